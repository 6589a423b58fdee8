"""What a logger is told to log: the registered variables, their options, and the script that sets them.

The part of `Logger` that knows nothing of runs, segments and helper processes. Changes take the lock of its life cycle
and are refused while the logger runs.
"""

import contextlib
import logging
import math
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsIndex

import numpy as np
from numpy.typing import DTypeLike, NDArray

from silo.core import units
from silo.core.arguments import line, switch, text
from silo.core.arguments import path as file_path
from silo.core.calls import present_words, told_class, unknown_argument
from silo.core.conditions import Conditions
from silo.core.elements import (
    DEFAULT_OPTIONS,
    OWN_SCRIPT,
    SCRIPT_OF_ALL,
    Edit,
    ElementInfo,
    ElementOptions,
    FieldChange,
    LoggerOptions,
    Problem,
    Storage,
    is_default_script,
    join_name,
)
from silo.core.kinds import STRUCT, struct_text
from silo.core.quantities.writing import many, size_text
from silo.core.runtime import available_memory_bytes
from silo.errors import ArgumentError, ElementError, ScriptError, SourceError, StateError
from silo.logger.arguments.keywords import AnyAction, AnyBuffer, ElementKeywords, Labels, Number, OptionKeywords, Switch
from silo.logger.arguments.options import (
    array_layout,
    edits_given,
    element_name,
    new_options,
    string_room,
    warn_of_end,
)
from silo.logger.arguments.other_names import tell_of_element
from silo.logger.conditions import LoggerConditions
from silo.logger.life_cycle import LifeCycle, WantedStretch
from silo.logger.registrations import Registrations
from silo.loop.plan import Element, time_buffer
from silo.loop.sources import OwnMemory, VariableSet
from silo.loop.types import as_numbers, describe, kind_of, label_map
from silo.segment.layout import STAMP_WORDS
from silo.segment.retention import buffer_bytes, kept_how, large_text, new_end_text
from silo.settings.options import refusal
from silo.settings.typed import ElementSettings, apply_settings, diff_options, rate_words, read_options

if TYPE_CHECKING:
    from typing_extensions import Unpack  # known to type checkers without being installed

_State = tuple[tuple[tuple[Element, ...], int], Conditions]  # elements and revision of the table, and conditions

BLOCK_BYTES = 1 << 18  # pages that are never used are never touched

log = logging.getLogger("silo")

MOST_TOLD_NAMES = 100  # that `log.q` tells of: each changes the class, 15 us, and who has more looks them up
MORE_AT_A_CUT_BYTES = 256_000_000  # which are touched within a second, while what other clients want waits
MOST_TOLD_CHANGES = 3  # of options, in the words of a cut


class Arena:
    """Grows by blocks; what was handed out never moves."""

    def __init__(self) -> None:
        self._block: OwnMemory | None = None
        self._size = self._used = 0

    def array(self, sizes: tuple[int, ...], kind: np.dtype[Any]) -> NDArray[Any]:
        """Zeros of this shape and type, aligned to 8 bytes. Raises SourceError where there is no memory for them."""
        count = math.prod(sizes) * kind.itemsize
        size = max(8, -(-count // 8) * 8)
        if self._block is None or self._used + size > self._size:
            try:
                self._block, self._size = OwnMemory(max(BLOCK_BYTES, size)), max(BLOCK_BYTES, size)
            except (OSError, OverflowError):
                raise SourceError(f"no memory for an array of shape {sizes} and type {kind}: {count} bytes") from None
            self._used = 0
        array: NDArray[Any] = np.ndarray(sizes, kind, self._block, self._used)
        self._used += size
        return array


@told_class("log")
class ScriptedTable:
    """The element table of a logger, and the script that sets it."""

    def __init__(
        self,
        options: LoggerOptions,
        table: Registrations,
        conditions: LoggerConditions,
        life: LifeCycle,
        owner: type | None = None,
        *,
        has_script: bool = True,
    ) -> None:
        """Begin with what the table has; `owner` is a class that is to tell what is meant by `log.q`.

        Without `has_script` none is read but by `load_script`.
        """
        self._options, self._table, self._conditions, self._life, self._owner = options, table, conditions, life, owner
        self._arena = Arena()
        self._values: dict[tuple[str, str], NDArray[Any]] = {}  # of `value`, by name and group
        self.is_updated = False
        self._has_script = self._reads_script = has_script
        self._said_late = False

    def adopt_late(self) -> None:
        """Make what was added after the last `update()` part of the table, as the script wants it; others stay."""
        self._said_late = False
        late = [element.info for element in self._table.pending]
        if not late:
            return
        options = [info.options for info in late]
        if self._reads_script and Path(self._options.script).exists():
            from silo.settings.script import apply_script, read_script

            script = read_script(Path(self._options.script))
            options = list(apply_script(script, late, self._options.frequency_hz).options)
        self._table.adopt()
        self._table.change({self._table.place(info.name): new for info, new in zip(late, options, strict=True)})

    def _take_in(self) -> None:
        """Make what was added part of the table, as a start does: what is asked for all is for these, too.

        Of a logger that runs the next start does. Raises ScriptError as `update` does.
        """
        if self._table.pending and not self._life.running:
            if self.is_updated:
                self.adopt_late()
            else:
                self.update()

    @property
    def lock(self) -> "threading.RLock":
        """That of table and state, which `collect()` never takes."""
        return self._life.lock

    @property
    def cutting(self) -> "threading.RLock":
        """That of who starts or cuts, taken before the other one."""
        return self._life.cutting

    @property
    def revision(self) -> int:
        """Grows with every change of the table."""
        return self._table.revision

    @property
    def elements(self) -> list[ElementInfo]:
        """The rows of the table."""
        return self._table.infos

    @property
    def given(self) -> dict[str, ElementOptions]:
        """The options that the program gave elements which have others now by a client's wish."""
        return self._table.given

    def problems(self, edits: Iterable[Edit]) -> list[Problem]:
        """Return why edits can't be applied, one per field; empty when they can."""
        return self._table.problems(
            edits_given(edits, self._table.infos, self._table.prefix, self._options.frequency_hz)
        )

    # --------------------------------------------------------------------------------------------- registering

    def add(
        self,
        source: object,
        name: str | None = None,
        group: str = "",
        unit: str = "-",
        divider: Number = DEFAULT_OPTIONS.divider,
        action: AnyAction = DEFAULT_OPTIONS.action,
        size: Number | None = None,
        buffer: AnyBuffer = DEFAULT_OPTIONS.buffer,
        *,
        attr: str | None = None,
        enabled: Switch = DEFAULT_OPTIONS.enabled,
        kind: str = "",
        labels: Labels | None = None,
        description: str = "",
        string_bytes: SupportsIndex | None = None,
        limits: Sequence[float | None] | None = None,
    ) -> None:
        """Register a variable; it is part of the table after the next `update()` or `start()`.

        Options are values, or words as `silo set` takes them.

        Args:
            source: a NumPy array (any shape, strides and dtype), ctypes object, array.array, memoryview or mmap, read
                by reference; an object with `attr`, read each due tick; a function without arguments; a dataclass, a
                registered type, or a list, tuple or dict of such; what `silo.mujoco` tells of a simulation.
            name: its name after prefix and group, or whole with the prefix. May be left out where `attr` gives one.
            group: the namespace between prefix and name.
            unit: `"Nm"`, `"rad/s"`, `"-"` for none.
            divider: collected at ticks 0, d, 2d, ...; or a rate (`"50Hz"`).
            action: `"save"`, `"publish"`, `"both"`.
            size: samples, or words (`"10s"`, `"10k"`); what `max_time` takes if it isn't given.
            buffer: `"looping"` keeps the newest samples, `"fixed"` the first, `"growing"` all.
            attr: a dotted path to an attribute of `source`.
            enabled: whether it is logged.
            kind: how numbers belong together, in their order in memory (`quaternion`, `quaternion_wxyz`, `angle_axis`,
                `pose`, `twist`, `vector_at_position(A, B)`, `array` for plain indices; `components(FL_hip, FL_knee)`
                names each).
            labels: names of an integer's values: an enumeration, or a mapping.
            description: a line about it, kept in files.
            string_bytes: room for a string, in bytes; for each of several as many letters.
            limits: (red_low, yellow_low, yellow_high, red_high), as `log.limit` takes them.

        Raises:
            SourceError: it can't be logged; the message says what to write instead.
            ElementError: a name is taken, a value is out of range; nothing was added.
        """
        self._life.check_open()
        if isinstance(source, VariableSet):
            own = {"name": name, "unit": unit, "attr": attr, "kind": kind, "labels": labels, "limits": limits}
            shared = {"divider": divider, "action": action, "size": size, "buffer": buffer, "enabled": enabled}
            self._add_each(source, own, group, description=description, **shared)
            return
        name = element_name(source, name, attr)
        group, unit = text("group", group, 'group="joints"'), line("unit", "-" if unit is None else unit, 'unit="Nm"')
        kind, description = text("kind", kind, 'kind="pose"'), text("description", description, 'description="..."')
        room = string_room(string_bytes)
        full = join_name(self._options.prefix, group, name)
        options = new_options(
            full, self._options.frequency_hz, self._options.max_time_s, enabled, divider, action, buffer, size
        )
        parts = describe(source, full, attr=attr, kind=kind, labels=label_map(labels), string_bytes=room)
        entries = parts[0].entries() if len(parts) == 1 else tuple(one for part in parts for one in part.entries())
        if labels and not any(entry.labels for entry in entries):
            raise ElementError(
                f"element '{full}': labels name the values of integers, and it has none; leave them out, or log an int"
            )
        first = parts[0].source
        single = len(parts) == 1
        info = ElementInfo(
            name=full,
            unit=self._table.unit(full, unit),
            kind=kind_of(first.dtype, first.shape, kind) if single else STRUCT.name,
            shape=first.shape if single else (),
            entries=entries,
            options=options,
            description=description,
            dtype=struct_text(first.dtype) if single else "",
        )
        with self._life.lock:
            conditions = None if limits is None else self._conditions.with_limits(info, limits)
            self._table.add(Element(info, tuple(parts)))
            if conditions is not None:
                self._conditions.take(conditions)
        if isinstance(divider, str):
            self._tell_rate(full, read_options({"divider": divider}, full), options.divider)
        if self._owner is not None and len(self._table.elements) + len(self._table.pending) <= MOST_TOLD_NAMES:
            tell_of_element(self._owner, full.rpartition("/")[2])
        if unit == "-" and len(group) > 1 and units.size(group) is not None:
            log.warning("element '%s': '%s' is its group, is it meant as a unit? write unit='%s'", full, group, group)
        if any(letter.isspace() for letter in full):
            log.warning(
                "element '%s': its name holds a blank: silo reads its files, the readers of signal_logger read none "
                "that has it; write '%s'", full, "_".join(full.split()),
            )  # fmt: skip
        if self._life.running and not self._said_late:
            self._said_late = True
            log.warning(
                "%s was added while the logger runs: it is logged from the next start on, as all that is added now",
                full,
            )

    def _add_each(self, variables: VariableSet, own: Mapping[str, object], group: str, **options: Any) -> None:
        """Add variables that have names and units of their own, or none of them."""
        given = next((word for word, value in own.items() if value not in (None, "", "-")), "")
        if given:
            raise ElementError(
                f"log.add({variables.origin}(...)): {given}= is each variable's own; group, divider, action, size, "
                "buffer, enabled and description hold for all. log.limit and log.set change one"
            )
        added: list[str] = []
        with self._life.lock:
            try:
                for one in variables.each:
                    place = f"{group}/{one.name}"
                    self.add(one.source, place, unit=one.unit, kind=one.kind, **options)
                    added.append(join_name(self._options.prefix, "", place))
            except ElementError:
                for name in added:
                    self._table.remove(name)
                raise

    def _tell_rate(self, name: str, asked: ElementSettings, divider: int) -> None:
        """Tell what became of a rate that no divider gives."""
        if words := rate_words(asked, divider, self._options.frequency_hz):
            log.warning("element '%s': %s", name, words)

    def array(
        self,
        name: str,
        shape: SupportsIndex | Sequence[SupportsIndex] = (),
        dtype: DTypeLike = float,
        **options: "Unpack[ElementKeywords]",
    ) -> NDArray[Any]:
        """Make a variable in silo's own memory and register it.

        The fastest way: all such variables are one memory copy per tick.

        Args:
            name: its name after prefix and group, or whole with the prefix.
            shape: a number, or several; `()` for a scalar, set by `x[...] = 1`.
            dtype: of one value.
            **options: the keywords of `add`.

        Returns:
            Zeros of this shape and type. Write into them, don't replace them.

        Raises:
            ArgumentError: an option that `add` doesn't have.
            ElementError: as `add`.
        """
        self._life.check_open()
        text("the element's name", name, 'log.array("q", 12)')
        keywords = present_words(options, ElementKeywords.__annotations__)
        wrong = next((key for key in keywords if key not in ElementKeywords.__annotations__), "")
        if wrong:
            raise ArgumentError(
                unknown_argument("log.array", wrong, ["shape", "dtype", *ElementKeywords.__annotations__])
            )
        made = self._arena.array(*array_layout(shape, dtype))
        self.add(made, name, **keywords)
        return made

    def value(self, name: str, value: object, **options: "Unpack[ElementKeywords]") -> None:
        """Log what has no memory that stays: a number, a tensor, a result. Once per tick, or now and then.

        `log.value("cost", cost)`: the first call registers the element, each writes its value, which holds until the
        next. A run logs what was registered when it began: call it before `start()`, too. Numbers are float64; arrays
        and tensors (of NumPy, torch, JAX ..., also on a GPU) keep type and shape.

        Args:
            name: its name after prefix and group, or whole with the prefix.
            value: a number, or what NumPy can make an array of numbers of.
            **options: the keywords of `add`, of the first call.

        Raises:
            SourceError: it is no number and no array of numbers.
            ElementError: it has another shape than the first one, or a type that can't be kept in it.
        """
        made = self._values.get((name, options.get("group", "")))
        if made is not None and (
            (type(value) is float and not made.shape and made.dtype.char == "d")
            or (type(value) is np.ndarray and value.shape == made.shape and value.dtype == made.dtype)
        ):  # as it was before: what follows would say the same, in several times the time
            made[...] = value
            return
        given = as_numbers(name, value)
        if made is None:
            made = self.array(name, given.shape, given.dtype, **options)
            self._values[name, options.get("group", "")] = made
        if given.shape != made.shape or not np.can_cast(given.dtype, made.dtype, "same_kind"):
            raise ElementError(
                f"log.value({name!r}, ...) began with {made.dtype} of shape {made.shape}, got {given.dtype} of shape "
                f"{given.shape}: give another name to what is something else; nothing was changed"
            )
        made[...] = given

    def update(self, *, read_script: bool = True) -> None:
        """Make what was added part of the table, and read the script if it exists.

        Args:
            read_script: False leaves the script out.

        Raises:
            StateError: the logger runs.
            ScriptError: the script has problems, one per line; nothing is changed then.
        """
        read_script = switch("read_script", read_script) and self._has_script
        with self._life.lock:
            self._life.check_stopped("update the table")
            self._table.adopt()
            if read_script and Path(self._options.script).exists():
                try:
                    self._load(Path(self._options.script), by_update=True)
                except ScriptError as error:
                    if not self._is_default_script:
                        raise
                    raise ScriptError(
                        f"{error} (the script of who names none, read at the start: mend or remove it, name another by "
                        "silo.Logger(script=...), None for none, or leave it out by log.update(read_script=False))"
                    ) from None
            elif read_script and not self.is_updated and not self._is_default_script:
                log.warning(
                    "%s: there is no script %s, all elements are logged as the program says (log.save_script() writes "
                    "one, e w in silo-tui too)", self._options.name, self._options.script,
                )  # fmt: skip
            self.is_updated, self._reads_script = True, read_script
            self._life.tell()

    # ------------------------------------------------------------------------------------------------- options

    def set(self, name: str = "/", *, cut: bool = False, **options: "Unpack[OptionKeywords]") -> int:
        """Change options of an element or of a whole namespace, all or none.

        `log.set("joints", divider="50Hz", size="10s", action="both")`

        With `cut=True` also while the logger runs: from its next tick on it goes on as changed, in another stretch
        with buffers of its own. What was logged until then is a file of its own (`..._part1`), which the helper
        process saves at once, or the next `save()`; `silo.open_log` reads all stretches as one log.

        Args:
            name: an element or a namespace; all elements if it is left out.
            cut: change it while the logger runs, too.
            **options: enabled, divider, action, buffer, size, as values or as words that `silo set` takes.

        Returns:
            How many elements changed.

        Raises:
            StateError: the logger runs (without `cut`), or can't be cut now.
            SegmentError: there is no room for another stretch; nothing was changed.
            ElementError: an unknown name, a value out of range; nothing was changed.
            ScriptError: elements that were just added are taken in, and the script has problems.
        """
        text("the element's or namespace's name", name, 'log.set("joints", divider=5), one call for each')
        with self._changing(cut=switch("cut", cut)):
            self._take_in()
            places = self._table.select(name)
            rows = [(info.name, info.options) for info in (self._table.elements[place].info for place in places)]
            settings = read_options(options, rows[0][0] if rows else "")
            made = apply_settings(settings, rows, self._options.frequency_hz)
            changed = self._table.change(dict(zip(places, made, strict=True)))
            if made:
                self._tell_rate(rows[0][0], settings, made[0].divider)
            self._warn_of_size(changed)
            return changed

    @contextlib.contextmanager
    def _changing(self, who: str = "", *, cut: bool, what: str = "change elements") -> Iterator[None]:
        """Have table and conditions changed by what is done within: of a logger that stands still, or else (`cut`)
        while it runs, at a cut where elements change. `what` can't be done otherwise.
        """
        with self._life.cutting if cut else contextlib.nullcontext():
            with self._life.lock:
                if cut and not who:
                    self._life.go_before_clients()
                runs, before = cut and self._life.running, self._state
                if not runs:
                    self._life.check_stopped(what)
                infos = self._table.infos
                cuts = False
                try:
                    yield
                    changes = diff_options(infos, [info.options for info in self._table.infos]) if runs else []
                    if not changes:
                        self._life.tell()
                        return
                    cuts = True  # all of it is to be, or nothing
                    wanted = self._wanted(changes, who, before)
                except BaseException:
                    cuts = runs
                    raise
                finally:
                    if cuts:
                        self._state = before
            self._life.cut(wanted)  # without the lock: others look, and stop the logger, while it is prepared
            after = kept_how(element.info for element in wanted.elements)
            warn_of_end(self._options, new_end_text(kept_how(infos), after, self._options.max_time_s))

    @property
    def _state(self) -> _State:
        return self._table.state, self._conditions.now

    @_state.setter
    def _state(self, state: _State) -> None:
        self._table.state, self._conditions.now = state

    def _wanted(self, changes: Sequence[FieldChange], who: str, before: _State) -> WantedStretch:
        """Return what a cut is to bring: table and conditions as they are now, which were others `before`."""
        (elements, revision), conditions = self._state
        (elements_before, revision_before), conditions_before = before
        told = [f"{one.name} {one.field} {one.old} -> {one.new}" for one in changes]
        more = [f"and {len(told) - MOST_TOLD_CHANGES} more"] if len(told) > MOST_TOLD_CHANGES else []

        def check() -> None:
            others = conditions is not conditions_before and self._conditions.now is not conditions_before
            if others or self._table.elements is not elements_before:
                raise StateError(
                    f"limits, triggers or derived signals of logger '{self._options.name}' were changed by others just "
                    "when it was to be cut: nothing was changed, try again"
                )

        def take() -> None:
            self._table.state = elements, self._table.revision + revision - revision_before
            if conditions is not conditions_before:
                self._conditions.now = conditions

        what = "; ".join(told[:MOST_TOLD_CHANGES] + more)
        return WantedStretch(what, who or self._options.name, elements, conditions, check, take)

    def _buffers_take(self) -> int:
        infos, options = self._table.infos, self._options
        stamps = time_buffer([info.options for info in infos], options.frequency_hz, options.max_time_s)
        return sum(map(buffer_bytes, infos)) + 8 * STAMP_WORDS * stamps.size

    def _no_room(self, before: int) -> str:
        """Say why a client may not have the buffers take what they do now: memory is touched when a stretch begins."""
        total, most = self._buffers_take(), self._life.memory_bytes() + available_memory_bytes() // 2
        why = "what they have, and half of the memory that is free here): make them smaller, or set them in the program"
        if self._life.running and most > before + MORE_AT_A_CUT_BYTES:
            most = before + MORE_AT_A_CUT_BYTES
            why = f"{size_text(MORE_AT_A_CUT_BYTES)} more while the logger runs): stop, change, start"
        if total <= max(before, most) or self._options.storage is Storage.FILE:
            return ""
        return f"the buffers would take {size_text(total)}, from a client {size_text(most)} at most ({why}"

    def _warn_of_size(self, changed: int) -> None:
        if changed and (large := large_text(self._table.infos)):
            log.warning("%s: %s", self._options.name, large)

    def remove(self, name: str) -> int:
        """Forget an element or a whole namespace.

        Its samples of the last run stay until the next start.

        Args:
            name: an element or a namespace.

        Returns:
            How many elements went.

        Raises:
            StateError: the logger runs.
            ElementError: an unknown name; nothing was removed.
        """
        text("the element's or namespace's name", name, 'log.remove("joints/q")')
        with self._life.lock:
            self._life.check_stopped("remove elements")
            if not name.strip(" /"):
                raise ElementError("remove what? log.remove('/') would be everything: name an element or a namespace")
            gone = self._table.remove(name)
            self._life.tell()
            return gone

    def apply(
        self,
        edits: Sequence[Edit],
        conditions: Conditions | None = None,
        *,
        cut: bool = False,
        who: str = "",
        check: Callable[[], None] = lambda: None,
    ) -> int:
        """Apply edits as one transaction, all or none, with `conditions` in the place of all; how many changed.

        `check` may refuse it first, by what the table is then.

        These fit the table as it is then (`silo.state.server.fitting`): to find that out takes longer than a loop may
        wait, and is done elsewhere.

        `cut`: also while the logger runs, as `set`, for whom is `who`. Raises StateError, SegmentError, ElementError
        with a line for each reason: nothing was changed.
        """
        with self._changing(who, cut=cut):
            check()
            edits = edits_given(edits, self._table.infos, self._table.prefix, self._options.frequency_hz)
            problems = self._table.problems(edits)
            if problems:
                raise ElementError(refusal(problems))
            size, state = self._buffers_take(), self._table.state
            changed = self._table.apply(edits, by_client=bool(who))
            if who and (why := self._no_room(size)):
                self._table.state = state
                raise ElementError(f"{why}; nothing was changed")
            if conditions is not None:
                self._conditions.take(conditions)
            self._warn_of_size(changed)
            return changed

    def load_script(self, path: str | os.PathLike[str] | None = None, *, cut: bool = False) -> list[str]:
        """Configure all elements by a script.

        Args:
            path: the script; the logger's own if it is left out.
            cut: load it while the logger runs, too, which goes on as changed, as by `set`.

        Returns:
            The names in it that the table lacks.

        Raises:
            StateError: the logger runs (without `cut`), or can't be cut now.
            SegmentError: there is no room for another stretch; nothing is changed.
            ScriptError: the script has problems, one per line; nothing is changed then.
        """
        return self._load(self._script_path(path), cut=switch("cut", cut))

    def _load(self, file: Path, *, cut: bool = False, by_update: bool = False) -> list[str]:
        """Do what `load_script` does; by an update, or as the first of a logger, what is gone of it is left out."""
        from silo.settings.script import apply_script, read_script, script_conditions

        with self._changing(cut=cut, what="load a script"):
            if self.is_updated or file != Path(self._options.script):
                self._take_in()
            else:
                self._table.adopt()
            script = read_script(file)
            plan = apply_script(script, self._table.infos, self._options.frequency_hz, self._options.prefix)
            prefix, frequency_hz = self._options.prefix, self._options.frequency_hz
            at_start, left_out = not self.is_updated and file == Path(self._options.script), list[str]()
            conditions = script_conditions(
                script, self._conditions.now, self._table.infos, plan, prefix, frequency_hz,
                left_out=left_out if at_start or by_update else None,
            )  # fmt: skip
            if at_start:
                self._tell_applied(file, plan.options, conditions)
            self._table.change(dict(enumerate(plan.options)))
            self._conditions.take(conditions)
            self.is_updated = self.is_updated or file == Path(self._options.script)  # an update would read no other
        for warning in (*script.warnings, *plan.rates, *left_out):
            log.warning("%s", warning)
        for unknown in plan.unknown:
            log.warning("%s:%s; it is left out", file, unknown)
        return [unknown.name for unknown in plan.unknown]

    @property
    def _is_default_script(self) -> bool:
        return is_default_script(Path(self._options.script).name)

    def _tell_applied(self, file: Path, wanted: Sequence[ElementOptions], conditions: Conditions) -> None:
        """Tell what the logger's own script changes of what its program says; runs keep it in what is known of them.

        A script that nobody named may have been left in this folder by another program.
        """
        from silo.settings.script_conditions import conditions_text

        pairs = [(info.options, new) for info, new in zip(self._table.infos, wanted, strict=True)]
        changed = sum(old != new for old, new in pairs)
        off = sum(old.enabled and not new.enabled for old, new in pairs)
        switched = f", {off} of them switched off" if off else ""
        told = [f"{changed} of {many(len(pairs), 'element')} changed{switched}"]
        if conditions != self._conditions.now:
            told.append(f"then {conditions_text(conditions)}")
        words = "; ".join(told)
        self._options.about.setdefault("script", f"{file.absolute()}: {words}")
        is_news = (changed or len(told) > 1) and file.name == SCRIPT_OF_ALL
        log.log(
            logging.WARNING if is_news else logging.INFO,
            "%s: script %s is applied: %s%s", self._options.name, file.absolute(), words,
            f" (whoever saved it: all loggers of this folder that name no script read it; as {self._options.name}"
            f"{OWN_SCRIPT} it is this one's alone; silo.Logger(script=...) names another, None none)" * is_news,
        )  # fmt: skip

    def save_script(self, path: str | os.PathLike[str] | None = None) -> Path:
        """Write the configuration of every element to a script, whole or not at all.

        Keys of a script that stands there already and that silo doesn't know are kept; so are, in the logger's own
        script, elements that were not added this time.

        Args:
            path: the script; the logger's own if it is left out.

        Returns:
            Its path.

        Raises:
            ScriptError: the system refuses, or the script of elements that are new to the table has problems.
        """
        from silo.settings.script import write_script

        self._life.check_open()
        with self._life.lock:
            self._take_in()  # with what its own script says, which is not to be lost
        target = self._script_path(path)
        own = target.resolve() == Path(self._options.script).resolve()
        kept = write_script(target, self._table.infos, self._conditions.now, own=own, prefix=self._options.prefix)
        if kept:
            log.warning("%s: script saved%s", target, kept)
        return target

    def _script_path(self, given: str | os.PathLike[str] | None) -> Path:
        return Path(self._options.script) if given is None else file_path("path", given)

"""What a program gets of its own logger: an element, new values, the table, saved files."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NoReturn, SupportsIndex, overload

import numpy as np
from numpy.typing import NDArray

from silo.core.calls import no_attribute, told_names
from silo.core.elements import ElementInfo, ElementOptions, SavedFile
from silo.core.kinds import in_parts
from silo.core.names import Names
from silo.core.quantities.writing import MOST_ROWS, html_table, many
from silo.errors import ArgumentError, StateError, UnknownNameError
from silo.loop.run import Run
from silo.segment.layout import ElementSchema
from silo.segment.picking import Packer, shaped
from silo.segment.reader import SegmentReader
from silo.segment.retention import kept_rows
from silo.segment.rows import Rows

_ALL = "log[{!r}].newest is the newest value, silo.Log(log.snapshot())[{!r}].values are all"
_NEWEST = "it is .newest"
_OPTION = "it is .options.{}; log.set({!r}, ...) changes it"
_INFO = "it is .info.{}"
_OF_NEW_VALUES = {
    "value": "they are .values, oldest first; the newest alone is log['x'].newest",
    "data": "they are .values",
    "newest": "it is .values[-1], or log['x'].newest",
    "time": "it is .time_ns",
    "times": "it is .time_ns",
    "timestamps": "it is .time_ns",
    "lost": "it is .missed",
}


@told_names("an element", fixed="log.set('x', divider=3) changes how it is logged, x[:] = ... the array that was added")
@dataclass(frozen=True, eq=False)
class LoggedElement:
    """What `log["joints/q"]` returns: a row of the table, and what the present run holds of it at this moment.

    Attributes:
        info: the row of the table.
        newest: the last logged value, of the element's shape; None before the first sample, and for an element that
            isn't logged in this run.
        time_ns: its time stamp, ns; None where `newest` is.
        held: how many samples are in its buffer.
        lost: how many could not be kept.
        failures: at how many ticks it could not be read; attributes and functions alone can fail.
    """

    info: ElementInfo
    newest: Any = None
    time_ns: int | None = None
    held: int = 0
    lost: int = 0
    failures: int = 0

    @property
    def name(self) -> str:
        """The full name."""
        return self.info.name

    @property
    def unit(self) -> str:
        """The unit, `-` for none."""
        return self.info.unit

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of one sample."""
        return self.info.shape

    @property
    def options(self) -> ElementOptions:
        """How it is logged."""
        return self.info.options

    if not TYPE_CHECKING:  # type checkers find it themselves

        def __getattr__(self, name: str) -> NoReturn:
            mine = self.info.name if "info" in self.__dict__ else ""
            others = dict.fromkeys(("values", "data", "samples", "history", "array"), _ALL.format(mine, mine))
            others |= dict.fromkeys(("value", "latest", "last", "current", "now"), _NEWEST)
            others |= dict.fromkeys(("time", "times", "t", "stamp"), "it is .time_ns")
            others |= dict.fromkeys(("count", "samples_held", "size"), "it is .held")
            options = ("divider", "action", "buffer", "size", "enabled")
            others |= {one: _OPTION.format(one, mine) for one in options}
            others |= {one: _INFO.format(one) for one in ("kind", "dtype", "description", "entries")}
            no_attribute("an element", name, type(self), others)

    def __getitem__(self, key: object) -> NoReturn:
        mine = self.info.name
        raise ArgumentError(f"an element has no [{key!r}]: log[{mine!r}].newest[{key!r}]; {_ALL.format(mine, mine)}")

    def __repr__(self) -> str:
        unit = "" if self.unit == "-" else f" [{self.unit}]"
        return f"<Element {self.name}{unit} {options_text(self.options)}, {self.held} held, newest {newest_text(self)}>"


class Elements(list[ElementInfo]):
    """The rows of the element table, by number or by name: `log.elements["joints/q"]`."""

    def __init__(self, infos: Iterable[ElementInfo] = (), prefix: str = "") -> None:
        super().__init__(infos)
        self._prefix = prefix

    def __call__(self, *_: object) -> NoReturn:
        """Nobody calls it: raises ArgumentError."""
        raise ArgumentError(".elements is no method: write log.elements, of which log.elements['joints/q'] is one")

    @property
    def known(self) -> Names:
        """What the names of the rows mean."""
        return Names((info.name for info in self), self._prefix)

    @overload
    def __getitem__(self, key: SupportsIndex | str) -> ElementInfo: ...
    @overload
    def __getitem__(self, key: slice) -> list[ElementInfo]: ...
    def __getitem__(self, key: SupportsIndex | slice | str) -> ElementInfo | list[ElementInfo]:
        if not isinstance(key, str):
            return super().__getitem__(key)
        found = self.known.find(key, namespaces=False)
        if len(found) == 1:
            return super().__getitem__(found[0][0])
        if found:
            raise UnknownNameError(self.known.several(key, found))
        raise UnknownNameError(f"no element '{key}'{self.known.hint(key, f'list(log) has all {len(self)}')}")


@told_names("saved files", dict.fromkeys(("name", "filename", "file"), "it is .path"))
class SavedFiles(list[SavedFile]):
    """The files of one save, in the order of their types; of a single one, `path` and `size_bytes` are its own."""

    def __fspath__(self) -> str:
        return self.path

    @property
    def path(self) -> str:
        """Where the file is. Raises `ArgumentError` where it is not one."""
        return self._only("path").path

    @property
    def size_bytes(self) -> int:
        """How much it takes. Raises `ArgumentError` where it is not one file."""
        return self._only("size_bytes").size_bytes

    def _only(self, what: str) -> SavedFile:
        if len(self) != 1:
            raise ArgumentError(f"{len(self)} files were saved: [file.{what} for file in saved] has it of each")
        return self[0]


def options_text(options: ElementOptions) -> str:
    """Options in a few words: `every 2nd tick, save, looping 100`."""
    every = "" if options.divider == 1 else f"divider {options.divider}, "
    off = "" if options.enabled else "off, "
    return f"{off}{every}{options.action.name.lower()}, {options.buffer.name.lower()} {options.size}"


def newest_text(element: LoggedElement) -> str:
    """The newest value on one line."""
    if element.time_ns is None:
        return "none"
    return np.array2string(np.asarray(element.newest), precision=6, threshold=8, separator=", ").replace("\n", "")


def look_at(info: ElementInfo, reader: SegmentReader, failures: int = 0) -> LoggedElement:
    """Return what a run holds of an element."""
    schema = next((one for one in reader.schema.elements if one.info.name == info.name), None)
    if schema is None:
        return LoggedElement(info)
    head = reader.head(schema.ring)
    begin, end = kept_rows(schema.info.options, 0, head)
    found = LoggedElement(info, held=end - begin, lost=reader.ring_lost(schema.ring), failures=failures)
    rows = reader.rows(schema.ring, end - 1, 1) if end > begin else None
    if rows is None or not len(rows):
        return found
    return replace(found, newest=sample_values(schema, rows)[-1], time_ns=int(rows.time_ns[-1]))


def as_html(title: str, names: Sequence[str], element: Callable[[str], LoggedElement]) -> str:
    """The first elements as a table, for notebooks."""
    rows = [
        (one.name, one.unit, "on" if one.options.enabled else "off", one.options.divider,
         one.options.action.name.lower(), f"{one.options.buffer.name.lower()} {one.options.size}",
         one.held, newest_text(one))
        for one in (element(name) for name in names[: MOST_ROWS + 1])
    ]  # fmt: skip
    heads = ("element", "unit", "log", "divider", "action", "buffer", "held", "newest")
    more = f"{many(len(names), 'element')} in all" if len(names) > MOST_ROWS else ""
    return html_table(title, heads, rows[:MOST_ROWS], more)


@told_names("new values", _OF_NEW_VALUES)
@dataclass(frozen=True)
class NewValues:
    """Samples of one element, oldest first.

    `time_ns` has shape `(n,)`. `values` has shape `(n, *shape)` where all entries have one type, else it is a
    structured array of shape `(n,)` with a field per suffix. `missed` counts samples overwritten before they were read.
    """

    time_ns: NDArray[np.int64]
    values: NDArray[Any]
    missed: int

    def __repr__(self) -> str:
        missed = f", {self.missed} missed" if self.missed else ""
        return f"<NewValues {len(self)} of {self.values.dtype} {self.values.shape[1:]}{missed}>"

    def __len__(self) -> int:
        return len(self.time_ns)

    def __getitem__(self, place: object) -> NoReturn:
        # what unpacking and iterating come to as well
        raise ArgumentError("new values are two arrays: new = log.read_new_values('x'), then new.time_ns, new.values")


class NewValuesReader:
    """Remembers up to where each element of a run was read."""

    def __init__(self) -> None:
        self._run = ""
        self._next: dict[str, int] = {}
        self._elements: dict[str, ElementSchema] = {}

    def read(self, run: Run, name: str) -> NewValues:
        """Raise StateError for an element that isn't logged in this run."""
        reader = run.reader
        if run.id != self._run:
            self._run, self._next = run.id, {}
            self._elements = {element.info.name: element for element in reader.schema.elements}
        if name not in self._elements:
            raise StateError(f"element '{name}' is not logged in this run: enable it and start again")
        element = self._elements[name]
        since = self._next.get(name, 0)
        rows = reader.rows(element.ring, since)
        begin, end = kept_rows(element.info.options, rows.first, rows.first + len(rows))
        begin, end = max(begin, since), max(end, since)
        self._next[name] = end
        kept = rows.part(begin, end)
        return NewValues(kept.time_ns.copy(), sample_values(element, kept), begin - since)


def sample_values(element: ElementSchema, rows: Rows) -> NDArray[Any]:
    """Return the samples in rows, shape `(n, *shape)`, or a structured array of shape `(n,)` where types differ."""
    packer = Packer(element.entries, [entry.entry.suffix.removeprefix("_") for entry in element.entries])
    return shaped(
        packer.of(rows.words),
        element.info.shape,
        parts=in_parts(element.info.kind, element.info.shape, element.info.entries),
    )

"""The logging script: the YAML file that says how each element is logged.

Reading checks everything before anything is changed: all problems of a file come in one `ScriptError`, each with its
line. Writing gives the layout of the original. Used by the logger, the helper process, the command line and the TUI;
knows no logger.
"""

import contextlib
import itertools
import json
import os
import re
import stat
import textwrap
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec
import yaml

from silo.core.conditions import NO_CONDITIONS, Conditions
from silo.core.elements import ElementInfo, ElementOptions
from silo.core.names import Names, did_you_mean, grouped
from silo.core.quantities.writing import and_more
from silo.errors import SaveError, ScriptError, reason
from silo.settings.options import IN_SCRIPT, OptionValue
from silo.settings.script_conditions import (
    Lines,
    fitting_conditions,
    format_conditions,
    kinds_of,
    merged,
    with_left_out,
)
from silo.settings.script_reader import Reader, ScriptElement, UnknownKey
from silo.settings.typed import ElementSettings, rate_words
from silo.settings.yaml_nodes import Pair, collector_paused, compose, explain, text_of

MAX_SCRIPT_BYTES = 8 * 2**20  # about 60,000 elements; libyaml reads 1 - 2 MB/s
MAX_PROBLEMS = 50
MAX_SUGGESTIONS = 10  # a close match in a table of 10,000 names takes up to 0.2 s

_PLAIN_NAME = re.compile(r"/(?:[A-Za-z0-9_./\-+~@=()<>\[\]]*[A-Za-z0-9_./\-+~@=()<>\[\]])?")
_NOT_PRINTABLE = re.compile("[\x7f-\x9f\u2028\u2029\ufeff\ufffe\uffff]")


@dataclass(frozen=True)
class Script:
    """A script that was read and found valid in itself; names are not yet held against a table."""

    path: Path
    elements: tuple[ScriptElement, ...]
    unknown_keys: tuple[UnknownKey, ...] = ()
    conditions: Conditions | None = None  # None where the script says nothing of them
    kinds: frozenset[str] = frozenset()  # keys of them that it has
    condition_lines: Lines = field(default_factory=dict)
    lists_elements: bool = True  # without that key they stay as they are

    @property
    def warnings(self) -> list[str]:
        """`file:line: reason` of what was left alone, and what is off by a missing key, `MAX_PROBLEMS` of each."""
        shown = [f"{self.path}:{key.line}: {key.text}; it was left alone" for key in self.unknown_keys[:MAX_PROBLEMS]]
        more = len(self.unknown_keys) - MAX_PROBLEMS
        shown += [f"{self.path}: and {more} more unknown keys"] if more > 0 else []
        off = [element for element in self.elements if "enabled" not in element.asked]
        shown += [
            f"{self.path}:{one.line}: element '{one.name}' is off, as it has no key 'enabled': write `enabled: true`"
            for one in off[:MAX_PROBLEMS]
        ]
        return shown + ([f"{self.path}: and {len(off) - MAX_PROBLEMS} more"] if len(off) > MAX_PROBLEMS else [])

    def conditions_beside(self, now: Conditions) -> Conditions:
        """Return the conditions that it leads to where there are these: kinds that it doesn't speak of stay."""
        return now if self.conditions is None else merged(self.conditions, self.kinds, now)


@dataclass(frozen=True)
class UnknownName:
    """A name of a script that the table lacks, with the nearest name of the table (may be empty)."""

    name: str
    line: int
    suggestion: str = ""

    def __str__(self) -> str:
        return f"{self.line}: no element '{self.name}'{did_you_mean([self.suggestion] if self.suggestion else [])}"


@dataclass(frozen=True)
class ScriptPlan:
    """What a script makes of a table: options in the table's order, and the names that the table lacks."""

    options: tuple[ElementOptions, ...]
    unknown: tuple[UnknownName, ...]
    rates: tuple[str, ...] = ()  # what became of rates that no divider gives, each with file and line


# ------------------------------------------------------------------------------------------------------------ reading


def read_script(path: str | os.PathLike[str]) -> Script:
    """Read and check the script at `path`. Raises `ScriptError` with one `file:line: reason` per problem."""
    path = Path(path)
    try:
        if path.exists() and not path.is_file():
            raise ScriptError(f"{path}: this is a folder or a device, not a script; give the path of a YAML file")
        with path.open("rb") as file:
            data = file.read(MAX_SCRIPT_BYTES + 1)
    except FileNotFoundError:
        way_out = "check the path, or write one with `silo script save`"
        raise ScriptError(f"{path}: no such file (looked for {path.absolute()}); {way_out}") from None
    except OSError as error:
        raise ScriptError(f"{path}: can't be read: {reason(error)}") from error
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        why = f"byte 0x{data[error.start]:02x} is not UTF-8; save the file as UTF-8"
        raise ScriptError(f"{path}:{line}: {why}; nothing was changed") from None
    return parse_script(text, path)


def parse_script(text: str, path: str | os.PathLike[str]) -> Script:
    """Check the text of a script; `path` only stands in messages. Raises `ScriptError` like `read_script`."""
    path = Path(path)
    if len(text) > MAX_SCRIPT_BYTES:
        limit = f"{MAX_SCRIPT_BYTES // 2**20} MB"
        raise ScriptError(f"{path}: larger than {limit}, which is too much for a script; nothing was changed")
    reader = Reader()
    elements: tuple[ScriptElement, ...] = ()
    with collector_paused():
        try:
            root = compose(text)
        except yaml.YAMLError as error:
            reader.report(*explain(error, text))
        else:
            elements = tuple(reader.elements(root))
    if reader.problems:
        raise ScriptError(_message(path, reader.problems + [(key.line, key.text) for key in reader.unknown]))
    return Script(
        path, elements, tuple(reader.unknown), reader.conditions, reader.kinds, reader.condition_lines,
        reader.lists_elements,
    )  # fmt: skip


def _message(path: Path, problems: Sequence[tuple[int, str]]) -> str:
    lines = [f"{path}:{line}: {text}" if line else f"{path}: {text}" for line, text in problems[:MAX_PROBLEMS]]
    if len(problems) > MAX_PROBLEMS:
        lines.append(f"{path}: and {len(problems) - MAX_PROBLEMS} more problems")
    return "\n".join(lines) + "; nothing was changed"


# ----------------------------------------------------------------------------------------------------------- applying


def apply_script(script: Script, table: Sequence[ElementInfo], frequency_hz: float, prefix: str = "") -> ScriptPlan:
    """Options of every element of `table` under `script`, in a logger of `frequency_hz`; changes nothing.

    A key that is missing keeps the element's setting, except that a listed element without `enabled` is disabled. An
    element that isn't listed is enabled. Names that the table lacks are returned, not errors, with
    what is most like them beside the `prefix` that all have. Raises `ScriptError` where a time or a rate gives a number
    out of range.
    """
    if not script.lists_elements:
        return ScriptPlan(tuple(info.options for info in table), ())
    listed = {element.name: element for element in script.elements}
    options: list[ElementOptions] = []
    problems: list[tuple[int, str]] = []
    rates: list[str] = []
    for info in table:
        element = listed.get(info.name)
        if element is None:
            options.append(msgspec.structs.replace(info.options, enabled=True))
            continue
        asked = ElementSettings({"enabled": False, **element.asked})
        made, wrong = asked.on(info.name, info.options, frequency_hz)
        options.append(made)
        if words := rate_words(asked, made.divider, frequency_hz):
            rates.append(f"{script.path}:{element.line_of('divider')}: element '{info.name}': {words}")
        problems += [(element.line_of(one.field), f"element '{one.name}': {one.reason}") for one in wrong]
    if problems:
        raise ScriptError(_message(script.path, problems))
    known = Names((info.name for info in table), prefix)
    missing = [element for element in script.elements if not known.has(element.name)]
    unknown = tuple(
        UnknownName(element.name, element.line, *(known.near(element.name, 1) if place < MAX_SUGGESTIONS else ()))
        for place, element in enumerate(missing)
    )
    return ScriptPlan(tuple(options), unknown, tuple(rates))


def script_conditions(
    script: Script,
    now: Conditions,
    table: Sequence[ElementInfo],
    plan: ScriptPlan,
    prefix: str,
    frequency_hz: float,
    *,
    left_out: list[str] | None = None,
) -> Conditions:
    """Return the conditions that a script leads to beside those of `now`, once its plan holds in the table.

    Raises `ScriptError` for all that don't fit, with the lines of those that the script lists. With `left_out` it is
    read as a logger starts, which is not to fail for a name that is gone, as little as for an element's: its triggers
    were there before, and what speaks of another table is told there.
    """
    if script.conditions is None:
        return now
    planned = [
        msgspec.structs.replace(info, options=options) for info, options in zip(table, plan.options, strict=True)
    ]
    there = [*now.triggers, *(script.conditions.triggers if left_out is not None else ())]
    made, unfit = fitting_conditions(script.conditions_beside(now), planned, prefix, frequency_hz, there)
    told = [(script.condition_lines.get((one.kind, one.name), 0), str(one)) for one in unfit]
    if left_out is not None and len(unfit) < MAX_PROBLEMS and all(one.is_of_another_table for one in unfit):
        left_out += [f"{script.path}:{line}: {text}; it is left out" for line, text in told]
    elif unfit:
        raise ScriptError(_message(script.path, told))
    return made


# ------------------------------------------------------------------------------------------------------------ writing


def format_script(
    table: Sequence[ElementInfo],
    kept: Sequence[UnknownKey] = (),
    conditions: Conditions = NO_CONDITIONS,
    unlisted: Iterable[list[Pair]] = (),
) -> str:
    """The script that gives `table` its present options: all of them, in order, as the original writes it.

    `kept` are keys that silo doesn't know: they stand again where they stood, without their comments. `conditions`
    stand in keys that the original doesn't know. `unlisted` are elements that the table lacks, which come behind it.
    """
    places = grouped(((key.place, key.element), key.pair) for key in kept)
    anchors = itertools.count(1)

    def unknown(place: str, name: str, indent: int) -> str:
        pairs = places.get((place, name))
        return textwrap.indent(text_of(pairs, anchors), " " * indent) if pairs else ""

    others = [textwrap.indent(text_of(pairs, anchors), "    ") for pairs in unlisted]
    lines = [unknown("above", "", 0), "log_elements:\n" if table or others else "log_elements: []\n"]
    for info in table:
        lines.append(f"  - name: {_quoted(info.name)}\n")
        for before, name, group in _LAYOUT:
            lines.append(f"{before}{_number(getattr(info.options, name))}\n" if name else before)
            if group:
                lines.append(unknown(group, info.name, 6))
        lines.append(unknown("element", info.name, 4))
    lines += [f"  - {text[4:]}" for text in others]
    return "".join([*lines, format_conditions(conditions, unknown), unknown("below", "", 0)])


def _layout() -> list[tuple[str, str, str]]:
    """The lines of an element: what stands before a value, the option that it is of, the group that ends with it."""
    made, above = [], ""
    for option, following in zip(IN_SCRIPT, [*IN_SCRIPT[1:], None], strict=True):
        *groups, key = option.place
        group = "".join(groups)
        if group and group != above:
            made.append((f"    {group}:\n", "", ""))
        ends = group if following is None or following.place[:-1] != option.place[:-1] else ""
        made.append((f"{' ' * (6 if group else 4)}{key}: ", option.name, ends))
        above = group
    return made


_LAYOUT = _layout()


def _number(value: OptionValue) -> str:
    return ("false", "true")[value] if isinstance(value, bool) else str(int(value))


def _quoted(name: str) -> str:
    if _PLAIN_NAME.fullmatch(name):
        return name
    text = json.dumps(name, ensure_ascii=False)  # YAML's double-quoted style reads every JSON string
    return _NOT_PRINTABLE.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def write_script(
    path: str | os.PathLike[str],
    table: Sequence[ElementInfo],
    conditions: Conditions | None = None,
    *,
    own: bool = False,
    prefix: str = "",
) -> str:
    """Write `format_script(table)` to `path`, whole or not at all; a script that stands there is replaced.

    Keys of that script that silo doesn't know are kept, as far as their elements are in the table. Of the logger's
    `own` script so are elements that the table lacks, and conditions that speak of such (with names without `prefix`):
    their sensor may be away today, or be added later. Without
    `conditions` (None), those of that script are kept too. Returns what a save says of what it kept; empty if there
    was nothing. Raises `ScriptError` when the file can't be written; what stood there is then untouched.
    """
    from silo.files.atomic import atomic_file  # with its package, NumPy and more: nothing that a reader should pay for

    final = Path(path).resolve()  # through a symbolic link, so that the link stays
    try:
        mode = stat.S_IMODE(final.stat().st_mode) if final.exists() else None
        names = {"", *(info.name for info in table)}
        there = _read_again(final, names)
        unlisted = there.unlisted if own else {}
        old = there.conditions or NO_CONDITIONS
        now, left_out = old if conditions is None else conditions, list[str]()
        if own and conditions is not None:
            now, left_out = with_left_out(now, old, table, prefix)
        named: dict[str, list[str]] = {key: [one.name for one in items] for key, items in kinds_of(now)}
        kept = [found for key in there.unknown if (found := _placed(key, names, named)) is not None]
        text = format_script(table, kept, now, unlisted.values()).encode()
        with atomic_file(final) as file:
            file.write(text)
            if mode is not None:
                os.fchmod(file.fileno(), mode)
    except UnicodeEncodeError as error:
        raise ScriptError(f"{path}: an element's name is not valid Unicode; nothing was changed") from error
    except SaveError as error:
        raise ScriptError(f"{path}: the script can't be written: {error}") from error
    told = f"; kept what silo doesn't know: {and_more([key.label for key in kept], 5)}" if kept else ""
    if unlisted or left_out:
        what = and_more([*unlisted, *left_out], 5)
        told += f"; kept what this program doesn't have: {what} (delete their lines if they are gone for good)"
    return told


def _placed(key: UnknownKey, elements: Container[str], conditions: Mapping[str, Sequence[str]]) -> UnknownKey | None:
    """An unknown key, of what is still there; of a condition under the whole name that its signal has in the table."""
    if key.place not in conditions:
        return key if key.element in elements else None
    whole = (name for name in conditions[key.place] if name == key.element or name.endswith(f"/{key.element}"))
    found = next(whole, None)
    return None if found is None else replace(key, element=found)


def _read_again(path: Path, table: Container[str]) -> Reader:
    """A script that is about to be replaced, whatever is wrong with it; nothing of one that nobody can read."""
    reader = Reader(table)
    if path.is_file():
        with contextlib.suppress(OSError, UnicodeDecodeError, yaml.YAMLError), path.open("rb") as file:
            root = compose(file.read(MAX_SCRIPT_BYTES).decode("utf-8-sig"))
            with collector_paused():
                for _ in reader.elements(root):
                    pass
    return reader

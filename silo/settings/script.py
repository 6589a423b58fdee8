"""The logging script: the YAML file that says how each element is logged.

Reading checks everything before anything is changed: all problems of a file come in one `ScriptError`, each with its
line. Writing gives the layout of the original. Used by the logger, the helper process, the command line and the TUI;
knows no logger.
"""

import json
import os
import re
import stat
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import yaml

from silo.errors import SaveError, ScriptError
from silo.model import MAX_BUFFER_SIZE, MAX_DIVIDER, Action, BufferType, ElementInfo, ElementOptions, FieldChange
from silo.settings.yaml_nodes import collector_paused, compose, describe, explain, is_null, is_plain, line_of, shorten

MAX_SCRIPT_BYTES = 8 * 2**20  # about 60,000 elements; libyaml reads 1 - 2 MB/s
MAX_PROBLEMS = 50
MAX_SUGGESTIONS = 10  # a close match in a table of 10,000 names takes up to 0.2 s

_WORDS = {"true": True, "yes": True, "on": True, "y": True, "false": False, "no": False, "off": False, "n": False}
_WHOLE = re.compile(r"[-+]?(0|[1-9][0-9]*)")
_PLAIN_NAME = re.compile(r"/(?:[A-Za-z0-9_./\-+~@=()<>\[\]]*[A-Za-z0-9_./\-+~@=()<>\[\]])?")
_NOT_PRINTABLE = re.compile("[\x7f-\x9f\u2028\u2029\ufeff\ufffe\uffff]")


@dataclass(frozen=True)
class ScriptElement:
    """One element as a script lists it; None stands for a key that isn't there. `line` counts from 1."""

    name: str
    line: int
    enabled: bool | None = None
    divider: int | None = None
    action: Action | None = None
    buffer_type: BufferType | None = None
    buffer_size: int | None = None


@dataclass(frozen=True)
class Script:
    """A script that was read and found valid in itself; names are not yet held against a table."""

    path: Path
    elements: tuple[ScriptElement, ...]


@dataclass(frozen=True)
class UnknownName:
    """A name of a script that the table lacks, with the nearest name of the table (may be empty)."""

    name: str
    line: int
    suggestion: str

    def __str__(self) -> str:
        hint = f" (did you mean '{self.suggestion}'?)" if self.suggestion else ""
        return f"line {self.line}: no element '{self.name}'{hint}"


@dataclass(frozen=True)
class ScriptPlan:
    """What a script makes of a table: options in the table's order, and the names that the table lacks."""

    options: tuple[ElementOptions, ...]
    unknown: tuple[UnknownName, ...]


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
        raise ScriptError(f"{path}: can't be read: {error.strerror}") from error
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        reason = f"byte 0x{data[error.start]:02x} is not UTF-8; save the file as UTF-8"
        raise ScriptError(f"{path}:{line}: {reason}; nothing was changed") from None
    return parse_script(text, path)


def parse_script(text: str, path: str | os.PathLike[str]) -> Script:
    """Check the text of a script; `path` only stands in messages. Raises `ScriptError` like `read_script`."""
    path = Path(path)
    if len(text) > MAX_SCRIPT_BYTES:
        limit = f"{MAX_SCRIPT_BYTES // 2**20} MB"
        raise ScriptError(f"{path}: larger than {limit}, which is too much for a script; nothing was changed")
    reader = _Reader()
    elements: tuple[ScriptElement, ...] = ()
    with collector_paused():
        try:
            root = compose(text)
        except yaml.YAMLError as error:
            reader.report(*explain(error, text))
        else:
            elements = tuple(reader.elements(root))
    if reader.problems:
        raise ScriptError(_message(path, reader.problems))
    return Script(path, elements)


def _message(path: Path, problems: list[tuple[int, str]]) -> str:
    lines = [f"{path}:{line}: {text}" for line, text in problems[:MAX_PROBLEMS]]
    if len(problems) > MAX_PROBLEMS:
        lines.append(f"{path}: and {len(problems) - MAX_PROBLEMS} more problems")
    return "\n".join(lines) + "; nothing was changed"


class _Reader:
    """Walks the nodes of one script and notes every problem, so that a user mends all of them in one go."""

    def __init__(self) -> None:
        self.problems: list[tuple[int, str]] = []

    def report(self, line: int, text: str) -> None:
        self.problems.append((line, text))

    def elements(self, root: yaml.Node | None) -> Iterator[ScriptElement]:
        """The valid elements below the top level; duplicates are problems."""
        if root is None:
            self.report(1, "the script is empty; it must start with `log_elements:`")
            return
        listed = self._mapping(root, "", ("log_elements",), "a script")
        if "log_elements" not in listed:
            if not self.problems:
                self.report(line_of(root), "`log_elements:` is missing")
            return
        node = listed["log_elements"]
        if is_null(node):
            return
        if not isinstance(node, yaml.SequenceNode) or node.tag:
            self.report(line_of(node), f"log_elements must be a list (`- name: ...`), got {describe(node)}")
            return
        first_lines: dict[str, int] = {}
        for position, item in enumerate(node.value, start=1):
            element = self._element(item, position)
            if element is None:
                continue
            if element.name in first_lines:
                first = first_lines[element.name]
                self.report(element.line, f"element '{element.name}': listed twice, first in line {first}")
                continue
            first_lines[element.name] = element.line
            yield element

    def _element(self, node: yaml.Node, position: int) -> ScriptElement | None:
        where = f"element {position} of the list: "
        if not isinstance(node, yaml.MappingNode):
            self.report(line_of(node), f"{where}must have keys (`name: ...`), got {describe(node)}")
            return None
        name = ""
        for key, value in node.value:
            if key.value == "name" and isinstance(value, yaml.ScalarNode) and not is_null(value):
                name = value.value
                where = f"element '{name}': "
                break
        keys = self._mapping(node, where, ("name", "enabled", "divider", "buffer", "action"), "an element")
        if not name:
            self.report(line_of(keys.get("name", node)), f"{where}name is missing")
        buffer: dict[str, yaml.Node] = {}
        if "buffer" in keys:
            buffer = self._mapping(keys["buffer"], where, ("type", "size"), "buffer")
        element = ScriptElement(
            name,
            line_of(node),
            self._switch(keys.get("enabled"), where),
            self._whole(keys.get("divider"), where, "divider", MAX_DIVIDER),
            self._member(keys.get("action"), where, "action", Action),
            self._member(buffer.get("type"), where, "buffer type", BufferType),
            self._whole(buffer.get("size"), where, "buffer size", MAX_BUFFER_SIZE),
        )
        return element if name else None

    def _mapping(self, node: yaml.Node, where: str, known: tuple[str, ...], what: str) -> dict[str, yaml.Node]:
        """The values of the known keys; anything else is a problem."""
        if not isinstance(node, yaml.MappingNode) or node.tag:
            self.report(line_of(node), f"{where}{what} must have keys ({', '.join(known)}), got {describe(node)}")
            return {}
        found: dict[str, yaml.Node] = {}
        for key, value in node.value:
            name = key.value if isinstance(key, yaml.ScalarNode) else describe(key)
            if name in found:
                self.report(line_of(key), f"{where}key '{name}' stands twice, first in line {line_of(found[name])}")
            elif name not in known:
                near = get_close_matches(str(name).lower(), known, 1)
                hint = f"did you mean '{near[0]}'?" if near else f"known are {', '.join(known)}"
                self.report(line_of(key), f"{where}unknown key '{name}' in {what}; {hint}")
            else:
                found[name] = value
        return found

    def _scalar(self, node: yaml.Node, where: str, field: str, wanted: str) -> str | None:
        """The text of a plain scalar, or None after reporting that the value is of another kind."""
        if not isinstance(node, yaml.ScalarNode):
            self.report(line_of(node), f"{where}{field} must be {wanted}, got {describe(node)}")
        elif is_null(node):
            self.report(line_of(node), f"{where}{field} has no value; give {wanted}, or remove the key")
        elif node.tag:
            self.report(line_of(node), f"{where}{field} must be {wanted}, got a value with the tag {node.tag!r}")
        else:
            return str(node.value)
        return None

    def _switch(self, node: yaml.Node | None, where: str) -> bool | None:
        if node is None:
            return None
        text = self._scalar(node, where, "enabled", "true or false")
        if text is None:
            return None
        value = _WORDS.get(text.lower()) if is_plain(node) else None
        if value is None:
            self.report(line_of(node), f"{where}enabled must be true or false, got {describe(node)}")
        return value

    def _whole(self, node: yaml.Node | None, where: str, field: str, highest: int) -> int | None:
        if node is None:
            return None
        text = self._scalar(node, where, field, "a whole number")
        if text is None:
            return None
        if not is_plain(node) or not _WHOLE.fullmatch(text):
            self.report(line_of(node), f"{where}{field} must be a whole number, got {describe(node)}")
            return None
        # int() refuses more than 4300 digits; a number of 20 is out of range already
        value = int(text) if len(text) < 20 else (-1 if text.startswith("-") else highest + 1)
        if value < 1:
            self.report(line_of(node), f"{where}{field} must be 1 or more, got {shorten(text)}")
        elif value > highest:
            self.report(line_of(node), f"{where}{field} must be at most {highest}, got {shorten(text)}")
        else:
            return value
        return None

    def _member(self, node: yaml.Node | None, where: str, field: str, enumeration: type[Any]) -> Any:
        if node is None:
            return None
        wanted = _choices(enumeration)
        text = self._scalar(node, where, field, wanted)
        if text is None:
            return None
        value = member_of(enumeration, text)
        if value is None:
            self.report(line_of(node), f"{where}{field} must be {wanted}, got {describe(node)}")
        return value


def member_of(enumeration: type[Any], text: str) -> Any:
    """The member that `text` names by number or by name in any case (`1`, `LOOPING`, `save-and-publish`), or None."""
    key = text.strip().upper().replace("-", "_").replace(" ", "_")
    if key.isascii() and key.isdigit():
        return next((member for member in enumeration if str(int(member)) == key), None)
    return enumeration.__members__.get(key)


def _choices(enumeration: type[Any]) -> str:
    words = [f"{member.name} ({int(member)})" for member in enumeration]
    return ", ".join(words[:-1]) + " or " + words[-1]


# ----------------------------------------------------------------------------------------------------------- applying


def apply_script(script: Script, table: Sequence[ElementInfo]) -> ScriptPlan:
    """Options of every element of `table` under `script`; changes nothing.

    A key that is missing keeps the element's setting, except that a listed element without `enabled` is disabled. An
    element that isn't listed is enabled. Names that the table lacks are returned, not errors.
    """
    listed = {element.name: element for element in script.elements}
    options = tuple(_options(listed.get(info.name), info.options) for info in table)
    names = [info.name for info in table]
    known = set(names)
    missing = [element for element in script.elements if element.name not in known]
    unknown = tuple(
        UnknownName(element.name, element.line, _nearest(element.name, names) if place < MAX_SUGGESTIONS else "")
        for place, element in enumerate(missing)
    )
    return ScriptPlan(options, unknown)


def _options(element: ScriptElement | None, now: ElementOptions) -> ElementOptions:
    if element is None:
        return ElementOptions(True, now.divider, now.action, now.buffer_type, now.buffer_size)
    return ElementOptions(
        bool(element.enabled),
        now.divider if element.divider is None else element.divider,
        now.action if element.action is None else element.action,
        now.buffer_type if element.buffer_type is None else element.buffer_type,
        now.buffer_size if element.buffer_size is None else element.buffer_size,
    )


def _nearest(name: str, names: Sequence[str]) -> str:
    near = get_close_matches(name, names, 1, cutoff=0.75)
    return near[0] if near else ""


# ------------------------------------------------------------------------------------------------------------ writing


def format_script(table: Sequence[ElementInfo]) -> str:
    """The script that gives `table` its present options: all of them, in order, as the original writes it."""
    if not table:
        return "log_elements: []\n"
    lines = ["log_elements:\n"]
    for info in table:
        now = info.options
        lines.append(
            f"  - name: {_quoted(info.name)}\n"
            f"    enabled: {'true' if now.enabled else 'false'}\n"
            f"    divider: {now.divider}\n"
            f"    buffer:\n"
            f"      type: {int(now.buffer_type)}\n"
            f"      size: {now.buffer_size}\n"
            f"    action: {int(now.action)}\n"
        )
    return "".join(lines)


def _quoted(name: str) -> str:
    if _PLAIN_NAME.fullmatch(name):
        return name
    text = json.dumps(name, ensure_ascii=False)  # YAML's double-quoted style reads every JSON string
    return _NOT_PRINTABLE.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def write_script(path: str | os.PathLike[str], table: Sequence[ElementInfo]) -> None:
    """Write `format_script(table)` to `path`, whole or not at all; a script that stands there is replaced.

    Raises `ScriptError` when the file can't be written; what stood there is then untouched.
    """
    from silo.files.atomic import atomic_file  # with its package, NumPy and more: nothing that a reader should pay for

    final = Path(path).resolve()  # through a symbolic link, so that the link stays
    try:
        mode = stat.S_IMODE(final.stat().st_mode) if final.exists() else None
        with atomic_file(final) as file:
            file.write(format_script(table).encode())
            if mode is not None:
                os.fchmod(file.fileno(), mode)
    except UnicodeEncodeError as error:
        raise ScriptError(f"{path}: an element's name is not valid Unicode; nothing was changed") from error
    except SaveError as error:
        raise ScriptError(f"{path}: the script can't be written: {error}") from error


# ---------------------------------------------------------------------------------------------------------- comparing


def diff_options(table: Sequence[ElementInfo], options: Sequence[ElementOptions]) -> list[FieldChange]:
    """What changes when the elements of `table` get `options` (same order and length), one entry per field."""
    changes: list[FieldChange] = []
    for info, new in zip(table, options, strict=True):
        old = info.options
        if new == old:
            continue
        changes.extend(
            FieldChange(info.name, field, show_option(getattr(old, field)), show_option(getattr(new, field)))
            for field in ElementOptions.__struct_fields__
            if getattr(old, field) != getattr(new, field)
        )
    return changes


def show_option(value: bool | int | Action | BufferType) -> str:
    """A field of `ElementOptions` in a word: `on`, `off`, `20`, `LOOPING`, `SAVE`."""
    if isinstance(value, bool):
        return "on" if value else "off"
    return value.name if isinstance(value, (Action, BufferType)) else str(value)

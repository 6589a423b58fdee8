"""From the nodes of a script to its elements: every problem with its line, every unknown key noted.

`silo.settings.script` calls it; what a value may be stands in `rules`, what may be typed for one in `words`.
"""

import re
from collections.abc import Container, Iterator
from dataclasses import dataclass, field

import yaml

from silo.core.conditions import Conditions
from silo.core.names import did_you_mean, nearest
from silo.settings.options import IN_SCRIPT, OPTIONS, ElementOption, OptionValue, shorten
from silo.settings.script_conditions import KEYS, Kind, Lines, read_conditions
from silo.settings.typed import ElementSettings, RelativeValue, UnreadableError, read_text, read_word
from silo.settings.yaml_nodes import Pair, describe, is_null, is_plain, key_name, line_of

_ELEMENT_KEYS = ("name", *dict.fromkeys(option.place[0] for option in IN_SCRIPT))
_ELEMENT = "an element"
_GROUPS = {  # keys below a key of an element
    group: tuple(option.place[1] for option in IN_SCRIPT if option.place[0] == group)
    for group in dict.fromkeys(option.place[0] for option in IN_SCRIPT if len(option.place) > 1)
}
_WHOLE = re.compile(r"-?(0|[1-9][0-9]*)")
_OCTAL = re.compile(r"[-+]?0[0-9]+")  # to YAML 010 is 8


@dataclass(frozen=True)
class ScriptElement:
    """One element as a script lists it, with what it asks for. `line` counts from 1, `lines` are those of options.

    A number may be one that follows from the logger: `size: 10s`, `divider: 50Hz`.
    """

    name: str
    line: int
    asked: ElementSettings = field(default_factory=ElementSettings)
    lines: dict[str, int] = field(default_factory=dict, compare=False)

    def line_of(self, option: str) -> int:
        """Return where an option stands."""
        return self.lines.get(option, self.line)


@dataclass(frozen=True)
class UnknownKey:
    """A key that silo doesn't know: left alone, told of, and kept when the script is saved again.

    `element` is empty for a key of the script itself. `place` is where it stands: `above` or `below` what silo knows
    of a script, in an `element`, or in the group or kind of that name (`buffer`, `triggers`).
    """

    line: int
    element: str
    place: str
    pair: Pair
    text: str

    def __str__(self) -> str:
        return f"line {self.line}: {self.text}"

    @property
    def label(self) -> str:
        """The key in a list: `note`, `note of /log/x`."""
        return shorten(key_name(self.pair[0])) + (f" of {self.element}" if self.element else "")


class Reader:
    """Walks the nodes of one script and notes every problem, so that a user mends all of them in one go.

    Unknown keys are no problems: another version of silo, or another program, may know them.
    """

    def __init__(self, listed: Container[str] | None = None) -> None:
        """`listed`: a table, of which valid elements that it lacks are noted, as they stand."""
        self._listed = listed
        self.unlisted: dict[str, list[Pair]] = {}
        self.problems: list[tuple[int, str]] = []
        self.unknown: list[UnknownKey] = []
        self.conditions: Conditions | None = None
        self.condition_lines: Lines = {}
        self.kinds: frozenset[str] = frozenset()  # of them that have their key
        self.lists_elements = False  # whether its key is there

    def report(self, line: int, text: str) -> None:
        """Note a problem."""
        self.problems.append((line, text))

    def _note(self, place: Kind, element: str, pair: Pair, text: str) -> None:
        self.unknown.append(UnknownKey(line_of(pair[0]), element, place, pair, text))

    def elements(self, root: yaml.Node | None) -> Iterator[ScriptElement]:
        """The valid elements below the top level; duplicates are problems."""
        if root is None:
            self.report(1, "the script is empty; it must start with `log_elements:`")
            return
        known = ("log_elements", *KEYS) if isinstance(root, yaml.MappingNode) else ("log_elements",)
        listed = self._mapping(root, "", known, "a script")
        self.conditions = read_conditions(listed, self.report, self._note, self.condition_lines)
        self.kinds = frozenset(KEYS).intersection(listed)
        self.lists_elements = "log_elements" in listed
        if not self.lists_elements:
            own = [key for key in self.unknown if key.place not in KEYS]
            meant = [key for key in own if not self.kinds or nearest(key_name(key.pair[0]).lower(), ("log_elements",))]
            if not self.problems and not meant and not self.kinds:
                self.report(line_of(root), "`log_elements:` is missing; `log_elements: []` has all of them on")
            # then one of the unknown keys is meant for it
            self.problems += [(key.line, key.text) for key in meant]
            self.unknown = [key for key in self.unknown if key not in meant]
            return
        node = listed["log_elements"]
        if is_null(node):
            return
        if not isinstance(node, yaml.SequenceNode) or node.tag:
            self.report(line_of(node), f"log_elements must be a list (`- name: ...`), got {describe(node)}")
            return
        first_lines: dict[str, int] = {}
        for position, item in enumerate(node.value, start=1):
            problems = len(self.problems)
            element = self._element(item, position)
            if element is None:
                continue
            if self._listed is not None and element.name not in self._listed and len(self.problems) == problems:
                self.unlisted[element.name] = item.value
            if element.name in first_lines:
                first = first_lines[element.name]
                self.report(element.line, f"element '{element.name}': listed twice, first in line {first}")
                continue
            first_lines[element.name] = element.line
            yield element
        self.unknown.sort(key=lambda key: key.line)  # those of the script itself were seen first

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
        keys = self._mapping(node, where, _ELEMENT_KEYS, _ELEMENT, name)
        if not name:
            self.report(line_of(keys.get("name", node)), f"{where}name is missing")
        nodes: dict[tuple[str, ...], yaml.Node] = {(key,): value for key, value in keys.items()}
        for group, known in _GROUPS.items():
            if group in keys:
                below = self._mapping(keys[group], where, known, group, name)
                nodes |= {(group, key): value for key, value in below.items()}
        asked = ElementSettings()
        for option in OPTIONS:
            if option.place in nodes and (value := self._value(nodes[option.place], where, option)) is not None:
                asked[option.name] = value
        lines = {option.name: line_of(nodes[option.place]) for option in OPTIONS if option.name in asked}
        element = ScriptElement(name, line_of(node), asked, lines)
        return element if name else None

    def _mapping(
        self, node: yaml.Node, where: str, known: tuple[str, ...], what: str, element: str = ""
    ) -> dict[str, yaml.Node]:
        """The values of the known keys; the others are noted as unknown."""
        if not isinstance(node, yaml.MappingNode) or node.tag:
            self.report(line_of(node), f"{where}{what} must have keys ({', '.join(known)}), got {describe(node)}")
            return {}
        found: dict[str, yaml.Node] = {}
        lines: dict[str, int] = {}
        for key, value in node.value:
            name = key_name(key)
            if name in found:
                self.report(line_of(key), f"{where}key '{name}' stands twice, first in line {lines[name]}")
            elif name not in known:
                hint = did_you_mean(nearest(name.lower(), known), f"known are {', '.join(known)}")
                text = f"{where}unknown key '{shorten(name)}' in {what}{hint}"
                place = what if what in _GROUPS else "element" if what == _ELEMENT else "below" if found else "above"
                self.unknown.append(UnknownKey(line_of(key), element, place, (key, value), text))
            else:
                found[name], lines[name] = value, line_of(key)
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

    def _value(self, node: yaml.Node, where: str, option: ElementOption) -> OptionValue | RelativeValue | None:
        """What an option is to be; None after reporting that it can't be that."""
        text = self._scalar(node, where, option.name, option.wanted)
        if text is None:
            return None
        if option.words:
            quoted_switch = option.kind is bool and not is_plain(node)
            word = None if quoted_switch else read_word(option, text)
            if word is None:
                self.report(line_of(node), where + option.problem(describe(node)))
            return word
        value: object
        if not is_plain(node) or _OCTAL.fullmatch(text):
            self.report(line_of(node), where + option.problem(describe(node)))
            return None
        if _WHOLE.fullmatch(text):
            # int() refuses more than 4300 digits; a number of 20 is out of range already
            value = int(text) if len(text) < 20 else -1
        else:
            try:
                value = read_text(option, text, relative=False)
            except UnreadableError as error:
                self.report(line_of(node), f"{where}{error}")
                return None
        if isinstance(value, RelativeValue) or (isinstance(value, int) and option.accepts(value)):
            return value
        got = text if _WHOLE.fullmatch(text) else str(value)
        self.report(line_of(node), where + option.problem(shorten(got)))
        return None

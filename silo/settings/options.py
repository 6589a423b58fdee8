"""What each option of an element may be, by which words, and the one text for each way of being wrong.

The table `OPTIONS` is where a new option, a new value of one or another word for it is written down. Ranges stand in
the type `silo.core.elements.ElementOptions` itself. The parser of typed words, the script, the robot process and the
helper ask here.
"""

from collections.abc import Container, Iterable, Mapping
from functools import cached_property
from typing import Any

import msgspec

from silo.core.elements import Action, BufferType, Edit, ElementOptions, Problem
from silo.errors import ElementError

MAX_PROBLEMS = 200
MAX_NAME = 200  # characters of a name that came from outside
MAX_TOLD = 3  # elements that one message names; nobody reads more

OptionValue = bool | int | Action | BufferType


class OptionWord(msgspec.Struct, frozen=True, dict=True):
    """One value of an option that has few: `word` is shown and typed, `cell` too, where a column is narrow.

    `phrase` is for sentences (the word, if empty), `also` holds further spellings. Its number and the enumeration's own
    names are always taken.
    """

    value: bool | Action | BufferType
    word: str
    cell: str
    meaning: str
    also: tuple[str, ...] = ()
    phrase: str = ""

    @cached_property
    def spellings(self) -> set[str]:
        """All that may be typed for it, in small letters, with `_` for `-` and blanks."""
        names = [name for name, member in getattr(type(self.value), "__members__", {}).items() if member is self.value]
        return {each.lower() for each in (self.word, self.cell, str(int(self.value)), *self.also, *names)}


class ElementOption(msgspec.Struct, frozen=True):
    """One field of `ElementOptions`: `keys` may stand before the `=` (the first is shown), `words` are its values.

    The first of the words is the most wanted one: keys of `silo-tui` step through them in this order. An option without
    words is a number; `examples` shows what else may be typed for it, `units` which units it takes. In a script
    it stands under the key `script`, or in the group of that key: `buffer.type`; what is `late` stands there behind
    those that are not.
    """

    name: str
    keys: tuple[str, ...]
    meaning: str
    words: tuple[OptionWord, ...] = ()
    units: tuple[str, ...] = ()
    examples: tuple[str, ...] = ()
    absolute: tuple[str, ...] = ()  # of the examples, those that don't depend on the value before
    script: str = ""  # its name, if empty
    late: bool = False

    @property
    def place(self) -> tuple[str, ...]:
        """Its key in a script, behind that of its group: `("buffer", "type")`."""
        return tuple((self.script or self.name).split("."))

    @property
    def kind(self) -> type[OptionValue]:
        """The type of its values."""
        return type(self.words[0].value) if self.words else int

    @property
    def wanted(self) -> str:
        """What it may be: `a whole number from 1 to 2147483647`, `on or off`."""
        if not self.words:
            low, high = RANGES[self.name]
            return f"a whole number from {low} to {high}"
        shown = [
            word.word if isinstance(word.value, bool) else f"{word.word} ({int(word.value)})" for word in self.words
        ]
        return ", ".join(shown[:-1]) + " or " + shown[-1]

    def word_of(self, value: object) -> OptionWord:
        """The word of a valid value."""
        return next(word for word in self.words if word.value == value)

    def accepts(self, value: object) -> bool:
        """Whether this is a value of its type, and in its range."""
        if self.words:
            return any(value is word.value for word in self.words)
        low, high = RANGES[self.name]
        return isinstance(value, int) and not isinstance(value, bool) and low <= value <= high

    def problem(self, got: str) -> str:
        """The text for a value that can't be taken."""
        return f"{self.name} must be {self.wanted}, got {got}"


def _ranges() -> dict[str, tuple[int, int]]:
    kind = msgspec.inspect.type_info(ElementOptions)
    assert isinstance(kind, msgspec.inspect.StructType)
    numbers = {field.name: field.type for field in kind.fields}
    return {
        name: (number.ge or 0, number.le or 0)
        for name, number in numbers.items()
        if isinstance(number, msgspec.inspect.IntType)
    }


RANGES = _ranges()
WIRE_NAMES = {field.name: field.encode_name for field in msgspec.structs.fields(ElementOptions)}

# in the order of the fields of `ElementOptions`
OPTIONS = (
    ElementOption(
        "enabled", ("enabled", "on", "log", "logging"), "log it or not",
        (
            OptionWord(True, "on", "on", "log it", ("yes", "y", "true", "x")),
            OptionWord(False, "off", "off", "leave it out", ("no", "n", "false")),
        ),
    ),
    ElementOption(
        "divider", ("divider", "div"), "every fifth tick", units=("Hz",),
        examples=("5", "50Hz", "*2", "/2", "+1"), absolute=("50Hz",),
    ),
    ElementOption(
        "action", ("action", "act"), "what becomes of the samples",
        (
            OptionWord(Action.SAVE, "save", "save", "into files"),
            OptionWord(Action.SAVE_AND_PUBLISH, "both", "save+pub", "", ("save+publish",), "save and publish"),
            OptionWord(Action.PUBLISH, "publish", "publish", "live only", ("pub",)),
        ),
        late=True,
    ),
    ElementOption(
        "buffer", ("buffer", "buf"), "which samples are kept",
        (
            OptionWord(BufferType.LOOPING, "looping", "loop", "the newest samples"),
            OptionWord(BufferType.FIXED, "fixed", "fix", "the first samples"),
            OptionWord(BufferType.GROWING, "growing", "grow", "all"),
        ),
        script="buffer.type",
    ),
    ElementOption(
        "size", ("size",), "samples, or a time", units=("s",),
        examples=("1000", "10k", "10s", "*2", "/2", "+10"), absolute=("10k", "10s"), script="buffer.size",
    ),
)  # fmt: skip
OPTION = {option.name: option for option in OPTIONS}
IN_SCRIPT = sorted(OPTIONS, key=lambda option: option.late)  # in the order of a script


def option_problems(name: str, options: ElementOptions) -> list[Problem]:
    """What is wrong in options that came from outside; empty when all is well."""
    return [
        Problem(name, option.name, option.problem(shorten(repr(given))))
        for option in OPTIONS
        if not option.accepts(given := getattr(options, option.name))
    ]


def raw_problems(name: str, options: Mapping[Any, Any]) -> list[Problem]:
    """`option_problems` of options as they come over the wire: plain values, some of which may be missing."""
    found = []
    for option in OPTIONS:
        value = options.get(WIRE_NAMES[option.name], option)
        numbers = {int(word.value): word.value for word in option.words if not isinstance(word.value, bool)}
        known = numbers.get(value, value) if type(value) is int else value
        if value is not option and not option.accepts(known):
            found.append(Problem(name, option.name, option.problem(shorten(repr(value)))))
    return found


def edit_problems(edits: Iterable[Edit], known: Container[str]) -> list[Problem]:
    """Why edits of a table with the elements `known` can't be applied, at most `MAX_PROBLEMS`; empty when they can."""
    found: list[Problem] = []
    seen: set[str] = set()
    for edit in edits:
        name = shorten(edit.name, MAX_NAME)
        if edit.name not in known:
            found.append(Problem(name, "name", "the table has no such element"))
        elif edit.name in seen:
            found.append(Problem(name, "name", "edited twice in one transaction"))
        seen.add(edit.name)
        found += option_problems(name, edit.options)
        if len(found) >= MAX_PROBLEMS:
            break
    return found[:MAX_PROBLEMS]


def refusal(problems: list[Problem]) -> str:
    """The message for problems: element, field, value and range of the first ones."""
    lines = [f"element '{problem.name}': {problem.reason}" for problem in problems[:MAX_TOLD]]
    if len(problems) > MAX_TOLD:
        lines.append(f"and {len(problems) - MAX_TOLD} more")
    return "; ".join([*lines, "nothing was changed"])


def checked(name: str, options: ElementOptions) -> ElementOptions:
    """Return the options. Raises an ElementError that names the element, the field, the value and the range."""
    problems = option_problems(name, options)
    if problems:
        raise ElementError(refusal(problems))
    return options


def shorten(text: str, limit: int = 40) -> str:
    """`text` cut so that it fits a message."""
    text = text if len(text) <= limit else f"{text[: limit - 10]}... ({len(text)} characters)"
    return text if text.isprintable() else repr(text)

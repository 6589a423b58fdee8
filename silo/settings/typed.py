"""The one parser of typed settings: `divider=50Hz size=10k buffer=looping action=both off`.

`log.set`, `log.add`, the script, `silo set`, the `:set` of `silo-tui` and its editors read by it, complete by it and
show its help. Reading gives `ElementSettings`; these make new options of the present ones, or problems in the words of
`rules`.
"""

import math
import re
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgspec

from silo.core.arguments import shown, truth, whole_hint, whole_number
from silo.core.calls import present_word
from silo.core.elements import (
    DEFAULT_OPTIONS,
    Action,
    BufferType,
    Edit,
    ElementInfo,
    ElementOptions,
    FieldChange,
    Problem,
    buffer_size_for,
)
from silo.core.names import Names, did_you_mean, is_glob, nearest
from silo.core.quantities.reading import AMOUNT, COUNTS, HERTZ, SECONDS, tell_bare_m
from silo.core.quantities.writing import and_more
from silo.errors import ElementError
from silo.settings.options import OPTION, OPTIONS, RANGES, ElementOption, OptionValue, refusal, shorten

_KEYS = {key: option for option in OPTIONS for key in option.keys}
_ENABLED = OPTION["enabled"]
_BARE = tuple(word.word for word in _ENABLED.words)  # `on` and `off` need no key
_NUMBER = re.compile(rf"\s*([=*/+-]?)\s*{AMOUNT}\s*", re.IGNORECASE | re.ASCII)
_UNITS = {*SECONDS, *COUNTS, *HERTZ}
_DIGITS = re.compile(r"[0-9]{1,300}")


@dataclass(frozen=True)
class RelativeValue:
    """A number that follows from the element: `operator` one of `*`, `/`, `+`, `-`, `s` (seconds), `Hz` (rate)."""

    operator: str
    amount: float
    typed: str = field(default="", compare=False)

    def on(self, value: int, divider: int, frequency_hz: float) -> float:
        """The new number, not rounded and not held against a range; a size in seconds is whole."""
        if self.operator == "s":
            samples = self.amount * frequency_hz / divider
            # out of range anyway: only a size that could be one is rounded up
            return float(buffer_size_for(self.amount, frequency_hz, divider)) if 0 < samples < 2**53 else samples
        if self.operator == "Hz":
            return frequency_hz / self.amount
        if self.operator == "/":
            return math.ceil(value / self.amount) if self.amount > 1e-12 else math.inf
        return {"*": value * self.amount, "+": value + self.amount, "-": value - self.amount}[self.operator]


class ElementSettings(dict[str, OptionValue | RelativeValue]):
    """What somebody asks for, by names of options; the others stay. Whole numbers are not yet held against ranges."""

    def on(self, name: str, now: ElementOptions, frequency_hz: float) -> tuple[ElementOptions, list[Problem]]:
        """The options of the element `name` under these settings, and what is out of range.

        A size given as a time follows the new divider. A field with a problem keeps its value.
        """
        made: dict[str, Any] = {}
        problems: list[Problem] = []
        for option in OPTIONS:  # the divider before the size
            asked = self.get(option.name)
            if asked is None:
                continue
            if option.words:
                made[option.name] = asked
                continue
            new: Any = asked
            typed = ""
            if isinstance(asked, RelativeValue):
                new = asked.on(getattr(now, option.name), int(made.get("divider", now.divider)), frequency_hz)
                most = f": at most {frequency_hz:g} Hz" if asked.operator == "Hz" and new < 1 else ""
                typed = f" ({asked.typed}{most})" if asked.typed else ""
            low, high = RANGES[option.name]
            if low <= new <= high:
                made[option.name] = round(new)
            else:
                problems.append(Problem(name, option.name, option.problem(_shown(new) + typed)))
        return msgspec.structs.replace(now, **made), problems


def _shown(number: float) -> str:
    if isinstance(number, int):
        return shorten(str(number))
    return f"{number:.0f}" if 1 <= abs(number) < 1e15 else f"{number:.6g}"


def rate_words(settings: ElementSettings, divider: int, frequency_hz: float) -> str:
    """What a rate became where no divider gives it: `divider=30Hz became 3: 33.3 Hz of 100 Hz`; "" where it is met."""
    asked = settings.get("divider")
    if not isinstance(asked, RelativeValue) or asked.operator != "Hz":
        return ""
    rate_hz = frequency_hz / divider
    if math.isclose(rate_hz, asked.amount, rel_tol=1e-3):
        return ""
    return f"divider={asked.typed or f'{asked.amount:g}Hz'} became {divider}: {rate_hz:.4g} Hz of {frequency_hz:g} Hz"


def apply_settings(
    settings: ElementSettings, elements: Iterable[tuple[str, ElementOptions]], frequency_hz: float
) -> list[ElementOptions]:
    """New options of elements, given by name and present options: of all, or an ElementError that says of which not."""
    made, problems = [], []
    for name, now in elements:
        options, wrong = settings.on(name, now, frequency_hz)
        made.append(options)
        problems += wrong
    if problems:
        raise ElementError(refusal(problems))
    return made


def whole_edits(edits: Iterable[Edit], elements: Iterable[ElementInfo], prefix: str, frequency_hz: float) -> list[Edit]:
    """Return edits with whole names, and all options: of those that name some, the others as they are now.

    Raises ElementError.
    """
    now = {info.name: info.options for info in elements}
    known = Names(now, prefix)

    def whole(one: Edit) -> Edit:
        name = _whole_name(one.name, known)
        if isinstance(one.options, ElementOptions):
            return one if name == one.name else Edit(name, one.options)
        settings = read_options(one.options, name)
        return Edit(name, *apply_settings(settings, [(name, now.get(name, DEFAULT_OPTIONS))], frequency_hz))

    return [whole(one) for one in edits]


def _whole_name(name: str, known: Names) -> str:
    """The name of the element that a text means; the text where there is none. Raises ElementError for several."""
    if name in known.places or is_glob(name):
        return name
    found = [known.name(one) for one in known.find(name, namespaces=False)]
    if len(found) > 1:
        raise ElementError(
            f"'{shorten(name)}' means {len(found)} elements, {and_more(found, 3)}: an edit is of one; nothing was done"
        )
    return found[0] if found else name


# ------------------------------------------------------------------------------------------------------------ reading


class UnreadableError(ValueError):
    """What was typed for an option can't be read; the text is the reason alone, for the door to complete."""


def find_option(key: str, given: Container[str] = ()) -> ElementOption:
    """The option that a key names. Raises UnreadableError with the nearest key, or if it is among those `given`."""
    found = _KEYS.get(present_word(key.strip().lower()))
    if found is None:
        there = f"there are {', '.join(option.keys[0] for option in OPTIONS)}"
        raise UnreadableError(f"no setting '{shorten(key)}'{did_you_mean(nearest(key.strip().lower(), _KEYS), there)}")
    if found.name in given:
        raise UnreadableError(f"{found.name} is given twice")
    return found


def read_word(option: ElementOption, text: str) -> bool | Action | BufferType | None:
    """The value that a word or number stands for in an option with few values (any case), None for another word."""
    folded = text.strip().lower().replace("-", "_").replace(" ", "_")
    return next((word.value for word in option.words if folded in word.spellings), None)


def _near_word(option: ElementOption, text: str) -> str:
    spellings = {spelling: word.word for word in option.words for spelling in word.spellings if len(spelling) > 2}
    folded = text.strip().lower().rsplit(".", 1)[-1]  # `Action.SAVE`
    near = [folded] if folded in spellings else nearest(folded, spellings, 0.75)
    near = near or ["looping"] * (option.name == "buffer" and folded in ("ring", "circular", "rolling"))
    return did_you_mean(spellings[one] for one in near)


def read_text(option: ElementOption, text: str, *, relative: bool = True) -> OptionValue | RelativeValue:
    """What was typed for an option. Raises UnreadableError that names the option, its range and the text.

    Without `relative`, what depends on the value before (`*2`, `+1`) is refused.
    """
    if option.words:
        value = read_word(option, text.strip().removeprefix("="))
        if value is None:
            raise UnreadableError(f"{option.problem(shorten(text.strip()) or 'nothing')}{_near_word(option, text)}")
        return value
    typed = text.strip()
    match = _NUMBER.fullmatch(typed)
    if match is None or match[3].lower() not in _UNITS:
        raise _unreadable(option, typed, relative)
    operator, digits, unit = match[1].replace("=", ""), match[2], match[3].lower()
    tell_bare_m(f"{option.keys[0]}={typed}:", digits + match[3], "millions", "M")
    if unit in SECONDS:
        if "s" not in option.units or operator:
            raise _unreadable(option, typed, relative, "a time only sets the size")
        return RelativeValue("s", float(digits) * SECONDS[unit], typed)
    if unit in HERTZ:
        if "Hz" not in option.units or operator:
            raise _unreadable(option, typed, relative, "a rate only sets the divider")
        if not float(digits):
            raise _unreadable(option, typed, relative, "a rate is above 0")
        return RelativeValue("Hz", float(digits) * HERTZ[unit], typed)
    if operator and not relative:
        raise _unreadable(option, typed, relative, "a change of the value before has no place here")
    if operator:
        return RelativeValue(operator, float(digits) * COUNTS[unit], typed)
    if not unit and _DIGITS.fullmatch(digits):
        return int(digits)
    number = round(float(digits) * COUNTS[unit], 6)  # 1.001k is 1000.9999999999999 in floating point
    if not number.is_integer():
        raise UnreadableError(option.problem(shorten(typed)))
    return int(number)


def _unreadable(option: ElementOption, text: str, relative: bool, why: str = "") -> UnreadableError:
    low, high = RANGES[option.name]
    *most, last = (f"{low} to {high}", *(option.examples[1:] if relative else option.absolute))
    reason = f"{option.name} must be {', '.join(most)} or {last}, got {shorten(text) or 'nothing'}"
    return UnreadableError(f"{reason}; {why}" if why else reason)


def read_value(option: ElementOption, value: object) -> OptionValue | RelativeValue:
    """What a program gave for an option: a value, its number, or words. Raises UnreadableError."""
    if isinstance(value, str) and not isinstance(value, Action | BufferType):
        return read_text(option, value)
    found = truth(value)
    number = whole_number(value) if found is None else None
    for word in option.words:
        if value is word.value or found is word.value or (number is not None and number == int(word.value)):
            return word.value
    if option.words or number is None:
        raise UnreadableError(f"{option.problem(shorten(shown(value)))}{_hint(option, value)}")
    return number


def _hint(option: ElementOption, value: object) -> str:
    """What to write instead of something that is no value of an option."""
    if isinstance(value, Action | BufferType):
        other = OPTION["action" if isinstance(value, Action) else "buffer"]
        return f", which is for {other.name}: write {other.name}={other.word_of(value).word!r}"
    return "" if option.words else whole_hint(option.name, value, *RANGES[option.name])


def read_options(options: Mapping[str, object], name: str = "") -> ElementSettings:
    """The settings in keywords, as `log.set` takes them. Raises ElementError, for the element `name`."""
    return _read(options.items(), name)


def _read(pairs: Iterable[tuple[str, object]], name: str = "") -> ElementSettings:
    found: dict[str, OptionValue | RelativeValue] = {}
    try:
        for key, value in pairs:
            option = find_option(key, found)
            found[option.name] = read_value(option, value)
    except UnreadableError as error:
        where = f"element '{name}': " if name else ""
        raise ElementError(f"{where}{error}; nothing was changed") from None
    return ElementSettings(found)


def is_setting(word: str) -> bool:
    """Whether a word of a command is a setting, not the name of something."""
    return "=" in word or word.lower() in _BARE


def read_settings(words: Sequence[str]) -> ElementSettings:
    """The settings in words such as `divider=5`, `size=10s`, `on`. Raises ElementError."""
    pairs = []
    for word in words:
        key, _, value = word.partition("=") if "=" in word else (_ENABLED.name, "", word)
        if not is_setting(word):
            keys = ", ".join(f"{option.keys[0]}=" for option in OPTIONS)
            raise ElementError(
                f"'{shorten(word)}' is no setting: write {keys} or {' or '.join(_BARE)}; nothing was changed"
            )
        pairs.append((key, value))
    return _read(pairs)


# ------------------------------------------------------------------------------------------------------------ showing


def phrase(name: str, value: OptionValue) -> str:
    """A value in a sentence or a list of differences: `on`, `20`, `save and publish`, `looping`."""
    option = OPTION[name]
    if not option.words:
        return str(value)
    word = option.word_of(value)
    return word.phrase or word.word


def examples(option: ElementOption) -> str:
    """What may be typed for an option, in a few words."""
    return " ".join(option.examples or [word.word for word in option.words])


def help_rows() -> list[tuple[str, str]]:
    """One row per setting, for help: an example, and what it means."""
    rows = []
    for option in OPTIONS:
        if option is _ENABLED:
            rows.append((", ".join(_BARE), option.meaning))
        elif option.words:
            words = [f"{word.word} ({word.meaning})" if word.meaning else word.word for word in option.words]
            rows.append((f"{option.keys[0]}={option.words[0].word}", ", ".join(words)))
        else:
            first, *more = option.examples
            also = f"; also {' '.join(more)}" if more else ""
            rows.append((f"{option.keys[0]}={first}", f"{option.meaning}{also}"))
    return rows


def completions(start: str) -> list[str]:
    """Settings that `start` may become: keys with their `=`, behind it the values of those that have few."""
    key, sign, value = start.partition("=")
    if not sign:
        keys = [f"{key}=" for option in OPTIONS for key in option.keys[:2]]
        return [word for word in (*_BARE, *keys) if word.startswith(start) and word != start]
    option = _KEYS.get(key.lower())
    words = option.words if option else ()
    return [f"{key}={word.word}" for word in words if word.word.startswith(value) and word.word != value]


def diff_options(table: Sequence[ElementInfo], options: Sequence[ElementOptions]) -> list[FieldChange]:
    """What changes when the elements of `table` get `options` (same order and length), one entry per field."""
    changes: list[FieldChange] = []
    for info, new in zip(table, options, strict=True):
        old = info.options
        if new == old:
            continue
        changes.extend(
            FieldChange(info.name, field, phrase(field, getattr(old, field)), phrase(field, getattr(new, field)))
            for field in ElementOptions.__struct_fields__
            if getattr(old, field) != getattr(new, field)
        )
    return changes

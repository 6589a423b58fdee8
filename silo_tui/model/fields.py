"""The five fields of an element that can be edited: their names, words, and what people may type for them."""

import enum
import math
import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silo.model import MAX_BUFFER_SIZE, MAX_DIVIDER, Action, BufferType, ElementOptions

Ints = NDArray[np.int64]


class Field(enum.IntEnum):
    """The editable columns, in the order of the screen."""

    ENABLED = 0
    DIVIDER = 1
    ACTION = 2
    BUFFER_TYPE = 3
    BUFFER_SIZE = 4

    @property
    def title(self) -> str:
        """Head of the column."""
        return ("on", "div", "act", "buf", "size")[self]

    @property
    def label(self) -> str:
        """The field in a sentence."""
        return ("logging", "divider", "action", "buffer type", "buffer size")[self]

    @property
    def cycles(self) -> bool:
        """Whether the field has a few values to step through, rather than a number to type."""
        return self not in {Field.DIVIDER, Field.BUFFER_SIZE}


ACTION_WORDS = {Action.SAVE_AND_PUBLISH: "both", Action.SAVE: "save", Action.PUBLISH: "pub"}
BUFFER_WORDS = {BufferType.FIXED: "fix", BufferType.LOOPING: "loop", BufferType.GROWING: "grow"}
# the order in which a key press steps: the most wanted change first
ACTION_CYCLE = (Action.SAVE, Action.SAVE_AND_PUBLISH, Action.PUBLISH)
BUFFER_CYCLE = (BufferType.LOOPING, BufferType.FIXED, BufferType.GROWING)

_ACTION_SYNONYMS = {
    "save": Action.SAVE, "pub": Action.PUBLISH, "publish": Action.PUBLISH, "both": Action.SAVE_AND_PUBLISH,
    "save_and_publish": Action.SAVE_AND_PUBLISH, "save+publish": Action.SAVE_AND_PUBLISH,
}  # fmt: skip
_BUFFER_SYNONYMS = {
    "fix": BufferType.FIXED, "fixed": BufferType.FIXED, "fixed_size": BufferType.FIXED, "loop": BufferType.LOOPING,
    "looping": BufferType.LOOPING, "grow": BufferType.GROWING, "growing": BufferType.GROWING,
    "exponentially_growing": BufferType.GROWING,
}  # fmt: skip
_ENABLED_SYNONYMS = {"on": 1, "yes": 1, "true": 1, "1": 1, "x": 1, "off": 0, "no": 0, "false": 0, "0": 0}
_SECONDS = {"ms": 1e-3, "s": 1.0, "sec": 1.0, "min": 60.0, "h": 3600.0}
_EXPRESSION = re.compile(r"\s*([=*/+-]?)\s*([0-9]*\.?[0-9]+(?:e[0-9]+)?)\s*(ms|sec|s|min|h|hz|k|M|)\s*$", re.IGNORECASE)


def word_for(field: Field, value: int) -> str:
    """How a value stands in its cell."""
    if field is Field.ENABLED:
        return "[x]" if value else "[ ]"
    if field is Field.ACTION:
        return ACTION_WORDS[Action(value)]
    if field is Field.BUFFER_TYPE:
        return BUFFER_WORDS[BufferType(value)]
    return str(value)


def phrase_for(field: Field, value: int) -> str:
    """How a value reads in a sentence or a diff."""
    if field is Field.ENABLED:
        return "on" if value else "off"
    if field is Field.ACTION:
        return {0: "save and publish", 1: "save", 2: "publish"}[value]
    if field is Field.BUFFER_TYPE:
        return {0: "fixed", 1: "looping", 2: "growing"}[value]
    return str(value)


def values_of(options: ElementOptions) -> tuple[int, int, int, int, int]:
    """The options as numbers, in the order of `Field`."""
    return int(options.enabled), options.divider, int(options.action), int(options.buffer_type), options.buffer_size


def options_of(values: Ints) -> ElementOptions:
    """The inverse of `values_of`; `values` has shape `(5,)`."""
    enabled, divider, action, buffer_type, size = (int(value) for value in values)
    return ElementOptions(bool(enabled), divider, Action(action), BufferType(buffer_type), size)


def synonym(field: Field, text: str) -> int | None:
    """The value that a word stands for in a field with few values; None for an unknown word."""
    words: dict[str, int] = {
        Field.ENABLED: _ENABLED_SYNONYMS,
        Field.ACTION: {word: int(value) for word, value in _ACTION_SYNONYMS.items()},
        Field.BUFFER_TYPE: {word: int(value) for word, value in _BUFFER_SYNONYMS.items()},
    }.get(field, {})
    return words.get(text.strip().lower())


def next_value(field: Field, value: int) -> int:
    """The value after `value` when a key steps through the field."""
    if field is Field.ENABLED:
        return int(not value)
    cycle = [int(step) for step in (ACTION_CYCLE if field is Field.ACTION else BUFFER_CYCLE)]
    return cycle[(cycle.index(value) + 1) % len(cycle)]


@dataclass(frozen=True)
class Change:
    """What somebody typed for a field: `operator` one of `=`, `*`, `/`, `+`, `-`, `s` (seconds), `Hz` (rate)."""

    operator: str
    amount: float

    def on(self, field: Field, values: Ints, dividers: Ints, frequency_hz: float) -> Ints:
        """New values, shape as `values`. ValueError names the first one that would be out of range."""
        if self.operator == "s":
            # rounded before ceil as silo.model.buffer_size_for does: 0.1 s x 30 Hz is 3.0000000000000004
            new = np.maximum(1, np.ceil(np.round(self.amount * frequency_hz / dividers, 6)))
        elif self.operator == "Hz":
            new = np.maximum(1, np.round(np.full(values.shape, frequency_hz / self.amount)))
        else:
            old = values.astype(np.float64)
            new = {
                "=": np.full(values.shape, self.amount), "*": old * self.amount,
                "/": np.ceil(old / self.amount) if self.amount else np.full(values.shape, np.inf),
                "+": old + self.amount, "-": old - self.amount,
            }[self.operator]  # fmt: skip
        if field.cycles:
            return np.asarray(new).astype(np.int64)  # a word, which parse_change knew
        limit = MAX_DIVIDER if field is Field.DIVIDER else MAX_BUFFER_SIZE
        wrong = ~((new >= 1) & (new <= limit))
        if wrong.any():
            bad = float(new[wrong][0])
            shown = f"{bad:.0f}" if math.isfinite(bad) else str(bad)
            raise ValueError(f"{field.label} must be 1 ... {limit}, got {shown}")
        return np.round(new).astype(np.int64)


def parse_change(field: Field, text: str) -> Change:
    """`1000`, `=1000`, `*2`, `/2`, `+10`, `10s`, `500ms`, `50Hz` or a word; ValueError says what is possible."""
    if field.cycles:
        value = synonym(field, text.lstrip("= "))
        if value is None:
            words = {Field.ENABLED: "on, off", Field.ACTION: "save, pub, both", Field.BUFFER_TYPE: "loop, fix, grow"}
            raise ValueError(f"{field.label}: {text!r} is none of {words[field]}")
        return Change("=", value)
    match = _EXPRESSION.match(text)
    possible = "1000, *2, /2, +10, 10s" if field is Field.BUFFER_SIZE else "5, *2, /2, +1, 50Hz"
    if match is None:
        raise ValueError(f"{field.label}: can't read {text!r}; try {possible}")
    operator, number, unit = match[1] or "=", float(match[2]), match[3]
    if unit.lower() in _SECONDS:
        if field is not Field.BUFFER_SIZE or operator != "=":
            raise ValueError(f"{field.label}: a time like {text.strip()!r} only sets the buffer size; try {possible}")
        return Change("s", number * _SECONDS[unit.lower()])
    if unit.lower() == "hz":
        if field is not Field.DIVIDER or operator != "=" or number <= 0:
            raise ValueError(f"{field.label}: a rate like {text.strip()!r} only sets the divider; try {possible}")
        return Change("Hz", number)
    scale = {"k": 1e3, "m": 1e6}.get(unit.lower(), 1.0)
    if operator == "=" and number * scale != int(number * scale):
        raise ValueError(f"{field.label} must be a whole number, got {text.strip()}")
    return Change(operator, number * scale)

"""The five fields of an element that can be edited, as columns of numbers. Their words stand in `silo.settings`."""

import enum
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import ElementOptions
from silo.settings.options import OPTIONS, ElementOption
from silo.settings.typed import ElementSettings, phrase, read_options, read_word

Ints = NDArray[np.int64]


class Field(enum.IntEnum):
    """The editable columns, in the order of the screen."""

    ENABLED = 0
    DIVIDER = 1
    ACTION = 2
    BUFFER = 3
    SIZE = 4

    @property
    def label(self) -> str:
        """The field in a sentence."""
        return "logging" if self is Field.ENABLED else self.option.name

    @property
    def cycles(self) -> bool:
        """Whether the field has a few values to step through, rather than a number to type."""
        return bool(self.option.words)

    @property
    def option(self) -> ElementOption:
        """What may be typed for it, and what its values are called."""
        return OPTIONS[self]


def word_for(field: Field, value: int) -> str:
    """How a value stands in its cell."""
    if field is Field.ENABLED:
        return "[x]" if value else "[ ]"
    return field.option.word_of(value).cell if field.cycles else str(value)


def phrase_for(field: Field, value: int) -> str:
    """How a value reads in a sentence or a diff."""
    return phrase(field.option.name, value)


def values_of(options: ElementOptions) -> tuple[int, ...]:
    """The options as numbers, in the order of `Field`."""
    return tuple(int(getattr(options, option.name)) for option in OPTIONS)


def options_of(values: Ints) -> ElementOptions:
    """The inverse of `values_of`; `values` has shape `(5,)`."""
    made: dict[str, Any] = {option.name: option.kind(value) for option, value in zip(OPTIONS, values, strict=True)}
    return ElementOptions(**made)


def rows_of(options: Sequence[ElementOptions]) -> Ints:
    """The options of several elements as numbers, shape `(5, n)`."""
    rows: Ints = np.array([values_of(each) for each in options], np.int64).reshape(-1, len(Field))
    return np.ascontiguousarray(rows.T)


def synonym(field: Field, text: str) -> int | None:
    """The value that a word stands for in a field with few values; None for an unknown word."""
    value = read_word(field.option, text)
    return None if value is None else int(value)


def parse_change(field: Field, text: str) -> ElementSettings:
    """What was typed for one field: `1000`, `=1000`, `*2`, `10s`, `50Hz`, a word. Raises ElementError."""
    return read_options({field.option.name: text})

"""The `field:value` terms of the filter language: how each is read, completed, and what has to be surveyed for it.

Terms of columns stand with their column in `table_columns.py`, those of what has no column in `OTHER_TERMS` below.
"""

import operator
from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np

from silo.core.arrays.columns import Floats
from silo.core.elements import BufferType, ElementInfo
from silo.core.quantities.reading import seconds_of
from silo_tui.model.table.facts import BITS, RED_HIGH, RED_LOW
from silo_tui.model.table.fields import Field, Ints, synonym
from silo_tui.model.table.state import Mask, TableState
from silo_tui.model.words.states import FULL

COMPARE: dict[str, Callable[[Any, Any], Any]] = {
    ">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le, "=": operator.eq, ":": operator.eq,
    "!=": operator.ne,
}  # fmt: skip

_SCALES = {"k": 1e3, "M": 1e6, "G": 1e9}

Test = Callable[[TableState, Mask, Ints], Mask]  # of a table, of what is marked, of settings: wanted, or in force


class Term(msgspec.Struct, frozen=True):
    """One field of the filter language.

    `read` takes sign and value and returns a test, or the words that say why it can't be read. `compares` ones take
    every sign, the others `:`, `=` and `!=`. `completions` are whole terms that Tab offers before the bare names.
    `quantities` have to be surveyed for it; until they are everything passes, so that rows don't flicker away. What is
    `of_settings` is asked of those wanted and of those in force.
    """

    names: tuple[str, ...]
    read: Callable[[str, str], Test | str]
    compares: bool = False
    completions: tuple[str, ...] = ()
    quantities: frozenset[str] = frozenset()
    of_settings: bool = False

    @property
    def bare(self) -> str:
        """The term as far as Tab completes it without a value."""
        return self.names[0] + (">" if self.compares else ":")


def read_number(text: str) -> float | None:
    """Return a number, also as `1k`, `2.5M`; None for what is none."""
    scale = _SCALES.get(text[-1:], 1.0)
    try:
        return float(text[:-1] if scale != 1.0 else text) * scale
    except ValueError:
        return None


def read_seconds(text: str) -> float | None:
    """Return a time in seconds, written with its unit or without; None for what is none.

    `3m` are minutes, as the table writes them: nothing here is counted in millions or in megabytes.
    """
    try:
        return float(text)
    except ValueError:
        return seconds_of(f"{text}in" if text[-1:] == "m" else text)


def read_share(text: str) -> float | None:
    """Return a share of 1, also as `95%`; None for what is none."""
    number = read_number(text.removesuffix("%"))
    return number / 100 if number is not None and text.endswith("%") else number


def negate(test: Test) -> Test:
    """Return the test that passes what `test` doesn't."""
    return lambda table, marked, settings: ~test(table, marked, settings)


def number_term(names: tuple[str, ...], field: Field) -> Term:
    """Return a term that compares a field with a number."""

    def read(sign: str, value: str) -> Test | str:
        number = read_number(value)
        if number is None:
            return f"{names[0]}{sign}{value}: {value!r} is no number"
        compare = COMPARE[sign]
        return lambda table, marked, settings: np.asarray(compare(settings[field], number), np.bool_)

    return Term(names, read, compares=True, of_settings=True)


def choice_term(names: tuple[str, ...], field: Field) -> Term:
    """Return a term that asks for one value of a field with a few, by any of their words; cells' words are offered."""
    offered = tuple(f"{names[0]}:{word.cell}" for word in field.option.words)

    def read(sign: str, value: str) -> Test | str:
        wanted = synonym(field, value)
        if wanted is None:
            return f"{value!r}: write {' or '.join(offered)}"
        return _signed(sign, lambda table, marked, settings: np.equal(settings[field], wanted))

    return Term(names, read, completions=offered, of_settings=True)


def action_term(names: tuple[str, ...]) -> Term:
    """Return the term about actions: `save` and `publish` ask what an element does, so those that do both pass too."""

    def read(sign: str, value: str) -> Test | str:
        wanted = synonym(Field.ACTION, value)
        if wanted is None:
            return f"{value!r}: write act:save, act:publish or act:save+pub"
        exact = value.lower() in {"both", "pub"} or "+" in value or "_" in value
        passing = (wanted,) if exact else (wanted, 0)
        return _signed(sign, lambda table, marked, settings: np.isin(settings[Field.ACTION], passing))

    return Term(names, read, completions=("act:save", "act:publish", "act:save+pub"), of_settings=True)


def state_term() -> Term:
    """Return the term about states, also beside a worse one: what is above a red limit is `H`, too."""
    also = {"H": RED_HIGH, "L": RED_LOW}
    offered = tuple(f"state:{word}" for word in (*BITS, FULL))

    def read(sign: str, value: str) -> Test | str:
        word = next((word for word in (*BITS, FULL) if word.casefold() == value.casefold()), None)
        if word is None:
            return f"{value!r}: write {' or '.join(offered)}"
        bits = BITS.get(word, 0) | also.get(word, 0)

        def test(table: TableState, marked: Mask, settings: Ints) -> Mask:
            if word == FULL:
                keeps = table.server[Field.BUFFER] != BufferType.LOOPING
                return np.asarray(keeps & (table.facts.quantities["fill"] >= 1.0))
            return np.asarray((table.signs & bits) != 0)

        return _signed(sign, test)

    return Term(("state",), read, completions=offered, quantities=frozenset({"signs", "fill"}))


def text_term(name: str, passes: Callable[[ElementInfo, str], bool]) -> Term:
    """Return a term about a text of the element; `passes` gets the value in small letters."""

    def read(sign: str, value: str) -> Test | str:
        folded = value.casefold()

        def test(table: TableState, marked: Mask, settings: Ints) -> Mask:
            return np.fromiter((passes(element, folded) for element in table.elements), np.bool_, len(table))

        return _signed(sign, test)

    return Term((name,), read)


def fact_term(
    names: tuple[str, ...], quantity: str, amount: Callable[[str], float | None] = read_number, example: str = "60",
    of: Callable[[Floats], Floats] | None = None,
) -> Term:  # fmt: skip
    """Return a term that compares what is measured with an amount."""

    def read(sign: str, value: str) -> Test | str:
        wanted = amount(value)
        if wanted is None:
            return f"{names[0]}{sign}{value}: {value!r} is no amount; for example {names[0]}{sign}{example}"
        return _compared(quantity, sign, wanted, of)

    return Term(names, read, compares=True, quantities=frozenset({quantity}))


def rate_term() -> Term:
    """Return the term about rates: in Hz, or as a share of the nominal one."""

    def read(sign: str, value: str) -> Test | str:
        if value.endswith("%"):
            share = read_share(value)
            return f"rate{sign}{value}: for example rate{sign}95%" if share is None else _compared("share", sign, share)
        hertz = read_number(value.lower().removesuffix("hz"))
        if hertz is None:
            return f"rate{sign}{value}: {value!r} is no rate; for example rate{sign}95% or rate{sign}50Hz"
        return _compared("rate", sign, hertz)

    return Term(("rate",), read, compares=True, quantities=frozenset({"rate", "share"}))


def _compared(quantity: str, sign: str, wanted: float, of: Callable[[Floats], Floats] | None = None) -> Test:
    compare = COMPARE[sign]

    def test(table: TableState, marked: Mask, settings: Ints) -> Mask:
        known = table.facts.quantities[quantity]
        with np.errstate(invalid="ignore"):
            found = np.asarray(compare(known if of is None else of(known), wanted), np.bool_)
        return found & ~np.isnan(known)  # nothing is known of it, so it isn't unequal either

    return test


def _signed(sign: str, test: Test) -> Test:
    return negate(test) if sign == "!=" else test


OTHER_TERMS = (
    text_term("kind", lambda element, value: element.kind.casefold().startswith(value)),
    text_term("type", lambda element, value: any(value in entry.dtype.casefold() for entry in element.entries)),
    text_term("desc", lambda element, value: value in element.description.casefold()),
)

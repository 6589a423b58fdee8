"""The terms of the filter language about what is measured: `value>60`, `rate<95%`, `changed<1s`.

Until a survey has told a quantity its terms let everything pass, so that rows don't flicker away while one is typed.
"""

import re
from collections.abc import Callable

import numpy as np

from silo.core.arrays.columns import Floats
from silo.core.quantities.reading import seconds_of
from silo_tui.model.table import Mask, TableState
from silo_tui.model.terms import COMPARE, Term, Test, read_number

Amount = Callable[[str], "float | None"]


def _seconds(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return seconds_of(text)


def _share(text: str) -> float | None:
    number = read_number(text.removesuffix("%"))
    return number / 100 if number is not None and text.endswith("%") else number


def _fact_term(
    names: tuple[str, ...], quantity: str, amount: Amount = read_number, example: str = "60",
    of: Callable[[Floats], Floats] | None = None,
) -> Term:  # fmt: skip
    def read(sign: str, value: str) -> Test | str:
        wanted = amount(value)
        if wanted is None:
            return f"{names[0]}{sign}{value}: {value!r} is no amount; for example {names[0]}{sign}{example}"
        return _compared(quantity, sign, wanted, of)

    return Term(names, read, compares=True)


def _compared(quantity: str, sign: str, wanted: float, of: Callable[[Floats], Floats] | None = None) -> Test:
    compare = COMPARE[sign]

    def test(table: TableState, marked: Mask) -> Mask:
        known = table.facts.of(quantity, len(table))
        if known is None:
            return np.ones(len(table), np.bool_)
        with np.errstate(invalid="ignore"):
            found = np.asarray(compare(known if of is None else of(known), wanted), np.bool_)
        return found & ~np.isnan(known)  # nothing is known of it, so it isn't unequal either

    return test


def _read_rate(sign: str, value: str) -> Test | str:
    if value.endswith("%"):
        share = _share(value)
        return f"rate{sign}{value}: for example rate{sign}95%" if share is None else _compared("share", sign, share)
    hertz = read_number(value.lower().removesuffix("hz"))
    if hertz is None:
        return f"rate{sign}{value}: {value!r} is no rate; for example rate{sign}95% or rate{sign}50Hz"
    return _compared("rate", sign, hertz)


FACT_TERMS = (
    _fact_term(("value",), "value"),
    _fact_term(("|value|", "abs"), "value", of=np.abs),
    _fact_term(("min",), "min"),
    _fact_term(("max",), "max"),
    _fact_term(("mean",), "mean"),
    _fact_term(("std",), "std", example="1"),
    Term(("rate",), _read_rate, compares=True),
    _fact_term(("fill",), "fill", _share, "50%"),
    _fact_term(("jitter",), "jitter", _seconds, "1ms"),
    _fact_term(("changed",), "changed", _seconds, "1s"),
)
QUANTITY_OF = {"|value|": "value", "abs": "value"}


def quantities_in(text: str) -> set[str]:
    """Return what has to be surveyed for a filter."""
    found = set()
    for word in re.findall(r"(\|?[a-z]+\|?)(?:>=|<=|!=|>|<|=|:)", text.casefold()):
        name = QUANTITY_OF.get(word, word)
        if any(word in term.names for term in FACT_TERMS):
            found |= {"rate", "share"} if name == "rate" else {name}
    return found

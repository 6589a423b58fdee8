"""Limits of a signal as lines to type. Pure functions."""

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any, TypeVar

from msgspec.structs import replace

from silo.conditions.standing import reach_of
from silo.core.conditions import NO_BOUNDS, Bounds, LimitOptions, SignalLimits
from silo.judging.checks import MOST_STALE_S, seconds

BOUNDS = {"LL": "red low", "L": "yellow low", "H": "yellow high", "HH": "red high"}  # their lines, and what they are
NONE = LimitOptions()
HYSTERESIS = 0.02  # of the range between bounds, where nobody says another: noise at a bound is one alarm

Number = TypeVar("Number", int, float)


def fields_of(limits: SignalLimits) -> dict[str, str]:
    """Return limits as lines to edit, by label: their bounds, `hyst`, and what else differs from limits
    that say no more.
    """
    bounds = zip(BOUNDS, limits.bounds, strict=True)
    fields = {word: _exact(bound) for word, bound in bounds if bound is not None}
    fields["persist"] = str(limits.persistence) if limits.persistence != NONE.persistence else ""
    fields["hyst"] = _exact(limits.hysteresis)
    fields["stale"] = f"{_exact(limits.stale_s)}s" if limits.stale_s else ""
    return {**fields, "when": limits.when}


def _exact(number: float) -> str:
    """Return the shortest text that reads as the same number: a line that nobody touches changes nothing."""
    return repr(number).removesuffix(".0")


def limits_of_fields(fields: Mapping[str, str], before: SignalLimits, *, whole: bool = False) -> SignalLimits:
    """Return the limits `before` with the bounds that lines say, and what else they say.

    `whole`: they show all of `before`, so that what is empty there is to be as without it.
    Where nothing is said of hysteresis that is `HYSTERESIS`. Raises ElementError or ValueError, in words fit to show.
    """

    def given(label: str, what: str, read: Callable[[str], Number]) -> Number | None:
        typed = fields.get(label, "").strip()
        try:
            return read(typed) if typed not in ("", "-") else None
        except ValueError:
            raise ValueError(f"{label} is {what}, a {'whole ' * (read is int)}number; got {typed!r}") from None

    low, warn_low, warn_high, high = (given(label, what, float) for label, what in BOUNDS.items())
    bounds: Bounds = (low, warn_low, warn_high, high)
    typed = [(label, bound) for label, bound in zip(BOUNDS, bounds, strict=True) if bound is not None]
    if any(one > other for (_, one), (_, other) in pairwise(typed)):
        told = ", ".join(f"{label} {_exact(bound)}" for label, bound in typed)
        raise ValueError(f"bounds must rise from LL over L and H to HH, got {told}")
    stale = fields.get("stale", "").strip()
    made: dict[str, Any] = {
        "persistence": given("persist", "how many samples in a row", int),
        "hysteresis": given("hyst", "how far inside it ends", float),
        "stale_s": seconds("stale", stale, MOST_STALE_S) if stale else None,
        "when": fields.get("when", "").strip() or None,
    }
    empty = NONE if whole else before
    if whole or before.bounds == NO_BOUNDS:
        empty = replace(empty, hysteresis=float(f"{HYSTERESIS * reach_of(bounds):.2g}"))
    made = {name: getattr(empty, name) if value is None else value for name, value in made.items()}
    return replace(before, bounds=bounds, **made)

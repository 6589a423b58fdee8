"""Limits of a signal as lines to type. Pure functions."""

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import TypeVar

from silo.core.conditions import SignalLimits
from silo.judging.checks import MOST_STALE_S, seconds
from silo_tui.model.plots.limits import Bounds4
from silo_tui.model.words import text

BOUNDS = {"LL": "red low", "L": "yellow low", "H": "yellow high", "HH": "red high"}  # their lines, and what they are

Number = TypeVar("Number", int, float)


def fields_of(limits: SignalLimits) -> dict[str, str]:
    """Return limits as lines to edit, by label: their bounds, and what differs from limits that say no more."""
    fields = {
        word: text.short(bound, 12) for word, bound in zip(BOUNDS, limits.bounds, strict=True) if bound is not None
    }
    fields["persist"] = str(limits.persistence) if limits.persistence != 1 else ""
    fields["hyst"] = text.short(limits.hysteresis, 12) if limits.hysteresis else ""
    fields["stale"] = f"{text.short(limits.stale_s, 12)}s" if limits.stale_s else ""
    return {**fields, "when": limits.when}


def limits_of_fields(fields: Mapping[str, str], before: SignalLimits) -> SignalLimits:
    """Return limits of the signal of `before`, which has what the lines say nothing of, but for bounds.

    Raises ElementError or ValueError, in words fit to show.
    """

    def given(label: str, what: str, read: Callable[[str], Number]) -> Number | None:
        typed = fields.get(label, "").strip()
        try:
            return read(typed) if typed not in ("", "-") else None
        except ValueError:
            raise ValueError(f"{label} is {what}, a {'whole ' * (read is int)}number; got {typed!r}") from None

    low, warn_low, warn_high, high = (given(label, what, float) for label, what in BOUNDS.items())
    bounds: Bounds4 = (low, warn_low, warn_high, high)
    typed = [(label, bound) for label, bound in zip(BOUNDS, bounds, strict=True) if bound is not None]
    if any(one > other for (_, one), (_, other) in pairwise(typed)):
        told = ", ".join(f"{label} {text.short(bound, 12)}" for label, bound in typed)
        raise ValueError(f"bounds must rise from LL over L and H to HH, got {told}")
    persistence = given("persist", "how many samples in a row", int)
    hysteresis = given("hyst", "how far inside it ends", float)
    stale = fields.get("stale", "").strip()
    return SignalLimits(
        before.name,
        bounds,
        before.persistence if persistence is None else persistence,
        before.hysteresis if hysteresis is None else hysteresis,
        seconds("stale", stale, MOST_STALE_S) if stale else before.stale_s,
        fields.get("when", "").strip() or before.when,
    )

"""Limits of signals: where their lines lie in plots, what is outside, and the lines to type. Pure functions."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np

from silo.core.conditions import SignalLimits
from silo.judging.checks import MOST_STALE_S, seconds
from silo_tui.model.drawing.plots import Axis
from silo_tui.model.words import text

Bounds4 = tuple[float | None, float | None, float | None, float | None]
"""Red low, yellow low, yellow high, red high; None for none."""

NO_BOUNDS: Bounds4 = (None, None, None, None)
WORDS = ("LL", "L", "H", "HH")


def inner(bounds: Mapping[str, Bounds4], name: str) -> tuple[float | None, float | None]:
    """Return the smallest and the largest value of a scalar that is within its limits."""
    return between(bounds.get(name, NO_BOUNDS))


def between(bounds: Bounds4) -> tuple[float | None, float | None]:
    """Return the bounds that are met first: the yellow ones, or where there is none the red ones."""
    red_low, low, high, red_high = bounds
    return red_low if low is None else low, red_high if high is None else high


@dataclass(frozen=True)
class LimitLine:
    """A bound in a plot: its line of cells (0 on top); `beyond` tells where it lies outside: -1 above, 1 below."""

    word: str
    line: int
    beyond: int = 0

    @property
    def red(self) -> bool:
        """Whether it is one of the outer bounds."""
        return len(self.word) == 2

    @property
    def mark(self) -> str:
        """What stands beside its line."""
        return self.word + {-1: "▲", 0: "", 1: "▼"}[self.beyond]


def lines_of(bounds: Bounds4, axis: Axis, height: int) -> list[LimitLine]:
    """Return the lines of limits in a plot of `height` lines; none where the plot has no scale."""
    found = (_line(word, bound, axis, height) for word, bound in zip(WORDS, bounds, strict=True) if bound is not None)
    return [line for line in found if line is not None]


def level_line(level: float, axis: Axis, height: int) -> list[LimitLine]:
    """Return the line of a level that is waited for, in a list; an empty one where the plot has no scale."""
    line = _line("level", level, axis, height)
    return [line] if line is not None else []


def _line(word: str, value: float, axis: Axis, height: int) -> LimitLine | None:
    bottom, top = axis.scale
    if not top > bottom:
        return None
    offset = np.array([float(value - axis.base)])
    place = float(axis.places(offset)[0])
    if place > top:
        return LimitLine(word, 0, -1)
    if not place >= bottom:
        return LimitLine(word, height - 1, 1)
    return LimitLine(word, (4 * height - 1 - int(axis.rows(offset, 4 * height)[0])) // 4)


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

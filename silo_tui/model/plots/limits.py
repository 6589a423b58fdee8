"""Limits of signals as plots know them: where their lines lie, and what is outside. Pure functions."""

from collections.abc import Mapping

import msgspec
import numpy as np

from silo.core.conditions import NO_BOUNDS, Bounds
from silo_tui.model.drawing.plots import Axis

WORDS = ("LL", "L", "H", "HH")


def inner(bounds: Mapping[str, Bounds], name: str) -> tuple[float | None, float | None]:
    """Return the smallest and the largest value of a scalar that is within its limits."""
    return between(bounds.get(name, NO_BOUNDS))


def between(bounds: Bounds) -> tuple[float | None, float | None]:
    """Return the bounds that are met first: the yellow ones, or where there is none the red ones."""
    red_low, low, high, red_high = bounds
    return red_low if low is None else low, red_high if high is None else high


class LimitLine(msgspec.Struct, frozen=True):
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


def lines_of(bounds: Bounds, axis: Axis, height: int) -> list[LimitLine]:
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

"""An axis by powers of ten, for any values: where there are zeros or negative ones, it is linear next to zero.

Pure functions. A value is `place`d on the axis; there every power of ten is a whole number.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from silo_tui.model.drawing import axes, braille
from silo_tui.model.drawing.columns import Floats

DECADES = 6  # below the largest value: what is smaller lies next to zero


@dataclass(frozen=True)
class LogAxis:
    """`least` is a power of ten: with `signed` the axis is linear from `-least` to `least`, else it has no zero."""

    least: float = 1.0
    signed: bool = False

    def place(self, values: Floats) -> Floats:
        """Return where values stand; -inf for those below every power of ten."""
        with np.errstate(divide="ignore", invalid="ignore"):
            if not self.signed:
                return np.where(
                    values > 0, np.log10(np.maximum(values, 0.0)), np.where(np.isnan(values), np.nan, -np.inf)
                )
            sizes = np.abs(values) / self.least
            return np.sign(values) * np.where(sizes <= 1, sizes, 1 + np.log10(np.maximum(sizes, 1.0)))

    def value(self, place: float) -> float:
        """Return the value that stands at a place."""
        if not self.signed:
            return float(10.0**place)
        size = abs(place)
        return math.copysign(self.least * (size if size <= 1 else 10.0 ** (size - 1)), place)


def axis_of(values: Sequence[Floats]) -> LogAxis | None:
    """Return the axis that shows these values; None where none of them is a finite number."""
    finite = np.concatenate([some[np.isfinite(some)] for some in values])
    if not len(finite):
        return None
    sizes = np.abs(finite[finite != 0])
    if not len(sizes):
        return LogAxis(1.0, signed=True)
    top = float(sizes.max())
    least = max(math.floor(math.log10(float(sizes.min())) + 1e-9), math.floor(math.log10(top)) - DECADES)
    return LogAxis(10.0 ** max(least, -300), signed=bool(finite.min() <= 0))


def scale_of(axis: LogAxis, smallest: float, largest: float) -> axes.Scale:
    """Return the whole powers of ten around two values, as places."""
    low, high = axis.place(np.array([smallest, largest])).tolist()
    bottom, top = math.floor(low + 1e-9), math.ceil(high - 1e-9)
    return float(bottom), float(max(top, bottom + 1))


def words_of(axis: LogAxis, scale: axes.Scale, lines: int) -> dict[int, str]:
    """Return what stands on which line of the axis."""
    first, last = round(scale[0]), round(scale[1])
    apart = max(1, -(-(last - first) // max(1, lines // 2)))
    places = np.arange(-(-first // apart) * apart, last + 1, apart, dtype=np.float64)  # zero is one of them
    rows = braille.row_of(places, scale, 4 * lines)
    return {
        int((4 * lines - 1 - row) // 4): _word(axis.value(place))
        for row, place in zip(rows.tolist(), places.tolist(), strict=True)
    }


def _word(value: float) -> str:
    if value == 0:
        return "0"
    return f"{'-' if value < 0 else ''}1e{round(math.log10(abs(value)))}"

"""Plots made of braille dots, two columns and four rows per cell, drawn from minimum and maximum per column.

Measured: 5 - 8 ms for a screen full of them, where plotext needs 140 ms for one series. A column always covers all
between its minimum and its maximum, so that a spike of one sample shows whatever the zoom.
"""

import math

import numpy as np
from numpy.typing import NDArray

from silo_tui.model.columns import Floats

# value of each dot by (row, column) inside a cell
_DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], np.uint32)
# not U+2800: some fonts draw its dots, and a space is one byte instead of three
BLANK = " "
TINY = 1e-200  # below, powers of ten run out


def rasterise(low: Floats, high: Floats, scale: tuple[float, float], width: int, height: int) -> list[str]:
    """`height` lines of `width` braille cells showing `2 * width` columns between the ends of `scale`.

    Columns that are NaN stay empty; what lies outside of the range is drawn at its edge.
    """
    bottom, top = scale
    columns, rows = 2 * width, 4 * height
    low, high = _fit(low, columns), _fit(high, columns)
    if width < 1 or height < 1:
        return []
    per_unit = (rows - 1) / (top - bottom) if top > bottom else 0.0
    valid = ~(np.isnan(low) | np.isnan(high))
    # row 0 is the highest; infinite values belong to the edge of their side
    with np.errstate(invalid="ignore", over="ignore"):
        upper = np.where(valid, (top - high) * per_unit if per_unit else rows // 2, rows)
        lower = np.where(valid, (top - low) * per_unit if per_unit else rows // 2, -1)
    upper = np.round(np.clip(np.nan_to_num(upper, nan=rows), 0, rows)).astype(np.int64)
    lower = np.round(np.clip(np.nan_to_num(lower, nan=-1), -1, rows - 1)).astype(np.int64)
    upper = np.where(valid, np.minimum(upper, rows - 1), rows)
    _join(upper, lower, valid)
    at = np.arange(rows)[:, None]
    dots = (at >= upper) & (at <= lower)
    cells = (dots.reshape(height, 4, width, 2) * _DOTS[None, :, None, :]).sum(axis=(1, 3)).astype(np.uint32) + 0x2800
    cells[cells == 0x2800] = ord(BLANK)
    return [line.tobytes().decode("utf-32-le") for line in cells.astype("<u4")]


def _join(upper: NDArray[np.int64], lower: NDArray[np.int64], valid: NDArray[np.bool_]) -> None:
    """Stretches each column half way to its neighbour, so that a steep line has no holes."""
    both = valid[1:] & valid[:-1]
    above = both & (lower[1:] < upper[:-1] - 1)  # the next column lies higher
    below = both & (upper[1:] > lower[:-1] + 1)
    middle_above = (lower[1:] + upper[:-1]) // 2
    middle_below = (upper[1:] + lower[:-1]) // 2
    new_upper, new_lower = upper.copy(), lower.copy()
    new_lower[1:] = np.where(above, np.maximum(new_lower[1:], middle_above), new_lower[1:])
    new_upper[:-1] = np.where(above, np.minimum(new_upper[:-1], middle_above), new_upper[:-1])
    new_upper[1:] = np.where(below, np.minimum(new_upper[1:], middle_below), new_upper[1:])
    new_lower[:-1] = np.where(below, np.maximum(new_lower[:-1], middle_below), new_lower[:-1])
    upper[:], lower[:] = new_upper, new_lower


def _fit(values: Floats, columns: int) -> Floats:
    """The newest `columns` values, NaN in front where there are fewer."""
    if len(values) >= columns:
        return values[len(values) - columns :]
    return np.concatenate([np.full(columns - len(values), np.nan), values])


def value_range(low: Floats, high: Floats) -> tuple[float, float] | None:
    """Smallest and largest finite value; None when there is none."""
    finite_low, finite_high = low[np.isfinite(low)], high[np.isfinite(high)]
    if not len(finite_low) or not len(finite_high):
        return None
    return float(finite_low.min()), float(finite_high.max())


def nice_range(smallest: float, largest: float) -> tuple[float, float]:
    """A range with round ends that holds both values; steady while the values stay inside of it."""
    extent = largest - smallest
    floor = max(abs(smallest), abs(largest), TINY) * 1e-6
    if not extent > floor:  # a constant: in the middle of a range around it
        half = max(abs(largest) * 0.1, TINY) if abs(largest) > TINY else 1.0
        return smallest - half, largest + half
    raw = extent / 8
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(factor * power for factor in (1, 2, 2.5, 5, 10) if factor * power >= raw * 0.999)
    return math.floor(smallest / step + 1e-9) * step, math.ceil(largest / step - 1e-9) * step

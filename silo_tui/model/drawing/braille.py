"""Plots made of braille dots, two columns and four rows per cell, drawn from minimum and maximum per column.

Measured: 5 - 8 ms for a screen full of them, where plotext needs 140 ms for one series. A column always covers all
between its minimum and its maximum, so that a spike of one sample shows whatever the zoom. NaN and inf have marks at
the bottom and at their end of the scale; where data is missing a shade stands, and why if there is room.
"""

import math
from itertools import pairwise
from typing import TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.columns import HOLE_TEXTS, Floats, Gap, Marks, NonFinite, holes_of
from silo_tui.model.drawing import dots
from silo_tui.model.drawing.dots import Cells, Dots

POS_INF, NEG_INF, NAN, SEVERAL = "▲", "▼", "×", "!"
SHADE = "░"
Scales: TypeAlias = tuple[float, float] | tuple[Floats, Floats]  # bottom and top, of one signal or of each
CONSTANT = 1e-13  # a smaller share of the value is rounding, not a change


def rasterise(
    low: Floats, high: Floats, scale: tuple[float, float], width: int, height: int, marks: Marks | None = None
) -> list[str]:
    """Return `height` lines of `width` cells showing `2 * width` columns between the ends of `scale`.

    Columns that are NaN stay empty; what lies outside of the range is drawn at its edge. `marks` are those of
    `silo.core.arrays.columns`, one per column.
    """
    if width < 1 or height < 1:
        return []
    cells = dots.cells(curve(low, high, scale, width, height))
    if marks is not None and len(marks):
        draw_over(cells, low, marks)
    return dots.lines_of(cells)


def draw_over(cells: Cells, low: Floats, marks: Marks) -> None:
    """Draw marks and holes of a signal over what was drawn of it."""
    draw_marks(cells, marks)
    for hole in holes(low, marks, cells.shape[1]):
        draw_hole(cells, hole)


def curve(low: Floats, high: Floats, scale: Scales, width: int, height: int) -> Dots:
    """Return the dots of a curve, shape `(4 * height, 2 * width)`, row 0 on top: neighbouring columns are joined.

    Of many curves at once, of shape `(signals, columns)` with as many scales, shape `(signals, 4 * height, 2 * width)`.
    """
    columns, rows = 2 * width, 4 * height
    low, high = _fit(low, columns), _fit(high, columns)
    valid = ~(np.isnan(low) | np.isnan(high))
    # row 0 is the highest; infinite values belong to the edge of their side
    upper = np.where(valid, rows - 1 - row_of(high, scale, rows), rows)
    lower = np.where(valid, rows - 1 - row_of(low, scale, rows), -1)
    _join(upper, lower, valid)
    at = np.arange(rows)[:, None]
    lit: Dots = (at >= upper[..., None, :]) & (at <= lower[..., None, :])
    return lit


def row_of(values: Floats, scale: Scales, rows: int) -> NDArray[np.int64]:
    """Return the row of each value, 0 at the bottom, whatever the size of the numbers."""
    bottom, top = (np.asarray(end, np.float64)[..., None] for end in scale)
    with np.errstate(invalid="ignore", over="ignore", under="ignore"):
        # as shares of the largest end: neither 1e308 - -1e308 nor 1 / 1e-310 fits into a float
        _, exponent = np.frexp(np.maximum(np.abs(bottom), np.abs(top)))
        first, last = np.ldexp(bottom, -exponent), np.ldexp(top, -exponent)
        rises = last > first
        share = (np.ldexp(values, -exponent) - first) / np.where(rises, last - first, 1.0)
    found = np.round(np.clip(np.nan_to_num(share, nan=0.0), 0.0, 1.0) * (rows - 1)).astype(np.int64)
    return np.where(rises, found, rows // 2)


def _join(upper: NDArray[np.int64], lower: NDArray[np.int64], valid: NDArray[np.bool_]) -> None:
    """Stretch each column half way to its neighbour, so that a steep line has no holes."""
    before, after = np.s_[..., :-1], np.s_[..., 1:]
    both = valid[after] & valid[before]
    above = both & (lower[after] < upper[before] - 1)  # the next column lies higher
    below = both & (upper[after] > lower[before] + 1)
    middle_above = (lower[after] + upper[before]) // 2
    middle_below = (upper[after] + lower[before]) // 2
    new_upper, new_lower = upper.copy(), lower.copy()
    new_lower[after] = np.where(above, np.maximum(new_lower[after], middle_above), new_lower[after])
    new_upper[before] = np.where(above, np.minimum(new_upper[before], middle_above), new_upper[before])
    new_upper[after] = np.where(below, np.minimum(new_upper[after], middle_below), new_upper[after])
    new_lower[before] = np.where(below, np.maximum(new_lower[before], middle_below), new_lower[before])
    upper[:], lower[:] = new_upper, new_lower


def draw_marks(cells: Cells, marks: Marks) -> None:
    """Draw the marks of NaN and inf over what was drawn in their cells; `marks` are one per column, newest last."""
    pairs = _fit_marks(marks, 2 * cells.shape[1]).reshape(-1, 2)
    flags = pairs[:, 0] | pairs[:, 1]
    kinds = np.zeros(cells.shape, np.int64)
    for flag, line, sign in (
        (NonFinite.POS_INF, 0, POS_INF),
        (NonFinite.NEG_INF, -1, NEG_INF),
        (NonFinite.NAN, -1, NAN),
    ):
        here = flags & flag != 0
        kinds[line, here] += 1
        cells[line, here] = ord(sign)
    cells[kinds > 1] = ord(SEVERAL)


# ---------------------------------------------------------------------------------------------------------- holes


class DrawnHole(msgspec.Struct, frozen=True):
    """Cells `start ... stop - 1` of a plot that have no sample, and why."""

    start: int
    stop: int
    why: Gap


def holes(low: Floats, marks: Marks, width: int) -> list[DrawnHole]:
    """Return where cells have no sample: for a reason that is known, or between samples.

    Before the first and after the last sample nothing is said without a reason.
    """
    columns = 2 * width
    low = _fit(low, columns)
    marks = _fit_marks(marks, columns)
    why = holes_of(marks)
    empty = np.isnan(low) & (marks == why << 4)
    filled = np.flatnonzero(~empty)
    inside = np.zeros(columns, np.bool_)
    if len(filled):
        inside[filled[0] : filled[-1]] = True
    missing = empty & (inside | (why > 0))
    cells = missing.reshape(-1, 2).all(axis=1)
    reasons = np.where(cells, why.reshape(-1, 2).max(axis=1).astype(np.int64), -1)
    edges = np.flatnonzero(np.diff(reasons, prepend=-2, append=-2))
    return [
        DrawnHole(int(start), int(stop), Gap(int(reasons[start])))
        for start, stop in pairwise(edges)
        if reasons[start] >= 0
    ]


def band(height: int) -> range:
    """Return the lines of a plot in which its holes stand."""
    lines = max(1, height // 2)
    return range((height - lines) // 2, (height - lines) // 2 + lines)


def draw_hole(cells: Cells, hole: DrawnHole) -> None:
    """Shade where no sample is, and write why if there is room."""
    lines = band(len(cells))
    words = f" {HOLE_TEXTS[hole.why]} "
    # before the start nothing is missing
    if hole.why is not Gap.BEFORE:
        cells[lines.start : lines.stop, hole.start : hole.stop] = ord(SHADE)
    if len(words) <= hole.stop - hole.start and len(cells) > 1:
        start = hole.start + (hole.stop - hole.start - len(words)) // 2
        cells[lines[len(lines) // 2], start : start + len(words)] = [ord(char) for char in words]


def _fit(values: Floats, columns: int) -> Floats:
    """The newest `columns` values, NaN in front where there are fewer."""
    if values.shape[-1] >= columns:
        return values[..., values.shape[-1] - columns :]
    return np.concatenate([np.full(columns - len(values), np.nan), values])


def _fit_marks(marks: Marks, columns: int) -> Marks:
    return np.concatenate([np.zeros(max(0, columns - len(marks)), np.uint8), marks[-columns:]])


# --------------------------------------------------------------------------------------------------------- scales


def value_range(low: Floats, high: Floats) -> tuple[float, float] | None:
    """Return the smallest and the largest finite value; None when there is none."""
    finite_low, finite_high = low[np.isfinite(low)], high[np.isfinite(high)]
    if not len(finite_low) or not len(finite_high):
        return None
    return float(finite_low.min()), float(finite_high.max())


def is_constant(smallest: float, largest: float) -> bool:
    """Return whether all values are one but for rounding."""
    return not largest - smallest > max(abs(smallest), abs(largest)) * CONSTANT


def room_around(value: float) -> tuple[float, float]:
    """Return a range with a constant in its middle."""
    half = abs(value) * 0.1 or 1.0
    return max(value - half, -_HUGE), min(value + half, _HUGE)


def nice_range(smallest: float, largest: float) -> tuple[float, float]:
    """Return a range with round ends that holds both values; steady while the values stay inside of it."""
    if is_constant(smallest, largest):
        return room_around(largest)
    raw = (largest / 8) - (smallest / 8)
    power = 10.0 ** math.floor(math.log10(raw)) if raw > _SMALLEST else 0.0
    if power <= _SMALLEST:  # powers of ten run out
        return smallest, largest
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= raw * 0.999)
    first, last = math.floor(smallest / step + 1e-9), math.ceil(largest / step - 1e-9)
    return max(first * step, -_HUGE), min(last * step, _HUGE)


_HUGE = float(np.finfo(np.float64).max)
_SMALLEST = float(np.finfo(np.float64).tiny)

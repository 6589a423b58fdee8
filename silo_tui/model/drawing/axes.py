"""The numbers on the axes: ranges whose ticks are round and lie evenly on the lines of a plot, or powers of ten.

By powers of ten any values have an axis: where there are zeros or negative ones, it is linear next to zero. A value is
`place`d on it; there every power of ten is a whole number.
"""

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from silo.core.arrays.columns import Floats
from silo_tui.model.drawing import braille
from silo_tui.model.words import text

Scale = tuple[float, float]
_FACTORS = (1, 1.5, 2, 2.5, 3, 4, 5, 6, 8)
_COUNTED = {*_FACTORS, 7.5}
_MOST_TICKS = 8
WASTE = 1.4
_ODD = 1.2  # what a top that needs more digits than the numbers below it may cost
_EXTREME = 1e290  # beyond, and below its inverse, there is no room for powers of ten


def round_scale(smallest: float, largest: float, lines: int) -> Scale:
    """Return a range that holds both values, with ticks that are round and an even number of lines apart."""
    extent, is_zero = largest / 2 - smallest / 2, smallest == largest == 0
    if braille.is_constant(smallest, largest):
        smallest, largest = braille.room_around(largest)
        extent = largest / 2 - smallest / 2
    # of numbers that differ in their last digits only, and of the largest and smallest there are, no step is round
    if not 1 / _EXTREME < extent < _EXTREME or extent < 1e-9 * max(abs(smallest), abs(largest)):
        return braille.nice_range(smallest, largest)
    plain = braille.nice_range(smallest, largest)
    found = [ends for apart in _distances(lines) if (ends := _range_of(smallest, largest, lines, apart))]
    found = [ends for ends in found if not is_zero or ends[0] == -ends[1]]  # nothing but zeros lies in the middle
    best = min(found, key=lambda ends: (ends[1] - ends[0]) * (1 if _reads(ends, lines) else _ODD), default=plain)
    # a curve in the lower half of its plot costs more than the numbers in between are worth
    return best if best[1] - best[0] <= WASTE * (plain[1] - plain[0]) else plain


def _distances(lines: int) -> range:
    """How many lines can lie between two ticks: at least three ticks fit, and no more than can be read."""
    least = 1 if lines <= 6 else 2
    return range(max(least, -(-(lines - 1) // _MOST_TICKS)), max(1, (lines - 1) // 2) + 1)


def _range_of(smallest: float, largest: float, lines: int, apart: int) -> Scale | None:
    """Return the smallest range with a round step every `apart` lines, from the bottom on, that holds both values.

    None where only much larger ones do.
    """
    steps = (lines - 1) / apart
    raw = (largest - smallest) / steps
    power = 10.0 ** math.floor(math.log10(raw))
    for step in (factor * size for size in (power, 10 * power) for factor in _FACTORS):
        first = math.floor(smallest / step + 1e-9)
        if step >= raw * 0.999 and (first + steps) * step >= largest - 1e-9 * step:
            return first * step, (first + steps) * step
    return None


def ticks_of(scale: Scale, lines: int) -> list[tuple[int, float]]:
    """Return the lines (0 on top) of a plot that have a number, and which: round ones, top and bottom always."""
    bottom, top = scale
    if not (math.isfinite(bottom) and math.isfinite(top)) or lines < 2:
        return []
    per_line = top / (lines - 1) - bottom / (lines - 1)
    # first those that are counted in steps as one counts, then those that reach the top
    order = sorted(
        _distances(lines), key=lambda apart: (_mantissa(apart * per_line) not in _COUNTED, (lines - 1) % apart > 0)
    )
    for apart in order:
        values = [bottom + place * per_line for place in range(0, lines, apart)]
        if _is_round(apart * per_line, values):
            ticks = [(lines - 1 - place * apart, value) for place, value in enumerate(values)][::-1]
            return ticks if ticks[0][0] == 0 else [(0, top), *ticks]
    return [(0, top), (lines - 1, bottom)]


def _reads(scale: Scale, lines: int) -> bool:
    """Whether the top of a range needs one digit more than the numbers below it at most: 1.0222 isn't read."""
    (_, top), (_, second), *_ = ticks = ticks_of(scale, lines)
    if len(ticks) < 3:
        return False
    step = second - ticks[2][1]
    last = 10.0 ** math.floor(math.log10(step) + 1e-9) / (10 if _mantissa(step).is_integer() else 100)
    return abs(top / last - round(top / last)) < 1e-6


def _mantissa(step: float) -> float:
    """Return the digits of a step before its power of ten: 2.5 of 250."""
    return float(f"{step:.6e}".partition("e")[0])


def _is_round(step: float, values: list[float]) -> bool:
    if not step > 0 or not math.isfinite(step):
        return False
    digits = step / 10.0 ** math.floor(math.log10(step)) if 1 / _EXTREME < step < _EXTREME else math.pi
    even = all(abs(value / step - round(value / step)) < 1e-6 for value in values)
    return even and abs(digits * 10 - round(digits * 10)) < 1e-6


def tick_words(ticks: list[tuple[int, float]], base: int, width: int) -> tuple[dict[int, str], str]:
    """Return what stands on which line of an axis, and from what it counts if that takes many digits."""
    if not ticks:
        return {}, ""
    (first, top), (last, bottom) = ticks[0], ticks[-1]
    if not base and len(ticks) > 1 and (words := text.ticks([value for _, value in ticks], width)):
        return {line: word for (line, _), word in zip(ticks, words, strict=True)}, ""
    low, high, origin = text.axis_ends(bottom, top, base, width)
    return {first: high, last: low}, origin


# ---------------------------------------------------------------------------------------------------- powers of ten


DECADES = 6  # below the largest value: what is smaller lies next to zero


class LogAxis(msgspec.Struct, frozen=True):
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


def scale_of(axis: LogAxis, smallest: float, largest: float) -> Scale:
    """Return the whole powers of ten around two values, as places."""
    low, high = axis.place(np.array([smallest, largest])).tolist()
    bottom, top = math.floor(low + 1e-9), math.ceil(high - 1e-9)
    return float(bottom), float(max(top, bottom + 1))


def words_of(axis: LogAxis, scale: Scale, lines: int) -> dict[int, str]:
    """Return what stands on which line of the axis."""
    first, last = round(scale[0]), round(scale[1])
    apart = max(1, -(-(last - first) // max(1, lines // 2)))
    places = np.arange(-(-first // apart) * apart, last + 1, apart, dtype=np.float64)  # zero is one of them
    places = np.array([*places, first, last], np.float64)  # the ends last: they have a number wherever others lie
    rows = braille.row_of(places, scale, 4 * lines).tolist()
    words = [_word(axis.value(place)) for place in places.tolist()]
    return {int((4 * lines - 1 - row) // 4): word for row, word in zip(rows, words, strict=True)}


def _word(value: float) -> str:
    if value == 0:
        return "0"
    return f"{'-' if value < 0 else ''}1e{round(math.log10(abs(value)))}"

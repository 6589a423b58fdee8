"""The numbers on the axes: ranges whose ticks are round and lie evenly on the lines of a plot, or powers of ten.

By powers of ten any values have an axis: where there are zeros or negative ones, it is linear next to zero. A value is
`place`d on it; there every power of ten is a whole number.
"""

import math
from collections.abc import Iterator, Sequence

import msgspec
import numpy as np

from silo.core.arrays.columns import Floats
from silo_tui.model.drawing import braille
from silo_tui.model.words import text

Scale = tuple[float, float]
_FACTORS = (1, 2, 5)  # steps between numbers that are read at a glance
_MOST_TICKS = 8
_SMALL = 6  # lines of a plot
_OPEN_END = 1.05  # what an end between two numbers may cost
_FEW = 1.3  # and that there are but two numbers
_EXTREME = 1e290  # beyond, and below its inverse, there is no room for powers of ten


def round_scale(smallest: float, largest: float, lines: int) -> Scale:
    """Return a range that holds both values, with numbers in steps of 1, 2 or 5 on whole lines of the plot."""
    is_zero = smallest == largest == 0
    if braille.is_constant(smallest, largest):
        smallest, largest = braille.room_around(largest)
    if lines < 2 or not has_round(smallest, largest):
        return braille.nice_range(smallest, largest)
    plain = braille.nice_range(smallest, largest)  # its ends alone are round
    found = [((plain[1] - plain[0]) * _FEW, plain), *_ranges(smallest, largest, lines)]
    return min(each for each in found if not is_zero or each[1][0] == -each[1][1])[1]  # zeros lie in the middle


def has_round(low: float, high: float) -> bool:
    """Whether there are round numbers in a range: not where they differ in their last digits only, nor at the ends of
    what numbers there are.
    """
    extent = high / 2 - low / 2
    return 1 / _EXTREME < extent < _EXTREME and extent >= 1e-9 * max(abs(low), abs(high))


def _steps(least: float) -> Iterator[float]:
    """Yield round steps that are as large as this, from the smallest on."""
    power = 10.0 ** math.floor(math.log10(least))
    steps = (factor * size for size in (power, 10 * power, 100 * power) for factor in _FACTORS)
    return (step for step in steps if step >= least * (1 - 1e-9))


def _closest(lines: int) -> int:
    """How many lines lie between two numbers at least."""
    return max(1 if lines <= _SMALL else 2, -(-(lines - 1) // _MOST_TICKS))


def _ranges(smallest: float, largest: float, lines: int) -> Iterator[tuple[float, Scale]]:
    """Yield ranges that hold both values and have round numbers on whole lines, each with what it costs."""
    whole = lines - 1
    for apart in range(_closest(lines), whole + 1):
        for step in _steps((largest - smallest) / whole * apart):
            per_line = step / apart
            first = math.floor(smallest / per_line + 1e-9)
            if (first + whole) * per_line >= largest - 1e-9 * step:
                yield _cost(per_line, apart, first, whole), (first * per_line, (first + whole) * per_line)
                break


def _cost(per_line: float, apart: int, first: int, whole: int) -> float:
    """Return how far a range of so many lines reaches, the more the worse it reads; a number every `apart` lines."""
    last = first + whole
    count = last // apart - -(-first // apart) + 1
    open_ends = (first % apart > 0) + (last % apart > 0)
    return whole * per_line * _OPEN_END**open_ends * _FEW ** (count < 3) if count > 1 else math.inf


def zeros_met(scales: Sequence[Scale], lines: int) -> list[Scale]:
    """Return ranges that hold others, which all have a zero, with the zeros on one line and round numbers on others."""
    whole = lines - 1

    def met(zero: int) -> list[Scale]:
        units = []
        for low, high in scales:
            least = max(-low / zero if zero else 0.0, high / (whole - zero) if zero < whole else 0.0)
            found = ((next(_steps(least * apart)) / apart, apart) for apart in range(_closest(lines), whole + 1))
            units.append(min(found, key=lambda each: _cost(each[0], each[1], -zero, whole))[0])
        return [(-zero * unit, (whole - zero) * unit) for unit in units]

    def cost(found: list[Scale]) -> float:
        return sum((top - bottom) / (high - low) for (bottom, top), (low, high) in zip(found, scales, strict=True))

    below, above = any(low < 0 for low, _ in scales), any(high > 0 for _, high in scales)
    return min((met(zero) for zero in range(below, lines - above)), key=cost)


def ticks_of(scale: Scale, lines: int) -> list[tuple[int, float]]:
    """Return the lines (0 on top) of a plot that have a number, and which: in steps of 1, 2 or 5, on the lines that are
    theirs or, where the range is of another plot, next to them; both ends where no step fits, and of a small plot where
    none would stand at its top, if that is round.
    """
    bottom, top = scale
    if not (math.isfinite(bottom) and math.isfinite(top)) or lines < 2:
        return []
    if has_round(bottom, top) and bottom < top:
        per_line = (top - bottom) / (lines - 1)
        found = [(step / per_line, ticks) for step in _steps(per_line) if len(ticks := _at(scale, step, per_line)) > 1]

        def badness(each: tuple[float, list[tuple[float, float]]]) -> tuple[bool, bool]:
            return each[0] < _closest(lines) * (1 - 1e-9), any(abs(place - round(place)) > 1e-6 for place, _ in each[1])

        best = [(math.floor(place + 0.5), value) for place, value in min(found, key=badness)[1]] if found else []
        if best and (lines > _SMALL or not best[0][0] or float(f"{top:.2g}") != float(f"{top:.9g}")):
            return best
    return [(0, top), (lines - 1, bottom)]


def _at(scale: Scale, step: float, per_line: float) -> list[tuple[float, float]]:
    """Return how far below the top the multiples of a step lie, in lines, and which they are."""
    bottom, top = scale
    first, last = math.ceil(bottom / step - 1e-6), math.floor(top / step + 1e-6)
    return [((top - count * step) / per_line, count * step) for count in range(last, first - 1, -1)]


def across(first: float, last: float, most: int = 6) -> list[tuple[float, float]]:
    """Return the numbers of an axis along the bottom, so many steps at most, each with its share of the way from left
    to right; both ends where no step is round. What is less than a cell beyond an end is at it.
    """
    extent = last - first
    if not (has_round(first, last) and first < last):
        return [(0.0, first), (1.0, last)]
    found = _at((first - 0.005 * extent, last + 0.005 * extent), next(_steps(extent / most)), extent)
    return [(min(1.0, max(0.0, (value - first) / extent)), value) for _, value in reversed(found)]


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

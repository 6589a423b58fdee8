"""Numbers, times, sizes and names as short text that fits a column."""

import math
import re
from collections.abc import Iterable, Sequence
from datetime import datetime
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

from silo.core.quantities import writing
from silo.core.quantities.writing import duration_text, whole_duration

SUFFIXES = "kMGT"
EXACT_DIGITS = 15  # that a float holds of any number
BRIEF = 5  # cells of a number among others
BARS = "▏▎▍▌▋▊▉█"
count = writing.count


class Digits(NamedTuple):
    """How all numbers of one row are written: counted in a power of ten, to so many decimals."""

    power: int = 0
    decimals: int = 0

    @property
    def step(self) -> float:
        """By how much the last digit counts."""
        return 10.0 ** (self.power - self.decimals)

    def counted(self, value: float) -> float:
        """Return a number as a multiple of the power; in two steps, because 1e324 is too much for a float."""
        return value / 10.0 ** (self.power // 2) / 10.0 ** (self.power - self.power // 2) if self.power else value

    def mantissa(self, value: float) -> str:
        """Return a number without its power."""
        return f"{self.counted(value):.{self.decimals}f}"

    def write(self, value: float, width: int = 0) -> str:
        """Return a number, in at most `width` cells (at least 7; 0: any): where it is none of the row's, by itself."""
        if not math.isfinite(value):
            return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
        words = self.mantissa(value)
        if words[0] == "-" and not words.strip("-0."):
            words = words[1:]  # no minus before what rounds to 0
        if self.power and words == "0":  # `0e-4` would be read as small; what is not 0 is not told as exactly that
            return "0.0" if value else words
        words += f"e{self.power}" if self.power else ""
        if 0 < width < len(words) and (alone := digits_of(abs(value), 0.0, width)) != self:
            return alone.write(value, width)
        return words


@lru_cache(4096)
def digits_of(size: float, span: float, width: int, *, signed: bool = True, integer: bool = False) -> Digits:
    """Return how numbers of up to this size are written in at most `width` cells, so that they differ in four digits.

    `span` is how far they lie apart; 0 where that isn't known, or they are all the same. Where so many digits have no
    room all of them have fewer, and count in the power of ten that leaves room for most. `signed`: one may be negative.
    """
    if not 0 < size < math.inf:
        return Digits(0, max(0, min(4, width - 2 - signed)))
    top = _top(size)
    last = math.floor(math.log10(span)) - 3 if 0 < span < math.inf else min(top - 3, -4) if size < 1e3 else -2
    plain = (0,) if top < EXACT_DIGITS or integer else ()
    powers = (*plain, top // 3 * 3, top) if size >= 1e-3 else (top // 3 * 3, top, *plain)
    fitting = [found for power in powers if (found := _fitting(size, power, last, width - signed))]
    best = min(fitting, key=lambda found: max(found.power - found.decimals, last), default=Digits(top))
    # where the numbers read the same all the same, more digits than of one that stands still tell nothing
    return digits_of(size, 0.0, width, signed=signed, integer=integer) if 0 < span < best.step else best


def _fitting(size: float, power: int, last: int, width: int) -> Digits | None:
    """Return how a number is counted in a power, down to the power `last` or as far as there is room; None for none."""
    found = Digits(power, max(0, min(power - max(last, _top(size) - EXACT_DIGITS), width)))
    while found.decimals and len(found.write(size)) > width:
        found = Digits(power, found.decimals - 1)
    return found if len(found.write(size)) <= width else None


def _top(size: float) -> int:
    """Return which power of ten the first digit of a number counts; 999.99 is 1000."""
    return int(f"{size:.3e}".partition("e")[2])


def digits_for(values: Iterable[float], width: int, *, integer: bool = False) -> Digits:
    """Return how these numbers are written beside each other."""
    finite = [value for value in values if math.isfinite(value)] or [0.0]
    low, high = min(finite), max(finite)
    return digits_of(max(abs(low), abs(high)), high - low, width, signed=low < 0, integer=integer)


def row(*values: float, width: int = 12) -> tuple[str, ...]:
    """Return numbers that stand beside each other and stay: without the zeros that all of them would end in."""
    power, decimals = digits_for(values, width)
    zeros = [len(word) - len(word.rstrip("0")) for word in map(Digits(power, decimals).mantissa, values)]
    return tuple(Digits(power, max(0, decimals - min(zeros))).write(value) for value in values)


def engineering(value: float, digits: int = 3) -> str:
    """Return `12.5k`, `-3.2M`, `250e-6`, `1e-300`: a number with so many digits, no more than it needs."""
    rounded = float(f"{value:.{digits - 1}e}")
    value = rounded if math.isfinite(rounded) else value
    if value == 0 or not math.isfinite(value) or 1e-3 <= abs(value) < 1e3:
        return f"{value + 0.0:.{max(digits, 3)}g}"
    power = math.floor(math.log10(abs(value))) // 3 * 3
    counted = f"{Digits(power).counted(value):.{max(digits, 3)}g}"
    return counted + (SUFFIXES[power // 3 - 1] if 3 <= power <= 12 else f"e{power}")


def ticks(values: Sequence[float], width: int) -> tuple[str, ...]:
    """Return the numbers of an axis, in order; none where there is no room for the digits that they need."""
    words, slack = row(*values, width=width), 4e-3 * min(abs(b / 2 - a / 2) for a, b in pairwise(values))
    told = all(abs(float(word) - value) <= slack for word, value in zip(words, values, strict=True))
    return words if told and len(set(words)) == len(words) else ()


def axis_ends(bottom: float, top: float, base: int = 0, width: int = 9) -> tuple[str, str, str]:
    """Return both ends of an axis so that they can be told apart, and from what they count if that takes many digits.

    `bottom` and `top` are offsets from `base`.
    """
    if not (math.isfinite(bottom) and math.isfinite(top)):
        return "", "", ""
    extent = top / 2 - bottom / 2
    if not base:
        if words := ticks((bottom, top), width):
            return words[0], words[1], ""
        origins = (f"{bottom:.{digits}g}" for digits in range(6, 18))
        origin = next((word for word in origins if abs(float(word) - bottom) <= 2e-3 * extent), repr(bottom))
        step = top - bottom  # half of the smallest number there is would be none
        return "+0", _step(step if math.isfinite(step) else 2 * extent, width), origin
    whole = math.floor(bottom)
    return f"+{engineering(bottom - whole)}", f"+{engineering(top - whole)}", str(base + whole)


def _step(size: float, width: int) -> str:
    words = (f"+{engineering(size, digits)}" for digits in (3, 2, 1))
    return next((word for word in words if len(word) <= width), f"+{_short_power(f'{size:.0e}')}")


def short(value: float, digits: int = 4) -> str:
    """Return a number in so many digits, no more than it needs; in four or more of them whole, up to a million, where
    a power of ten is no shorter.
    """
    words = _short_power(f"{value:.{digits}g}")
    whole = f"{value:.0f}" if digits > 3 and 1 <= abs(value) < 1e6 and "e" in words else ""
    return whole if whole and len(whole) <= len(words) else words


def _short_power(words: str) -> str:
    return words.replace("e+0", "e").replace("e+", "e").replace("e-0", "e-")


def compact(value: float) -> str:
    """Return a number in a few characters, for lists and axes."""
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e4 else engineering(value)


def ago(seconds: float) -> str:
    """Return `0.4 s`, `12 s`, `2 min`, `3 h`."""
    if seconds < 10:
        return f"{max(seconds, 0.0):.1f} s"
    if seconds < 60:
        return f"{seconds:.0f} s"
    if seconds < 3600:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.0f} h" if seconds < 86_400 else f"{seconds / 86_400:.0f} d"


def span(seconds: float, digits: int = 4) -> str:
    """Return a time span in its natural unit: `50 us`, `2 ms`, `10 s`, `5 min`."""
    size, unit, scale = abs(float(short(seconds, digits))), "h", 1 / 3600
    for limit, smaller, its in ((7200.0, "min", 1 / 60), (120.0, "s", 1.0), (1.0, "ms", 1e3), (1e-3, "us", 1e6)):
        unit, scale = (smaller, its) if size < limit else (unit, scale)
    return f"{short(float(short(seconds * scale, digits)), max(4, digits))} {unit}"  # 200 us, not 2e2


def since(seconds: float | None) -> str:
    """Return for how long something has been so, in whole units: `14 s`, `5 min`; `…` where that isn't known."""
    return "…" if seconds is None else whole_duration(seconds)


def running(seconds: float) -> str:
    """Return for how long something runs, in eight cells: `2:31:07`, `61 d 9 h`."""
    if seconds < 86_400:
        return duration_text(seconds)
    return f"{seconds // 86_400:.0f} d {seconds % 86_400 // 3600:.0f} h"


def day_and_time(time_ns: int, now_s: float) -> str:
    """Return a moment as one tells it at `now_s`: `today 13:07:27`, `21 Nov 13:07`, `2025-11-21`."""
    when, now = datetime.fromtimestamp(time_ns / 1e9), datetime.fromtimestamp(now_s)
    if when.date() == now.date():
        return f"today {when:%H:%M:%S}"
    return f"{when:%d %b %H:%M}" if when.year == now.year else f"{when:%Y-%m-%d}"


def bar(share: float, width: int) -> str:
    """Return a bar of `width` cells in eighths of a cell."""
    eighths = round(max(0.0, min(1.0, share)) * width * 8)
    full, part = divmod(eighths, 8)
    return ("█" * full + (BARS[part - 1] if part else "")).ljust(width)


def clean(words: str) -> str:
    """Return `words` without what moves the terminal's cursor or rings its bell: a logged string may hold anything."""
    return words if words.isprintable() else "".join(char if char.isprintable() else "·" for char in words)


# a number and its unit; the letter of a menu and that of its entry: `12 345`, `9.8 MB`, `g a`
_WITHIN = re.compile(r"(?<=\d) (?=\d{3}(?!\d)|[kMGT]?B\b)|(?<=\b[gevrp]) (?=[^\s\w]|\w\b)")
_HELD = "\ue000"  # of no use elsewhere, and no blank


def held(words: str) -> str:
    """Return words whose numbers and keys don't break at the end of a line; `loosened` makes blanks of it again."""
    return _WITHIN.sub(_HELD, words)


def loosened(words: str) -> str:
    """Return words that were held together, as they are read."""
    return words.replace(_HELD, " ")


def cut(words: str, width: int) -> str:
    """Return clean words in at most `width` letters, an ellipsis in place of the rest."""
    words = clean(words)
    return words if len(words) <= width else words[: max(0, width - 1)] + "…"

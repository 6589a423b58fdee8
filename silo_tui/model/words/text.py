"""Numbers, times, sizes and names as short text that fits a column."""

import math
from collections.abc import Callable, Sequence

from silo.core.elements import SavedFile
from silo.core.quantities import writing
from silo.core.quantities.writing import size_text

SUFFIXES = "kMGT"
BRIEF = 5  # cells of a number among others
BARS = "▏▎▍▌▋▊▉█"
count = writing.count


def number(value: float, width: int = 11, *, integer: bool = False, decimals: int | None = None) -> str:
    """Return a number in at most `width` cells (at least 6); its decimals are steady so that digits don't dance.

    `decimals` are those that its signal needs (`decimals_between`), where that is known.
    """
    if math.isnan(value):
        return "nan"
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    if integer:
        text = str(int(value))
        return text if len(text) <= width else _fitting(value, width, 9)
    size = abs(value)
    if decimals is None:
        if value != 0 and size < 1e-4:
            return _fitting(value, width)
        decimals = 4 if size < 1000 else 2
    if size >= 1e6 and len(f"{value:.0f}") > width:
        return _fitting(value, width, 9)
    text = f"{round(value, decimals) + 0.0:.{decimals}f}"  # no minus before what rounds to 0
    while len(text) > width and decimals:
        decimals -= 1
        text = f"{value:.{decimals}f}"
    return text if len(text) <= width else _fitting(value, width)


def decimals_between(smallest: float, largest: float) -> int | None:
    """Return with how many decimals numbers between two differ in four digits; None where these don't tell it."""
    extent = largest - smallest
    if not (math.isfinite(extent) and extent > 0) or max(abs(smallest), abs(largest)) < 1e-4:
        return None
    return max(0, min(9, 3 - math.floor(math.log10(extent))))


def of_range(smallest: float, largest: float, *between: float) -> tuple[str, ...]:
    """Return both ends of what numbers were, and some between: short, with plain decimals where they differ little."""
    decimals = decimals_between(smallest, largest)
    if decimals is not None and largest - smallest <= max(abs(smallest), abs(largest)) / 100:
        words = tuple(number(value, 14, decimals=max(0, decimals - 2)) for value in (smallest, largest, *between))
        if words[0] != words[1]:  # else there is no room for what tells them apart
            return words
    return (*told_apart(smallest, largest), *map(compact, between))


def _fitting(value: float, width: int, most: int = 4) -> str:
    """Write in engineering notation, with as many decimals as fit, at most `most`; else in the shortest one."""
    mantissa, power = _parts(value)
    texts = [f"{mantissa:.{digits}f}e{power}" for digits in range(most, -1, -1)]
    return next((text for text in texts if len(text) <= width), _short_power(f"{value:.0e}"))


def _parts(value: float) -> tuple[float, int]:
    """Return mantissa from 1 to below 1000, and a power of ten that is a multiple of three."""
    power = math.floor(math.log10(abs(value))) // 3 * 3 if value else 0
    # in two steps: 1e324 is too much for a float
    mantissa = value / 10.0 ** (power // 2) / 10.0 ** (power - power // 2)
    if abs(mantissa) >= 999.99995:
        return mantissa / 1000, power + 3
    return mantissa, power


def engineering(value: float, digits: int = 3) -> str:
    """Return `12.5k`, `-3.2M`, `250e-6`, `1e-300`: a number with so many digits, no more than it needs."""
    if not math.isfinite(value):
        return number(value)
    if value == 0:
        return "0"
    rounded = float(f"{value:.{digits - 1}e}")
    value = rounded if math.isfinite(rounded) else value
    if 1e-3 <= abs(value) < 1e3:
        return f"{value:.{max(digits, 3)}g}"
    mantissa, power = _parts(value)
    words = f"{mantissa:.{max(digits, 3)}g}"
    return words + (SUFFIXES[power // 3 - 1] if 3 <= power <= 12 else f"e{power}")


def axis_ends(bottom: float, top: float, base: int = 0, width: int = 9) -> tuple[str, str, str]:
    """Return both ends of an axis so that they can be told apart, and from what they count if that takes many digits.

    `bottom` and `top` are offsets from `base`.
    """
    if not (math.isfinite(bottom) and math.isfinite(top)):
        return "", "", ""
    extent = top / 2 - bottom / 2
    if not base:
        for digits in range(1, 10):
            words = [engineering(end, digits) for end in (bottom, top)]
            rounded = [float(f"{end:.{digits - 1}e}") for end in (bottom, top)]
            told = all(abs(a / 2 - b / 2) <= 2e-3 * extent for a, b in zip(rounded, (bottom, top), strict=True))
            if told and words[0] != words[1] and max(map(len, words)) <= width:
                return words[0], words[1], ""
        for decimals in range(4):  # 999999.4 and 1000000.6: each by itself, not one from the other
            words = [f"{end:.{decimals}f}" for end in (bottom, top)]
            told = all(abs(float(word) - end) <= 4e-3 * extent for word, end in zip(words, (bottom, top), strict=True))
            if told and max(map(len, words)) <= width:
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


def compact(value: float, digits: int = 3) -> str:
    """Return a number in a few characters, for lists and axes."""
    return f"{value:.0f}" if digits <= 4 and 1e3 <= abs(value) < 1e4 else engineering(value, digits)


def told_apart(*values: float, digits: int = 3, write: Callable[[float, int], str] = compact) -> tuple[str, ...]:
    """Return numbers in so many digits, in more where some would read the same."""
    words: tuple[str, ...] = ()
    for more in range(digits, 18):
        words = tuple(write(value, more) for value in values)
        if len(set(words)) == len(set(values)):
            break
    return words


def brief(value: float, beside: float = 0.0) -> str:
    """Return a number in four or five characters, for the entries of a vector side by side.

    The largest and smallest that there are take more. What is nothing `beside` the largest of them in size is a zero.
    """
    size = abs(value)
    if size < 1e-3 * beside and size < 0.005:
        return "0.00"
    if math.isnan(value) or size >= 1e5:
        return compact(value)
    if 0 < size < 0.005:
        return _short_power(f"{value:.0e}")
    return f"{value + 0.0:.{2 if size < 10 else 1 if size < 100 else 0}f}"


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


def short_span(seconds: float) -> str:
    """Return a time span in whole units, at most four cells up to 99 days: `45s`, `12m`, `3h`, `2d`."""
    scales = ((100, 1, "s"), (6000, 60, "m"), (360_000, 3600, "h"))
    scale, unit = next(((scale, unit) for limit, scale, unit in scales if seconds < limit), (86_400, "d"))
    return f"{int(seconds // scale)}{unit}"


def bar(share: float, width: int) -> str:
    """Return a bar of `width` cells in eighths of a cell."""
    eighths = round(max(0.0, min(1.0, share)) * width * 8)
    full, part = divmod(eighths, 8)
    return ("█" * full + (BARS[part - 1] if part else "")).ljust(width)


def clean(words: str) -> str:
    """Return `words` without what moves the terminal's cursor or rings its bell: a logged string may hold anything."""
    return words if words.isprintable() else "".join(char if char.isprintable() else "·" for char in words)


def cut(words: str, width: int) -> str:
    """Return clean words in at most `width` letters, an ellipsis in place of the rest."""
    words = clean(words)
    return words if len(words) <= width else words[: max(0, width - 1)] + "…"


def saved_words(files: Sequence[SavedFile]) -> str:
    """Return what a save wrote, in words."""
    return f"saved: {', '.join(f'{one.path} ({size_text(one.size_bytes)})' for one in files)}"

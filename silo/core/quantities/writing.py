"""Sizes, times, counts and tables as they are told, one way everywhere."""

import math
import time
from collections.abc import Iterable, Sequence
from typing import Any

EPOCH_FROM_NS = 946_684_800_000_000_000  # 2000: a smaller time stamp is none of the system's clock


def duration(seconds: float) -> str:
    """Return a time to three digits as people say it: `0.19 s`, `9.99 s`, `17.7 min`, `3.5 h`, `2.1 days`."""
    for limit, unit, scale in ((120.0, "s", 1.0), (7200.0, "min", 60.0), (172_800.0, "h", 3600.0)):
        if seconds < limit:
            return f"{seconds / scale:.3g} {unit}"
    days = seconds / 86_400
    return f"{days:.3g} days" if days < 1000 else f"{days:.0f} days"


def duration_text(seconds: float) -> str:
    """Return how long something takes or took, for columns and heads: `00:12`, `1:02:03`, `2 d 03:04`."""
    whole = max(0, int(seconds))
    days, hours, minutes, rest = whole // 86400, whole // 3600 % 24, whole // 60 % 60, whole % 60
    if days:
        return f"{days} d {hours:02}:{minutes:02}"
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes:02}:{rest:02}"


def wall_clock(time_ns: int, decimals: int = 0, *, date: bool = False) -> str:
    """Return a time stamp in this machine's zone, cut to so many decimals: `13:07:32`, `2026-11-25 13:07:32.250`."""
    seconds, rest = divmod(time_ns, 1_000_000_000)
    words = time.strftime("%Y-%m-%d %H:%M:%S" if date else "%H:%M:%S", time.localtime(seconds))
    return f"{words}.{rest:09}"[: len(words) + 1 + decimals] if decimals else words


def since_text(time_ns: int) -> str:
    """Return since when something is so, by the clock of this machine; with the date where that was another day."""
    then, now = wall_clock(time_ns, date=True), wall_clock(time.time_ns(), date=True)
    return then[11:] if then[:10] == now[:10] else then


def size_text(size_bytes: float) -> str:
    """Return a size, of a file, of memory, to three digits: `812 B`, `1.2 MB`, `40 GB`."""
    for unit in ("B", "kB", "MB", "GB"):
        if abs(size_bytes) < 999.5:
            return f"{size_bytes:.3g} {unit}"
        size_bytes /= 1000
    return f"{size_bytes:.3g} TB"


def share_words(some: int, total: int) -> str:
    """Return how much of something that is: `all the time`, `for 12 %`, `for less than 0.01 %`."""
    if some >= total:
        return "all the time"
    share = 100 * some / total
    return f"for {min(share, 99.9):.3g} %" if share >= 0.01 else "for less than 0.01 %"


def count(value: int) -> str:
    """Return a count in groups: `12 345`."""
    return f"{value:,}".replace(",", " ")


def many(value: int, noun: str) -> str:
    """Return `1 tick`, `3 ticks`, `12 345 ticks`."""
    return f"{count(value)} {noun}{'' if value == 1 else 's'}"


def ordinal(number: int) -> str:
    """Return `2nd`, `3rd`, `11th`."""
    endings = {1: "st", 2: "nd", 3: "rd"} if number % 100 not in {11, 12, 13} else {}
    return f"{number}{endings.get(number % 10, 'th')}"


def there_are(value: int, noun: str = "") -> str:
    """Return `there is 1 tick`, `there are 3 ticks`, `there are none`; without a noun the number alone."""
    told = many(value, noun) if noun else count(value)
    return f"there {'is' if value == 1 else 'are'} {told if value else 'none'}"


def and_more(words: Sequence[str], most: int, sign: str = ", ") -> str:
    """Return the first of several, and how many more there are: `q, dq and 3 more`; of lines as the last of them."""
    before = "\n" if sign == "\n" else " "
    return sign.join(words[:most]) + (f"{before}and {len(words) - most} more" if len(words) > most else "")


def idle_words(idle_s: float) -> str:
    """Return `no tick for 4 min`."""
    return f"no tick for {whole_duration(idle_s)}"


def whole_duration(seconds: float) -> str:
    """Return a time that goes on, in whole units: `14 s`, `5 min`, `3 h`."""
    unit = 1 if seconds < 120 else 60 if seconds < 7200 else 3600
    return duration(float(seconds // unit * unit))


MOST_ROWS = 60  # in a notebook; nobody reads 10,000


def html_table(caption: str, heads: Sequence[str], rows: Iterable[Sequence[object]], more: str = "") -> str:
    """Return a table; of many rows the first, and how many there are besides."""
    from html import escape  # 3 ms that no shell command needs

    shown = list(rows)
    left = len(shown) - MOST_ROWS
    body = "".join(_row(row, "td") for row in shown[:MOST_ROWS])
    below = f"<p>and {left} more</p>" if left > 0 else ""
    note = f"<p>{escape(more)}</p>" if more else ""
    head = f"<thead>{_row(heads, 'th')}</thead>" if shown else ""
    return f"<p><b>{escape(caption)}</b></p><table>{head}<tbody>{body}</tbody></table>{below}{note}"


def _row(cells: Sequence[object], tag: str) -> str:
    from html import escape

    return "<tr>" + "".join(f"<{tag}>{escape(str(cell))}</{tag}>" for cell in cells) + "</tr>"


def infinite_as_text(value: Any) -> Any:
    """Return the same of dicts and lists, infinite numbers as "inf" or "-inf": JSON has none."""
    if isinstance(value, float):
        return value if abs(value) != math.inf else str(value)
    if isinstance(value, dict):
        return {key: infinite_as_text(one) for key, one in value.items()}
    return [infinite_as_text(one) for one in value] if isinstance(value, list | tuple) else value

"""The line under plots: times, and the letters of cursors and of what happened between them. Pure.

And the way back: which moment is meant by what somebody types.
"""

import re
import time
from collections.abc import Iterable, Mapping, Sequence

from silo.core.quantities.reading import seconds_of
from silo.core.quantities.writing import EPOCH_FROM_NS
from silo_tui.model.drawing import axes
from silo_tui.model.drawing.window import SECOND_NS, PlotWindow
from silo_tui.model.lists.happened import NAMES, RANK
from silo_tui.model.words import text

MOMENTS = "-3s from the end, 12.5, +2s from the cursor, 13:07:32.5"
_CLOCK = re.compile(r"([01]?\d|2[0-3]):([0-5]\d)(?::([0-5]\d)(?:\.(\d*))?)?")
_NUMBER = re.compile(r"\d+\.?\d*|\.\d+")
NO_BREAK = "\u00a0"
QUARTERS = (0.0, 0.25, 0.5, 0.75, 1.0)
FAR = 10  # cells that a letter may stand beside its place


def axis_line(
    width: int, words: Iterable[tuple[float, str]], cursors: Iterable[tuple[int, str]], events: Mapping[int, str]
) -> str:
    """Return the line, of words at their shares of the way from left to right; letters take the nearest empty cell,
    the rarer events first, limits none but their own; what they are stands behind, where there is room.
    """
    line = [" "] * width
    for share, word in words:
        start = max(0, min(width - len(word), round(share * width) - (len(word) // 2 if 0 < share < 1 else 0)))
        begin, end = max(0, start - 1), min(width, start + len(word) + 1)
        if "".join(line[begin:end]).isspace():
            line[begin:end] = NO_BREAK * (end - begin)  # no letter goes in between, nor right beside it
            line[start : start + len(word)] = word.replace(" ", NO_BREAK)
    for cell, sign in [*cursors, *sorted(events.items(), key=lambda letter: RANK.index(letter[1]))]:
        if (free := _free_cell(line, cell, 0 if sign == "H" else FAR)) is not None:
            line[free] = sign
    told = "".join(line)
    for sign in sorted(set(events.values()), key=RANK.index):  # in words once, at the newest that has room
        word = f" {NAMES[sign].partition(',')[0]}"
        for found in [*re.finditer(rf"(?<![^ {NO_BREAK}{sign}]){sign}(?= {{{len(word)}}}(?: |$))", told)][-1:]:
            told = told[: found.end()] + word + told[found.end() + len(word) :]
    return told.replace(NO_BREAK, " ")


def axis_words(window: PlotWindow, newest_ns: int, columns: int) -> list[tuple[float, str]]:
    """Return what stands below a window of a logger, each at its share of the way from left to right.

    It is counted from where the cursor's time is: the newest moment, which an earlier window doesn't end with.
    """
    end_ns = window.paused_end_ns
    back_s = 0.0 if end_ns is None else max(0, newest_ns - end_ns) / SECOND_NS
    if back_s < window.span_s / columns:
        return [(share, f"-{text.span(window.span_s * (1 - share))}") for share in QUARTERS[:-1]] + [(1.0, "0")]
    return seconds_words(-back_s - window.span_s, -back_s)


def seconds_words(first_s: float, last_s: float) -> list[tuple[float, str]]:
    """Return round seconds between two moments, each at its share of the way from left to right."""
    places = axes.across(first_s, last_s)
    words = text.row(*(value for _, value in places))
    return [(share, f"{word} s") for (share, _), word in zip(places, words, strict=True)]


def moment_of(words: str, zero_ns: int, newest_ns: int, here_ns: int) -> int:
    """Return the moment that is typed: so long after `zero_ns`, or a time of the clock that was last at `newest_ns`.

    Args:
        words: `250ms`, `12.5` (seconds); `-3s` counts from `newest_ns`, `+2s` from `here_ns`; `13:07`, `13:07:32.25`
            in this machine's time zone.
        zero_ns: what the times on the screen are counted from: the newest moment of a robot, the first of a file.
        newest_ns: the newest moment that is held.
        here_ns: where the cursor is.

    Raises:
        ValueError: that is no time, or one that is still to come, or the logger's clock is none of the day.
    """
    word = words.replace(" ", "")
    if (found := _CLOCK.fullmatch(word)) is None:
        sign, length = (-1 if word[:1] == "-" else 1), word.removeprefix(word[:1] if word[:1] in "+-" else "")
        known = float(length) if _NUMBER.fullmatch(length) else seconds_of(length)
        if not word:
            raise ValueError(f"type a time: {MOMENTS}")
        if known is None:
            raise ValueError(f"{words.strip()!r} is no time: {MOMENTS}")
        begin_ns = {"+": here_ns, "-": newest_ns}.get(word[:1], zero_ns)
        moment = begin_ns + sign * round(known * SECOND_NS)
        if moment > newest_ns:
            raise ValueError(
                f"{words.strip()} is later than all that is held, which ends at {_after(newest_ns - zero_ns)}"
            )
        return moment
    if newest_ns < EPOCH_FROM_NS:
        raise ValueError(f"this logger has a clock of its own, in which no time of the day is {word}: -3s, 12.5")
    hour, minute, second, part = int(found[1]), int(found[2]), int(found[3] or 0), f"{found[4] or '':0<9}"[:9]
    year, month, day, *_ = time.localtime(newest_ns // SECOND_NS)
    for back in (0, 1):  # of the day before, where it is still to come
        begun_s = time.mktime((year, month, day - back, hour, minute, second, 0, 0, -1))
        moment = int(begun_s) * SECOND_NS + int(part)
        if moment <= newest_ns:
            break
    return moment


def _after(moment_ns: int) -> str:
    return f"{moment_ns / SECOND_NS:.6g} s" if moment_ns else "0 s: -3s is before it"


def _free_cell(line: Sequence[str], cell: int, reach: int) -> int | None:
    """Return the empty cell next to one, itself first, not farther than `reach`; None where there is none."""
    near = (at for step in range(reach + 1) for at in dict.fromkeys((cell + step, cell - step)))
    return next((at for at in near if 0 <= at < len(line) and line[at] == " "), None)

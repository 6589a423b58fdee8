"""The line under plots: times at its quarters, and the letters of cursors and of what happened between them. Pure."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence

from silo_tui.model.drawing.window import SECOND_NS, PlotWindow
from silo_tui.model.lists.happened import RANK
from silo_tui.model.words import text

NO_BREAK = "\u00a0"
FAR = 10  # cells that a letter may stand beside its place


def axis_line(
    width: int, word_at: Callable[[float], str], cursors: Iterable[tuple[int, str]], events: Mapping[int, str]
) -> str:
    """Return the line; letters take the nearest empty cell, the rarer events first, limits none but their own."""
    line = [" "] * width
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        word = word_at(share)
        start = min(width - len(word), max(0, round(share * width) - (len(word) // 2 if 0 < share < 1 else 0)))
        begin, end = max(0, start - 1), min(width, start + len(word) + 1)
        if "".join(line[begin:end]).isspace():
            line[begin:end] = NO_BREAK * (end - begin)  # no letter goes in between, nor right beside it
            line[start : start + len(word)] = word.replace(" ", NO_BREAK)
    for cell, sign in [*cursors, *sorted(events.items(), key=lambda letter: RANK.index(letter[1]))]:
        if (free := _free_cell(line, cell, 0 if sign == "H" else FAR)) is not None:
            line[free] = sign
    return "".join(line).replace(NO_BREAK, " ")


def axis_word(share: float, window: PlotWindow, newest_ns: int, columns: int) -> str:
    """Return what stands under a place of a window that stands still, 0 ... 1 from left to right.

    It is counted from where the cursor's time is: the newest moment, which an earlier window doesn't end with.
    """
    before_s = window.span_s * (1 - share)
    end_ns = window.paused_end_ns
    back_s = 0.0 if end_ns is None else max(0, newest_ns - end_ns) / SECOND_NS
    if back_s < window.span_s / columns:
        return "0" if share == 1.0 else f"-{text.span(before_s)}"
    decimals = max(0, min(9, 1 - math.floor(math.log10(window.span_s / 4))))
    return f"-{back_s + before_s:.{decimals}f} s"


def _free_cell(line: Sequence[str], cell: int, reach: int) -> int | None:
    """Return the empty cell next to one, itself first, not farther than `reach`; None where there is none."""
    near = (at for step in range(reach + 1) for at in dict.fromkeys((cell + step, cell - step)))
    return next((at for at in near if 0 <= at < len(line) and line[at] == " "), None)

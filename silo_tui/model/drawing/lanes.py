"""Signals that are no curve, in one line: booleans as a lane, enumerations and texts as words in a band."""

from collections.abc import Callable, Sequence
from itertools import groupby

import numpy as np

from silo.core.arrays.columns import ColumnPiece
from silo_tui.model.words import text

FALSE, TRUE, BOTH = "▁", "█", "▄"
EDGE = "│"
MANY = "…"  # several values in one cell, or a word that is longer than its place

_NOTHING, _SEVERAL = "\0nothing", "\0several"


def bool_lane(piece: ColumnPiece, width: int) -> str:
    """Return `▁` where a boolean is false, `█` where it is true, `▄` where a cell has both."""
    low, high = _per_cell(piece, width)
    chars = np.where(np.isnan(low), " ", np.where(low > 0.5, TRUE, np.where(high > 0.5, BOTH, FALSE)))
    return "".join(chars.tolist())


def band(piece: ColumnPiece, word_of: Callable[[float], str], width: int) -> str:
    """Return the words of the values, each where it begins; `│` where one ends, `…` where several share a cell."""
    low, high = _per_cell(piece, width)
    cells = [
        _NOTHING if missing else word_of(value) if value == highest else _SEVERAL
        for missing, value, highest in zip(np.isnan(low).tolist(), low.tolist(), high.tolist(), strict=True)
    ]
    return _words(cells)


def events_band(events: Sequence[tuple[int, str]], end: int, column_ns: int, width: int) -> str:
    """Return texts, each at its time: `events` are (time_ns, text), `end` is one past the newest column."""
    first = end - 2 * width
    cells = [_NOTHING] * width
    begins: dict[int, int] = {}
    for time_ns, word in events:
        at = max(0, (time_ns // column_ns - first) // 2)
        if time_ns // column_ns >= end:
            break
        begins[at] = begins.get(at, 0) + (time_ns // column_ns >= first)
        cells[at:] = [word] * (width - at)
    for at, count in begins.items():
        if count > 1:
            cells[at] = _SEVERAL
    return _words(cells, edges=set(begins))


def _words(cells: Sequence[str], edges: set[int] | None = None) -> str:
    line: list[str] = []
    before = _NOTHING
    runs = groupby(range(len(cells)), lambda at: (cells[at], sum(edge <= at for edge in edges) if edges else 0))
    for (word, _), places in runs:
        length = len(list(places))
        if word is _NOTHING:
            line += " " * length
        elif word is _SEVERAL:
            line += EDGE if length == 1 else EDGE + MANY * (length - 1)
        else:
            # after several values the edge is drawn already
            edge = EDGE if before is not _NOTHING and before is not _SEVERAL else ""
            room = length - len(edge)
            shown = text.clean(word) or "''"
            shown = shown if len(shown) <= room else shown[: max(0, room - 1)] + MANY[: max(0, room)]
            line += edge + shown.ljust(room)
        before = word
    return "".join(line)


def _per_cell(piece: ColumnPiece, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest value of both columns of a cell."""
    low, high = piece.low[-2 * width :].reshape(-1, 2), piece.high[-2 * width :].reshape(-1, 2)
    return np.fmin(low[:, 0], low[:, 1]), np.fmax(high[:, 0], high[:, 1])

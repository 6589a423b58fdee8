"""Signals as minimum and maximum per column of time, on one fixed grid: column k covers `[k, k + 1) * column_ns`.

Because the grid is absolute, what a view sends, what history returns and what was there before can be laid over one
another in any order; a column that comes twice only gets wider, so that a spike of one sample is never lost.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class ColumnStore:
    """The newest `count` columns of some entries: `low`, `high` have shape `(len(names), count)`, NaN where empty."""

    def __init__(self, names: Sequence[str], count: int, column_ns: int) -> None:
        self.names = tuple(names)
        self.count = max(1, count)
        self.column_ns = column_ns
        self.first = 0  # absolute number of the first column kept
        self.low = np.full((len(names), self.count), np.nan)
        self.high = np.full((len(names), self.count), np.nan)
        self.empty = True
        self._row_of = {name: row for row, name in enumerate(self.names)}

    @property
    def end(self) -> int:
        """One past the absolute number of the newest column."""
        return self.first + self.count

    def row(self, name: str) -> int | None:
        """Which row an entry has."""
        return self._row_of.get(name)

    def advance_to(self, end: int) -> None:
        """Makes room so that the newest column is `end - 1`; older ones leave. Never goes back."""
        if self.empty:
            self.first, self.empty = end - self.count, False
            return
        step = end - self.end
        if step <= 0:
            return
        for array in (self.low, self.high):
            if step < self.count:
                array[:, :-step] = array[:, step:].copy()
            array[:, max(0, self.count - step) :] = np.nan
        self.first += step

    def merge(self, names: Sequence[str], first: int, low: Floats, high: Floats) -> None:
        """Lays columns `first ...` of some entries over what is there; `low`, `high` have shape `(len(names), k)`."""
        width = low.shape[1] if low.ndim == 2 else 0
        if not width:
            return
        self.advance_to(first + width)
        start, stop = max(first, self.first), min(first + width, self.end)
        if start >= stop:
            return
        known = [(row, theirs) for theirs, name in enumerate(names) if (row := self.row(name)) is not None]
        if not known:
            return
        mine, theirs = np.array(known, np.intp).T
        here, there = slice(start - self.first, stop - self.first), slice(start - first, stop - first)
        self.low[mine, here] = np.fmin(self.low[mine, here], low[theirs, there])
        self.high[mine, here] = np.fmax(self.high[mine, here], high[theirs, there])

    def window(self, name: str, end: int, width: int) -> tuple[Floats, Floats]:
        """`width` columns up to `end` (absolute, exclusive); NaN where there is nothing."""
        low, high = np.full(width, np.nan), np.full(width, np.nan)
        row = self.row(name)
        start, stop = max(end - width, self.first), min(end, self.end)
        if row is not None and start < stop:
            there = slice(start - (end - width), stop - (end - width))
            here = slice(start - self.first, stop - self.first)
            low[there], high[there] = self.low[row, here], self.high[row, here]
        return low, high

    def adopt(self, other: "ColumnStore") -> None:
        """Takes over what another store of the same grid has about the same entries."""
        if other.column_ns == self.column_ns and not other.empty:
            self.merge(other.names, other.first, other.low, other.high)


def hold(low: Floats, high: Floats, limit: int) -> tuple[Floats, Floats]:
    """Fills gaps of at most `limit` columns with the value before: a slow signal holds between its samples."""
    valid = ~np.isnan(low)
    if limit < 1 or valid.all() or not valid.any():
        return low, high
    places = np.where(valid, np.arange(len(low)), -1)
    source = np.maximum.accumulate(places)
    age = np.arange(len(low)) - source
    usable = (source >= 0) & (age <= limit)
    # what holds after a column is the value it ended with; its middle is the best that minimum and maximum tell
    middle = (low + high) / 2
    source = np.maximum(source, 0)
    fill_low = np.where(age == 0, low, middle[source])
    fill_high = np.where(age == 0, high, middle[source])
    return np.where(usable, fill_low, np.nan), np.where(usable, fill_high, np.nan)

"""Samples to columns: the one place where samples are reduced, and the one rule for what no curve can show.

Column k covers the time stamps `[k, k + 1) * column_ns`, absolutely: the same sample falls into the same column
whoever asks and when. A column holds the smallest and the largest finite number in it, so that a spike of one sample
always shows, and a byte of marks: whether it has NaN, +inf or -inf too, or why it has no sample at all.

What a value of which type counts as a number says `silo.core.arrays.values`. Used by the helper process, clients,
silo-tui, files and charts alike; knows none of them.
"""

import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.values import Floats, as_floats, numbers, rebased

__all__ = [
    "Bins",
    "ColumnGrid",
    "ColumnPiece",
    "ColumnStore",
    "Floats",
    "Gap",
    "HistoryColumns",
    "NonFinite",
    "as_floats",
]

MAX_COLUMNS = 4096
_HOLE_SHIFT = 4

Marks = NDArray[np.uint8]


class NonFinite(enum.IntFlag):
    """Samples in a column that are no finite number."""

    NAN = 1
    POS_INF = 2
    NEG_INF = 4


class Gap(enum.IntEnum):
    """Why a column has no sample; of several reasons the largest is told."""

    NONE = 0
    BEFORE = 1
    OVERWRITTEN = 2
    FULL = 3
    OFF = 4
    LOST = 5


HOLE_TEXTS = {
    Gap.NONE: "no sample",
    Gap.BEFORE: "before the start",
    Gap.OVERWRITTEN: "overwritten",
    Gap.FULL: "buffer full, not published then",
    Gap.OFF: "not logged then",
    Gap.LOST: "lost",
}
HOLES = np.uint8(0xF0)
FLAGS = np.uint8(NonFinite.NAN | NonFinite.POS_INF | NonFinite.NEG_INF)


def hole_mark(hole: Gap) -> int:
    """Return the byte of a column without sample."""
    return int(hole) << _HOLE_SHIFT


def holes_of(marks: Marks) -> Marks:
    """Return the `Gap` of each column, same shape."""
    holes: Marks = marks >> np.uint8(_HOLE_SHIFT)
    return holes


class Bins(msgspec.Struct, frozen=True):
    """Which samples share a column: `columns` are the numbers of those that have samples, ascending, at most 4096.

    `order` sorts the samples by time where the clock jumped back, None where it didn't; `starts` is where each column
    begins among the (sorted) samples from `skip` on.
    """

    columns: NDArray[np.int64]
    starts: NDArray[np.intp]
    order: NDArray[np.intp] | None = None
    skip: int = 0


def bins_of(time_ns: NDArray[np.int64], column_ns: int) -> Bins:
    """Return the bins of samples with these time stamps, shape `(n,)`; only the newest 4096 columns are kept."""
    columns = time_ns // column_ns
    order = None
    if len(columns) > 1 and (np.diff(columns) < 0).any():
        order = np.argsort(columns, kind="stable")
        columns = columns[order]
    skip = int(np.searchsorted(columns, columns[-1] - MAX_COLUMNS, "right")) if len(columns) else 0
    columns = columns[skip:]
    starts = np.flatnonzero(np.diff(columns, prepend=columns[0] - 1)) if len(columns) else np.zeros(0, np.intp)
    return Bins(columns[starts], starts, order, skip)


def bins_at(starts: NDArray[np.intp]) -> Bins:
    """Return the bins of samples in order: bin k begins at sample `starts[k]`, the last one ends with the samples."""
    return Bins(np.arange(len(starts), dtype=np.int64), starts)


class ColumnPiece(msgspec.Struct, frozen=True):
    """Some columns of one signal, shape `(k,)` each: smallest and largest finite value as offsets from `base`; marks.

    NaN where there is no finite value.
    """

    low: Floats
    high: Floats
    marks: Marks
    base: int = 0


def reduce(values: NDArray[Any], bins: Bins) -> ColumnPiece:
    """Return minimum, maximum and marks per column of `bins` that has samples, shape `(len(bins.columns),)`."""
    if bins.order is not None:
        values = values[bins.order]
    values = values[bins.skip :]
    if not len(bins.starts):
        return ColumnPiece(np.zeros(0), np.zeros(0), np.zeros(0, np.uint8))
    found = numbers(values)
    offsets = found.offsets
    marks = np.zeros(len(bins.starts), np.uint8)
    finite = np.isfinite(offsets)
    if not finite.all():
        for mark, hit in ((NonFinite.NAN, np.isnan(offsets)), (NonFinite.POS_INF, offsets == np.inf),
                          (NonFinite.NEG_INF, offsets == -np.inf)):  # fmt: skip
            marks |= np.where(np.logical_or.reduceat(hit, bins.starts), mark, 0).astype(np.uint8)
        offsets = np.where(finite, offsets, np.nan)
    low, high = np.fmin.reduceat(offsets, bins.starts), np.fmax.reduceat(offsets, bins.starts)
    return ColumnPiece(low, high, marks, found.base)


def coarser(low: Floats, high: Floats, marks: Marks, starts: NDArray[np.intp]) -> tuple[Floats, Floats, Marks]:
    """Return several columns as one, of one signal or of many: new column k begins at old column `starts[k]`."""
    low, high = np.fmin.reduceat(low, starts, axis=-1), np.fmax.reduceat(high, starts, axis=-1)
    flags = np.bitwise_or.reduceat(marks & FLAGS, starts, axis=-1)
    return low, high, _with_holes(low, flags, np.maximum.reduceat(marks & HOLES, starts, axis=-1))


def _with_holes(low: Floats, flags: Marks, holes: Marks) -> Marks:
    """Marks of columns: one that has a sample is no hole."""
    return flags | np.where(np.isnan(low) & (flags == 0), holes, np.uint8(0))


class ColumnGrid:
    """Columns `first ... first + count - 1` of several signals, filled piece by piece, in any order.

    `low` and `high`, shape `(signals, count)`, are offsets from each signal's base, NaN without finite value; `marks`
    are bytes of the same shape.
    """

    def __init__(self, signals: int, first: int, count: int) -> None:
        self.first = first
        self.low = np.full((signals, count), np.nan)
        self.high = np.full((signals, count), np.nan)
        self.marks: Marks = np.zeros((signals, count), np.uint8)
        self.bases = [0] * signals

    @property
    def count(self) -> int:
        """Columns."""
        return int(self.low.shape[1])

    @property
    def known_bases(self) -> dict[int, int]:
        """The bases that aren't 0, by row."""
        return {row: base for row, base in enumerate(self.bases) if base}

    def packed(self) -> dict[str, Any]:
        """What replies and frames say of it, by their fields: little-endian bytes, no marks where all are 0."""
        marks = self.marks.tobytes() if self.marks.any() else b""
        found = {"low": self.low.tobytes(), "high": self.high.tobytes(), "marks": marks, "bases": self.known_bases}
        return {"first": self.first, "count": self.count, **found}

    def add(self, signal: int, bins: Bins, values: NDArray[Any]) -> None:
        """Merge samples of one signal, of any type; columns outside of the grid are dropped."""
        found = reduce(values, bins)
        places = bins.columns - self.first
        wanted = (places >= 0) & (places < self.count)
        places = places[wanted]
        low, high = self._on_base(signal, found.base, found.low[wanted], found.high[wanted])
        self.low[signal, places] = np.fmin(self.low[signal, places], low)
        self.high[signal, places] = np.fmax(self.high[signal, places], high)
        flags = (self.marks[signal, places] | found.marks[wanted]) & FLAGS
        self.marks[signal, places] = _with_holes(self.low[signal, places], flags, self.marks[signal, places])

    def add_hole(self, signal: int, start: int, stop: int, hole: Gap) -> None:
        """Say why columns `start ... stop - 1` (absolute numbers) have no sample, where they have none."""
        place = slice(max(start - self.first, 0), max(stop - self.first, 0))
        marks = self.marks[signal, place]
        empty = np.isnan(self.low[signal, place]) & (marks & FLAGS == 0)
        self.marks[signal, place] = np.where(empty, np.maximum(marks, np.uint8(hole_mark(hole))), marks)

    def lay(self, rows: Sequence[int], other: "ColumnGrid", other_rows: Sequence[int]) -> None:
        """Lay columns of another grid over those that are here; a column that comes twice only gets wider."""
        start, stop = max(self.first, other.first), min(self.first + self.count, other.first + other.count)
        if start >= stop or not len(rows):
            return
        mine, theirs = np.array(rows, np.intp), np.array(other_rows, np.intp)
        here, there = slice(start - self.first, stop - self.first), slice(start - other.first, stop - other.first)
        low, high = other.low[theirs, there], other.high[theirs, there]
        for at, (row, its) in enumerate(zip(rows, other_rows, strict=True)):
            if other.bases[its] != self.bases[row]:
                low[at], high[at] = self._on_base(row, other.bases[its], low[at], high[at])
        self.low[mine, here] = np.fmin(self.low[mine, here], low)
        self.high[mine, here] = np.fmax(self.high[mine, here], high)
        marks, others = self.marks[mine, here], other.marks[theirs, there]
        if marks.any() or others.any():
            holes = np.maximum(marks & HOLES, others & HOLES)
            self.marks[mine, here] = _with_holes(self.low[mine, here], (marks | others) & FLAGS, holes)

    def columns(self, names: Sequence[str], column_ns: int, until_ns: int | None = None) -> "HistoryColumns":
        """Return all that is here, as if it had come as one history."""
        found = self.low, self.high, self.marks, self.known_bases
        return HistoryColumns(tuple(names), self.first, column_ns, *found, until_ns)

    def _on_base(self, row: int, base: int, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        """Offsets from the row's base, which becomes that of the newcomers where these have a larger one."""
        old = self.bases[row]
        if base == old or np.isnan(low).all():
            return low, high
        if np.isnan(self.low[row]).all() or abs(base) > abs(old):
            self.low[row], self.high[row] = rebased(self.low[row], old, base), rebased(self.high[row], old, base)
            self.bases[row] = base
            return low, high
        return rebased(low, base, old), rebased(high, base, old)


# --------------------------------------------------------------------------------------------- what travels and stays


@dataclass(frozen=True)
class HistoryColumns:
    """Minimum and maximum per column of some entries, shape `(len(names), count)`; NaN without finite number.

    Column k of the arrays covers the time stamps `[first + k, first + k + 1) * column_ns`. `low` and `high` are
    offsets from `bases` (by row; 0 where it isn't named), `marks` are bytes as above, None for none. All samples up to
    `until_ns` are in it, None where the source has no end that moves.
    """

    names: tuple[str, ...]
    first: int
    column_ns: int
    low: Floats
    high: Floats
    marks: Marks | None = None
    bases: Mapping[int, int] = field(default_factory=dict)
    until_ns: int | None = None


def grid_of(
    first: int, low: Floats, high: Floats, marks: Marks | None = None, bases: Mapping[int, int] | None = None
) -> ColumnGrid:
    """Return a grid on these arrays, shape `(signals, count)` each."""
    grid = ColumnGrid(0, first, 0)
    grid.low, grid.high = low, high
    grid.marks = np.zeros(low.shape, np.uint8) if marks is None else marks
    grid.bases = [(bases or {}).get(row, 0) for row in range(len(low))]
    return grid


class ColumnStore(ColumnGrid):
    """The newest `count` columns of some entries, on the grid of `column_ns`; `low`, `high` as in `ColumnGrid`.

    Because the grid is absolute, what a view sends, what history returns and what was there before can be laid over
    one another in any order.
    """

    def __init__(self, names: Sequence[str], count: int, column_ns: int) -> None:
        super().__init__(len(names), 0, max(1, count))
        self.names = tuple(names)
        self.column_ns = column_ns
        self.empty = True
        # all samples from `live_since_ns` on came by frames, and all up to `past_until_ns` by the history
        self.live_since_ns = 0
        self.past_until_ns: int | None = None
        self.row = {name: row for row, name in enumerate(self.names)}.get  # of an entry, None for one that isn't here

    @property
    def end(self) -> int:
        """One past the absolute number of the newest column."""
        return self.first + self.count

    @property
    def gapped(self) -> bool:
        """Whether frames went missing that the history can tell of: it is to be asked for again."""
        return self.past_until_ns is not None and self.live_since_ns > self.past_until_ns

    def advance_to(self, end: int) -> None:
        """Make room so that the newest column is `end - 1`; older ones leave. Never goes back."""
        if self.empty:
            self.first, self.empty = end - self.count, False
            return
        step = end - self.end
        if step <= 0:
            return
        for array, nothing in ((self.low, np.nan), (self.high, np.nan), (self.marks, 0)):
            if step < self.count:
                array[:, :-step] = array[:, step:].copy()
            array[:, max(0, self.count - step) :] = nothing
        self.first += step

    def merge(self, names: Sequence[str], grid: ColumnGrid) -> None:
        """Lay columns of some entries over what is there; `names` are those of its rows."""
        if not grid.count:
            return
        self.advance_to(grid.first + grid.count)
        known = [(row, theirs) for theirs, name in enumerate(names) if (row := self.row(name)) is not None]
        self.lay([mine for mine, _ in known], grid, [theirs for _, theirs in known])

    def take(self, past: HistoryColumns) -> None:
        """Lay a history over what is there; it must be of this grid."""
        self.merge(past.names, grid_of(past.first, past.low, past.high, past.marks, past.bases))
        self.past_until_ns = past.until_ns

    def stretch(self, until_ns: int | None) -> HistoryColumns:
        """Return all that is here, as if it had come as one history."""
        return self.columns(self.names, self.column_ns, until_ns)

    def piece(self, name: str, end: int, width: int) -> ColumnPiece:
        """Return `width` columns up to `end` (absolute, exclusive), empty where there is nothing."""
        low, high = np.full(width, np.nan), np.full(width, np.nan)
        marks = np.zeros(width, np.uint8)
        row = self.row(name)
        if row is None:
            return ColumnPiece(low, high, marks)
        start, stop = max(end - width, self.first), min(end, self.end)
        if start < stop:
            there = slice(start - (end - width), stop - (end - width))
            here = slice(start - self.first, stop - self.first)
            low[there], high[there], marks[there] = self.low[row, here], self.high[row, here], self.marks[row, here]
        return ColumnPiece(low, high, marks, self.bases[row])

    def adopt(self, other: "ColumnStore") -> None:
        """Take over what another store of the same grid has about the same entries."""
        if other.column_ns == self.column_ns and not other.empty:
            self.merge(other.names, other)


MIN_COLUMN_NS = 1_000

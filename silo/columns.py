"""Samples to columns: minimum and maximum per stretch of time, so that a spike of one sample always shows.

Column k covers the time stamps `[k, k + 1) * column_ns`, absolutely: the same sample falls into the same column
whoever asks and when.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

MAX_COLUMNS = 4096

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Bins:
    """Which samples share a column: `columns` are the numbers of those that have samples, ascending, at most 4096.

    `order` sorts the samples by time where the clock jumped back, None where it didn't; `starts` is where each column
    begins among the (sorted) samples from `skip` on.
    """

    columns: NDArray[np.int64]
    starts: NDArray[np.intp]
    order: NDArray[np.intp] | None
    skip: int


def bins_of(time_ns: NDArray[np.int64], column_ns: int) -> Bins:
    """Bins of samples with these time stamps, shape `(n,)`; only the newest 4096 columns are kept."""
    numbers = time_ns // column_ns
    order = None
    if len(numbers) > 1 and (np.diff(numbers) < 0).any():
        order = np.argsort(numbers, kind="stable")
        numbers = numbers[order]
    skip = int(np.searchsorted(numbers, numbers[-1] - MAX_COLUMNS, "right")) if len(numbers) else 0
    numbers = numbers[skip:]
    starts = np.flatnonzero(np.diff(numbers, prepend=numbers[0] - 1)) if len(numbers) else np.zeros(0, np.intp)
    return Bins(numbers[starts], starts, order, skip)


def reduce(values: Floats, bins: Bins) -> tuple[Floats, Floats]:
    """Minimum and maximum per column of `bins`, NaN where all samples are NaN."""
    if bins.order is not None:
        values = values[bins.order]
    values = values[bins.skip :]
    if not len(bins.starts):
        return np.zeros(0), np.zeros(0)
    return np.fmin.reduceat(values, bins.starts), np.fmax.reduceat(values, bins.starts)


def as_floats(column: NDArray[Any]) -> Floats:
    """Any numeric column as float64; what is no number becomes NaN, complex numbers their real part."""
    kind = column.dtype.kind
    if kind in "Mm":
        return column.view(np.int64).astype(np.float64)
    if kind == "c":
        column = column.real
    elif kind not in "biuf":
        return np.full(len(column), np.nan)
    return column.astype(np.float64)


class ColumnGrid:
    """Columns `first ... first + count - 1` of several signals, filled piece by piece."""

    def __init__(self, signals: int, first: int, count: int) -> None:
        self.first = first
        self.low = np.full((signals, count), np.nan)
        self.high = np.full((signals, count), np.nan)

    def add(self, signal: int, bins: Bins, values: Floats) -> None:
        """Merges samples of one signal; columns outside of the grid are dropped."""
        low, high = reduce(values, bins)
        places = bins.columns - self.first
        wanted = (places >= 0) & (places < self.low.shape[1])
        places = places[wanted]
        self.low[signal, places] = np.fmin(self.low[signal, places], low[wanted])
        self.high[signal, places] = np.fmax(self.high[signal, places], high[wanted])

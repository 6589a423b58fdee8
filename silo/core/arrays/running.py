"""Statistics of many signals, added up block by block: whatever is added when, the digits are those of all at once."""

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.columns import Floats

STATISTICS = ("min", "max", "mean", "std", "noise", "count", "bad")
# slots before and after
_Both: TypeAlias = tuple[slice, slice] | tuple[NDArray[np.intp], NDArray[np.intp]]


class RunningStatistics:
    """Minimum, maximum, mean and standard deviation of many signals over all samples that were added, but NaN.

    Of infinite ones, as everywhere: they are extremes, the mean is infinite, too, and there is no deviation. `noise` is
    of second differences of samples: their root mean square over sqrt(6), which is the standard deviation of white
    noise, whatever slow motion it lies on (the Hadamard deviation at one sample).
    """

    def __init__(self, count: int) -> None:
        self.since_ns = 0  # when they begin, as far as somebody says so
        self.low, self.high = np.full(count, np.inf), np.full(count, -np.inf)
        self.number, self.bad = np.zeros(count, np.int64), np.zeros(count, np.int64)
        self._base = np.full(count, np.nan)  # sums of what is left of it lose no digits
        self._sum, self._squares = np.zeros(count), np.zeros(count)
        self._before, self._last = np.full(count, np.nan), np.full(count, np.nan)
        self._bends, self._bend_squares = np.zeros(count, np.int64), np.zeros(count)

    def moved(self, count: int, kept: Sequence[tuple[slice, slice]]) -> "RunningStatistics":
        """Return statistics of `count` signals that go on with these; `kept` are slots here, and where they are there.

        Those of the other slots begin.
        """
        made = RunningStatistics(count)
        made.since_ns = self.since_ns
        arrays = [name for name, each in vars(self).items() if isinstance(each, np.ndarray)]
        move(vars(self), vars(made), arrays, kept)
        return made

    def add(self, slots: slice, block: Floats, *, all_finite: bool) -> None:
        """Add samples, shape `(n, number of slots)`."""
        base = self._base[slots]
        new = np.isnan(base)
        if new.any():
            finite = np.isfinite(block)
            first = block[np.argmax(finite, axis=0), np.arange(block.shape[1])]
            base[new & finite.any(axis=0)] = first[new & finite.any(axis=0)]
        with np.errstate(invalid="ignore", over="ignore"):
            if all_finite:
                self.low[slots] = np.minimum(self.low[slots], block.min(axis=0))
                self.high[slots] = np.maximum(self.high[slots], block.max(axis=0))
                rest = block - base
                self.number[slots] += len(block)
            else:
                finite = np.isfinite(block)
                self.low[slots] = np.fmin(self.low[slots], np.fmin.reduce(block, axis=0))
                self.high[slots] = np.fmax(self.high[slots], np.fmax.reduce(block, axis=0))
                rest = np.where(finite, block - base, 0.0)
                self.number[slots] += finite.sum(axis=0)
                self.bad[slots] += (~finite).sum(axis=0)
            self._sum[slots] += rest.sum(axis=0)
            self._squares[slots] += np.einsum("ij,ij->j", rest, rest)
            bends = rest  # which is done with
            np.multiply(block[1:-1], -2.0, out=bends[2:])
            bends[2:] += block[2:]
            bends[2:] += block[:-2]
            known = np.stack([self._before[slots], self._last[slots]])
            bends[:2] = np.diff(np.concatenate([known, block[:2]]), 2, axis=0)
            some = bends[:2] if all_finite else bends
            unknown = ~np.isfinite(some)
            some[unknown] = 0.0
            self._bends[slots] += len(bends) - unknown.sum(axis=0)
            self._bend_squares[slots] += np.einsum("ij,ij->j", bends, bends)
            self._before[slots], self._last[slots] = np.concatenate([known, block[-2:]])[-2:]

    def of(self, quantity: str) -> Floats:
        """Return one of `STATISTICS`, NaN where there are too few samples.

        `count` is of the finite ones, `bad` of all others.
        """
        if quantity in {"count", "bad"}:
            return (self.number if quantity == "count" else self.bad).astype(float)
        if quantity in {"min", "max"}:
            found = self.low if quantity == "min" else self.high
            return np.where(self.low <= self.high, found, np.nan)
        if quantity == "noise":
            with np.errstate(invalid="ignore"):
                return np.sqrt(self._bend_squares / (6 * self._bends))
        infinite = np.where(self.high == np.inf, np.inf, 0.0), np.where(self.low == -np.inf, -np.inf, 0.0)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            mean = self._sum / self.number
            if quantity == "mean":
                ends = infinite[0] + infinite[1]  # NaN of both
                return np.where(ends == 0.0, self._base + mean, ends)
            std = np.sqrt(np.maximum(self._squares / self.number - mean * mean, 0.0))
            return np.where((infinite[0] == 0.0) & (infinite[1] == 0.0), std, np.nan)


def move(
    before: Mapping[str, NDArray[Any]], after: Mapping[str, NDArray[Any]], names: Sequence[str], kept: Sequence[_Both]
) -> None:
    """Copy the kept slots of the arrays of these names."""
    for name in names:
        for here, there in kept:
            after[name][there] = before[name][here]

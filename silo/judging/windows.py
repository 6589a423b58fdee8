"""Minimum, maximum, mean and deviation within a moving time, the same however the samples come in batches.

A window is put together of blocks of 1, 2, 4, ... samples that begin at multiples of their length, counted from the
start. Which blocks these are follows from the window alone, and so does every rounding; running sums would differ with
each cut, and keep an infinity for ever. The cost per row grows with the logarithm of the window.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Merge = Callable[[Floats, Floats], Floats]


@dataclass
class Window:
    """One moving window over a scalar or a vector, with the samples that it still needs.

    NaN samples are left out. `function` is `min`, `max`, `mean` or `std`.
    """

    function: str
    window_ns: int
    _times: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    _values: Floats | None = None
    _first: int = 0  # which sample since the start the oldest kept one is
    _zero: Floats | None = None  # the first samples: distances from them keep the digits of large numbers

    def feed(self, time_ns: NDArray[np.int64], values: Floats, breaks: NDArray[np.intp]) -> Floats:
        """Return the value at each sample, over those of the last `window_ns` with itself; NaN where there is none.

        `values` has shape `(n,)` or `(n, k)`. At `breaks`, and where the clock goes back, the window begins anew.
        """
        if not len(time_ns):
            return values
        flat = values.reshape(len(values), -1)
        kept = len(self._times)
        times = np.concatenate([self._times, time_ns]) if kept else time_ns
        samples = np.concatenate([self._values, flat]) if kept and self._values is not None else flat
        jumps = np.flatnonzero(times[1:] < times[:-1]) + 1
        cuts = np.unique(np.concatenate([breaks + kept, jumps])).tolist()
        starts = np.empty(len(times) - kept, np.int64)
        begin = 0
        for end in [*cuts, len(times)]:
            low = max(begin, kept)
            if end > low:
                found = np.searchsorted(times[begin:end], times[low:end] - self.window_ns, "right")
                starts[low - kept : end - kept] = begin + found
            begin = end
        stops = np.arange(kept + 1, len(times) + 1, dtype=np.int64)
        made = self._reduced(samples, starts, stops)
        drop = int(starts[-1])
        self._times, self._values = times[drop:].copy(), samples[drop:].copy()
        self._first += drop
        return made.reshape(values.shape)

    def _reduced(self, samples: Floats, starts: NDArray[np.int64], stops: NDArray[np.int64]) -> Floats:
        if self.function in ("min", "max"):
            # NaN is what fmin and fmax leave out
            merge = np.fmin if self.function == "min" else np.fmax
            return _query(samples, self._first, starts, stops, merge, np.full(samples.shape[1:], np.nan))
        missing = np.isnan(samples)
        counts = np.where(missing, 0.0, 1.0)
        clean = np.where(missing, 0.0, samples)
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            if self.function == "mean":
                pairs = np.stack([clean, counts], axis=-1)
                total = _query(pairs, self._first, starts, stops, np.add, np.zeros(pairs.shape[1:]))
                mean: Floats = total[..., 0] / total[..., 1]
                return mean
            if self._zero is None:
                self._zero = np.where(np.isfinite(samples[0]), samples[0], 0.0)
            moments = np.stack([counts, clean - self._zero, np.zeros_like(clean)], axis=-1)
            found = _query(moments, self._first, starts, stops, _merged_moments, np.zeros(moments.shape[1:]))
            deviation: Floats = np.sqrt(found[..., 2] / found[..., 0])
            return deviation


def _merged_moments(one: Floats, other: Floats) -> Floats:
    """Count, mean and sum of squared distances of two sets together (Chan's formula: nothing cancels)."""
    count = one[..., 0] + other[..., 0]
    share = other[..., 0] / np.where(count > 0, count, 1.0)
    away = other[..., 1] - one[..., 1]
    mean = np.where(one[..., 0] > 0, one[..., 1] + away * share, other[..., 1])
    both = (one[..., 0] > 0) & (other[..., 0] > 0)
    squares = one[..., 2] + other[..., 2] + np.where(both, away * away * one[..., 0] * share, 0.0)
    return np.stack([count, mean, squares], axis=-1)


def _query(
    level: Floats, first: int, starts: NDArray[np.int64], stops: NDArray[np.int64], merge: Merge, empty: Floats
) -> Floats:
    """Return each `level[starts[i]:stops[i]]` merged along the first axis; `first` is the number of `level[0]`."""
    low, high = starts + first, stops + first
    # from the left and from the right: a window's blocks are merged in the order of their samples
    left = np.broadcast_to(empty, (len(low), *empty.shape)).copy()
    right = left.copy()
    while True:
        odd = np.flatnonzero((low & 1 == 1) & (low < high))
        if len(odd):
            left[odd] = merge(left[odd], level[low[odd] - first])
            low[odd] += 1
        odd = np.flatnonzero((high & 1 == 1) & (low < high))
        if len(odd):
            high[odd] -= 1
            right[odd] = merge(level[high[odd] - first], right[odd])
        if not (low < high).any():
            return merge(left, right)
        skip = first & 1  # half a block at the beginning is in no window that is left
        pairs = (len(level) - skip) // 2
        level = merge(level[skip : skip + 2 * pairs : 2], level[skip + 1 : skip + 2 * pairs : 2])
        first = (first + skip) // 2
        low >>= 1
        high >>= 1

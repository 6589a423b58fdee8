"""Minimum, maximum, sum, mean and deviation within a moving time, the same however the samples come in batches.

A window is put together of what stands before and what stands after one sample, the turn: accumulated from the turn
backwards once, and from the turn on as samples come. When a window has left the turn behind, its newest sample is the
next one. So nothing is ever subtracted, an infinity is gone with its sample, and a row costs the same for any window.
Where the turns are follows from the windows alone, and so does every rounding. Windows of a few samples, which would
turn at every other row, are gathered instead.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SHORT = 64  # samples that are gathered: the mean of 50 rows of them takes 40 us
_EXTREMES = {"min": np.fmin, "max": np.fmax}
BLOCK = 128  # rows that are gathered at once: 5000 of them leave the cache and take 7 us each, these 1


@dataclass
class WindowMemory:
    """What a window needs to go on: its samples, the number of the oldest since the start, and two more numbers."""

    times: np.ndarray
    samples: np.ndarray
    first: int
    begin: int  # of the stretch without a break
    turn: int  # -1 for none


@dataclass
class _Side:
    """Samples accumulated from the turn: by row how many there are and what they make, shape `(n, parts, k)`.

    The parts are minimum, maximum or sum; for the deviation the sums of distances from a `center`, and of their
    squares. The center is one of the samples: that keeps the digits of large numbers.
    """

    counts: Floats
    parts: Floats
    center: Floats


@dataclass
class Window:
    """One moving window over a scalar or a vector, with the samples that it still needs.

    NaN samples are left out. `function` is `min`, `max`, `sum`, `mean` or `std`.
    """

    function: str
    window_ns: int
    _times: Ints = field(default_factory=lambda: np.zeros(0, np.int64))  # with room for more
    _samples: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    _low: int = 0  # where in them the kept samples begin and end
    _high: int = 0
    _first: int = 0  # which sample since the start is in place 0
    _begin: int = 0  # which one the present stretch without a break begins with
    _turn: int = -1
    _before: _Side | None = None  # row i: samples `_from + i` up to the turn
    _mean: Floats = field(default_factory=lambda: np.zeros((0, 0)))  # of its rows, for the deviation
    _spread: Floats = field(default_factory=lambda: np.zeros((0, 0)))  # squares of the distances from it
    _from: int = 0
    _after: _Side | None = None  # one row: samples from the turn on, before sample `_next`
    _next: int = 0

    def feed(self, time_ns: Ints, values: Floats, breaks: NDArray[np.intp]) -> Floats:
        """Return the value at each sample, over those of the last `window_ns` with itself; NaN where there is none.

        `values` has shape `(n,)` or `(n, k)`. At `breaks`, and where the clock goes back, the window begins anew.
        """
        count = len(time_ns)
        if not count:
            return values
        flat = values.reshape(count, -1)
        self._append(time_ns, flat)
        end = self._first + self._high
        stops = np.arange(end - count + 1, end + 1)
        starts = self._starts(time_ns, breaks, int(stops[0]) - 1)
        made = np.empty_like(flat)
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            lengths = stops - starts
            if lengths.max() <= SHORT:
                for low in range(0, count, BLOCK):
                    made[low : low + BLOCK] = self._gathered(starts[low : low + BLOCK], stops[low : low + BLOCK])
            elif lengths.min() > SHORT:
                self._accumulated(starts, stops, made)
            else:
                is_short = lengths <= SHORT
                places = np.flatnonzero(is_short)
                for low in range(0, len(places), BLOCK):
                    block = places[low : low + BLOCK]
                    made[block] = self._gathered(starts[block], stops[block])
                long = np.empty((int(count - is_short.sum()), flat.shape[1]))
                self._accumulated(starts[~is_short], stops[~is_short], long)
                made[~is_short] = long
        self._low = int(starts[-1]) - self._first
        return made.reshape(values.shape)

    # ------------------------------------------------------------------------------------------------- the samples

    def _append(self, time_ns: Ints, flat: Floats) -> None:
        count = len(time_ns)
        if self._high + count > len(self._times):
            kept = self._high - self._low
            room = 2 * (kept + count)
            times, samples = np.empty(room, np.int64), np.empty((room, flat.shape[1]))
            times[:kept] = self._times[self._low : self._high]
            if kept:
                samples[:kept] = self._samples[self._low : self._high]
            self._times, self._samples = times, samples
            self._first, self._low, self._high = self._first + self._low, 0, kept
        self._times[self._high : self._high + count] = time_ns
        self._samples[self._high : self._high + count] = flat
        self._high += count

    def _starts(self, time_ns: Ints, breaks: NDArray[np.intp], number: int) -> Ints:
        """The first sample of the window of each new sample, the first of which has this number."""
        count, place = len(time_ns), number - self._first
        cuts = breaks.tolist()
        back = time_ns[1:] < time_ns[:-1]
        if back.any():
            cuts = sorted({*cuts, *(np.flatnonzero(back) + 1).tolist()})
        if place > self._low and time_ns[0] < self._times[place - 1] and 0 not in cuts:
            cuts = [0, *cuts]
        starts = np.empty(count, np.int64)
        low = 0
        for high in [*cuts, count]:
            if high > low:
                begin = max(self._begin - self._first, self._low)
                times = self._times[begin : place + high]
                starts[low:high] = np.searchsorted(times, time_ns[low:high] - self.window_ns, "right") + begin
            if high < count:
                self._begin = number + high
            low = high
        starts += self._first
        return starts

    def _part(self, low: int, high: int) -> Floats:
        return self._samples[low - self._first : high - self._first]

    # ----------------------------------------------------------------------------------------------- short windows

    def _gathered(self, starts: Ints, stops: Ints) -> Floats:
        lengths = stops - starts
        width, rows = int(lengths.max()), len(starts)
        has_nan = bool(np.isnan(self._part(int(starts[0]), int(stops[-1]))).any())
        if rows > 1 and not has_nan and int(lengths.min()) == width and int(starts[-1] - starts[0]) == rows - 1:
            return self._alike(int(starts[0]), rows, width)
        along = np.arange(width)
        inside = along < lengths[:, None]
        samples = self._samples[np.minimum(starts[:, None] + along, stops[:, None] - 1) - self._first]
        known = inside[:, :, None]
        center = samples[:, :1]
        counts = lengths[:, None].astype(np.float64)
        if has_nan:
            known = known & ~np.isnan(samples)
            center = np.take_along_axis(samples, known.argmax(axis=1)[:, None], 1)
            counts = known.sum(axis=1).astype(np.float64)
        if merge := _EXTREMES.get(self.function):
            reduced: Floats = merge.reduce(np.where(known, samples, np.nan), axis=1)
            return reduced
        if self.function in ("sum", "mean"):
            # added up one by one, whatever stands beside them
            return self._of_sums(np.cumsum(np.where(known, samples, 0.0), axis=1)[:, -1], counts)
        away = np.where(known, samples - center, 0.0)
        total = np.cumsum(away, axis=1)[:, -1]
        return _deviation(np.cumsum(away * away, axis=1)[:, -1] - total * total / counts, counts)

    def _alike(self, start: int, rows: int, width: int) -> Floats:
        """The values of windows of as many samples each, one sample after the other: what there is nearly always.

        Half of the time of the other way, which comes to the same: sums are made one sample after the other here, too.
        With the samples of a window in the first axis NumPy adds whole rows; of one row alone it would add in pairs.
        """
        step, scalars = self._samples.strides[0], self._samples.shape[1]
        samples: Floats = np.ndarray(
            (width, rows, scalars), np.float64, self._samples, (start - self._first) * step, (step, step, 8)
        )
        if merge := _EXTREMES.get(self.function):
            reduced: Floats = merge.reduce(samples, axis=0)
            return reduced
        if self.function in ("sum", "mean"):
            return self._of_sums(np.add.reduce(samples.copy(), axis=0), float(width))
        away = samples - samples[:1]
        total = np.add.reduce(away, axis=0)
        squares = np.add.reduce(away * away, axis=0)
        return _deviation(squares - total * total / float(width), float(width))

    def _of_sums(self, total: Floats, counts: Floats | float) -> Floats:
        made: Floats = total / counts if self.function == "mean" else np.where(counts == 0, np.nan, total)
        return made

    # ------------------------------------------------------------------------------------------------ long windows

    def _accumulated(self, starts: Ints, stops: Ints, made: Floats) -> None:
        row = 0
        while row < len(starts):
            if self._turn < 0 or starts[row] > self._turn:
                self._turn_at(int(starts[row]), int(stops[row]) - 1)
            end = row + int(np.searchsorted(starts[row:], self._turn, "right"))
            made[row:end] = self._merged(starts[row:end], stops[row:end])
            row = end

    def _turn_at(self, start: int, turn: int) -> None:
        """Have windows from sample `start` on put together at this one."""
        self._turn = self._next = turn
        samples = self._part(start, turn)[::-1]
        side, nothing = self._nothing(), np.zeros((1, samples.shape[1]))
        self._from, self._before = start, self._extended(side, samples)
        # the last row is of no sample at all, forward order
        self._before.counts = np.concatenate([nothing, self._before.counts])[::-1]
        self._before.parts = np.concatenate([side.parts, self._before.parts])[::-1]
        if self.function == "std":
            counts, total = self._before.counts, self._before.parts[:, 0]
            with np.errstate(invalid="ignore"):  # also when it is recalled
                mean = total / counts
            # of windows that end before the turn: nothing of it counts
            self._spread = np.where(counts == 0, 0.0, self._before.parts[:, 1] - total * mean)
            self._mean = np.where(counts == 0, 0.0, mean)
        self._after = self._nothing()

    def _nothing(self) -> _Side:
        width = self._samples.shape[1]
        parts = np.full((1, 1, width), np.nan) if self.function in _EXTREMES else np.zeros((1, 2, width))
        if self.function in ("sum", "mean"):
            parts = parts[:, :1]
        return _Side(np.zeros((1, width)), parts, np.full(width, np.nan))

    def _extended(self, side: _Side, samples: Floats) -> _Side:
        """What comes out at each of more samples."""
        if merge := _EXTREMES.get(self.function):
            made = merge.accumulate(np.concatenate([side.parts[-1], samples]))[1:]
            return _Side(np.zeros(samples.shape), made[:, None], side.center)
        missing = np.isnan(samples)
        center = side.center
        if missing.any():
            known = np.where(missing, 0.0, 1.0)
            counts = np.cumsum(np.concatenate([side.counts[-1:], known]), axis=0)[1:]
            if self.function == "std" and np.isnan(center).any() and len(samples):
                found = samples[(~missing).argmax(axis=0), np.arange(samples.shape[1])]
                center = np.where(np.isnan(center), found, center)
        else:
            counts = side.counts[-1] + np.arange(1.0, len(samples) + 1)[:, None]
            if self.function == "std" and len(samples):
                center = np.where(np.isnan(center), samples[0], center)
        away = samples - center if self.function == "std" else samples
        if missing.any():
            away = np.where(missing, 0.0, away)
        stacked = np.empty((len(samples) + 1, side.parts.shape[1], samples.shape[1]))
        stacked[0], stacked[1:, 0] = side.parts[-1], away
        if self.function == "std":
            np.multiply(away, away, out=stacked[1:, 1])
        return _Side(counts, np.cumsum(stacked, axis=0)[1:], center)

    def _merged(self, starts: Ints, stops: Ints) -> Floats:
        """The value of windows that have the turn in them."""
        assert self._before is not None
        assert self._after is not None
        last = int(stops[-1])
        begin = self._next
        after = self._extended(self._after, self._part(begin, last))
        rows = starts - self._from
        if len(rows) == last - begin:  # nearly always: each of the samples is one of the rows
            counts, parts = after.counts, after.parts
        else:
            counts, parts = after.counts[stops - begin - 1], after.parts[stops - begin - 1]
        before = self._before
        self._after, self._next = _Side(after.counts[-1:], after.parts[-1:], after.center), last
        if merge := _EXTREMES.get(self.function):
            extreme: Floats = merge(before.parts[rows, 0], parts[:, 0])
            return extreme
        counts_before = before.counts[rows]
        both = counts_before + counts
        if self.function in ("sum", "mean"):
            return self._of_sums(before.parts[rows, 0] + parts[:, 0], both)
        spread_before = self._spread[rows]
        mean_after = parts[:, 0] / counts
        spread_after = parts[:, 1] - parts[:, 0] * mean_after
        apart = (mean_after - self._mean[rows]) + (after.center - before.center)
        # Chan's formula for two sets together: nothing cancels
        whole = spread_before + spread_after + apart * apart * (counts_before * counts / both)
        if not counts_before.all():  # of nothing there is no center either
            whole = np.where(counts_before == 0, spread_after, whole)
        if not counts.all():
            whole = np.where(counts == 0, spread_before, whole)
        return _deviation(whole, both)

    # ---------------------------------------------------------------------------------------------------- going on

    def memory(self) -> WindowMemory:
        """Return what another window of this function and length needs to go on in this one's place."""
        low, high = self._low, self._high
        return WindowMemory(
            self._times[low:high].copy(), self._samples[low:high].copy(), self._first + low, self._begin, self._turn
        )

    def recall(self, memory: WindowMemory) -> None:
        """Go on where another window stood."""
        self._times, self._samples = memory.times.copy(), memory.samples.copy()
        self._first, self._low, self._high = memory.first, 0, len(memory.times)
        self._begin, turn = memory.begin, memory.turn
        self._turn = -1
        if turn >= memory.first:
            self._turn_at(memory.first, turn)
            after = self._extended(self._nothing(), self._part(turn, memory.first + self._high))
            self._after = _Side(after.counts[-1:], after.parts[-1:], after.center)
            self._next = memory.first + self._high


def _deviation(squares: Floats, counts: Floats | float) -> Floats:
    made: Floats = np.sqrt(np.maximum(squares, 0.0) / counts)
    return made

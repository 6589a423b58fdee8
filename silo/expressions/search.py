"""Which samples of a signal are what one looks for: the highest, a crossing, a change, a hole; exact to the sample.

`places` looks through one array, `Finder` through any number of blocks and keeps as many moments as are asked for, next
to a time: what a ring holds may be longer than what fits into an answer. Both find the same.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.values import as_floats, numbers
from silo.core.elements import Sought

Places = NDArray[np.intp]
Ends = tuple[float, float]  # int, too
LONG_GAP = 1.5  # periods between two samples from which on some are missing
UP, DOWN = 5 / 8, 3 / 8  # of what a signal spans: a swing goes over the one and below the other


@dataclass(frozen=True)
class Looking:
    """What one looks for: a crossing of `level`, with `direction` 1 rising, -1 falling, 0 either way; with peaks -1
    are troughs, of what is outside -1 are the last samples that are.

    `bounds` are the smallest and the largest value inside; a hole is a time without sample that is longer than 1.5
    `period_ns`, and than `level` seconds.
    """

    what: Sought
    level: float = 0.0
    direction: int = 0
    bounds: tuple[float | None, float | None] = (None, None)
    period_ns: int = 1

    @property
    def needs_span(self) -> bool:
        """Whether the smallest and the largest value must be known before the places can be."""
        return self.what in (Sought.EDGE, Sought.PEAK)


@dataclass(frozen=True)
class FoundMoments:
    """Moments of one signal, oldest first: `total` in all, of which `before` come before those that are here.

    `values` are those of the samples, of a hole its length in ns. `begin_ns` and `end_ns` are the oldest and the newest
    sample that was looked at, both 0 where there was none, and `why` says why.
    """

    total: int
    before: int
    time_ns: NDArray[np.int64]
    values: NDArray[Any]
    begin_ns: int = 0
    end_ns: int = 0
    why: str = ""


def places(looking: Looking, time_ns: NDArray[np.int64], values: NDArray[Any], ends: Ends | None = None) -> Places:
    """Return which samples are what one looks for, ascending; both arrays of shape `(n,)`.

    A crossing is the first sample on the other side of the level (on it counts as above), the nan in between left out.
    A hole is the last sample before it. An edge is a step of more than half of what the signal spans; `ends` are
    its smallest and its largest value where these are not all its samples. A peak is the first highest sample from
    where a signal rose over 5/8 of what it spans until it fell below 3/8: of a ripple on a swing there is one.
    """
    what = looking.what
    if what is Sought.HOLE:
        return np.flatnonzero(np.diff(time_ns) > max(LONG_GAP * looking.period_ns, looking.level * 1e9))
    if what is Sought.CHANGE or (what is Sought.EDGE and values.dtype.kind in "SUVb"):
        return _changes(values)
    if values.dtype.kind in ("SUVb" if what is Sought.PEAK else "SUV"):
        return np.zeros(0, np.intp)
    if looking.needs_span:
        ends = _ends(values) if ends is None else ends
        return _edges(values, *ends) if what is Sought.EDGE else _peaks(values, ends, looking.direction)[0]
    found = numbers(values)
    offsets = found.offsets
    if what is Sought.NOT_FINITE:
        return run_begins(~np.isfinite(offsets))
    if what is Sought.OUTSIDE:
        low, high = (None if bound is None else bound - found.base for bound in looking.bounds)
        outside = np.zeros(len(offsets), np.bool_)
        outside |= False if low is None else offsets < low
        outside |= False if high is None else offsets > high
        return run_ends(outside) if looking.direction < 0 else run_begins(outside)
    if what is Sought.CROSSING:
        # the level moves to the base: it is the float, the samples are exact
        return _crossings(offsets, looking.level - found.base, looking.direction)
    numbered = offsets[~np.isnan(offsets)]
    if not len(numbered):
        return np.zeros(0, np.intp)
    return run_begins(offsets == (numbered.max() if what is Sought.HIGHEST else numbered.min()))


def run_begins(here: NDArray[np.bool_]) -> Places:
    """Return where each unbroken run begins."""
    return np.flatnonzero(here & ~np.concatenate([[False], here[:-1]]))


def run_ends(here: NDArray[np.bool_]) -> Places:
    """Return where each unbroken run ends."""
    return np.flatnonzero(here & ~np.concatenate([here[1:], [False]]))


def _changes(values: NDArray[Any]) -> Places:
    if len(values) < 2:
        return np.zeros(0, np.intp)
    after, before = values[1:], values[:-1]
    # a nan after a nan is no change
    missing = np.isnan(values) if values.dtype.kind in "fc" else np.isnat(values) if values.dtype.kind in "Mm" else None
    both = np.zeros(len(after), np.bool_) if missing is None else missing[1:] & missing[:-1]
    return np.flatnonzero((after != before) & ~both) + 1


def _crossings(values: NDArray[np.float64], level: float, direction: int) -> Places:
    known = np.flatnonzero(~np.isnan(values))
    above = values[known] >= level
    rising = ~above[:-1] & above[1:]
    falling = above[:-1] & ~above[1:]
    wanted = rising if direction > 0 else falling if direction < 0 else rising | falling
    return known[1:][wanted] if len(known) else known


def _ends(values: NDArray[Any]) -> Ends:
    """Return the smallest and the largest finite value, of integers exactly; where there is none inf and -inf."""
    finite = values if values.dtype.kind in "iu" else (floats := as_floats(values))[np.isfinite(floats)]
    return (finite.min().item(), finite.max().item()) if len(finite) else (np.inf, -np.inf)


def _edges(values: NDArray[Any], low: float, high: float) -> Places:
    """Steps of more than half of what the signal spans, from one sample to the next."""
    if len(values) < 2 or not high > low:
        return np.zeros(0, np.intp)
    if values.dtype.kind in "iu":
        # at 2^63 two floats next to each other are 1024 apart: whole numbers are compared as such
        larger, smaller = np.maximum(values[1:], values[:-1]), np.minimum(values[1:], values[:-1])
        steps = larger.astype(np.uint64) - smaller.astype(np.uint64)
        return np.flatnonzero(steps > np.uint64((int(high) - int(low)) // 2)) + 1
    floats = as_floats(values) / 2  # the step from the smallest to the largest float is none
    with np.errstate(invalid="ignore"):
        halves = np.abs(floats[1:] - floats[:-1])
    return np.flatnonzero(np.isfinite(halves) & (halves > (high / 2 - low / 2) / 2)) + 1


def _peaks(values: NDArray[Any], ends: Ends, direction: int, *, first: bool = True) -> tuple[Places, int | None]:
    """Return the peaks, and the highest sample since it rose where it has not fallen yet.

    Where these samples are the `first` of all, one that begins high has risen at the earliest with the next.
    """
    low, high = ends
    if not high > low:
        return np.zeros(0, np.intp), None
    with np.errstate(invalid="ignore"):  # halves: from the smallest to the largest float is no float
        heights = (as_floats(values) / 2 - low / 2) / (high / 2 - low / 2)
    heights = 1 - heights if direction < 0 else heights
    sides = (heights > UP).astype(np.int8) - (heights < DOWN)
    known = np.flatnonzero(sides)
    turns = known[np.diff(sides[known], prepend=-1) != 0]  # up, down, up ...
    if not len(turns):
        return turns, None
    heights = np.where(np.isnan(heights), -np.inf, heights)[turns[0] :]
    stretch = np.repeat(np.arange(len(turns)), np.diff(turns, append=len(values)))
    highest = np.flatnonzero(heights == np.maximum.reduceat(heights, turns - turns[0])[stretch])
    tops = turns[0] + highest[np.unique(stretch[highest], return_index=True)[1]][::2]
    still = int(tops[-1]) if len(turns) % 2 else None
    tops = tops[: len(turns) // 2]
    return tops[tops > 0] if first else tops, still


class Finder:
    """Looks through the blocks of one signal, oldest first, and keeps the `most` moments next to `around_ns`."""

    def __init__(self, looking: Looking, around_ns: int, most: int) -> None:
        self.looking = looking
        self._around_ns = around_ns
        self._most = max(1, most)
        self._low: float = np.inf  # of all samples, where a search needs that first
        self._high: float = -np.inf
        self._tail: tuple[NDArray[np.int64], NDArray[Any]] | None = None  # what the next block is compared with
        self._extreme: Any = None
        self._begin_ns: int | None = None
        self._end_ns = 0
        self._forget()

    def _forget(self) -> None:
        self._total = self._early = 0
        self._times: list[list[NDArray[np.int64]]] = [[], []]
        self._values: list[list[NDArray[Any]]] = [[], []]
        self._counts = [0, 0]

    def measure(self, values: NDArray[Any]) -> None:
        """Note what a block spans: first of all blocks, where `looking.needs_span`."""
        if values.dtype.kind not in "SUVb":
            low, high = _ends(values)
            self._low, self._high = min(self._low, low), max(self._high, high)

    def feed(self, time_ns: NDArray[np.int64], values: NDArray[Any]) -> None:
        """Look through the next block."""
        if not len(time_ns):
            return
        self._begin_ns = int(time_ns[0]) if self._begin_ns is None else self._begin_ns
        self._end_ns = int(time_ns[-1])
        old = 0
        if self._tail is not None:
            old = len(self._tail[0])
            time_ns, values = np.concatenate([self._tail[0], time_ns]), np.concatenate([self._tail[1], values])
        what, still = self.looking.what, None
        if what in (Sought.HIGHEST, Sought.LOWEST):
            found = self._extremes(values)
        elif what is Sought.PEAK and values.dtype.kind not in "SUVb":
            first = int(time_ns[0]) == self._begin_ns
            found, still = _peaks(values, (self._low, self._high), self.looking.direction, first=first)
            old = 0  # what the tail has was not said yet
        else:
            ends = (self._low, self._high) if self.looking.needs_span else None
            found = places(self.looking, time_ns, values, ends)
        if what is Sought.HOLE:
            self._keep(time_ns[found], np.diff(time_ns)[found])
        elif self._finds_ends:  # the newest may be none: the next block tells
            found = found[found < len(values) - 1]
            self._keep(time_ns[found], values[found])
        else:
            found = found[found >= old]  # of the tail it was said before
            self._keep(time_ns[found], values[found])
        self._remember(time_ns, values, still)

    @property
    def _finds_ends(self) -> bool:
        return self.looking.what is Sought.OUTSIDE and self.looking.direction < 0

    def _extremes(self, values: NDArray[Any]) -> Places:
        if values.dtype.kind in "SUV":
            return np.zeros(0, np.intp)
        exact = _exact(values)
        known = exact[~_missing(values)]
        if not len(known):
            return np.zeros(0, np.intp)
        highest = self.looking.what is Sought.HIGHEST
        extreme = (known.max() if highest else known.min()).item()
        if self._extreme is None or (extreme > self._extreme if highest else extreme < self._extreme):
            self._extreme = extreme
            self._forget()
        return run_begins((exact == self._extreme) & ~_missing(values))

    def _remember(self, time_ns: NDArray[np.int64], values: NDArray[Any], still: int | None) -> None:
        """Keep the last sample, of a crossing the last one that is a number: with it the next block is compared.

        While a signal is high `still`, that is the highest.
        """
        last = len(values) - 1 if still is None else still
        if self.looking.what is Sought.CROSSING and values.dtype.kind not in "SUV":
            known = np.flatnonzero(~_missing(values))
            last = int(known[-1]) if len(known) else -1
        if last >= 0:
            self._tail = time_ns[last : last + 1].copy(), values[last : last + 1].copy()

    def _keep(self, time_ns: NDArray[np.int64], values: NDArray[Any]) -> None:
        self._total += len(time_ns)
        cut = int(np.searchsorted(time_ns, self._around_ns, "left"))
        self._early += cut
        if cut:
            self._add(0, time_ns[max(0, cut - self._most) : cut], values[max(0, cut - self._most) : cut])
            while self._counts[0] - len(self._times[0][0]) >= self._most:
                self._counts[0] -= len(self._times[0].pop(0))
                self._values[0].pop(0)
        room = self._most - self._counts[1]
        if room > 0 and cut < len(time_ns):
            self._add(1, time_ns[cut : cut + room], values[cut : cut + room])

    def _add(self, side: int, time_ns: NDArray[np.int64], values: NDArray[Any]) -> None:
        self._times[side].append(time_ns.copy())
        self._values[side].append(values.copy())
        self._counts[side] += len(time_ns)

    @property
    def found(self) -> FoundMoments:
        """What was found in all blocks: as many on both sides, but where one has less."""
        if self._finds_ends and self._tail is not None:  # nothing comes behind the newest
            (time_ns, values), self._tail = self._tail, None
            ends = places(self.looking, time_ns, values)
            self._keep(time_ns[ends], values[ends])
        before, behind = self._counts
        late = min(behind, max(self._most - self._most // 2, self._most - before))
        kept = min(before, self._most - late)
        part = slice(before - kept, before + late)
        times = np.concatenate([*self._times[0], *self._times[1], np.zeros(0, np.int64)])[part]
        parts = [*self._values[0], *self._values[1]]
        values = np.concatenate(parts)[part] if parts else np.zeros(0)
        return FoundMoments(self._total, self._early - kept, times, values, self._begin_ns or 0, self._end_ns)


def _exact(values: NDArray[Any]) -> NDArray[Any]:
    """Return what can be compared from block to block without rounding."""
    if values.dtype.kind in "Mm":
        return values.astype(np.int64)
    return values.real if values.dtype.kind == "c" else values


def _missing(values: NDArray[Any]) -> NDArray[np.bool_]:
    kind = values.dtype.kind
    if kind in "fc":
        missing: NDArray[np.bool_] = np.isnan(values.real)
        return missing
    return np.isnat(values) if kind in "Mm" else np.zeros(len(values), np.bool_)

"""How far a change of parameters had come at a tick: one of a parameter with `rate=` goes there over many ticks.

All that is set together goes the same share of its way (`silo.parameters.landing`), but for what is set again
meanwhile. An event tells where a change begins and where it goes, and not always when it was over; the samples of the
parameters that it changed tell the rest.
"""

import math
import sys
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import LoggedEvent
from silo.core.recording import RecordedElement, Recording, ticks_of
from silo.core.tuning.parameters import ParameterValue

Values = Sequence[tuple[str, ParameterValue | None, ParameterValue]]


ARRIVED = 1 - 1e-6  # of its way


class TunedSamples(NamedTuple):
    """Of a parameter: the ticks at which it was logged, and what it was, shape `(samples, values)`."""

    ticks: NDArray[np.int64]
    values: NDArray[Any]


def samples_of(recording: Recording) -> Callable[[str], TunedSamples | None]:
    """Return what gives the samples of a parameter by its name; None where it is no number, or wasn't logged."""
    elements = {element.name: element for element in recording.elements}
    before = recording.offset - len(recording.time_ns)

    def samples(name: str) -> TunedSamples | None:
        element = elements.get(name)
        return None if element is None else _samples(element, recording.time_ns, before)

    return samples


def _samples(element: RecordedElement, time_ns: NDArray[np.int64], before: int) -> TunedSamples | None:
    own = element.own_ns
    if own is not None and not element.holds:  # of a bag of others, which has no ticks
        return None
    if any(one.dtype.kind not in "iuf" or one.entry.labels for one in element.entries):
        return None
    return TunedSamples(ticks_of(time_ns, element) + before, np.stack([one.values for one in element.entries], axis=-1))


class _Timed:
    """What takes its time by what passes between ticks, ns."""

    _passed: Callable[[int], int]

    def _done(self, begin: int, tick: int) -> int:
        """Nanoseconds: the row of a tick has what came of the one before it."""
        return max(0, self._passed(tick - 1) - self._passed(begin - 1))


class Ramp(_Timed):
    """The way of one change, for what was not set again since."""

    def __init__(
        self,
        event: LoggedEvent,
        later: Sequence[LoggedEvent],
        samples: Callable[[str], TunedSamples | None],
        passed: Callable[[int], int],
    ) -> None:
        """Look at what is known of it. `later` events may set the same again; `passed` is the time until a tick, ns."""
        assert event.change is not None
        self._passed, self._begin, until = passed, event.tick, event.change.until
        self._takes_time, self._whole = until > event.tick, 1.0
        self._end = until if self._takes_time else sys.maxsize  # from which tick on it stands still
        numbers = list(_numbers_told(event, later, samples))
        exact = max(numbers, key=lambda one: (one.is_logged, not one.step, one.until), default=None)
        shares = [] if exact is None else exact.shares
        self._ticks, self._shares = [tick for tick, _ in shares], [share for _, share in shares]
        under_way = next(((tick, share) for tick, share in shares if 0 < share < 1), None)
        self._pace = 0.0
        if under_way is not None:
            self._pace = under_way[1] / max(self._done(self._begin, min(under_way[0], self._end)), 1)
        longest = max(numbers, key=lambda one: (one.until, one is exact), default=None)
        if longest is not None and longest is not exact:
            for tick, share in longest.shares:
                # what is rounded tells nothing where it is what it would be
                if not self._ticks or (tick > self._ticks[-1] and abs(self.share(tick) - share) > longest.step / 2):
                    self._ticks.append(tick)
                    self._shares.append(share)
        self._end = min(self._end, max(_again(name, later)[0] for name, _, _ in values_of(event)))
        behind = bisect_left(self._ticks, self._end)
        if behind < len(self._shares):
            self._whole = self._shares[behind]
        elif self._pace and self._takes_time and (went := self._went(self._end)) < ARRIVED:
            self._whole = went  # it was stopped
        self._ticks, self._shares = self._ticks[:behind], self._shares[:behind]

    def share(self, tick: int) -> float:
        """Return how much of the way was done at a tick, from 0 to 1; 1 where nothing tells that it takes time."""
        return self._went(tick) if tick < self._end else self._whole

    def _went(self, tick: int) -> float:
        place = bisect_right(self._ticks, tick) - 1
        share = self._shares[place] if place >= 0 else 0.0
        following = self._shares[place + 1] if place + 1 < len(self._shares) else self._whole
        pace = self._pace
        if not pace and self._takes_time:
            pace = self._whole / max(self._done(self._begin, self._end), 1)
        elif not pace:
            return share if place >= 0 else 0.0 if self._shares[:1] == [0.0] else 1.0
        if place == len(self._shares) - 1 and self._shares[place - 1 : place] == [share]:
            return share  # it stopped on its way
        return min(share + pace * self._done(self._ticks[place] if place >= 0 else self._begin, tick), following)


def _again(name: str, later: Sequence[LoggedEvent]) -> tuple[int, ParameterValue | None]:
    """At which tick something was set again, and what it was until then; a tick that never comes, and None."""
    found = ((one.tick, then) for one in later for other, then, _ in values_of(one) if other == name)
    return next(found, (sys.maxsize, None))


class _Number(NamedTuple):
    """What a number tells of a change: how far it had come, by tick.

    `step` is the part of the way that is 1 of a whole number; `until` the tick at which it was set again.
    """

    is_logged: bool
    step: float
    until: int
    shares: list[tuple[int, float]]


def _numbers_told(
    event: LoggedEvent, later: Sequence[LoggedEvent], samples: Callable[[str], TunedSamples | None]
) -> Iterator[_Number]:
    fresh = event.tick + (event.change.held if event.change is not None else 0)
    for name, old, new in values_of(event):
        if (way := _way(old, new)) is None:
            continue
        until, then = _again(name, later)
        logged, shares = samples(name), []
        is_logged = logged is not None and way.place < logged.values.shape[1]
        if logged is not None and is_logged:
            part = slice(*np.searchsorted(logged.ticks, [min(fresh, until), until]))
            numbers = logged.values[part, way.place].tolist()
            shares = list(zip(logged.ticks[part].tolist(), map(way.share, numbers), strict=True))
        if then is not None:
            shares.append((until, way.share(_numbers(then)[way.place])))
        yield _Number(is_logged, abs(1 / way.length) if isinstance(way.first, int) else 0.0, until, shares)


class _Way(NamedTuple):
    """Of a value the number that goes furthest: its place, where it begins, how far it goes."""

    place: int
    first: float
    length: float

    def share(self, number: float) -> float:
        return min(max((number - self.first) / self.length, 0.0), 1.0)


def _way(old: ParameterValue | None, new: ParameterValue) -> _Way | None:
    """None where no number goes anywhere."""
    if old is None:
        return None
    before, after = _numbers(old), _numbers(new)
    far = [b - a for a, b in zip(before, after, strict=False)]
    place = max(range(len(far)), key=lambda one: abs(far[one]), default=0)
    return _Way(place, before[place], far[place]) if far and far[place] else None


def _numbers(value: ParameterValue) -> list[float]:
    """The numbers of a value; none of what are words, or true or false."""
    items = value if isinstance(value, tuple) else (value,)
    return [one for one in items if not isinstance(one, str | bool)]


class Arrival(_Timed):
    """What a number was on its way to what an image says of it, which knows where it goes, not how far it had come.

    So are those of a log that begins while it is under way. Its samples tell: two at least, which come nearer.
    """

    def __init__(
        self, aim: ParameterValue, samples: TunedSamples, begin: int, end: int, passed: Callable[[int], int]
    ) -> None:
        """Look at the samples of ticks from `begin` to before `end`. `passed` is the time until a tick, ns."""
        self._passed, self._aim, self._goal = passed, aim, _numbers(aim)
        low, high = np.searchsorted(samples.ticks, [begin, end])
        rows = samples.values[low:high]
        # nearly always it was there already, and no more is looked at
        stands = len(rows) == 0 or rows.shape[1] != len(self._goal) or rows[0].tolist() == self._goal
        left = np.zeros((0, 0)) if stands else _left(rows, self._goal)
        self._count = next(iter(np.flatnonzero(~left.any(axis=1)).tolist()), len(left))
        left = left[: self._count]
        sizes = np.abs(left)
        nearer = ((sizes[1:] <= sizes[:-1]) & (left[1:] * left[:-1] >= 0)).all(axis=1) & (sizes[1:] < sizes[:-1]).any(
            axis=1
        )
        if self._count < 2 or not nearer.all():
            self._count = 0  # it is excited, or may be
        some = slice(low, low + min(self._count + 1, high - low))  # with the one that is there
        self._ticks, self._values = samples.ticks[some].tolist(), samples.values[some].tolist()

    def at(self, tick: int) -> ParameterValue:
        """Return what it was at a tick."""
        place = bisect_right(self._ticks, tick) - 1
        if place >= self._count or not self._count:
            return self._aim
        first = min(max(place, 0), max(self._count - 2, 0))  # the way from this one to the next tells the pace
        pace = [0.0] * len(self._goal)
        if first + 1 < len(self._ticks):
            took = max(self._done(self._ticks[first], self._ticks[first + 1]), 1)
            pace = [(b - a) / took for a, b in zip(self._values[first], self._values[first + 1], strict=True)]
        known = max(place, 0)
        went = self._done(self._ticks[known], tick) if place >= 0 else -self._done(tick, self._ticks[0])
        made = [one + rate * went for one, rate in zip(self._values[known], pace, strict=True)]
        if place >= 0:
            ends = self._values[place + 1] if place + 1 < self._count else self._goal
            made = [
                min(max(one, min(a, b)), max(a, b)) for one, a, b in zip(made, self._values[place], ends, strict=True)
            ]
        whole = isinstance(self._goal[0], int)
        found = tuple(round(one) if whole else one for one in made)
        return found if isinstance(self._aim, tuple) else found[0]


def _left(rows: NDArray[Any], goal: Sequence[float]) -> NDArray[np.float64]:
    """How far each is from its goal, 0 only where it is there to the last digit."""
    there = np.array(goal, rows.dtype)
    made: NDArray[np.float64] = np.where(rows < there, -1.0, 1.0) * np.abs(rows.astype(float) - there.astype(float))
    return np.where((rows != there) & (made == 0), np.finfo(float).tiny, made)


def between(old: ParameterValue, new: ParameterValue, share: float) -> ParameterValue:
    """Return a value a share of the way from old to new; what is no number is as it was until the end."""
    if share >= 1:
        return new
    if isinstance(old, tuple) and isinstance(new, tuple):
        return tuple(between(a, b, share) for a, b in zip(old, new, strict=True))  # type: ignore[misc]
    if isinstance(old, str | bool | tuple) or isinstance(new, str | bool | tuple):
        return old
    made = old + share * (new - old)
    if math.isinf(made):
        made = old * (1 - share) + new * share  # the way is longer than any float
    return round(made) if isinstance(old, int) and isinstance(new, int) else made


def values_of(event: LoggedEvent) -> Values:
    """What a change was of: names, values before and after."""
    return event.change.values if event.change is not None else ()

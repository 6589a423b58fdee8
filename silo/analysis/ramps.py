"""How far a change of parameters had come at a tick: one of a parameter with `rate=` goes there over many ticks.

All that is set together goes the same share of its way (`silo.parameters.landing`). An event tells where a change
begins and where it goes, and not always when it was over; the samples of the parameters that it changed tell the rest.
"""

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import LoggedEvent
from silo.core.recording import RecordedElement, Recording, ticks_of
from silo.core.tuning.parameters import ParameterValue

Values = Sequence[tuple[str, ParameterValue | None, ParameterValue]]


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


class Ramp:
    """The way of one change."""

    def __init__(
        self,
        event: LoggedEvent,
        later: Sequence[LoggedEvent],
        samples: Callable[[str], TunedSamples | None],
        stamp: Callable[[int], int],
    ) -> None:
        """Look at what is known of it. `later` events may set the same again; `stamp` is that of a tick, ns."""
        assert event.change is not None
        self._event, self._stamp = event, stamp
        names = {name for name, _, _ in event.change.values}
        following = next((one for one in later if not names.isdisjoint(name for name, _, _ in values_of(one))), None)
        self._end = None if following is None else following.tick  # with what belongs together it stops there
        points = dict(_shares(event, following, samples))
        self._ticks = sorted(points)
        self._shares = [points[tick] for tick in self._ticks]

    def share(self, tick: int) -> float:
        """Return how much of the way was done at a tick, from 0 to 1; 1 where nothing tells that it takes time."""
        tick = tick if self._end is None else min(tick, self._end)
        begin, until = self._event.tick, self._event.change.until if self._event.change is not None else -1
        under_way = next((place for place, share in enumerate(self._shares) if 0 < share < 1), None)
        place = bisect_right(self._ticks, tick) - 1
        if under_way is None:
            if place >= 0 or not begin < until:
                return self._shares[place] if place >= 0 else 0.0 if self._shares[:1] == [0.0] else 1.0
            return self._done(begin, tick) / max(self._done(begin, until), 1)
        pace = self._shares[under_way] / max(self._done(begin, self._ticks[under_way]), 1)
        share = self._shares[place] if place >= 0 else 0.0
        following = self._shares[place + 1] if place + 1 < len(self._shares) else 1.0
        if place == len(self._shares) - 1 and self._shares[place - 1 : place] == [share]:
            return share  # it stopped on its way
        return min(share + pace * self._done(self._ticks[place] if place >= 0 else begin, tick), following)

    def _done(self, begin: int, tick: int) -> int:
        """Nanoseconds: the row of a tick has what came of the one before it."""
        return max(0, self._stamp(tick - 1) - self._stamp(begin - 1))


def _shares(
    event: LoggedEvent, following: LoggedEvent | None, samples: Callable[[str], TunedSamples | None]
) -> Iterator[tuple[int, float]]:
    """How far it had come, by tick, as the samples of a number tell, and what the next change found."""
    numbers = [(name, way) for name, old, new in values_of(event) if (way := _way(old, new)) is not None]
    # what is rounded tells less
    numbers.sort(key=lambda one: isinstance(one[1].first, int))
    logged, name, way = next(
        ((found, name, way) for name, way in numbers if (found := samples(name)) is not None),
        (None, *(numbers[0] if numbers else ("", None))),
    )
    if way is None:
        return
    if logged is not None and way.place < logged.values.shape[1]:
        low = int(np.searchsorted(logged.ticks, event.tick))
        high = len(logged.ticks) if following is None else int(np.searchsorted(logged.ticks, following.tick))
        shares = np.clip((logged.values[low:high, way.place].astype(float) - way.first) / way.length, 0.0, 1.0)
        yield from zip(logged.ticks[low:high].tolist(), shares.tolist(), strict=True)
    if following is not None:
        then = next((then for other, then, _ in values_of(following) if other == name), None)
        if then is not None:
            yield following.tick, way.share(_numbers(then)[way.place])


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


def between(old: ParameterValue, new: ParameterValue, share: float) -> ParameterValue:
    """Return a value a share of the way from old to new; what is no number is as it was until the end."""
    if share >= 1:
        return new
    if isinstance(old, tuple) and isinstance(new, tuple):
        return tuple(between(a, b, share) for a, b in zip(old, new, strict=True))  # type: ignore[misc]
    if isinstance(old, str | bool | tuple) or isinstance(new, str | bool | tuple):
        return old
    made = old + share * (new - old)
    return round(made) if isinstance(old, int) and isinstance(new, int) else made


def values_of(event: LoggedEvent) -> Values:
    """What a change was of: names, values before and after."""
    return event.change.values if event.change is not None else ()

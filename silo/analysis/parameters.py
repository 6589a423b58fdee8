"""What the parameters of a run were, and who changed them when: read from the events of its log."""

import functools
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute.samples import Samples
from silo.analysis.ramps import Arrival, Ramp, TunedSamples, between, samples_of, values_of
from silo.core.arguments import real
from silo.core.elements import LoggedEvent
from silo.core.parameter_images import Unknown, unknown_of_runs, unknown_texts
from silo.core.recording import Recording
from silo.core.tuning.excitation import ENDED
from silo.core.tuning.parameters import Excitation, ParameterValue
from silo.errors import ElementError


class LoggedExcitation(NamedTuple):
    """An excitation, in seconds since the start, and why it ended; empty where the log ends before."""

    what: Excitation
    start_s: float
    stop_s: float
    ended: str


class ToldExcitation(NamedTuple):
    """An excitation by its ticks, and why it ended: `until` is None where nothing tells of that."""

    what: Excitation
    tick: int
    until: int | None = None
    ended: str = ""


def excitations_told(events: Iterable[LoggedEvent]) -> list[ToldExcitation]:
    """Return what the events of one run tell of excitations, oldest first."""
    found: list[ToldExcitation] = []
    for event in events:
        if event.change is None:
            continue
        if event.change.excitation is not None:
            found.append(ToldExcitation(event.change.excitation, event.tick))
        elif found and found[-1].until is None and event.change.where.startswith(ENDED):
            found[-1] = found[-1]._replace(until=event.tick, ended=event.change.where.removeprefix(ENDED))
    return found


class LoggedParameters:
    """The parameters of a log: `log.parameters.at(12.5)` are their values then, `.changes` all that changed them."""

    def __init__(
        self,
        events: Sequence[LoggedEvent],
        time_ns: NDArray[np.int64],
        offset: int,
        start_ns: int,
        samples: Callable[[str], TunedSamples | None] = lambda name: None,
    ) -> None:
        """Read what events tell. `time_ns` are the stamps of the ticks before `offset`; times count from `start_ns`.

        `samples` are those of a parameter, which tell how far a ramp had come.
        """
        told = [event for event in events if event.change is not None]
        self._events = sorted(told, key=lambda event: (event.tick, event.time_ns, event.number))
        self._time_ns, self._offset, self._start_ns, self._samples = time_ns, offset, start_ns, samples
        self._ramps: dict[int, Ramp] = {}
        self._arrivals: dict[tuple[str, int], Arrival | None] = {}

    @property
    def changes(self) -> list[LoggedEvent]:
        """All changes, oldest first: when, by whom, from the tick on from which the new values held."""
        return [event for event in self._events if any(old is not None for _, old, _ in values_of(event))]

    @property
    def excitations(self) -> list[LoggedExcitation]:
        """What was excited, oldest first, from when to when: `.what` has all of its numbers."""
        stop_s = (int(self._time_ns[-1]) - self._start_ns) * 1e-9 if len(self._time_ns) else 0.0
        return [
            LoggedExcitation(
                one.what, self._seconds(one.tick), stop_s if one.until is None else self._seconds(one.until), one.ended
            )
            for one in excitations_told(self._events)
        ]

    def _seconds(self, tick: int) -> float:
        return (self._stamp(tick) - self._start_ns) * 1e-9 if len(self._time_ns) else 0.0

    @property
    def names(self) -> list[str]:
        """The names of all that are told of."""
        return list(dict.fromkeys(name for event in self._events for name, _, _ in values_of(event)))

    def at(self, time_s: float) -> dict[str, ParameterValue]:
        """Return what each parameter was at a time; of one that is excited, around what it goes.

        One with a rate is on its way then, and all that was set with it, as far as its samples tell (10 a second);
        where it wasn't logged, it is where it went to.

        Args:
            time_s: seconds since the start of the log; before its first tick and after its last one, these.

        Raises:
            ElementError: it is no number, or the log tells of no parameters, or not of what they were then: a run keeps
                the newest changes.
        """
        time_s = real("time_s", time_s, -1e12, 1e12, "s")
        if not self._events:
            raise ElementError("this log tells of no parameters: log.parameter(...) declares them")
        stamp = np.asarray(self._start_ns + round(time_s * 1e9))
        since = int(Samples("ticks", self._time_ns, self._time_ns)._places(stamp))
        tick = self._offset - len(self._time_ns) + max(0, since)
        for one in self.unknown:
            if one.first <= tick < one.end:
                raise ElementError(f"what the parameters were at {time_s:g} s is not known: {one.text(self._seconds)}")
        return self._at_tick(tick)

    @property
    def last(self) -> dict[str, ParameterValue]:
        """What each is behind the last tick; empty where the log tells of none."""
        return self._at_tick(max([self._offset, *(event.tick for event in self._events)]))

    def _at_tick(self, tick: int) -> dict[str, ParameterValue]:
        known = max((one.end for one in self.unknown if not one.whole and one.end <= tick), default=-1)
        found: dict[str, ParameterValue] = {}
        ways: dict[str, tuple[int, ParameterValue]] = {}  # of what was changed last: by which event, from where
        images: dict[str, int] = {}  # of what an image told last: by which event
        for number, event in enumerate(self._events):
            for name, old, new in values_of(event):
                if event.tick < known:
                    continue
                if event.tick <= tick:
                    found[name] = new
                    ways.pop(name, None)
                    images.pop(name, None)
                    if old is not None:
                        ways[name] = number, old
                    else:
                        images[name] = number
                elif old is not None:  # of what was changed before, nothing is told any more
                    found.setdefault(name, old)
        for name, (number, old) in ways.items():
            found[name] = between(old, found[name], self._ramp(number).share(tick))
        for name, number in images.items():
            if (arrival := self._arrival(name, number)) is not None:
                found[name] = arrival.at(tick)
        return found

    @functools.cached_property
    def unknown(self) -> list[Unknown]:
        """Of which ticks it is not known what they were."""
        return unknown_of_runs(self._events)

    @property
    def warnings(self) -> tuple[str, ...]:
        """The same in words."""
        return unknown_texts(self._events, self._offset - len(self._time_ns), self._seconds)

    def _ramp(self, number: int) -> Ramp:
        if number not in self._ramps:
            later = self._events[number + 1 :]
            self._ramps[number] = Ramp(self._events[number], later, self._samples, self._passed)
        return self._ramps[number]

    def _arrival(self, name: str, number: int) -> Arrival | None:
        if (name, number) not in self._arrivals:
            event, later = self._events[number], self._events[number + 1 :]
            aim = next(new for other, _, new in values_of(event) if other == name)
            again = (one.tick for one in later if any(other == name for other, _, _ in values_of(one)))
            logged, end = self._samples(name), next(again, sys.maxsize)
            begin = event.tick + (event.change.held if event.change is not None else 0)
            self._arrivals[name, number] = logged and Arrival(aim, logged, begin, end, self._passed)
        return self._arrivals[name, number]

    @functools.cached_property
    def _ahead(self) -> NDArray[np.int64]:
        return np.concatenate([[0], np.cumsum(np.maximum(np.diff(self._time_ns), 0))])

    def _passed(self, tick: int) -> int:
        """What passed until a tick, ns: its stamp, but for how far clocks were set back before, which no ramp goes."""
        place = min(max(tick - self._offset + len(self._time_ns), 0), max(len(self._time_ns) - 1, 0))
        behind = int(self._ahead[place]) - int(self._time_ns[place] - self._time_ns[0]) if len(self._time_ns) else 0
        return self._stamp(tick) + behind

    def _stamp(self, tick: int) -> int:
        """The stamp of a tick; of one before the first, that which it had at the pace of the first two."""
        times, place = self._time_ns, tick - self._offset + len(self._time_ns)
        if place >= 0 or len(times) < 2:
            return int(times[min(max(place, 0), len(times) - 1)]) if len(times) else 0
        return int(times[0]) + place * int(times[1] - times[0])

    def __repr__(self) -> str:
        return f"<LoggedParameters: {len(self.names)}, {len(self.changes)} changes>"


def parameters_of(recording: Recording, start_ns: int) -> LoggedParameters:
    """Return the parameters of a recording; times count from `start_ns`."""
    samples = samples_of(recording)
    return LoggedParameters(recording.events, recording.time_ns, recording.offset, start_ns, samples)

"""Where the samples of an element stand among the time stamps of its recording."""

from collections.abc import Callable
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from silo.analysis.stretches import held_until
from silo.core.recording import Recording

Stamps = NDArray[np.int64]


class Places:
    """Which time stamp each sample belongs to, as the number of it: sample i to `first + i * step`.

    Of a bag of others, and of what was changed while it was logged, they are listed instead.
    """

    def __init__(self, time_ns: Stamps, first: int, step: int, count: int, tick_ns: int) -> None:
        """`time_ns` are all time stamps, which never fall, mostly `tick_ns` apart."""
        self._time_ns, self.first, self.step, self.count, self._tick_ns = time_ns, first, step, count, tick_ns
        self._listed: Stamps | None = None
        self._ask_until: Callable[[], Stamps | None] = lambda: None

    @classmethod
    def listed(cls, time_ns: Stamps, own_ns: Stamps, tick_ns: int) -> "Places":
        """Return those of samples with stamps of their own, which are among all."""
        made = cls(time_ns, 0, 1, len(own_ns), tick_ns)
        made._listed = np.searchsorted(time_ns, np.maximum.accumulate(own_ns), "left").astype(np.int64)
        return made

    @property
    def is_listed(self) -> bool:
        """Whether no distance says where they stand."""
        return self._listed is not None

    def at(self, sample: int) -> int:
        """Return the number of the stamp of a sample."""
        return int(self._listed[sample]) if self._listed is not None else self.first + sample * self.step

    def from_stamp(self, numbers: Stamps) -> Stamps:
        """Return the first sample at or after each of these stamps, the number of all where there is none."""
        if self._listed is not None:
            return np.searchsorted(self._listed, numbers, "left").astype(np.int64)
        return np.clip(-((self.first - numbers) // self.step), 0, self.count)

    def held_at(self, at_ns: int) -> int:
        """Return the newest sample up to a moment; -1 where none had come yet, or it holds no longer, and others come.

        The last one is told to the end.
        """
        number = int(np.searchsorted(self._time_ns, at_ns, "right"))
        sample = int(self.from_stamp(np.array([number]))[0]) - 1
        if self._until is None or sample < 0 or sample == self.count - 1:
            return sample
        return sample if at_ns < self._until[sample] else -1

    def stamps(self, begin: int, end: int) -> Stamps:
        """Return the time stamps of samples `begin ... end - 1`."""
        if self._listed is not None:
            return self._time_ns[self._listed[begin:end]]
        first = self.first + begin * self.step
        return self._time_ns[first : first + (end - begin) * self.step : self.step]

    def held_until_ns(self, samples: Stamps) -> Stamps:
        """Return until when samples hold: to the next one, the last one as long as one more would have taken.

        Of a run that was cut, or of which a part is missing, each until the next would be due.
        """
        until: Stamps
        if self._until is not None:
            until = np.minimum(self._until[samples], self._time_ns[-1])
            return until
        if self._listed is not None and self.count:
            end_ns = min(int(self._time_ns[self._listed[-1]]) + self.period_ns, int(self._time_ns[-1]))
            return np.full(len(samples), end_ns, np.int64)
        last = min(self.first + self.count * self.step, len(self._time_ns)) - 1
        return np.full(len(samples), self._time_ns[max(last, 0)], np.int64)

    @cached_property
    def _until(self) -> Stamps | None:
        return self._ask_until()

    @cached_property
    def period_ns(self) -> int:
        """The time between two samples, as it mostly was."""
        if self._listed is None:
            return self._tick_ns * self.step
        steps = np.diff(self.stamps(0, self.count))
        return int(np.median(steps[steps > 0])) if (steps > 0).any() else self._tick_ns


def places_of(recording: Recording, time_ns: Stamps, tick_ns: int) -> list[Places]:
    """Return where the samples of elements stand, by one object for all that stand alike."""
    known: dict[tuple[int, int, int, int], Places] = {}
    found = []
    for element in recording.elements:
        own, step = element.own_ns, max(1, element.divider)
        key = (element.first, step, element.count, id(own))
        if key not in known:
            known[key] = made = (
                Places(time_ns, element.first, step, element.count, tick_ns)
                if own is None
                else Places.listed(time_ns, own, tick_ns)
            )
            made._ask_until = partial(held_until, recording, element)
        found.append(known[key])
    return found

"""Where the samples of an element stand among the time stamps of its recording."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from silo.analysis.stretches import held_until, holes
from silo.core.recording import RecordedElement, Recording

Stamps = NDArray[np.int64]


class Places:
    """Which time stamp each sample belongs to, as the number of it: sample i to `first + i * step`.

    Of a bag of others, and of what was changed while it was logged, they are listed instead.
    """

    def __init__(self, recording: Recording, element: RecordedElement, time_ns: Stamps, tick_ns: int) -> None:
        """`time_ns` are all time stamps, which never fall, mostly `tick_ns` apart."""
        self._recording, self._element, self._time_ns, self._tick_ns = recording, element, time_ns, tick_ns
        self.first, self.step, self.count = element.first, max(1, element.divider), element.count
        self._listed: Stamps | None = None
        if element.own_ns is not None:
            self.first, self.step = 0, 1
            self._listed = np.searchsorted(time_ns, np.maximum.accumulate(element.own_ns), "left").astype(np.int64)

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

    @property
    def holes(self) -> tuple[tuple[int, int], ...]:
        """From which stamps on, and before which, it holds no value between two samples."""
        return holes(self._recording, self._element)

    @cached_property
    def _until(self) -> Stamps | None:
        return held_until(self._recording, self._element)

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
    keys = [(one.first, one.divider, one.count, id(one.own_ns)) for one in recording.elements]
    for key, element in zip(keys, recording.elements, strict=True):
        if key not in known:
            known[key] = Places(recording, element, time_ns, tick_ns)
    return [known[key] for key in keys]

"""Samples of several elements that make one message: those of a tick wait until all of them are there.

Elements in different rings come at different times: a batch has each up to where its ring was read.
"""

from collections.abc import Mapping, Sequence
from functools import reduce

import numpy as np

from silo.history.arrays import NO_SAMPLES, SampleArrays, after, joined, taken

MOST_WAITING = 10_000  # samples of an element


class Pairing:
    """What waits for its partners. `unpaired` counts ticks that were left out, as not all had them, since the first one
    that all had: streams of several rings don't begin at the same tick.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self.unpaired = 0
        self.forget()

    def forget(self) -> None:
        """Begin anew: what waits belongs to nothing that comes."""
        self._first: int | None = None  # tick that had all
        self._waiting = dict.fromkeys(self.names, NO_SAMPLES)

    def take(self, batch: Mapping[str, SampleArrays]) -> list[SampleArrays]:
        """Take samples in, and return those of the ticks that all have by now, in the order of the names."""
        for name in self.names:
            if name in batch and len(batch[name]):
                self._add(name, batch[name])
        waiting = [self._waiting[name] for name in self.names]
        ticks = reduce(np.intersect1d, [one.ticks for one in waiting])
        paired = [taken(one, np.searchsorted(one.ticks, ticks)) for one in waiting]
        # an element tells its ticks in order: what is older than the newest of each has its partners by now, or never
        done = min(int(one.ticks[-1]) if len(one) else -1 for one in waiting)
        self._waiting = {name: after(one, done) for name, one in zip(self.names, waiting, strict=True)}
        if self._first is None and len(ticks):
            self._first = int(ticks[0])
        if self._first is not None:
            since = [after(one, self._first - 1) for one in waiting]
            self.unpaired += max(len(one) - len(after(one, done)) for one in since) - len(ticks)
        return paired

    def _add(self, name: str, fresh: SampleArrays) -> None:
        known = self._waiting[name]
        if len(known) and fresh.ticks[0] <= known.ticks[-1]:
            self.forget()  # another run
            known = NO_SAMPLES
        added = joined([known, fresh]) if len(known) else fresh
        over = max(0, len(added) - MOST_WAITING)
        self.unpaired += over
        self._waiting[name] = taken(added, slice(over, None))

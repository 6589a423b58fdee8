"""What filters, orders and columns ask of a file's elements: the quantities of a logger's survey, from all samples.

`value`, `changed` and `signs` are those of a moment, the others of the whole run. Whole signals are read for it, so
screens call this in a thread, for a few elements at a time, and what needs no moment is reckoned once.
"""

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.columns import Floats
from silo.core.arrays.running import STATISTICS, RunningStatistics
from silo.core.arrays.values import with_nan
from silo.core.recording import RecordedElement, Recording, rate_of, steps_of
from silo.live.quantities import FROZEN_PERIODS, FROZEN_S, signs_of
from silo_tui.model.samples.places import Places

BLOCK = 1 << 16  # samples that are looked at together
UNKNOWN = ("fill", "held")  # how large a buffer was is not in a file


class FileFacts:
    """Quantities of the elements of a recording, and of their entries, by name. NaN: not known, or no number."""

    def __init__(self, recording: Recording, names: Sequence[str], places: Sequence[Places]) -> None:
        """`places` say where the samples of each element stand."""
        self._elements, self._stand = recording.elements, places
        self._nominal_hz = recording.frequency_hz
        self._places = {name: (place, -1) for place, name in enumerate(names)}
        for place, (name, element) in enumerate(zip(names, recording.elements, strict=True)):
            if len(element.entries) > 1:
                for position, entry in enumerate(element.entries):
                    self._places.setdefault(name + entry.entry.suffix, (place, position))
        self._statistics: dict[tuple[int, int], dict[str, float]] = {}
        self._timing: dict[Places, tuple[float, float]] = {}

    def __len__(self) -> int:
        return len(self._elements)

    def survey(
        self, quantities: Sequence[str], at_ns: int, out: Mapping[str, Floats], begin: int, seconds: float
    ) -> int:
        """Fill columns of `out` from element `begin` on, for some seconds; return the element to go on with."""
        until_s = time.monotonic() + seconds
        for place in range(begin, len(self)):
            for quantity in quantities:
                out[quantity][place] = self._of(place, -1, quantity, at_ns)
            if time.monotonic() >= until_s:
                return place + 1
        return len(self)

    def of(self, name: str, quantities: Sequence[str], at_ns: int) -> dict[str, float]:
        """Return quantities of one element or entry."""
        place, position = self._places[name]
        return {quantity: self._of(place, position, quantity, at_ns) for quantity in quantities}

    # --------------------------------------------------------------------------------------------- one quantity

    def _of(self, place: int, position: int, quantity: str, at_ns: int) -> float:
        if quantity in UNKNOWN:
            return math.nan
        if quantity in {"least", "most"}:
            positions = range(len(self._elements[place].entries)) if position < 0 else (position,)
            name, pick = ("min", np.fmin) if quantity == "least" else ("max", np.fmax)
            return float(pick.reduce([self._statistics_of(place, each)[name] for each in positions], initial=math.nan))
        if quantity in STATISTICS:
            return self._statistics_of(place, position)[quantity]
        if quantity in ("rate", "share", "jitter"):
            rate, jitter = self._timing_of(place)
            if quantity == "jitter":
                return jitter
            return rate if quantity == "rate" else rate * self._nominal_s(place)
        at = self._stand[place].held_at(at_ns)
        if quantity == "changed":
            return self._changed_s(place, position, at, at_ns)
        if quantity == "change_seen":
            return math.nan if at < 0 else float(self._changed_at(place, position, at) > 0)
        if quantity == "signs":
            return self._signs(place, at)
        entries = _entries(self._elements[place], position)
        return float(_values(entries, at, at + 1)[0]) if entries and at >= 0 else math.nan

    def _nominal_s(self, place: int) -> float:
        """The time between two samples, as the logger meant it; NaN where it didn't say, or changed its mind."""
        return self._stand[place].step / (math.nan if self._stand[place].is_listed else self._nominal_hz or math.nan)

    def _statistics_of(self, place: int, position: int) -> dict[str, float]:
        key = (place, position)
        if key not in self._statistics:
            self._statistics[key] = _statistics_of(_entries(self._elements[place], position))
        return self._statistics[key]

    def _timing_of(self, place: int) -> tuple[float, float]:
        """Return rate in Hz and jitter in s, of all that have the same ticks once; holes count not."""
        stand = self._stand[place]
        if stand not in self._timing:
            stamps, gaps = stand.stamps(0, stand.count), stand.holes
            steps = steps_of(stamps, gaps)
            jitter = float(np.std(steps / 1e9)) if len(steps) > 1 else math.nan
            self._timing[stand] = rate_of(stamps, gaps) or math.nan, jitter
        return self._timing[stand]

    def _time(self, place: int, sample: int) -> int:
        return int(self._stand[place].stamps(sample, sample + 1)[0])

    def _changed_s(self, place: int, position: int, at: int, at_ns: int, most: int = 1 << 62) -> float:
        """Return for how long a value had held; `most`: so many samples back it is looked for."""
        if at < 0:
            return math.nan
        return max(0, at_ns - self._time(place, self._changed_at(place, position, at, most))) / 1e9

    def _changed_at(self, place: int, position: int, at: int, most: int = 1 << 62) -> int:
        """Return the sample with which a value came; 0 also where it was there from the first on."""
        element = self._elements[place]
        entries = element.entries if position < 0 else element.entries[position : position + 1]
        changed = 0
        for entry in entries:
            changed = max(changed, _last_change(entry.values, at, max(changed, at - most)))
        return changed

    def _signs(self, place: int, at: int) -> float:
        """Return what was the matter at a moment: whether it came at its rate and was lost is told of the whole run."""
        element = self._elements[place]
        entries = _entries(element, -1)
        finite = at < 0 or not entries or bool(np.isfinite(_values(entries, at, at + 1)[0]))
        rate, _ = self._timing_of(place)
        period_s = self._nominal_s(place)
        share = rate * period_s
        if math.isnan(period_s):
            period_s = 1 / rate
        numbers = all(entry.values.dtype.kind in "iuf" and not entry.entry.labels for entry in element.entries)
        changed_s = pace_s = math.nan
        if numbers and at >= 0 and not math.isnan(period_s):
            samples = math.ceil(max(FROZEN_PERIODS, FROZEN_S / period_s)) + 2
            changed_s = self._changed_s(place, -1, at, self._time(place, at), samples)
            if changed_s > max(FROZEN_PERIODS * period_s, FROZEN_S):
                pace_s = period_s * min(_samples_a_change(entry.values, at) for entry in element.entries)
                changed_s = self._changed_s(place, -1, at, self._time(place, at))
        bits = signs_of(
            np.array([finite]), np.array([changed_s]), np.array([pace_s]), np.array([numbers]), np.array([share]),
            np.array([element.lost]),
        )  # fmt: skip
        return float(bits[0])


def _entries(element: RecordedElement, position: int) -> Sequence[NDArray[Any]]:
    """Return the samples of an entry, or of all of them for their norm; none where they are no numbers."""
    found = [one.values for one in (element.entries if position < 0 else element.entries[position : position + 1])]
    return found if all(values.dtype.kind in "biuf" for values in found) else ()


def _values(entries: Sequence[NDArray[Any]], begin: int, stop: int) -> Floats:
    """Return some samples of an entry, or the norm of several, shape `(n,)`."""
    some = [with_nan(values[begin:stop]).astype(float) for values in entries]
    if len(some) == 1:
        return some[0]
    with np.errstate(over="ignore", invalid="ignore"):
        return cast(Floats, np.sqrt(np.sum(np.square(some), axis=0)))


def _statistics_of(entries: Sequence[NDArray[Any]]) -> dict[str, float]:
    """Return statistics of all samples but NaN."""
    running = RunningStatistics(1)
    for begin in range(0, len(entries[0]) if entries else 0, BLOCK):
        running.add(slice(0, 1), _values(entries, begin, begin + BLOCK)[:, None], all_finite=False)
    return {name: float(running.of(name)[0]) for name in STATISTICS}


def _samples_a_change(values: NDArray[Any], at: int) -> float:
    """Return after how many samples a value changed, in the mean up to its last change; inf where it never did."""
    last = _last_change(values, at, 0)
    begin = max(0, last - BLOCK)
    changes = int((values[begin + 1 : last + 1] != values[begin:last]).sum())
    return (last - begin) / changes if changes else math.inf


def _last_change(values: NDArray[Any], at: int, begin: int) -> int:
    """Return the newest sample, up to `at`, that differs from the one before it; `begin` where all are alike."""
    stop = at + 1
    while stop - begin > 1:
        start = max(begin, stop - BLOCK)
        block = values[start:stop]
        differs = np.flatnonzero(block[1:] != block[:-1])
        if len(differs):
            return start + int(differs[-1]) + 1
        stop = start + 1
    return begin

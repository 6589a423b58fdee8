"""A recording as a source of plots: minimum, maximum and mean per column, and the values that held at a time.

Nothing is read before it is on the screen. What was read is kept per zoom level in tiles of 64 columns, so that
panning reads only what is new; the tick where each column begins is found once for all signals.
"""

import asyncio
import math
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.columns import MAX_COLUMNS, Bins, ColumnGrid, Floats, Gap, HistoryColumns, Marks, grid_of
from silo.core.arrays.values import newest_values, numbers
from silo.core.elements import Action, ElementInfo, ElementOptions, LoggedEvent
from silo.core.recording import RecordedElement, Recording
from silo.expressions.search import FoundMoments, Looking
from silo.expressions.span import Between, between
from silo_tui.model.drawing.plots import signs_of
from silo_tui.model.drawing.window import SECOND_NS, SPANS_S
from silo_tui.model.samples.live import Reading
from silo_tui.model.samples.places import Places, Stamps, places_of
from silo_tui.model.samples.searching import found_in
from silo_tui.model.samples.source import Samples

TILE = 64
MAX_TILES = 4096  # 8 MB
SHORT_SPANS_S = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
LONG_SPANS_S = (7200.0, 18000.0, 36000.0, 86400.0, 259200.0)
WHOLE = 1.02  # a little more than all, because columns begin at round times


@dataclass(frozen=True)
class StretchFacts:
    """What a stretch of an entry holds, as offsets from `base`: NaN where there is no finite number."""

    smallest: float
    largest: float
    mean: float
    samples: int  # that are numbers, inf too
    finite: int = 0
    base: int = 0
    signs: str = ""


@dataclass(frozen=True)
class _Signal:
    """The samples of an entry, where they stand, and why it ends before the recording does, or has none within."""

    values: NDArray[Any]
    places: Places
    ended: Gap
    absent: tuple[tuple[int, int, Gap], ...]


@dataclass(frozen=True)
class _Tile:
    """64 columns of an entry; `total` and `finite` are of the finite samples, `count` of all that are no NaN."""

    low: Floats
    high: Floats
    marks: Marks
    base: int
    total: Floats
    finite: Stamps
    count: Stamps


class RecordingSource:
    """A recording behind the monitor; `names` are those of its elements, each once. Safe for several threads."""

    live = False

    def __init__(self, recording: Recording, names: Sequence[str]) -> None:
        self.recording = recording
        self.elements = [_info(name, element) for name, element in zip(names, recording.elements, strict=True)]
        # where a clock was set back, the samples stand at the latest time before: none is hidden
        times = recording.time_ns
        self.clock_jumps = int((np.diff(times) < 0).sum())
        # shape `(n,)`, of all ticks; they never fall, and are not to be written to
        self.time_ns: Stamps = np.maximum.accumulate(times) if self.clock_jumps else np.ascontiguousarray(times)
        self._begin = recording.early
        self._numbers = {name: number for number, name in enumerate(names)}
        self._tick_ns = _period(self.time_ns, recording.frequency_hz)
        self.places = places_of(recording, self.time_ns, self._tick_ns)
        self._signals: dict[str, tuple[int, int]] = {}  # which entry of which element
        for number, info in enumerate(self.elements):
            for position, entry in enumerate(info.entries):
                self._signals.setdefault(info.name + entry.suffix, (number, position))
        self._tile, self._ticks = lru_cache(MAX_TILES)(self._read_tile), lru_cache(MAX_TILES)(self._find_ticks)
        self._lock = threading.Lock()

    # ------------------------------------------------------------------------------------------------ what is

    @property
    def begin_ns(self) -> int:
        """The first time stamp, from which the seconds of a file count everywhere."""
        return int(self.time_ns[0])

    @property
    def end_ns(self) -> int:
        """The last time stamp."""
        return int(self.time_ns[-1])

    @property
    def happened(self) -> Sequence[LoggedEvent]:
        """What happened, as the file has it."""
        return self.recording.events

    @property
    def spans_s(self) -> tuple[float, ...]:
        """The spans that one zooms through; the last one is the whole recording."""
        whole = (self.end_ns - self.begin_ns) / SECOND_NS * WHOLE or 1.0
        return (*(span for span in SHORT_SPANS_S + SPANS_S + LONG_SPANS_S if span < 0.7 * whole), whole)

    def element(self, name: str) -> ElementInfo | None:
        """The element of that name."""
        number = self._numbers.get(name)
        return self.elements[number] if number is not None else None

    def period_ns(self, element: str) -> int:
        """Time between two samples of an element, as it mostly was."""
        number = self._numbers.get(element)
        return self.places[number].period_ns if number is not None else self._tick_ns

    def is_live(self, element: str) -> bool:
        """Whether there is data to plot: of all that is in a file."""
        return element in self._numbers

    def extent_ns(self, names: Sequence[str]) -> tuple[int, int]:
        """The first and the last moment that any of these elements has a sample of; of all where none has."""
        found = [self.places[self._numbers[name]] for name in names if name in self._numbers]
        found = [places for places in found if places.count]
        if not found:
            return self.begin_ns, self.end_ns
        first = max(self._begin, min(places.at(0) for places in found))
        last = max(places.at(places.count - 1) for places in found)
        return int(self.time_ns[first]), int(self.time_ns[max(first, last)])

    # ------------------------------------------------------------------------------------------------ columns

    async def history(self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int) -> HistoryColumns:
        """Columns of a stretch of time, read in a thread."""
        return await asyncio.to_thread(self.columns, names, start_ns, end_ns, column_ns)

    def columns(self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int) -> HistoryColumns:
        """Columns from the one of `start_ns` to the one of `end_ns`, at most the newest 4097.

        Where a signal has fewer samples than there are columns, a column without one shows the value that held.
        """
        stop = end_ns // column_ns + 1
        first = max(start_ns // column_ns, stop - MAX_COLUMNS - 1)
        grid = ColumnGrid(len(names), first, stop - first)
        with self._lock:
            for row, name in enumerate(names):
                signal = self._signal(name)
                if signal is None:
                    continue
                numbers = range(first // TILE, (stop - 1) // TILE + 1)
                for number, tile in zip(numbers, self._covering(name, first, stop, column_ns), strict=True):
                    some = grid_of(number * TILE, tile.low[None], tile.high[None], tile.marks[None], {0: tile.base})
                    grid.lay([row], some, [0])
                if column_ns < signal.places.period_ns:
                    self._hold(signal, column_ns, grid, row)
                self._say_why_empty(signal, column_ns, grid, row)
        return grid.columns(names, column_ns)

    def facts(self, name: str, first: int, stop: int, column_ns: int) -> StretchFacts:
        """Minimum, maximum and mean of the samples in columns `first ... stop - 1`."""
        with self._lock:
            tiles = self._covering(name, first, stop, column_ns) if name in self._signals else []
        if not tiles:
            return StretchFacts(math.nan, math.nan, math.nan, 0)
        inside = slice(first % TILE, first % TILE + stop - first)
        base = max((tile.base for tile in tiles if tile.finite.any()), key=abs, default=0)
        shifts = [float(tile.base - base) for tile in tiles]
        low = np.concatenate([tile.low + shift for tile, shift in zip(tiles, shifts, strict=True)])[inside]
        high = np.concatenate([tile.high + shift for tile, shift in zip(tiles, shifts, strict=True)])[inside]
        total = np.concatenate([t.total + s * t.finite for t, s in zip(tiles, shifts, strict=True)])[inside]
        marks = np.concatenate([tile.marks for tile in tiles])[inside]
        samples = int(np.concatenate([tile.count for tile in tiles])[inside].sum())
        finite = int(np.concatenate([tile.finite for tile in tiles])[inside].sum())
        if not finite:
            return StretchFacts(math.nan, math.nan, math.nan, samples, signs=signs_of(marks))
        with np.errstate(invalid="ignore", over="ignore"):
            mean = float(total.sum()) / finite
        return StretchFacts(float(np.nanmin(low)), float(np.nanmax(high)), mean, samples, finite, base, signs_of(marks))

    def _covering(self, name: str, first: int, stop: int, column_ns: int) -> list[_Tile]:
        return [self._tile(name, column_ns, number) for number in range(first // TILE, (stop - 1) // TILE + 1)]

    def _signal(self, name: str) -> _Signal | None:
        """Its values are read now: those of a bag are not before somebody looks at them."""
        if name not in self._signals:
            return None
        number, position = self._signals[name]
        element = self.recording.elements[number]
        ended = Gap.LOST if element.lost else Gap.FULL
        return _Signal(element.entries[position].values, self.places[number], ended, element.absent)

    def _read_tile(self, name: str, column_ns: int, number: int) -> _Tile:
        signal = self._signal(name)
        assert signal is not None, "who asks for a tile knows that there is one"
        return _reduce(signal.values, signal.places.from_stamp(self._ticks(column_ns, number)))

    def _find_ticks(self, column_ns: int, number: int) -> Stamps:
        """Shape `(65,)`: the first tick of each column of a tile, and of the one after."""
        return self._first_ticks(number * TILE, TILE + 1, column_ns)

    def _first_ticks(self, first: int, count: int, column_ns: int) -> Stamps:
        # by Python's integers, because the last column may begin after the end of int64
        limit = 2**63 - 1
        starts = np.array([min(column * column_ns, limit) for column in range(first, first + count)], np.int64)
        return np.searchsorted(self.time_ns, starts, "left").astype(np.int64)

    def _hold(self, signal: _Signal, column_ns: int, grid: ColumnGrid, row: int) -> None:
        """Fill columns without sample after the first one, as long as the last one holds: until the next would be due.

        What ends before the recording (a full buffer), or has a hole, doesn't go on.
        """
        edges = signal.places.from_stamp(self._first_ticks(grid.first, grid.count + 1, column_ns))
        empty = np.flatnonzero((edges[1:] == edges[:-1]) & (edges[:-1] > 0))
        until_ns = signal.places.held_until_ns(edges[empty] - 1)
        empty = empty[grid.first + empty <= until_ns // column_ns]
        if len(empty):
            held = Bins(grid.first + empty.astype(np.int64), np.arange(len(empty)))
            grid.add(row, held, signal.values[edges[empty] - 1])

    def _say_why_empty(self, signal: _Signal, column_ns: int, grid: ColumnGrid, row: int) -> None:
        begin, end, places = self.begin_ns // column_ns, self.end_ns // column_ns, signal.places
        for since_ns, until_ns, why in signal.absent:
            grid.add_hole(row, since_ns // column_ns, until_ns // column_ns + 1, why)
        if signal.absent or (places.is_listed and self.recording.stretch is not None):
            return  # of a run that was cut all is told, or nothing known
        if not places.count:
            grid.add_hole(row, begin, end + 1, signal.ended)
            return
        if places.at(0) - self._begin >= places.step:
            before = Gap.OFF if places.is_listed else Gap.OVERWRITTEN
            grid.add_hole(row, begin, int(self.time_ns[places.at(0)]) // column_ns, before)
        until_ns = int(places.held_until_ns(np.array([places.count - 1]))[0])
        if until_ns < self.end_ns:
            after = Gap.OFF if places.is_listed else signal.ended
            grid.add_hole(row, until_ns // column_ns + 1, end + 1, after)

    # ----------------------------------------------------------------------------------------- values at a time

    def readings(self, names: Sequence[str], time_ns: int) -> dict[str, Reading]:
        """What held at a time: the newest sample up to then; nothing before the first one."""
        return {name: self._reading(self._numbers[name], time_ns) for name in names if name in self._numbers}

    def _reading(self, number: int, time_ns: int) -> Reading:
        element, at = self.recording.elements[number], self.places[number].held_at(time_ns)
        newest = np.full(len(element.entries), np.nan)
        texts: dict[int, str] = {}
        if at < 0:
            return Reading(newest, texts, 0, element.lost, time_ns, failed=element.failures.count)
        for position, entry in enumerate(element.entries):
            floats, words = newest_values(entry.values[at : at + 1])
            newest[position] = floats[0]
            if words:
                texts[position] = words[0]
        return Reading(newest, texts, element.count, element.lost, time_ns, failed=element.failures.count)

    async def samples(self, name: str, start_ns: int, end_ns: int) -> Samples:
        """All samples of an entry from `start_ns` to `end_ns`, both included; views, don't change them."""
        signal = self._signal(name)
        if signal is None:
            return np.zeros(0, np.int64), np.zeros(0)
        ticks = np.array(
            [np.searchsorted(self.time_ns, start_ns, "left"), np.searchsorted(self.time_ns, end_ns, "right")], np.int64
        )
        begin, end = signal.places.from_stamp(ticks).tolist()
        return signal.places.stamps(begin, end), signal.values[begin:end]

    async def find(
        self, looking: Mapping[str, Looking], around_ns: int, most: int
    ) -> tuple[dict[str, FoundMoments], str]:
        """Look for moments in all samples of entries; nothing of a file is out of reach."""
        found = {}
        for name, wanted in looking.items():
            samples = await self.samples(name, int(self.time_ns[0]), self.end_ns)
            found[name] = await asyncio.to_thread(found_in, wanted, samples, around_ns, most)
        return found, ""

    async def measure(self, names: Sequence[str], a_ns: int, b_ns: int) -> tuple[dict[str, Between], str]:
        """Measure entries between two moments."""
        found = {}
        for name in names:
            time_ns, values = await self.samples(name, int(self.time_ns[0]), max(a_ns, b_ns))
            found[name] = await asyncio.to_thread(between, time_ns, values, a_ns, b_ns)
        return found, ""


def _info(name: str, element: RecordedElement) -> ElementInfo:
    options = ElementOptions(
        divider=max(1, element.divider),
        action=Action.SAVE_AND_PUBLISH,
        buffer=element.buffer_type,
        size=max(1, element.count),
    )
    entries = tuple(entry.entry for entry in element.entries)
    return ElementInfo(name, element.unit, element.kind, element.shape, entries, options, element.description)


def _period(times: Stamps, frequency_hz: float | None) -> int:
    steps = np.diff(times[:10_000])
    steps = steps[steps > 0]
    if len(steps):
        return int(np.median(steps))
    return round(SECOND_NS / frequency_hz) if frequency_hz else SECOND_NS


def _reduce(values: NDArray[Any], edges: Stamps) -> _Tile:
    """Columns of samples; column k has those from `edges[k]` to `edges[k + 1]`."""
    width = len(edges) - 1
    grid = ColumnGrid(1, 0, width)
    total, finite, count = np.zeros(width), np.zeros(width, np.int64), np.zeros(width, np.int64)
    filled = np.flatnonzero(edges[1:] > edges[:-1])
    if len(filled):
        piece = values[edges[0] : edges[-1]]
        starts = edges[filled] - edges[0]
        grid.add(0, Bins(filled.astype(np.int64), starts), piece)
        offsets = numbers(piece).offsets
        good = np.isfinite(offsets)
        with np.errstate(invalid="ignore", over="ignore"):
            total[filled] = np.add.reduceat(np.where(good, offsets, 0.0), starts)
        finite[filled] = np.add.reduceat(good, starts, dtype=np.int64)
        count[filled] = np.add.reduceat(~np.isnan(offsets), starts, dtype=np.int64)
    return _Tile(grid.low[0], grid.high[0], grid.marks[0], grid.bases[0], total, finite, count)

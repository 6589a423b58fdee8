"""Derived signals computed while rows are read: a reader of a segment that has a ring more for each of them.

Views, histories, streams, pins and statistics read these rings as they read all others. Nothing of them is stored. A
read that goes on where one before ended goes on with what that remembered (the sample before, a window); another one
reads as much of the past as the expression looks back, so that a value doesn't depend on who asks for it: windows of
`mean` and `std` may differ in the last bit, as sums are put together from where reading began.
"""

import contextlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.conditions import Derived
from silo.core.elements import BufferType, ElementInfo
from silo.expressions.binding import OFF, BoundExpression, Catalogue, Known, ScalarPlace
from silo.expressions.derived_signals import Lookback, bound_derived, info_of, lookback
from silo.expressions.evaluation import Evaluator, SourceRows
from silo.segment.layout import STAMP_WORDS, TIME_RING, ElementSchema, EntrySchema, RingSchema, SegmentSchema
from silo.segment.picking import STAMPS, RowPicker
from silo.segment.reader import SegmentReader
from silo.segment.rows import Rows, Words

BATCH_TICKS = 16_384  # what is computed at once stays in the cache
MOST_KEPT = 4  # readings of one signal that may be gone on with: newest values, a plot, a stream


@dataclass(frozen=True)
class DerivedSignal:
    """How one derived signal is computed from rings: by ring, what is picked out of its rows, by (element, entry)."""

    ring: int
    divider: int
    bound: BoundExpression
    dividers: dict[int, int]
    pickers: dict[int, RowPicker[tuple[int, int]]]
    lookback: Lookback


@dataclass(frozen=True)
class DerivedPlan:
    """A segment's schema with a ring and an element more for each derived signal, and how these are computed."""

    schema: SegmentSchema
    signals: dict[int, DerivedSignal]


def derived_plan(schema: SegmentSchema, table: Sequence[ElementInfo], derived: Sequence[Derived]) -> DerivedPlan:
    """Return how derived signals are computed in a run; `table` names the elements that are off too.

    One that can't be computed, as what it needs is off, has no ring.
    """
    sources = sources_of(schema, table, lambda element: _source_ring(element, schema))
    logged = {info.name for info, source in sources if source != OFF}
    known = [Known.of(*one) for one in sources]
    rings, elements = list(schema.rings), list(schema.elements)
    signals: dict[int, DerivedSignal] = {}
    for one, bound, why in bound_derived(Catalogue(known, schema.prefix, derived)):
        if bound is None or why or one.name in logged:
            continue
        info = info_of(one, bound)
        ring = _ring(len(rings), bound, schema)
        options = msgspec.structs.replace(
            info.options, buffer=ring.buffer_type, size=max(1, ring.capacity)
        )  # fmt: skip
        entries = tuple(EntrySchema(each, 8 * (STAMP_WORDS + at)) for at, each in enumerate(info.entries))
        rings.append(ring)
        elements.append(ElementSchema(msgspec.structs.replace(info, options=options), ring.ring, entries))
        pickers = pickers_of(schema, bound.columns)
        signals[ring.ring] = DerivedSignal(
            ring.ring, ring.divider, bound, dict(bound.sources), pickers, lookback(bound)
        )
    conditions = msgspec.structs.replace(schema.conditions, derived=tuple(derived))
    made = msgspec.structs.replace(schema, rings=tuple(rings), elements=tuple(elements), conditions=conditions)
    return DerivedPlan(made, signals)


def sources_of(
    schema: SegmentSchema, table: Sequence[ElementInfo], ring_of: Callable[[ElementSchema], int]
) -> list[tuple[ElementInfo, int]]:
    """Return the elements of a run with their rings, and those of a table that it hasn't, which are off."""
    logged = {element.info.name for element in schema.elements}
    off = [(info, OFF) for info in table if info.name not in logged]
    return [*((element.info, ring_of(element)) for element in schema.elements), *off]


def pickers_of(schema: SegmentSchema, columns: Iterable[ScalarPlace]) -> dict[int, RowPicker[tuple[int, int]]]:
    """What picks the columns of expressions out of rows, by ring, each by (element, entry); none of what is off."""
    wanted: dict[int, dict[tuple[int, int], EntrySchema]] = {}
    for column in columns:
        if column.source != OFF:
            entry = schema.elements[column.element].entries_in(column.source)[column.entry]
            wanted.setdefault(column.source, {})[column.element, column.entry] = entry
    return {ring: RowPicker(entries) for ring, entries in wanted.items()}


def _source_ring(element: ElementSchema, schema: SegmentSchema) -> int:
    """The ring with most samples of an element, the newest among them."""
    if element.live_ring >= 0 and schema.rings[element.ring].buffer_type is not BufferType.GROWING:
        return element.live_ring
    return element.ring


def _ring(number: int, bound: BoundExpression, schema: SegmentSchema) -> RingSchema:
    """A ring that holds what can be computed: it ends where the first of its signals' rings ends."""
    divider = int(np.gcd.reduce(list(bound.sources.values())))
    rings = [schema.rings[ring] for ring in bound.sources]
    kinds = {ring.buffer_type for ring in rings}
    ends = [kind for kind in (BufferType.FIXED, BufferType.GROWING) if kind in kinds]
    held = [ring.capacity * ring.divider for ring in rings if ring.buffer_type is not BufferType.GROWING]
    capacity = max(1, min(held, default=schema.time_buffer_size) // divider)
    words = STAMP_WORDS + (bound.width or 1)
    return RingSchema(number, divider, ends[0] if ends else BufferType.LOOPING, capacity, words, 0, live=True)


@dataclass
class _Reading:
    """Where a reading of a derived signal stands: what it remembers, and the first tick that it has not seen.

    `tick` and `value`, shape `(1,)` and `(1, width)`, are the last that it gave, which hold; of shape 0 before.
    """

    evaluator: Evaluator
    next_tick: int
    tick: NDArray[np.int64]
    value: NDArray[np.float64]


@dataclass
class _Readings:
    kept: list[_Reading] = field(default_factory=list)

    def take(self, tick: int, oldest: int) -> _Reading | None:
        """The reading that comes nearest before a tick, from tick `oldest` on; it is no longer kept."""
        fitting = [one for one in self.kept if oldest <= one.next_tick <= tick]
        if not fitting:
            return None
        found = max(fitting, key=lambda one: one.next_tick)
        self.kept.remove(found)
        return found

    def keep(self, reading: _Reading) -> None:
        self.kept = [*self.kept[1 - MOST_KEPT :], reading]


class DerivedReader(SegmentReader):
    """A segment with its derived signals, to be read as a segment is."""

    def __init__(self, path: str | Path, descriptor: int | None, plan: DerivedPlan) -> None:
        """Raises SegmentError where the file is missing, not a segment, or damaged. `plan` is of this very segment."""
        super().__init__(path, descriptor)
        self.schema = plan.schema
        self._signals = plan.signals
        self._readings = {ring: _Readings() for ring in plan.signals}

    def head(self, ring: int) -> int:
        """Rows ever committed to a ring; of a derived signal those that can be computed."""
        signal = self._signals.get(ring)
        if signal is None:
            return super().head(ring)
        ticks = min(super(DerivedReader, self).head(one) * divider for one, divider in signal.dividers.items())
        return -(-ticks // signal.divider)

    def ring_lost(self, ring: int) -> int:
        """Rows of a ring that could not be kept; they are counted where they were logged."""
        return 0 if ring in self._signals else super().ring_lost(ring)

    def rows(self, ring: int, since: int, limit: int | None = None, words: Words | None = None) -> Rows:
        """Rows with index `since` and later that are still there, or can be computed; at most the first `limit`."""
        signal = self._signals.get(ring)
        if signal is None:
            return super().rows(ring, since, limit, words)
        begin = max(since, 0, self._oldest(signal))
        head = self.head(ring)
        end = max(head if limit is None else min(head, begin + limit), begin)
        if words is not None and len(words) and int(words[-1]) < STAMP_WORDS:
            found = self._stamps(signal, begin, end)
            return Rows(found.ring, found.first, found.words[:, words])
        found = self._computed(signal, begin, end)
        return found if words is None else Rows(found.ring, found.first, np.take(found.words, words, axis=1))

    def _oldest(self, signal: DerivedSignal) -> int:
        """The first row for which every ring still has what holds there."""
        ticks = max(
            super(DerivedReader, self).rows(ring, 0, 1, STAMPS).first * divider
            for ring, divider in signal.dividers.items()
        )  # fmt: skip
        return -(-ticks // signal.divider)

    def _stamps(self, signal: DerivedSignal, begin: int, end: int) -> Rows:
        """Rows with tick and time stamp alone."""
        of = next((ring for ring, divider in signal.dividers.items() if divider == signal.divider), TIME_RING)
        step = 1 if of != TIME_RING else signal.divider
        rows = super().rows(of, begin * step, (end - begin) * step, STAMPS).part(begin * step, end * step)
        late = -rows.first % step
        return Rows(self.schema.rings[signal.ring], (rows.first + late) // step, rows.words[late::step])

    def _computed(self, signal: DerivedSignal, begin: int, end: int) -> Rows:
        layout = self.schema.rings[signal.ring]
        empty = Rows(layout, begin, np.zeros((0, layout.row_words), np.uint64))
        if end <= begin:
            return empty
        stamps = self._stamps(signal, begin, end)
        ticks, values = self._values(signal, begin * signal.divider, (end - 1) * signal.divider + 1)
        held = np.searchsorted(ticks, stamps.ticks, "right") - 1
        missing = int(np.searchsorted(held, 0))  # what was overwritten meanwhile
        held = held[missing:]
        out = np.empty((len(held), layout.row_words), np.uint64)
        out[:, :STAMP_WORDS] = stamps.words[missing:]
        out[:, STAMP_WORDS:] = np.ascontiguousarray(values[held]).view(np.uint64)
        return Rows(layout, stamps.first + missing, out)

    def _values(self, signal: DerivedSignal, begin: int, end: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Ticks before `end`, of shape `(n,)`, at which one of its signals has a sample, with values `(n, width)`.

        The first is at `begin`, or holds there.
        """
        start, width = reading_start(self, signal.lookback, begin), signal.bound.width or 1
        reading = self._readings[signal.ring].take(begin, start)
        if reading is None:
            reading = _Reading(Evaluator(signal.bound), start, np.zeros(0, np.int64), np.zeros((0, width)))
        longest = max(signal.dividers.values())
        ticks, values = [reading.tick], [reading.value]
        while reading.next_tick < end:
            until = min(end, reading.next_tick + BATCH_TICKS)
            batch = rows_between(super().rows, signal.dividers, signal.pickers, reading.next_tick, until)
            judged = reading.evaluator.feed(batch)
            reading.next_tick = until
            if len(judged.ticks):
                found = judged.numbers().reshape(len(judged.ticks), width)
                reading.tick, reading.value = judged.ticks[-1:].copy(), found[-1:].copy()
                if until > begin - longest:
                    ticks.append(judged.ticks)
                    values.append(found)
        self._readings[signal.ring].keep(reading)
        return np.concatenate(ticks), np.concatenate(values)


def reading_start(reader: SegmentReader, back: Lookback, begin: int) -> int:
    """Return where a reading has to begin so that it remembers all that the value at tick `begin` depends on."""
    near = max(0, begin - back.ticks)
    window_ns = back.window_ns
    if not window_ns or not near:
        return near
    span = int(window_ns * reader.schema.frequency_hz / 1e9) + 1
    until = reader.stamp_of(near)
    while near > span:  # a loop that runs faster than it should has more ticks in a window
        stamp = reader.stamp_of(near - span)
        if not until or not stamp or until - stamp >= window_ns:
            break
        span *= 2
    return max(0, near - span)


def rows_between(
    rows_of: Callable[[int, int, int, Words], Rows],
    dividers: Mapping[int, int],
    pickers: Mapping[int, RowPicker[tuple[int, int]]],
    begin: int,
    end: int,
) -> dict[int, SourceRows]:
    """Return the rows of rings for the ticks from `begin` to before `end`, with what is picked out of them."""
    found = {}
    for ring, divider in dividers.items():
        first, last, picker = -(-begin // divider), -(-end // divider), pickers[ring]
        rows = rows_of(ring, first, last - first, picker.words).part(first, last)
        found[ring] = SourceRows(rows.ticks, rows.time_ns, picker.numbers(rows))
    return found


def with_derived_rows(reader: SegmentReader, derived: Sequence[Derived]) -> SegmentReader:
    """Return a reader of the same segment that has these derived signals, too; of none the reader itself."""
    if not derived:
        return reader
    plan = derived_plan(reader.schema, (), derived)
    with contextlib.closing(reader):
        return DerivedReader(reader.path, reader.fileno(), plan)

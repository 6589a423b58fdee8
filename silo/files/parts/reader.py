"""Reading a part of an endless recording into a `Recording`: finished, open, or cut short.

Its samples are numbered by row. Where rows are missing, as the recorder could not keep up, NaN or NaT stands in their
place, or nothing (masked) where a type has none, counted as failures with their ticks; time stamps of ticks at which
nothing that was recorded fell due lie evenly between those of their neighbours.
"""

import struct
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from silo.core.elements import UNHELD, BufferType, LoggedEvent
from silo.core.recording import NO_FAILURES, Failures, RecordedElement, RecordedEntry, Recording, alike, masked
from silo.files.bags.channels import Values, channel_readers
from silo.files.bags.index import DAMAGE, GAPS, told_damage
from silo.files.mcap.chunks import INDEX_ENTRY, unpack_chunk
from silo.files.mcap.writer import MAGIC
from silo.files.parts.events import events_of
from silo.files.parts.metadata import EVENTS_RING, PartFacts, RingFacts
from silo.files.parts.scan import first_row, part_records, ring_of

_MOST_SPANS = 15


@dataclass
class _Ring:
    """The rows of one ring: their numbers and time stamps, in the order of the file."""

    facts: RingFacts
    found: list[NDArray[np.int64]] = field(default_factory=list)
    stamped: list[NDArray[np.int64]] = field(default_factory=list)

    def add(self, first: int, entries: NDArray[np.void]) -> None:
        self.found.append(np.arange(first, first + len(entries)))
        self.stamped.append(entries["time"].astype(np.int64))

    def join(self) -> "_Joined":
        rows = np.concatenate([np.empty(0, np.int64), *self.found])
        return _Joined(self.facts.divider, rows, np.concatenate([np.empty(0, np.int64), *self.stamped]))


@dataclass(frozen=True)
class _Joined:
    """All rows of a ring in the file; rows rise, with holes."""

    divider: int
    rows: NDArray[np.int64]
    stamps: NDArray[np.int64]

    @property
    def ticks(self) -> NDArray[np.int64]:
        return self.rows * self.divider

    @property
    def missing(self) -> int:
        return int(self.rows[-1] - self.rows[0]) + 1 - len(self.rows) if len(self.rows) else 0

    @property
    def holes(self) -> list[tuple[int, int]]:
        """Stretches of ticks without rows, both ends included."""
        before = np.flatnonzero(np.diff(self.rows) > 1)
        pairs = zip((self.ticks[before] + self.divider).tolist(), self.ticks[before + 1].tolist(), strict=True)
        return [(first, after - self.divider) for first, after in pairs]


def read_part(data: memoryview, facts: PartFacts) -> Recording:
    """All samples of a part. Raises ValueError, ZstdError and the like for a damaged one."""
    rings = {ring.ring: _Ring(ring) for ring in facts.value_rings}
    begin_tick = min((ring.begin * ring.divider for ring in facts.value_rings), default=0)
    events: list[LoggedEvent] = []
    chunks = [record for record in part_records(data) if record.opcode == Opcode.CHUNK and ring_of(facts, record)]
    counts: dict[int, int] = {}
    for record in chunks:
        for index in record.index:
            channel, size = struct.unpack_from("<HI", index)
            counts[channel] = counts.get(channel, 0) + size // INDEX_ENTRY.itemsize
    elements = [Values(element, 0) for element in facts.recording.elements]
    for values in elements:
        values.reserve(max((counts.get(entry.channel, 0) for entry in values.facts.entries), default=0))
    readers = channel_readers(facts.recording, elements)
    damaged: list[str] = []
    for record in chunks:
        ring = ring_of(facts, record)
        assert ring is not None
        try:
            chunk = bytes(unpack_chunk(record.body))
        except DAMAGE as error:
            damaged.append(f"what was logged in the chunk at byte {record.at:,} can't be read ({told_damage(error)})")
            continue
        if ring.ring == EVENTS_RING:
            events += events_of(chunk, record.index[0], ring.begin, begin_tick, facts.run)
            continue
        for place, index in enumerate(record.index):
            channel, size = struct.unpack_from("<HI", index)
            entries = np.frombuffer(index[6 : 6 + size], INDEX_ENTRY)
            if not place:
                rings[ring.ring].add(first_row(ring, chunk, index), entries)
            readers[channel].add(chunk, entries["offset"])
    joined = {number: ring.join() for number, ring in rings.items()}
    found = _recording(facts, joined, elements, damaged, closed=bytes(data[-len(MAGIC) :]) == MAGIC)
    # what was found of sources while the part was written: its description came before
    told = tuple(dict.fromkeys(event.text for event in events if event.kind == UNHELD))
    ordered = tuple(sorted(events, key=lambda event: (event.time_ns, event.number)))
    return replace(found, events=ordered, warnings=(*found.warnings, *told))


def _recording(
    facts: PartFacts, rings: dict[int, _Joined], elements: list[Values], damaged: list[str], *, closed: bool
) -> Recording:
    about = facts.recording
    filled = [ring for ring in rings.values() if len(ring.rows)]
    first = min((int(ring.ticks[0]) for ring in filled), default=0)
    end = max((int(ring.ticks[-1]) + 1 for ring in filled), default=0)
    ring_by_channel = {channel: rings[ring.ring] for ring in facts.value_rings for channel in ring.channels}
    warnings = list(about.warnings)
    if not closed:
        warnings.append(
            "the file is not finished: it is being recorded, or its recorder was killed (`silo recover` closes it, so "
            "that other readers read it too)"
        )
    warnings += damaged
    read = []
    for values in elements:
        ring = ring_by_channel[values.facts.entries[0].channel]
        if values.whole or not len(ring.rows):  # damaged ones are left out, those of which nothing came are empty
            read.append(_element(values, ring, first))
    lost = sum(element.lost for element in read)
    if lost:
        spans = sorted({span for ring in filled for span in ring.holes})
        shown = ", ".join(f"{low}-{high}" for low, high in spans[:5]) + (", ..." if len(spans) > 5 else "")
        warnings.append(
            f"{lost} samples {'are damaged, or ' if damaged else ''}were lost as the recorder could not keep up "
            f"(ticks {shown}): {GAPS}"
        )
    return alike(
        Recording,
        about,
        time_ns=_stamps(filled, first, end),
        offset=end,
        elements=tuple(read),
        time_looping=True,
        warnings=tuple(warnings),
    )


def _stamps(rings: list[_Joined], first: int, end: int) -> NDArray[np.int64]:
    stamps = np.zeros(end - first, np.int64)
    known = np.zeros(end - first, bool)
    for ring in rings:
        stamps[ring.ticks - first] = ring.stamps
        known[ring.ticks - first] = True
    if not known.all():
        places, base = np.flatnonzero(known), int(stamps[known][0])
        unknown = np.flatnonzero(~known)
        between = np.interp(unknown, places, (stamps[places] - base).astype(float))
        stamps[unknown] = base + np.rint(between).astype(np.int64)
    return stamps


def _element(values: Values, ring: _Joined, first: int) -> RecordedElement:
    facts = values.facts
    holes = ring.holes
    entries = []
    for entry, array in zip(facts.entries, values.arrays, strict=True):
        whole = array[: values.whole]
        entries.append(RecordedEntry(entry.name, entry.entry, _with_holes(whole, ring.rows) if holes else whole))
    spans = holes if len(holes) <= _MOST_SPANS else [*holes[: _MOST_SPANS - 1], holes[-1]]
    return alike(
        RecordedElement,
        facts,
        buffer_type=BufferType.LOOPING,
        first=int(ring.ticks[0]) - first if len(ring.rows) else 0,
        entries=tuple(entries),
        lost=ring.missing,
        failures=Failures(ring.missing, tuple(spans)) if holes else NO_FAILURES,
    )


def _with_holes(values: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[Any]:
    """One value per row from the first to the last; those that are missing are NaN or NaT, else masked."""
    places = rows[: len(values)] - rows[0]
    room = int(places[-1]) + 1
    spread, missing = np.zeros(room, values.dtype), np.ones(room, bool)
    spread[places], missing[places] = values, False
    return masked(spread, missing)

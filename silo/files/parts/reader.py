"""A part of an endless recording as a `Recording`: finished, open, or cut short.

It is a bag whose samples are numbered by row. Where rows are missing, as the recorder could not keep up, NaN or NaT
stands in their place, or nothing (masked) where a type has none, counted as failures with their ticks; time stamps of
ticks at which nothing that was recorded fell due lie evenly between those of their neighbours. Which rows a chunk has
is told by the beginning of its first message; values are read when they are asked for.
"""

import re
import struct
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec
import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from silo.core.elements import UNHELD, BufferType, LoggedEvent, Stretch
from silo.core.recording import Recording
from silo.core.structs import alike
from silo.files.bags.index import GAPS, BagElements, lost_chunk
from silo.files.mcap.chunks import RECORD, chunk_start, unpack_chunk, walked
from silo.files.mcap.damage import DAMAGE
from silo.files.mcap.index import Index, IndexedChunk, entries_at, entries_in, record_at, walked_index
from silo.files.parts.events import events_of
from silo.files.parts.metadata import EVENTS_RING, PART_ENDING, PartFacts, RingFacts
from silo.files.parts.scan import CUT_SHORT, NO_INDEX, SEQUENCE_AT, first_row, index_fits

_LOST = re.compile(r"samples were lost, of ticks \d+ to \d+: ([^;]*)")  # in the recorder's words, and why


@dataclass
class _Ring:
    """The rows of one ring: stretches in the order of the file, which rise, with their time stamps."""

    facts: RingFacts
    stretches: list[tuple[int, NDArray[np.int64]]] = field(default_factory=list)

    @property
    def first(self) -> int:
        return self.stretches[0][0]

    @property
    def end(self) -> int:
        """The row after the last one."""
        return self.stretches[-1][0] + len(self.stretches[-1][1]) if self.stretches else self.facts.begin

    @property
    def count(self) -> int:
        """Rows from the first to the last, those that are missing counted."""
        return self.end - self.first if self.stretches else 0

    @property
    def there(self) -> int:
        return sum(len(stamps) for _, stamps in self.stretches)

    @property
    def missing(self) -> NDArray[np.int64]:
        """Which rows are missing, counted from the first one that is there."""
        there = np.zeros(self.count, bool)
        for row, stamps in self.stretches:
            there[row - self.first : row - self.first + len(stamps)] = True
        return np.flatnonzero(~there)

    @property
    def lacks(self) -> int:
        """How many rows are missing before the first one that is there."""
        return max(0, self.first - self.facts.begin) if self.stretches else 0

    @property
    def holes(self) -> list[tuple[int, int]]:
        """Stretches of ticks without rows, both ends included."""
        divider, ends = self.facts.divider, [self.facts.begin, *(row + len(stamps) for row, stamps in self.stretches)]
        pairs = zip(ends, self.stretches, strict=False)
        return [(end * divider, (row - 1) * divider) for end, (row, _) in pairs if end < row]

    def add(self, data: memoryview, chunk: IndexedChunk, found: memoryview | None = None) -> IndexedChunk:
        """Take in a chunk; return it with how many rows it has. Raises ValueError and the like for a damaged one.

        `found` is an index to be taken instead of its own, for its first channel.
        """
        channel, at = (int(one) for one in chunk.offsets[0])
        body, index = record_at(data, chunk.at, Opcode.CHUNK), found or record_at(data, at, Opcode.MESSAGE_INDEX)
        entries = entries_in(index, channel)
        row = first_row(self.facts, chunk_start(body, int(entries["offset"][0]) + SEQUENCE_AT + 4), index)
        if row != self.end:  # what comes unexpected is believed by its checksum
            row = first_row(self.facts, bytes(unpack_chunk(body)), index)
        if row < self.end:
            raise ValueError("its rows stand before it already")
        skipped = row - self.end if self.stretches else 0
        self.stretches.append((row, entries["time"].astype(np.int64)))
        return chunk._replace(rows=len(entries), skipped=skipped)


def _is_odd(data: memoryview, chunk: IndexedChunk) -> bool:
    """Whether zeros stand in the index of a chunk's first channel, as after a power cut; the first message may be at 0.

    This takes 4 us; to hold it against the messages takes longer than to read them.
    """
    channel, at = chunk.offsets[0].item()
    entries = entries_at(data, at, channel)
    (begin,) = struct.unpack_from("<Q", data, chunk.at + RECORD.size)
    return not len(entries) or entries[0].item()[0] < begin or not entries["offset"][1:].all()


def _by_messages(data: memoryview, chunk: IndexedChunk) -> memoryview | None:
    """An index of a chunk's first channel by its messages, whose checksum is looked at; None where its own is right."""
    body = record_at(data, chunk.at, Opcode.CHUNK)
    whole = bytes(unpack_chunk(body))
    with suppress(*DAMAGE):
        if index_fits(whole, [record_at(data, int(at), Opcode.MESSAGE_INDEX) for at in chunk.offsets["offset"]]):
            return None
    channel = int(chunk.offsets["channel"][0])
    entries = walked(whole, len(body))[0][channel].tobytes()
    return memoryview(struct.pack("<HI", channel, len(entries)) + entries)


def open_part(file: Path, data: memoryview, index: Index, facts: PartFacts, check: bool = False) -> Recording:
    """What a part holds. Raises ValueError, ZstdError and the like for a damaged one.

    With `check` all chunks are unpacked, and held against their indexes, which have no checksum.
    """
    rings = {ring.ring: _Ring(ring) for ring in facts.value_rings}
    begin_tick = min((ring.begin * ring.divider for ring in facts.value_rings), default=0)
    events: list[LoggedEvent] = []
    chunks: list[IndexedChunk] = []
    damaged: list[str] = []
    for chunk in index.chunks:
        ring = facts.ring_of(int(chunk.offsets["channel"][0]), len(chunk.offsets)) if len(chunk.offsets) else None
        if ring is None:
            continue
        try:
            found = _by_messages(data, chunk) if check or _is_odd(data, chunk) else None
            if found is not None:
                damaged.append(f"of the chunk at byte {chunk.at:,} {NO_INDEX}, which were taken instead")
            if ring.ring == EVENTS_RING:
                body = bytes(unpack_chunk(record_at(data, chunk.at, Opcode.CHUNK)))
                at = int(chunk.offsets["offset"][0])
                entries = entries_in(found or record_at(data, at, Opcode.MESSAGE_INDEX), ring.channels[0])
                events += events_of(body, entries["offset"], ring.begin, begin_tick, facts.run)
            else:
                chunks.append(rings[ring.ring].add(data, chunk, found))
        except DAMAGE as error:
            damaged.append(lost_chunk(chunk.at, error))
    filled = [ring for ring in rings.values() if ring.stretches]
    if index.definitions and any(ring.count > ring.there or ring.first > ring.facts.begin for ring in filled):
        # who closed it left out of its summary what is damaged
        return open_part(file, data, walked_index(data), facts, check)
    first = min((ring.first * ring.facts.divider for ring in filled), default=0)
    end = max(((ring.end - 1) * ring.facts.divider + 1 for ring in filled), default=0)
    ring_by_channel = {channel: ring for ring in rings.values() for channel in ring.facts.channels}
    of_elements = [ring_by_channel[element.entries[0].channel] for element in facts.recording.elements]
    warnings = list(facts.recording.warnings)
    if not index.complete:
        warnings.append(
            "the file is not finished: it is being recorded, or its recorder was killed (`silo recover` closes it, so "
            "that other readers read it too)"
            if file.name.endswith(PART_ENDING)
            else CUT_SHORT
        )
    warnings += damaged
    if lost := sum(ring.lacks + len(ring.missing) for ring in of_elements):
        spans = sorted({span for ring in filled for span in ring.holes})
        shown = ", ".join(f"{low}-{high}" for low, high in spans[:5]) + (", ..." if len(spans) > 5 else "")
        told = dict.fromkeys(one[1] for event in events if (one := _LOST.search(event.text)) is not None)
        why = f": {'; '.join(told)}" if told else " as the recorder could not keep up"
        warnings.append(f"{lost} samples {'are damaged, or ' if damaged else ''}were lost{why} (ticks {shown}): {GAPS}")
    # what was found of sources while the part was written: its description came before
    warnings += dict.fromkeys(event.text for event in events if event.kind == UNHELD)
    about = msgspec.structs.replace(
        facts.recording,
        offset=end,
        time_looping=True,
        stretch=msgspec.structs.replace(
            facts.recording.stretch or Stretch(facts.run, 1), recorder=facts.recorder, since=facts.since
        ),
        warnings=tuple(warnings),
        events=tuple(sorted(events, key=lambda event: (event.time_ns, event.number))),
        elements=tuple(
            msgspec.structs.replace(
                element,
                buffer_type=BufferType.LOOPING,
                first=ring.first * ring.facts.divider - first if ring.stretches else 0,
                count=ring.count,
                lost=ring.lacks,
            )
            for element, ring in zip(facts.recording.elements, of_elements, strict=True)
        ),
    )
    holes = {place: ring.missing for place, ring in enumerate(of_elements)}
    bag = BagElements(file, data, about, replace(index, chunks=chunks), end - first, holes)
    return alike(Recording, about, time_ns=_stamps(filled, first, end), elements=bag.elements, warnings=bag.warnings)


def _stamps(rings: Sequence[_Ring], first: int, end: int) -> NDArray[np.int64]:
    stamps = np.zeros(end - first, np.int64)
    known = np.zeros(end - first, bool)
    for ring in rings:
        divider = ring.facts.divider
        for row, times in ring.stretches:
            ticks = slice(row * divider - first, (row + len(times) - 1) * divider - first + 1, divider)
            stamps[ticks], known[ticks] = times, True
    if not known.all():
        places, base = np.flatnonzero(known), int(stamps[known][0])
        unknown = np.flatnonzero(~known)
        between = np.interp(unknown, places, (stamps[places] - base).astype(float))
        stamps[unknown] = base + np.rint(between).astype(np.int64)
    return stamps

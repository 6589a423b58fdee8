"""Which channels the rows of a run's rings fill, and rows as samples of them. Pure rules.

An element is recorded from the ring that passes every sample of it: its own, or the one for live values where its own
ends when it is full. All of a ring's elements have the same rows, so a chunk holds one ring's. The last channel has no
ring: what happened.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import msgspec
import numpy as np
from mcap.records import Channel as ChannelRecord
from mcap.records import Schema
from numpy.typing import NDArray

from silo.core.conditions import Conditions, Derived
from silo.core.elements import BufferType, Stretch
from silo.core.names import matching
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.core.structs import alike
from silo.errors import SaveError
from silo.files.bags.events import LOG_TYPE, events_topic
from silo.files.bags.ros_types import STRING, Channel, MessageType, channels_of, is_text
from silo.files.bags.writer import MAX_CHANNELS, Utf8Entry, definitions, recording_facts, utf8_entry
from silo.files.parts.metadata import EVENTS_RING, PART_VERSION, PartFacts, RingFacts
from silo.files.texts import presentable
from silo.judging.checks import table_catalogue
from silo.segment.layout import ElementSchema, RingSchema, SegmentSchema
from silo.segment.rows import Rows


@dataclass(frozen=True)
class ChannelLayout:
    """The channels of one run. `as_bytes` are entries whose texts turned out to be none, which travel as bytes."""

    schema: SegmentSchema
    elements: tuple[ElementSchema, ...]
    as_bytes: frozenset[str] = frozenset()

    @cached_property
    def rings(self) -> dict[int, RingSchema]:
        """The rings that are read, by number."""
        return {ring: self.schema.rings[ring] for ring in sorted({element.watch_ring for element in self.elements})}

    @cached_property
    def template(self) -> Recording:
        """The recording without a sample: what its elements are."""
        elements = [self._recorded(element, None) for element in self.elements]
        names = {element.name for element in elements}
        empty = np.empty(0, np.int64)
        about = alike(
            Recording,
            self.schema,
            time_ns=empty,
            offset=0,
            elements=elements,
            time_looping=True,
            conditions=self._conditions(names),
            stretch=Stretch(*self.schema.stretch) if self.schema.cut is not None else None,
        )
        return presentable(about)

    def _conditions(self, names: set[str]) -> Conditions:
        """Derived signals and limits of what is recorded, and all triggers: what fires is in the part."""
        conditions = self.schema.conditions
        catalogue = table_catalogue([element.info for element in self.elements], self.schema.prefix)
        return Conditions(
            tuple(one for one in conditions.derived if one.name in names),
            tuple(one for one in conditions.limits if catalogue.find(one.name)),
            conditions.triggers,
        )

    @cached_property
    def channels(self) -> list[Channel]:
        """All channels; they count from 1 in files."""
        return channels_of(self.template.elements)

    @property
    def topics(self) -> list[tuple[str, MessageType]]:
        """Name and type of each channel's topic."""
        events = events_topic(self.template, self.channels), LOG_TYPE
        return [*((channel.topic, channel.type) for channel in self.channels), events]

    @property
    def events_channel(self) -> int:
        """The number of the channel of events."""
        return len(self.channels) + 1

    @cached_property
    def ring_channels(self) -> dict[int, dict[int, Channel]]:
        """By ring, its channels by number."""
        found: dict[int, dict[int, Channel]] = {ring: {} for ring in self.rings}
        for number, channel in enumerate(self.channels, start=1):
            found[self.elements[channel.element].watch_ring][number] = channel
        return found

    @cached_property
    def definitions(self) -> tuple[list[Schema], list[ChannelRecord]]:
        """The schema and channel records."""
        return definitions(self.template, self.channels, events=True)

    def facts(self, recorder: str, begin: Mapping[int, int], since: Mapping[int, int]) -> PartFacts:
        """What a part says of itself that begins with these rows, of a run that is recorded since those."""
        rings = [
            RingFacts(ring, self.rings[ring].divider, begin.get(ring, 0), list(channels))
            for ring, channels in self.ring_channels.items()
            if channels
        ]
        since_tick = min((since.get(ring.ring, 0) * ring.divider for ring in rings), default=0)
        rings.append(RingFacts(EVENTS_RING, 1, begin.get(EVENTS_RING, 0), [self.events_channel]))
        about = recording_facts(self.template, self.channels)
        return PartFacts(PART_VERSION, recorder, self.schema.run, rings, about, since_tick)

    def samples(self, rows: Rows) -> list[RecordedElement]:
        """All elements; those of the rows' ring with values, the others as in the template."""
        ring = rows.ring.ring
        return [
            self._recorded(element, rows) if element.watch_ring == ring else empty
            for element, empty in zip(self.elements, self.template.elements, strict=True)
        ]

    def misfits(self, rows: Rows, elements: Sequence[RecordedElement]) -> set[str]:
        """Entries of channels of texts whose values are no texts."""
        found = set()
        for channel in self.ring_channels[rows.ring.ring].values():
            if channel.parts[0].wire == STRING:
                entry = elements[channel.element].entries[channel.parts[0].entry]
                if entry.values.dtype.kind != "S" or not is_text(entry.values):
                    found.add(self.elements[channel.element].info.name + entry.entry.suffix)
        return found

    def filled(self, begin: dict[int, int], noted: Mapping[int, int]) -> dict[int, int]:
        """Rows with which a run goes on, with those of signals that were derived after what told them: as was noted for
        them, or where the others are. None are from the start.
        """
        ticks = [(row - 1) * self.rings[ring].divider + 1 for ring, row in begin.items() if ring in self.rings]
        if not ticks:
            return begin
        tick = max(0, *ticks)
        return {number: noted.get(number, ring.rows_before(tick)) for number, ring in self.rings.items()} | begin

    def with_conditions(self, conditions: Conditions) -> "ChannelLayout":
        """The same with other limits and triggers; what is computed stays as it is."""
        kept = msgspec.structs.replace(self.schema.conditions, limits=conditions.limits, triggers=conditions.triggers)
        return replace(self, schema=msgspec.structs.replace(self.schema, conditions=kept))

    def _recorded(self, element: ElementSchema, rows: Rows | None) -> RecordedElement:
        info = element.info
        entries: list[RecordedEntry] = []
        for part in element.watch_entries:
            dtype = np.dtype(part.entry.dtype)
            values = rows.column(part) if rows is not None else np.zeros(0, dtype)
            entry = RecordedEntry(info.name + part.entry.suffix, part.entry, values)
            if dtype.kind in "SU":
                entry = _as_bytes(entry) if entry.name in self.as_bytes else utf8_entry(entry)
            entries.append(entry)
        return alike(
            RecordedElement,
            info,
            divider=info.options.divider if rows is None else 1,  # then rows count, not ticks
            buffer_type=BufferType.LOOPING,
            first=0,
            entries=tuple(entries),
        )


def _as_bytes(entry: RecordedEntry) -> RecordedEntry:
    values: NDArray[np.void] = np.ascontiguousarray(entry.values).view(f"V{max(entry.values.dtype.itemsize, 1)}")
    return Utf8Entry(entry.name, entry.entry, values, entry.values.dtype.str)


def more_derived(before: Sequence[Derived], now: Sequence[Derived]) -> tuple[tuple[Derived, ...], list[str]]:
    """Return the signals that a run is recorded with and those that were derived since, which come behind them.

    Those that are recorded stay, whatever became of them; what is computed of one that is another now would be wrong,
    and is left out: its names are returned, too.
    """
    names = {one.name for one in before}
    others = [one.name for one in before if one not in now]
    fresh = []
    for one in now:
        if one.name not in names:
            # a name may be written by its end, and what is computed of one left out is left out as well
            stands_on = any(name.rpartition("/")[2] in one.expression for name in others)
            (others.append(one.name) if stands_on else fresh.append(one))
    left_out = [name for name in others if name not in names]
    return (*before, *fresh), left_out


def layout_of(schema: SegmentSchema, patterns: Sequence[str]) -> ChannelLayout:
    """What of a run is recorded. Raises SaveError for more than a file can number, or for what none can hold."""
    wanted = set(matching([element.info.name for element in schema.elements], patterns))
    layout = ChannelLayout(schema, tuple(element for element in schema.elements if element.info.name in wanted))
    if layout.events_channel > MAX_CHANNELS:
        raise SaveError(
            f"{layout.events_channel} topics are too many for an MCAP file, which numbers at most {MAX_CHANNELS}: "
            "record fewer, by patterns"
        )
    return layout


def ending(layout: ChannelLayout) -> list[str]:
    """Names of elements of which no sample comes any more once their buffer is full."""
    rings = layout.schema.rings
    return [
        element.info.name
        for element in layout.elements
        if rings[element.watch_ring].buffer_type is not BufferType.LOOPING
    ]

"""The rows of one capture while it is under way: copied from the rings at once, before anything overwrites them."""

import dataclasses
from collections.abc import Iterable

import msgspec
import numpy as np

from silo.core.conditions import CaptureFacts, Conditions, TriggerOptions
from silo.core.elements import BufferType, LoggedEvent
from silo.core.episodes.words import within_ticks
from silo.core.parameter_images import image_until
from silo.core.quantities.writing import many
from silo.core.recording import Recording, once_each, with_events
from silo.judging.triggers import Capture, longest_capture
from silo.segment.layout import TIME_RING, SegmentSchema
from silo.segment.reader import SegmentReader
from silo.segment.rows import Rows
from silo.segment.snapshot import snapshot


def bytes_per_tick(schema: SegmentSchema) -> float:
    """Return what a capture takes of memory for each tick, without what keeps its first samples: that has an end."""
    saved = {TIME_RING, *(element.ring for element in schema.elements if element.info.options.action.saves)}
    rings = [schema.rings[ring] for ring in saved if schema.rings[ring].buffer_type is not BufferType.FIXED]
    return sum(ring.row_words * 8 / ring.divider for ring in rings)


class CaptureBuffer:
    """Rows of ticks `capture.first` to `capture.last` of all elements that are saved: a `RowSource`."""

    def __init__(
        self, options: TriggerOptions, capture: Capture, reader: SegmentReader, conditions: Conditions
    ) -> None:
        """Begin a capture; `conditions` are the derived signals and limits by which it was judged that it fired."""
        self.conditions = conditions
        self.trigger = options.name
        self.options = options  # as they were when it began
        self.capture = capture
        self._reader = reader
        self.ring_lost, self.lost_whys, self.failures = reader.ring_lost, reader.lost_whys, reader.failures
        self.cut_texts = reader.cut_texts
        elements = [element for element in reader.schema.elements if element.info.options.action.saves]
        self._rings = {TIME_RING, *(element.ring for element in elements)}
        self._parts: dict[int, list[Rows]] = {ring: [] for ring in self._rings}
        # a slow signal brings the sample that holds where the capture begins, and that its time stamp
        self._next = {ring: capture.first // self._divider(ring) for ring in self._rings}
        self._next[TIME_RING] = min(self._next[ring] * self._divider(ring) for ring in self._rings)
        self._begun = dict(self._next)
        self._missing = 0
        self._schema: SegmentSchema | None = None  # of the rows that there are: 13 ms for 500 elements
        self.ended = ""
        self._stop = capture.first + longest_capture(bytes_per_tick(reader.schema))

    def _divider(self, ring: int) -> int:
        return self._reader.schema.rings[ring].divider

    @property
    def run(self) -> str:
        """The run that it is of."""
        return self._reader.schema.run

    def extend(self, capture: Capture) -> None:
        """Take in that more fires made the capture longer."""
        self.capture = capture

    @property
    def is_closed_early(self) -> bool:
        """Whether it has all that a capture may have, and its end is still to come."""
        return self._stop <= self.capture.last and self.ticks >= self._stop

    @property
    def why(self) -> str:
        """Why the capture is shorter than what fired; empty where it isn't."""
        full = f"closed as it fired on and on: capture {self.capture.number + 1} goes on" if self.capture.full else ""
        return "; ".join(filter(None, (self._before_cut, self._overwritten, self.ended or full)))

    @property
    def _overwritten(self) -> str:
        length = self.capture.last + 1 - self.capture.first
        if not self._missing:
            return ""
        which = f"the first {many(self._missing, 'tick')}" if self._missing < length else f"all {many(length, 'tick')}"
        return f"{which} were overwritten before they could be copied"

    @property
    def _before_cut(self) -> str:
        """What it lacks of the past, as that is of the stretch before a cut."""
        schema, fires = self._reader.schema, self.capture.fires
        missing = round(self.options.pre_s * schema.frequency_hz) - fires[0].tick if schema.cut and fires else 0
        return (
            f"the run was cut, and its first {many(missing, 'tick')} are of the stretch before" if missing > 0 else ""
        )

    def append(self, until: int) -> bool:
        """Copy the rows of ticks before `until` that are new; whether the capture is whole then."""
        self._schema = None
        end = min(until, self.capture.last + 1, self._stop)
        for ring in self._rings:
            stop = -(-end // self._divider(ring))
            if stop <= self._next[ring]:
                continue
            rows = self._reader.rows(ring, self._next[ring], stop - self._next[ring]).part(self._next[ring], stop)
            if rows.first > self._next[ring]:
                # they were overwritten before: what is whole begins here
                begin = min(rows.first * self._divider(ring), self.capture.last + 1)
                self._missing = max(self._missing, begin - self.capture.first)
                self._parts[ring] = []
            if len(rows):
                self._parts[ring].append(rows)
                self._next[ring] = rows.first + len(rows)
        return until > self.capture.last

    def is_held(self) -> bool:
        """Whether the rings hold all of it so far, and will for a second."""
        schema = self._reader.schema
        for ring, begun in self._begun.items():
            layout = schema.rings[ring]
            soon = self._reader.head(ring) + -(-round(schema.frequency_hz) // layout.divider)
            if layout.buffer_type is BufferType.LOOPING and soon - layout.capacity >= begun:
                return False
        return True

    @property
    def size_bytes(self) -> int:
        """Bytes of the rows that it holds."""
        return sum(part.words.nbytes for parts in self._parts.values() for part in parts)

    # ------------------------------------------------------------------------------------------ as a row source

    @property
    def schema(self) -> SegmentSchema:
        """What the rows hold, every buffer as large as what it has of the capture."""
        if self._schema is None:
            self._schema = self._made_schema()
        return self._schema

    def _made_schema(self) -> SegmentSchema:
        schema = self._reader.schema
        rings = tuple(msgspec.structs.replace(ring, buffer_type=BufferType.LOOPING) for ring in schema.rings)
        elements = []
        for element in schema.elements:
            if element.ring in self._rings:
                size = max(1, sum(map(len, self._parts[element.ring])))
                options = msgspec.structs.replace(element.info.options, buffer=BufferType.LOOPING, size=size)
                info = msgspec.structs.replace(element.info, options=options)
                elements.append(msgspec.structs.replace(element, info=info))
        return msgspec.structs.replace(
            schema, rings=rings, elements=tuple(elements), time_buffer_type=BufferType.LOOPING,
            time_buffer_size=max(1, sum(map(len, self._parts[TIME_RING]))),
        )  # fmt: skip

    @property
    def ticks(self) -> int:
        """One more than the last tick of the capture."""
        return self._next[TIME_RING]

    def rows(self, ring: int, since: int, limit: int | None = None) -> Rows:
        """Rows of the capture with index `since` and later."""
        parts = self._parts[ring]
        layout = self._reader.schema.rings[ring]
        if not parts:
            return Rows(layout, self._next[ring], np.zeros((0, layout.row_words), np.uint64))
        whole = Rows(layout, parts[0].first, np.concatenate([part.words for part in parts]))
        begin = max(since, whole.first)
        return whole.part(begin, whole.first + len(whole) if limit is None else begin + limit)

    def unheld(self) -> dict[str, int]:
        """Elements whose array nobody but silo holds any more, as far as that was seen until the capture's end."""
        return {name: tick for name, tick in self._reader.unheld().items() if tick <= self.capture.last}

    def marks(self, since: int = 0) -> list[LoggedEvent]:
        """The program's marks at ticks of the capture, and those of episodes in which it begins."""
        return within_ticks(self._reader.marks(since), self.capture.first, self.capture.last)

    def changes(self, since: int = -1) -> list[LoggedEvent]:
        """The changes of parameters until the capture's end."""
        return [
            one for change in self._reader.changes(since) if (one := image_until(change, self.capture.last)) is not None
        ]

    def recording(self, happened: Iterable[LoggedEvent] = ()) -> Recording:
        """What was captured, with what there is to say of it: of what `happened` in the run, what is of the capture."""
        capture = self.capture
        # who tells what happened may not have read the newest marks yet, by which an episode ended
        told = once_each([*happened, *self._reader.marks()])
        found = with_events(snapshot(self), within_ticks(told, capture.first, capture.last))
        facts = CaptureFacts(
            self.trigger, capture.number, capture.first, capture.last, tuple(fire.tick for fire in capture.fires),
            tuple(fire.time_ns for fire in capture.fires), self.why,
        )  # fmt: skip
        conditions = msgspec.structs.replace(found.conditions, capture=facts)
        # of buffers of the size of a capture the snapshot thinks that they are short
        warnings = [text for text in found.warnings if not text.startswith("the oldest samples of")]
        return dataclasses.replace(
            found,
            conditions=conditions,
            warnings=(*warnings, *([f"capture of '{self.trigger}': {self.why}"] if self.why else [])),
        )

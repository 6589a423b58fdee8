"""Reading rows out of the rings of one run, each from where it was left, until none is to come. Never waits.

What was overwritten before it was read is taken from the buffers that are saved, where these still have it; else it is
counted, as rows of its ring.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import BufferType
from silo.recorder.layout import ChannelLayout
from silo.segment.layout import ORDERED_STORES, STAMP_WORDS
from silo.segment.reader import SegmentReader
from silo.segment.rows import Rows

MOST_PERIOD_S, LEAST_PERIOD_S = 0.25, 0.005
TOO_SLOW = "the disk took the rows too slowly, and the ring was overwritten before they were read"
AWAY = "no recorder read them in time, as it was down or got no processor time, and the ring was overwritten"
DROPPED = "nobody had recorded them when the program began other runs, and their memory was needed"
_NO_TICK = 2**62  # later than any


@dataclass(frozen=True)
class Loss:
    """Rows `begin` to `end - 1` of a ring, which nobody has any more, and why."""

    ring: int
    begin: int
    end: int
    why: str = AWAY


@dataclass(frozen=True)
class Drained:
    """What came out of the rings: by ring, rows and what is missing before them, in their order."""

    rows: list[Rows] = field(default_factory=list)
    losses: list[Loss] = field(default_factory=list)
    complete: bool = True  # nothing was left behind for want of room: all rings are at the same tick
    again: bool = False  # what follows is to be read at once: it is overwritten next

    @property
    def size_bytes(self) -> int:
        """Bytes of the rows."""
        return sum(rows.words.nbytes for rows in self.rows)

    def at(self, tick: int) -> tuple["Drained", "Drained"]:
        """What came before a tick, with what is missing, and what came from it on."""
        before, after = [], []
        for rows in self.rows:
            count = max(0, rows.ring.rows_before(tick) - rows.first)
            before.append(Rows(rows.ring, rows.first, rows.words[:count]))
            after.append(Rows(rows.ring, rows.first + count, rows.words[count:]))
        return Drained([*filter(len, before)], self.losses, self.complete), Drained([*filter(len, after)])


class RingCursor:
    """Cursors into the rings of one run."""

    def __init__(self, reader: SegmentReader, layout: ChannelLayout, begin: Mapping[int, int] | None) -> None:
        """`begin` are the rows to begin with, by ring; None: with what comes from now on."""
        self.reader, self.layout = reader, layout
        ticks = reader.ticks
        now = {number: ring.rows_before(ticks) for number, ring in layout.rings.items()}
        self.cursors = now if begin is None else {ring: begin.get(ring, 0) for ring in layout.rings}
        self.begun_with = dict(self.cursors)
        self.is_held_up = False  # by the disk: there was no room for rows since the last read

    def going_on(self, run: SegmentReader, layout: ChannelLayout) -> "RingCursor":
        """The cursors into the same run with more rings, which begin where these are."""
        found = RingCursor(run, layout, layout.filled(self.cursors, {}) if self.cursors else None)
        found.is_held_up = self.is_held_up
        return found

    @property
    def period_s(self) -> float:
        """How often to come: a quarter of the time after which the shortest ring is overwritten."""
        frequency_hz = self.layout.schema.frequency_hz
        spans = [
            ring.capacity * ring.divider / frequency_hz
            for ring in self.layout.rings.values()
            if ring.buffer_type is BufferType.LOOPING
        ]
        return min(MOST_PERIOD_S, max(LEAST_PERIOD_S, min(spans, default=1.0) / 4))

    def read(self, room_bytes: int, until: int = _NO_TICK) -> Drained:
        """Read what came, before the tick `until`, of at most about so many bytes."""
        if not ORDERED_STORES:
            self.reader.alive()  # of a writer that was killed, the newest row counts too
        ticks = min(self.reader.ticks, until)
        found = Drained()
        complete, again = True, False
        for ring, schema in self.layout.rings.items():
            # a full buffer and the memory limit end a ring before the ticks end
            due = min(schema.rows_before(ticks), self.reader.head(ring))
            most = max(1, room_bytes // (len(self.layout.rings) * 8 * schema.row_words))
            cursor = self.cursors[ring]
            if due <= cursor:
                continue
            rows = self.reader.rows(ring, cursor, min(due - cursor, most))
            if rows.first > cursor:
                saved = self._saved_rows(ring, cursor, min(rows.first, cursor + most))
                if saved is None:
                    found.losses.append(
                        Loss(
                            ring,
                            cursor,
                            rows.first,
                            DROPPED if self.reader.dropped else TOO_SLOW if self.is_held_up else AWAY,
                        )
                    )
                else:
                    rows, again = saved, True
            if len(rows):
                found.rows.append(rows)
            self.cursors[ring] = rows.first + len(rows)
            complete = complete and self.cursors[ring] >= due
        self.is_held_up = False
        return Drained(found.rows, found.losses, complete, again)

    def _saved_rows(self, ring: int, begin: int, end: int) -> Rows | None:
        """Rows of a ring for live values, put together of those of the buffers that its elements have, from the start.

        None where not all of them have the first row: rows of a ring are there for all that is recorded of it.
        """
        elements = [element for element in self.layout.elements if element.live_ring == ring]
        sources = {element.ring: self.reader.rows(element.ring, begin, end - begin) for element in elements}
        count = min((len(rows) if rows.first == begin else 0 for rows in sources.values()), default=0)
        if not count:
            return None
        schema = self.layout.rings[ring]
        words = np.zeros((count, schema.row_words), np.uint64)
        for element in elements:
            rows = sources[element.ring]
            words[:, :STAMP_WORDS] = rows.words[:count, :STAMP_WORDS]
            for own, live in zip(element.entries, element.live_entries, strict=True):
                dtype = np.dtype(own.entry.dtype)
                if dtype.itemsize:
                    stored = dtype.newbyteorder(">") if live.swapped else dtype
                    column: NDArray[Any] = np.ndarray((count,), stored, words.data, live.offset, (words.strides[0],))
                    column[:] = rows.column(own)[:count]
        return Rows(schema, begin, words)

    def is_over(self) -> bool:
        """Whether no row will come any more."""
        return not self.reader.running or not self.reader.alive()

    def done(self) -> bool:
        """Whether the run is over and all of it was read."""
        over = self.is_over()
        ticks = self.reader.ticks
        return over and all(
            self.cursors[number] >= min(ring.rows_before(ticks), self.reader.head(number))
            for number, ring in self.layout.rings.items()
        )

"""Topics: every sample of a published element with its time stamp, in batches, only while somebody subscribes.

A batch is little-endian: `n` time stamps (int64, ns), then `n` values. The encoding tells the type of a value,
`silo/samples;dtype=<f8;shape=3` or, for elements of several types, `silo/samples;fields=_x:<f8,_mode:|u1` (packed, in
that order); so `n = len(payload) // (8 + bytes of a value)`. The attachment is the number of the batch's first sample
since start, uint64: a gap between batches is a loss, a smaller number a new start. An encoding for which Zenoh has no
room stands behind it.
"""

from dataclasses import dataclass

import numpy as np
import zenoh

from silo.core.kinds import in_parts
from silo.core.names import grouped
from silo.errors import SegmentError
from silo.net.keys import Root, escape
from silo.net.session import matching, undeclare
from silo.rpc.published import ATTACHED
from silo.segment.layout import ElementSchema
from silo.segment.picking import Packer, shaped
from silo.segment.reader import SegmentReader
from silo.segment.rows import stored_type
from silo.state.run_follower import Between, is_next, is_over

MAX_BATCH_BYTES = 2 * 2**20  # rows read per ring and round
CHECK_PERIOD_S = 0.25  # how soon a new subscriber is noticed
MOST_ENCODING_BYTES = 255  # Zenoh panics at more, within a lock: then nobody reaches the helper process any more
DECLARED_PER_ROUND = 250  # a declaration takes 70 us: 10,000 elements must not hold up the views


def encoding_of(element: ElementSchema) -> str:
    """Return the encoding string of an element's topic."""
    entries = element.live_entries
    types = {entry.entry.dtype for entry in entries}
    if len(types) == 1:
        dtype = stored_type(types.pop(), swapped=False)
        # bytes that are the same may as well be read as what was logged
        info = element.info
        parts = in_parts(info.kind, info.shape, info.entries)
        like = shaped(np.empty((0, len(entries)), dtype), info.shape, parts=parts)
        return f"silo/samples;dtype={like.dtype.str};shape={','.join(map(str, like.shape[1:]))}"
    fields = ",".join(
        f"{_field(entry.entry.suffix)}:{stored_type(entry.entry.dtype, swapped=False).str}" for entry in entries
    )
    return f"silo/samples;fields={fields}"


def _field(suffix: str) -> str:
    return escape(suffix).replace(",", "%2C").replace(":", "%3A").replace(";", "%3B")


@dataclass
class _Topic:
    element: ElementSchema
    publisher: zenoh.Publisher
    attached: bytes  # behind the number of the first sample
    packer: Packer
    active: bool = False


def _said(element: ElementSchema) -> object:
    """What an encoding is made of."""
    return element.info.kind, element.info.shape, [entry.entry for entry in element.live_entries]


class Topics:
    """The topics of one segment. Belongs to the publisher thread."""

    def __init__(self, session: zenoh.Session, root: Root, between: Between) -> None:
        self._session, self._between = session, between
        self._root = root
        # one publisher for all keys tells whether anybody wants anything: nothing else is done until somebody does
        self._any = session.declare_publisher(root.key("topic", "**"))
        self._reader: SegmentReader | None = None
        self._present: SegmentReader | None = None  # where that is another one: what is behind is read to its end first
        self._following: SegmentReader | None = None  # the run behind the one that is read
        self._next_s = 0.0  # since when another one is the present one
        self._published: list[ElementSchema] = []
        self._topics: list[_Topic] = []
        self._undeclared: list[ElementSchema] = []  # those of what is published that have no topic yet, the last first
        self._cursors: dict[int, int] = {}
        self._check_s = 0.0
        # whose subscribers were there before the run began that is read now: they get its first sample
        self._read_before: set[str] = set()
        self._seen: str | None = None  # the run that was read last, None before the first look, empty for none so far

    def adopt(self, reader: SegmentReader | None, now_s: float) -> None:
        """Go over to another segment, once what somebody reads of the one before is sent to its end."""
        self._present, self._next_s = reader, now_s
        if reader is None or self._reader is None or not self._cursors:
            self._go_over(reader)

    @property
    def reading(self) -> str:
        """The run that somebody reads; empty for none."""
        return self._reader.schema.run if self._reader is not None and self._cursors else ""

    def _go_over(self, reader: SegmentReader | None) -> None:
        """Rings that somebody reads go on with the first sample of the new run."""
        self._reader, self._following = reader, None
        published = [e for e in reader.schema.elements if e.live_ring >= 0] if reader else []
        if published != self._published:
            self._published = published
            self._keep(published)
        self._cursors = {topic.element.live_ring: 0 for topic in self._topics if topic.active}
        # not of the run that was there first, which may have begun long ago
        if reader is not None and self._seen not in (None, reader.schema.run) and self.wanted():
            self._read_before = {element.info.name for element in published}
            self._check_s = 0.0

    def _keep(self, published: list[ElementSchema]) -> None:
        """Have who subscribes to what is as it was do so still: to another publisher it comes a moment later."""
        before = {topic.element.info.name: topic for topic in self._topics}
        self._topics, self._undeclared = [], []
        for element in published:
            topic = before.get(element.info.name)
            if topic is not None and _said(topic.element) == _said(element):
                topic.element, topic.packer = element, Packer(element.live_entries)
                self._topics.append(before.pop(element.info.name))
            else:
                self._undeclared.append(element)
        self._undeclared.reverse()
        self._read_before = {name for name, topic in before.items() if topic.active}
        self._check_s = 0.0
        undeclare(*(topic.publisher for topic in before.values()))

    def _forget(self) -> None:
        undeclare(*(topic.publisher for topic in self._topics))
        self._topics, self._undeclared = [], self._published[::-1]
        self._cursors = {}
        self._read_before.clear()

    def wanted(self) -> bool:
        """Return whether anybody subscribes to any topic."""
        return matching(self._any)

    def publish(self, now_s: float) -> bool:
        """Send what came since the last call; True if there is more than fits in one round."""
        present = self._present
        self._seen = self._reader.schema.run if self._reader is not None else self._seen or ""
        if self._reader is not present and self._reader is not None and present is not None and self.wanted():
            if self._following is None or not is_next(self._reader, self._following):
                self._following = self._between(self.reading, present)
            over, more = self._publish_rest(self._reader, self._following, now_s)
            if more or not over:
                return more
            self._go_over(self._following)
            if self._reader is not present:
                return True
        elif self._reader is not present:
            self._go_over(present)
        reader = self._reader
        if reader is None:
            return False
        if not self.wanted():
            if self._topics:
                self._forget()
            return False
        self._declare()
        if now_s >= self._check_s:
            self._check_s = now_s + CHECK_PERIOD_S
            self._check(reader)
        return self._publish_rows(reader)

    def _publish_rest(self, before: SegmentReader, following: SegmentReader, now_s: float) -> tuple[bool, bool]:
        """Send what is left of a run; returns whether it has all its rows, and whether more of them are to be sent."""
        try:
            over = is_over(before, following, now_s - self._next_s)
            return over, self._publish_rows(before)
        except SegmentError:
            return True, False  # its files were cut short: the next run goes on

    def _publish_rows(self, reader: SegmentReader) -> bool:
        by_ring = grouped((topic.element.live_ring, topic) for topic in self._topics if topic.active)
        more = [self._publish_ring(reader, ring, topics) for ring, topics in by_ring.items()]
        return any(more)

    def _declare(self) -> None:
        for _ in range(min(DECLARED_PER_ROUND, len(self._undeclared))):
            element = self._undeclared.pop()
            encoding = encoding_of(element)
            fits = len(encoding.encode()) <= MOST_ENCODING_BYTES
            publisher = self._session.declare_publisher(
                self._root.topic(element.info.name),
                encoding=encoding if fits else ATTACHED,
                congestion_control=zenoh.CongestionControl.DROP,
            )
            attached = b"" if fits else encoding.encode()
            self._topics.append(_Topic(element, publisher, attached, Packer(element.live_entries)))

    def _check(self, reader: SegmentReader) -> None:
        """See who has subscribers; a ring begins with what comes from now on, unless it was read before a restart."""
        for topic in self._topics:
            topic.active = matching(topic.publisher)
            ring = topic.element.live_ring
            if topic.active and ring not in self._cursors:
                self._cursors[ring] = 0 if topic.element.info.name in self._read_before else reader.head(ring)
        if not self._undeclared:
            self._read_before.clear()
        active = {topic.element.live_ring for topic in self._topics if topic.active}
        for ring in set(self._cursors) - active:
            del self._cursors[ring]

    def _publish_ring(self, reader: SegmentReader, ring: int, topics: list[_Topic]) -> bool:
        most = max(1, MAX_BATCH_BYTES // (8 * reader.schema.rings[ring].row_words))
        rows = reader.rows(ring, self._cursors[ring], most)
        self._cursors[ring] = rows.first + len(rows)
        if not len(rows):
            return False
        stamps = rows.time_ns.tobytes()
        first = rows.first.to_bytes(8, "little")
        for topic in topics:
            topic.publisher.put(stamps + topic.packer.of(rows.words).tobytes(), attachment=first + topic.attached)
        return len(rows) == most

"""Which elements can't be shown live, and why: their ring ends, or forgets samples before a view reads them.

What is published has a ring that carries every sample; what is only saved is watched in its own buffer.
"""

from collections.abc import Sequence

from silo.core.elements import BufferType
from silo.rpc.published import NotLive
from silo.segment.layout import ElementSchema
from silo.segment.reader import SegmentReader


class Liveness:
    """The elements of one view, by the rings in which they are watched."""

    def __init__(self, reader: SegmentReader, elements: Sequence[ElementSchema | None], period_s: float) -> None:
        """`period_s` is how often the rows are read."""
        self._reader = reader
        self._always: dict[int, NotLive] = {}
        self._ending: dict[int, list[int]] = {}
        for place, element in enumerate(elements):
            if element is None:
                self._always[place] = NotLive.ABSENT
                continue
            ring = reader.schema.rings[element.watch_ring]
            if ring.buffer_type is not BufferType.LOOPING:
                self._ending.setdefault(ring.ring, []).append(place)
            elif ring.capacity * ring.divider < period_s * reader.schema.frequency_hz:
                self._always[place] = NotLive.SHORT

    def missing(self) -> dict[int, NotLive]:
        """Return why elements aren't live now, by their places; those that are have none."""
        found = dict(self._always)
        ticks = self._reader.ticks if self._ending else 0
        for number, places in self._ending.items():
            ring = self._reader.schema.rings[number]
            if self._reader.head(number) < -(-ticks // ring.divider):
                why = NotLive.FULL if ring.buffer_type is BufferType.FIXED else NotLive.LIMIT
                found.update(dict.fromkeys(places, why))
        return found

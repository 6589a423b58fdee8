"""Rows that were copied from a segment, to be read as the segment is. They never change."""

from collections.abc import Mapping

import numpy as np

from silo.segment.layout import SegmentSchema
from silo.segment.rows import Rows, Words


class PinnedRows:
    """What a pin holds, to be read as a segment is."""

    def __init__(self, schema: SegmentSchema, held: Mapping[int, tuple[Words, Rows]]) -> None:
        """Hold of each ring these words of one stretch of rows."""
        self.schema = schema
        self._held = dict(held)

    @property
    def size_bytes(self) -> int:
        """Memory that the rows take."""
        return sum(rows.words.nbytes for _, rows in self._held.values())

    def span_ns(self) -> tuple[int, int]:
        """Return the first and the last time stamp, 0 where there is no row."""
        stamps = [rows.time_ns for _, rows in self._held.values() if len(rows)]
        return min((int(some.min()) for some in stamps), default=0), max(
            (int(some.max()) for some in stamps), default=0
        )

    def holds(self, ring: int, words: Words) -> bool:
        """Return whether these words of this ring are held."""
        held = self._held.get(ring)
        return held is not None and bool(np.isin(words, held[0]).all())

    def head(self, ring: int) -> int:
        """Return the number of the row after the newest one that is held."""
        held = self._held.get(ring)
        return held[1].first + len(held[1]) if held is not None else 0

    def first(self, ring: int) -> int:
        """Return the number of the oldest row that is held."""
        held = self._held.get(ring)
        return held[1].first if held is not None else 0

    def rows(self, ring: int, since: int, limit: int | None = None, words: Words | None = None) -> Rows:
        """Return rows from `since` on, of each the words at these places."""
        held, rows = self._held[ring]
        begin = max(since, rows.first)
        end = self.head(ring) if limit is None else min(self.head(ring), begin + limit)
        some = rows.part(begin, max(begin, end))
        if words is None or len(words) == len(held):
            return some
        # not by fancy indexing, which turns the rows into columns: rows are read by strides
        return Rows(some.ring, some.first, np.take(some.words, np.searchsorted(held, words), axis=1))

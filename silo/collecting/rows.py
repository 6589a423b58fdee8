"""Rows of rings, and what a reader of them offers: of a segment in shared memory, or of a journal on the disk."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from silo.collecting.reasons import LostWhy
from silo.collecting.schema import ElementSchema, EntrySchema, RingSchema, SegmentSchema
from silo.model import LoggedEvent
from silo.recording import Failures

Words = NDArray[np.intp]  # places in a row, ascending


@dataclass(frozen=True)
class Rows:
    """Rows of one ring, oldest first: uint64 of shape `(n, row_words)`; row i is the ring's row `first + i`."""

    ring: RingSchema
    first: int
    words: NDArray[np.uint64]

    def __len__(self) -> int:
        return len(self.words)

    @property
    def ticks(self) -> NDArray[np.int64]:
        """Shape `(n,)`: ticks since start."""
        return self.words[:, 0].view(np.int64)

    @property
    def time_ns(self) -> NDArray[np.int64]:
        """Shape `(n,)`: time stamps."""
        return self.words[:, 1].view(np.int64)

    def column(self, entry: EntrySchema) -> NDArray[Any]:
        """Shape `(n,)`: one entry, as a strided view in the entry's own type."""
        dtype = np.dtype(entry.entry.dtype)
        if dtype.itemsize == 0 or not len(self.words):
            return np.zeros(len(self.words), dtype)
        stored = dtype.newbyteorder(">") if entry.swapped else dtype
        shape, strides = (len(self.words),), (8 * self.words.shape[1],)
        column: NDArray[Any] = np.ndarray(shape, stored, self.words.data, entry.byte_offset, strides)
        return column.astype(dtype) if entry.swapped else column

    def part(self, begin: int, end: int) -> "Rows":
        """The rows with index `begin <= index < end`, without a copy."""
        low, high = max(begin - self.first, 0), max(end - self.first, 0)
        return Rows(self.ring, self.first + min(low, len(self)), self.words[low:high])


def words_of(entry: EntrySchema) -> range:
    """Return the places of the words that hold an entry in a row."""
    size = max(1, np.dtype(entry.entry.dtype).itemsize)
    return range(entry.byte_offset // 8, (entry.byte_offset + size - 1) // 8 + 1)


def moved(entry: EntrySchema, words: Words) -> EntrySchema:
    """Return where an entry stands when only these words of a row are there."""
    place = int(np.searchsorted(words, entry.byte_offset // 8))
    return EntrySchema(entry.entry, 8 * place + entry.byte_offset % 8, entry.swapped)


class RowSource(Protocol):
    """A recording as rows."""

    @property
    def schema(self) -> SegmentSchema:
        """What the rows hold."""

    @property
    def ticks(self) -> int:
        """Ticks collected since start."""

    def rows(self, ring: int, since: int, limit: int | None = None) -> Rows:
        """Committed rows with index `since` and later that are still there; at most the first `limit` of them."""

    def ring_lost(self, ring: int) -> int:
        """Rows of a ring that could not be kept."""

    def lost_whys(self) -> tuple[LostWhy, ...]:
        """Why rows could not be kept, each reason once."""

    def failures(self, element: ElementSchema) -> Failures:
        """At which ticks an element could not be read."""

    def unheld(self) -> dict[str, int]:
        """Elements whose array nobody but silo holds any more, with the tick at which that was seen."""

    def marks(self, since: int = 0) -> list[LoggedEvent]:
        """The program's marks after number `since` that are still there."""

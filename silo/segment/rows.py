"""Rows of rings, and what a reader of them offers: of a segment in shared memory, or of a journal on the disk."""

import functools
from collections import Counter
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import LoggedEvent
from silo.core.recording import Failures
from silo.segment.layout import ElementSchema, EntrySchema, RingSchema, SegmentSchema
from silo.segment.reasons import LostWhy

Words = NDArray[np.intp]  # places in a row, ascending


class Placed(NamedTuple):
    """Where one scalar stands in a row: its type with the byte order in which it is there, and bytes from the begin."""

    stored: np.dtype[Any]
    offset: int


@functools.lru_cache(1024)
def stored_type(dtype: str, *, swapped: bool) -> np.dtype[Any]:
    """Return a type with the byte order that it has in rows: little-endian, or `swapped`."""
    found: np.dtype[Any] = np.dtype(dtype).newbyteorder(">" if swapped else "<")
    return found


class HasPlace(Protocol):
    """An entry of a segment, or of rows that travel."""

    @property
    def dtype(self) -> str:
        """Its type, whatever the order of its bytes."""

    @property
    def offset(self) -> int:
        """Bytes from the begin of its row."""

    @property
    def swapped(self) -> bool:
        """Whether it is big-endian there."""


def placed(entry: HasPlace) -> Placed:
    """Return where an entry stands."""
    return Placed(stored_type(entry.dtype, swapped=entry.swapped), entry.offset)


def strided(words: NDArray[Any], entry: Placed) -> NDArray[Any]:
    """Shape `(n,)`: an entry as it is stored in rows of shape `(n, words of a row)`, which lie without a gap."""
    if not len(words) or not entry.stored.itemsize:
        return np.zeros(len(words), entry.stored)
    shape, strides = (len(words),), (8 * words.shape[1],)
    found: NDArray[Any] = np.ndarray(shape, entry.stored, words.data, entry.offset, strides)
    return found


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
        """Shape `(n,)`: one entry in its own type, a strided view where that is the one of this machine."""
        return self.at(placed(entry))

    def at(self, entry: Placed) -> NDArray[Any]:
        """Shape `(n,)`: the same of one that was placed before."""
        found = strided(self.words, entry)
        return found if found.dtype.isnative else found.astype(found.dtype.newbyteorder("="))

    def part(self, begin: int, end: int) -> "Rows":
        """The rows with index `begin <= index < end`, without a copy."""
        low, high = max(begin - self.first, 0), max(end - self.first, 0)
        return Rows(self.ring, self.first + min(low, len(self)), self.words[low:high])


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

    def cut_texts(self) -> dict[str, int]:
        """Elements of which texts were cut to their room, with the length of the longest."""

    def unheld(self) -> dict[str, int]:
        """Elements whose array nobody but silo holds any more, with the tick at which that was seen."""

    def marks(self, since: int = 0) -> list[LoggedEvent]:
        """The program's marks after number `since` that are still there."""

    def changes(self, since: int = -1) -> list[LoggedEvent]:
        """The changes of parameters after number `since` that are still there, from the image at the start on."""


def lost_samples(source: RowSource) -> int:
    """Return how many samples could not be kept since start, all elements together."""
    rows = {ring.ring: lost for ring in source.schema.rings if (lost := source.ring_lost(ring.ring))}
    if not rows:
        return 0
    elements = Counter(element.ring for element in source.schema.elements if element.ring in rows)
    return sum(count * rows[ring] for ring, count in elements.items())

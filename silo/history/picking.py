"""Which words of which rings hold the samples of some names, and the rows between two moments. Pure rules."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import BufferType
from silo.core.kinds import in_parts
from silo.history.requests import By, SampledEntry, SampledName
from silo.segment.layout import ElementSchema, EntrySchema, SegmentSchema
from silo.segment.picking import STAMPS, moved, words_with
from silo.segment.rows import Rows, Words, stored_type
from silo.state.replica import LoggerSnapshot

BLOCK_BYTES = 4 * 2**20
_STAMP_OF = {By.TICK: 0, By.TIME: 1}


class RingSource(Protocol):
    """Where rows are read from: a segment, or what a pin holds of one."""

    @property
    def schema(self) -> SegmentSchema:
        """What the rows are of."""

    def head(self, ring: int) -> int:
        """Return the number of the row after the newest one."""

    def rows(self, ring: int, since: int, limit: int | None = None, words: Words | None = None) -> Rows:
        """Return rows from `since` on that are there, of each the words at these places."""


@dataclass(frozen=True)
class RingGroup:
    """The words of one ring that are wanted, but none of rows that the ring `after` holds too (-1: there is none)."""

    ring: int
    after: int
    words: Words

    @property
    def row_bytes(self) -> int:
        """Bytes of a row as it is sent."""
        return 8 * len(self.words)


@dataclass(frozen=True)
class RowSelection:
    """All that names ask for: groups, where each name stands in them, and why others have nothing."""

    groups: tuple[RingGroup, ...]
    names: list[SampledName]
    missing: dict[str, str]

    @property
    def row_bytes(self) -> int:
        """Bytes of one row of every group."""
        return sum(group.row_bytes for group in self.groups)


def check_known(names: Sequence[str], now: LoggerSnapshot) -> None:
    """Raise RequestRefusedError for the first name that means neither an element nor an entry."""
    for name in names:
        now.meant(name)


def pick(
    names: Sequence[str],
    now: LoggerSnapshot,
    schema: SegmentSchema | None,
    held: Callable[[int, Words], bool] | None = None,
) -> RowSelection:
    """Return what elements or entries of these names need, which are told as they were asked; they must be known.

    `held` tells whether there are these words of a ring, where there aren't all.
    """
    schemas = {element.info.name: element for element in schema.elements} if schema else {}
    wanted: dict[tuple[int, int], list[tuple[str, ElementSchema, tuple[EntrySchema, ...], bool]]] = {}
    missing: dict[str, str] = {}
    for name in dict.fromkeys(names):
        of, number = now.meant(name)
        whole = number < 0
        element = schemas.get(of)
        if element is None or (not whole and number >= len(element.entries)):
            missing[name] = _why_missing(of, now, schema)
            continue
        parts = [
            (ring, after, entries if whole else entries[number : number + 1])
            for ring, after, entries in _rings_of(element, schema)
        ]
        if held is not None and not all(held(ring, words_with(*_places(entries))) for ring, _, entries in parts):
            missing[name] = "it is not in this pin"
            continue
        for ring, after, entries in parts:
            wanted.setdefault((ring, after), []).append((name, element, entries, whole))
    groups: list[RingGroup] = []
    found: list[SampledName] = []
    for (ring, after), some in wanted.items():
        types, before = _places([entry for _, _, entries, _ in some for entry in entries])
        words = words_with(types, before)
        offsets = iter(moved(before, words).tolist())
        for name, element, entries, whole in some:
            shape = tuple(element.info.shape) if whole else ()
            sent = [SampledEntry(each.entry.suffix, each.dtype, next(offsets), each.swapped) for each in entries]
            info = element.info
            complex_ = whole and in_parts(info.kind, info.shape, info.entries)
            found.append(SampledName(name, len(groups), info.options.divider, shape, sent, complex_))
        groups.append(RingGroup(ring, after, words))
    return RowSelection(tuple(groups), found, missing)


def _places(entries: Sequence[EntrySchema]) -> tuple[list[np.dtype[Any]], NDArray[np.intp]]:
    types = [stored_type(entry.dtype, swapped=entry.swapped) for entry in entries]
    return types, np.array([entry.offset for entry in entries], np.intp)


def _why_missing(name: str, now: LoggerSnapshot, schema: SegmentSchema | None) -> str:
    info = now.element(name)
    if info is not None and not info.options.enabled:
        return "it is off" if not info.expression else info.description.partition(" (off: ")[2][:-1]
    return "nothing was logged yet" if schema is None else "it is not in this recording, start again"


def _rings_of(element: ElementSchema, schema: SegmentSchema | None) -> list[tuple[int, int, tuple[EntrySchema, ...]]]:
    """The rings that hold samples of an element, none twice: what a full buffer lacks is in the one that passes all."""
    assert schema is not None  # there is an element of it
    own = (element.ring, -1, element.entries)
    if element.watch_ring == element.ring:
        return [own]
    if schema.rings[element.ring].buffer_type is BufferType.LOOPING:
        return [(element.live_ring, -1, element.live_entries)]  # it is the longer one
    return [own, (element.live_ring, element.ring, element.live_entries)]


def first_row(source: RingSource, ring: int, by: By, value: int) -> int:
    """Return the first row whose time stamp or tick is `value` or more, by bisection.

    Where rows are missing, as between a pin and the buffers, those after them tell; rows that are overwritten meanwhile
    only move it on.
    """
    if by is By.ROW:
        return value
    word = _STAMP_OF[by]
    low, high = source.rows(ring, 0, 1, STAMPS).first, source.head(ring)
    while low < high:
        middle = (low + high) // 2
        found = source.rows(ring, middle, 1, STAMPS)
        if len(found) and int(found.words[0, word].view(np.int64)) >= value:
            high = middle
        else:
            low = max(middle, found.first) + 1
    return low


def bounds(source: RingSource, group: RingGroup, start: int, end: int, by: By) -> tuple[int, int]:
    """Return the rows of a group with `start <= time stamp, tick or row < end` as begin and end."""
    head = source.head(group.ring)
    begin = first_row(source, group.ring, by, start) if start > -(2**62) else 0
    if group.after >= 0:
        begin = max(begin, source.head(group.after))
    oldest = source.rows(group.ring, 0, 1, STAMPS).first
    stop = head if end >= 2**62 else min(head, first_row(source, group.ring, by, end))
    begin = min(max(begin, oldest, 0), head)
    return begin, max(begin, stop)


def blocks(source: RingSource, group: RingGroup, begin: int, end: int) -> Iterator[Rows]:
    """Yield rows of a group from `begin` to before `end`, so few at a time that memory stays small.

    What is overwritten meanwhile is left out: then rows don't go on where those before them end.
    """
    most = max(1, BLOCK_BYTES // group.row_bytes)
    while begin < end:
        rows = source.rows(group.ring, begin, min(most, end - begin), group.words)
        if not len(rows) and rows.first <= begin:
            return
        rows = rows.part(rows.first, end)
        begin = rows.first + len(rows)
        if len(rows):
            yield rows


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

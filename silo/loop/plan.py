"""From elements to rings: which words of memory each ring gathers, and where each entry stands in a row.

Made once at `start()`. Rules of the time buffer and of the size tiers are pure functions, tested without a segment.
"""

import dataclasses
import functools
import itertools
import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.elements import BufferType, ElementInfo, ElementOptions, Entry
from silo.core.names import grouped
from silo.loop.scratch import Scratch
from silo.loop.sources import Reference, ValuePath
from silo.loop.types import Component, expand, offsets_of
from silo.segment.layout import STAMP_WORDS, TIME_RING, ElementSchema, EntrySchema, RingSchema
from silo.segment.writer import chunk_bytes_for

LIVE_SECONDS = 2.0  # how long a sample must stay readable for the helper process to publish it
SLACK_SECONDS = 0.25  # rows kept beyond a looping buffer, so that a snapshot during collection loses none
MIN_SLACK_ROWS = 64
TIME_START_SECONDS = 10.0  # first size of a growing time buffer
MAX_TIER_SIZES = 128  # distinct sizes that are considered before sizes are merged


@dataclass(frozen=True)
class Element:
    """An element of the table with the sources of its parts.

    `given` are the program's own options where a client's hold.
    """

    info: ElementInfo
    parts: tuple[Component, ...]
    given: ElementOptions | None = None


@dataclass(frozen=True)
class TimeBuffer:
    """The buffer of the time stamps. For FIXED the logger stops by itself after `size` ticks."""

    buffer_type: BufferType
    size: int


def time_buffer(options: Iterable[ElementOptions], frequency_hz: float, max_time_s: float) -> TimeBuffer:
    """The four rules of the original, for the enabled elements (silo's reference, section Time)."""
    enabled = [option for option in options if option.enabled]
    types = {option.buffer for option in enabled}
    longest = max((option.divider * option.size for option in enabled), default=1)
    if types == {BufferType.LOOPING}:
        return TimeBuffer(BufferType.LOOPING, longest)
    if types == {BufferType.FIXED}:
        return TimeBuffer(BufferType.FIXED, longest)
    if max_time_s:
        return TimeBuffer(BufferType.FIXED, max(1, math.ceil(round(max_time_s * frequency_hz, 6))))
    return TimeBuffer(BufferType.GROWING, math.ceil(TIME_START_SECONDS * frequency_hz))


def size_tiers(sizes: Sequence[int], weights: Sequence[int], tiers: int) -> list[int]:
    """Upper bounds of at most `tiers` groups of sizes that waste the least memory, ascending.

    An element of size s and weight w (words) goes to the first bound >= s and costs w * bound.
    """
    total: dict[int, int] = defaultdict(int)
    for size, weight in zip(sizes, weights, strict=True):
        total[size] += weight
    bounds = sorted(total)
    if len(bounds) > MAX_TIER_SIZES:
        bounds = sorted({bounds[i] for i in np.linspace(0, len(bounds) - 1, MAX_TIER_SIZES).astype(int)})
    weight_up_to = [sum(w for s, w in total.items() if s <= bound) for bound in bounds]
    # best[i]: least cost of the sizes up to bounds[i] with the tiers so far, and the bounds chosen
    best: list[tuple[int, list[int]]] = [(weight_up_to[i] * bound, [bound]) for i, bound in enumerate(bounds)]
    for _ in range(tiers - 1):
        best = [
            min(
                [best[i]]
                + [(best[j][0] + (weight_up_to[i] - weight_up_to[j]) * bound, [*best[j][1], bound]) for j in range(i)],
                key=lambda choice: choice[0],
            )
            for i, bound in enumerate(bounds)
        ]
    return best[-1][1] if best else []


class _Layout(NamedTuple):
    """The words that a source covers, from the one where it begins; of its scalars the bytes from the first of them.

    `swapped`: whether they are big-endian.
    """

    words: NDArray[np.int64]
    offsets: tuple[int, ...]
    swapped: tuple[bool, ...]


class _Placed(NamedTuple):
    """How one element lies in memory: its layout, from the word address `begin`. Elements of a kind share layouts."""

    element: Element
    copied: bool  # whether part of it is read at each due tick, which can fail
    begin: int
    layout: _Layout
    entries: tuple[Entry, ...]


@dataclass(frozen=True)
class RingPlan:
    """A ring and the word addresses (memory address / 8) that fill its rows after the stamp."""

    schema: RingSchema
    words: NDArray[np.int64]


@dataclass(frozen=True)
class Plan:
    """All that `start()` needs to make a segment and to generate `collect()`."""

    time: TimeBuffer
    rings: tuple[RingPlan, ...]
    elements: tuple[ElementSchema, ...]
    first_rows: dict[int, int]
    chunk_bytes: int
    scratch: Scratch
    references: tuple[Reference, ...]

    @functools.cached_property
    def elements_json(self) -> bytes:
        """The elements as they stand in the schema of a segment, but for the places where failures are counted."""
        return msgspec.json.encode(self.elements)

    def again(self) -> "Plan":
        """The same for another run of an unchanged table. Its scratch is its own: a tick of the last run may last."""
        scratch = self.scratch.again()
        begin, count = self.scratch.address // 8, len(self.scratch.words)
        moved = scratch.address // 8 - begin
        rings = self.rings
        if count > STAMP_WORDS:
            inside = [(ring.words >= begin) & (ring.words < begin + count) for ring in rings]
            rings = tuple(
                RingPlan(ring.schema, ring.words + moved * within) for ring, within in zip(rings, inside, strict=True)
            )
        made = dataclasses.replace(self, scratch=scratch, rings=rings)
        vars(made)["elements_json"] = self.elements_json
        return made


@dataclass
class _Rings:
    """Rings being made."""

    rings: list[RingPlan] = field(default_factory=list)
    where: dict[tuple[int, bool], tuple[int, int]] = field(default_factory=dict)  # (element, live) -> ring, first byte

    def add(
        self, members: list[tuple[int, _Placed]], divider: int, kind: BufferType, capacity: int, live: bool
    ) -> None:
        ring = len(self.rings)
        # sorted by address: what lies side by side in memory becomes one copy
        firsts = np.array([placed.begin + placed.layout.words[0] for _, placed in members], np.int64)
        members = [members[place] for place in np.argsort(firsts, kind="stable").tolist()]
        counts = np.array([len(placed.layout.words) for _, placed in members], np.int64)
        ends = STAMP_WORDS + np.cumsum(counts)
        for (number, _), first_byte in zip(members, (8 * (ends - counts)).tolist(), strict=True):
            self.where[number, live] = ring, first_byte
        words = np.concatenate([np.empty(0, np.int64), *(placed.layout.words for _, placed in members)])
        words += np.repeat(np.array([placed.begin for _, placed in members], np.int64), counts)
        row_words = STAMP_WORDS + len(words)
        self.rings.append(RingPlan(RingSchema(ring, divider, kind, capacity, row_words, 0, live), words))


def make_plan(
    elements: Sequence[Element], frequency_hz: float, max_time_s: float, tiers: int, *, checked: bool = False
) -> Plan:
    """Lay out the rings of the enabled elements. `checked` copies every source by NumPy instead of by address."""
    enabled = [element for element in elements if element.info.options.enabled]
    scratch = Scratch()
    for element in enabled:
        for part in element.parts:
            if checked or isinstance(part.source, ValuePath):
                scratch.add(part.source, element.info.options.divider, element.info.name)
    scratch.freeze()
    placed = [_place(element, scratch) for element in enabled]
    time = time_buffer([element.info.options for element in enabled], frequency_hz, max_time_s)
    rings = _Rings()
    rings.add([], 1, time.buffer_type, _capacity(time.buffer_type, time.size, 1, frequency_hz), live=False)
    _add_rings(rings, placed, frequency_hz, tiers)
    _add_live_rings(rings, placed, frequency_hz)
    chunk_bytes = max(chunk_bytes_for(ring.schema.row_words) for ring in rings.rings)
    return Plan(
        time=time,
        rings=tuple(_with_chunk_rows(ring, chunk_bytes) for ring in rings.rings),
        elements=tuple(_element_schema(i, p, rings) for i, p in enumerate(placed)),
        first_rows=_first_rows(rings, placed, time),
        chunk_bytes=chunk_bytes,
        scratch=scratch,
        references=tuple(
            part.source
            for element in enabled
            for part in element.parts
            if isinstance(part.source, Reference) and not checked
        ),
    )


def _add_rings(rings: _Rings, placed: list[_Placed], frequency_hz: float, tiers: int) -> None:
    options = [item.element.info.options for item in placed]
    groups = grouped(((one.divider, one.buffer), number) for number, one in enumerate(options))
    for (divider, kind), numbers in sorted(groups.items()):
        sizes = [options[number].size for number in numbers]
        weights = [len(placed[number].layout.words) + 1 for number in numbers]
        bounds = [max(sizes)] if kind is BufferType.GROWING else size_tiers(sizes, weights, tiers)
        tier_of = np.searchsorted(bounds, sizes)
        for tier, bound in enumerate(bounds):
            members = [(n, placed[n]) for n, t in zip(numbers, tier_of.tolist(), strict=True) if t == tier]
            rings.add(members, divider, kind, _capacity(kind, bound, divider, frequency_hz), live=False)


def _add_live_rings(rings: _Rings, placed: list[_Placed], frequency_hz: float) -> None:
    groups = grouped(
        (item.element.info.options.divider, number)
        for number, item in enumerate(placed)
        if item.element.info.options.action.publishes and not _carries_live(rings, number, item, frequency_hz)
    )
    for divider, numbers in sorted(groups.items()):
        rows = max(MIN_SLACK_ROWS, math.ceil(LIVE_SECONDS * frequency_hz / divider))
        rings.add([(n, placed[n]) for n in numbers], divider, BufferType.LOOPING, rows, live=True)


def _carries_live(rings: _Rings, number: int, item: _Placed, frequency_hz: float) -> bool:
    """Whether an element's own ring passes every sample and keeps it long enough to be published.

    A FIXED ring ends when it is full, a GROWING one at the memory limit.
    """
    ring = rings.rings[rings.where[number, False][0]].schema
    seconds = ring.capacity * ring.divider / frequency_hz
    return ring.buffer_type is BufferType.LOOPING and (seconds >= LIVE_SECONDS or ring.capacity >= 4096)


def _capacity(kind: BufferType, size: int, divider: int, frequency_hz: float) -> int:
    if kind is BufferType.LOOPING:
        return size + max(MIN_SLACK_ROWS, math.ceil(SLACK_SECONDS * frequency_hz / divider))
    return size


def _with_chunk_rows(ring: RingPlan, chunk_bytes: int) -> RingPlan:
    if ring.schema.buffer_type is not BufferType.GROWING:
        return ring
    rows = chunk_bytes // (8 * ring.schema.row_words)
    return RingPlan(msgspec.structs.replace(ring.schema, capacity=rows, offset=0), ring.words)


def _first_rows(rings: _Rings, placed: list[_Placed], time: TimeBuffer) -> dict[int, int]:
    rows: dict[int, int] = {TIME_RING: time.size} if time.buffer_type is BufferType.GROWING else {}
    for number, item in enumerate(placed):
        options = item.element.info.options
        if options.buffer is BufferType.GROWING:
            ring = rings.where[number, False][0]
            rows[ring] = max(rows.get(ring, 1), options.size)
    return rows


def _element_schema(number: int, placed: _Placed, rings: _Rings) -> ElementSchema:
    info = placed.element.info
    ring, base = rings.where[number, False]
    entries = _entry_schemas(placed, base)
    failures = 0 if placed.copied else -1
    if not info.options.action.publishes:
        return ElementSchema(info, ring, entries, failures=failures)
    live = rings.where.get((number, True))
    if live is None:
        return ElementSchema(info, ring, entries, ring, entries, failures)
    return ElementSchema(info, ring, entries, live[0], _entry_schemas(placed, live[1]), failures)


def _entry_schemas(placed: _Placed, base: int) -> tuple[EntrySchema, ...]:
    layout = placed.layout
    return tuple(map(EntrySchema, placed.entries, [base + offset for offset in layout.offsets], layout.swapped))


# ------------------------------------------------------------------------------------------------- words of memory


def _place(element: Element, scratch: Scratch) -> _Placed:
    """The aligned 8-byte words that cover an element, each once, and where its entries lie in them."""
    placed = [_place_part(element, part, scratch) for part in element.parts]
    if len(placed) == 1:
        return placed[0]
    begin = placed[0].begin
    covered = [one.begin - begin + one.layout.words for one in placed]
    words = np.unique(np.concatenate(covered))
    offsets: list[int] = []
    for some, one in zip(covered, placed, strict=True):
        within = np.array(one.layout.offsets, np.int64)
        offsets += (8 * np.searchsorted(words, some[within // 8]) + within % 8).tolist()
    swapped = tuple(itertools.chain.from_iterable(one.layout.swapped for one in placed))
    entries = tuple(itertools.chain.from_iterable(one.entries for one in placed))
    copied = any(one.copied for one in placed)
    return _Placed(element, copied, begin, _Layout(words, tuple(offsets), swapped), entries)


def _place_part(element: Element, part: Component, scratch: Scratch) -> _Placed:
    """The same for one part: in its own memory, or at its place in the scratch."""
    source = part.source
    place = scratch.place_of(source)
    view = source.view if place is None and isinstance(source, Reference) else place
    assert view is not None
    begin, within = divmod(view.__array_interface__["data"][0], 8)
    layout_of = _few_layout if part.is_small else _layout
    layout = layout_of(view.dtype, view.shape, view.strides, part.kind, within)
    return _Placed(element, place is not None, begin, layout, part.entries())


def _layout(dtype: np.dtype[Any], shape: tuple[int, ...], strides: tuple[int, ...], kind: str, begin: int) -> _Layout:
    """How a source lies in words, whose first item is `begin` bytes into a word."""
    if dtype.kind in "Vc":
        scalars = expand(dtype, shape, strides, kind)
        addresses = np.array([begin + scalar.offset for scalar in scalars], np.int64)
        types = [scalar.dtype for scalar in scalars]
    else:  # its items are its scalars, of which a picture has a million
        addresses = begin + offsets_of(shape, strides)
        types = [dtype] * len(addresses)
    sizes = [one.itemsize for one in types]
    first = addresses // 8
    last = (addresses + np.maximum(sizes, 1) - 1) // 8
    covered = first[:, None] + np.arange(int((last - first).max()) + 1)
    words = np.unique(covered[covered <= last[:, None]])
    offsets = 8 * np.searchsorted(words, first) + addresses % 8
    big_endian = {one for one in set(types) if one.str.startswith(">") and one.itemsize > 1}
    swapped = tuple(one in big_endian for one in types)
    return _Layout(words, tuple(offsets.tolist()), swapped)


_few_layout = functools.lru_cache(maxsize=1024)(_layout)

"""Arrays that nobody but silo holds any more: `q = np.full(3, i)` in a loop leaves the one that was added behind.

Looked for beside the loop: at each start, stop and save, and once a second where a helper process serves the logger.
What is found is told once, and stands in the segment, from where files, the status and the event log have it.

A function that returned leaves its arrays behind as well, and some are constants; so an array is told of at the start,
or after ticks went by without it and it stayed what it was, or at the end if it never changed, or stood still for far
longer than before.
"""

import itertools
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from silo.core.elements import ElementInfo
from silo.core.quantities.writing import many
from silo.core.recording import KEPT_ALIKE, NEVER_CHANGED, NEWEST_ALIKE, unheld_text
from silo.loop.plan import Element
from silo.loop.sources import HeldArrays, Reference
from silo.segment.layout import ElementSchema
from silo.segment.picking import RowPicker
from silo.segment.reader import SegmentReader
from silo.segment.writer import Segment

logger = logging.getLogger("silo")

TICKS_WITHOUT = 2  # that go by until an array is told of: at least one whole turn of the loop
MOST_TOLD = 10  # by name, at once
LEAST_ALIKE = 10  # samples at the end
MOST_STILL = 100  # arrays without anybody of which that is asked
MOST_BYTES = 4 << 20  # of one element that are looked at


@dataclass
class Watched:
    """The elements of a table that are read by reference, and of which it was told."""

    infos: list[ElementInfo]
    references: list[Reference]
    held: HeldArrays
    told: set[str] = field(default_factory=set)

    @classmethod
    def of(cls, elements: Sequence[Element]) -> "Watched":
        """What is to be watched of a table."""
        infos: list[ElementInfo] = []
        references: list[Reference] = []
        for element in elements:
            for part in element.parts:
                if isinstance(part.source, Reference):
                    infos.append(element.info)
                    references.append(part.source)
        return cls(infos, references, HeldArrays(references))


class Unheld:
    """Looks for them during one run. `without_anybody` may be called any time, all else under the logger's lock."""

    def __init__(self, watched: Watched, segment: Segment) -> None:
        self._watched, self._segment = watched, segment
        self._places = {element.info.name: place for place, element in enumerate(segment.schema.elements)}
        self._known: set[str] = set()
        self._seen: dict[int, tuple[int, bytes]] = {}  # those without anybody: since which tick, and what they held
        self._over = False

    def end(self) -> None:
        """Let go of the program's variables."""
        self._watched, self._seen, self._over = Watched.of(()), {}, True

    def without_anybody(self, pause: Callable[[], None] | None = None) -> list[int]:
        """The places of arrays that nobody else holds, of elements that are logged and were not told of yet.

        `pause` is called now and then, where the loop is to have the interpreter in between.
        """
        watched, known = self._watched, self._known
        if self._over or not watched.references:
            return []
        found = itertools.compress(range(len(watched.infos)), watched.held.abandoned(pause))
        return [at for at in found if watched.infos[at].name in self._places and watched.infos[at].name not in known]

    def tell_at_start(self) -> None:
        """Tell of what can't change any more, before the first tick.

        Not of silo's own memory: whoever made a variable there and never took it has not assigned it anew.
        """
        alone = self.without_anybody()
        watched = self._watched
        never_taken = {
            watched.infos[at].name
            for at in alone
            if watched.references[at].is_own and watched.infos[at].name not in watched.told
        }
        self._known |= never_taken
        self._tell([at for at in alone if watched.infos[at].name not in never_taken], lambda _: "")

    def take(
        self, alone: Sequence[int], reader: Callable[[], SegmentReader], *, during: bool, last: bool = False
    ) -> None:
        """Tell of those without anybody that stayed what they were. After the `last` look there is none.

        `during`: others follow while the loop turns, so that what is new is not judged yet.
        """
        if self._over:
            return
        self._over = last
        ticks = self._segment.ticks
        self._seen = {at: self._seen[at] for at in alone if at in self._seen}
        found, fresh = [], []
        for at in alone:
            tick, held = self._seen.setdefault(at, (ticks, self._bytes(at)))
            if held != self._bytes(at):  # somebody writes there by its address
                self._seen[at] = ticks, self._bytes(at)
            elif ticks >= tick + TICKS_WITHOUT:
                found.append(at)
            else:
                fresh.append(at)
        if fresh and not during:
            found += [at for at in fresh if _is_constant(reader(), self._element(at))]
            moved = [at for at in fresh if at not in found]
            still = [at for at in moved[:MOST_STILL] if _newest_alike(reader(), self._element(at))]
            if len(still) <= MOST_TOLD or 2 * len(still) <= len(moved):  # else it is the robot that stood still
                found += still
        self._tell(found, lambda one: _same(reader(), one))

    def _bytes(self, at: int) -> bytes:
        return self._watched.references[at].view.tobytes()

    def _element(self, at: int) -> ElementSchema:
        return self._segment.schema.elements[self._places[self._watched.infos[at].name]]

    def _tell(self, places: list[int], same: Callable[[ElementSchema], str]) -> None:
        """Note them in the segment, and say so unless that was said in an earlier run of this table."""
        found = {one.info.name: one for one in map(self._element, places)}
        tick = max(self._segment.ticks - 1, 0)
        for name in found:
            self._segment.note_unheld(self._places[name], tick)
        self._known |= found.keys()
        fresh = sorted(found.keys() - self._watched.told)
        self._watched.told |= found.keys()
        for name in fresh[:MOST_TOLD]:
            logger.warning("%s: %s", name, unheld_text(tick, same(found[name])))
        if len(fresh) > MOST_TOLD:
            more = many(len(fresh) - MOST_TOLD, "more element")
            logger.warning("nobody but silo holds the arrays of %s either", more)


def _same(reader: SegmentReader, one: ElementSchema) -> str:
    """That all samples of an element are the same, or the newest as never before, in words; empty otherwise."""
    if _is_constant(reader, one):
        return KEPT_ALIKE if reader.rows(one.ring, 0, 1).first else NEVER_CHANGED
    alike = _newest_alike(reader, one)
    return NEWEST_ALIKE.format(alike) if alike else ""


def _newest_alike(reader: SegmentReader, one: ElementSchema) -> int:
    """How many of an element's newest samples are the same, if that is far more than ever before; 0 otherwise.

    An array that a function leaves behind changed until then, by and large as always. 4 MB at most are looked at.
    """
    head, picker = reader.head(one.ring), RowPicker(dict(enumerate(one.entries)))
    many = max(LEAST_ALIKE, MOST_BYTES // (8 * len(picker.words)))
    for count in (LEAST_ALIKE, many):  # most did change just before
        rows = reader.rows(one.ring, max(0, head - count), None, picker.words)
        if len(rows) < LEAST_ALIKE:
            return 0
        columns = [np.ascontiguousarray(some).view(np.uint8).reshape(len(rows), -1) for _, some in picker.columns(rows)]
        moved = np.logical_or.reduce([(bits[1:] != bits[:-1]).any(axis=1) for bits in columns])
        changed = np.flatnonzero(moved) + 1  # rows that differ from the one before
        if len(changed) and len(rows) - changed[-1] < LEAST_ALIKE:
            return 0
    if not len(changed):
        return 0
    alike, longest = len(rows) - int(changed[-1]), int(np.diff(changed, prepend=0).max())
    return alike if alike >= 3 * longest and 4 * alike >= len(rows) else 0


def _is_constant(reader: SegmentReader, one: ElementSchema) -> bool:
    """Whether an element has several samples, all the same. Looks at some of them first: most do change."""
    head = reader.head(one.ring)
    picker = RowPicker(dict(enumerate(one.entries)))
    if head < 2:
        return False
    for since, limit in ((head - 2, 2), (head // 2, 1), (0, 1), (0, None)):
        rows = reader.rows(one.ring, since, limit, picker.words)
        bits = [np.ascontiguousarray(some).view(np.uint8).reshape(len(rows), -1) for _, some in picker.columns(rows)]
        if since == head - 2:
            newest = [one[-1:] for one in bits]
        if not all((one == last).all() for one, last in zip(bits, newest, strict=True)):
            return False
    return True

"""What a tick does when an attribute or function could not be read: all of its divider again, one by one.

The fast way stores all expressions of a divider at once and leaves zeros when one of them fails. Here the others are
stored again; NaN or NaT stands in the place of the one that failed, or the value of its last committed row where a
type has none; and the failure is counted in the segment.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from silo.core.elements import BufferType
from silo.loop.plan import Plan, RingPlan
from silo.loop.scratch import Slot
from silo.segment.failures import record_failure
from silo.segment.layout import STAMP_WORDS, RingControl
from silo.segment.writer import Chunks, Segment


class SlowReads:
    """Reads the slots of one run one by one. Costs nothing until it is needed."""

    def __init__(self, plan: Plan, segment: Segment, chunks: Mapping[int, Chunks]) -> None:
        """`chunks` are those of the growing rings, by ring; they may come later."""
        self._plan, self._segment, self._chunks = plan, segment, chunks
        self._blocks = {element.info.name: element.failures for element in segment.schema.elements}
        self._columns: dict[int, tuple[RingPlan | None, list[tuple[int, int]]]] = {}

    def read(self, slots: Sequence[Slot], tick: int) -> None:
        """Store every slot's value or what stands for it, and count the elements that failed at this tick."""
        failed = {}
        for slot in slots:
            if not slot.try_store():
                slot.store_missing(self._last(slot) if slot.needs_last else b"")
                failed[slot.name] = slot.divider
        for name, divider in failed.items():
            record_failure(self._segment.words, self._blocks[name], tick, divider)

    def _last(self, slot: Slot) -> bytes:
        """The bytes of a slot in the newest row that holds it; before the first row what it began with."""
        found = self._columns.get(id(slot))
        if found is None:  # looked for once in a run: it goes through all words of the rings
            found = self._columns[id(slot)] = self._columns_of(slot)
        ring, columns = found
        words = np.zeros(-(-len(slot.first) // 8), np.int64)
        words.view(np.uint8)[: len(slot.first)] = np.frombuffer(slot.first, np.uint8)
        row = None if ring is None else self._newest_row(ring)
        if row is not None:
            memory, begin = row
            for word, column in columns:
                words[word] = memory[begin + column]
        return words.tobytes()[: len(slot.first)]

    def _columns_of(self, slot: Slot) -> tuple[RingPlan | None, list[tuple[int, int]]]:
        """The ring to ask, and which of the slot's words stands in which column of its rows.

        The last ring that has it: an element's live ring, which never ends, comes after its own.
        """
        first = (self._plan.scratch.address + slot.offset) // 8
        count = max(1, -(-len(slot.first) // 8))
        for ring in reversed(self._plan.rings):
            columns = np.flatnonzero((ring.words >= first) & (ring.words < first + count))
            if len(columns):
                words = (ring.words[columns] - first).tolist()
                return ring, list(zip(words, (STAMP_WORDS + columns).tolist(), strict=True))
        return None, []

    def _newest_row(self, ring: RingPlan) -> tuple[memoryview, int] | None:
        schema = self._segment.schema.rings[ring.schema.ring]
        head = self._segment.words[self._segment.ring_control(schema.ring) + RingControl.HEAD]
        if not head:
            return None
        if schema.buffer_type is BufferType.GROWING:
            return self._chunks[schema.ring].newest(head - 1)
        return self._segment.words, schema.offset // 8 + (head - 1) % schema.capacity * schema.row_words

"""Elements of a whole bag that silo wrote, each read when it is asked for: by the index behind the chunks.

An element alone costs unpacking the chunks that hold its messages, and nothing for the other elements' messages; who
asks for several gets the rest in one more pass. Used by `silo.files.bag_reader`.
"""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from silo.core.recording import DamageNotes, RecordedElement, failures_at, lazy_entry
from silo.core.structs import alike
from silo.files.bags.channels import Values, are_right, channel_readers, logged_dtype, most_samples
from silo.files.bags.metadata import PlacedElement, RecordingFacts
from silo.files.mcap.chunks import INDEX_ENTRY, unpack_chunk, walked
from silo.files.mcap.damage import DAMAGE, damage_told, told_damage
from silo.files.mcap.index import Index, IndexedChunk, entries_at, record_at

ALONE = 3  # so many elements that nobody asked for together are read one by one; each costs unpacking its chunks


class BagElements:
    """The elements of a bag: what they are stands in its facts, values are read when they are first asked for.

    `holes` are the samples of an element, by its place, that are known to be lost: of parts. `warnings` grows by what
    is found damaged when values are read, and so do the failures of the element.
    """

    def __init__(
        self,
        file: Path,
        data: memoryview,
        facts: RecordingFacts,
        index: Index,
        ticks: int,
        holes: Mapping[int, NDArray[np.int64]] | None = None,
    ) -> None:
        self._zero, self._ticks = facts.offset - ticks, ticks
        self._file, self._data = file, data
        self._facts, self._index = facts, index
        self._holes = holes
        self._values: dict[int, Values] = {}
        self._asked: set[int] = set()  # to be read together with the next one
        self.warnings = DamageNotes(file, facts.warnings)
        self.warnings.loud = True
        self.elements = tuple(self._element(place, one) for place, one in enumerate(facts.elements))

    def _element(self, place: int, facts: PlacedElement) -> RecordedElement:
        # a damaged count must not announce more than the file can hold
        count = most_samples(facts, self._most, self._ticks)
        ahead = partial(self._asked.add, place)
        entries = [
            lazy_entry(one.name, one.entry, partial(self._column, place, at), logged_dtype(one), count, ahead)
            for at, one in enumerate(facts.entries)
        ]
        made = alike(RecordedElement, facts, entries=tuple(entries))
        if self._holes is not None:
            self._note_gaps(made, facts, self._holes[place])
        return made

    @property
    def _most(self) -> int:
        """How many samples of an element the file can hold: each message has an entry in an index, or is told lost."""
        return len(self._data) // INDEX_ENTRY.itemsize if self._holes is None else self._ticks

    def _note_gaps(self, element: RecordedElement, facts: PlacedElement, missing: NDArray[np.int64]) -> None:
        failures = failures_at(facts.failures, self._zero + facts.first + missing * facts.divider, facts.divider)
        # as frozen as its list of warnings is: what was told before nobody could know of this
        object.__setattr__(element, "failures", failures)
        if self._holes is not None:
            object.__setattr__(element, "lost", facts.lost + len(missing))

    def _column(self, place: int, at: int) -> NDArray[Any]:
        if place not in self._values:
            asked = {*range(len(self.elements))} if len(self._values) >= ALONE else {place, *self._asked}
            wanted = sorted(asked - self._values.keys())
            with damage_told(self._file):
                self._values.update(zip(wanted, self._read(wanted), strict=True))
            self._asked.clear()
        return self._values[place].column(at)

    def _read(self, places: list[int]) -> list[Values]:
        # a damaged count must not reserve memory that the file can't fill
        elements = [Values(self._facts.elements[place], self._most, self._ticks) for place in places]
        readers = channel_readers(self._facts, elements)
        wanted = np.array(sorted(readers), np.uint16)
        for one in self._index.chunks:
            here = one.offsets[np.isin(one.offsets["channel"], wanted)]
            if not len(here):
                continue
            chunk = self._chunk(one.at)
            listed = list(zip(here["channel"].tolist(), here["offset"].tolist(), strict=True))
            found = [(readers[channel], self._entries(one, channel, at, chunk)) for channel, at in listed]
            known = chunk is not None and are_right(chunk, found)
            for (_, at), (reader, entries) in zip(listed, found, strict=True):
                reader.skip(one.skipped)
                if chunk is None:
                    reader.skip(one.rows or len(entries))
                    reader.is_behind |= not (one.rows or len(entries))
                elif not reader.add(chunk, entries, known):
                    self._tell(f"an index at byte {at:,} is damaged: {len(entries):,} samples can't be found by it")
        for place, values in zip(places, elements, strict=True):
            if values.facts.entries and values.short > 0:
                self._tell(f"'{values.facts.name}' has {values.short:,} samples less than its table says")
                values.fill_up()
            self._note_gaps(self.elements[place], values.facts, np.flatnonzero(values.missing[: values.whole]))
        return elements

    def _chunk(self, place: int) -> bytes | None:
        try:
            return bytes(unpack_chunk(record_at(self._data, place, Opcode.CHUNK)))
        except DAMAGE as error:
            self._tell(lost_chunk(place, error))
            return None

    def _entries(self, where: IndexedChunk, channel: int, at: int, chunk: bytes | None) -> NDArray[np.uint64]:
        """Where the messages of a channel begin in a chunk; of an index that is damaged, by the messages themselves."""
        try:
            entries = entries_at(self._data, at, channel)
            places: NDArray[np.uint64] = entries["offset"]
            if where.rows in (None, len(entries)) and (chunk is None or (places[1:] > places[:-1]).all()):
                return places  # of zeros each would be the first message
        except DAMAGE:
            pass
        found = {} if chunk is None else walked(chunk, len(chunk))[0]
        if channel not in found:
            self._tell(f"an index at byte {at:,} is damaged")
        return found.get(channel, np.empty(0, INDEX_ENTRY))["offset"]

    def _tell(self, what: str) -> None:
        self.warnings.add(f"{what}: {GAPS}")


GAPS = "NaN stands there, and nothing (masked) where a type has no NaN"


def lost_chunk(place: int, error: BaseException) -> str:
    """What is told of a chunk that can't be read."""
    return f"what was logged in the chunk at byte {place:,} can't be read ({told_damage(error)})"

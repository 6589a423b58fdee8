"""The newest value of many entries at once: one row per ring."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.values import Floats, newest_values
from silo.segment.layout import ElementSchema, EntrySchema
from silo.segment.picking import RowPicker
from silo.segment.reader import SegmentReader
from silo.segment.retention import most_kept


class NewestValues:
    """Newest values, fill levels and losses of a list of elements (None for a name that the segment lacks)."""

    def __init__(self, reader: SegmentReader, elements: Sequence[ElementSchema | None], counts: Sequence[int]) -> None:
        """`counts` is the number of entries of each element, which take their places one after the other."""
        self._reader = reader
        self._size = sum(counts)
        wanted: dict[int, dict[int, EntrySchema]] = {}
        place = 0
        for element, count in zip(elements, counts, strict=True):
            if element is not None and len(element.watch_entries) == count:
                wanted.setdefault(element.watch_ring, {}).update(enumerate(element.watch_entries, place))
            place += count
        self._pickers = {ring: RowPicker(entries) for ring, entries in wanted.items()}
        self._places = {ring: np.array(list(entries), np.intp) for ring, entries in wanted.items()}
        known = [element for element in elements if element is not None]
        self._elements = len(elements)
        self._names = [element.info.name if element is not None else "" for element in elements]
        self._known = np.array([at for at, element in enumerate(elements) if element is not None], np.intp)
        self._rings = np.array([element.ring for element in known], np.intp)
        # a growing buffer has no limit
        self._limits = np.array([most_kept(element.info.options) for element in known], np.int64)

    def values(self) -> tuple[Floats, dict[int, str]]:
        """Return the newest value of every entry, NaN where there is none, and by place what only a text can tell."""
        newest = np.full(self._size, np.nan)
        texts: dict[int, str] = {}
        for ring, picker in self._pickers.items():
            row = self._reader.rows(ring, self._reader.head(ring) - 1, words=picker.words)
            for at, values in picker.blocks(row.words[-1:]) if len(row) else ():
                places = self._places[ring][at]
                newest[places], words = newest_values(values[0])
                texts.update((int(places[index]), word) for index, word in words.items())
        return newest, texts

    def held(self) -> NDArray[np.int64]:
        """Samples in each element's buffer."""
        heads = np.array([self._reader.head(ring.ring) for ring in self._reader.schema.rings], np.int64)
        held = np.zeros(self._elements, np.int64)
        held[self._known] = np.minimum(heads[self._rings], self._limits)
        return held

    def lost(self) -> NDArray[np.int64]:
        """Samples of each element that could not be kept."""
        lost_rows = np.array([self._reader.ring_lost(ring.ring) for ring in self._reader.schema.rings], np.int64)
        lost = np.zeros(self._elements, np.int64)
        lost[self._known] = lost_rows[self._rings]
        return lost

    def failed(self) -> dict[int, int]:
        """At how many ticks elements could not be read, by their places in the list; only those that ever failed."""
        counts = self._reader.failure_counts()
        return {at: counts[name] for at, name in enumerate(self._names) if name in counts} if counts else {}

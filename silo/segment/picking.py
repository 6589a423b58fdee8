"""Entries picked out of rows: which words hold them, and these words as columns, as one array, or by type."""

import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import prod
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.values import as_exact
from silo.core.names import grouped
from silo.segment.layout import STAMP_WORDS, EntrySchema
from silo.segment.rows import HasPlace, Placed, Rows, Words, placed, stored_type, strided

STAMPS: Words = np.arange(STAMP_WORDS)

Key = TypeVar("Key")


def words_with(types: Sequence[np.dtype[Any]], offsets: NDArray[np.intp]) -> Words:
    """Return the places of the words of a row that hold entries, and of those with which it opens."""
    first = offsets // 8
    sizes = np.array([max(1, each.itemsize) for each in types], np.intp)
    counts = (offsets + sizes - 1) // 8 - first + 1
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.unique(np.concatenate([STAMPS, np.repeat(first, counts) + within]))


def moved(offsets: NDArray[np.intp], words: Words) -> NDArray[np.intp]:
    """Return where entries stand when only these words of a row are there."""
    return 8 * np.searchsorted(words, offsets // 8) + offsets % 8


class Packer:
    """Packs entries of rows beside one another, little-endian.

    Makes an array of its own: of shape `(n, number of entries)` where all are of one type, else structured, of shape
    `(n,)`, with a field for each.
    """

    def __init__(self, entries: Sequence[HasPlace], fields: Sequence[str] | None = None) -> None:
        self._entries = [placed(entry) for entry in entries]
        types = [stored_type(entry.dtype, swapped=False) for entry in entries]
        self._fields: Sequence[str] | None = None
        self._step = 0
        if len(set(types)) == 1:
            self._dtype = types[0]
            steps = {after.offset - before.offset for before, after in pairwise(self._entries)} or {8}
            if len(steps) == 1 and len({entry.stored for entry in self._entries}) == 1 and types[0].itemsize:
                self._step = steps.pop()
        else:
            self._fields = fields or [str(at) for at in range(len(types))]
            self._dtype = np.dtype(list(zip(self._fields, types, strict=True)))

    def of(self, words: NDArray[Any]) -> NDArray[Any]:
        """Pack rows of shape `(n, words of a row)`."""
        if self._fields is not None:
            made = np.empty(len(words), self._dtype)
            for field, entry in zip(self._fields, self._entries, strict=True):
                made[field] = strided(words, entry)
            return made
        shape = len(words), len(self._entries)
        if self._step and len(words):
            # evenly spaced in the row, as arrays are: one strided copy
            stored, offset = self._entries[0]
            strides = (8 * words.shape[1], self._step)
            block: NDArray[Any] = np.ndarray(shape, stored, words.data, offset, strides)
            return block.astype(self._dtype)
        made = np.empty(shape, self._dtype)
        for at, entry in enumerate(self._entries):
            made[:, at] = strided(words, entry)
        return made


def shaped(values: NDArray[Any], shape: Sequence[int], *, parts: bool = False) -> NDArray[Any]:
    """Return what a `Packer` made, each sample in the shape of its element, where it has as many entries.

    `parts`: the entries are real and imaginary parts in turns.
    """
    if values.ndim == 1:
        return values
    if parts and values.dtype.itemsize in (4, 8) and values.shape[1] == 2 * prod(shape):
        return values.view(f"<c{2 * values.dtype.itemsize}").reshape(len(values), *shape)
    count = values.shape[1]
    fitting = shape if prod(shape) == count else () if count == 1 else (count,)
    return values.reshape(len(values), *fitting)


@dataclass(frozen=True)
class _Block:
    """Entries of one type: which items of its size they are in a row, or which bytes, and their places."""

    dtype: np.dtype[Any]
    swapped: bool
    items: NDArray[np.intp]
    places: NDArray[np.intp]


class RowPicker(Generic[Key]):
    """Picks entries out of the rows of one ring, always the same; rows are read with its `words`."""

    def __init__(self, entries: Mapping[Key, EntrySchema]) -> None:
        self.keys = tuple(entries)
        self._types = [stored_type(entry.entry.dtype, swapped=entry.swapped) for entry in entries.values()]
        offsets = np.array([entry.offset for entry in entries.values()], np.intp)
        self.words = words_with(self._types, offsets)
        self._offsets = moved(offsets, self.words)

    @functools.cached_property
    def _placed(self) -> list[tuple[Key, Placed]]:
        return list(zip(self.keys, map(Placed, self._types, self._offsets.tolist()), strict=True))

    def columns(self, rows: Rows) -> Iterator[tuple[Key, NDArray[Any]]]:
        """Return each entry, shape `(len(rows),)`, in its own type."""
        return ((key, rows.at(entry)) for key, entry in self._placed)

    def numbers(self, rows: Rows) -> dict[Key, NDArray[Any]]:
        """Return each entry as float64, shape `(len(rows),)`, integers as int64."""
        return {key: as_exact(values) for key, values in self.columns(rows)}

    @functools.cached_property
    def _blocks(self) -> list[_Block]:
        by_type = grouped((stored, place) for place, stored in enumerate(self._types))
        return [
            _block(stored, np.array(places, np.intp), self._offsets[places])
            for stored, places in by_type.items()
            if stored.itemsize
        ]

    def blocks(self, words: NDArray[np.uint64]) -> Iterator[tuple[NDArray[np.intp], NDArray[Any]]]:
        """Return entries of one type together: which of them, and their values, shape `(len(words), how many)`.

        Takes 5 ns for a value: for thousands of entries, of which a column each would cost 1 us.
        """
        data = np.ascontiguousarray(words).view(np.uint8)
        for block in self._blocks:
            items = data.view(f"u{block.dtype.itemsize}") if block.items.ndim == 1 else data
            values = np.ascontiguousarray(items[:, block.items.reshape(-1)]).view(block.dtype)
            yield block.places, values.byteswap() if block.swapped else values


def _block(stored: np.dtype[Any], places: NDArray[np.intp], offsets: NDArray[np.intp]) -> _Block:
    dtype = stored.newbyteorder("=")
    if dtype.itemsize in {1, 2, 4, 8} and not (offsets % dtype.itemsize).any():
        return _Block(dtype, not stored.isnative, offsets // dtype.itemsize, places)
    return _Block(dtype, not stored.isnative, offsets[:, None] + np.arange(dtype.itemsize), places)

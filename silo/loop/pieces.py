"""How a row is filled: which of its words are copied in one stroke, which are gathered one by one.

Facts that decide it:
- fancy indexing keeps the GIL up to 500 indices; `np.take` always drops it, and next to a busy thread single calls then
  take 5 ms and more. So words are gathered in pieces of at most 500. A store through a memoryview slice keeps it too.
- words that lie side by side in memory are cheaper to copy than to gather from some 128 words on; a row of them alone
  is always cheaper to copy: 10 words take 55 ns from a memoryview, 190 ns gathered.
"""

import itertools
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from silo.segment.layout import STAMP_WORDS

GATHER_WORDS = 500
RUN_WORDS = 128

Words = NDArray[np.int64]


@dataclass(frozen=True)
class RowPiece:
    """Columns `begin <= column < end` of a ring's row, and what fills them: memory as it is, or words by indices.

    Neither for the stamp alone, which needs no memory.
    """

    begin: int
    end: int
    run: "memoryview | None" = None
    indices: NDArray[np.intp] | None = None


def memory_window(addresses: Words, scratch_words: Words) -> tuple[Words, int]:
    """One array over all words that are gathered, and the word address where it begins.

    Only the words that are indexed are ever touched: what lies between the sources need not be mapped.
    """
    scratch = int(scratch_words.__array_interface__["data"][0]) // 8
    low = min(int(addresses.min(initial=scratch)), scratch)
    high = max(int(addresses.max(initial=scratch)) + 1, scratch + len(scratch_words))
    if low == scratch and high == scratch + len(scratch_words):
        return scratch_words, scratch
    return words_at(low, high - low), low


def words_at(low: int, count: int) -> Words:
    """An array over words of memory, by the word address of the first."""
    memory = {"data": (8 * low, True), "shape": (count,), "typestr": "<i8", "version": 3}
    return np.asarray(SimpleNamespace(__array_interface__=memory))


def row_pieces(words: Words, stamp: int, memory: Words, base: int) -> list[RowPiece]:
    """How a row of these words (addresses / 8) is filled, the stamp at the word address `stamp` in front of them.

    Long runs of memory are copied, the rest is gathered, where that costs nothing with the stamp. `memory` begins at
    the word address `base`.
    """
    if len(words) and int(words[-1] - words[0]) == len(words) - 1 and bool((np.diff(words) == 1).all()):
        start = int(words[0]) - base
        return [
            RowPiece(0, STAMP_WORDS),
            RowPiece(STAMP_WORDS, STAMP_WORDS + len(words), memory[start:][: len(words)].data),
        ]
    columns = np.concatenate([np.arange(stamp, stamp + STAMP_WORDS), words]) - base
    pieces: list[RowPiece] = []
    gathered = 0
    if -(-len(columns) // GATHER_WORDS) > -(-len(words) // GATHER_WORDS):
        gathered = STAMP_WORDS  # the stamp would cost a gather of its own
        pieces.append(RowPiece(0, STAMP_WORDS))
    cuts = np.concatenate([[0], np.flatnonzero(np.diff(columns) != 1) + 1, [len(columns)]])
    for begin, end in [(int(a), int(b)) for a, b in itertools.pairwise(cuts) if b - a >= RUN_WORDS]:  # side by side
        pieces += _gather(columns, gathered, begin)
        pieces.append(RowPiece(begin, end, memory[columns[begin] : columns[end - 1] + 1].data))
        gathered = end
    return pieces + _gather(columns, gathered, len(columns))


def _gather(columns: Words, begin: int, end: int) -> list[RowPiece]:
    starts = range(begin, end, GATHER_WORDS)
    stops = [min(start + GATHER_WORDS, end) for start in starts]
    return [
        RowPiece(start, stop, indices=np.ascontiguousarray(columns[start:stop], np.intp))
        for start, stop in zip(starts, stops, strict=True)
    ]

"""Reads a journal: what it proves, as rows like those of the segment that it was written from."""

import mmap
import os
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.collecting.journal import (
    HEADER_WORDS,
    KEEP_FILE,
    LOOP_FILES,
    MAGIC,
    SCHEMA_FILE,
    Commit,
    Head,
    Kind,
    Word,
    checksum,
    seed_of,
)
from silo.collecting.reasons import LostWhy
from silo.collecting.rows import Rows
from silo.collecting.schema import STAMP_WORDS, ElementSchema, RingSchema
from silo.collecting.snapshot import snapshot
from silo.errors import SegmentError
from silo.model import BufferType
from silo.recording import NO_FAILURES, Failures, Recording


@dataclass(frozen=True)
class _Record:
    """A whole record, or rows that a commit of `ticks` closes."""

    header: NDArray[np.int64]
    payload: memoryview


@dataclass(frozen=True)
class _Block:
    """Rows of one ring, closed by the commit of `ticks`."""

    ring: int
    first: int
    words: NDArray[np.uint64]
    ticks: int


class JournalReader:
    """What a journal proves: a `RowSource`. The journal may be written meanwhile; this is its state at opening."""

    def __init__(self, path: str | Path) -> None:
        """Read all of it. Raises SegmentError for what is no journal, or one whose schema is damaged."""
        self.path = Path(path)
        self.schema = read_head(self.path).schema
        streams = [self._stream(paths) for paths in self._files()]
        # a batch counts where every stream has its commit
        proven = set.intersection(*({commit.ticks for commit in commits} for _, commits in streams))
        last = max(proven, default=0)
        zeros = (0,) * len(self.schema.rings)
        found = [commit for _, commits in streams for commit in commits if commit.ticks == last]
        self._commit = max(found, key=lambda commit: commit.saved_ticks) if found else Commit(0, zeros, zeros, (), {})
        blocks = [block for blocks, _ in streams for block in blocks if block.ticks <= last]
        self._rows = [_newest_run(ring, [b for b in blocks if b.ring == ring.ring]) for ring in self.schema.rings]

    def _files(self) -> Iterator[list[Path]]:
        """The files of each stream, oldest first."""
        kinds = {ring.buffer_type is BufferType.LOOPING for ring in self.schema.rings}
        if False in kinds:
            yield [self.path / KEEP_FILE]
        if True in kinds:
            yield sorted(self.path.glob(LOOP_FILES))

    def _stream(self, paths: Sequence[Path]) -> tuple[list[_Block], list[Commit]]:
        blocks: list[_Block] = []
        commits: list[Commit] = []
        for path in paths:
            open_blocks: list[tuple[int, int, NDArray[np.uint64]]] = []
            for record in _records(path, seed_of(self.schema.run)):
                try:
                    if record.header[Word.KIND] == Kind.ROWS:
                        open_blocks.append(self._block(record))
                        continue
                    commit = msgspec.msgpack.decode(record.payload, type=Commit)
                except (ValueError, IndexError, msgspec.MsgspecError) as error:
                    raise SegmentError(f"{path}: is no journal of its schema ({error})") from error
                blocks += [_Block(*block, commit.ticks) for block in open_blocks]
                commits.append(commit)
                open_blocks = []
        return blocks, commits

    def _block(self, record: _Record) -> tuple[int, int, NDArray[np.uint64]]:
        ring = self.schema.rings[int(record.header[Word.RING])]
        shape = int(record.header[Word.COUNT]), ring.row_words
        return ring.ring, int(record.header[Word.FIRST]), np.frombuffer(record.payload, np.uint64).reshape(shape)

    # ------------------------------------------------------------------------------------------ as a row source

    @property
    def ticks(self) -> int:
        """Ticks that are proven."""
        return self._commit.ticks

    @property
    def saved_ticks(self) -> int:
        """Ticks that stood in a file at the last commit."""
        return self._commit.saved_ticks

    def rows(self, ring: int, since: int, limit: int | None = None) -> Rows:
        """Proven rows with index `since` and later; at most the first `limit` of them."""
        rows = self._rows[ring]
        begin, end = max(since, rows.first), rows.first + len(rows)
        return rows.part(begin, end if limit is None else min(end, begin + limit))

    def ring_lost(self, ring: int) -> int:
        """Rows of a ring that could not be kept."""
        return self._commit.lost[ring]

    def lost_whys(self) -> tuple[LostWhy, ...]:
        """Why rows could not be kept, each reason once."""
        return tuple(why for why in LostWhy if why in self._commit.whys)

    def failures(self, element: ElementSchema) -> Failures:
        """At which ticks an element could not be read."""
        return self._commit.failures.get(element.info.name, NO_FAILURES)

    def snapshot(self) -> Recording:
        """All elements that are saved, as far as they are proven."""
        return snapshot(self)

    @property
    def proven_text(self) -> str:
        """How far it goes, fit to show."""
        return f"its journal was durable to tick {self.ticks}: what was logged after it was lost with the power"


def read_head(path: Path) -> Head:
    """Of what a journal holds rows. Raises SegmentError where that is damaged."""
    try:
        data = (path / SCHEMA_FILE).read_bytes()
    except OSError as error:
        raise SegmentError(f"{path}: can't open the journal ({error.strerror})") from error
    size, check = int.from_bytes(data[:8], "little"), int.from_bytes(data[8:16], "little")
    body = data[16 : 16 + size]
    if len(data) < 16 or len(body) != size or zlib.crc32(body) != check:
        raise SegmentError(f"{path}: the description of the journal is torn; no tick of it was durable yet")
    try:
        head = msgspec.json.decode(body, type=Head)
    except msgspec.MsgspecError as error:
        raise SegmentError(f"{path}: the journal's description is damaged ({error})") from error
    if any(ring.row_words < STAMP_WORDS or ring.divider < 1 for ring in head.schema.rings):
        raise SegmentError(f"{path}: the journal's description makes no sense")
    return head


def _records(path: Path, seed: int) -> Iterator[_Record]:
    """The whole records of a file in order, until the first that isn't."""
    try:
        with path.open("rb") as file:
            empty = not file.seek(0, os.SEEK_END)
            data = memoryview(b"" if empty else mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
    except FileNotFoundError:
        return  # not there yet when the power went
    except OSError as error:
        raise SegmentError(f"{path}: can't be read ({error.strerror})") from error
    at, number = 0, None
    while at + 8 * HEADER_WORDS <= len(data):
        header = np.frombuffer(data, "<i8", HEADER_WORDS, at)
        begin, size = at + 8 * HEADER_WORDS, int(header[Word.PAYLOAD_BYTES])
        if header[Word.MAGIC] != MAGIC or not 0 <= size <= len(data) - begin:
            return
        payload = data[begin : begin + size]
        if header[Word.CHECKSUM] != checksum(seed, header, payload):
            return
        if number is not None and header[Word.NUMBER] != number + 1:
            return
        number = int(header[Word.NUMBER])
        yield _Record(header, payload)
        at = begin + size + -size % 8


def _newest_run(ring: RingSchema, blocks: list[_Block]) -> Rows:
    """The newest rows of a ring that follow one another without a hole."""
    blocks = sorted(blocks, key=lambda block: block.first)
    if not blocks:
        return Rows(ring, 0, np.zeros((0, ring.row_words), np.uint64))
    begin = len(blocks) - 1
    while begin and blocks[begin - 1].first + len(blocks[begin - 1].words) == blocks[begin].first:
        begin -= 1
    return Rows(ring, blocks[begin].first, np.concatenate([block.words for block in blocks[begin:]]))

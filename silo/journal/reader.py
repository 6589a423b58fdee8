"""Reads a journal: what it proves, as rows like those of the segment that it was written from.

In blocks: a first pass checks every record and notes where its rows stand, 40 bytes each; rows are read when they are
asked for. Much of them at once goes to an unnamed file beside the journal, whose pages the kernel can take back: a
journal of gigabytes needs no gigabytes of memory.
"""

import contextlib
import mmap
import os
import tempfile
import weakref
import zlib
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.elements import BufferType, LoggedEvent
from silo.core.recording import NO_FAILURES, Failures, Recording
from silo.core.runtime import boot_id, open_own, read_own
from silo.decoding import msgpack_decoder
from silo.errors import SegmentError, reason
from silo.journal.format import (
    HEADER_WORDS,
    KEEP_FILE,
    LOOP_FILES,
    MAGIC,
    SCHEMA_FILE,
    Commit,
    Head,
    RecordKind,
    RecordWord,
    bare_checksum,
    seed_of,
)
from silo.segment.layout import STAMP_WORDS, ElementSchema, RingSchema, decode_description
from silo.segment.parameter_changes import image_event
from silo.segment.reasons import LostWhy
from silo.segment.rows import Rows
from silo.segment.snapshot import in_chain, snapshot

READ_BYTES = 1 << 20
SPOOL_BYTES = 16 << 20  # rows that take more are read into a file
_BLOCK_WORDS = 5  # first row, rows, number of the file, offset in it, ticks of the commit that closes them


class _Ticks(msgspec.Struct):
    """Of a commit no more than this is held for each."""

    ticks: int


@dataclass
class _Stream:
    """What a pass over a stream's files found: blocks of each ring, and where the commit of how many ticks stands."""

    blocks: dict[int, "array[int]"] = field(default_factory=dict)
    commits: dict[int, tuple[int, int, int]] = field(default_factory=dict)  # file, offset, bytes


class JournalReader:
    """What a journal proves: a `RowSource`. The journal may be written meanwhile; this is its state at opening."""

    def __init__(self, path: str | Path) -> None:
        """Check all of it. Raises SegmentError for what is no journal, or one whose schema is damaged."""
        self.path = Path(path)
        self.schema = read_head(self.path).schema
        self._files: list[int] = []
        self._close = weakref.finalize(self, _close_all, self._files)
        streams = [self._stream(paths) for paths in self._paths()]
        # a batch counts where every stream has its commit
        proven = set.intersection(*(set(stream.commits) for stream in streams))
        last = max(proven, default=0)
        zeros = (0,) * len(self.schema.rings)
        found = [self._commit_at(*stream.commits[last]) for stream in streams] if proven else []
        self._commit = max(found, key=lambda commit: commit.saved_ticks) if found else Commit(0, zeros, zeros, (), {})
        blocks = {ring: found for stream in streams for ring, found in stream.blocks.items()}
        self._blocks = [_newest_run(blocks.get(ring.ring, array("q")), last) for ring in self.schema.rings]

    def close(self) -> None:
        """Let go of the files. Rows that were handed out stay valid."""
        self._close()

    def _paths(self) -> Iterator[list[Path]]:
        """The files of each stream, oldest first."""
        kinds = {ring.buffer_type is BufferType.LOOPING for ring in self.schema.rings}
        if False in kinds:
            yield [self.path / KEEP_FILE]
        if True in kinds:
            yield sorted(self.path.glob(LOOP_FILES))

    def _stream(self, paths: Sequence[Path]) -> _Stream:
        stream = _Stream()
        for path in paths:
            try:
                descriptor = open_own(path, os.O_RDONLY)
            except FileNotFoundError:
                continue  # not there yet when the power went
            except OSError as error:
                raise SegmentError(f"{path}: can't be read ({reason(error)})") from error
            self._files.append(descriptor)
            try:
                self._take(stream, len(self._files) - 1)
            except OSError as error:
                raise SegmentError(f"{path}: can't be read ({reason(error)})") from error
            except (ValueError, IndexError, msgspec.MsgspecError) as error:
                raise SegmentError(f"{path}: is no journal of its schema ({error})") from error
        return stream

    def _take(self, stream: _Stream, number: int) -> None:
        """Note what stands in a file. Raises ValueError, IndexError, MsgspecError for what its schema can't mean."""
        uncommitted: list[tuple[int, ...]] = []
        for header, offset in _records(self._files[number], seed_of(self.schema.run)):
            size = header[RecordWord.PAYLOAD_BYTES]
            if header[RecordWord.KIND] == RecordKind.ROWS:
                ring = self.schema.rings[header[RecordWord.RING]]
                count = header[RecordWord.COUNT]
                if count * 8 * ring.row_words != size:
                    raise ValueError(f"{count} rows of ring {ring.ring} in {size} bytes")
                uncommitted.append((ring.ring, header[RecordWord.FIRST], count, number, offset))
                continue
            ticks = msgpack_decoder(_Ticks).decode(self._read(number, offset, size)).ticks
            for ring_number, *block in uncommitted:
                stream.blocks.setdefault(ring_number, array("q")).extend([*block, ticks])
            uncommitted = []
            stream.commits[ticks] = number, offset, size

    def _commit_at(self, number: int, offset: int, size: int) -> Commit:
        try:
            return msgpack_decoder(Commit).decode(self._read(number, offset, size))
        except (OSError, ValueError, msgspec.MsgspecError) as error:
            raise SegmentError(f"{self.path}: is no journal of its schema ({error})") from error

    def _read(self, number: int, offset: int, size: int) -> bytearray:
        out = bytearray(size)
        _read_into(self._files[number], memoryview(out), offset)
        return out

    # ------------------------------------------------------------------------------------------ as a row source

    @property
    def ticks(self) -> int:
        """Ticks that are proven."""
        return self._commit.ticks

    @property
    def saved_ticks(self) -> int:
        """Ticks that stood in a file at the last commit."""
        return self._commit.saved_ticks

    def first(self, ring: int) -> int:
        """The oldest proven row of a ring."""
        return int(self._blocks[ring][0, 0]) if len(self._blocks[ring]) else 0

    def head(self, ring: int) -> int:
        """One behind the newest proven row of a ring."""
        return int(self._blocks[ring][-1, :2].sum()) if len(self._blocks[ring]) else 0

    def rows(self, ring: int, since: int, limit: int | None = None) -> Rows:
        """Proven rows with index `since` and later; at most the first `limit` of them.

        Raises SegmentError where they can't be read any more.
        """
        blocks, layout = self._blocks[ring], self.schema.rings[ring]
        head = self.head(ring)
        begin = min(max(since, self.first(ring)), head)
        end = head if limit is None else min(head, begin + limit)
        words = self._room(max(0, end - begin), layout)
        row = begin
        place = int(np.searchsorted(blocks[:, 0], begin, "right")) - 1
        while row < end:
            first, count, number, offset, _ticks = (int(word) for word in blocks[place])
            until = min(end, first + count)
            part = words[row - begin : until - begin]
            try:
                _read_into(self._files[number], part.data.cast("B"), offset + 8 * layout.row_words * (row - first))
            except (OSError, ValueError) as error:
                raise SegmentError(f"{self.path}: can't be read any more ({error})") from error
            row, place = until, place + 1
        return Rows(layout, begin, words)

    def _room(self, count: int, ring: RingSchema) -> NDArray[np.uint64]:
        size = 8 * count * ring.row_words
        if size > SPOOL_BYTES:
            with contextlib.suppress(OSError):  # no room on that disk: then in memory
                with tempfile.TemporaryFile(dir=self.path.parent) as file:
                    os.posix_fallocate(file.fileno(), 0, size)
                    mapped = mmap.mmap(file.fileno(), size)
                return np.frombuffer(mapped, np.uint64).reshape(count, ring.row_words)
        return np.empty((count, ring.row_words), np.uint64)

    def ring_lost(self, ring: int) -> int:
        """Rows of a ring that could not be kept."""
        return self._commit.lost[ring]

    def lost_whys(self) -> tuple[LostWhy, ...]:
        """Why rows could not be kept, each reason once."""
        return tuple(why for why in LostWhy if why in self._commit.whys)

    def failures(self, element: ElementSchema) -> Failures:
        """At which ticks an element could not be read."""
        return self._commit.failures.get(element.info.name, NO_FAILURES)

    def cut_texts(self) -> dict[str, int]:
        """Elements of which texts were cut to their room, with the length of the longest."""
        return self._commit.cut_texts

    def unheld(self) -> dict[str, int]:
        """Elements whose array nobody but silo held any more, with the tick at which that was seen."""
        return self._commit.unheld

    def marks(self, since: int = 0) -> list[LoggedEvent]:
        """None: the event log beside the journal has them."""
        return []

    def changes(self, since: int = -1) -> list[LoggedEvent]:
        """None but the image at the start, likewise."""
        schema = self.schema
        if since >= 0 or not schema.parameters:
            return []
        return [image_event(schema.parameters, schema.started_ns, schema.logger, schema.run)]

    def snapshot(self) -> Recording:
        """All elements that are saved, as far as they are proven."""
        return in_chain(snapshot(self), self.schema, cut_off=False)

    @property
    def proven_text(self) -> str:
        """How far it goes and what may be missing behind that, as far as it is known; fit to show."""
        if self._commit.ended:
            return f"its journal holds all {self.ticks} ticks: logging had stopped, nothing is missing"
        why = "it was deleted" if self.schema.boot_id == boot_id() else "the computer was started anew"
        return (
            f"its journal was durable to tick {self.ticks}; what was collected after that tick, if anything, stood in "
            f"memory alone, which is gone ({why})"
        )


def read_head(path: Path) -> Head:
    """Of what a journal holds rows. Raises SegmentError where that is damaged."""
    try:
        data = read_own(path / SCHEMA_FILE)
    except OSError as error:
        raise SegmentError(f"{path}: can't open the journal ({reason(error)})") from error
    size, check = int.from_bytes(data[:8], "little"), int.from_bytes(data[8:16], "little")
    body = data[16 : 16 + size]
    if len(data) < 16 or len(body) != size or zlib.crc32(body) != check:
        raise SegmentError(f"{path}: the description of the journal is torn; no tick of it was durable yet")
    try:
        head = decode_description(body, Head)
    except msgspec.MsgspecError as error:
        raise SegmentError(f"{path}: the journal's description is damaged ({error})") from error
    if any(ring.row_words < STAMP_WORDS or ring.divider < 1 for ring in head.schema.rings):
        raise SegmentError(f"{path}: the journal's description makes no sense")
    return head


def _records(descriptor: int, seed: int) -> Iterator[tuple[list[int], int]]:
    """The headers of the whole records of a file in order, until the first that isn't, each with where its payload
    begins. Raises OSError.
    """
    length = os.fstat(descriptor).st_size
    at, number = 0, None
    while (begin := at + 8 * HEADER_WORDS) <= length:
        head = bytearray(8 * HEADER_WORDS)
        _read_into(descriptor, memoryview(head), at)
        header = np.frombuffer(head, "<i8")
        size = int(header[RecordWord.PAYLOAD_BYTES])
        if header[RecordWord.MAGIC] != MAGIC or not 0 <= size <= length - begin:
            return
        if header[RecordWord.CHECKSUM] != _checksum(descriptor, begin, size, bare_checksum(seed, header)):
            return
        if number is not None and header[RecordWord.NUMBER] != number + 1:
            return
        number = int(header[RecordWord.NUMBER])
        yield header.tolist(), begin
        at = begin + size + -size % 8


def _checksum(descriptor: int, offset: int, size: int, seed: int) -> int:
    block = memoryview(bytearray(min(size, READ_BYTES)))
    for at in range(0, size, READ_BYTES):
        part = block[: min(READ_BYTES, size - at)]
        _read_into(descriptor, part, offset + at)
        seed = zlib.crc32(part, seed)
    return seed


def _read_into(descriptor: int, out: memoryview, offset: int) -> None:
    """Fill `out`, bytes, from a file. Raises OSError, also where the file was cut meanwhile."""
    done = 0
    while done < len(out):
        count = os.preadv(descriptor, [out[done : done + READ_BYTES]], offset + done)
        if not count:
            raise OSError("it was cut short while it was read")
        done += count


def _newest_run(found: "array[int]", last: int) -> NDArray[np.int64]:
    """The newest blocks of a ring that follow one another without a hole, shape `(n, _BLOCK_WORDS)`."""
    blocks = np.frombuffer(found, np.int64).reshape(-1, _BLOCK_WORDS)
    blocks = blocks[blocks[:, -1] <= last]
    blocks = blocks[np.argsort(blocks[:, 0], kind="stable")]
    holes = np.flatnonzero(blocks[:-1, 0] + blocks[:-1, 1] != blocks[1:, 0])
    return blocks[holes[-1] + 1 if len(holes) else 0 :]


def _close_all(descriptors: list[int]) -> None:
    while descriptors:
        os.close(descriptors.pop())

"""Writes a journal: what is new in a segment since the last time, closed by a commit, synced."""

import contextlib
import errno
import os
import time
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from silo.core.elements import BufferType
from silo.core.runtime import is_at, lock_as_writer, sync
from silo.journal.format import (
    HEADER_WORDS,
    KEEP_FILE,
    MAGIC,
    SCHEMA_FILE,
    Commit,
    Head,
    RecordKind,
    RecordWord,
    checksum,
    loop_file,
    remove_journal,
    seed_of,
)
from silo.segment.layout import RingSchema
from silo.segment.reader import SegmentReader

BLOCK_BYTES = 1 << 20  # payload of a record at most, so that a copy never takes much memory


class Disk:
    """Files and folders as the system has them. Every method raises OSError where it refuses."""

    def make_folder(self, path: Path) -> None:
        """Make a folder of one's own."""
        path.mkdir(mode=0o700)

    def create(self, path: Path) -> int:
        """Make a file that isn't there yet; return its descriptor."""
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)

    def write(self, descriptor: int, data: bytes, offset: int) -> None:
        """Write all of the data."""
        while data:
            written = os.pwrite(descriptor, data, offset)
            data, offset = data[written:], offset + written

    def truncate(self, descriptor: int, size_bytes: int) -> None:
        """Cut a file."""
        os.ftruncate(descriptor, size_bytes)

    def sync(self, descriptor: int) -> None:
        """Return when a file's data, and its length, would survive a power cut."""
        os.fdatasync(descriptor)

    def sync_folder(self, path: Path) -> None:
        """Return when the names in a folder would survive a power cut."""
        sync(path)

    def remove(self, path: Path) -> None:
        """Delete a file."""
        path.unlink()

    def close(self, descriptor: int) -> None:
        """Let go of a file."""
        os.close(descriptor)


@dataclass
class _Stream:
    """A file that is appended to. `number` and `offset` are of the record that comes next."""

    path: Path
    descriptor: int
    rings: Sequence[RingSchema]
    number: int = 0
    offset: int = 0
    torn: bool = False  # whether a failed batch may stand behind `offset`


@dataclass
class _Batch:
    """What a stream has when its batch is synced: place and number of the next record, and of each ring next row and
    unbroken rows in the file."""

    offset: int
    number: int
    next_rows: dict[int, int]
    unbroken: dict[int, int]


class JournalWriter:
    """Appends what is new in a segment to a journal. One thread; raises OSError where the disk refuses."""

    def __init__(self, path: Path, head: Head, disk: Disk) -> None:
        """Make the folder and its schema file, durable when this returns. After an OSError nothing is left."""
        schema = head.schema
        self.path = path
        self.durable_ticks = 0
        self._saved_ticks = 0
        self._ended = False
        self._schema, self._disk = schema, disk
        self._seed = seed_of(schema.run)
        self._next_rows = {ring.ring: 0 for ring in schema.rings}
        self._unbroken = {ring.ring: 0 for ring in schema.rings}  # rows in the newest file without a hole
        self._generation = 0
        self._old: Path | None = None
        self._keep: _Stream | None = None
        self._loop: _Stream | None = None
        self._lock = self._make()
        try:
            body = msgspec.json.encode(head)
            facts = len(body).to_bytes(8, "little") + zlib.crc32(body).to_bytes(8, "little")
            self._disk.write(self._lock, facts + body, 0)
            self._disk.sync(self._lock)
            self._open_streams()
        except OSError:
            self.close()
            remove_journal(path)
            raise

    def _make(self) -> int:
        """The folder with an empty schema file, which we hold: no sweep takes it."""
        for _ in range(100):
            with contextlib.suppress(FileExistsError, FileNotFoundError):
                if self.path.is_symlink() or not self.path.is_dir():
                    self._disk.make_folder(self.path)
                descriptor = self._disk.create(self.path / SCHEMA_FILE)
                if lock_as_writer(descriptor) and is_at(descriptor, self.path / SCHEMA_FILE):
                    return descriptor
                self._disk.close(descriptor)
            time.sleep(0.001)  # a sweep took it between two calls for what a dead process left
        raise FileExistsError(errno.EEXIST, "another process has a journal of this name", str(self.path))

    def _open_streams(self) -> None:
        rings = self._schema.rings
        keeps = [ring for ring in rings if ring.buffer_type is not BufferType.LOOPING]
        loops = [ring for ring in rings if ring.buffer_type is BufferType.LOOPING]
        self._keep = self._open(KEEP_FILE, keeps) if keeps else None
        self._loop = self._open(loop_file(0), loops) if loops else None
        self._disk.sync_folder(self.path)
        self._disk.sync_folder(self.path.parent)

    def _open(self, name: str, rings: Sequence[RingSchema]) -> _Stream:
        return _Stream(self.path / name, self._disk.create(self.path / name), rings)

    @property
    def is_gone(self) -> bool:
        """Whether somebody deleted it, or moved it away: what is written to it then is in no journal."""
        streams = [stream for stream in (self._loop, self._keep) if stream is not None]
        there = (self.path / SCHEMA_FILE).exists()
        return not (there and all(is_at(stream.descriptor, stream.path) for stream in streams))

    def append(self, source: SegmentReader) -> int:
        """Write and sync all rows up to the present tick; return the ticks that are durable from now on.

        After an OSError nothing is lost: the next call writes the same rows again, at the same places.
        """
        ended = not source.running  # first: a run that has stopped has no further tick
        ticks, saved = source.ticks, source.saved_ticks
        if (ticks, saved, ended) == (self.durable_ticks, self._saved_ticks, self._ended):
            return ticks
        commit = self._commit(source, ticks, saved, ended=ended)
        streams = [stream for stream in (self._loop, self._keep) if stream is not None]
        batches = [self._write_batch(stream, source, commit) for stream in streams]
        for stream in streams:
            self._disk.sync(stream.descriptor)
        for stream, batch in zip(streams, batches, strict=True):
            stream.offset, stream.number, stream.torn = batch.offset, batch.number, False
            self._next_rows |= batch.next_rows
            self._unbroken |= batch.unbroken
        self.durable_ticks, self._saved_ticks, self._ended = ticks, saved, ended
        self._rotate()
        return ticks

    def _commit(self, source: SegmentReader, ticks: int, saved: int, *, ended: bool) -> Commit:
        rings = self._schema.rings
        return Commit(
            ticks=ticks,
            heads=tuple(min(source.head(ring.ring), -(-ticks // ring.divider)) for ring in rings),
            lost=tuple(source.ring_lost(ring.ring) for ring in rings),
            whys=tuple(map(int, source.lost_whys())),
            failures={
                element.info.name: found
                for element in self._schema.elements
                if element.failures >= 0 and (found := source.failures(element)).count
            },
            saved_ticks=saved,
            ended=ended,
            unheld=source.unheld(),
            cut_texts=source.cut_texts(),
        )

    def _write_batch(self, stream: _Stream, source: SegmentReader, commit: Commit) -> _Batch:
        if stream.torn:
            self._disk.truncate(stream.descriptor, stream.offset)
        stream.torn = True
        batch = _Batch(stream.offset, stream.number, {}, {})
        for ring in stream.rings:
            row, end = self._next_rows[ring.ring], commit.heads[ring.ring]
            unbroken = self._unbroken[ring.ring]
            limit = max(1, BLOCK_BYTES // (8 * ring.row_words))
            while row < end:
                rows = source.rows(ring.ring, row, limit).part(row, end)
                if not len(rows):
                    break  # overwritten before they were read, and so is what follows: the next batch begins later
                unbroken = len(rows) + (unbroken if rows.first == row else 0)
                payload = np.ascontiguousarray(rows.words).tobytes()
                self._record(stream, batch, [RecordKind.ROWS, ring.ring, rows.first, len(rows)], payload)
                row = rows.first + len(rows)
            batch.next_rows[ring.ring] = row
            batch.unbroken[ring.ring] = unbroken
        self._record(stream, batch, [RecordKind.COMMIT, 0, commit.ticks, 0], msgspec.msgpack.encode(commit))
        return batch

    def _record(self, stream: _Stream, batch: _Batch, words: list[int], payload: bytes) -> None:
        header = np.array([MAGIC, *words, len(payload), batch.number, 0], "<i8")
        header[RecordWord.CHECKSUM] = checksum(self._seed, header, payload)
        record = header.tobytes() + payload + bytes(-len(payload) % 8)
        assert len(header) == HEADER_WORDS
        self._disk.write(stream.descriptor, record, batch.offset)
        batch.offset += len(record)
        batch.number += 1

    def _rotate(self) -> None:
        """Begin a new file of looping rings once the present one alone holds every buffer; drop the one before it."""
        loop = self._loop
        if loop is None or any(self._unbroken[ring.ring] < ring.capacity for ring in loop.rings):
            return
        self._generation += 1  # also of a try that the disk refuses: the next one has a name of its own
        fresh = self._open(loop_file(self._generation), loop.rings)
        fresh.number = loop.number
        try:
            self._disk.sync_folder(self.path)
        except OSError:
            self._disk.close(fresh.descriptor)
            raise
        if self._old is not None:
            self._disk.remove(self._old)
        self._disk.close(loop.descriptor)
        self._old, self._loop = loop.path, fresh
        self._unbroken |= {ring.ring: 0 for ring in loop.rings}

    def close(self) -> None:
        """Let go of the files; they stay for recovery."""
        for stream in (self._keep, self._loop):
            if stream is not None:
                self._disk.close(stream.descriptor)
        self._keep = self._loop = None
        if self._lock >= 0:
            self._disk.close(self._lock)
            self._lock = -1

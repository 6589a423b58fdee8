"""A recording on the disk that survives a power cut: rows with checksums, appended and synced by the helper process.

The control loop never stores into a file that anybody syncs: a sync write-protects its pages, and the next store may
wait for the disk. So rows are copied out of the segment, some times a second, into a folder of append-only files:

    schema           a `Head`: what the rows hold, written and synced before the first row
    keep.rows        rows of fixed and growing rings
    loop-NNNNNN.rows rows of looping rings; the older of two is deleted when the newer alone holds every buffer

Its name is `.<logger>.<logger id>-<run>.<number>.journal`; a second helper process of a run writes a second journal and
drops the first once its own holds as much. Whoever writes a journal holds a lock on its schema file, see
`silo.core.runtime.lock_as_writer`.

A file is a run of records: eight words (see `_Word`), then a payload. ROWS are some rows of one ring; a COMMIT closes
all rows up to one tick. Readers take whole records in order, as far as each one's checksum holds, and of them those
that a commit closes: what was synced is always taken, what was torn never.
"""

import contextlib
import enum
import itertools
import os
import shutil
import zlib
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.recording import Failures
from silo.core.runtime import closing_file, has_writer, open_own
from silo.segment.layout import SegmentSchema

JOURNAL_SUFFIX = ".journal"
GONE_SUFFIX = ".gone"  # added to the name of one that is being deleted
SCHEMA_FILE = "schema"
KEEP_FILE = "keep.rows"
LOOP_FILES = "loop-*.rows"
ROWS = "*.rows"
MAGIC = int.from_bytes(b"SILOJNL1", "little")
HEADER_WORDS = 8


class RecordWord(enum.IntEnum):
    """Words of a record's header. `checksum` is the CRC-32 of run id, header (with 0 in its place) and payload."""

    MAGIC = 0
    KIND = 1
    RING = 2
    FIRST = 3  # first row, or the ticks of a commit
    COUNT = 4
    PAYLOAD_BYTES = 5
    NUMBER = 6  # of the record, counted through all files of its stream
    CHECKSUM = 7


class RecordKind(enum.IntEnum):
    """What a record is."""

    ROWS = 1
    COMMIT = 2


class Commit(msgspec.Struct, frozen=True):
    """All rows up to `ticks` stand before it: `heads` of each ring, and what was lost, failed and let go of until then.

    `ended`: the run had stopped, no tick follows.
    """

    ticks: int
    heads: tuple[int, ...]
    lost: tuple[int, ...]
    whys: tuple[int, ...]
    failures: dict[str, Failures]
    saved_ticks: int = 0
    ended: bool = False
    unheld: dict[str, int] = {}
    cut_texts: dict[str, int] = {}


class Head(msgspec.Struct, frozen=True):
    """The schema file: of which segment the rows are, and what they hold."""

    segment: str
    schema: SegmentSchema


def free_name(folder: Path, schema: SegmentSchema) -> Path:
    """A name for a journal of this run that nothing has yet."""
    stem = f".{schema.logger}.{schema.logger_id}-{schema.run}"
    names = (folder / f"{stem}.{number}{JOURNAL_SUFFIX}" for number in itertools.count())
    return next(name for name in names if not name.exists())


def list_journals(
    folder: str | os.PathLike[str], logger: str = "*", logger_id: str = "*", run: str = "*"
) -> list[Path]:
    """The journals in a log folder: all, or those of a logger, or of one of its runs."""
    return sorted(Path(folder).glob(f".{logger}.{logger_id}-{run}.*{JOURNAL_SUFFIX}"))


def journals_of(schema: SegmentSchema, folder: str | os.PathLike[str] = "") -> list[Path]:
    """The journals of a run, in its log folder if no other is given."""
    return list_journals(folder or schema.folder, schema.logger, schema.logger_id, schema.run) if schema.run else []


def remove_journal(path: Path) -> None:
    """Delete a journal whose data is in a file, or no longer wanted; at once for all who look. It stays if it must."""
    gone = path.with_name(f"{path.name}{GONE_SUFFIX}")
    with contextlib.suppress(OSError):  # another process was quicker, or the folder can't be written
        path.rename(gone)
    shutil.rmtree(gone, ignore_errors=True)


def remove_journals(schema: SegmentSchema, but: Path | None = None) -> None:
    """Delete the journals of a run whose data is in a file, or no longer wanted."""
    for path in journals_of(schema):
        if path != but:
            remove_journal(path)


def is_written(path: Path) -> bool:
    """Whether a process writes this journal right now."""
    with contextlib.suppress(OSError), closing_file(open_own(path / SCHEMA_FILE, os.O_RDONLY)) as descriptor:
        return has_writer(descriptor)
    return False


def seed_of(run: str) -> int:
    """Where the checksums of a run begin: a record of another run is none of this one."""
    return zlib.crc32(run.encode())


def checksum(seed: int, header: NDArray[np.int64], payload: bytes | memoryview) -> int:
    """The checksum of a record; the header's own word for it counts as 0."""
    return zlib.crc32(payload, bare_checksum(seed, header))


def bare_checksum(seed: int, header: NDArray[np.int64]) -> int:
    """The checksum of a record up to its payload."""
    bare = header.copy()
    bare[RecordWord.CHECKSUM] = 0
    return zlib.crc32(bare.tobytes(), seed)


def loop_file(generation: int) -> str:
    """The name of a file of looping rings."""
    return f"loop-{generation:06}.rows"

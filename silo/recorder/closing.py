"""Closing parts that their recorders left when they were killed: index and summary are made from what is whole.

A part that is written is locked by its writer, in whatever process or container that is, and stays.
"""

import contextlib
import fcntl
import mmap
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import msgspec
import zstandard
from mcap.exceptions import McapError

from silo.errors import FileFormatError, SaveError
from silo.files.atomic import reason, sweep_parts
from silo.files.manifest import ClosedPart
from silo.files.mcap_write import McapFile, file_start
from silo.files.part_facts import PART_ENDING, TOTALS_METADATA
from silo.files.part_scan import PartScan, scan_part


def left_parts(folder: Path) -> list[Path]:
    """Return the parts in a folder whose recorders are gone."""
    return [path for path in sorted(folder.glob(f"*{PART_ENDING}")) if not _is_written(path)]


def _is_written(path: Path) -> bool:
    try:
        with claimed(path):
            return False
    except (OSError, SaveError):
        return True


@contextmanager
def claimed(path: Path) -> Iterator[BinaryIO]:
    """The open file, locked. Raises BlockingIOError if a recorder writes it, or another process closes it; OSError."""
    descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
    with os.fdopen(descriptor, "r+b", buffering=0) as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if not os.path.samestat(os.fstat(file.fileno()), path.lstat()):
            raise FileNotFoundError(path)
        yield file


def close_parts(folder: Path) -> tuple[list[ClosedPart], list[str]]:
    """Close what killed recorders left in a folder; returns what was closed, and in words what could not be."""
    closed: list[ClosedPart] = []
    problems: list[str] = []
    with contextlib.suppress(OSError):
        sweep_parts(folder)  # of a ledger that was being written when its recorder was killed
    for path in left_parts(folder):
        _close_one(path, closed, problems)
    return closed, problems


def _close_one(path: Path, closed: list[ClosedPart], problems: list[str]) -> None:
    try:
        closed.append(close_part(path))
    except (FileNotFoundError, BlockingIOError):
        return  # another process closes it just now
    except (FileFormatError, SaveError) as error:
        problems.append(str(error))
    except OSError as error:
        problems.append(f"{path}: can't be closed: {reason(error)}; it stays as it is")


def close_part(path: Path) -> ClosedPart:
    """Close a part: cut it behind its last whole chunk, add index and summary, sync it, give it its name.

    Raises FileFormatError for what is no part of ours, OSError for what can't be written or is being written.
    """
    final = path.with_name(path.name.removesuffix(".part"))
    with claimed(path) as file:
        scan = _scanned(file, path)
        facts = scan.facts
        samples = facts.samples(scan.counts) if facts is not None else 0
        run, recorder = (facts.run, facts.recorder) if facts is not None else ("", "")
        if not any(scan.counts.values()):
            path.unlink()
            return ClosedPart(path, 0, 0, run, recorder, scan.next_rows)
        if final.exists():
            raise SaveError(f"{path}: can't get its name, as there is a {final.name}: rename that one and try again")
        if not scan.finished:
            mcap = McapFile.continued(file, scan.begun)
            mcap.add_metadata(TOTALS_METADATA, {"samples": str(samples), "closed": "later, its recorder was killed"})
            mcap.finish(scan.counts, scan.start_ns, scan.end_ns)
        os.fsync(file.fileno())
        path.rename(final)
        sync_folder(final.parent)
        found = os.fstat(file.fileno())
        return ClosedPart(final, found.st_size, samples, run, recorder, scan.next_rows, found.st_ino, rows_of(scan))


def finished_part(path: Path) -> ClosedPart | None:
    """Return what a part holds that somebody else closed; None where it can't be told."""
    try:
        with path.open("rb", buffering=0) as file:
            scan = _scanned(file, path)
            found = os.fstat(file.fileno())
    except (OSError, FileFormatError):
        return None
    facts = scan.facts
    if facts is None:
        return None
    samples = facts.samples(scan.counts)
    return ClosedPart(
        path, found.st_size, samples, facts.run, facts.recorder, scan.next_rows, found.st_ino, rows_of(scan)
    )


def rows_of(scan: PartScan) -> dict[int, int]:
    """How many rows of each ring a part has."""
    rings = scan.facts.value_rings if scan.facts is not None else []
    return {ring.ring: scan.counts.get(ring.channels[0], 0) for ring in rings if ring.channels}


def _scanned(file: BinaryIO, path: Path) -> PartScan:
    if os.fstat(file.fileno()).st_size == 0:
        return PartScan()
    data = memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))  # the map ends with its last view
    begin = file_start()
    if len(data) <= len(begin) and begin.startswith(data):
        return PartScan()
    try:
        scan = scan_part(data)
    except FileFormatError as error:
        raise FileFormatError(f"{path}: can't be closed: {error}; it stays as it is") from None
    except (struct.error, ValueError, IndexError, OverflowError, MemoryError) as error:
        raise FileFormatError(f"{path}: can't be closed, it is damaged: {error}; it stays as it is") from None
    except (zstandard.ZstdError, msgspec.MsgspecError, McapError) as error:
        raise FileFormatError(f"{path}: can't be closed, it is damaged: {error}; it stays as it is") from None
    if scan.facts is None and scan.begun.size != len(begin):
        raise FileFormatError(f"{path}: was not written by a recorder of silo; it stays as it is")
    return scan


def sync_folder(folder: Path) -> None:
    """Make the names in a folder durable; some network file systems refuse that."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        with contextlib.suppress(OSError):
            os.fsync(descriptor)
    finally:
        os.close(descriptor)

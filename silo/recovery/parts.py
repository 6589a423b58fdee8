"""Parts of endless recordings that their recorders left open when they were killed.

A part is closed from what of it is whole: index and summary are made anew. One that is written is locked by its writer,
in whatever process or container that is, and stays. The next recorder of that name goes on at once, with the rows after
those that the part holds: that is told at a glance. The part is closed beside, when it has caught up: one of a gigabyte
takes many seconds, in which a short ring would be overwritten.
"""

import contextlib
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from silo.core.runtime import sync
from silo.errors import FileFormatError, SaveError, reason
from silo.files.atomic import sweep_parts
from silo.files.manifest import ClosedPart, Ledger, number_of
from silo.files.mcap.chunks import mapped
from silo.files.mcap.damage import DAMAGE
from silo.files.mcap.writer import McapWriter, file_start
from silo.files.parts.metadata import EVENTS_RING, PART_ENDING, TOTALS_METADATA, PartFacts
from silo.files.parts.scan import PartScan, rows_after, scan_part
from silo.recovery.left import BusyError, claimed_file

OTHERS_S = 10.0  # how long another process may take to close what a predecessor left


def left_parts(folder: Path) -> list[Path]:
    """Return the parts in a folder whose recorders are gone."""
    return [path for path in sorted(folder.glob(f"*{PART_ENDING}")) if not _is_written(path)]


def _is_written(path: Path) -> bool:
    try:
        with claimed_part(path):
            return False
    except (OSError, BusyError):
        return True


@contextmanager
def claimed_part(path: Path) -> Iterator[BinaryIO]:
    """The open file, held. Raises BusyError if a recorder writes it, or another process closes it; OSError."""
    with claimed_file(path, os.O_RDWR) as descriptor, os.fdopen(descriptor, "r+b", buffering=0, closefd=False) as file:
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
    except (FileNotFoundError, BusyError):
        return  # another process closes it just now
    except (FileFormatError, SaveError) as error:
        problems.append(str(error))
    except OSError as error:
        problems.append(f"{path}: can't be closed: {reason(error)}; it stays as it is")


def close_part(path: Path) -> ClosedPart:
    """Close a part: cut it behind its last whole chunk, add index and summary, sync it, give it its name.

    Raises FileFormatError for what is no part of ours, BusyError for what is being written, OSError.
    """
    final = path.with_name(path.name.removesuffix(".part"))
    with claimed_part(path) as file:
        scan = _scanned(file, path)
        if not any(scan.counts.values()):
            path.unlink()
            return _closed(path, scan)
        if final.exists():
            raise SaveError(f"{path}: can't get its name, as there is a {final.name}: rename that one and try again")
        if not scan.finished:
            mcap = McapWriter.continued(file, scan.begun)
            samples = str(scan.facts.samples(scan.counts)) if scan.facts is not None else "0"
            mcap.add_metadata(TOTALS_METADATA, {"samples": samples, "closed": "later, its recorder was killed"})
            mcap.finish(scan.counts, scan.start_ns, scan.end_ns)
        os.fsync(file.fileno())
        path.rename(final)
        with contextlib.suppress(OSError):  # some network file systems refuse that
            sync(final.parent)
        return _closed(final, scan, os.fstat(file.fileno()))


def finished_part(path: Path) -> ClosedPart | None:
    """Return what a part holds that somebody else closed; None where it can't be told."""
    try:
        with path.open("rb", buffering=0) as file:
            scan = _scanned(file, path)
            return None if scan.facts is None else _closed(path, scan, os.fstat(file.fileno()))
    except (OSError, FileFormatError):
        return None


def _closed(path: Path, scan: PartScan, found: os.stat_result | None = None) -> ClosedPart:
    """What a part holds; without a file it held nothing, and is removed."""
    run, recorder = (scan.facts.run, scan.facts.recorder) if scan.facts is not None else ("", "")
    if found is None:
        return ClosedPart(path, 0, 0, run, recorder, scan.next_rows)
    samples = scan.facts.samples(scan.counts) if scan.facts is not None else 0
    return ClosedPart(path, found.st_size, samples, run, recorder, scan.next_rows, found.st_ino, rows_of(scan))


def rows_of(scan: PartScan) -> dict[int, int]:
    """How many rows of each ring a part has."""
    rings = scan.facts.value_rings if scan.facts is not None else []
    return {ring.ring: scan.counts.get(ring.channels[0], 0) for ring in rings if ring.channels}


def _scanned(file: BinaryIO, path: Path) -> PartScan:
    try:
        scan = scan_part(mapped(file))
    except FileFormatError as error:
        raise FileFormatError(f"{path}: can't be closed: {error}; it stays as it is") from None
    except (*DAMAGE, MemoryError) as error:
        raise FileFormatError(f"{path}: can't be closed, it is damaged: {error}; it stays as it is") from None
    if scan.facts is None and scan.begun.size not in (0, len(file_start())):
        raise FileFormatError(f"{path}: was not written by a recorder of silo; it stays as it is")
    return scan


# -------------------------------------------------------------------------------------------- going on after one


def left_rows(ledger: Ledger) -> tuple[str, dict[int, int]]:
    """Return with which rows of which run to go on, told at a glance."""
    until_s = time.monotonic() + OTHERS_S
    for path in sorted(ledger.open_parts(), key=number_of, reverse=True):
        while (found := _glance(path)) is None and time.monotonic() < until_s:
            time.sleep(0.02)  # another process closes it just now
        if found and found[0].recorder == ledger.name:
            return found[0].run, found[1]
    written = ledger.written
    if written.runs and written.entry(written.run) is None:  # its order is over
        return "", {}
    return written.run, dict(written.next_rows)


def _glance(path: Path) -> "tuple[PartFacts, dict[int, int]] | tuple[()] | None":
    """What a part says of itself, and its rows; nothing of one that can't be read, None of one that is in use."""
    final = path.with_name(path.name.removesuffix(".part"))
    try:
        # claimed, as who closes it cuts it: to read beyond its end would end this process
        with claimed_part(path if path.exists() else final) as file:
            return rows_after(mapped(file)) or ()
    except BusyError:
        return None
    except FileNotFoundError:
        return None if final.exists() else ()  # it got its name just now
    except (OSError, FileFormatError, *DAMAGE, MemoryError):
        return ()


def fewer_rows(closed: list[ClosedPart], recorder: str, run: str, rows: dict[int, int]) -> int:
    """Return how many rows the newest part of a recorder lacks of those after which another one went on: damage."""
    ours = [part for part in closed if part.recorder == recorder and part.run == run and part.size_bytes]
    if not ours:
        return 0
    newest = max(ours, key=lambda part: number_of(part.path))
    return sum(max(0, row - newest.next_rows.get(ring, row)) for ring, row in rows.items() if ring != EVENTS_RING)

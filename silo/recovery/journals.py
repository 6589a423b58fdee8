"""Journals that helper processes left behind (`storage="disk"`): what they prove, and which of them nobody needs.

A journal is recovered where its segment is gone, as after a power cut: a segment that is still there holds at least as
much, and its recovery removes the journal. That of a living logger is never touched: its helper process holds a lock on
it, and while there is none its segment or its process is alive.
"""

import contextlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from silo.core.runtime import (
    boot_id,
    closing_file,
    has_writer,
    is_at,
    lock_as_writer,
    open_own,
    pid_namespace,
    process_start,
)
from silo.errors import SegmentError, StateError, reason
from silo.journal.format import (
    GONE_SUFFIX,
    JOURNAL_SUFFIX,
    ROWS,
    SCHEMA_FILE,
    Head,
    is_written,
    journals_of,
    list_journals,
    remove_journal,
)
from silo.journal.holdings import segment_holdings
from silo.journal.reader import JournalReader, read_head
from silo.recovery.left import LeftRun, SavedMeanwhileError, claimed_file
from silo.segment.reader import SegmentReader


def is_journal(path: str | os.PathLike[str]) -> bool:
    """Whether a path is that of a journal: a folder with its schema file."""
    return (Path(path) / SCHEMA_FILE).is_file()


def left_journals(folder: str | os.PathLike[str], logger: str = "*") -> list[LeftRun]:
    """Journals in a log folder whose logger and segment are gone, of each run the one that proves most.

    Of one `logger`, by their names, or of all. A damaged one is told as such.
    """
    found: dict[str, LeftRun] = {}
    for path in list_journals(folder, logger):
        left = _look(path)
        if left is not None:
            run = left.schema.run if left.schema else str(path)
            if run not in found or found[run].ticks < left.ticks:
                found[run] = left
    return list(found.values())


def _look(path: Path) -> LeftRun | None:
    if is_written(path):
        return None
    try:
        head = read_head(path)
        if in_use(head):
            return None
        with contextlib.closing(JournalReader(path)) as reader:
            schema = reader.schema
            reason = f"process {schema.pid} of user {schema.user} and its memory are gone; {reader.proven_text}"
            return LeftRun(path, schema, segment_holdings(reader), reason)
    except SegmentError as error:
        if not _has_rows(path):
            return None  # saved and removed by another process just now, or swept by the next sweep
        text = str(error).removeprefix(f"{path}: ")
        return LeftRun(path, None, None, f"{text}; it stays; to free its room: rm -r {path}")


def in_use(head: Head) -> bool:
    """Whether the logger of a journal lives, or has left its segment, which holds as much and is saved instead."""
    schema = head.schema
    with contextlib.suppress(SegmentError), contextlib.closing(SegmentReader(head.segment)) as reader:
        if reader.schema.run == schema.run:
            return True
    # its files may have been deleted under it
    here = schema.boot_id == boot_id() and schema.pid_namespace in (0, pid_namespace())
    return here and process_start(schema.pid) == schema.pid_start


def orphaned_journals(folder: str | os.PathLike[str]) -> list[Path]:
    """Journals in a log folder whose logger and segment are gone; of each run the first. Their rows are not read."""
    found: dict[str, Path] = {}
    for path in list_journals(folder):
        with contextlib.suppress(SegmentError):
            head = read_head(path)
            if not is_written(path) and not in_use(head):
                found.setdefault(head.schema.run, path)
    return list(found.values())


def sweep_journals(folder: str | os.PathLike[str]) -> list[Path]:
    """Remove journals of dead processes in which no tick is durable yet, as no row was ever written; cheap.

    Returns what was removed.
    """
    for rest in Path(folder).glob(f".*{JOURNAL_SUFFIX}{GONE_SUFFIX}"):
        shutil.rmtree(rest, ignore_errors=True)
    return [path for path in list_journals(folder) if _removed_if_empty(path)]


def _has_rows(path: Path) -> bool:
    """Whether anything was ever written behind the description."""
    with contextlib.suppress(FileNotFoundError):
        return any(file.stat().st_size for file in path.glob(ROWS))
    return False


def _removed_if_empty(path: Path) -> bool:
    with contextlib.suppress(OSError):
        if _has_rows(path):
            return False
        try:
            descriptor = open_own(path / SCHEMA_FILE, os.O_RDWR)
        except FileNotFoundError:
            path.rmdir()
            return True
        with closing_file(descriptor):
            if has_writer(descriptor) or not lock_as_writer(descriptor) or not is_at(descriptor, path / SCHEMA_FILE):
                return False
            with contextlib.suppress(SegmentError):
                if in_use(read_head(path)):
                    return False
            remove_journal(path)
            return True
    return False


@contextlib.contextmanager
def claimed_journal(path: Path, *, wait: bool = False) -> Iterator[JournalReader]:
    """Hold a journal for one who saves and removes it; read while it is held.

    Raises StateError while its logger lives or its segment is there, BusyError while another process holds it (unless
    it may `wait`), SavedMeanwhileError if another has saved it, SegmentError for one that is damaged.
    """
    with contextlib.ExitStack() as held:
        try:
            descriptor = held.enter_context(claimed_file(path / SCHEMA_FILE, wait=wait, of=path))
        except FileNotFoundError:
            raise SavedMeanwhileError(f"{path}: another process saved it meanwhile (look in {path.parent})") from None
        except OSError as error:
            raise SegmentError(f"{path}: can't open the journal ({reason(error)})") from error
        head = read_head(path)
        if has_writer(descriptor) or in_use(head):
            raise StateError(
                f"{path}: process {head.schema.pid} still logs, or left its memory, which holds more: "
                f"{head.segment}; nothing was changed"
            )
        yield held.enter_context(contextlib.closing(JournalReader(path)))


def remove_proven(reader: JournalReader) -> None:
    """Delete a journal whose data is in a file, and others of its run that prove no more."""
    for path in journals_of(reader.schema, reader.path.parent):
        with contextlib.suppress(SegmentError):
            if path != reader.path:
                with contextlib.closing(JournalReader(path)) as other:
                    if other.ticks > reader.ticks:
                        continue
        remove_journal(path)
    remove_journal(reader.path)  # whatever somebody renamed it to

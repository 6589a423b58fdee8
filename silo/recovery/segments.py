"""Segments that dead programs left in memory, and the rests of segments that they were making.

Looked for at the first start of a logger, by its helper, by `silo ls` and by `silo recover`. Removed without a question
is only what surely belongs to a dead process and holds nothing that isn't in a file.
"""

import contextlib
import logging
import os
from collections.abc import Iterator
from pathlib import Path

from silo.core.elements import LoggerOptions, Storage
from silo.core.runtime import closing_file, is_at, list_segments, runtime_dir, sweep_unfinished
from silo.errors import SegmentError, StateError, reason
from silo.journal.format import remove_journals
from silo.journal.holdings import segment_holdings
from silo.recovery.left import LeftRun, SavedMeanwhileError, has_unsaved, locked, log_end
from silo.segment.held_runs import hold, in_order, is_due, remove
from silo.segment.layout import ControlWord, SegmentSchema
from silo.segment.reader import SegmentReader

log = logging.getLogger("silo")


def left_segments(folder: Path | None = None, logger: str = "") -> list[LeftRun]:
    """Segments of processes that ended without saving: in the runtime folder, and in `folder` (`storage="file"`).

    Of one `logger`, by their names, or of all. A damaged one is told as such and keeps none of the others.
    """
    paths = [path for path in list_segments(folder) if not logger or path.name.lstrip(".").startswith(f"{logger}.")]
    return [one for path in in_order(paths) if (one := _look(path)) is not None]


def _look(path: Path) -> LeftRun | None:
    try:
        reader = SegmentReader(path)
    except SegmentError as error:
        return _unreadable(path, None, error)
    try:
        schema = reader.schema
        if reader.alive():
            return None
        unsaved = max(0, reader.ticks - reader.saved_ticks)
        reason = f"process {schema.pid} of user {schema.user} ended without close(); {unsaved} ticks are in no file"
        return LeftRun(path, schema, segment_holdings(reader), reason)
    except SegmentError as error:
        return _unreadable(path, reader.schema, error)
    finally:
        reader.close()


def _unreadable(path: Path, schema: SegmentSchema | None, error: SegmentError) -> LeftRun | None:
    if not path.exists():
        return None  # saved and removed by another process just now
    text = str(error).removeprefix(f"{path}: ")
    if "update silo" not in text:
        text += f"; it stays, and keeps no other from being saved; to free its memory: rm {path}"
    return LeftRun(path, schema, None, text)


def segment_folder(options: LoggerOptions) -> Path | None:
    """Where a logger keeps its segments other than in the runtime folder."""
    return Path(options.folder) if options.storage is Storage.FILE else None


def sweep_segments(folder: Path | None = None) -> list[Path]:
    """Remove what dead processes left and nobody can want: unfinished segments, and those without an unsaved tick.

    In the runtime folder, and in `folder`. Returns what was removed.
    """
    removed = sweep_unfinished(runtime_dir()) + (sweep_unfinished(folder) if folder is not None else [])
    return removed + [path for path in list_segments(folder) if _remove_if_worthless(path)]


def _remove_if_worthless(path: Path) -> bool:
    with contextlib.suppress(SegmentError, StateError, OSError), contextlib.closing(SegmentReader(path)) as reader:
        # what somebody still has to read stays for the next helper process, or `silo recover`
        if not reader.alive() and not has_unsaved(reader) and not is_due(reader.schema):
            with claimed(reader):
                log_end(reader)
                discard(reader)
                return True
    return False


def discard(reader: SegmentReader) -> None:
    """Delete a segment whose data is in a file, or that holds none, and its journals; these first.

    It is held instead where a recorder, or the judge, is not done with it; where that fails it stays for the next.
    """
    remove_journals(reader.schema)
    if not is_due(reader.schema):
        remove(reader.path)
        return
    try:
        with contextlib.suppress(FileNotFoundError):  # somebody deleted it
            hold(reader.path)
    except OSError as error:
        log.warning("%s can't be held for who still has to read it (%s): it stays", reader.path, reason(error))


@contextlib.contextmanager
def claimed(reader: SegmentReader, *, wait: bool = False) -> Iterator[None]:
    """Hold a segment for one who saves or removes it.

    Raises BusyError while another does (unless it may `wait`), SavedMeanwhileError if another has. A segment that was
    deleted without being saved can be held: it is still mapped.
    """
    with locked(reader.fileno(), reader.path, wait=wait):
        if not has_unsaved(reader) and reader.ticks and not is_at(reader.fileno(), reader.path):
            where = f"look in {reader.schema.folder}"
            raise SavedMeanwhileError(f"{reader.path}: another process saved it meanwhile ({where})")
        yield


@contextlib.contextmanager
def claimed_segment(path: Path, *, wait: bool = False) -> Iterator[SegmentReader]:
    """Hold a segment of a dead writer; read while it is held.

    Raises what `claimed` does, StateError while its writer lives, SegmentError for one that is damaged, or is gone.
    """
    with contextlib.closing(SegmentReader(path)) as reader:
        if reader.alive():
            raise StateError(f"{path}: process {reader.schema.pid} is still logging into it; nothing was changed")
        with claimed(reader, wait=wait):
            yield reader


def mark_saved(reader: SegmentReader) -> None:
    """Note in the segment of a dead writer that all its ticks stand in a file, for those that have it open."""
    with closing_file(os.open(f"/proc/self/fd/{reader.fileno()}", os.O_WRONLY | os.O_CLOEXEC)) as descriptor:
        os.pwrite(descriptor, reader.ticks.to_bytes(8, "little"), reader.control_offset(ControlWord.SAVED_TICKS))


def release_segment(reader: SegmentReader) -> None:
    """Delete a segment of which all stands in files, and tell those who have it open."""
    if has_unsaved(reader):
        mark_saved(reader)
    discard(reader)

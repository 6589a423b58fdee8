"""A run that a dead program left: what is known of it, and what is done with it, be it in memory or in a journal.

Of a run whose segment is still in memory that is saved, else (after a power cut) what its journal proves. One process
at a time has it: who comes second finds it saved.
"""

import contextlib
import errno
import fcntl
import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from silo.core.conditions import Conditions
from silo.core.elements import STARTED, FileType, LoggedEvent, SavedFile
from silo.core.quantities.writing import and_more
from silo.core.runtime import closing_file, is_at, open_own
from silo.errors import StateError
from silo.journal.holdings import Holdings, published_in, recording_holdings
from silo.journal.reader import JournalReader
from silo.segment.layout import SegmentSchema
from silo.segment.reader import SegmentReader
from silo.segment.reasons import STOP_TEXTS, StopReason
from silo.segment.rows import Rows
from silo.segment.snapshot import cut_events

DIED = "program died"  # why its log was saved

RunReader = SegmentReader | JournalReader


@dataclass(frozen=True)
class LeftRun:
    """A segment, or a journal, without its writer.

    `schema` and `holdings` are None for what can't be read; `reason` says what is.
    """

    path: Path
    schema: SegmentSchema | None
    holdings: Holdings | None
    reason: str

    @property
    def ticks(self) -> int:
        """Ticks since start, 0 for what can't be read."""
        return self.holdings.ticks if self.holdings else 0


class BusyError(StateError):
    """Another process saves the run right now."""


class SavedMeanwhileError(StateError):
    """Another process saved the run, and freed its memory."""


def death_text(pid: int, stopped: str = "") -> str:
    """Return that a program died, or was ended by an error, as what `stopped` its run tells; fit to show."""
    how = "by an error, or Ctrl-C" if stopped == STOP_TEXTS[StopReason.ERROR] else "without close()"
    return f"the robot program (process {pid}) ended {how}"


def saved_text(files: list[SavedFile], held: Holdings) -> str:
    """Return what was saved of it, fit to show."""
    from silo.files.naming import files_text

    return f"saved {held.text}: {files_text(files)}"


def log_start(reader: RunReader) -> None:
    """Have the event log say that a run was started, where nobody was there to say so."""
    from silo.files.event_log import add_missing  # which a program that just starts has no use for

    schema = reader.schema
    add_missing(schema.folder, schema.logger, schema.run, [_start(reader)])


def _start(reader: RunReader) -> LoggedEvent:
    schema, stamp_ns = reader.schema, reader.stamp_of(0) if isinstance(reader, SegmentReader) else 0
    return LoggedEvent(STARTED, schema.start_text, schema.started_ns, 0, stamp_ns, schema.logger, schema.run)


def log_end(reader: RunReader, saved: str = "", log: Callable[..., object] | None = None) -> None:
    """Have the event log say what nobody came to say of a run that a dead program left, each line once.

    That it was started, what its program noted, how it ended, and what was `saved` of it by now. Whoever comes first
    says it, be it the helper process, a recorder on its own, the next start, or `silo recover`; `log` is how.
    """
    from silo.files.event_log import CRASHED, STOPPED, add_missing

    schema, noted, stopped, stamp_ns = reader.schema, [], "", 0
    if isinstance(reader, SegmentReader):
        noted = sorted([*reader.stamped_marks(), *reader.stamped_changes()], key=lambda one: one.tick)
        stopped = "" if reader.running else reader.stop_reason or "stopped"
        stamp_ns = reader.last_time_ns
    ends = {STOPPED: stopped, CRASHED: death_text(schema.pid, stopped), "recovered": saved}
    at = time.time_ns(), reader.ticks - 1, stamp_ns, schema.logger, schema.run
    ended = [LoggedEvent(kind, text, *at) for kind, text in ends.items() if text]
    lines = [_start(reader), *cut_events(schema), *noted, *ended]
    (log or add_missing)(schema.folder, schema.logger, schema.run, lines)


def has_unsaved(reader: RunReader) -> bool:
    """Whether a run holds ticks that stand in no file."""
    return reader.ticks > reader.saved_ticks


@contextlib.contextmanager
def locked(descriptor: int, path: Path, *, wait: bool = False) -> Iterator[None]:
    """Hold an open file of what is left, so that one process alone saves or removes it.

    Raises BusyError while another does (unless it may `wait`). A file without a name can be held.
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except BlockingIOError:
        raise BusyError(f"{path}: another process is saving it right now") from None
    try:
        yield
    finally:
        fcntl.flock(descriptor, fcntl.LOCK_UN)


@contextlib.contextmanager
def claimed_file(path: Path, flags: int = os.O_RDONLY, *, wait: bool = False, of: Path | None = None) -> Iterator[int]:
    """Open what is left under a name, or the file `of` it that is locked, and hold it; the descriptor of that.

    Raises BusyError while another process does (unless it may `wait`), FileNotFoundError for one that is not there, or
    lost its name to another process, OSError.
    """
    with closing_file(open_own(path, flags)) as descriptor, locked(descriptor, of or path, wait=wait):
        if not is_at(descriptor, path):
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
        yield descriptor


def save_reader(
    reader: RunReader,
    folder: str | os.PathLike[str],
    types: Sequence[FileType] = (FileType.SILO,),
    progress: Callable[[float], None] | None = None,
    events: Sequence[LoggedEvent] | None = None,
    conditions: Conditions | None = None,
) -> tuple[list[SavedFile], Holdings]:
    """Save all that is held, and tell how much that is; no file if it is nothing. Raises SaveError.

    `events` are what happened in its run; None: what the event log in the logger's folder says. `conditions` are its
    derived signals, limits and triggers as they were last; None: as they were when the run began.
    """
    from silo.files import LogOfRun, write_run

    recording = reader.snapshot()
    held = recording_holdings(recording)
    if not held.samples:
        return [], held
    schema = reader.schema
    happened = LogOfRun(schema.folder, schema.run) if events is None else events
    files = write_run(
        recording, folder, schema.logger, types, progress=progress, why=DIED, events=happened, conditions=conditions,
        damage=missing(reader),
    )  # fmt: skip
    return files, replace(held, published=published_in(schema))  # which the file, and it, know nothing of


def missing(reader: RunReader) -> tuple[str, ...]:
    """What is damaged, or lost, in what a dead process left; fit to show."""
    return damage(reader) if isinstance(reader, SegmentReader) else (reader.proven_text,)


BLOCK_BYTES = 4 << 20


def damage(reader: SegmentReader) -> tuple[str, ...]:
    """A line for each ring of a dead writer's segment that holds rows of another tick than theirs; fit to show.

    Each row begins with its tick, which is known. Pages that a file system lost read as zeros and would be taken for
    values. What a page lost in the midst of a row that is wider than it can't be seen.
    """
    return tuple(text for ring in range(len(reader.schema.rings)) if (text := _damage(reader, ring)))


def _damage(reader: SegmentReader, ring: int) -> str:
    divider = reader.schema.rings[ring].divider
    wrong, first, last, count = 0, -1, -1, 0
    for rows in _blocks(reader, ring):
        numbers = np.arange(rows.first, rows.first + len(rows))
        differing = numbers[rows.ticks != numbers * divider]
        if len(differing):
            first = int(differing[0]) * divider if first < 0 else first
            last = int(differing[-1]) * divider
        wrong += len(differing)
        count += len(rows)
    if not wrong:
        return ""
    names = [element.info.name for element in reader.schema.elements if element.ring == ring]
    what = and_more(names, 3) if ring else "the time stamps"
    return (
        f"{wrong} of {count} rows of {what} are damaged, the first at tick {first}, the last at {last}: "
        "what stands there in the file is not what was logged"
    )


def _blocks(reader: SegmentReader, ring: int) -> Iterator[Rows]:
    limit = max(1, BLOCK_BYTES // (8 * reader.schema.rings[ring].row_words))
    since = 0
    while len(rows := reader.rows(ring, since, limit)):
        yield rows
        since = rows.first + len(rows)

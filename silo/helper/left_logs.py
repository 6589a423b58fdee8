"""Saving what a robot process left behind, by the next helper process of that logger or by `silo recover`.

First what reads the runs: endless recordings are completed, and what triggers captured is written. Then the runs.
"""

import contextlib
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from silo.core.elements import FileType, LoggedEvent, SavedFile
from silo.core.runtime import HELD_SUFFIX, JUDGE_SUFFIX, runtime_dir
from silo.errors import SegmentError, SiloError
from silo.files.event_log import CRASHED, add_missing, read_events
from silo.files.naming import is_capture
from silo.journal.holdings import Holdings
from silo.journal.reader import JournalReader
from silo.recorder.left_recordings import complete_recordings, told
from silo.recorder.process import RecorderHandover
from silo.recordings.folder import RecordingFolder
from silo.recordings.requests import SavedRecording
from silo.recovery.left import DIED, has_unsaved, log_end, missing, save_reader, saved_text
from silo.recovery.runs import claimed_run, let_go
from silo.rpc.published import EventKind
from silo.segment.held_runs import held_runs, is_due, is_live, judge_path, program_of, remove
from silo.segment.reader import SegmentReader

if TYPE_CHECKING:
    # 1.4 MB that a helper without triggers doesn't need
    from silo.conditions.left_captures import RecoveredCaptures
    from silo.conditions.segment_judge import SegmentJudge

MOST_LOOKED_AT = 100  # of the newest logs in a folder

Tell = Callable[[EventKind, str, list[SavedFile]], object]
Save = Callable[..., tuple[list[SavedFile], Holdings]]
Log = Callable[[str, str, str, Sequence[LoggedEvent]], object]


@dataclass(frozen=True)
class Recovered:
    """What became of a segment or journal: the files, and in words what was saved, and `more`.

    `judge` judged it to its end, for the one that goes on it.
    """

    files: list[SavedFile]
    saved: str
    more: tuple[str, ...] = ()
    judge: "SegmentJudge | None" = None

    @property
    def text(self) -> str:
        """All of it, fit to show."""
        return "; ".join([self.saved, *self.more])


def recover(
    path: str | os.PathLike[str],
    folder: str | os.PathLike[str] | None = None,
    types: Sequence[FileType] = (FileType.SILO,),
    *,
    save: Save = save_reader,
    log: Log = add_missing,
    wait: bool = True,
    before: Recovered | None = None,
) -> Recovered:
    """Save a segment or a journal whose writer is gone, in `folder` or its logger's own, then delete it.

    Triggers and limits of one that goes on what was recovered `before` are judged on. Waits while another process saves
    it. `save` is how it is saved, `log` how its event log says so. Raises SegmentError for what isn't one, or is
    damaged, SavedMeanwhileError if another process saved it, StateError while its own process lives, or if it may not
    `wait`, SaveError if it can't be saved (it stays).
    """
    with claimed_run(Path(path), wait=wait) as reader:
        is_journal = isinstance(reader, JournalReader)
        where = str(folder or (reader.path.parent if is_journal else reader.schema.folder))
        known = before.judge if before else None
        captures = None if isinstance(reader, JournalReader) else _captures(reader, where, known)
        judge = captures.judge if captures else None
        texts, captured = (captures.texts, captures.files) if captures else ([], [])
        log_end(reader, log=log)
        if reader.ticks and not has_unsaved(reader):
            let_go(reader)
            freed = "journal was removed" if is_journal else "memory was freed"
            saved = f"all its {reader.ticks} ticks were saved before its process ended; its {freed}"
            return Recovered(captured, saved, tuple(texts), judge)
        conditions = captures.conditions if captures else None
        files, held = save(reader, where, types, conditions=conditions)
        if files:
            log_end(reader, saved_text(files, held), log)
        let_go(reader)
        if files:
            return Recovered([*files, *captured], f"saved {held.text}", (*missing(reader), *texts), judge)
        if is_journal:
            nothing = f"held {held.text}; removed" if held.ticks else "proves no tick; removed"
        else:
            nothing = f"held {held.text if held.ticks else 'no tick'}; its memory was freed"
        return Recovered(captured, nothing, tuple(texts), judge)


def _captures(reader: SegmentReader, folder: str, before: "SegmentJudge | None") -> "RecoveredCaptures | None":
    """Write what triggers captured of a run; None where nobody was to look."""
    schema = reader.schema
    if not (schema.conditions.judged or judge_path(schema.logger, schema.run).exists()):
        return None
    from silo.conditions.left_captures import recover_captures

    return recover_captures(reader, folder, before)


def saved_before(folder: Path) -> list[SavedRecording]:
    """Return the newest log of each logger in a folder whose program died: it was saved already, nothing is lost.

    By the helper process, by an earlier `silo recover`, or by the program itself before it died.
    """
    newest: dict[str, SavedRecording] = {}
    with contextlib.suppress(SiloError):  # it can't be read, or isn't there
        for row in RecordingFolder().listing(str(folder), "", MOST_LOOKED_AT).recordings:
            if row.logger and row.files and not is_capture(Path(row.files[0].name)):
                newest.setdefault(row.logger, row)
    return [row for row in newest.values() if row.why.startswith(DIED) or _is_of_dead(folder, row)]


def _is_of_dead(folder: Path, row: SavedRecording) -> bool:
    """Whether the event log has the run of which a log is told end by its program's death."""
    events: list[LoggedEvent] = []
    with contextlib.suppress(OSError):
        events = read_events(folder, row.logger)
    runs = {event.run for event in events if any(file.name in event.text for file in row.files)}
    return any(event.kind == CRASHED and event.run in runs for event in events)


def settle_left(
    tell: Tell,
    wanted: Callable[[str, str], bool],
    home: str = "",
    recordings: Callable[[RecorderHandover], bool] = lambda _: True,
) -> list[str]:
    """Have what reads runs of dead programs come to its end: endless recordings, and what triggers captured.

    Before the runs are saved, and deleted. What was held for that goes. `wanted` chooses by name and folder of a logger
    whose captures those are, `recordings` by recording; `home` is the folder where none is known. Returns in words what
    could not be done: it stays for the next time.
    """
    try:
        problems = complete_recordings(lambda *what: tell(EventKind.RECOVERED, told(*what), []), recordings)
    except (OSError, SiloError) as error:  # captures wait for nobody's recording
        problems = [f"recordings of dead programs are not completed now: {error}"]
    with contextlib.suppress(SegmentError, OSError):  # no runtime folder: then there is nothing in it either
        # nearly always there is none
        if any(name.endswith((JUDGE_SUFFIX, HELD_SUFFIX)) for name in os.listdir(runtime_dir())):  # noqa: PTH208
            from silo.conditions.left_captures import recover_left

            recover_left(tell, wanted, home)
    release_left()
    return problems


def release_left() -> None:
    """Delete runs that are held of loggers that are gone, and that nobody needs any more."""
    live: dict[str, bool] = {}
    for reader in held_runs():
        with contextlib.closing(reader):
            schema = reader.schema
            if is_due(schema) or _is_unjudged(reader):
                continue
            if schema.logger_id not in live:
                live[schema.logger_id] = is_live(program_of(schema))
            if not live[schema.logger_id]:
                remove(reader.path)


def _is_unjudged(reader: SegmentReader) -> bool:
    """Whether a run has something to judge, and no helper process ever saw it."""
    if not reader.schema.conditions.judged:
        return False
    from silo.conditions.left_captures import unseen

    try:
        return unseen(reader) is not None
    except OSError:
        return True  # nobody can tell now

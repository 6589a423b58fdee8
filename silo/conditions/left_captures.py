"""Captures of a program that died together with its helper process: judged to the end, cut out of its rings, written.

What the judge knew stands in a file of the runtime folder, the rows in the segment. By `silo recover`, or by the next
helper process of that logger, whoever claims the segment.
"""

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from silo.conditions import state_file
from silo.conditions.captures.files import write_capture
from silo.conditions.memory import lost_news, runs_there, untold
from silo.conditions.segment_judge import SegmentJudge
from silo.conditions.state_file import JudgeState, Untold
from silo.core.conditions import Conditions
from silo.core.elements import LoggedEvent, SavedFile
from silo.core.quantities.writing import and_more
from silo.core.runtime import HELD_SUFFIX, JUDGE_SUFFIX
from silo.errors import SegmentError, SiloError, StateError
from silo.files.event_log import add_missing, read_events
from silo.files.manifest import CaptureList
from silo.recovery.left import log_start
from silo.recovery.segments import claimed
from silo.rpc.published import EventKind
from silo.segment.held_runs import held_runs, is_due, is_live, judge_path, program_of, remove
from silo.segment.reader import SegmentReader

WHY = "the program and its helper process died"
MOST_NAMED = 3  # captures in what is told at once: the event log has each
_OF_RECORDINGS = {kind.value for kind in (EventKind.STARTED, EventKind.RECORDING, EventKind.RECORDING_FAILED)}
GONE = "program and helper process died before it was written, and its memory is gone"

Tell = Callable[[EventKind, str, list[SavedFile]], object]


@dataclass
class RecoveredCaptures:
    """Captures that were written, and in words what became of each, and of what could not be.

    `conditions` are limits, triggers and derived signals as the judge knew them last, None where there was none;
    `is_whole`: all that there was is written; `judge` judged it to its end, None where nobody had to.
    """

    files: list[SavedFile]
    texts: list[str]
    conditions: Conditions | None = None
    is_whole: bool = True
    judge: SegmentJudge | None = None


def recover_captures(reader: SegmentReader, folder: str, before: SegmentJudge | None = None) -> RecoveredCaptures:
    """Write the captures that a judge left of a segment whose writer is gone, and forget what it left.

    Of one that nobody judged, and that goes on the one that `before` judged, what held there holds here.

    What it left stays where a capture can't be written: another folder may take it; of a run that no helper process
    saw it is begun, so that the run is held for who tries again. The segment is claimed. What is found is told in the
    event log of its logger, too.
    """
    found = _judged_to_its_end(reader, folder, before)
    if not found.is_whole:
        state_file.note_begun(reader.schema)
    return found


def _judged_to_its_end(reader: SegmentReader, folder: str, before: SegmentJudge | None) -> RecoveredCaptures:
    schema = reader.schema
    found = RecoveredCaptures([], [])
    try:
        path = judge_path(schema.logger, schema.run)
        state = _known(reader, path)
    except OSError:
        found.is_whole = False  # it can't be read now
        return found
    except SegmentError as error:
        if not is_live(program_of(schema)):  # nobody will read it: it would keep the run for ever
            found.texts.append(f"what triggers captured of it is lost: {error}")
            path.unlink(missing_ok=True)
        return found
    if state is None or not state.is_orphan:
        return found
    found.conditions = state.conditions
    try:
        _log(schema.folder, schema.logger, schema.run, _recovered(reader, state, folder, found, before))
    except (SiloError, OSError) as error:  # the run is saved nevertheless
        found.texts.append(f"what triggers captured of it stays for the next `silo recover`: {error}")
        found.is_whole = False
        return found
    if found.is_whole:
        path.unlink(missing_ok=True)
    return found


def _known(reader: SegmentReader, path: Path) -> JudgeState | None:
    if not path.exists():
        return unseen(reader)
    return state_file.begun_state(reader.schema) if state_file.is_note(path) else state_file.read_state(path)


def unseen(reader: SegmentReader) -> JudgeState | None:
    """Return what is known of a run that no helper process ever saw, and has something to judge; None for any other.

    One that was seen was judged to its end, where nothing is left of that. That it was started, or recorded, is told by
    who completes recordings, too.
    """
    schema = reader.schema
    if not schema.conditions.judged or not _was_served(reader):
        return None
    seen = {event.kind for event in read_events(schema.folder, schema.logger, schema.run)} - _OF_RECORDINGS
    return None if seen else state_file.begun_state(schema)


def _was_served(reader: SegmentReader) -> bool:
    """Whether its logger had a helper process: what has none judges nothing. Of an older silo that held runs tell."""
    if reader.schema.served:
        return True
    held = [reader, *held_runs(reader.schema.logger, reader.schema.logger_id)]
    for one in held[1:]:
        one.close()
    return reader.path.suffix == HELD_SUFFIX or len(held) > 1


def _recovered(
    reader: SegmentReader, state: JudgeState, folder: str, found: RecoveredCaptures, before: SegmentJudge | None
) -> list[Untold]:
    """Write what there is; returns what is to be told."""
    schema = reader.schema
    judge = SegmentJudge(reader, [*(one.info for one in schema.elements), *state.off], state.conditions, state.until)
    whole = judge.recall(state)
    if not state.cursors and before is not None and schema.follows(before.reader.schema):
        judge.follow(before)
    found.judge = judge
    step = judge.end(WHY)
    log_start(reader)
    news = [*state.untold, *untold(step)]
    listed = CaptureList(folder, schema.logger)
    written, failed = list[str](), list[str]()
    for buffer in [*whole, *step.whole]:
        capture = buffer.capture
        # also by the helper process that died, where another folder is asked for now
        lists = listed, CaptureList(schema.folder, schema.logger)
        if any(one.has_files(buffer.run, buffer.trigger, capture.number) for one in lists):
            continue
        try:
            done = write_capture(buffer, folder, listed, read_events(schema.folder, schema.logger, schema.run))
        except (SiloError, OSError) as error:
            text = f"capture {capture.number} of '{buffer.trigger}' was not saved: {error}"
            kind = EventKind.SAVE_FAILED
            found.is_whole = False
            failed.append(text)
        else:
            found.files.extend(done.files)
            text, kind = done.text, EventKind.CAPTURED
            written.append(text)
        news.append(Untold(kind.value, text, capture.fires[0].tick, capture.fires[0].time_ns))
    found.texts += [and_more(texts, MOST_NAMED, "; ") for texts in (failed, written) if texts]
    return news


def recover_left(tell: Tell, wanted: Callable[[str, str], bool], home: str = "") -> None:
    """Judge what programs held before they died; told is what was written, and what is lost.

    Of runs whose memory is gone the event log is told since when nobody looked. `wanted` chooses by name and folder of
    a logger; `home` is the folder of those of which none is known, as an older silo wrote none down.
    """
    before = None
    for reader in held_runs():
        schema = reader.schema
        with contextlib.closing(reader), contextlib.suppress(StateError):  # else another process does it
            if wanted(schema.logger, schema.folder) and not is_live(program_of(schema)):
                with claimed(reader):
                    found = recover_captures(reader, schema.folder, before)
                    before = found.judge
                    if found.texts:
                        tell(EventKind.RECOVERED, f"{WHY}; {'; '.join(found.texts)}", found.files)
                    if found.is_whole and not is_due(schema):
                        remove(reader.path)
    for path in state_file.all_states():
        with contextlib.suppress(SegmentError, OSError):  # a damaged one goes with its run
            logger, _, run = path.name.removesuffix(JUDGE_SUFFIX).rpartition(".")
            if state_file.is_note(path):
                if run not in runs_there(logger):
                    path.unlink()
                continue
            state = state_file.read_state(path)
            folder = state.folder or home
            if folder and wanted(logger, folder) and state.is_orphan:
                _let_go(path, state, logger, folder, tell)


def _let_go(path: Path, state: JudgeState, logger: str, folder: str, tell: Tell) -> None:
    """Forget what is known of a run whose program and memory are gone; that of a segment goes with the segment."""
    if state.run in runs_there(logger, folder):
        return
    lost = lost_news(state, folder, logger, GONE)
    if Path(folder).is_dir():
        _log(folder, logger, state.run, [*state.untold, *lost])
    path.unlink(missing_ok=True)
    if lost:
        tell(EventKind.RECOVERED, f"logger '{logger}': {'; '.join(one.text for one in lost)}", [])


def _log(folder: str, logger: str, run: str, news: list[Untold]) -> None:
    """Have the event log say of that run what nobody came to say."""
    now_ns = time.time_ns()
    lines = [
        LoggedEvent(one.kind, one.text, now_ns, one.tick, one.stamp_ns, logger, run, times=one.times) for one in news
    ]
    add_missing(folder, logger, run, lines)

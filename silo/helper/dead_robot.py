"""What the helper does when the robot process is gone without a goodbye: it saves what was committed, says so, stays.

How long it outlives it is decided here: `stays_s`. What earlier processes of this logger left unsaved it saves, too.
"""

import contextlib
import logging
import threading
import time
from collections.abc import Sequence
from pathlib import Path

from silo.core.elements import LoggedEvent, SavedFile, Storage
from silo.core.runtime import has_writer, list_segments, runtime_dir, sweep_unfinished
from silo.errors import SegmentError, SiloError, StateError
from silo.files.event_log import CRASHED
from silo.files.naming import files_text
from silo.helper.left_logs import Recovered, recover, settle_left
from silo.journal.format import remove_journals
from silo.journal.holdings import segment_holdings
from silo.recovery.left import BusyError, LeftRun, SavedMeanwhileError, death_text, log_end, save_reader, saved_text
from silo.recovery.runs import left_of, sweep
from silo.recovery.segments import claimed, discard, mark_saved, segment_folder
from silo.rpc.published import EventKind
from silo.segment.held_runs import number_of, readers
from silo.segment.reader import SegmentReader
from silo.state.events import EventNotifier
from silo.state.replica import Replica

ENDING_S = 5.0  # how long a process may take from closing its files to its end

WITHOUT_CLIENTS_S = 10.0
WITH_CLIENTS_S = 600.0

log = logging.getLogger("silo.helper")


def stays_s(*, news: bool, clients: bool) -> float:
    """Return how long it is there to be asked: for who reads what happened, or may come for `news` of it."""
    return WITH_CLIENTS_S if clients else WITHOUT_CLIENTS_S if news else 0.0


def log_death(replica: Replica, events: EventNotifier) -> None:
    """Have the event log say that the program died: first of all, as recorders take that into their last parts."""
    reader = None
    with contextlib.suppress(SegmentError):  # told when it is to be saved
        reader = replica.open_reader()
        if reader is not None:
            log_end(reader, log=events.log.add_missing)
    if reader is None:
        robot = replica.now.robot
        events.log.add(LoggedEvent(CRASHED, death_text(robot.pid), time.time_ns(), who=robot.logger, run=replica.run))


def after_crash(replica: Replica, events: EventNotifier) -> bool:
    """Save the segment if it isn't saved, delete it once it is, and tell the clients.

    Returns whether there was anything to save, which people may want to read about later.
    """
    stopped = ""
    with contextlib.suppress(SegmentError):  # told below
        if (reader := replica.open_reader()) is not None:
            stopped = reader.stop_reason
    who = death_text(replica.now.robot.pid, stopped)
    try:
        return _after_crash(replica, events, who)
    except SegmentError as error:
        text = f"{who}, and what it had logged can't be read: {error}"
        log.error("%s", text)  # noqa: TRY400  # the words say it all
        events.publish(EventKind.SAVE_FAILED, text)
        _tell(replica, events, text)
        return True


def _after_crash(replica: Replica, events: EventNotifier, who: str) -> bool:
    for folder in filter(None, (runtime_dir(), segment_folder(replica.now.options))):
        sweep_unfinished(folder)  # what it was making as it died
    for cut_off in _cut_off(replica):
        with contextlib.closing(cut_off):
            _save(replica, events, cut_off, who)
    reader = replica.open_reader()
    if reader is None or not reader.ticks or replica.is_saved():
        kept = "all that it logged was saved before" if reader and reader.ticks else "it had logged nothing"
        _tell(replica, events, f"{who}; {kept}")
        if reader is not None:
            _delete(reader)
        return False
    replica.mark_dead(f"{who}; saving {_held(reader)}")
    events.publish(EventKind.SAVING, replica.now.died)
    _save(replica, events, reader, who)
    return True


def _cut_off(replica: Replica) -> list[SegmentReader]:
    """Stretches before the present one that are in no file yet, oldest first."""
    options, found = replica.now.options, []
    folder = Path(options.folder) if options.storage is Storage.FILE else None
    for reader in readers(sorted(list_segments(folder), key=number_of), options.name, options.id):
        if reader.schema.run == replica.run or not reader.is_cut or replica.is_saved_of(reader):
            reader.close()
        else:
            found.append(reader)
    return found


def _tell(replica: Replica, events: EventNotifier, text: str, files: Sequence[SavedFile] = ()) -> None:
    """Tell clients what became of it; the event log has it."""
    replica.mark_dead(text)
    events.publish(EventKind.CRASHED, text, files=files, logged=events.log.newest)


def _save(replica: Replica, events: EventNotifier, reader: SegmentReader, who: str) -> None:
    files: list[SavedFile] = []
    robot = replica.now.robot
    try:
        with claimed(reader):
            files, held = save_reader(
                reader,
                robot.folder,
                progress=events.progress("saving after a crash"),
                events=events.log.of_run(reader.schema.run),
                conditions=robot.conditions if robot.segment == str(reader.path) else None,
            )
            replica.mark_saved(str(reader.path), reader.ticks)
            mark_saved(reader)
            log_end(reader, saved_text(files, held), events.log.add_missing)
            _delete(reader)
    except SavedMeanwhileError as error:
        replica.mark_saved(str(reader.path), reader.ticks)
        text = f"{who}; {error}"
        log.warning("%s", text)
    except BusyError as error:
        text = f"{who}; {error}, and says where; `silo recover --list` tells if it did not"
        log.warning("%s", text)
    except (SiloError, OSError) as error:
        text = f"{who}, and its log could not be saved: {error}; run `silo recover {reader.path}`"
        log.error("%s", text)  # noqa: TRY400  # the words say it all
        events.publish(EventKind.SAVE_FAILED, text)
    else:
        text = f"{who}; {saved_text(files, held)}"
        log.warning("%s", text)
    _tell(replica, events, text, files)


def _held(reader: SegmentReader) -> str:
    try:
        return segment_holdings(reader).text
    except SegmentError as error:
        return f"what it had logged ({error})"


def _delete(reader: SegmentReader) -> None:
    """Delete the segment once its writer is gone; one that only gave up its helper still needs it."""
    remove_journals(reader.schema)  # also where the segment stays: what is saved needs no journal
    deadline = time.monotonic() + ENDING_S
    while reader.alive() and has_writer(reader.fileno()):  # a program that goes on may have let go of it
        if time.monotonic() > deadline:
            log.info("%s stays: process %d still lives", reader.path, reader.schema.pid)
            return
        time.sleep(0.02)  # the end of a process that isn't our child can only be polled
    discard(reader)


class OrphanRecovery:
    """Owns the thread that saves what predecessors left, beside the helper's work, once clients can come.

    In a writing process of its own, which is told to be nice to the control loop; one after the other. What can't be
    saved stays, and it is said how to save it by hand.
    """

    def __init__(self, replica: Replica, events: EventNotifier) -> None:
        self._replica = replica
        self._events = events
        self._ended = threading.Event()
        self._before: Recovered | None = None
        # a daemon: should the helper have to end before it is done, the segment stays for the next one
        self._thread = threading.Thread(target=self._run, name="predecessors", daemon=True)
        self.start = self._thread.start

    def stop(self, timeout_s: float) -> None:
        """Begin no other segment, and wait at most `timeout_s` for the one under way."""
        self._ended.set()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        options = self._replica.now.options
        try:
            for problem in settle_left(self._tell, lambda *of: of == (options.name, options.folder), options.folder):
                log.error("%s", problem)
                self._events.publish(EventKind.RECORDING_FAILED, problem)
        except Exception:  # what is in the segments is saved all the same, and stays as long as it is due
            log.exception("what earlier programs left to be recorded, or captured, can't be completed")
        with contextlib.suppress(SiloError):  # no runtime folder any more: then there is nothing in it either
            sweep(options)
            for left in left_of(options):
                if not self._ended.is_set():
                    self._recover(left)
        self._before = None

    def _tell(self, kind: EventKind, text: str, files: list[SavedFile]) -> None:
        log.warning("%s", text)
        self._events.publish(kind, text, files=files, logged=self._events.log.newest)  # its own run has it logged

    def _recover(self, left: LeftRun) -> None:
        if left.schema is None or left.holdings is None:
            return
        from silo.recordings.writing import save_apart

        who = f"an earlier run of this logger (process {left.schema.pid}) ended without close()"
        try:
            done = recover(
                left.path, save=save_apart, log=self._events.log.add_missing, wait=False, before=self._before
            )
        except StateError:
            return  # its own helper, or somebody's `silo recover`, saves it and says so
        except (SiloError, OSError) as error:
            if left.path.exists():  # else likewise
                self._tell_failed(left, who, str(error))
            return
        self._before = done
        if done.files or done.more:
            texts = [f"{who}; {done.saved}: {files_text(done.files)}", *done.more]
            self._tell(EventKind.RECOVERED, "; ".join(texts), done.files)

    def _tell_failed(self, left: LeftRun, who: str, problem: str) -> None:
        text = f"{who}, and its log could not be saved: {problem}; run `silo recover {left.path}`"
        log.error("%s", text)
        self._events.publish(EventKind.SAVE_FAILED, text)

"""What earlier processes of this logger left unsaved: the helper saves it beside its work, once clients can come.

In a writing process of its own, which is told to be nice to the control loop; one after the other. What can't be saved
stays, and it is said how to save it by hand.
"""

import contextlib
import logging
import os
import threading
from pathlib import Path
from typing import TYPE_CHECKING

from silo.collecting.left_behind import (
    StaleSegment,
    claimed,
    discard,
    mark_saved,
    predecessors,
    segment_folder,
    sweep_segments,
)
from silo.collecting.left_journals import claimed_journal, find_stale_journals, remove_proven, sweep_journals
from silo.collecting.segment_reader import SegmentReader
from silo.errors import SegmentError, SiloError, StateError
from silo.files.atomic import sweep_parts
from silo.helper.events import Events
from silo.helper.judge import STATE_NAME
from silo.helper.left_log import RECOVERED
from silo.helper.left_recordings import complete_recordings, release_left
from silo.helper.mirror import Mirror
from silo.helper.saver import describe
from silo.ipc.published import EventKind
from silo.model import FileType, SavedFile
from silo.runtime import runtime_dir

if TYPE_CHECKING:
    from silo.helper.writing import WriteReport

log = logging.getLogger("silo.helper")


class PredecessorRecovery:
    """Owns the thread that saves what predecessors left."""

    def __init__(self, mirror: Mirror, events: Events) -> None:
        self._mirror = mirror
        self._events = events
        self._ended = threading.Event()
        # a daemon: should the helper have to end before it is done, the segment stays for the next one
        self._thread = threading.Thread(target=self._run, name="predecessors", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self, timeout_s: float) -> None:
        """Begin no other segment, and wait at most `timeout_s` for the one under way."""
        self._ended.set()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        options = self._mirror.now.options
        self._complete_recordings()
        self._recover_captures(options.name, options.folder)
        release_left()  # what was held for captures alone
        with contextlib.suppress(SiloError):  # no runtime folder any more: then there is nothing in it either
            sweep_segments(segment_folder(options))
            sweep_parts(Path(options.folder))
            sweep_journals(options.folder)
            for stale in predecessors(options):
                if not self._ended.is_set():
                    self._recover(stale)
            for stale in find_stale_journals(options.folder, options):
                if not self._ended.is_set():
                    self._recover(stale)

    def _complete_recordings(self) -> None:
        """First of all: their rows are in the segments that are saved, and deleted, next."""
        try:
            for problem in complete_recordings(lambda text: self._tell(EventKind.RECOVERED, text, [])):
                log.error("%s", problem)
                self._events.publish(EventKind.RECORDING_FAILED, problem)
        except Exception:  # what is in the segments is saved all the same, and stays as long as it is due
            log.exception("recordings that earlier programs left can't be completed")

    def _recover_captures(self, logger: str, folder: str) -> None:
        """Before their segments are saved, or removed as all of them stands in files."""
        try:
            with contextlib.suppress(SegmentError, OSError):  # no runtime folder: then there is nothing in it either
                if any(map(STATE_NAME, os.listdir(runtime_dir()))):  # noqa: PTH208  # nearly always there is none
                    from silo.helper.capture_recovery import recover_all_captures

                    recover_all_captures(logger, folder, self._tell)
        except Exception:  # what is in the segment is saved all the same
            log.exception("captures that earlier runs of this logger left can't be written")

    def _tell(self, kind: EventKind, text: str, files: list[SavedFile]) -> None:
        log.warning("%s", text)
        self._events.publish(kind, text, files=files)

    def _recover(self, stale: StaleSegment) -> None:
        if stale.schema is None or stale.holdings is None:
            return
        who = f"an earlier run of this logger (process {stale.schema.pid}) ended without close()"
        report = None
        try:
            save = self._save_journal if stale.path.is_dir() else self._save_segment
            report = save(stale)
        except StateError:
            return  # its own helper, or somebody's `silo recover`, saves it and says so
        except (SiloError, OSError) as error:
            if not stale.path.exists():
                return  # likewise
            self._tell_failed(stale, who, str(error))
            return
        if report is not None and report.error:
            self._tell_failed(stale, who, report.error)
            return
        if report is None and stale.path.is_dir():
            return  # nothing that isn't in a file
        files = report.files if report else []
        text = "; ".join([f"{who}; saved {stale.holdings.text}: {describe(files)}", *(report.damage if report else ())])
        log.warning("%s", text)
        self._events.publish(EventKind.RECOVERED, text, files=files)

    def _save_segment(self, stale: StaleSegment) -> "WriteReport | None":
        with contextlib.closing(SegmentReader(stale.path)) as reader, claimed(reader):
            report = self._written(stale, reader) if stale.holdings and stale.holdings.samples else None
            if report is None or not report.error:
                mark_saved(reader)
                discard(reader)
            return report

    def _save_journal(self, stale: StaleSegment) -> "WriteReport | None":
        with claimed_journal(stale.path) as reader:
            unsaved = reader.ticks > reader.saved_ticks and stale.holdings and stale.holdings.samples
            report = self._written(stale, None) if unsaved else None
            if report is None or not report.error:
                remove_proven(reader)
            return report

    def _written(self, stale: StaleSegment, reader: SegmentReader | None) -> "WriteReport":
        from silo.helper.writing import WriteOrder, write_apart

        assert stale.schema is not None
        journal = "" if reader is not None else str(stale.path)
        folder = stale.schema.folder if reader is not None else str(stale.path.parent)
        order = WriteOrder(
            folder, stale.schema.logger, [FileType.SILO], "", of_dead=True, journal=journal, why=RECOVERED
        )
        return write_apart(reader, order, _unheard)

    def _tell_failed(self, stale: StaleSegment, who: str, problem: str) -> None:
        text = f"{who}, and its log could not be saved: {problem}; run `silo recover {stale.path}`"
        log.error("%s", text)
        self._events.publish(EventKind.SAVE_FAILED, text)


def _unheard(_fraction: float) -> None:
    """Nobody waits for this save."""

"""The journal thread: what is collected with `storage="disk"` is copied to the disk and synced, some times a second.

The control loop has no part in it. How far the journal is, is shown to clients ("durable to tick N"); nobody waits for
it. A disk that refuses is told once, tried again, and what is not durable meanwhile is in memory as ever.
"""

import logging
import os
import shutil
import threading
from pathlib import Path

from silo.collecting.disk import Disk
from silo.collecting.journal import JOURNAL_SUFFIX
from silo.collecting.journal_writer import JournalWriter
from silo.collecting.segment_reader import SegmentReader
from silo.errors import SegmentError
from silo.helper.events import Events
from silo.helper.mirror import Mirror
from silo.ipc.messages import EventKind
from silo.model import Storage

PERIOD_S = 0.2
RETRY_S = 5.0

log = logging.getLogger("silo.helper")


def journals_of(segment: Path, folder: Path) -> list[Path]:
    """The journals in a log folder that were written from a segment; a second helper process makes a second one."""
    return sorted(folder.glob(f".{segment.stem.lstrip('.')}.*{JOURNAL_SUFFIX}"))


def remove_journals(segment: Path, folder: Path, but: Path | None = None) -> None:
    """Delete the journals of a segment whose data is saved, or no longer wanted."""
    for journal in journals_of(segment, folder):
        if journal != but:
            shutil.rmtree(journal, ignore_errors=True)


class Journaling:
    """Owns the journal thread."""

    def __init__(self, mirror: Mirror, events: Events) -> None:
        self._mirror, self._events = mirror, events
        self._ended = threading.Event()
        self._writer: JournalWriter | None = None
        self._reader: SegmentReader | None = None
        self._segment: Path | None = None
        self._told = ""
        self._thread = threading.Thread(target=self._run, name="journal")

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self, *, keep: bool) -> None:
        """End the thread; `keep` leaves the journal for recovery, otherwise it is deleted."""
        self._ended.set()
        self._thread.join()
        self._close()
        if not keep and self._segment is not None:
            remove_journals(self._segment, Path(self._mirror.now.robot.folder))
        self._segment = None

    def _run(self) -> None:
        wait_s = PERIOD_S
        while not self._ended.wait(wait_s):
            if self._mirror.now.options.storage is not Storage.DISK:
                continue
            try:
                self._step()
                wait_s = PERIOD_S
            except OSError as error:
                wait_s = RETRY_S
                self._tell(f"the journal can't be written ({error.strerror or error}): ")
            except SegmentError as error:
                wait_s = RETRY_S
                self._tell(f"the journal can't read the buffers ({error}): ")

    def _step(self) -> None:
        path = self._mirror.segment
        if not path:
            self._close()
            return
        if self._segment != Path(path) or self._reader is None:
            self._follow(Path(path))
        assert self._reader is not None
        if self._writer is None:
            folder = Path(self._mirror.now.robot.folder)
            folder.mkdir(parents=True, exist_ok=True)
            name = f".{Path(path).stem.lstrip('.')}.{os.getpid()}{JOURNAL_SUFFIX}"
            shutil.rmtree(folder / name, ignore_errors=True)  # of a try that the disk refused half-way
            self._writer = JournalWriter(folder / name, self._reader.schema, Disk())
        ticks = self._writer.append(self._reader)
        if self._mirror.durable_ticks <= 0 and ticks:
            # from its first commit on this journal holds all that the one of an earlier helper process held
            remove_journals(Path(path), self._writer.path.parent, but=self._writer.path)
        self._mirror.durable_ticks = ticks
        if self._told:
            self._told = ""
            self._events.publish(EventKind.DURABLE, f"the journal goes on: durable to tick {ticks}")

    def _follow(self, segment: Path) -> None:
        """A new run: the journal of the one before goes with its buffers."""
        reader = self._mirror.open_reader()
        if reader is None or reader.path != segment:
            raise SegmentError("a new run began meanwhile")
        self._close()
        if self._segment is not None:
            remove_journals(self._segment, Path(self._mirror.now.robot.folder))
        self._segment, self._reader = segment, reader
        self._mirror.durable_ticks = 0

    def _tell(self, problem: str) -> None:
        if problem == self._told:
            return
        self._told = problem
        text = (
            f"{problem}a power cut now loses all after tick {max(self._mirror.durable_ticks, 0)}; make room in "
            f"{self._mirror.now.robot.folder}, it is tried again every {RETRY_S:.0f} s; logging goes on"
        )
        log.warning("%s", text)
        self._events.publish(EventKind.DURABLE, text)

    def _close(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None
        if self._reader is not None:
            self._reader.close()
            self._reader = None

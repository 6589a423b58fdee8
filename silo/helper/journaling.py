"""The journal thread: what is collected with `storage="disk"` is copied to the disk and synced, some times a second.

The control loop has no part in it. How far the journal is, is shown to clients ("durable to tick N"); nobody waits for
it. A disk that refuses is told once, tried again, and what is not durable meanwhile is in memory as ever.
"""

import logging
import threading
from pathlib import Path

from silo.core.elements import Storage
from silo.errors import SegmentError, reason
from silo.journal.folders import remember_folder
from silo.journal.format import Head, free_name, is_written, list_journals, remove_journal, remove_journals
from silo.journal.writer import Disk, JournalWriter
from silo.rpc.published import EventKind
from silo.segment.reader import SegmentReader
from silo.state.events import EventNotifier
from silo.state.replica import Replica
from silo.state.run_follower import RunFollower

PERIOD_S = 0.2
RETRY_S = 5.0

log = logging.getLogger("silo.helper")


class Journaling:
    """Owns the journal thread."""

    def __init__(self, replica: Replica, events: EventNotifier) -> None:
        self._replica, self._events = replica, events
        self._ended = threading.Event()
        self._writer: JournalWriter | None = None
        self._run = RunFollower(replica)
        self._told = ""
        self._thread = threading.Thread(target=self._watch, name="journal")
        self.start = self._thread.start

    def stop(self) -> None:
        """End the thread, which makes durable what it can before; the journal stays.

        Who saves the run, or drops it, removes it.
        """
        self._ended.set()
        self._thread.join()

    def _watch(self) -> None:
        wait_s = PERIOD_S
        while not self._ended.wait(wait_s):
            wait_s = self._guarded_step()
        self._guarded_step()
        self._close()

    def _guarded_step(self) -> float:
        """Do a step, whatever the disk says; returns how long to wait for the next one."""
        if self._replica.now.options.storage is not Storage.DISK:
            return PERIOD_S
        try:
            self._step()
        except OSError as error:
            self._tell(f"the journal can't be written ({reason(error)}): ")
        except SegmentError as error:
            self._tell(f"the journal can't read the buffers ({error}): ")
        else:
            return PERIOD_S
        return RETRY_S

    def _step(self) -> None:
        before = self._run.reader
        if self._run.look():
            self._end(before)
        reader = self._run.reader
        if reader is None:
            return
        run = reader.schema.run
        if self._writer is not None and self._writer.is_gone:
            self._close()
            self._replica.durable = run, 0
            self._tell("somebody deleted the journal: ", way_out="")
        if self._writer is None:
            self._writer = self._begin(reader)
        ticks = self._writer.append(reader)
        if ticks and not self._replica.durable_ticks(run):
            # from its first commit on this journal holds all that the one of an earlier helper process held
            remove_journals(reader.schema, but=self._writer.path)
        self._replica.durable = run, ticks
        if self._told:
            self._told = ""
            text = f"the journal goes on: durable to tick {ticks}"
            log.warning("%s", text)
            self._events.publish(EventKind.DURABLE, text)

    def _end(self, before: SegmentReader | None) -> None:
        """Of a run that another one goes on write the end, too: the file that it is saved to comes somewhat later."""
        following = self._run.reader
        try:
            if self._writer is not None and before is not None and following is not None and following.schema.cut:
                self._writer.append(before)
        except (OSError, SegmentError) as error:
            log.warning("the end of a run that was cut is in no journal: %s", reason(error))
        finally:
            self._close()

    def _begin(self, reader: SegmentReader) -> JournalWriter:
        """A journal of a new run, or of one that another helper process began; those of earlier runs go."""
        schema = reader.schema
        folder = Path(schema.folder)
        folder.mkdir(parents=True, exist_ok=True)
        if schema.cut is None:  # a run that it goes on may be in no file yet
            # of earlier runs of this very logger: its restart cleared their buffers
            for path in list_journals(schema.folder, schema.logger, schema.logger_id):
                if f"-{schema.run}." not in path.name and not is_written(path):
                    remove_journal(path)
        writer = JournalWriter(free_name(folder, schema), Head(str(reader.path), schema), Disk())
        try:
            remember_folder(folder)  # once a journal is there: links to folders without are removed by others
        except (OSError, RuntimeError) as error:
            log.warning(
                "the folder %s can't be remembered for `silo recover` (%s): after a power cut, say it: "
                "`silo recover %s`; set XDG_STATE_HOME to a folder on the disk that this user may write",
                folder,
                reason(error),
                folder,
            )
        return writer

    def _tell(self, problem: str, way_out: str | None = None) -> None:
        if problem == self._told:
            return
        self._told = problem
        durable = self._replica.durable_ticks(self._replica.run)
        way_out = f"make room in {self._replica.now.robot.folder}, " if way_out is None else way_out
        again = f"{way_out}it is tried again every {RETRY_S:.0f} s"
        text = f"{problem}a power cut now loses all after tick {durable}; {again}; logging goes on"
        log.warning("%s", text)
        self._events.publish(EventKind.DURABLE, text)

    def _close(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None

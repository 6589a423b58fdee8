"""Takes what the program notes in its segment into the event log, five times a second and at every end.

That are its marks, changes of parameters, and arrays that nobody but silo holds any more.
"""

import contextlib
import logging
import threading

from silo.core.elements import NOTED, LoggedEvent
from silo.core.quantities.writing import many
from silo.core.recording import unheld_text
from silo.errors import SegmentError
from silo.files.event_log import lacking
from silo.rpc.published import EventKind
from silo.segment.reader import SegmentReader
from silo.state.events import EventNotifier
from silo.state.replica import Replica
from silo.state.run_follower import RunFollower

PERIOD_S = 0.2
MOST_UNHELD = 10  # told of by name, at once

log = logging.getLogger("silo.helper")


class MarkReader:
    """Owns the thread that looks for marks."""

    def __init__(self, replica: Replica, events: EventNotifier) -> None:
        self._events = events
        self._lock = threading.Lock()
        self._run = RunFollower(replica)
        self._known: list[LoggedEvent] = []  # of the run, that a helper process before this one took
        self._taken, self._changed = 0, -1  # numbers of the newest mark and change; -1: nor what they were at the start
        self._unheld: set[str] = set()  # elements that were told of
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="marks")

    def start(self) -> None:
        """Follow the present run, from its first mark on."""
        self.take_run()
        self._thread.start()

    def stop(self) -> None:
        """Take what is left and end. May be called twice."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()
        self.take()

    def take_run(self) -> None:
        """Follow the replica's run, and take what is left of the one before, whose memory is still mapped here.

        In this order: what is noted until the present run is known to be another one is of the one before.
        """
        with self._lock:
            before, run = self._run.reader, self._run.run
            try:
                self._run.look()
            except SegmentError:
                log.exception("the marks of a run can't be read")
            self._take(before)
            if self._run.run != run:
                self._taken, self._changed, self._unheld = 0, -1, set()
                self._known = self._events.log.of_run(self._run.run) if self._run.run else []

    def take_left(self, reader: SegmentReader) -> None:
        """Take those of a run that ended while there was no helper process."""
        self._publish([*reader.stamped_marks(), *reader.stamped_changes()], self._events.log.of_run(reader.schema.run))

    def _watch(self) -> None:
        while not self._ended.wait(PERIOD_S):
            self.take_run()  # maybe one that was not handed over

    def take(self) -> None:
        """Take what there is now."""
        with self._lock:
            self._take(self._run.reader)

    def _take(self, reader: SegmentReader | None) -> None:
        with contextlib.suppress(SegmentError):  # somebody cut it short, which others tell
            if reader is not None:
                self._take_noted(reader)
                self._take_unheld(reader)

    def _take_noted(self, reader: SegmentReader) -> None:
        if marks := reader.stamped_marks(self._taken):
            self._tell_lost(reader, marks[0].number - 1 - self._taken, "marks of the program", "it marks too often")
            self._taken = marks[-1].number
            self._publish(marks, self._known)
        if changes := reader.stamped_changes(self._changed):
            told = sum(one.change is not None and not one.change.is_image for one in changes)
            lost = changes[-1].number - max(self._changed, 0) - told
            self._tell_lost(reader, lost, "changes of parameters", "they change too often")
            self._changed = max(self._changed, changes[-1].number, 0)
            self._publish(changes, self._known)

    def _tell_lost(self, reader: SegmentReader, lost: int, what: str, why: str) -> None:
        if lost > 0 and not any(one.kind in NOTED for one in self._known):
            text = f"{lost} {what} were overwritten before they could be read: {why}"
            self._events.publish(EventKind.LOST, text, run=reader.schema.run)

    def _publish(self, noted: list[LoggedEvent], known: list[LoggedEvent]) -> None:
        for one in lacking(noted, known):
            self._events.publish_mark(one)

    def _take_unheld(self, reader: SegmentReader) -> None:
        found, run = reader.unheld(), reader.schema.run
        fresh = sorted(found.keys() - self._unheld)
        self._unheld |= found.keys()
        logged = self._events.log.texts(EventKind.UNHELD.value, run) if fresh else set()
        for name in fresh[:MOST_UNHELD]:
            text = f"{name}: {unheld_text(found[name])}"
            if text not in logged:  # else a helper process before this one told it
                self._events.publish(EventKind.UNHELD, text, tick=found[name], run=run)
        if len(fresh) > MOST_UNHELD:
            text = f"nobody but silo holds the arrays of {many(len(fresh) - MOST_UNHELD, 'more element')} either"
            self._events.publish(EventKind.UNHELD, text, run=run)

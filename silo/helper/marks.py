"""Takes what the program notes in its segment into the event log, five times a second and at every end.

That are its marks, changes of parameters, and arrays that nobody but silo holds any more.
"""

import logging
import threading

from silo.core.recording import unheld_text
from silo.errors import SegmentError
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
        self._replica, self._events = replica, events
        self._lock = threading.Lock()
        self._run = RunFollower(replica)
        self._known: set[tuple[int, int, str]] = set()  # marks that a helper process before this one took
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
        """Take what is left of the run before, whose memory is still mapped here, and follow the replica's run."""
        self.take()
        with self._lock:
            before = self._run.run
            try:
                self._run.look()
            except SegmentError:
                log.exception("the marks of a run can't be read")
            if self._run.run != before:
                self._taken, self._changed, self._unheld = 0, -1, set()
                self._known = self._events.log.marks_of(self._run.run) if self._run.run else set()

    def take_left(self, reader: SegmentReader) -> None:
        """Take those of a run that ended while there was no helper process."""
        known = self._events.log.marks_of(reader.schema.run)
        for mark in [*reader.stamped_marks(), *reader.stamped_changes()]:
            if (mark.time_ns, mark.tick, mark.text) not in known:
                self._events.publish_mark(mark)

    def _watch(self) -> None:
        while not self._ended.wait(PERIOD_S):
            self.take_run()  # maybe one that was not handed over

    def take(self) -> None:
        """Take what there is now."""
        self._take_marks()
        self._take_changes()
        self._take_unheld()

    def _take_unheld(self) -> None:
        with self._lock:
            reader = self._run.reader
            if reader is None:
                return
            try:
                found = reader.unheld()
            except SegmentError:  # somebody cut it short, which others tell
                return
            run, fresh = reader.schema.run, sorted(found.keys() - self._unheld)
            self._unheld |= found.keys()
            if not fresh:
                return
        logged = self._events.log.texts(EventKind.UNHELD.value, run)
        for name in fresh[:MOST_UNHELD]:
            text = f"{name}: {unheld_text(found[name])}"
            if text not in logged:  # else a helper process before this one told it
                self._events.publish(EventKind.UNHELD, text, tick=found[name], run=run)
        if len(fresh) > MOST_UNHELD:
            text = f"nobody but silo holds the arrays of {len(fresh) - MOST_UNHELD} more elements either"
            self._events.publish(EventKind.UNHELD, text, run=run)

    def _take_changes(self) -> None:
        with self._lock:
            reader = self._run.reader
            if reader is None:
                return
            try:
                changes = reader.stamped_changes(self._changed)
            except SegmentError:  # somebody cut it short, which others tell
                return
            if not changes:
                return
            lost = max(0, changes[-1].number - self._changed - len(changes))
            self._changed = max(self._changed, changes[-1].number, 0)
            fresh = [one for one in changes if (one.time_ns, one.tick, one.text) not in self._known]
        if lost and not self._known:
            text = f"{lost} changes of parameters were overwritten before they could be read: they change too often"
            self._events.publish(EventKind.LOST, text, run=reader.schema.run)
        for one in fresh:
            self._events.publish_mark(one)

    def _take_marks(self) -> None:
        with self._lock:
            reader = self._run.reader
            if reader is None:
                return
            try:
                marks = reader.stamped_marks(self._taken)
            except SegmentError:  # somebody cut it short, which others tell
                return
            if not marks:
                return
            lost = marks[0].number - 1 - self._taken
            self._taken = marks[-1].number
            fresh = [mark for mark in marks if (mark.time_ns, mark.tick, mark.text) not in self._known]
        if lost > 0 and not self._known:
            text = f"{lost} marks of the program were overwritten before they could be read: it marks too often"
            self._events.publish(EventKind.LOST, text, run=reader.schema.run)
        for mark in fresh:
            self._events.publish_mark(mark)

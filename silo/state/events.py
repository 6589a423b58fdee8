"""Telling every client what happened, and writing it into the event log.

Any thread of the helper may tell; nobody waits for a slow client or a slow disk.
"""

import logging
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import msgspec
import zenoh

from silo.core.elements import PARAMETER, LoggedEvent, SavedFile, Status
from silo.net.access.senders import came_by_network
from silo.net.keys import Root
from silo.rpc.published import Event, EventKind
from silo.state.event_log import EventLog
from silo.state.replica import Replica

MAX_BY = 120
PROGRESS_PERIOD_S = 0.1

_QUIET = (EventKind.SAVING, EventKind.MARKER)  # not on the console of the robot program

_OF_FILES = (
    EventKind.SAVED, EventKind.CAPTURED, EventKind.CRASHED, EventKind.RECOVERED, EventKind.RECORDING,
    EventKind.RECORDING_FAILED, EventKind.DELETED, EventKind.FILES_DELETED,
)  # fmt: skip

log = logging.getLogger("silo.helper")


def plain(text: str, limit: int = MAX_BY) -> str:
    """Return a client's words, safe to show on a terminal: no control characters, not too long."""
    return "".join(character for character in text[:limit] if character.isprintable())


class EventNotifier:
    """Numbers events, logs and publishes them."""

    def __init__(self, session: zenoh.Session, root: Root, replica: Replica, log: EventLog) -> None:
        """Tell by this session."""
        self._publisher = session.declare_publisher(
            root.key("event"), congestion_control=zenoh.CongestionControl.DROP, priority=zenoh.Priority.INTERACTIVE_HIGH
        )
        self._replica = replica
        self._lock = threading.Lock()
        self._number = 0
        self.log = log
        self.files_changed: Callable[[Sequence[SavedFile]], object] = lambda files: None

    def publish(
        self,
        kind: EventKind,
        text: str,
        *,
        by: str = "",
        job: int = 0,
        progress: float = 0.0,
        files: Sequence[SavedFile] = (),
        tick: int | None = None,
        stamp_ns: int = 0,
        run: str = "",
        time_ns: int = 0,
        logged: int = -1,
    ) -> LoggedEvent:
        """Publish an event with the present status; it stands at `tick`, or at the newest one, of `run` or the present.

        `stamp_ns` is the time stamp of that tick, `time_ns` the wall clock then, where they are known. `logged` is the
        number of the line that tells it where that is written already.
        """
        status = self._replica.status()
        newest = status.ticks - 1 if run in ("", self._replica.run) else -1  # of another run nobody knows it here
        begun_ns = time_ns or (status.started_ns if kind is EventKind.STARTED else 0)  # this is told some time after
        event = LoggedEvent(
            kind.value,
            text,
            begun_ns or time.time_ns(),
            newest if tick is None else tick,
            stamp_ns or self._stamp_of(newest if tick is None else tick, run, status),
            plain(by) or self._replica.now.robot.logger,
            run or self._replica.run,
        )
        if logged >= 0:
            event = msgspec.structs.replace(event, number=logged)
        elif kind is not EventKind.SAVING:  # only news; how it ends is logged
            event = self.log.add(event)
        if came_by_network(by) and kind not in _QUIET:
            # whoever sits before the robot wants to know why it does what nobody there asked for
            log.warning("%s: %s, by %s", self._replica.now.robot.logger, text, plain(by))
        self._put(event, by=plain(by), status=status, job=job, progress=progress, files=list(files))
        if kind in _OF_FILES:
            self.files_changed(files)
        return event

    def progress(self, what: str, *, by: str = "", job: int = 0) -> Callable[[float], None]:
        """Return what is called with the share of a save that is done, and tells it some times a second."""
        told_s = time.monotonic()

        def tell(fraction: float) -> None:
            nonlocal told_s
            if time.monotonic() - told_s >= PROGRESS_PERIOD_S:
                told_s = time.monotonic()
                share = min(max(fraction, 0.0), 1.0)
                self.publish(EventKind.SAVING, f"{what}: {share:.0%}", by=by, job=job, progress=share)

        return tell

    def is_started(self) -> bool:
        """Whether it is told that the present run was started."""
        run = self._replica.run
        return bool(run and self.log.texts(EventKind.STARTED.value, run))

    def _stamp_of(self, tick: int, run: str, status: Status) -> int:
        """Return the time stamp of a tick of a run, 0 where only who tells of it may know it: the run is over."""
        if run not in ("", self._replica.run):
            return 0
        return status.last_tick_ns if tick == status.ticks - 1 else self._replica.stamp_of(tick)

    def publish_mark(self, mark: LoggedEvent) -> None:
        """Log and publish a mark of the program, or who changed a parameter; without a status, as they may be many."""
        self._put(self.log.add(mark), by=mark.who if mark.kind == PARAMETER else "")

    def _put(self, one: LoggedEvent, **more: Any) -> None:
        """Publish an event, with `more` than its line in the log has."""
        with self._lock:
            self._number += 1
            told = Event(
                self._number, one.time_ns, EventKind(one.kind), one.text, tick=one.tick, stamp_ns=one.stamp_ns,
                logged=one.number, run=one.run, **more,
            )  # fmt: skip
            self._publisher.put(msgspec.msgpack.encode(told))

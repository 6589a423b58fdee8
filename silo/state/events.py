"""Telling every client what happened, and writing it into the event log.

Any thread of the helper may tell; nobody waits for a slow client or a slow disk: a thread of its own writes. What can't
be written now is tried again with the next lines, as long as memory has it.
"""

import contextlib
import itertools
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import msgspec
import zenoh

from silo.core.elements import PARAMETER, TOLD_LATE_NS, LoggedEvent, SavedFile, Status
from silo.core.recording import MOST_EVENTS
from silo.errors import reason
from silo.files.event_log import append_events, lacking, read_events, renumbered
from silo.net.access.senders import came_by_network
from silo.net.keys import Root
from silo.rpc.published import Event, EventKind
from silo.state.replica import Replica

RETRY_S = 5.0
MOST_LETTERS = 4000  # of a line
MOST_WAIT_S = 2.0  # what follows a death may take so long: the disk of the log may hang

log = logging.getLogger("silo.helper")


class EventLog:
    """What happened to one logger, numbered: the newest lines in memory, all in the file in the logger's folder.

    It begins with what earlier helper processes wrote. The file has the last word on numbers: where another process
    wrote there in between, lines that wait are numbered on.
    """

    def __init__(self, folder: str, logger: str) -> None:
        self._folder, self._logger = folder, logger
        self._events: deque[LoggedEvent] = deque(self._read(), MOST_EVENTS)
        self._numbers = itertools.count(max((event.number for event in self._events), default=0) + 1)
        self._waiting: deque[LoggedEvent] = deque(maxlen=MOST_EVENTS)
        self._lock = threading.Lock()
        self._written = threading.Condition(self._lock)
        self._wake = threading.Event()
        self._ended = False
        self._told = False
        self._thread = threading.Thread(target=self._write_all, name="events", daemon=True)
        self._thread.start()

    def _read(self) -> list[LoggedEvent]:
        try:
            return read_events(self._folder, self._logger)
        except OSError as error:
            log.warning("the event log in %s can't be read (%s): it goes on from here", self._folder, reason(error))
            return []

    def stop(self, timeout_s: float = 5.0) -> None:
        """Write what waits and end; a disk that hangs is given up after a while. May be called twice."""
        self._ended = True
        self._wake.set()
        self._thread.join(timeout_s)

    def add(self, event: LoggedEvent) -> LoggedEvent:
        """Add a line; returns it with its number. Words without end would push all others out of the file."""
        if len(event.text) > MOST_LETTERS:
            text = f"{event.text[:MOST_LETTERS]}... ({len(event.text)} letters)"
            event = msgspec.structs.replace(event, text=text)
        with self._lock:
            numbered = msgspec.structs.replace(event, number=next(self._numbers))
            self._events.append(numbered)
            self._waiting.append(numbered)
        self._wake.set()
        return numbered

    def add_missing(self, folder: str, logger: str, run: str, events: Sequence[LoggedEvent]) -> None:
        """Add what neither this process nor another one has told of a run, as `silo.files.event_log.add_missing`.

        Who reads the file next finds it there, unless the disk takes longer than `MOST_WAIT_S`.
        """
        known = self.of_run(run)
        with contextlib.suppress(OSError):
            known += read_events(folder, logger, run)
        for event in lacking(events, known):
            self.add(event)
        self.settle(MOST_WAIT_S)

    def since(self, number: int, limit: int) -> tuple[list[LoggedEvent], int]:
        """Return the newest `limit` lines after a number, oldest first, and how many older ones that leaves out."""
        with self._lock:
            found = [event for event in self._events if event.number > number]
        kept = found[-limit:] if limit > 0 else []
        return kept, len(found) - len(kept)

    @property
    def newest(self) -> int:
        """The number of the newest line, 0 if there is none."""
        with self._lock:
            return self._events[-1].number if self._events else 0

    @property
    def written(self) -> int:
        """The number up to which all lines stand in the file."""
        with self._lock:
            return self._waiting[0].number - 1 if self._waiting else self._events[-1].number if self._events else 0

    def settled(self, event: LoggedEvent, timeout_s: float) -> LoggedEvent | None:
        """Wait until a line stands in the file, and return it with its number there; None for a disk that is slower."""

        def is_it(one: LoggedEvent) -> bool:
            return msgspec.structs.replace(one, number=event.number) == event

        with self._lock:
            if not self._written.wait_for(lambda: not any(map(is_it, self._waiting)), timeout_s):
                return None
            return next(filter(is_it, reversed(self._events)), event)

    def settle(self, timeout_s: float) -> int:
        """Wait likewise for the newest line, and return its number, which is sure then; 0 where there is none."""
        with self._lock:
            newest = self._events[-1] if self._events else LoggedEvent("", "", 0)
        return (self.settled(newest, timeout_s) or newest).number

    def of_run(self, run: str) -> list[LoggedEvent]:
        """Return what happened in a run, as far as memory has it."""
        with self._lock:
            return [event for event in self._events if event.run == run]

    def texts(self, kind: str, run: str) -> set[str]:
        """Return what stands there of a kind, of a run."""
        return {event.text for event in self.of_run(run) if event.kind == kind}

    # -------------------------------------------------------------------------------------------------- the thread

    def _write_all(self) -> None:
        while not self._ended:
            self._wake.wait(RETRY_S if self._waiting else None)
            self._wake.clear()
            self._write()
        self._write()

    def _write(self) -> None:
        with self._lock:
            lines = list(self._waiting)
        if not lines:
            return
        try:
            higher = append_events(self._folder, self._logger, lines)
        except OSError as error:
            if not self._told:
                log.warning("the event log in %s can't be written (%s); it is tried again", self._folder, reason(error))
            self._told = True
            return
        self._told = False
        with self._lock:
            if higher:
                self._number_on(lines[0].number, higher)
            last = lines[-1].number + higher
            while self._waiting and self._waiting[0].number <= last:
                self._waiting.popleft()
            self._written.notify_all()

    def _number_on(self, first: int, higher: int) -> None:
        """Number all lines from a number on so much higher, and those to come. Called with the lock held."""
        for lines in (self._events, self._waiting):
            at = next((at for at, event in enumerate(lines) if event.number >= first), len(lines))
            moved = renumbered(itertools.islice(lines, at, None), higher)
            while len(lines) > at:
                lines.pop()
            lines.extend(moved)
        self._numbers = itertools.count(next(self._numbers) + higher)


MAX_BY = 120
PROGRESS_PERIOD_S = 0.1

_QUIET = (EventKind.SAVING, EventKind.MARKER)  # not on the console of the robot program

_OF_FILES = (
    EventKind.SAVED, EventKind.CAPTURED, EventKind.CRASHED, EventKind.RECOVERED, EventKind.RECORDING,
    EventKind.RECORDING_FAILED, EventKind.DELETED, EventKind.FILES_DELETED,
)  # fmt: skip


def plain(text: str, limit: int = MAX_BY) -> str:
    """Return a client's words, safe to show on a terminal: no control characters, not too long."""
    return "".join(character for character in text[:limit] if character.isprintable())


class EventNotifier:
    """Numbers events, logs and publishes them."""

    def __init__(self, session: zenoh.Session, root: Root, replica: Replica, log: EventLog) -> None:
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
        times: int = 1,
        about: str = "",
    ) -> LoggedEvent:
        """Publish an event with the present status; it stands at `tick`, or at the newest one, of `run` or the present.

        `stamp_ns` is the time stamp of that tick, `time_ns` the wall clock then, where they are known: else that of a
        tick that is held. `logged` is the
        number of the line that tells it where that is written already. It happened so many `times`, and is
        `about` a trigger.
        """
        status = self._replica.status()
        newest = status.ticks - 1 if run in ("", self._replica.run) else -1  # of another run nobody knows it here
        begun_ns = time_ns or (status.started_ns if kind is EventKind.STARTED else 0)  # this is told some time after
        at = newest if tick is None else tick
        found_ns = 0 if stamp_ns else self._stamp_of(at, run, status)
        since_ns = status.last_tick_ns - found_ns if found_ns else 0  # its tick, by the clock of the logger
        event = LoggedEvent(
            kind.value,
            text,
            begun_ns or time.time_ns() - since_ns * (0 < since_ns < TOLD_LATE_NS),
            at,
            stamp_ns or found_ns,
            plain(by) or self._replica.now.robot.logger,
            run or self._replica.run,
            times=times,
        )
        if logged >= 0:
            event = msgspec.structs.replace(event, number=logged)
        elif kind is not EventKind.SAVING:  # only news; how it ends is logged
            event = self.log.add(event)
        if (came_by_network(by) or kind is EventKind.DENIED) and kind not in _QUIET:
            # whoever sits before the robot wants to know why it does what nobody there asked for
            log.warning("%s: %s, by %s", self._replica.now.robot.logger, event.text, plain(by))
        self._put(event, by=plain(by), status=status, job=job, progress=progress, files=list(files), about=about)
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
            self._publisher.put(msgspec.msgpack.encode(Event.of(one, self._number, **more)))

"""What happened to this logger, numbered: the newest lines in memory, all of them in the file in the logger's folder.

The file has the last word on numbers: where another process wrote there in between, lines that wait are numbered on.

Any thread may add; a thread of its own writes, so that a disk that hangs holds nobody up. What can't be written now is
tried again with the next lines, as long as memory has it.
"""

import contextlib
import itertools
import logging
import threading
from collections import deque
from collections.abc import Sequence

import msgspec

from silo.core.elements import LoggedEvent
from silo.core.recording import MOST_EVENTS
from silo.files.event_log import append_events, lacking, read_events, renumbered

RETRY_S = 5.0
MOST_WAIT_S = 2.0  # what follows a death may take so long: the disk of the log may hang

log = logging.getLogger("silo.helper")


class EventLog:
    """The event log of one logger; begins with what earlier helper processes wrote."""

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
            log.warning("the event log in %s can't be read (%s): it goes on from here", self._folder, error.strerror)
            return []

    def stop(self, timeout_s: float = 5.0) -> None:
        """Write what waits and end; a disk that hangs is given up after a while. May be called twice."""
        self._ended = True
        self._wake.set()
        self._thread.join(timeout_s)

    def add(self, event: LoggedEvent) -> LoggedEvent:
        """Add a line; returns it with its number."""
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
        self.wait_written(self.newest, MOST_WAIT_S)

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

    def wait_written(self, number: int, timeout_s: float) -> bool:
        """Wait until a line stands in the file; False for a disk that takes longer."""
        with self._lock:
            return self._written.wait_for(lambda: not self._waiting or self._waiting[0].number > number, timeout_s)

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
                log.warning(
                    "the event log in %s can't be written (%s); it is tried again", self._folder, error.strerror
                )
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

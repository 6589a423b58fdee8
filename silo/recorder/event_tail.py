"""What happens in a run, for its parts: the lines of the event log as they come, read from its file.

From the file and not over the socket, so that a recorder has them whether or not the helper process lives that wrote
them, and one that goes on after a kill finds what its predecessor had not written yet.
"""

import contextlib
import os
import time
from pathlib import Path

import msgspec

from silo.core.elements import LoggedEvent
from silo.core.runtime import open_own, read_own
from silo.files.event_log import CRASHED, decoded, event_log_path, older_event_log
from silo.recovery.left import STOPPED, log_end
from silo.segment.reader import SegmentReader

LAST_WORDS_S = 2.0  # how long what is told of the end of a run may take: the disk of the log may hang
_BLOCK_BYTES = 1 << 20


class _Tail:
    """The whole lines of an event log that were not read yet, also when it is renamed as it is full."""

    def __init__(self, path: Path, older: Path) -> None:
        self._path, self._older = path, older
        self._descriptor = -1
        self._begun = b""

    def close(self) -> None:
        if self._descriptor >= 0:
            os.close(self._descriptor)
        self._descriptor = -1

    @property
    def is_open(self) -> bool:
        return self._descriptor >= 0

    def lines(self) -> list[bytes]:
        """What came since the last time; nothing where the log can't be read now."""
        found: list[bytes] = []
        with contextlib.suppress(OSError):  # the log is beside the recording, which goes on without it
            if not self.is_open:
                self._open()
                with contextlib.suppress(FileNotFoundError):
                    if not os.path.samestat(self._older.lstat(), os.fstat(self._descriptor)):
                        found += read_own(self._older).splitlines()
            found += self._rest()
            while not os.path.samestat(self._path.lstat(), os.fstat(self._descriptor)):
                found += self._rest()  # what came between: nobody writes to one that has another name
                self.close()
                self._open()
                found += self._rest()
        return found

    def _open(self) -> None:
        self._begun = b""
        self._descriptor = open_own(self._path, os.O_RDONLY)

    def _rest(self) -> list[bytes]:
        found: list[bytes] = []
        while block := os.read(self._descriptor, _BLOCK_BYTES):
            *lines, self._begun = (self._begun + block).split(b"\n")
            found += lines
        return found


class EventTail:
    """The events of one run, each once, with the time stamp of its tick. Used by the writing thread.

    That may wait for a disk, as reading the log does; `has_ended` is for the other one.
    """

    def __init__(self, run: SegmentReader, since: int) -> None:
        """`since` is the number of the first event that counts."""
        reader = self._reader = SegmentReader(run.path, run.fileno())
        self._next = since
        folder, logger = reader.schema.folder, reader.schema.logger
        self._tail = _Tail(event_log_path(folder, logger), older_event_log(folder, logger))
        self._run = reader.schema.run
        self._unstamped: list[LoggedEvent] = []  # of ticks that are still to come
        self._is_over = False
        self._done_s = 0.0
        self._seen = 0  # the newest number, of whatever run
        self._before: LoggedEvent | None = None  # the newest line

    def close(self) -> None:
        """Let go of the log and the segment."""
        self._tail.close()
        self._reader.close()

    def read(self) -> tuple[LoggedEvent, ...]:
        """Return what came, as far as its time stamps are there."""
        found = [*self._unstamped, *self._fresh()]
        ticks = self._reader.ticks
        late = next((at for at, event in enumerate(found) if not event.stamp_ns and event.tick >= ticks), len(found))
        self._unstamped = found[late:]  # in their order: by number it is told what a part has
        return tuple(self._stamped(event) for event in found[:late])

    def _fresh(self) -> list[LoggedEvent]:
        found = []
        for event in decoded(self._tail.lines(), before=self._before):
            self._before = event
            self._seen = max(self._seen, event.number)
            if event.run == self._run and event.number >= self._next:
                self._next = event.number + 1
                found.append(event)
                self._is_over |= event.kind in (STOPPED, CRASHED)
        return found

    def _stamped(self, event: LoggedEvent) -> LoggedEvent:
        if event.stamp_ns:
            return event
        stamp_ns = self._reader.stamp_of(event.tick) if event.tick >= 0 else 0
        return msgspec.structs.replace(event, stamp_ns=stamp_ns or self._reader.last_time_ns or event.time_ns)

    def has_ended(self) -> bool:
        """Whether the end of a run that is over was told, or won't be: to be asked until it is."""
        self._done_s = self._done_s or time.monotonic()
        return self._is_over or not self._tail.is_open or time.monotonic() - self._done_s > LAST_WORDS_S

    def read_last(self, until: int, *, died: bool = False) -> tuple[LoggedEvent, ...]:
        """Return all that is left at the end; waits a while for event `until`, which the log is to have.

        Of a program that is gone, with what its event log is to have of its end, whoever writes it there. It
        `died`, too, where the kernel still clears up behind it: from the end of its sockets to that of its process time
        passes.
        """
        found = list(self.read())
        waited_s = time.monotonic()
        while self._seen < until and time.monotonic() - waited_s < LAST_WORDS_S:
            time.sleep(0.01)  # a file gives no sign
            found += self.read()
        found += map(self._stamped, self._unstamped)
        self._unstamped = []
        if self._reader.running and (died or not self._reader.alive()):
            log_end(self._reader)
            found += map(self._stamped, self._fresh())
        return tuple(found)

"""What happens in a run, for its parts: the lines of the event log as they come, read from its file.

From the file and not over the socket, so that a recorder has them whether or not the helper process lives that wrote
them, and one that goes on after a kill finds what its predecessor had not written yet. Changes of parameters are read
from the segment, which has them before the row from which on they hold: once the log tells of one, the part in which
its tick lies may be closed.
"""

import contextlib
import os
import time
from collections import deque
from collections.abc import Sequence
from pathlib import Path

import msgspec

from silo.core.elements import MARKER, PARAMETER, SEEN_LATE_NS, LoggedEvent
from silo.core.runtime import open_own, read_own
from silo.core.tuning.parameters import ParameterChange, ParameterValue
from silo.errors import SegmentError
from silo.files.event_log import CRASHED, STOPPED, decoded, event_log_path, lacking, older_event_log, read_events
from silo.recovery.left import log_end
from silo.segment.marks import SLOTS
from silo.segment.reader import SegmentReader

LAST_WORDS_S = 2.0  # how long what is told of the end of a run may take: the disk of the log may hang
MOST_UNMATCHED = 10_000  # changes of which the log has not told yet: where nobody writes it, it never does
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


class ParameterTail:
    """The changes of parameters in one run, for parts of it: of each what all were at its begin, and what changed then.

    Used by the writing thread.
    """

    def __init__(self, reader: SegmentReader) -> None:
        self._reader = reader
        self._seen = -1  # the number of the newest change, among those that landed
        self._values: dict[str, ParameterValue] = {}  # what each was at the begin of the part that is open
        self._since: dict[str, tuple[int, int]] = {}  # by tick and time of the change
        self._changes: list[LoggedEvent] = []  # since then
        self._waiting: list[LoggedEvent] = []  # those of them that are not in the part yet
        self._told: set[tuple[int, int, str]] = set()  # those that are in any
        self._unmatched: dict[tuple[int, int, str], None] = {}  # that are to come in the log, too
        self._start: LoggedEvent | None = None
        self._has_begun = False  # a part: what changed before the first one is in none

    def _look(self) -> None:
        """Take in what landed since the last time."""
        with contextlib.suppress(SegmentError):  # somebody cut it short, which others tell
            found = self._reader.changes(self._seen)
            if self._seen < 0 and found:
                self._start, *found = found
                self._unmatched[_identity(self._start)] = None
                self._values = {name: new for name, _, new in _values(self._start)}
                self._seen = 0
                kept = [one for one in found if one.change is not None and not one.change.is_image]
                if found and (len(kept) < len(found) or kept[0].number > 1):  # the oldest are overwritten
                    found = [*self._told_by_the_log(kept[0].time_ns if kept else time.time_ns()), *found]
            self._seen = found[-1].number if found else self._seen
            self._take(found)
            self._unmatched |= dict.fromkeys(map(_identity, found))
            while len(self._unmatched) > MOST_UNMATCHED:
                del self._unmatched[next(iter(self._unmatched))]

    def _told_by_the_log(self, until_ns: int) -> list[LoggedEvent]:
        schema = self._reader.schema
        with contextlib.suppress(OSError):
            told = read_events(schema.folder, schema.logger, schema.run)
            changes = [(one, one.change) for one in told if one.change is not None and one.time_ns < until_ns]
            return [one for one, change in changes if change.order > 0 or not change.is_image]
        return []

    def _take(self, changes: Sequence[LoggedEvent]) -> None:
        self._changes += changes
        self._waiting += changes

    def take_line(self, event: LoggedEvent) -> None:
        """Take in what the log tells of a change, which is known already unless it was overwritten in the segment."""
        self._look()
        if self._unmatched.pop(_identity(event), event) is event:
            self._take([event])

    def begin(self, tick: int) -> LoggedEvent | None:
        """Return what all parameters are at a tick, with which a part begins; None where there are none."""
        self._look()
        start, changes = self._start, self._changes
        if start is None:
            return None
        late = [one for one in changes if one.tick < tick and _identity(one) not in self._told]
        self._changes = [one for one in changes if one.tick >= tick or not tick]
        self._waiting = [*(late if self._has_begun and tick else ()), *self._changes]
        self._told.intersection_update(map(_identity, self._changes))
        self._has_begun = True
        if not tick:
            return start
        self._fold([one for one in changes if one.tick < tick])
        change = ParameterChange(tuple((name, None, value) for name, value in self._values.items()))
        text = start.text.replace("at the start", "at the begin of this part")
        now_ns, stamp_ns = time.time_ns(), self._reader.stamp_of(tick)
        told_ns = stamp_ns if 0 <= now_ns - stamp_ns < SEEN_LATE_NS else now_ns
        # before what changed since then, whenever that is written
        time_ns = min([told_ns, *(one.time_ns - 1 for one in self._changes)])
        return msgspec.structs.replace(start, text=text, time_ns=time_ns, tick=tick, change=change)

    def until(self, tick: int) -> list[LoggedEvent]:
        """Return what changed before a tick, and is not in the part that is open."""
        self._look()
        due = [one for one in self._waiting if one.tick < tick]
        self._waiting = [one for one in self._waiting if one.tick >= tick]
        self._told.update(map(_identity, due))
        return due

    def forget(self, tick: int) -> None:
        """Keep of changes before a tick, with which no part begins any more, what they left: there may be millions."""
        if len(self._changes) < MOST_UNMATCHED:
            return
        done = {_identity(one): one for one in self._changes if one.tick < tick and _identity(one) in self._told}
        self._fold(list(done.values()))
        self._changes = [one for one in self._changes if _identity(one) not in done]
        self._told -= done.keys()

    def _fold(self, changes: Sequence[LoggedEvent]) -> None:
        """Have what parameters are at the begin of a part be what these changes left."""
        for one in changes:
            for name, _, new in _values(one):
                if (one.tick, one.time_ns) >= self._since.get(name, (-1, 0)):
                    self._values[name], self._since[name] = new, (one.tick, one.time_ns)

    def has_more(self, tick: int) -> bool:
        """Whether there are changes that are in no part; `tick` is where the first one would begin."""
        self._look()
        since = [one for one in self._changes if self._has_begun or one.tick >= tick or not tick]
        return any(_identity(one) not in self._told for one in since)


def _identity(event: LoggedEvent) -> tuple[int, int, str]:
    return event.time_ns, event.tick, event.text


def _values(event: LoggedEvent) -> Sequence[tuple[str, ParameterValue | None, ParameterValue]]:
    return event.change.values if event.change is not None else ()


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
        self._marks: deque[LoggedEvent] = deque(maxlen=SLOTS)  # the newest of the run that the log told
        self.parameters = ParameterTail(reader)

    def close(self) -> None:
        """Let go of the log and the segment."""
        self._tail.close()
        self._reader.close()

    def read(self) -> tuple[LoggedEvent, ...]:
        """Return what came, as far as its time stamps are there."""
        found = [*self._unstamped, *self._fresh()]
        ticks = self._reader.ticks
        # what comes before the first tick has the stamp of that one
        waits = (at for at, event in enumerate(found) if not event.stamp_ns and max(event.tick, 0) >= ticks)
        late = next(waits, len(found))
        self._unstamped = found[late:]  # in their order: by number it is told what a part has
        return tuple(self._stamped(event) for event in found[:late])

    def _fresh(self) -> list[LoggedEvent]:
        found = []
        for event in decoded(self._tail.lines(), before=self._before):
            self._before = event
            self._seen = max(self._seen, event.number)
            if event.run == self._run and event.kind == MARKER:
                self._marks.append(event)
            if event.run == self._run and event.number >= self._next:
                self._next = event.number + 1
                if event.kind == PARAMETER:
                    self.parameters.take_line(event)
                else:
                    found.append(event)
                self._is_over |= event.kind in (STOPPED, CRASHED)
        return found

    def parameters_at(self, tick: int) -> tuple[LoggedEvent, ...]:
        """Return what all parameters are at the first tick of a part; nothing where there are none."""
        found = self.parameters.begin(tick)
        return () if found is None else (self._stamped(found),)

    def changes_until(self, tick: int, next_tick: int) -> tuple[LoggedEvent, ...]:
        """Return what parameters became at ticks of the present part, before this one, each once.

        `next_tick` is where the next part would begin, at the soonest.
        """
        found = tuple(map(self._stamped, self.parameters.until(tick)))
        self.parameters.forget(next_tick)
        return found

    def _stamped(self, event: LoggedEvent) -> LoggedEvent:
        if event.stamp_ns:
            return event
        stamp_ns = self._reader.stamp_of(max(event.tick, 0))
        return msgspec.structs.replace(event, stamp_ns=stamp_ns or self._reader.last_time_ns or event.time_ns)

    def has_ended(self) -> bool:
        """Whether the end of a run that is over was told, or won't be: to be asked until it is."""
        self._done_s = self._done_s or time.monotonic()
        return self._is_over or not self._tail.is_open or time.monotonic() - self._done_s > LAST_WORDS_S

    def read_last(self, until: int, *, died: bool = False) -> tuple[LoggedEvent, ...]:
        """Return all that is left at the end; waits a while for event `until`, which the log is to have.

        And for the program's newest mark, which reaches the log a little after it was set. Of a program that is gone,
        with what its event log is to have of its end, whoever writes it there. It `died`, too, where the kernel still
        clears up behind it: from the end of its sockets to that of its process time passes.
        """
        found = list(self.read())
        waited_s = time.monotonic()
        while self._seen < until or (not self._is_left(died=died) and self._lacks_mark()):
            if time.monotonic() - waited_s > LAST_WORDS_S:
                break
            time.sleep(0.01)  # a file gives no sign
            found += self.read()
        found += map(self._stamped, self._unstamped)
        self._unstamped = []
        if self._is_left(died=died):
            log_end(self._reader)
            found += map(self._stamped, self._fresh())
        return tuple(found)

    def _is_left(self, *, died: bool) -> bool:
        return self._reader.running and (died or not self._reader.alive())

    def _lacks_mark(self) -> bool:
        with contextlib.suppress(SegmentError):  # somebody cut it short, which others tell
            return bool(lacking(self._reader.marks()[-1:], self._marks))
        return False

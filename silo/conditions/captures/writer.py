"""Captures that wait to be written, and the thread that writes them: the judge never waits for a disk.

In turn of their triggers, and of each trigger not more than make sense: one that chatters makes captures faster than
any disk takes them. It must not keep those of others waiting, nor take the memory that they need.
"""

import logging
import math
import threading
import time
from collections import OrderedDict, deque
from collections.abc import Sequence
from typing import TYPE_CHECKING

from silo.core.elements import SavedFile
from silo.errors import SaveError, SiloError, lacks_descriptors
from silo.files.atomic import NearlyFullError
from silo.files.manifest import CaptureList
from silo.rpc.published import EventKind
from silo.state.events import EventNotifier
from silo.state.replica import Replica

if TYPE_CHECKING:
    from silo.conditions.captures.buffer import CaptureBuffer

log = logging.getLogger("silo.helper")

MOST_WAITING = 1000  # of a trigger that keeps all its captures; of others as many as it keeps, and LEAST_WAITING
LEAST_WAITING = 20
SETTLES_S = 1.0  # for the line of a capture in the event log to be on the disk
AGAIN_S = 0.5  # before another try of a capture for which no file could be opened
TOLD_S = 10.0  # what is left out is told together for so long
TOO_FAST = "it fired faster than they could be; give it a holdoff"


class WaitingCaptures:
    """A queue of captures for one thread that writes them. Any thread may call."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        # by run and trigger, next one first
        self._turns: OrderedDict[tuple[str, str], deque[CaptureBuffer]] = OrderedDict()
        self._under_way: CaptureBuffer | None = None
        # numbers of the first and the last, how many, and why
        self._dropped: dict[tuple[str, str], tuple[int, int, int, str]] = {}
        self._since_s: dict[tuple[str, str], float] = {}
        self._stop_s: float | None = None

    def add(self, buffer: "CaptureBuffer") -> bool:
        """Let a capture wait, the oldest of a trigger of which too many do goes; whether it is the first that went."""
        key = buffer.run, buffer.trigger
        with self._changed:
            waiting = self._turns.setdefault(key, deque())
            waiting.append(buffer)
            keep = buffer.options.keep
            too_many = len(waiting) > (max(keep, LEAST_WAITING) if keep else MOST_WAITING)
            self._changed.notify()
            return too_many and self.leave_out(waiting.popleft(), TOO_FAST)

    def leave_out(self, buffer: "CaptureBuffer", why: str) -> bool:
        """Count a capture that is not written; whether it is the first of its trigger since that was told."""
        key, number = (buffer.run, buffer.trigger), buffer.capture.number
        with self._changed:
            is_first = key not in self._dropped
            self._since_s.setdefault(key, time.monotonic())
            first, _, count, _ = self._dropped.get(key, (number, number, 0, ""))
            self._dropped[key] = first, number, count + 1, why
            return is_first

    def next(self) -> "CaptureBuffer | None":
        """Wait for a capture and return it, of each trigger one in turn; None at the end. It counts until `done`."""
        with self._changed:
            while not self._turns:
                if self._stop_s is not None:
                    return None
                self._changed.wait()
            if self._stop_s is not None and time.monotonic() >= self._stop_s:
                return None
            key, waiting = self._turns.popitem(last=False)
            self._under_way = waiting.popleft()
            if waiting:
                self._turns[key] = waiting  # behind the others
            return self._under_way

    def pause(self, seconds: float) -> bool:
        """Wait before the same capture is tried again; False where that must come to its end."""
        with self._changed:
            return not self._changed.wait_for(lambda: self._stop_s is not None, seconds)

    def done(self) -> list[tuple[str, str]]:
        """Take in that the capture is written; returns by run, in words, what was left out until some time ago."""
        with self._changed:
            self._under_way = None
            told_s = time.monotonic() - TOLD_S
            return [self._left_out(key) for key, since_s in list(self._since_s.items()) if since_s <= told_s]

    def _left_out(self, key: tuple[str, str]) -> tuple[str, str]:
        first, last, count, why = self._dropped.pop(key)
        del self._since_s[key]
        return key[0], f"{_captures(first, last, count)} of '{key[1]}' not written: {why}"

    def stop(self, within_s: float) -> None:
        """End `next` when nothing waits, or after so long."""
        with self._changed:
            self._stop_s = time.monotonic() + within_s
            self._changed.notify()

    def drop_all(self) -> tuple[list[tuple[str, str]], set[str]]:
        """Forget what waits; returns by run, in words, what was not written, and of which runs somebody still can."""
        with self._changed:
            texts = [self._left_out(key) for key in list(self._dropped)]
            for (run, trigger), waiting in self._turns.items():
                first, last = waiting[0].capture.number, waiting[-1].capture.number
                what = f"{_captures(first, last, len(waiting))} of '{trigger}' not written yet"
                why = "the disk was too slow for them when the logger was closed"
                texts.append((run, f"{what}: {why}; its next start does that, or `silo recover`"))
            runs = {run for run, _ in self._turns}
            self._turns.clear()
            return texts, runs

    def all(self) -> "list[CaptureBuffer]":
        """Return those that are not written yet, oldest of each trigger first."""
        with self._changed:
            under_way = [] if self._under_way is None else [self._under_way]
            return [*under_way, *(buffer for waiting in self._turns.values() for buffer in waiting)]


def _captures(first: int, last: int, count: int) -> str:
    return f"capture {first}" if count == 1 else f"{count} captures, numbers {first} to {last},"


class CaptureWriter:
    """Owns the thread. The other methods may be called by any thread."""

    def __init__(self, replica: Replica, events: EventNotifier) -> None:
        self._replica, self._events = replica, events
        self._waiting = WaitingCaptures()
        self._listed: CaptureList | None = None
        self.left: set[str] = set()  # runs with captures that wait for who comes after this process
        self._files: dict[tuple[str, str], tuple[str, ...]] = {}  # of the newest capture of a trigger of a run
        self._thread = threading.Thread(target=self._write_all, name="captures")
        self.start = self._thread.start

    def stop(self, within_s: float = math.inf) -> None:
        """Write what waits and end; what is not begun within that time is told, and left to others. Twice is fine."""
        self._waiting.stop(within_s)
        self._thread.join()
        texts, runs = self._waiting.drop_all()
        self.left |= runs
        self._tell_left_out(texts)

    def add(self, *buffers: "CaptureBuffer") -> None:
        """Have captures written."""
        for buffer in buffers:
            if self._waiting.add(buffer):
                text = (
                    f"trigger '{buffer.trigger}' fires faster than its captures can be written: the oldest that wait "
                    "are left out from here on; give it a holdoff"
                )
                self._events.publish(EventKind.SAVE_FAILED, text)

    @property
    def folder(self) -> str:
        """Where captures are written to."""
        return self._replica.now.robot.folder

    def waiting(self, run: str = "") -> "list[CaptureBuffer]":
        """Return the captures that are not written yet, of a run or of all."""
        return [one for one in self._waiting.all() if not run or one.run == run]

    @property
    def size_bytes(self) -> int:
        """Bytes of those."""
        return sum(one.size_bytes for one in self.waiting())

    def files(self, run: str, trigger: str) -> tuple[str, ...]:
        """Return the files of the newest capture of a trigger."""
        return self._files.get((run, trigger), ())

    # ------------------------------------------------------------------------------------------------- the thread

    def _write_all(self) -> None:
        while (buffer := self._waiting.next()) is not None:
            self._guarded(buffer)
            self._tell_left_out(self._waiting.done())
            del buffer  # while the thread waits, nothing must hold the memory of a segment that is gone

    def _tell_left_out(self, texts: Sequence[tuple[str, str]]) -> None:
        for run, text in texts:
            self._events.publish(EventKind.SAVE_FAILED, text, run=run)

    def _guarded(self, buffer: "CaptureBuffer") -> None:
        try:
            try:
                self._write_when_it_can(buffer)
            except NearlyFullError as error:
                if self._waiting.leave_out(buffer, str(error)):
                    text = f"captures of trigger '{buffer.trigger}' are left out from here on: {error}"
                    self._tell(buffer, EventKind.SAVE_FAILED, text)
            except SaveError as error:  # its writing process was killed, perhaps
                log.info("capture %d of '%s' is tried again: %s", buffer.capture.number, buffer.trigger, error)
                self._write_when_it_can(buffer)
        except Exception as error:
            # whatever a writer does, the next capture gets its chance, and clients hear of this one
            is_ours = isinstance(error, SiloError | OSError)
            log.log(logging.WARNING if is_ours else logging.ERROR, "a capture was not saved", exc_info=not is_ours)
            why = str(error) if is_ours else repr(error)
            text = f"capture {buffer.capture.number} of '{buffer.trigger}' was not saved: {why}"
            self._tell(buffer, EventKind.SAVE_FAILED, text)

    def _write_when_it_can(self, buffer: "CaptureBuffer") -> None:
        while True:
            try:
                self._write(buffer)
            except (OSError, SiloError) as error:  # noqa: PERF203  # it waits in between
                if not lacks_descriptors(error) or not self._waiting.pause(AGAIN_S):
                    raise
            else:
                return

    def _write(self, buffer: "CaptureBuffer") -> None:
        from silo.conditions.captures.files import write_capture

        folder, logger = self.folder, buffer.schema.logger
        if self._listed is None or not self._listed.is_of(folder, logger):
            self._listed = CaptureList(folder, logger)  # of one that was read before only what is new has to be read
        done = write_capture(buffer, folder, self._listed, self._events.log.of_run(buffer.run), leaves_room=True)
        told = self._events.log.texts(EventKind.CAPTURED.value, buffer.run) if done.files else ()
        if done.files and not any(file.path in text for file in done.files for text in told):
            self._tell(buffer, EventKind.CAPTURED, done.text, done.files)
            self._events.log.settle(SETTLES_S)  # it is waiting for until that is sure: whoever comes after this process
        self._files[buffer.run, buffer.trigger] = tuple(file.path for file in done.files)
        if done.removed:
            log.info("trigger '%s' keeps %d captures: removed %s", buffer.trigger, buffer.options.keep, done.removed)

    def _tell(self, buffer: "CaptureBuffer", kind: EventKind, text: str, files: Sequence[SavedFile] = ()) -> None:
        """Tell it of the capture's own run, which may be over, at the tick of what fired first."""
        fire = buffer.capture.fires[0]
        self._events.publish(
            kind, text, files=files, tick=fire.tick, stamp_ns=fire.time_ns, run=buffer.run, about=buffer.trigger
        )

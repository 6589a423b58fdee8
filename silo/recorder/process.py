"""One recorder from the helper's side: its process, its socket, and what it said last."""

import contextlib
import logging
import os
import socket
import threading
import time
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from silo.core.child import PIPE, ChildProcess
from silo.core.conditions import NO_CONDITIONS, Conditions
from silo.core.elements import RecorderState
from silo.core.runtime import process_facts, write_private
from silo.decoding import json_decoder
from silo.errors import SegmentError, lacks_descriptors
from silo.files.manifest import RecordedTotals, read_written
from silo.recorder.orders import (
    MAX_PACKET_BYTES,
    Finish,
    Follow,
    NewConditions,
    RecordOrder,
    Report,
    conditions_file,
    decode_report,
    encode,
    recorded_of,
)
from silo.segment.held_runs import Program
from silo.segment.reader import SegmentReader

# glibc answers each large block that is freed by keeping larger ones: within 3 minutes 54 MB became 68
HEAP = {"MALLOC_ARENA_MAX": "2", "MALLOC_MMAP_THRESHOLD_": str(2**20), "MALLOC_TRIM_THRESHOLD_": str(2**20)}

MOST_IN_HAND = 2  # the run that a recorder reads, and the one by which it knows that this one is over

log = logging.getLogger("silo.helper")


class RecorderHandover(msgspec.Struct, frozen=True):
    """What a helper process leaves for its successor of each recorder.

    `program` is whose runs it records; of an order that is over, but not done, `ending` says why: the runs that there
    are are recorded to their end, up to `last` where it is told, and none that come.
    """

    order: RecordOrder
    by: str
    since_ns: int
    program: Program = Program()
    ending: str = ""
    last: str = ""

    def wanted(self, runs: Sequence[str]) -> Sequence[str]:
        """Return which of these runs, oldest first, it is to record: those from its order to its end."""
        first, last = self.order.run, self.last
        runs = runs[runs.index(first) :] if first in runs else runs
        if not last:
            return runs
        return runs[: runs.index(last) + 1] if last in runs else ()  # memory goes oldest first


class Spare:
    """A process that has all of a recorder in memory and waits for an order.

    To import it takes 0.4 s of a processor, which on one that has much to do is longer than a short ring lasts.
    """

    def __init__(self) -> None:
        """Start it. Raises OSError."""
        self.socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            self.child = ChildProcess(
                "silo.recorder", [theirs.fileno(), os.getpid()], [theirs.fileno()], environment=HEAP
            )
        except BaseException:
            self.socket.close()
            raise
        finally:
            theirs.close()

    @property
    def is_ready(self) -> bool:
        """Whether it lives, and isn't frozen: an order that nobody takes up is a recording that stands still."""
        return self.child.is_there and process_facts(self.child.pid)[0] != "T"

    def end(self) -> None:
        """End it without an order: it holds nothing, and a frozen one would end for no other word."""
        self.socket.close()
        self.child.kill()


class RecorderProcess:
    """A recorder that was started. Methods are for who holds the lock of `EndlessRecordings`."""

    def __init__(self, kept: RecorderHandover) -> None:
        self.kept = kept
        self.report = Report(RecorderState.WAITING)
        self.runs: list[str] = []  # that it is to record and has not, oldest first
        self.known: set[str] = set()  # those, and those that it needs no more, or never did
        self._handed: set[str] = set()  # of them, to the process that lives
        self._conditions = NO_CONDITIONS  # of the newest, with it, or since
        self._ending: Finish | None = None
        self.useless_lives = 0  # in a row, in which it did not come to record
        self.again_s = 0.0  # when it is started again, 0 while it lives
        self.given_up = False  # it died each time it was to end: whoever comes after completes what it lacks
        self.reported = threading.Event()
        self.ended = threading.Event()

    @property
    def order(self) -> RecordOrder:
        """What it is to do."""
        return self.kept.order

    @property
    def ending(self) -> bool:
        """Whether it was told to end."""
        return self._ending is not None

    def start(self, order: RecordOrder, spare: Spare | None = None) -> None:
        """Start a process, or have one that is there do it. Raises OSError."""
        if spare is not None and not spare.is_ready:
            spare.end()
            spare = None
        fresh = spare or Spare()
        self.socket, self._child = fresh.socket, fresh.child
        self.socket.setblocking(False)
        self.again_s = 0.0
        self.started_s = time.monotonic()
        self._handed = set()
        self._is_told = False  # in this life that it is to end
        self.has_recorded = False  # likewise
        self._send(msgspec.structs.replace(order, runs=tuple(self.runs)))

    @property
    def goes_on(self) -> bool:
        """Whether something comes of it, now or later."""
        return not self.ended.is_set() or (self.given_up and bool(self.runs))

    @property
    def pid(self) -> int:
        """Process id."""
        return self._child.pid

    @property
    def is_live(self) -> bool:
        """Whether there is a process whose end was not noticed yet."""
        return not self.ended.is_set() and not self.again_s

    def lacks(self, run: str) -> bool:
        """Whether a run is to be handed over to the process that lives: with each it has that run's memory in hand."""
        in_hand = sum(one in self._handed for one in self.runs)
        return run not in self._handed and in_hand < MOST_IN_HAND and not self.again_s

    def follow(self, reader: SegmentReader, conditions: Conditions | None) -> bool:
        """Hand a run over, with the limits and triggers that it has now, None: those that it had last.

        False while no file can be opened for that.
        """
        if not self._send(Follow(str(reader.path)), reader.fileno(), conditions=conditions):
            return False
        self._handed.add(reader.schema.run)
        self._conditions = conditions or NO_CONDITIONS
        return True

    def change(self, conditions: Conditions, tick: Callable[[], int]) -> None:
        """Tell what is derived, limits and triggers of the run that it has, if they changed, and from which tick on."""
        before, now = recorded_of(self._conditions), recorded_of(conditions)
        is_new = (*before, self._conditions.derived) != (*now, conditions.derived)
        if is_new and not self.ending and not self.again_s and self._send(NewConditions(tick()), conditions=conditions):
            self._conditions = conditions

    def done(self, run: str) -> None:
        """It has all of a run in files."""
        if run in self.runs:
            self.runs.remove(run)

    def finish(self, why: str, events: int, *, died: bool = False, for_good: bool = True, last: str = "") -> None:
        """Have it finish what is there and end; `events` is the newest of the event log. One that dies is told anew.

        Not `for_good`: another helper process goes on with it. `last` is the run in which it ends, where others follow.
        """
        self._ending = Finish(why, events, died)
        self.kept = msgspec.structs.replace(self.kept, ending=why if for_good else "", last=last)
        self.finish_again()

    def finish_again(self) -> None:
        """Tell the process that lives, once it has all runs in hand that it is to record."""
        all_there = all(run in self._handed for run in self.runs)
        if self._ending is not None and all_there and not self.again_s and not self._is_told:
            self._is_told = True
            self._send(self._ending)

    def _send(self, message: msgspec.Struct, *descriptors: int, conditions: Conditions | None = None) -> bool:
        """Say something, with open files, of which `conditions` become the last one; whether no file was lacking."""
        with contextlib.ExitStack() as closing:
            try:
                files = [] if conditions is None else [conditions_file(conditions)]
                for file in files:
                    closing.callback(os.close, file)
                socket.send_fds(self.socket, [encode(message)], [*descriptors, *files])
            except OSError as error:
                return not lacks_descriptors(error)  # else it is gone: its end is noticed
        return True

    def receive(self) -> Report | None:
        """Return its next report, None at its end. Raises BlockingIOError where there is none."""
        try:
            body = self.socket.recv(MAX_PACKET_BYTES)
        except ConnectionResetError:  # it ended before it read all: the kernel tells that before its last words
            body = self.socket.recv(MAX_PACKET_BYTES)
        try:
            return decode_report(body) if body else None
        except msgspec.MsgspecError:
            return None

    def reap(self) -> int:
        """Return the exit code of a process that closed its socket."""
        self.socket.close()
        return self._child.wait()

    def sums(self) -> RecordedTotals:
        """Return what became of it, by its ledger; by its last words where that can't be read."""
        written = read_written(Path(self.order.folder), self.order.name)
        if written is not None and written.order == self.order.order:
            return written.sums()
        return RecordedTotals(self.report.parts, self.report.samples, self.report.lost)

    def place(self) -> Path:
        """Return where to look for it: its only file, or the folder of several."""
        folder = Path(self.order.folder)
        written = read_written(folder, self.order.name)
        own = [part.name for part in written.parts if part.name not in written.earlier] if written is not None else []
        return folder / own[0] if len(own) == 1 == self.sums().parts else folder


def close_left(folder: str) -> list[str]:
    """Close the parts that killed recorders left in a folder, in a process of its own; returns what was done."""
    with ChildProcess("silo.recorder", ["--close", folder], stdout=PIPE) as child:
        return child.stdout.read().decode().splitlines()


def store(path: Path, kept: list[RecorderHandover]) -> None:
    """Leave a list for the next helper process; an empty one is no file."""
    if not kept:
        path.unlink(missing_ok=True)
        return
    try:
        body = encode(kept)
        write_private(path, b"%08x\n%s" % (zlib.crc32(body), body))
    except OSError:
        log.exception("recorders would not outlive this helper process")


def stored(path: Path) -> list[RecorderHandover]:
    """Return the list that a helper process left. Raises SegmentError for one that is damaged."""
    try:
        data = path.read_bytes()
    except OSError:
        return []
    head, _, body = data.partition(b"\n")
    if head != b"%08x" % zlib.crc32(body):
        raise SegmentError(f"{path}: what was being recorded can't be read: the file is damaged")
    try:
        return json_decoder(list[RecorderHandover]).decode(body)
    except msgspec.MsgspecError as error:
        raise SegmentError(f"{path}: what was being recorded can't be read: {error}") from error

"""Endless recordings of this logger: starts a process for each, hands runs over, watches it, tells what it says.

One that dies is started again, and goes on with the row after the last one on the disk. What is under way is kept in
the runtime folder, so that the helper process after this one goes on with it, too.
"""

import contextlib
import logging
import os
import select
import threading
import time
from collections.abc import Callable
from pathlib import Path

import msgspec

from silo.errors import SegmentError
from silo.files.naming import check_name
from silo.helper.events import Events
from silo.helper.mirror import Mirror
from silo.helper.recorder_process import Kept, RecorderProcess, Spare, close_left, store, stored
from silo.helper.recording_folder import recording_folder
from silo.ipc.messages import Done, RecorderInfo, RecorderStarted, Refused, RefusedWhy, StartRecorder, StopRecorder
from silo.ipc.published import EventKind
from silo.model import BufferType, RecorderState
from silo.patterns import matching
from silo.recorder.orders import RecordOrder
from silo.runtime import process_start, runtime_dir

MOST_RECORDERS = 8
MOST_PATTERNS, MOST_PATTERN_LETTERS = 1000, 50_000
BEGIN_S = 5.0  # how long a client waits for the first report
END_S = 5.0  # and for a part to be finished
SPARE_S = 1.0  # after the start of a recorder
AGAIN_S = (0.0, 0.5, 2.0, 10.0, 30.0)  # before each new try, after so many that recorded nothing
SUFFIX = ".recorders"

log = logging.getLogger("silo.helper")


class Recording:
    """All recorders. `begin`, `end` and `infos` may be called by any thread."""

    def __init__(self, mirror: Mirror, events: Events) -> None:
        self._mirror, self._events = mirror, events
        self._lock = threading.RLock()
        self._recorders: dict[str, RecorderProcess] = {}
        self._wake = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._stopping = False
        self._spare: Spare | None = None  # only the thread's
        robot = mirror.now.robot
        self._kept = runtime_dir() / f"{robot.logger}.{robot.pid}{SUFFIX}"
        self._thread = threading.Thread(target=self._watch, name="recorders", daemon=True)

    def start(self) -> None:
        """Go on with what the helper process before this one recorded, and start the thread."""
        _sweep(runtime_dir())
        for kept in stored(self._kept):
            again = Kept(msgspec.structs.replace(kept.order, resume=True), kept.by, kept.since_ns)
            try:
                self._spawn(again)
            except OSError as error:
                self._failed(f"the recording '{kept.order.name}' could not go on: {error.strerror}", kept.by)
        self._thread.start()

    # ------------------------------------------------------------------------------------------------- by any thread

    def begin(
        self, request: StartRecorder, *, anywhere: bool = False, left_s: Callable[[float], float] = float
    ) -> RecorderStarted | Refused:
        """Start a recorder; waits for its first words. `left_s` tells how much of a time may still be waited."""
        checked = self._checked(request, anywhere=anywhere)
        if isinstance(checked, Refused):
            return checked
        with self._lock:
            name = self._free_name(request.name)
            if isinstance(name, Refused):
                return name
            order = msgspec.structs.replace(checked, name=name)
            try:
                recorder = self._spawn(Kept(order, request.client, time.time_ns()))
            except OSError as error:
                return Refused(RefusedWhy.FAILED, f"no process for the recorder: {error.strerror}; nothing is recorded")
        recorder.reported.wait(left_s(BEGIN_S))
        report = recorder.report
        if report.state is RecorderState.FAILED:
            recorder.ended.wait(left_s(END_S))  # its end is for the thread to notice
            with self._lock:
                self._recorders.pop(name, None)
            return Refused(RefusedWhy.FAILED, report.text)
        what = " ".join(request.patterns) or "all elements"
        self._tell(f"recording '{name}' of {what} to {order.folder}", request.client)
        return RecorderStarted(name, order.folder, self._warning(request))

    def _checked(self, request: StartRecorder, *, anywhere: bool) -> RecordOrder | Refused:
        robot = self._mirror.now.robot
        folder = recording_folder(request.folder, Path(robot.folder), anywhere=anywhere)
        if isinstance(folder, Refused):
            return folder
        problem = _wrong_numbers(request)
        table = self._mirror.now.table
        names = [info.name for info in (*table.elements, *table.derived)]
        for pattern in request.patterns:
            if not problem and not (pattern and matching(names, [pattern])):
                problem = f"no element matches '{pattern[:80]}'; `silo info -e` lists them"
        if problem:
            return Refused(RefusedWhy.INVALID, f"{problem}; nothing is recorded")
        return RecordOrder(
            request.name,
            str(folder),
            tuple(request.patterns),
            request.split_bytes,
            request.split_s,
            request.keep_bytes,
        )

    def _free_name(self, asked: str) -> str | Refused:
        logger = self._mirror.now.robot.logger
        live = {name for name, one in self._recorders.items() if not one.report.state.over}
        if len(live) >= MOST_RECORDERS:
            text = f"{MOST_RECORDERS} recordings are under way already: stop one first; nothing is recorded"
            return Refused(RefusedWhy.FAILED, text)
        if asked in live:
            text = f"a recording '{asked}' is under way already: stop it first, or choose another name (--name)"
            return Refused(RefusedWhy.EXISTS, f"{text}; nothing is recorded")
        numbered = (f"{logger}-{number}" for number in range(2, MOST_RECORDERS + 2))
        return asked or next(name for name in (logger, *numbered) if name not in live)

    def _warning(self, request: StartRecorder) -> str:
        """Of which elements a recording comes to an end: no ring passes every sample of them."""
        table = {info.name: info.options for info in self._mirror.now.table.elements}
        short = [
            name
            for name in matching(list(table), request.patterns)
            if table[name].enabled
            and table[name].buffer_type is not BufferType.LOOPING
            and not table[name].action.publishes
        ]
        if not short:
            return ""
        shown = ", ".join(short[:5]) + (f" and {len(short) - 5} more" if len(short) > 5 else "")
        return (
            f"{len(short)} of the elements are recorded only until their buffers are full ({shown}): "
            "set buffer=looping, or action=both, to record them without end"
        )

    def _spawn(self, kept: Kept) -> RecorderProcess:
        with self._lock:
            recorder = self._recorders[kept.order.name] = RecorderProcess(kept)
            self._follow(recorder)
            self._store()
        self._poke()
        return recorder

    def end(self, request: StopRecorder, *, left_s: Callable[[float], float] = float) -> Done | Refused:
        """Have a recorder finish its part; waits for that a while, as `begin` does."""
        with self._lock:
            name = request.name or (next(iter(self._recorders)) if len(self._recorders) == 1 else "")
            recorder = self._recorders.get(name)
            if recorder is None:
                names = ", ".join(f"'{one}'" for one in self._recorders)
                text = f"there are {names}" if names else "nothing is being recorded"
                what = f"no recording is called '{request.name[:80]}'" if request.name else "say which recording"
                return Refused(RefusedWhy.NOT_FOUND, f"{what}: {text}; nothing was stopped")
            why = f"stopped by {request.client}" if request.client else "stopped"
            recorder.finish(why, self._events.log.newest)
        over = recorder.ended.wait(left_s(END_S))
        with self._lock:
            if over:
                self._recorders.pop(name, None)
            self._store()
        report = recorder.report
        held = f"{report.parts} files, {report.samples} samples, {report.lost} lost"
        if not over:
            return Done(f"recording '{name}' ends: {held}; it is still finishing its last part")
        return Done(f"recording '{name}' ended: {held}, in {recorder.order.folder}")

    def infos(self) -> list[RecorderInfo]:
        """Return what there is."""
        with self._lock:
            return [_info(recorder) for recorder in self._recorders.values()]

    def follow_present(self) -> None:
        """Hand the present run over to all recorders that don't have it."""
        with self._lock:
            for recorder in self._recorders.values():
                self._follow(recorder)

    def _follow(self, recorder: RecorderProcess) -> None:
        extras = self._mirror.now.robot.extras
        if not self._mirror.run or recorder.run == self._mirror.run:
            recorder.change(extras)
            return
        try:
            reader = self._mirror.open_reader()
        except SegmentError as error:
            log.warning("a run can't be recorded: %s", error)
            return
        if reader is not None:
            recorder.follow(reader.schema.run, reader.path, reader.fileno(), extras)
            reader.close()

    def stop(self, *, forget: bool) -> None:
        """Have all of them finish; returns at once. `forget`: no helper process after this one goes on with them."""
        with self._lock:
            self._stopping = True
            if forget:
                store(self._kept, [])
            why = "the logger was closed, or its program ended" if forget else "the helper process ends"
            for recorder in self._recorders.values():
                recorder.finish(why, self._events.log.newest)
        self._poke()

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait until all have ended."""
        if self._thread.is_alive():
            self._thread.join(timeout_s)

    # --------------------------------------------------------------------------------------------------- the thread

    def _watch(self) -> None:
        while True:
            with self._lock:
                live = {one.socket.fileno(): one for one in self._recorders.values() if one.is_live}
                waiting = [one for one in self._recorders.values() if one.again_s]
                self._mirror.recorders = len(live) + len(waiting)
                if not live and (self._stopping or not waiting):
                    self._let_spare_go()
                if self._stopping and not live:
                    return
            for one in waiting:
                self._start_again(one)
            readable = select.select([*live, self._wake], [], [], 0.2 if waiting else None)[0]
            if self._wake in readable:
                with contextlib.suppress(BlockingIOError):
                    os.eventfd_read(self._wake)
            for descriptor, recorder in live.items():
                if descriptor in readable:
                    self._take(recorder)

    def _poke(self) -> None:
        os.eventfd_write(self._wake, 1)

    def _take(self, recorder: RecorderProcess) -> None:
        try:
            report = recorder.receive()
        except BlockingIOError:
            return
        if report is None:
            self._gone(recorder)
            return
        recorder.report = report
        recorder.has_recorded = recorder.has_recorded or report.state is RecorderState.RECORDING
        recorder.reported.set()
        self._keep_spare(recorder)
        if report.finished:
            self._tell(f"recording '{recorder.order.name}': finished {report.finished}")
        if report.told:
            self._tell(f"recording '{recorder.order.name}': {report.told}")

    def _keep_spare(self, recorder: RecorderProcess) -> None:
        """Have a process ready for the case that a recorder is killed, once one records and has caught up."""
        records = recorder.report.state is RecorderState.RECORDING
        if self._spare is None and records and time.monotonic() - recorder.started_s > SPARE_S:
            with contextlib.suppress(OSError):  # then the next one takes longer
                self._spare = Spare()

    def _let_spare_go(self) -> None:
        if self._spare is not None:
            self._spare.end()
            self._spare = None

    def _gone(self, recorder: RecorderProcess) -> None:
        code = recorder.reap()
        name, report = recorder.order.name, recorder.report
        if report.state.over:
            recorder.reported.set()
            recorder.ended.set()
            text = f"recording '{name}' ended: {report.text}"
            if report.state is RecorderState.FAILED:
                self._failed(text, recorder.kept.by)
            else:
                self._tell(f"{text}; {report.parts} files, {report.samples} samples, {report.lost} lost")
            with self._lock:
                self._store()
            return
        if recorder.ending or self._stopping:
            for line in close_left(recorder.order.folder):
                self._tell(f"recording '{name}': {line}")
            self._over(recorder, f"its process died (exit code {code}) while it ended; its last part was closed")
            return
        recorder.useless_lives = 0 if recorder.has_recorded else recorder.useless_lives + 1
        recorder.report = msgspec.structs.replace(report, state=RecorderState.DIED)
        recorder.again_s = time.monotonic() + AGAIN_S[min(recorder.useless_lives, len(AGAIN_S) - 1)]
        self._tell(f"recording '{name}': its process died (exit code {code}); it is started again and goes on")

    def _over(self, recorder: RecorderProcess, text: str) -> None:
        recorder.report = msgspec.structs.replace(recorder.report, state=RecorderState.FAILED, text=text)
        recorder.reported.set()
        recorder.ended.set()
        self._failed(f"recording '{recorder.order.name}' ended: {text}", recorder.kept.by)
        with self._lock:
            self._store()

    def _start_again(self, recorder: RecorderProcess) -> None:
        with self._lock:
            if recorder.ending or self._stopping:
                recorder.again_s = 0.0
                self._over(recorder, "it was stopped while it was started again")
                return
            if time.monotonic() < recorder.again_s:
                return
            try:
                spare, self._spare = self._spare, None
                recorder.start(msgspec.structs.replace(recorder.order, resume=True), spare)
            except OSError as error:
                recorder.again_s = time.monotonic() + AGAIN_S[-1]
                log.warning("recorder '%s' can't be started: %s", recorder.order.name, error.strerror)
                return
            self._follow(recorder)

    def _store(self) -> None:
        if not self._stopping:
            alive = [one.kept for one in self._recorders.values() if not one.ended.is_set() and not one.ending]
            store(self._kept, alive)

    def _tell(self, text: str, by: str = "") -> None:
        log.info("%s", text)
        self._events.publish(EventKind.RECORDING, text, by=by)

    def _failed(self, text: str, by: str) -> None:
        log.warning("%s", text)
        self._events.publish(EventKind.RECORDING_FAILED, text, by=by)


def _info(recorder: RecorderProcess) -> RecorderInfo:
    order, report = recorder.order, recorder.report
    return RecorderInfo(
        name=order.name,
        folder=order.folder,
        state=report.state,
        patterns=list(order.patterns),
        split_bytes=order.split_bytes,
        split_s=order.split_s,
        keep_bytes=order.keep_bytes,
        part=report.part,
        parts=report.parts,
        size_bytes=report.size_bytes,
        samples=report.samples,
        lost=report.lost,
        since_ns=recorder.kept.since_ns,
        by=recorder.kept.by,
        text=report.text,
        pid=recorder.pid,
        written_bytes=report.written_bytes,
    )


def _wrong_numbers(request: StartRecorder) -> str:
    from silo.amounts import LEAST_SPLIT_BYTES, LEAST_SPLIT_S, MOST_BYTES, MOST_SPLIT_S
    from silo.errors import SaveError

    if request.name:
        try:
            check_name(request.name)
        except SaveError as error:
            return str(error)
    if len(request.patterns) > MOST_PATTERNS or sum(map(len, request.patterns)) > MOST_PATTERN_LETTERS:
        return (
            f"at most {MOST_PATTERNS} patterns of {MOST_PATTERN_LETTERS} letters together, got {len(request.patterns)}"
        )
    if request.split_bytes and not LEAST_SPLIT_BYTES <= request.split_bytes <= MOST_BYTES:
        return f"a part must have {LEAST_SPLIT_BYTES} bytes or more, got {request.split_bytes}"
    if request.split_s and not LEAST_SPLIT_S <= request.split_s <= MOST_SPLIT_S:  # also false for NaN
        return f"a part must last from {LEAST_SPLIT_S:g} s to 31 days, got {request.split_s}"
    if request.keep_bytes and not 2 * LEAST_SPLIT_BYTES <= request.keep_bytes <= MOST_BYTES:
        return f"keep must be {2 * LEAST_SPLIT_BYTES} bytes or more, got {request.keep_bytes}"
    return ""


def _sweep(folder: Path) -> None:
    """Lists of loggers whose programs are gone."""
    for path in folder.glob(f"*{SUFFIX}"):
        pid = path.name.removesuffix(SUFFIX).rpartition(".")[2]
        if pid.isdecimal() and not process_start(int(pid)):
            path.unlink(missing_ok=True)

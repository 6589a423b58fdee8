"""Endless recordings of this logger: starts a process for each, hands runs over, watches it, tells what it says.

One that dies is started again, and goes on with the row after the last one on the disk. What is under way is kept in
the runtime folder, so that the helper process after this one goes on with it, too.
"""

import contextlib
import itertools
import logging
import os
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
from msgspec.structs import asdict

from silo.core.arguments import check_name
from silo.core.elements import BufferType, RecorderState, State
from silo.core.names import matching
from silo.core.quantities.writing import and_more, many, size_text
from silo.decoding import converted
from silo.errors import SegmentError, lacks_descriptors, reason
from silo.files.manifest import RecordedTotals, size_of_parts
from silo.polling import readable
from silo.recorder import requests
from silo.recorder.orders import CLOSED, RecordOrder
from silo.recorder.process import RecorderHandover, RecorderProcess, Spare, close_left, store, stored
from silo.recorder.requests import (
    RecorderInfo,
    Recorders,
    RecorderStarted,
    StartRecorder,
    StopRecorder,
    recording_folder,
)
from silo.rpc.published import EventKind
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.rpc.serving import Server, Turn
from silo.segment.held_runs import child_of, recorders_path
from silo.segment.retention import ending_by_time, kept_how
from silo.state.events import EventNotifier
from silo.state.held_runs import HeldRuns
from silo.state.replica import Replica
from silo.state.robot_program import RobotProgram

MOST_RECORDERS = 8
SETTLED_S = 0.5  # for what happened until then to have its number in the event log, by which a recorder looks for it
MOST_PATTERNS, MOST_PATTERN_LETTERS = 1000, 50_000
BEGIN_S = 5.0  # how long a client waits for the first report
END_S = 5.0  # and for a part to be finished
SPARE_S = 1.0  # after the start of a recorder
AGAIN_S = (0.0, 0.5, 2.0, 10.0, 30.0)  # before each new try, after so many that recorded nothing
MOST_ENDS = 3  # how often one is started again that is to end and dies before it recorded anything

log = logging.getLogger("silo.helper")


@dataclass(frozen=True)
class RecorderServer(Server, does=[requests]):
    """Has recorders begin and end, and tells of them."""

    recording: "EndlessRecordings"
    robot: RobotProgram

    def list_recorders(self) -> Recorders:
        return Recorders(self.recording.infos())

    def start_recorder(self, turn: Turn, request: StartRecorder) -> RecorderStarted:
        self.robot.must_live()
        return self.recording.begin(msgspec.structs.replace(request, client=turn.by), left_s=turn.left_s)

    def stop_recorder(self, turn: Turn, request: StopRecorder) -> str:
        return self.recording.end(msgspec.structs.replace(request, client=turn.by), left_s=turn.left_s)


class EndlessRecordings:
    """All recorders. `begin`, `end` and `infos` may be called by any thread."""

    def __init__(self, replica: Replica, events: EventNotifier, held: HeldRuns) -> None:
        self._replica, self._events, self._held = replica, events, held
        self._lock = threading.RLock()
        self._recorders: dict[str, RecorderProcess] = {}
        self._wake = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._stopping = False
        self._forgets = False
        self._spare: Spare | None = None  # only the thread's
        robot, options = replica.now.robot, replica.now.options
        self._program = child_of(robot.logger, options.id, robot.pid)
        self._kept = recorders_path(robot.logger, options.id)
        self._thread = threading.Thread(target=self._watch, name="recorders", daemon=True)

    def start(self) -> None:
        """Go on with what the helper process before this one recorded, and start the thread."""
        for kept in self._stored():
            order = msgspec.structs.replace(kept.order, resume=True)
            try:
                self._spawn(msgspec.structs.replace(kept, order=order, program=self._program))
            except OSError as error:
                self._tell(f"the recording '{kept.order.name}' could not go on: {reason(error)}", kept.by, failed=True)
        self._thread.start()

    def _stored(self) -> list[RecorderHandover]:
        try:
            return stored(self._kept)
        except SegmentError as error:
            self._kept.unlink(missing_ok=True)  # told once
            self._tell(f"{error}; record again, and `silo recover` closes what there is", failed=True)
            return []

    def needs(self, run: str) -> bool:
        """Whether a recorder is not done with a run. For the main thread."""
        with self._lock:
            return any(run in one.runs for one in self._recorders.values() if one.goes_on)

    # ------------------------------------------------------------------------------------------------- by any thread

    def begin(
        self, request: StartRecorder, *, anywhere: bool = False, left_s: Callable[[float], float] = float
    ) -> RecorderStarted:
        """Start a recorder; waits for its first words. `left_s` tells how much of a time may still be waited.

        Raises RequestRefusedError.
        """
        checked = self._checked(request, anywhere=anywhere)
        with self._lock:
            name = self._free_name(request.name)
            self._give_up(name)
            order = msgspec.structs.replace(checked, name=name, order=secrets.token_hex(8), **self._present())
            warnings = [_earlier(order), self._warning(request)]
            try:
                recorder = self._spawn(RecorderHandover(order, request.client, time.time_ns(), self._program))
            except OSError as error:
                text = f"no process for the recorder: {reason(error)}; nothing is recorded"
                raise RequestRefusedError(RefusedWhy.FAILED, text) from error
        recorder.reported.wait(left_s(BEGIN_S))
        report = recorder.report
        if report.state is RecorderState.FAILED:
            recorder.ended.wait(left_s(END_S))  # its end is for the thread to notice
            with self._lock:
                self._recorders.pop(name, None)
            raise RequestRefusedError(RefusedWhy.FAILED, report.text)
        what = " ".join(request.patterns) or "all elements"
        self._tell(f"recording '{name}' of {what} to {order.folder}", request.client)
        return RecorderStarted(name, order.folder, "; ".join(filter(None, warnings)))

    def _checked(self, request: StartRecorder, *, anywhere: bool) -> RecordOrder:
        robot = self._replica.now.robot
        folder = recording_folder(request.folder, Path(robot.folder), anywhere=anywhere)
        problem = _wrong_numbers(request)
        table = self._replica.now.table
        names = [info.name for info in (*table.elements, *table.derived)]
        for pattern in request.patterns:
            if not problem and not (pattern and matching(names, [pattern])):
                problem = f"no element matches '{pattern[:80]}'; `silo info -e` lists them"
        if problem:
            raise RequestRefusedError(RefusedWhy.INVALID, f"{problem}; nothing is recorded")
        return converted({**asdict(request), "folder": str(folder)}, RecordOrder)

    def _free_name(self, asked: str) -> str:
        logger = self._replica.now.robot.logger
        live = {name for name, one in self._recorders.items() if not one.report.state.over}
        if len(live) >= MOST_RECORDERS:
            text = f"{MOST_RECORDERS} recordings are under way already: stop one first; nothing is recorded"
            raise RequestRefusedError(RefusedWhy.FAILED, text)
        if asked in live:
            text = f"a recording '{asked}' is under way already: stop it first, or choose another name (--name)"
            raise RequestRefusedError(RefusedWhy.EXISTS, f"{text}; nothing is recorded")
        numbered = (f"{logger}-{number}" for number in itertools.count(2))
        taken = {name for name, one in self._recorders.items() if one.goes_on}
        return asked or next(name for name in itertools.chain([logger], numbered) if name not in taken)

    def _give_up(self, name: str) -> None:
        """Let go of what was to be completed later of a recording: another one of that name has its ledger."""
        left = self._recorders.get(name)
        if left is not None and left.given_up and left.runs:
            left.given_up = False
            self._tell(f"recording '{name}': what was still in memory of it is lost: another one of that name begins")

    def _warning(self, request: StartRecorder) -> str:
        """Of which elements a recording comes to an end: no ring passes every sample of them."""
        table = {info.name: info.options for info in self._replica.now.table.elements}
        short = [
            name
            for name in matching(list(table), request.patterns)
            if table[name].enabled and table[name].buffer is not BufferType.LOOPING and not table[name].action.publishes
        ]
        limit_s, told = self._replica.now.options.max_time_s, list[str]()
        if short:
            are, full = ("is", "its buffer is") if len(short) == 1 else ("are", "their buffers are")
            told.append(
                f"{many(len(short), 'element')} {are} recorded only until {full} full ({and_more(short, 5)}), or, "
                "where it grows, until there is no memory; buffer=looping or action=both has them recorded without end"
            )
        if ending := ending_by_time(kept_how(self._replica.now.table.elements), limit_s):
            told.append(
                f"the logger stops by itself {limit_s:g} s after each start (max_time), and nothing is recorded then, "
                f"as not all buffers are looping ({and_more(ending, 3)}): make them, or give max_time=0 in its program"
            )
        return "; ".join(told)

    def _present(self) -> dict[str, Any]:
        """The run in which an order is given, and its newest tick."""
        with contextlib.suppress(SegmentError):
            reader = self._replica.open_reader()
            if reader is not None:
                with contextlib.closing(reader):
                    return {"run": reader.schema.run, "tick": reader.ticks}
        return {}

    def _spawn(self, kept: RecorderHandover) -> RecorderProcess:
        with self._lock:
            # first: should all be killed now, whoever comes knows of it
            store(self._kept, [*self._living(), kept])
            recorder = RecorderProcess(kept)
            runs = self._held.ids()
            recorder.known = set(runs) - set(kept.wanted(runs))
            self._assign(recorder)
            recorder.start(kept.order)
            self._recorders[kept.order.name] = recorder
            self._follow(recorder)
            if kept.ending:
                recorder.finish(kept.ending, self._events.log.newest, last=kept.last)
            self._store()
        self._poke()
        return recorder

    def end(self, request: StopRecorder, *, left_s: Callable[[float], float] = float) -> str:
        """Have a recorder finish its part; waits for that a while, as `begin` does. Raises RequestRefusedError."""
        newest = self._events.log.settle(left_s(SETTLED_S))
        with self._lock:
            live = [name for name, one in self._recorders.items() if not one.given_up] or list(self._recorders)
            name = request.name or (live[0] if len(live) == 1 else "")
            recorder = self._recorders.get(name)
            if recorder is None:
                names = ", ".join(f"'{one}'" for one in self._recorders)
                text = f"there are {names}" if names else "nothing is being recorded"
                what = f"no recording is called '{request.name[:80]}'" if request.name else "say which recording"
                raise RequestRefusedError(RefusedWhy.NOT_FOUND, f"{what}: {text}; nothing was stopped")
            if recorder.given_up:
                return f"recording '{name}' is over: {recorder.report.text}"
            why = f"stopped by {request.client}" if request.client else "stopped"
            recorder.finish(why, newest, last=self._replica.run)
        over = recorder.ended.wait(left_s(END_S))
        with self._lock:
            if over and not recorder.given_up:
                self._recorders.pop(name, None)
            self._store()
        if not over:
            report = recorder.report
            held = RecordedTotals(report.parts, report.samples, report.lost).text
            return f"recording '{name}' ends: {held} until now; it is still finishing its last part"
        room = recorder.order.keep_bytes
        kept = f", of which the newest stay within {size_text(room)}" if room else ""
        why = f"{recorder.report.text}; " if recorder.report.state is RecorderState.FAILED else ""
        return f"recording '{name}' ended, in {recorder.place()}: {why}{recorder.sums().text}{kept}"

    def infos(self) -> list[RecorderInfo]:
        """Return what there is, and of what waits why its logger stands still."""
        with self._lock:
            infos = [_info(recorder) for recorder in self._recorders.values()]
        robot = self._replica.now.robot
        still = f"the logger stands still: {robot.reason}" if robot.state is State.STOPPED and robot.reason else ""
        return [
            msgspec.structs.replace(one, text=one.text or still) if one.state is RecorderState.WAITING else one
            for one in infos
        ]

    def follow_present(self) -> None:
        """Hand the present run over to all recorders that don't have it."""
        with self._lock:
            for recorder in self._recorders.values():
                self._follow(recorder)

    def _assign(self, recorder: RecorderProcess) -> None:
        """Have it record all runs that there are, but those from before its order or after its end."""
        for run in self._held.ids():
            if run not in recorder.known and not recorder.ending:
                recorder.known.add(run)
                recorder.runs.append(run)

    def _follow(self, recorder: RecorderProcess) -> None:
        self._assign(recorder)
        for run in recorder.runs:
            if recorder.lacks(run) and not self._hand_over(recorder, run):
                return  # it comes again, and they go over in their order; what is told is of the newest that did
        if self._replica.run in recorder.runs and self._replica.now.robot.segment == self._replica.segment:
            recorder.change(self._replica.now.robot.conditions, lambda: self._present().get("tick", 0))

    def _hand_over(self, recorder: RecorderProcess, run: str) -> bool:
        try:
            reader = self._held.open(run)
        except SegmentError as error:
            if not lacks_descriptors(error):
                recorder.done(run)
                self._tell(f"recording '{recorder.order.name}': run {run} can't be recorded: {error}", failed=True)
            return False
        if reader is None:
            return False
        with contextlib.closing(reader):
            return recorder.follow(reader, self._held.conditions(run))

    def stop(self, *, forget: bool, died: bool = False) -> None:
        """Have all of them finish; returns at once. `forget`: no helper process after this one goes on with them.

        What none of them comes to finish is completed by who comes after, all the same. `died`: the program, without
        a word.
        """
        newest = self._events.log.settle(SETTLED_S)
        with self._lock:
            self._stopping = True
            self._forgets = forget
            why = CLOSED if forget else "the helper process ends"
            for recorder in self._recorders.values():
                if not recorder.ending:
                    recorder.finish(why, newest, died=died, for_good=forget)
            self._store()
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
                self._count()
                if not live and not waiting and self._spare is not None:
                    self._spare.end()
                    self._spare = None
                if self._stopping and not live and not waiting:
                    return
            for one in waiting:
                self._start_again(one)
            ready = readable(*live, self._wake, timeout_s=0.2 if waiting else None)
            if self._wake in ready:
                with contextlib.suppress(BlockingIOError):
                    os.eventfd_read(self._wake)
            for descriptor, recorder in live.items():
                if descriptor in ready:
                    self._take(recorder)

    def _count(self, over: RecorderProcess | None = None) -> None:
        """Have clients see how many are under way, but for one that is just being told to be over."""
        under_way = [one for one in self._recorders.values() if one is not over and (one.is_live or one.again_s)]
        self._replica.recorders = len(under_way)

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
        before, recorder.report = recorder.report, report
        # of two reports, as the first comes before anything is in a file
        recorder.has_recorded |= before.state is report.state is RecorderState.RECORDING
        recorder.reported.set()
        if report.done:
            with self._lock:
                recorder.done(report.done)
                self._follow(recorder)
                recorder.finish_again()
            self._held.changed()
        self._keep_spare(recorder)
        # a loss, or a part, belongs to the run that lacks the ticks, or has them, which may be over
        tick = report.told_tick if report.told_run and report.told_tick >= 0 else None
        for told in filter(None, [report.finished and f"finished {report.finished}", report.told]):
            self._tell(f"recording '{recorder.order.name}': {told}", run=report.told_run, tick=tick)

    def _keep_spare(self, recorder: RecorderProcess) -> None:
        """Have a process ready for the case that a recorder is killed, once one records and has caught up."""
        records = recorder.report.state is RecorderState.RECORDING
        if self._spare is None and records and time.monotonic() - recorder.started_s > SPARE_S:
            with contextlib.suppress(OSError):  # then the next one takes longer
                self._spare = Spare()

    def _gone(self, recorder: RecorderProcess) -> None:
        code = recorder.reap()
        name, report = recorder.order.name, recorder.report
        if report.state.over:
            self._over(recorder, report.text, failed=report.state is RecorderState.FAILED)
            return
        recorder.useless_lives = 0 if recorder.has_recorded else recorder.useless_lives + 1
        if recorder.ending and recorder.useless_lives >= MOST_ENDS:
            for line in close_left(recorder.order.folder):
                self._tell(f"recording '{recorder.order.name}': {line}")
            recorder.given_up = True
            text = f"its process died (exit code {code}) each time it was to end"
            if recorder.runs:
                text += "; what is in no file stays in memory, and the next start of this logger, or `silo recover`, "
                text += "completes it"
            self._over(recorder, text, failed=True)
            return
        recorder.report = msgspec.structs.replace(report, state=RecorderState.DIED)
        recorder.again_s = time.monotonic() + AGAIN_S[min(recorder.useless_lives, len(AGAIN_S) - 1)]
        goes_on = "is started again, to end" if recorder.ending else "is started again and goes on"
        self._tell(f"recording '{name}': its process died (exit code {code}); it {goes_on}")

    def _over(self, recorder: RecorderProcess, text: str, *, failed: bool) -> None:
        """It comes to nothing more: told with what became of it, by its ledger."""
        state = RecorderState.FAILED if failed else RecorderState.ENDED
        recorder.again_s = 0.0
        sums, last = recorder.sums(), recorder.report
        recorder.report = msgspec.structs.replace(
            last, state=state, text=text, parts=sums.parts, samples=sums.samples, lost=sums.lost
        )
        with self._lock:
            if not failed:
                recorder.runs.clear()
            self._count(recorder)
        told = f"recording '{recorder.order.name}' ended: {text}; {sums.text}"
        # other runs may have come since: it failed in this one, or was to end in that; the last words of one that died
        # are of something else
        run = "" if not last.state.over else last.told_run if failed else recorder.kept.last
        tick = last.told_tick if run and run == last.told_run and last.told_tick >= 0 else None
        self._tell(told, recorder.kept.by if failed else "", run=run, tick=tick, failed=failed)
        recorder.reported.set()
        recorder.ended.set()
        with self._lock:
            self._store()
        self._held.changed()

    def _start_again(self, recorder: RecorderProcess) -> None:
        with self._lock:
            if time.monotonic() < recorder.again_s:
                return
            self._assign(recorder)
            try:
                spare, self._spare = self._spare, None
                recorder.start(msgspec.structs.replace(recorder.order, resume=True), spare)
            except OSError as error:
                recorder.again_s = time.monotonic() + AGAIN_S[-1]
                log.warning("recorder '%s' can't be started: %s", recorder.order.name, reason(error))
                return
            self._follow(recorder)
            recorder.finish_again()

    def _living(self) -> list[RecorderHandover]:
        goes_on = self._stopping and not self._forgets  # with another process
        recorders = self._recorders.values()
        return [one.kept for one in recorders if one.goes_on or (goes_on and not one.kept.ending)]

    def _store(self) -> None:
        """Leave what is under way for who comes after, and what is ending as long as it is not over."""
        store(self._kept, self._living())

    def _tell(self, text: str, by: str = "", *, run: str = "", tick: int | None = None, failed: bool = False) -> None:
        log.log(logging.WARNING if failed else logging.INFO, "%s", text)
        kind = EventKind.RECORDING_FAILED if failed else EventKind.RECORDING
        self._events.publish(kind, text, by=by, run=run, tick=tick)


def _info(recorder: RecorderProcess) -> RecorderInfo:
    kept = recorder.kept
    facts = {**asdict(kept.order), **asdict(recorder.report), **asdict(kept), "pid": recorder.pid}
    return converted(facts, RecorderInfo)


def _earlier(order: RecordOrder) -> str:
    """Return that a budget is of all parts of its name; what a recording is to keep may be what one wanted to keep."""
    left_bytes = size_of_parts(Path(order.folder), order.name) if order.keep_bytes else 0
    if not left_bytes:
        return ""
    return (
        f"{size_text(left_bytes)} of earlier recordings '{order.name}' count into the {size_text(order.keep_bytes)}, "
        "and are deleted first: another name keeps them"
    )


def _wrong_numbers(request: StartRecorder) -> str:
    from silo.core.quantities.reading import LEAST_SPLIT_BYTES, LEAST_SPLIT_S, MOST_BYTES, MOST_SPLIT_S
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
        return f"a part must have from {LEAST_SPLIT_BYTES} to {MOST_BYTES} bytes, got {request.split_bytes}"
    if request.split_s and not LEAST_SPLIT_S <= request.split_s <= MOST_SPLIT_S:  # also false for NaN
        return f"a part must last from {LEAST_SPLIT_S:g} s to 31 days, got {request.split_s}"
    if request.keep_bytes and not 2 * LEAST_SPLIT_BYTES <= request.keep_bytes <= MOST_BYTES:
        return f"keep must be from {2 * LEAST_SPLIT_BYTES} to {MOST_BYTES} bytes, got {request.keep_bytes}"
    return ""

"""The judge thread: triggers and limits of the present run, and the files of what is captured.

Two threads: one judges and copies rows before they are overwritten, one writes files, which may take its time.
"""

import concurrent.futures
import dataclasses
import logging
import queue
import shutil
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from silo.collecting.segment_reader import SegmentReader
from silo.errors import ElementError, SaveError, SegmentError, SiloError
from silo.helper.events import Events
from silo.helper.mirror import Mirror
from silo.ipc.conditions import LimitStatus, LimitWord, TriggerStatus, TriggerWord
from silo.ipc.published import EventKind
from silo.model import NO_EXTRAS, Extras, FileType, SavedFile, TriggerOptions
from silo.recording import with_events

if TYPE_CHECKING:
    # 1.4 MB that a helper without triggers doesn't need
    from silo.helper.segment_judge import SegmentJudge, Step
    from silo.helper.spool import Spool

IDLE_S = 0.1  # how often is looked whether there is a run with triggers

ORDER_S = 1.5  # how long a client waits for the judge thread; it asks for 2 s

log = logging.getLogger("silo.helper")


@dataclass(frozen=True)
class Standing:
    """How triggers and limits stood at a tick of a run."""

    run: str = ""
    tick: int = 0
    triggers: tuple[TriggerStatus, ...] = ()
    limits: tuple[LimitStatus, ...] = ()


class Judge:
    """Owns the judge thread and the one that writes captures."""

    def __init__(self, mirror: Mirror, events: Events) -> None:
        self._mirror, self._events = mirror, events
        self._wake = threading.Event()
        self._ended = False
        self._offered: deque[SegmentReader] = deque()
        self._judge: SegmentJudge | None = None
        self._run = self._why = ""
        self._closed = False  # captures of a run that stopped are closed
        self._jobs: queue.Queue[tuple[Spool, TriggerOptions] | None] = queue.Queue()
        self._unwritten: dict[int, int] = {}  # bytes of the captures that wait to be written, by spool
        self._kept: dict[tuple[str, str], deque[list[SavedFile]]] = {}
        self._orders: deque[tuple[Callable[[], Any], concurrent.futures.Future[Any]]] = deque()
        self._standing = Standing()  # at the end of the last run
        self._failed = ""
        self._files: dict[tuple[str, str], tuple[str, ...]] = {}  # of the newest capture of a trigger of a run
        self._threads = [
            threading.Thread(target=self._watch, name="judge"),
            threading.Thread(target=self._write_all, name="captures"),
        ]

    def start(self) -> None:
        """Start the threads."""
        for thread in self._threads:
            thread.start()

    def stop(self, why: str) -> None:
        """Judge what is left, close the captures under way with the reason, write their files, end the threads.

        May be called twice.
        """
        self._why = self._why or why
        self._ended = True
        self._wake.set()
        self._threads[0].join()
        self._jobs.put(None)
        self._threads[1].join()

    def take_run(self) -> None:
        """Judge the run that the mirror has just taken over, however soon the next one replaces it."""
        try:
            reader = self._mirror.open_reader()
        except SegmentError:
            log.exception("a run can't be judged")
            return
        if reader is not None and _has_conditions(reader.schema.extras):
            self._offered.append(reader)
            self._wake.set()

    # --------------------------------------------------------------------------------- for threads that answer clients

    def standing(self) -> Standing:
        """Return how triggers and limits stand. Raises ElementError while the judge is too busy to say."""
        found: Standing = self._ordered(self._stands)
        return found

    def arm(self, name: str, *, armed: bool) -> None:
        """Have a trigger watch again, or no more. Raises ElementError."""

        def order() -> None:
            if self._judge is not None:
                self._judge.arm(name, armed=armed)

        self._ordered(order)

    def force(self, name: str) -> int:
        """Fire now; returns the tick. Raises ElementError where nothing is logged."""
        tick: int = self._ordered(lambda: self._force(name))
        return tick

    def acknowledge(self, names: list[str], who: str, time_ns: int) -> int:
        """Note that somebody has seen alarms; returns how many there were. Raises ElementError."""
        count: int = self._ordered(lambda: self._judge.acknowledge(names, who, time_ns) if self._judge else 0)
        return count

    def _ordered(self, order: Callable[[], Any]) -> Any:
        """Have the judge thread do it between two looks at the rings."""
        if not self._threads[0].is_alive():
            return order()
        future: concurrent.futures.Future[Any] = concurrent.futures.Future()
        self._orders.append((order, future))
        self._wake.set()
        try:
            return future.result(ORDER_S)
        except concurrent.futures.TimeoutError:
            raise ElementError("the helper process is busy judging rows; ask again in a moment") from None

    def _do_orders(self) -> None:
        while self._orders:
            order, future = self._orders.popleft()
            try:
                future.set_result(order())
            except Exception as error:  # noqa: BLE001  # it is raised where it was asked for
                future.set_exception(error)

    def _stands(self) -> Standing:
        judge, robot = self._judge, self._mirror.now.robot
        if judge is None:
            known = {one.options.name: one for one in self._standing.triggers}
            why = self._failed
            triggers = [
                _waiting(
                    msgspec.structs.replace(known.get(one.name, TriggerStatus(one, TriggerWord.WAITING)), options=one),
                    why,
                )
                for one in robot.extras.triggers
            ]
            limits = self._standing.limits or tuple(
                LimitStatus(one.name, one.name, LimitWord.BLIND, why=why or "nothing was logged yet")
                for one in robot.extras.limits
            )
            return Standing(self._standing.run, self._standing.tick, tuple(triggers), limits)
        run = judge.reader.schema.run
        found = [
            msgspec.structs.replace(one, files=self._files.get((run, one.options.name), ())) for one in judge.triggers()
        ]
        if self._closed:
            found = [_waiting(one, "") for one in found]
        return Standing(run, judge.reader.ticks, tuple(found), tuple(judge.limits()))

    def _force(self, name: str) -> int:
        judge = self._judge
        if judge is None or self._closed:
            raise ElementError(f"trigger '{name}' can't fire: the logger doesn't run; start it; nothing was changed")
        found, tick = judge.force(name)
        self._tell(found)
        return tick

    # ------------------------------------------------------------------------------------------------- judging

    def _watch(self) -> None:
        wait_s = IDLE_S
        while not self._ended:
            self._wake.wait(wait_s)
            self._wake.clear()
            wait_s = self._guarded()
            self._do_orders()
        self._guarded()
        self._end_run(self._why)
        self._do_orders()

    def _guarded(self) -> float:
        """Do a step, whatever the rows hold; returns how long to wait for the next one."""
        try:
            return self._step()
        except SiloError as error:
            self._forget(f"triggers and limits of this run are judged no more: {error}")
        except Exception as error:
            log.exception("judging failed")
            self._forget(f"triggers and limits of this run are judged no more: {type(error).__name__}: {error}")
        return IDLE_S

    def _forget(self, text: str) -> None:
        self._judge, self._failed = None, text
        self._events.publish(EventKind.BLIND, text)

    def _step(self) -> float:
        while self._offered:
            self._next_run(self._offered.popleft())
        if self._run != self._mirror.run and not self._offered:
            self._next_run(self._mirror.open_reader())  # let go of, without triggers, or not handed over
        self._adopt()
        judge = self._judge
        if judge is None or not judge.active:
            return IDLE_S
        running = judge.reader.running  # before its rows are read: a stop after them is seen at the next look
        self._tell(judge.step())
        if not running and not self._closed:
            self._closed = True
            self._tell(judge.end(judge.reader.stop_reason or "the logger was stopped"))
        return judge.wait_s

    def _adopt(self) -> None:
        """Judge what the robot program has by now, where it differs from what the run began with."""
        robot, judge = self._mirror.now.robot, self._judge
        if robot.segment != self._mirror.segment or (judge is not None and judge.extras == robot.extras):
            return  # of another run, or known
        if judge is None:
            if not _has_conditions(robot.extras) or self._failed or not self._run:
                return
            reader = self._mirror.open_reader()
            if reader is None or reader.schema.run != self._run:
                return
            self._begin(reader, robot.extras, since=reader.ticks)
        elif judge.extras != robot.extras:
            judge.adopt(robot.extras)
            self._tell_problems(judge)

    def _next_run(self, reader: SegmentReader | None) -> None:
        """Close the run before, and begin with this one; None: there is none."""
        run = reader.schema.run if reader is not None else ""
        if run and run == self._run:
            return
        self._end_run("a new run began")
        self._run, self._closed, self._failed = run, False, ""
        if reader is None or not _has_conditions(reader.schema.extras):
            return
        self._begin(reader, reader.schema.extras)

    def _begin(self, reader: SegmentReader, extras: Extras, since: int = 0) -> None:
        from silo.helper.segment_judge import SegmentJudge

        self._judge = SegmentJudge(
            reader, self._mirror.now.table.elements, extras, since, lambda: sum(list(self._unwritten.values()))
        )
        self._tell_problems(self._judge)

    def _tell_problems(self, judge: "SegmentJudge") -> None:
        for problem in judge.problems:
            self._events.publish(EventKind.BLIND, problem)

    def _end_run(self, why: str) -> None:
        judge = self._judge
        if judge is None:
            return
        try:
            self._tell(judge.end(why))
        except SiloError as error:
            self._events.publish(EventKind.BLIND, f"the end of the run was not judged: {error}")
        self._closed = True
        self._standing = self._stands()
        self._judge = None

    def _tell(self, found: "Step") -> None:
        for text in found.blind:
            self._events.publish(EventKind.BLIND, text)
        for name, capture in found.fired:
            tick = capture.fires[0].tick
            self._events.publish(EventKind.TRIGGERED, f"trigger '{name}' fired at tick {tick}", tick=tick)
        for spool in found.whole:
            self._unwritten[id(spool)] = spool.size_bytes
            self._jobs.put((spool, spool.options))
        for over, text in found.limits:
            self._events.publish(EventKind.LIMIT if over else EventKind.LIMIT_ENDED, text)

    # ------------------------------------------------------------------------------------------------- writing

    def _write_all(self) -> None:
        while (job := self._jobs.get()) is not None:
            self._guarded_write(*job)
            del self._unwritten[id(job[0])]
            del job  # while the thread waits, nothing must hold the memory of a segment that is gone

    def _guarded_write(self, spool: "Spool", options: TriggerOptions) -> None:
        try:
            self._write(spool, options)
        except Exception as error:
            # whatever a writer does, the next capture gets its chance, and clients hear of this one
            log.exception("a capture was not saved")
            why = str(error) if isinstance(error, SiloError | OSError) else repr(error)
            text = f"capture {spool.capture.number} of '{spool.trigger}' was not saved: {why}"
            self._events.publish(EventKind.SAVE_FAILED, text)

    def _write(self, spool: "Spool", options: TriggerOptions) -> None:
        from silo.files import write
        from silo.files.naming import next_run_number
        from silo.helper.writing import WriteOrder, write_apart

        happened = self._events.log.of_run(spool.schema.run)
        first, last = spool.capture.first, spool.capture.last
        recording = with_events(spool.recording(), [event for event in happened if first <= event.tick <= last])
        if spool.schema.run == self._mirror.run:  # derived signals and limits as they are by now
            extras = msgspec.structs.replace(self._mirror.now.robot.extras, capture=recording.extras.capture)
            recording = dataclasses.replace(recording, extras=extras)
        folder, logger = self._mirror.now.robot.folder, recording.logger
        Path(folder).mkdir(parents=True, exist_ok=True)
        run = next_run_number(folder, logger)
        name = f"{logger}_{datetime.now():%Y%m%d_%H-%M-%S}_{run:05d}_{options.name}_{spool.capture.number}"
        files = write(recording, folder, logger, [FileType.SILO], name, why=f"trigger {options.name}")
        others: list[FileType] = [kind for kind in options.save if kind is not FileType.SILO]
        if others:
            # what CSV and bags need would leave this process with twice its memory
            order = WriteOrder(folder, logger, others, name, log=files[0].path)
            report = write_apart(None, order, lambda _: None)
            files += report.files
            if report.error:
                raise SaveError(f"{report.error}; saved: {', '.join(file.path for file in files)}")
            if FileType.SILO not in options.save:
                _remove(Path(files.pop(0).path))
        capture, ended = spool.capture, spool.ended and f" ({spool.ended})"
        paths = ", ".join(file.path for file in files)
        text = f"capture {capture.number} of '{options.name}', ticks {capture.first} to {capture.last}{ended}: {paths}"
        self._events.publish(EventKind.CAPTURED, text, files=files)
        self._files[spool.schema.run, options.name] = tuple(file.path for file in files)
        self._keep(spool.schema.run, options, files)

    def _keep(self, run: str, options: TriggerOptions, files: list[SavedFile]) -> None:
        """Remove the oldest captures beyond those that are kept: only files of this very run and trigger."""
        kept = self._kept.setdefault((run, options.name), deque())
        kept.append(files)
        while options.keep and len(kept) > options.keep:
            for file in kept.popleft():
                _remove(Path(file.path))


def _has_conditions(extras: Extras) -> bool:
    return extras is not NO_EXTRAS and bool(extras.triggers or extras.limits)


def _waiting(one: TriggerStatus, why: str) -> TriggerStatus:
    """A trigger while nothing is logged."""
    state = one.state if one.options.armed else TriggerWord.OFF
    state = state if state in (TriggerWord.OFF, TriggerWord.FIRED) else TriggerWord.WAITING
    return msgspec.structs.replace(one, state=TriggerWord.BLIND if why else state, holdoff_s=0.0, why=why)


def _remove(path: Path) -> None:
    """Remove one saved log with what belongs to it."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
        return
    path.unlink(missing_ok=True)
    if path.suffix == ".csv":
        path.with_name(f"{path.name}.json").unlink(missing_ok=True)

"""The judge thread: triggers of the present run, and the files of what they capture.

Two threads: one judges and copies rows before they are overwritten, one writes files, which may take its time.
"""

import logging
import queue
import shutil
import threading
from collections import deque
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from silo.collecting.segment_reader import SegmentReader
from silo.errors import SaveError, SegmentError, SiloError
from silo.helper.events import Events
from silo.helper.mirror import Mirror
from silo.ipc.published import EventKind
from silo.model import FileType, SavedFile, TriggerOptions
from silo.recording import with_events

if TYPE_CHECKING:
    # 1.4 MB that a helper without triggers doesn't need
    from silo.helper.segment_judge import SegmentJudge, Step
    from silo.helper.spool import Spool

IDLE_S = 0.1  # how often is looked whether there is a run with triggers

log = logging.getLogger("silo.helper")


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
        self._kept: dict[tuple[str, str], deque[list[SavedFile]]] = {}
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
        if reader is not None and reader.schema.extras.triggers:
            self._offered.append(reader)
            self._wake.set()

    # ------------------------------------------------------------------------------------------------- judging

    def _watch(self) -> None:
        wait_s = IDLE_S
        while not self._ended:
            self._wake.wait(wait_s)
            self._wake.clear()
            wait_s = self._guarded()
        self._guarded()
        self._end_run(self._why)

    def _guarded(self) -> float:
        """Do a step, whatever the rows hold; returns how long to wait for the next one."""
        try:
            return self._step()
        except SiloError as error:
            self._forget(f"triggers of this run are judged no more: {error}")
        except Exception as error:
            log.exception("judging failed")
            self._forget(f"triggers of this run are judged no more: {type(error).__name__}: {error}")
        return IDLE_S

    def _forget(self, text: str) -> None:
        self._judge = None
        self._events.publish(EventKind.BLIND, text)

    def _step(self) -> float:
        while self._offered:
            self._next_run(self._offered.popleft())
        if self._run != self._mirror.run and not self._offered:
            self._next_run(self._mirror.open_reader())  # let go of, without triggers, or not handed over
        judge = self._judge
        if judge is None or not judge.active:
            return IDLE_S
        running = judge.reader.running  # before its rows are read: a stop after them is seen at the next look
        self._tell(judge.step(), judge)
        if not running and not self._closed:
            self._closed = True
            self._tell(judge.end(judge.reader.stop_reason or "the logger was stopped"), judge)
        return judge.wait_s

    def _next_run(self, reader: SegmentReader | None) -> None:
        """Close the run before, and begin with this one; None: there is none."""
        run = reader.schema.run if reader is not None else ""
        if run and run == self._run:
            return
        self._end_run("a new run began")
        self._run, self._closed = run, False
        if reader is None or not reader.schema.extras.triggers:
            return
        from silo.helper.segment_judge import SegmentJudge

        self._judge = SegmentJudge(reader, self._mirror.now.table.elements)
        for problem in self._judge.problems:
            self._events.publish(EventKind.BLIND, problem)

    def _end_run(self, why: str) -> None:
        judge, self._judge = self._judge, None
        if judge is None:
            return
        try:
            self._tell(judge.end(why), judge)
        except SiloError as error:
            self._events.publish(EventKind.BLIND, f"the end of the run was not judged: {error}")

    def _tell(self, found: "Step", judge: "SegmentJudge") -> None:
        for text in found.blind:
            self._events.publish(EventKind.BLIND, text)
        for name, capture in found.fired:
            tick = capture.fires[0].tick
            self._events.publish(EventKind.TRIGGERED, f"trigger '{name}' fired at tick {tick}", tick=tick)
        for spool in found.whole:
            self._jobs.put((spool, judge.options[spool.trigger]))

    # ------------------------------------------------------------------------------------------------- writing

    def _write_all(self) -> None:
        while (job := self._jobs.get()) is not None:
            self._guarded_write(*job)
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
        folder, logger = self._mirror.now.robot.folder, recording.logger
        Path(folder).mkdir(parents=True, exist_ok=True)
        run = next_run_number(folder, logger)
        name = f"{logger}_{datetime.now():%Y%m%d_%H-%M-%S}_{run:05d}_{options.name}_{spool.capture.number}"
        files = write(recording, folder, logger, [FileType.SILO], name)
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
        self._keep(spool.schema.run, options, files)

    def _keep(self, run: str, options: TriggerOptions, files: list[SavedFile]) -> None:
        """Remove the oldest captures beyond those that are kept: only files of this very run and trigger."""
        kept = self._kept.setdefault((run, options.name), deque())
        kept.append(files)
        while options.keep and len(kept) > options.keep:
            for file in kept.popleft():
                _remove(Path(file.path))


def _remove(path: Path) -> None:
    """Remove one saved log with what belongs to it."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
        return
    path.unlink(missing_ok=True)
    if path.suffix == ".csv":
        path.with_name(f"{path.name}.json").unlink(missing_ok=True)

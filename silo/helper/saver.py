"""The saver thread: one save after the other, with progress, while everything else goes on."""

import logging
import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass

from silo.core.arguments import check_name
from silo.core.conditions import Conditions
from silo.core.elements import SavedFile
from silo.errors import SegmentError, SiloError
from silo.files.naming import files_text
from silo.helper.robot_link import RobotLink
from silo.link.channel import LinkSaved
from silo.recordings.heap import trim_heap
from silo.recordings.requests import Save, SaveStarted
from silo.rpc.published import EventKind
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.segment.reader import SegmentReader
from silo.state.events import EventNotifier, plain
from silo.state.replica import Replica

MAX_WAITING = 4
MAX_WHY = 80

log = logging.getLogger("silo.helper")


@dataclass(frozen=True)
class _Job:
    """One save. The reader is opened when it is asked for, so that a restart meanwhile doesn't empty it."""

    number: int
    request: Save
    reader: SegmentReader
    folder: str
    logger: str
    segment: str
    for_robot: bool
    conditions: Conditions  # derived signals and limits as they are, not as they were when the run began


class Saver:
    """Owns the saver thread. The other methods may be called by any thread."""

    def __init__(
        self, replica: Replica, events: EventNotifier, robot: RobotLink, settle: Callable[[], object] = lambda: None
    ) -> None:
        """`settle` returns when triggers and limits have come to what is logged: what they tell stands in the file."""
        self._settle = settle
        self._replica = replica
        self._events = events
        self._robot = robot
        self._lock = threading.Lock()
        self._number = 0
        self._jobs: queue.Queue[_Job | None] = queue.Queue()
        self._thread = threading.Thread(target=self._run, name="saver")
        self.start = self._thread.start
        self.submit, self.finish = self._jobs.put, self._jobs.join  # have a job done; wait until all are

    def stop(self, timeout_s: float | None = None) -> None:
        """End the thread after the saves that wait; waits at most `timeout_s` for that."""
        self._jobs.put(None)
        self._thread.join(timeout_s)

    def prepare(self, request: Save, *, for_robot: bool = False) -> _Job:
        """Return a job for `submit`. Raises RequestRefusedError where it can't be done, which all clients are told."""
        try:
            return self._prepared(request, for_robot)
        except (SegmentError, RequestRefusedError) as error:
            text = f"can't save: {error}" if isinstance(error, SegmentError) else str(error)
            self._events.publish(EventKind.SAVE_FAILED, text, by=request.client)
            why = RefusedWhy.FAILED if isinstance(error, SegmentError) else error.why
            raise RequestRefusedError(why, text) from error

    def _prepared(self, request: Save, for_robot: bool) -> _Job:
        types = list(dict.fromkeys(request.types))
        if not types:
            raise RequestRefusedError(RefusedWhy.INVALID, "no file type to save: choose silo, csv or bag")
        if request.name:
            try:
                check_name(request.name)
            except SiloError as error:
                raise RequestRefusedError(RefusedWhy.INVALID, str(error)) from None
        if not for_robot and self._jobs.qsize() >= MAX_WAITING:
            raise RequestRefusedError(
                RefusedWhy.FAILED, f"{MAX_WAITING} saves are waiting already; try again when they are done"
            )
        cut_off = request.segment if for_robot else ""
        reader = SegmentReader(cut_off) if cut_off else self._replica.open_reader()
        if reader is None:
            raise RequestRefusedError(RefusedWhy.FAILED, "nothing was logged yet: start the logger first")
        robot = self._replica.now.robot
        with self._lock:
            self._number += 1
            number = self._number
        checked = Save(types=types, name=request.name, client=request.client, why=request.why)
        folder = request.folder if for_robot and request.folder else robot.folder
        conditions = robot.conditions if robot.segment == str(reader.path) else reader.schema.conditions
        if for_robot and request.conditions is not None:
            conditions = request.conditions
        return _Job(number, checked, reader, folder, robot.logger, str(reader.path), for_robot, conditions)

    def save(self, request: Save) -> SaveStarted:
        """Begin a save for a client. Raises RequestRefusedError."""
        job = self.prepare(request)
        self.submit(job)
        return SaveStarted(job.number)

    # -------------------------------------------------------------------------------------------------- the thread

    def _run(self) -> None:
        # no name for the job here: while the thread waits, nothing must hold the memory of a segment that is gone
        while self._guarded(self._jobs.get()):
            self._jobs.task_done()

    def _guarded(self, job: _Job | None) -> bool:
        """Do a job, whatever happens in it; False for the sign to end."""
        if job is None:
            return False
        try:
            self._do(job)
        except SiloError as error:
            self._failed(job, str(error), [])
        except Exception as error:
            # whatever a writer does, the next save gets its chance, and whoever waits for this one hears of it
            log.exception("save %d failed", job.number)
            self._failed(job, f"{type(error).__name__}: {error}", [])
        trim_heap()
        return True

    def _do(self, job: _Job) -> None:
        from silo.recordings.writing import WriteOrder, write_log

        names = ", ".join(file_type.name.lower() for file_type in job.request.types)
        by = job.request.client
        self._events.publish(EventKind.SAVING, f"saving {names}", by=by, job=job.number)
        self._settle()
        events = self._events.log.of_run(job.reader.schema.run)
        order = WriteOrder(
            job.folder,
            job.logger,
            job.request.types,
            job.request.name,
            why=_why(job.request),
            awaited=job.for_robot,
            leaves_room=not job.for_robot,
            events=events,
            conditions=job.conditions,
        )
        report = write_log(job.reader, order, self._events.progress(f"saving {names}", by=by, job=job.number))
        files = report.files
        if files:  # in some formats, at least
            self._replica.mark_saved(job.segment, report.ticks)
        if report.error:
            self._failed(job, report.error, files, report.ticks)
            return
        self._events.publish(
            EventKind.SAVED, f"saved {files_text(files)}", by=by, job=job.number, progress=1.0, files=files
        )
        self._robot.tell(LinkSaved(job.number, files, "", job.reader.schema.run, report.ticks))

    def _failed(self, job: _Job, text: str, files: list[SavedFile], ticks: int = 0) -> None:
        self._events.publish(EventKind.SAVE_FAILED, text, by=job.request.client, job=job.number, files=files)
        if job.for_robot or ticks:
            self._robot.tell(LinkSaved(job.number, files, text, job.reader.schema.run, ticks))


def _why(request: Save) -> str:
    """Return why it is saved, as lists of recordings show it: the person is enough, not the person's process."""
    user, _, program = request.client.partition(" ")
    who = user if "@" in user and program else request.client
    return plain(request.why, MAX_WHY) or plain(f"saved by {who}" if who else "saved", MAX_WHY)

"""The helper process as a whole: opens the session, starts the threads, watches the robot process, ends.

The main thread is the one that reads the link. It is the only one that changes the replica.
"""

import contextlib
import enum
import functools
import logging
import math
import os
import signal
import socket
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import zenoh

from silo.conditions.judge import Judge
from silo.control.authentication import Authentication
from silo.control.denials import Denials
from silo.control.server import ControlLock
from silo.core.conditions import Conditions, Derived
from silo.core.elements import GOES_ON, STARTED, FileType, GroupRole, State
from silo.core.quantities.writing import and_more, many
from silo.core.runtime import runtime_dir
from silo.errors import ConnectionLostError, SiloError
from silo.helper.dead_robot import OrphanRecovery, after_crash, log_death, stays_s
from silo.helper.journaling import Journaling
from silo.helper.marks import MarkReader
from silo.helper.request_threads import RequestThreads, Servers
from silo.helper.robot_link import RobotLink, ending
from silo.helper.runs import Runs, taken_over
from silo.helper.saver import Saver
from silo.link.channel import FILES_DELETED, READY, Beat, Goodbye, LetGo, LinkReply, LinkRequest, LinkSaved
from silo.live.publisher import Publisher
from silo.net.access.certificates import not_valid_today
from silo.net.access.logins import asks_for_passwords, watch_logins
from silo.net.access.rights import ASKED
from silo.net.configuration import robot_named
from silo.net.folders import group_folder, share_socket
from silo.net.keys import Root
from silo.net.session import SOCKET_SUFFIX, Beside, close, forget, open_server
from silo.polling import readable
from silo.printing import leave_pipes
from silo.recorder.requests import StartRecorder, StopRecorder
from silo.recorder.server import EndlessRecordings
from silo.recordings.requests import Save, SaveStarted
from silo.rpc.clocks import clock_s
from silo.rpc.declaring import Do, Done, Reply
from silo.rpc.published import EventKind
from silo.rpc.refusals import Refused, RefusedWhy, RequestRefusedError, answered
from silo.run_index.keeping import IndexKeeper
from silo.settings.conditions_diff import NONE, diff_conditions
from silo.state.events import EventLog, EventNotifier, plain
from silo.state.handover import ChangeCount, RobotState
from silo.state.held_runs import HeldRuns
from silo.state.replica import LoggerSnapshot, Replica

TERM_GRACE_S = 5.0
SAVE_GRACE_S = 10.0
CAPTURES_GRACE_S = 8.0  # the program that closes its logger kills this process after 15 s
DEAD_POLL_S = 0.2
MOST_CHANGE_LETTERS = 500
WATCH_PERIOD_S = 1.0  # how often is looked whether the files are still there

log = logging.getLogger("silo.helper")


class _Ended(enum.Enum):
    """Why the helper process follows its robot process no more."""

    GOODBYE = enum.auto()
    DIED = enum.auto()
    FILES_DELETED = enum.auto()


@dataclass(frozen=True)
class ServingOptions:
    """To whom a logger is served: see `silo.Logger.serve`."""

    group: str | None = None
    config: str | None = None
    group_role: GroupRole = GroupRole.OPERATOR
    control: str = "any"


class Helper:
    """One helper process. `run` returns when it has ended."""

    def __init__(self, robot: RobotLink, name: str, serving: ServingOptions, drawn: str = "", died: str = "") -> None:
        """`died` is how, and when, the one before it died, if it did."""
        self._robot, self._died = robot, died
        self._name = name
        self._serving = serving
        named = robot_named(serving.config) if serving.config is not None else ""
        self._root = Root(named or socket.gethostname(), name, drawn)
        self._wake = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._term_s = 0.0  # when SIGTERM came
        self._gave_up = False  # SIGTERM came, and the robot program goes on
        self._exit_code = 0
        self._denials = Denials()

    def run(self) -> int:
        """Serve until the robot process is gone and nobody needs the helper any more; returns the exit code."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the robot program, which then says goodbye
        signal.signal(signal.SIGTERM, self._on_term)
        first = self._robot.receive()
        if not isinstance(first, RobotState):
            return 1
        self._robot.took(first)
        try:
            session, path = self._open(first)
        except (SiloError, OSError) as error:
            self._robot.tell(LinkReply(READY, Refused(RefusedWhy.FAILED, str(error))))
            return 1
        try:
            self._serve(session, path, first)
        finally:
            close(session)
            forget(path)
        return self._exit_code

    def _open(self, first: RobotState) -> tuple[zenoh.Session, Path]:
        group, config = self._serving.group, self._serving.config
        if config is not None and asks_for_passwords(config):
            watch_logins(functools.partial(self._denials.note, "login refused: wrong user or password"))
        folder = group_folder(group) if group else runtime_dir()
        session, path = open_server(folder, self._name, first.pid, config, self._root, grouped=bool(group))
        if group:
            share_socket(path, folder)
        return session, path

    def _authentication(self, path: Path) -> Authentication:
        authentication = Authentication.of(self._root, self._serving.config)
        if self._serving.group:
            authentication.share(path, self._serving.group, may_change=self._serving.group_role in ASKED[Do])
        for words in not_valid_today(self._serving.config) if self._serving.config is not None else ():
            log.warning("%s: %s", self._name, words)
        if authentication.old_rules:
            log.warning("%s: %s", self._name, authentication.old_rules)
        if authentication.admission.why:
            log.warning("%s: no changes are taken from the network: %s", self._name, authentication.admission.why)
        return authentication

    def _authority(self, path: Path, replica: Replica, events: EventNotifier) -> tuple[Authentication, ControlLock]:
        one, authentication = self._serving.control == "one", self._authentication(path)
        control_lock = ControlLock(
            events, replica, self._root, path.name.removesuffix(SOCKET_SUFFIX), one=one,
            closed=lambda: authentication.closed, leave=self._robot.leave, left=self._robot.left(),
        )  # fmt: skip
        replica.control = lambda: (control_lock.control, control_lock.one)
        replica.denied = lambda: self._denials.count
        self._denials.tell = lambda text, who: events.publish(EventKind.DENIED, text, by=who)
        return authentication, control_lock

    def _serve(self, session: zenoh.Session, path: Path, first: RobotState) -> None:
        replica = Replica(first, self._root.host)
        held = HeldRuns(replica, self._poke)
        early = list(taken_over(self._robot, replica, held))
        held.take()  # one that was not handed over
        events = EventNotifier(session, self._root, replica, EventLog(first.folder, first.logger))
        marks, keeper = MarkReader(replica, events), IndexKeeper(replica, events)
        publisher = Publisher(session, self._root, replica, events, held)
        judge = Judge(replica, events, held, self._robot.end_excitation)
        saver = Saver(replica, events, self._robot, judge.settle)
        journaling = Journaling(replica, events)
        recording = EndlessRecordings(replica, events, held)
        runs = Runs(self._robot, replica, held, events, marks, judge, recording, publisher, early)
        _begin(runs, events, self._died)
        people = self._authority(path, replica, events)
        servers = Servers(replica, events, publisher, saver, self._robot, judge, recording, people[1])
        control = RequestThreads(
            session, self._root, servers, *people, publisher.name_client, self._denials, first.done
        )
        for part in (keeper, marks, publisher, saver, journaling, judge, recording, control):
            part.start()
        token = session.liveliness().declare_token(self._root.key("alive"))
        predecessors = OrphanRecovery(replica, events)
        self._robot.tell(LinkReply(READY, Done(str(path))))
        predecessors.start()
        with contextlib.ExitStack() as at_end:  # the last one first
            for stop in (keeper.stop, events.log.stop, marks.stop, publisher.stop):
                at_end.callback(stop)
            at_end.callback(held.release, at_end=True)
            for wait in (saver.stop, predecessors.stop, recording.wait):
                at_end.callback(wait, SAVE_GRACE_S)
            for stop in (servers.stop, control.stop, journaling.stop):
                at_end.callback(stop)
            at_end.callback(judge.stop, "the helper process ended", within_s=CAPTURES_GRACE_S)
            at_end.callback(self._robot.lost)
            at_end.callback(token.undeclare)
            ended = self._follow_robot(runs, events, saver, people[1], path)
            runs.look(at_end=True)  # the program may have gone on while this process started
            if ended is _Ended.DIED:
                _tell_death(path, publisher, marks, replica, events)
            marks.stop()  # recordings have them, too
            # a helper process that comes after this one goes on with what was recorded, unless the logger is closed
            forget = ended is not _Ended.FILES_DELETED and not self._term_s
            recording.stop(forget=forget, died=ended is _Ended.DIED)
            if ended is _Ended.DIED:
                self._robot.lost()
                judge.stop("the robot program died")
                saver.finish()
                journaling.stop()
                self._linger(publisher, held, news=after_crash(replica, events))
                return
            deleted = ended is _Ended.FILES_DELETED
            self._exit_code = FILES_DELETED if deleted else 0
            _stop_judge(judge, deleted=deleted, gave_up=self._gave_up)
            journaling.stop()
            if not deleted:
                _tell_end(events, publisher)
            saver.stop(None if deleted else SAVE_GRACE_S)

    # ------------------------------------------------------------------------------------------- while it lives

    def _follow_robot(
        self, runs: Runs, events: EventNotifier, saver: Saver, control_lock: ControlLock, path: Path
    ) -> "_Ended":
        """Take in what the robot process pushes, until one of its ends."""
        link, handed_over = self._robot.socket.fileno(), self._robot.runs.fileno()
        waited = [link, handed_over, self._wake]
        while True:
            timeout_s = WATCH_PERIOD_S
            if self._term_s:
                timeout_s = min(timeout_s, max(0.0, self._term_s + TERM_GRACE_S - time.monotonic()))
            ready = readable(*waited, timeout_s=timeout_s)
            if self._wake in ready:
                os.eventfd_read(self._wake)
            if self._wake in ready or not ready:
                runs.look()
            control_lock.watch()
            self._denials.watch()
            if not ready and self._term_s and time.monotonic() >= self._term_s + TERM_GRACE_S:
                log.warning("ended by SIGTERM; the robot program goes on")
                self._gave_up = True
                return _Ended.GOODBYE
            # a run first: what comes after it on the link may be about it, and it outlives the robot process
            if runs.take():
                waited = [link, handed_over, self._wake]
            elif handed_over in ready:
                waited = [link, self._wake]  # that channel is closed, or nothing can be taken from it now
            if not ready and runs.replica.files_deleted() and readable(*waited, timeout_s=0):
                continue  # the robot process says first what it deletes itself
            if not ready and _files_deleted(runs, events, saver, path):
                return _Ended.FILES_DELETED
            if link not in ready:
                continue
            try:
                message = self._robot.receive()
            except ConnectionLostError:
                log.exception("the link to the robot program is broken")
                return _Ended.DIED
            if message is None or isinstance(message, Goodbye):
                runs.take()
                return _Ended.DIED if message is None else _Ended.GOODBYE
            self._handle(message, runs, events, saver)

    def _poke(self) -> None:
        with contextlib.suppress(BlockingIOError):
            os.eventfd_write(self._wake, 1)

    def _handle(
        self,
        message: RobotState | LinkRequest | LinkReply | LinkSaved | LetGo | Beat,
        runs: Runs,
        events: EventNotifier,
        saver: Saver,
    ) -> None:
        if isinstance(message, RobotState):
            _take_state(message, runs, events)
            self._robot.took(message)
        elif isinstance(message, Beat):
            self._robot.tell(message)
        elif isinstance(message, LinkRequest) and 0 < message.request.until_s < clock_s():
            refused = Refused(RefusedWhy.FAILED, "it came too late: the helper process stood still; nothing was done")
            self._robot.tell(LinkReply(message.number, refused, late=True))
        elif isinstance(message, LetGo):
            runs.let_go(message)
        elif isinstance(message, LinkReply):
            late = self._robot.answered(message)
            if late is not None:
                text = ending(late, message.reply)
                events.publish(EventKind.ENDED, text, by=late.client, job=message.number)
        elif isinstance(message, LinkRequest) and isinstance(message.request, StartRecorder | StopRecorder):
            # its answer takes as long as a process takes to start, or to finish a part
            wanted = (runs.recording, message.number, message.request)
            threading.Thread(target=self._record, args=wanted, name="record").start()
        elif isinstance(message, LinkRequest) and isinstance(message.request, Save):
            try:
                job = saver.prepare(message.request, for_robot=True)
            except RequestRefusedError as error:
                self._robot.tell(LinkReply(message.number, Refused(error.why, str(error))))
                return
            self._robot.tell(LinkReply(message.number, SaveStarted(job.number)))
            saver.submit(job)

    def _record(self, recording: EndlessRecordings, number: int, request: StartRecorder | StopRecorder) -> None:
        def done() -> Reply:
            if isinstance(request, StartRecorder):
                return recording.begin(request, anywhere=True)
            return Done(recording.end(request))

        self._robot.tell(LinkReply(number, answered(done)))

    # ------------------------------------------------------------------------------------------- after its end

    def _linger(self, publisher: Publisher, held: HeldRuns, *, news: bool) -> None:
        """Go on answering while somebody is there to read what happened, or may come for it."""
        leave_pipes()  # `python robot.py 2>&1 | tee told` ends now: what there was to say is said
        ended_s = time.monotonic()
        while not self._term_s:
            if time.monotonic() - ended_s > stays_s(news=news, clients=bool(publisher.clients)):
                return
            if readable(self._wake, timeout_s=DEAD_POLL_S):
                os.eventfd_read(self._wake)
                held.release(at_end=True)

    def _on_term(self, _number: int, _frame: object) -> None:
        # a service manager sends SIGTERM to robot and helper at once: what the robot logged must be saved before
        self._term_s = time.monotonic()
        self._poke()


def _begin(runs: Runs, events: EventNotifier, died: str) -> None:
    """Take in what went on meanwhile, and tell that the helper process before this one died, if it did."""
    runs.begin()
    if died:
        code, _, time_ns = died.partition(" ")
        text = f"helper process died (exit code {code}), and another one was started; logging went on"
        events.publish(EventKind.HELPER, text, time_ns=int(time_ns))


def _tell_death(path: Path, publisher: Publisher, marks: MarkReader, replica: Replica, events: EventNotifier) -> None:
    """First of all: who looks for the program may find its next start already, and saving takes time."""
    Beside.DEAD.of(path).touch()
    publisher.summary.die()
    marks.stop()
    log_death(replica, events)


def _stop_judge(judge: Judge, *, deleted: bool, gave_up: bool) -> None:
    if deleted:
        judge.stop("the helper process was replaced", hand_over=True)
        return
    ending = "the helper process was ended" if gave_up else "the program closed its logger"
    # what a successor goes on with is not dropped
    judge.stop(ending, hand_over=gave_up, within_s=math.inf if gave_up else CAPTURES_GRACE_S)


def _tell_end(events: EventNotifier, publisher: Publisher) -> None:
    events.publish(EventKind.CLOSED, "the robot program closed its logger")
    publisher.summary.close()


def _files_deleted(runs: Runs, events: EventNotifier, saver: Saver, path: Path) -> bool:
    """Save what somebody deleted the names of; True if clients can't find this process any more either."""
    replica = runs.replica
    if replica.run != runs.deleted and replica.files_deleted():
        runs.deleted = replica.run
        text = (
            "somebody deleted this logger's files from the runtime folder (a cleanup job, or systemd's RemoveIPC "
            "at logout); logging goes on, and what was logged is saved now, but a kill of both the program and "
            "its helper process would lose what follows until the next start"
        )
        log.warning("%s", text)
        events.publish(EventKind.FILES_DELETED, text)
        if not replica.is_saved():
            saver.save(Save(types=[FileType.SILO], client="silo, because its files were deleted"))
    return not path.exists()


def _take_state(message: RobotState, runs: Runs, events: EventNotifier) -> None:
    before, now = runs.replica.take(message)
    runs.take_state(now)
    _tell_changes(events, before, now)
    if now.robot.segment != before.robot.segment:
        runs.tell_cut()
        runs.look()


def _tell_changes(events: EventNotifier, before: LoggerSnapshot, now: LoggerSnapshot) -> None:
    """Events for what differs between two states of the robot process."""
    by = now.robot.by
    stopped = now.robot.state is State.STOPPED
    if now.robot.segment != before.robot.segment and not (stopped and before.robot.state is State.STOPPED):
        if not events.is_started():  # a state may come behind the run that follows the one that it tells of
            events.publish(EventKind.STARTED, GOES_ON if now.robot.begun_ns else STARTED, by=by, tick=0)
        if now.robot.saved:
            events.publish(EventKind.SAVED, now.robot.saved, by=by, tick=0)
        if stopped:
            events.publish(EventKind.STOPPED, now.robot.reason or "stopped", by=by)
    elif now.robot.state is not before.robot.state:
        if stopped:
            events.publish(EventKind.STOPPED, now.robot.reason or "stopped", by=by)
        else:
            events.publish(EventKind.STARTED, "started", by=by, tick=0)
    if now.table.revision != before.table.revision:
        count = _changed(before, now)
        derived = derived_text(before.robot.conditions.derived, now.robot.conditions.derived)
        told = [f"{many(count, 'element')} changed"] if count or not derived else []
        events.publish(EventKind.EDITED, "; ".join([*told, *filter(None, [derived])]), by=by)
    if not by and (text := conditions_text(before.robot.conditions, now.robot.conditions)):
        events.publish(EventKind.CONDITIONS, text)  # by the program: what clients change is told with their request


def conditions_text(before: Conditions, now: Conditions) -> str:
    """Return what became of limits and triggers, fit to show; empty where nothing did."""
    if (before.limits, before.triggers) == (now.limits, now.triggers):
        return ""
    told = []
    for change in diff_conditions(
        Conditions((), before.limits, before.triggers), Conditions((), now.limits, now.triggers)
    ):
        what = f"{change.name} {change.field}".strip()
        told.append(f"{what} removed" if change.new == NONE and not change.field else f"{what}: {change.new}")
    return plain(and_more(told, 3, "; "), MOST_CHANGE_LETTERS)


def _changed(before: LoggerSnapshot, now: LoggerSnapshot) -> int:
    old = before.table.elements
    new = now.table.elements
    return sum(one != other for one, other in zip(old, new, strict=False)) + abs(len(old) - len(new))


def derived_text(before: Sequence[Derived], now: Sequence[Derived]) -> str:
    """Return what became of derived signals, fit to show; empty where nothing did."""
    old, new = {one.name: one for one in before}, {one.name: one for one in now}
    told = [f"{one.name} = {one.expression}" for one in new.values() if one != old.get(one.name)]
    told += [f"{name} is derived no more" for name in old if name not in new]
    return plain(and_more(told, 3, "; "))


def open_link(descriptor: int, runs: int, changes: int | None) -> RobotLink:
    """Return the channels that the robot process handed over."""
    handed = socket.socket(fileno=runs)
    handed.setblocking(False)
    return RobotLink(socket.socket(fileno=descriptor), handed, ChangeCount(changes))

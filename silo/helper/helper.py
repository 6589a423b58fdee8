"""The helper process as a whole: opens the session, starts the threads, watches the robot process, ends.

The main thread is the one that reads the link. It is the only one that changes the mirror.
"""

import contextlib
import logging
import os
import select
import signal
import socket
import time
from pathlib import Path

import zenoh

from silo.errors import ConnectionLostError, SiloError
from silo.helper.answers import Answers
from silo.helper.control import Control
from silo.helper.crash import after_crash
from silo.helper.events import Events
from silo.helper.mirror import LoggerSnapshot, Mirror
from silo.helper.predecessor import PredecessorRecovery
from silo.helper.publisher import Publisher
from silo.helper.robot import Robot
from silo.helper.saver import Saver
from silo.ipc.folders import group_folder, share_socket
from silo.ipc.keys import Root
from silo.ipc.messages import Done, EventKind, Refused, RefusedWhy, Save, SaveStarted
from silo.ipc.session import close, dead_mark, forget, open_server
from silo.link.messages import Goodbye, LinkReply, LinkRequest, LinkSaved, RobotState
from silo.model import State
from silo.runtime import runtime_dir

READY = 0  # number of the LinkReply that says that clients can come, or why they can't
TERM_GRACE_S = 5.0
SAVE_GRACE_S = 10.0
DEAD_WITHOUT_CLIENTS_S = 10.0
DEAD_WITH_CLIENTS_S = 600.0
DEAD_POLL_S = 0.2

log = logging.getLogger("silo.helper")


class Helper:
    """One helper process. `run` returns when it has ended."""

    def __init__(self, robot: Robot, name: str, group: str | None, config: str | None) -> None:
        self._robot = robot
        self._name = name
        self._group = group
        self._config = config
        self._wake = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._term_s = 0.0  # when SIGTERM came

    def run(self) -> int:
        """Serves until the robot process is gone and nobody needs the helper any more; returns the exit code."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the robot program, which then says goodbye
        signal.signal(signal.SIGTERM, self._on_term)
        first = self._robot.receive()
        if not isinstance(first, RobotState):
            return 1
        try:
            session, path = self._open(first)
        except (SiloError, OSError) as error:
            self._robot.send(LinkReply(READY, Refused(RefusedWhy.FAILED, str(error))))
            return 1
        try:
            self._serve(session, path, first)
        finally:
            close(session)
            forget(path)
        return 0

    def _open(self, first: RobotState) -> tuple[zenoh.Session, Path]:
        folder = group_folder(self._group) if self._group else runtime_dir()
        session, path = open_server(folder, self._name, first.pid, self._config)
        if self._group:
            share_socket(path, folder)
        return session, path

    def _serve(self, session: zenoh.Session, path: Path, first: RobotState) -> None:
        mirror = Mirror(first)
        root = Root(mirror.host, first.logger)
        events = Events(session, root, mirror)
        publisher = Publisher(session, root, mirror, events)
        saver = Saver(mirror, events, self._robot)
        control = Control(session, root, Answers(mirror, events, publisher, saver, self._robot))
        publisher.start()
        saver.start()
        control.start()
        token = session.liveliness().declare_token(root.key("alive"))
        predecessors = PredecessorRecovery(mirror, events)
        self._robot.send(LinkReply(READY, Done(str(path))))
        predecessors.start()
        try:
            if self._follow_robot(mirror, events, saver):
                events.publish(EventKind.CLOSED, "the robot program closed its logger")
                saver.stop(SAVE_GRACE_S)
            else:
                self._robot.lost()
                saver.finish()
                dead_mark(path).touch()
                news = after_crash(mirror, events)
                self._linger(publisher, DEAD_WITHOUT_CLIENTS_S if news else 0.0)
        finally:
            token.undeclare()  # type: ignore[no-untyped-call]  # zenoh's stub leaves the return type out
            self._robot.lost()
            control.stop()
            publisher.stop()
            predecessors.stop(SAVE_GRACE_S)
            saver.stop(SAVE_GRACE_S)

    # ------------------------------------------------------------------------------------------- while it lives

    def _follow_robot(self, mirror: Mirror, events: Events, saver: Saver) -> bool:
        """Takes in what the robot process pushes; True after its goodbye, False if it just ended."""
        link = self._robot.socket.fileno()
        while True:
            timeout_s = None if not self._term_s else max(0.0, self._term_s + TERM_GRACE_S - time.monotonic())
            readable = select.select([link, self._wake], [], [], timeout_s)[0]
            if self._wake in readable:
                os.eventfd_read(self._wake)
            if not readable:
                log.warning("ended by SIGTERM; the robot program goes on")
                return True
            if link not in readable:
                continue
            try:
                message = self._robot.receive()
            except ConnectionLostError:
                log.exception("the link to the robot program is broken")
                return False
            if message is None or isinstance(message, Goodbye):
                return message is not None
            self._handle(message, mirror, events, saver)

    def _handle(
        self,
        message: RobotState | LinkRequest | LinkReply | LinkSaved,
        mirror: Mirror,
        events: Events,
        saver: Saver,
    ) -> None:
        if isinstance(message, RobotState):
            before, now = mirror.take(message)
            _tell_changes(events, before, now)
        elif isinstance(message, LinkReply):
            self._robot.answered(message)
        elif isinstance(message, LinkRequest) and isinstance(message.request, Save):
            job = saver.prepare(message.request, for_robot=True)
            if isinstance(job, Refused):
                self._robot.send(LinkReply(message.number, job))
            else:
                self._robot.send(LinkReply(message.number, SaveStarted(job.number)))
                saver.submit(job)

    # ------------------------------------------------------------------------------------------- after its end

    def _linger(self, publisher: Publisher, without_clients_s: float) -> None:
        """Goes on answering while somebody is there to read what happened, or may come for it."""
        ended_s = time.monotonic()
        while not self._term_s:
            since_s = time.monotonic() - ended_s
            if since_s > (DEAD_WITH_CLIENTS_S if publisher.clients else without_clients_s):
                return
            if select.select([self._wake], [], [], DEAD_POLL_S)[0]:
                return

    def _on_term(self, _number: int, _frame: object) -> None:
        # a service manager sends SIGTERM to robot and helper at once: what the robot logged must be saved before
        self._term_s = time.monotonic()
        with contextlib.suppress(BlockingIOError):
            os.eventfd_write(self._wake, 1)


def _tell_changes(events: Events, before: LoggerSnapshot, now: LoggerSnapshot) -> None:
    """Events for what differs between two states of the robot process."""
    by = now.robot.by
    stopped = now.robot.state is State.STOPPED
    if now.robot.segment != before.robot.segment and not (stopped and before.robot.state is State.STOPPED):
        events.publish(EventKind.STARTED, "started", by=by)
        if stopped:
            events.publish(EventKind.STOPPED, now.robot.reason or "stopped", by=by)
    elif now.robot.state is not before.robot.state:
        if stopped:
            events.publish(EventKind.STOPPED, now.robot.reason or "stopped", by=by)
        else:
            events.publish(EventKind.STARTED, "started", by=by)
    if now.table.revision != before.table.revision:
        count = _changed(before, now)
        events.publish(EventKind.EDITED, f"{count} element{'s' if count != 1 else ''} changed", by=by)


def _changed(before: LoggerSnapshot, now: LoggerSnapshot) -> int:
    old = before.table.elements
    new = now.table.elements
    return sum(one != other for one, other in zip(old, new, strict=False)) + abs(len(old) - len(new))


def open_link(descriptor: int) -> Robot:
    """The link that the robot process handed over."""
    return Robot(socket.socket(fileno=descriptor))

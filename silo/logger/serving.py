"""The robot process's end of the link to its helper process: one small thread, never the control loop.

The thread answers what clients ask of the logger (edits, start, stop, restart), pushes every new state, and starts a
new helper when one died. `collect()` never waits for any of it.
"""

import concurrent.futures
import itertools
import logging
import os
import select
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

import msgspec

from silo.errors import ConnectionLostError, SaveError, SiloError, StateError
from silo.ipc.messages import (
    ApplyEdits,
    Done,
    EditsApplied,
    Refused,
    RefusedWhy,
    Restart,
    Save,
    SaveStarted,
    Start,
    Stop,
)
from silo.link.channel import LinkChannel
from silo.link.messages import Goodbye, LinkReply, LinkRequest, LinkSaved, RobotState
from silo.model import FileType, SavedFile, Table

if TYPE_CHECKING:
    from silo.logger.logger import Logger

log = logging.getLogger("silo")

SaveFuture = concurrent.futures.Future[list[SavedFile]]

READY_TIMEOUT_S = 15.0
MAX_RESPAWNS = 5  # within RESPAWN_WINDOW_S, then the logger goes on without a helper
RESPAWN_WINDOW_S = 60.0

HELPER_ENVIRONMENT = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "PYTHONMALLOC": "malloc",  # gives freed memory back, see silo/helper/heap.py
    "PYTHONSAFEPATH": "1",  # `-m` puts the present folder first: a `queue.py` of the robot's would be the helper's, too
}


class Serving:
    """A served logger: a helper process that clients reach. A context manager."""

    def __init__(self, logger: "Logger", *, group: str | None, config: str | os.PathLike[str] | None) -> None:
        """Start the helper process and wait until it answers. Raises ConnectionLostError with its reason."""
        self._logger = logger
        self._arguments = ["--name", logger.options.name]
        if group is not None:
            self._arguments += ["--group", group]
        if config is not None:
            self._arguments += ["--config", str(Path(config).absolute())]
        self._wake = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._sending = threading.Lock()
        self._waking = threading.Lock()  # held for the write of 8 bytes only
        self._numbers = itertools.count(1)
        self._replies: dict[int, concurrent.futures.Future[SaveFuture]] = {}
        self._saves: dict[int, SaveFuture] = {}
        self._table_sent = -1
        self._by = ""
        self._spawned: list[float] = []
        self.alive = True
        self.left: tuple[str, int] | None = None  # the segment and the ticks that the helper was told to save
        self._spawn()
        self._thread = threading.Thread(target=self._serve, name="silo-link", daemon=True)
        self._thread.start()

    # ------------------------------------------------------------------------------------------ the helper process

    def _spawn(self) -> None:
        ours, theirs = socket.socketpair()
        command = [sys.executable, "-m", "silo.helper", "--fd", str(theirs.fileno()), *self._arguments]
        home = str(Path(__file__).resolve().parents[2])
        paths = [home, *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = dict(os.environ, PYTHONPATH=os.pathsep.join(paths), **HELPER_ENVIRONMENT)
        self._spawned.append(time.monotonic())
        # a session of its own: Ctrl-C in the robot's terminal must not end the helper before the data is saved
        self._process = subprocess.Popen(
            command, pass_fds=[theirs.fileno()], env=environment, start_new_session=True, stdin=subprocess.DEVNULL
        )
        theirs.close()
        self._channel = LinkChannel(ours)
        self._socket = ours
        self._table_sent = -1
        try:
            self._push_state()
        except OSError:
            log.debug("the helper process ended before it read its first message")  # why is asked for next
        self._wait_until_ready()

    def _wait_until_ready(self) -> None:
        readable, _, _ = select.select([self._socket], [], [], READY_TIMEOUT_S)
        message = self._channel.receive() if readable else None
        reply = message.reply if isinstance(message, LinkReply) and message.number == 0 else None
        if isinstance(reply, Done):
            self.socket_path = reply.text
            return
        self._socket.close()
        self._process.kill()
        self._process.wait()
        reason = (
            reply.text
            if isinstance(reply, Refused)
            else f"no answer within {READY_TIMEOUT_S:.0f} s; see its output above"
        )
        raise ConnectionLostError(f"the helper process of logger '{self._logger.options.name}' didn't start: {reason}")

    @property
    def helper_pid(self) -> int:
        """Process id of the helper."""
        return self._process.pid

    # -------------------------------------------------------------------------------------------------- the thread

    def _serve(self) -> None:
        while self.alive:
            readable = select.select([self._socket.fileno(), self._wake], [], [])[0]
            try:
                if self._wake in readable:
                    os.eventfd_read(self._wake)
                    if not self.alive:
                        return
                    self._push_state()
                if self._socket.fileno() in readable:
                    message = self._channel.receive()
                    if message is None:
                        self._helper_died()
                    else:
                        self._handle(message)
            except (OSError, SiloError):  # gone, or what it sends is no message
                self._helper_died()

    def _handle(self, message: object) -> None:
        if isinstance(message, LinkRequest):
            reply = self._answer(message.request)
            self._push_state()
            self._send(LinkReply(message.number, reply))
        elif isinstance(message, LinkReply):
            self._started(message)
        elif isinstance(message, LinkSaved):
            future = self._saves.pop(message.job, None)
            if future is not None:
                if message.error:
                    future.set_exception(SaveError(message.error))
                else:
                    future.set_result(message.files)

    def _started(self, message: LinkReply) -> None:
        future = self._replies.pop(message.number, None)
        if future is None:
            return
        if isinstance(message.reply, SaveStarted):
            # registered here, in the thread that will read the LinkSaved, so that it can't come first
            saved = self._saves[message.reply.job] = concurrent.futures.Future()
            future.set_result(saved)
        else:
            text = message.reply.text if isinstance(message.reply, Refused | Done) else repr(message.reply)
            future.set_exception(SaveError(text))

    def _answer(self, request: ApplyEdits | Start | Stop | Restart | Save) -> EditsApplied | Done | Refused:
        """Do what a client asks; whatever goes wrong becomes words."""
        logger = self._logger
        self._by = request.client
        try:
            if isinstance(request, ApplyEdits):
                return self._edit(request)
            if isinstance(request, Start):
                logger.start()
            elif isinstance(request, Stop):
                logger.stop()
            elif isinstance(request, Restart):
                logger.restart()
            else:
                return Refused(RefusedWhy.INVALID, "a robot process doesn't save for its helper")
        except StateError as error:
            why = RefusedWhy.RUNNING if logger.is_running else RefusedWhy.INVALID
            return Refused(why, str(error))
        except SiloError as error:
            return Refused(RefusedWhy.FAILED, str(error))
        except Exception as error:
            log.exception("%s failed", type(request).__name__)
            return Refused(RefusedWhy.FAILED, f"{type(error).__name__}: {error}")
        return Done()

    def _edit(self, request: ApplyEdits) -> EditsApplied | Refused:
        logger = self._logger
        with logger.lock:
            if logger.is_running:
                return Refused(RefusedWhy.RUNNING, "the logger is running: stop it, then apply; nothing was changed")
            if request.revision not in (-1, logger.revision):
                text = (
                    f"somebody changed the table meanwhile (revision {logger.revision}, the edits are based on "
                    f"{request.revision}): read it again; nothing was changed"
                )
                return Refused(RefusedWhy.CONFLICT, text)
            problems = logger.problems(request.edits)
            if problems:
                return Refused(RefusedWhy.INVALID, f"{len(problems)} fields are invalid; nothing was changed", problems)
            changed = logger.apply(request.edits)
            return EditsApplied(logger.revision, changed)

    def _push_state(self) -> None:
        logger = self._logger
        with logger.lock:
            revision = logger.revision
            table = Table(revision, logger.elements) if revision != self._table_sent else None
            state = RobotState(
                logger=logger.options.name,
                pid=os.getpid(),
                state=logger.state,
                revision=revision,
                options_json=msgspec.json.encode(logger.options),
                folder=logger.options.folder,
                script=logger.options.script,
                segment=logger.segment_path,
                reason=logger.stop_reason,
                by=self._by,
                table=table,
            )
        self._by = ""
        self._send(state)
        self._table_sent = revision

    def _send(self, message: RobotState | LinkRequest | LinkReply | Goodbye) -> None:
        with self._sending:
            self._channel.send(message)

    def _helper_died(self) -> None:
        """Start a new helper; its predecessor may have been killed. The control loop notices nothing."""
        if not self.alive:
            return  # it ended because the logger is being closed
        self._socket.close()
        self._process.kill()
        code = self._process.wait()
        self._fail_pending("the helper process died while it saved; a new one is being started: save again")
        recent = [moment for moment in self._spawned if time.monotonic() - moment < RESPAWN_WINDOW_S]
        name = self._logger.options.name
        if len(recent) >= MAX_RESPAWNS:
            log.error(
                "%s: the helper process died %d times in a row, not starting another; logging goes on",
                name,
                len(recent),
            )
            self.alive = False
            return
        log.warning("%s: the helper process died (exit code %s), starting a new one; logging goes on", name, code)
        try:
            self._spawn()
        except (SiloError, OSError) as failure:
            log.error("%s: %s; logging goes on without it", name, failure)  # noqa: TRY400  # the words say it all
            self.alive = False

    def _fail_pending(self, reason: str) -> None:
        for reply in list(self._replies.values()):
            reply.set_exception(SaveError(reason))
        for save in list(self._saves.values()):
            save.set_exception(SaveError(reason))
        self._replies.clear()
        self._saves.clear()

    # ------------------------------------------------------------------------------------------- for the logger

    def state_changed(self) -> None:
        """Have the thread push the new state. Never waits: called by the tick with which a logger stops by itself."""
        with self._waking:
            if self.alive:
                os.eventfd_write(self._wake, 1)

    def save(self, types: list[FileType], name: str, folder: str = "") -> list[SavedFile]:
        """Save in the helper process; waits without holding the GIL. Raises SaveError."""
        number = next(self._numbers)
        started: concurrent.futures.Future[SaveFuture] = concurrent.futures.Future()
        self._replies[number] = started
        try:
            request = Save(types=types, name=name, folder=folder, client="the robot program")
            self._send(LinkRequest(number, request))
        except OSError as error:
            raise SaveError("the helper process died before it could save: call save() again") from error
        return started.result().result()

    def close(self) -> None:
        """End the helper process: clients are told that the logger was closed. The logger goes on."""
        self._end(say_goodbye=True)

    def abandon(self) -> None:
        """End without a goodbye: the helper process saves what was collected."""
        self.left = (self._logger.segment_path, self._logger.ticks)
        self._end(say_goodbye=False)

    def _end(self, *, say_goodbye: bool) -> None:
        if not self.alive:
            return
        with self._waking:
            self.alive = False
        os.eventfd_write(self._wake, 1)
        if self._thread is not threading.current_thread():
            self._thread.join()  # the goodbye goes to the helper that is there then
            os.close(self._wake)
        if say_goodbye:
            try:
                self._send(Goodbye())
            except OSError:
                log.info("%s: the helper process was gone already", self._logger.options.name)
        self._socket.close()
        self._fail_pending("the logger was closed meanwhile")
        if say_goodbye:
            try:
                self._process.wait(READY_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()

    def __enter__(self) -> "Serving":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close; after Ctrl-C or an error, the helper process saves what was not saved yet."""
        if kind is None or not self._logger.has_unsaved:
            self.close()
        else:
            self.abandon()

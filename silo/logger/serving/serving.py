"""The robot process's end of the link to its helper process: one small thread, never the control loop.

The thread answers what clients ask of the logger (edits, start, stop, restart), pushes every new state, and starts a
new helper when one died, again and again. `collect()` never waits for any of it. The thread holds the logger weakly:
one that the program forgot ends with its helper process.
"""

import concurrent.futures
import functools
import itertools
import logging
import os
import threading
import time
import weakref
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

import msgspec

from silo.core.calls import told_class, told_names
from silo.core.elements import ROBOT_PROGRAM, FileType, SavedFile
from silo.errors import ConnectionLostError, SaveError, SiloError
from silo.link.channel import FILES_DELETED, Beat, Goodbye, LetGo, LinkReply, LinkRequest, LinkSaved
from silo.logger.serving.answers import Served, answer, robot_state
from silo.logger.serving.process import (
    FROZEN_ROUNDS,
    ROUND_S,
    DownMark,
    FoxgloveBridge,
    HelperProcess,
    Patience,
    Tries,
    drawn_id,
)
from silo.loop.run import Run
from silo.parameters.requests import ParametersSet
from silo.parameters.robot import ended
from silo.polling import readable, writable
from silo.recorder.requests import RecorderStarted, StartRecorder, StopRecorder
from silo.recordings.requests import Save, SaveStarted
from silo.requests import AnyReply
from silo.rpc.clocks import clock_s
from silo.rpc.declaring import Done
from silo.rpc.last_answers import LastAnswers
from silo.rpc.refusals import Refused, answered
from silo.segment.held_runs import has_left
from silo.state.handover import ChangeCount, RobotState, RunOffer, offer_run

log = logging.getLogger("silo")

_Result = TypeVar("_Result")
SaveFuture = concurrent.futures.Future[list[SavedFile]]

_LATE_RECORDING = "what it had not begun by then it won't do; `silo record` tells"

LOOK_S = 1.0  # between looks at what the program holds: 2 ms of processor time for 10,000 arrays
LANDING_S = 0.001  # between looks whether a change has landed whose client waits for that, nobody else
WAITS_S = 1.0  # for a tick; then its client hears that it waits
PAUSE_S = 0.0005  # which the loop has between two slices of a look
LISTENED_S = FROZEN_ROUNDS * ROUND_S  # what the helper process has not begun by then, it won't begin


class HelperFrozenError(SaveError):
    """The helper process shows no sign of life, nobody knows whether for good; or it died before it was asked."""


_OF_ADDRESSES = dict.fromkeys(("url", "address", "port", "host"), "`silo address LOGGER` in a shell prints it")


@told_names("serving", _OF_ADDRESSES | dict.fromkeys(("stop", "end", "shutdown", "join"), "it is .close()"))
@told_class("serving")
class Serving:
    """A served logger: a helper process that clients reach. A context manager."""

    def __init__(
        self,
        logger: Served,
        *,
        group: str | None,
        config: str | os.PathLike[str] | None,
        foxglove: int | None = None,
        group_role: str = "operator",
        control: str = "any",
    ) -> None:
        """Start the helper process and wait until it answers.

        Args:
            logger: whose table, state and buffers it shows.
            group: a system group whose members are let in.
            config: a file with remote access settings of Zenoh.
            foxglove: a port for other people's viewers.
            group_role: what members of the group may do.
            control: whether changes need control.

        Raises:
            ConnectionLostError: it didn't start; the message has its reason.
            SiloError: the viewers' port is taken, or a package is missing.
        """
        viewers = None if foxglove is None else FoxgloveBridge(logger.options.name, foxglove)
        self._logger_ref = weakref.ref(logger)
        self._ends = logger._life.ends
        self._name = logger.options.name
        self._arguments = ["--name", self._name, "--id", drawn_id()]  # the same for every helper process of it
        if group is not None:
            self._arguments += ["--group", group, "--group-role", group_role]
        if control != "any":
            self._arguments += ["--control", control]
        if config is not None:
            self._arguments += ["--config", str(Path(config).absolute())]
        self._wake = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._sending = threading.Lock()
        self._telling = threading.RLock()  # its state; taken before the lock of the logger, never with it
        self._waking = threading.RLock()  # held for two writes of 8 bytes only
        self._changes = ChangeCount()
        self._numbers = itertools.count(1)
        self._answers: dict[int, concurrent.futures.Future[tuple[AnyReply, SaveFuture]]] = {}
        self._saves: dict[int, SaveFuture] = {}
        self._done = LastAnswers()
        self._beats = 0  # that were answered
        self._to_end: list[Callable[[], None]] = []  # the logger, or this, as a check of a parameter asked for
        self._landing: list[tuple[int, str, float]] = []  # changes of parameters whose clients wait for their tick
        self._table_sent = -1
        self._by = ""
        self._tries = Tries()
        self._died = ""  # how, and when, a helper process did of which no other one told yet
        self._down = DownMark(self._name)
        self.alive = True  # until it is closed
        self.is_up = False  # whether a helper process is there right now
        self._was_up = False  # as it was closed
        self._over = False  # it is closed to its end
        try:
            self._spawn()
        except (SiloError, OSError) as error:
            os.close(self._wake)
            self._changes.close()
            if viewers is not None:
                viewers.process.close()
            text = f"the helper process of logger '{self._name}' didn't start: {error}"
            raise ConnectionLostError(text) from error
        if viewers is not None:
            viewers.process.begin()
        self._viewers = viewers
        self._thread = threading.Thread(target=self._serve, name="silo-link", daemon=True)
        self._thread.start()

    # ------------------------------------------------------------------------------------------ the helper process

    def _spawn(self) -> None:
        died = ["--died", self._died] if self._died else []
        self._helper = HelperProcess([*self._arguments, *died], self._changes.descriptor)
        self._table_sent = -1
        try:
            self.hand_over()
            self._push_state()
        except OSError:
            log.debug("the helper process ended before it read its first message")  # why is asked for next
        self.socket_path = self._helper.wait_until_ready(lambda: self.alive)
        self._died = ""  # it is told
        self.is_up = True
        for message in self._helper.early:
            self._heard(message)

    @property
    def foxglove_port(self) -> int | None:
        """The port on which Foxglove, Lichtblick and PlotJuggler can look, None for none."""
        return None if self._viewers is None else self._viewers.port

    @property
    def helper_pid(self) -> int:
        """Process id of the helper."""
        return self._helper.pid

    # -------------------------------------------------------------------------------------------------- the thread

    def _serve(self) -> None:
        next_look_s = time.monotonic() + LOOK_S
        while self.alive:
            link = self._helper.link.fileno()
            end = None if self._viewers is None else self._viewers.end
            watched = [link, self._wake] if end is None else [link, self._wake, end]
            ready = readable(*watched, timeout_s=self._until_due(next_look_s))
            try:
                if time.monotonic() >= next_look_s:
                    self._look()
                    next_look_s = time.monotonic() + LOOK_S
                self._look_at_parameters()
                if self._wake in ready:
                    os.eventfd_read(self._wake)
                    if not self.alive:
                        break
                    self._push_state()
                    self._look_at_end()
                if link in ready:
                    message = self._helper.channel.receive()
                    if message is None:
                        self._helper_died()
                    else:
                        self._heard(message)
                if self._viewers is not None:
                    if end in ready:
                        self._viewers.died()
                    self._viewers.look()
                self._end_as_asked(waiting=False)
            except (OSError, SiloError):  # gone, or what it sends is no message
                self._helper_died()
        self._end_as_asked(waiting=True)

    def _end_as_asked(self, *, waiting: bool) -> None:
        """End what it was asked to here; not while another thread ends it, which may wait for what this one hears."""
        if self._to_end and self._ends.acquire(blocking=waiting):
            try:
                while self._to_end:
                    self._to_end.pop(0)()
            finally:
                self._ends.release()

    def _until_due(self, next_look_s: float) -> float | None:
        """Seconds until the next look at what a running logger's program holds, or at changes of its parameters.

        None while there is nothing to see.
        """
        if self._landing:
            return LANDING_S
        logger = self._logger_ref()
        if logger is None:
            return None
        due = [next_look_s] if logger.is_running else []
        parameters = logger.parameters
        looks = [parameters.next_revert_s(), parameters.excitations.next_look_s()]
        looks += [] if self._viewers is None else [self._viewers.due_s]
        due += [at_s for at_s in looks if at_s is not None]
        return max(0.0, min(due) - time.monotonic()) if due else None

    def _look_at_parameters(self) -> None:
        """Answer those whose changes landed, or wait for too long; take back what nobody confirmed, or is stuck."""
        logger = self._logger_ref()
        if logger is None:
            return
        logger.parameters.revert_due()
        logger.parameters.excitations.look(logger.options.frequency_hz)
        for waits in list(self._landing):
            number, name, until_s = waits
            reply = answered(functools.partial(ended, logger.parameters, name))
            if isinstance(reply, ParametersSet) and reply.waits and time.monotonic() < until_s:
                continue
            self._landing.remove(waits)
            self._send(LinkReply(number, reply))

    def _look_at_end(self) -> None:
        """The last look at a run that stopped by itself, which its loop has no time for."""
        logger = self._logger_ref()
        if logger is not None and not logger.is_running:
            logger._data.look_for_unheld()

    def _look(self) -> None:
        """Tell of arrays that nobody but silo holds any more. The loop has the interpreter in between."""
        logger = self._logger_ref()
        run = logger._present.run if logger is not None else None
        if logger is not None and run is not None:
            logger._data.look_for_unheld(run, run.left_behind(lambda: time.sleep(PAUSE_S)))

    def _heard(self, message: object) -> None:
        logger = self._logger_ref()
        if isinstance(message, LinkRequest) and logger is not None:
            with self._telling:
                self._by = message.request.client
                reply = answer(logger, message.request)
                if number := message.request.number:  # at once: the helper process may have ended by now
                    self._done.keep(message.request.client, number, msgspec.msgpack.encode(reply))
                self._push_state()
            if isinstance(reply, ParametersSet) and reply.waits:
                self._landing.append((message.number, reply.name, time.monotonic() + WAITS_S))
            else:
                self._send(LinkReply(message.number, reply))
        elif isinstance(message, Beat):
            self._beats += 1
        elif isinstance(message, LinkReply):
            self._replied(message)
        else:
            self._hear_saved(message)

    def _hear_saved(self, message: object) -> None:
        logger = self._logger_ref()
        if not isinstance(message, LinkSaved):
            return
        if logger is not None and message.ticks:
            logger._data.note_saved(message.run, message.ticks)
        future = self._saves.pop(message.job, None)
        if future is not None:
            if message.error:
                future.set_exception(SaveError(message.error))
            else:
                future.set_result(message.files)

    def _replied(self, message: LinkReply) -> None:
        asked, reply, saving = self._answers.pop(message.number, None), message.reply, SaveFuture()
        if asked is None:
            return
        if isinstance(reply, Refused):
            asked.set_exception(HelperFrozenError(reply.text) if message.late else SaveError(reply.text))
            return
        if isinstance(reply, SaveStarted):
            # registered here, in the thread that will read the LinkSaved, so that it can't come first
            self._saves[reply.job] = saving
        asked.set_result((reply, saving))

    def _push_state(self) -> None:
        logger = self._logger_ref()
        if logger is None:
            return  # it is being forgotten, and ends this
        with self._telling:
            state = robot_state(logger, self._by, self._table_sent, self._changes.now)
            if self._table_sent < 0:  # it is a new one
                state = msgspec.structs.replace(state, done=self._done.by_number)
            self._by = ""
            self._send(state)
            self._table_sent = state.revision

    def _send(self, message: RobotState | LinkRequest | LinkReply | LetGo | Goodbye) -> None:
        """Send a message. Raises OSError where the helper process is gone, or frozen with its buffer full."""
        patience = self._patience()
        while not self._sending.acquire(timeout=ROUND_S):
            if patience.is_over():
                raise TimeoutError("another thread waits for a frozen helper process")
        try:
            self._helper.channel.send(message, patience.is_over)
        finally:
            self._sending.release()

    def _patience(self) -> Patience:
        return Patience(lambda: self._beats, self._helper.worked_ns)

    def _beat(self) -> None:
        """Ask the helper process for a sign of life, unless that would mean to wait."""
        if not self._sending.acquire(blocking=False):
            return
        try:
            if writable(self._helper.link.fileno(), 0):
                self._helper.channel.send(Beat())
        except (OSError, ValueError):  # it is being replaced: whoever waits is told by others
            log.debug("no beat can be sent")
        finally:
            self._sending.release()

    def _wait(self, future: "concurrent.futures.Future[_Result]", then: str) -> _Result:
        """Return what the helper process answers. Raises HelperFrozenError where it shows no sign of life."""
        patience = self._patience()
        while True:
            self._beat()
            try:
                return future.result(ROUND_S)
            except concurrent.futures.TimeoutError:
                if patience.is_over():
                    raise HelperFrozenError(
                        f"the helper process (pid {self.helper_pid}) shows no sign of life: it is frozen (SIGSTOP, a "
                        f"debugger, no memory); {then}"
                    ) from None

    def _helper_died(self) -> None:
        """Start a new helper, as often as it takes. The control loop notices nothing."""
        self._end_as_asked(waiting=False)  # it may be long until there is another
        if not self.alive:
            return  # it ended because the logger is being closed
        self.is_up = False
        self._landing.clear()  # whoever waited asked the process that died
        if (logger := self._logger_ref()) is not None:
            logger.parameters.excitations.stop("", "the helper process died")
        del logger  # it may be forgotten while no new one starts
        self._down.set()
        code = self._helper.end()
        self._fail_pending("the helper process died while it saved; a new one is being started: save again")
        self._tries.died()
        if code == FILES_DELETED:
            log.warning("%s: a new helper process makes the folder and the socket of this logger anew", self._name)
        else:
            self._died = self._died or f"{code} {time.time_ns()}"
            log.warning(
                "%s: the helper process died (exit code %s), starting a new one; logging goes on", self._name, code
            )
        while self.alive and not self._respawned():
            pass
        self._down.clear()

    def _respawned(self) -> bool:
        """Wait for the next try and make it; False if it failed."""
        until_s = time.monotonic() + self._tries.delay_s
        while (left_s := until_s - time.monotonic()) > 0:
            if readable(self._wake, timeout_s=left_s):
                os.eventfd_read(self._wake)
                if not self.alive:
                    return True
        self._tries.begin()
        try:
            self._spawn()
        except (SiloError, OSError) as failure:
            log.error(  # noqa: TRY400  # the words say it all
                "%s: no helper process: %s; clients can't reach this logger, logging goes on, save() works in this "
                "process; it is tried again in %g s",
                self._name,
                failure,
                self._tries.delay_s,
            )
            return False
        if self._tries.count > 1:
            log.warning("%s: a helper process is there again", self._name)
        return True

    def _fail_pending(self, reason: str) -> None:
        pending: list[concurrent.futures.Future[Any]] = [*self._answers.values(), *self._saves.values()]
        for waiting in pending:
            waiting.set_exception(SaveError(reason))
        self._answers.clear()
        self._saves.clear()

    # ------------------------------------------------------------------------------------------- for the logger

    def state_changed(self) -> None:
        """Have the thread push the new state. Never waits: called by the tick with which a logger stops by itself."""
        with self._waking:
            if self.alive:
                self._changes.add()
                os.eventfd_write(self._wake, 1)

    def hand_over(self) -> None:
        """Make the present run known to the helper process, before its first tick. Never waits."""
        logger = self._logger_ref()
        run = logger._present.run if logger is not None else None
        if run is None:
            return
        offer = RunOffer(run.id, str(run.segment.path), run.segment.named)
        with run.segment.open_read_only() as file:
            if not offer_run(self._helper.runs, offer, file.fileno()):
                log.info("%s: the helper process takes no run over now, its successor will", self._name)

    def let_go(self, *, held_alone: bool) -> None:
        """Have the helper process free the memory of runs, soon: it is needed for the next one.

        Args:
            held_alone: of those before the present one only.
        """
        try:
            self._send(LetGo(held_alone=held_alone))
        except OSError:
            log.debug("a helper process that is gone holds nothing")

    def save(self, types: list[FileType], name: str, folder: str = "", run: Run | None = None) -> list[SavedFile]:
        """Save in the helper process; waits without holding the GIL.

        Args:
            types: file types.
            name: a file name without ending; empty: the usual one.
            folder: where to; empty: the logger's folder.
            run: a stretch before the present one, instead of that.

        Returns:
            The files: path, size in bytes.

        Raises:
            SaveError: it failed, with the reason.
        """
        logger = self._logger_ref()
        # what was derived just now may not have been told yet
        conditions = logger._conditions.now if logger is not None else None
        segment, why = ("", "") if run is None else (str(run.segment.path), "saved when edits were applied")
        request = Save(
            types=types,
            name=name,
            folder=folder,
            conditions=conditions,
            segment=segment,
            why=why,
            client=ROBOT_PROGRAM,
        )
        _, saving = self._asked(request, SaveStarted, "it saves nothing later")
        return self._wait(saving, "it had begun to save, and goes on when it wakes")

    def record(self, request: StartRecorder) -> RecorderStarted:
        """Start an endless recording in a process of the helper's; waits for its first words.

        Args:
            request: what to record and where to; folders outside of the logger's are fine.

        Returns:
            Its name, its folder, and in `text` what will not be recorded without end.

        Raises:
            SaveError: it can't record, with the reason, or the helper process died.
        """
        return self._asked(request, RecorderStarted, _LATE_RECORDING)[0]

    def stop_recording(self, name: str) -> str:
        """Finish an endless recording; waits up to 5 s for the end of its last part.

        Args:
            name: of the recording; empty: the only one.

        Returns:
            What was done, in words.

        Raises:
            SaveError: there is none, or none of that name, or several without a name; or the helper process died.
        """
        return self._asked(StopRecorder(name=name, client=ROBOT_PROGRAM), Done, _LATE_RECORDING)[0].text

    def _asked(
        self, request: Save | StartRecorder | StopRecorder, wanted: type[_Result], then: str
    ) -> tuple[_Result, SaveFuture]:
        """Return the helper process's answer, with what a save that is begun comes to. Raises SaveError."""
        if self._thread is threading.current_thread():  # `check=` of a parameter, which that answer would wait for
            raise SaveError("no save and no recording within a check: it would wait for itself; use another thread")
        number = next(self._numbers)
        asked: concurrent.futures.Future[tuple[AnyReply, SaveFuture]] = concurrent.futures.Future()
        self._answers[number] = asked
        until_s = clock_s() + LISTENED_S
        try:
            self._push_state()  # first: it may be about what was added just now
            self._send(LinkRequest(number, msgspec.structs.replace(request, until_s=until_s)))
        except OSError as error:
            self._answers.pop(number, None)
            if isinstance(error, TimeoutError):
                raise HelperFrozenError("the helper process takes nothing in: it is frozen") from error
            gone = "the helper process died just now, a new one is being started"
            raise HelperFrozenError(gone if isinstance(request, Save) else f"{gone}: try again") from error
        reply, saving = self._wait(asked, then)
        if not isinstance(reply, wanted):
            raise SaveError(repr(reply))
        return reply, saving

    def close(self) -> None:
        """End the helper process: clients are told that the logger was closed. The logger goes on.

        Amid a call of the logger in the same thread, as in a signal handler, this returns at once: it ends after that.
        """
        self._close(self.end)

    def _close(self, end: Callable[[], None]) -> None:
        logger = self._logger_ref()
        end() if logger is None else logger._life.end(end)

    def keeps(self, end: Callable[[], None]) -> bool:
        """Keep an end for after an answer, where it is asked for amid that.

        Args:
            end: ends the logger, or this.

        Returns:
            Whether it is kept; else the caller does it.
        """
        if self._thread is not threading.current_thread() or self._logger_ref() is None:  # being forgotten
            return False
        self._to_end.append(end)
        os.eventfd_write(self._wake, 1)
        return True

    def forget(self) -> None:
        """Serve nobody, in a forked child, and hold nothing by whose end others learn that its parent ended."""
        self.alive, self.is_up, self._over = False, False, True
        self._helper.let_go()
        self._down.let_go()
        if self._viewers is not None:
            self._viewers.process.let_go()

    def end(self, leave: Callable[[], bool] = lambda: False) -> None:
        """End the helper process: by a goodbye; or where it is to save what was collected, and is up, without.

        Each step may be done again, where it was interrupted.

        Args:
            leave: has that be the helper process's, and returns whether there is any.
        """
        if self._over:
            return
        is_thread = self._thread is threading.current_thread()
        with self._ends, self._waking:
            self.alive = False
            self._no_more_asked()
            if not self._over:
                os.eventfd_write(self._wake, 1)
        if not is_thread:  # which may come to this, too
            self._thread.join()  # the goodbye goes to the helper that is there then
        with self._ends:
            if self._over:
                return
            self._no_more_asked()  # one that was just being started
            if self._viewers is not None:
                self._viewers.process.close()  # before its logger goes, which it would complain of
            if not self._was_up or not leave():
                self._say_goodbye()
            self._helper.let_go()
            self._fail_pending("the logger was closed meanwhile")
            with self._waking:
                self.is_up, self._over = False, True
                self._changes.close()
                if not is_thread:
                    os.close(self._wake)

    def _no_more_asked(self) -> None:
        """Nobody will read what it answers."""
        self._was_up, self.is_up = self._was_up or self.is_up, False

    def _say_goodbye(self) -> None:
        """End the helper process; where it is down and left something to do, one more does that first."""
        logger = self._logger_ref()
        if self._parted() or logger is None:
            return
        if has_left(logger.options.name, logger.options.id) or (logger.ticks and logger._conditions.now.judged):
            try:
                self._spawn()
            except (SiloError, OSError) as error:
                log.warning("%s: no helper process to end with: %s", self._name, error)
            else:
                self._no_more_asked()
                self._parted()

    def _parted(self) -> bool:
        """Say goodbye to the helper process, and wait for its end; False where it didn't come to that by itself."""
        try:
            self._send(Goodbye())
            return not self._was_up or self._helper.wait_out(self._hear_saved) == 0
        except (OSError, SiloError):
            log.info("%s: the helper process was gone already", self._name)
            return False

    def __enter__(self) -> "Serving":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close; after Ctrl-C or an error, save what was not saved yet. The logger goes on."""
        self._close(self.end if kind is None or self._over else self._end_by_error)

    def _end_by_error(self) -> None:
        logger = self._logger_ref()
        if logger is None:
            self.end()
            return
        with self._ends:
            logger._data.save_unsaved("is served no more after an error")
        self.end(logger._leave)  # another thread may end the logger, too

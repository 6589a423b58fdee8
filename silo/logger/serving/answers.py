"""What a logger tells its helper process, and who does what clients ask of it through that.

Called by the thread of `silo.logger.serving.serving`, never by the loop.
"""

import os
import threading
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import msgspec

from silo.conditions.robot import ConditionRobot, ConditionsOfLogger
from silo.core.elements import LoggerOptions, State, Table
from silo.errors import SaveError, ScriptError, StateError
from silo.logger.arguments.options import end_at_start
from silo.logger.current_run import CurrentRun
from silo.loop.run import Run
from silo.parameters.parameters import Parameters
from silo.parameters.robot import ParameterRobot
from silo.rpc.declaring import Reply, Request
from silo.rpc.refusals import WHYS, RefusedWhy, RequestRefusedError, answered
from silo.rpc.serving import Dispatch, Sender, Turn
from silo.state.handover import RobotState
from silo.state.robot import StateOfLogger, StateRobot, TableOfLogger


class RunSamples(Protocol):
    """What a logger's run holds, seen from here."""

    def look_for_unheld(self, run: Run | None = None, found: Sequence[int] | None = None) -> None: ...
    def note_saved(self, run_id: str, ticks: int, /) -> None: ...
    def save_unsaved(self, ended: str, /) -> None: ...


class Life(Protocol):
    """A logger's life, seen from here."""

    ends: threading.RLock

    def end(self, end: Callable[[], None], /) -> None: ...


class Served(StateOfLogger, Protocol):
    """A logger, seen from here: what its clients may know of it and ask of it."""

    options: LoggerOptions
    parameters: Parameters
    _present: CurrentRun

    @property
    def _life(self) -> Life: ...
    @property
    def _scripted(self) -> TableOfLogger: ...
    @property
    def _conditions(self) -> ConditionsOfLogger: ...
    @property
    def _data(self) -> RunSamples: ...
    @property
    def stop_reason(self) -> str: ...
    @property
    def ticks(self) -> int: ...
    def _leave(self) -> bool: ...


def robot_state(logger: Served, by: str, table_sent: int, changes: int = 0) -> RobotState:
    """Return what the helper is to know now; with the table, unless that revision was sent before.

    `changes` were counted before this call.
    """
    table = logger._scripted
    with table.lock:
        revision = table.revision
        return RobotState(
            logger=logger.options.name,
            pid=os.getpid(),
            state=State.RUNNING if logger.is_running else State.STOPPED,
            revision=revision,
            options_json=msgspec.json.encode(logger.options),
            folder=logger.options.folder,
            script=logger.options.script,
            segment=logger._present.path,
            reason=logger.stop_reason,
            by=by,
            table=Table(revision, table.elements, given=table.given) if revision != table_sent else None,
            conditions=logger._conditions.now,
            saved=logger._present.saved_before,
            cut_off=logger._present.unsaved_before,
            begun_ns=logger._present.begun_ns,
            before_ticks=logger._present.ticks_before,
            changes=changes,
        )


def answer(logger: Served, request: Request[Any]) -> Reply:
    """Do what a client asks; whatever goes wrong becomes words."""
    present, folder = logger._present, logger.options.folder
    state = StateRobot(
        logger, logger._scripted, lambda: present.saved_before, logger.options.max_time_s,
        logger._conditions.less_captured, lambda: end_at_start(logger.options, logger._scripted.elements),
        lambda: present.check_room(folder),
    )  # fmt: skip
    parameters = ParameterRobot(logger.parameters, logger.options.frequency_hz)
    dispatch = Dispatch([state, ConditionRobot(logger._conditions), parameters], _not_ours)
    running = RefusedWhy.RUNNING if logger.is_running else RefusedWhy.INVALID
    whys = {**WHYS, StateError: running, SaveError: RefusedWhy.FAILED, ScriptError: RefusedWhy.FAILED}
    reply = answered(lambda: dispatch.reply(request, Turn(Sender("", request.client))), whys)
    assert isinstance(reply, Reply)
    return reply


def _not_ours(request: Request[Any], _: Turn) -> Reply:
    text = f"a robot process doesn't do {type(request).__name__} for its helper"
    raise RequestRefusedError(RefusedWhy.INVALID, text)

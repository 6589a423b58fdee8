"""What the helper has to do requests with, and what several of them need."""

from dataclasses import dataclass
from typing import Any

import msgspec

from silo.conditions.monitor import Judge
from silo.control.lock import ControlLock
from silo.core.elements import State
from silo.helper.robot_link import REPLY_TIMEOUT_S, RobotLink
from silo.helper.saver import Saver
from silo.history.pins import Pins
from silo.live.publisher import Publisher
from silo.live.statistics import Surveyor
from silo.recorder.server import EndlessRecordings
from silo.recordings.folder import RecordingFolder
from silo.rpc.declaring import Reply, ReplyT, Request
from silo.rpc.refusals import RefusedWhy, RequestRefusedError, checked, raised
from silo.rpc.serving import Turn
from silo.scripts.early_refusals import refused_running
from silo.state.events import EventNotifier
from silo.state.replica import LoggerSnapshot, Replica


@dataclass(frozen=True)
class Parts:
    """Everything that the helper has."""

    replica: Replica
    events: EventNotifier
    publisher: Publisher
    saver: Saver
    robot: RobotLink
    judge: Judge
    recording: EndlessRecordings
    pins: Pins
    recordings: RecordingFolder
    surveyor: Surveyor
    control_lock: ControlLock


def ask_robot(parts: Parts, request: Request[Any], turn: Turn) -> Reply:
    """Return what the robot program answers; while its client listens it is waited for.

    Raises RequestRefusedError where it refuses or has ended, GoesOnError where it takes longer.
    """
    must_live(parts.replica.now)
    request = msgspec.structs.replace(request, client=turn.by)
    return raised(parts.robot.ask(request, turn.left_s(REPLY_TIMEOUT_S)))


def relayed(parts: Parts, request: Request[ReplyT], turn: Turn) -> ReplyT:
    """Return what the robot program answers, if that is the reply of the request. Raises as `ask_robot` does."""
    return checked(request, ask_robot(parts, request, turn), "the robot process")


def must_live(now: LoggerSnapshot) -> None:
    """Raise RequestRefusedError where the robot program has ended."""
    if now.died:
        raise RequestRefusedError(RefusedWhy.DEAD, f"{now.died}; start the robot program again")


def must_stop(now: LoggerSnapshot) -> None:
    """Raise RequestRefusedError for a logger that runs."""
    if now.state is State.RUNNING:
        raise refused_running()

"""Which function answers which request, and what all of them may need."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import msgspec

from silo.helper.events import Events, plain
from silo.helper.judge import Judge
from silo.helper.lanes import Lane, Turn
from silo.helper.mirror import LoggerSnapshot, Mirror
from silo.helper.operators import Operators
from silo.helper.pins import Pins
from silo.helper.publisher import Publisher
from silo.helper.recorders import Recording
from silo.helper.recordings import RecordingFolder
from silo.helper.robot import REPLY_TIMEOUT_S, Robot
from silo.helper.saver import Saver
from silo.helper.statistics import Surveyor
from silo.ipc.messages import AnyReply, GoesOn, Refused, RefusedWhy, ReplyT, Request, RobotRequest, SlowAsk
from silo.ipc.refusals import refused_running
from silo.model import State

Signed = TypeVar("Signed", bound=Request[Any])


@dataclass(frozen=True)
class Parts:
    """Everything that the helper has, and whose turn it is."""

    mirror: Mirror
    events: Events
    publisher: Publisher
    saver: Saver
    robot: Robot
    judge: Judge
    recording: Recording
    pins: Pins
    recordings: RecordingFolder
    surveyor: Surveyor
    operators: Operators
    turn: Turn = field(default_factory=Turn)


Handler = Callable[[Parts, Any], Any]
Function = TypeVar("Function", bound=Handler)

HANDLERS: dict[type[Request[Any]], Handler] = {}
LANES: dict[type[Request[Any]], Lane] = {}


def answers_to(
    *kinds: type[Request[ReplyT]], lane: Lane | None = None
) -> Callable[[Callable[[Parts, Any], ReplyT | bytes | GoesOn | Refused]], Any]:
    """Register a function for a kind of request; bytes are a reply that is encoded already.

    `lane` is what it may wait for; the robot program and what is read slowly are known by the kind.
    """

    def register(function: Function) -> Function:
        HANDLERS.update(dict.fromkeys(kinds, function))
        LANES.update({kind: lane or _lane(kind) for kind in kinds})
        return function

    return register


def _lane(kind: type[Request[Any]]) -> Lane:
    if issubclass(kind, RobotRequest):
        return Lane.ROBOT
    return Lane.SLOW if issubclass(kind, SlowAsk) else Lane.NOW


def relayed(parts: Parts, request: RobotRequest[Any]) -> AnyReply:
    """Return what the robot program answers, if it lives; while its client listens it is waited for."""
    refused = must_live(parts.mirror.now)
    return refused or parts.robot.ask(signed(request), parts.turn.left_s(REPLY_TIMEOUT_S))


def unexpected(request: Request[Any], reply: AnyReply) -> Refused:
    """Return what a client is told of an answer of the robot process that makes no sense."""
    text = f"the robot process answered {type(request).__name__} with a {type(reply).__name__}"
    return Refused(RefusedWhy.FAILED, text)


def must_live(now: LoggerSnapshot) -> Refused | None:
    """Return what is said of a robot program that has ended, None while it lives."""
    return Refused(RefusedWhy.DEAD, f"{now.died}; start the robot program again") if now.died else None


def must_stop(now: LoggerSnapshot) -> Refused | None:
    """Return what is said of a logger that runs, None where it is stopped."""
    return refused_running() if now.state is State.RUNNING else None


def signed(request: Signed) -> Signed:
    """Return the request with a sender that is safe to show."""
    return msgspec.structs.replace(request, client=plain(request.client))

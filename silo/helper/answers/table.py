"""Which function answers which request, and what all of them may need."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import msgspec

from silo.helper.events import Events, plain
from silo.helper.judge import Judge
from silo.helper.mirror import LoggerSnapshot, Mirror
from silo.helper.operators import Operators
from silo.helper.pins import Pins
from silo.helper.publisher import Publisher
from silo.helper.recorders import Recording
from silo.helper.recordings import RecordingFolder
from silo.helper.robot import Robot
from silo.helper.saver import Saver
from silo.helper.statistics import Surveyor
from silo.ipc.messages import AnyReply, GoesOn, Refused, RefusedWhy, ReplyT, Request
from silo.ipc.refusals import refused_running
from silo.model import State

Signed = TypeVar("Signed", bound=Request[Any])


@dataclass(frozen=True)
class Parts:
    """Everything that the helper has."""

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


Handler = Callable[[Parts, Any], Any]
Function = TypeVar("Function", bound=Handler)

HANDLERS: dict[type[Request[Any]], Handler] = {}


def answers_to(
    *kinds: type[Request[ReplyT]],
) -> Callable[[Callable[[Parts, Any], ReplyT | bytes | GoesOn | Refused]], Any]:
    """Register a function for a kind of request; bytes are a reply that is encoded already."""

    def register(function: Function) -> Function:
        HANDLERS.update(dict.fromkeys(kinds, function))
        return function

    return register


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

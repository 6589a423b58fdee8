"""What all requests and replies are: their bases, and the replies that any request may get."""

import enum
import re
from typing import Any, ClassVar, Generic, TypeVar, get_args

import msgspec

from silo.model import Problem

ReplyT = TypeVar("ReplyT", bound="Reply")


class Reply(msgspec.Struct, frozen=True, tag=True):
    """Base of the replies that are not nouns of their own."""


class Done(Reply, frozen=True):
    """It worked; `text` says what was done, fit to show."""

    text: str = ""


class GoesOn(Reply, frozen=True):
    """The robot process hasn't answered yet, and may still do it: an event with the number `job` tells how it ended."""

    job: int
    text: str


class RefusedWhy(str, enum.Enum):
    """The reasons that a client can act on. One that only a newer silo knows is read as FAILED."""

    RUNNING = "running"  # stop first
    CONFLICT = "conflict"  # somebody else changed the table: read it again
    INVALID = "invalid"
    NOT_FOUND = "not found"
    EXISTS = "exists"
    FORBIDDEN = "forbidden"
    DEAD = "dead"
    FAILED = "failed"
    UNSAVED = "unsaved"  # save or discard
    CONTROL = "control"  # somebody else has control
    LATE = "late"  # its turn came when its client had given up, or was about to

    @classmethod
    def _missing_(cls, _: object) -> "RefusedWhy":
        return cls.FAILED


class Refused(Reply, frozen=True):
    """Nothing was changed. `text` says why and what to do; `problems` has one line per rejected field."""

    why: RefusedWhy
    text: str
    problems: list[Problem] = []


class Request(msgspec.Struct, Generic[ReplyT], frozen=True, tag=True, kw_only=True):
    """Base of all requests, by the type of their reply.

    `client` says who asks, for events: `alice@laptop silo-tui 4711`; `protocol` is the client's, set when the request
    is sent (those of protocol 1 said none). `timeout_s` is how long a client waits, `max_bytes` what a helper process
    reads. `until_s` is when its client gives up, by the helper's clock (`HelloReply.clock_s`): what isn't begun by then
    is refused, not done; 0 where that isn't known, then it is `timeout_s` after it came.
    """

    key: ClassVar[str]
    timeout_s: ClassVar[float]
    max_bytes: ClassVar[int]

    client: str = ""
    protocol: int = 1
    until_s: float = 0.0


class Ask(Request[ReplyT], Generic[ReplyT], frozen=True):
    """Base of the requests that only read."""

    key: ClassVar[str] = "ask"
    timeout_s: ClassVar[float] = 2.0
    max_bytes: ClassVar[int] = 2 * 2**20


class SlowAsk(Ask[ReplyT], Generic[ReplyT], frozen=True):
    """Base of those for which files or gigabytes are read: a thread of its own answers them."""

    timeout_s: ClassVar[float] = 15.0


class Do(Request[ReplyT], Generic[ReplyT], frozen=True):
    """Base of the requests that change something. Where somebody has control, `needs_control` keeps out all others."""

    key: ClassVar[str] = "do"
    needs_control: ClassVar[bool] = True
    timeout_s: ClassVar[float] = 8.0  # the helper itself waits 5 s for the robot process
    max_bytes: ClassVar[int] = 8 * 2**20 - 4096  # with Zenoh's own bytes within MAX_MESSAGE_BYTES


class RobotRequest(Do[ReplyT], Generic[ReplyT], frozen=True):
    """Base of the requests that the helper process hands on to the robot process."""


def spoken(request: Request[Any]) -> str:
    """Return what a request is called where it is told of: `apply edits`."""
    return re.sub(r"(?<!^)(?=[A-Z])", " ", type(request).__name__).lower()


def leaves(base: type[msgspec.Struct]) -> tuple[type[Any], ...]:
    """Return the structs below a base that are no bases themselves."""
    found: list[type[Any]] = []
    for kind in base.__subclasses__():
        found += leaves(kind) or (kind,)
    return tuple(found)


def reply_type(request: type[Request[ReplyT]]) -> type[ReplyT]:
    """Return the type of the reply that a request declares."""
    kind: type[ReplyT] = get_args(vars(request)["__orig_bases__"][0])[0]
    return kind

"""What is not done, and why: one error, raised by whoever finds it out, on the robot and at the client alike.

A helper or robot process makes an answer of it in `answered`, a client the same error of that answer in `checked`.
"""

import contextlib
import enum
import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TypeVar

from silo.core.elements import Problem
from silo.errors import (
    ConnectionLostError,
    ElementError,
    GoesOnError,
    RefusedError,
    SaveError,
    ScriptError,
    SiloError,
    StateError,
    UnsavedError,
)
from silo.rpc.declaring import GoesOn, Reply, ReplyT, Request, reply_type

T = TypeVar("T")
Word = TypeVar("Word", bound=enum.Enum)

log = logging.getLogger("silo")


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
    problems: list[Problem] = []  # noqa: RUF012  # msgspec copies defaults


class RequestRefusedError(RefusedError):
    """This is not done: `why` to act on, `problems` with one line per rejected field."""

    def __init__(self, why: RefusedWhy, text: str, problems: Iterable[Problem] = ()) -> None:
        super().__init__(text)
        self.why, self.problems = why, list(problems)


@contextlib.contextmanager
def paths_refused(outcome: str) -> Iterator[None]:
    """Refuse a path that the system can't follow: a name in it is too long, or links lead in a circle."""
    try:
        yield
    except (OSError, RuntimeError) as error:  # a circle is a RuntimeError until Python 3.13
        why = getattr(error, "strerror", None) or "its links lead in a circle"
        raise RequestRefusedError(RefusedWhy.INVALID, f"this path leads nowhere: {why}; {outcome}") from error


WHYS: Mapping[type[Exception], RefusedWhy] = {
    UnsavedError: RefusedWhy.UNSAVED,
    StateError: RefusedWhy.INVALID,
    ElementError: RefusedWhy.INVALID,
    ScriptError: RefusedWhy.INVALID,
    SaveError: RefusedWhy.INVALID,
    SiloError: RefusedWhy.FAILED,
}


def meant(kind: type[Word], argument: str, value: object, outcome: str) -> Word:
    """Return what a word means. Raises RefusedError for one that means nothing."""
    try:
        return kind(value)
    except ValueError:
        words = ", ".join(repr(one.value) for one in kind)
        raise RefusedError(f"{argument} must be one of {words}, got {value!r}; {outcome}") from None


def answered(do: Callable[[], T], whys: Mapping[type[Exception], RefusedWhy] = WHYS) -> T | Refused | GoesOn:
    """Return what something returns, or the answer that an error of it is; `whys` goes by the class of the error.

    What breaks something is refused and logged.
    """
    try:
        return do()
    except RequestRefusedError as error:
        return Refused(error.why, str(error), error.problems)
    except GoesOnError as error:
        return GoesOn(error.job, str(error))
    except SiloError as error:
        return Refused(next(whys[kind] for kind in type(error).__mro__ if kind in whys), str(error))
    except Exception as error:
        log.exception("a request failed")
        return Refused(RefusedWhy.FAILED, f"{type(error).__name__}: {error}")


def raised(reply: Reply) -> Reply:
    """Return a reply. Raises RequestRefusedError for a refusal, GoesOnError where it isn't done yet."""
    if isinstance(reply, Refused):
        raise RequestRefusedError(reply.why, reply.text, reply.problems)
    if isinstance(reply, GoesOn):
        raise GoesOnError(reply.text, reply.job)
    return reply


def checked(request: Request[ReplyT], reply: Reply, who: str = "the helper process") -> ReplyT:
    """Return the reply if it is of the request's type. Raises as `raised` does, ConnectionLostError for another one."""
    reply = raised(reply)
    if not isinstance(reply, reply_type(type(request))):
        raise ConnectionLostError(f"{who} answered {type(request).__name__} with a {type(reply).__name__}")
    return reply

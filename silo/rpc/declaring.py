"""How a request is declared: once, as a method of the client that makes it, or as a struct where it is kept as a whole.

    class ConditionRequests(Caller):
        @change(robot=True)
        def set_trigger(self, trigger: TriggerOptions, lease_s: float = 0.0) -> str:
            \"\"\"Add a trigger or replace the one of its name.\"\"\"

From that come the struct `SetTrigger(trigger, lease_s)` that travels, its place among those that are decoded, and what
the method does: it sends one and returns the reply, of `Done` the text. A body is there to change arguments before they
are sent: `return given(names=texts("names", names, ...))`. Who does it is a method of the same name of a `Server`.

All are msgspec structs in msgpack. Requests that only read go to the key `ask`, those that change something to `do`:
two keys, so that roles can be given by access control. Every request gets exactly one reply.
"""

import enum
import functools
import re
from collections.abc import Callable
from types import FunctionType
from typing import Any, ClassVar, Concatenate, Generic, ParamSpec, TypeVar, cast, get_args

import msgspec

from silo.core.calls import told

ReplyT = TypeVar("ReplyT", bound="Reply")
F = TypeVar("F", bound=Callable[..., Any])
P = ParamSpec("P")


class Lane(enum.Enum):
    """What a request waits for where it is done, in words."""

    NOW = "others before it"  # nothing that takes long
    ROBOT = "the robot program, which is stopped or has much to do"
    RECORDERS = "a recorder process"
    DISK = "the robot's disk"
    SLOW = "histories and files that are read"


class Reply(msgspec.Struct, frozen=True, tag=True):
    """Base of the replies that are not nouns of their own."""


class Done(Reply, frozen=True):
    """It worked; `text` says what was done, fit to show."""

    text: str = ""


class GoesOn(Reply, frozen=True):
    """The robot process hasn't answered yet, and may still do it: an event with the number `job` tells how it ended."""

    job: int
    text: str


class Request(msgspec.Struct, Generic[ReplyT], frozen=True, tag=True, kw_only=True):
    """Base of all requests, by the type of their reply.

    `client` says who asks, for events: `alice@laptop silo-tui 4711`; `protocol` is the client's, set when the request
    is sent (those of protocol 1 said none). `timeout_s` is how long a client waits, `max_bytes` what a helper process
    reads. `until_s` is when its client gives up, by the helper's clock (`HelloReply.clock_s`): what isn't begun by then
    is refused, not done; 0 where that isn't known, then it is `timeout_s` after it came. `declared` is the method that
    declares it, empty where a struct does.
    """

    key: ClassVar[str]
    timeout_s: ClassVar[float]
    max_bytes: ClassVar[int]
    lane: ClassVar[Lane]
    declared: ClassVar[str] = ""

    client: str = ""
    protocol: int = 1
    until_s: float = 0.0


class Ask(Request[ReplyT], Generic[ReplyT], frozen=True):
    """Base of the requests that only read."""

    key: ClassVar[str] = "ask"
    timeout_s: ClassVar[float] = 2.0
    max_bytes: ClassVar[int] = 2 * 2**20
    lane: ClassVar[Lane] = Lane.NOW


class SlowAsk(Ask[ReplyT], Generic[ReplyT], frozen=True):
    """Base of those for which files or gigabytes are read: a thread of its own answers them."""

    timeout_s: ClassVar[float] = 15.0
    lane: ClassVar[Lane] = Lane.SLOW


class Do(Request[ReplyT], Generic[ReplyT], frozen=True, kw_only=True):
    """Base of the requests that change something. Where somebody has control, `needs_control` keeps out all others.

    `number` tells it from all others of its `client`, empty where that gave none: asked again with the same one it is
    not done again, and answered as it was. `asked_pid` is the helper process that was asked for it before, 0: none.
    """

    key: ClassVar[str] = "do"
    needs_control: ClassVar[bool] = True
    timeout_s: ClassVar[float] = 8.0  # the helper itself waits 5 s for the robot process
    max_bytes: ClassVar[int] = 8 * 2**20 - 4096  # with Zenoh's own bytes within MAX_MESSAGE_BYTES
    lane: ClassVar[Lane] = Lane.NOW

    number: str = ""
    asked_pid: int = 0


class RobotRequest(Do[ReplyT], Generic[ReplyT], frozen=True):
    """Base of the requests that the helper process hands on to the robot process.

    That one reads them with the interpreter held, beside its control loop: so many bytes take it some milliseconds, and
    all parameters that a logger has room for are less.
    """

    max_bytes: ClassVar[int] = 256 * 1024
    lane: ClassVar[Lane] = Lane.ROBOT


# ------------------------------------------------------------------------------------------------- declared by methods


class Caller:
    """Base of the classes that declare requests; `silo.client.connect` says how they are sent."""

    def _call(self, request: Request[ReplyT]) -> ReplyT:
        raise NotImplementedError


def ask(wire: str = "", *, slow: bool = False, timeout_s: float | None = None) -> Callable[[F], F]:
    """Declare a request that only reads.

    Args:
        wire: its name, where the method has another.
        slow: it reads files or gigabytes.
        timeout_s: how long a client waits, at least.
    """
    return _declared(SlowAsk if slow else Ask, wire, {} if timeout_s is None else {"timeout_s": timeout_s})


def change(
    *, robot: bool = False, control: bool = True, timeout_s: float | None = None, lane: Lane | None = None
) -> Callable[[F], F]:
    """Declare a request that changes something.

    Args:
        robot: the robot program does it.
        control: it needs control where somebody has it.
        timeout_s: how long a client waits, at least.
        lane: what it may wait for.
    """
    facts: dict[str, object] = {"needs_control": control, "timeout_s": timeout_s, "lane": lane}
    known = {name: fact for name, fact in facts.items() if fact is not None}
    return _declared(RobotRequest if robot else Do, "", known)


def given(**changed: object) -> Any:
    """Return the arguments of a declared method that are sent as something else than they were given as."""
    return changed


def _declared(base: type[Request[Any]], wire: str, facts: dict[str, object]) -> Callable[[F], F]:
    def declare(function: F) -> F:
        assert isinstance(function, FunctionType)
        kind = _struct_of(function, base, wire, facts)
        names = fields_of(kind)
        checked = told(f"client.{function.__name__}", bound=True)(function)
        only_text = function.__annotations__["return"] is str

        @functools.wraps(function)
        def call(self: Caller, *args: object, **kwargs: object) -> object:
            changed = checked(self, *args, **kwargs) or {}
            reply = self._call(kind(**{**dict(zip(names, args, strict=False)), **kwargs, **changed}))
            return reply.text if only_text else reply

        vars(call)["request"] = kind
        return cast(F, call)

    return declare


def _struct_of(
    function: FunctionType, base: type[Request[Any]], wire: str, facts: dict[str, object]
) -> type[Request[Any]]:
    code, hints = function.__code__, function.__annotations__
    names = code.co_varnames[1 : code.co_argcount + code.co_kwonlyargcount]
    by_place = function.__defaults__ or ()
    defaults = dict(zip(code.co_varnames[: code.co_argcount][::-1], by_place[::-1], strict=False))
    defaults |= function.__kwdefaults__ or {}
    fields = [(name, hints[name], defaults[name]) if name in defaults else (name, hints[name]) for name in names]
    reply = Done if hints["return"] is str else hints["return"]
    name = function.__name__.lstrip("_")
    own = {"__doc__": function.__doc__, "__orig_bases__": (base[reply],), "declared": name, **facts}  # type: ignore[index]  # classes are generic at run time, too
    wire = wire or "".join(word.capitalize() for word in name.split("_"))
    made = msgspec.defstruct(wire, fields, bases=(base,), namespace=own, module=function.__module__, frozen=True)
    return cast("type[Request[Any]]", made)


def request_of(declared: Callable[Concatenate[Any, P], Any], *args: P.args, **kwargs: P.kwargs) -> Request[Any]:
    """Return the request that a declared method sends when it is called with these arguments, as they are."""
    kind: Callable[..., Request[Any]] = vars(declared)["request"]
    return kind(*args, **kwargs)


# ------------------------------------------------------------------------------------------------- what is declared


def leaves(base: type[msgspec.Struct]) -> tuple[type[Any], ...]:
    """Return the structs below a base that are no bases themselves."""
    found: list[type[Any]] = []
    for kind in base.__subclasses__():
        found += leaves(kind) or (kind,)
    return tuple(found)


def fields_of(kind: type[Request[Any]]) -> tuple[str, ...]:
    """Return what a request has beside what each has."""
    base = Do if issubclass(kind, Do) else Request
    return tuple(name for name in kind.__struct_fields__ if name not in base.__struct_fields__)


def reply_type(request: type[Request[ReplyT]]) -> type[ReplyT]:
    """Return the type of the reply that a request declares."""
    kind: type[ReplyT] = get_args(vars(request)["__orig_bases__"][0])[0]
    return kind


def spoken(request: Request[Any]) -> str:
    """Return what a request is called where it is told of: `apply edits`."""
    return _words(type(request)).replace("_", " ")


def method_of(kind: type[Request[Any]]) -> str:
    """Return what the method is called that does a request: `set_trigger`."""
    return kind.declared or _words(kind)


def _words(kind: type[Request[Any]]) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", "_", kind.__name__).lower()

"""Who does a request: a method of its name in the server of its feature, for whom, and until when.

A server that lacks a request, has one too many, or takes other arguments than are declared fails when it is imported.
"""

import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any, ClassVar

from silo.rpc.clocks import clock_s
from silo.rpc.declaring import Done, Reply, Request, RobotRequest, fields_of, leaves, method_of

Answer = Reply | bytes  # bytes are a reply that is encoded already

WAITED_S = 0.375  # until then somebody else is waited for: what is told of it takes up to 0.1 s on two busy processors


@dataclass(frozen=True)
class Sender:
    """Who sends a change: `identity` tells operators apart, `words` are shown."""

    identity: str
    words: str


@dataclass(frozen=True)
class Turn:
    """Whose request is done now, what tells it from all others, and until when its client listens (of `clock_s`)."""

    sender: Sender = field(default_factory=lambda: Sender("", "nobody"))
    until_s: float = float("inf")
    number: str = ""

    @property
    def by(self) -> str:
        """Who sends it, fit to show."""
        return self.sender.words

    def left_s(self, most_s: float) -> float:
        """Return for how long somebody may be waited for so that the client hears how it ended; at most so long."""
        return max(0.0, min(most_s, self.until_s - WAITED_S - clock_s()))


NOBODY = Turn()


class Server:
    """Base of what does the requests that some modules declare: a method for each, with the fields for arguments.

    Each is a dataclass of what it needs to do them, and no more. What an element of that is is said by a class of its
    feature or of one below, by a protocol where it is the logger or the helper process.

    One that a struct declares comes whole, as `request`; who wants to know who asks takes a `turn` before it. What is
    done is returned: the reply, its bytes, or a text for `Done`; what isn't, is raised. What the robot program does has
    a method there, and one in the helper process only if there is more to do than to hand it on.
    """

    handlers: ClassVar[dict[type[Request[Any]], str]] = {}

    def __init_subclass__(cls, *, does: Iterable[ModuleType], robot: bool = False, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        modules = {module.__name__ for module in does}
        kinds = {method_of(kind): kind for kind in leaves(Request) if kind.__module__ in modules}
        kinds = {name: kind for name, kind in kinds.items() if not robot or issubclass(kind, RobotRequest)}
        methods = {name for name, found in vars(cls).items() if callable(found) and not name.startswith("_")}
        needed = {name for name, kind in kinds.items() if robot or not issubclass(kind, RobotRequest)}
        if wrong := sorted(needed - methods) + sorted(methods - kinds.keys()):
            raise TypeError(f"{cls.__name__} and what {', '.join(sorted(modules))} declare differ: {', '.join(wrong)}")
        for name in methods:
            _check_arguments(cls, name, kinds[name])
        cls.handlers = {kinds[name]: name for name in methods}


def _arguments(function: Callable[..., Any]) -> tuple[str, ...]:
    code = function.__code__
    return code.co_varnames[1 : code.co_argcount + code.co_kwonlyargcount]


def _check_arguments(cls: type, name: str, kind: type[Request[Any]]) -> None:
    declared = fields_of(kind) if kind.declared else ("request",)
    taken = _arguments(getattr(cls, name))
    if taken[taken[:1] == ("turn",) :] != declared:
        raise TypeError(f"{cls.__name__}.{name} takes {', '.join(taken)}, declared are {', '.join(declared)}")


class Dispatch:
    """Has each request done by the server that has a method for it; others are handed on."""

    def __init__(self, servers: Iterable[Server], hand_on: Callable[[Request[Any], Turn], Answer]) -> None:
        self._hand_on = hand_on
        found = itertools.chain.from_iterable(
            ((kind, getattr(server, name)) for kind, name in server.handlers.items()) for server in servers
        )
        self._handlers = {kind: (handler, _arguments(handler)[:1] == ("turn",)) for kind, handler in found}

    def reply(self, request: Request[Any], turn: Turn = NOBODY) -> Answer:
        """Do a request while its `turn` has time, and return the reply. Raises what its handler raises."""
        kind = type(request)
        if kind not in self._handlers:
            return self._hand_on(request, turn)
        handler, wants_turn = self._handlers[kind]
        before = (turn,) if wants_turn else ()
        fields = {name: getattr(request, name) for name in fields_of(kind)} if kind.declared else {"request": request}
        done = handler(*before, **fields)
        return Done(done) if isinstance(done, str) else done

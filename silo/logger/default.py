"""One logger for the whole program, as module-level functions: `silo.init(...)`, `silo.add(...)`, `silo.collect()`.

Before `init` the default logger is a `NullLogger`: library code may add and collect whether or not anybody logs.
"""

import inspect
import logging
from collections.abc import Callable
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar

from silo.core.calls import told
from silo.logger.logger import Logger
from silo.logger.null import NullLogger
from silo.logger.serving.serving import Serving
from silo.logger.unclosed import LoggerEnd
from silo.segment.marks import NO_WORDS

log = logging.getLogger("silo")

P = ParamSpec("P")
R = TypeVar("R")

_default: Logger | NullLogger = NullLogger()
_early: dict[str, int] = {}  # how often what was called before there was a logger
_BEGINNINGS = {"start", "restart", "save", "serve", "record"}  # what only a program does that wants to log
_told: set[str] = set()  # what was said to do nothing


def _making(kind: Callable[P, Logger]) -> Callable[P, Logger]:
    """Return `init`, with the arguments of the class."""

    @wraps(Logger.__init__, assigned=())
    def init(*args: P.args, **kwargs: P.kwargs) -> Logger:
        global _default  # noqa: PLW0603  # the one logger of the program
        if isinstance(_default, Logger):
            _default._end(LoggerEnd.UNCLOSED)
        made = kind(*args, **kwargs)
        if _early:
            log.warning("%s before silo.init() went to a logger that does nothing: call silo.init() first", _counted())
            _early.clear()
            _told.clear()
        _default = made
        return made

    init.__name__ = init.__qualname__ = "init"
    init.__doc__ = "Make the default logger; takes the arguments of `silo.Logger`. What a previous one holds is saved."
    init.__signature__ = inspect.signature(kind)  # type: ignore[attr-defined]  # for help() and editors
    return init


def _of_default(method: Callable[Concatenate[Logger, P], R], early: bool = False) -> Callable[P, R]:
    """Return a method of whichever logger is the default one, with its arguments and types."""
    name = method.__name__

    @wraps(method)
    def function(*args: P.args, **kwargs: P.kwargs) -> R:
        if isinstance(_default, NullLogger):
            if early:
                _note_early(f"silo.{name}()")
            elif name in _BEGINNINGS and name not in _told:
                _told.add(name)
                log.warning(
                    "silo.%s() did nothing: there is no logger before silo.init()%s",
                    name,
                    f"; so did {_counted()}" if _early else "",
                )
        found: R = getattr(_default, name)(*args, **kwargs)
        return found

    signature = inspect.signature(method)
    function.__doc__ = f"`Logger.{name}` of the default logger.\n\n{inspect.getdoc(method) or ''}"
    function.__signature__ = signature.replace(parameters=list(signature.parameters.values())[1:])  # type: ignore[attr-defined]
    function.__qualname__ = name
    return function


def _note_early(what: str) -> None:
    _early[what] = _early.get(what, 0) + 1


def _counted() -> str:
    """What was called of a logger that does nothing, and how often."""
    return ", ".join(what if count == 1 else f"{what} ({count} times)" for what, count in _early.items())


init = _making(Logger)
add = _of_default(Logger.add, early=True)
array = _of_default(Logger.array, early=True)
value = _of_default(Logger.value, early=True)
update = _of_default(Logger.update)
start = _of_default(Logger.start)
stop = _of_default(Logger.stop)
restart = _of_default(Logger.restart)
save = _of_default(Logger.save)
serve = _of_default(Logger.serve)
record = _of_default(Logger.record)
stop_recording = _of_default(Logger.stop_recording)
close = _of_default(Logger.close)


def collect() -> None:
    """`Logger.collect` of the default logger."""
    if isinstance(_default, NullLogger):
        _note_early("silo.collect()")
    _default.collect()


def mark(text: str = NO_WORDS, *more: object) -> None:
    """`Logger.mark` of the default logger.

    Args:
        text: the words.
        *more: what follows them, a space between.
    """
    _default.mark(text, *more)


@told("silo.get_logger")
def get_logger() -> Logger | NullLogger:
    """Return the default logger: what `silo.init` made, before that one with the same methods that does nothing."""
    if isinstance(_default, NullLogger):
        _note_early("silo.get_logger()")
    return _default


__all__ = [
    "Serving",
    "add",
    "array",
    "close",
    "collect",
    "get_logger",
    "init",
    "mark",
    "record",
    "restart",
    "save",
    "serve",
    "start",
    "stop",
    "stop_recording",
    "update",
    "value",
]

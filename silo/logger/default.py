"""One logger for the whole program, as module-level functions: `silo.init(...)`, `silo.add(...)`, `silo.collect()`.

Before `init` the default logger is a `NullLogger`: library code may add and collect whether or not anybody logs.
"""

import os
from collections.abc import Iterable
from typing import Any

from numpy.typing import DTypeLike, NDArray

from silo.logger.logger import Logger
from silo.logger.null import NullLogger
from silo.logger.serving import Serving
from silo.model import FileType, SavedFile

_default: Logger | NullLogger = NullLogger()


def init(name: str = "silo", **options: Any) -> Logger:
    """Make the default logger; takes the arguments of `silo.Logger`. What a previous one holds is saved."""
    global _default  # noqa: PLW0603  # the one logger of the program
    if isinstance(_default, Logger):
        _default.abandon()
    _default = made = Logger(name, **options)
    return made


def logger() -> Logger | NullLogger:
    """Return the default logger."""
    return _default


def add(source: object, name: str | None = None, **options: Any) -> None:
    """`Logger.add` of the default logger."""
    _default.add(source, name, **options)


def array(name: str, shape: int | tuple[int, ...] = (), dtype: DTypeLike = float, **options: Any) -> NDArray[Any]:
    """Return `Logger.array` of the default logger."""
    return _default.array(name, shape, dtype, **options)


def update(*, read_script: bool = True) -> None:
    """`Logger.update` of the default logger."""
    _default.update(read_script=read_script)


def start(*, unsaved: str = "clear") -> None:
    """`Logger.start` of the default logger."""
    _default.start(unsaved=unsaved)


def collect() -> None:
    """`Logger.collect` of the default logger."""
    _default.collect()


def stop() -> None:
    """`Logger.stop` of the default logger."""
    _default.stop()


def restart(*, unsaved: str = "clear") -> None:
    """`Logger.restart` of the default logger."""
    _default.restart(unsaved=unsaved)


def save(
    types: Iterable[FileType | str] | FileType | str = (FileType.SILO,),
    name: str | None = None,
    folder: str | os.PathLike[str] | None = None,
) -> list[SavedFile]:
    """Return `Logger.save` of the default logger."""
    return _default.save(types, name, folder)


def serve(*, group: str | None = None, config: str | os.PathLike[str] | None = None) -> Any:
    """Return `Logger.serve` of the default logger; returns a context manager."""
    return _default.serve(group=group, config=config)


def close() -> None:
    """`Logger.close` of the default logger."""
    _default.close()


cleanup = close

__all__ = [
    "Serving",
    "add",
    "array",
    "cleanup",
    "close",
    "collect",
    "init",
    "logger",
    "restart",
    "save",
    "serve",
    "start",
    "stop",
    "update",
]

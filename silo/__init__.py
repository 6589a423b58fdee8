"""silo: a signal logger for robots.

Public names are loaded at first use, so that commands that need none of them start fast.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from silo.analysis.log import Log, Signal, open_log
    from silo.collecting.traits import register
    from silo.errors import (
        ConnectionLostError,
        ElementError,
        FileFormatError,
        RefusedError,
        SaveError,
        ScriptError,
        SegmentError,
        SiloError,
        SourceError,
        StateError,
    )
    from silo.kinds import vector_at_position
    from silo.logger.default import add, array, cleanup, close, collect, init, restart, save, serve, start, stop, update
    from silo.logger.logger import Logger
    from silo.logger.null import NullLogger
    from silo.model import Action, BufferType, ElementInfo, ElementOptions, FileType, LoggerOptions, Storage
    from silo.recording import Recording

__version__ = "0.1.0"

_HOMES = {
    "silo.logger.default": "add array cleanup close collect init restart save serve start stop update",
    "silo.errors": (
        "ConnectionLostError ElementError FileFormatError RefusedError SaveError ScriptError SegmentError SiloError "
        "SourceError StateError"
    ),
    "silo.analysis.log": "Log Signal open_log",
    "silo.logger.logger": "Logger",
    "silo.model": "Action BufferType ElementInfo ElementOptions FileType LoggerOptions Storage",
    "silo.logger.null": "NullLogger",
    "silo.recording": "Recording",
    "silo.collecting.traits": "register",
    "silo.kinds": "vector_at_position",
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names.split()}

__all__ = [
    "Action",
    "BufferType",
    "ConnectionLostError",
    "ElementError",
    "ElementInfo",
    "ElementOptions",
    "FileFormatError",
    "FileType",
    "Log",
    "Logger",
    "LoggerOptions",
    "NullLogger",
    "Recording",
    "RefusedError",
    "SaveError",
    "ScriptError",
    "SegmentError",
    "Signal",
    "SiloError",
    "SourceError",
    "StateError",
    "Storage",
    "add",
    "array",
    "cleanup",
    "close",
    "collect",
    "init",
    "open_log",
    "register",
    "restart",
    "save",
    "serve",
    "start",
    "stop",
    "update",
    "vector_at_position",
]


def __getattr__(name: str) -> object:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'silo' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])

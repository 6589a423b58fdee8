# ruff: noqa: I001 - a line per module, not one per name
"""silo: a signal logger for robots.

Public names are loaded at first use, so that commands that need none of them start fast. They stand here twice: for who
reads the code (type checkers, editors) and for who runs it; a test holds both to each other.
"""

import importlib
from typing import TYPE_CHECKING

from silo.version import VERSION

if TYPE_CHECKING:  # for type checkers and editors; a name that is given to itself is public
    from silo.analysis.log import Log as Log, Signal as Signal, open_log as open_log
    from silo.collecting.traits import register as register
    from silo.errors import (
        GoesOnError as GoesOnError,
        LogNotFoundError as LogNotFoundError,
        NoRoomError as NoRoomError,
        UnsavedError as UnsavedError,
        VersionError as VersionError,
        ConnectionLostError as ConnectionLostError,
        ElementError as ElementError,
        FileFormatError as FileFormatError,
        RefusedError as RefusedError,
        SaveError as SaveError,
        ScriptError as ScriptError,
        SegmentError as SegmentError,
        SiloError as SiloError,
        SourceError as SourceError,
        StateError as StateError,
    )
    from silo.judging.tokens import ExpressionError as ExpressionError
    from silo.kinds import vector_at_position as vector_at_position
    from silo.logger.default import (
        add as add,
        array as array,
        cleanup as cleanup,
        close as close,
        collect as collect,
        init as init,
        restart as restart,
        save as save,
        serve as serve,
        start as start,
        stop as stop,
        update as update,
    )
    from silo.logger.logger import Logger as Logger
    from silo.logger.null import NullLogger as NullLogger
    from silo.model import (
        Action as Action,
        BufferType as BufferType,
        ElementInfo as ElementInfo,
        ElementOptions as ElementOptions,
        FileType as FileType,
        LoggerOptions as LoggerOptions,
        Storage as Storage,
        Threads as Threads,
    )
    from silo.recording import Recording as Recording

__version__ = VERSION

_HOMES = {
    "silo.logger.default": "add array cleanup close collect init restart save serve start stop update",
    "silo.errors": (
        "ConnectionLostError ElementError FileFormatError GoesOnError LogNotFoundError NoRoomError RefusedError "
        "SaveError ScriptError SegmentError SiloError SourceError StateError UnsavedError VersionError"
    ),
    "silo.analysis.log": "Log Signal open_log",
    "silo.logger.logger": "Logger",
    "silo.model": "Action BufferType ElementInfo ElementOptions FileType LoggerOptions Storage Threads",
    "silo.logger.null": "NullLogger",
    "silo.recording": "Recording",
    "silo.collecting.traits": "register",
    "silo.judging.tokens": "ExpressionError",
    "silo.kinds": "vector_at_position",
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names.split()}

__all__ = list(_HOME_OF)


def __getattr__(name: str) -> object:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'silo' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])

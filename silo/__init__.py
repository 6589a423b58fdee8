# ruff: noqa: I001 - a line per module, not one per name
"""silo: a signal logger for robots.

Public names are loaded at first use, so that commands that need none of them start fast. They stand here twice: for who
reads the code (type checkers, editors) and for who runs it; a test holds both to each other.
"""

import importlib
import os
import sys

from silo.version import VERSION

TYPE_CHECKING = False  # `typing` itself takes 5 ms to load
if TYPE_CHECKING:  # for type checkers and editors; a name that is given to itself is public
    from silo.analysis.compare import compare as compare
    from silo.analysis.log import Log as Log
    from silo.analysis.signal import Signal as Signal
    from silo.analysis.opening import open_log as open_log, open_logs as open_logs
    from silo.client.connect import Client as Client, connect as connect, topic as topic
    from silo.loop.types import register as register
    from silo.errors import (
        ConnectionLostError as ConnectionLostError,
        ElementError as ElementError,
        LogWarning as LogWarning,
        RefusedError as RefusedError,
        SaveError as SaveError,
        SiloError as SiloError,
        StateError as StateError,
    )
    from silo.logger.default import (
        add as add,
        array as array,
        close as close,
        collect as collect,
        get_logger as get_logger,
        init as init,
        mark as mark,
        record as record,
        restart as restart,
        save as save,
        serve as serve,
        start as start,
        stop as stop,
        stop_recording as stop_recording,
        update as update,
        value as value,
    )
    from silo.logger.logger import Logger as Logger
    from silo.logger.null import NullLogger as NullLogger
    from silo.core.elements import (
        Action as Action,
        BufferType as BufferType,
        Edit as Edit,
        ElementOptions as ElementOptions,
        LoggerOptions as LoggerOptions,
    )
    from silo.core.recording import Recording as Recording
    from silo.run_index.runs import runs as runs
    from silo.simulators.gymnasium import gymnasium as gymnasium
    from silo.simulators.mujoco import mujoco as mujoco
    from silo import errors as errors, types as types

__version__ = VERSION

_HOMES = {
    "silo.logger.default": (
        "add array close collect get_logger init mark record restart save serve start stop stop_recording update value"
    ),
    "silo.errors": "ConnectionLostError ElementError LogWarning RefusedError SaveError SiloError StateError",
    "silo.analysis.log": "Log",
    "silo.analysis.signal": "Signal",
    "silo.analysis.opening": "open_log open_logs",
    "silo.analysis.compare": "compare",
    "silo.client.connect": "Client connect topic",
    "silo.logger.logger": "Logger",
    "silo.core.elements": "Action BufferType Edit ElementOptions LoggerOptions",
    "silo.logger.null": "NullLogger",
    "silo.core.recording": "Recording",
    "silo.loop.types": "register",
    "silo.run_index.runs": "runs",
    "silo.simulators.gymnasium": "gymnasium",
    "silo.simulators.mujoco": "mujoco",
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names.split()}

__all__ = list(_HOME_OF) + ["errors", "types"]  # noqa: RUF005


def __getattr__(name: str) -> object:
    if name in ("errors", "types"):
        return importlib.import_module(f"silo.{name}")
    if name not in _HOME_OF:
        raise _no_such_name(name)
    value = getattr(importlib.import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


_OF_A_LOGGER = {
    "episode",
    "set",
    "enable",
    "disable",
    "remove",
    "apply",
    "element",
    "elements",
    "snapshot",
    "read_new_values",
}


_OTHERS = dict.fromkeys(("open", "load", "read", "read_log", "load_log"), "open_log") | {
    "log": "get_logger",
    "Null": "NullLogger",
    "FakeLogger": "NullLogger",
    "gym": "gymnasium",
    "diff": "compare",
    "cleanup": "close",
}
_ELSEWHERE = dict.fromkeys(("list", "ls", "loggers", "discover", "find"), "`silo ls` in a shell") | {
    "Trigger": "log.trigger('fall', 'x > 1')",
    "Limit": "log.limit('x', (red_low, yellow_low, yellow_high, red_high))",
    "ros2": "`silo ros2 LOGGER` in a shell",
    "plot": "silo.open_log('logs').plot('x')",
    "watch": "silo.topic('silo:///robot/log/x') in Python, `silo watch LOGGER` in a shell",
}


def _no_such_name(name: str) -> Exception:
    importing = sys._getframe(2).f_globals.get("__name__") == "importlib._bootstrap"
    is_module = any(os.path.exists(f"{__path__[0]}/{name}{end}") for end in ("", ".py"))  # noqa: PTH110
    if name.startswith("_") or (importing and is_module):
        # a module of silo that is imported now: nobody reads this
        return AttributeError(f"module 'silo' has no attribute {name!r}", name=name)
    words = f"module 'silo' has no attribute '{name}'{_what_instead(name)}"
    if importing:  # of an AttributeError this statement keeps no word
        return ImportError(words, name="silo", path=__file__)
    from silo.errors import UnknownNameError

    return UnknownNameError(words, name=name)


def _what_instead(name: str) -> str:
    if name in _OF_A_LOGGER:
        return f"; write silo.get_logger().{name}"
    if name in _ELSEWHERE:
        return f"; it is {_ELSEWHERE[name]}"
    for home in ("silo.errors", "silo.types"):
        if hasattr(importlib.import_module(home), name):
            return f"; it is {home}.{name}"
    from silo.core.names import did_you_mean, nearest

    near = [_OTHERS[name]] if name in _OTHERS else nearest(name, __all__, 0.7)
    return did_you_mean([f"silo.{one}" for one in near], "help(silo) lists what there is")


def __dir__() -> list[str]:
    return sorted([*(name for name in globals() if name.startswith("__")), *__all__])

"""What the arguments of `Logger` and of its methods may be, and what they become."""

import functools
import math
import os
import re
import secrets
import time
from collections.abc import Callable

import numpy as np

from silo.errors import ElementError, StateError
from silo.logger.arguments import path, real, switch, text, whole
from silo.model import FileType, LoggerOptions, Storage, Threads, join_name

NAME_PATTERN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,39}")


def logger_options(
    *,
    name: str,
    frequency: float,
    max_time: float,
    script: str | os.PathLike[str],
    prefix: str,
    folder: str | os.PathLike[str],
    storage: str | Storage,
    size_tiers: int,
    memory_limit_mb: int,
    checked: bool,
    threads: str | Threads,
) -> LoggerOptions:
    """Return options with absolute paths. Raises ElementError that names the argument, its value and its range."""
    if not NAME_PATTERN.fullmatch(text("the logger's name", name, 'silo.Logger("robot")')):
        raise ElementError(f"logger name {name!r}: 1 to 40 letters, digits, '_', '-' or '.', a letter or digit first")
    if storage not in set(Storage):
        raise ElementError(f"storage must be 'memory', 'disk' or 'file', got {storage!r}")
    if threads not in (Threads.SINGLE, Threads.SERIALIZED):
        raise ElementError(f"threads must be 'single' or 'serialized', got {threads!r}")
    return LoggerOptions(
        name=name,
        frequency_hz=real("frequency", frequency, 0, 1e6, "Hz", include_low=False),
        max_time_s=real("max_time", max_time, 0, 1e9, "s (0: no limit)"),
        prefix=_prefix(prefix),
        script=str(path("script", script).absolute()),
        folder=str(path("folder", folder).absolute()),
        storage=Storage(storage),
        size_tiers=whole("size_tiers", size_tiers, 1, 1000),
        memory_limit_mb=whole("memory_limit_mb", memory_limit_mb, 1, 10**9),
        checked=switch("checked", checked),
        threads=Threads(threads),
        id=secrets.token_hex(4),
    )


def _prefix(given: str) -> str:
    stripped = text("prefix", given, 'prefix="/log"').strip("/")
    return join_name("", "", stripped) if stripped else ""


def nanosecond_clock(clock: Callable[[], int | float] | None) -> Callable[[], int]:
    """Return a clock of int nanoseconds, whichever unit it was given in. Raises ElementError for anything else."""
    if clock is None:
        return time.time_ns
    if not callable(clock):
        raise ElementError(f"clock must be a function without arguments, got {clock!r}; write clock=lambda: ...")
    try:
        now = clock()
    except Exception as error:
        raise ElementError(
            f"clock failed when it was asked for the first time ({type(error).__name__}: {error}): it must return "
            "int nanoseconds or float seconds from now on"
        ) from error
    if isinstance(now, float | np.floating):
        if not math.isfinite(now):
            raise ElementError(f"clock must return int nanoseconds or float seconds, got {now!r}")
        return lambda: int(clock() * 1e9)
    if isinstance(now, int | np.integer) and not isinstance(now, bool):
        return functools.partial(_whole_nanoseconds, clock)
    raise ElementError(f"clock must return int nanoseconds or float seconds, got {now!r}")


def _whole_nanoseconds(clock: Callable[[], int | float]) -> int:
    now = clock()
    if isinstance(now, float):
        raise StateError(
            f"clock returned the float {now!r}, but an int (nanoseconds) when the logger was made; "
            "a clock of seconds must return floats from the start: 0.0, not 0"
        )
    return now


def name_of(source: object, attr: str | None) -> str:
    """Return the name of an element that was given none. Raises ElementError where none can be told."""
    name = attr.rsplit(".", 1)[-1] if attr else getattr(source, "__name__", "")
    if not name or name == "<lambda>":
        raise ElementError(f'give the element a name: log.add({type(source).__name__.lower()}, "name")')
    return str(name)


def file_type(given: FileType | str) -> FileType:
    """Return a file type by its name. Raises ElementError."""
    if isinstance(given, FileType):
        return given
    # not before: the control program loads nothing of files until it saves
    from silo.files import formats

    found = formats.file_type(given)
    if found is None:
        raise ElementError(f"unknown file type {given!r}; there are {formats.savable()}")
    return found

"""What the arguments of `Logger` and of its methods may be, and what they become."""

import functools
import os
import re
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from silo.errors import ElementError, StateError
from silo.model import FileType, LoggerOptions, Storage, join_name

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
) -> LoggerOptions:
    """Options with absolute paths. Raises ElementError that names the argument, its value and its range."""
    if not NAME_PATTERN.fullmatch(name):
        raise ElementError(f"logger name {name!r}: 1 to 40 letters, digits, '_', '-' or '.', a letter or digit first")
    if not 0 < frequency < 1e6:
        raise ElementError(f"frequency must be above 0 and below 1e6 Hz, got {frequency!r}")
    if not 0 <= max_time < 1e9:
        raise ElementError(f"max_time must be 0 (no limit) or a number of seconds below 1e9, got {max_time!r}")
    if size_tiers < 1 or memory_limit_mb < 1:
        raise ElementError(f"size_tiers and memory_limit_mb must be 1 or more, got {size_tiers} and {memory_limit_mb}")
    if storage not in (Storage.MEMORY, Storage.DISK):
        raise ElementError(f"storage must be 'memory' or 'disk', got {storage!r}")
    return LoggerOptions(
        name=name,
        frequency_hz=float(frequency),
        max_time_s=float(max_time),
        prefix=join_name("", "", prefix) if prefix.strip("/") else "",
        script=str(Path(script).absolute()),
        folder=str(Path(folder).absolute()),
        storage=Storage(storage),
        size_tiers=size_tiers,
        memory_limit_mb=memory_limit_mb,
        checked=checked,
    )


def nanosecond_clock(clock: Callable[[], int | float] | None) -> Callable[[], int]:
    """A clock of int nanoseconds, whichever unit it was given in. Raises ElementError for anything else."""
    if clock is None:
        return time.time_ns
    now = clock()
    if isinstance(now, float | np.floating):
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
    """The name of an element that was given none. Raises ElementError where none can be told."""
    name = attr.rsplit(".", 1)[-1] if attr else getattr(source, "__name__", "")
    if not name or name == "<lambda>":
        raise ElementError(f'give the element a name: log.add({type(source).__name__.lower()}, "name")')
    return str(name)


def file_type(given: FileType | str) -> FileType:
    """A file type by its name. Raises ElementError."""
    if isinstance(given, FileType):
        return given
    # not before: the control program loads nothing of files until it saves
    from silo.files import formats

    found = formats.file_type(given)
    if found is None:
        raise ElementError(f"unknown file type {given!r}; there are {formats.savable()}")
    return found

"""What is kept on this machine of a logger: a terminal that is lost, or a kill, doesn't take it along.

Edits that were not applied: one small file per logger and process in `$XDG_STATE_HOME/silo/edits/`, written anew after
each edit, gone when nothing is pending: two terminals on one logger keep theirs apart. What processes left that are no
more is offered at a start. What the robot program judges and derives: one file per logger, of the newest program.
"""

import os
import re
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import msgspec

from silo.core.conditions import NO_CONDITIONS, Conditions
from silo.core.runtime import state_folder
from silo.decoding import json_decoder
from silo_tui.model.table.state import KeptEdit

Kept = TypeVar("Kept")


class KeptEdits(msgspec.Struct, frozen=True):
    """What was pending, and when."""

    time_s: float
    edits: list[KeptEdit]


class KeptConditions(msgspec.Struct, frozen=True):
    """What a robot program has, and what that before it had alone."""

    there: Conditions
    gone: Conditions = NO_CONDITIONS
    program: str = ""  # as an older silo-tui left it: another one than is there


def path_of(host: str, logger: str) -> Path:
    """Return the file of this process for a logger."""
    return _folder() / f"{_stem(host, logger)}.{os.getpid()}.json"


def left_behind(host: str, logger: str) -> dict[Path, KeptEdits]:
    """Return what processes that are no more kept of a logger, by file; what can't be read is none."""
    found = ((path, read(path)) for path in of_the_dead(_folder(), f"{_stem(host, logger)}.*.json"))
    return {path: kept for path, kept in found if kept is not None and kept.edits}


def of_the_dead(folder: Path, pattern: str) -> list[Path]:
    """Return the files of a folder that belong to processes that are no more, by the number before the ending."""
    found = [(path, path.name.split(".")[-2]) for path in sorted(folder.glob(pattern))]
    return [path for path, pid in found if pid.isdecimal() and not lives(int(pid))]


def _folder() -> Path:
    return state_folder() / "edits"


def _stem(host: str, logger: str) -> str:
    return re.sub(r"[^\w-]", "_", f"{host or 'here'}-{logger}")


def lives(pid: int) -> bool:
    """Return whether another process of that number runs."""
    if pid == os.getpid():
        return False  # this process has just begun with this logger
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    return True


def keep(path: Path, edits: Sequence[KeptEdit]) -> None:
    """Write what is pending, or remove the file where nothing is. Raises OSError."""
    if not edits:
        path.unlink(missing_ok=True)
        return
    _write(path, KeptEdits(time.time(), list(edits)))


def read(path: Path) -> KeptEdits | None:
    """Return what was kept; None for nothing, or what can't be read."""
    return _read(path, KeptEdits)


def conditions_of(host: str, logger: str) -> KeptConditions | None:
    """Return what was kept of what a logger judges and derives."""
    return _read(_path_of_conditions(host, logger), KeptConditions)


def keep_conditions(host: str, logger: str, found: KeptConditions) -> None:
    """Write what a logger judges and derives. Raises OSError."""
    _write(_path_of_conditions(host, logger), found)


def _path_of_conditions(host: str, logger: str) -> Path:
    return state_folder() / "conditions" / f"{_stem(host, logger)}.json"


def _write(path: Path, what: msgspec.Struct) -> None:
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    beside = path.with_suffix(f".{os.getpid()}.new")
    beside.write_bytes(msgspec.json.encode(what))
    beside.replace(path)


def _read(path: Path, kind: type[Kept]) -> Kept | None:
    try:
        return json_decoder(kind).decode(path.read_bytes())
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError):
        return None

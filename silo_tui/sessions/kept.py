"""Edits that were not applied, kept on this machine: a terminal that is lost, or a kill, doesn't take them along.

One small file per logger in `$XDG_STATE_HOME/silo/edits/`, written anew after each edit, gone when nothing is pending.
"""

import os
import re
import time
from collections.abc import Sequence
from pathlib import Path

import msgspec

from silo_tui.model.table import KeptEdit


class KeptEdits(msgspec.Struct, frozen=True):
    """What was pending, and when."""

    time_s: float
    edits: list[KeptEdit]


def path_of(host: str, logger: str) -> Path:
    """Return the file of a logger."""
    state = os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    name = re.sub(r"[^\w.-]", "_", f"{host or 'here'}-{logger}")
    return Path(state) / "silo" / "edits" / f"{name}.json"


def keep(path: Path, edits: Sequence[KeptEdit]) -> None:
    """Write what is pending, or remove the file where nothing is. Raises OSError."""
    if not edits:
        path.unlink(missing_ok=True)
        return
    path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    beside = path.with_suffix(f".{os.getpid()}")
    beside.write_bytes(msgspec.json.encode(KeptEdits(time.time(), list(edits))))
    beside.replace(path)


def read(path: Path) -> KeptEdits | None:
    """Return what was kept; None for nothing, or what can't be read."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=KeptEdits)
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError):
        return None

"""Remotes: networks of robots that a user has given a name, one Zenoh configuration each.

    ~/.config/silo/remotes/NAME.json5      XDG_CONFIG_HOME moves the folder

Every command looks for loggers there too, beside those of this computer.
"""

import os
import re
from pathlib import Path

LOCAL = "local"  # in place of a configuration: the loggers of this computer alone
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
_SUFFIX = ".json5"


def config_folder() -> Path:
    """Return `~/.config/silo`, or as `XDG_CONFIG_HOME` says (an absolute path, as its standard has it)."""
    base = Path(os.environ.get("XDG_CONFIG_HOME", ""))
    return (base if base.is_absolute() else Path.home() / ".config") / "silo"


def remote_file(name: str) -> Path:
    """Return where the configuration of a remote stands."""
    return config_folder() / "remotes" / f"{name}{_SUFFIX}"


def remotes() -> list[str]:
    """Return the names of this user's remotes."""
    try:
        found = [path.name.removesuffix(_SUFFIX) for path in remote_file("x").parent.glob(f"*{_SUFFIX}")]
    except (OSError, RuntimeError):  # no home
        return []
    return sorted(name for name in found if NAME.fullmatch(name))

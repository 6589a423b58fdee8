"""Tells on the command line whether a logger or a file is meant."""

import os
import re
from collections.abc import Callable, Collection
from pathlib import Path

from silo.errors import LogNotFoundError
from silo.files.formats import LOG_ENDINGS, is_bag_folder
from silo.files.naming import find_log, logger_of
from silo.net.found import ADDRESS

_WITH_PID = re.compile(r"(?P<logger>.+)\.\d+")


def file_meant(target: str, running: Callable[[], Collection[str]]) -> Path | None:
    """Return the log that `target` means, None where it is the name or the address of a logger.

    A known ending, and a path that begins with `/`, `.` or `~`, always mean a file: `LogNotFoundError` if it isn't
    there. Else a logger that runs comes first (`running` tells all names and addresses), then a path, a run number and
    the beginning of a file name. One waits for a logger that doesn't run: its name is not the beginning of the names of
    its files, and a `HOST/NAME` may come where there is no folder `HOST`.
    """
    if not target:
        return None
    address = ADDRESS.fullmatch(target) is not None
    if target.lower().endswith(LOG_ENDINGS) or (os.sep in target and not address):
        return _path_meant(target)
    with_pid = _WITH_PID.fullmatch(target)
    names = running()
    if target in names or (with_pid is not None and with_pid["logger"] in names):
        return None
    if os.sep in target:
        return _path_meant(target) if Path(target).parent.is_dir() else None
    try:
        found = find_log(target)
    except LogNotFoundError:
        return None
    if Path(target).exists() or target.isdecimal():
        return found
    return None if logger_of(found.stem) == target else found


def _path_meant(target: str) -> Path:
    if Path(target).is_dir() and not is_bag_folder(Path(target)):
        raise LogNotFoundError(
            f"'{target}' is a folder without a bag in it: name one of its files; `silo runs {target}` lists its runs, "
            f"and so does :runs {target} in silo-tui"
        )
    return find_log(target)


def also_a_file(target: str) -> str:
    """Return what to say where a logger was meant and a file has its address; empty where none has."""
    if os.sep not in target or not Path(target).exists():
        return ""
    return f"{target} is the logger; there is a file of that path, too: silo-tui ./{target}"

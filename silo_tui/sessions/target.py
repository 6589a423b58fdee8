"""Tells on the command line whether a logger or a file is meant."""

import os
import re
from collections.abc import Callable, Collection
from pathlib import Path

from silo.errors import LogNotFoundError
from silo.files.formats import LOG_ENDINGS, is_bag_folder
from silo.files.naming import find_log

_WITH_PID = re.compile(r"(?P<logger>.+)\.\d+")
_STEM = re.compile(r"(?P<logger>.+)_\d{8}_\d\d-\d\d-\d\d_\d{5,}")


def file_meant(target: str, running: Callable[[], Collection[str]]) -> Path | None:
    """Return the log that `target` means, None where it is the name of a logger.

    A known ending or a path separator always mean a file: `LogNotFoundError` if it isn't there. Else a logger of that
    name that runs (`running` tells all of them) comes first, then a path, a run number and the beginning of a file
    name. The name of a logger that doesn't run is not the beginning of the names of its files: one waits for it.
    """
    if not target:
        return None
    if target.lower().endswith(LOG_ENDINGS) or os.sep in target:
        if Path(target).is_dir() and not is_bag_folder(Path(target)):
            raise LogNotFoundError(f"'{target}' is a folder without a bag in it; name one of its files")
        return find_log(target)
    with_pid = _WITH_PID.fullmatch(target)
    names = running()
    if target in names or (with_pid is not None and with_pid["logger"] in names):
        return None
    try:
        found = find_log(target)
    except LogNotFoundError:
        return None
    if Path(target).exists() or target.isdecimal():
        return found
    stem = _STEM.fullmatch(found.stem)
    return None if stem is not None and stem["logger"] == target else found

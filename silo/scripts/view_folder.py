"""Views of the terminal, kept in `views/` beside the logger's script: plain names, small texts, whatever clients ask.

No link is followed; what stands in a view is for the terminal to judge.
"""

import os
import re
from pathlib import Path

from silo.errors import SaveError, reason
from silo.files.atomic import atomic_file
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.scripts.script_folder import read_bounded

FOLDER, ENDING = "views", ".yaml"
MOST_VIEWS = 500
MOST_BYTES = 256 * 1024  # of a view with 2,000 plots
_NAME = re.compile(r"[\w][\w.+ -]{0,79}")


def folder_of(own_script: Path) -> Path:
    """Return where views are kept."""
    return own_script.parent / FOLDER  # none of whose files is anybody else's: names are plain, and links refused


def names(own_script: Path) -> list[str]:
    """Return the views that there are; none where there is no such folder."""
    try:
        found = [path.name for path in _real(own_script).iterdir()]
    except (OSError, RequestRefusedError):
        return []
    known = [name.removesuffix(ENDING) for name in found if name.endswith(ENDING)]
    return sorted(name for name in known if _NAME.fullmatch(name))[:MOST_VIEWS]


def read(own_script: Path, name: str) -> tuple[Path, str]:
    """Return path and text of a view. Raises RequestRefusedError where there is none that can be read."""
    path = _path(own_script, name)
    try:
        return path, read_bounded(path, path, MOST_BYTES)
    except FileNotFoundError:
        there = ", ".join(names(own_script)[:20]) or "none yet"
        text = f"there is no view '{name}' on the robot (there: {there})"
        raise RequestRefusedError(RefusedWhy.NOT_FOUND, text) from None


def keep(own_script: Path, name: str, text: str, *, overwrite: bool) -> Path:
    """Write a view and return its path. Raises RequestRefusedError, then nothing was changed."""
    path = _path(own_script, name)
    data = text.encode(errors="replace")
    if len(data) > MOST_BYTES:
        size = f"a view has at most {MOST_BYTES // 1024} kB, this one {len(data) // 1024} kB"
        raise RequestRefusedError(RefusedWhy.INVALID, f"{size}; nothing was changed")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        there = os.path.lexists(path)
        if there and (path.is_symlink() or not path.is_file()):
            raise RequestRefusedError(RefusedWhy.INVALID, f"{path}: is not a file; nothing was changed")
        if there and not overwrite:
            text = f"there is a view '{name}' on the robot; confirm that it is replaced, or choose another name"
            raise RequestRefusedError(RefusedWhy.EXISTS, text)
        if not there and len(names(own_script)) >= MOST_VIEWS:
            text = f"{MOST_VIEWS} views are kept in {path.parent} already; nothing was changed"
            raise RequestRefusedError(RefusedWhy.FAILED, text)
        with atomic_file(path) as file:
            file.write(data)
    except (OSError, SaveError) as error:
        why = reason(error)
        raise RequestRefusedError(RefusedWhy.FAILED, f"{path}: can't be written: {why}; nothing was changed") from error
    return path


def _path(own_script: Path, name: str) -> Path:
    if not _NAME.fullmatch(name) or name != name.strip():
        text = f"{name[:80]!r} is no name for a view: letters, digits, - _ . + and blanks, at most 80"
        raise RequestRefusedError(RefusedWhy.INVALID, text)
    return _real(own_script) / (name + ENDING)


def _real(own_script: Path) -> Path:
    """Return the folder. Raises RequestRefusedError where a link leads elsewhere."""
    folder = folder_of(own_script)
    if folder.is_symlink():
        raise RequestRefusedError(RefusedWhy.FORBIDDEN, f"{folder} is a link; views are kept in a folder of their own")
    return folder

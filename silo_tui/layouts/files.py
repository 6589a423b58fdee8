"""Views as files, in `views/` beside the settings.

`.last-NAME` is what was on the screen of a logger at last, `.left-NAME.PID` what a process has there that hasn't ended.
"""

import os
import re
import time
from pathlib import Path

from silo.core.names import did_you_mean, nearest
from silo.errors import SaveError, reason
from silo.net.configuration import config_folder
from silo_tui.layouts.layout import KeptLayout
from silo_tui.model.words.text import ago
from silo_tui.sessions.kept import lives
from silo_tui.settings.file import read_text

ENDING = ".yaml"
_NAME = re.compile(r"[\w][\w.+ -]{0,79}")


def _folder() -> Path:
    return config_folder() / "views"


def place(name: str) -> Path:
    """Return the file of a view. ValueError for what is no name."""
    if not _NAME.fullmatch(name) or name != name.strip():
        raise ValueError(f"{name!r} is no name for a view: letters, digits, - _ . + and blanks, at most 80")
    return _folder() / (name + ENDING)


def last_of(logger: str) -> Path:
    """Return the file of what was on the screen of a logger at last."""
    return _folder() / f".last-{re.sub(r'[^A-Za-z0-9_.-]', '_', logger)[:80]}{ENDING}"


def left_by_us(logger: str) -> Path:
    """Return the file of what is on the screen of a logger now, for the case that this terminal is lost."""
    return _folder() / f".left-{_plain(logger)}.{os.getpid()}{ENDING}"


def left_behind(logger: str) -> list[Path]:
    """Return what processes that are no more had on the screen when they ended without being asked to, newest last."""
    found = []
    for path in _folder().glob(f".left-{_plain(logger)}.*{ENDING}"):
        pid = path.name.removesuffix(ENDING).rpartition(".")[2]
        if pid.isdecimal() and not lives(int(pid)):
            found.append(path)
    return sorted(found, key=_changed)


def _changed(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


def since(file: Path) -> str:
    """Return how long ago a view was written, in words."""
    return f"{ago(time.time() - _changed(file) / 1e9)} ago"


def _plain(logger: str) -> str:
    return re.sub(r"[^A-Za-z0-9_-]", "_", logger)[:80]


def names() -> list[str]:
    """Return the views that there are."""
    try:
        found = [each.name.removesuffix(ENDING) for each in _folder().iterdir() if each.suffix == ENDING]
    except OSError:
        return []
    return sorted(name for name in found if _NAME.fullmatch(name))


def load(name: str) -> tuple[KeptLayout, list[str]]:
    """Return a view by its name, and what of its file was left out. ValueError when there is none."""
    file = place(name)
    if not file.exists():
        known = names()
        there = f"there are {', '.join(known)}" if known else "`:view save NAME` makes one"
        raise ValueError(f"there is no view {name!r}{did_you_mean(nearest(name, known), there)}")
    return load_file(file)


def load_file(file: Path) -> tuple[KeptLayout, list[str]]:
    """Return the view in a file, and what of it was left out. ValueError when it can't be read."""
    from silo_tui.layouts.texts import read

    try:
        return read(read_text(file))
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"can't read '{file}': {reason(error)}") from error


def save(file: Path, layout: KeptLayout) -> None:
    """Write a view, over what was there. SaveError, then nothing was changed."""
    from silo.files.atomic import atomic_file
    from silo_tui.layouts.texts import write

    try:
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise SaveError(f"can't make '{file.parent}': {reason(error)}; nothing was saved") from error
    with atomic_file(file) as opened:
        opened.write(write(layout).encode())

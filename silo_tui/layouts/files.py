"""Views as files, in `views/` beside the settings.

`.left-NAME.TERMINAL.PID` is what a process has on the screen of a logger, or had there when it ended.
"""

import os
import re
import time
from pathlib import Path

import msgspec

from silo.core.names import did_you_mean, nearest
from silo.errors import SaveError, reason
from silo.net.configuration import config_folder
from silo_tui.layouts.layout import KeptLayout
from silo_tui.model.words.text import ago
from silo_tui.sessions.kept import of_the_dead
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


class LeftLayout(msgspec.Struct, frozen=True):
    """What was on the screen of a logger when a process ended, and what of its file was left out."""

    path: Path
    changed_ns: int
    layout: KeptLayout
    problems: list[str]

    @property
    def since(self) -> str:
        """How long ago that was, in words."""
        return f"{ago(time.time() - self.changed_ns / 1e9)} ago"


def left_by_us(logger: str) -> Path:
    """Return the file of what this process has on the screen of a logger."""
    return _folder() / f".left-{_plain(logger)}.{_terminal()}.{os.getpid()}{ENDING}"


def left_last(logger: str) -> LeftLayout | None:
    """Return what this terminal showed of a logger at last, else what processes that are no more did; None for nothing.

    Older ones of this terminal are removed. ValueError for one that can't be read.
    """
    paths = of_the_dead(_folder(), f".left-{_plain(logger)}.*{ENDING}")
    found = [(path.name.split(".")[-3], _changed(path), path) for path in paths]
    ours = sorted(each for each in found if each[0] == _terminal())
    for _, _, path in ours[:-1]:
        path.unlink(missing_ok=True)
    for _, changed_ns, path in ours[-1:] or sorted(found, key=lambda each: each[1], reverse=True):
        layout, problems = load_file(path)
        if layout != KeptLayout() or problems:
            return LeftLayout(path, changed_ns, layout, problems)
    return None


def _terminal() -> str:
    """Return the name of the terminal that this process is in: each comes back with what it showed itself."""
    try:
        return _plain(os.ttyname(0).removeprefix("/dev/"))
    except OSError:
        return "none"


def _changed(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


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

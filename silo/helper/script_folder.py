"""Scripts on the robot's side: only YAML files inside the folder of the logger's script, whatever a client asks for."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path

from silo.ipc.messages import Refused, RefusedWhy

SUFFIXES = (".yaml", ".yml")
MAX_LISTED = 500
MAX_DEPTH = 3  # folders below the script's own
MAX_VISITED = 5_000  # a script beside a data set must not make listing slow
MAX_TEXT_BYTES = 2 * 2**20


class ScriptRefusedError(Exception):
    """A path that clients may not use; `refused` is the answer to give."""

    def __init__(self, why: RefusedWhy, text: str) -> None:
        super().__init__(text)
        self.refused = Refused(why, text)


def list_scripts(own_script: Path) -> list[str]:
    """Return scripts in the folder of `own_script` and below it, relative to it; at most 500, hidden ones left out."""
    folder = own_script.parent
    return sorted(str(path.relative_to(folder)) for path in _walk(folder))[:MAX_LISTED]


def _walk(folder: Path) -> Iterator[Path]:
    waiting = [(folder, 0)]
    visited = 0
    while waiting and visited < MAX_VISITED:
        place, depth = waiting.pop(0)
        try:
            with os.scandir(place) as entries:
                for entry in entries:
                    visited += 1
                    if visited >= MAX_VISITED:
                        break
                    if entry.name.startswith("."):
                        continue
                    if entry.is_dir(follow_symlinks=False):
                        if depth < MAX_DEPTH and (depth or entry.name != "views"):  # those are of the terminal
                            waiting.append((Path(entry.path), depth + 1))
                    elif _is_script(entry, folder):
                        yield Path(entry.path)
        except OSError:
            # a folder that we may not read, or that vanished, holds no script for us
            continue


def _is_script(entry: os.DirEntry[str], folder: Path) -> bool:
    return entry.name.lower().endswith(SUFFIXES) and entry.is_file() and _inside(Path(entry.path), folder)


def resolve(asked: str, own_script: Path) -> Path:
    """Return the file that a client means: a path relative to the script folder, or an absolute one inside it.

    Empty means the logger's own script. Raises ScriptRefusedError for anything outside.
    """
    if not asked:
        return own_script
    folder = own_script.parent
    where = f"scripts are *.yaml and *.yml files in {folder} or below"
    if len(asked) > 1000 or not asked.isprintable():
        raise ScriptRefusedError(RefusedWhy.INVALID, f"this is not the path of a script: {asked[:80]!r}; {where}")
    path = folder / asked
    if path == own_script:
        return own_script
    if ".." in Path(asked).parts or not path.is_relative_to(folder):
        raise ScriptRefusedError(RefusedWhy.FORBIDDEN, f"{asked}: is outside of the script folder; {where}")
    if path.suffix.lower() not in SUFFIXES:
        raise ScriptRefusedError(RefusedWhy.INVALID, f"{asked}: does not end in .yaml or .yml; {where}")
    if not _inside(path, folder):
        raise ScriptRefusedError(RefusedWhy.FORBIDDEN, f"{asked}: leads out of the script folder by a link; {where}")
    return path


def _inside(path: Path, folder: Path) -> bool:
    return path.resolve().is_relative_to(folder.resolve())


def read_text(path: Path) -> str:
    """Return the text of a script. Raises ScriptRefusedError where there is none that can be read."""
    try:
        # without O_NONBLOCK, opening a named pipe would wait forever
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(descriptor, "rb") as file:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise ScriptRefusedError(RefusedWhy.INVALID, f"{path}: is not a file")
            data = file.read(MAX_TEXT_BYTES + 1)
    except FileNotFoundError:
        raise ScriptRefusedError(
            RefusedWhy.NOT_FOUND,
            f"{path}: no such script; paths begin in the folder of the logger's script, see `silo script list`",
        ) from None
    except OSError as error:
        raise ScriptRefusedError(RefusedWhy.FAILED, f"{path}: can't be read: {error.strerror}") from error
    if len(data) > MAX_TEXT_BYTES:
        raise ScriptRefusedError(RefusedWhy.INVALID, f"{path}: larger than {MAX_TEXT_BYTES // 2**20} MB")
    return data.decode(errors="replace")


def check_target(path: Path, *, overwrite: bool) -> None:
    """Raise ScriptRefusedError if a script must not be written there; its folder is made where missing."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ScriptRefusedError(
            RefusedWhy.FAILED, f"{path.parent}: can't make this folder: {error.strerror}"
        ) from error
    if path.exists():
        if not path.is_file():
            raise ScriptRefusedError(RefusedWhy.INVALID, f"{path}: is not a file")
        if not overwrite:
            raise ScriptRefusedError(
                RefusedWhy.EXISTS, f"{path} exists already; choose another name, or confirm that it is replaced"
            )

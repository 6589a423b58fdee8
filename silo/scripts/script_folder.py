"""Scripts on the robot's side: silo's own YAML files inside a folder for them, whatever a client asks for.

That is the folder of the logger's script where it has one; where it stands in the folder that the program was started
in, or at home, one beside it: what else is there is nobody's business. Nothing hidden, no YAML file of anybody else.
"""

import logging
import os
import re
import stat
from collections.abc import Iterator
from pathlib import Path

from silo.core.elements import SCRIPT_OF_ALL, is_default_script
from silo.core.runtime import followed
from silo.errors import reason
from silo.files.atomic import NearlyFullError, asked_left, check_room
from silo.rpc.refusals import RefusedWhy, RequestRefusedError, paths_refused

SUFFIXES = (".yaml", ".yml")
MAX_LISTED = 500
MAX_DEPTH = 3  # folders below the script's own
MAX_VISITED = 5_000  # a script beside a data set must not make listing slow
MAX_TEXT_BYTES = 2 * 2**20
MAX_HEAD_BYTES = 64 * 1024  # in which a script that is listed says that it is one
NO_SCRIPT = "is no script of silo, it has neither `log_elements:` nor another key of one"
_KEYS = "log_elements|derived_signals|signal_limits|triggers"
_IS_SCRIPT = re.compile(rf"""^\ufeff?\s*\{{?\s*["']?({_KEYS})["']?\s*:""", re.MULTILINE)

log = logging.getLogger("silo.helper")
_told: set[Path] = set()  # scripts in the old place that were told of


def folder_of(own_script: Path) -> Path:
    """Return where clients read and write scripts."""
    own = own_script.parent
    stem = Path(SCRIPT_OF_ALL).stem if is_default_script(own_script.name) else own_script.stem
    return own / f"{stem}.scripts" if own in _SHARED else own


def _shared() -> tuple[Path, ...]:
    try:
        return (Path.cwd(), Path.home())
    except (OSError, RuntimeError):  # deleted, or nobody's
        return ()


_SHARED = _shared()  # folders that hold anything


def list_scripts(own_script: Path) -> list[str]:
    """Return scripts in their folder and below it, relative to it; at most 500, hidden ones left out.

    For one release those that stand in the old place are there too, beside the logger's script.
    """
    own, *old = ([*_walk(place)] for place in _places(own_script))
    found = [(path, folder_of(own_script)) for path in own]
    found += [(path, own_script.parent) for path in (old[0] if old else []) if path not in own]
    return sorted({str(path.relative_to(place)) for path, place in found})[:MAX_LISTED]


def _places(own_script: Path) -> list[Path]:
    return list(dict.fromkeys([folder_of(own_script), own_script.parent]))


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
    if not (entry.name.lower().endswith(SUFFIXES) and entry.is_file() and _inside(Path(entry.path), folder)):
        return False
    try:
        return is_script(_head(Path(entry.path)))
    except OSError:
        return False


def is_script(text: str) -> bool:
    """Return whether this is a script of silo, or nothing at all: any other YAML file is somebody else's."""
    said = (line.strip() for line in text.splitlines())
    return _IS_SCRIPT.search(text) is not None or all(not line or line.startswith("#") for line in said)


def _head(path: Path) -> str:
    with os.fdopen(_opened(path.resolve()), "rb") as file:
        return file.read(MAX_HEAD_BYTES).decode(errors="replace")


def _opened(path: Path) -> int:
    """Open a file to read it. Raises OSError, for a link too."""
    # without O_NONBLOCK, opening a named pipe would wait forever
    return os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW | os.O_CLOEXEC)


@paths_refused("nothing was changed")
def resolve(asked: str, own_script: Path) -> Path:
    """Return the file that a client means: a path relative to the script folder, or an absolute one inside it.

    Empty means the logger's own script. Raises RequestRefusedError for anything outside.
    """
    if not asked:
        return own_script
    folder = folder_of(own_script)
    where = f"scripts are *.yaml and *.yml files in {folder} or below"
    if len(asked) > 1000 or not asked.isprintable():
        raise RequestRefusedError(RefusedWhy.INVALID, f"this is not the path of a script: {asked[:80]!r}; {where}")
    path = _meant(asked, own_script)
    if path == own_script:
        return own_script
    place = next((one for one in _places(own_script) if path.is_relative_to(one)), None)
    outside = f"{asked}: is outside of the script folder; {where}: '{path.name}' alone means {folder / path.name}"
    if ".." in Path(asked).parts or place is None:
        raise RequestRefusedError(RefusedWhy.FORBIDDEN, outside)
    if any(part.startswith(".") for part in path.relative_to(place).parts):
        raise RequestRefusedError(RefusedWhy.FORBIDDEN, f"{asked}: is hidden, and no script; {where}")
    if path.suffix.lower() not in SUFFIXES:
        raise RequestRefusedError(RefusedWhy.INVALID, f"{asked}: does not end in .yaml or .yml; {where}")
    if not _inside(path, place):
        raise RequestRefusedError(RefusedWhy.FORBIDDEN, f"{asked}: leads out of the script folder by a link; {where}")
    if place != folder and not _is_old_script(path, place):
        raise RequestRefusedError(RefusedWhy.FORBIDDEN, outside)
    if place != folder and path not in _told:
        _told.add(path)
        log.warning("%s: scripts of clients stand in %s: move it there, the next silo doesn't look here", path, folder)
    return path


def _meant(asked: str, own_script: Path) -> Path:
    """Return the path that is meant: in the folder, or of a script that stands in the old place, where it has none."""
    path, *old = [place / asked for place in _places(own_script)]
    if os.path.lexists(path) or ".." in Path(asked).parts:
        return path
    return next((one for one in old if one == own_script or _is_old_script(one, own_script.parent)), path)


def _is_old_script(path: Path, place: Path) -> bool:
    return path.suffix.lower() in SUFFIXES and _inside(path, place) and path.is_file() and is_script(_text_of(path))


def _inside(path: Path, folder: Path) -> bool:
    return followed(path).is_relative_to(folder.resolve())


def read_text(path: Path) -> str:
    """Return the text of a script. Raises RequestRefusedError where there is none that can be read."""
    try:
        text = read_bounded(path, path.resolve(), MAX_TEXT_BYTES)  # where links lead was checked
    except FileNotFoundError:
        where = "paths begin in the folder of the logger's script, see `silo script list`"
        raise RequestRefusedError(RefusedWhy.NOT_FOUND, f"{path}: no such script; {where}") from None
    if not is_script(text):
        raise RequestRefusedError(
            RefusedWhy.FORBIDDEN,
            f"{path}: is no script of silo, it has no key `log_elements:` or another of a script's",
        )
    return text


def read_bounded(path: Path, real: Path, most_bytes: int) -> str:
    """Return the text of a file, which is opened as `real`. Raises RequestRefusedError, FileNotFoundError for none."""
    try:
        descriptor = _opened(real)
        with os.fdopen(descriptor, "rb") as file:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise RequestRefusedError(RefusedWhy.INVALID, f"{path}: is not a file")
            data = file.read(most_bytes + 1)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise RequestRefusedError(RefusedWhy.FAILED, f"{path}: can't be read: {reason(error)}") from error
    if len(data) > most_bytes:
        most = f"{most_bytes // 1024} kB" if most_bytes < 2**20 else f"{most_bytes // 2**20} MB"
        raise RequestRefusedError(RefusedWhy.INVALID, f"{path}: larger than {most}")
    return data.decode(errors="replace")


@paths_refused("nothing was changed")
def check_target(path: Path, own_script: Path, *, overwrite: bool) -> None:
    """Raise RequestRefusedError if a script must not be written there; its folder is made where missing.

    What the program itself calls its script may be replaced whatever it is.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RequestRefusedError(
            RefusedWhy.FAILED, f"{path.parent}: can't make this folder: {reason(error)}"
        ) from error
    try:
        check_room(path.parent, MAX_TEXT_BYTES, most_left=asked_left(path.parent))
    except NearlyFullError as error:
        raise RequestRefusedError(RefusedWhy.FAILED, f"{error}; nothing was changed") from error
    if path.exists():
        if not path.is_file():
            raise RequestRefusedError(RefusedWhy.INVALID, f"{path}: is not a file")
        if not overwrite:
            raise RequestRefusedError(
                RefusedWhy.EXISTS,
                f"{path} exists already; choose another name, or replace it (--force, overwrite=True)",
            )
        if path != own_script and not is_script(_text_of(path)):
            text = f"{path}: {NO_SCRIPT}; choose another name; nothing was changed"
            raise RequestRefusedError(RefusedWhy.FORBIDDEN, text)


def _text_of(path: Path) -> str:
    try:
        return _head(path)
    except OSError as error:
        text = f"{path}: can't be read: {reason(error)}; nothing was changed"
        raise RequestRefusedError(RefusedWhy.FAILED, text) from error

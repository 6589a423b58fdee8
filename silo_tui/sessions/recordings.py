"""Recordings of a robot on this machine: where they lie already, or fetched into a cache, or to where one wants them.

Blocking functions for a thread of their own, so that a file that takes minutes holds up neither screen nor link.
"""

import os
import shutil
import time
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from silo.core.elements import FileType
from silo.core.quantities.writing import size_text
from silo.core.runtime import user_folder
from silo.recordings.requests import RecordingFile

if TYPE_CHECKING:
    from silo.client.client import Client

CACHED_BYTES = 4_000_000_000


class GivenUpError(Exception):
    """Nobody waits for this any more; what came is kept, and gone on with the next time."""


class Fetching(msgspec.Struct):
    """One fetch under way: written by its thread, read by the screen."""

    name: str
    done: int = 0
    total: int = 0
    given_up: bool = False
    began_s: float = msgspec.field(default_factory=time.monotonic)
    first: int = -1  # bytes that were here before

    def progress(self, done: int, total: int) -> None:
        """Note how far it is. Raises GivenUpError to end it."""
        if self.given_up:
            raise GivenUpError
        self.first = done if self.first < 0 else self.first
        self.done, self.total = done, total

    @property
    def words(self) -> str:
        """How far it is, fit to show."""
        if not self.total:
            return f"fetching {self.name}"
        elapsed_s = max(0.001, time.monotonic() - self.began_s)
        rate = (self.done - max(0, self.first)) / elapsed_s
        return f"fetching {self.name}  {self.done / self.total:.0%}  {size_text(rate)}/s"


def here(folder: str | os.PathLike[str], file: RecordingFile) -> Path | None:
    """Return where a recording lies in a folder of this machine; None where no such file, or another one, is there."""
    path = Path(folder) / file.folder / file.name
    return path if as_listed(path, file.type, file.folder) == file else None


def as_listed(path: Path, kind: FileType, below: str = "") -> RecordingFile | None:
    """Return a file or bag folder of this machine as a robot would list it; None where it can't be read.

    `below` is in which folder below that of the logger it lies.
    """
    try:
        inner = list(path.iterdir()) if path.is_dir() else [path]
        stats = [each.stat() for each in inner]
    except OSError:
        return None
    if not stats or not all(os.access(each, os.R_OK) for each in inner):
        return None
    size, changed = sum(each.st_size for each in stats), max(each.st_mtime_ns for each in stats)
    return RecordingFile(path.name, kind, size, changed, below)


def cache_folder(host: str, logger: str) -> Path:
    """Return where recordings of a logger are kept that were opened from far away."""
    plain = "".join(char if char.isalnum() or char in "-." else "_" for char in f"{host or 'here'}-{logger}")
    return user_folder("XDG_CACHE_HOME", ".cache") / "recordings" / plain.lstrip(".")


def lies_here(folder: str, file: RecordingFile, cache: Path) -> Path | None:
    """Return a path of this machine where the recording can be opened; None where it must be fetched."""
    return here(folder, file) or here(cache, msgspec.structs.replace(file, folder=""))


def bring_here(client: "Client", file: RecordingFile, cache: Path, fetching: Fetching) -> Path:
    """Fetch a recording into the cache."""
    path = client.fetch(file.name, cache, fetching.progress, replace=True)
    _make_room(cache.parent, path)
    return path


def _make_room(cache: Path, newest: Path) -> None:
    """Remove what was fetched longest ago until all takes at most `CACHED_BYTES`; the newest stays."""
    found = [path for path in cache.glob("*/*") if path != newest and path.name != f"{newest.name}.json"]
    by_age = sorted(found, key=lambda path: path.lstat().st_ctime, reverse=True)
    left = CACHED_BYTES - _size(newest)
    for path in by_age:
        left -= _size(path)
        if left < 0 and path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        elif left < 0:
            path.unlink(missing_ok=True)


def _size(path: Path) -> int:
    return sum(each.lstat().st_size for each in ([path] if not path.is_dir() else path.iterdir()))

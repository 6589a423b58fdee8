"""Copying a recording from a robot: in pieces that suit the link, checked, resumed, and in place only when whole.

What came stands in `<name>.part` beside the final name. A later fetch compares it with the file on the robot by
checksums, and goes on behind the part that is the same.
"""

import errno
import fcntl
import hashlib
import os
import shutil
import time
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, TypeVar

from silo.core.quantities.writing import size_text
from silo.core.runtime import closing_file, disk_room, is_at, sync_folder
from silo.errors import ConnectionLostError, SaveError, reason
from silo.files.atomic import write_all
from silo.recordings.requests import PartOfRecording, Piece, RecordingParts

FIRST_PIECE = 64 << 10
MIN_PIECE = 8 << 10
MAX_PIECE = 1 << 20
SUMMED = 16 << 20
FAST_S, SLOW_S = 0.4, 2.0  # a piece that takes less is followed by a larger one, one that takes more by a smaller one
LOOK_S = 0.1
ENDING = ".part"

Progress = Callable[[int, int], None]
Told = TypeVar("Told", Piece, RecordingParts)


def mark_of(files: "Iterable[os.stat_result]") -> str:
    """Return a text that changes with the content of these files, as far as the file system tells."""
    told = " ".join(f"{one.st_ino}:{one.st_size}:{one.st_mtime_ns}" for one in files)
    return hashlib.blake2s(told.encode(), digest_size=12).hexdigest()


class Fetch:
    """One recording on its way here. `parts` and `piece` ask the helper process."""

    def __init__(
        self,
        parts: Callable[[str], RecordingParts],
        piece: Callable[[str, str, int, int, bool], Piece],
        connected: Callable[[], bool],
        patience_s: float,
    ) -> None:
        self._parts, self._piece, self._connected, self._patience_s = parts, piece, connected, patience_s
        self._count = FIRST_PIECE
        self._here = self._total = 0
        self._progress: Progress | None = None

    def run(self, name: str, folder: Path, progress: Progress | None = None, replace: bool = False) -> Path:
        """Fetch it into `folder`, which is made where missing; return where it stands. See `Client.fetch`."""
        self._progress = progress
        told = self._patiently(lambda: self._parts(name))
        _check(told, name)
        final = folder / name
        names = [final, *(folder / one.path for one in told.parts)]
        if not replace:
            _check_none(names)
        self._total = sum(one.size_bytes for one in told.parts)
        # a bag is filled beside its final name, and renamed whole
        place = folder / f"{name}{ENDING}" if told.is_folder else folder
        targets = [place / f"{Path(one.path).name}{'' if told.is_folder else ENDING}" for one in told.parts]
        try:
            with _alone(place if told.is_folder else targets[0], told.is_folder, () if replace else names):
                for one, target in zip(told.parts, targets, strict=True):
                    self._fetch(one, target)
                _put_in_place(told, folder, place, targets)
        except SaveError:
            raise
        except OSError as error:
            if isinstance(error, ConnectionLostError):
                raise ConnectionLostError(f"{error}; {self._kept(name, folder)}") from error
            raise self._refused(error, name, folder) from error
        return final

    def _fetch(self, part: PartOfRecording, target: Path) -> None:
        with target.open("r+b" if target.exists() else "x+b", buffering=0) as file:
            have = self._verified(part, file)
            file.truncate(have)
            self._say(have)
            room, _ = disk_room(target.parent)
            if part.size_bytes - have > room:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            while have < part.size_bytes:
                piece = self._next(part, have)
                write_all(file.fileno(), [memoryview(piece.data)], have)
                have += piece.count
                self._say(piece.count)
            os.fsync(file.fileno())
        os.utime(target, ns=(part.changed_ns, part.changed_ns))

    def _verified(self, part: PartOfRecording, file: BinaryIO) -> int:
        """Return how many bytes from an earlier fetch are those of the file on the robot."""
        size = min(os.fstat(file.fileno()).st_size, part.size_bytes)
        good = 0
        while good < size:
            count = min(SUMMED, size - good)
            theirs = self._patiently(lambda: self._piece(part.path, part.mark, good, count, True))  # noqa: B023
            if theirs.count != count or theirs.crc32 != summed(file.fileno(), good, count):
                break
            good += count
        return good

    def _next(self, part: PartOfRecording, have: int) -> Piece:
        def ask() -> Piece:
            count = min(self._count, part.size_bytes - have)
            began_s = time.monotonic()
            try:
                piece = self._piece(part.path, part.mark, have, count, False)
            except ConnectionLostError:
                self._count = max(MIN_PIECE, self._count // 4)
                raise
            took_s = time.monotonic() - began_s
            if took_s < FAST_S:
                self._count = min(MAX_PIECE, self._count * 2)
            elif took_s > SLOW_S:
                self._count = max(MIN_PIECE, self._count // 2)
            return piece

        piece = self._patiently(ask)
        fits = 0 < piece.count <= part.size_bytes - have
        if not fits or len(piece.data) != piece.count or zlib.crc32(piece.data) != piece.crc32:
            raise ConnectionLostError(f"bytes {have} and following of {part.path} came damaged, or the file was cut")
        return piece

    def _patiently(self, ask: Callable[[], Told]) -> Told:
        """Ask, and again when the link is back."""
        until_s = time.monotonic() + self._patience_s
        while True:
            try:
                return ask()
            except ConnectionLostError:
                if time.monotonic() >= until_s:
                    raise
            while not self._connected() and time.monotonic() < until_s:
                self._say(0)  # whoever watches may give up
                time.sleep(LOOK_S)

    def _say(self, more: int) -> None:
        self._here += more
        if self._progress is not None:
            self._progress(self._here, self._total)

    def _kept(self, name: str, folder: Path) -> str:
        kept = folder / f"{name}{ENDING}"
        here = f"{size_text(self._here)} of {size_text(self._total)}"
        return f"{here} are kept in '{kept}': fetch again to go on from there"

    def _refused(self, error: OSError, name: str, folder: Path) -> SaveError:
        why = reason(error)
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            free, _ = disk_room(folder)
            return SaveError(
                f"can't fetch '{name}': {why}: {size_text(self._total - self._here)} more are needed, "
                f"{size_text(free)} are free in '{folder}'; make room or choose another folder; "
                f"{self._kept(name, folder)}"
            )
        return SaveError(f"can't fetch '{name}' to '{folder}': {why}; choose another folder")


def _check(told: RecordingParts, name: str) -> None:
    """Raise ConnectionLostError for parts that would be written elsewhere: a robot is not trusted with our files."""
    for one in told.parts:
        owner, _, inner = one.path.partition("/")
        plain = inner if told.is_folder else owner
        good = owner == name if told.is_folder else owner in (name, f"{name}.json") and not inner
        if not good or not plain or plain in (".", "..") or "/" in plain or not plain.isprintable() or "\0" in one.path:
            raise ConnectionLostError(
                f"the helper process told of a part {one.path!r} of {name!r}; nothing was fetched"
            )
    if not told.parts or told.name != name or "/" in name or name in ("", ".", ".."):
        raise ConnectionLostError(f"the helper process told of no part of {name!r}; nothing was fetched")


def _check_none(names: Sequence[Path]) -> None:
    if any(name.exists() for name in names):
        raise SaveError(f"'{names[0]}' exists already; remove it, or choose another folder; nothing was fetched")


@contextmanager
def _alone(target: Path, is_folder: bool, names: Sequence[Path]) -> Iterator[None]:
    """Make what is being fetched and hold its lock, unless one of these names is there by then."""
    flags = os.O_RDONLY | os.O_DIRECTORY if is_folder else os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW
    while True:
        (target if is_folder else target.parent).mkdir(parents=True, exist_ok=True)
        try:
            descriptor = os.open(target, flags | os.O_CLOEXEC, 0o666)
        except FileNotFoundError:
            continue
        with closing_file(descriptor):
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                text = f"'{target}' is being fetched already, by another program; nothing was changed"
                raise SaveError(text) from None
            if not is_at(descriptor, target):
                continue  # another program has just put it in place
            try:
                _check_none(names)
            except SaveError:
                with suppress(OSError):  # what came of it by an earlier fetch stays
                    if is_folder:
                        target.rmdir()
                    elif not os.fstat(descriptor).st_size:
                        target.unlink()
                raise
            yield
            return


def _put_in_place(told: RecordingParts, folder: Path, place: Path, targets: list[Path]) -> None:
    final = folder / told.name
    if told.is_folder:
        for stray in set(place.iterdir()) - set(targets):
            stray.unlink()  # of a fetch of what the bag was before
        if final.exists():
            shutil.rmtree(final)
        sync_folder(place)
        place.rename(final)
    else:
        # the file itself last: where it stands all of it is there
        for one, target in reversed(list(zip(told.parts, targets, strict=True))):
            target.replace(folder / one.path)
    sync_folder(folder)


def summed(file: int, offset: int, count: int) -> int:
    """Return the CRC-32 of so many bytes of a file."""
    crc32 = 0
    for begin in range(offset, offset + count, MAX_PIECE):
        crc32 = zlib.crc32(os.pread(file, min(MAX_PIECE, offset + count - begin), begin), crc32)
    return crc32

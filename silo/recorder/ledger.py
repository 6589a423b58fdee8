"""What a recorder wrote, in a file beside its parts: the only files that its budget may delete.

A part is told by name and by inode: a file that somebody put in its place is not ours. `.NAME.recorder.json` is
replaced as a whole; `.NAME.recorder.lock` is held by the recorder that writes under the name.
"""

import contextlib
import fcntl
import glob
import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from silo.errors import SaveError
from silo.files.atomic import atomic_file, reason
from silo.files.part_facts import PART_ENDING
from silo.recorder.closing import ClosedPart

ROOM_SHARE = 0.02  # of a disk that is left free, or
ROOM_BYTES = 1_000_000_000  # that many, whichever is less
_RETRY_S = 0.02

DiskRoom = Callable[[Path], tuple[int, int]]  # free bytes and size of the disk of a folder


class PartEntry(msgspec.Struct):
    """A part: its name when it is finished, its inode; size 0 while it is written."""

    name: str
    inode: int
    size_bytes: int = 0


class Written(msgspec.Struct):
    """What the file holds: parts oldest first, and with which rows of which run to go on."""

    recorder: str
    run: str = ""
    next_rows: dict[int, int] = {}
    parts: list[PartEntry] = []


def disk_room(folder: Path) -> tuple[int, int]:
    """Return the bytes that this user may still write, and the size of the disk."""
    found = os.statvfs(folder)
    return found.f_bavail * found.f_frsize, found.f_blocks * found.f_frsize


def left_free(size_bytes: int) -> int:
    """Return how many bytes of a disk of this size are left to others."""
    return int(min(ROOM_SHARE * size_bytes, ROOM_BYTES))


def part_path(folder: Path, name: str) -> Path:
    """Return where the part of this final name is while it is written."""
    return folder / (name.removesuffix(".mcap") + PART_ENDING)


def number_of(path: Path) -> int:
    """Return the number of a part, by which they follow one another; 0 for a name that is no part's."""
    number = path.name.removesuffix(".part").removesuffix(".mcap").rpartition("_")[2]
    return int(number) if number.isdecimal() else 0


class Ledger:
    """The parts of one recorder. One user at a time: `close` lets go of the name."""

    def __init__(self, folder: Path, name: str, wait_s: float) -> None:
        """Take the name; waits until a predecessor has finished. Raises SaveError."""
        self.folder, self.name = folder, name
        self._path = folder / f".{name}.recorder.json"
        self._lock = _locked(folder / f".{name}.recorder.lock", wait_s)
        self.written = self._read()

    def _read(self) -> Written:
        try:
            return msgspec.json.decode(self._path.read_bytes(), type=Written)
        except FileNotFoundError:
            return Written(self.name)
        except (msgspec.MsgspecError, UnicodeDecodeError) as error:
            os.close(self._lock)
            raise SaveError(
                f"{self._path}: the list of this recorder's files is damaged ({error}); remove it, and the files in "
                f"{self.folder} stay until you delete them, or record under another name; nothing is recorded"
            ) from None

    def close(self) -> None:
        """Let go of the name."""
        os.close(self._lock)

    def _store(self) -> None:
        with atomic_file(self._path) as file:
            file.write(msgspec.json.encode(self.written))

    def open_parts(self) -> list[Path]:
        """Return where parts of this recorder are, or were, of whose end it knows nothing."""
        noted = {part_path(self.folder, entry.name) for entry in self.written.parts if not entry.size_bytes}
        return [*(noted | set(self.folder.glob(f"{glob.escape(self.name)}_*{PART_ENDING}")))]

    def go_on(self, run: str, next_rows: dict[int, int]) -> None:
        """Note with which rows this recorder goes on."""
        self.written.run, self.written.next_rows = run, next_rows

    def settle(self, closed: Sequence[ClosedPart], open_part: str = "") -> None:
        """Take in what became of parts that a predecessor left: closed just now, by others, or gone.

        One that was killed right before it noted a part, or its end, leaves that to its successor, of whom `open_part`
        is. With which rows to go on stays as it is: that is told by what is newest.
        """
        names = {entry.name for entry in self.written.parts}
        ours = [part for part in closed if part.recorder == self.name and part.size_bytes]
        self.written.parts += [PartEntry(part.path.name, part.inode) for part in ours if part.path.name not in names]
        for entry in self.written.parts:
            found = self._ours(entry)
            if found is not None and not entry.size_bytes:
                entry.size_bytes = found
        self.written.parts = [
            entry
            for entry in sorted(self.written.parts, key=lambda entry: number_of(Path(entry.name)))
            if entry.name == open_part or (entry.size_bytes and self._ours(entry))
        ]
        self._store()

    def begin(self, name: str, inode: int) -> None:
        """Note a part that is begun. Raises SaveError."""
        self.written.parts.append(PartEntry(name, inode))
        self._store()

    def end(self, name: str, size_bytes: int, run: str, next_rows: dict[int, int]) -> None:
        """Note a part that is finished, of size 0 if nothing is left of it. Raises SaveError."""
        self.written.run, self.written.next_rows = run, next_rows
        for entry in self.written.parts:
            if entry.name == name:
                entry.size_bytes = size_bytes
        self.written.parts = [entry for entry in self.written.parts if entry.name != name or size_bytes]
        self._store()

    @property
    def size_bytes(self) -> int:
        """Bytes of all finished parts that are still there."""
        return sum(entry.size_bytes for entry in self.written.parts)

    def trim(self, keep_bytes: int, coming_bytes: int) -> list[str]:
        """Delete the oldest finished parts until `coming_bytes` fit; returns their names.

        One that was moved away or replaced is forgotten, and no other file is touched.
        """
        deleted = []
        while keep_bytes and self.size_bytes + coming_bytes > keep_bytes:
            oldest = next((entry for entry in self.written.parts if entry.size_bytes), None)
            if oldest is None:
                break
            if self._ours(oldest) is not None:
                (self.folder / oldest.name).unlink(missing_ok=True)
                deleted.append(oldest.name)
            self.written.parts.remove(oldest)
        if deleted:
            self._store()
        return deleted

    def _ours(self, entry: PartEntry) -> int | None:
        """The size of a finished part, None if another file stands there, or none."""
        with contextlib.suppress(OSError):
            found = (self.folder / entry.name).lstat()
            if found.st_ino == entry.inode:
                return found.st_size
        return None


def _locked(path: Path, wait_s: float) -> int:
    until_s = time.monotonic() + wait_s
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    except OSError as error:
        raise SaveError(f"can't record to '{path.parent}': {reason(error)}; choose another folder") from error
    while not _taken(descriptor):
        if time.monotonic() > until_s:
            os.close(descriptor)
            raise SaveError(
                f"another recorder writes to '{path.parent}' under this name: record under another name "
                "(--name) or to another folder (--to); nothing is recorded"
            )
        time.sleep(_RETRY_S)  # a lock gives no sign to those who want a time limit
    return descriptor


def _taken(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True  # a file system that knows no locks
    return True

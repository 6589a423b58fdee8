"""Which captures the judges of a logger wrote, in a file of its folder: the only files that `keep` may remove.

`.<logger>.captures.jsonl` has a line before a capture is written, which says under which name, and one after, with the
inodes of its files: what somebody put in their place is not ours. Lines are appended under a lock, as several processes
may have loggers of one name; it is written anew when most of what it tells is gone.
"""

import contextlib
import fcntl
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import msgspec

from silo.runtime import open_own, read_own

MOST_BYTES = 200_000
MOST_BEGUN = 20  # captures without files that are remembered: of a process one is under way, others failed
_TAIL = 256  # bytes before what is new that must be as they were: else the file was written anew

_encoder = msgspec.json.Encoder()


class CaptureFile(msgspec.Struct, frozen=True):
    """A file, or the folder of a bag."""

    name: str
    inode: int


class CaptureEntry(msgspec.Struct, frozen=True, omit_defaults=True):
    """A capture by run, trigger and number. `name` is what its files are called; without `files` it was only begun."""

    run: str
    trigger: str
    number: int
    name: str
    files: tuple[CaptureFile, ...] = ()


_decoder = msgspec.json.Decoder(CaptureEntry)


class CaptureList:
    """The captures of one logger. One user at a time in a process."""

    def __init__(self, folder: str, logger: str) -> None:
        self._folder = Path(folder)
        self._path = self._folder / f".{logger}.captures.jsonl"
        self._entries: dict[tuple[str, str, int], CaptureEntry] = {}
        self._inode = self._read_to = 0
        self._tail = b""
        self._looked_at = MOST_BYTES  # bytes: below nobody looks what of it is gone

    def is_of(self, folder: str, logger: str) -> bool:
        """Whether it is the list of this logger in this folder."""
        return self._path == Path(folder) / f".{logger}.captures.jsonl"

    def find(self, run: str, trigger: str, number: int) -> CaptureEntry | None:
        """Return what is known of a capture. Raises OSError."""
        with self._locked() as descriptor:
            return self._read(descriptor).get((run, trigger, number))

    def numbers(self, run: str) -> dict[str, int]:
        """Return the highest number of each trigger's captures in a run. Raises OSError."""
        with self._locked() as descriptor:
            found: dict[str, int] = {}
            for one in self._read(descriptor).values():
                if one.run == run:
                    found[one.trigger] = max(found.get(one.trigger, 0), one.number)
            return found

    def begun(self, run: str, trigger: str, number: int, name: Callable[[], str]) -> CaptureEntry:
        """Return what is known of a capture; of one that nobody knows it is noted what its files will be called.

        A process that is killed from here on leaves the name to its successor. Raises OSError, and what `name` does.
        """
        with self._locked() as descriptor:
            entry = self._read(descriptor).get((run, trigger, number))
            if entry is None:
                entry = CaptureEntry(run, trigger, number, name())
                _append(descriptor, entry)
            return entry

    def note(self, entry: CaptureEntry) -> None:
        """Add a line. Raises OSError."""
        with self._locked() as descriptor:
            _append(descriptor, entry)

    def written(self, entry: CaptureEntry, paths: Sequence[str], keep: int) -> list[str]:
        """Note the files of a capture, and remove the oldest of its trigger beyond those to keep (0: all).

        Returns the names of what was removed. Raises OSError.
        """
        found: list[CaptureFile] = []
        for path in paths:
            with contextlib.suppress(FileNotFoundError):  # somebody has taken it away already
                found.append(CaptureFile(Path(path).name, os.lstat(path).st_ino))
        self.note(msgspec.structs.replace(entry, files=tuple(found)))
        removed: list[str] = []
        with self._locked() as descriptor:
            entries = self._read(descriptor)
            own = [one for one in entries.values() if keep and one.trigger == entry.trigger and self._is_there(one)]
            for one in own[: max(0, len(own) - keep)]:
                for file in filter(self._is_ours, one.files):
                    _remove(self._folder / file.name)
                    removed.append(file.name)
            if os.fstat(descriptor).st_size > self._looked_at:
                self._shorten(descriptor, entries)
        return removed

    def _shorten(self, descriptor: int, entries: dict[tuple[str, str, int], CaptureEntry]) -> None:
        """Write the file anew where most of what it tells is gone."""
        # what was begun only may be under way: its name is all that keeps it from being written twice
        begun = [key for key, one in entries.items() if not one.files][-MOST_BEGUN:]
        there = [one for key, one in entries.items() if key in begun or self._is_there(one)]
        if len(there) < len(entries) / 2:
            # the same process, or another one, may be killed in the midst: then older lines stand below, of files
            # that are gone
            os.lseek(descriptor, 0, os.SEEK_SET)
            lines = b"".join(_encoder.encode(one) + b"\n" for one in there)
            _write(descriptor, lines)
            os.ftruncate(descriptor, len(lines))
        self._looked_at = max(MOST_BYTES, os.fstat(descriptor).st_size * 5 // 4)  # thousands may be there for good

    def _read(self, descriptor: int) -> dict[tuple[str, str, int], CaptureEntry]:
        """All captures, oldest first; a damaged line is left out. What was read before is not read again."""
        status = os.fstat(descriptor)
        tail = os.pread(descriptor, len(self._tail), self._read_to - len(self._tail)) if self._read_to else b""
        if status.st_ino != self._inode or status.st_size < self._read_to or tail != self._tail:
            self._entries, self._inode, self._read_to = {}, status.st_ino, 0
        text = os.pread(descriptor, status.st_size - self._read_to, self._read_to)
        for entry in _decoded(text):
            self._entries[entry.run, entry.trigger, entry.number] = entry
        self._read_to = status.st_size
        begin = max(0, status.st_size - _TAIL)
        self._tail = os.pread(descriptor, status.st_size - begin, begin)
        return self._entries

    def _is_there(self, entry: CaptureEntry) -> bool:
        return any(map(self._is_ours, entry.files))

    def _is_ours(self, file: CaptureFile) -> bool:
        with contextlib.suppress(OSError):
            return (self._folder / file.name).lstat().st_ino == file.inode
        return False

    @contextlib.contextmanager
    def _locked(self) -> Iterator[int]:
        descriptor = open_own(self._path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            with contextlib.suppress(OSError):  # a file system that knows no locks
                fcntl.flock(descriptor, fcntl.LOCK_EX)
            yield descriptor
        finally:
            os.close(descriptor)


def _decoded(text: bytes) -> Iterator[CaptureEntry]:
    """The captures of lines; a damaged line is left out."""
    for line in text.splitlines():
        with contextlib.suppress(msgspec.MsgspecError, UnicodeDecodeError):
            yield _decoder.decode(line)


def read_captures(folder: str | os.PathLike[str], logger: str) -> list[CaptureEntry]:
    """Return the captures of a logger as its list has them, without touching it. Raises OSError."""
    found: dict[tuple[str, str, int], CaptureEntry] = {}
    with contextlib.suppress(FileNotFoundError):
        for entry in _decoded(read_own(Path(folder, f".{logger}.captures.jsonl"))):
            found[entry.run, entry.trigger, entry.number] = entry
    return list(found.values())


def _append(descriptor: int, entry: CaptureEntry) -> None:
    os.lseek(descriptor, 0, os.SEEK_END)
    _write(descriptor, b"\n" + _encoder.encode(entry) + b"\n")  # a process may have been killed within a line


def _write(descriptor: int, text: bytes) -> None:
    view = memoryview(text)
    while view:
        view = view[os.write(descriptor, view) :]


def _remove(path: Path) -> None:
    """Remove one saved log with what belongs to it."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
        return
    path.unlink(missing_ok=True)
    if path.suffix == ".csv":
        path.with_name(f"{path.name}.json").unlink(missing_ok=True)

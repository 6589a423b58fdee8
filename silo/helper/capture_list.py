"""Which captures the judges of a logger wrote, in a file of its folder: the only files that `keep` may remove.

`.<logger>.captures.jsonl` has a line before a capture is written, which says under which name, and one after, with the
inodes of its files: what somebody put in their place is not ours. Lines are appended under a lock, as several processes
may have loggers of one name; it is written anew when most of what it tells is gone.
"""

import contextlib
import fcntl
import os
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec

MOST_BYTES = 200_000

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

    def find(self, run: str, trigger: str, number: int) -> CaptureEntry | None:
        """Return what is known of a capture. Raises OSError."""
        with self._locked() as descriptor:
            return _entries(descriptor).get((run, trigger, number))

    def numbers(self, run: str) -> dict[str, int]:
        """Return the highest number of each trigger's captures in a run. Raises OSError."""
        with self._locked() as descriptor:
            found: dict[str, int] = {}
            for one in _entries(descriptor).values():
                if one.run == run:
                    found[one.trigger] = max(found.get(one.trigger, 0), one.number)
            return found

    def note(self, entry: CaptureEntry) -> None:
        """Add a line. Raises OSError."""
        with self._locked() as descriptor:
            os.lseek(descriptor, 0, os.SEEK_END)
            _write(descriptor, b"\n" + _encoder.encode(entry) + b"\n")  # a process may have been killed within a line

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
            entries = _entries(descriptor)
            there = {key: one for key, one in entries.items() if any(map(self._is_ours, one.files))}
            own = [key for key, one in there.items() if one.trigger == entry.trigger]
            for key in own[: max(0, len(own) - keep)] if keep else []:
                for file in filter(self._is_ours, there.pop(key).files):
                    _remove(self._folder / file.name)
                    removed.append(file.name)
            if os.fstat(descriptor).st_size > MOST_BYTES and len(there) < len(entries) / 2:
                # the same process, or another one, may be killed in the midst: then older lines stand below, of files
                # that are gone
                os.lseek(descriptor, 0, os.SEEK_SET)
                lines = b"".join(_encoder.encode(one) + b"\n" for one in there.values())
                _write(descriptor, lines)
                os.ftruncate(descriptor, len(lines))
        return removed

    def _is_ours(self, file: CaptureFile) -> bool:
        with contextlib.suppress(OSError):
            return (self._folder / file.name).lstat().st_ino == file.inode
        return False

    @contextlib.contextmanager
    def _locked(self) -> Iterator[int]:
        flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
        descriptor = os.open(self._path, flags, 0o644)
        try:
            with contextlib.suppress(OSError):  # a file system that knows no locks
                fcntl.flock(descriptor, fcntl.LOCK_EX)
            yield descriptor
        finally:
            os.close(descriptor)


def _entries(descriptor: int) -> dict[tuple[str, str, int], CaptureEntry]:
    """All captures, oldest first; a damaged line is left out."""
    size = os.fstat(descriptor).st_size
    found: dict[tuple[str, str, int], CaptureEntry] = {}
    for line in os.pread(descriptor, size, 0).splitlines():
        with contextlib.suppress(msgspec.MsgspecError, UnicodeDecodeError):
            entry = _decoder.decode(line)
            found[entry.run, entry.trigger, entry.number] = entry
    return found


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

"""What a recorder wrote, in a file beside its parts: the only files that its budget may delete, and how far it is.

A part is told by name and by inode: a file that somebody put in its place is not ours. `.NAME.recorder.json` is
replaced as a whole; `.NAME.recorder.lock` is held by the recorder that writes under the name.
"""

import contextlib
import fcntl
import glob
import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import msgspec

from silo.errors import SaveError
from silo.files.atomic import atomic_file, reason
from silo.files.part_facts import PART_ENDING
from silo.recorder.closing import ClosedPart, finished_part
from silo.recorder.written import PartEntry, RunEntry, Sums, Written, decode_written, written_path

ROOM_SHARE = 0.02  # of a disk that is left free, or
ROOM_BYTES = 1_000_000_000  # that many, whichever is less
_RETRY_S = 0.02

DiskRoom = Callable[[Path], tuple[int, int]]  # free bytes and size of the disk of a folder


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
        self.expected: dict[str, dict[int, int]] = {}  # rows of runs that parts seem to have which are not closed yet
        self._path = written_path(folder, name)
        self._lock = _locked(folder / f".{name}.recorder.lock", wait_s)
        self.written = self._read()

    def _read(self) -> Written:
        try:
            return decode_written(self._path.read_bytes())
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
        """Note with which rows this recorder goes on: those before them are in parts that are open, or that is told."""
        self.written.run, self.written.next_rows = run, next_rows
        entry = self.written.entry(run)
        if entry is not None:
            known = {ring: entry.end.get(ring, entry.begin.get(ring, 0)) for ring in entry.channels}
            self.expected[run] = {ring: max(0, next_rows.get(ring, row) - row) for ring, row in known.items()}
            entry.end = {**entry.end, **next_rows}

    def begin_order(self, order: str) -> None:
        """Count anew: of the parts of orders before this one is known that they are there."""
        self.written.order, self.written.runs, self.written.before = order, [], Sums()

    def rows_of(self, run: str) -> dict[int, int] | None:
        """Return with which rows to go on in a run; None where nothing is known of it."""
        if run and run == self.written.run:
            return self.written.next_rows
        entry = self.written.entry(run)
        return None if entry is None else {**entry.begin, **entry.end}

    def settle(self, closed: Sequence[ClosedPart], open_part: str = "") -> None:
        """Take in what became of parts that a predecessor left: closed just now, by others, or gone.

        One that was killed right before it noted a part, or its end, leaves that to its successor, of whom `open_part`
        is. With which rows to go on stays as it is: that is told by what is newest.
        """
        names = {entry.name for entry in self.written.parts}
        ours = {part.path.name: part for part in closed if part.recorder == self.name and part.size_bytes}
        self.written.parts += [PartEntry(name, part.inode) for name, part in ours.items() if name not in names]
        for entry in self.written.parts:
            found = self._ours(entry)
            if found is not None and not entry.size_bytes:
                entry.size_bytes = found
                part = ours.get(entry.name) or finished_part(self.folder / entry.name)
                if part is not None:
                    self._count(part.run, part.rows, part.samples, found, part.next_rows)
        self.written.parts = [
            entry
            for entry in sorted(self.written.parts, key=lambda entry: number_of(Path(entry.name)))
            if entry.name == open_part or (entry.size_bytes and self._ours(entry))
        ]
        self.expected = {}
        self._store()

    def _count(self, run: str, rows: Mapping[int, int], samples: int, size_bytes: int, end: Mapping[int, int]) -> None:
        """Take in a part that is finished; one of another order is none of its runs."""
        entry = self.written.entry(run)
        if entry is None or (rows and all(end.get(ring, 0) <= entry.begin.get(ring, 0) for ring in rows)):
            return
        for ring, many in rows.items():
            entry.rows[ring] = entry.rows.get(ring, 0) + many
        for ring, row in end.items():
            entry.end[ring] = max(entry.end.get(ring, 0), row)
        entry.parts += 1
        entry.samples += samples
        entry.size_bytes += size_bytes

    def begin_run(self, entry: RunEntry) -> None:
        """Note a run that is recorded from now on, or again; what stands of it in parts stays counted."""
        known = self.written.entry(entry.run)
        if known is None:
            self.written.runs.append(entry)
        else:
            known.channels, known.extras = entry.channels, entry.extras
        self.written.fold()
        self._store()

    def end_run(self, run: str, end: Mapping[int, int], *, done: bool, gone: str = "") -> None:
        """Note how far a run was read, or lost, and whether that is all of it. Raises SaveError."""
        entry = self.written.entry(run)
        if entry is not None:
            entry.end = dict(end) or entry.end
            entry.done, entry.gone = done, gone or entry.gone
            entry.extras = None if done else entry.extras
        self._store()

    def sums(self, run: str = "", rows: Mapping[int, int] | None = None, end: Mapping[int, int] | None = None) -> Sums:
        """Return what became of the order; of `run` with `rows` more in a part that is open, read as far as `end`."""
        sums = self.written.sums()
        for one in self.written.runs:
            more = dict(self.expected.get(one.run, {}))
            if one.run == run:
                for ring, many in (rows or {}).items():
                    more[ring] = more.get(ring, 0) + many
            if more:
                sums.lost += one.lost(more, dict(end) if end and one.run == run else one.end) - one.lost()
        return sums

    def begin(self, name: str, inode: int, run: str = "") -> None:
        """Note a part that is begun. Raises SaveError."""
        self.written.parts.append(PartEntry(name, inode, run=run))
        self._store()

    def end(
        self, name: str, size_bytes: int, run: str, next_rows: dict[int, int], rows: dict[int, int], samples: int
    ) -> None:
        """Note a part that is finished, of size 0 if nothing is left of it. Raises SaveError."""
        self.written.run, self.written.next_rows = run, next_rows
        for entry in self.written.parts:
            if entry.name == name:
                entry.size_bytes = size_bytes
        self.written.parts = [entry for entry in self.written.parts if entry.name != name or size_bytes]
        if size_bytes:
            self._count(run, rows, samples, size_bytes, next_rows)
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

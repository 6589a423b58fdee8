"""What silo itself wrote: the only files that a budget may delete, told by name and inode.

A file that somebody put in the place of one of ours is not ours. Two lists stand in the folders of the files:

- `.<logger>.captures.jsonl`, the captures of a logger, as several processes may have loggers of one name. A line comes
  before a capture is written, which says under which name, and one after, with the inodes of its files. Lines are
  appended under a lock; it is written anew when most of what it tells is gone.
- `.<name>.recorder.json`, the parts of a recorder, and of each run what was to be recorded, and what was: all numbers
  of a recording are computed of this, never told by a process, which may be new, or dead. Replaced as a whole, by the
  one that holds `.<name>.recorder.lock`, in which it says who it is. Needs no MCAP.
"""

import contextlib
import glob
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from silo.core.child import end_abandoned_holder, note_holder
from silo.core.conditions import Conditions
from silo.core.quantities.writing import many, size_text
from silo.core.runtime import closing_file, open_own, read_own
from silo.decoding import json_decoder
from silo.errors import SaveError, reason
from silo.files.atomic import append_all, atomic_file, lock, taken
from silo.files.formats import OPEN_PART_ENDING

MOST_BYTES = 200_000
MOST_BEGUN = 20  # captures without files that are remembered: of a process one is under way, others failed
MOST_RUNS = 100  # of an order that are told one by one; of those before them the sums are kept
MOST_ORDERS = 100  # before this one that are remembered: a recorder of one of them may still come to go on with it
WRITTEN_ENDING = ".recorder.json"
_TAIL = 256  # bytes before what is new that must be as they were: else the file was written anew
_RETRY_S = 0.02


def own_status(file: "CaptureFile | PartEntry", folder: Path | int) -> os.stat_result | None:
    """Return how a listed file is there now, in a folder or an open one; None where it is gone, or another one is."""
    with contextlib.suppress(OSError, ValueError):
        if isinstance(folder, Path):
            found = (folder / file.name).lstat()
        else:
            found = os.stat(file.name, dir_fd=folder, follow_symlinks=False)
        if found.st_ino == file.inode:
            return found
    return None


# ------------------------------------------------------------------------------------------------------------- captures


class CaptureFile(msgspec.Struct, frozen=True):
    """A file of a capture, or the folder of a bag."""

    name: str
    inode: int


class CaptureEntry(msgspec.Struct, frozen=True, omit_defaults=True):
    """A capture by run, trigger and number. `name` is what its files are called; without `files` it was only begun.

    One that was `let_go` made room for newer ones of its trigger.
    """

    run: str
    trigger: str
    number: int
    name: str
    files: tuple[CaptureFile, ...] = ()
    let_go: bool = False


_Key = tuple[str, str, int]  # run, trigger, number
_decode_capture = json_decoder(CaptureEntry).decode


def captures_path(folder: str | os.PathLike[str], logger: str) -> Path:
    """Return where the captures of a logger are listed."""
    return Path(folder, f".{logger}.captures.jsonl")


class CaptureList:
    """The captures of one logger. One user at a time in a process."""

    def __init__(self, folder: str, logger: str) -> None:
        self._folder, self._path = Path(folder), captures_path(folder, logger)
        self._entries: dict[_Key, CaptureEntry] = {}
        self._inode = self._read_to = 0
        self._tail = b""
        self._looked_at = MOST_BYTES  # bytes: below nobody looks what of it is gone

    def is_of(self, folder: str, logger: str) -> bool:
        """Whether it is the list of this logger in this folder."""
        return self._path == captures_path(folder, logger)

    def has_files(self, run: str, trigger: str, number: int) -> bool:
        """Whether a capture was written; False too where that can't be read."""
        with contextlib.suppress(OSError), self._locked() as descriptor:
            entry = self._read(descriptor).get((run, trigger, number))
            return entry is not None and bool(entry.files)
        return False

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
                _append(descriptor, msgspec.structs.replace(one, let_go=True))
                for file in one.files:
                    if own_status(file, self._folder) is not None:
                        _remove(self._folder / file.name)
                        removed.append(file.name)
            if os.fstat(descriptor).st_size > self._looked_at:
                self._shorten(descriptor, entries)
        return removed

    def _shorten(self, descriptor: int, entries: dict[_Key, CaptureEntry]) -> None:
        """Write the file anew where most of what it tells is gone."""
        # what was begun only may be under way: its name is all that keeps it from being written twice
        begun = [key for key, one in entries.items() if not one.files][-MOST_BEGUN:]
        there = [one for key, one in entries.items() if key in begun or self._is_there(one)]
        if len(there) < len(entries) / 2:
            # the same process, or another one, may be killed in the midst: then older lines stand below, of files
            # that are gone
            os.lseek(descriptor, 0, os.SEEK_SET)
            lines = b"".join(msgspec.json.encode(one) + b"\n" for one in there)
            append_all(descriptor, lines)
            os.ftruncate(descriptor, len(lines))
        self._looked_at = max(MOST_BYTES, os.fstat(descriptor).st_size * 5 // 4)  # thousands may be there for good

    def _read(self, descriptor: int) -> dict[_Key, CaptureEntry]:
        """All captures, oldest first; a damaged line is left out. What was read before is not read again."""
        status = os.fstat(descriptor)
        tail = os.pread(descriptor, len(self._tail), self._read_to - len(self._tail)) if self._read_to else b""
        if status.st_ino != self._inode or status.st_size < self._read_to or tail != self._tail:
            self._entries, self._inode, self._read_to = {}, status.st_ino, 0
        text = os.pread(descriptor, status.st_size - self._read_to, self._read_to)
        self._entries.update(_decoded(text))
        self._read_to = status.st_size
        begin = max(0, status.st_size - _TAIL)
        self._tail = os.pread(descriptor, status.st_size - begin, begin)
        return self._entries

    def _is_there(self, entry: CaptureEntry) -> bool:
        return any(own_status(file, self._folder) is not None for file in entry.files)

    @contextlib.contextmanager
    def _locked(self) -> Iterator[int]:
        with closing_file(open_own(self._path, os.O_RDWR | os.O_CREAT, 0o644)) as descriptor:
            lock(descriptor)
            yield descriptor


def _decoded(text: bytes) -> Iterator[tuple[_Key, CaptureEntry]]:
    """The captures of lines; a damaged line is left out."""
    for line in text.splitlines():
        with contextlib.suppress(msgspec.MsgspecError, UnicodeDecodeError):
            entry = _decode_capture(line)
            yield (entry.run, entry.trigger, entry.number), entry


def read_captures(folder: str | os.PathLike[str], logger: str) -> list[CaptureEntry]:
    """Return the captures of a logger as its list has them, without touching it. Raises OSError."""
    with contextlib.suppress(FileNotFoundError):
        return list(dict(_decoded(read_own(captures_path(folder, logger)))).values())
    return []


def _append(descriptor: int, entry: CaptureEntry) -> None:
    os.lseek(descriptor, 0, os.SEEK_END)
    append_all(descriptor, b"\n" + msgspec.json.encode(entry) + b"\n")  # a process may have been killed within a line


def _remove(path: Path) -> None:
    """Remove one saved log with what belongs to it."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
        return
    path.unlink(missing_ok=True)
    if path.suffix == ".csv":
        path.with_name(f"{path.name}.json").unlink(missing_ok=True)


# --------------------------------------------------------------------------------------------------- parts of recorders


class PartEntry(msgspec.Struct):
    """A part: its name when it is finished, its inode; size 0 while it is written. `run` is empty in older lists."""

    name: str
    inode: int
    size_bytes: int = 0
    run: str = ""


class RunEntry(msgspec.Struct, rename={"conditions": "extras"}):
    """A run: by ring, rows from `begin` to `end` were to be recorded as far as it was read, and `rows` of them were.

    `channels` are samples in a row, `dividers` ticks between rows. `deleted` are parts of it that a budget had no room
    for. `done`: nothing more comes of it; `gone` says why not all that there was did.
    `conditions` are what it was recorded with last, while it is not done.
    """

    run: str
    number: int = 0
    begin: dict[int, int] = {}
    end: dict[int, int] = {}
    rows: dict[int, int] = {}
    channels: dict[int, int] = {}
    parts: int = 0
    samples: int = 0
    size_bytes: int = 0
    done: bool = False
    gone: str = ""
    conditions: Conditions | None = None
    dividers: dict[int, int] = {}
    deleted: int = 0

    def lost(self, more: dict[int, int] | None = None, end: dict[int, int] | None = None) -> int:
        """Return how many samples are in no file; `more` are rows in parts that are open, with which it is at `end`."""
        more, end = more or {}, end or self.end
        return sum(
            many * max(0, end.get(ring, begin) - begin - self.rows.get(ring, 0) - more.get(ring, 0))
            for ring, many in self.channels.items()
            for begin in [self.begin.get(ring, 0)]
        )


class RecordedTotals(msgspec.Struct):
    """What became of an order: finished parts and their bytes, samples in them, samples that are in none.

    `gone` are runs of which an end is missing that nobody could count.
    """

    parts: int = 0
    samples: int = 0
    lost: int = 0
    size_bytes: int = 0
    gone: int = 0

    def add(self, run: RunEntry) -> None:
        """Take in a run."""
        self.parts += run.parts
        self.samples += run.samples
        self.lost += run.lost()
        self.size_bytes += run.size_bytes
        self.gone += bool(run.gone)

    @property
    def text(self) -> str:
        """All of it, fit to show."""
        more = f", and the end of {self.gone} runs" if self.gone > 1 else ", and the end of a run" if self.gone else ""
        size = f", {size_text(self.size_bytes)}" if self.size_bytes else ""
        counts = many(self.parts, "file"), many(self.samples, "sample"), f"{self.lost} lost"
        return f"{', '.join(counts)}{more}{size}"


class Written(msgspec.Struct):
    """What the file holds: parts oldest first, with which rows of which run to go on, and the runs of an order."""

    recorder: str
    run: str = ""
    next_rows: dict[int, int] = {}
    parts: list[PartEntry] = []
    order: str = ""
    runs: list[RunEntry] = []
    before: RecordedTotals = msgspec.field(default_factory=RecordedTotals)  # of the runs before these
    earlier: list[str] = []  # the parts that orders before this one left: they count into its budget, too
    orders: list[str] = []  # those before this one, oldest first

    def entry(self, run: str) -> RunEntry | None:
        """Return what there is of a run."""
        return next((one for one in self.runs if one.run == run), None)

    def sums(self) -> RecordedTotals:
        """Return what became of the order."""
        sums = msgspec.structs.replace(self.before)
        for run in self.runs:
            sums.add(run)
        return sums

    def fold(self) -> None:
        """Keep of the oldest runs no more than their sums."""
        while len(self.runs) > MOST_RUNS and self.runs[0].done:
            self.before.add(self.runs.pop(0))


def written_path(folder: Path, name: str) -> Path:
    """Return where a recorder of that name keeps its ledger."""
    return folder / f".{name}{WRITTEN_ENDING}"


decode_written = json_decoder(Written).decode


def read_written(folder: Path, name: str) -> Written | None:
    """Return the list of a recorder; None where there is none, or it is damaged."""
    try:
        return decode_written(read_own(written_path(folder, name)))
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError):
        return None


def size_of_parts(folder: Path, name: str) -> int:
    """Return the bytes of the finished parts that recordings of that name left in a folder."""
    written = read_written(folder, name)
    parts = written.parts if written is not None else []
    return sum(entry.size_bytes for entry in parts if own_status(entry, folder) is not None)


@dataclass(frozen=True)
class ClosedPart:
    """A part that was closed: where it stands now, empty if it held no sample and was removed."""

    path: Path
    size_bytes: int
    samples: int
    run: str
    recorder: str
    next_rows: dict[int, int]
    inode: int = 0
    rows: dict[int, int] = field(default_factory=dict)  # that it has, by ring

    @property
    def text(self) -> str:
        """What was done, fit to show."""
        if not self.size_bytes:
            return f"{self.path.name}: its recorder was killed before its first sample; removed"
        return f"{self.path}: closed, as its recorder was killed: {self.samples} samples, {size_text(self.size_bytes)}"


LookAtPart = Callable[[Path], ClosedPart | None]  # what a finished part holds, None where it can't be told


def part_path(folder: Path, name: str) -> Path:
    """Return where the part of this final name is while it is written."""
    return folder / (name.removesuffix(".mcap") + OPEN_PART_ENDING)


def number_of(path: Path) -> int:
    """Return the number of a part, by which they follow one another; 0 for a name that is no part's."""
    number = path.name.removesuffix(".part").removesuffix(".mcap").rpartition("_")[2]
    return int(number) if number.isdecimal() else 0


class Ledger:
    """The parts of one recorder. One user at a time: `close` lets go of the name."""

    def __init__(self, folder: Path, name: str, wait_s: float, parent: int) -> None:
        """Take the name; waits until a predecessor has finished. `parent` started this process. Raises SaveError."""
        self.folder, self.name = folder, name
        self.expected: dict[str, dict[int, int]] = {}  # rows of runs that parts seem to have which are not closed yet
        self._path, self._parent = written_path(folder, name), parent
        self._lock_path = folder / f".{name}.recorder.lock"
        self._lock = _locked(self._lock_path, wait_s, parent)
        self.written = self._read()

    def _read(self) -> Written:
        try:
            return decode_written(read_own(self._path))
        except FileNotFoundError:
            return Written(self.name)
        except (OSError, msgspec.MsgspecError, UnicodeDecodeError) as error:
            os.close(self._lock)
            raise SaveError(
                f"{self._path}: the list of this recorder's files is damaged ({error}); remove it, and the files in "
                f"{self.folder} stay until you delete them, or record under another name; nothing is recorded"
            ) from None

    def close(self) -> None:
        """Let go of the name."""
        os.close(self._lock)

    def take_again(self) -> None:
        """Have the name in a folder that was made anew, too. Raises SaveError where somebody took it there."""
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(self._lock), self._lock_path.stat(follow_symlinks=False)):
                return
        taken_anew = _locked(self._lock_path, 0.0, self._parent)
        os.close(self._lock)
        self._lock = taken_anew

    def _store(self) -> None:
        with atomic_file(self._path) as file:
            file.write(msgspec.json.encode(self.written))

    def open_parts(self) -> list[Path]:
        """Return where parts of this recorder are, or were, of whose end it knows nothing."""
        noted = {part_path(self.folder, entry.name) for entry in self.written.parts if not entry.size_bytes}
        return [*(noted | set(self.folder.glob(f"{glob.escape(self.name)}_*{OPEN_PART_ENDING}")))]

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
        written = self.written
        written.orders = [*written.orders, *filter(None, [written.order])][-MOST_ORDERS:]
        written.order, written.runs, written.before = order, [], RecordedTotals()
        written.run, written.next_rows = "", {}
        written.earlier = [entry.name for entry in written.parts]

    def rows_of(self, run: str) -> dict[int, int] | None:
        """Return with which rows to go on in a run; None where nothing is known of it."""
        if run and run == self.written.run:
            return self.written.next_rows
        entry = self.written.entry(run)
        return None if entry is None else {**entry.begin, **entry.end}

    def settle(self, closed: Sequence[ClosedPart], look: LookAtPart, open_part: str = "") -> None:
        """Take in what became of parts that a predecessor left: closed just now, by others, or gone.

        One that was killed right before it noted a part, or its end, leaves that to its successor, of whom `open_part`
        is. With which rows to go on stays as it is: that is told by what is newest. `look` into those that others
        closed.
        """
        names = {entry.name for entry in self.written.parts}
        ours = {part.path.name: part for part in closed if part.recorder == self.name and part.size_bytes}
        self.written.parts += [PartEntry(name, part.inode) for name, part in ours.items() if name not in names]
        for entry in self.written.parts:
            found = self._ours(entry)
            if found and not entry.size_bytes:
                entry.size_bytes = found
                part = ours.get(entry.name) or look(self.folder / entry.name)
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
        for ring, count in rows.items():
            entry.rows[ring] = entry.rows.get(ring, 0) + count
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
            known.channels, known.conditions, known.gone = entry.channels, entry.conditions, ""
            known.begin = {**entry.begin, **known.begin}  # of rings that came since, where they begin
        self.written.fold()
        self._store()

    def end_run(self, run: str, end: Mapping[int, int], *, done: bool, gone: str = "") -> None:
        """Note how far a run was read, or lost, and whether that is all of it. Raises SaveError."""
        entry = self.written.entry(run)
        if entry is not None:
            entry.end = dict(end) or entry.end
            entry.done, entry.gone = done, gone or entry.gone
            entry.conditions = None if done else entry.conditions
        self._store()

    def sums(
        self, run: str = "", rows: Mapping[int, int] | None = None, end: Mapping[int, int] | None = None
    ) -> RecordedTotals:
        """Return what became of the order; of `run` with `rows` more in a part that is open, read as far as `end`."""
        sums = self.written.sums()
        for one in self.written.runs:
            more = dict(self.expected.get(one.run, {}))
            if one.run == run:
                for ring, count in (rows or {}).items():
                    more[ring] = more.get(ring, 0) + count
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
            if own_status(oldest, self.folder) is not None:
                (self.folder / oldest.name).unlink(missing_ok=True)
                deleted.append(oldest.name)
                if (run := self.written.entry(oldest.run)) is not None:
                    run.deleted += 1
            self.written.parts.remove(oldest)
        if deleted:
            self._store()
        return deleted

    def _ours(self, entry: PartEntry) -> int:
        """The size of a finished part, 0 if another file stands there, or none."""
        found = own_status(entry, self.folder)
        return found.st_size if found is not None else 0


def name_in_use(folder: Path) -> SaveError:
    """Return that another recorder has the name in this folder."""
    return SaveError(
        f"another recorder writes to '{folder}' under this name: record under another name "
        "(--name) or to another folder (--to); nothing is recorded"
    )


def _locked(path: Path, wait_s: float, parent: int) -> int:
    """Open the file, which says who has the lock; one that was frozen, and whose parent died, gives it up."""
    until_s = time.monotonic() + wait_s
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    except OSError as error:
        raise SaveError(f"can't record to '{path.parent}': {reason(error)}; choose another folder") from error
    while not taken(descriptor):
        if time.monotonic() > until_s:
            os.close(descriptor)
            raise name_in_use(path.parent)
        end_abandoned_holder(descriptor)
        time.sleep(_RETRY_S)  # a lock gives no sign to those who want a time limit
    note_holder(descriptor, parent)
    return descriptor

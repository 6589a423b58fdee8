"""The recordings in the logger's own folder: listed, read in pieces, deleted on behalf of clients.

A client's name of a file is never more than a plain name below that folder, opened without following links, of a
format that silo saves, and recognised by what stands in it. Deleted is only what this logger wrote. Runs in the slow
thread, deleting in that of changes.
"""

import errno
import fcntl
import os
import secrets
import stat
import struct
import threading
import time
import zlib
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import msgspec

from silo.core.elements import FileType
from silo.core.names import grouped
from silo.core.quantities.writing import size_text
from silo.core.runtime import closing_file, disk_room
from silo.errors import reason
from silo.files.atomic import PART_ENDING
from silo.files.convert import CONVERTED
from silo.files.csv.metadata import SIDECAR
from silo.files.formats import SAVED
from silo.files.manifest import WRITTEN_ENDING, decode_written, own_status, written_path
from silo.files.naming import logger_of
from silo.files.summaries import FileSummary, opened_file, opened_folder, read_summary
from silo.recordings.fetching import mark_of, summed
from silo.recordings.requests import (
    GetPiece,
    PartOfRecording,
    Piece,
    RecordingFile,
    RecordingParts,
    Recordings,
    SavedRecording,
)
from silo.rpc.refusals import RefusedWhy, RequestRefusedError

RECORDED = ".mcap"
MOST_FOLDERS = 1000
_MOST_LIST_BYTES = 8 << 20
_MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _CHUNK_INDEX, _STATISTICS, _SUMMARY_OFFSET = 0x02, 0x08, 0x0B, 0x0E
_MOST_INDEXES_BYTES = 2**20  # of a part of many signals those of the first chunks
_FOOTER_BYTES = 9 + 20 + len(_MAGIC)
_MOST_OFFSETS_BYTES = 4096

MAX_LISTED = 10_000
MAX_VISITED = 100_000
MAX_PIECE = 4 << 20
MAX_OFFSET = 1 << 60
MAX_SUMMED = 64 << 20
READ_S = 1.0  # for which files are looked into per request; those that are left come with the next ones
ENDINGS = {ending: kind for kind, one in SAVED.items() for ending in one.endings}
LISTED = ", ".join(one.ending for one in SAVED.values())


@dataclass(frozen=True)
class FinishedPart:
    """A finished part: the folder that holds it, below the logger's own, and how it is there now."""

    folder: str
    name: str
    recorder: str
    about: os.stat_result

    @property
    def told(self) -> RecordingFile:
        """The file as a list of recordings has it."""
        return RecordingFile(self.name, FileType.BAG, self.about.st_size, self.about.st_mtime_ns, self.folder)

    @property
    def mark(self) -> str:
        """What tells this content from another one."""
        return mark_of([self.about])


def parts_below(place: int, only: str = "") -> Iterator[FinishedPart]:
    """Yield the finished parts in the folders right below an open one that recorders wrote into; `only`: of a name.

    Only folders that have a recorder's list of parts are looked into, and only files that such a list names.
    """
    with os.scandir(place) as entries:
        names = [entry.name for entry in islice(entries, 100 * MOST_FOLDERS)
                 if entry.is_dir(follow_symlinks=False) and not entry.name.startswith(".")]  # fmt: skip
    for name in names[:MOST_FOLDERS]:
        with suppress(OSError), opened_folder(place, name) as folder:  # it vanished, or may not be read
            yield from _parts_of(folder, name, only)


def part_named(place: int, name: str) -> FinishedPart | None:
    """Return the part of an endless recording that a plain name means, None where there is none."""
    return None if not name.endswith(RECORDED) or "/" in name else next(parts_below(place, name), None)


def _parts_of(folder: int, name: str, only: str) -> Iterator[FinishedPart]:
    # a part is called after its recorder, as a rule: the list of that one is looked into first
    likely = written_path(Path(), logger_of(only.removesuffix(RECORDED))).name
    lists = [each for each in os.listdir(folder) if each.endswith(WRITTEN_ENDING)]
    for each in sorted(lists, key=lambda each: each != likely):
        with suppress(OSError, msgspec.MsgspecError, UnicodeDecodeError), opened_file(folder, each) as file:
            written = decode_written(os.pread(file, _MOST_LIST_BYTES, 0))
            for entry in written.parts:
                if not entry.size_bytes or "/" in entry.name or not entry.name.endswith(RECORDED):
                    continue
                # one of thousands is asked for with every piece of it: the others are not looked at
                about = own_status(entry, folder) if only in ("", entry.name) else None
                if about is not None and stat.S_ISREG(about.st_mode):
                    yield FinishedPart(name, entry.name, written.recorder, about)


def part_summary(place: int, part: FinishedPart) -> FileSummary:
    """Return from when to when a part goes, of its last bytes; nothing of one that vanished, or may not be read."""
    with suppress(OSError), opened_folder(place, part.folder) as folder, opened_file(folder, part.name) as file:
        return FileSummary("", f"recording {part.recorder}", *_times(file, os.fstat(file).st_size))
    return FileSummary()


def _times(file: int, size: int) -> tuple[int, int]:
    """Return the times of the first and the last sample, by the indexes of an MCAP file; 0 where it has none."""
    footer = os.pread(file, _FOOTER_BYTES, max(0, size - _FOOTER_BYTES))
    if len(footer) < _FOOTER_BYTES or footer[0] != _FOOTER or not footer.endswith(_MAGIC):
        return 0, 0
    offsets_at = struct.unpack_from("<Q", footer, 17)[0]
    if not 0 < offsets_at < size:
        return 0, 0
    offsets = os.pread(file, min(_MOST_OFFSETS_BYTES, size - _FOOTER_BYTES - offsets_at), offsets_at)
    at, groups = 0, dict[int, tuple[int, int]]()
    while at + 26 <= len(offsets) and offsets[at] == _SUMMARY_OFFSET:
        group, *place = struct.unpack_from("<BQQ", offsets, at + 9)
        groups[group] = (place[0], place[1])
        at += 9 + struct.unpack_from("<Q", offsets, at + 1)[0]
    record = os.pread(file, 9 + 42, groups.get(_STATISTICS, (size, 0))[0])
    if len(record) != 9 + 42 or record[0] != _STATISTICS:
        return 0, 0
    channels, begin, end = struct.unpack_from("<10xI12xQQ", record, 9)
    indexes_at, length = groups.get(_CHUNK_INDEX, (size, 0))
    times = _sampled(os.pread(file, min(length, _MOST_INDEXES_BYTES), indexes_at), channels)
    if not times:
        return begin, end
    return min(times)[0], end if length > _MOST_INDEXES_BYTES else max(last for _, last in times)


def _sampled(indexes: bytes, events_channel: int) -> list[tuple[int, int]]:
    """Return the first and the last time of each chunk that has samples, of indexes of chunks.

    What happened, maybe at other times, is told by a channel of its own, the last one, in chunks of its own.
    """
    found, at = [], 0
    while at + 9 <= len(indexes) and indexes[at] == _CHUNK_INDEX:
        end = at + 9 + struct.unpack_from("<Q", indexes, at + 1)[0]
        if end > len(indexes):
            break
        begin_ns, end_ns, entries = struct.unpack_from("<QQ16xI", indexes, at + 9)
        if entries != 10 or struct.unpack_from("<H", indexes, at + 45)[0] != events_channel:
            found.append((begin_ns, end_ns))
        at = end
    return found


def row_of(part: FinishedPart, summary: FileSummary) -> SavedRecording:
    """Return a part as a row of the list. Never `own`: its recorder's budget deletes it, or somebody on the robot."""
    return SavedRecording(
        stem=f"{part.folder}/{part.name.removesuffix(RECORDED)}",
        files=[part.told],
        begun_ns=summary.begin_ns,
        span_s=(summary.end_ns - summary.begin_ns) / 1e9,
        why=summary.why,
    )


class RecordingFolder:
    """Remembers what stands in the files of one folder, as long as they don't change. Any thread may ask."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._known: OrderedDict[tuple[str, str], FileSummary | None] = OrderedDict()

    def listing(self, place: str, logger: str, most: int) -> Recordings:
        """Return what is there. Raises RequestRefusedError where it can't be read."""
        with _opened(place) as folder:
            found = _found(folder)
            stems = grouped((file.stem, file) for file in found)
            newest = sorted(stems.items(), key=lambda item: (max(file.changed_ns for file in item[1]), item[0]))[::-1]
            shown = newest[: max(0, min(most, MAX_LISTED))]
            until_s = time.monotonic() + READ_S
            looked = [self._recording(folder, logger, stem, files, until_s) for stem, files in shown]
            free, size = disk_room(folder)
            parts = list(parts_below(folder))
            recorded = [self._part_row(folder, part) for part in parts]
        rows = [row for row in looked if row is not None]
        # without those that turned out to be others' files
        count = len(newest) - (len(shown) - len(rows)) + len(recorded)
        rows += recorded
        rows = sorted(rows, key=_changed, reverse=True)[: max(0, min(most, MAX_LISTED))] if recorded else rows
        sizes = Counter[str]()
        for part in parts:
            sizes[f"{part.folder}/{part.recorder}"] += part.about.st_size
        return Recordings(place, rows, count, size, free, dict(sizes))

    def parts(self, place: str, name: str) -> RecordingParts:
        """Return the plain files of a recording. Raises RequestRefusedError."""
        with _opened(place) as folder, _told(name):
            if part := part_named(folder, name):
                return RecordingParts(
                    name, False, [PartOfRecording(part.name, part.about.st_size, part.mark, part.about.st_mtime_ns)]
                )
            self._recognised(folder, name)
            if _kind(name) is not FileType.BAG:
                names = [name, name + SIDECAR] if _kind(name) is FileType.CSV else [name]
                return RecordingParts(name, False, [_part(folder, each, each) for each in names])
            with opened_folder(folder, name) as bag:
                return RecordingParts(name, True, [_part(bag, each, f"{name}/{each}") for each in _inner(bag)])

    def piece(self, place: str, request: GetPiece) -> Piece:
        """Return a piece of a part. Raises RequestRefusedError."""
        limit = MAX_SUMMED if request.sum_only else MAX_PIECE
        if not 0 < request.count <= limit or not 0 <= request.offset <= MAX_OFFSET:
            text = f"a piece has 1 to {limit} bytes from 0 on, asked for are {request.count} from {request.offset} on"
            raise RequestRefusedError(RefusedWhy.INVALID, text)
        name, _, inner = request.path.partition("/")
        owner = name.removesuffix(SIDECAR) if not inner and name.endswith(f".csv{SIDECAR}") else name
        with _opened(place) as folder, _told(request.path):
            if part := part_named(folder, request.path):
                with opened_folder(folder, part.folder) as inside, opened_file(inside, part.name) as file:
                    return _piece(file, request)
            self._recognised(folder, owner)
            if not inner:
                with opened_file(folder, name) as file:
                    return _piece(file, request)
            _check_plain(inner)
            with opened_folder(folder, name) as bag, opened_file(bag, inner) as file:
                return _piece(file, request)

    def delete(self, place: str, logger: str, name: str) -> str:
        """Delete a recording, or nothing; return what was deleted, in words. Raises RequestRefusedError."""
        with _opened(place) as folder, _told(name):
            if part := part_named(folder, f"{name.rpartition('/')[2].removesuffix(RECORDED)}{RECORDED}"):
                text = (
                    f"{name} is not deleted: it is a part of recording '{part.recorder}', of which its budget deletes "
                    f"the oldest (`silo record --keep`); delete it in {place}/{part.folder} on the robot, if it may go"
                )
                raise RequestRefusedError(RefusedWhy.FORBIDDEN, text)
            _check_plain(name)
            names = [name]
            if _kind(name) is None:
                names = [file.name for file in _found(folder) if file.stem == name and not file.unfinished]
            if not names:
                raise RequestRefusedError(RefusedWhy.NOT_FOUND, f"there is no recording {name!r} in {place}")
            for each in names:
                self._check_own(folder, logger, each)
                _check_no_others(folder, each)
            size = sum(_delete(folder, each) for each in names)
        return f"deleted {', '.join(names)} ({size_text(size)})"

    # ------------------------------------------------------------------------------------------------- looking into

    def _recording(
        self, folder: int, logger: str, stem: str, files: "list[_File]", until_s: float
    ) -> SavedRecording | None:
        """Return a row of the list, None for files of others that only end as ours do."""
        kept: list[_File] = []
        summaries: list[FileSummary] = []
        unread = False
        for file in files:
            if file.unfinished:
                return SavedRecording(stem, [file.told], begun_ns=file.changed_ns, unfinished=True)
            try:
                summary = self._summary(folder, file.name, file.mark, until_s)
            except TimeoutError:
                unread = True
                kept.append(file)
                continue
            except (OSError, ValueError):
                continue  # it vanished, or may not be read
            if summary is not None:
                summaries.append(summary)
                kept.append(file)
        if not kept:
            return None
        told = [file.told for file in sorted(kept, key=lambda file: file.kind)]
        best = max(summaries, key=lambda one: (bool(one.logger), one.end_ns - one.begin_ns), default=FileSummary())
        return SavedRecording(
            stem=stem,
            files=told,
            begun_ns=best.begin_ns,
            span_s=(best.end_ns - best.begin_ns) / 1e9,
            markers=max((one.markers for one in summaries), default=0),
            why=best.why,
            logger=best.logger,
            own=bool(summaries) and not unread and all(not _foreign(stem, one, logger) for one in summaries),
            unread=unread,
        )

    def _part_row(self, folder: int, part: FinishedPart) -> SavedRecording:
        key = (f"{part.folder}/{part.name}", part.mark)
        return row_of(part, self._remembered(key, lambda: part_summary(folder, part)) or FileSummary())

    def _summary(self, folder: int, name: str, mark: str, until_s: float = 0.0) -> FileSummary | None:
        return self._remembered((name, mark), lambda: read_summary(folder, name), until_s)

    def _remembered(
        self, key: tuple[str, str], read: Callable[[], FileSummary | None], until_s: float = 0.0
    ) -> FileSummary | None:
        with self._lock:
            if key in self._known:
                self._known.move_to_end(key)
                return self._known[key]
        if until_s and time.monotonic() > until_s:
            raise TimeoutError
        summary = read()
        with self._lock:
            self._known[key] = summary
            if len(self._known) > 2 * MAX_LISTED:
                self._known.popitem(last=False)
        return summary

    def _recognised(self, folder: int, name: str) -> FileSummary:
        """Return what a recording says of itself. Raises RequestRefusedError for what is no recording."""
        _check_plain(name)
        if _kind(name) is None:
            text = f"{name} is no recording: those end in {LISTED}; nothing was read or changed"
            raise RequestRefusedError(RefusedWhy.INVALID, text)
        summary = self._summary(folder, name, _mark(folder, name))
        if summary is None:
            text = f"{name} was not written by silo, or its beginning is damaged; nothing was read or changed"
            raise RequestRefusedError(RefusedWhy.FORBIDDEN, text)
        return summary

    def _check_own(self, folder: int, logger: str, name: str) -> None:
        summary = self._recognised(folder, name)
        why = _foreign(_stem(name), summary, logger)
        if why:
            text = f"{name} is not deleted: {why}; delete it on the robot, if it may go"
            raise RequestRefusedError(RefusedWhy.FORBIDDEN, text)


@dataclass(frozen=True)
class _File:
    """A file or bag folder whose name ends as ours do, or a temporary one."""

    name: str
    kind: FileType
    size: int
    changed_ns: int
    mark: str
    unfinished: bool

    @property
    def stem(self) -> str:
        return self.name if self.unfinished else _stem(self.name)

    @property
    def told(self) -> RecordingFile:
        return RecordingFile(self.name, self.kind, self.size, self.changed_ns)


def _found(folder: int) -> list[_File]:
    found = []
    with os.scandir(folder) as entries:
        for entry in islice(entries, MAX_VISITED):
            with suppress(OSError):  # it vanished
                file = _looked_at(folder, entry)
                found += [file] if file else []
    return found


def _looked_at(folder: int, entry: "os.DirEntry[str]") -> _File | None:
    name = entry.name
    unfinished = name.startswith(".silo-") and name.endswith(PART_ENDING)
    kind = FileType.SILO if unfinished else _kind(name)
    if kind is None or (name.startswith(".") and not unfinished) or not name.isprintable():
        return None
    is_folder = entry.is_dir(follow_symlinks=False)
    if not is_folder and not entry.is_file(follow_symlinks=False):
        return None
    if not unfinished and is_folder != (kind is FileType.BAG):
        return None
    about = entry.stat(follow_symlinks=False)
    if not is_folder:
        return _File(name, kind, about.st_size, about.st_mtime_ns, mark_of([about]), unfinished)
    with opened_folder(folder, name) as inside:
        inner = [os.stat(each, dir_fd=inside, follow_symlinks=False) for each in _names(inside)]
    newest = max((each.st_mtime_ns for each in inner), default=about.st_mtime_ns)
    return _File(name, FileType.BAG, sum(each.st_size for each in inner), newest, mark_of(inner), unfinished)


def _changed(one: SavedRecording) -> tuple[int, str]:
    return max(file.changed_ns for file in one.files), one.stem


def _mark(folder: int, name: str) -> str:
    if _kind(name) is not FileType.BAG:
        return mark_of([os.stat(name, dir_fd=folder, follow_symlinks=False)])
    with opened_folder(folder, name) as bag:
        return mark_of([os.stat(each, dir_fd=bag, follow_symlinks=False) for each in _names(bag)])


def _foreign(stem: str, summary: FileSummary, logger: str) -> str:
    """Return why a recording is not surely one that this logger wrote, empty if it is."""
    if summary.logger != logger:
        return f"it is of the logger {summary.logger!r}, not of {logger!r}" if summary.logger else "it names no logger"
    if summary.why == CONVERTED:
        return "somebody converted it from another file"
    named = logger_of(stem)
    if named and named != logger:
        return f"its name is one of the logger {named!r}"
    if not named and not summary.why:
        return "neither its name nor what stands in it says that a logger saved it"
    return ""


def _kind(name: str) -> FileType | None:
    return next((kind for ending, kind in ENDINGS.items() if name.endswith(ending) and name != ending), None)


def _stem(name: str) -> str:
    return next((name.removesuffix(ending) for ending in ENDINGS if name.endswith(ending)), name)


# ------------------------------------------------------------------------------------------------ names and folders


def _check_plain(name: str) -> None:
    """Raise RequestRefusedError for what is no plain name of a file that isn't hidden."""
    if not name or "/" in name or name.startswith(".") or not name.isprintable() or len(os.fsencode(name)) > 255:
        text = f"{name[:80]!r} is not the name of a recording in the logger's folder; nothing was read or changed"
        raise RequestRefusedError(RefusedWhy.FORBIDDEN, text)


@contextmanager
def _opened(place: str) -> Iterator[int]:
    try:
        folder = os.open(place, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except FileNotFoundError:
        text = f"{place}: there is no such folder yet; the first save makes it"
        raise RequestRefusedError(RefusedWhy.NOT_FOUND, text) from None
    except OSError as error:
        text = f"{place}: can't be read: {reason(error)}"
        raise RequestRefusedError(RefusedWhy.FAILED, text) from error
    with closing_file(folder):
        yield folder


@contextmanager
def _told(name: str) -> Iterator[None]:
    """Have what the system refuses told in words."""
    try:
        yield
    except FileNotFoundError:
        text = f"there is no recording {name[:255]!r} in the logger's folder"
        raise RequestRefusedError(RefusedWhy.NOT_FOUND, text) from None
    except NotADirectoryError:
        text = f"{name[:255]!r} is not a bag: a link, or no folder; nothing was read or changed"
        raise RequestRefusedError(RefusedWhy.FORBIDDEN, text) from None
    except (OSError, ValueError) as error:
        link = isinstance(error, OSError) and error.errno == errno.ELOOP
        text = f"{name[:255]!r} is a link" if link else f"{name[:255]!r}: {error}"
        why = RefusedWhy.FORBIDDEN if link else RefusedWhy.FAILED
        raise RequestRefusedError(why, f"{text}; nothing was read or changed") from error


# --------------------------------------------------------------------------------------------- reading and deleting


def _names(folder: int) -> list[str]:
    return sorted(os.listdir(folder))  # of an open folder, which no path knows


def _inner(bag: int) -> list[str]:
    return [name for name in _names(bag) if name == "metadata.yaml" or name.endswith(".mcap")]


def _part(folder: int, name: str, path: str) -> PartOfRecording:
    with opened_file(folder, name) as file:
        about = os.fstat(file)
    return PartOfRecording(path, about.st_size, mark_of([about]), about.st_mtime_ns)


def _piece(file: int, request: GetPiece) -> Piece:
    if mark_of([os.fstat(file)]) != request.mark:
        text = f"{request.path} is not the file any more that it was: it was written anew; fetch it again"
        raise RequestRefusedError(RefusedWhy.CONFLICT, text)
    if not request.sum_only:
        data = os.pread(file, request.count, request.offset)
        return Piece(len(data), zlib.crc32(data), data)
    count = max(0, min(request.count, os.fstat(file).st_size - request.offset))
    return Piece(count, summed(file, request.offset, count))


def _check_no_others(folder: int, name: str) -> None:
    """Raise RequestRefusedError for a bag that holds what no logger writes."""
    if _kind(name) is not FileType.BAG:
        return
    with opened_folder(folder, name) as bag:
        others = sorted(set(_names(bag)) - set(_inner(bag)))
        if others:
            text = f"{name} is not deleted: it holds {others[0]!r}, which no logger writes; nothing was changed"
            raise RequestRefusedError(RefusedWhy.FORBIDDEN, text)


def _delete(folder: int, name: str) -> int:
    """Delete a file, or a bag with its folder; return its bytes. Raises OSError."""
    if _kind(name) is not FileType.BAG:
        size = os.stat(name, dir_fd=folder, follow_symlinks=False).st_size
        os.unlink(name, dir_fd=folder)
        if _kind(name) is FileType.CSV:
            size += os.stat(name + SIDECAR, dir_fd=folder, follow_symlinks=False).st_size
            os.unlink(name + SIDECAR, dir_fd=folder)
        return size
    with opened_folder(folder, name) as bag:
        inner = _inner(bag)
        # out of the way at once, and whole: should this process die now, the next sweep removes the rest
        fcntl.flock(bag, fcntl.LOCK_EX)
        gone = f".silo-{os.getpid()}-{secrets.token_hex(4)}{PART_ENDING}"
        os.rename(name, gone, src_dir_fd=folder, dst_dir_fd=folder)
        size = sum(os.stat(each, dir_fd=bag, follow_symlinks=False).st_size for each in inner)
        for each in inner:
            os.unlink(each, dir_fd=bag)
        os.rmdir(gone, dir_fd=folder)  # while it is locked still: else a sweep may be quicker
    return size

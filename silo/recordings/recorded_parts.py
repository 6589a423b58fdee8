"""Parts of endless recordings in folders below the logger's own, for the list of recordings. Read, never changed.

A part is known by its plain name, which carries its recorder, date and number; whoever asks for one gets it from the
folder that holds it. Only folders that a recorder wrote into (its list of parts lies there) are looked into, and only
files that such a list names.
"""

import os
import stat
import struct
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec

from silo.core.elements import FileType
from silo.files.manifest import WRITTEN_ENDING, decode_written, own_status, written_path
from silo.files.naming import logger_of
from silo.files.summaries import FileSummary, opened_file, opened_folder
from silo.recordings.fetching import mark_of
from silo.recordings.requests import RecordingFile, SavedRecording

ENDING = ".mcap"
MOST_FOLDERS = 1000
_MOST_LIST_BYTES = 8 << 20
_MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _STATISTICS, _SUMMARY_OFFSET = 0x02, 0x0B, 0x0E
_FOOTER_BYTES = 9 + 20 + len(_MAGIC)
_MOST_OFFSETS_BYTES = 4096


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
    """Yield the finished parts in the folders right below an open one that recorders wrote into; `only`: of a name."""
    with os.scandir(place) as entries:
        names = [entry.name for _, entry in zip(range(100 * MOST_FOLDERS), entries, strict=False)
                 if entry.is_dir(follow_symlinks=False) and not entry.name.startswith(".")]  # fmt: skip
    for name in names[:MOST_FOLDERS]:
        with suppress(OSError), opened_folder(place, name) as folder:  # it vanished, or may not be read
            yield from _parts_of(folder, name, only)


def part_named(place: int, name: str) -> FinishedPart | None:
    """Return the part of that plain name, None where there is none."""
    return next(parts_below(place, name), None)


def _parts_of(folder: int, name: str, only: str) -> Iterator[FinishedPart]:
    # a part is called after its recorder, as a rule: the list of that one is looked into first
    likely = written_path(Path(), logger_of(only.removesuffix(ENDING))).name
    lists = [each for each in os.listdir(folder) if each.endswith(WRITTEN_ENDING)]
    for each in sorted(lists, key=lambda each: each != likely):
        with suppress(OSError, msgspec.MsgspecError, UnicodeDecodeError), opened_file(folder, each) as file:
            written = decode_written(os.pread(file, _MOST_LIST_BYTES, 0))
            for entry in written.parts:
                if not entry.size_bytes or "/" in entry.name or not entry.name.endswith(ENDING):
                    continue
                # one of thousands is asked for with every piece of it: the others are not looked at
                about = own_status(entry, folder) if only in ("", entry.name) else None
                if about is not None and stat.S_ISREG(about.st_mode):
                    yield FinishedPart(name, entry.name, written.recorder, about)


def part_summary(place: int, part: FinishedPart) -> FileSummary:
    """Return from when to when a part goes, of its last bytes. Raises OSError."""
    with opened_folder(place, part.folder) as folder, opened_file(folder, part.name) as file:
        begin, end = _times(file, os.fstat(file).st_size)
    return FileSummary("", f"recording {part.recorder}", begin, end)


def _times(file: int, size: int) -> tuple[int, int]:
    """Return the times of the first and the last message, by the statistics of an MCAP file; 0 where it has none."""
    footer = os.pread(file, _FOOTER_BYTES, max(0, size - _FOOTER_BYTES))
    if len(footer) < _FOOTER_BYTES or footer[0] != _FOOTER or not footer.endswith(_MAGIC):
        return 0, 0
    offsets_at = struct.unpack_from("<Q", footer, 17)[0]
    if not 0 < offsets_at < size:
        return 0, 0
    offsets = os.pread(file, min(_MOST_OFFSETS_BYTES, size - _FOOTER_BYTES - offsets_at), offsets_at)
    at = 0
    while at + 26 <= len(offsets) and offsets[at] == _SUMMARY_OFFSET:
        group, start = struct.unpack_from("<BQ", offsets, at + 9)
        if group == _STATISTICS:
            record = os.pread(file, 9 + 42, start)
            if len(record) == 9 + 42 and record[0] == _STATISTICS:
                begin, end = struct.unpack_from("<QQ", record, 9 + 26)
                return begin, end
        at += 9 + struct.unpack_from("<Q", offsets, at + 1)[0]
    return 0, 0


def row_of(part: FinishedPart, summary: FileSummary) -> SavedRecording:
    """Return a part as a row of the list. Never `own`: its recorder's budget deletes it, or somebody on the robot."""
    return SavedRecording(
        stem=f"{part.folder}/{part.name.removesuffix(ENDING)}",
        files=[part.told],
        begun_ns=summary.begin_ns,
        span_s=(summary.end_ns - summary.begin_ns) / 1e9,
        why=summary.why,
    )

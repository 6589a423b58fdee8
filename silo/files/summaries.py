"""What a list of recordings shows of a file: which logger wrote it, why, from when to when. Read of its first bytes.

For the helper process, which reads thousands of them beside its work, on behalf of clients that may ask for any name:
files are opened by plain names below an open folder, no link is followed, and no format's reader is loaded.
"""

import json
import os
import re
import stat
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass

import msgspec

from silo.core.runtime import closing_file
from silo.decoding import json_decoder
from silo.files.csv.metadata import SIDECAR
from silo.files.silo import format as form

_FIRST = 64 << 10  # in it stand the facts of logs of up to about 1,000 entries
_MOST = 16 << 20  # and of 300,000
_BAG_FACTS = 16 << 10
_LOG_DECODER = json_decoder(form.LogFacts)
_TEXT = re.compile(rb"^    (silo_logger|silo_why|silo_markers): (\".*\")$", re.MULTILINE)
_BEGIN = re.compile(
    rb"^  starting_time:\n    nanoseconds_since_epoch: (\d{1,19})\n  duration:\n    nanoseconds: (\d{1,19})$", re.M
)
_CSV_FACTS_END = b',\n "elements":'


@dataclass(frozen=True)
class FileSummary:
    """What a file says of itself; `logger` is empty for one of the original, the times are 0 where it says none."""

    logger: str = ""
    why: str = ""
    begin_ns: int = 0
    end_ns: int = 0
    markers: int = 0


def read_summary(folder: int, name: str) -> FileSummary | None:
    """Return what a recording in an open folder says of itself, None if it is none that silo wrote.

    A CSV file is one by the file beside it. Raises OSError.
    """
    if name.endswith(".silo"):
        return _of_silo(folder, name)
    if name.endswith(".csv"):
        return _of_csv(folder, name)
    return _of_bag(folder, name)


@contextmanager
def opened_file(folder: int, name: str) -> Iterator[int]:
    """Open a regular file in an open folder for reading; a link or a pipe is refused as OSError."""
    flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC  # else a named pipe would be waited for
    with closing_file(os.open(name, flags, dir_fd=folder)) as descriptor:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise FileNotFoundError(f"{name} is not a file")
        yield descriptor


def opened_folder(folder: int, name: str) -> AbstractContextManager[int]:
    """Open a folder in an open folder; a link is refused as OSError."""
    return closing_file(os.open(name, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC, dir_fd=folder))


def _of_silo(folder: int, name: str) -> FileSummary | None:
    with opened_file(folder, name) as file:
        text = os.pread(file, _FIRST, 0)
        if not text.startswith(form.BANNER):
            return None
        mark = b"\n" + form.LOG_FACTS
        while (begin := text.find(mark)) < 0 or text.find(b"\n", begin + 1) < 0:
            if b"\n" + form.DATA_LINE in text or len(text) >= _MOST:
                return FileSummary()  # of the original, which says no more
            more = os.pread(file, 3 * len(text), len(text))
            if not more:
                return FileSummary()
            text += more
    return _of_facts(text[begin + len(mark) : text.find(b"\n", begin + 1)])


def _of_csv(folder: int, name: str) -> FileSummary | None:
    try:
        with opened_file(folder, name + SIDECAR) as file, opened_file(folder, name):
            text = os.pread(file, _FIRST, 0)
            if _CSV_FACTS_END not in text:  # of a log with many derived signals, limits and triggers
                text = os.pread(file, _MOST, 0)
    except FileNotFoundError:
        return None
    # {"version": 1, "log": {...}, "elements": [...]}; within a text a line break is escaped
    begin, end = text.find(b'"log": '), text.find(_CSV_FACTS_END)
    return _of_facts(text[begin + len(b'"log": ') : end]) if 0 <= begin < end else None


def _of_facts(text: bytes) -> FileSummary | None:
    try:
        facts = _LOG_DECODER.decode(text)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return None
    return FileSummary(facts.logger, facts.why, *facts.span, facts.markers)


def _of_bag(folder: int, name: str) -> FileSummary | None:
    with opened_folder(folder, name) as bag, opened_file(bag, "metadata.yaml") as file:
        head = os.pread(file, _BAG_FACTS, 0)
        tail = os.pread(file, _BAG_FACTS, max(0, os.fstat(file).st_size - _BAG_FACTS))
    said: dict[str, str] = {}
    for key, value in _TEXT.findall(tail):
        with suppress(ValueError):
            said[key.decode()] = json.loads(value)
    begin = _BEGIN.search(head)
    if "silo_logger" not in said or begin is None:
        return None  # of other tools
    first = int(begin[1])
    markers = said.get("silo_markers", "0")
    return FileSummary(
        said["silo_logger"],
        said.get("silo_why", ""),
        first,
        first + int(begin[2]),
        int(markers) if markers.isascii() and markers.isdecimal() and len(markers) < 10 else 0,
    )

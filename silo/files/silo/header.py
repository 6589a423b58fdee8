"""The text header of a `.silo` file -> the lines of its table, facts, and where the data starts.

Damaged headers are read, too: each part is found by its landmark, else by its place; what can't be understood becomes a
warning. Only a file in which no table can be found is an error. A header without a warning is as silo wrote it, or of
the original.
"""

import mmap
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import msgspec

from silo.core.elements import LoggedEvent
from silo.decoding import json_decoder
from silo.errors import FileFormatError
from silo.files.silo import format as form

# A table of 100,000 entries with facts is 20 MB; a longer header is no header.
_LONGEST_HEADER = 256 << 20
_FIRST_LINE_BYTES = 1 << 20  # far more than the longest line
_DATA = re.compile(rb"^# Binary(?: Data)?[ ]*\r?\n", re.MULTILINE)
_PLACES = {form.OFFSET_LINE: 5, form.COUNT_LINE: 7, form.TABLE_LINE: 9}
_LOG_DECODER = json_decoder(list[form.LogFacts])
_EVENTS_DECODER = json_decoder(list[LoggedEvent])
_ELEMENTS_DECODER = json_decoder(list[form.ElementFacts])


@dataclass
class Header:
    """What the header says. A line of the table that can't be understood is None, as is an offset.

    `sums` are the checksums of the values of each line of the table, as text; empty in files that have none.
    """

    offset: int | None
    names: list[str]
    lines: list[form.TableLine | None]
    facts: form.LogFacts | None = None
    elements: list[form.ElementFacts] = field(default_factory=list)
    events: list[LoggedEvent] = field(default_factory=list)
    data_start: int = 0
    warnings: list[str] = field(default_factory=list)
    sums: bytes = b""


def parse_header(data: mmap.mmap) -> Header:
    """Read the header of a file. Raises `FileFormatError` (without the path) if it is none, or its table is lost."""
    # a disk's worth of zeros has no line anywhere: the search for the end of a header would take seconds in it
    if data.find(b"\n", 0, _FIRST_LINE_BYTES) < 0:
        raise FileFormatError("this is no .silo file: it has no header")
    # searched in the memory map: copying the start of a file whose header is long would take longer than all the rest
    begin = data.find(b"\n" + form.DATA_LINE, 0, _LONGEST_HEADER)
    end = begin + 1 + len(form.DATA_LINE) if begin >= 0 else None
    if end is None and (last := _DATA.search(memoryview(data)[:_LONGEST_HEADER])):
        begin, end = last.start() - 1, last.end()
    text = data[: end or _LONGEST_HEADER]
    if not any(mark in text for mark in (b"# ", b" double", b" int64")):
        raise FileFormatError("this is no .silo file: it has no header")
    # the end of the line of the checksum is the end of a header without a line that says so
    check = text.rfind(b"\n" + form.CHECK) + 1
    behind_check = (text.find(b"\n", check) + 1 if check else 0) or None
    head = text[: begin + 1] if end else text[:behind_check]
    table, mark, facts = head.partition(b"\n# silo ")
    warnings: list[str] = []
    lines = (table + mark[:1]).decode("utf-8", "backslashreplace").split("\n")
    offset = _number(lines, form.OFFSET_LINE, "the time synchronization offset", warnings)
    count = _number(lines, form.COUNT_LINE, "the number of log elements", warnings)
    names, found = _table(lines, count, warnings)
    header = Header(
        offset,
        names,
        found,
        next(iter(_decoded(mark + facts, form.LOG_FACTS, _LOG_DECODER, warnings)), None),
        _decoded(mark + facts, form.ELEMENT_FACTS, _ELEMENTS_DECODER, warnings),
        _decoded(mark + facts, form.EVENT_FACTS, _EVENTS_DECODER, warnings),
        warnings=warnings,
        sums=(mark + facts).rpartition(b"\n" + form.SUMS)[2].partition(b"\n")[0],
    )
    if behind_check is not None:
        _verify(header, text[: end or behind_check], check, behind_check)
    elif header.facts or header.elements or mark:
        warnings.append("the header is damaged: its checksum is missing")
    if end is None and behind_check is not None:
        end = behind_check + len(form.DATA_LINE)
    header.data_start = _start_at_the_end(header, data) if end is None else end
    return header


def _start_at_the_end(header: Header, data: mmap.mmap) -> int:
    """The data of a whole file is what stands at its end: behind the damaged line, else it is text of a cut header."""
    start = max(len(data) - sum(line.size_bytes for line in header.lines if line), 0)
    line = data[max(start - len(form.DATA_LINE), 0) : start]
    alike = sum(one == other for one, other in zip(line, form.DATA_LINE, strict=False))
    if None in header.lines or 2 * alike < len(form.DATA_LINE):
        raise FileFormatError("it ends in its header, or the line '# Binary Data' is damaged: no values can be read")
    header.warnings.append("the line '# Binary Data' is damaged: the values were taken from the end of the file")
    return start


def _number(lines: Sequence[str], landmark: bytes, what: str, warnings: list[str]) -> int | None:
    place = _place(lines, landmark)
    text = lines[place].strip() if place < len(lines) else ""
    if re.fullmatch("[0-9]{1,18}", text):
        return int(text)
    warnings.append(f"line {place + 1}: {what} can't be read ('{text[:40]}')")
    return None


def _place(lines: Sequence[str], landmark: bytes) -> int:
    """Index of the first line after a landmark that is no comment."""
    start = landmark.decode().rstrip().rstrip(":")
    for index, line in enumerate(lines):
        if line.startswith(start):
            place = index + 1
            while place < len(lines) and lines[place].startswith("#") and not _is_row(lines[place]):
                place += 1
            return place
    return _PLACES[landmark]


def _is_row(line: str) -> bool:
    try:
        form.parse_line(line[len(line.rsplit(" ", 5)[0]) :])
    except ValueError:
        return False
    return True


def _table(
    lines: Sequence[str], count: int | None, warnings: list[str]
) -> tuple[list[str], list[form.TableLine | None]]:
    """The names in the table, and what it says behind them, mostly the same of many."""
    names: list[str] = []
    found: list[form.TableLine | None] = []
    known: dict[str, form.TableLine] = {}
    start = _place(lines, form.TABLE_LINE)
    for number, line in enumerate(lines[start:-1], start + 1):
        # a name may start with '#' in a foreign file, so within `count` lines only our own comments end the table
        if line[:1] == "#" and (count is None or len(names) >= count):
            break
        name = line.rsplit(" ", 5)[0]  # it may hold spaces
        rest = line[len(name) :]
        parsed = known.get(rest)
        if parsed is None:
            try:
                parsed = known[rest] = form.parse_line(rest)
            except ValueError as error:
                warnings.append(f"line {number}, of the table, can't be read ({error}): '{line[:80]}'")
        names.append(name)
        found.append(parsed)
    if not any(found):
        raise FileFormatError("this is no .silo file, or its table of elements is lost")
    if count is not None and count != len(names):
        warnings.append(f"the header announces {count} entries, its table has {len(names)}")
    return names, found


def _decoded(lines: bytes, start: bytes, decoder: msgspec.json.Decoder[Any], warnings: list[str]) -> list[Any]:
    """The facts in lines that start so, by one call; where a line is damaged, those of all others."""
    texts = [text.partition(b"\n")[0] for text in lines.split(b"\n" + start)[1:]]
    try:
        return list(decoder.decode(b"[" + b",".join(texts) + b"]"))
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        if len(texts) > 1:
            return [one for text in texts for one in _decoded(b"\n" + start + text, start, decoder, warnings)]
        warnings.append(f"a comment with facts about the elements can't be read ({error})")
        return []


def _verify(header: Header, text: bytes, check: int, behind_check: int) -> None:
    """Compare the checksum of a header that silo wrote; files of the original have none."""
    exact = form.CHECK_PATTERN.fullmatch(text, check, behind_check)
    rest = text[behind_check:]
    if not rest.endswith(form.DATA_LINE):
        rest += form.DATA_LINE
        header.warnings.append("the header is damaged: its last line is not '# Binary Data'")
    if exact is None or exact[1] != b"%08x" % zlib.crc32(rest, zlib.crc32(memoryview(text)[:check])):
        header.warnings.append(
            "the header is damaged: its checksum does not match; names, types or positions of values may be wrong"
        )

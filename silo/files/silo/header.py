"""The text header of a `.silo` file -> table lines, facts, and where the data starts.

Written for damaged files: each part is found by its landmark, else by its place; what can't be understood becomes a
warning. Only a file in which no table can be found is an error.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import msgspec

from silo.core.elements import LoggedEvent
from silo.errors import FileFormatError
from silo.files.silo import format as form

# A table of 100,000 entries with facts is 20 MB; a longer header is no header.
_LONGEST_HEADER = 256 << 20
_DATA = re.compile(rb"^# Binary(?: Data)?[ ]*\r?\n", re.MULTILINE)
_CHECK = re.compile(rb"^# silo check [^\n]*\n", re.MULTILINE)
_PLACES = {form.OFFSET_LINE: 5, form.COUNT_LINE: 7, form.TABLE_LINE: 9}

_Facts = TypeVar("_Facts", form.LogFacts, form.ElementFacts, LoggedEvent)
_LOG_DECODER = msgspec.json.Decoder(form.LogFacts)
_EVENT_DECODER = msgspec.json.Decoder(LoggedEvent)
_ELEMENT_DECODER = msgspec.json.Decoder(form.ElementFacts)


@dataclass
class Header:
    """What the header says. A table line that can't be understood is None in `rows`; `offset` is None if unreadable."""

    offset: int | None
    rows: list[form.TableRow | None]
    data_start: int
    facts: form.LogFacts | None = None
    elements: list[form.ElementFacts] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    events: list[LoggedEvent] = field(default_factory=list)


def parse_header(data: bytes | memoryview, size: int) -> Header:
    """Read the header of a file of `size` bytes; `data` is the file, or its start if longer than any header.

    Raises `FileFormatError` (without the path) if this is no `.silo` file or its table is lost.
    """
    # searched in the memory map: copying the start of a file whose header is long would take longer than all the rest
    found = _DATA.search(data[:_LONGEST_HEADER])
    text = bytes(data[: found.end() if found else _LONGEST_HEADER])
    if b"\n" not in text or not any(mark in text for mark in (b"# ", b" double", b" int64")):
        raise FileFormatError("this is no .silo file: it has no header")
    warnings: list[str] = []
    if found is None:
        end = _end_of_check_line(text)
        head, data_start = text[: end or len(text)], end
    else:
        head, data_start = text[: found.start()], found.end()
    lines = head.split(b"\n")
    offset = _number(lines, form.OFFSET_LINE, "the time synchronization offset", warnings)
    count = _number(lines, form.COUNT_LINE, "the number of log elements", warnings)
    rows, after = _table(lines, count, warnings)
    header = Header(offset, rows, 0, warnings=warnings)
    _read_facts(header, lines[after:])
    _verify(header, text[: data_start or len(text)])
    if data_start is not None and found is None:
        data_start += len(form.DATA_LINE)
    header.data_start = _start_of_data(header, data_start, size)
    return header


def _end_of_check_line(text: bytes) -> int | None:
    found = _CHECK.search(text)
    return found.end() if found else None


def _start_of_data(header: Header, known: int | None, size: int) -> int:
    if known is not None:
        return known
    # without any landmark, the data of a whole file is what stands at its end
    start = size - sum(row.size_bytes for row in header.rows if row)
    if None in header.rows or start <= 0:
        raise FileFormatError("it ends in its header, or the line '# Binary Data' is damaged: no values can be read")
    header.warnings.append("the line '# Binary Data' is damaged: the values were taken from the end of the file")
    return start


def _number(lines: Sequence[bytes], landmark: bytes, what: str, warnings: list[str]) -> int | None:
    place = _place(lines, landmark)
    text = lines[place].strip() if place < len(lines) else b""
    if re.fullmatch(rb"[0-9]{1,18}", text):
        return int(text)
    warnings.append(f"line {place + 1}: {what} can't be read ('{form.decode_text(text[:40])}')")
    return None


def _place(lines: Sequence[bytes], landmark: bytes) -> int:
    """Index of the first line after a landmark that is no comment."""
    start = landmark.rstrip().rstrip(b":")
    for index, line in enumerate(lines):
        if line.startswith(start):
            place = index + 1
            while place < len(lines) and lines[place].startswith(b"#") and not _is_row(lines[place]):
                place += 1
            return place
    return _PLACES[landmark]


def _is_row(line: bytes) -> bool:
    try:
        form.parse_row(line)
    except ValueError:
        return False
    return True


def _table(lines: Sequence[bytes], count: int | None, warnings: list[str]) -> tuple[list[form.TableRow | None], int]:
    """The table's rows, and the index of the line after the table."""
    start = _place(lines, form.TABLE_LINE)
    rows: list[form.TableRow | None] = []
    index = start
    while index < len(lines) - 1:
        line = lines[index]
        complete = count is not None and len(rows) >= count
        # a name may start with '#' in a foreign file, so within `count` lines only our own comments end the table
        if line.startswith(b"# silo ") or (line.startswith(b"#") and (complete or count is None)):
            break
        try:
            rows.append(form.parse_row(line))
        except ValueError as error:
            warnings.append(f"line {index + 1} of the table can't be read ({error}): '{form.decode_text(line[:80])}'")
            rows.append(None)
        index += 1
    if not any(rows):
        raise FileFormatError("this is no .silo file, or its table of elements is lost")
    if count is not None and count != len(rows):
        warnings.append(f"the header announces {count} entries, its table has {len(rows)}")
    return rows, index


def _read_facts(header: Header, lines: Sequence[bytes]) -> None:
    for line in lines:
        if line.startswith(form.LOG_FACTS):
            header.facts = _decoded(line[len(form.LOG_FACTS) :], _LOG_DECODER, header) or header.facts
        elif line.startswith(form.ELEMENT_FACTS):
            element = _decoded(line[len(form.ELEMENT_FACTS) :], _ELEMENT_DECODER, header)
            header.elements += [element] if element else []
        elif line.startswith(form.EVENT_FACTS):
            event = _decoded(line[len(form.EVENT_FACTS) :], _EVENT_DECODER, header)
            header.events += [event] if event else []


def _decoded(text: bytes, decoder: msgspec.json.Decoder[_Facts], header: Header) -> _Facts | None:
    try:
        return decoder.decode(text)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        header.warnings.append(f"a comment with facts about the elements can't be read ({error})")
        return None


def _verify(header: Header, text: bytes) -> None:
    """Compare the checksum of a header that silo wrote; files of the original have none."""
    found = _CHECK.search(text)
    if found is None:
        if header.facts or header.elements or b"\n# silo " in text:
            header.warnings.append("the header is damaged: its checksum is missing")
        return
    exact = form.CHECK_PATTERN.fullmatch(found[0])
    rest = text[: found.start()] + text[found.end() :]
    if not rest.endswith(form.DATA_LINE):
        rest += form.DATA_LINE
        header.warnings.append("the header is damaged: its last line is not '# Binary Data'")
    if exact is None or exact[1] != form.checksum(rest):
        header.warnings.append(
            "the header is damaged: its checksum does not match; names, types or positions of values may be wrong"
        )

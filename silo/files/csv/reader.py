"""CSV -> a recording: both layouts that we write, the original's rows, and tables that other tools wrote.

CSV says neither types, units nor dividers: `<name>.csv.json` beside it does, where silo wrote both. Else types follow
from the texts (quoted: string), the divider of an entry from the ticks at which its cells are filled, and vectors are
put together again by their suffixes.
"""

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import BufferType, Entry
from silo.core.kinds import regroup
from silo.core.recording import RecordedElement, RecordedEntry, Recording, masked
from silo.errors import FileFormatError, LogNotFoundError
from silo.files.atomic import reason
from silo.files.csv.metadata import Column, NotThisTableError, restored, sidecar_of, types_of, unpack
from silo.files.csv.numbers import Filled, NumberTable, read_numbers
from silo.files.silo.format import decode_text, first_stamp

TIME_NS = "time_ns"  # the last column: the first one in whole nanoseconds
_ROUNDED_NS = 1000  # by which seconds that went through a double may be off
_SECOND = 1_000_000_000
_MOST_NS = 2**63
_LINES_AT_ONCE = 4096
_CELL = re.compile(rb'(?:"((?:[^"]|"")*)"[^,]*|([^,]*))(?:,|$)')
_DECIMAL = re.compile(rb"([+-]?)(\d+)(?:\.(\d*))?")
_MOST_OFFSETS = 1_000_000
# A quoted cell keeps its first quote: so an empty string is not an empty cell.
_QUOTE = b'"'


class _Samples(NamedTuple):
    """What a column holds: sample i at time stamp `first + i * divider`."""

    values: NDArray[Any]
    first: int
    divider: int


def read_csv(path: str | os.PathLike[str]) -> Recording:
    """Read a CSV file, of one column per entry (first column: time in seconds) or one row per entry.

    What can't be understood is left out, with a warning of the recording. Raises `LogNotFoundError` if the file can't
    be opened, `FileFormatError` if it is empty or its first column (or rows) holds no time.
    """
    try:
        data = Path(path).read_bytes()
    except FileNotFoundError as error:
        raise LogNotFoundError(f"there is no file '{os.fspath(path)}'") from error
    except OSError as error:
        raise LogNotFoundError(f"can't open '{os.fspath(path)}': {reason(error)}") from error
    try:
        return _parsed(data, Path(path))
    except FileFormatError as error:
        raise FileFormatError(f"'{os.fspath(path)}' can't be read as a log: {error}") from None


def _parsed(data: bytes, path: Path) -> Recording:
    warnings: list[str] = []
    facts = _facts_beside(path)
    columns: Sequence[Column]
    plain = _plain_table(data, facts)
    if plain is not None:
        head, numbers = plain
        time_ns = _time(_text(head[0]), numbers.first)
        names, columns, time_ns = _counted([_text(cell) for cell in head[1:]], numbers.columns, time_ns)
        return _as_recording(path, "/log", names, columns, time_ns, facts, warnings)
    records = _records(data)
    head = next(records, [])
    if not head:
        raise FileFormatError("it is empty")
    if _text(head[0]).endswith("time_s") and len(head) > 1 and re.fullmatch(rb"-?\d*", head[1]):
        names, columns, time_ns = _from_rows(head, records, warnings)
        prefix = _text(head[0]).removesuffix("time_s").removesuffix("/")
    else:
        names, columns, time_ns = _counted(*_from_columns(head, records, warnings))
        prefix = "/log"
    return _as_recording(path, prefix, names, columns, time_ns, facts, warnings)


def _plain_table(data: bytes, facts: bytes | None) -> tuple[list[bytes], NumberTable] | None:
    """The first record and the numbers of a plain table of columns; None for any other."""
    line = data[: data.find(b"\n") + 1].rstrip(b"\r\n")
    head = _split(line) if line.count(_QUOTE) % 2 == 0 and line else []
    if len(head) < 2 or _text(head[0]).endswith("time_s"):
        return None
    types = None
    if facts is not None:
        try:
            types = types_of(unpack(facts))
            if types is not None and _text(head[-1]) == TIME_NS:
                types = [*types, np.dtype(np.int64)]
        except NotThisTableError:
            return None
    numbers = read_numbers(data, len(head), types)
    return None if numbers is None else (head, numbers)


def _counted(
    names: list[str], columns: Sequence[Column], time_ns: NDArray[np.int64]
) -> tuple[list[str], Sequence[Column], NDArray[np.int64]]:
    """The columns of signals, and the stamps by that of nanoseconds, where it agrees with the first one."""
    if not names or names[-1] != TIME_NS:
        return names, columns, time_ns
    cells = columns[-1]
    counted = cells.values if isinstance(cells, Filled) else _numbers(cells)
    fits = counted is not None and counted.dtype == np.int64 and len(counted) == len(time_ns)
    if counted is None or not fits or (np.abs(counted - time_ns) > _ROUNDED_NS).any():
        return names[:-1], columns[:-1], time_ns  # somebody edited the seconds, or the file was cut there
    return names[:-1], columns[:-1], counted


def _as_recording(
    path: Path,
    prefix: str,
    names: Sequence[str],
    columns: Sequence[Column],
    time_ns: NDArray[np.int64],
    facts: bytes | None,
    warnings: list[str],
) -> Recording:
    if facts is not None:
        try:
            recording = restored(unpack(facts), names, columns, time_ns)
            return replace(recording, warnings=(*recording.warnings, *warnings))
        except NotThisTableError as error:
            warnings.append(
                f"'{sidecar_of(path.name)}' is not of this table ({error}): "
                "units, labels, types and buffers of the log are not known"
            )
    return _recording(path.stem, prefix, time_ns, names, columns, warnings)


def _facts_beside(path: Path) -> bytes | None:
    try:
        return sidecar_of(path).read_bytes()
    except OSError:
        return None


# ---------------------------------------------------------------------------------------------------- text to columns


def _records(data: bytes) -> Iterator[list[bytes]]:
    """The cells of each line; a quoted cell may hold line breaks."""
    pending: list[bytes] = []
    for line in data.removeprefix(b"\xef\xbb\xbf").split(b"\n"):
        if pending or line.count(_QUOTE) % 2:
            pending.append(line)
            if len(pending) > 1 and line.count(_QUOTE) % 2:
                yield _split(b"\n".join(pending))
                pending = []
        elif line.strip():
            yield _split(line)
    if pending:
        yield _split(b"\n".join(pending))


def _split(record: bytes) -> list[bytes]:
    record = record.removesuffix(b"\r")
    if _QUOTE not in record:
        return record.split(b",")
    cells: list[bytes] = []
    position = 0
    while position <= len(record):
        match = _CELL.match(record, position)
        if match is None:
            # an opening quote without its end: the file was cut here
            cells.append(record[position:])
            break
        quoted = match[1]
        cells.append(match[2] if quoted is None else _QUOTE + quoted.replace(b'""', _QUOTE))
        if not match[0].endswith(b","):
            break
        position = match.end()
    return cells


def _text(cell: bytes) -> str:
    return decode_text(cell.removeprefix(_QUOTE))


def _from_columns(
    head: list[bytes], records: Iterator[list[bytes]], warnings: list[str]
) -> tuple[list[str], list[NDArray[np.bytes_]], NDArray[np.int64]]:
    width = len(head)
    chunks: list[list[NDArray[np.bytes_]]] = [[] for _ in head]
    block: list[list[bytes]] = []
    for number, cells in enumerate(records, start=2):
        if len(cells) != width:
            warnings.append(f"record {number} has {len(cells)} cells where the header has {width}; it is left out")
            continue
        block.append(cells)
        if len(block) == _LINES_AT_ONCE:
            _append(chunks, block)
            block = []
    _append(chunks, block)
    columns = [np.concatenate(column) if column else np.empty(0, "S1") for column in chunks]
    return [_text(cell) for cell in head[1:]], columns[1:], _time(_text(head[0]), columns[0])


def _append(chunks: list[list[NDArray[np.bytes_]]], block: list[list[bytes]]) -> None:
    for column, cells in zip(chunks, zip(*block, strict=True), strict=False):
        column.append(np.array(cells, "S"))


def _from_rows(
    head: list[bytes], records: Iterator[list[bytes]], warnings: list[str]
) -> tuple[list[str], list[NDArray[np.bytes_]], NDArray[np.int64]]:
    second = next(records, [b""])
    if not _text(second[0]).endswith("time_ns"):
        raise FileFormatError("after the row 'time_s' comes no row 'time_ns'")
    seconds, nanoseconds = _numbers(_cells_of(head)), _numbers(_cells_of(second))
    if seconds is None or nanoseconds is None or "f" in seconds.dtype.kind + nanoseconds.dtype.kind:
        raise FileFormatError("the rows 'time_s' and 'time_ns' must hold whole numbers")
    stamps = min(len(seconds), len(nanoseconds))
    pairs = zip(seconds[:stamps].tolist(), nanoseconds[:stamps].tolist(), strict=True)
    time_ns = _stamps([second * _SECOND + nanosecond for second, nanosecond in pairs])
    names: list[str] = []
    columns: list[NDArray[np.bytes_]] = []
    for number, record in enumerate(records, start=3):
        cells = _cells_of(record)
        if len(cells) > stamps:
            warnings.append(f"row {number} has {len(cells)} cells for {stamps} ticks; it is left out")
            continue
        names.append(_text(record[0]))
        columns.append(np.array([*cells, *[b""] * (stamps - len(cells))], "S"))
    return names, columns, time_ns


def _cells_of(row: list[bytes]) -> list[bytes]:
    """The cells behind the name; each is followed by a comma, so that the last one is empty."""
    return row[1:-1] if len(row) > 1 and not row[-1] else row[1:]


# --------------------------------------------------------------------------------------------------- columns to values


def _time(name: str, cells: NDArray[np.bytes_]) -> NDArray[np.int64]:
    """Nanoseconds of a time column: exact for decimal texts; dates and counts of ns (`..._ns`) are understood, too."""
    texts: list[bytes] = np.char.lstrip(cells, _QUOTE).tolist()
    if name.endswith("_ns"):
        whole = _numbers(texts)
        if whole is not None and whole.dtype == np.int64:
            return whole
    matches = [_DECIMAL.fullmatch(text) for text in texts]
    if all(matches):
        return _stamps([_nanoseconds(match) for match in matches if match])
    numbers = _numbers(texts)
    if numbers is not None:
        scaled = np.round(numbers.astype(np.float64) * 1e9)
        if not (np.abs(scaled) < _MOST_NS).all():
            raise FileFormatError("a time stamp is out of range: nanoseconds must fit 63 bits, the years 1678 to 2262")
        return scaled.astype(np.int64)
    try:
        return np.array([decode_text(text) for text in texts], "M8[ns]").view(np.int64)
    except ValueError:
        raise FileFormatError(f"its first column ('{name}') holds no time in seconds") from None


def _stamps(numbers: list[int]) -> NDArray[np.int64]:
    wrong = next((number for number in numbers if abs(number) >= _MOST_NS), None)
    if wrong is not None:
        raise FileFormatError(f"time stamp {wrong} ns is out of range: 63 bits, the years 1678 to 2262")
    return np.array(numbers, np.int64)


def _nanoseconds(match: re.Match[bytes]) -> int:
    stamp = int(match[2]) * _SECOND + int((match[3] or b"").ljust(9, b"0")[:9])
    return -stamp if match[1] == b"-" else stamp


def _numbers(texts: Sequence[bytes] | NDArray[np.bytes_]) -> NDArray[Any] | None:
    """The values if all texts are numbers: int64, else uint64, else float64."""
    if not len(texts):
        return np.empty(0, np.int64)
    cells = np.asarray(texts, "S")
    for dtype in (np.int64, np.uint64, np.float64):
        values = _converted(cells, np.dtype(dtype))
        if values is not None:
            return values
    return None


def _converted(cells: NDArray[np.bytes_], dtype: np.dtype[Any]) -> NDArray[Any] | None:
    try:
        return cells.astype(dtype)
    except (ValueError, OverflowError):
        return None


def _samples(cells: Column, rows: int) -> _Samples | None:
    """What a column of a table with so many rows holds, None if it is empty."""
    if isinstance(cells, Filled):
        return _stepping(cells.places, cells.values, rows) if len(cells.places) else None
    places = np.flatnonzero(np.char.str_len(cells))
    if not len(places):
        return None
    filled = cells[places]
    quoted = np.char.startswith(filled, _QUOTE)
    values = None if quoted.any() else _numbers(filled)
    if values is None:
        values = np.array([cell.removeprefix(_QUOTE) for cell in filled.tolist()], "S")
    return _stepping(places, values, rows)


def _stepping(places: NDArray[np.intp], values: NDArray[Any], rows: int) -> _Samples:
    steps = np.diff(places)
    divider = int(steps[0]) if len(steps) else 1
    if (steps == divider).all():
        return _Samples(values, int(places[0]), divider)
    # gaps without a pattern, as other tools leave them for NaN, and silo for whole numbers that are missing
    dense, missing = np.zeros(rows, values.dtype), np.ones(rows, bool)
    dense[places], missing[places] = values, False
    return _Samples(masked(dense, missing), 0, 1)


def _recording(
    stem: str,
    prefix: str,
    time_ns: NDArray[np.int64],
    names: Sequence[str],
    columns: Sequence[Column],
    warnings: list[str],
) -> Recording:
    stamps = len(time_ns)
    found = [(name, found) for name, cells in zip(names, columns, strict=True) if (found := _samples(cells, stamps))]
    likeness = [(s.first, s.divider, len(s.values), s.values.dtype.kind) for _, s in found]
    elements: list[RecordedElement] = []
    for group in regroup([name for name, _ in found], likeness):
        members = found[group.start : group.start + len(group.suffixes)]
        entries = tuple(
            RecordedEntry(name, Entry(suffix, samples.values.dtype.str), samples.values)
            for (name, samples), suffix in zip(members, group.suffixes, strict=True)
        )
        samples = members[0][1]
        newest = samples.first > 0 and stamps - 1 - (samples.first + (len(samples.values) - 1) * samples.divider) < (
            samples.divider
        )
        buffer_type = BufferType.LOOPING if newest else BufferType.GROWING
        elements.append(
            RecordedElement(
                group.name, "-", group.kind, group.shape, samples.divider, buffer_type, samples.first, entries
            )
        )
    looping = bool(elements) and all(element.buffer_type is BufferType.LOOPING for element in elements)
    offset = _likely_offset(elements, stamps)
    return Recording(stem, time_ns, offset, elements, prefix, time_looping=looping, warnings=tuple(warnings))


def _likely_offset(elements: Sequence[RecordedElement], stamps: int) -> int:
    """The smallest count of ticks that explains which ticks the looping elements have; `stamps` if none does."""
    looping = [element for element in elements if element.buffer_type is BufferType.LOOPING]
    offsets = np.arange(stamps, stamps + _MOST_OFFSETS if looping else stamps)
    for divider, last in {(e.divider, e.first + (e.count - 1) * e.divider) for e in looping}:
        offsets = offsets[(offsets - 1) % divider == stamps - 1 - last]
    fits = [first_stamp(True, stamps, e.count, e.divider, int(offsets[0])) == e.first for e in looping if len(offsets)]
    return int(offsets[0]) if fits and all(fits) else stamps

"""A `.silo` file -> a recording whose values stay in the file until they are touched.

The file is memory-mapped: opening costs the header, reading a signal costs that signal. What is damaged or cut off is
left out, and a warning of the recording says what; only a file without a usable header raises `FileFormatError`.
"""

import mmap
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.elements import BufferType, Entry
from silo.core.kinds import SCALAR, regroup
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.errors import FileFormatError, LogNotFoundError
from silo.files.atomic import reason
from silo.files.silo import format as form
from silo.files.silo.header import Header, parse_header
from silo.files.silo.values import file_element, file_entry, file_recording, time_stamps, types_of
from silo.files.silo.whole import read_whole

_NAMED = 5
_FIRST_LINE_BYTES = 1 << 20  # far more than the longest line


class _Column(NamedTuple):
    """Where the values of a table line stand in the file: `whole` of them are there, starting with sample `skip`."""

    row: form.TableRow
    offset: int
    whole: int
    skip: int = 0


@dataclass(frozen=True)
class _Time:
    """The time stamps: how many the table announces, how many are there, and how to get them."""

    announced: int
    count: int
    looping: bool
    prefix: str
    columns: int
    load: Callable[[], NDArray[np.int64]]


def read_silo(path: str | os.PathLike[str]) -> Recording:
    """Open a `.silo` file. Values are read-only views of the memory-mapped file, looked up when first used.

    A damaged or truncated file gives what is whole; `Recording.warnings` says what is missing. Raises
    `LogNotFoundError` if the file can't be opened, `FileFormatError` if it has no usable header. (Whoever shortens the
    file in place while it is open ends the reading process with SIGBUS; silo itself only ever replaces files.)
    """
    data = _map(Path(path))
    # a disk's worth of zeros has no line anywhere: the search for the end of a header would take seconds in it
    if b"\n" not in bytes(data[:_FIRST_LINE_BYTES]):
        raise FileFormatError(f"'{os.fspath(path)}': this is no .silo file: it has no header")
    whole = read_whole(data)
    if whole is not None:
        return whole
    try:
        header = parse_header(data, len(data))
    except FileFormatError as error:
        raise FileFormatError(f"'{os.fspath(path)}': {error}") from None
    columns = _columns(header, len(data))
    time = _time(data, header, columns)
    elements = _elements(data, header, columns, time)
    facts = header.facts or form.LogFacts(logger=Path(path).stem, prefix=time.prefix)
    return file_recording(
        time.load,
        facts,
        offset=time.announced if header.offset is None else header.offset,
        elements=elements,
        time_looping=time.looping,
        warnings=(*facts.warnings, *header.warnings),
        events=tuple(header.events),
    )


def _map(path: Path) -> memoryview:
    try:
        with path.open("rb") as file:
            if os.fstat(file.fileno()).st_size == 0:
                raise FileFormatError(f"'{path}' is empty")
            return memoryview(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
    except FileNotFoundError as error:
        raise LogNotFoundError(f"there is no file '{path}'") from error
    except OSError as error:
        raise LogNotFoundError(f"can't open '{path}': {reason(error)}") from error


def _columns(header: Header, size: int) -> list[_Column]:
    """Every readable table line with the place of its values; a warning where the file is too short or too long."""
    rows = header.rows
    damaged = [index for index, row in enumerate(rows) if row is None]
    columns: list[_Column] = []
    position = header.data_start
    for row in rows[: damaged[0] if damaged else len(rows)]:
        if row:
            columns.append(_column(row, position, size))
            position += row.size_bytes
    if position > size:
        _tell_what_is_cut(header, columns, position - size)
    if not damaged:
        if position < size:
            header.warnings.append(f"{size - position} bytes after the last value are ignored")
        return columns
    # what stands behind a line that can't be read is found from the end of the file
    behind: list[_Column] = []
    back = size
    for row in reversed(rows[damaged[-1] + 1 :]):
        if row and back - row.size_bytes >= position:
            back -= row.size_bytes
            behind.insert(0, _column(row, back, size))
        else:
            break
    found = [column.row for column in columns + behind]
    lost = [row.name for row in rows if row and row not in found]
    header.warnings.append(
        "behind a damaged line of the table, values were taken from the end of the file" + _and_lost(lost)
    )
    return columns + behind


def _column(row: form.TableRow, place: int, size: int) -> _Column:
    whole = min(row.count, max(0, size - place) // row.item_bytes) if row.item_bytes else row.count
    return _Column(row, place, whole)


def _tell_what_is_cut(header: Header, columns: Sequence[_Column], missing: int) -> None:
    partly = [f"'{c.row.name}' has {c.whole} of {c.row.count} samples" for c in columns if 0 < c.whole < c.row.count]
    gone = [column.row.name for column in columns if column.row.count and not column.whole]
    parts = [f"the file is cut off: {missing} bytes are missing", *partly]
    header.warnings.append("; ".join(parts) + _and_lost(gone))


def _and_lost(names: Sequence[str]) -> str:
    if not names:
        return ""
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return f"; lost: {', '.join(names[:_NAMED])}{more}"


def _time(data: memoryview, header: Header, columns: Sequence[_Column]) -> _Time:
    """The first two lines of the table are the seconds and nanoseconds of each kept tick."""
    if len(columns) >= 2 and header.rows[:2] == [columns[0].row, columns[1].row]:
        first, second = columns[:2]
        if _is_time(first.row) and _is_time(second.row) and first.row.count == second.row.count:
            if not (first.row.name.endswith("time_s") and second.row.name.endswith("time_ns")):
                header.warnings.append(f"'{first.row.name}' and '{second.row.name}' were taken as time stamps")
            count = min(first.whole, second.whole)

            load = time_stamps(data, first.offset, second.offset, count)
            prefix = first.row.name.removesuffix("time_s").removesuffix("/")
            return _Time(first.row.count, count, first.row.looping, prefix, 2, load)
    frequency = header.facts.frequency_hz if header.facts and header.facts.frequency_hz else 1.0
    longest = max((c.whole * c.row.divider for c in columns if c.row.item_bytes), default=0)
    # no more stamps than there are bytes, whatever a damaged divider says
    count = min(longest, len(data))
    header.warnings.append(f"the time stamps are lost: ticks are numbered from 0 at {frequency:g} Hz")
    return _Time(count, count, False, "/log", 0, lambda: (np.arange(count) * (1e9 / frequency)).astype(np.int64))


def _is_time(row: form.TableRow) -> bool:
    return row.type_name == "int64" and row.divider == 1


def _elements(data: memoryview, header: Header, columns: list[_Column], time: _Time) -> tuple[RecordedElement, ...]:
    named = [(facts, facts_names(facts)) for facts in header.elements if facts.entries]
    pending = {names[0]: (facts, names) for facts, names in reversed(named)}
    found: list[tuple[form.ElementFacts, Sequence[_Column]]] = []
    rest: list[_Column] = []
    position = time.columns
    while position < len(columns):
        facts, names = pending.get(columns[position].row.name, (None, []))
        members = columns[position : position + len(names)]
        if facts and names == [member.row.name for member in members]:
            found += [*_by_suffix(rest), (facts, members)]
            rest = []
            position += len(members)
        else:
            rest.append(columns[position])
            position += 1
    found += _by_suffix(rest)
    return tuple(made for facts, members in found for made in _assemble(data, header, facts, members, time))


def facts_names(facts: form.ElementFacts) -> list[str]:
    """The names of an element's entries as they stand in the table."""
    return [form.table_name(facts.name + entry.suffix if entry.name is None else entry.name) for entry in facts.entries]


def _by_suffix(columns: Sequence[_Column]) -> Iterator[tuple[form.ElementFacts, Sequence[_Column]]]:
    """The facts of elements of which the file says nothing."""
    rows = [column.row for column in columns]
    likeness = [(row.divider, row.looping, row.count, row.type_name) for row in rows]
    for group in regroup([row.name for row in rows], likeness):
        members = columns[group.start : group.start + len(group.suffixes)]
        entries = tuple(
            form.EntryFacts(suffix, form.dtype_of(column.row).str, name=column.row.name)
            for column, suffix in zip(members, group.suffixes, strict=True)
        )
        buffer_type = BufferType.LOOPING if members[0].row.looping else BufferType.FIXED
        yield form.ElementFacts(group.name, entries, "-", group.kind, group.shape, buffer_type), members


def _alone(facts: form.ElementFacts, entry: form.EntryFacts, first: int | None) -> form.ElementFacts:
    """An entry as an element of its own."""
    name = entry.name or facts.name + entry.suffix
    scalar = msgspec.structs.replace(entry, suffix="", name=name)
    return msgspec.structs.replace(
        facts, name=name, kind=SCALAR.name, shape=(), dtype="", first=first, entries=(scalar,)
    )


def _assemble(
    data: memoryview, header: Header, facts: form.ElementFacts, columns: Sequence[_Column], time: _Time
) -> list[RecordedElement]:
    """The element with its entries; if the file ends within it, what is there of each entry as a scalar element."""
    row, first = columns[0].row, facts.first
    if len({(c.row.divider, c.row.looping, c.row.count) for c in columns}) > 1:
        # only in damaged files: lines of one element that disagree about their ticks
        pairs = zip(columns, facts.entries, strict=True)
        return [one for c, entry in pairs for one in _assemble(data, header, _alone(facts, entry, None), [c], time)]
    if first is None:
        offset = time.announced if header.offset is None else header.offset
        first = form.first_stamp(row.looping, time.announced, row.count, row.divider, offset)
    kept = columns
    if any(c.whole and (first < 0 or first + (c.whole - 1) * row.divider >= time.count) for c in columns):
        # samples without a time stamp: only in damaged files
        skip = max(0, -(first // row.divider))
        kept = [_fitted(column, skip, first, time.count) for column in columns]
        header.warnings.append(f"'{facts.name}' has samples without a time stamp; they are left out")
        first += skip * row.divider
    groups = [(facts, kept)]
    if len({column.whole for column in kept}) > 1:
        groups = [(_alone(facts, entry, first), [c]) for c, entry in zip(kept, facts.entries, strict=True)]
    return [
        file_element(one, row.divider, first, list(map(partial(_entry, data, header, one), some, one.entries)))
        for one, some in groups
        if some[0].whole
    ]


def _fitted(column: _Column, skip: int, first: int, stamps: int) -> _Column:
    divider = column.row.divider
    stop = min(column.whole, max(0, -((first - stamps) // divider)))
    if skip == 0 and stop == column.whole:
        return column
    return column._replace(skip=skip, whole=max(0, stop - skip))


def _entry(
    data: memoryview, header: Header, element: form.ElementFacts, column: _Column, facts: form.EntryFacts
) -> RecordedEntry:
    name = facts.name or element.name + facts.suffix
    stored, logged, shown = types_of(column.row.type_name, column.row.item_bytes, facts.dtype)
    if logged is None:
        header.warnings.append(f"'{name}' was logged as '{facts.dtype}' but is stored as {column.row.type_name}")
        logged = stored
    start = column.offset + column.skip * stored.itemsize
    place = (data, start, column.whole, stored, logged)
    return file_entry(name, Entry(facts.suffix, shown, facts.labels), facts, *place, column.skip)

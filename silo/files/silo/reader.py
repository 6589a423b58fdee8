"""A `.silo` file -> a recording whose elements are made when they are asked for, and whose values stay in the file.

The file is memory-mapped: opening costs the header, reading a signal costs that signal. Where header, length and facts
agree, few calls take all lines together: 1 ms for 500 elements. Where they don't, the list of lines is repaired first:
what is damaged or cut off is left out, and a warning of the recording says what; only a file without a usable header
raises `FileFormatError`.

Checksums of values are looked at only where that is asked for: to read all with them takes two to three times as long.
"""

import mmap
import os
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import accumulate, pairwise
from pathlib import Path
from typing import NamedTuple, overload

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.elements import BufferType, Entry
from silo.core.kinds import SCALAR, regroup
from silo.core.quantities.writing import and_more
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.errors import FileFormatError, LogNotFoundError, reason
from silo.files.silo import format as form
from silo.files.silo.header import Header, parse_header
from silo.files.silo.values import Type, file_element, file_entry, file_recording, time_stamps, types_of

_NAMED = 5


class _Stored(NamedTuple):
    """Where the values of a table line stand in the file: `whole` of them are there."""

    name: str
    line: form.TableLine
    offset: int
    whole: int


# an element, and the lines that it has
_Found = tuple[form.ElementFacts, Sequence[_Stored]]


class FileElements(Sequence[RecordedElement]):
    """The elements of a file, each made when it is first asked for; `names` are there at once.

    lines, offsets: what the table says of the entries of all elements, and where in the file their values begin.
    stamps, offset: how many time stamps there are, and the offset of the log, by which samples belong to them.
    """

    def __init__(
        self,
        data: memoryview,
        facts: Sequence[form.ElementFacts],
        lines: Sequence[form.TableLine],
        offsets: Sequence[int],
        stamps: int = 0,
        offset: int = 0,
    ) -> None:
        self._data = data
        self._facts = facts
        self._lines = lines
        self._offsets = offsets
        self._ticks = stamps, offset
        self._made: list[RecordedElement | None] = [None] * len(facts)
        self._starts = list(accumulate((len(one.entries) for one in facts), initial=0))

    @property
    def names(self) -> list[str]:
        """The names of the elements, in their order."""
        return [facts.name for facts in self._facts]

    def __len__(self) -> int:
        return len(self._facts)

    @overload
    def __getitem__(self, index: int) -> RecordedElement: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[RecordedElement, ...]: ...
    def __getitem__(self, index: int | slice) -> RecordedElement | tuple[RecordedElement, ...]:
        if isinstance(index, slice):
            return tuple(self._element(place) for place in range(*index.indices(len(self))))
        if not -len(self) <= index < len(self):
            raise IndexError(f"no element {index}: the log has {len(self)}")
        return self._element(index % len(self))

    def __iter__(self) -> Iterator[RecordedElement]:
        return map(self._element, range(len(self)))

    def _element(self, place: int) -> RecordedElement:
        made = self._made[place]
        if made is None:
            facts, row = self._facts[place], self._starts[place]
            line = self._lines[row]
            first = _first(facts, line, *self._ticks)
            entries = [self._entry(row + number, facts, entry) for number, entry in enumerate(facts.entries)]
            made = self._made[place] = file_element(facts, line.divider, first, entries)
        return made

    def _entry(self, row: int, element: form.ElementFacts, facts: form.EntryFacts) -> RecordedEntry:
        line = self._lines[row]
        entry, stored, logged = _entry_of(line.type_name, line.item_bytes, facts.dtype, facts.suffix)
        if facts.labels is not None:
            entry = Entry(facts.suffix, entry.dtype, facts.labels)
        name = facts.name or element.name + facts.suffix
        return file_entry(name, entry, facts, self._data, self._offsets[row], line.samples, stored, logged)


@lru_cache(maxsize=1024)
def _entry_of(type_name: str, item_bytes: int, dtype: str, suffix: str) -> tuple[Entry, Type, Type]:
    """Most entries of a log are alike: one object for all of them takes a tenth of the time."""
    stored, logged, shown = types_of(type_name, item_bytes, dtype)
    return Entry(suffix, shown), stored, stored if logged is None else logged


def _first(facts: form.ElementFacts, line: form.TableLine, stamps: int, offset: int) -> int:
    if facts.first is not None:
        return facts.first
    return form.first_stamp(line.looping, stamps, line.samples, line.divider, offset)


def read_silo(path: str | os.PathLike[str], check: bool = False) -> Recording:
    """Open a `.silo` file. Values are read-only views of the memory-mapped file, looked up when first used.

    A damaged or truncated file gives what is whole; `Recording.warnings` says what is missing, and with `check` which
    values aren't those that were written, by the checksums of the file: all of it is read. Raises `LogNotFoundError`
    if the file can't be opened, `FileFormatError` if it has no usable header. (Whoever shortens the file in place while
    it is open ends the reading process with SIGBUS; silo itself only ever replaces files.)
    """
    recording, header, data = _opened(path)
    wrong = _wrong_values(header, data) if check else ()
    return replace(recording, warnings=(*recording.warnings, *wrong)) if wrong else recording


def damage_of(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """What is damaged in a file, its values too: all of it is read. Raises as `read_silo` does."""
    recording, header, data = _opened(path)
    told = len(header.facts.warnings) if header.facts is not None else 0
    return (*recording.warnings[told:], *_wrong_values(header, data))


def _opened(path: str | os.PathLike[str]) -> tuple[Recording, Header, memoryview]:
    data = _map(Path(path))
    try:
        header = parse_header(data)
    except FileFormatError as error:
        raise FileFormatError(f"'{os.fspath(path)}': {error}") from None
    view = memoryview(data)
    return _whole(view, header) or _repaired(view, header, Path(path).stem), header, view


def _wrong_values(header: Header, data: memoryview) -> tuple[str, ...]:
    """A sentence that names the entries whose checksum doesn't match; none where the table tells no places."""
    lines = [line for line in header.lines if line is not None]
    sums = form.parse_sums(header.sums)
    if not len(sums) == len(lines) == len(header.lines) == len(header.names):
        return ()
    ends = accumulate((line.size_bytes for line in lines), initial=header.data_start)
    spans = zip(header.names, sums, pairwise(ends), strict=True)
    wrong = [f"'{name}'" for name, one, (begin, end) in spans
             if end <= len(data) and zlib.crc32(data[begin:end]) != one]  # fmt: skip
    if not wrong:
        return ()
    return (
        f"values of {and_more(wrong, _NAMED)} are damaged: they aren't those that were written, as their checksum says",
    )


def _map(path: Path) -> mmap.mmap:
    try:
        with path.open("rb") as file:
            if os.fstat(file.fileno()).st_size == 0:
                raise FileFormatError(f"'{path}' is empty")
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except FileNotFoundError as error:
        raise LogNotFoundError(f"there is no file '{path}'") from error
    except OSError as error:
        raise LogNotFoundError(f"can't open '{path}': {reason(error)}") from error


# ------------------------------------------------------------------------------------------------- a file that is whole


def _whole(data: memoryview, header: Header) -> Recording | None:
    """The recording in a file in which all agrees; None for any other."""
    lines = [line for line in header.lines if line is not None]
    offsets = list(accumulate([line.item_bytes * line.samples for line in lines], initial=header.data_start))
    if header.warnings or header.facts is None or header.offset is None or offsets[-1] != len(data):
        return None
    if header.names[2:] != _names(header.elements) or not _has_time(header):
        return None
    time, lines = lines[0], lines[2:]
    elements = header.elements
    if not _fit(lines, elements, time.samples, header.offset):
        return None
    return file_recording(
        time_stamps(data, offsets[0], offsets[1], time.samples),
        header.facts,
        offset=header.offset,
        elements=FileElements(data, elements, lines, offsets[2:], time.samples, header.offset) if elements else (),
        time_looping=time.looping,
        events=tuple(header.events),
    )


def _names(elements: Sequence[form.ElementFacts]) -> list[str]:
    """The names of the entries of elements as they stand in the table."""
    return [
        one.name + entry.suffix if entry.name is None else form.table_name(entry.name)
        for one in elements
        for entry in one.entries
    ]


def _has_time(header: Header) -> bool:
    """Whether the first two lines are the seconds and nanoseconds of each kept tick, as silo writes them."""
    first, second = (*header.lines[:2], None, None)[:2]
    if first is None or first != second or (first.type_name, first.divider) != ("int64", 1):
        return False
    return header.names[0].endswith("time_s") and header.names[1].endswith("time_ns")


def _fit(lines: Sequence[form.TableLine], elements: Sequence[form.ElementFacts], stamps: int, offset: int) -> bool:
    """Whether each type can be what the facts say, and each sample has a time stamp."""
    runs: set[tuple[form.TableLine, int | None]] = set()
    types: set[tuple[str, int, str]] = set()
    row = 0
    for one in elements:
        if not one.entries:
            return False
        line = lines[row]
        runs.add((line, one.first))
        for entry in one.entries:
            other = lines[row]
            if other is not line and other[1:4] != line[1:4]:
                return False
            types.add((other.type_name, other.item_bytes, entry.dtype))
            row += 1
    for line, given in runs:
        first = form.first_stamp(line.looping, stamps, line.samples, line.divider, offset) if given is None else given
        if line.samples <= 0 or first < 0 or first + (line.samples - 1) * line.divider >= stamps:
            return False
    return all(types_of(*each)[1] for each in types)


# --------------------------------------------------------------------------------------------- a file that is not whole


def _repaired(data: memoryview, header: Header, stem: str) -> Recording:
    """What is there of a file that is damaged, cut off, or of the original, whose elements are told by their names."""
    columns = _columns(header, len(data))
    facts = header.facts or form.LogFacts(logger=stem)
    looping = False
    if len(columns) >= 2 and header.lines[:2] == [columns[0].line, columns[1].line] and _may_be_time(*columns[:2]):
        first, second = columns[:2]
        columns = columns[2:]
        if not (first.name.endswith("time_s") and second.name.endswith("time_ns")):
            header.warnings.append(f"'{first.name}' and '{second.name}' were taken as time stamps")
        announced, looping = first.line.samples, first.line.looping
        stamps = min(first.whole, second.whole)
        load_time = time_stamps(data, first.offset, second.offset, stamps)
        if header.facts is None:
            prefix = first.name.removesuffix("time_s").removesuffix("/")
            facts = form.LogFacts(logger=stem, prefix=prefix)
    else:
        frequency = facts.frequency_hz or 1.0
        longest = max((column.whole * column.line.divider for column in columns if column.line.item_bytes), default=0)
        # no more stamps than there are bytes, whatever a damaged divider says
        announced = stamps = min(longest, len(data))
        header.warnings.append(f"the time stamps are lost: ticks are numbered from 0 at {frequency:g} Hz")

        def load_time() -> NDArray[np.int64]:
            return (np.arange(stamps) * (1e9 / frequency)).astype(np.int64)

    offset = announced if header.offset is None else header.offset
    told = list(_told(header, columns))
    found = [
        one for facts_of, members in told for one in _in_ticks(header, facts_of, members, announced, stamps, offset)
    ]
    kept = [column for _, members in found for column in members]
    lines = [column.line._replace(samples=column.whole) for column in kept]
    return file_recording(
        load_time,
        facts,
        offset=offset,
        elements=FileElements(data, [one for one, _ in found], lines, [column.offset for column in kept])
        if found
        else (),
        time_looping=looping,
        cut_off=sum(max(one.line.samples - one.whole for one in members) for _, members in told),
        warnings=(*facts.warnings, *header.warnings),
        events=tuple(header.events),
    )


def _columns(header: Header, size: int) -> list[_Stored]:
    """Every readable table line with the place of its values; a warning where the file is too short or too long."""
    rows = list(zip(header.names, header.lines, strict=True))
    damaged = [place for place, line in enumerate(header.lines) if line is None]
    columns: list[_Stored] = []
    position = header.data_start
    for name, line in rows[: damaged[0] if damaged else len(rows)]:
        if line:
            columns.append(_column(name, line, position, size))
            position += line.size_bytes
    if position > size:
        _tell_what_is_cut(header, columns, position - size)
    if not damaged:
        if position < size:
            header.warnings.append(f"{size - position} bytes after the last value are ignored")
        return columns
    # what stands behind a line that can't be read is found from the end of the file
    behind: list[_Stored] = []
    back = size
    for name, line in reversed(rows[damaged[-1] + 1 :]):
        if not line or back - line.size_bytes < position:
            break
        back -= line.size_bytes
        behind.append(_column(name, line, back, size))
    behind.reverse()
    found = {(column.name, column.line) for column in columns + behind}
    lost = [name for name, line in rows if line and (name, line) not in found]
    header.warnings.append(
        "behind a damaged line of the table, values were taken from the end of the file" + _and_lost(lost)
    )
    return columns + behind


def _column(name: str, line: form.TableLine, place: int, size: int) -> _Stored:
    whole = min(line.samples, max(0, size - place) // line.item_bytes) if line.item_bytes else line.samples
    return _Stored(name, line, place, whole)


def _tell_what_is_cut(header: Header, columns: Sequence[_Stored], missing: int) -> None:
    partly = [f"'{c.name}' has {c.whole} of {c.line.samples} samples" for c in columns if 0 < c.whole < c.line.samples]
    gone = [column.name for column in columns if column.line.samples and not column.whole]
    parts = [f"the file is cut off: {missing} bytes are missing", *partly]
    header.warnings.append("; ".join(parts) + _and_lost(gone))


def _and_lost(names: Sequence[str]) -> str:
    return f"; lost: {and_more(names, _NAMED)}" if names else ""


def _may_be_time(first: _Stored, second: _Stored) -> bool:
    lines = first.line, second.line
    return all((line.type_name, line.divider, line.samples) == ("int64", 1, lines[0].samples) for line in lines)


def _told(header: Header, columns: list[_Stored]) -> Iterator[_Found]:
    """The columns of each element: as its facts say, else by their names."""
    named = [(facts, _names([facts])) for facts in header.elements if facts.entries]
    pending = {names[0]: (facts, names) for facts, names in reversed(named)}
    rest: list[_Stored] = []
    position = 0
    while position < len(columns):
        facts, names = pending.get(columns[position].name, (None, []))
        members = columns[position : position + len(names)]
        if facts and names == [member.name for member in members]:
            yield from _by_suffix(rest)
            yield facts, members
            rest = []
            position += len(members)
        else:
            rest.append(columns[position])
            position += 1
    yield from _by_suffix(rest)


def _by_suffix(columns: Sequence[_Stored]) -> Iterator[_Found]:
    """The facts of elements of which the file says nothing."""
    likeness = [(line.divider, line.looping, line.samples, line.type_name) for _, line, *_ in columns]
    for group in regroup([column.name for column in columns], likeness):
        members = columns[group.start : group.start + len(group.suffixes)]
        entries = tuple(
            form.EntryFacts(suffix, _type_text(column), name=column.name)
            for column, suffix in zip(members, group.suffixes, strict=True)
        )
        buffer_type = BufferType.LOOPING if members[0].line.looping else BufferType.FIXED
        yield form.ElementFacts(group.name, entries, "-", group.kind, group.shape, buffer_type), members


def _type_text(column: _Stored) -> str:
    return str(form.dtype_of(column.line.type_name, column.line.item_bytes).str)


def _alone(facts: form.ElementFacts, entry: form.EntryFacts, first: int | None) -> form.ElementFacts:
    """An entry as an element of its own."""
    name = entry.name or facts.name + entry.suffix
    scalar = msgspec.structs.replace(entry, suffix="", name=name)
    return msgspec.structs.replace(
        facts, name=name, kind=SCALAR.name, shape=(), dtype="", first=first, entries=(scalar,)
    )


def _in_ticks(
    header: Header, facts: form.ElementFacts, columns: Sequence[_Stored], announced: int, stamps: int, offset: int
) -> list[_Found]:
    """The element with a time stamp for each sample; if the file ends within it, what is there of each entry alone."""
    line = columns[0].line
    if len({column.line[1:4] for column in columns}) > 1:
        # only in damaged files: lines of one element that disagree about their ticks
        pairs = zip(columns, facts.entries, strict=True)
        ticks = announced, stamps, offset
        return [one for c, entry in pairs for one in _in_ticks(header, _alone(facts, entry, None), [c], *ticks)]
    first = _first(facts, line, announced, offset)
    skip = 0
    last = max(column.whole for column in columns) - 1
    if last >= 0 and (first < 0 or first + last * line.divider >= stamps):
        # samples without a time stamp: only in damaged files
        skip = max(0, -(first // line.divider))
        stop = max(skip, -((first - stamps) // line.divider))
        columns = [
            c._replace(offset=c.offset + skip * line_bytes, whole=max(0, min(c.whole, stop) - skip))
            for c in columns
            for line_bytes in [c.line.item_bytes]
        ]
        header.warnings.append(f"'{facts.name}' has samples without a time stamp; they are left out")
        first += skip * line.divider
    entries = tuple(_fitting(header, facts, *pair, skip) for pair in zip(facts.entries, columns, strict=True))
    facts = msgspec.structs.replace(facts, first=first, entries=entries)
    groups: list[_Found] = [(facts, columns)]
    if len({column.whole for column in columns}) > 1:
        groups = [(_alone(facts, entry, first), [c]) for c, entry in zip(columns, entries, strict=True)]
    return [(one, members) for one, members in groups if members[0].whole]


def _fitting(
    header: Header, element: form.ElementFacts, facts: form.EntryFacts, column: _Stored, skip: int
) -> form.EntryFacts:
    """The facts of an entry of a type that it can have, whose first samples are left out."""
    if column.whole and types_of(column.line.type_name, column.line.item_bytes, facts.dtype)[1] is None:
        name = facts.name or element.name + facts.suffix
        header.warnings.append(f"'{name}' was logged as '{facts.dtype}' but is stored as {column.line.type_name}")
        facts = msgspec.structs.replace(facts, dtype=_type_text(column))
    if not skip:
        return facts
    dashes = {place - skip: number for place, number in (facts.dashes or {}).items()}
    missing = facts.missing
    if missing is not None:
        spans = tuple((begin - skip, end - skip) for begin, end in missing.spans)
        missing = msgspec.structs.replace(missing, spans=spans)
    return msgspec.structs.replace(facts, dashes=dashes, missing=missing)

"""A `.silo` file that is whole, as silo wrote it -> a recording whose elements are made when they are asked for.

The checksum of the header proves that nothing in it was damaged, so that it can be read with few calls for all lines
together: 1 ms for 500 elements, where the careful reader (`silo_reader`) takes 6. What is in any way not as silo
writes it is left to that one.
"""

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate
from operator import mul
from typing import Any, overload

import msgspec

from silo.files import silo_format as form
from silo.files.silo_values import file_entry, file_recording, time_stamps, types_of
from silo.model import Entry
from silo.recording import RecordedElement, RecordedEntry, Recording

_FIRST_READ = 1 << 18
_LONGEST = 256 << 20
_BEFORE_TABLE = 9  # lines
_END = b"\n" + form.DATA_LINE
_NEXT_FACTS = b"\n" + form.ELEMENT_FACTS
_LOG_DECODER = msgspec.json.Decoder(form.LogFacts)
_ELEMENTS_DECODER = msgspec.json.Decoder(list[form.ElementFacts])


@dataclass(frozen=True)
class _Table:
    """The lines of the table, column by column, and where the values of each begin in the file."""

    names: list[str]
    sizes: list[int]
    counts: list[int]
    dividers: list[int]
    loopings: list[bool]
    types: list[str]
    offsets: list[int]


class FileElements(Sequence[RecordedElement]):
    """The elements of a file, each made when it is first asked for; `names` are there at once."""

    def __init__(self, data: memoryview, table: _Table, facts: list[form.ElementFacts], offset: int) -> None:
        self._data = data
        self._table = table
        self._facts = facts
        self._offset = offset
        self._made: list[RecordedElement | None] = [None] * len(facts)
        self._starts = list(accumulate((len(one.entries) for one in facts), initial=2))

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
            made = self._made[place] = self._make(place)
        return made

    def _make(self, place: int) -> RecordedElement:
        facts, row, table = self._facts[place], self._starts[place], self._table
        divider = table.dividers[row]
        first = facts.first
        if first is None:
            stamps, samples = table.counts[0], table.counts[row]
            first = form.first_stamp(table.loopings[row], stamps, samples, divider, self._offset)
        element = RecordedElement.__new__(RecordedElement)
        # a frozen dataclass sets each of its ten fields by a call of its own, in three times the time
        element.__dict__.update(
            name=facts.name,
            unit=facts.unit,
            kind=facts.kind,
            shape=facts.shape,
            divider=divider,
            buffer_type=facts.buffer,
            first=first,
            entries=tuple([self._entry(row + number, entry) for number, entry in enumerate(facts.entries)]),
            description=facts.description,
            lost=facts.lost,
        )
        return element

    def _entry(self, row: int, facts: form.EntryFacts) -> RecordedEntry:
        table = self._table
        stored, logged, shown = types_of(table.types[row], table.sizes[row], facts.dtype)
        assert logged is not None  # `_fits` looked
        entry = Entry(facts.suffix, shown, facts.labels)
        name = table.names[row] if facts.name is None else facts.name
        return file_entry(name, entry, self._data, table.offsets[row], table.counts[row], stored, logged)


def read_whole(data: memoryview) -> Recording | None:
    """The recording in a file that silo wrote and nobody changed; None for any other, which needs a closer look."""
    text = _header(data)
    check = text.rfind(b"\n" + form.CHECK) + 1
    found = form.CHECK_PATTERN.fullmatch(text, check, len(text) - len(form.DATA_LINE)) if check else None
    if found is None or found[1] != b"%08x" % zlib.crc32(form.DATA_LINE, zlib.crc32(memoryview(text)[:check])):
        return None
    begin = text.find(_NEXT_FACTS)
    begin = begin if begin >= 0 else check - 1
    try:
        head = text[:begin].decode().split("\n")
        offset = int(head[5])
        table = _table(head[_BEFORE_TABLE:-1], len(text))
        facts = _LOG_DECODER.decode(text[text.rfind(b"\n", 0, begin) + 1 + len(form.LOG_FACTS) : begin])
        elements = _element_facts(text[begin + 1 : check - 1])
    except (ValueError, msgspec.DecodeError):
        return None
    whole = (
        head[-1].startswith(form.LOG_FACTS.decode())
        and int(head[7]) == len(table.names)
        and table.offsets[-1] == len(data)
        and _fits(table, elements, offset)
    )
    if not whole:
        return None
    return file_recording(
        time_stamps(data, table.offsets[0], table.offsets[1], table.counts[0]),
        logger=facts.logger,
        offset=offset,
        elements=FileElements(data, table, elements, offset) if elements else (),
        prefix=facts.prefix,
        frequency_hz=facts.frequency_hz,
        started_ns=facts.started_ns,
        time_looping=table.loopings[0],
        warnings=facts.warnings,
    )


def _header(data: memoryview) -> bytes:
    """The header with its last line; empty where it has none."""
    length = _FIRST_READ
    while True:
        text = bytes(data[:length])
        end = text.find(_END)
        if end >= 0:
            return text[: end + len(_END)]
        if length >= min(len(data), _LONGEST):
            return b""
        length *= 4


def _table(lines: list[str], start: int) -> _Table:
    # 0.25 us per line; a regular expression takes 1 us
    names, sizes, counts, dividers, loopings, types = map(
        list, zip(*[line.rsplit(" ", 5) for line in lines], strict=True)
    )
    item_bytes, samples = list(map(int, sizes)), list(map(int, counts))
    offsets = list(accumulate(map(mul, item_bytes, samples), initial=start))
    return _Table(
        names, item_bytes, samples, list(map(int, dividers)), [flag == "1" for flag in loopings], types, offsets
    )


def _element_facts(lines: bytes) -> list[form.ElementFacts]:
    """The facts of all elements by one call: no JSON text holds a line break, so the lines make a list."""
    listed = lines[len(form.ELEMENT_FACTS) :].replace(_NEXT_FACTS, b",")
    return _ELEMENTS_DECODER.decode(b"[" + listed + b"]")


def _fits(table: _Table, elements: Sequence[form.ElementFacts], offset: int) -> bool:
    """Whether table and facts tell of the same elements, in types that can be, with a time stamp for every sample."""
    stamps = table.counts[0]
    expected = [
        (one.name + entry.suffix if entry.name is None else form.table_name(entry.name), entry.dtype)
        for one in elements
        for entry in one.entries
    ]
    if [name for name, _ in expected] != table.names[2:] or not all(one.entries for one in elements):
        return False
    dtypes = [dtype for _, dtype in expected]
    if not all(types_of(*one)[1] for one in set(zip(table.types[2:], table.sizes[2:], dtypes, strict=True))):
        return False
    times = list(zip(table.counts, table.dividers, table.loopings, strict=True))
    if times[0] != times[1] or times[0][1] != 1 or set(table.types[:2]) != {"int64"}:
        return False
    if not (table.names[0].endswith("time_s") and table.names[1].endswith("time_ns")):
        return False
    runs: set[tuple[Any, ...]] = set()
    row = 2
    for one in elements:
        end = row + len(one.entries)
        if end - row > 1 and len(set(times[row:end])) > 1:
            return False
        runs.add((*times[row], one.first))
        row = end
    return all(_in_time(*run, stamps=stamps, offset=offset) for run in runs)


def _in_time(count: int, divider: int, looping: bool, first: int | None, *, stamps: int, offset: int) -> bool:
    if count < 1 or divider < 1:
        return False
    begin = form.first_stamp(looping, stamps, count, divider, offset) if first is None else first
    return begin >= 0 and begin + (count - 1) * divider < stamps

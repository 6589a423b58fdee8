"""What a CSV file can't say, beside it in `<name>.csv.json`: units, labels, types, kinds, buffers.

`silo.files.csv.writer` writes it with the table, `silo.files.csv.reader` takes it where it is of this very table: the
same columns, ticks, first and last time stamp. Values are those of the table, so that they may be edited.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.elements import Entry, LoggedEvent
from silo.core.recording import RecordedElement, Recording, are_samples_of, lazy_entry, masked
from silo.core.structs import alike
from silo.decoding import json_decoder
from silo.errors import FileFormatError
from silo.files.csv.cells import OTHERS, POINTS, QUOTE, Words, as_numbers
from silo.files.silo import format as form

SIDECAR = ".json"
VERSION = 1
_LARGEST = 256 << 20
_LARGEST_TICK = 2**62
_MASKED = "biuV"  # what has no NaN: an empty cell is a value that is missing


class Column(NamedTuple):
    """A column of a table: the rows in which it is filled, and what gives the texts there.

    `dtype` is the type that these surely have, None where they must be looked at; `letters` those of
    `silo.files.csv.cells`, None where nobody looked.
    """

    places: NDArray[np.intp]
    words: Callable[[], Words]
    dtype: Any
    letters: int | None


class CsvElement(form.ElementFacts, frozen=True, omit_defaults=True):
    """An element of the table: which ticks it has."""

    divider: int = 1
    count: int = 0


class CsvFacts(msgspec.Struct, frozen=True, omit_defaults=True):
    """The whole sidecar. `span`: first and last time stamp, ns."""

    version: int
    log: form.LogFacts
    elements: tuple[CsvElement, ...]
    offset: int
    ticks: int
    span: tuple[int, int] = (0, 0)
    time_looping: bool = False
    events: tuple[LoggedEvent, ...] = ()


class NotThisTableError(ValueError):
    """The sidecar is damaged, or of another table; the message says why."""


def sidecar_of(path: str | Path) -> Path:
    """Where the facts of a CSV file stand."""
    return Path(f"{path}{SIDECAR}")


def pack(recording: Recording, elements: Sequence[RecordedElement]) -> bytes:
    """The sidecar of a table of these elements."""
    return msgspec.json.format(msgspec.json.encode(table_facts(recording, elements)), indent=1) + b"\n"


def table_facts(recording: Recording, elements: Sequence[RecordedElement]) -> CsvFacts:
    """What a table of these elements can't say."""
    time_ns = recording.time_ns
    return CsvFacts(
        version=VERSION,
        log=form.log_facts(recording),
        elements=tuple(map(_element_facts, elements)),
        offset=recording.offset,
        ticks=len(time_ns),
        span=_span(time_ns),
        time_looping=recording.time_looping,
        events=tuple(map(form.plain_texts, recording.events)),
    )


def unpack(data: bytes) -> CsvFacts:
    """Raises `NotThisTableError` for what is no sidecar."""
    if len(data) > _LARGEST:
        raise NotThisTableError(f"it has {len(data)} bytes")
    try:
        facts = json_decoder(CsvFacts).decode(data)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise NotThisTableError(str(error)) from None
    if facts.version != VERSION:
        raise NotThisTableError(f"its version is {facts.version}, this silo reads {VERSION}")
    return facts


def restored(
    facts: CsvFacts, names: Sequence[str], columns: Sequence[Column], time_ns: NDArray[np.int64], path: Path
) -> Recording:
    """The recording as it was, of the cells of this table. Raises `NotThisTableError` if the facts don't fit."""
    if [entry.name for one in facts.elements for entry in one.entries] != list(names):
        raise NotThisTableError("its columns are others")
    if facts.ticks != len(time_ns) or facts.span != _span(time_ns):
        raise NotThisTableError("its time stamps are others")
    cells = iter(columns)
    elements = tuple(_element(one, cells, len(time_ns), path) for one in facts.elements)
    log = alike(Recording, facts.log, time_ns=time_ns, elements=elements, offset=facts.offset, events=facts.events)
    return replace(log, time_looping=facts.time_looping)


def _span(time_ns: NDArray[np.int64]) -> tuple[int, int]:
    return (int(time_ns[0]), int(time_ns[-1])) if len(time_ns) else (0, 0)


def _element_facts(element: RecordedElement) -> CsvElement:
    facts = form.element_facts(element, element.first)
    entries = tuple(
        msgspec.structs.replace(one, name=form.plain_text(entry.name))
        for one, entry in zip(facts.entries, element.entries, strict=True)
    )
    return alike(CsvElement, facts, entries=entries, divider=element.divider, count=element.count)


def _element(facts: CsvElement, columns: Any, ticks: int, path: Path) -> RecordedElement:
    entries = []
    for entry in facts.entries:
        column: Column = next(columns)
        samples = _in_step(column.places, facts, ticks)
        dtype = form.dtype_from(entry.dtype)
        if dtype is None or not _may_be(dtype, column):
            raise NotThisTableError(f"the values of '{entry.name}' are no {entry.dtype}")
        if samples is None or (len(samples) < facts.count and dtype.kind not in _MASKED):
            raise NotThisTableError(f"'{entry.name}' has its samples at other ticks")
        load = partial(_loaded, path, column, entry, dtype, facts.count, samples)
        about = Entry(entry.suffix, entry.dtype, entry.labels)
        entries.append(lazy_entry(entry.name or "", about, load, dtype.newbyteorder("="), facts.count))
    return alike(RecordedElement, facts, first=facts.first or 0, entries=tuple(entries))


def _may_be(dtype: np.dtype[Any], column: Column) -> bool:
    """Whether the letters of a column may be values of this type."""
    if dtype.kind not in "biufmM" or column.letters is None:
        return dtype.kind in "biufmMSUc" or (dtype.kind == "V" and dtype.fields is None)
    return not column.letters & (OTHERS if dtype.kind == "f" else OTHERS | POINTS)


def _loaded(
    path: Path, column: Column, entry: form.EntryFacts, dtype: np.dtype[Any], count: int, samples: NDArray[np.intp]
) -> NDArray[Any]:
    """The values of a column as they were logged; strings stay bytes, as in every recording."""
    try:
        values = _parsed(column.words(), dtype)
    except (ValueError, OverflowError, TypeError):
        raise FileFormatError(
            f"{path}: '{entry.name}' was logged as {entry.dtype}, which a value in the table is not; correct that, or "
            f"remove {sidecar_of(path.name)} to read the table by itself"
        ) from None
    return spread(values, samples, count)


def spread(values: NDArray[Any], places: NDArray[np.intp], count: int) -> NDArray[Any]:
    """So many values with these at their places, all others missing."""
    if len(values) == count:
        return values
    dense, missing = np.zeros(count, values.dtype), np.ones(count, bool)
    dense[places], missing[places] = values, False
    return masked(dense, missing)


def _in_step(places: NDArray[np.intp], facts: CsvElement, ticks: int) -> NDArray[np.intp] | None:
    """Which samples of an element stand in these rows; None where one of them is none."""
    first, divider = facts.first or 0, facts.divider
    if max(abs(first), divider, facts.count) >= _LARGEST_TICK:
        return None
    if facts.count < len(places) or not are_samples_of(ticks, first, divider, facts.count):
        return None
    samples = (places - first) // divider
    inside = (samples >= 0) & (samples < facts.count) & (samples * divider + first == places)
    return samples if inside.all() else None


def _parsed(cells: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    kind = dtype.kind
    if kind in "SUcV":
        texts = [cell.removeprefix(QUOTE) for cell in cells.tolist()]
        if kind == "c":
            return np.array([complex(text.decode("ascii")) for text in texts], dtype)
        if kind == "V" and dtype.fields is None:
            raw = [bytes.fromhex(text.decode("ascii")) for text in texts]
            if any(len(each) != dtype.itemsize for each in raw):
                raise ValueError
            return np.frombuffer(b"".join(raw), dtype)
        if kind == "V":
            raise ValueError
        return np.array(texts, "S")
    if kind == "f":
        # the shortest text of a narrow float is nearest to it, by way of a double, too
        return as_numbers(cells, dtype)
    if kind not in "biumM":
        raise ValueError
    wide = as_numbers(cells, np.dtype(np.uint64 if kind == "u" else np.int64))
    if kind in "mM":
        return wide.view(dtype.newbyteorder("="))
    values = wide.astype(dtype)
    if (values != wide).any():
        raise ValueError
    return values

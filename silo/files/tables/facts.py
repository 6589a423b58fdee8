"""What files of arrays and Parquet say of a log beside its numbers, so that silo reads them back: one text for each.

The text is that beside a CSV file, and where each entry stands. A reader gives it the arrays by name; values are read
when they are asked for.
"""

import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.elements import Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording, are_samples_of, lazy_entry
from silo.core.structs import alike
from silo.decoding import json_decoder
from silo.errors import FileFormatError, LogNotFoundError, SiloError, reason
from silo.files.csv.metadata import CsvFacts, table_facts
from silo.files.silo import format as form

NAME = "silo.log"  # of the text in the file
_SLACK = 1024  # stamps by which a file may seem to have more than it has: heads of arrays
Place = tuple[str, int]  # the array that an entry stands in, and in which of its columns: -1 for all of it
# of an element with so many samples, of this type
Arrays = Callable[[Place, RecordedElement, int, "np.dtype[Any]"], NDArray[Any]]


class TableFacts(CsvFacts, frozen=True, omit_defaults=True):
    """The facts of a log, where its entries stand, in their order, and, by element, arrays of stamps of its own."""

    places: tuple[Place, ...] = ()
    own: dict[int, str] = msgspec.field(default_factory=dict)


_CHECK = ',"crc32":'  # the last fact: that of the text before it


def packed(
    recording: Recording,
    elements: Sequence[RecordedElement],
    places: Sequence[Place],
    own: Mapping[int, str] = MappingProxyType({}),
) -> str:
    """The text, of the elements as they are written."""
    text = msgspec.json.encode(
        alike(TableFacts, table_facts(recording, elements), places=tuple(places), own=dict(own))
    ).decode()[:-1]
    return f"{text}{_CHECK}{zlib.crc32(text.encode())}}}"


def unpacked(path: Path, text: str | bytes) -> TableFacts:
    """The facts of a text; one without a checksum is taken as it is. Raises FileFormatError for another text."""
    text = text if isinstance(text, str) else text.decode()
    told, check, number = text.rpartition(_CHECK)
    if check and number != f"{zlib.crc32(told.encode())}}}":
        raise FileFormatError(f"'{path}' is damaged: what it says of its log is not what was written")
    return json_decoder(TableFacts).decode(text)


@contextmanager
def told_of(path: Path) -> Iterator[None]:
    """Turn what a damaged file leads to, by whatever library reads it, into an error of silo."""
    try:
        yield
    except SiloError:
        raise
    except FileNotFoundError as error:
        raise LogNotFoundError(f"there is no file '{path}'") from error
    except Exception as error:  # each library has its own
        words = reason(error)
        raise FileFormatError(f"'{path}' can't be read: {words}") from error


def restored(
    path: Path,
    text: str | bytes | None,
    announced: Callable[[], int],
    time_ns: Callable[[], NDArray[Any]],
    arrays: Arrays,
) -> Recording:
    """The recording of a file; `time_ns` and `arrays` read of it, `announced` says about how many stamps that will be.

    Raises `FileFormatError` for a file of others, and where the stamps are not as many as the facts say; before they
    are unpacked, if they are many more.
    """
    if text is None:
        raise FileFormatError(f"'{path}' was not written by silo, or by one before 0.2: it doesn't say what is in it")
    facts = unpacked(path, text)
    count = announced()
    if count <= facts.ticks + _SLACK:
        stamps = np.asarray(time_ns()).ravel().astype(np.int64)
        count = len(stamps)
    if count != facts.ticks:
        raise FileFormatError(
            f"'{path}' has {count:,} time stamps, and says that it has {facts.ticks:,}: it is damaged"
        )
    entries_told = sum(len(one.entries) for one in facts.elements)
    if len(facts.places) != entries_told:
        raise FileFormatError(
            f"'{path}' says where {len(facts.places):,} entries stand, and has {entries_told:,}: it is damaged"
        )
    places = iter(facts.places)
    elements = []
    for number, one in enumerate(facts.elements):
        element = alike(RecordedElement, one, first=one.first or 0, entries=())
        if number in facts.own:
            own = np.asarray(arrays((facts.own[number], -1), element, one.count, stamps.dtype)).ravel().astype(np.int64)
            if len(own) != one.count:
                raise FileFormatError(f"'{path}': '{one.name}' has {one.count:,} samples, and {len(own):,} time stamps")
            element = alike(RecordedElement, element, own_ns=own)
        elif not are_samples_of(len(stamps), element.first, one.divider, one.count):
            raise FileFormatError(f"'{path}': '{one.name}' has samples without a time stamp")
        entries = [_entry(path, entry, next(places), element, one.count, arrays) for entry in one.entries]
        elements.append(alike(RecordedElement, element, entries=tuple(entries)))
    return alike(
        Recording, facts.log, time_ns=stamps, elements=tuple(elements), offset=facts.offset, events=facts.events,
        time_looping=facts.time_looping,
    )  # fmt: skip


def _entry(
    path: Path, facts: form.EntryFacts, place: Place, element: RecordedElement, count: int, arrays: Arrays
) -> RecordedEntry:
    dtype = form.dtype_from(facts.dtype)
    if dtype is None:
        raise FileFormatError(f"'{path}': '{facts.name}' is of type {facts.dtype}, which no file can hold")
    logged = dtype if facts.missing is None else facts.missing.type_of(dtype)
    entry = Entry(facts.suffix, facts.dtype if facts.missing is None else facts.missing.dtype, facts.labels)

    def load() -> NDArray[Any]:
        if not count:
            return np.empty(0, logged)
        with told_of(path):
            values = arrays(place, element, count, dtype)
            if len(values) != count:
                raise FileFormatError(f"'{path}': '{facts.name}' has {len(values)} samples, not {count}")
            values = _as_logged(values, dtype)
            return values if facts.missing is None else facts.missing.masked(values)

    return lazy_entry(facts.name or "", entry, load, logged, count)


def _as_logged(values: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    """Values of a file in the type in which they were logged; strings are bytes, as in every recording."""
    if values.dtype == dtype:
        return values
    kind = dtype.kind
    if kind in "SU":
        return np.array([text.encode() if isinstance(text, str) else bytes(text) for text in values.tolist()], "S")
    if kind == "V":
        if values.dtype.kind == "u":
            return np.ascontiguousarray(values).view(dtype).reshape(len(values))
        return np.frombuffer(b"".join(map(bytes, values.tolist())), dtype)
    if kind in "mM" and values.dtype.kind != kind:  # else in a unit that the file has, as Parquet has no seconds
        return values.astype(np.int64).view(dtype.newbyteorder("="))
    return values.astype(dtype)

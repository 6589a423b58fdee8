"""Values of a `.silo` file that stay in the file until they are touched, and the types that they have there."""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.wide import from_wire
from silo.core.elements import Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording, lazy_entry
from silo.core.structs import alike, fields_of
from silo.files.silo import format as form

Type = np.dtype[Any]


class FileRecording(Recording):
    """A recording whose time stamps are put together when they are first asked for; `file_recording` makes it."""

    @cached_property
    def time_ns(self) -> NDArray[np.int64]:
        """Shape `(n,)`: int64 nanoseconds, one per kept tick."""
        load: Callable[[], NDArray[np.int64]] = self.__dict__["load_time"]
        return load()


def file_element(
    facts: form.ElementFacts, divider: int, first: int, entries: Sequence[RecordedEntry]
) -> RecordedElement:
    """An element of these facts."""
    made = RecordedElement.__new__(RecordedElement)
    fields = {name: getattr(facts, name) for name in _FACTS}
    fields |= {"divider": divider, "first": first, "entries": tuple(entries), "own_ns": None}
    # a frozen dataclass sets each of its twelve fields by a call of its own, in three times the time
    object.__setattr__(made, "__dict__", fields)
    return made


_FACTS = tuple(
    name for name in fields_of(form.ElementFacts) if name in fields_of(RecordedElement) and name != "entries"
)


def file_entry(
    name: str,
    entry: Entry,
    facts: form.EntryFacts,
    data: memoryview,
    offset: int,
    count: int,
    stored: Type,
    logged: Type,
) -> RecordedEntry:
    """An entry of so many values that begin at this byte of the file."""
    missing, dashes = facts.missing, facts.dashes if stored.kind == "S" else None
    at = {place: number for place, number in (dashes or {}).items() if 0 <= place < count}
    load = partial(_loaded, data, offset, count, stored, logged, at, missing)
    if missing is not None:
        entry = Entry(entry.suffix, missing.dtype, entry.labels)
    return lazy_entry(name, entry, load, logged if missing is None else missing.type_of(logged), count)


def _loaded(
    data: memoryview,
    offset: int,
    count: int,
    stored: Type,
    logged: Type,
    dashes: Mapping[int, int],
    missing: form.Missing | None,
) -> NDArray[Any]:
    values = stored_values(data, stored, count, offset)
    if stored is not logged:
        values = _as_logged(values, logged)
    for at, number in dashes.items():
        values[at] += b"-" * min(number, stored.itemsize)
    return values if missing is None else missing.masked(values)


def file_recording(load_time: Callable[[], NDArray[np.int64]], about: object = None, **facts: Any) -> Recording:
    """A recording of these facts, and of those of `about` that have the same names; `load_time` gives the stamps."""
    made: FileRecording = alike(FileRecording, about, time_ns=np.empty(0, np.int64), **facts)
    made.__dict__.pop("time_ns")
    made.__dict__["load_time"] = load_time
    return made


def stored_values(data: memoryview, stored: Type, count: int, offset: int) -> NDArray[Any]:
    """So many values of the file from this byte on."""
    if stored.itemsize and count:
        return np.frombuffer(data, stored, count, offset)
    return np.empty(0, stored) if stored.itemsize else np.zeros(count, "S1")


def _as_logged(values: NDArray[Any], logged: Type) -> NDArray[Any]:
    if values.dtype.kind == "S":
        return np.char.rstrip(values, b"-")
    return from_wire(values, logged) if logged.str == "<f2" else values.view(logged)


def time_stamps(data: memoryview, seconds: int, nanoseconds: int, count: int) -> Callable[[], NDArray[np.int64]]:
    """What puts the two columns of time stamps, which begin at these bytes, together."""
    int64 = np.dtype("<i8")

    def load() -> NDArray[np.int64]:
        time_ns = stored_values(data, int64, count, seconds).astype(np.int64)
        time_ns *= 1_000_000_000
        time_ns += stored_values(data, int64, count, nanoseconds)
        return time_ns

    return load


@lru_cache(maxsize=256)
def types_of(type_name: str, item_bytes: int, text: str) -> tuple[Type, Type | None, str]:
    """The type in the file, the type as logged (None if it can't have been that), and how the entry calls it.

    Raises `ValueError` for a type that the format doesn't have, or not of that size.
    """
    stored = form.dtype_of(type_name, item_bytes)
    logged = _logged_dtype(text, stored)
    if logged == stored and stored.kind != "S":  # of strings, the padding is still to be taken off
        logged = stored
    return stored, logged, text if stored.kind == "S" else (logged or stored).str


def _logged_dtype(text: str, stored: Type) -> Type | None:
    """The type that the values had when they were logged, None if what is stored can't have been that."""
    named = form.dtype_from(text)
    if named is None:
        return None
    logged = named.newbyteorder("<")
    if stored.kind == "V":
        fits = logged.itemsize == stored.itemsize
    elif stored.kind == "S" or logged.kind in "SU":
        fits = stored.kind == "S" and logged.kind in "SU"
    else:
        fits = form.file_dtype(logged) == stored
    return logged if fits else None

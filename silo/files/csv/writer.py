"""A recording -> CSV, one column per entry: what pandas, PlotJuggler and spreadsheets open.

Numbers in full precision, strings always quoted (so that `"12"` stays a string), an empty cell for a tick without
sample, and where a whole number is missing. The rows of a large log are made by the JSON encoder, in a fifth of the
time (the values are the same, some exponents look different). Reading is in `silo.files.csv.reader`.
"""

import os
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.recording import Progress, RecordedElement, Recording, samples_between, silent
from silo.errors import SaveError
from silo.files.atomic import atomic_file, write_all
from silo.files.csv.metadata import pack, sidecar_of
from silo.files.csv.reader import TIME_NS
from silo.files.silo.missing import is_masked

CHUNK_CELLS = 200_000  # that are text at the same time: 20 MB
ENCODED_FROM = 200_000  # cells; smaller tables look as Python writes numbers
_SECOND = 1_000_000_000


class _Cells(NamedTuple):
    """The samples of an entry that belong to a range of ticks; `places` are their rows within the range."""

    values: NDArray[Any]
    places: slice | NDArray[np.int64]
    rows: int

    @property
    def complete(self) -> bool:
        return len(self.values) == self.rows


def write_csv(recording: Recording, path: str | os.PathLike[str], progress: Progress = silent) -> None:
    """Save a recording as CSV, atomically.

    A header, then one line per tick: `time` (seconds since 1970 with nine decimals, exact), one column per entry, and
    `time_ns` (the same time in whole nanoseconds: seconds that are read as doubles are off by up to 223 ns). Bools and
    enumerations are numbers, dates are counts of their unit. Elements without a sample are left out. Units, labels,
    types and buffers stand in `<path>.json` beside it. `progress` is called with the fraction written. Raises
    `SaveError` when the system refuses.
    """
    elements = [element for element in recording.elements if element.count]
    for entry in (entry for element in elements for entry in element.entries):
        if entry.dtype.hasobject:
            raise SaveError(f"'{entry.name}' holds Python objects, which no file can hold; log numbers or strings")
    # the table takes its name first: facts that are older than it would not fit, and are seen through
    with atomic_file(sidecar_of(os.fspath(path))) as beside, atomic_file(path) as file:
        write_all(beside.fileno(), [memoryview(pack(recording, elements))], 0)
        position = 0
        progress(0.0)
        for fraction, text in _columns(recording, elements):
            write_all(file.fileno(), [memoryview(text)], position)
            position += len(text)
            progress(fraction)


def _columns(recording: Recording, elements: Sequence[RecordedElement]) -> Iterator[tuple[float, bytes]]:
    """Pieces of the file with the fraction that is then written."""
    names = [entry.name for element in elements for entry in element.entries]
    yield (
        0.0,
        ",".join(["time", *(_quoted(name) for name in names), TIME_NS]).encode("utf-8", "backslashreplace") + b"\n",
    )
    stamps = len(recording.time_ns)
    make = _encoded_lines if stamps * (len(names) + 2) >= ENCODED_FROM else _plain_lines
    rows = max(1, CHUNK_CELLS // (len(names) + 2))
    for start in range(0, stamps, rows):
        stop = min(stamps, start + rows)
        cells = [
            _cells(element, values, start, stop)
            for element in elements
            for values in (entry.values for entry in element.entries)
        ]
        yield stop / stamps, make(recording.time_ns[start:stop], cells)
    if not stamps:
        yield 1.0, b""


def _cells(element: RecordedElement, values: NDArray[Any], start: int, stop: int) -> _Cells:
    """The samples whose ticks are in `start ... stop`."""
    first, divider = element.first, element.divider
    begin, end = samples_between(first, divider, element.count, start, stop)
    place = first + begin * divider - start
    samples = values[begin:end]
    if is_masked(samples):
        there = np.flatnonzero(~np.ma.getmaskarray(samples))
        return _Cells(_plain(np.ma.getdata(samples)[there]), place + there * divider, stop - start)
    return _Cells(_plain(samples), slice(place, place + (end - begin) * divider, divider), stop - start)


def _plain(values: NDArray[Any]) -> NDArray[Any]:
    """Numbers and strings as they are written: no bool, date, float16 or raw bytes."""
    kind = values.dtype.kind
    if kind == "b":
        return values.view(np.uint8)
    if kind in "mM":
        return values.view(np.dtype("i8").newbyteorder(values.dtype.byteorder))
    if kind == "c":
        return values.astype("U")
    if kind == "V":
        return np.array([value.tobytes().hex() for value in values], "U")
    if kind == "S":
        return np.array([value.decode("utf-8", "backslashreplace") for value in values.tolist()], "U")
    return values.astype(np.float32) if values.dtype.itemsize == 2 and kind == "f" else values


def _encoded_lines(time_ns: NDArray[np.int64], cells: Sequence[_Cells]) -> bytes:
    even = all(cell.complete and cell.values.dtype.str == "<f8" for cell in cells) and len(cells) > 0
    matrix = np.stack([cell.values for cell in cells], axis=1) if even else np.full((1, 1), np.nan)
    rows = matrix.tolist() if np.isfinite(matrix).all() else list(zip(*map(_encodable, cells), strict=True))
    lines = _ENCODER.encode_lines(rows)[1:-2].split(_BETWEEN)
    if not cells or len(lines) != len(time_ns):  # a text that reads as the end of a line
        return _plain_lines(time_ns, cells)
    times = zip(_time_texts(time_ns), lines, time_ns.tolist(), strict=True)
    return b"".join([b"%b,%b,%d\n" % (time.encode(), line, stamp) for time, line, stamp in times])


_ENCODER = msgspec.json.Encoder()
_BETWEEN = b"]\n["
_EMPTY = msgspec.Raw(b"")


def _encodable(cell: _Cells) -> list[Any]:
    """The cells of a column as JSON numbers; what is none stands for itself."""
    values = cell.values
    numbers = values.dtype.kind in "iu" or (values.dtype.kind == "f" and values.dtype.itemsize == 8)
    found: list[Any] = values.tolist() if numbers else list(map(_raw, _texts(values)))
    if numbers and values.dtype.kind == "f":
        odd = np.flatnonzero(~np.isfinite(values))
        for place, text in zip(odd.tolist(), _texts(values[odd]), strict=True):
            found[place] = _raw(text)
    return found if cell.complete else _spread(found, cell, _EMPTY)


def _raw(text: str) -> msgspec.Raw:
    return msgspec.Raw(text.encode("utf-8", "backslashreplace"))


def _plain_lines(time_ns: NDArray[np.int64], cells: Sequence[_Cells]) -> bytes:
    columns = [_time_texts(time_ns)]
    for cell in cells:
        texts = _texts(cell.values)
        columns.append(texts if cell.complete else _spread(texts, cell, ""))
    columns.append(list(map(str, time_ns.tolist())))
    lines = map(",".join, zip(*columns, strict=True))
    return ("\n".join(lines) + "\n").encode("utf-8", "backslashreplace")


def _spread(found: list[Any], cell: _Cells, empty: Any) -> list[Any]:
    """The cells in their rows, the others empty."""
    column = [empty] * cell.rows
    if isinstance(cell.places, slice):
        column[cell.places] = found
    else:
        for place, one in zip(cell.places.tolist(), found, strict=True):
            column[place] = one
    return column


def _time_texts(time_ns: NDArray[np.int64]) -> list[str]:
    return [
        f"{'-' if stamp < 0 else ''}{abs(stamp) // _SECOND}.{abs(stamp) % _SECOND:09d}" for stamp in time_ns.tolist()
    ]


def _texts(values: NDArray[Any]) -> list[str]:
    """Each value in the shortest text that is exactly it; `NaN`, as what reads tables takes `nan` for a text."""
    if values.dtype.kind == "U":
        return [_quoted(text) for text in values.tolist()]
    if values.dtype.kind == "f" and values.dtype.itemsize != 8:
        # the shortest text of a narrow float, not that of the double next to it
        texts: list[str] = values.astype("U").tolist()
    else:
        texts = [repr(value) for value in values.tolist()]
    if values.dtype.kind == "f":
        for place in np.flatnonzero(np.isnan(values)).tolist():
            texts[place] = "NaN"
    return texts


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"'

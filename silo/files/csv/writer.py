"""A recording -> CSV: one column per entry (what pandas, PlotJuggler and spreadsheets open), or one row per entry.

Numbers in full precision, strings always quoted (so that `"12"` stays a string), an empty cell for a tick without
sample, and where a whole number is missing. The column layout of a large log is written by polars where that is
installed (5 times as fast; the values are the same, some exponents look different). Reading is in
`silo.files.csv.reader`.
"""

import io
import os
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from silo.core.recording import Progress, RecordedElement, Recording
from silo.errors import SaveError
from silo.files.atomic import atomic_file, write_all
from silo.files.csv.metadata import pack, sidecar_of
from silo.files.csv.reader import TIME_NS, read_csv
from silo.files.silo.missing import is_masked

__all__ = ["Layout", "read_csv", "write_csv"]

Layout = Literal["columns", "rows"]

# Cells that are text at the same time: about 100 MB in the plain way, 40 MB with polars.
CHUNK_CELLS = 1_000_000
POLARS_FROM = 200_000  # cells; below, loading polars takes longer than writing the table without it
_SECOND = 1_000_000_000


class _Cells(NamedTuple):
    """The samples of an entry that belong to a range of ticks; `places` are their rows within the range."""

    values: NDArray[Any]
    places: slice | NDArray[np.int64]
    rows: int

    @property
    def complete(self) -> bool:
        """Whether every tick of the range has a sample."""
        return len(self.values) == self.rows


def write_csv(
    recording: Recording,
    path: str | os.PathLike[str],
    layout: Layout = "columns",
    progress: Progress | None = None,
) -> None:
    """Save a recording as CSV, atomically.

    `columns`: a header, then one line per tick: `time` (seconds since 1970 with nine decimals, exact), one column per
    entry, and `time_ns` (the same time in whole nanoseconds: seconds that are read as doubles are off by up to 223 ns).
    `rows`: the original's layout, one line per entry with one cell per tick, `time_s` and `time_ns` first.
    Bools and enumerations are numbers, dates are counts of their unit. Elements without a sample are left out.
    Units, labels, types and buffers stand in `<path>.json` beside it.
    `progress` is called with the fraction written. Raises `SaveError` when the system refuses.
    """
    if layout not in ("columns", "rows"):
        raise SaveError(f"unknown layout '{layout}' of a CSV file: choose 'columns' or 'rows'")
    elements = [element for element in recording.elements if element.count]
    _refuse_objects(elements)
    pieces = _columns(recording, elements) if layout == "columns" else _rows(recording, elements)
    # the table takes its name first: facts that are older than it would not fit, and are seen through
    with atomic_file(sidecar_of(os.fspath(path))) as beside, atomic_file(path) as file:
        write_all(beside.fileno(), [memoryview(pack(recording, elements))], 0)
        position = 0
        if progress:
            progress(0.0)
        for fraction, text in pieces:
            write_all(file.fileno(), [memoryview(text)], position)
            position += len(text)
            if progress:
                progress(fraction)


def _refuse_objects(elements: Sequence[RecordedElement]) -> None:
    for element in elements:
        for entry in element.entries:
            if entry.values.dtype.hasobject:
                raise SaveError(f"'{entry.name}' holds Python objects, which no file can hold; log numbers or strings")


# ------------------------------------------------------------------------------------------------- one column per entry


def _columns(recording: Recording, elements: Sequence[RecordedElement]) -> Iterator[tuple[float, bytes]]:
    """Pieces of the file with the fraction that is then written."""
    names = [entry.name for element in elements for entry in element.entries]
    yield (
        0.0,
        ",".join(["time", *(_quoted(name) for name in names), TIME_NS]).encode("utf-8", "backslashreplace") + b"\n",
    )
    stamps = len(recording.time_ns)
    large = stamps * (len(names) + 2) >= POLARS_FROM
    make = _polars_lines if large and _polars_can(elements) else _plain_lines
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
    begin = min(element.count, max(0, -((first - start) // divider)))
    end = min(element.count, max(begin, -((first - stop) // divider)))
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


def _polars_can(elements: Sequence[RecordedElement]) -> bool:
    # long double is all that polars has no type for
    wide = any(
        entry.values.dtype.kind == "f" and entry.values.dtype.itemsize > 8 for e in elements for entry in e.entries
    )
    return not wide and find_spec("polars") is not None


def _polars_lines(time_ns: NDArray[np.int64], cells: Sequence[_Cells]) -> bytes:
    import polars

    scale = polars.lit("0.000000001").cast(polars.Decimal(38, 9))
    time = polars.select(polars.Series(time_ns).cast(polars.Decimal(38, 0)) * scale).to_series()
    columns = [time.alias("time")]
    spread: dict[tuple[int, int, int] | None, Any] = {}
    for number, cell in enumerate(cells):
        native = cell.values.astype(cell.values.dtype.newbyteorder("="), copy=False)
        series = polars.Series(str(number), native, strict=False)
        if native.dtype.kind == "U":
            series = series.cast(polars.String)
        if not cell.complete:
            key = (cell.places.start, cell.places.step, len(cell.values)) if isinstance(cell.places, slice) else None
            indices = spread.get(key)
            if indices is None:
                places = np.full(cell.rows, -1, np.int64)
                places[cell.places] = np.arange(len(cell.values))
                indices = polars.Series(places)
                indices = indices.set(indices < 0, None)
                if key is not None:
                    spread[key] = indices
            series = series.gather(indices)
        columns.append(series)
    columns.append(polars.Series(TIME_NS, time_ns))
    text = io.BytesIO()
    # batches of 64 lines: with the 1024 by default wide logs take 2.5 times as long
    polars.DataFrame(columns).write_csv(text, include_header=False, quote_style="non_numeric", batch_size=64)
    return text.getvalue()


def _plain_lines(time_ns: NDArray[np.int64], cells: Sequence[_Cells]) -> bytes:
    columns = [_time_texts(time_ns)]
    for cell in cells:
        texts = _texts(cell.values)
        columns.append(texts if cell.complete else _spread(texts, cell))
    columns.append(list(map(str, time_ns.tolist())))
    lines = map(",".join, zip(*columns, strict=True))
    return ("\n".join(lines) + "\n").encode("utf-8", "backslashreplace")


def _spread(texts: list[str], cell: _Cells) -> list[str]:
    """The texts in their rows, the others empty."""
    column = [""] * cell.rows
    if isinstance(cell.places, slice):
        column[cell.places] = texts
    else:
        for place, text in zip(cell.places.tolist(), texts, strict=True):
            column[place] = text
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


# ---------------------------------------------------------------------------------------------------- one row per entry


def _rows(recording: Recording, elements: Sequence[RecordedElement]) -> Iterator[tuple[float, bytes]]:
    """Pieces of the file with the fraction that is then written; each row ends in a comma, as in the original."""
    stamps = len(recording.time_ns)
    total = recording.entry_count + 2
    times = (recording.time_ns // _SECOND, recording.time_ns % _SECOND)
    for number, (name, values) in enumerate(zip(("time_s", "time_ns"), times, strict=True), start=1):
        yield number / total, _row(f"{recording.prefix}/{name}", _texts(values))
    for element in elements:
        for entry in element.entries:
            number += 1
            cells = _cells(element, entry.values, 0, stamps)
            yield number / total, _row(entry.name, _spread(_texts(cells.values), cells))
    yield 1.0, b""


def _row(name: str, texts: Sequence[str]) -> bytes:
    shown = _quoted(name) if any(character in name for character in '",\r\n') else name
    return ",".join([shown, *texts, "\n"]).encode("utf-8", "backslashreplace")

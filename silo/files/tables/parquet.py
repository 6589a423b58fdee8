"""A recording -> Parquet: one row per tick, one column per entry, null where an element has no sample at a tick, and
where a whole number is missing.

Types are kept (long double becomes float64); units, kinds, labels and dividers stand in the
metadata of the columns. Written in row groups, so that memory stays bounded.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.recording import Progress, RecordedElement, RecordedEntry, Recording, samples_between, silent
from silo.files.bags.ros_types import is_text
from silo.files.optional_packages import need, whole_file
from silo.files.tables.facts import NAME, Place, packed, restored, told_of
from silo.files.texts import presentable, unique_names

# cells of a row group: 64 MB of doubles
_GROUP_CELLS = 8_000_000
_MAX_ROWS = 1 << 16
WRITTEN = {"compression": "zstd", "write_page_checksum": True}


def write_parquet(
    recording: Recording, path: Path, progress: Progress = silent, *, without: str = "", taken: Sequence[str] = ()
) -> None:
    """Write `time_ns` (int64), `time` (UTC, nanoseconds) and one column per entry; complex ones are two columns.

    Columns are called as entries are, but for what `without` says that they begin with; none like one of `taken`.

    Where something happened there is a column `events` too, with its words; all of it, as JSON, is in the metadata,
    as are the recording's `warnings`.

    Raises `SaveError`, and `SiloError` without pyarrow.
    """
    recording = presentable(recording)
    arrow = need("pyarrow", "convert", "Parquet files")
    parquet = need("pyarrow.parquet", "convert", "Parquet files")
    columns = list(_columns(recording))
    events = _events_by_tick(recording)
    wanted = [
        "time_ns",
        "time",
        *(name.removeprefix(without) for name, _, _ in columns),
        *(["events"] if events else []),
    ]
    names = list(map(unique_names(str), [*taken, *wanted]))[len(taken) :]
    time_type = arrow.timestamp("ns", tz="UTC")
    fields = [arrow.field(names[0], arrow.int64(), nullable=False), arrow.field(names[1], time_type, nullable=False)]
    for name, (_, element, values) in zip(names[2:], columns, strict=False):
        fields.append(arrow.field(name, _arrow_type(arrow, values), metadata=_about(element, values.dtype)))
    signals = fields[2:]
    if events:
        fields.append(arrow.field(names[-1], arrow.string(), metadata={"kind": "events"}))
    left = iter(names[2:])
    places: list[Place] = []
    for entry in (entry for element in recording.elements for entry in element.entries):
        parts = [next(left) for _ in _real(entry)]
        places.append((parts[0], len(parts) - 2))  # -1 of one that is alone, 0 of one that the next belongs to
    facts = {NAME: packed(recording, recording.elements, places)}
    schema = arrow.schema(fields, metadata=_about_log(recording) | facts)

    total = len(recording.time_ns)
    rows = max(1, min(_MAX_ROWS, _GROUP_CELLS // len(fields)))
    with whole_file(path) as file, parquet.ParquetWriter(file, schema, **WRITTEN) as writer:
        for start in range(0, total, rows):
            stop = min(start + rows, total)
            stamps = recording.time_ns[start:stop]
            arrays = [arrow.array(stamps), arrow.array(stamps).cast(time_type)]
            arrays += [
                _cells(arrow, field.type, element, values, (start, stop))
                for field, (_, element, values) in zip(signals, columns, strict=True)
            ]
            if events:
                arrays.append(arrow.array([events.get(row) for row in range(start, stop)], type=arrow.string()))
            writer.write_table(arrow.Table.from_arrays(arrays, schema=schema))
            progress(stop / total)


def read_parquet(path: Path, source: Any = None) -> Recording:
    """Open a file that `write_parquet` wrote; a column is read when it is asked for, from `source` if one is given."""
    arrow = need("pyarrow", "convert", "Parquet files")
    parquet = need("pyarrow.parquet", "convert", "Parquet files")

    def column(place: Place, element: RecordedElement, count: int, _: object) -> NDArray[Any]:
        values = _samples(arrow, file, place[0], element, count)
        if place[1] < 0:
            return values
        names = file.schema_arrow.names
        return values + 1j * _samples(arrow, file, names[names.index(place[0]) + 1], element, count)

    with told_of(path):
        file = parquet.ParquetFile(path if source is None else source, page_checksum_verification=True)
        text = (file.schema_arrow.metadata or {}).get(NAME.encode())
        stamps = lambda: file.read(columns=["time_ns"]).column(0).to_numpy()  # noqa: E731
        return restored(path, text, lambda: file.metadata.num_rows, stamps, column)


def _samples(arrow: Any, file: Any, name: str, element: RecordedElement, count: int) -> NDArray[Any]:
    """The cells of a column that are samples of an element; those that are null are missing."""
    rows = arrow.array(element.first + np.arange(count) * element.divider)
    cells = file.read(columns=[name]).column(name).take(rows).combine_chunks()
    is_date = arrow.types.is_timestamp(cells.type) or arrow.types.is_duration(cells.type)  # null is its NaT
    if is_date or not cells.null_count:
        return np.asarray(cells.to_numpy(zero_copy_only=False))
    missing = cells.is_null().to_numpy(zero_copy_only=False)
    zero: object = b"" if arrow.types.is_binary(cells.type) else False if arrow.types.is_boolean(cells.type) else 0
    if arrow.types.is_fixed_size_binary(cells.type):
        zero = b"\0" * cells.type.byte_width
    return np.ma.masked_array(cells.fill_null(zero).to_numpy(zero_copy_only=False), missing)


def _columns(recording: Recording) -> Iterator[tuple[str, RecordedElement, NDArray[Any]]]:
    for element in recording.elements:
        for entry in element.entries:
            for name, values in _real(entry):
                yield name, element, values


def _real(entry: RecordedEntry) -> list[tuple[str, NDArray[Any]]]:
    if entry.values.dtype.kind == "c":
        return [(f"{entry.name}_real", entry.values.real), (f"{entry.name}_imag", entry.values.imag)]
    return [(entry.name, entry.values)]


def _cells(arrow: Any, kind: Any, element: RecordedElement, values: NDArray[Any], window: tuple[int, int]) -> Any:
    """The column's cells of the ticks from `start` to `stop`."""
    start, stop = window
    low, high = samples_between(element.first, element.divider, len(values), start, stop)
    samples, gone = _plain(np.ma.getdata(values[low:high])), np.ma.getmaskarray(values[low:high])
    bytes_first = arrow.binary() if samples.dtype.kind == "S" else kind
    if high - low == stop - start:
        return arrow.array(samples, type=bytes_first, mask=gone if gone.any() else None).cast(kind)
    places = element.first + np.arange(low, high) * element.divider - start
    cells = np.zeros(stop - start, dtype=samples.dtype)
    missing = np.ones(stop - start, dtype=bool)
    cells[places] = samples
    missing[places] = gone
    return arrow.array(cells, type=bytes_first, mask=missing).cast(kind)


def _arrow_type(arrow: Any, values: NDArray[Any]) -> Any:
    dtype = values.dtype
    if dtype.kind == "S":
        return arrow.string() if is_text(values) else arrow.binary()
    if dtype.kind == "U":
        return arrow.string()
    if dtype.kind == "V":
        return arrow.binary(dtype.itemsize)
    return arrow.from_numpy_dtype(_plain(np.empty(0, dtype=dtype)).dtype)


def _plain(values: NDArray[Any]) -> NDArray[Any]:
    """Values of a type that Arrow has: little-endian, at most 8 bytes per number, dates as fine as they were."""
    dtype = values.dtype
    if dtype.kind == "f" and dtype.itemsize > 8:
        with np.errstate(over="ignore", invalid="ignore"):
            return values.astype(np.float64)
    if dtype.kind in "mM" and np.datetime_data(dtype)[0] not in ("s", "ms", "us", "ns"):
        return values.astype(np.int64)
    if dtype.kind == "V":
        return np.array([bytes(value) for value in values.tolist()], dtype=object)
    return np.ascontiguousarray(values.astype(dtype.newbyteorder("="), copy=False))


def _about(element: RecordedElement, dtype: np.dtype[Any]) -> dict[str, str]:
    about = {"unit": element.unit, "kind": element.kind, "element": element.name, "divider": str(element.divider)}
    about |= {"buffer": element.buffer_type.name, "type": dtype.str}
    if element.lost:
        about["lost"] = str(element.lost)
    if element.failures.count:
        about["failures"] = msgspec.json.encode(element.failures).decode()
    if element.description:
        about["description"] = element.description
    labels = element.entries[0].entry.labels
    if labels:
        about["labels"] = msgspec.json.encode(labels).decode()
    return about


def _about_log(recording: Recording) -> dict[str, str]:
    frequency = "" if recording.frequency_hz is None else str(recording.frequency_hz)
    about = {"logger": recording.logger, "frequency_hz": frequency, "started_ns": str(recording.started_ns)}
    if recording.warnings:
        about["warnings"] = msgspec.json.encode(list(recording.warnings)).decode()
    if recording.events:
        about["events"] = msgspec.json.encode(recording.events).decode()
    return about


def _events_by_tick(recording: Recording) -> dict[int, str]:
    """What happened at each tick that is kept, in words, by its row; more than one thing in lines."""
    first = recording.offset - len(recording.time_ns)
    told: dict[int, str] = {}
    for event in recording.events:
        if 0 <= event.tick - first < len(recording.time_ns):
            place = event.tick - first
            line = f"{event.kind}: {event.text}"
            told[place] = f"{told[place]}\n{line}" if place in told else line
    return told

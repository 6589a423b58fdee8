"""A recording -> a `.silo` file.

A snapshot is row-major (one row per tick), the file is column-major (all values of an entry in a row), so that writing
is one big transposition. It runs in tiles that stay in the cache, where checksums are taken too, with a few MB of
memory whatever the size of the log. The header, which has them, is written last. Nothing here waits for anybody or
changes the recording.
"""

import errno
import functools
import os
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.wide import to_wire
from silo.core.recording import Progress, RecordedEntry, Recording, silent
from silo.errors import SaveError
from silo.files.atomic import atomic_file, write_all
from silo.files.silo import format as form
from silo.files.silo.missing import in_doubles

TILE_COLUMNS = 16
TILE_ROWS = 16384
TILE_BYTES = 4 << 20
BLOCK_ROWS = 1024
_SLOT = 16


# a name of the table, what stands behind it, and what fills in samples as they stand in the file
_Source = tuple[str, form.TableLine, Callable[[int, int, NDArray[np.uint8]], None]]


@dataclass(frozen=True)
class LineValues:
    """The values of a table line, `number` in the table: `fill(start, stop, out)` writes samples as in the file."""

    line: form.TableLine
    number: int
    offset: int
    fill: Callable[[int, int, NDArray[np.uint8]], None]


def write_silo(recording: Recording, path: str | os.PathLike[str], progress: Progress = silent) -> None:
    """Save a recording as `.silo`: atomically, so that under `path` stands the whole file or what stood there before.

    `progress` is called with the fraction written, from 0 to 1. Elements without a sample are left out, as the format
    wants it. Raises `SaveError` when the system refuses, and for values that no file can hold (Python objects).
    """
    elements = [in_doubles(element) for element in recording.elements if element.count]
    stamps = len(recording.time_ns)
    sources: list[_Source] = []
    facts: list[bytes] = [form.facts_line(form.LOG_FACTS, form.log_facts(recording))]
    for name, part in (("time_s", np.floor_divide), ("time_ns", np.remainder)):
        line = form.TableLine(8, stamps, 1, recording.time_looping, "int64")
        sources.append((f"{recording.prefix}/{name}", line, _of_seconds(recording.time_ns, part)))
    for element in elements:
        looping, first = form.looping_and_first(element, stamps, recording.offset)
        facts.append(form.facts_line(form.ELEMENT_FACTS, form.element_facts(element, first)))
        sources += [_source(entry, element.divider, looping) for entry in element.entries]
    facts += [form.facts_line(form.EVENT_FACTS, form.plain_texts(event)) for event in recording.events]
    sums = [0] * len(sources)
    length = len(_header(os.fspath(path), recording.offset, sources, facts, sums))
    columns = list(_placed(sources, length))
    with atomic_file(path) as file:
        _reserve(file.fileno(), length + sum(column.line.size_bytes for column in columns))
        _write_columns(file.fileno(), columns, sums, progress)
        header = _header(os.fspath(path), recording.offset, sources, facts, sums)
        write_all(file.fileno(), [memoryview(header)], 0)


def _reserve(file_descriptor: int, size: int) -> None:
    """Claim the room on the disk: a full one refuses at once, and ext4 takes the data in a third of the time."""
    try:
        os.posix_fallocate(file_descriptor, 0, size)
    except OSError as error:
        # some file systems can't; the writes then find out whether there is room
        if error.errno not in (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS, errno.ENODEV):
            raise


def _header(path: str, offset: int, sources: Sequence[_Source], facts: list[bytes], sums: Sequence[int]) -> bytes:
    shown = form.table_name(path).replace("Binary Data", "Binary_Data")
    before = b"".join(
        [
            form.BANNER,
            form.encode_text(f"# Log File: {shown}\n"),
            form.OFFSET_LINE,
            b"%d\n" % offset,
            form.COUNT_LINE,
            b"%d\n" % len(sources),
            form.TABLE_LINE,
            *(form.format_row(name, line) for name, line, _ in sources),
            *facts,
            form.sums_line(sums),
        ]
    )
    check = form.CHECK + form.checksum(before + form.DATA_LINE) + b" "
    # dots up to an aligned offset: doubles are then aligned in the memory map
    length = len(before) + len(check) + 1 + len(form.DATA_LINE)
    return before + check + b"." * (-length % form.ALIGNMENT) + b"\n" + form.DATA_LINE


def _source(entry: RecordedEntry, divider: int, looping: bool) -> _Source:
    values = entry.values
    if values.dtype.hasobject:
        raise SaveError(f"'{entry.name}' holds Python objects, which no file can hold; log numbers or strings")
    if values.dtype.kind in "SU":
        width, fill = _strings(values)
        item_bytes, type_name = width, "string"
    else:
        dtype = form.file_dtype(values.dtype)
        item_bytes, type_name, fill = dtype.itemsize, form.type_name(dtype), _numbers(values, dtype)
    return form.table_name(entry.name), form.TableLine(item_bytes, len(values), divider, looping, type_name), fill


def _numbers(values: NDArray[Any], dtype: np.dtype[Any]) -> Callable[[int, int, NDArray[np.uint8]], None]:
    # dates to int64 and bool to uint8 by looking at the same bytes, which keeps NaT and their order of bytes
    if values.dtype.kind in "mM":
        values = values.view(np.dtype("i8").newbyteorder(values.dtype.byteorder))
    elif values.dtype.kind == "b":
        values = values.view(np.uint8)

    if dtype.itemsize != values.dtype.itemsize:
        # the processor would make quiet NaNs of signalling ones
        return lambda start, stop, out: np.copyto(out.view(dtype), to_wire(values[start:stop], dtype.str))

    return functools.partial(_fill, values, dtype)


def _fill(values: NDArray[Any], dtype: np.dtype[Any], start: int, stop: int, out: NDArray[np.uint8]) -> None:
    out.view(dtype)[:] = values[start:stop]


def _strings(values: NDArray[Any]) -> tuple[int, Callable[[int, int, NDArray[np.uint8]], None]]:
    """The bytes of the longest string, and a fill that pads the others with dashes to that length."""
    longest = 0
    for start in range(0, len(values), TILE_ROWS):
        longest = max(longest, int(np.char.str_len(_as_bytes(values[start : start + TILE_ROWS])).max()))

    def fill(start: int, stop: int, out: NDArray[np.uint8]) -> None:
        texts = _as_bytes(values[start:stop]).astype(f"S{longest}")
        lengths = np.char.str_len(texts)
        letters = texts.view(np.uint8).reshape(len(texts), longest)
        missing = np.arange(longest) >= lengths[:, None]
        out.reshape(letters.shape)[:] = np.where(missing, np.uint8(form.STRING_PAD), letters)

    return longest, fill


def _as_bytes(values: NDArray[Any]) -> NDArray[np.bytes_]:
    if values.dtype.kind == "U":
        return np.char.encode(values, "utf-8", "backslashreplace")
    return np.ascontiguousarray(values)


def _of_seconds(time_ns: NDArray[np.int64], part: np.ufunc) -> Callable[[int, int, NDArray[np.uint8]], None]:
    def fill(start: int, stop: int, out: NDArray[np.uint8]) -> None:
        part(time_ns[start:stop], 1_000_000_000, out=out.view("<i8"))

    return fill


def _placed(sources: Sequence[_Source], start: int) -> Iterator[LineValues]:
    for number, (_, line, fill) in enumerate(sources):
        if line.size_bytes:
            yield LineValues(line, number, start, fill)
        start += line.size_bytes


def _write_columns(file_descriptor: int, columns: list[LineValues], sums: list[int], progress: Progress) -> None:
    """Write the values, and put the checksum of each line into `sums`."""
    total = sum(column.line.size_bytes for column in columns)
    written = 0
    progress(0.0)
    tile = np.empty(0, np.uint8)
    for first in range(0, len(columns), TILE_COLUMNS):
        band = columns[first : first + TILE_COLUMNS]
        row_bytes = sum(column.line.item_bytes for column in band)
        rows = max(BLOCK_ROWS, min(TILE_ROWS, TILE_BYTES // row_bytes), 1)
        count = max(column.line.samples for column in band)
        # one buffer for all tiles: fresh memory for each costs a third of the time in page faults
        needed = row_bytes * min(rows, count) + _SLOT * len(band)
        tile = tile if len(tile) >= needed else np.empty(needed, np.uint8)
        for start in range(0, count, rows):
            written += _write_tile(file_descriptor, band, start, rows, tile, sums)
            progress(written / total)
    if not total:
        progress(1.0)


def _write_tile(
    file_descriptor: int, band: list[LineValues], start: int, rows: int, tile: NDArray[np.uint8], sums: list[int]
) -> int:
    """Transpose samples `start ... start + rows` of a few columns, sum and write them; returns the bytes written."""
    columns = [column for column in band if column.line.samples > start]
    stops = [min(column.line.samples, start + rows) for column in columns]
    sizes = [column.line.item_bytes * (stop - start) for column, stop in zip(columns, stops, strict=True)]
    slots = np.concatenate(([0], np.cumsum([-(-size // _SLOT) * _SLOT for size in sizes])))
    pieces = [tile[slot : slot + size] for slot, size in zip(slots.tolist(), sizes, strict=False)]
    # a block of rows of all columns at a time: neighbouring words of a row share cache lines
    for block in range(start, max(stops), BLOCK_ROWS):
        for column, stop, piece in zip(columns, stops, pieces, strict=True):
            end = min(stop, block + BLOCK_ROWS)
            if block < end:
                size = column.line.item_bytes
                column.fill(block, end, piece[(block - start) * size : (end - start) * size])
    run: list[memoryview] = []
    run_offset = run_end = 0
    for column, piece in zip(columns, pieces, strict=True):
        sums[column.number] = zlib.crc32(piece.data, sums[column.number])
        offset = column.offset + start * column.line.item_bytes
        if offset != run_end:
            write_all(file_descriptor, run, run_offset)
            run, run_offset = [], offset
        run.append(piece.data)
        run_end = offset + piece.nbytes
    write_all(file_descriptor, run, run_offset)
    return sum(sizes)

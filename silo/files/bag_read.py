"""Reading bags that silo wrote, back into a `Recording` with every value bit for bit.

The facts attachment says where in which message each value stands; the message index says where in a chunk each
message stands; so a chunk is read with one indexed load per channel. A file that was cut off gives what is whole, with
a warning. Bags of others have no facts: `FileFormatError` says so.
"""

import mmap
import os
import struct
import zlib
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import zstandard
from mcap.opcode import Opcode
from numpy.typing import NDArray

from silo.errors import FileFormatError, LogNotFoundError
from silo.files.atomic import reason
from silo.files.bag_facts import (
    FACTS_ATTACHMENT,
    FACTS_VERSION,
    TIME_ATTACHMENT,
    ElementFacts,
    EntryFacts,
    RecordingFacts,
    unpack_facts,
    unpack_times,
)
from silo.files.bag_groups import RECORD_HEAD
from silo.files.mcap_write import MAGIC
from silo.files.ros_types import STRING
from silo.files.silo_format import dtype_from
from silo.files.wide import from_wire
from silo.recording import RecordedElement, RecordedEntry, Recording

_INDEX_ENTRY = np.dtype([("time", "<u8"), ("offset", "<u8")])


def read_bag(path: str | os.PathLike[str]) -> Recording:
    """The recording in a bag that silo wrote: a rosbag2 folder or an `.mcap` file.

    A truncated file gives the samples that are whole; `Recording.warnings` says what is missing. Raises
    `LogNotFoundError` if it can't be opened, `FileFormatError` for damaged files and for bags of others.
    """
    file = _storage_file(Path(path))
    try:
        with file.open("rb") as opened:
            if os.fstat(opened.fileno()).st_size == 0:
                raise FileFormatError(f"{file}: the file is empty")
            # the map ends with its last view, whoever holds it
            data = memoryview(mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ))
    except OSError as error:
        raise LogNotFoundError(f"can't open '{file}': {reason(error)}") from error
    try:
        return _read(data)
    except (struct.error, ValueError, IndexError, OverflowError, TypeError, MemoryError) as error:
        # every field of a damaged file may hold anything
        raise FileFormatError(f"{file}: {error}") from error
    except (zstandard.ZstdError, msgspec.MsgspecError) as error:
        raise FileFormatError(f"{file}: damaged: {error}") from error


def _storage_file(path: Path) -> Path:
    if not path.exists():
        raise LogNotFoundError(f"there is no file or folder '{path}'")
    if not path.is_dir():
        return path
    files = sorted(path.glob("*.mcap"))
    if len(files) != 1:
        raise FileFormatError(f"{path}: a bag that silo wrote holds one .mcap file, this folder holds {len(files)}")
    return files[0]


class _Values:
    """Grows the values of one element while chunks are read."""

    def __init__(self, facts: ElementFacts, messages: int) -> None:
        self.facts = facts
        # a damaged count must not reserve memory that the file can't fill
        room = min(facts.count, messages)
        self.arrays = [np.zeros(room, dtype=_dtype(entry)) for entry in facts.entries]
        self.filled = [0] * len(facts.entries)

    def add(self, index: int, values: NDArray[Any]) -> None:
        start = self.filled[index]
        self.arrays[index][start : start + len(values)] = values
        self.filled[index] = start + len(values)

    @property
    def whole(self) -> int:
        return min(self.filled, default=0)


def _read(data: memoryview) -> Recording:
    if bytes(data[: len(MAGIC)]) != MAGIC:
        raise FileFormatError("not an MCAP file: it doesn't start with the MCAP mark")
    facts: RecordingFacts | None = None
    times: NDArray[np.int64] | None = None
    elements: list[_Values] = []
    readers: dict[int, _ChannelReader] = {}
    chunk: bytes | None = None
    complete = False
    for opcode, body in _records(data):
        if opcode == Opcode.ATTACHMENT:
            name, content = _attachment(body)
            if name == FACTS_ATTACHMENT:
                facts = unpack_facts(content)
                if facts.version != FACTS_VERSION:
                    raise ValueError(f"layout version {facts.version} is newer than this silo reads ({FACTS_VERSION})")
                # a message takes at least an index entry
                elements = [_Values(element, len(data) // _INDEX_ENTRY.itemsize) for element in facts.elements]
                readers = _channel_readers(facts, elements)
            elif name == TIME_ATTACHMENT:
                times = unpack_times(content)
        elif opcode == Opcode.CHUNK:
            chunk = _unpack_chunk(body)
        elif opcode == Opcode.MESSAGE_INDEX and chunk is not None:
            channel, size = struct.unpack_from("<HI", body)
            entries = np.frombuffer(body[6 : 6 + size], dtype=_INDEX_ENTRY)
            if channel in readers:
                readers[channel].add(chunk, entries["offset"])
        elif opcode == Opcode.DATA_END:
            complete = bytes(data[-len(MAGIC) :]) == MAGIC
            break
    if facts is None or times is None:
        raise ValueError(
            "this bag was not written by silo, or was cut off before its table"
            if complete or facts is None
            else "cut off before its time stamps"
        )
    return _recording(facts, times, elements, complete)


def _records(data: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Opcode and content of each whole record; stops at the first that is cut off."""
    at = len(MAGIC)
    while at + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, at)
        at += 9
        if at + length > len(data):
            return
        yield opcode, data[at : at + length]
        at += length


def _attachment(body: memoryview) -> tuple[str, bytes]:
    at = 16
    texts = []
    for _ in range(2):
        (length,) = struct.unpack_from("<I", body, at)
        texts.append(bytes(body[at + 4 : at + 4 + length]))
        at += 4 + length
    (size,) = struct.unpack_from("<Q", body, at)
    content = bytes(body[at + 8 : at + 8 + size])
    (checksum,) = struct.unpack_from("<I", body, at + 8 + size)
    if zlib.crc32(body[:-4]) != checksum:
        raise ValueError(f"attachment {texts[0].decode(errors='replace')!r} is damaged: wrong checksum")
    return texts[0].decode(), content


def _unpack_chunk(body: memoryview) -> bytes:
    _, _, size, checksum, length = struct.unpack_from("<QQQII", body)
    compression = bytes(body[32 : 32 + length])
    (packed,) = struct.unpack_from("<Q", body, 32 + length)
    content = body[40 + length : 40 + length + packed]
    if compression == b"zstd":
        if zstandard.frame_content_size(bytes(content[:32])) != size:
            raise ValueError("a chunk is damaged: it has not the size that it announces")
        chunk = zstandard.decompress(content)
    elif compression:
        raise ValueError(f"a chunk is compressed with {compression.decode(errors='replace')!r}, not with zstd")
    else:
        chunk = bytes(content)
    if zlib.crc32(chunk) != checksum:
        raise ValueError("a chunk is damaged: wrong checksum")
    return chunk


class _ChannelReader:
    """Takes the values of one channel out of chunks."""

    def __init__(self, size: int) -> None:
        self._size = RECORD_HEAD + size
        self._targets: list[tuple[EntryFacts, _Values, int]] = []

    def aim(self, entry: EntryFacts, values: _Values, index: int) -> None:
        self._targets.append((entry, values, index))

    @cached_property
    def _layout(self) -> np.dtype[np.void]:
        """A message record, of which only the values have names: their number in the list of targets."""
        entries = [entry for entry, _, _ in self._targets]
        formats: list[Any] = [e.wire if e.wire_count == 1 else (e.wire, (e.wire_count,)) for e in entries]
        return np.dtype(
            {
                "names": [str(k) for k in range(len(entries))],
                "formats": formats,
                "offsets": [RECORD_HEAD + entry.offset for entry in entries],
                "itemsize": self._size,
            }
        )

    @cached_property
    def _columns(self) -> list[tuple[str, np.dtype[Any], _Values, int]]:
        return [(str(k), _dtype(entry), values, index) for k, (entry, values, index) in enumerate(self._targets)]

    def add(self, chunk: bytes, offsets: NDArray[np.uint64]) -> None:
        if len(offsets) == 0:
            return
        if int(offsets.max()) >= len(chunk):
            raise ValueError("a message index points out of its chunk")
        places = offsets.astype(np.int64)
        if self._targets[0][0].wire == STRING:
            self._add_strings(chunk, places)
            return
        rows = _overlapping(chunk, self._layout)[places]
        for name, dtype, values, index in self._columns:
            values.add(index, from_wire(rows[name], dtype))

    def _add_strings(self, chunk: bytes, places: NDArray[np.int64]) -> None:
        entry, values, index = self._targets[0]
        start = places + RECORD_HEAD + entry.offset + 4
        lengths = _overlapping(chunk, np.dtype("<u4"))[start - 4].astype(np.int64) - 1
        texts: list[Any] = [chunk[at : at + size] for at, size in zip(start.tolist(), lengths.tolist(), strict=True)]
        dtype = _dtype(entry)
        if dtype.kind == "U":
            texts = [text.decode() for text in texts]
        values.add(index, np.array(texts, dtype=dtype))


def _overlapping(chunk: bytes, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Items of `dtype` that start at every byte of the chunk; an index too far is an `IndexError`."""
    if len(chunk) < dtype.itemsize:
        raise ValueError("a message is cut off at the end of its chunk")
    # as_strided does the same in three times as long
    items: NDArray[Any] = np.ndarray((len(chunk) - dtype.itemsize + 1,), dtype, chunk, 0, (1,))
    return items


def _channel_readers(facts: RecordingFacts, elements: list[_Values]) -> dict[int, _ChannelReader]:
    readers: dict[int, _ChannelReader] = {}
    for values in elements:
        for index, entry in enumerate(values.facts.entries):
            if entry.channel not in readers:
                readers[entry.channel] = _ChannelReader(facts.channel_sizes[entry.channel])
            readers[entry.channel].aim(entry, values, index)
    return readers


def _dtype(entry: EntryFacts) -> np.dtype[Any]:
    dtype = dtype_from(entry.dtype)
    if dtype is None:
        raise ValueError(f"{entry.name}: type {entry.dtype} can't stand in a file")
    return dtype


def _recording(facts: RecordingFacts, times: NDArray[np.int64], elements: list[_Values], complete: bool) -> Recording:
    warnings = list(facts.warnings)
    missing = sum(values.facts.count - values.whole for values in elements if values.facts.entries)
    if missing:
        warnings.append(f"the file is cut off: {missing} samples are missing at the end")
    elif not complete:
        warnings.append("the file is cut off: its index is missing, which other readers need; all samples are there")
    return Recording(
        logger=facts.logger,
        time_ns=times,
        offset=facts.offset,
        elements=tuple(_element(values) for values in elements),
        prefix=facts.prefix,
        frequency_hz=facts.frequency_hz,
        started_ns=facts.started_ns,
        time_looping=facts.time_looping,
        warnings=tuple(warnings),
        extras=facts.extras,
        events=facts.events,
    )


def _element(values: _Values) -> RecordedElement:
    facts = values.facts
    return RecordedElement(
        name=facts.name,
        unit=facts.unit,
        kind=facts.kind,
        shape=facts.shape,
        divider=facts.divider,
        buffer_type=facts.buffer_type,
        first=facts.first,
        entries=tuple(
            RecordedEntry(entry.name, entry.entry, array[: values.whole])
            for entry, array in zip(facts.entries, values.arrays, strict=True)
        ),
        description=facts.description,
        lost=facts.lost,
        dtype=facts.dtype,
        failures=facts.failures,
    )

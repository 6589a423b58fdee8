"""Values out of the chunks of a bag that silo wrote: one indexed load per channel and chunk.

Facts say where in which message each value stands, the message index where in its chunk each message stands.
"""

import struct
import zlib
from functools import cached_property
from typing import Any

import numpy as np
import zstandard
from numpy.typing import NDArray

from silo.files.bag_facts import ElementFacts, EntryFacts, RecordingFacts
from silo.files.bag_groups import RECORD_HEAD
from silo.files.ros_types import STRING
from silo.files.silo_format import dtype_from
from silo.files.wide import from_wire

INDEX_ENTRY = np.dtype([("time", "<u8"), ("offset", "<u8")])


class Values:
    """Grows the values of one element while chunks are read."""

    def __init__(self, facts: ElementFacts, messages: int) -> None:
        self.facts = facts
        # a damaged count must not reserve memory that the file can't fill
        self.reserve(min(facts.count, messages))

    def reserve(self, room: int) -> None:
        """Begin anew, with room for so many samples."""
        self.arrays = [np.zeros(room, dtype=entry_dtype(entry)) for entry in self.facts.entries]
        self.filled = [0] * len(self.facts.entries)

    def add(self, index: int, values: NDArray[Any]) -> None:
        """Append values of one entry."""
        start = self.filled[index]
        self.arrays[index][start : start + len(values)] = values
        self.filled[index] = start + len(values)

    @property
    def whole(self) -> int:
        """Samples that all entries have."""
        return min(self.filled, default=0)


def unpack_chunk(body: memoryview) -> bytes:
    """The records of a chunk. Raises ValueError or ZstdError for one that is damaged."""
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


class ChannelReader:
    """Takes the values of one channel out of chunks."""

    def __init__(self, size: int) -> None:
        self._size = RECORD_HEAD + size
        self._targets: list[tuple[EntryFacts, Values, int]] = []

    def aim(self, entry: EntryFacts, values: Values, index: int) -> None:
        """Have an entry of the messages appended to `values`, as number `index`."""
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
    def _columns(self) -> list[tuple[str, np.dtype[Any], Values, int]]:
        return [(str(k), entry_dtype(entry), values, index) for k, (entry, values, index) in enumerate(self._targets)]

    def add(self, chunk: bytes, offsets: NDArray[np.uint64]) -> None:
        """Take the values of the messages at these places in a chunk."""
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
        dtype = entry_dtype(entry)
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


def channel_readers(facts: RecordingFacts, elements: list[Values]) -> dict[int, ChannelReader]:
    """A reader of each channel, which fills the values of the elements."""
    readers: dict[int, ChannelReader] = {}
    for values in elements:
        for index, entry in enumerate(values.facts.entries):
            if entry.channel not in readers:
                readers[entry.channel] = ChannelReader(facts.channel_sizes[entry.channel])
            readers[entry.channel].aim(entry, values, index)
    return readers


def entry_dtype(entry: EntryFacts) -> np.dtype[Any]:
    """The type of an entry's values. Raises ValueError for one that no file can hold."""
    dtype = dtype_from(entry.dtype)
    if dtype is None:
        raise ValueError(f"{entry.name}: type {entry.dtype} can't stand in a file")
    return dtype

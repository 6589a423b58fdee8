"""Elements of a whole bag that silo wrote, each read when it is asked for: by the index behind the chunks.

An element alone costs unpacking the chunks that hold its messages, and nothing for the other elements' messages; who
asks for several gets the rest in one more pass. Used by `silo.files.bag_read`.
"""

import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import overload

import msgspec
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Statistics
from numpy.typing import NDArray

from silo.errors import FileFormatError
from silo.files.bag_channels import INDEX_ENTRY, Values, channel_readers, unpack_chunk
from silo.files.bag_facts import RecordingFacts
from silo.files.mcap_write import MAGIC
from silo.recording import RecordedElement, RecordedEntry

ALONE = 3  # so many elements are read one by one; each costs about as much as unpacking all chunks
_HEAD = struct.Struct("<BQ")  # of a record: opcode, length
_CHUNK = struct.Struct("<QQQQI")  # of a chunk index: first and last time, where, length, bytes of the offsets
_OFFSET = np.dtype([("channel", "<u2"), ("offset", "<u8")])
_FOOTER = struct.Struct("<BQQQI")


@dataclass(frozen=True)
class Index:
    """What the summary says: attachments by name with place and length, messages per channel, chunks.

    A chunk is where it begins, its length, and where the message index of each channel begins, shape `(channels,)`.
    """

    attachments: Mapping[str, tuple[int, int]]
    counts: Mapping[int, int]
    chunks: Sequence[tuple[int, int, NDArray[np.void]]]


def read_index(data: memoryview) -> Index | None:
    """The summary of a finished MCAP file, None where there is none or it is damaged."""
    end = len(data) - len(MAGIC) - _FOOTER.size
    if end < len(MAGIC) or bytes(data[-len(MAGIC) :]) != MAGIC:
        return None
    opcode, length, start, _, checksum = _FOOTER.unpack_from(data, end)
    if opcode != Opcode.FOOTER or length != _FOOTER.size - _HEAD.size or not len(MAGIC) <= start < end:
        return None
    # the footer counts up to its checksum, which others may leave out
    if checksum and zlib.crc32(data[start : end + _FOOTER.size - 4]) != checksum:
        return None
    attachments: dict[str, tuple[int, int]] = {}
    counts: Mapping[int, int] = {}
    chunks: list[tuple[int, int, NDArray[np.void]]] = []
    at = start
    while at < end:
        opcode, length = _HEAD.unpack_from(data, at)
        body = data[at + _HEAD.size : at + _HEAD.size + length]
        if opcode == Opcode.ATTACHMENT_INDEX:
            one = AttachmentIndex.read(ReadDataStream(BytesIO(body)))
            attachments[one.name] = (one.offset, one.length)
        elif opcode == Opcode.STATISTICS:
            counts = Statistics.read(ReadDataStream(BytesIO(body))).channel_message_counts
        elif opcode == Opcode.CHUNK_INDEX:
            _, _, place, size, taken = _CHUNK.unpack_from(body)
            chunks.append((place, size, np.frombuffer(body[_CHUNK.size : _CHUNK.size + taken], _OFFSET)))
        at += _HEAD.size + length
    return Index(attachments, counts, chunks)


def record_at(data: memoryview, at: int, opcode: int) -> memoryview:
    """The body of the record that begins there. Raises ValueError if there is another one, or none."""
    if at + _HEAD.size > len(data):
        raise ValueError("the index points out of the file")
    found, length = _HEAD.unpack_from(data, at)
    if found != opcode or at + _HEAD.size + length > len(data):
        raise ValueError("the index points at something else")
    return data[at + _HEAD.size : at + _HEAD.size + length]


@contextmanager
def damage_told(file: Path) -> Iterator[None]:
    """Turn what a damaged file leads to, whose fields may hold anything, into FileFormatError."""
    try:
        yield
    except (struct.error, ValueError, IndexError, OverflowError, TypeError, MemoryError) as error:
        raise FileFormatError(f"{file}: {error}") from error
    except (zstandard.ZstdError, msgspec.MsgspecError) as error:
        raise FileFormatError(f"{file}: damaged: {error}") from error


class BagElements(Sequence[RecordedElement]):
    """The elements of a bag, each read when it is first asked for; `names` are there at once."""

    def __init__(self, file: Path, data: memoryview, facts: RecordingFacts, index: Index) -> None:
        self._file = file
        self._data = data
        self._facts = facts
        self._index = index
        self._made: dict[int, RecordedElement] = {}

    @property
    def names(self) -> list[str]:
        """The names of the elements, in their order."""
        return [facts.name for facts in self._facts.elements]

    @property
    def entry_names(self) -> list[list[str]]:
        """The names of the scalars of each element."""
        return [[entry.name for entry in facts.entries] for facts in self._facts.elements]

    def __len__(self) -> int:
        return len(self._facts.elements)

    @overload
    def __getitem__(self, index: int) -> RecordedElement: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[RecordedElement, ...]: ...
    def __getitem__(self, index: int | slice) -> RecordedElement | tuple[RecordedElement, ...]:
        if isinstance(index, slice):
            return tuple(self._elements(list(range(*index.indices(len(self))))))
        if not -len(self) <= index < len(self):
            raise IndexError(f"no element {index}: the log has {len(self)}")
        place = index % len(self)
        several = place not in self._made and len(self._made) >= ALONE
        return self._elements(list(range(len(self))) if several else [place])[place if several else 0]

    def __iter__(self) -> Iterator[RecordedElement]:
        return iter(self._elements(list(range(len(self)))))

    def _elements(self, places: list[int]) -> list[RecordedElement]:
        missing = [place for place in places if place not in self._made]
        if missing:
            with damage_told(self._file):
                self._made.update(zip(missing, self._read(missing), strict=True))
        return [self._made[place] for place in places]

    def _read(self, places: list[int]) -> list[RecordedElement]:
        # a damaged count must not reserve memory that the file can't fill
        most = len(self._data) // INDEX_ENTRY.itemsize
        elements = [Values(self._facts.elements[place], most) for place in places]
        readers = channel_readers(self._facts, elements)
        wanted = np.array(sorted(readers), np.uint16)
        for place, _, offsets in self._index.chunks:
            here = offsets[np.isin(offsets["channel"], wanted)]
            if not len(here):
                continue
            chunk = unpack_chunk(record_at(self._data, place, Opcode.CHUNK))
            for at in here["offset"].tolist():
                body = record_at(self._data, at, Opcode.MESSAGE_INDEX)
                channel, size = struct.unpack_from("<HI", body)
                readers[channel].add(chunk, np.frombuffer(body[6 : 6 + size], INDEX_ENTRY)["offset"])
        short = [values.facts.name for values in elements if values.facts.entries and values.whole < values.facts.count]
        if short:
            raise ValueError(f"damaged: {', '.join(short[:5])} has fewer samples than its table says")
        return [recorded(values) for values in elements]


def recorded(values: Values) -> RecordedElement:
    """An element with the samples of it that are whole."""
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

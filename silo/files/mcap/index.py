"""What stands where in an MCAP file: by its summary, or by its records where that is missing or damaged."""

import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Statistics
from numpy.typing import NDArray

from silo.files.mcap.chunks import INDEX_ENTRY, RECORD, records
from silo.files.mcap.damage import DAMAGE
from silo.files.mcap.writer import MAGIC

_CHUNK = struct.Struct("<QQQQI")  # of a chunk index: first and last time, where, length, bytes of the offsets
_OFFSET = np.dtype([("channel", "<u2"), ("offset", "<u8")])
_FOOTER = struct.Struct("<BQQQI")


class IndexedChunk(NamedTuple):
    """Where a chunk begins, its length, and where the message index of each channel begins, shape `(channels,)`.

    `rows` of each channel are in it where that is known, and `skipped` are missing before them: of parts.
    """

    at: int
    length: int
    offsets: NDArray[np.void]
    rows: int | None = None
    skipped: int = 0


@dataclass(frozen=True)
class Index:
    """Attachments by name with place and length, messages per channel, chunks.

    Of a summary `definitions` are its records of schemas and channels. `complete`: the file has its end.
    """

    attachments: Mapping[str, tuple[int, int]]
    counts: Mapping[int, int]
    chunks: Sequence[IndexedChunk]
    definitions: Sequence[tuple[int, memoryview]] = ()
    complete: bool = True


def read_index(data: memoryview) -> Index | None:
    """The summary of a finished MCAP file, None where there is none or it is damaged."""
    end = len(data) - len(MAGIC) - _FOOTER.size
    if end < len(MAGIC) or bytes(data[-len(MAGIC) :]) != MAGIC:
        return None
    opcode, length, start, _, checksum = _FOOTER.unpack_from(data, end)
    if opcode != Opcode.FOOTER or length != _FOOTER.size - RECORD.size or not len(MAGIC) <= start < end:
        return None
    # the footer counts up to its checksum, which others may leave out
    if checksum and zlib.crc32(data[start : end + _FOOTER.size - 4]) != checksum:
        return None
    try:
        return _summary(data[:end], start)
    except DAMAGE:
        return None  # it has no checksum, or one of what is wrong: the file is read by its records


def _summary(data: memoryview, start: int) -> Index:
    attachments: dict[str, tuple[int, int]] = {}
    counts: Mapping[int, int] = {}
    chunks: list[IndexedChunk] = []
    definitions: list[tuple[int, memoryview]] = []
    end = start
    for opcode, at, body in records(data, start):
        end = at + RECORD.size + len(body)
        if opcode == Opcode.ATTACHMENT_INDEX:
            one = parsed(AttachmentIndex, body)
            attachments[one.name] = (one.offset, one.length)
        elif opcode == Opcode.STATISTICS:
            counts = parsed(Statistics, body).channel_message_counts
        elif opcode == Opcode.CHUNK_INDEX:
            _, _, place, size, taken = _CHUNK.unpack_from(body)
            offsets = np.frombuffer(body[_CHUNK.size : _CHUNK.size + taken], _OFFSET)
            chunks.append(IndexedChunk(place, size, offsets))
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            definitions.append((opcode, body))
    if end != len(data):
        raise ValueError("a record of the summary ends elsewhere")
    return Index(attachments, counts, chunks, definitions)


@dataclass
class IndexedRecord:
    """A record, of a chunk with the message index behind it: `index` has a body per channel."""

    opcode: int
    at: int
    body: memoryview
    index: list[memoryview] = field(default_factory=list)

    @property
    def end(self) -> int:
        """Where the next record begins."""
        return self.at + RECORD.size + len(self.body)

    @property
    def indexed(self) -> Iterator[tuple[int, int, int]]:
        """Of each channel in its index: its number, how many messages, and where their entries begin."""
        at = self.end
        for body in self.index:
            if len(body) >= ENTRIES_AT:
                channel, size = _INDEXED.unpack_from(body)
                yield channel, size // INDEX_ENTRY.itemsize, at
            at += RECORD.size + len(body)

    @property
    def index_end(self) -> int:
        """Where its index ends."""
        return self.end + sum(RECORD.size + len(one) for one in self.index)


def indexed_records(data: memoryview) -> Iterator[IndexedRecord]:
    """The whole records of a file; the index of the last chunk may be cut off."""
    last: IndexedRecord | None = None
    for opcode, at, body in records(data, len(MAGIC)):
        if opcode == Opcode.MESSAGE_INDEX and last is not None and last.opcode == Opcode.CHUNK:
            last.index.append(body)
            continue
        if last is not None:
            yield last
        last = IndexedRecord(opcode, at, body)
    if last is not None:
        yield last


def walked_index(data: memoryview) -> Index:
    """What is whole of a file that may be cut off. Raises ValueError, struct.error for a damaged attachment."""
    attachments: dict[str, tuple[int, int]] = {}
    counts: dict[int, int] = {}
    chunks: list[IndexedChunk] = []
    complete = False
    for record in indexed_records(data):
        if record.opcode == Opcode.CHUNK:
            offsets: list[tuple[int, int]] = []
            for channel, count, place in record.indexed:
                counts[channel] = counts.get(channel, 0) + count
                offsets.append((channel, place))
            chunks.append(IndexedChunk(record.at, record.end - record.at, np.array(offsets, _OFFSET)))
        elif record.opcode == Opcode.ATTACHMENT:
            attachments[attachment(record.body)[0]] = (record.at, record.end - record.at)
        elif record.opcode == Opcode.DATA_END:
            complete = bytes(data[-len(MAGIC) :]) == MAGIC
            break
    return Index(attachments, counts, chunks, complete=complete)


_INDEXED = struct.Struct("<HI")  # of a message index: channel, bytes of its entries
ENTRIES_AT = _INDEXED.size  # in the body of a message index


def record_at(data: memoryview, at: int, opcode: int) -> memoryview:
    """The body of the record that begins there. Raises ValueError if there is another one, or none."""
    if at + RECORD.size > len(data):
        raise ValueError("the index points out of the file")
    found, length = RECORD.unpack_from(data, at)
    if found != opcode or at + RECORD.size + length > len(data):
        raise ValueError("the index points at something else")
    return data[at + RECORD.size : at + RECORD.size + length]


def entries_at(data: memoryview, at: int, channel: int) -> NDArray[np.void]:
    """The message index of a channel that stands there. Raises ValueError for one that is damaged."""
    return entries_in(record_at(data, at, Opcode.MESSAGE_INDEX), channel)


def entries_in(body: memoryview, channel: int) -> NDArray[np.void]:
    """When the messages of a channel were logged, and where in their chunk they are. Raises ValueError."""
    if len(body) < ENTRIES_AT or _INDEXED.unpack_from(body) != (channel, len(body) - ENTRIES_AT):
        raise ValueError("an index is damaged")
    return np.frombuffer(body[ENTRIES_AT:], INDEX_ENTRY)


def parsed(kind: Any, body: bytes | memoryview) -> Any:
    """A record as the `mcap` package has it. Raises McapError, ValueError or struct.error for a damaged one."""
    return kind.read(ReadDataStream(BytesIO(body)))


def attachment(body: memoryview) -> tuple[str, str, bytes]:
    """Name, media type and content. Raises ValueError for one that is damaged."""
    at, texts = 16, []
    for _ in range(2):
        (length,) = struct.unpack_from("<I", body, at)
        texts.append(bytes(body[at + 4 : at + 4 + length]).decode())
        at += 4 + length
    (size,) = struct.unpack_from("<Q", body, at)
    content = bytes(body[at + 8 : at + 8 + size])
    (checksum,) = struct.unpack_from("<I", body, at + 8 + size)
    if zlib.crc32(body[:-4]) != checksum:
        raise ValueError(f"attachment {texts[0]!r} is damaged: wrong checksum")
    return texts[0], texts[1], content

"""An MCAP file built from chunks that are ready: records of a whole time window at once.

`silo.files.bags.writer` makes the message records and their index with NumPy; here stands what is around them: header,
chunk records, summary, footer. The small records are written with the `mcap` package's own classes.
"""

import struct
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import BinaryIO

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray

from silo.files.atomic import write_all

MAGIC = b"\x89MCAP0\r\n"
MESSAGE_OPCODE = 5
INDEX_OPCODE = 7
# level 1 packs noisy signals 8 % smaller than level 3, level 3 packs signals that rest or step up to 70 % smaller
_ZSTD_LEVELS = (1, 3)
_CHUNKS_PER_CHOICE = 8
_LIBRARY = "silo"
_PREFIX_BYTES = 9  # opcode and length of a record


Write = Callable[[int, list[memoryview], int], None]  # `write_all`, or what stands for a slow disk


@dataclass(frozen=True)
class IndexBlock:
    """Message index records of channels with the same number of messages in a chunk.

    `records` holds one whole record per channel (structured, shape `(channels,)`), `ids` the channels.
    """

    ids: NDArray[np.uint16]
    records: NDArray[np.void]


@dataclass
class Begun:
    """What is whole of a file that nobody finished: its first `size` bytes, and what its summary will say of them."""

    size: int = 0
    schemas: list[Schema] = field(default_factory=list)
    channels: list[Channel] = field(default_factory=list)
    chunk_indexes: list[bytes] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)
    metadata: list[MetadataIndex] = field(default_factory=list)


class McapWriter:
    """Writes one MCAP file front to back into an open unbuffered file; `finish` writes the summary."""

    def __init__(
        self,
        file: BinaryIO,
        schemas: Sequence[Schema],
        channels: Sequence[Channel],
        write: Write | None = None,
        begun: "Begun | None" = None,
    ) -> None:
        self._descriptor = file.fileno()
        self._write_all = write or write_all
        self._schemas = schemas
        self._channels = channels
        self._compressors = [zstandard.ZstdCompressor(level=level) for level in _ZSTD_LEVELS]
        self._best = self._compressors[0]
        self._undefined = b"" if begun else b"".join(map(_bytes, [*schemas, *channels]))
        begun = begun or Begun()
        self.size_bytes = begun.size
        self._chunk_indexes = begun.chunk_indexes
        self.index_bytes = sum(map(len, begun.chunk_indexes))
        self._attachments = begun.attachments
        self._metadata = begun.metadata
        if not begun.size:
            self._write(file_start())

    @classmethod
    def continued(cls, file: BinaryIO, begun: "Begun") -> "McapWriter":
        """A file that was begun and not finished, to be finished; it is cut behind what is whole of it."""
        file.truncate(begun.size)
        return cls(file, begun.schemas, begun.channels, begun=begun)

    @property
    def definitions_size(self) -> int:
        """Bytes that the next chunk gets in front of its messages; index offsets must count them."""
        return len(self._undefined)

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Write an attachment: data that is not a message."""
        record = _bytes(Attachment(create_time=0, log_time=0, name=name, media_type=media_type, data=data))
        index = AttachmentIndex(self.size_bytes, len(record), 0, 0, len(data), name, media_type)
        self._attachments.append(index)
        self._write(record)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record: names and texts."""
        record = _bytes(Metadata(name=name, metadata=dict(values)))
        self._metadata.append(MetadataIndex(self.size_bytes, len(record), name))
        self._write(record)

    def add_chunk(self, records: memoryview, start_ns: int, end_ns: int, index: Sequence[IndexBlock]) -> None:
        """Write message records as one chunk, and the index of them behind it."""
        definitions, self._undefined = self._undefined, b""
        data = definitions + records if definitions else records
        packed = self._compress(data)
        compression = b"\x04\0\0\0zstd"
        head = struct.pack("<QQQI", start_ns, end_ns, len(data), zlib.crc32(data)) + compression
        head += struct.pack("<Q", len(packed))
        at = self.size_bytes
        length = len(head) + len(packed)
        blocks = [block.records.view(np.uint8).data for block in index]
        self._write(struct.pack("<BQ", Opcode.CHUNK, length) + head, packed, *blocks)

        chunk_length = _PREFIX_BYTES + length
        offsets, index_length = _index_offsets(index, at + chunk_length)
        place = (start_ns, end_ns, at, chunk_length)
        self._chunk_indexes.append(
            chunk_index(place, offsets.tobytes(), index_length, compression, len(packed), len(data))
        )
        self.index_bytes += len(self._chunk_indexes[-1])

    def finish(self, counts: Mapping[int, int], start_ns: int, end_ns: int) -> int:
        """Write the summary and the end of the file; `counts` are messages per channel. Returns the file's size."""
        if self._undefined:
            self._write(self._undefined)
        self._write(_bytes(DataEnd(data_section_crc=0)))
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=dict(counts),
            chunk_count=len(self._chunk_indexes),
            message_count=sum(counts.values()),
            message_end_time=end_ns,
            message_start_time=start_ns,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        groups: list[tuple[Opcode, bytes]] = [
            (Opcode.SCHEMA, b"".join(map(_bytes, self._schemas))),
            (Opcode.CHANNEL, b"".join(map(_bytes, self._channels))),
            (Opcode.STATISTICS, _bytes(statistics)),
            (Opcode.CHUNK_INDEX, b"".join(self._chunk_indexes)),
            (Opcode.ATTACHMENT_INDEX, b"".join(map(_bytes, self._attachments))),
            (Opcode.METADATA_INDEX, b"".join(map(_bytes, self._metadata))),
        ]
        start = at = self.size_bytes
        summary, offsets = b"", b""
        for opcode, data in groups:
            if data:
                offsets += _bytes(SummaryOffset(group_opcode=opcode, group_start=at, group_length=len(data)))
            summary += data
            at += len(data)
        summary += offsets
        begun = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, at)
        footer = Footer(summary_start=start, summary_offset_start=at, summary_crc=zlib.crc32(summary + begun))
        self._write(summary, _bytes(footer), MAGIC)
        return self.size_bytes

    def _compress(self, data: bytes | memoryview) -> bytes:
        if len(self._chunk_indexes) % _CHUNKS_PER_CHOICE:
            return self._best.compress(data)
        tried = [(compressor.compress(data), compressor) for compressor in self._compressors]
        packed, self._best = min(tried, key=lambda pair: len(pair[0]))
        return packed

    def _write(self, *buffers: bytes | memoryview) -> None:
        views = [memoryview(buffer) for buffer in buffers]
        self._write_all(self._descriptor, views, self.size_bytes)
        self.size_bytes += sum(view.nbytes for view in views)


def file_start() -> bytes:
    """What every file begins with."""
    return MAGIC + _bytes(Header(profile="ros2", library=_LIBRARY))


def chunk_index(
    place: tuple[int, int, int, int], offsets: bytes, index_length: int, compression: bytes, packed: int, size: int
) -> bytes:
    """A chunk index record. `place`: first and last time in ns, where the chunk record begins, its length.

    `offsets` has channel and place of each message index record, `compression` its length before it.
    """
    body = struct.pack("<QQQQI", *place, len(offsets)) + offsets
    body += struct.pack("<Q", index_length) + compression + struct.pack("<QQ", packed, size)
    return struct.pack("<BQ", Opcode.CHUNK_INDEX, len(body)) + body


def index_block(channels: NDArray[np.uint16], times: NDArray[np.int64], offsets: NDArray[np.int64]) -> IndexBlock:
    """Message index records of channels, all with messages of these times; `offsets`: shape (channels, messages)."""
    dtype = np.dtype(
        [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("size", "<u4"),
         ("entries", [("time", "<u8"), ("offset", "<u8")], (len(times),))]
    )  # fmt: skip
    records = np.empty(len(channels), dtype)
    records["opcode"] = INDEX_OPCODE
    records["length"] = dtype.itemsize - _PREFIX_BYTES
    records["channel"] = channels
    records["size"] = 16 * len(times)
    records["entries"]["time"] = times
    records["entries"]["offset"] = offsets
    return IndexBlock(channels, records)


def _index_offsets(index: Sequence[IndexBlock], at: int) -> tuple[NDArray[np.void], int]:
    blocks = []
    start = at
    for block in index:
        offsets = np.empty(len(block.ids), dtype=[("channel", "<u2"), ("offset", "<u8")])
        offsets["channel"] = block.ids
        offsets["offset"] = at + block.records.itemsize * np.arange(len(block.ids))
        blocks.append(offsets)
        at += block.records.nbytes
    return np.concatenate(blocks), at - start


def _bytes(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    write: Callable[[RecordBuilder], None] = record.write
    write(builder)
    data: bytes = builder.end()
    return data

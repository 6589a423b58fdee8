"""An MCAP file of others: which topics it has, when their messages were logged, and their bytes.

By the summary and the message indices where the file has them: then a topic costs the chunks that hold messages of it.
A file without, or one that was cut off, is walked through once.
"""

import struct
import zlib
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from silo.files.bag_channels import INDEX_ENTRY
from silo.files.bag_index import read_index, record_at
from silo.files.mcap_write import MAGIC
from silo.files.others.topics import SOME, Equal, Topic

_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_BEGIN = _HEAD.size + _MESSAGE.size  # of what a message holds, from its record on
_CACHE_BYTES = 128 << 20
_SMALL = 512  # bytes of a message: of larger ones, copying one by one is as quick as indices of their bytes

Entries = NDArray[np.void]  # of `INDEX_ENTRY`: log times, and where in the block the records begin


@dataclass(frozen=True)
class _Block:
    """A chunk (the place of its record), or the file itself (-1); where the message index of each channel begins, or
    the entries themselves.
    """

    place: int
    indices: Mapping[int, int]
    entries: Mapping[int, Entries]

    def holds(self, channel: int) -> bool:
        return channel in self.indices or channel in self.entries


class McapFile:
    """One file, mapped into memory."""

    def __init__(self, path: Path, data: memoryview) -> None:
        self.path = path
        self.warnings: list[str] = []
        self._data = data
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._chunks: OrderedDict[int, bytes | memoryview] = OrderedDict()
        self._blocks = self._indexed() or self._scanned()

    def topics(self) -> list[Topic]:
        """Return what the file has messages of, in the order of the channels."""
        nothing = Schema(id=0, name="", encoding="", data=b"")
        return [
            Topic(
                channel.topic,
                schema.name,
                channel.message_encoding,
                schema.encoding,
                schema.data.decode("utf-8", "replace"),
                McapChannel(self, number),
            )
            for number, channel in sorted(self._channels.items())
            for schema in [self._schemas.get(channel.schema_id, nothing)]
            if any(block.holds(number) for block in self._blocks)
        ]

    # ------------------------------------------------------------------------------------------------ what is where

    def _indexed(self) -> list[_Block] | None:
        """The blocks by the summary; None where it lacks something."""
        index = read_index(self._data)
        if index is None or not index.chunks:
            return None
        start = struct.unpack_from("<Q", self._data, len(self._data) - len(MAGIC) - 20)[0]
        for opcode, _, body in _records(self._data, start):
            self._learn(opcode, body)
        blocks = []
        for place, _, offsets in index.chunks:
            if not len(offsets):
                return None  # a writer without message indices
            places = dict(zip(offsets["channel"].tolist(), offsets["offset"].tolist(), strict=True))
            blocks.append(_Block(place, places, {}))
        known = {channel for block in blocks for channel in block.indices}
        return blocks if known <= self._channels.keys() else None

    def _scanned(self) -> list[_Block]:
        """The blocks of the whole file, from the first record to the last that is whole."""
        blocks: list[_Block] = []
        outside: dict[int, list[tuple[int, int]]] = {}
        end = False
        for opcode, at, body in _records(self._data, len(MAGIC)):
            if opcode == Opcode.CHUNK:
                found: dict[int, list[tuple[int, int]]] = {}
                for inner, place, record in _records(memoryview(_unpacked(body)), 0):
                    self._learn(inner, record)
                    if inner == Opcode.MESSAGE:
                        _note(found, place, record)
                blocks.append(_Block(at, {}, _entries(found)))
            elif opcode == Opcode.MESSAGE:
                _note(outside, at, body)
            elif opcode == Opcode.DATA_END:
                end = True
                break
            else:
                self._learn(opcode, body)
        if not end:
            self.warnings.append(f"'{self.path.name}' is cut off: what it holds up to there is read")
        elif bytes(self._data[-len(MAGIC) :]) != MAGIC:
            self.warnings.append(f"'{self.path.name}' is cut off: its index is missing, all messages are there")
        return [*blocks, _Block(-1, {}, _entries(outside))] if outside else blocks

    def _learn(self, opcode: int, body: memoryview) -> None:
        try:
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(ReadDataStream(BytesIO(body)))
                self._schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                channel = Channel.read(ReadDataStream(BytesIO(body)))
                self._channels[channel.id] = channel
        except McapError as error:
            raise ValueError(f"damaged: a description of a topic ends too early {error}") from error

    # ----------------------------------------------------------------------------------------------------- messages

    def entries(self, block: int, channel: int) -> Entries:
        """Return the index entries of a channel in a block."""
        one = self._blocks[block]
        if channel not in one.indices:
            return one.entries.get(channel, np.empty(0, INDEX_ENTRY))
        body = record_at(self._data, one.indices[channel], Opcode.MESSAGE_INDEX)
        _, size = struct.unpack_from("<HI", body)
        return np.frombuffer(body[6 : 6 + size], INDEX_ENTRY)

    def blocks_of(self, channel: int) -> list[int]:
        """Return which blocks have messages of a channel."""
        return [number for number, block in enumerate(self._blocks) if block.holds(channel)]

    def content(self, block: int) -> bytes | memoryview:
        """Return the records of a block; the newest chunks are kept, as topics share them."""
        place = self._blocks[block].place
        if place < 0:
            return self._data
        if place not in self._chunks:
            self._chunks[place] = _unpacked(record_at(self._data, place, Opcode.CHUNK))
            while len(self._chunks) > 1 and sum(map(len, self._chunks.values())) > _CACHE_BYTES:
                self._chunks.popitem(last=False)
        self._chunks.move_to_end(place)
        return self._chunks[place]


@dataclass(frozen=True)
class McapChannel:
    """The messages of one channel of a file, in the order in which they stand there."""

    file: McapFile
    number: int

    def stamps(self) -> NDArray[np.int64]:
        """Return their log times."""
        found = [self.file.entries(block, self.number)["time"] for block in self.file.blocks_of(self.number)]
        return np.concatenate([np.empty(0, np.uint64), *found]).astype(np.int64)

    def messages(self) -> Iterator[Equal]:
        """Return what they hold, those of one size together. Raises ValueError for a damaged chunk."""
        sizes: dict[int, list[tuple[NDArray[np.int64], NDArray[np.uint8]]]] = {}
        first = 0
        for block in self.file.blocks_of(self.number):
            offsets = self.file.entries(block, self.number)["offset"].astype(np.int64)
            for which, rows in _contents(self.file.content(block), offsets):
                sizes.setdefault(rows.shape[1], []).append((which + first, rows))
            first += len(offsets)
        for parts in sizes.values():
            yield np.concatenate([which for which, _ in parts]), np.concatenate([rows for _, rows in parts])

    def some(self) -> Iterator[Equal]:
        """Return the first messages of the first, a middle and the last block."""
        blocks = self.file.blocks_of(self.number)
        first = 0
        for block in sorted({blocks[0], blocks[len(blocks) // 2], blocks[-1]} if blocks else ()):
            offsets = self.file.entries(block, self.number)["offset"][:SOME].astype(np.int64)
            for which, rows in _contents(self.file.content(block), offsets):
                yield which + first, rows
            first += len(offsets)


def _contents(block: bytes | memoryview, offsets: NDArray[np.int64]) -> Iterator[Equal]:
    """What the messages whose records begin there hold, those of one size together."""
    data = np.frombuffer(block, np.uint8)
    if len(offsets) and int(offsets.max()) + _BEGIN > len(data):
        raise ValueError("an index points out of its chunk")
    heads = data[offsets[:, None] + np.arange(_HEAD.size)]
    lengths = np.ascontiguousarray(heads[:, 1:]).view("<u8")[:, 0].astype(np.int64)
    if (heads[:, 0] != Opcode.MESSAGE).any() or (offsets + _HEAD.size + lengths > len(data)).any():
        raise ValueError("an index points at something else than a message")
    for length in np.unique(lengths).tolist():
        which = np.flatnonzero(lengths == length)
        begins, size = offsets[which] + _BEGIN, length - _MESSAGE.size
        if size <= _SMALL:
            yield which, data[begins[:, None] + np.arange(size)]
        else:
            yield which, np.stack([data[begin : begin + size] for begin in begins.tolist()])


def _records(data: memoryview, at: int) -> Iterator[tuple[int, int, memoryview]]:
    """Opcode, place and body of each whole record from there on."""
    while at + _HEAD.size <= len(data):
        opcode, length = _HEAD.unpack_from(data, at)
        if at + _HEAD.size + length > len(data):
            return
        yield opcode, at, data[at + _HEAD.size : at + _HEAD.size + length]
        at += _HEAD.size + length


def _note(found: dict[int, list[tuple[int, int]]], at: int, body: memoryview) -> None:
    channel, _, log_time, _ = _MESSAGE.unpack_from(body)
    found.setdefault(channel, []).append((log_time, at))


def _entries(found: Mapping[int, Sequence[tuple[int, int]]]) -> dict[int, Entries]:
    return {channel: np.array(pairs, INDEX_ENTRY) for channel, pairs in found.items()}


def _unpacked(body: memoryview) -> bytes | memoryview:
    """The records of a chunk. Raises ValueError for one that is damaged, or packed in a way that isn't known."""
    _, _, size, checksum, length = struct.unpack_from("<QQQII", body)
    compression = bytes(body[32 : 32 + length]).decode(errors="replace")
    (packed,) = struct.unpack_from("<Q", body, 32 + length)
    content = body[40 + length : 40 + length + packed]
    chunk: bytes | memoryview
    if compression == "zstd":
        chunk = zstandard.ZstdDecompressor().decompress(bytes(content), max_output_size=size)
    elif compression == "lz4":
        try:
            chunk = lz4.frame.decompress(content)
        except RuntimeError as error:
            raise ValueError(f"a chunk is damaged: {error}") from error
    elif compression:
        raise ValueError(f"a chunk is compressed with {compression!r}, not with zstd or lz4")
    else:
        chunk = content  # mapped: what nobody asks for is looked at for its checksum alone
    if len(chunk) != size or (checksum and zlib.crc32(chunk) != checksum):
        raise ValueError("a chunk is damaged: wrong checksum")
    return chunk

"""An MCAP file of others: which topics it has, when their messages were logged, and their bytes.

By the summary and the message indices where the file has them: then a topic costs the chunks that hold messages of it.
A file without, or one that was cut off, is walked through once. What is damaged costs the chunk, or the message, that
it is in.
"""

import struct
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from silo.core.names import grouped
from silo.core.recording import DamageNotes
from silo.files.mcap.chunks import INDEX_ENTRY, MESSAGE, RECORD, are_messages, records, unpack_chunk, walked
from silo.files.mcap.damage import DAMAGE, told_damage
from silo.files.mcap.index import entries_at, parsed, read_index, record_at
from silo.files.mcap.writer import MAGIC
from silo.files.others.topics import Bad, Equal, FileTopic

_BEGIN = RECORD.size + MESSAGE.size  # of what a message holds, from its record on
_CACHE_BYTES = 128 << 20
_SMALL = 512  # bytes of a message: of larger ones, copying one by one is as quick as indices of their bytes
# of all chunks of a file together: a small file of many chunks may announce terabytes
_MOST_BYTES = 256 << 20
_MOST_RATIO = 1000

Entries = NDArray[np.void]  # of `INDEX_ENTRY`: log times, and where in the block the records begin


@dataclass
class _Block:
    """A chunk (the place of its record), or the file itself (-1); where the message index of each channel begins, or
    the entries themselves.
    """

    place: int
    indices: dict[int, int]
    entries: dict[int, Entries]

    def holds(self, channel: int) -> bool:
        return channel in self.indices or channel in self.entries


class McapFile:
    """One file, mapped into memory."""

    def __init__(self, path: Path, data: memoryview, told: DamageNotes) -> None:
        self.path = path
        self._told = told
        self._data = data
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._chunks: OrderedDict[int, bytes | memoryview] = OrderedDict()
        self._bad: dict[int, str] = {}  # chunks that can't be unpacked, by their places
        self._room = max(_MOST_BYTES, _MOST_RATIO * len(data))
        self._unpacked: set[int] = set()
        indexed = self._indexed()
        self._blocks = self._scanned() if indexed is None else indexed
        unknown = {channel for block in self._blocks for channel in (*block.indices, *block.entries)}
        for channel in sorted(unknown - self._channels.keys()):
            self._told.add(f"'{path.name}' has messages of channel {channel}, whose description is damaged")

    def topics(self) -> list[FileTopic]:
        """Return what the file has messages of, in the order of the channels."""
        nothing = Schema(id=0, name="", encoding="", data=b"")
        return [
            FileTopic(
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
        for opcode, body in index.definitions:
            self._learn(opcode, body)
        blocks = []
        for chunk in index.chunks:
            if not len(chunk.offsets):
                return None  # a writer without message indices
            blocks.append(_Block(chunk.at, dict(chunk.offsets.tolist()), {}))
        known = {channel for block in blocks for channel in block.indices}
        return blocks if known <= self._channels.keys() else None

    def _scanned(self) -> list[_Block]:
        """The blocks of the whole file, from the first record to the last that is whole."""
        blocks: list[_Block] = []
        outside: dict[int, list[tuple[int, int]]] = {}
        damaged: _Block | None = None  # a chunk that can't be walked: the index behind it says what it held
        end = False
        for opcode, at, body in records(self._data, len(MAGIC)):
            if opcode == Opcode.MESSAGE_INDEX and damaged is not None and len(body) >= 2:
                damaged.indices[struct.unpack_from("<H", body)[0]] = at
            if opcode == Opcode.CHUNK:
                damaged = None
                blocks.append(_Block(at, {}, {}))
                try:
                    blocks[-1].entries, others = walked(self._chunk(at), len(body))
                except ValueError:
                    damaged = blocks[-1]
                    continue
                for inner, record in others:
                    self._learn(inner, record)
            elif opcode == Opcode.MESSAGE and len(body) >= MESSAGE.size:
                channel, _, log_time, _ = MESSAGE.unpack_from(body)
                outside.setdefault(channel, []).append((log_time, at))
            elif opcode == Opcode.DATA_END:
                end = True
                break
            else:
                self._learn(opcode, body)
        for block in blocks:
            if block.place in self._bad and not block.indices:
                self._tell_chunk(block.place)
        if not end:
            self._told.add(f"'{self.path.name}' is cut off: what it holds up to there is read")
        elif bytes(self._data[-len(MAGIC) :]) != MAGIC:
            self._told.add(f"'{self.path.name}' is cut off: its index is missing, all messages are there")
        entries = {channel: np.array(pairs, INDEX_ENTRY) for channel, pairs in outside.items()}
        return [*blocks, _Block(-1, {}, entries)] if entries else blocks

    def _tell_chunk(self, place: int) -> None:
        self._told.add(f"'{self.path.name}': the messages of the chunk at byte {place:,} are lost ({self._bad[place]})")

    def _learn(self, opcode: int, body: memoryview) -> None:
        """Take in a description; of one that is damaged, the messages stay without."""
        try:
            if opcode == Opcode.SCHEMA:
                schema = parsed(Schema, body)
                self._schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                channel = parsed(Channel, body)
                self._channels[channel.id] = channel
        except DAMAGE as error:
            self._told.add(f"'{self.path.name}': a description of a topic can't be read ({told_damage(error)})")

    # ----------------------------------------------------------------------------------------------------- messages

    def entries(self, block: int, channel: int) -> Entries:
        """Return the index entries of a channel in a block; of an index that is damaged, by the messages themselves."""
        one = self._blocks[block]
        if channel not in one.entries and channel in one.indices:
            try:
                return entries_at(self._data, one.indices[channel], channel)
            except ValueError:
                one.entries[channel] = self._searched(block, channel)
        return one.entries.get(channel, np.empty(0, INDEX_ENTRY))

    def _searched(self, block: int, channel: int) -> Entries:
        try:
            return self.placed(block, channel)
        except ValueError as error:
            place = self._blocks[block].place
            self._bad.setdefault(place, str(error))
            self._tell_chunk(place)
            return np.empty(0, INDEX_ENTRY)

    def blocks_of(self, channel: int) -> list[int]:
        """Return which blocks have messages of a channel."""
        return [number for number, block in enumerate(self._blocks) if block.holds(channel)]

    def content(self, block: int) -> bytes | memoryview:
        """Return the records of a block; the newest chunks are kept, as topics share them.

        Raises ValueError for one that is damaged.
        """
        place = self._blocks[block].place
        return self._data if place < 0 else self._chunk(place)

    def placed(self, block: int, channel: int) -> Entries:
        """Return the index entries of a channel in a block by the messages themselves. Raises ValueError."""
        place = self._blocks[block].place
        if place < 0:
            return self.entries(block, channel)
        found, _ = walked(self._chunk(place), len(record_at(self._data, place, Opcode.CHUNK)))
        return found.get(channel, np.empty(0, INDEX_ENTRY))

    def _chunk(self, place: int) -> bytes | memoryview:
        if place in self._bad:
            raise ValueError(self._bad[place])
        if place not in self._chunks:
            try:
                self._chunks[place] = self._unpack(place)
            except DAMAGE as error:
                # it is not tried again for every topic
                self._bad[place] = told_damage(error)
                raise ValueError(self._bad[place]) from error
        self._chunks.move_to_end(place)
        return self._chunks[place]

    def _unpack(self, place: int) -> bytes | memoryview:
        body = record_at(self._data, place, Opcode.CHUNK)
        (size,) = struct.unpack_from("<Q", body, 16)
        if place not in self._unpacked:
            if size > self._room:
                raise ValueError(f"the chunks of {len(self._data):,} bytes announce more than so few can hold")
            self._unpacked.add(place)
            self._room -= size
        while self._chunks and sum(map(len, self._chunks.values())) + size > _CACHE_BYTES:
            self._chunks.popitem(last=False)
        return unpack_chunk(body)


@dataclass(frozen=True)
class McapChannel:
    """The messages of one channel of a file, in the order in which they stand there."""

    file: McapFile
    number: int
    damage: str = ""  # nothing is known to be missing that the file does not tell itself

    def stamps(self) -> NDArray[np.int64]:
        """Return their log times."""
        found = [self.file.entries(block, self.number)["time"] for block in self.file.blocks_of(self.number)]
        return np.concatenate([np.empty(0, np.uint64), *found]).astype(np.int64)

    def messages(self, bad: Bad, most: int | None = None) -> Iterator[Equal]:
        """Return what they hold, or the first of the first, a middle and the last block, those of one size together.

        `bad` gets those that can't be read.
        """
        blocks = self.file.blocks_of(self.number)
        if most is not None:
            chosen = sorted({blocks[0], blocks[len(blocks) // 2], blocks[-1]} if blocks else ())
            yield from self._groups(chosen, most, bad)
            return
        sizes = grouped((rows.shape[1], (which, rows)) for which, rows in self._groups(blocks, None, bad))
        for parts in sizes.values():
            yield np.concatenate([which for which, _ in parts]), np.concatenate([rows for _, rows in parts])

    def _groups(self, blocks: list[int], most: int | None, bad: Bad) -> Iterator[Equal]:
        first = 0
        for block in blocks:
            entries = self.file.entries(block, self.number)[:most]
            every = np.arange(first, first + len(entries))
            first += len(entries)
            try:
                content = self.file.content(block)
                right = are_messages(content, self.number, entries)
                if not right.all():
                    entries, right = self._found_again(block, content, entries, right)
            except ValueError as error:
                bad.append((every, str(error)))
                continue
            if not right.all():
                bad.append((every[~right], "its index points at something else than a message of this topic"))
            for which, rows in _contents(content, entries["offset"][right].astype(np.int64)):
                yield every[right][which], rows

    def _found_again(
        self, block: int, content: bytes | memoryview, entries: Entries, right: NDArray[np.bool_]
    ) -> tuple[Entries, NDArray[np.bool_]]:
        """The entries by the messages themselves, where these are as many as a damaged index has."""
        found = self.file.placed(block, self.number)[: len(entries)]
        if len(found) < len(entries):
            return entries, right
        same = found["time"] == entries["time"]  # else it stands at another time than it was logged at
        return found, same & are_messages(content, self.number, found)


def _contents(block: bytes | memoryview, offsets: NDArray[np.int64]) -> Iterator[Equal]:
    """What the messages whose records begin there hold, those of one size together."""
    data = np.frombuffer(block, np.uint8)
    heads = data[offsets[:, None] + np.arange(RECORD.size)]
    lengths = np.ascontiguousarray(heads[:, 1:]).view("<u8")[:, 0].astype(np.int64)
    for length in np.unique(lengths).tolist():
        which = np.flatnonzero(lengths == length)
        begins, size = offsets[which] + _BEGIN, length - MESSAGE.size
        if size <= _SMALL:
            yield which, data[begins[:, None] + np.arange(size)]
        else:
            yield which, np.stack([data[begin : begin + size] for begin in begins.tolist()])

"""Values out of the chunks of a bag that silo wrote: one indexed load per channel and chunk.

Facts say where in which message each value stands, the message index where in its chunk each message stands.
"""

import struct
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.wide import from_wire
from silo.core.recording import masked
from silo.files.bags.message_groups import RECORD_HEAD
from silo.files.bags.metadata import PlacedElement, PlacedEntry, RecordingFacts
from silo.files.bags.ros_types import STRING
from silo.files.mcap.chunks import RECORD, walked
from silo.files.mcap.writer import MESSAGE_OPCODE
from silo.files.silo.format import dtype_from

_SEQUENCE_AT = RECORD.size + 2  # in a message record
_SEQUENCE = np.dtype("<u4")
_OVERLAP = 3  # a message begins with opcode, length and channel, 11 bytes: the words from 0 and from here have them all


class Values:
    """Grows the values of one element while chunks are read."""

    def __init__(self, facts: PlacedElement, messages: int, ticks: int = 0) -> None:
        self.facts = facts
        room = most_samples(facts, messages, ticks)
        self.arrays = [np.zeros(room, dtype=entry_dtype(entry)) for entry in self.facts.entries]
        self.filled = [0] * len(self.facts.entries)
        self.missing = np.zeros(room, bool)
        # of entries with absent messages: which samples have none
        self.absent = {at: np.ones(room, bool) for at, entry in enumerate(self.facts.entries) if entry.absent}

    def add(self, index: int, values: NDArray[Any]) -> None:
        """Append values of one entry."""
        start = self.filled[index]
        values = values[: len(self.missing) - start]  # of a file that was cut off, an entry may have more than others
        self.arrays[index][start : start + len(values)] = values
        self.filled[index] = start + len(values)

    def put(self, index: int, samples: NDArray[np.int64], values: NDArray[Any]) -> None:
        """Take values of an entry with absent messages. Raises IndexError for samples that the element has not."""
        self.arrays[index][samples] = values
        self.absent[index][samples] = False
        self.filled[index] += len(samples)

    def skip(self, index: int, count: int) -> None:
        """Append so many samples of an entry that can't be read."""
        start = self.filled[index]
        if index in self.absent:
            self.filled[index] = start + count
            return
        self.filled[index] = min(start + count, len(self.missing))
        self.missing[start : start + count] = True

    def fill_up(self) -> None:
        """Append what is missing at the end."""
        for index, filled in enumerate(self.filled):
            if index not in self.absent:
                self.skip(index, len(self.missing) - filled)

    @cached_property
    def whole(self) -> int:
        """Samples that all entries have, or that are known to be missing; asked for once all chunks are read."""
        room = len(self.missing)
        return min((room if at in self.absent else filled for at, filled in enumerate(self.filled)), default=0)

    @property
    def short(self) -> int:
        """Samples that the table announces and that did not come."""
        entries = zip(self.facts.entries, self.filled, strict=True)
        return max((self.facts.count - entry.absent - filled for entry, filled in entries), default=0)

    def column(self, index: int) -> NDArray[Any]:
        """The samples of an entry that are whole; those that are missing are NaN, NaT, empty or masked."""
        values, missing = self.arrays[index][: self.whole], self.missing[: self.whole]
        told = self.facts.entries[index].missing
        values = values if told is None else told.masked(values)
        if index in self.absent:
            missing = missing | self.absent[index][: self.whole]
        return masked(np.ma.getdata(values), missing | np.ma.getmaskarray(values)) if told or missing.any() else values


class ChannelReader:
    """Takes the values of one channel out of chunks."""

    def __init__(self, channel: int, size: int) -> None:
        self._channel = channel
        self.size = RECORD_HEAD + size  # of a message
        self.is_behind = False  # by nobody knows how many messages, which the number of the next one tells
        self._targets: list[tuple[PlacedEntry, Values, int]] = []

    def aim(self, entry: PlacedEntry, values: Values, index: int) -> None:
        """Have an entry of the messages appended to `values`, as number `index`."""
        self._targets.append((entry, values, index))

    @cached_property
    def _layout(self) -> np.dtype[np.void]:
        """A message record, of which only the values have names: their number in the list of targets."""
        entries = [entry for entry, _, _ in self._targets]
        formats: list[Any] = [e.wire if e.wire_count == 1 else (e.wire, (e.wire_count,)) for e in entries]
        return np.dtype(
            {
                # what is named is copied: the head of a record would take as long as its value
                "names": [str(k) for k in range(len(entries))],
                "formats": formats,
                "offsets": [RECORD_HEAD + entry.offset for entry in entries],
                "itemsize": self.size,
            }
        )

    @cached_property
    def _columns(self) -> list[tuple[str, np.dtype[Any], Values, int]]:
        return [(str(k), entry_dtype(entry), values, index) for k, (entry, values, index) in enumerate(self._targets)]

    def add(self, chunk: bytes, offsets: NDArray[np.uint64], known: bool = False) -> bool:
        """Take the values of the messages at these places in a chunk; return whether they are of this channel.

        `known`: they are, `are_right` has looked. Where an index that has no checksum points elsewhere, the messages
        are looked for among the records of the chunk, which has one. As many that can't be found are skipped.
        """
        if len(offsets) == 0:
            return True
        if self._take(chunk, offsets.astype(np.int64), known):
            return True
        found = walked(chunk, len(chunk))[0].get(self._channel)
        if found is not None and len(found) == len(offsets) and self._take(chunk, found["offset"].astype(np.int64)):
            return True
        self.skip(len(offsets))
        return False

    def skip(self, count: int) -> None:
        """Leave out so many messages, of a chunk that is damaged."""
        for _, values, index in self._targets:
            values.skip(index, count)

    def _take(self, chunk: bytes, places: NDArray[np.int64], known: bool = False) -> bool:
        """Take the values of messages; nothing, where something else stands there."""
        if self.is_text:
            return self._take_strings(chunk, places)
        if not (known or are_right(chunk, [(self, places)])):
            return False
        rows = _overlapping(chunk, self._layout)[places]
        if self._targets[0][0].absent:
            return self._put(rows, _overlapping(chunk, _SEQUENCE)[places + _SEQUENCE_AT].astype(np.int64))
        self._catch_up(chunk, places)
        for name, dtype, values, index in self._columns:
            values.add(index, from_wire(rows[name], dtype))
        return True

    def _catch_up(self, chunk: bytes, places: NDArray[np.int64]) -> None:
        """Leave out what is missing before these messages: what came after it stood at times of its own."""
        if self.is_behind:
            first, self.is_behind = int(_overlapping(chunk, _SEQUENCE)[places[0] + _SEQUENCE_AT]), False
            for _, values, index in self._targets:
                values.skip(index, max(first - values.filled[index], 0))

    def _put(self, rows: NDArray[np.void], samples: NDArray[np.int64]) -> bool:
        if int(samples.max()) >= len(self._targets[0][1].missing):
            return False
        for name, dtype, values, index in self._columns:
            values.put(index, samples, from_wire(rows[name], dtype))
        return True

    @property
    def is_text(self) -> bool:
        """Whether messages differ in length."""
        return self._targets[0][0].wire == STRING

    @cached_property
    def expected(self) -> tuple[int, int]:
        """What stands where a message of this channel begins: opcode, length and channel, as two overlapping words."""
        start = RECORD.pack(MESSAGE_OPCODE, self.size - RECORD.size) + struct.pack("<H", self._channel)
        return struct.unpack_from("<Q", start)[0], struct.unpack_from("<Q", start, _OVERLAP)[0]

    def _take_strings(self, chunk: bytes, places: NDArray[np.int64]) -> bool:
        entry, values, index = self._targets[0]
        if int(places.max()) + max(self.size, RECORD_HEAD) > len(chunk) or int(places.min()) < 0:
            return False
        start = places + RECORD_HEAD + entry.offset + 4
        opcodes = _overlapping(chunk, np.dtype("u1"))[places]
        channels = _overlapping(chunk, np.dtype("<u2"))[places + RECORD.size]
        right = (opcodes == MESSAGE_OPCODE) & (channels == self._channel)
        if int(start.max()) > len(chunk) or not right.all():
            return False
        lengths = _overlapping(chunk, np.dtype("<u4"))[start - 4].astype(np.int64) - 1
        if (lengths < 0).any() or (start + lengths > len(chunk)).any():
            return False
        texts: list[Any] = [chunk[at : at + size] for at, size in zip(start.tolist(), lengths.tolist(), strict=True)]
        dtype = entry_dtype(entry)
        if dtype.kind == "U":
            texts = [text.decode() for text in texts]
        self._catch_up(chunk, places)
        values.add(index, np.array(texts, dtype=dtype))
        return True


def are_right(chunk: bytes, wanted: Sequence[tuple[ChannelReader, NDArray[Any]]]) -> bool:
    """Whether messages of all these channels begin at these places of a chunk, and end in it; texts are left out.

    An index has no checksum. Of all channels at once: looked at one by one, heads take as long as the values.
    """
    numbers = [(reader, offsets) for reader, offsets in wanted if not reader.is_text]
    if not numbers or len(chunk) < RECORD_HEAD:
        return not numbers
    places = np.concatenate([offsets for _, offsets in numbers]).astype(np.int64)
    which = np.repeat(np.arange(len(numbers)), [len(offsets) for _, offsets in numbers])
    room = len(chunk) - np.array([reader.size for reader, _ in numbers])
    if (places < 0).any() or (places > room[which]).any():
        return False
    head, channel = np.array([reader.expected for reader, _ in numbers], np.uint64).T
    words = _overlapping(chunk, np.dtype("<u8"))
    return bool((words[places] == head[which]).all() and (words[places + _OVERLAP] == channel[which]).all())


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
                readers[entry.channel] = ChannelReader(entry.channel, facts.channel_sizes[entry.channel])
            readers[entry.channel].aim(entry, values, index)
    return readers


def most_samples(facts: PlacedElement, messages: int, ticks: int) -> int:
    """How many samples an element can have, of a file with at most so many messages, and ticks.

    A damaged count must not reserve memory that the file can't fill.
    """
    return min(facts.count, ticks if any(entry.absent for entry in facts.entries) else messages)


def logged_dtype(entry: PlacedEntry) -> np.dtype[Any]:
    """The type of an entry's values as they were logged. Raises ValueError for one that no file can hold."""
    dtype = entry_dtype(entry)
    return dtype if entry.missing is None else entry.missing.type_of(dtype)


def entry_dtype(entry: PlacedEntry) -> np.dtype[Any]:
    """The type of an entry's values. Raises ValueError for one that no file can hold."""
    # times without a unit, which were taken once, are but numbers
    dtype = np.dtype("<i8") if entry.dtype in ("<M8", "<m8") else dtype_from(entry.dtype)
    if dtype is None:
        raise ValueError(f"{entry.name}: type {entry.dtype} can't stand in a file")
    return dtype

"""Message records of many channels at once, for `silo.files.bags.writer`.

Channels with the same message layout and the same ticks form a group: per time window their records are one
structured array of shape (samples, channels), filled by column, and copied to their places in the window's buffer by
one indexed store (5 ns per message).
"""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from silo.core.arrays.wide import to_wire
from silo.core.recording import RecordedElement, samples_between
from silo.files.bags.ros_types import Channel, fill_constants, message_dtype
from silo.files.mcap.writer import MESSAGE_OPCODE, IndexBlock, index_block
from silo.files.silo.format import FilledEntry

# of a message record
_HEAD = (
    ("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"), ("log_time", "<u8"),
    ("publish_time", "<u8"),
)  # fmt: skip
MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # the same, of one
RECORD_HEAD = MESSAGE_HEAD.size
_NOT_COUNTED = 9  # opcode and length itself
_SECOND = 1_000_000_000


@dataclass(frozen=True)
class _Key:
    """What the channels of a group have in common.

    `text_size`: the longest string. `absent`: samples without a message, as bytes of int64.
    """

    wires: tuple[tuple[int, str, int], ...]
    size: int
    fixed: tuple[tuple[int, int], ...]
    text_size: int
    divider: int
    first: int
    count: int
    absent: bytes = b""


def absent_of(element: RecordedElement, channel: Channel) -> NDArray[np.int64]:
    """The samples of which a channel has no message: all that would be in it is missing."""
    entries = [element.entries[part.entry] for part in channel.parts]
    told = [(one, one.missing.fill) for one in entries if isinstance(one, FilledEntry)]
    if len(told) < len(entries) or any(fill is None for _, fill in told):
        return np.empty(0, np.int64)
    return np.flatnonzero(np.logical_and.reduce([one.values == fill for one, fill in told]))


def group_samples(
    elements: Sequence[RecordedElement], channels: Mapping[int, Channel], numbered_from: int = 0
) -> list["MessageGroup"]:
    """Groups of these channels, by their numbers; the first sample gets the sequence number `numbered_from`."""
    numbers: dict[_Key, list[int]] = {}
    for number, channel in channels.items():
        element = elements[channel.element]
        if element.count == 0:
            continue
        text_size = element.entries[channel.parts[0].entry].values.dtype.itemsize if channel.is_string else 0
        wires = tuple((part.offset, part.wire, part.count) for part in channel.parts)
        absent = absent_of(element, channel).tobytes()
        key = _Key(wires, channel.size, channel.fixed, text_size, element.divider, element.first, element.count, absent)
        numbers.setdefault(key, []).append(number)
    groups = []
    for key, members in numbers.items():
        values = []
        for number in members:
            channel = channels[number]
            entries = elements[channel.element].entries
            values.append([entries[part.entry].values for part in channel.parts])
        groups.append(MessageGroup(key, channels[members[0]], members, values, numbered_from))
    return groups


class MessageGroup:
    """Channels with the same layout and ticks. Per window: `build`, `add_sizes`, `place`, then `index` per chunk."""

    def __init__(
        self,
        key: _Key,
        channel: Channel,
        channels: Sequence[int],
        values: Sequence[Sequence[NDArray[Any]]],
        numbered_from: int,
    ) -> None:
        self._numbered_from = numbered_from
        self.divider = key.divider
        self.first = key.first
        self.count = key.count
        self._ids = np.array(channels, dtype="<u2")
        self._channel, self._parts = channel, channel.parts
        self._values = values
        self._text_size = key.text_size
        self._is_string = channel.is_string
        self._dtype = message_dtype(channel, _HEAD, key.text_size)
        self._scratch = np.zeros((0, len(channels)), dtype=self._dtype)
        self._records = self._scratch
        self._lengths: NDArray[np.int64] | None = None
        self._positions = np.zeros((0, len(channels)), dtype=np.int64)
        self._begin = 0
        self._times: NDArray[np.int64] = np.zeros(0, dtype=np.int64)
        self._ticks: slice | NDArray[np.int64] = slice(0, 0)
        self._there: NDArray[np.int64] | None = None  # the samples that have messages, None for all
        if key.absent:
            self._there = np.delete(np.arange(key.count), np.frombuffer(key.absent, np.int64))

    @property
    def tick_bytes(self) -> int:
        """Bytes that the group needs at most at a tick when it is due."""
        return int(self._dtype.itemsize) * len(self._ids)

    def reserve(self, ticks: int) -> None:
        """Make room for windows of so many ticks, and write what is the same in every record."""
        samples = min(self.count, -(-ticks // self.divider))
        scratch = np.zeros((samples, len(self._ids)), dtype=self._dtype)
        scratch["opcode"] = MESSAGE_OPCODE
        scratch["length"] = self._dtype.itemsize - _NOT_COUNTED
        scratch["channel"] = self._ids
        fill_constants(scratch, self._channel)
        self._scratch = scratch

    def build(self, begin: int, times: NDArray[np.int64]) -> None:
        """Fill the records of the samples that belong to ticks `begin` and following, one per stamp in `times`."""
        start, stop = samples_between(self.first, self.divider, self.count, begin, begin + len(times))
        offset = self.first + start * self.divider - begin
        self._ticks = slice(offset, offset + (stop - start) * self.divider, self.divider)
        samples = np.arange(start, stop)
        which: slice | NDArray[np.int64] = slice(start, stop)
        if self._there is not None:
            which = samples = self._there[slice(*np.searchsorted(self._there, (start, stop)).tolist())]
            self._ticks = self.first + samples * self.divider - begin
        records = self._records = self._scratch[: len(samples)]
        if not len(samples):
            return
        stamps = self._times = times[self._ticks].astype(np.int64)
        records["sequence"] = (samples.astype(np.uint64) + np.uint64(self._numbered_from)).astype("<u4")[:, None]
        records["log_time"] = records["publish_time"] = stamps[:, None]
        records["sec"] = (stamps // _SECOND)[:, None]
        records["nanosec"] = (stamps % _SECOND)[:, None]
        if self._is_string:
            self._fill_strings(which)
            return
        for k, part in enumerate(self._parts):
            column = records[f"value{k}"]
            for channel, values in enumerate(self._values):
                column[:, channel] = to_wire(values[k][which], part.wire, part.count)

    def _fill_strings(self, which: slice | NDArray[np.int64]) -> None:
        records, text = self._records, self._records["value0"]
        for channel, (values,) in enumerate(self._values):
            text[:, channel] = values[which]
        characters = np.strings.str_len(text) if hasattr(np, "strings") else np.char.str_len(text)
        records["text_length"] = characters + 1
        self._lengths = characters.astype(np.int64) + (self._dtype.itemsize - self._text_size)
        records["length"] = self._lengths - _NOT_COUNTED

    def due(self, ticks: NDArray[np.bool_]) -> None:
        """Mark the ticks of the recording at which there are messages."""
        if self._there is None:
            ticks[self.first : self.first + self.count * self.divider : self.divider] = True
        else:
            ticks[self.first + self._there * self.divider] = True

    def add_sizes(self, sizes: NDArray[np.int64]) -> None:
        """Add the bytes of this group's records to the ticks of the window."""
        if len(self._records):
            sizes[self._ticks] += self.tick_bytes if self._lengths is None else self._lengths.sum(axis=1)

    def place(self, cursor: NDArray[np.int64], buffer: NDArray[np.uint8]) -> None:
        """Copy the records into the window's buffer from `cursor` (a place per tick) on, and move the cursor."""
        if not len(self._records):
            return
        size, records = self._dtype.itemsize, self._records.reshape(-1)
        here = cursor[self._ticks]
        if self._lengths is None:
            positions = here[:, None] + size * np.arange(len(self._ids))
            cursor[self._ticks] = here + self.tick_bytes
            _scatter(buffer, positions.reshape(-1), records.view(f"V{size}"))
        else:
            ends = np.cumsum(self._lengths, axis=1)
            positions = here[:, None] + ends - self._lengths
            cursor[self._ticks] = here + ends[:, -1]
            places, lengths = positions.reshape(-1), self._lengths.reshape(-1)
            rows = records.view(np.uint8).reshape(-1, size)
            for length in np.unique(lengths):
                same = np.flatnonzero(lengths == length)
                cut = np.ascontiguousarray(rows[same, :length])
                _scatter(buffer, places[same], cut.view(f"V{length}").reshape(-1))
        self._positions = positions

    def index(self, start: int, stop: int, shift: int) -> IndexBlock | None:
        """Message index records of the window's ticks `start` to `stop`; `shift` turns a place into an offset."""
        if not len(self._records):
            return None
        if isinstance(self._ticks, slice):
            low, high = samples_between(self._ticks.start, self.divider, len(self._records), start, stop)
        else:
            low, high = np.searchsorted(self._ticks, (start, stop)).tolist()
        if low >= high:
            return None
        return index_block(self._ids, self._times[low:high], self._positions[low:high].T + shift)


def _scatter(buffer: NDArray[np.uint8], places: NDArray[np.int64], records: NDArray[np.void]) -> None:
    """`buffer[p : p + size] = record` for all: an array of overlapping items, one for every byte as the first."""
    size = records.dtype.itemsize
    items = as_strided(buffer[:size].view(records.dtype), shape=(len(buffer) - size + 1,), strides=(1,))
    items[places] = records

"""Samples of a live logger as ROS 2 messages (CDR), many at once.

The topics, types and layouts are those of bags (`silo.files.bags.ros_types`), so that what a viewer draws live and what
it draws of a file are the same.
"""

import itertools
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.wide import to_wire
from silo.core.elements import BufferType, ElementInfo
from silo.core.recording import RecordedElement, RecordedEntry
from silo.errors import SaveError
from silo.files.bags.ros_types import (
    ENCAPSULATION,
    Channel,
    FieldPlace,
    channels_of,
    fill_constants,
    message_dtype,
)
from silo.files.bags.writer import utf8_entry
from silo.history.arrays import SampleArrays

SECOND_NS = 1_000_000_000


@dataclass(frozen=True)
class Block:
    """Entries of an element, from the one of a part on, that stand one behind the other in its messages."""

    part: FieldPlace
    entries: int = 1

    @property
    def place(self) -> FieldPlace:
        """All of them as one part of a message."""
        return replace(self.part, count=self.part.count * self.entries)

    def of(self, samples: SampleArrays) -> NDArray[Any]:
        """Their values as messages have them: shape `(n,)` of a single number, else `(n, numbers)`."""
        values = entry_values(samples, self.part.entry, self.entries)
        made = to_wire(values.reshape(-1), self.part.wire, self.part.count)
        return made if self.place.count == 1 else made.reshape(len(samples), -1)


@dataclass(frozen=True)
class LiveTopic:
    """A topic, and the element whose samples are its messages; a picture is one block of it."""

    element: str
    channel: Channel
    blocks: tuple[Block, ...]

    def empty(self, samples: SampleArrays, head: Sequence[tuple[str, str]] = ()) -> "NDArray[np.void]":
        """Return room for the messages of samples behind a head, zero so far."""
        merged = replace(self.channel, parts=tuple(block.place for block in self.blocks))
        return np.zeros(len(samples), message_dtype(merged, head))

    def fill(self, messages: "NDArray[np.void]", samples: SampleArrays) -> None:
        """Write samples into what `empty` returned."""
        fill_constants(messages, self.channel)
        messages["sec"] = samples.time_ns // SECOND_NS
        messages["nanosec"] = samples.time_ns % SECOND_NS
        for k, block in enumerate(self.blocks):
            messages[f"value{k}"] = block.of(samples)

    def texts(self, samples: SampleArrays) -> Iterator[tuple[int, bytes]]:
        """Yield time stamp and message of each sample of a topic of texts."""
        (part,) = self.channel.parts
        for time_ns, value in zip(samples.time_ns.tolist(), entry_values(samples, part.entry).tolist(), strict=True):
            word = value if isinstance(value, str) else value.decode(errors="replace")
            letters = word.encode(errors="replace").split(b"\0")[0] + b"\0"
            sec, nanosec = divmod(time_ns, SECOND_NS)
            head = ENCAPSULATION + struct.pack("<iII", sec & 0x7FFFFFFF, nanosec, 1)
            yield time_ns, head.ljust(part.offset, b"\0") + struct.pack("<I", len(letters)) + letters


def entry_values(samples: SampleArrays, entry: int, count: int = 1) -> NDArray[Any]:
    """Return the values of scalars of an element, by the place of the first among the entries.

    Shape `(n,)` of one, else `(n, count)`.
    """
    values = samples.values
    if values.dtype.names:
        columns: list[NDArray[Any]] = [values[name] for name in values.dtype.names[entry : entry + count]]
        return columns[0] if count == 1 else np.stack(columns, axis=1)
    if values.dtype.kind == "c":  # real and imaginary parts are entries of their own
        values = np.ascontiguousarray(values).view(values.real.dtype).reshape(len(values), -1)
    if values.ndim == 1:
        return values
    flat = values.reshape(len(values), -1)
    return flat[:, entry] if count == 1 else flat[:, entry : entry + count]


def _blocks(parts: Sequence[FieldPlace], info: ElementInfo) -> tuple[Block, ...]:
    """The parts of a message, those of one array as one: nothing is done per value of it."""
    if len({entry.dtype for entry in info.entries}) > 1:
        return tuple(map(Block, parts))
    begins = [0]
    for place, (last, part) in enumerate(itertools.pairwise(parts), start=1):
        behind = last.offset + last.count * np.dtype(last.wire).itemsize
        if (part.entry, part.offset, part.wire, part.count) != (last.entry + 1, behind, last.wire, last.count):
            begins.append(place)
    return tuple(Block(parts[begin], end - begin) for begin, end in itertools.pairwise([*begins, len(parts)]))


def live_topics(elements: Sequence[ElementInfo]) -> tuple[list[LiveTopic], dict[str, str]]:
    """Return the topics of all elements that are on, and why others have none, by name."""
    left_out: dict[str, str] = {}
    recorded: list[RecordedElement] = []
    for info in elements:
        if not info.options.enabled:
            continue
        element = _without_samples(info)
        try:
            channels_of([element])
        except SaveError as error:  # Python objects, that no message can hold
            left_out[info.name] = str(error)
            continue
        recorded.append(element)
    infos = {info.name: info for info in elements}
    topics = []
    for channel in channels_of(recorded):
        name = recorded[channel.element].name
        topics.append(LiveTopic(name, channel, _blocks(channel.parts, infos[name])))
    return topics, left_out


def _without_samples(info: ElementInfo) -> RecordedElement:
    entries = [
        utf8_entry(RecordedEntry(info.name + entry.suffix, entry, np.zeros(0, np.dtype(entry.dtype))))
        for entry in info.entries
    ]
    return RecordedElement(
        info.name, info.unit, info.kind, info.shape, 1, BufferType.LOOPING, 0, tuple(entries), info.description,
        dtype=info.dtype,
    )  # fmt: skip

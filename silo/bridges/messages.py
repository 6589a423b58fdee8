"""Samples of a live logger as ROS 2 messages (CDR), many at once.

The topics, types and layouts are those of bags (`silo.files.bags.ros_types`), so that what a viewer draws live and what
it draws of a file are the same.
"""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.wide import to_wire
from silo.core.elements import BufferType, ElementInfo
from silo.core.recording import RecordedElement, RecordedEntry
from silo.errors import SaveError
from silo.files.bags.ros_types import ENCAPSULATION, STRING, Channel, channels_of
from silo.files.bags.writer import utf8_entry
from silo.history.arrays import SampleArrays

SECOND_NS = 1_000_000_000
Head = Sequence[tuple[str, str]]


@dataclass(frozen=True)
class LiveTopic:
    """A topic, and the element whose samples are its messages."""

    element: str
    channel: Channel

    def message_dtype(self, head: Head = ()) -> "np.dtype[np.void]":
        """Return the fields of a message of fixed length, behind fields of the caller's own."""
        fields: list[tuple[str, Any, int]] = []
        at = 0
        for name, kind in head:
            fields.append((name, kind, at))
            at += np.dtype(kind).itemsize
        fields += [
            ("encapsulation", "<u4", at),
            ("sec", "<i4", at + 4),
            ("nanosec", "<u4", at + 8),
            ("frame_id", "<u4", at + 12),  # a text of one letter, the NUL that ends it
        ]
        fields += [(f"fixed{k}", "<u4", at + offset) for k, (offset, _) in enumerate(self.channel.fixed)]
        for k, part in enumerate(self.channel.parts):
            wire: Any = part.wire if part.count == 1 else (part.wire, (part.count,))
            fields.append((f"value{k}", wire, at + part.offset))
        names, formats, offsets = zip(*fields, strict=True)
        return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": at + self.channel.size})

    def fill(self, messages: "NDArray[np.void]", samples: SampleArrays) -> None:
        """Write samples into an array of `message_dtype`, zero before, as long as they are."""
        messages["encapsulation"] = np.frombuffer(ENCAPSULATION, dtype="<u4")[0]
        messages["sec"] = samples.time_ns // SECOND_NS
        messages["nanosec"] = samples.time_ns % SECOND_NS
        messages["frame_id"] = 1
        for k, (_, value) in enumerate(self.channel.fixed):
            messages[f"fixed{k}"] = value
        for k, part in enumerate(self.channel.parts):
            messages[f"value{k}"] = to_wire(entry_values(samples, part.entry), part.wire, part.count)

    def texts(self, samples: SampleArrays) -> Iterator[tuple[int, bytes]]:
        """Yield time stamp and message of each sample of a topic of texts."""
        (part,) = self.channel.parts
        for time_ns, value in zip(samples.time_ns.tolist(), entry_values(samples, part.entry).tolist(), strict=True):
            word = value if isinstance(value, str) else value.decode(errors="replace")
            letters = word.encode(errors="replace").split(b"\0")[0] + b"\0"
            sec, nanosec = divmod(time_ns, SECOND_NS)
            head = ENCAPSULATION + struct.pack("<iII", sec & 0x7FFFFFFF, nanosec, 1)
            yield time_ns, head.ljust(part.offset, b"\0") + struct.pack("<I", len(letters)) + letters


def entry_values(samples: SampleArrays, entry: int) -> NDArray[Any]:
    """Return shape `(n,)`: the values of one scalar of an element, by its place among the entries."""
    values = samples.values
    if values.dtype.names:
        column: NDArray[Any] = values[values.dtype.names[entry]]
        return column
    if values.ndim == 1:
        return values
    return values.reshape(len(values), -1)[:, entry]


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
    topics = [LiveTopic(recorded[channel.element].name, channel) for channel in channels_of(recorded)]
    return topics, left_out


def is_texts(topic: LiveTopic) -> bool:
    """Whether the messages of a topic differ in length."""
    return topic.channel.parts[0].wire == STRING


def _without_samples(info: ElementInfo) -> RecordedElement:
    entries = [
        utf8_entry(RecordedEntry(info.name + entry.suffix, entry, np.zeros(0, np.dtype(entry.dtype))))
        for entry in info.entries
    ]
    return RecordedElement(
        info.name, info.unit, info.kind, info.shape, 1, BufferType.LOOPING, 0, tuple(entries), info.description,
        dtype=info.dtype,
    )  # fmt: skip

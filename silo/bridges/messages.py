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
from silo.files.bags.ros_types import ENCAPSULATION, Channel, channels_of, fill_constants
from silo.files.bags.writer import utf8_entry
from silo.history.arrays import SampleArrays

SECOND_NS = 1_000_000_000


@dataclass(frozen=True)
class LiveTopic:
    """A topic, and the element whose samples are its messages."""

    element: str
    channel: Channel

    def fill(self, messages: "NDArray[np.void]", samples: SampleArrays) -> None:
        """Write samples into an array of `message_dtype`, zero before, as long as they are."""
        fill_constants(messages, self.channel)
        messages["sec"] = samples.time_ns // SECOND_NS
        messages["nanosec"] = samples.time_ns % SECOND_NS
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
    if values.dtype.kind == "c":  # real and imaginary parts are entries of their own
        values = np.ascontiguousarray(values).view(values.real.dtype).reshape(len(values), -1)
    return values if values.ndim == 1 else values.reshape(len(values), -1)[:, entry]


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


def _without_samples(info: ElementInfo) -> RecordedElement:
    entries = [
        utf8_entry(RecordedEntry(info.name + entry.suffix, entry, np.zeros(0, np.dtype(entry.dtype))))
        for entry in info.entries
    ]
    return RecordedElement(
        info.name, info.unit, info.kind, info.shape, 1, BufferType.LOOPING, 0, tuple(entries), info.description,
        dtype=info.dtype,
    )  # fmt: skip

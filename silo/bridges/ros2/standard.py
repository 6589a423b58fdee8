"""Samples as messages that every ROS 2 machine knows: `std_msgs`, `geometry_msgs`, `sensor_msgs/JointState`.

The stamped types of silo's bags would need a package on the other side. Pure rules, no session.
"""

import struct
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import prod

import numpy as np
from numpy.typing import NDArray

from silo.bridges.messages import SECOND_NS, Block, LiveTopic, live_topics
from silo.core.elements import ElementInfo
from silo.files.bags.ros_types import (
    ENCAPSULATION,
    MessageType,
    add_numbers,
    add_text,
    align,
    free_topic,
)
from silo.history.arrays import SampleArrays

Stamped = tuple[NDArray[np.int64], list[bytes]]  # time stamps, and as many messages
STRING_TYPE = MessageType("std_msgs/msg/String", (("string", "data"),))
JOINT_STATE = MessageType(
    "sensor_msgs/msg/JointState",
    (
        ("std_msgs/Header", "header"), ("string[]", "name"),
        ("float64[]", "position"), ("float64[]", "velocity"), ("float64[]", "effort"),
    ),
)  # fmt: skip
JOINT_NAMES = (
    ("q", "position", "positions"),
    ("qd", "dq", "velocity", "velocities"),
    ("tau", "torque", "torques", "effort"),
)

_CAMEL = {"|u1": "UInt8", "<f4": "Float32", "<f8": "Float64"} | {
    f"{order}{kind}{size}": f"{name}{8 * size}"
    for kind, name in (("i", "Int"), ("u", "UInt"))
    for order, size in (("|", 1), ("<", 1), ("<", 2), ("<", 4), ("<", 8))
}


@dataclass(frozen=True)
class Outlet:
    """A topic of standard messages. `encode` has samples of its elements in their order, of the same ticks."""

    topic: str
    type: MessageType
    elements: tuple[str, ...]
    encode: Callable[[Sequence[SampleArrays]], Stamped]


def outlets_of(elements: Sequence[ElementInfo], prefix: str) -> tuple[list[Outlet], dict[str, str]]:
    """Return the topics of all elements that are on, below `/prefix`, and why others have none, by name."""
    topics, left_out = live_topics(elements)
    found = [outlet for topic in topics for outlet in _outlets(topic)] + list(_joints(elements))
    named: dict[str, Outlet] = {}
    for outlet in found:
        topic = f"/{prefix}{outlet.topic}"
        topic = free_topic(topic, named) if topic in named else topic
        named[topic] = Outlet(topic, outlet.type, outlet.elements, outlet.encode)
    return list(named.values()), left_out


def _outlets(topic: LiveTopic) -> Iterable[Outlet]:
    channel, element = topic.channel, (topic.element,)
    if topic.channel.is_string:
        yield Outlet(channel.topic, STRING_TYPE, element, lambda samples: _texts(topic, samples[0]))
    elif channel.type.name.startswith("geometry_msgs/"):
        yield Outlet(channel.topic, channel.type, element, lambda samples: _as_it_is(topic, samples[0]))
    elif len({part.wire for part in channel.parts}) == 1 and "/Struct" not in channel.type.name:
        names = [name for _, name in channel.type.fields[1:]]
        sizes = [(name, size) for name, (_, size) in zip(names, channel.fixed, strict=False)]
        yield _numbers(channel.topic, topic.element, channel.type.fields[-1][0], topic.blocks, sizes)
    else:
        for part, (kind, name) in zip(channel.parts, channel.type.fields[1:], strict=True):
            yield _numbers(f"{channel.topic}/{name}", topic.element, kind, (Block(part),), ())


def _numbers(topic: str, element: str, kind: str, blocks: Sequence[Block], sizes: Sequence[tuple[str, int]]) -> Outlet:
    """A number, or an array of them; `sizes` are its dimensions by name where it has more than one."""
    count, wire = sum(block.place.count for block in blocks), blocks[0].part.wire
    camel = "Bool" if kind == "bool" else _CAMEL[wire]
    base = kind.partition("[")[0]
    if count == 1:
        type_ = MessageType(f"std_msgs/msg/{camel}", ((base, "data"),))
        head = ENCAPSULATION
    else:
        camel = "UInt8" if camel == "Bool" else camel
        fields = (("std_msgs/MultiArrayLayout", "layout"), (f"{camel.lower()}[]", "data"))
        type_ = MessageType(f"std_msgs/msg/{camel}MultiArray", fields)
        head = _array_head(sizes or [("", count)], count, np.dtype(wire).itemsize)

    def encode(samples: Sequence[SampleArrays]) -> Stamped:
        columns = [one.of(samples[0]).reshape(len(samples[0]), -1) for one in blocks]
        rows = np.concatenate(columns, axis=1).astype(wire)
        return samples[0].time_ns, [head + row.tobytes() for row in np.ascontiguousarray(rows)]

    return Outlet(topic, type_, (element,), encode)


def _array_head(sizes: Sequence[tuple[str, int]], count: int, item_bytes: int) -> bytes:
    """All of a `MultiArray` before its numbers: the layout, and how many they are."""
    head = bytearray(struct.pack("<I", len(sizes)))
    for place, (label, size) in enumerate(sizes):
        add_text(head, label)
        add_numbers(head, "II", size, prod(length for _, length in sizes[place:]))
    head += struct.pack("<II", 0, count)
    align(head, item_bytes)
    return ENCAPSULATION + head


def _as_it_is(topic: LiveTopic, samples: SampleArrays) -> Stamped:
    messages = topic.empty(samples)
    topic.fill(messages, samples)
    data, size = messages.tobytes(), topic.channel.size
    return samples.time_ns, [data[at : at + size] for at in range(0, len(data), size)]


def _texts(topic: LiveTopic, samples: SampleArrays) -> Stamped:
    at = topic.channel.parts[0].offset  # of the text in silo's stamped message
    return samples.time_ns, [ENCAPSULATION + message[at:] for _, message in topic.texts(samples)]


# ------------------------------------------------------------------------------------------------------------- joints


def _joints(elements: Sequence[ElementInfo]) -> Iterable[Outlet]:
    """A `JointState` for each group with positions of joints beside velocities or efforts of as many."""
    groups: dict[str, dict[str, ElementInfo]] = {}
    for info in elements:
        group, _, name = info.name.rpartition("/")
        if info.options.enabled and _is_row_of_floats(info):
            groups.setdefault(group, {})[name] = info
    for group, members in groups.items():
        chosen = [next((members[name] for name in names if name in members), None) for names in JOINT_NAMES]
        first = chosen[0]
        if first is None:
            continue
        alike = [
            one if one and (one.shape, one.options.divider) == (first.shape, first.options.divider) else None
            for one in chosen
        ]
        if any(alike[1:]):  # an array that happens to be called q is none
            yield _joint_state(group, first.shape[0], alike)


def _is_row_of_floats(info: ElementInfo) -> bool:
    plain = len(info.shape) == 1 and info.kind in ("array", "vector")  # three numbers are a vector by default
    return plain and not info.dtype and {entry.dtype for entry in info.entries} == {"<f8"}


def _joint_state(group: str, count: int, alike: Sequence[ElementInfo | None]) -> Outlet:
    named = bytearray(struct.pack("<I", count))
    for number in range(count):
        add_text(named, f"joint{number}")
    elements = tuple(one.name for one in alike if one)
    lengths = [count if one else 0 for one in alike]

    def encode(samples: Sequence[SampleArrays]) -> Stamped:
        time_ns = samples[0].time_ns
        rows = [one.values.reshape(len(one), -1) for one in samples]
        return time_ns, [message_of(int(at), [row[k] for row in rows]) for k, at in enumerate(time_ns)]

    def message_of(time_ns: int, values: Sequence[NDArray[np.float64]]) -> bytes:
        sec, nanosec = divmod(time_ns, SECOND_NS)
        body = bytearray(struct.pack("<iIII", sec & 0x7FFFFFFF, nanosec, 1, 0)) + named
        rest = iter(values)
        for length in lengths:
            add_numbers(body, "I", length)
            if length:
                align(body, 8)
                body += next(rest).astype("<f8").tobytes()
        return ENCAPSULATION + body

    return Outlet(free_topic(f"{group}/joint_states", ()), JOINT_STATE, elements, encode)

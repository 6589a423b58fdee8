"""Which ROS 2 message carries an element, and where in it each entry stands.

Pure rules, no files, for bags, parts, events and bridges. A channel's message has a fixed layout (CDR, little-endian),
so that thousands of messages are one NumPy structured array; only a string has a length of its own, and it is always
the last field of its message.
"""

import hashlib
import json
import math
import re
import struct
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from silo.core.arguments import shown
from silo.core.kinds import ARRAY, KINDS, STRUCT, Kind, is_complex, kind_named
from silo.core.recording import RecordedElement, RecordedEntry
from silo.errors import SaveError
from silo.files.texts import unique_names

T = TypeVar("T")

PACKAGE = "signal_logger_msgs/msg/"
ENCAPSULATION = b"\x00\x01\x00\x00"  # CDR version 1, little-endian
# encapsulation, int32 sec, uint32 nanosec, frame_id "" (length 1, NUL)
HEADER_END = 17
STRING = "string"

_STRINGS_AT_ONCE = 65536
_NESTED = 1
_ARRAY, _SEQUENCE = 48, 144  # added for a fixed length, for any length
_TYPE_IDS = {
    name: number
    for number, name in enumerate(
        ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32", "float64"), start=2
    )
} | {"bool": 15, "string": 17}
_SIZES = {"bool": 1, "string": 4} | {
    name: int(re.sub(r"\D", "", name)) // 8 for name in _TYPE_IDS if name[-1].isdigit()
}
_CAMEL = {name: re.sub("^Ui", "UI", name.capitalize()) for name in _TYPE_IDS}

_DEPENDENCIES: dict[str, tuple[tuple[str, str], ...]] = {
    "std_msgs/Header": (("builtin_interfaces/Time", "stamp"), ("string", "frame_id")),
    "builtin_interfaces/Time": (("int32", "sec"), ("uint32", "nanosec")),
    "std_msgs/MultiArrayLayout": (("std_msgs/MultiArrayDimension[]", "dim"), ("uint32", "data_offset")),
    "std_msgs/MultiArrayDimension": (("string", "label"), ("uint32", "size"), ("uint32", "stride")),
    "geometry_msgs/Point": (("float64", "x"), ("float64", "y"), ("float64", "z")),
} | {f"geometry_msgs/{kind.message.name}": kind.message.fields for kind in KINDS if kind.message}


@dataclass(frozen=True)
class MessageType:
    """A ROS 2 message type: its full name (`package/msg/Name`), its fields (type, name), and constants."""

    name: str
    fields: tuple[tuple[str, str], ...]
    constants: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The definition with all that it depends on, as an MCAP `ros2msg` schema wants it."""
        blocks = ["\n".join([*self.constants, *(f"{kind} {name}" for kind, name in self.fields)])]
        for dependency in self._dependencies():
            lines = "\n".join(f"{kind} {name}" for kind, name in _DEPENDENCIES[dependency])
            blocks.append(f"MSG: {dependency}\n{lines}")
        return f"\n{'=' * 80}\n".join(blocks) + "\n"

    @property
    def type_hash(self) -> str:
        """The type's version hash (RIHS01), which ROS 2 compares between publisher and subscriber."""
        referenced = sorted(_long_name(name) for name in self._dependencies())
        described = {_long_name(name): fields for name, fields in _DEPENDENCIES.items()}
        description = {
            "type_description": _describe(self.name, self.fields),
            "referenced_type_descriptions": [_describe(name, described[name]) for name in referenced],
        }
        return "RIHS01_" + hashlib.sha256(json.dumps(description).encode()).hexdigest()

    def _dependencies(self) -> list[str]:
        found: list[str] = []
        waiting = [kind for kind, _ in self.fields]
        while waiting:
            kind = waiting.pop(0).removesuffix("[]")
            if kind in _DEPENDENCIES and kind not in found:
                found.append(kind)
                waiting.extend(nested for nested, _ in _DEPENDENCIES[kind])
        return found


@dataclass(frozen=True)
class FieldPlace:
    """Where one entry stands: `entry` is its index in the element, `offset` counts from the start of the message.

    `wire` is the NumPy type there (`string` for a CDR string), `count` how many of them: 2 for a complex number.
    """

    entry: int
    offset: int
    wire: str
    count: int = 1


@dataclass(frozen=True)
class Channel:
    """One topic: all entries of an element, or one string of it.

    `size` is the length of a message in bytes; of a string message without the characters. `fixed` are fields with
    the same value in each message: (offset, value), uint32.
    """

    topic: str
    element: int
    type: MessageType
    parts: tuple[FieldPlace, ...]
    size: int
    fixed: tuple[tuple[int, int], ...] = ()

    @property
    def is_string(self) -> bool:
        """Whether messages differ in length."""
        return self.parts[0].wire == STRING


@dataclass(frozen=True)
class _Wire:
    """How one value travels: ROS type, NumPy type, how many of them."""

    ros: str
    numpy: str
    count: int = 1

    @property
    def ros_field(self) -> str:
        return self.ros if self.count == 1 else f"{self.ros}[{self.count}]"


def message_dtype(channel: Channel, head: Sequence[tuple[str, str]] = (), text_bytes: int = 0) -> "np.dtype[np.void]":
    """The fields of a message, behind those of a head; a text has room for so many bytes, and a NUL behind them."""
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
    fields += [(f"fixed{k}", "<u4", at + offset) for k, (offset, _) in enumerate(channel.fixed)]
    for k, part in enumerate(channel.parts):
        start = at + part.offset
        if part.wire == STRING:
            fields += [("text_length", "<u4", start), (f"value{k}", f"S{text_bytes}", start + 4)]
        else:
            fields.append((f"value{k}", part.wire if part.count == 1 else (part.wire, (part.count,)), start))
    names, formats, offsets = zip(*fields, strict=True)
    itemsize = at + channel.size + text_bytes
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": itemsize})


def fill_constants(messages: "NDArray[np.void]", channel: Channel) -> None:
    """Write what is the same in every message into an array of `message_dtype`, zero before."""
    messages["encapsulation"] = np.frombuffer(ENCAPSULATION, dtype="<u4")[0]
    messages["frame_id"] = 1
    for k, (_, value) in enumerate(channel.fixed):
        messages[f"fixed{k}"] = value


def add_text(body: bytearray, text: str) -> None:
    """Append a text to the fields of a message."""
    data = text.encode("utf-8", "backslashreplace").replace(b"\0", b"") + b"\0"
    add_numbers(body, "I", len(data))
    body += data


def add_numbers(body: bytearray, codes: str, *values: float) -> None:
    """Append numbers of these types (those of `struct`), which need no more than to be aligned for the first."""
    if codes:
        align(body, struct.calcsize(codes[0]))
    body += struct.pack(f"<{codes}", *values)


def align(body: bytearray, size: int) -> None:
    """Pad the fields of a message to where a value of this size may stand."""
    body += bytes(-len(body) % size)


class CdrReader:
    """Reads the fields of a message one after the other. Raises ValueError where it is cut off, or is none."""

    def __init__(self, data: bytes, what: str = "a message") -> None:
        if data[:2] != ENCAPSULATION[:2]:
            raise ValueError(f"{what} must be CDR, little-endian")
        self._body, self._at, self._what = data, len(ENCAPSULATION), what

    def numbers(self, codes: str) -> tuple[Any, ...]:
        """Return numbers of these types (those of `struct`), which are aligned for the first."""
        size = struct.calcsize(f"<{codes}")
        self._at = aligned(self._at, struct.calcsize(codes[0])) if codes else self._at
        if self._at + size > len(self._body):
            raise ValueError(f"{self._what} is cut off")
        found = struct.unpack_from(f"<{codes}", self._body, self._at)
        self._at += size
        return found

    def count(self) -> int:
        """Return how many there are of something that follows, of which each takes a byte at least."""
        (count,) = self.numbers("I")
        if count > len(self._body) - self._at:
            raise ValueError(f"{self._what} is cut off")
        return int(count)

    def text(self) -> str:
        """Return a text."""
        size = self.count()
        self._at += size
        try:
            return self._body[self._at - size : self._at].rstrip(b"\0").decode()
        except UnicodeDecodeError as error:
            raise ValueError(f"{self._what} has a text that is not UTF-8: {shown(error.object)}") from None

    def items(self, read: Callable[[], T]) -> list[T]:
        """Return a list of what `read` reads."""
        return [read() for _ in range(self.count())]


# by NumPy kind and size; what is not here travels as its bytes
_WIRES = {
    "b1": _Wire("bool", "|u1"),
    "f2": _Wire("float32", "<f4"),
    "f4": _Wire("float32", "<f4"),
    "f8": _Wire("float64", "<f8"),
    "c8": _Wire("float32", "<f4", 2),
    "c16": _Wire("float64", "<f8", 2),
    "M8": _Wire("int64", "<i8"),
    "m8": _Wire("int64", "<i8"),
} | {
    f"{kind}{size}": _Wire(f"{prefix}{8 * size}", f"<{kind}{size}")
    for kind, prefix in (("i", "int"), ("u", "uint"))
    for size in (1, 2, 4, 8)
}


def channels_of(elements: Sequence[RecordedElement]) -> list[Channel]:
    """The channels of all elements, in the table's order; a compound element with strings has several.

    Raises `SaveError` for values that no message can hold (Python objects).
    """
    channels: list[Channel] = []
    unique = unique_names(_topic)
    for index, element in enumerate(elements):
        wires = [_wire_of(entry) for entry in element.entries]
        strings = [i for i, wire in enumerate(wires) if wire.ros == STRING]
        rest = [i for i, wire in enumerate(wires) if wire.ros != STRING]
        if rest:
            channel = _message(element, rest, [wires[i] for i in rest])
            channels.append(replace(channel, topic=unique(element.name), element=index))
        for i in strings:
            name = element.name if len(element.entries) == 1 else element.entries[i].name
            channels.append(replace(_string_message(i), topic=unique(name), element=index))
    return channels


def free_topic(name: str, taken: Iterable[str]) -> str:
    """The topic of this name, with a number where another one has it."""
    unique = unique_names(_topic)
    for topic in taken:
        unique(topic)
    return unique(name)


def _wire_of(entry: RecordedEntry) -> _Wire:
    dtype = entry.values.dtype
    kind, size = dtype.kind, dtype.itemsize
    if kind == "S" and is_text(entry.values):
        return _Wire(STRING, STRING)
    if kind + str(size) in _WIRES:
        return _WIRES[kind + str(size)]
    if kind in "SVfcU":
        return _Wire("uint8", "|u1", max(size, 1))
    raise SaveError(f"{entry.name}: values of type {dtype} can't be stored in a bag; leave the element out of it")


def is_text(values: NDArray[np.bytes_]) -> bool:
    """Whether all strings are UTF-8 without NUL inside, so that other programs can show them."""
    # readers decode strings as UTF-8 and end them at NUL: what is neither travels as bytes
    for start in range(0, len(values), _STRINGS_AT_ONCE):
        joined = b"\n".join(values[start : start + _STRINGS_AT_ONCE].tolist())
        try:
            joined.decode()
        except UnicodeDecodeError:
            return False
        if b"\0" in joined:
            return False
    return True


def _message(element: RecordedElement, indices: list[int], wires: list[_Wire]) -> Channel:
    entries = [element.entries[i] for i in indices]
    suffixes = tuple(entry.entry.suffix for entry in entries)
    uniform = len(set(wires)) == 1 and wires[0].count == 1
    if len(indices) == 1:
        return _scalar(entries[0], indices[0], wires[0])
    kind = kind_named(element.kind) or STRUCT
    if uniform and kind.message and wires[0].ros.startswith("float") and sorted(kind.suffixes) == sorted(suffixes):
        offset = aligned(HEADER_END, 8)
        parts = tuple(
            FieldPlace(indices[suffixes.index(suffix)], offset + 8 * k, "<f8") for k, suffix in enumerate(kind.suffixes)
        )
        value = (f"geometry_msgs/{kind.message.name}", kind.message.field)
        type_ = _stamped(f"geometry_msgs/msg/{kind.message.name}Stamped", value)
        return Channel("", 0, type_, parts, offset + 8 * len(parts))
    called = kind is ARRAY and suffixes[0].strip("_0123456789") and not is_complex("", element.shape, suffixes)
    if uniform and kind.array and not called:
        return _array(element, kind, indices, wires[0])
    return _struct(suffixes, indices, wires)


def _scalar(entry: RecordedEntry, index: int, wire: _Wire) -> Channel:
    offset = aligned(HEADER_END, _SIZES[wire.ros])
    field = (wire.ros_field, "value")
    constants = tuple(_constants(wire.ros, entry.entry.labels or {})) if entry.values.dtype.kind in "iu" else ()
    if constants:
        name = f"{PACKAGE}Enum{_digest(wire.ros, *constants)}Stamped"
    elif wire.count > 1:
        name = f"{PACKAGE}{_CAMEL[wire.ros]}Array{wire.count}Stamped"
    else:
        name = f"{PACKAGE}{_CAMEL[wire.ros]}Stamped"
    size = offset + _SIZES[wire.ros] * wire.count
    return Channel(
        "", 0, _stamped(name, field, constants=constants), (FieldPlace(index, offset, wire.numpy, wire.count),), size
    )


def _array(element: RecordedElement, kind: Kind, indices: list[int], wire: _Wire) -> Channel:
    count, size = len(indices), _SIZES[wire.ros]
    value = (f"{wire.ros}[{count}]", "value")
    camel = _CAMEL[wire.ros]
    fixed: tuple[tuple[int, int], ...] = ()
    if kind.sizes and len(element.shape) == len(kind.sizes) and math.prod(element.shape) == count:
        at = aligned(HEADER_END, 4)
        fixed = tuple((at + 4 * axis, length) for axis, length in enumerate(element.shape))
        offset = aligned(at + 4 * len(fixed), size)
        shown = f"{kind.name.capitalize()}{'x'.join(map(str, element.shape))}"
        type_ = _stamped(f"{PACKAGE}{camel}{shown}Stamped", *(("uint32", name) for name in kind.sizes), value)
    else:
        offset = aligned(HEADER_END, size)
        type_ = _stamped(f"{PACKAGE}{camel}Array{count}Stamped", value)
    parts = tuple(FieldPlace(index, offset + k * size, wire.numpy) for k, index in enumerate(indices))
    return Channel("", 0, type_, parts, offset + count * size, fixed)


def _struct(suffixes: Iterable[str], indices: list[int], wires: list[_Wire]) -> Channel:
    unique = unique_names(_field)
    fields: list[tuple[str, str]] = []
    parts: list[FieldPlace] = []
    end = HEADER_END
    for suffix, index, wire in zip(suffixes, indices, wires, strict=True):
        offset = aligned(end, _SIZES[wire.ros])
        fields.append((wire.ros_field, unique(suffix)))
        parts.append(FieldPlace(index, offset, wire.numpy, wire.count))
        end = offset + _SIZES[wire.ros] * wire.count
    name = f"{PACKAGE}Struct{_digest(*(f'{kind} {field}' for kind, field in fields))}Stamped"
    return Channel("", 0, _stamped(name, *fields), tuple(parts), end)


def _string_message(index: int) -> Channel:
    offset = aligned(HEADER_END, 4)
    # + 4 bytes of length, + the NUL that ends it
    return Channel(
        "", 0, _stamped(f"{PACKAGE}StringStamped", (STRING, "value")), (FieldPlace(index, offset, STRING),), offset + 5
    )


def _stamped(name: str, *fields: tuple[str, str], constants: tuple[str, ...] = ()) -> MessageType:
    return MessageType(name, (("std_msgs/Header", "header"), *fields), constants)


def aligned(offset: int, size: int) -> int:
    """Return where in a message the next value of this size may stand: CDR counts from behind its 4 bytes of head."""
    return -(-(offset - len(ENCAPSULATION)) // size) * size + len(ENCAPSULATION)


def _constants(kind: str, labels: dict[int, str]) -> Iterable[str]:
    # Foxglove shows the constants of a message as names of its values
    unique = unique_names(lambda label: re.sub("[^A-Z0-9]+", "_", label.upper()).strip("_"))
    for number, label in sorted(labels.items()):
        constant = unique(label)
        if re.fullmatch("[A-Z][A-Z0-9]*(_[A-Z0-9]+)*", constant):
            yield f"{kind} {constant}={number}"


def _topic(name: str) -> str:
    tokens = [re.sub("_+", "_", re.sub("[^A-Za-z0-9_]", "_", token)) for token in name.split("/") if token]
    return "/" + "/".join("_" + token if token[0].isdigit() else token for token in tokens or ["unnamed"])


def _field(suffix: str) -> str:
    name = re.sub("[^a-z0-9]+", "_", suffix.lower()).strip("_")
    return name if name and name[0].isalpha() and name != "header" else f"value_{name}".rstrip("_")


def _digest(*lines: str) -> str:
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:8]


def _long_name(name: str) -> str:
    package, _, message = name.partition("/")
    return f"{package}/msg/{message}"


def _describe(name: str, fields: tuple[tuple[str, str], ...]) -> dict[str, object]:
    return {"type_name": name, "fields": [_describe_field(kind, field) for kind, field in fields]}


def _describe_field(kind: str, name: str) -> dict[str, object]:
    base, bracket, length = kind.rstrip("]").partition("[")
    number = _TYPE_IDS.get(base, _NESTED) + (_ARRAY if length else _SEQUENCE if bracket else 0)
    nested = "" if base in _TYPE_IDS else _long_name(base)
    type_ = {"type_id": number, "capacity": int(length or 0), "string_capacity": 0, "nested_type_name": nested}
    return {"name": name, "type": type_}

"""Message types of ROS 2 as trees, and which signals a message of a type has.

Definitions are parsed by `rosbags`, which knows those of ROS 2 itself too. A message is a tree of numbers, texts and
repetitions of them; `signals_of` makes of it elements as a logger of silo would have registered them: vectors,
quaternions, arrays and scalars, with units where a message says in which (REP 103), with labels where it has constants.
"""

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from silo.files.optional_packages import need

Path = tuple[str, ...]

NUMBERS = {
    "bool": "b1", "byte": "u1", "char": "u1", "octet": "u1", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
MOST_VALUES = 4096  # of an array that is a signal
_NOTHING = "structure_needs_at_least_one_member"  # what IDL, and so CDR, has in place of a message without fields


class UnknownTypeError(ValueError):
    """A message type of which there is no definition, or one that can't be read."""


@dataclass(frozen=True)
class NumberField:
    """A number by its NumPy type without byte order; `labels` are names of values."""

    dtype: str
    labels: Mapping[int, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Text:
    """A string."""


@dataclass(frozen=True)
class Stamp:
    """Seconds and nanoseconds: a time, or a duration."""

    duration: bool


@dataclass(frozen=True)
class MessageFields:
    """Fields in their order; `name` is the type."""

    name: str
    fields: tuple[tuple[str, "Node"], ...]


@dataclass(frozen=True)
class Repeated:
    """`count` times the same, -1 where each message says how often."""

    node: "Node"
    count: int


Node: TypeAlias = "NumberField | Text | Stamp | MessageFields | Repeated"

_TIMES = {"builtin_interfaces/msg/Time": False, "builtin_interfaces/msg/Duration": True}


@functools.lru_cache(256)  # to parse a definition takes milliseconds, and files of a bag have the same ones
def message_type(name: str, definition: str, encoding: str) -> MessageFields:
    """Return the type of this name. Without a definition it must be one of ROS 2.

    Raises UnknownTypeError, and `SiloError` where `rosbags` is missing.
    """
    types: Any = need("rosbags.typesys", "bags", "bags of others")
    known: dict[str, Any] = dict(types.get_typestore(types.Stores.LATEST).fielddefs)
    if definition.strip():
        read = types.get_types_from_idl if encoding == "ros2idl" else types.get_types_from_msg
        try:
            known |= read(definition) if encoding == "ros2idl" else read(definition, name)
        except Exception as error:  # of a parser, for whatever a file holds
            raise UnknownTypeError(f"its definition can't be read: {str(error).splitlines()[0]}") from error
    full = name if name.count("/") != 1 else name.replace("/", "/msg/")
    if full not in known:
        raise UnknownTypeError("its definition is not in the bag")
    return _message(full, known, ())


def _message(name: str, known: Mapping[str, Any], above: Path) -> MessageFields:
    if name.rpartition("/")[2] == "wstring":  # as which the parser takes it
        raise UnknownTypeError("silo reads no wstring: middlewares write them in ways of their own")
    if name in above or name not in known:
        raise UnknownTypeError(f"the type {name} in it is not known")
    constants, fields = known[name]
    fields = fields or [(_NOTHING, (1, ("uint8", 0)))]
    made = tuple((label, _node(what, known, (*above, name))) for label, what in fields)
    return MessageFields(name, tuple((label, _labelled(label, node, made, constants)) for label, node in made))


def _node(what: Any, known: Mapping[str, Any], above: Path) -> Node:
    kind, detail = int(what[0]), what[1]
    if kind == 1:
        base = detail[0]
        if base == "string":
            return Text()
        if base not in NUMBERS:
            raise UnknownTypeError(f"silo reads no {base}")
        return NumberField(NUMBERS[base])
    if kind == 2:
        return Stamp(_TIMES[detail]) if detail in _TIMES else _message(detail, known, above)
    inner, count = detail
    return Repeated(_node(inner, known, above), count if kind == 3 else -1)


def _labelled(label: str, node: Node, fields: tuple[tuple[str, Node], ...], constants: list[Any]) -> Node:
    """The node with constants of its message as labels: those that begin with its name, or all where it is alone."""
    if not isinstance(node, NumberField) or node.dtype[0] not in "iu" or not constants:
        return node
    mine = [(word, value) for word, base, value in constants if NUMBERS.get(base) == node.dtype]
    start = f"{label.upper()}_"
    named = [(word.removeprefix(start), value) for word, value in mine if word.startswith(start)]
    alone = sum(isinstance(other, NumberField) and other.dtype == node.dtype for _, other in fields) == 1
    chosen = named or (mine if alone else [])
    distinct = len({value for _, value in chosen}) == len(chosen)
    return NumberField(node.dtype, {int(value): word for word, value in chosen}) if chosen and distinct else node


# ------------------------------------------------------------------------------------------------------------- signals


@dataclass(frozen=True)
class FieldSpec:
    """An element of a topic: where its values stand in a message, and what they are.

    Of several `paths` each is one scalar, of one path it is what stands there. `suffixes` belong to the scalars;
    of arrays of a length that messages say, there are none yet. `dtype` is a NumPy type, `S` for texts.
    """

    name: Path
    paths: tuple[Path, ...]
    dtype: str
    kind: str = "scalar"
    suffixes: tuple[str, ...] = ("",)
    count: int = 0  # of an array, -1 where messages say it, 0 for all else
    unit: str = "-"
    labels: Mapping[int, str] = field(default_factory=dict)


_COMPOUND = {
    ("x", "y", "z"): "vector",
    ("x", "y", "z", "w"): "quaternion",
    ("x", "y"): "vector",
}
_VECTORS = {
    "geometry_msgs/msg/Vector3", "geometry_msgs/msg/Point", "geometry_msgs/msg/Point32",
    "geometry_msgs/msg/Quaternion", "foxglove_msgs/msg/Vector2", "foxglove_msgs/msg/Point2",
}  # fmt: skip

# REP 103, and what the definitions say in their comments
_UNITS = {
    "sensor_msgs/msg/Imu": {"angular_velocity": "rad/s", "linear_acceleration": "m/s^2"},
    "geometry_msgs/msg/Twist": {"linear": "m/s", "angular": "rad/s"},
    "geometry_msgs/msg/Accel": {"linear": "m/s^2", "angular": "rad/s^2"},
    "geometry_msgs/msg/Wrench": {"force": "N", "torque": "Nm"},
    "geometry_msgs/msg/Pose": {"position": "m"},
    "geometry_msgs/msg/PointStamped": {"point": "m"},
    "geometry_msgs/msg/Transform": {"translation": "m"},
    "sensor_msgs/msg/Temperature": {"temperature": "degC"},
    "sensor_msgs/msg/FluidPressure": {"fluid_pressure": "Pa"},
    "sensor_msgs/msg/MagneticField": {"magnetic_field": "T"},
    "sensor_msgs/msg/NavSatFix": {"latitude": "deg", "longitude": "deg", "altitude": "m"},
    "sensor_msgs/msg/Range": {"range": "m", "min_range": "m", "max_range": "m", "field_of_view": "rad"},
    "sensor_msgs/msg/BatteryState": {
        "voltage": "V", "temperature": "degC", "current": "A", "charge": "Ah", "capacity": "Ah",
        "design_capacity": "Ah", "cell_voltage": "V", "cell_temperature": "degC",
    },
    "sensor_msgs/msg/LaserScan": {
        "angle_min": "rad", "angle_max": "rad", "angle_increment": "rad", "time_increment": "s", "scan_time": "s",
        "range_min": "m", "range_max": "m", "ranges": "m",
    },
}  # fmt: skip


def signals_of(message: MessageFields) -> tuple[list[FieldSpec], list[Path]]:
    """Return the elements of a message, and which fields are none: bytes without end, and lists of messages."""
    found = list(_signals(message, (), "-"))
    return [one for one in found if isinstance(one, FieldSpec)], [one for one in found if isinstance(one, tuple)]


def _signals(message: MessageFields, above: Path, given: str) -> Iterator[FieldSpec | Path]:
    units = _UNITS.get(message.name, {})
    for label, node in message.fields:
        if label == _NOTHING:
            continue
        name, unit = (*above, label), units.get(label, given)
        if isinstance(node, MessageFields):
            names = tuple(each for each, _ in node.fields)
            numbers = [each for _, each in node.fields if isinstance(each, NumberField)]
            if node.name in _VECTORS and names in _COMPOUND and len({one.dtype for one in numbers}) == 1:
                suffixes = tuple(f"_{each}" for each in names)
                paths = tuple((*name, each) for each in names)
                yield FieldSpec(name, paths, numbers[0].dtype, _COMPOUND[names], suffixes, unit=unit)
            else:
                yield from _signals(node, name, unit)
        elif isinstance(node, Repeated):
            yield _array(name, node, unit)
        elif isinstance(node, Stamp):
            yield FieldSpec(name, (name,), "i8" if node.duration else "M8[ns]", unit="ns" if node.duration else "-")
        elif isinstance(node, Text):
            yield FieldSpec(name, (name,), "S")
        else:
            yield FieldSpec(name, (name,), node.dtype, unit=unit, labels=node.labels)


def _array(name: Path, node: Repeated, unit: str) -> FieldSpec | Path:
    """The element of an array of numbers or texts, else the path of what is none."""
    inner = node.node
    if not isinstance(inner, NumberField | Text) or node.count > MOST_VALUES:
        return name
    if node.count < 0 and isinstance(inner, NumberField) and inner.dtype in ("u1", "i1"):
        return name  # pictures, point clouds, maps
    dtype = inner.dtype if isinstance(inner, NumberField) else "S"
    suffixes = tuple(f"_{at}" for at in range(max(node.count, 0)))
    labels = inner.labels if isinstance(inner, NumberField) else {}
    return FieldSpec(name, (name,), dtype, "vector", suffixes, node.count, unit, labels)

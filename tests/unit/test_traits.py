"""From values to named entries: the suffixes of the original, kinds, enumerations, and types of one's own."""

import collections
import dataclasses
import enum

import numpy as np
import pytest

import silo
from silo.errors import ElementError, SourceError
from silo.loop.types import describe, entry_of, kind_of, strides_of


class Mode(enum.Enum):
    IDLE = "idle"
    WALK = "walk"


class Gait(enum.IntEnum):
    STAND = 0
    TROT = 4


class Fault(enum.Flag):
    HOT = 1
    STALL = 2


class Holder:
    """Attributes, as a robot's parts have them."""

    def __init__(self, **attributes):
        vars(self).update(attributes)


def parts_of(value, *, attr=None, kind="", labels=None, string_bytes=None):
    return describe(value, "/x", attr=attr, kind=kind, labels=labels, string_bytes=string_bytes)


def entries(value, **chosen):
    return [
        entry_of(scalar, part.labels)
        for part in parts_of(value, **chosen)
        for scalar in part.scalars(strides_of(part.source))
    ]


def suffixes(value, **chosen):
    return [entry.suffix for entry in entries(value, **chosen)]


# ------------------------------------------------------------------------------------------------------- suffixes


STRUCTURE = np.dtype([("pos", "f8", (3,)), ("id", "i4"), ("inner", [("a", "?"), ("m", "f4", (2, 2))])])
SUFFIXES = {
    "a scalar array has none": (np.zeros(()), "", [""]),
    "an array of one item has none": (np.zeros(1), "", [""]),
    **{
        f"a vector of three {dtype} is x y z": (np.zeros(3, dtype), "", "_x _y _z")
        for dtype in ("f8", "f4", "i4", "u1")
    },
    **{
        f"three {dtype}, no numbers, are counted": (np.zeros(3, dtype), "", "_0 _1 _2")
        for dtype in ("?", "S4", "M8[ns]")
    },
    "two are counted": (np.zeros(2), "", "_0 _1"),
    "four are counted": (np.zeros(4), "", "_0 _1 _2 _3"),
    "five are counted": (np.zeros(5), "", "_0 _1 _2 _3 _4"),
    "kind array counts three numbers too": (np.zeros(3), "array", "_0 _1 _2"),
    "a matrix is counted by rows and columns": (np.zeros((2, 3)), "", "_0_0 _0_1 _0_2 _1_0 _1_1 _1_2"),
    "a dimension of size one has none": (np.zeros((1, 2, 1)), "", "_0 _1"),
    "a quaternion": (np.zeros(4), "quaternion", "_x _y _z _w"),
    "an angle axis": (np.zeros(4), "angle_axis", "_angle _x _y _z"),
    "a pose is position and orientation": (
        np.zeros(7),
        "pose",
        "_position_x _position_y _position_z _orientation_x _orientation_y _orientation_z _orientation_w",
    ),
    "a twist is linear and angular": (
        np.zeros(6),
        "twist",
        "_linear_x _linear_y _linear_z _angular_x _angular_y _angular_z",
    ),
    "a vector at a position names both frames": (
        np.zeros(6),
        silo.types.vector_at_position("odom", "base"),
        [f"_{part}_frame_{axis}" for part in ("vector_in_odom", "at_position_in_base") for axis in "xyz"],
    ),
    "a list of quaternions has the kind in its last dimension": (
        np.zeros((2, 4)),
        "quaternion",
        "_0_x _0_y _0_z _0_w _1_x _1_y _1_z _1_w",
    ),
    "components are called by the names that are given": (
        np.zeros((2, 2)),
        "components(FL_hip, knee)",
        "_0_FL_hip _0_knee _1_FL_hip _1_knee",
    ),
    "a complex number is real and imag": (np.zeros((), complex), "", "_real _imag"),
    "a structured array has its fields": (
        np.zeros((), STRUCTURE),
        "",
        "_pos_x _pos_y _pos_z _id _inner_a _inner_m_0_0 _inner_m_0_1 _inner_m_1_0 _inner_m_1_1",
    ),
    "an array of structures is counted first": (np.zeros(2, [("a", "f8"), ("b", "f8")]), "", "_0_a _0_b _1_a _1_b"),
}


@pytest.mark.parametrize(("value", "kind", "expected"), SUFFIXES.values(), ids=SUFFIXES)
def test_the_entries_of_an_array_are_named_by_its_shape_type_and_kind(value, kind, expected):
    assert suffixes(value, kind=kind) == (expected.split() if isinstance(expected, str) else expected)


def test_a_transposed_matrix_keeps_its_rows_and_columns():
    (part,) = parts_of(np.arange(6.0).reshape(3, 2).T)
    offsets = {scalar.suffix: scalar.offset for scalar in part.scalars(strides_of(part.source))}
    assert offsets["_0_1"] == 16
    assert offsets["_1_0"] == 8


def test_a_quaternion_with_w_first_in_memory_keeps_its_order():
    (part,) = parts_of(np.zeros(4), kind="quaternion_wxyz")
    scalars = part.scalars(strides_of(part.source))
    assert [(scalar.suffix, scalar.offset) for scalar in scalars] == [("_w", 0), ("_x", 8), ("_y", 16), ("_z", 24)]


KINDS = (
    "there are quaternion, quaternion_wxyz, pose, twist, vector_at_position(FRAME, FRAME), angle_axis, vector, "
    "components(NAME, NAME, ...), array"
)
MEANT = f"{KINDS}; did you mean 'components(NAME, NAME, ...)'?"
REFUSED = {
    "no quaternion": (
        np.zeros(3),
        "quaternion",
        "kind 'quaternion' has 4 values in its last dimension, the shape is (3,)",
    ),
    "no pose": (np.zeros((7, 2)), "pose", "kind 'pose' has 7 values in its last dimension, the shape is (7, 2)"),
    "no twist": (np.zeros(()), "twist", "kind 'twist' has 6 values in its last dimension, the shape is ()"),
    "no vector": (np.zeros(2), "vector", "kind 'vector' has 3 values in its last dimension, the shape is (2,)"),
    "no kind": (np.zeros(4), "quat", f"unknown kind 'quat'; {KINDS}"),
    "a name of two words": (np.zeros(2), "components(a b)", f"unknown kind 'components(a b)'; {MEANT}"),
    "no names": (np.zeros(2), "components()", f"unknown kind 'components()'; {MEANT}"),
    "names of digits": (np.zeros(2), "components(0, 1)", f"unknown kind 'components(0, 1)'; {MEANT}"),
    "equal names": (
        np.zeros(2),
        "components(a, a)",
        "2 of its values are named '..._a' all alike; rename a field or key",
    ),
    "millions of values": (
        np.zeros((1001, 1000)),
        "",
        "an array of shape (1001, 1000) has more than 1000000 values; log a part of it",
    ),
    "two values of one name": (
        {"a": {"b": np.zeros(1)}, "a_b": np.zeros(1)},
        "",
        "2 of its values are named '..._a_b' all alike; rename a field or key",
    ),
    "a line break in a name": (
        {"a\nb": np.zeros(1)},
        "",
        r"the name of a value, '_a\nb', holds a control character; rename the key",
    ),
}


@pytest.mark.parametrize(("value", "kind", "words"), REFUSED.values(), ids=REFUSED)
def test_what_can_not_be_named_is_refused_with_what_is_wrong(value, kind, words):
    with pytest.raises(ElementError) as refused:
        parts_of(value, kind=kind)
    assert str(refused.value) == f"element '/x': {words}"


def test_an_entry_has_the_type_of_the_file_whatever_the_byte_order_in_memory():
    assert entries(np.zeros(1, ">f8"))[0].dtype == "<f8"


@pytest.mark.parametrize(
    ("dtype", "shape", "kind", "named"),
    [
        ("f8", (), "", "scalar"),
        ("f8", (1,), "", "scalar"),
        ("f8", (3,), "", "vector"),
        ("f8", (4,), "", "array"),
        ("f8", (2, 3), "", "matrix"),
        ("f8", (2, 1), "", "array"),
        ("f8", (2, 3, 4), "", "array"),
        ("c16", (), "", "complex"),
        ("f8", (4,), "quaternion_wxyz", "quaternion"),
        ("f8", (6,), "vector_at_position(a, b)", "vector_at_position"),
        ("f8", (3,), "array", "array"),
    ],
)
def test_the_table_says_how_entries_belong_together(dtype, shape, kind, named):
    assert kind_of(np.dtype(dtype), shape, kind) == named


# ---------------------------------------------------------------------------------------------------- enumerations


def test_an_enumeration_of_integers_is_logged_as_its_values_with_their_names():
    (entry,) = entries(Holder(gait=Gait.TROT), attr="gait")
    assert (entry.dtype, entry.labels) == ("<i8", {0: "STAND", 4: "TROT"})


def test_an_enumeration_of_strings_is_logged_by_the_places_of_its_members():
    (entry,) = entries(Holder(mode=Mode.WALK), attr="mode")
    assert entry.labels == {0: "IDLE", 1: "WALK"}


def test_flags_are_logged_as_their_bits():
    (part,) = parts_of(Holder(fault=Fault.HOT), attr="fault")
    assert part.source.convert(Fault.HOT | Fault.STALL) == 3
    assert part.labels == {1: "HOT", 2: "STALL"}


@pytest.mark.parametrize(("dtype", "labels"), [("u1", {1: "on"}), ("f8", None)])
def test_labels_name_the_values_of_integers_alone(dtype, labels):
    (entry,) = entries(np.zeros(1, dtype), labels={1: "on"})
    assert entry.labels == labels


def test_labels_of_an_enumeration_of_strings_are_refused(new_logger):
    with pytest.raises(ElementError, match="labels=Mode: the values of its members aren't integers"):
        new_logger().add(np.zeros(1, np.uint8), "mode", labels=Mode)


# ---------------------------------------------------------------------------------------------------- types


class Circle:
    """The tutorial's custom type."""

    def __init__(self):
        self.diameter = 1.0
        self.center = np.zeros(2)


silo.register(Circle, "diameter", "center", area=lambda circle: np.pi * circle.diameter**2 / 4)


@dataclasses.dataclass
class Wheel:
    rim: Circle = dataclasses.field(default_factory=Circle)
    speed: float = 0.0
    name: str = "front"
    orientation: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(4), metadata={"kind": "quaternion"})


class Disc(Circle):
    pass


class Arm:
    """Of a dotted field."""

    def __init__(self):
        self.wheel = Circle()


class Body:
    """Of a kind for a field."""

    def __init__(self):
        self.q = np.zeros(4)


silo.register(Arm, "wheel.diameter")
silo.register(Body, "q", kinds={"q": "quaternion"})
CIRCLE = "_diameter _center_0 _center_1 _area"
POINT = collections.namedtuple("point", "left right")
TYPES = {
    "a registered type has its fields": (Circle(), None, CIRCLE),
    "a subclass is logged like its base": (Disc(), None, CIRCLE),
    "a dataclass needs no registration and a registered type nests in it": (
        Wheel(),
        None,
        "_rim_diameter _rim_center_0 _rim_center_1 _rim_area _speed _name"
        " _orientation_x _orientation_y _orientation_z _orientation_w",
    ),
    "one is found behind an attribute": (Holder(arm=Holder(wheel=Circle())), "arm.wheel", CIRCLE),
    "a list of them is counted": (
        [Circle(), Circle()],
        None,
        "_0_diameter _0_center_0 _0_center_1 _0_area _1_diameter _1_center_0 _1_center_1 _1_area",
    ),
    "a dict has its keys": (
        {"left": Circle(), 7: Circle()},
        None,
        "_left_diameter _left_center_0 _left_center_1 _left_area _7_diameter _7_center_0 _7_center_1 _7_area",
    ),
    "a named tuple has its fields": (
        Holder(p=POINT(Circle(), Circle())),
        "p",
        "_left_diameter _left_center_0 _left_center_1 _left_area _right_diameter _right_center_0 _right_center_1"
        " _right_area",
    ),
    "a dotted field is named with underscores": (Arm(), None, "_wheel_diameter"),
    "kinds of registered fields are declared": (Body(), None, "_q_x _q_y _q_z _q_w"),
}


@pytest.mark.parametrize(("value", "attr", "expected"), TYPES.values(), ids=TYPES)
def test_the_entries_of_a_type_are_its_fields(value, attr, expected):
    assert suffixes(value, attr=attr) == expected.split()


def test_registering_nothing_is_refused():
    with pytest.raises(ElementError, match=r"register\(Mode\): name at least one"):
        silo.register(Mode)


@pytest.mark.parametrize("path", ["", "a-b", "a..b", "a()", "class", "a.import"])
def test_a_path_that_is_no_attribute_is_refused(path):
    with pytest.raises(ElementError, match="write the name of an attribute"):
        parts_of(Holder(a=1.0), attr=path)


def test_an_attribute_that_is_not_there_is_named():
    with pytest.raises(SourceError, match=r"/x: reading \.speed failed \(AttributeError"):
        parts_of(Holder(), attr="speed")

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


def test_a_scalar_array_has_no_suffix():
    assert suffixes(np.zeros(())) == [""]


def test_an_array_of_one_item_has_no_suffix():
    assert suffixes(np.zeros(1)) == [""]


@pytest.mark.parametrize("dtype", ["f8", "f4", "i4", "u1"])
def test_a_vector_of_three_numbers_is_x_y_z(dtype):
    assert suffixes(np.zeros(3, dtype)) == ["_x", "_y", "_z"]


@pytest.mark.parametrize("dtype", ["?", "S4", "M8[ns]"])
def test_three_items_that_are_no_numbers_are_counted(dtype):
    assert suffixes(np.zeros(3, dtype)) == ["_0", "_1", "_2"]


@pytest.mark.parametrize("size", [2, 4, 5])
def test_other_vectors_are_counted(size):
    assert suffixes(np.zeros(size)) == [f"_{i}" for i in range(size)]


def test_kind_array_counts_three_numbers_too():
    assert suffixes(np.zeros(3), kind="array") == ["_0", "_1", "_2"]


def test_a_matrix_is_counted_by_rows_and_columns():
    assert suffixes(np.zeros((2, 3))) == ["_0_0", "_0_1", "_0_2", "_1_0", "_1_1", "_1_2"]


def test_a_dimension_of_size_one_has_no_suffix():
    assert suffixes(np.zeros((1, 2, 1))) == ["_0", "_1"]


def test_a_transposed_matrix_keeps_its_rows_and_columns():
    (part,) = parts_of(np.arange(6.0).reshape(3, 2).T)
    offsets = {scalar.suffix: scalar.offset for scalar in part.scalars(strides_of(part.source))}
    assert offsets["_0_1"] == 16
    assert offsets["_1_0"] == 8


def test_a_quaternion_is_x_y_z_w():
    assert suffixes(np.zeros(4), kind="quaternion") == ["_x", "_y", "_z", "_w"]


def test_a_quaternion_with_w_first_in_memory_keeps_its_order():
    (part,) = parts_of(np.zeros(4), kind="quaternion_wxyz")
    scalars = part.scalars(strides_of(part.source))
    assert [(scalar.suffix, scalar.offset) for scalar in scalars] == [("_w", 0), ("_x", 8), ("_y", 16), ("_z", 24)]


def test_an_angle_axis_is_angle_x_y_z():
    assert suffixes(np.zeros(4), kind="angle_axis") == ["_angle", "_x", "_y", "_z"]


def test_a_pose_is_position_and_orientation():
    expected = [f"_position_{axis}" for axis in "xyz"] + [f"_orientation_{axis}" for axis in "xyzw"]
    assert suffixes(np.zeros(7), kind="pose") == expected


def test_a_twist_is_linear_and_angular():
    assert suffixes(np.zeros(6), kind="twist") == [
        f"_{part}_{axis}" for part in ("linear", "angular") for axis in "xyz"
    ]


def test_a_vector_at_a_position_names_both_frames():
    assert suffixes(np.zeros(6), kind=silo.types.vector_at_position("odom", "base")) == [
        *[f"_vector_in_odom_frame_{axis}" for axis in "xyz"],
        *[f"_at_position_in_base_frame_{axis}" for axis in "xyz"],
    ]


def test_components_are_called_by_the_names_that_are_given():
    kind = "components(FL_hip, knee)"
    assert suffixes(np.zeros((2, 2)), kind=kind) == ["_0_FL_hip", "_0_knee", "_1_FL_hip", "_1_knee"]
    for wrong in ("components(a b)", "components()", "components(0, 1)"):
        with pytest.raises(ElementError, match=r"unknown kind .* components\(NAME, NAME, ...\)"):
            parts_of(np.zeros(2), kind=wrong)
    with pytest.raises(ElementError, match="2 of its values are named"):
        parts_of(np.zeros(2), kind="components(a, a)")


def test_a_list_of_quaternions_has_the_kind_in_its_last_dimension():
    assert suffixes(np.zeros((2, 4)), kind="quaternion")[3:5] == ["_0_w", "_1_x"]


@pytest.mark.parametrize(("kind", "shape"), [("quaternion", (3,)), ("pose", (7, 2)), ("twist", ()), ("vector", (2,))])
def test_a_kind_that_does_not_fit_the_shape_is_refused(kind, shape):
    with pytest.raises(ElementError, match=r"element '/x': kind .* has \d values in its last dimension"):
        parts_of(np.zeros(shape), kind=kind)


def test_an_unknown_kind_is_refused_with_those_that_there_are():
    with pytest.raises(ElementError, match=r"unknown kind 'quat'; there are quaternion, .*vector_at_position"):
        parts_of(np.zeros(4), kind="quat")


def test_a_complex_number_is_real_and_imag():
    assert suffixes(np.zeros((), complex)) == ["_real", "_imag"]


def test_a_structured_array_has_its_fields_as_suffixes():
    dtype = np.dtype([("pos", "f8", (3,)), ("id", "i4"), ("inner", [("a", "?"), ("m", "f4", (2, 2))])])
    assert suffixes(np.zeros((), dtype)) == [
        *["_pos_x", "_pos_y", "_pos_z", "_id", "_inner_a"],
        *["_inner_m_0_0", "_inner_m_0_1", "_inner_m_1_0", "_inner_m_1_1"],
    ]


def test_an_array_of_structures_is_counted_first():
    assert suffixes(np.zeros(2, [("a", "f8"), ("b", "f8")])) == ["_0_a", "_0_b", "_1_a", "_1_b"]


def test_an_entry_has_the_type_of_the_file_whatever_the_byte_order_in_memory():
    assert entries(np.zeros(1, ">f8"))[0].dtype == "<f8"


def test_an_array_of_millions_of_values_is_refused():
    with pytest.raises(ElementError, match="more than 1000000 values; log a part of it"):
        parts_of(np.zeros((1001, 1000)))


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


def test_labels_name_the_values_of_an_integer_array():
    (entry,) = entries(np.zeros(1, np.uint8), labels={1: "on"})
    assert entry.labels == {1: "on"}


def test_a_float_has_no_labels():
    (entry,) = entries(np.zeros(1), labels={1: "on"})
    assert entry.labels is None


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


def test_a_registered_type_has_its_fields_as_suffixes():
    assert suffixes(Circle()) == ["_diameter", "_center_0", "_center_1", "_area"]


def test_a_subclass_is_logged_like_its_base():
    class Disc(Circle):
        pass

    assert suffixes(Disc()) == suffixes(Circle())


def test_a_dataclass_needs_no_registration():
    expected = ["_speed", "_name", *[f"_orientation_{axis}" for axis in "xyzw"]]
    assert suffixes(Wheel())[4:] == expected


def test_a_registered_type_nests_in_dataclasses():
    assert suffixes(Wheel())[:2] == ["_rim_diameter", "_rim_center_0"]


def test_a_registered_type_is_found_behind_an_attribute():
    assert suffixes(Holder(arm=Holder(wheel=Circle())), attr="arm.wheel")[0] == "_diameter"


def test_a_list_of_registered_types_is_counted():
    assert suffixes([Circle(), Circle()])[4] == "_1_diameter"


def test_a_dict_has_its_keys_as_suffixes():
    assert suffixes({"left": Circle(), 7: Circle()})[::4] == ["_left_diameter", "_7_diameter"]


def test_a_dotted_field_is_named_with_underscores():
    class Arm:
        def __init__(self):
            self.wheel = Circle()

    silo.register(Arm, "wheel.diameter")
    assert suffixes(Arm()) == ["_wheel_diameter"]


def test_kinds_of_registered_fields_are_declared():
    class Body:
        def __init__(self):
            self.q = np.zeros(4)

    silo.register(Body, "q", kinds={"q": "quaternion"})
    assert suffixes(Body()) == ["_q_x", "_q_y", "_q_z", "_q_w"]


def test_registering_nothing_is_refused():
    with pytest.raises(ElementError, match=r"register\(Mode\): name at least one"):
        silo.register(Mode)


@pytest.mark.parametrize("path", ["", "a-b", "a..b", "a()", "class", "a.import"])
def test_a_path_that_is_no_attribute_is_refused(path):
    with pytest.raises(ElementError, match="write the name of an attribute"):
        parts_of(Holder(a=1.0), attr=path)


def test_two_values_of_one_name_are_refused():
    with pytest.raises(ElementError, match=r"2 of its values are named '\.\.\._a_b' all alike"):
        parts_of({"a": {"b": np.zeros(1)}, "a_b": np.zeros(1)})


def test_a_key_with_a_line_break_is_refused():
    with pytest.raises(ElementError, match="control character"):
        parts_of({"a\nb": np.zeros(1)})


def test_an_attribute_that_is_not_there_is_named():
    with pytest.raises(SourceError, match=r"/x: reading \.speed failed \(AttributeError"):
        parts_of(Holder(), attr="speed")


def test_a_named_tuple_has_its_fields_as_suffixes():
    point = collections.namedtuple("point", "left right")
    assert suffixes(Holder(p=point(Circle(), Circle())), attr="p")[0] == "_left_diameter"

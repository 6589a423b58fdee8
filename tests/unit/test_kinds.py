"""The table of kinds: what one entry says is what the logger, the bags and the readers do."""

import numpy as np
import pytest

from silo.core import kinds
from silo.core.elements import BufferType, Entry
from silo.core.kinds import KINDS, GeometryMessage, Kind, kind_given, regroup, struct_fields, struct_text
from silo.core.recording import RecordedElement, RecordedEntry
from silo.errors import ElementError
from silo.files.bags.ros_types import channels_of
from silo.loop.sources import refer
from silo.loop.types import Component, kind_of

GIVEN = [name for kind in KINDS for name in kind.orders] + [kinds.vector_at_position("a_frame_b", "c")]


@pytest.mark.parametrize("name", GIVEN)
def test_what_a_kind_names_is_put_together_again(name):
    kind, layout = kind_given(name)
    names = [f"/log/x{suffix}" for suffix in layout]
    (group,) = regroup(names, [0] * len(names))
    assert (group.name, group.kind, group.shape) == ("/log/x", kind.name, (len(layout),))
    assert group.suffixes == layout


@pytest.mark.parametrize("name", GIVEN)
def test_each_value_in_memory_has_one_suffix(name):
    kind, layout = kind_given(name)
    assert len(set(layout)) == len(layout)
    assert not kind.suffixes or sorted(layout) == sorted(kind.suffixes)


def test_a_vector_at_a_position_of_the_original_is_one_element():
    names = [f"/log/f_vector_in_world_frame_{axis}" for axis in "xyz"]
    names += [f"/log/f_at_position_in_base_frame_{axis}" for axis in "xyz"]
    (group,) = regroup(["/log/a", *names, "/log/b"], [0] * 8)[1:2]
    assert (group.name, group.kind, group.shape, group.start) == ("/log/f", "vector_at_position", (6,), 1)


def test_half_a_vector_at_a_position_is_a_vector():
    names = [f"/log/f_vector_in_world_frame_{axis}" for axis in "xyz"]
    (group,) = regroup(names, [0] * 3)
    assert (group.name, group.kind) == ("/log/f_vector_in_world_frame", "vector")


def test_a_new_entry_is_all_that_a_kind_needs(monkeypatch):
    message = GeometryMessage(
        "Wrench", "wrench", (("geometry_msgs/Vector3", "force"), ("geometry_msgs/Vector3", "torque"))
    )
    suffixes = tuple(f"_{part}_{axis}" for part in ("force", "torque") for axis in "xyz")
    wrench = Kind("wrench", suffixes=suffixes, shape=(6,), orders={"wrench": suffixes}, message=message)
    monkeypatch.setattr(kinds, "KINDS", (wrench, *KINDS))
    part = Component("", refer(np.zeros(6), "/x"), "wrench")
    assert [scalar.suffix for scalar in part.scalars((8,))] == list(suffixes)
    assert kind_of(np.dtype("f8"), (6,), "wrench") == "wrench"
    assert regroup([f"/log/w{suffix}" for suffix in suffixes], [0] * 6)[0].kind == "wrench"
    entries = tuple(RecordedEntry(f"/log/w{s}", Entry(s, "<f8"), np.zeros(1)) for s in suffixes)
    element = RecordedElement("/log/w", "N", "wrench", (6,), 1, BufferType.LOOPING, 0, entries)
    (channel,) = channels_of([element])
    assert channel.type.name == "geometry_msgs/msg/WrenchStamped"


def test_an_unknown_kind_names_those_that_there_are():
    with pytest.raises(ElementError, match=r"unknown kind 'quat'; there are quaternion, quaternion_wxyz, .*, array"):
        kind_given("quat")


@pytest.mark.parametrize(
    "dtype",
    [
        [("a", "<f8")],
        [("a", ">i2"), ("b", [("c", "<c16", (2,)), ("d", "S3")], (2, 1))],
        [("when", "<M8[ns]"), ("\u00e4", "?")],
    ],
)
def test_a_structure_comes_back_from_its_text(dtype):
    made = np.dtype(struct_fields(struct_text(np.dtype(dtype))))
    assert made == np.dtype(dtype).newbyteorder("<")


@pytest.mark.parametrize("text", ["", "[", "{}", "[[1]]", '[["a",[[]],[]]]', "[" * 5000])
def test_a_text_that_is_no_structure_has_no_fields(text):
    assert struct_fields(text) == []

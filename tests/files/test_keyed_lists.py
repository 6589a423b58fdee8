"""Lists of messages with keys, as `rosbags` wrote them: transforms, diagnostics, states of interfaces, statistics."""

import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import silo
from silo.files.others import recording as others

START = 1_700_000_000 * 10**9
DYNAMIC = """std_msgs/Header header
string[] joint_names
control_msgs/InterfaceValue[] interface_values
================================================================================
MSG: control_msgs/InterfaceValue
string[] interface_names
float64[] values
"""
STATISTICS = """std_msgs/Header header
pal_statistics_msgs/Statistic[] statistics
================================================================================
MSG: pal_statistics_msgs/Statistic
string name
float64 value
"""


@pytest.fixture(scope="module")
def store():
    made = get_typestore(Stores.LATEST)
    made.register(get_types_from_msg(DYNAMIC, "control_msgs/msg/DynamicJointState"))
    made.register(get_types_from_msg(STATISTICS, "pal_statistics_msgs/msg/Statistics"))
    return made


def kind(store, name):
    package, _, short = name.partition("/")
    return store.types[f"{package}/msg/{short}"]


def header(store, seconds):
    return kind(store, "std_msgs/Header")(kind(store, "builtin_interfaces/Time")(seconds, 5), "odom")


def write(store, path, topic, type_name, messages):
    with Writer(path, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        package, _, short = type_name.partition("/")
        connection = writer.add_connection(topic, f"{package}/msg/{short}", typestore=store)
        for number, message in enumerate(messages):
            writer.write(connection, START + number * 10**8, store.serialize_cdr(message, connection.msgtype))
    return path


def transforms(store, tick, frames):
    one, move = kind(store, "geometry_msgs/TransformStamped"), kind(store, "geometry_msgs/Transform")
    place, turn = kind(store, "geometry_msgs/Vector3"), kind(store, "geometry_msgs/Quaternion")
    return kind(store, "tf2_msgs/TFMessage")([
        one(kind(store, "std_msgs/Header")(kind(store, "builtin_interfaces/Time")(tick, at), parent), child,
            move(place(tick, at, 0.5), turn(0.0, 0.0, 0.0, 1.0)))
        for at, (parent, child) in enumerate(frames)
    ])  # fmt: skip


@settings(max_examples=20, deadline=None)
@given(st.lists(st.lists(st.tuples(st.sampled_from(["odom", "map", "b"]), st.sampled_from(["arm", "leg", "x"])),
                         max_size=4), min_size=1, max_size=8))  # fmt: skip
def test_every_transform_is_where_it_was_sent(store, tmp_path_factory, ticks):
    path = tmp_path_factory.mktemp("bag") / "bag"
    write(
        store, path, "/tf", "tf2_msgs/TFMessage", [transforms(store, tick, frames) for tick, frames in enumerate(ticks)]
    )
    wanted = {}
    for tick, frames in enumerate(ticks):
        for at, (parent, child) in enumerate(frames):
            wanted.setdefault(f"/tf/{parent}->{child}", []).append((tick, at))
    log = silo.open_log(path)
    measured = silo.open_log(path, stamps="header")
    assert {name.rpartition("/")[0] for name in log.names("/tf/*/translation")} == set(wanted)
    for name, samples in wanted.items():
        signal = log[f"{name}/translation"]
        assert signal.values.tolist() == [[tick, at, 0.5] for tick, at in samples]
        assert signal.time_ns.tolist() == [START + tick * 10**8 for tick, _ in samples]
        assert signal.unit == "m"
        assert log[f"{name}/translation/y"].values.tolist() == [at for _, at in samples]
        assert log[f"{name}/rotation"].kind == "quaternion"
        stamps = sorted(tick * 10**9 + at if tick or at else START for tick, at in samples)
        assert measured[f"{name}/rotation"].time_ns.tolist() == stamps
    assert log.warnings == ()


def test_diagnostics_are_levels_words_and_numbers(store, tmp_path):
    status, pair = kind(store, "diagnostic_msgs/DiagnosticStatus"), kind(store, "diagnostic_msgs/KeyValue")
    messages = [
        kind(store, "diagnostic_msgs/DiagnosticArray")(header(store, tick), [
            status(tick % 4, "motors", "hot" * (tick % 3), "", [pair("temperature", f"{tick}.5"), pair("mode", "on")]),
            *([status(0, "camera", "", "", [pair("temperature", "n/a")])] if tick % 2 else []),
            *([status(2, "camera/temperature", "", "", [])] if tick == 0 else []),  # called as a value of another
        ]) for tick in range(8)
    ]  # fmt: skip
    log = silo.open_log(write(store, tmp_path / "bag", "/diagnostics", "diagnostic_msgs/DiagnosticArray", messages))
    assert log["/diagnostics/motors/level"].values.tolist() == [0, 1, 2, 3] * 2
    assert log["/diagnostics/motors/level"].labels[2] == "ERROR"
    assert log["/diagnostics/motors/message"].values.tolist() == ["hot" * (tick % 3) for tick in range(8)]
    assert log["/diagnostics/motors/temperature"].values.tolist() == [tick + 0.5 for tick in range(8)]
    assert log["/diagnostics/motors/mode"].values.tolist() == ["on"] * 8
    assert log["/diagnostics/camera/temperature"].values.tolist() == ["", *["n/a"] * 4]
    assert log["/diagnostics/camera/temperature/level"].values.tolist() == [2, *[None] * 4]
    assert len(log["/diagnostics/header/stamp"]) == 8
    measured = silo.open_log(tmp_path / "bag", stamps="header")
    assert measured["/diagnostics/camera/level"].time_ns.tolist() == [tick * 10**9 + 5 for tick in (1, 3, 5, 7)]


def test_states_of_interfaces_and_statistics_have_their_names(store, tmp_path):
    values = kind(store, "control_msgs/InterfaceValue")
    messages = [
        kind(store, "control_msgs/DynamicJointState")(header(store, tick), ["hip", "knee"][:: 1 - 2 * (tick % 2)], [
            values(["position", "effort"], np.array([tick, 2.0])), values(["position"], np.array([-tick], float)),
        ]) for tick in range(4)
    ]  # fmt: skip
    path = write(store, tmp_path / "a", "/dynamic_joint_states", "control_msgs/DynamicJointState", messages)
    log = silo.open_log(path)
    assert log["/dynamic_joint_states/hip/position"].values.tolist() == [0, -1, 2, -3]
    assert log["/dynamic_joint_states/knee/position"].values.tolist() == [0, 1, -2, 3]
    assert len(log["/dynamic_joint_states/hip/effort"]) == 2
    one = kind(store, "pal_statistics_msgs/Statistic")
    told = [kind(store, "pal_statistics_msgs/Statistics")(header(store, tick), [one("loop.period", tick * 0.1)])
            for tick in range(5)]  # fmt: skip
    path = write(store, tmp_path / "b", "/introspection/full", "pal_statistics_msgs/Statistics", told)
    assert silo.open_log(path)["/introspection/full/loop.period/value"].values == pytest.approx(np.arange(5) * 0.1)


def test_a_type_of_the_same_name_and_another_make_is_read_as_any(store, tmp_path):
    own = get_typestore(Stores.EMPTY)
    own.register(get_types_from_msg("float64 transforms\n", "tf2_msgs/msg/TFMessage"))
    messages = [own.types["tf2_msgs/msg/TFMessage"](float(tick)) for tick in range(3)]
    log = silo.open_log(write(own, tmp_path / "bag", "/tf", "tf2_msgs/TFMessage", messages))
    assert log["/tf/transforms"].values.tolist() == [0, 1, 2]


def test_of_very_many_messages_the_first_tell_the_names(store, tmp_path, monkeypatch):
    messages = [transforms(store, tick, [("odom", "arm" if tick < 150 else "late")]) for tick in range(200)]
    path = write(store, tmp_path / "bag", "/tf", "tf2_msgs/TFMessage", messages)
    monkeypatch.setattr(others, "_MOST_LOOKED_AT", 100)
    log = silo.open_log(path)
    assert len(log["/tf/odom->arm/translation"]) == 150
    assert any("what came first" in text for text in log.warnings)


@pytest.mark.filterwarnings("ignore::silo.errors.LogWarning")
def test_of_damaged_lists_come_only_errors_of_silo(store, tmp_path):
    messages = [transforms(store, tick, [("odom", "arm"), ("map", "odom")]) for tick in range(20)]
    path = write(store, tmp_path / "bag", "/tf", "tf2_msgs/TFMessage", messages)
    (file,) = path.glob("*.mcap")
    whole, draw = file.read_bytes(), random.Random(7)
    for _ in range(150):
        data = bytearray(whole)
        for _ in range(draw.randint(1, 4)):
            data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
        file.write_bytes(data)
        try:
            log = silo.open_log(path)
            for name in log:
                log[name].values  # noqa: B018
        except silo.SiloError:
            continue

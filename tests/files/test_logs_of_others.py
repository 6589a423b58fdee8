"""Logs of other systems: bags of ROS 1 by what `rosbags` wrote, ULogs by their format, each damaged too."""

import random
import struct
import time

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import silo
from silo.errors import FileFormatError
from silo_tui.sessions.recorded import open_file

START = 1_700_000_000 * 10**9
COUNT = 200  # damaged files of each kind


@pytest.fixture(scope="module")
def types():
    store = get_typestore(Stores.ROS1_NOETIC)
    text = "Header header\nduration left\nfloat32[2] pair\nstring[] words\nchar last\n"
    store.register(get_types_from_msg(text, "my_msgs/msg/Mixed"))
    return store


def write_bag(path, types, compression=None, count=40):
    """A bag of ROS 1 of three topics, one of them of two publishers."""
    writer = Writer(path)
    if compression:
        writer.set_compression(compression)
    known = types.types
    header, stamp = known["std_msgs/msg/Header"], known["builtin_interfaces/msg/Time"]
    duration, mixed = known["builtin_interfaces/msg/Duration"], known["my_msgs/msg/Mixed"]
    number, joints = known["std_msgs/msg/Float64"], known["sensor_msgs/msg/JointState"]
    with writer:
        ways = [
            writer.add_connection(topic, kind, typestore=types, callerid=caller)
            for topic, kind, caller in (
                ("/number", "std_msgs/msg/Float64", "/a"),
                ("/number", "std_msgs/msg/Float64", "/b"),
                ("/mixed", "my_msgs/msg/Mixed", "/a"),
                ("/joints", "sensor_msgs/msg/JointState", "/a"),
            )
        ]
        for i in range(count):
            head = header(i, stamp(5 + i, 7), "base")
            made = [
                number(i * 2.0),
                number(-float(i)),
                mixed(head, duration(i, 3), np.array([i, 0.5], np.float32), ["a" * i, "b"], 9),
                joints(head, ["hip", "knee"], np.array([i, -i], float), np.array([]), np.array([1.0, 2.0])),
            ]
            for way, message in zip(ways, made, strict=True):
                data = types.serialize_ros1(message, way.msgtype)
                writer.write(way, START + i * 10**7 + ways.index(way), data)


@pytest.mark.parametrize("compression", [None, *Writer.CompressionFormat])
def test_a_bag_of_ros_1_is_read_as_it_was_written(types, tmp_path, compression):
    write_bag(tmp_path / "x.bag", types, compression)
    log = silo.open_log(tmp_path / "x.bag")
    steps = np.arange(40.0)
    assert log["/number/data"].values.tolist() == np.stack([steps * 2, -steps], axis=1).ravel().tolist()
    assert log["/mixed/pair"].values.tolist() == [[i, 0.5] for i in range(40)]
    assert log["/mixed/last"].values.tolist() == [9] * 40
    assert log["/joints/position_knee"].values.tolist() == (-steps).tolist()
    assert log["/joints/effort_hip"].unit == "-"
    assert log["/mixed/header/frame_id"].values.tolist() == ["base"] * 40
    np.testing.assert_allclose(log["/mixed/pair"].times, steps * 0.01, atol=1e-8)
    assert str(log["/mixed/header/stamp"].values[3]) == "1970-01-01T00:00:08.000000007"
    headed = silo.open_log(tmp_path / "x.bag", stamps="header")["/mixed/pair"]
    np.testing.assert_allclose(headed.times[1:] - headed.times[:-1], 1.0)
    assert log.warnings == ()


def test_a_bag_of_ros_1_in_another_format_holds_the_same(types, tmp_path):
    write_bag(tmp_path / "x.bag", types)
    log = silo.open_log(tmp_path / "x.bag")
    again = silo.open_log(log.save(tmp_path / "x.npz"))
    assert again["/mixed/pair"].values.tolist() == log["/mixed/pair"].values.tolist()


def test_a_bag_of_ros_1_without_an_index_says_what_makes_one(types, tmp_path):
    write_bag(tmp_path / "x.bag", types)
    data = bytearray((tmp_path / "x.bag").read_bytes())
    place = data.index(b"index_pos=") + len(b"index_pos=")
    data[place : place + 8] = bytes(8)
    (tmp_path / "x.bag").write_bytes(data)
    with pytest.raises(FileFormatError, match=r"not indexed.*rosbag reindex"):
        silo.open_log(tmp_path / "x.bag")


def test_a_chunk_that_unpacks_to_too_much_is_told(types, tmp_path, monkeypatch):
    from silo.files.mcap import chunks

    write_bag(tmp_path / "x.bag", types, Writer.CompressionFormat.BZ2)
    monkeypatch.setattr(chunks, "MOST_ROOM", 10)
    monkeypatch.setattr(chunks, "MOST_RATIO", 1)
    with pytest.raises(FileFormatError, match="unpack to more than"):
        silo.open_log(tmp_path / "x.bag")


# ------------------------------------------------------------------------------------------------------------- ULog


def record(kind, data):
    return struct.pack("<HB", len(data), ord(kind)) + data


def keyed(kind, key, value):
    return record(kind, bytes([len(key)]) + key.encode() + value)


def a_ulog(count=50):
    """A ULog with two topics, one of them twice, two parameters of which one changes, a message and a dropout."""
    formats = [
        "attitude:uint64_t timestamp;float[4] q;uint8_t reset;",
        "battery:uint64_t timestamp;float voltage;battery_cell cell;",
        "battery_cell:int16_t low;bool[2] on;",
    ]
    made = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1_000_000)
    made += record("B", bytes(40))
    made += b"".join(record("F", text.encode()) for text in formats)
    made += keyed("I", "char[5] sys_name", b"PX4 1")
    made += keyed("P", "float MC_ROLL_P", struct.pack("<f", 6.5)) + keyed("P", "int32_t SYS_ID", struct.pack("<i", 3))
    for number, (instance, name) in enumerate([(0, "attitude"), (0, "battery"), (1, "battery")]):
        made += record("A", struct.pack("<BH", instance, number) + name.encode())
    for i in range(count):
        micros = 1_000_000 + i * 4000
        made += record("D", struct.pack("<HQ4fB", 0, micros, i, 0, 0, 1, i % 7))
        if i % 5 == 0:
            for number in (1, 2):
                cell = struct.pack("<h2?", -i, True, False)
                made += record("D", struct.pack("<HQf", number, micros + number, i / 2 * number) + cell)
        if i == 20:
            made += record("L", b"4" + struct.pack("<Q", micros) + b"low battery")
            made += keyed("P", "float MC_ROLL_P", struct.pack("<f", 7.0))
            made += record("O", struct.pack("<H", 30))
    return made


def test_a_ulog_is_read_as_it_was_written(tmp_path):
    (tmp_path / "x.ulg").write_bytes(a_ulog())
    log = silo.open_log(tmp_path / "x.ulg")
    assert log["/attitude/q"].values.tolist() == [[i, 0, 0, 1] for i in range(50)]
    assert log["/attitude/reset"].values.tolist() == [i % 7 for i in range(50)]
    assert log["/battery_0/voltage"].values.tolist() == [i / 2 for i in range(0, 50, 5)]
    assert log["/battery_1/voltage"].values.tolist() == [float(i) for i in range(0, 50, 5)]
    assert log["/battery_1/cell/low"].values.tolist() == [-i for i in range(0, 50, 5)]
    assert log["/battery_0/cell/on"].values.tolist() == [[True, False]] * 10
    np.testing.assert_allclose(log["/battery_1/voltage"].times, np.arange(10) * 0.02 + 2e-6)
    assert log.recording.about["sys_name"] == "PX4 1"
    assert log.warnings == ("its logger lost 0.03 s in 1 dropout",)


def test_silo_tui_shows_a_ulog_and_a_bag_of_ros_1_at_any_moment(types, tmp_path):
    (tmp_path / "x.ulg").write_bytes(a_ulog())
    write_bag(tmp_path / "x.bag", types)
    for path, name in ((tmp_path / "x.ulg", "/battery_1/voltage"), (tmp_path / "x.bag", "/number/data")):
        signal, of = silo.open_log(path)[name], open_file(path).source
        for place, at_ns in enumerate(signal.time_ns.tolist()):
            for late_ns, held in ((0, place), (-1, place - 1)):
                if held >= 0:
                    assert of.readings([name], at_ns + late_ns)[name].newest[0] == signal.values[held]


def test_messages_and_parameters_of_a_ulog_are_known(tmp_path):
    (tmp_path / "x.ulg").write_bytes(a_ulog())
    log = silo.open_log(tmp_path / "x.ulg")
    (low,) = [event for event in log.events if event.kind == "marker"]
    assert (low.seconds, low.text) == (pytest.approx(0.08), "WARNING: low battery")
    assert log.time_ns[low.tick] == low.time_ns
    assert log.parameters.at(0.05) == {"MC_ROLL_P": 6.5, "SYS_ID": 3}
    assert log.parameters.at(0.09)["MC_ROLL_P"] == 7.0
    assert len(log.parameters.changes) == 1


@pytest.mark.filterwarnings("ignore::silo.LogWarning")
def test_a_ulog_that_ends_within_a_message_says_so(tmp_path):
    whole, shorter, path = a_ulog(20), len(a_ulog(19)), tmp_path / "x.ulg"
    for size in range(shorter, len(whole) + 1):
        path.write_bytes(whole[:size])
        told = [text for text in silo.open_log(path).warnings if "ends within a message" in text]
        assert bool(told) == (size not in (shorter, len(whole)))


@pytest.mark.parametrize("kind", ["bag", "ulg"])
def test_of_damaged_logs_of_others_come_only_errors_of_silo(types, tmp_path, kind, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if kind == "bag":
        write_bag(tmp_path / "whole.bag", types, Writer.CompressionFormat.LZ4, count=8)
    else:
        (tmp_path / "whole.ulg").write_bytes(a_ulog(12))
    whole = (tmp_path / f"whole.{kind}").read_bytes()
    rng, read = random.Random(7), 0
    for number in range(COUNT):
        data = bytearray(whole)
        place = rng.randrange(len(data))
        if number % 4 == 0:
            del data[place:]
        elif number % 4 == 1:
            data[place : place + 4] = struct.pack("<I", rng.choice([0, 1, 2**16, 2**31, 2**32 - 1]))
        else:
            data[place] ^= 1 << rng.randrange(8)
        path = tmp_path / f"{number}.{kind}"
        path.write_bytes(data)
        begin = time.process_time()
        try:
            log = silo.open_log(path)
            for name in log:
                assert len(log[name].values) == len(log[name].time_ns)
            read += 1
        except silo.SiloError as error:
            assert str(path) in str(error)
        assert time.process_time() - begin < 5
    assert read > COUNT // 20

"""Bags opened by readers that others wrote: `mcap` with `mcap-ros2-support`, `rosbags`, npm's `@mcap/core`."""

import json
import math
import shutil
import subprocess
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

from silo.core.elements import FileType, Stretch
from silo.core.recording import Recording
from silo.files import write
from silo.files.bags import writer
from silo.files.bags.writer import write_bag
from tests.stand_ins.saved import element

TICKS = 40
START = 1_700_000_000_999_999_999
STEP = 2_500_001
MODES = {0: "stand", 1: "walk fast", -1: "off"}
PACKAGE = "signal_logger_msgs/msg/"
POSE = [f"_position_{a}" for a in "xyz"] + [f"_orientation_{a}" for a in "xyzw"]
CELLS = [f"_{row}_{column}" for row in range(2) for column in range(3)]
TWIST = [f"_{part}_{a}" for part in ("linear", "angular") for a in "xyz"]


def ramps(count, dtype="<f8", samples=TICKS):
    return [np.arange(samples, dtype=dtype) + 10 * i for i in range(count)]


NUMBERS = {"Float64": "<f8", "Float32": "<f4", "Int8": "i1", "Int16": "<i2", "Int32": "<i4", "Int64": "<i8"}
NUMBERS |= {"UInt8": "u1", "UInt16": "<u2", "UInt32": "<u4", "UInt64": "<u8"}


@pytest.fixture(scope="module")
def robot() -> Recording:
    table = [element(f"/log/{name}", ramps(1, dtype)) for name, dtype in NUMBERS.items()]
    table += [
        element("/log/half", ramps(1, "<f2")),
        element("/log/Bool", [np.arange(TICKS) % 2 == 1]),
        element("/log/text", [np.array([b"stand", b"", "Ω".encode(), b"go"] * 10, dtype="S5")]),
        element("/log/raw", [np.array([b"\xff\x00\x01", b""] * 20, dtype="S3")]),
        element("/log/mode", [np.array([0, 1, -1, 0] * 10, dtype="i1")], labels=MODES),
        element("/log/vector", ramps(3), suffixes=("_x", "_y", "_z"), kind="vector", shape=(3,)),
        element("/log/quaternion", ramps(4, "<f4"), suffixes=("_x", "_y", "_z", "_w"), kind="quaternion", shape=(4,)),
        element("/log/pose", ramps(7), suffixes=POSE, kind="pose", shape=(7,)),
        element("/log/twist", ramps(6), suffixes=TWIST, kind="twist", shape=(6,)),
        element("/log/joints", ramps(12), suffixes=[f"_{i}" for i in range(12)], kind="vector", shape=(12,)),
        element("/log/matrix", ramps(6, "<f4"), suffixes=CELLS, kind="matrix", shape=(2, 3)),
        element("/log/angle_axis", ramps(4), suffixes=("_angle", "_x", "_y", "_z"), kind="angle_axis", shape=(4,)),
        element("/log/complex", ramps(1, "<c16")),
        element(
            "/log/foot",
            [*ramps(1), np.arange(TICKS) % 2 == 0, np.array([b"LF"] * TICKS), *ramps(1, "<i2")],
            suffixes=("_force", "_contact", "_name", "_0"),
            kind="struct",
            shape=(),
        ),
        element("/log/slow", ramps(1, samples=4), divider=10, first=5),
        element("/log/early", ramps(1, samples=3)),
    ]
    return Recording("robot", START + STEP * np.arange(TICKS, dtype=np.int64), TICKS, table, frequency_hz=400.0)


EXPECTED_TYPES = {f"/log/{name}": f"{PACKAGE}{name}Stamped" for name in NUMBERS} | {
    "/log/half": PACKAGE + "Float32Stamped",
    "/log/Bool": PACKAGE + "BoolStamped",
    "/log/text": PACKAGE + "StringStamped",
    "/log/raw": PACKAGE + "UInt8Array3Stamped",
    "/log/vector": "geometry_msgs/msg/Vector3Stamped",
    "/log/quaternion": "geometry_msgs/msg/QuaternionStamped",
    "/log/pose": "geometry_msgs/msg/PoseStamped",
    "/log/twist": "geometry_msgs/msg/TwistStamped",
    "/log/joints": PACKAGE + "Float64Array12Stamped",
    "/log/matrix": PACKAGE + "Float32Matrix2x3Stamped",
    "/log/complex": PACKAGE + "Float64Array2Stamped",
    "/log/foot_name": PACKAGE + "StringStamped",
}


@pytest.fixture(scope="module")
def folder(robot, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("bags") / "run 1"
    # small chunks, so that readers meet several
    before, writer.CHUNK_BYTES = writer.CHUNK_BYTES, 20_000
    write_bag(robot, path)
    writer.CHUNK_BYTES = before
    return path


@pytest.fixture(scope="module")
def file(folder) -> Path:
    return folder / "run 1_0.mcap"


@pytest.fixture(scope="module")
def decoded(file):
    """Messages by topic: (schema name, log time, publish time, message)."""
    found: dict = {}
    with file.open("rb") as opened:
        reader = make_reader(opened, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for schema, channel, message, content in reader.iter_decoded_messages(log_time_order=False):
            found.setdefault(channel.topic, []).append((schema.name, message.log_time, message.publish_time, content))
    return found


def values(decoded, topic, field="value"):
    return [getattr(message[3], field) for message in decoded[topic]]


class TestMcap:
    """What `mcap` and `mcap-ros2-support` say, checksums included."""

    def test_every_topic_has_its_message_type(self, decoded):
        assert {topic: decoded[topic][0][0] for topic in EXPECTED_TYPES} == EXPECTED_TYPES

    @pytest.mark.parametrize(
        ("name", "wanted"),
        [
            *((name, list(range(TICKS))) for name in (*NUMBERS, "half")),
            ("Bool", [False, True] * 20),
            ("text", ["stand", "", "Ω", "go"] * 10),
            ("raw", [[255, 0, 1], [0, 0, 0]] * 20),  # no text: bytes
            ("foot_name", ["LF"] * TICKS),  # of a struct
        ],
    )
    def test_values_are_exact(self, decoded, name, wanted):
        assert [list(value) if name == "raw" else value for value in values(decoded, f"/log/{name}")] == wanted

    def test_stamps_are_exact_to_the_nanosecond(self, decoded, robot):
        for messages in decoded.values():
            for _, log_time, publish_time, message in messages:
                stamp = message.header.stamp
                assert stamp.sec * 10**9 + stamp.nanosec == log_time == publish_time
        # of each tick, of every tenth, of the first ones
        for name, ticks in (("Float64", slice(None)), ("slow", slice(5, None, 10)), ("early", slice(3))):
            assert [message[1] for message in decoded[f"/log/{name}"]] == robot.time_ns[ticks].tolist()

    def test_vectors_poses_twists_matrices_and_structs_have_their_parts_in_order(self, decoded):
        vector = values(decoded, "/log/vector", "vector")[5]
        assert (vector.x, vector.y, vector.z) == (5, 15, 25)
        pose = values(decoded, "/log/pose", "pose")[1]
        assert (pose.position.x, pose.position.z) == (1, 21)
        assert (pose.orientation.x, pose.orientation.w) == (31, 61)
        twist = values(decoded, "/log/twist", "twist")[1]
        assert (twist.linear.y, twist.angular.z) == (11, 51)
        message = decoded["/log/matrix"][2][3]
        assert (message.rows, message.cols, list(message.value)) == (2, 3, [2, 12, 22, 32, 42, 52])
        message = decoded["/log/foot"][3][3]
        assert (message.force, message.contact, message.value_0) == (3, False, 3)

    def test_the_names_of_an_enumeration_are_constants_of_its_message(self, file):
        with file.open("rb") as opened:
            summary = make_reader(opened).get_summary()
        channel = next(c for c in summary.channels.values() if c.topic == "/log/mode")
        text = summary.schemas[channel.schema_id].data.decode()
        assert "int8 STAND=0\nint8 WALK_FAST=1" in text
        assert channel.metadata["labels"] == "-1=off, 0=stand, 1=walk fast"

    def test_messages_come_in_the_order_of_time_and_chunks_do_not_overlap(self, file):
        with file.open("rb") as opened:
            reader = make_reader(opened)
            times = [message.log_time for _, _, message in reader.iter_messages(log_time_order=False)]
            chunks = reader.get_summary().chunk_indexes
        assert times == sorted(times)
        assert len(chunks) > 2
        assert all(a.message_end_time < b.message_start_time for a, b in pairwise(chunks))

    def test_the_index_finds_one_topic_in_a_span_of_time(self, file):
        with file.open("rb") as opened:
            reader = make_reader(opened)
            span = {"starting_at": START + 10 * STEP, "ending_before": START + 20 * STEP}
            found = [m.sequence for _, _, m in reader.iter_messages(topics=["/log/Float64"], **span)]
        assert found == list(range(10, 20))

    def test_statistics_count_every_message(self, file, robot):
        with file.open("rb") as opened:
            statistics = make_reader(opened).get_summary().statistics
        assert statistics.message_count == sum(e.count for e in robot.elements) + TICKS  # the struct's string
        assert (statistics.message_start_time, statistics.message_end_time) == (START, START + 39 * STEP)


class TestRosbags:
    """What `rosbags` says, from the folder."""

    def test_reader_finds_every_message_of_the_folder_and_of_the_plain_file(self, folder, file):
        for path in (folder, file):
            with Reader(path) as reader:
                assert reader.message_count == sum(1 for _ in reader.messages()) > 0
                assert (reader.start_time, reader.end_time) == (START, START + 39 * STEP + 1)

    def test_any_reader_decodes_every_topic(self, folder):
        with AnyReader([folder]) as reader:
            for connection, stamp, raw in reader.messages():
                header = reader.deserialize(raw, connection.msgtype).header
                assert header.stamp.sec * 10**9 + header.stamp.nanosec == stamp

    def test_type_hashes_are_those_of_ros(self, folder):
        with AnyReader([folder]) as reader:
            for connection in reader.connections:
                assert connection.digest == reader.typestore.hash_rihs01(connection.msgtype), connection.msgtype


class TestMetadata:
    """`metadata.yaml`, as `ros2 bag` of Humble and later reads it."""

    @pytest.fixture
    def information(self, folder):
        return yaml.safe_load((folder / "metadata.yaml").read_text())["rosbag2_bagfile_information"]

    def test_it_is_version_8_with_qos_as_text(self, information):
        assert (information["version"], information["storage_identifier"]) == (8, "mcap")
        assert information["topics_with_message_count"][0]["topic_metadata"]["offered_qos_profiles"] == ""

    def test_it_names_the_file_beside_it(self, information, folder):
        assert [(folder / name).exists() for name in information["relative_file_paths"]] == [True]
        assert information["files"][0]["path"] == information["relative_file_paths"][0]

    def test_it_counts_messages_and_time(self, information, robot):
        assert information["starting_time"]["nanoseconds_since_epoch"] == START
        assert information["duration"]["nanoseconds"] == 39 * STEP
        counts = {t["topic_metadata"]["name"]: t["message_count"] for t in information["topics_with_message_count"]}
        assert (counts["/log/slow"], counts["/log/early"], sum(counts.values())) == (4, 3, information["message_count"])

    def test_of_a_bag_without_a_message_all_is_0(self, robot, tmp_path):
        write_bag(replace(robot, elements=(), time_ns=robot.time_ns[:0]), tmp_path / "none")
        found = yaml.safe_load((tmp_path / "none" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
        begin, span = found["starting_time"]["nanoseconds_since_epoch"], found["duration"]["nanoseconds"]
        assert (begin, span, found["message_count"]) == (0, 0, 0)

    def test_the_same_stands_in_the_mcap_file(self, information, file):
        with file.open("rb") as opened:
            records = {record.name: record.metadata for record in make_reader(opened).iter_metadata()}
        assert yaml.safe_load(records["rosbag2"]["serialized_metadata"]) == information

    def test_viewers_are_told_of_which_run_that_was_cut_it_is_a_part(self, robot, tmp_path):
        part = replace(robot, about={"operator": "alice"}, stretch=Stretch("1f", 2))
        write(part, tmp_path, "robot", [FileType.BAG])
        with next(tmp_path.rglob("*.mcap")).open("rb") as opened:
            (told,) = [one.metadata for one in make_reader(opened).iter_metadata() if one.name == "silo"]
        assert (told["about cut"], told["about operator"]) == ("part 2 of run 1f", "alice")


READ_WITH_NODE = """
const fs = require('fs');
const {McapIndexedReader} = require('@mcap/core');
const {parse} = require('@foxglove/rosmsg');
const {MessageReader} = require('@foxglove/rosmsg2-serialization');
const fzstd = require('fzstd');
(async () => {
  const data = fs.readFileSync(process.argv[1]);
  const readable = {
    size: async () => BigInt(data.length),
    read: async (offset, size) => new Uint8Array(data.subarray(Number(offset), Number(offset + size))),
  };
  const zstd = (packed, size) => fzstd.decompress(packed, new Uint8Array(Number(size)));
  const reader = await McapIndexedReader.Initialize({readable, decompressHandlers: {zstd}});
  const decoders = {}, sums = {};
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    decoders[schema.id] ??= new MessageReader(parse(new TextDecoder().decode(schema.data), {ros2: true}));
    const content = decoders[schema.id].readMessage(message.data);
    const stamp = BigInt(content.header.stamp.sec) * 1000000000n + BigInt(content.header.stamp.nanosec);
    if (stamp !== message.logTime) throw new Error('stamp of ' + channel.topic);
    const topic = (sums[channel.topic] ??= {count: 0, sum: 0});
    topic.count += 1;
    topic.sum += Number(content.value);
  }
  console.log(JSON.stringify(sums));
})().catch(error => { console.error(error); process.exit(1); });
"""


def has_node_packages() -> bool:
    node = shutil.which("node")
    names = ("@mcap/core", "@foxglove/rosmsg", "@foxglove/rosmsg2-serialization", "fzstd")
    needs = "".join(f"require.resolve('{name}');" for name in names)
    return node is not None and subprocess.run([node, "-e", needs], capture_output=True, check=False).returncode == 0


@pytest.mark.skipif(not has_node_packages(), reason="needs node and, in NODE_PATH, @mcap/core and Foxglove's decoders")
def test_foxglove_s_own_reader_decodes_every_topic(file, robot):
    done = subprocess.run(["node", "-e", READ_WITH_NODE, str(file)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    sums = json.loads(done.stdout)
    assert sums["/log/UInt64"] == {"count": TICKS, "sum": TICKS * (TICKS - 1) / 2}
    assert sum(topic["count"] for topic in sums.values()) == sum(e.count for e in robot.elements) + TICKS
    assert not math.isnan(sums["/log/mode"]["sum"])

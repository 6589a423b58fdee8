"""Bags that silo did not write, made here by `rosbags` and `mcap`: signals with the stamps of their own topics."""

import functools
import json
import sqlite3
import warnings

import numpy as np
import pytest
from click.testing import CliRunner
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import silo
from silo.cli.group import cli
from silo.files.others import mcap_file, recording
from silo.files.others.message_types import UnknownTypeError, message_type
from tests.pages import carry_out

START = 1_700_000_000 * 10**9
STEP = 5_000_000
LATE = 2_000_000  # from the measurement to the recorder
STATE = """uint8 MODE_STAND=0
uint8 MODE_WALK=1
uint8 mode
string note
float64[] gains
uint8 last
bool on
float32[4] feet
"""


@functools.cache
def message_types():
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(STATE, "my_msgs/msg/State"))
    return store


@functools.cache
def messages(count):
    """Topic, type, log time, CDR: what a small robot publishes, topic by topic at rates of their own."""
    return list(made(count))


def made(count):
    store = message_types()
    make = store.types
    vector, turn, header, stamp = (
        make[name]
        for name in (
            "geometry_msgs/msg/Vector3", "geometry_msgs/msg/Quaternion", "std_msgs/msg/Header",
            "builtin_interfaces/msg/Time",
        )
    )  # fmt: skip
    nothing = np.zeros(9)

    def packed(topic, time_ns, kind, *fields):
        return topic, kind, time_ns, store.serialize_cdr(make[kind](*fields), kind)

    for number in range(count):
        now = START + number * STEP
        measured = divmod(now - LATE, 10**9)
        head = header(stamp(*measured), "base")
        still, fast = vector(0.0, 0.0, 9.81), vector(float(number), 0.5, -1.0)
        yield packed(
            "/imu", now, "sensor_msgs/msg/Imu", head, turn(0.0, 0.0, 0.0, 1.0), nothing, fast, nothing, still, nothing
        )
        if number % 3 == 0:
            joints = ["hip", "knee"] if number % 2 == 0 else ["grip"]
            where = np.array([number, number + 0.5])[: len(joints)]
            yield packed(
                "/joint_states", now + 1000, "sensor_msgs/msg/JointState", head, joints, where, np.zeros(0), np.zeros(0)
            )
        if number % 10 == 0:
            gains = np.arange(number // 10 % 3, dtype=float)
            note = "x" * (number // 10 % 7)
            feet = np.full(4, number, np.float32)
            walks, on = int(number > count / 2), number % 20 == 0
            yield packed("/state", now + 5, "my_msgs/msg/State", walks, note, gains, number % 256, on, feet)
        if number % 100 == 0:
            picture = (4, 4, "mono8", 0, 4, np.zeros(16, np.uint8))
            yield packed("/camera", now + 7, "sensor_msgs/msg/Image", head, *picture)


def rosbag(path, plugin, count=200, compression=()):
    store = message_types()
    writer = Writer(path, version=8, storage_plugin=plugin)
    if compression:
        writer.set_compression(*compression)
    with writer:
        topics = {}
        for topic, kind, time_ns, data in messages(count):
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(topics[topic], time_ns, data)
    return path


def mcap_bag(path, count=200, **options):
    """The same by the writer of Foxglove."""
    store = message_types()
    with path.open("wb") as file:
        writer = McapWriter(file, **options)
        writer.start(profile="ros2")
        topics = {}
        for topic, kind, time_ns, data in messages(count):
            if topic not in topics:
                text = store.generate_msgdef(kind, ros_version=2)[0].encode()
                schema = writer.register_schema(kind, "ros2msg", text)
                topics[topic] = writer.register_channel(topic, "cdr", schema)
            writer.add_message(topics[topic], time_ns, bytes(data), time_ns)
        writer.finish()
    return path


def opened(path, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", silo.LogWarning)
        return silo.open_log(path, **options)


MAKERS = {
    "rosbag2 sqlite3": lambda path: rosbag(path / "bag", StoragePlugin.SQLITE3),
    "a .db3 alone": lambda path: rosbag(path / "bag", StoragePlugin.SQLITE3) / "bag.db3",
    "rosbag2 mcap": lambda path: rosbag(path / "bag", StoragePlugin.MCAP),
    "mcap, zstd": lambda path: mcap_bag(path / "bag.mcap", chunk_size=20_000),
    "mcap, lz4": lambda path: mcap_bag(path / "bag.mcap", chunk_size=20_000, compression=CompressionType.LZ4),
    "mcap without chunks": lambda path: mcap_bag(path / "bag.mcap", use_chunking=False),
    "mcap without index": lambda path: mcap_bag(path / "bag.mcap", index_types=mcap_no_index()),
    "mcap without repeated channels": lambda path: mcap_bag(
        path / "bag.mcap", repeat_channels=False, repeat_schemas=False
    ),
}


def mcap_no_index():
    from mcap.writer import IndexType

    return IndexType.NONE


@pytest.fixture(scope="module", params=MAKERS)
def log(request, tmp_path_factory):
    return opened(MAKERS[request.param](tmp_path_factory.mktemp("bags")))


@pytest.mark.parametrize(
    ("definition", "labels"),
    [
        ("uint8 A=0\nuint8 B=1\nuint8 x", [{0: "A", 1: "B"}]),
        ("int8 A=-1\nint8 x", [{-1: "A"}]),
        ("uint8 A=1\nuint8 x\nint8 y", [{1: "A"}, {}]),
        ("uint8 A=0\nuint8 x\nuint8 y", [{}, {}]),  # whose they are isn't said
        ("uint8 X_ON=1\nuint8 A=2\nuint8 x\nuint8 y", [{1: "ON"}, {}]),
        ("int16 X_A=3\nint16 Y=4\nint16 x", [{3: "A"}]),
        ("uint8 A=0\nuint8 B=0\nuint8 x", [{}]),  # which of them it is isn't known
        ("float32 A=1.0\nfloat32 x", [{}]),
        ("bool A=true\nbool x", [{}]),
        ("int32 A=-1\nuint8 x", [{}]),
    ],
)
def test_constants_are_labels_of_the_field_that_they_are_of(definition, labels):
    fields = message_type("p/msg/M", definition, "ros2msg").fields
    assert [dict(node.labels) for _, node in fields] == labels


@pytest.mark.parametrize(
    ("kind", "definition", "why"),
    [
        ("ros2msg", "wstring x", "silo reads no wstring: middlewares write them in ways of their own"),
        ("ros2msg", "M x", "the type p/msg/M in it is not known"),  # as it is in itself
        ("ros2msg", "their/Thing x", "the type their/msg/Thing in it is not known"),
        ("ros2msg", "float64 x[", "its definition can't be read: Could not parse:"),
        ("ros2idl", "module p { module msg { struct M { long double x; }; }; };", "silo reads no float128"),
        ("ros2idl", "module p { module msg { struct M { wchar x; }; }; };", "silo reads no wchar"),
        ("ros2idl", "module p { module msg { struct N { long x; }; }; };", "its definition is not in the bag"),
    ],
)
def test_of_a_type_that_is_not_read_it_is_told_why(kind, definition, why):
    with pytest.raises(UnknownTypeError) as told:
        message_type("p/msg/M", definition, kind)
    assert str(told.value) == why


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return rosbag(tmp_path_factory.mktemp("bags") / "drive", StoragePlugin.MCAP)


@pytest.mark.filterwarnings("ignore::silo.LogWarning")
class TestEveryStorage:
    """The same messages by all that writes bags."""

    def test_fields_are_signals_with_the_stamps_of_their_topic(self, log):
        turning = log["/imu/angular_velocity/x"]
        np.testing.assert_array_equal(turning.values, np.arange(200.0))
        np.testing.assert_array_equal(turning.time_ns, START + STEP * np.arange(200))
        np.testing.assert_array_equal(log["/state/last"].time_ns, START + 5 + 10 * STEP * np.arange(20))
        turning = log["imu/angular_velocity"]  # three numbers are a vector with a unit
        assert (turning.kind, turning.unit, turning.components) == ("vector", "rad/s", ("x", "y", "z"))
        assert turning.to("deg/s").max()[0] == pytest.approx(np.degrees(199))
        assert log["imu/orientation"].kind == "quaternion"
        stamps = log["imu/header/stamp"].values  # a time is a date
        np.testing.assert_array_equal(stamps.view(np.int64), START - LATE + STEP * np.arange(200))

    def test_arrays_texts_bools_and_constants_are_what_they_are(self, log):
        assert log["state/feet"].values.shape == (20, 4)
        assert log["state/feet"].dtype == np.float32
        assert log["state/note"].values.tolist() == ["x" * (number % 7) for number in range(20)]
        assert log["state/on"].values.tolist() == [True, False] * 10
        assert log["state/mode"].texts.tolist() == ["STAND"] * 11 + ["WALK"] * 9
        assert log["imu/header/frame_id"].values.tolist() == ["base"] * 200
        np.testing.assert_array_equal(log["state/last"].values, (10 * np.arange(20) % 256).astype(np.uint8))
        # where an array is shorter there is nothing
        np.testing.assert_array_equal(log["state/gains"].values[:3], [[np.nan, np.nan], [0, np.nan], [0, 1]])
        (text,) = log.warnings
        assert text == "bytes, lists of messages and of lists are no signals: /camera/data"
        assert "/camera/width" in log

    def test_joints_are_found_by_their_names_whoever_publishes_them(self, log):
        joints = log["joint_states/position"]
        assert joints.components == ("hip", "knee", "grip")
        np.testing.assert_array_equal(joints.values[:2], [[0, 0.5, np.nan], [np.nan, np.nan, 3]])
        np.testing.assert_array_equal(log["joint_states/position_grip"].values[1::2], np.arange(3.0, 200, 6))
        assert not [text for text in log.warnings if "joint_states" in text]  # others come by their names, uncut

    def test_joints_that_are_named_after_those_that_were_looked_at_are_told(self, folder, monkeypatch):
        monkeypatch.setattr(recording, "SOME", 1)
        late = silo.open_log(folder)
        np.testing.assert_array_equal(late["joint_states/position"].values[:2], [[0, 0.5], [np.nan, np.nan]])
        told = [one for one in late.warnings if "joint" in one]
        assert told == ["joints of /joint_states that come in late are left out: grip"]

    def test_an_expression_over_two_topics_holds_the_slower_one_and_a_part_is_that_of_every_topic(self, log):
        assert log.eval("imu/angular_velocity/x > 50 and state/mode == WALK").when()[0] == pytest.approx(0.55, abs=1e-6)
        part = log.clip(0.1, 0.2)
        assert part["imu/angular_velocity/x"].values.tolist() == list(range(20, 41))
        assert len(part["state/on"]) == 2

    def test_resampled_it_is_a_log_like_any_other(self, log, tmp_path):
        made = silo.open_log(log.resample(100).save(tmp_path / "run.silo"))
        np.testing.assert_array_equal(made["/imu/angular_velocity/x"].values[:5], [0, 2, 4, 6, 8])
        assert made["imu/angular_velocity"].unit == "rad/s"
        assert made["state/mode"].texts[-1] == "WALK"
        assert len({len(made[name].time_ns) for name in made.names("/imu/*")}) == 1


class TestHeaderStamps:
    def test_the_header_tells_when_it_was_measured_and_without_one_or_by_default_the_log_when_recorded(self, folder):
        assert opened(folder)["imu/angular_velocity"].time_ns[0] == START
        log = opened(folder, stamps="header")
        np.testing.assert_array_equal(log["imu/angular_velocity/x"].time_ns, START - LATE + STEP * np.arange(200))
        np.testing.assert_array_equal(log["imu/angular_velocity/x"].values, np.arange(200.0))
        assert log["imu/angular_velocity"].times[0] == pytest.approx(-0.002)
        assert log["state/on"].time_ns[0] == START + 5

    def test_headers_that_come_in_another_order_are_put_in_order(self, tmp_path):
        store = message_types()
        kind = "sensor_msgs/msg/Temperature"
        header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
        with Writer(tmp_path / "bag", version=8, storage_plugin=StoragePlugin.MCAP) as writer:
            topic = writer.add_connection("/warm", kind, typestore=store)
            for number, second in enumerate((3, 1, 0, 2)):  # one was not set
                message = store.types[kind](header(stamp(second, 0), ""), float(second), 0.0)
                writer.write(topic, 10**9 * (number + 1), store.serialize_cdr(message, kind))
        warm = opened(tmp_path / "bag", stamps="header")["warm/temperature"]
        assert warm.values.tolist() == [1, 2, 3, 0]
        assert (warm.time_ns / 1e9).tolist() == [1, 2, 3, 3]

    def test_an_unknown_word_is_told(self, folder):
        with pytest.raises(silo.ElementError, match=r"choose 'log' .* or 'header'"):
            silo.open_log(folder, stamps="publish")


class TestLazily:
    def test_opening_unpacks_only_what_tells_lengths(self, tmp_path, monkeypatch):
        path = mcap_bag(tmp_path / "bag.mcap", 2000, chunk_size=20_000)
        unpacked = []
        whole = mcap_file.unpack_chunk
        monkeypatch.setattr(mcap_file, "unpack_chunk", lambda body: unpacked.append(1) or whole(body))
        log = opened(path)
        chunks = len(log.recording.elements[0].reader._parts[0].stored.file._blocks)
        assert chunks > 30
        assert len(unpacked) <= 9  # of three topics with arrays, the first, a middle and the last chunk
        assert log.duration_s == pytest.approx(1999 * STEP * 1e-9)
        assert len(unpacked) <= 9

    def test_a_signal_costs_the_chunks_of_its_topic(self, tmp_path, monkeypatch):
        path = mcap_bag(tmp_path / "bag.mcap", 2000, chunk_size=2_000)
        log = opened(path)
        unpacked = []
        whole = mcap_file.unpack_chunk
        monkeypatch.setattr(mcap_file, "unpack_chunk", lambda body: unpacked.append(1) or whole(body))
        assert len(log["camera/width"]) == 20
        assert log["camera/width"].max() == 4
        assert 0 < len(unpacked) <= 20

    def test_tables_have_a_row_for_every_stamp(self, folder):
        log = opened(folder)
        frame = log.to_pandas("state/*")
        assert len(frame) == 20
        assert len(log.to_polars("*/header/stamp")) == 200 + 67 + 2  # as many as there are stamps
        both = log.namespace("imu").to_pandas()
        assert (len(both), both["/imu/angular_velocity_x"].iloc[-1]) == (200, 199)


class TestOtherFiles:
    @pytest.mark.parametrize("nested", ["[", "{a: ", "- ", "? "])
    def test_metadata_that_is_nested_without_end_is_as_none(self, tmp_path, nested):
        rosbag(tmp_path / "bag", StoragePlugin.MCAP, count=20)
        (tmp_path / "bag" / "metadata.yaml").write_text(nested * 200_000)
        assert len(opened(tmp_path / "bag")["imu/angular_velocity/x"].values) == 20

    def test_two_files_of_one_bag_are_one_log(self, tmp_path):
        (tmp_path / "bag").mkdir()
        (tmp_path / "bag" / "metadata.yaml").write_text(
            "rosbag2_bagfile_information:\n  relative_file_paths: [bag_0.mcap, bag_1.mcap]\n"
        )
        whole = messages(40)
        store = message_types()
        for part in range(2):
            with (tmp_path / "bag" / f"bag_{part}.mcap").open("wb") as file:
                writer = McapWriter(file)
                writer.start()
                topics = {}
                for topic, kind, time_ns, data in whole[part::2]:
                    if topic not in topics:
                        text = store.generate_msgdef(kind, ros_version=2)[0].encode()
                        topics[topic] = writer.register_channel(
                            topic, "cdr", writer.register_schema(kind, "ros2msg", text)
                        )
                    writer.add_message(topics[topic], time_ns, bytes(data), time_ns)
                writer.finish()
        assert opened(tmp_path / "bag")["imu/angular_velocity/x"].values.tolist() == list(range(40))

    @pytest.mark.parametrize("size", [0.5, 0.9, 0.999])
    def test_a_file_that_was_cut_off_gives_what_is_whole(self, tmp_path, size):
        path = mcap_bag(tmp_path / "bag.mcap", chunk_size=5_000)
        path.write_bytes(path.read_bytes()[: int(path.stat().st_size * size)])
        with pytest.warns(silo.LogWarning, match="cut off"):
            log = silo.open_log(path)
        turning = log["imu/angular_velocity/x"].values
        assert 60 < len(turning) <= 200
        np.testing.assert_array_equal(turning, np.arange(len(turning)))

    def test_damage_is_told_where_it_is_met(self, tmp_path):
        path = mcap_bag(tmp_path / "bag.mcap", compression=CompressionType.NONE)
        log = opened(path)
        data = bytearray(path.read_bytes())
        data[5000] ^= 0xFF
        path.write_bytes(data)
        with pytest.raises(silo.errors.FileFormatError, match=r"bag\.mcap: .*damaged"):
            opened(path)["imu/angular_velocity/x"].max()
        assert "imu/angular_velocity" in log

    @pytest.mark.parametrize("plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
    def test_messages_that_are_compressed_one_by_one_are_read(self, tmp_path, plugin):
        bag = rosbag(tmp_path / "bag", plugin, 30, (CompressionMode.MESSAGE, CompressionFormat.ZSTD))
        assert opened(bag)["imu/angular_velocity/x"].values.tolist() == list(range(30))

    def test_a_bag_that_is_compressed_as_a_whole_is_told_how_to_unpack(self, tmp_path):
        bag = rosbag(tmp_path / "bag", StoragePlugin.SQLITE3, 3, (CompressionMode.FILE, CompressionFormat.ZSTD))
        with pytest.raises(silo.errors.FileFormatError, match=r"zstd -d bag\.db3\.zstd"):
            silo.open_log(bag)

    def test_types_that_nobody_knows_are_named_in_one_warning_and_left_out(self, tmp_path):
        bag = rosbag(tmp_path / "bag", StoragePlugin.SQLITE3, 30)
        database = sqlite3.connect(bag / "bag.db3")
        database.execute("UPDATE topics SET type = 'their_msgs/msg/' || 'Thing' WHERE name IN ('/state', '/camera')")
        database.commit()
        database.close()
        with pytest.warns(silo.LogWarning) as told:
            log = silo.open_log(bag)
        (text,) = [str(one.message) for one in told]
        assert "2 topics left out: /state (their_msgs/msg/Thing: its definition is not in the bag), /camera" in text
        assert "imu/angular_velocity" in log
        assert "state/on" not in log

    def test_numbers_and_texts_of_json_are_signals(self, tmp_path):
        path = tmp_path / "bag.mcap"
        with path.open("wb") as file:
            writer = McapWriter(file)
            writer.start()
            schema = writer.register_schema("Pose", "jsonschema", b'{"type": "object"}')
            topic = writer.register_channel("/pose", "json", schema)
            for number in range(5):
                message = {"at": {"x": number, "y": 0.5}, "mode": "go", "ok": True, "legs": [number, 1], "list": [{}]}
                if number == 3:
                    del message["at"]["y"]
                writer.add_message(topic, START + number, json.dumps(message).encode(), START + number)
            writer.finish()
        log = opened(path)
        assert log["/pose/at/x"].values.tolist() == [0, 1, 2, 3, 4]
        np.testing.assert_array_equal(log["pose/at/y"].values, [0.5, 0.5, 0.5, np.nan, 0.5])
        assert log["pose/mode"].values.tolist() == ["go"] * 5
        assert log["pose/ok"].values.tolist() == [True] * 5
        assert log["pose/legs"].values.tolist() == [[number, 1] for number in range(5)]
        assert "/pose/list" in log.warnings[0]

    def test_an_empty_file_is_told(self, tmp_path):
        path = tmp_path / "bag.mcap"
        with path.open("wb") as file:
            writer = McapWriter(file)
            writer.start()
            writer.finish()
        with pytest.raises(silo.errors.FileFormatError, match=f"^'{path}' is no log of silo, and holds no message$"):
            silo.open_log(path)

    def test_a_folder_finds_bags_of_others_too(self, tmp_path):
        rosbag(tmp_path / "rosbag2_2026", StoragePlugin.MCAP, 3)
        with pytest.warns(silo.LogWarning):
            (log,) = silo.open_logs(tmp_path)
        assert log.path.endswith("rosbag2_2026")
        assert opened("rosbag2_20", folder=tmp_path).path == log.path

    def test_a_folder_with_several_mcap_files_is_a_folder_of_logs(self, tmp_path):
        for number in range(2):
            mcap_bag(tmp_path / f"drive_{number}.mcap", 10 + number)
        with pytest.warns(silo.LogWarning):
            assert [len(log["imu/angular_velocity"]) for log in silo.open_logs(tmp_path)] == [10, 11]
        assert len(opened(tmp_path)["imu/angular_velocity"]) == 11


class TestSaving:
    def test_a_file_with_one_time_for_all_is_refused_with_the_way_out(self, folder, tmp_path):
        way_out = r"log.resample\(100\).save\('drive.csv'\) or `silo convert --rate 100`.*keep the times of each"
        with pytest.raises(silo.SaveError, match=way_out):
            opened(folder).save(tmp_path / "drive.csv")
        assert not (tmp_path / "drive.csv").exists()

    def test_files_that_can_keep_the_times_of_each(self, folder, tmp_path):
        import h5py

        opened(folder).save(tmp_path / "drive.h5")
        with h5py.File(tmp_path / "drive.h5") as file:
            np.testing.assert_array_equal(file["imu/angular_velocity/time_ns"], START + STEP * np.arange(200))
            np.testing.assert_array_equal(file["state/last/time_ns"], START + 5 + 10 * STEP * np.arange(20))


class TestCommands:
    @pytest.fixture
    def silo_command(self):
        return lambda *words: CliRunner().invoke(cli, list(map(str, words)), env={"COLUMNS": "120"})

    def test_info_lists_topics_with_their_rates(self, silo_command, folder):
        output = silo_command("info", folder).output
        assert "/imu/angular_velocity" in output
        assert "rad/s  float64[3]          200     200" in output

    def test_convert_says_the_way_and_takes_it(self, silo_command, folder, tmp_path):
        refused = silo_command("convert", folder, tmp_path / "x.csv")
        assert refused.exit_code == 1
        assert "--rate 100" in refused.output
        assert silo_command("convert", "--rate", 50, folder, tmp_path / "x.csv").exit_code == 0
        assert silo.open_log(tmp_path / "x.csv")["imu/angular_velocity/x"].values[:3].tolist() == [0, 4, 8]

    def test_the_screen_shows_it_each_topic_by_its_own_stamps(self, folder):
        from silo_tui.sessions.recorded import open_file

        of = open_file(folder).source
        imu, mode = "/imu/angular_velocity", "/state/last"
        for number in (0, 1, 57, 199):
            for late_ns, held in ((0, number), (STEP - 1, number), (-1, number - 1)):
                if held >= 0:
                    found = of.readings([imu, mode], START + STEP * number + late_ns)
                    assert found[imu].newest[0] == held
                if number == 57:
                    assert found[mode].newest[0] == 50
        assert of.period_ns(imu) == STEP
        assert of.period_ns(mode) == 10 * STEP
        shown = of.columns([f"{imu}_x"], START, START + 199 * STEP, STEP)
        begun = shown.low[0][~np.isnan(shown.low[0])]
        assert begun.tolist() == list(range(200))


def joint_log(path, names_at):
    """A log of joint states: each position is a hundred times the message's number, and its joint's place in ABC."""
    store = message_types()
    names = ("builtin_interfaces/msg/Time", "std_msgs/msg/Header", "sensor_msgs/msg/JointState")
    stamp, header, state = (store.types[name] for name in names)
    nothing = np.zeros(0)
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=2_000)
        writer.start(profile="ros2")
        text = store.generate_msgdef(names[2], ros_version=2)[0].encode()
        channel = writer.register_channel("/joints", "cdr", writer.register_schema(names[2], "ros2msg", text))
        for number in range(200):
            joints = names_at(number)
            values = np.array([100.0 * number + ord(joint[0]) - ord("a") for joint in joints])
            made = state(header(stamp(0, 0), ""), joints, values, values[:-1] if len(joints) > 1 else nothing, nothing)
            writer.add_message(channel, START + number, bytes(store.serialize_cdr(made, names[2])), START + number)
        writer.finish()
    return silo.open_log(path)


def test_a_joint_that_only_the_beginning_of_a_bag_has_is_a_signal(tmp_path):
    log = joint_log(tmp_path / "bag.mcap", lambda number: ["a_old" if number < 50 else "b_new"])
    assert log["joints/position"].components == ("a_old", "b_new")
    assert log["joints/position_a_old"].values[:50].tolist() == [100.0 * number for number in range(50)]


def test_joints_in_another_order_keep_their_names_also_where_one_has_no_value(tmp_path):
    log = joint_log(tmp_path / "bag.mcap", lambda number: ["c", "a", "b"] if number % 2 else ["a", "b", "c"])
    hundreds = 100.0 * np.arange(200)
    np.testing.assert_array_equal(log["joints/position"].values, hundreds[:, None] + [0, 1, 2])
    even, odd = [0, 1, np.nan], [0, np.nan, 2]  # the last of each message has no velocity
    wanted = [hundreds[number] + (odd if number % 2 else even) for number in range(200)]
    np.testing.assert_array_equal(log["joints/velocity"].values, wanted)


@pytest.mark.filterwarnings("ignore::silo.LogWarning")
def test_the_page_for_ros_reads_a_bag_as_it_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rosbag(tmp_path / "rosbag2_2026_11_22", StoragePlugin.SQLITE3, 400)
    carry_out("how-to/ros2.md", "Read a bag")
    assert {"drive.silo", "gyro.png"} <= {path.name for path in tmp_path.iterdir()}

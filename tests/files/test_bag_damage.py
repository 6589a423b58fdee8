"""Bags that others wrote, with a message, a chunk or a topic that is damaged: the rest is read, and it is told."""

import json
import struct
import warnings

import numpy as np
import pytest
from click.testing import CliRunner
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import silo
from silo.cli.group import cli
from silo.files.bags.metadata import RecordingFacts, pack_times, unpack_facts, unpack_times
from silo.files.mcap import chunks as mcap_chunks
from silo.files.mcap.damage import told_damage
from silo.files.mcap.index import read_index

START = 1_700_000_000 * 10**9
STEP = 10**7
SPLIT = "=" * 80
NUMBER = "float64 data\n"
LIST = "int64[] data\n"


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ValueError("17 bytes are no message"), "17 bytes are no message"),
        (KeyError("imu"), "damaged: it names 'imu', which isn't there"),
        (struct.error("unpack requires 4 bytes"), "damaged: unpack requires 4 bytes"),
        (EOFError(), "damaged: EOFError"),
        (UnicodeDecodeError("utf-8", b"a", 0, 1, "odd"), "damaged: 'utf-8' codec can't decode byte 0x61 in position 0: "
                                                         "odd"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_file_is_said_in_words(error, words):
    assert told_damage(error) == words


def number(value):
    return b"\0\1\0\0" + struct.pack("<d", value)


def ints(*values):
    return b"\0\1\0\0" + struct.pack("<I", len(values)) + (b"\0" * 4 + struct.pack(f"<{len(values)}q", *values))


def bag(path, *messages, **options):
    """An MCAP file of `(topic, definition, type, data)`, one message each STEP; JSON where there is no definition."""
    options = {"compression": CompressionType.NONE, "chunk_size": 500, **options}
    with path.open("wb") as file:
        writer = McapWriter(file, **options)
        writer.start()
        known = {}
        for at, (topic, definition, kind, data) in enumerate(messages):
            key = topic, definition, kind
            if key not in known:
                how = ("jsonschema", "json") if definition is None else ("ros2msg", "cdr")
                schema = writer.register_schema(kind, how[0], (definition or "{}").encode())
                known[key] = writer.register_channel(topic, how[1], schema)
            content = json.dumps(data).encode() if definition is None and not isinstance(data, bytes) else data
            writer.add_message(known[key], START + at * STEP, content, START + at * STEP)
        writer.finish()
    return path


def quietly(path, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", silo.LogWarning)
        log = silo.open_log(path, **options)
        for name in log:
            _ = log[name]
    return log


def floats(count, topic="/good"):
    return [(topic, NUMBER, "my_msgs/msg/Number", number(at)) for at in range(count)]


def chunks(path):
    return [chunk.at for chunk in read_index(memoryview(path.read_bytes())).chunks]


def flip(path, *places):
    data = bytearray(path.read_bytes())
    for place in places:
        data[place] ^= 0x40
    path.write_bytes(data)


class TestNumbers:
    def test_bytes_that_are_left_over_are_an_error_of_the_message(self, tmp_path):
        rows = floats(10)
        rows[4] = (*rows[4][:3], rows[4][3] + bytes(4))
        rows[5] = (*rows[5][:3], rows[5][3] + bytes(3))  # padding
        log = quietly(bag(tmp_path / "x.mcap", *rows))
        assert np.flatnonzero(np.isnan(log["good/data"].values)).tolist() == [4]
        assert "4 bytes are left over" in log.warnings[0]

    def test_integers_of_lists_stay_integers(self, tmp_path):
        rows = [(2**60,), (2**60 + 1, 2**60 + 2), ()]
        log = quietly(bag(tmp_path / "x.mcap", *(("/s", LIST, "my_msgs/msg/List", ints(*row)) for row in rows)))
        values = log["s/data"].values
        assert values.dtype == np.int64
        assert values.tolist() == [[2**60, None], [2**60 + 1, 2**60 + 2], [None, None]]
        assert log["s/data"].max().tolist() == [2**60 + 1, 2**60 + 2]
        assert log["s/data_1"].values.tolist() == [None, 2**60 + 2, None]

    def test_integers_of_json_stay_integers(self, tmp_path):
        rows = [{"x": 2**60 + at, "u": 2**63 + at, "s": -at, "v": [2**60 + at, at]} for at in range(5)]
        log = quietly(bag(tmp_path / "x.mcap", *(("/j", None, "J", row) for row in rows)))
        assert {name: log[f"j/{name}"].dtype.str for name in "xusv"} == {"x": "<i8", "u": "<u8", "s": "<i8", "v": "<i8"}
        for name in "xusv":
            assert log[f"j/{name}"].values.tolist() == [row[name] for row in rows]

    def test_integers_that_no_type_holds_are_told(self, tmp_path):
        rows = [{"x": 2**64, "y": 1.5}, {"x": -1, "y": 2**53 + 1}]
        log = quietly(bag(tmp_path / "x.mcap", *(("/j", None, "J", row) for row in rows)))
        assert log["j/x"].values.tolist() == [2.0**64, -1]
        assert sorted(text.split()[0] for text in log.warnings) == ["/j/x", "/j/y"]
        assert all("rounded to 53 bits" in text for text in log.warnings)

    def test_nan_as_python_writes_it_is_a_number(self, tmp_path):
        log = quietly(bag(tmp_path / "x.mcap", ("/j", None, "J", {"x": float("nan")}), ("/j", None, "J", {"x": 1.0})))
        np.testing.assert_array_equal(log["j/x"].values, [np.nan, 1.0])
        assert not log.warnings


class TestMasks:
    """What is made of signals with samples that are missing."""

    @pytest.fixture
    def log(self, tmp_path):
        rows = [{"x": 2**60 + at, "y": at} if at % 3 else {"y": at} for at in range(12)]
        return quietly(bag(tmp_path / "x.mcap", *(("/j", None, "J", row) for row in rows)))

    def test_statistics_leave_them_out_comparisons_are_false_and_expressions_and_numpy_see_nan(self, log):
        there = [at for at in range(12) if at % 3]
        assert log["j/x"].max() == 2**60 + 11
        assert (log["j/x"] - 2**60).mean() == np.mean(there)
        assert (log["j/x"] - 2**60).median() == np.median(there)
        assert (log["j/x"] >= 0).values.tolist() == [bool(at % 3) for at in range(12)]
        assert log["j/y"][log["j/x"] >= 0].values.tolist() == there
        assert log.eval("j/x >= 0").values.tolist() == [True] * 8
        assert np.isnan(np.percentile(log["j/x"], 50))
        assert np.isfinite(np.nanmean(log["j/x"]))

    def test_tables_have_nothing_there(self, log):
        series = log["j/x"].to_pandas()
        assert str(series.dtype) == "Int64"
        assert series.isna().tolist() == [at % 3 == 0 for at in range(12)]
        assert series.iloc[1] == 2**60 + 1
        column = log["j/x"].to_polars()["/j/x"]
        assert column.to_list() == [2**60 + at if at % 3 else None for at in range(12)]
        assert log.to_polars()["/j/x"].to_list() == column.to_list()
        assert log.to_pandas()["/j/x"].isna().sum() == 4


class TestMessages:
    def test_one_that_is_cut_short_is_left_out_and_told(self, tmp_path):
        rows = [("/s", LIST, "my_msgs/msg/List", ints(at, at)) for at in range(50)]
        rows[7] = (*rows[7][:3], rows[7][3][:-5])
        path = bag(tmp_path / "x.mcap", *rows)
        log = silo.open_log(path)
        with pytest.warns(
            silo.LogWarning, match=r"/s: 1 of 50 messages can't be read, number 7 \(from 0\), logged at 2023"
        ):
            values = log["s/data"].values
        assert values.tolist() == [[at, at] if at != 7 else [None, None] for at in range(50)]
        assert "2023-11-14T22:13:20.070000000 UTC: it ends before its last field" in log.warnings[0]

    def test_lists_that_are_longer_than_those_that_were_looked_at_are_told_with_counts(self, tmp_path):
        lengths = [7 if at in (101, 140) else 5 if at == 133 else 2 for at in range(200)]
        rows = [("/s", LIST, "my_msgs/msg/List", ints(*range(size))) for size in lengths]
        log = silo.open_log(bag(tmp_path / "x.mcap", *rows, chunk_size=1 << 20))
        with pytest.warns(silo.LogWarning, match=r"/s/data \(up to 7 values in 3 messages, first in number 101\)"):
            values = log["s/data"].values
        assert values.tolist() == [[0, 1]] * 200

    def test_the_first_one_that_is_cut_short_hides_no_other(self, tmp_path):
        rows = [("/s", LIST, "my_msgs/msg/List", ints(at, at)) for at in range(5)]
        rows[0] = (*rows[0][:3], rows[0][3][:-5])
        log = quietly(bag(tmp_path / "x.mcap", *rows, *floats(3)))
        assert log["s/data"].values[1:].tolist() == [[at, at] for at in range(1, 5)]
        assert log["good/data"].values.tolist() == [0, 1, 2]

    def test_json_that_is_cut_short_is_left_out_and_told(self, tmp_path):
        rows = [("/j", None, "J", {"x": at}) for at in range(9)]
        rows[3] = ("/j", None, "J", b'{"x": 3')
        log = quietly(bag(tmp_path / "x.mcap", *rows))
        assert log["j/x"].values.tolist() == [0, 1, 2, None, 4, 5, 6, 7, 8]
        assert "/j: 1 of 9 messages can't be read, number 3" in log.warnings[0]

    def test_json_that_is_nested_without_end_is_told(self, tmp_path):
        log = quietly(bag(tmp_path / "x.mcap", ("/j", None, "J", {"x": 1}), ("/j", None, "J", b"[" * 100_000)))
        assert log["j/x"].values.tolist() == [1, None]

    def test_stamps_of_headers_that_can_not_be_read_are_those_of_the_log(self, tmp_path):
        header = "builtin_interfaces/Time stamp\nstring frame_id\n"
        text = f"std_msgs/Header header\nint32 x\n{SPLIT}\nMSG: std_msgs/Header\n{header}"
        rows = [b"\0\1\0\0" + struct.pack("<iIIB3xi", 1_600_000_000 + at, 0, 1, 0, at) for at in range(4)]
        rows[2] = rows[2][:10]
        log = quietly(bag(tmp_path / "x.mcap", *(("/s", text, "my_msgs/msg/S", row) for row in rows)), stamps="header")
        assert log["s/x"].values.tolist() == [0, 1, 3, None]
        assert log["s/x"].time_ns.tolist()[-1] == START + 2 * STEP


class TestTopics:
    def test_an_encoding_that_is_not_read_costs_its_topic(self, tmp_path):
        other = [("/other", NUMBER, "my_msgs/msg/Number", b"\0\7\0\0" + struct.pack("<d", 1)) for _ in range(3)]
        with pytest.warns(silo.LogWarning, match=r"1 topic left out: /other .*another way than CDR \(00070000\)"):
            log = silo.open_log(bag(tmp_path / "x.mcap", *floats(5), *other))
        assert list(log) == ["/good/data"]
        assert log["good/data"].values.tolist() == [0, 1, 2, 3, 4]

    def test_convert_of_a_bag_with_nothing_readable_writes_nothing(self, tmp_path):
        with (tmp_path / "x.mcap").open("wb") as file:
            writer = McapWriter(file)
            writer.start()
            topic = writer.register_channel("/x", "protobuf", writer.register_schema("X", "protobuf", b""))
            writer.add_message(topic, START, b"\0", START)
            writer.finish()
        result = CliRunner().invoke(cli, ["convert", "--rate", "10", str(tmp_path / "x.mcap"), str(tmp_path / "x.csv")])
        assert result.exit_code == 1
        assert "nothing in it can be read" in result.output
        assert not (tmp_path / "x.csv").exists()

    def test_convert_tells_what_it_found_damaged_and_the_file_says_so(self, tmp_path):
        rows = [("/s", "int32 x\n", "my_msgs/msg/S", b"\0\1\0\0" + struct.pack("<i", at)) for at in range(50)]
        rows[20] = (*rows[20][:3], rows[20][3][:6])
        path = bag(tmp_path / "x.mcap", *rows)
        words = ["convert", "--rate", str(1e9 / STEP), str(path), str(tmp_path / "x.silo")]
        result = CliRunner().invoke(cli, words)
        assert result.exit_code == 0
        assert result.output.count("number 20") == 1
        made = quietly(tmp_path / "x.silo")
        assert any("number 20" in text for text in made.warnings)
        assert made["s/x"].values.tolist() == [*range(20), None, *range(21, 50)]

    def test_two_types_on_a_topic_are_two_topics_and_told(self, tmp_path):
        rows = [
            *floats(5, "/t"),
            *(
                ("/t", "int32 x\nint32 y\n", "my_msgs/msg/P", b"\0\1\0\0" + struct.pack("<ii", at, -at))
                for at in range(3)
            ),
        ]
        with pytest.warns(
            silo.LogWarning, match=r"/t has messages of 2 types.*/t \(my_msgs/msg/Number\), /t#2 \(my_msgs/msg/P\)"
        ):
            log = silo.open_log(bag(tmp_path / "x.mcap", *rows))
        assert log["/t/data"].values.tolist() == [0, 1, 2, 3, 4]
        assert log["/t#2/y"].values.tolist() == [0, -1, -2]
        assert log["/t#2/y"].time_ns.tolist() == [START + at * STEP for at in (5, 6, 7)]

    @pytest.mark.parametrize("read", [0, 1])
    def test_each_type_on_a_topic_that_is_not_read_is_left_out_under_a_name_of_its_own(self, read, tmp_path):
        unread = [("/t", f"float64 {name}[", f"my_msgs/msg/{name}", b"\0\1\0\0" + bytes(8)) for name in "PQ"]
        path = bag(tmp_path / "x.mcap", *floats(3, "/t")[: 3 * read], *unread, *floats(1, "/u"))
        first, second = ("/t#2", "/t#3") if read else ("/t", "/t#2")
        words = rf"2 topics left out: {first} \(my_msgs/msg/P: .*\), {second} \(my_msgs/msg/Q: "
        with pytest.warns(silo.LogWarning, match=words):
            log = silo.open_log(path)
        assert list(log) == ["/t/data"] * read + ["/u/data"]

    def test_a_type_that_changed_under_its_name_is_not_read_by_the_first_definition(self, tmp_path):
        rows = [
            *floats(3, "/t"),
            *(
                ("/t", "float32 a\nfloat32 data\n", "my_msgs/msg/Number", b"\0\1\0\0" + struct.pack("<ff", 0, at))
                for at in range(3)
            ),
        ]
        log = quietly(bag(tmp_path / "x.mcap", *rows))
        assert log["/t/data"].values.tolist() == log["/t#2/data"].values.tolist() == [0, 1, 2]

    def test_a_number_that_turns_into_text_is_told(self, tmp_path):
        rows = [("/j", None, "J", {"x": at if at != 6 else "n/a"}) for at in range(10)]
        with pytest.warns(
            silo.LogWarning, match="/j/x is a number, but a text once, first in number 6: left out there"
        ):
            log = silo.open_log(bag(tmp_path / "x.mcap", *rows))
        assert log["j/x"].values.tolist() == [0, 1, 2, 3, 4, 5, None, 7, 8, 9]


class TestSqlite:
    def test_a_damaged_page_costs_what_is_in_it(self, tmp_path):
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(NUMBER, "my_msgs/msg/Number"))
        with Writer(tmp_path / "bag", version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
            topics = [writer.add_connection(name, "my_msgs/msg/Number", typestore=store) for name in ("/good", "/b")]
            for at in range(2000):
                writer.write(topics[at % 2], START + at, number(at))
        path = tmp_path / "bag" / "bag.db3"
        data = bytearray(path.read_bytes())
        page = int.from_bytes(data[16:18], "big")
        place = next(at for at in range(0, len(data), page) if number(1000) in data[at : at + page])
        data[place : place + page] = b"\xff" * page
        path.write_bytes(data)
        log = quietly(tmp_path / "bag")
        values = log["good/data"].values
        there = values[~np.isnan(values)]
        assert 900 < len(there) < 1000
        assert there[0] == 0
        assert there[-1] == 1998
        assert ((log["good/data"].time_ns - START)[~np.isnan(values)] == there).all()
        assert "damaged" in log.warnings[0]


@pytest.mark.parametrize("index", [IndexType.ALL, IndexType.NONE], ids=["index", "no index"])
class TestChunks:
    def test_a_flipped_byte_costs_its_chunk(self, tmp_path, index):
        rows = [("/s", LIST, "my_msgs/msg/List", ints(at, at)) for at in range(100)]
        mixed = [row for pair in zip(floats(100), rows, strict=True) for row in pair]
        path = bag(tmp_path / "x.mcap", *mixed, index_types=IndexType.ALL)
        place = chunks(path)[3] + 300
        path = bag(tmp_path / "x.mcap", *mixed, index_types=index)
        flip(path, place)
        log = quietly(path)
        for name, width in (("good/data", 1), ("s/data", 2)):
            found = log[name].values.reshape(-1, width)[:, 0]
            there = ~np.isnan(np.asarray(np.ma.filled(found.astype(float), np.nan)))
            if index is IndexType.ALL:
                assert len(found) == 100
                assert found[there].tolist() == np.flatnonzero(there).tolist()
            assert 85 < there.sum() < 100
        assert any("a chunk is damaged: wrong checksum" in text for text in log.warnings)

    def test_an_index_or_message_of_another_topic_gives_no_other_value(self, tmp_path, index):
        mixed = [row for pair in zip(floats(50), floats(50, "/b"), strict=True) for row in pair]
        path = bag(tmp_path / "x.mcap", *mixed, index_types=index)
        if index is IndexType.ALL:
            data = bytearray(path.read_bytes())
            offsets = read_index(memoryview(bytes(data))).chunks[1][2]["offset"].tolist()
            for place, other in zip(offsets, offsets[::-1], strict=True):
                data[place + 23 : place + 31] = path.read_bytes()[other + 23 : other + 31]
            path.write_bytes(data)
        log = quietly(path)
        assert log["good/data"].values.tolist() == log["b/data"].values.tolist() == list(range(50))


class TestSizes:
    @pytest.mark.parametrize("announced", [64 << 20, 1 << 32, 1 << 63])
    @pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
    def test_what_a_chunk_announces_is_not_believed(self, tmp_path, announced, compression, monkeypatch):
        path = bag(tmp_path / "x.mcap", *floats(300), compression=compression, chunk_size=4000)
        data = bytearray(path.read_bytes())
        for place in chunks(path):
            data[place + 9 + 16 : place + 9 + 24] = announced.to_bytes(8, "little")
        path.write_bytes(data)
        tried = []
        monkeypatch.setattr(mcap_chunks, "_of_zstd", lambda content, size: tried.append(size) or b"")
        whole = r"/good \(my_msgs/msg/Number: 300 messages, of which none can be read: .*(hold|checksum)\)"
        with pytest.raises(silo.errors.FileFormatError, match=f"^{path}: damaged, nothing in it can be read: {whole}$"):
            silo.open_log(path)
        assert all(size <= mcap_chunks.MOST_ROOM for size in tried)

    def test_all_chunks_together_may_not_announce_more_than_a_file_can_hold(self, tmp_path):
        import zstandard

        path = bag(tmp_path / "x.mcap", *floats(3), compression=CompressionType.ZSTD)
        whole = path.read_bytes()
        (place,) = chunks(path)
        packed = zstandard.compress(bytes(60 << 20))
        body = struct.pack("<QQQII", START, START, 60 << 20, 0, 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed
        chunk = struct.pack("<BQ", 6, len(body)) + body
        path.write_bytes(whole[:place] + 30 * chunk)
        with pytest.raises(
            silo.errors.FileFormatError, match=f"^'{path}' is no log of silo, and holds no message "
        ) as told:
            silo.open_log(path)
        why = "lost (the chunks of 59,802 bytes announce more than so few can hold)"
        assert str(told.value).endswith(f"'x.mcap': the messages of the chunk at byte 15,978 are {why})")

    def test_what_silo_wrote_beside_messages_may_not_announce_more_than_it_can_hold(self):
        import zstandard

        with pytest.raises(zstandard.ZstdError, match="announce more than"):
            unpack_facts(RecordingFacts, zstandard.compress(b" " * (65 << 20)))
        times = np.arange(10_000_000) * 10**6
        assert unpack_times(pack_times(times))[-1] == times[-1]

    def test_a_chunk_of_more_records_than_bytes_is_damaged(self):
        chunk = struct.pack("<BQ", 0x80, 0) * 100_000
        with pytest.raises(ValueError, match="more records"):
            mcap_chunks.walked(chunk, 400)

    def test_long_lists_of_messages_are_stepped_over(self, tmp_path):
        text = f"my_msgs/Point[] p\nuint32 x\n{SPLIT}\nMSG: my_msgs/Point\nuint8 a\nfloat64 b\nuint16 c\n"
        count = 1_000_003
        starts = [4]  # behind the length
        while len(starts) < 9:
            starts.append(-(-(starts[-1] + 1) // 8) * 8 + 10)
        end = starts[1] + (count - 1) * (starts[8] - starts[7])
        body = bytes(-(-end // 4) * 4 - 4) + struct.pack("<I", 77)
        log = quietly(
            bag(tmp_path / "x.mcap", ("/s", text, "my_msgs/msg/S", b"\0\1\0\0" + struct.pack("<I", count) + body))
        )
        assert log["s/x"].values.tolist() == [77]

"""What a program logged comes back from files as it was written: shapes, complex numbers, structures, dates."""

import datetime

import numpy as np
import pytest

import silo
from silo.analysis.log import Log
from silo.analysis.opening import open_log
from silo.files.formats import FORMATS, Keeps, read_recording, writer_for

NESTED = np.dtype(
    [
        ("gain", "<f8"),
        ("at", "<f4", (3,)),
        ("deep", [("z", "<c16"), ("on", "?")], (2,)),
        ("name", "S3"),
        ("shown", "U3"),
        ("x_0", "i1"),
    ]
)
SOURCES = {
    "one": np.array([2.5]),
    "row": np.array([[1.0, 2.0, 3.0]]),
    "column": np.array([[1], [2]], "i2"),
    "cell": np.array([[7]], "u1"),
    "cube": np.arange(24, dtype="f4").reshape(2, 3, 4),
    "complex": np.array(1 + 2j),
    "complex64": np.array(1 - 2j, "c8"),
    "complex_list": np.array([1 + 2j, complex(np.inf, 3)]),
    "complex_matrix": np.arange(4).reshape(2, 2) * 1j,
    "complex_one": np.array([3 + 4j]),
    "struct": np.array((1.5, (1, 2, 3), [(1j, True), (2, False)], b"ab", "äß", 4), NESTED),
    "structs": np.zeros((2, 2), [("a", "<i4"), ("b", ">f8", (1, 2))]),
    "filled_structs": np.array([[(i, [[i, -i]]) for i in range(2)]] * 2, [("a", "<i4"), ("b", ">f8", (1, 2))]),
    "struct_of_one": np.zeros(1, [("a", "<i4")]),
    "date": np.array("2026-01-02T03:04:05.678", "M8[ms]"),
    "dates": np.array(["2026-01-02", "NaT"], "M8[D]"),
    "instants": np.array(["2026-01-02T03:04:05", "NaT"], "M8[ns]"),
    "seconds": np.array(["2026-01-02T03:04:05", "NaT"], "M8[s]"),
    "second": np.array("2026-01-02T03:04:05", ">M8[s]"),
    "hours": np.array(["2026-01-02T03", "NaT"], "M8[h]"),
    "span": np.array([7, -5], "m8[s]"),
    "step": np.array([[5, -6]], "m8[us]"),
    "steps": np.array(["NaT", 5], "m8[ns]"),
    "text": np.array("äß", "U6"),
    "texts": np.array(["äß", ""], "U3"),
    "bytes": np.array(b"ab", "S4"),
    "big_endian": np.array([1.0, 2.0], ">f8"),
    "half": np.array([0.5, 1.5], "f2"),
    "bools": np.array([[True], [False]]),
}
FULL = [one for one in FORMATS if Keeps.KINDS | Keeps.DTYPES in one.keeps]


def recorded_by_a_logger(sources, folder, ticks=3, **options):
    log = silo.Logger("robot", max_time=1.0, folder=folder, script=str(folder / "none.yaml"))
    for name, source in sources.items():
        log.add(source, name, **options)
    log.update()
    log.start()
    for _ in range(ticks):
        log.collect()
    log.stop()
    (saved,) = log.save(["silo"])
    log.close()
    return read_recording(saved.path)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return recorded_by_a_logger(SOURCES, tmp_path_factory.mktemp("robot"))


def packed(source):
    """The source as it can stand in a file: little-endian, without gaps, texts of bytes as text."""
    if source.dtype.kind == "S":
        return np.char.decode(source, "utf-8")
    return source


@pytest.fixture(scope="module", params=FULL, ids=lambda one: one.name)
def written(request, log, tmp_path_factory):
    """The log as a file of each format has it."""
    path = tmp_path_factory.mktemp("written") / f"x{request.param.ending}"
    writer_for(path)(log, path, None)
    return open_log(path)


@pytest.mark.parametrize("name", SOURCES)
def test_what_was_logged_comes_back_as_it_was_written(name, written):
    source = packed(SOURCES[name])
    values = written[name].values
    assert values.shape == (3, *source.shape)
    assert not isinstance(values, np.ma.MaskedArray)  # which is equal to anything where it is masked
    if source.dtype.names:
        assert values.dtype.names == source.dtype.names
        for field in source.dtype.names:
            before, after = source[field], values[field][1]
            if before.dtype.names:
                assert after.dtype == before.dtype
            np.testing.assert_array_equal(after, before)
    else:
        kinds = "U" if source.dtype.kind == "U" else source.dtype.newbyteorder("=")
        assert values.dtype == kinds or values.dtype.kind == kinds or source.dtype.str == "<f2"
        np.testing.assert_array_equal(values[1], source)


def test_a_component_of_anything_is_its_scalar(log):
    opened = Log(log)
    assert opened["one"].component(0).values.tolist() == [2.5] * 3
    assert opened["row"].component("1").values.tolist() == [2.0] * 3
    assert opened["complex_list"].component("0_imag").values.tolist() == [2.0] * 3
    assert opened["struct"].component("deep_0_z_imag").values.tolist() == [1.0] * 3
    assert opened["structs"].component("1_0_b_1").values.tolist() == [0.0] * 3


def test_tables_of_other_libraries_take_an_element_of_shape_1(log):
    frame = Log(log)["one"].to_pandas()
    assert frame.iloc[:, 0].tolist() == [2.5] * 3


def test_a_python_date_comes_back_as_one(tmp_path):
    class Robot:
        woke = datetime.datetime(2026, 1, 2, tzinfo=datetime.timezone.utc)

    log = silo.Logger("robot", max_time=1.0, folder=tmp_path, script=str(tmp_path / "none.yaml"))
    log.add(Robot(), attr="woke")
    log.update()
    log.start()
    log.collect()
    log.stop()
    (saved,) = log.save(["silo"])
    log.close()
    assert open_log(saved.path)["woke"].values[0] == np.datetime64("2026-01-02")


def test_a_text_of_numpy_goes_into_a_bag_as_a_string(tmp_path):
    from mcap_ros2.reader import read_ros2_messages

    recording = recorded_by_a_logger({"name": np.array("äß", "U6")}, tmp_path)
    writer_for(tmp_path / "x.mcap")(recording, tmp_path / "x.mcap", None)
    messages = list(read_ros2_messages(tmp_path / "x.mcap"))
    assert [message.ros_msg.value for message in messages] == ["äß"] * 3
    assert messages[0].schema.name == "signal_logger_msgs/msg/StringStamped"

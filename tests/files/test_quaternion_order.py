"""Quaternions come back in the order in which they lay in memory, and are right where an order is asked for."""

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

import silo
from silo.bridges.messages import live_topics
from silo.files.convert import convert
from silo.files.csv.metadata import sidecar_of

MEMORY = [0.5, 0.1, 0.2, 0.3]


@pytest.fixture(params=["quaternion_wxyz", "quaternion"])
def saved(request, new_logger):
    """A logger of one quaternion, each part of which is known, and the names of its parts in the order of memory."""
    logger = new_logger()
    q = logger.array("q", 4, kind=request.param)
    logger.start()
    q[:] = MEMORY
    for _ in range(3):
        logger.collect()
    logger.stop()
    return logger, tuple("wxyz" if request.param == "quaternion_wxyz" else "xyzw")


@pytest.mark.parametrize("file_type", ["silo", "csv", "bag"])
def test_files_keep_the_order_of_memory(saved, file_type):
    logger, names = saved
    signal = silo.open_log(logger.save(file_type).path)["q"]
    assert signal.values.tolist() == [MEMORY] * 3
    assert (signal.components, signal.kind) == (names, "quaternion")
    assert [signal.component(name).values[0] for name in names] == MEMORY


def test_so_does_what_is_read_live(saved):
    logger, _ = saved
    assert logger.read_new_values("q").values.tolist() == [MEMORY] * 3
    assert logger["q"].newest.tolist() == MEMORY


def test_a_table_of_columns_alone_has_it_as_a_quaternion(saved):
    logger, names = saved
    path = logger.save("csv").path
    sidecar_of(path).unlink()
    signal = silo.open_log(path)["q"]
    assert (signal.kind, signal.components, signal.values[0].tolist()) == ("quaternion", names, MEMORY)


def test_a_message_of_ros_has_each_part_in_its_field(saved, tmp_path):
    logger, names = saved
    convert(logger.save().path, tmp_path / "q.mcap")
    with (tmp_path / "q.mcap").open("rb") as file:
        (first, *_) = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
    assert first.channel.topic == "/log/q"
    assert [getattr(first.decoded_message.quaternion, name) for name in names] == MEMORY


def test_rotations_take_either_order(new_logger):
    pytest.importorskip("scipy")
    logger = new_logger()
    turn, other = logger.array("turn", 4, kind="quaternion"), logger.array("other", 4, kind="quaternion_wxyz")
    along, pose = logger.array("along", 3), logger.array("pose", 7, kind="pose")
    logger.start()
    half = np.sqrt(0.5)
    turn[:], other[:], along[:], pose[3:] = (0, 0, half, half), (half, 0, 0, half), (1, 0, 0), (0, 0, half, half)
    logger.collect()
    log = silo.Log(logger.snapshot())
    for one in (log["turn"], log["other"], log["pose"].part("orientation")):
        assert one.euler().values[0] == pytest.approx([np.pi / 2, 0, 0])
        assert log["along"].rotate(one).values[0] == pytest.approx([0, 1, 0])
        assert one.inverse().euler().values[0] == pytest.approx([-np.pi / 2, 0, 0])
    assert log["other"].inverse().values[0] == pytest.approx([half, 0, 0, -half])


def test_what_is_calculated_of_both_orders_meets_part_by_part(new_logger):
    logger = new_logger()
    first, second = logger.array("first", 4, kind="quaternion"), logger.array("second", 4, kind="quaternion_wxyz")
    logger.start()
    first[:], second[:] = (1, 2, 3, 4), (4, 1, 2, 3)
    logger.collect()
    log = silo.Log(logger.snapshot())
    assert (log["first"] - log["second"]).values.tolist() == [[0, 0, 0, 0]]
    assert (log["second"] == log["first"]).values.all()


def test_live_messages_have_each_part_in_its_field(saved):
    logger, names = saved
    ((topic,), _) = live_topics(logger.elements)
    assert [names[part.entry] for part in topic.channel.parts] == list("xyzw")

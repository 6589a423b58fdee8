"""Attributes and functions, read at each due tick, and what happens when one can't be read."""

import datetime
import enum

import numpy as np
import pytest

import silo
from silo.core.recording import Failures
from silo.errors import SourceError
from silo.segment.failures import BLOCK_WORDS, read_cut, read_failures, record_cut, record_failure
from tests.stand_ins.ticking import Robot, warnings_of


class Mode(enum.Enum):
    IDLE = "idle"
    WALK = "walk"


class Fault(enum.Flag):
    HOT = 1
    STALL = 2


# --------------------------------------------------------------------------------------------------- expressions


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (1.5, 2.5),
        (1.5, 3),
        (7, -9),
        (True, False),
        (1 + 2j, 3j),
        (np.float32(1.5), np.float32(2.5)),
        (np.int8(-3), np.int8(3)),
        (np.uint64(2**64 - 1), np.uint64(1)),
        (np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])),
        ([1, 2], [3, 4]),
        (np.datetime64("2020-01-01T00:00:01.5", "ns"), np.datetime64("2021-01-01", "ns")),
        (np.array([[1, 2], [3, 4]], np.uint8), np.array([[5, 6], [7, 8]], np.uint8)),
    ],
)
def test_an_attribute_is_followed_when_it_is_assigned_anew(logged, first, second):
    robot = Robot(x=first)
    found = logged(robot, lambda: setattr(robot, "x", second), attr="x")
    if isinstance(first, complex):
        assert found == [[first.real, second.real], [first.imag, second.imag]]
    else:
        expected = [np.ravel(first).tolist(), np.ravel(second).tolist()]
        assert found == [list(pair) for pair in zip(*expected, strict=True)]


@pytest.mark.parametrize(
    ("first", "second", "found"),
    [
        ("stand", "läuft", [b"stand", "läuft".encode()]),
        ("", "walking", [b"", b"walking"]),  # one that was empty has room
        (np.str_("a"), np.str_("walking"), [b"a", b"walking"]),
        (Mode.IDLE, Mode.WALK, [0, 1]),
        (Fault.HOT, Fault.HOT | Fault.STALL, [1, 3]),
    ],
)
def test_texts_are_logged_as_utf8_and_enumerations_and_flags_as_numbers(logged, first, second, found):
    robot = Robot(x=first)
    assert logged(robot, lambda: setattr(robot, "x", second), attr="x") == [found]


@pytest.mark.parametrize(
    ("first", "second", "cut", "words"),
    [
        (b"", b"walking", b"walk", "7 bytes is cut to 4"),
        (["ab", "c"], ["ab", "walking"], "walk", "7 letters is cut to 4"),
        (("ab", "c"), ("ab", "walking"), "walk", "7 letters is cut to 4"),
        (np.array(["ab", "c"]), np.array(["ab", "walking"]), "walk", "7 letters is cut to 4"),
        (np.array([b"ab", b"c"], "S4"), np.array([b"ab", b"walking"]), b"walk", "7 bytes is cut to 4"),
    ],
)
def test_bytes_and_texts_in_a_list_that_are_cut_are_told_too_once(logged, caplog, first, second, cut, words):
    robot = Robot(x=first)
    found = logged(robot, lambda: setattr(robot, "x", second), lambda: None, attr="x", string_bytes=4)
    assert found[-1][1:] == [cut, cut]
    (warning,) = caplog.messages
    assert warning == f"/log/x: a text of {words}: give string_bytes=7 or more where it is added"


@pytest.mark.parametrize("value", [b"walk", ["walk", "ab"], np.array(["walk"], "U40")])
def test_texts_that_fill_their_room_are_not_cut(logged, caplog, value):
    robot = Robot(x=value)
    logged(robot, lambda: setattr(robot, "x", value), attr="x", string_bytes=4)
    assert caplog.messages == []


def test_a_time_with_a_zone_is_logged_in_utc(logged):
    zone = datetime.timezone(datetime.timedelta(hours=2))
    robot = Robot(x=datetime.datetime(2020, 1, 1, 2, 0, 0, 5, tzinfo=zone))
    assert logged(robot, attr="x") == [[datetime.datetime(2020, 1, 1, 0, 0, 0, 5)]]


def test_a_date_and_a_duration_are_logged(logged):
    assert logged(Robot(x=datetime.date(2020, 1, 2)), attr="x") == [[datetime.datetime(2020, 1, 2)]]
    assert logged(Robot(x=datetime.timedelta(milliseconds=5)), attr="x") == [[datetime.timedelta(milliseconds=5)]]


def test_a_dotted_path_is_followed_at_every_step(logged):
    robot = Robot(arm=Robot(speed=1.0))
    assert logged(robot, lambda: setattr(robot, "arm", Robot(speed=2.0)), attr="arm.speed") == [[1.0, 2.0]]


def test_a_function_is_called_each_due_tick(new_logger):
    calls = []

    def load():
        calls.append(1)
        return float(len(calls))

    logger = new_logger()
    logger.add(load, divider=3)
    logger.start()
    before = len(calls)
    for _ in range(7):
        logger.collect()
    assert len(calls) - before == 3


def test_a_function_with_several_results_is_called_once_per_tick(new_logger):
    robot = Robot(count=0)

    def state():
        robot.count += 1
        return {"a": float(robot.count), "b": robot.count, "c": np.full(2, robot.count), "d": [robot.count] * 2}

    logger = new_logger()
    logger.add(state)
    logger.start()
    before = robot.count
    for _ in range(5):
        logger.collect()
    found = [entry.values.tolist() for entry in logger.snapshot().elements[0].entries]
    assert found == [list(range(before + 1, before + 6))] * 6


# ----------------------------------------------------------------------------------------------- what fails


def test_failures_are_counted_per_element_and_said_once(new_logger, caplog):
    robot = Robot(x=1.0)
    logger = new_logger()
    logger.add(robot, attr="x")
    logger.start()
    del robot.x
    for _ in range(3):
        logger.collect()
    assert logger._present.failures == {"/log/x": 3}
    (warning,) = warnings_of(caplog)
    assert "/log/x: reading Robot.x failed (AttributeError" in warning


def test_an_integer_attribute_that_becomes_a_float_is_not_cut_silently(logged, caplog):
    robot = Robot(x=0)
    assert logged(robot, lambda: setattr(robot, "x", 0.5), attr="x") == [[0, 0]]
    assert logged.logger._present.failures == {"/log/x": 1}
    assert "0.5 would be cut to an integer" in warnings_of(caplog)[0]


def test_a_value_without_a_type_is_refused(new_logger):
    with pytest.raises(SourceError, match=r"the value is None \(NoneType\) now, its type can't be told"):
        new_logger().add(Robot(x=None), attr="x")


def test_a_function_that_fails_is_refused_with_its_reason(new_logger):
    with pytest.raises(SourceError, match=r"reading \(\) failed \(ZeroDivisionError"):
        new_logger().add(lambda: 1 / 0, "x")


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [("", "walking", "7 bytes were cut to 4"), (["ab", "c"], ["ab", "walking"], "7 letters were cut to 4")],
)
def test_the_file_of_each_run_tells_of_its_texts_that_were_cut(tmp_path, first, second, words):
    robot = Robot(x=first)
    log = silo.Logger("bot", folder=tmp_path)
    log.add(robot, attr="x", string_bytes=4)
    told = []
    for values in ([first, second, first], [first, first], [second]):
        log.start()
        for robot.x in values:
            log.collect()
        log.stop()
        told.append(silo.open_log(log.save().path).warnings)
    log.close()
    cut = f"/log/x: texts of up to {words}: give string_bytes=7 or more where it is added"
    assert told == [(cut,), (), (cut,)]


def test_failures_and_cut_texts_are_counted_side_by_side():
    words = memoryview(bytearray(8 * BLOCK_WORDS)).cast("q")
    record_failure(words, 0, 5, 1)
    for length in (70, 3_000_000, 9):
        record_cut(words, 0, length)
    for tick in (6, 9):
        record_failure(words, 0, tick, 1)
    assert read_failures(words.tolist()) == Failures(3, ((5, 6), (9, 9)))
    assert read_cut(words.tolist()) == 2**20 - 1

"""Large tables, many dividers, many runs: what is remembered from one element or run to the next, and what is not."""

import gc
import sys
import weakref

import numpy as np
import pytest

from silo.core.elements import Action, BufferType
from silo.errors import ElementError
from silo.loop import generated_code, run

DIVIDERS = [*range(2, 31), 64, 101]


class Robot:
    """Attributes, as a robot's parts have them."""

    def __init__(self, **attributes):
        vars(self).update(attributes)


@pytest.fixture
def counted(monkeypatch):
    """How often tables were laid out, and texts compiled."""
    counts = {"laid out": 0, "compiled": 0}
    lay_out, make_code = run.make_plan, compile

    def counting(name, function):
        def call(*args, **kwargs):
            counts[name] += 1
            return function(*args, **kwargs)

        return call

    monkeypatch.setattr(run, "make_plan", counting("laid out", lay_out))
    monkeypatch.setattr(generated_code, "compile", counting("compiled", make_code), raising=False)
    generated_code._compiled.cache_clear()
    return counts


# ------------------------------------------------------------------------------------------------------- dividers


def lines_of_a_tick(logger):
    """How many lines of generated code one call of `collect()` runs."""
    lines = 0

    def trace(frame, event, _):
        nonlocal lines
        lines += event == "line"
        return trace if frame.f_code.co_filename == "<silo collect>" else None

    sys.settrace(trace)
    try:
        logger.collect()
    finally:
        sys.settrace(None)
    return lines


def test_a_tick_at_which_nothing_is_due_does_the_same_for_any_number_of_dividers(new_logger):
    counts = []
    for number, dividers in enumerate((range(100, 105), range(100, 400))):
        logger = new_logger(f"test{number}")
        for divider in dividers:
            logger.array(f"x{divider}", divider=divider, size=1)
        logger.start()
        logger.collect()
        counts.append(lines_of_a_tick(logger))
    assert counts[0] == counts[1]


@pytest.mark.parametrize("kind", list(BufferType))
def test_many_dividers_each_log_their_own_ticks(new_logger, kind):
    logger = new_logger(max_time=0)
    robot = Robot(tick=0)
    for divider in DIVIDERS:
        logger.add(robot, f"y{divider}", attr="tick", divider=divider, buffer=kind, size=9)
    x = logger.array("x", 1, np.int64, buffer=kind, size=9)
    logger.start()
    for tick in range(400):
        x[:] = robot.tick = tick
        logger.collect()
    for element in logger.snapshot().elements:
        assert element.entries[0].values.tolist() == element.stamp_indices.tolist(), element.name


def test_the_buffers_of_a_run_with_many_dividers_are_freed_at_once(new_logger):
    logger = new_logger()
    for divider in DIVIDERS:
        logger.array(f"x{divider}", divider=divider, size=9)
    logger.start()
    for _ in range(200):
        logger.collect()
    old = weakref.ref(logger._present.run.collect)
    gc.disable()
    try:
        logger.restart()
        assert old() is None
    finally:
        gc.enable()


# ------------------------------------------------------------------------------------------------------- restarts


def filled(new_logger):
    logger = new_logger()
    robot = Robot(a=1.0, b="text", fails=0)
    logger.array("x", 3, size=50)
    for name in vars(robot):
        logger.add(robot, attr=name, size=50)
    logger.start()
    logger.collect()
    return logger, robot


def test_a_restart_of_an_unchanged_table_lays_out_and_compiles_nothing(new_logger, counted):
    logger, _ = filled(new_logger)
    assert counted == {"laid out": 1, "compiled": 1}
    logger.restart()
    logger.stop()
    logger.set("/", divider=1)
    logger.start()
    assert counted == {"laid out": 1, "compiled": 1}


def test_a_restart_of_a_changed_table_lays_it_out_anew(new_logger, counted):
    logger, _ = filled(new_logger)
    logger.stop()
    logger.set("x", divider=2)
    logger.start()
    assert counted["laid out"] == 2
    for _ in range(4):
        logger.collect()
    assert [len(element.stamp_indices) for element in logger.snapshot().elements] == [2, 4, 4, 4]


def test_a_run_with_the_layout_of_the_last_one_reads_everything_anew(new_logger):
    logger, robot = filled(new_logger)
    logger.restart()
    robot.a, robot.b = 2.0, "other"
    logger.collect()
    del robot.fails
    logger.collect()
    recording = logger.snapshot()
    assert recording.offset == 2
    assert recording.elements[1].entries[0].values.tolist() == [2.0, 2.0]
    assert recording.elements[2].entries[0].values.tolist() == [b"other", b"other"]
    assert logger._present.failures == {"/log/fails": 1}


def test_a_tick_of_the_last_run_can_not_write_into_the_present_one(new_logger):
    logger, _ = filled(new_logger)
    before = logger._present.run.plan.scratch.words
    logger.restart()
    assert not np.shares_memory(before, logger._present.run.plan.scratch.words)


def test_a_source_that_failed_in_the_last_run_is_told_of_again(new_logger, caplog):
    logger, robot = filled(new_logger)
    del robot.fails
    for _ in range(2):
        caplog.clear()
        logger.restart()
        logger.collect()
        assert "reading Robot.fails failed" in caplog.text


# ----------------------------------------------------------------------------------------------- alike, but not equal


@pytest.mark.parametrize(("option", "value"), [("divider", True), ("divider", Action.SAVE), ("size", 1.0)])
def test_options_that_only_equal_valid_ones_are_refused_with_the_name_of_the_element(new_logger, option, value):
    logger = new_logger()
    logger.array("first", **{option: 1})
    with pytest.raises(ElementError, match="element '/log/second'"):
        logger.array("second", **{option: value})


def test_words_for_options_mean_the_same_for_every_element(new_logger):
    logger, other = new_logger(frequency=100), new_logger("other", frequency=1000)
    for name in ("x", "y"):
        logger.array(name, divider="50Hz")
        other.array(name, divider="50Hz")
        logger.update()
        other.update()
        assert logger[name].options.divider == 2
        assert other[name].options.divider == 20
        logger.remove(name)
        other.remove(name)


def test_numbers_that_share_a_word_of_memory_are_each_logged_as_they_are(new_logger):
    logger = new_logger()
    halves = np.zeros(6, np.float32)
    for place in range(3):
        logger.add(halves[place : place + 1], f"x{place}")
    logger.add([halves[3:4], halves[4:6], halves[1:3]], "parts")
    logger.add(halves[::-1], "backwards")
    logger.start()
    halves[:] = 0, 1, 2, 3, 4, 5
    logger.collect()
    found = [[entry.values.tolist() for entry in element.entries] for element in logger.snapshot().elements]
    assert found == [[[0]], [[1]], [[2]], [[3], [4], [5], [1], [2]], [[5], [4], [3], [2], [1], [0]]]


def test_labels_of_one_element_are_not_those_of_another_of_its_type(new_logger):
    logger = new_logger()
    logger.array("plain", dtype=int)
    logger.array("mode", dtype=int, labels={0: "stand"})
    logger.array("gait", dtype=int, labels={0: "trot"})
    logger.start()
    logger.collect()
    found = [element.entries[0].entry.labels for element in logger.snapshot().elements]
    assert found == [None, {0: "stand"}, {0: "trot"}]

"""Arrays that were assigned anew are found while and after they are logged; what is only constant is not told of."""

import ctypes

import numpy as np
import pytest

import silo
from silo.files.convert import convert
from tests.stand_ins.ticking import Robot, collect, warnings_of

pytestmark = pytest.mark.filterwarnings("ignore::silo.LogWarning")

ALONE = "nobody but silo holds this array any more"


def turned(logger, owner, ticks=5, name="q"):
    """Log some ticks of a loop that assigns its array anew."""
    for tick in range(ticks):
        setattr(owner, name, np.full(3, float(tick)))
        logger.collect()


def test_an_array_that_is_assigned_anew_in_the_loop_is_told_of_at_the_end(new_logger, caplog):
    robot, logger = Robot(q=np.zeros(3)), new_logger()
    logger.add(robot.q, "q")
    logger.start()
    turned(logger, robot)
    logger.stop()
    (warning,) = warnings_of(caplog)
    assert warning.startswith(f"/log/q: {ALONE} (seen at tick 4), and it never changed during the run")


@pytest.mark.parametrize(("still", "told"), [(9, False), (11, False), (12, True), (40, True)])
def test_one_that_changed_and_was_assigned_anew_then_is_told_of_at_the_end(new_logger, caplog, still, told):
    robot, logger = Robot(q=np.zeros(3)), new_logger()
    logger.add(robot.q, "q")
    logger.start()
    for tick in range(20):  # changes at every fourth tick, the last time at 16
        robot.q[0] = tick // 4
        logger.collect()
    turned(logger, robot, still - 4)
    logger.stop()
    says = f"/log/q: {ALONE} (seen at tick {15 + still}), and its newest {still} samples are the same"
    assert [warning.partition(": right")[0] for warning in warnings_of(caplog)] == [says] * told


@pytest.mark.parametrize(("count", "told"), [(2, 2), (11, 0)])
def test_several_that_are_assigned_anew_together_are_told_of_a_robot_that_stands_still_is_not(
    new_logger, caplog, count, told
):
    robot, logger = Robot(), new_logger()
    robot.arrays = [np.zeros(3) for _ in range(count)]
    for place, one in enumerate(robot.arrays):
        logger.add(one, f"q{place}")
        del one
    logger.start()
    for tick in range(40):
        if tick == 20:
            robot.arrays = [one + 1 for one in robot.arrays]
        for one in robot.arrays:
            one[0] = tick
            del one
        logger.collect()
    logger.stop()
    assert (
        len([warning for warning in warnings_of(caplog) if ", and its newest 21 samples are the same" in warning])
        == told
    )


def test_so_is_one_of_silos_own_memory(new_logger, caplog):
    robot, logger = Robot(), new_logger()
    robot.q, robot.kept = logger.array("q", 3), logger.array("kept", 3)
    logger.start()
    turned(logger, robot)
    logger.stop()
    assert [warning.split(":")[0] for warning in warnings_of(caplog)] == ["/log/q"]


def test_a_view_keeps_an_array_of_silos_own_memory(new_logger, caplog):
    logger = new_logger()
    view = logger.array("q", 3)[:2]
    logger.start()
    collect(logger, 5)
    logger.stop()
    assert view.shape == (2,)
    assert warnings_of(caplog) == []


@pytest.mark.parametrize(
    ("source", "assign"),
    [
        (lambda robot: robot.x, lambda robot: setattr(robot, "x", robot.x + 1)),
        (lambda robot: robot.x[1:], lambda robot: setattr(robot, "x", robot.x + 1)),
        (lambda robot: robot.x.reshape(3, 1).T, lambda robot: setattr(robot, "x", robot.x + 1)),
        (lambda robot: robot.record, lambda robot: setattr(robot, "record", robot.record.copy())),
    ],
)
def test_views_parts_and_structures_are_found_as_well(new_logger, caplog, source, assign):
    robot = Robot(x=np.zeros(3), record=np.zeros(1, [("a", "f8"), ("b", "i4")]))
    logger = new_logger()
    logger.add(source(robot), "x")
    logger.start()
    assert warnings_of(caplog) == []
    for _ in range(4):
        assign(robot)
        logger.collect()
    logger.stop()
    assert [ALONE in warning for warning in warnings_of(caplog)] == [True]


def test_an_attribute_follows_assignments(new_logger, caplog):
    robot, logger = Robot(q=np.zeros(3)), new_logger()
    logger.add(robot, attr="q")
    logger.start()
    turned(logger, robot)
    logger.stop()
    assert warnings_of(caplog) == []


def test_an_array_that_changed_until_its_function_returned_is_not_told_of(new_logger, caplog):
    logger = new_logger()

    def loop():
        q = np.zeros(3)
        logger.add(q, "q")
        logger.start()
        for tick in range(5):
            q[:] = tick
            logger.collect()

    loop()
    logger.stop()
    assert warnings_of(caplog) == []


def test_one_that_is_let_go_of_after_the_stop_is_not_told_of(new_logger, caplog):
    robot, logger = Robot(q=np.zeros(3)), new_logger()
    logger.add(robot.q, "q")
    logger.start()
    collect(logger, 5)
    logger.stop()
    robot.q = None
    logger.save()
    assert warnings_of(caplog) == []


def test_one_that_is_written_by_its_address_is_not_told_of(new_logger, caplog):
    robot, logger = Robot(q=np.zeros(3)), new_logger()
    logger.add(robot.q, "q")
    memory = (ctypes.c_double * 3).from_address(robot.q.ctypes.data)
    robot.q = None
    logger.start()
    caplog.clear()  # at the start nobody can know
    logger.restart()
    for tick in range(6):
        memory[0] = tick
        logger.collect()
        logger.snapshot()
    assert warnings_of(caplog) == []


def test_one_that_changed_before_is_found_between_two_looks(new_logger, caplog):
    robot, logger = Robot(q=np.zeros(3)), new_logger()
    logger.add(robot.q, "q")
    logger.start()
    for tick in range(5):
        robot.q[:] = tick
        logger.collect()
    for _ in range(3):
        turned(logger, robot)
        logger.snapshot()
    (warning,) = warnings_of(caplog)
    assert ALONE in warning
    assert "never changed" not in warning


def test_a_run_that_stops_by_itself_is_looked_at_when_it_is_saved(new_logger, caplog):
    robot, logger = Robot(q=np.zeros(3)), new_logger()
    logger.add(robot.q, "q", buffer="fixed", size=4)
    logger.start()
    turned(logger, robot, 6)
    assert not logger.is_running
    logger.save()
    assert ALONE in caplog.text


def test_it_is_told_once_however_often_one_looks(new_logger, caplog):
    robot, logger = Robot(q=np.zeros(3)), new_logger()
    logger.add(robot.q, "q")
    for _ in range(3):
        logger.start()
        turned(logger, robot)
        logger.save()
        logger.stop()
    assert len(warnings_of(caplog)) == 1


def test_many_are_told_of_in_a_few_lines(new_logger, caplog):
    robots, logger = [Robot(q=np.zeros(3)) for _ in range(30)], new_logger()
    for number, robot in enumerate(robots):
        logger.add(robot.q, f"q{number:02}")
    logger.start()
    for robot in robots:
        turned(logger, robot, 1)
    logger.collect()
    logger.stop()
    told = warnings_of(caplog)
    assert len(told) == 11
    assert told[-1] == "nobody but silo holds the arrays of 20 more elements either"


@pytest.mark.parametrize("file_type", ["silo", "csv", "bag"])
def test_files_say_it(new_logger, file_type):
    robot, logger = Robot(q=np.zeros(3)), new_logger()
    logger.add(robot.q, "q")
    logger.start()
    turned(logger, robot)
    (warning,) = silo.open_log(logger.save(file_type).path).warnings
    assert warning.startswith(f"/log/q: {ALONE} (seen at tick 4), and it never changed during the run")


@pytest.mark.parametrize("ending", ["csv", "silo", "mcap"])
def test_and_what_they_are_converted_to(new_logger, tmp_path, ending):
    robot, logger = Robot(q=np.zeros(3)), new_logger()
    logger.add(robot.q, "q")
    logger.start()
    turned(logger, robot)
    target = tmp_path / f"converted.{ending}"
    convert(logger.save().path, target)
    assert ALONE in silo.open_log(target).warnings[0]


def test_looking_beside_the_loop_gives_it_the_interpreter_in_between(new_logger):
    arrays, logger = [np.zeros(1) for _ in range(2000)], new_logger()
    for number, array in enumerate(arrays):
        logger.add(array, f"x{number}")
    logger.start()
    pauses = []
    assert logger._present.run.left_behind(lambda: pauses.append(1)) == []
    assert len(pauses) > 4

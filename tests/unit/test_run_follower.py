"""Who follows the present run: goes over to another one, lets go, and goes on after one that can't be read."""

from types import SimpleNamespace

import numpy as np
import pytest

import silo
from silo.errors import SegmentError
from silo.logger.serving.answers import robot_state
from silo.state.replica import Replica
from silo.state.run_follower import RunFollower, is_next, is_over


class Robot:
    """A logger of this process, and what its helper process would know of it."""

    def __init__(self, folder):
        self.log = silo.Logger("r", frequency=100, folder=folder, script=folder / "r.yaml")
        self.x = self.log.array("x", action=silo.Action.SAVE_AND_PUBLISH)
        self.log.update()
        self.replica = Replica(robot_state(self.log, "", -1))

    def start(self):
        """Begin another run, and tell of it."""
        self.log.restart(unsaved="clear") if self.log.is_running else self.log.start()
        self.tell()

    def tell(self):
        self.replica.take(robot_state(self.log, "", -1))


@pytest.fixture
def robot(tmp_path):
    made = Robot(tmp_path)
    yield made
    made.log.close(discard=True)


def test_without_a_run_nothing_is_followed_and_nothing_is_new(robot):
    follower = RunFollower(robot.replica)
    assert [follower.look(), follower.look()] == [False, False]
    assert (follower.reader, follower.run) == (None, "")


def test_each_run_is_new_once(robot):
    follower, runs = RunFollower(robot.replica), []
    for _ in range(3):
        robot.start()
        assert [follower.look(), follower.look()] == [True, False]
        runs.append(follower.run)
    assert len(set(runs)) == 3
    assert runs[-1] == robot.replica.run


def test_the_rows_of_a_run_that_is_over_are_there_until_the_next_look(robot):
    robot.start()
    follower = RunFollower(robot.replica)
    follower.look()
    for number in range(5):
        robot.x[...] = number
        robot.log.collect()
    before = follower.reader
    robot.start()
    (element,) = before.schema.elements
    assert before.rows(element.ring, 0).column(element.entries[0]).tolist() == [0, 1, 2, 3, 4]
    assert follower.look()
    assert follower.reader is not before


def test_a_run_that_is_let_go_of_is_let_go_of_at_the_next_look(robot):
    robot.start()
    follower = RunFollower(robot.replica)
    follower.look()
    robot.replica.let_go()
    assert [follower.look(), follower.look()] == [True, False]
    assert follower.reader is None


def test_a_run_that_can_not_be_read_is_opened_anew_at_each_look(robot, monkeypatch):
    robot.start()
    follower, opened = RunFollower(robot.replica), robot.replica.open_reader
    follower.look()
    follower.forget()

    def broken():
        raise SegmentError("it is damaged")

    monkeypatch.setattr(robot.replica, "open_reader", broken)
    for _ in range(2):
        with pytest.raises(SegmentError, match="damaged"):
            follower.look()
        assert follower.reader is None
    monkeypatch.setattr(robot.replica, "open_reader", opened)
    assert follower.look()
    assert follower.run == robot.replica.run


def test_who_follows_derived_signals_goes_over_when_others_are_derived(robot):
    robot.start()
    plain, derived = RunFollower(robot.replica), RunFollower(robot.replica, derived=True)
    assert [plain.look(), derived.look()] == [True, True]
    robot.log.derive("twice", "2 * x")
    robot.tell()
    assert [plain.look(), derived.look(), derived.look()] == [False, True, False]
    assert [element.info.name for element in derived.reader.schema.elements] == ["/log/x", "/log/twice"]
    robot.x[...] = np.pi
    robot.log.collect()
    assert plain.run == derived.run


def test_a_run_is_not_over_for_its_readers_while_one_right_behind_it_is_not_known_yet():
    def run(number, ticks=0):
        return SimpleNamespace(schema=SimpleNamespace(number=number), running=False, ticks=ticks)

    assert [is_next(run(4), run(number)) for number in (5, 6, 0)] == [True, False, True]
    assert is_over(run(4), run(5), 0.0)
    assert not is_over(run(4), run(6, ticks=3), 0.0)
    assert is_over(run(4), run(6), 1.5)  # it never came

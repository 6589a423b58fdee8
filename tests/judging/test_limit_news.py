"""What is told of limits: the worst at once, and nothing of it lost."""

import itertools
import math

import pytest

import silo
from silo.conditions import limit_judge
from silo.conditions.segment_judge import SegmentJudge
from silo.segment.reader import SegmentReader

JOINTS = 45


class Robot:
    """A logger without a helper, and the judge of its run."""

    def __init__(self, folder, **options):
        script = folder / "none.yaml"
        self.logger = silo.Logger("news", frequency=1000, max_time=0, folder=folder, script=script, **options)
        self.x = self.logger.array("x", (), size=3000)
        self.tau = self.logger.array("tau", JOINTS, size=3000)
        self.off = self.logger.array("off", (), size=3000)
        self.logger.update(read_script=False)
        self.logger.limit("x", (None, None, 5, 10))

    def start(self):
        self.logger.start()
        self.judge = SegmentJudge(SegmentReader(self.logger._present.path), self.logger.elements)

    def collect(self, *values):
        for value in values:
            self.x[...] = value
            self.logger.collect()

    def told(self):
        return [news.text for news in self.judge.step().limits]


@pytest.fixture
def robot(tmp_path, runtime_folder, monkeypatch):
    monkeypatch.setattr(limit_judge, "TELL_AGAIN_S", 3600.0)  # however slow this computer is
    made = Robot(tmp_path)
    yield made
    made.logger.close()


@pytest.mark.parametrize(
    ("looks", "at_the_end"),
    [
        ([((0, 7), "H 7 at tick 1, limit 5"), ((30, 30), "HH 30 at tick 2, limit 10")], []),
        (  # one that comes later and is worse
            [((7, 0), "H 7 at tick 0, limit 5; within its limits again from tick 1 on"),
             ((30, 0, 6, 0), "HH 30 at tick 2, limit 10, 2 times; within its limits again from tick 5 on")], [],
        ),
        (  # what isn't told yet
            [((30, 0), "HH 30 at tick 0, limit 10; within its limits again from tick 1 on"), ((0, 40, 0), "")],
            ["HH 40 at tick 3, limit 10; within its limits again from tick 4 on"],
        ),
        (  # a peak that grew
            [((30,), "HH 30 at tick 0, limit 10"), ((90, 20, 0), "")],
            ["is within its limits again; its peak was 90 at tick 1"],
        ),
        (  # one that grew, and another one behind it
            [((30,), "HH 30 at tick 0, limit 10"), ((50, 0, 20, 0), "")],
            ["HH 50 at tick 1, limit 10; within its limits again",
             "HH 20 at tick 3, limit 10; within its limits again from tick 4 on"],
        ),
    ],
)  # fmt: skip
def test_the_worst_is_told_at_once_and_the_rest_at_the_end(robot, looks, at_the_end):
    robot.start()
    for values, told in looks:
        robot.collect(*values)
        assert robot.told() == [f"/log/x {told}"] * bool(told)
    robot.logger.stop()
    told = [news.text for news in robot.judge.end("the logger was stopped").limits]
    assert told == [f"/log/x {text}" for text in at_the_end]


def test_each_violation_that_begins_or_becomes_worse_fires_at_once_told_or_not(robot):
    robot.start()
    fired = []
    for values in ((0, 7), (7, 7), (30,), (7, 0), (7,), (0, 6, 0), (0,)):
        robot.collect(*values)
        fired.append(robot.judge.step().limit_fired)
    assert fired == [
        "/log/x H 7 at tick 1, limit 5", "", "/log/x HH 30 at tick 4, limit 10", "", "/log/x H 7 at tick 7, limit 5",
        "/log/x H 6 at tick 9, limit 5", "",
    ]  # fmt: skip


@pytest.mark.parametrize("level", [30, 7])
def test_what_comes_behind_a_violation_that_is_known_is_told_with_its_own_peak(robot, monkeypatch, level):
    robot.start()
    robot.collect(0, level)
    assert len(robot.told()) == 1
    robot.collect(level, level, 0)
    assert robot.told() == []
    robot.collect(level - 1, 0)
    assert robot.told() == []
    monkeypatch.setattr(limit_judge, "TELL_AGAIN_S", 0.0)
    word = {30: "HH 29 at tick 5, limit 10", 7: "H 6 at tick 5, limit 5"}[level]
    (news,) = robot.judge.step().limits
    assert (news.text, news.tick) == (f"/log/x {word}; within its limits again from tick 6 on", 5)
    assert robot.told() == []


def test_of_many_at_once_those_that_are_not_told_now_are_told_next_each_with_its_peak(robot):
    robot.logger.limit("tau", (None, None, 5, 10))
    robot.start()
    robot.tau[:] = 7
    robot.tau[-1] = 99
    robot.collect(0)
    first = robot.told()
    assert first[0] == f"/log/tau_{JOINTS - 1} HH 99 at tick 0, limit 10"  # the worst before the others
    told = [*first, *robot.told(), *robot.told()]
    assert {text.split()[0] for text in told} == {f"/log/tau_{joint}" for joint in range(JOINTS)}
    assert len(told) == JOINTS
    assert robot.told() == []


def test_a_limit_stands_with_its_newest_value_where_it_is_finite(robot):
    robot.start()
    for value, shown in ((0, 0), (7, 7), (float("inf"), None)):
        robot.collect(value)
        robot.judge.step()
        assert [one.value for one in robot.judge.limits.statuses()] == [shown]


@pytest.mark.parametrize(
    ("values", "worst"),
    [
        ((7, 0, -6, 0), "H 7 at tick 0, limit 5"), ((6, 0, -7, 0), "L -7 at tick 2, limit -5"),
        ((9, 0, 7, 0), "H 9 at tick 0, limit 5"),
        ((7, 0, 9, 0), "H 9 at tick 2, limit 5"), ((-9, 0, -7, 0), "L -9 at tick 0, limit -5"),
        ((-7, 0, -9, 0), "L -9 at tick 2, limit -5"), ((7, 0, 7, 0), "H 7 at tick 0, limit 5"),
        ((30, 0, 7, 0), "HH 30 at tick 0, limit 10"), ((7, 0, -30, 0), "LL -30 at tick 2, limit -10"),
    ],
)  # fmt: skip
def test_of_violations_between_two_looks_the_one_farthest_beyond_is_told(robot, values, worst):
    robot.logger.limit("x", (-10, -5, 5, 10))
    robot.start()
    robot.collect(*values)
    assert robot.told() == [f"/log/x {worst}, 2 times; within its limits again from tick 3 on"]
    (stands,) = robot.judge.limits.statuses()
    assert (stands.worst, stands.count) == (float(worst.split()[1]), 2)


@pytest.mark.parametrize("most", [JOINTS + 1, JOINTS, JOINTS - 3])
def test_all_that_wait_are_told_at_the_end(robot, monkeypatch, most):
    monkeypatch.setattr(limit_judge, "MOST_NEWS", 0)
    monkeypatch.setattr(limit_judge, "MOST_LAST_NEWS", most)
    robot.logger.limit("tau", (None, None, 5, 10))
    robot.start()
    robot.tau[:] = 7
    robot.collect(0)
    robot.logger.stop()
    told = [news.text for news in robot.judge.end("the logger was stopped").limits]
    assert len({text.split()[0] for text in told[:most]}) == min(most, JOINTS)
    assert told[most:] == ["3 more signals changed; `silo alarms` lists them"] * (most < JOINTS)


def test_limits_of_an_element_that_is_off_or_whose_condition_is_are_told_to_be_blind(robot):
    robot.logger.limit("off", (None, None, 5, 10))
    robot.logger.limit("x", (None, None, 5, 10), when="off > 1")
    robot.logger.set("off", enabled=False)
    robot.start()
    assert robot.judge.problems == [
        "limits of 'x' are blind: /log/off is off",
        "limits of 'off' are blind: /log/off is off",
    ]
    robot.collect(30)
    robot.judge.step()
    stands = robot.judge.limits.statuses()
    assert {(one.name, one.word.value) for one in stands} == {
        ("/log/x", "~~"),
        ("/log/off", "~~"),
    }


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize("looks", ["each", "once"])
def test_a_limit_of_what_has_no_value_any_more_says_since_when(tmp_path, runtime_folder, looks, together):
    seconds = itertools.count()
    robot = Robot(tmp_path, clock=lambda: float(next(seconds)))
    if not together:
        robot.logger.limit("x", (None, None, 5, 10), when="off == 0")
    robot.start()
    begun_s = next(seconds)
    for value in (0, 1, math.nan, math.nan):
        robot.collect(value)
        if looks == "each":
            robot.told()
    robot.told()
    (one,) = robot.judge.limits.statuses()
    robot.logger.close(discard=True)
    assert (one.word.value, one.why) == ("~~", f"it has no value (NaN) since {begun_s + 3} s")


def test_a_limit_of_what_never_had_a_value_says_that(robot):
    robot.start()
    robot.collect(math.nan, math.nan)
    robot.told()
    assert [one.why for one in robot.judge.limits.statuses()] == ["it has no value yet"]


def test_a_signal_that_was_over_and_has_no_value_now_is_not_called_well_again(robot):
    robot.start()
    robot.collect(30, 0, math.nan)
    robot.told()
    (one,) = robot.judge.limits.statuses()
    assert (one.word.value, one.violated, one.alarm, one.count) == ("~~", True, True, 1)
    assert one.why.startswith("it has no value (NaN) since")


def test_since_when_there_is_no_value_is_known_when_the_limits_are_changed(robot):
    robot.start()
    robot.collect(0, math.nan)
    robot.told()
    (before,) = robot.judge.limits.statuses()
    robot.logger.limit("x", (None, None, 6, 10))
    robot.judge.adopt(robot.logger._conditions.now)
    robot.collect(math.nan)
    robot.told()
    (after,) = robot.judge.limits.statuses()
    assert (after.bounds, after.why) == ((None, None, 6, 10), before.why)
    assert "since" in after.why

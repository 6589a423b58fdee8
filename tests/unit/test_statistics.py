"""Statistics of a survey: over every sample, whatever its type, and signs that follow from them."""

import itertools

import msgspec
import numpy as np
import pytest

import silo
from silo.analysis.signal import Signal
from silo.core.arrays.running import RunningStatistics
from silo.core.conditions import Derived
from silo.journal.derived_rows import with_derived_rows
from silo.live.quantities import FROZEN, LOST, NOT_FINITE, SLOW, signs_of
from silo.live.requests import GetSurvey, Survey
from silo.live.statistics import Surveyor, Tally, _values
from silo.logger.serving.answers import robot_state
from silo.rpc.refusals import Refused, answered
from silo.segment.reader import SegmentReader
from silo.state.replica import Replica
from tests.waiting import wait_until


class Robot:
    """A logger of this process, and the tally that reads its segment."""

    def __init__(self, folder):
        self.now_ns = 1_000_000_000
        self.log = silo.Logger(
            "r", frequency=100, folder=folder, script=folder / "r.yaml", clock=lambda: self.now_ns, max_time=0
        )
        both = silo.Action.SAVE_AND_PUBLISH
        self.x = self.log.array("x", action=both)
        self.kept = self.log.array("kept", action=silo.Action.SAVE)
        self.force = self.log.array("force", 3, np.float32, action=both)
        self.count = self.log.array("count", 1, np.int64, action=both, divider=4)
        self.flag = self.log.array("flag", 1, np.bool_, action=both)
        self.mixed = self.log.array("mixed", (), [("tau", "f8"), ("at", "M8[ns]")], action=both)
        self.word = self.log.array("word", (), "U8", action=both)
        self.gain = self.log.array("gain", (), buffer=silo.BufferType.FIXED, size=2)
        self.log.start()
        self.tally = Tally(SegmentReader(self.log._present.path))
        self.sums = self.tally.sums()

    def tick(self, x, **others):
        self.x[...] = x
        for name, value in others.items():
            getattr(self, name)[...] = value
        self.log.collect()
        self.now_ns += 10_000_000

    def advance(self, seconds=0.0):
        self.tally.advance(seconds, [self.sums])

    def of(self, name, quantity, *, running=True):
        found, per_slot = self.tally.quantity(quantity, self.sums, running=running)
        number = self.tally.numbers.get(name)
        if per_slot:
            return found[self.tally.lead[number] if number is not None else self.tally.slot_of[name]]
        return found[number]


@pytest.fixture
def robot(tmp_path):
    robot = Robot(tmp_path)
    yield robot
    robot.log.close()


def test_every_sample_counts_however_the_reads_fall(robot):
    values = 1e9 + np.random.default_rng(3).normal(size=500)
    for at, value in enumerate(values):
        robot.tick(value, kept=-value)
        if at % 37 == 0:
            robot.advance()
    robot.advance()
    found = [robot.of("/log/x", quantity) for quantity in ("min", "max", "mean", "std", "count", "value")]
    expected = [values.min(), values.max(), values.mean(), values.std(), 500, values[-1]]
    assert found == pytest.approx(expected, rel=1e-9)
    assert robot.of("/log/kept", "min") == -values.max()


def test_of_a_vector_the_norm_is_told_and_each_entry_by_its_name(robot):
    robot.tick(0, force=[3, 4, 0])
    robot.tick(0, force=[0, 0, -1])
    robot.advance()
    assert [robot.of("/log/force", quantity) for quantity in ("max", "min", "value")] == [5, 1, 1]
    assert robot.of("/log/force_z", "min") == -1
    assert robot.tally.lead[robot.tally.numbers["/log/mixed"]] < 0  # of numbers and times there is none


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ((1, np.nan, 3), [1, 3, 2, 1]),
        ((1, np.nan, 3, np.inf), [1, np.inf, np.inf, np.nan]),
        ((-np.inf, 3), [-np.inf, 3, -np.inf, np.nan]),
        ((np.inf, 1, -np.inf), [-np.inf, np.inf, np.nan, np.nan]),
        ((np.inf, np.inf), [np.inf, np.inf, np.inf, np.nan]),
    ],
)
def test_nan_is_left_out_of_statistics_infinite_ones_count_and_both_get_a_sign(robot, values, told):
    for value in values:
        robot.tick(value)
        robot.advance()
    found = [robot.of("/log/x", quantity) for quantity in ("min", "max", "mean", "std")]
    np.testing.assert_equal(found, told)
    assert robot.of("/log/x", "count") == np.isfinite(values).sum()
    assert int(robot.of("/log/x", "signs")) & NOT_FINITE
    signal = Signal("x", np.array(values, float), np.arange(len(values)))
    np.testing.assert_equal([signal.min(), signal.max(), signal.mean()], told[:3])


def test_the_last_change_is_found_across_reads(robot):
    for at in range(300):
        robot.tick(at if at < 100 else 99, flag=True)
        if at % 50 == 7:
            robot.advance()
    robot.advance()
    assert robot.of("/log/x", "changed") == pytest.approx(2.0)
    assert [robot.of(name, "change_seen") for name in ("/log/x", "/log/flag")] == [1, 0]
    assert int(robot.of("/log/x", "signs")) & FROZEN
    assert not int(robot.of("/log/flag", "signs")) & FROZEN


def test_texts_and_what_is_no_number_have_a_last_change_and_no_statistics(robot):
    for at in range(300):
        robot.tick(0, word="walk" if at < 120 else "trot", mixed=(at < 200, np.datetime64(0, "ns")))
        if at % 50 == 7:
            robot.advance()
    robot.advance()
    names = ["/log/word", "/log/mixed", "/log/mixed_tau", "/log/force_x"]
    told = _values(robot.tally, robot.sums, ["changed", "max"], names, entries=True, running=True)
    changed, most = np.frombuffer(told).reshape(2, -1)
    assert changed == pytest.approx([1.79, 0.99, 0.99, 2.99])
    np.testing.assert_equal(most, [np.nan, np.nan, 1, 0])
    assert not int(robot.of("/log/word", "signs"))


def test_a_large_integer_changed_though_float64_has_not_each_of_its_values(robot):
    """2**60 and 2**60 + 1 are one float: what counts at each sample was told to have changed a second ago."""
    for at in range(200):
        robot.tick(at, count=2**60 + at // 4)
        if at % 50 == 7:
            robot.advance()
    robot.advance()
    told = _values(robot.tally, robot.sums, ["changed", "change_seen"], ["/log/count"], entries=True, running=True)
    assert np.frombuffer(told) == pytest.approx([0.03, 1.0])
    assert not int(robot.of("/log/count", "signs")) & FROZEN


def test_a_constant_that_nobody_keeps_any_more_has_not_changed_since_it_came(robot):
    for _ in range(100):
        robot.tick(7.0)
    robot.tally = Tally(SegmentReader(robot.log._present.path))
    robot.sums = robot.tally.sums()
    for _ in range(10):
        robot.tick(7.0)
    robot.advance()
    assert [robot.of(name, "changed") for name in ("/log/x", "/log/gain")] == pytest.approx([1.09, 1.09])
    assert [robot.of(name, "change_seen") for name in ("/log/x", "/log/gain")] == [0, 0]
    assert robot.of("/log/x", "count") == 10
    assert np.isnan(robot.of("/log/gain", "max"))


@pytest.mark.parametrize("stopped_s", [0, 40])
def test_what_is_frozen_is_so_in_the_next_run_as_well(robot, stopped_s):
    for at in range(500):
        robot.tick(min(at, 300), word=str(min(at, 200)))
    robot.advance()
    assert int(robot.of("/log/x", "signs")) & FROZEN
    before = robot.tally.changes()
    robot.log.restart()
    robot.now_ns += stopped_s * 10**9
    robot.tally = Tally(SegmentReader(robot.log._present.path), whole=True)
    robot.tally.remember(before)
    robot.sums = robot.tally.sums(whole=True)
    robot.tick(300, word="200")
    robot.advance()
    assert int(robot.of("/log/x", "signs")) & FROZEN
    assert robot.of("/log/x", "changed") == pytest.approx(stopped_s + 2.0)
    told = _values(robot.tally, robot.sums, ["changed"], ["/log/word"], entries=False, running=True)
    assert np.frombuffer(told) == pytest.approx([stopped_s + 3.0])
    assert robot.of("/log/x", "count") == 1
    robot.tick(301)
    robot.advance()
    assert robot.of("/log/x", "changed") == 0
    assert not int(robot.of("/log/x", "signs")) & FROZEN


def test_changes_by_a_clock_that_began_anew_are_none(robot):
    for at in range(500):
        robot.tick(min(at, 300))
    robot.advance()
    before = robot.tally.changes()
    robot.log.restart()
    robot.tally = Tally(SegmentReader(robot.log._present.path), whole=True)
    robot.tally.remember(before)
    robot.now_ns = 1_000_000
    robot.tick(300)
    robot.now_ns += 10**9
    robot.tick(300)
    robot.advance()
    assert robot.of("/log/x", "changed") == pytest.approx(1.01)


def test_what_never_changed_or_changes_seldom_is_not_frozen(robot):
    for at in range(1000):
        robot.tick(7.0, force=[at // 100, 0, 0] if at < 500 else [4, 0, 0])
        if at % 50 == 7:
            robot.advance()
    robot.advance()
    assert robot.of("/log/x", "changed") > 9
    assert not int(robot.of("/log/x", "signs")) & FROZEN
    assert robot.of("/log/force", "changed") > 5
    assert not int(robot.of("/log/force", "signs")) & FROZEN


def test_what_froze_before_anybody_asked_is_frozen(robot):
    for at in range(500):
        robot.tick(min(at, 300))
    robot.tally = Tally(SegmentReader(robot.log._present.path))
    for _ in range(400):
        robot.tick(300)
    robot.advance()
    assert int(robot.of("/log/x", "signs")) & FROZEN


def test_rate_and_jitter_follow_the_time_stamps(robot):
    for at in range(400):
        robot.tick(at, count=at // 4)
        robot.advance(at / 100)
    assert robot.of("/log/x", "rate") == pytest.approx(100)
    assert robot.of("/log/count", "rate") == pytest.approx(25)
    assert robot.of("/log/count", "share") == pytest.approx(1)
    assert robot.of("/log/x", "jitter") == pytest.approx(0, abs=1e-9)


def test_nothing_is_called_slow_before_a_whole_window_was_measured(robot):
    for at in range(400):
        robot.tick(at, count=at // 4)
        robot.now_ns += 10_000_000
        robot.advance(at * 0.02)
        slow = [bool(int(robot.of(name, "signs")) & SLOW) for name in ("/log/x", "/log/count")]
        assert slow == [at >= 100] * 2
    assert robot.of("/log/x", "share") == pytest.approx(0.5)


def test_a_loop_that_is_too_slow_gets_a_sign_only_while_it_runs(robot):
    for at in range(400):
        robot.tick(at)
        robot.now_ns += 1_000_000
        robot.advance(at * 0.011)
    assert robot.of("/log/x", "share") == pytest.approx(1 / 1.1)
    assert int(robot.of("/log/x", "signs")) & SLOW
    assert robot.of("/log/x", "signs", running=False) == 0


def test_statistics_begin_where_they_were_asked_for(robot):
    robot.tick(50)
    robot.advance()
    robot.sums = robot.tally.sums()
    robot.tick(2)
    robot.advance()
    assert robot.of("/log/x", "max") == 2


SQUARE = Derived("/log/square", "x * x")
DOUBLE = Derived("/log/double", "2 * x")


def test_statistics_go_on_as_signals_are_derived_and_begin_where_these_are_changed(robot):
    followed = []

    def over(*derived):
        before = robot.tally
        robot.tally = Tally(with_derived_rows(SegmentReader(robot.log._present.path), derived))
        kept = robot.tally.go_on(before)
        robot.sums = robot.sums.moved(robot.tally.count, kept)
        followed.append(len(kept))

    def told(name, *quantities):
        return [robot.of(name, quantity) for quantity in quantities]

    values = [5.0, -2.0, 3.0, 7.0, np.nan, 1.0, 4.0]
    for place, x in enumerate(values):
        robot.tick(x, force=x)
        if place % 2 == 0:
            robot.advance(place)
        if place == 2:
            over(SQUARE)  # with a row that was not read yet
        if place == 4:
            over(SQUARE, DOUBLE)
    robot.advance(9.0)
    assert told("/log/x", "count", "bad", "min", "max", "mean") == [6, 1, -2, 7, 3]
    assert told("/log/force", "count", "bad") == told("/log/x", "count", "bad")
    assert robot.sums.since_ns == 1_000_000_000  # of the first tick
    assert told("/log/square", "count", "max") == [3, 49]  # 49, 1, 16: from where it was derived, on over the next
    assert told("/log/double", "count", "min", "max") == [2, 2, 8]
    over(msgspec.structs.replace(SQUARE, expression="x + x"), DOUBLE)
    robot.tick(6.0)
    robot.advance(10.0)
    assert told("/log/x", "count", "max") == [7, 7]
    assert told("/log/square", "count", "max") == [1, 12]
    assert told("/log/double", "count") == [1]  # it may be computed from what was changed
    over()
    assert told("/log/x", "count") == [7]
    assert followed[-1] == followed[0]


def test_another_run_goes_on_nothing(robot):
    robot.tick(1.0)
    before = robot.tally
    robot.log.restart()
    assert Tally(SegmentReader(robot.log._present.path)).go_on(before) == []


def test_sums_keep_their_digits_far_from_zero():
    sums = RunningStatistics(1)
    values = 1e15 + np.arange(1000.0)
    for part in np.split(values, 10):
        sums.add(slice(0, 1), part[:, None], all_finite=True)
    assert sums.of("std")[0] == pytest.approx(np.arange(1000.0).std(), rel=1e-9)


@pytest.mark.parametrize("parts", [1, 7, 1500, 4000])
def test_noise_is_that_of_second_differences_so_that_what_warms_slowly_has_none(parts):
    sigma, count = 0.02, 4000
    values = np.random.default_rng(5).normal(0.0, sigma, count)
    for slow in (0.0, np.linspace(20.0, 9000.0, count), 5 * np.sin(np.linspace(0, 6, count))):
        sums = RunningStatistics(1)
        for part in np.array_split(values + slow, parts):
            sums.add(slice(0, 1), part[:, None], all_finite=True)
        assert sums.of("noise")[0] == pytest.approx(sigma, rel=0.05), "whatever it lies on"


def test_no_noise_is_measured_over_a_nan():
    sums = RunningStatistics(2)
    for part in ([0.0, 2.0], [0.0, np.nan, 9.0], [11.0, 9.0, np.inf, 1.0]):
        sums.add(slice(0, 1), np.array(part)[:, None], all_finite=False)
    assert sums.of("noise")[0] == pytest.approx(4 / np.sqrt(6)), "twice back by 4"
    assert np.isnan(sums.of("noise")[1]), "no sample"
    assert sums.moved(2, [(slice(0, 1), slice(1, 2))]).of("noise")[1] == sums.of("noise")[0]


def test_signs_leave_out_what_is_not_known():
    nothing = np.array([np.nan])
    yes, no = np.array([True]), np.array([False])
    assert signs_of(yes, nothing, np.array([0.01]), yes, nothing, np.array([0]))[0] == 0
    assert signs_of(no, np.array([9.0]), np.array([0.01]), yes, np.array([0.5]), np.array([3]))[0] == (
        NOT_FINITE | FROZEN | SLOW | LOST
    )


def test_who_asks_for_statistics_is_told_once_that_they_failed_and_begin_anew(robot, monkeypatch):
    advance, fails = Tally.advance, []

    def failing(*words):
        if fails:
            raise ValueError(fails.pop())
        advance(*words)

    robot.log.derive("twice", "2 * x")
    replica = Replica(robot_state(robot.log, "", -1))
    monkeypatch.setattr(replica, "open_watcher", lambda: SegmentReader(robot.log._present.path))
    monkeypatch.setattr(Tally, "advance", failing)
    surveyor, asked = Surveyor(replica), GetSurvey(quantities=["mean"], client="me")
    try:
        for derived in (False, True):
            found = surveyor.answer(msgspec.structs.replace(asked, derived=derived))
            assert len(found.values) // 8 == len(robot.log.elements) + derived
        fails.append("shapes (1,) and (2,)")
        refused = wait_until(lambda: isinstance(answer := answered(lambda: surveyor.answer(asked)), Refused) and answer)
        assert "the statistics failed and begin anew: ValueError: shapes" in refused.text
        assert isinstance(surveyor.answer(asked), Survey)
        askers = (msgspec.structs.replace(asked, client=str(number)) for number in itertools.count())
        answers = (answered(lambda: surveyor.answer(next(askers))) for _ in itertools.count())
        refused = wait_until(lambda: isinstance(answer := next(answers), Refused) and answer)
        assert refused.text == "no survey: 8 clients have statistics; close one first"
    finally:
        surveyor.stop()


def test_statistics_of_a_run_without_a_tick_begin_with_its_first(robot):
    robot.log.restart(unsaved="clear")
    robot.tally = Tally(SegmentReader(robot.log._present.path), whole=True)
    robot.sums = robot.tally.sums(whole=True)
    robot.advance()
    assert robot.sums.since_ns == 0
    robot.now_ns = begin_ns = 10**18
    robot.tick(1.0)
    robot.now_ns += 10**9
    robot.tick(2.0)
    robot.advance()
    assert (robot.sums.since_ns, robot.of("/log/x", "count")) == (begin_ns, 2)


def test_statistics_that_are_asked_for_before_a_start_are_of_the_whole_run(robot, monkeypatch):
    replica = Replica(robot_state(robot.log, "", -1))
    monkeypatch.setattr(replica, "open_watcher", lambda: SegmentReader(robot.log._present.path))
    monkeypatch.setattr(replica, "run", robot.log._present.run.id)
    monkeypatch.setattr("silo.live.statistics.PERIOD_S", 60.0)
    surveyor = Surveyor(replica)
    asked = [GetSurvey(names=["/log/x"], quantities=["count"], client=who) for who in ("me", "you")]

    def counts():
        return [np.frombuffer(surveyor.answer(one).values).tolist() for one in asked]

    try:
        robot.tick(1.0)
        surveyor.answer(asked[0])
        robot.log.restart(unsaved="clear")
        for value in range(3):
            robot.tick(value)
        replica.run = robot.log._present.run.id
        surveyor._round(0.0)
        assert counts() == [[3.0], [0.0]]
        robot.tick(4.0)
        surveyor._round(1.0)
        assert counts() == [[4.0], [1.0]]
    finally:
        surveyor.stop()


def test_a_survey_goes_over_a_stop_with_what_it_knows_of_changes(robot, monkeypatch):
    replica = Replica(robot_state(robot.log, "", -1))
    watched = [robot.log._present]
    monkeypatch.setattr(replica, "open_watcher", lambda: SegmentReader(watched[0].path) if watched else None)
    monkeypatch.setattr(replica, "run", robot.log._present.run.id)
    monkeypatch.setattr("silo.live.statistics.PERIOD_S", 60.0)
    surveyor, asked = Surveyor(replica), GetSurvey(names=["/log/x"], quantities=["signs", "changed"], client="me")

    def told():
        surveyor._round(0.0)
        return np.frombuffer(surveyor.answer(asked).values).tolist()

    try:
        surveyor.answer(asked)
        for at in range(500):
            robot.tick(min(at, 300))
        assert told() == [FROZEN, pytest.approx(1.99)]
        watched.clear()
        replica.run = ""
        told()
        robot.log.restart(unsaved="clear")
        watched.append(robot.log._present)
        replica.run = robot.log._present.run.id
        robot.tick(300)
        assert told() == [FROZEN, pytest.approx(2.0)]
    finally:
        surveyor.stop()


def test_a_nan_among_numbers_is_counted_and_signed_until_ten_seconds_later(robot):
    robot.tick(np.nan)
    for _ in range(9):
        robot.tick(1.0)
    robot.advance()
    assert [robot.of("/log/x", quantity) for quantity in ("bad", "count", "min", "max")] == [1, 9, 1, 1]
    assert int(robot.of("/log/x", "signs")) & NOT_FINITE
    assert not int(robot.of("/log/kept", "signs")) & NOT_FINITE
    for _ in range(1000):
        robot.tick(1.0)
    robot.advance(1.0)
    assert not int(robot.of("/log/x", "signs")) & NOT_FINITE
    assert robot.of("/log/x", "bad") == 1


def test_the_least_and_the_most_are_of_any_entry_of_a_vector(robot):
    robot.tick(5, force=[3, 4, 0])
    robot.tick(6, force=[0, -2, 1])
    robot.advance()
    assert [robot.of("/log/force", quantity) for quantity in ("least", "most")] == [-2, 4]
    assert [robot.of("/log/x", quantity) for quantity in ("least", "most")] == [5, 6]

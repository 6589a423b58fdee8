"""Time stamps: one per tick for all elements, from any clock, and kept by the rules of the original."""

import itertools
import time

import numpy as np
import pytest

from silo.core.elements import BufferType
from silo.errors import ElementError, StateError


def collect(logger, ticks):
    for _ in range(ticks):
        logger.collect()


def times_of(recording, name):
    (element,) = [element for element in recording.elements if element.name == f"/log/{name}"]
    return recording.time_ns[element.stamp_indices].tolist()


@pytest.fixture
def ticking(new_logger):
    """A logger whose clock says 0, 1, 2 ... from its first tick on."""

    def make(**options):
        times = iter(range(-1, 10**9))
        return new_logger(clock=lambda: next(times), **options)

    return make


def test_a_tick_is_stamped_with_the_system_clock(new_logger):
    logger = new_logger()
    logger.array("x")
    logger.start()
    before = time.time_ns()
    logger.collect()
    after = time.time_ns()
    assert before <= logger.snapshot().time_ns[0] <= after


def test_a_clock_of_float_seconds_becomes_nanoseconds(new_logger):
    now = iter([0.0, 1.5, 2.25])
    logger = new_logger(clock=lambda: next(now))
    logger.array("x")
    logger.start()
    collect(logger, 2)
    assert logger.snapshot().time_ns.tolist() == [1_500_000_000, 2_250_000_000]


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_a_clock_of_numpy_seconds_becomes_nanoseconds(new_logger, kind):
    logger = new_logger(clock=lambda: kind(0.5))
    logger.array("x")
    logger.start()
    logger.collect()
    assert logger.snapshot().time_ns.tolist() == [500_000_000]


def test_a_clock_of_numpy_nanoseconds_is_taken_as_it_is(new_logger):
    logger = new_logger(clock=lambda: np.int64(7))
    logger.array("x")
    logger.start()
    logger.collect()
    assert logger.snapshot().time_ns.tolist() == [7]


def test_simulation_time_may_begin_before_zero_and_go_back(new_logger):
    now = iter([0, -5, 3, -(2**62)])
    logger = new_logger(clock=lambda: next(now))
    logger.array("x")
    logger.start()
    collect(logger, 3)
    assert logger.snapshot().time_ns.tolist() == [-5, 3, -(2**62)]


def test_a_clock_that_turns_from_integers_to_floats_is_told_what_is_wrong(new_logger):
    now = iter([0, 0, 0.002])
    logger = new_logger(clock=lambda: next(now))
    logger.array("x")
    logger.start()
    logger.collect()
    with pytest.raises(StateError, match=r"a clock of seconds must return floats from the start: 0\.0, not 0"):
        logger.collect()
    assert logger.ticks == 1


def test_a_clock_that_is_no_clock_is_refused(new_logger):
    with pytest.raises(ElementError, match="clock must return int nanoseconds or float seconds, got None"):
        new_logger(clock=lambda: None)


def test_all_elements_share_the_stamp_of_their_tick(ticking):
    logger = ticking()
    logger.array("a")
    logger.array("b", divider=2, size=3)
    logger.start()
    collect(logger, 7)
    recording = logger.snapshot()
    assert times_of(recording, "a") == [0, 1, 2, 3, 4, 5, 6]
    assert times_of(recording, "b") == [2, 4, 6]


def test_an_element_is_collected_at_ticks_that_its_divider_divides(ticking):
    logger = ticking()
    logger.array("x", divider=3)
    logger.start()
    collect(logger, 8)
    assert times_of(logger.snapshot(), "x") == [0, 3, 6]


def test_the_clock_is_read_once_per_tick(new_logger):
    calls = []
    logger = new_logger(clock=lambda: calls.append(1) or len(calls))
    for name in "abc":
        logger.array(name, divider=2)
    logger.start()
    before = len(calls)
    collect(logger, 5)
    assert len(calls) - before == 5


def test_looping_time_stamps_reach_back_as_far_as_the_longest_element(ticking):
    logger = ticking()
    logger.array("short", size=4)
    logger.array("long", divider=10, size=3)
    logger.start()
    collect(logger, 100)
    recording = logger.snapshot()
    assert recording.time_ns.tolist() == list(range(70, 100))
    assert times_of(recording, "long") == [70, 80, 90]
    assert times_of(recording, "short") == [96, 97, 98, 99]


def test_between_two_samples_a_looping_element_keeps_its_times(ticking):
    logger = ticking()
    logger.array("x", divider=10, size=3)
    logger.start()
    collect(logger, 95)
    assert times_of(logger.snapshot(), "x") == [70, 80, 90]


def test_a_fixed_element_that_filled_early_keeps_its_first_times(ticking):
    logger = ticking(frequency=10, max_time=3)
    logger.array("fixed", buffer=BufferType.FIXED, size=3, divider=2)
    logger.array("looping", size=2)
    logger.start()
    collect(logger, 99)
    recording = logger.snapshot()
    assert len(recording.time_ns) == 30
    assert times_of(recording, "fixed") == [0, 2, 4]
    assert times_of(recording, "looping") == [28, 29]


def test_growing_time_stamps_are_all_kept(ticking):
    logger = ticking(frequency=10, max_time=0)
    logger.array("x", buffer=BufferType.GROWING, size=1)
    logger.start()
    collect(logger, 200_000)  # the second chunk of time stamps begins after 65,536
    assert np.array_equal(logger.snapshot().time_ns, np.arange(200_000))


def test_the_offset_counts_ticks_since_start(ticking):
    logger = ticking()
    logger.array("x", size=5)
    logger.start()
    collect(logger, 42)
    recording = logger.snapshot()
    assert (recording.offset, recording.time_looping) == (42, True)


def test_new_values_carry_the_stamps_of_their_ticks(ticking):
    logger = ticking()
    logger.array("x", divider=4)
    logger.start()
    collect(logger, 9)
    assert logger.read_new_values("x").time_ns.tolist() == [0, 4, 8]


# ------------------------------------------------------------------------------------- clocks of another unit


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (10, "milliseconds as int"),
        (10_000, "microseconds as int"),
        (12, "milliseconds as int"),
        (10.0, "milliseconds as float"),
        (1e4, "microseconds as float"),
        (1e7, "nanoseconds as float"),
    ],
)
def test_a_clock_of_another_unit_is_told_of_at_the_tenth_tick(new_logger, caplog, monkeypatch, step, words):
    ticks, now = itertools.count(), [0]
    monkeypatch.setattr(time, "monotonic_ns", lambda: now[0] * 10_000_000)

    def clock():
        now[0] = next(ticks)
        return step * now[0]

    logger = new_logger(clock=clock)
    logger.start()
    collect(logger, 9)
    assert caplog.text == ""
    logger.collect()
    assert f"it seems to return {words}" in caplog.text
    caplog.clear()
    collect(logger, 50)
    assert caplog.text == ""


@pytest.mark.parametrize("step", [10_000_000, 0.01, 25_000_000, 3_000_000, 1, 100_000, 4_000_000_000, 1e-5])
def test_a_clock_that_is_right_or_only_its_own_is_not_told_of(new_logger, caplog, step):
    times = iter(step * tick for tick in range(100))
    logger = new_logger(clock=lambda: next(times))
    logger.start()
    collect(logger, 60)
    assert caplog.text == ""


@pytest.mark.parametrize("unit", [1, 1.0e-9])
@pytest.mark.parametrize(("frequency", "apart_ns"), [(100, 4_000), (10, 40_000)])
def test_a_loop_without_a_pace_says_nothing_against_a_clock_that_is_right(
    new_logger, caplog, monkeypatch, unit, frequency, apart_ns
):
    ticks = itertools.count(1)
    now = [0]
    monkeypatch.setattr(time, "monotonic_ns", lambda: 5 + now[0])

    def clock():
        now[0] = next(ticks) * apart_ns
        return (10**15 + now[0]) * unit

    logger = new_logger(clock=clock, frequency=frequency)
    logger.start()
    collect(logger, 60)
    assert caplog.text == ""


def test_a_clock_of_whole_seconds_is_told_of_as_soon_as_it_moves(new_logger, caplog):
    times = iter(tick // 100 for tick in range(1000))
    logger = new_logger(clock=lambda: next(times))
    logger.start()
    collect(logger, 400)
    assert "it seems to return seconds as int" in caplog.text


def test_later_ticks_ask_the_clock_alone(new_logger):
    times = iter(range(0, 10**10, 10**7))

    def clock():
        return next(times)

    logger = new_logger(clock=clock)
    logger.start()
    collect(logger, 10)
    assert logger._present.run.collect.__globals__["clock"] is clock

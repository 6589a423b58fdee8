"""Time stamps: one per tick for all elements, from any clock, and kept by the rules of the original."""

import itertools
import time

import numpy as np
import pytest

from silo.core.elements import BufferType
from silo.errors import StateError


def collect(logger, ticks):
    for _ in range(ticks):
        logger.collect()


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


@pytest.mark.parametrize(
    ("times", "stamps"),
    [
        ([np.float64(0.5)] * 2, [500_000_000]),
        ([np.float32(0.5)] * 2, [500_000_000]),
        ([0, -5, 3, -(2**62)], [-5, 3, -(2**62)]),  # a simulation may begin before zero, and go back
    ],
)
def test_what_a_clock_says_becomes_nanoseconds(new_logger, times, stamps):
    logger = new_logger(clock=iter(times).__next__)
    logger.array("x")
    logger.start()
    collect(logger, len(stamps))
    assert logger.snapshot().time_ns.tolist() == stamps


def test_a_clock_that_turns_from_integers_to_floats_is_told_what_is_wrong(new_logger):
    now = iter([0, 0, 0.002])
    logger = new_logger(clock=lambda: next(now))
    logger.array("x")
    logger.start()
    logger.collect()
    with pytest.raises(StateError, match=r"a clock of seconds must return floats from the start: 0\.0, not 0"):
        logger.collect()
    assert logger.ticks == 1


def test_the_clock_is_read_once_per_tick(new_logger):
    calls = []
    logger = new_logger(clock=lambda: calls.append(1) or len(calls))
    for name in "abc":
        logger.array(name, divider=2)
    logger.start()
    before = len(calls)
    collect(logger, 5)
    assert len(calls) - before == 5


def test_growing_time_stamps_are_all_kept(ticking):
    logger = ticking(frequency=10, max_time=0)
    logger.array("x", buffer=BufferType.GROWING, size=1)
    logger.start()
    collect(logger, 200_000)  # the second chunk of time stamps begins after 65,536
    assert np.array_equal(logger.snapshot().time_ns, np.arange(200_000))


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

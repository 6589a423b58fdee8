"""An excitation stays within its bounds, moves as it says, and leaves the value as it was, whatever ends it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

import silo
from silo.core.tuning.excitation import LONGEST_S, MOST_BITS, _check_numbers, ends_of, number_at, steepest
from silo.core.tuning.parameters import Excitation, ParameterInfo, ParameterKind, Wave, Writable, fitting, range_text
from silo.errors import ElementError
from silo.parameters.excited import GONE, TAPS, _prbs, course_of
from silo.parameters.landing import CLOSED, SET, STANDS_STILL
from silo.parameters.parameters import STALLED, Parameters
from silo.parameters.requests import ParametersSet
from silo.parameters.robot import ParameterRobot, ended
from silo.rpc.refusals import RequestRefusedError
from silo.rpc.serving import NOBODY, Sender, Turn

HZ = 1000
CHIRP = Excitation("tau", Wave.CHIRP, 2.0, 8.0, 1.0, 50.0, 0.5)
BAND = {Wave.CHIRP: CHIRP, Wave.MULTISINE: Excitation("tau", Wave.MULTISINE, 2.0, 8.0, 1.0, 50.0, 0.5)}


class Clock:
    """Turned by hand; its ticks are not even."""

    now_ns = 0

    def __call__(self):
        self.now_ns += 1_000_000
        return self.now_ns


@pytest.fixture
def robot(new_logger):
    """A running logger with an input and two gains."""
    logger = new_logger(frequency=HZ, max_time=60, clock=Clock())
    logger.input("tau", min=-5, max=5, unit="Nm", locked=True)
    logger.parameter("kp", 40.0, min=0, max=200, step=0.5, group="legs")
    logger.parameter("kd", 1.0, group="legs", check=lambda kd, group: kd < group["kp"])
    logger.parameter("free", 1e308)
    logger.parameter("fine", 0.0, step=1e-9)
    logger.parameter("count", 2**60 + 1)
    logger.start()
    return logger


def excite(logger, what=CHIRP, name="a", **more):
    return logger.parameters.excite(what, "alice", "shell", name, **{"remote": False, "frequency_hz": HZ, **more})


def turn(logger, seconds):
    for _ in range(round(seconds * HZ)):
        logger.collect()


def values(logger, name="tau"):
    return silo.Log(logger.snapshot())[name].values


def off_by(logger):
    """Turn until the input is far off, and return by how much."""
    while abs(now := float(logger.parameters["tau"])) < 1.5:
        logger.collect()
    return now


def told(logger):
    return logger._present.run.reader.changes(0)


# ------------------------------------------------------------------------------------------------------- what it does


@pytest.mark.parametrize("wave", BAND)
def test_a_band_is_excited_and_hardly_anything_beyond_it_without_a_jump(robot, wave):
    change = excite(robot, BAND[wave])
    turn(robot, 9)
    applied = values(robot)
    assert (applied[: change.tick] == 0).all()
    assert (applied[change.excited.until :] == 0).all()
    assert 1.9 < np.abs(applied).max() <= 2.0
    assert np.abs(np.diff(applied)).max() <= steepest(BAND[wave]) / HZ * (1 + 1e-9)
    power = np.abs(np.fft.rfft(applied)) ** 2
    hz = np.fft.rfftfreq(len(applied), 1 / HZ)
    assert power[(hz > 0.8) & (hz < 55)].sum() > 0.99 * power.sum()
    octaves = [power[(hz >= low) & (hz < 2 * low)].sum() for low in (2, 4, 8, 16)]
    assert max(octaves) < 3 * min(octaves)  # about as much in each


@pytest.mark.parametrize("high_hz", [50.0, 1.0])
def test_a_chirp_begins_at_zero_and_turns_as_often_as_its_frequency_says(high_hz):
    what = replace(CHIRP, high_hz=high_hz, ramp_s=0.0)
    at_s = np.linspace(0.0, what.duration_s, 80_000, endpoint=False)
    hz = what.low_hz * (high_hz / what.low_hz) ** (at_s / what.duration_s)
    turns = np.concatenate([[0.0], np.cumsum((hz[1:] + hz[:-1]) / 2 * np.diff(at_s))])
    found = [course_of(what)(each) for each in at_s.tolist()]
    np.testing.assert_allclose(found, what.amplitude * np.sin(2 * np.pi * turns), atol=1e-3)


def test_a_prbs_goes_to_both_ends_as_often_and_changes_with_its_bits_alone(robot):
    excite(robot, Excitation("tau", Wave.PRBS, 2.0, 8.0, 0.0, 50.0))
    turn(robot, 9)
    applied = values(robot)
    assert set(applied.tolist()) == {-2.0, 0.0, 2.0}
    assert abs(applied.mean()) < 0.2
    changes = np.flatnonzero(np.diff(applied))[1:]
    assert set(np.diff(changes) % 20) == {0}
    assert 100 < len(changes) < 300  # of 400 bits


def test_a_step_jumps_and_with_a_ramp_it_rises(robot):
    excite(robot, Excitation("tau", Wave.STEP, -3.0, 1.0))
    turn(robot, 1.5)
    excite(robot, Excitation("tau", Wave.STEP, 3.0, 1.0, ramp_s=0.25), "b")
    turn(robot, 1.5)
    applied = values(robot)
    assert set(applied[:1500].tolist()) == {0.0, -3.0}
    assert applied[1500:].max() == 3.0
    assert np.abs(np.diff(applied[1500:])).max() == pytest.approx(3.0 / 250)


def test_a_gain_goes_in_its_steps_as_fast_as_it_may_and_comes_back(new_logger):
    logger = new_logger(frequency=HZ, clock=Clock())
    logger.parameter("kp", 40.0, min=0, max=200, step=0.5, rate=100.0)
    logger.start()
    excite(logger, Excitation("kp", Wave.PRBS, 1.8, 2.0, 0.0, 10.0))
    seen = []
    for _ in range(2100):
        logger.collect()
        seen.append(float(logger.parameters["kp"]))
    assert set(seen) == {38.5 + place / 2 for place in range(7)}
    assert np.abs(np.diff(seen)).max() == 0.5
    assert seen[-1] == 40.0


def test_one_value_of_an_array_is_excited(new_logger):
    logger = new_logger(frequency=HZ, clock=Clock())
    logger.input("tau", -5, 5, 3)
    logger.start()
    excite(logger, Excitation("tau", Wave.STEP, 3.0, 0.5, index=1))
    turn(logger, 0.2)
    assert logger.parameters["tau"].value.tolist() == [0.0, 3.0, 0.0]
    turn(logger, 0.5)
    assert logger.parameters["tau"].value.tolist() == [0.0, 0.0, 0.0]


def test_its_begin_has_all_of_its_numbers_and_its_end_why_also_in_a_file(robot):
    change = excite(robot)
    turn(robot, 9)
    log = silo.open_log(robot.save().path)
    begin, end = log.parameters.changes
    assert begin.change.excitation == Excitation("/log/tau", Wave.CHIRP, 2.0, 8.0, 1.0, 50.0, 0.5)
    assert begin.text == ("tau excited around 0.0 Nm: chirp 1 to 50 Hz, amplitude 2, for 8 s, ramps of 0.5 s (shell)")
    assert (begin.tick, begin.who, end.tick) == (change.tick, "alice", change.excited.until)
    assert end.text == "tau 0.0 -> 0.0 Nm (excitation ended: it is over)"
    assert log["tau"].divider == 1


def test_nothing_waits_for_the_loop_before_and_after(robot):
    waiting = robot.parameters.landing.waiting
    excite(robot)
    assert len(waiting) == 1
    turn(robot, 9)
    assert not waiting


# --------------------------------------------------------------------------------------------------------- how it ends


def lease_over(robot, change):
    change.excited.monotonic = lambda: math.inf


def stopped(robot, change):
    robot.parameters.excitations.stop("", "the key")


def locked(robot, change):
    robot.parameters.lock()


def run_over(robot, change):
    robot.stop()


def next_run(robot, change):
    robot.restart()


@pytest.mark.parametrize(
    ("end", "why"),
    [(lease_over, GONE), (stopped, "the key"), (locked, CLOSED), (run_over, STANDS_STILL), (next_run, STANDS_STILL)],
)
def test_what_ends_it_brings_the_value_back_at_once_without_a_jump(robot, end, why):
    change = excite(robot)
    before = off_by(robot)
    end(robot, change)
    seen = [before]
    for _ in range(300):
        robot.collect()
        seen.append(float(robot.parameters["tau"]))
    assert np.abs(np.diff(seen)).max() <= abs(before) / 250 * (1 + 1e-6)
    assert seen[251:] == [0.0] * 50
    assert change.excited.ended == why
    assert not robot.parameters.landing.waiting


def test_a_gain_goes_as_far_as_asked_and_comes_back_from_there_in_a_straight_line(robot):
    change = excite(robot, Excitation("kp", Wave.STEP, -1.5, 8.0, ramp_s=0.25))
    turn(robot, 1)
    assert float(robot.parameters["kp"]) == 38.5
    stopped(robot, change)
    turn(robot, 0.13)
    assert float(robot.parameters["kp"]) == 39.5  # half-way, in its steps
    turn(robot, 0.2)
    assert float(robot.parameters["kp"]) == 40.0


@pytest.mark.parametrize("by_client", [False, True])
def test_who_sets_the_value_has_the_last_word(robot, by_client):
    change = excite(robot, Excitation("kp", Wave.CHIRP, 2.0, 8.0, 1.0, 50.0, 0.5))
    turn(robot, 2)
    if by_client:
        robot.parameters.request({"kp": 50.0}, "bob", "shell", "b", remote=False)
    else:
        robot.parameters["kp"].value = 50.0
    turn(robot, 0.002)
    assert change.excited.ended == SET
    turn(robot, 1)
    assert float(robot.parameters["kp"]) == 50.0
    assert told(robot)[-1].text == "kp 50.0 -> 50.0 (excitation ended: somebody set it)"


def test_the_program_ends_it_by_setting_its_input_to_zero_and_sets_it_to_nothing_else(robot):
    excite(robot)
    off_by(robot)
    with pytest.raises(ElementError, match="an input is 0 unless it is excited"):
        robot.parameters["tau"].value = 1.0
    robot.parameters.reset()
    turn(robot, 1)
    assert float(robot.parameters["tau"]) == 0.0


def test_a_loop_that_stands_still_gets_its_value_back_from_the_link_thread(robot):
    change = excite(robot)
    off_by(robot)
    robot.parameters.excitations.look(HZ)
    assert float(robot.parameters["tau"])
    change.excited.went_s = -math.inf
    robot.parameters.excitations.look(HZ)
    assert (float(robot.parameters["tau"]), change.excited.ended) == (0.0, STALLED)
    turn(robot, 1)
    assert float(robot.parameters["tau"]) == 0.0
    assert STALLED in told(robot)[-1].text


def test_what_nobody_kept_before_its_first_tick_never_begins(robot):
    change = excite(robot)
    lease_over(robot, change)
    turn(robot, 0.01)
    assert change.refused == GONE
    assert not values(robot).any()


def test_a_client_is_answered_what_became_of_what_it_asked(robot):
    served = ParameterRobot(robot.parameters, HZ)
    asked = served.set_parameters(NOBODY, {"kp": 50.0}, "", 0.0, remote=False)
    assert asked == ParametersSet(asked.name, waits=True)
    assert "waits for a tick" in asked.text
    robot.collect()
    found = ended(robot.parameters, asked.name)
    assert (found, found.text) == (ParametersSet(asked.name, 1), "it holds from tick 1 on")
    assert ParametersSet("a", 0).text == "it holds from tick 0 on"
    assert ParametersSet("a").text == "it holds; the logger stands still"
    begun = served.excite(NOBODY, CHIRP, "b", remote=False)
    assert (begun.at_s, begun.tick, begun.ended, begun.until) == (0.0, -1, "", -1)
    turn(robot, 1)
    excited = robot.parameters.excitations.known["b"].excited
    excited.kept_s = -math.inf
    kept = served.keep_excitation("b")
    assert (kept.at_s, kept.tick, kept.ended, excited.kept_s > 0) == (pytest.approx(0.999), 2, "", True)
    assert served.stop_excitation(NOBODY, "", "") == "it goes back"
    turn(robot, 1)
    assert served.stop_excitation(NOBODY, "b", "") == "nothing is excited"
    over = served._excitation("b")
    assert (over.ended, over.until) == ("stopped by nobody", excited.until)


@pytest.mark.parametrize("jump_s", [-3600, 60])
def test_it_goes_back_though_the_clock_of_the_logger_is_set(new_logger, jump_s):
    clock = Clock()
    logger = new_logger(frequency=HZ, max_time=60, clock=clock)
    logger.input("tau", min=-5, max=5)
    logger.start()
    change = excite(logger, Excitation("tau", Wave.STEP, 1.0, 600.0, ramp_s=0.5))
    turn(logger, 1)
    assert float(logger.parameters["tau"]) == 1.0
    clock.now_ns += jump_s * 10**9
    logger.parameters.excitations.stop("a", "stopped by alice")
    turn(logger, 1)
    assert (float(logger.parameters["tau"]), change.excited.ended) == (0.0, "stopped by alice")


def test_what_can_not_go_on_ends_and_leaves_what_was_before(robot, monkeypatch):
    change = excite(robot)
    turn(robot, 0.3)
    monkeypatch.setattr(change.excited, "course", lambda at_s: 1 / 0)
    turn(robot, 0.01)
    assert (float(robot.parameters["tau"]), change.excited.ended) == (0.0, "it can't be done: division by zero")
    assert not robot.parameters.landing.waiting


@pytest.mark.parametrize(("who", "why"), [("carol (proven)", "stopped by carol (proven)"), ("", "limit: q is high")])
def test_why_it_ended_is_said_by_the_helper_process_alone(robot, who, why):
    served = ParameterRobot(robot.parameters, HZ)
    served.excite(NOBODY, CHIRP, "b", remote=False)
    turn(robot, 1)
    served.stop_excitation(Turn(Sender("", who)), "", "limit: q is high")
    turn(robot, 1)
    assert served._excitation("b").ended == why
    lease_over(robot, excite(robot, name="c"))
    turn(robot, 0.01)
    assert served._excitation("c").ended == GONE
    robot.parameters.request({"kp": 60.0}, "bob", "shell", "d", remote=False)
    robot.parameters["kp"].value = 55.0
    robot.collect()
    with pytest.raises(RequestRefusedError, match="; nothing was changed"):
        ended(robot.parameters, "d")


# ----------------------------------------------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    ("what", "words"),
    [
        (Excitation("tau", Wave.CHIRP, 5.5, 8.0, 1.0, 50.0), "parameter '/log/tau': 0.0 with an amplitude of 5.5 goes "
         "from -5.5 to 5.5, it takes -5 to 5: an amplitude of at most 5 fits; nothing was changed"),
        (Excitation("kp", Wave.STEP, -41.0, 8.0), "parameter '/log/legs/kp': 40.0 with an amplitude of -41 goes from -1"
         " to 40, it takes 0 to 200 in steps of 0.5: an amplitude of at most 40 fits; nothing was changed"),
        (Excitation("tau", Wave.CHIRP, 1.0, 8.0, 1.0, 401.0),
         "401 Hz is too fast for a loop of 1000 Hz: up to 400 Hz; nothing was changed"),
        (Excitation("tau", Wave.CHIRP, 1.0, 8.0, 20.0, 10.0),
         "frequencies go up from 0.0001 Hz or more, as 0.1-20Hz, got 20 to 10 Hz"),
        (Excitation("tau", Wave.CHIRP, 1.0, 8.0, 5e-324, 10.0),
         "frequencies go up from 0.0001 Hz or more, as 0.1-20Hz, got 4.94066e-324 to 10 Hz"),
        (Excitation("tau", Wave.CHIRP, 1.0, 8.0, 1.0, 10.0, 5.0), "ramps take 0 to half of its 8 s, got 5 s"),
        (Excitation("tau", Wave.STEP, math.nan, 8.0),
         "an amplitude is a number other than 0, got nan; nothing was changed"),
        (Excitation("tau", Wave.STEP, 1.0, 0.0), "it lasts more than 0 and up to 3600 s, got 0 s"),
        (Excitation("tau", Wave.PRBS, 1.0, 80.0, 0.0, 820.0),
         "a PRBS has a rate above 0, and up to 65536 bits: got 820 bit/s"),
        *[(Excitation(name, Wave.STEP, by, 8.0),
           f"parameter '/log/{name}': around {value} it can't be excited by {by:g}; nothing was changed")
          for name, value, by in [("free", "1e+308", 1.7e308), ("fine", "0", 1e300), ("count", "1.15292e+18", 1.0)]],
        (Excitation("tau", Wave.STEP, 1.0, 8.0, index=1),
         "parameter '/log/tau': it has the values 0 to 0, not 1; nothing was changed"),
        *[(what, "parameter '/log/legs/kd': its check refuses it; nothing was changed")
          for what in (Excitation("kd", Wave.STEP, 40.0, 8.0), Excitation("kp", Wave.CHIRP, 39.5, 8.0, 1.0, 10.0))],
        (Excitation("kx", Wave.STEP, 1.0, 8.0),
         "no parameter 'kx'; there are 6: /log/tau, /log/legs/kp, /log/legs/kd, /log/free, /log/fine"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused_as_a_whole(robot, what, words):
    with pytest.raises(ElementError) as refused:
        excite(robot, what)
    assert str(refused.value) == words
    assert not robot.parameters.landing.waiting


def test_it_is_refused_where_something_else_goes_on(robot):
    with pytest.raises(ElementError, match="set on the robot alone"):
        excite(robot, remote=True)
    robot.parameters.request({"kp": 50.0}, "bob", "shell", "c", remote=False, revert_s=60)
    with pytest.raises(ElementError, match="on its way"):
        excite(robot, Excitation("kp", Wave.STEP, 1.0, 8.0))
    turn(robot, 0.01)
    with pytest.raises(ElementError, match="confirm it first"):
        excite(robot, Excitation("kp", Wave.STEP, 1.0, 8.0))
    first = excite(robot)
    assert excite(robot) is first  # asked twice by one name
    for other in (CHIRP, Excitation("kp", Wave.STEP, 1.0, 8.0)):
        with pytest.raises(ElementError, match="excited by alice: one at a time"):
            excite(robot, other, name="b")
    robot.parameters.lock()
    with pytest.raises(ElementError, match="closed it for now"):
        excite(robot, name="b")
    robot.stop()
    turn(robot, 1)
    robot.parameters.unlock()
    with pytest.raises(ElementError, match="stands still"):
        excite(robot, name="b")


def test_while_a_value_swings_its_group_is_checked_for_both_ends(robot):
    excite(robot, Excitation("kp", Wave.CHIRP, 20.0, 8.0, 1.0, 10.0))
    turn(robot, 1)
    with pytest.raises(ElementError, match="'/log/legs/kd': its check refuses it"):
        robot.parameters.request({"kd": 30.0}, "bob", "shell", "b", remote=False)
    robot.parameters["kd"].value = 2.0  # what landed after it began is no reason to refuse
    robot.parameters.request({"kd": 15.0}, "bob", "shell", "c", remote=False)
    turn(robot, 1)
    assert float(robot.parameters["kd"]) == 15.0


NUMBERS = st.floats(-100, 100)


@given(
    st.sampled_from([ParameterKind.FLOAT, ParameterKind.INT]),
    st.integers(-20, 20), NUMBERS, st.integers(0, 30), st.integers(0, 30), st.sampled_from([None, 1.0, 2.0]),
    st.sampled_from([None, 5.0, 500.0]), st.sampled_from(Wave), st.floats(0.1, 40), st.floats(0, 0.5),
)  # fmt: skip
def test_no_value_ever_stands_that_would_be_refused(kind, default, amplitude, down, up, step, rate, wave, high, ramp):
    info = ParameterInfo(
        "/log/x", kind, default, (), default - down * (step or 1.0), default + up, step, rate=rate,
        writable=Writable.ANYWHERE,
    )  # fmt: skip
    parameters = Parameters()
    made, landing = parameters.declare(info, None, None), parameters.landing
    landing.next_row = lambda: 0
    what = Excitation("x", wave, amplitude, 1.0, 0.1, high, ramp)
    try:
        low, high_end = (number_at(end, 0) for end in ends_of(made.info, what))
        change = parameters.excite(what, "", "", "a", remote=False, frequency_hz=100)
    except ElementError:
        return
    before = default
    tick = 0
    while landing.waiting:
        landing.land(tick, tick * 10_000_000)
        now = made.value
        fitting(made.info, now)
        assert low - 1e-9 <= now <= high_end + 1e-9
        assert rate is None or step or kind is ParameterKind.INT or abs(now - before) <= rate * 0.01 * (1 + 1e-9)
        before, tick = now, tick + 1
        assert tick < 5000
    assert change.landed
    assert made.value == default


# ------------------------------------------------------------------------------------------------------ small parts


@pytest.mark.parametrize("stages", TAPS)
def test_the_bits_of_a_prbs_come_again_only_after_all_of_its_states(stages):
    period = 2**stages - 1
    course = _prbs(Excitation("tau", Wave.PRBS, 1.0, period - 2.0, 0.0, 1.0))  # a bit a second
    bits = np.array([course(float(second)) for second in range(2 * period)]) > 0
    np.testing.assert_array_equal(bits[:period], bits[period:])
    assert bits[:period].sum() == 2 ** (stages - 1)
    states = sum(bits[place : place + period].astype(int) << place for place in range(stages))
    assert len(np.unique(states)) == period


@pytest.mark.parametrize(
    "what",
    [
        replace(CHIRP, ramp_s=0.0),
        replace(CHIRP, ramp_s=4.0),
        replace(CHIRP, duration_s=LONGEST_S),
        Excitation("tau", Wave.PRBS, 1.0, 1.0, 0.0, float(MOST_BITS)),
    ],
)
def test_what_is_just_within_the_bounds_is_taken(what):
    _check_numbers(what)


@pytest.mark.parametrize(
    ("bounds", "words"),
    [
        ({}, "any number"),
        ({"kind": ParameterKind.INT}, "a whole number"),
        ({"minimum": 2.0}, "from 2"),
        ({"maximum": 5.0, "step": 0.5}, "up to 5 in steps of 0.5"),
        ({"minimum": 2.0, "maximum": 5.0}, "2 to 5"),
        ({"minimum": 0.00012345678, "maximum": 1000.00049}, "0.00012345678 to 1000.00049"),
    ],
)
def test_a_range_is_told_by_the_bounds_it_has(bounds, words):
    assert range_text(ParameterInfo("kp", **{"kind": ParameterKind.FLOAT, "default": 3.0, **bounds})) == words

"""Changes of clients land whole at the end of a tick, and are recorded with the tick from which they held."""

import threading
import time

import numpy as np
import pytest

import silo
from silo.analysis.parameters import LoggedParameters
from silo.analysis.ramps import Arrival, TunedSamples
from silo.core.elements import LoggedEvent
from silo.core.recording import MOST_EVENTS, with_events
from silo.core.tuning.parameters import Excitation, ParameterChange, ParameterInfo, ParameterKind, Wave
from silo.errors import ElementError
from silo.logger.current_run import CurrentRun
from silo.parameters.landing import between
from silo.parameters.parameters import MOST_ENDS, MOST_REVERTS, MOST_WAITING
from silo.segment.parameter_changes import AREA_BYTES, ChangeRecord, image_bytes, read_changes
from tests.waiting import wait_until


class Clock:
    """Turned by hand."""

    now_ns = 0

    def __call__(self):
        self.now_ns += 10_000_000
        return self.now_ns


@pytest.fixture
def tuned(new_logger):
    """A running logger of two gains and what asks for changes: `tuned.ask({"kp": 1.0})`."""
    logger = new_logger(frequency=100, clock=Clock(), max_time=60)
    logger.parameter("kp", 40.0, min=0, max=200, group="legs", locked=True)
    logger.parameter("height", 0.3, min=0.1, max=0.5, rate=1.0)  # per second: 0.01 a tick
    logger.parameter("kd", 1.0, group="legs")
    logger.start()
    return logger


def ask(logger, values, name="", **more):
    return logger.parameters.request(values, "alice", "shell", name, **{"remote": False, **more})


def read(logger):
    return {name.rpartition("/")[2]: value for name, value in logger.parameters.read().items()}


def told(logger):
    return [
        (event.tick, event.who, {name: (old, new) for name, old, new in event.change.values})
        for event in logger._present.run.reader.changes()
    ]


def test_a_change_waits_for_the_end_of_the_tick_and_holds_from_the_next_row_on(tuned):
    tuned.collect()
    change = ask(tuned, {"kp": 50.0, "kd": 2.0})
    assert read(tuned)["kp"] == 40.0
    tuned.collect()
    assert (read(tuned)["kp"], read(tuned)["kd"]) == (50.0, 2.0)
    assert change.tick == tuned.ticks == 2  # the index of the next row
    assert told(tuned)[-1] == (2, "alice", {"/log/legs/kp": (40.0, 50.0), "/log/legs/kd": (1.0, 2.0)})


def test_the_record_begins_with_what_all_were_and_tells_what_it_really_was_before(tuned):
    ask(tuned, {"kp": 50.0})
    tuned.parameters["kp"].value = 45.0
    tuned.collect()
    image, own, asked = told(tuned)
    assert image[2]["/log/legs/kp"] == (None, 40.0)
    assert own == (0, tuned.name, {"/log/legs/kp": (40.0, 45.0)})
    assert asked == (1, "alice", {"/log/legs/kp": (45.0, 50.0)})


def test_what_comes_while_another_thread_notes_a_change_waits_for_nobody_and_is_noted_as_it_lands(tuned):
    asks = threading.Thread(target=lambda: ask(tuned, {"kp": 50.0}), daemon=True)
    with tuned.parameters.landing._recording:
        asks.start()
        asks.join(30)
        assert not asks.is_alive()
    tuned.collect()
    assert told(tuned)[-1] == (1, "alice", {"/log/legs/kp": (40.0, 50.0)})


def test_a_start_waits_for_nobody_who_notes_a_change_elsewhere(tuned):
    landing = tuned.parameters.landing
    infos, area = landing.described(), bytearray(AREA_BYTES)
    record = ChangeRecord(memoryview(area), memoryview(bytearray(image_bytes(infos))), infos)
    tuned.parameters["kp"].value = 45.0  # while the loop turned
    begins = threading.Thread(target=lambda: landing.begin_run(record, lambda: 0), daemon=True)
    with landing._recording:  # of a thread that a signal handler has interrupted, which waits for the start
        begins.start()
        begins.join(30)
        assert not begins.is_alive()
    (late,) = read_changes(np.frombuffer(area, np.uint64), 0, infos, "bot", "1")
    assert (late.tick, late.change.values) == (0, (("/log/legs/kp", 40.0, 45.0),))


def test_what_waits_when_the_next_run_starts_lands_in_it_and_is_recorded_there(tuned):
    ask(tuned, {"kp": 50.0})
    tuned.restart()
    assert read(tuned)["kp"] == 40.0
    tuned.collect()
    assert told(tuned)[-1] == (1, "alice", {"/log/legs/kp": (40.0, 50.0)})


def test_before_the_start_and_while_stopped_a_change_lands_at_a_collect_that_logs_nothing(new_logger):
    logger = new_logger()
    logger.parameter("kp", 40.0)
    change = ask(logger, {"kp": 50.0})
    logger.collect()
    assert (change.landed, change.tick, read(logger)["kp"]) == (True, -1, 50.0)
    logger.start()
    assert told(logger)[0][2] == {"/log/kp": (None, 50.0)}


def test_the_values_stay_across_runs(tuned):
    tuned.parameters["kp"].value = 77.0
    tuned.restart()
    assert told(tuned)[0][2]["/log/legs/kp"] == (None, 77.0)


def test_a_lock_closes_what_is_declared_so_also_for_what_waits_and_not_for_the_program(tuned):
    waits = ask(tuned, {"kp": 50.0})
    tuned.parameters.lock()
    tuned.collect()
    assert "closed it for now" in waits.refused
    with pytest.raises(ElementError, match="closed it for now"):
        ask(tuned, {"kp": 60.0})
    ask(tuned, {"kd": 3.0})
    tuned.collect()
    tuned.parameters["kp"].value = 55.0
    assert (read(tuned)["kp"], read(tuned)["kd"]) == (55.0, 3.0)
    tuned.parameters.unlock()
    ask(tuned, {"kp": 60.0})
    assert all("50.0" not in str(one) for one in told(tuned))


def test_a_ramp_goes_so_fast_by_the_stamps_and_all_of_a_change_arrive_at_once(tuned):
    ask(tuned, {"height": 0.4, "kp": 50.0})
    tuned.collect()
    tuned.collect()
    assert (read(tuned)["height"], read(tuned)["kp"]) == (pytest.approx(0.31), pytest.approx(41.0))
    for _ in range(20):
        tuned.collect()
    assert (read(tuned)["height"], read(tuned)["kp"]) == (0.4, 50.0)
    (event,) = [event for event in tuned._present.run.reader.changes() if event.who == "alice"]
    assert (event.tick, event.change.until) == (1, 11)


def test_what_the_program_sets_ends_a_ramp(tuned):
    ask(tuned, {"height": 0.4})
    tuned.collect()
    tuned.collect()
    tuned.parameters["height"].value = 0.2
    tuned.collect()
    assert read(tuned)["height"] == 0.2
    assert not tuned.parameters.landing.waiting


def test_a_clock_that_goes_back_holds_a_ramp(new_logger):
    clock = Clock()
    logger = new_logger(clock=clock)
    logger.parameter("height", 0.0, rate=1.0)
    logger.start()
    ask(logger, {"height": 1.0})
    for _ in range(11):
        logger.collect()
    clock.now_ns = 0
    logger.collect()
    assert read(logger)["height"] == pytest.approx(0.1)


def test_a_change_whose_partner_the_program_changed_after_the_check_is_refused(new_logger):
    logger = new_logger()
    logger.parameter("kp", 40.0, check=lambda value, group: value > group["kd"])
    logger.parameter("kd", 1.0)
    logger.start()
    first, second = ask(logger, {"kp": 5.0}), ask(logger, {"kp": 6.0})
    logger.parameters["kd"].value = 4.0
    logger.collect()
    assert "meanwhile" in first.refused
    assert "meanwhile" in second.refused
    ask(logger, {"kp": 6.0})
    logger.collect()
    assert read(logger)["kp"] == 6.0


def test_a_check_sees_the_values_as_they_will_be(new_logger):
    logger = new_logger()
    logger.parameter("kp", 40.0, check=lambda value, group: value > group["kd"])
    logger.parameter("kd", 1.0)
    logger.start()
    ask(logger, {"kd": 30.0})
    with pytest.raises(ElementError, match="its check refuses it"):
        ask(logger, {"kp": 20.0})
    ask(logger, {"kp": 31.0})
    logger.collect()
    assert read(logger) == {"kp": 31.0, "kd": 30.0}


def test_more_than_so_many_that_wait_are_told_to_come_again(tuned):
    for _ in range(MOST_WAITING):
        ask(tuned, {"kd": 2.0})
    with pytest.raises(ElementError, match="wait for a tick already: try again"):
        ask(tuned, {"kd": 2.0})
    tuned.collect()
    ask(tuned, {"kd": 2.0})


def test_a_change_that_is_asked_for_twice_under_one_name_is_done_once_and_its_end_is_remembered(tuned):
    first = ask(tuned, {"kd": 2.0}, "a")
    tuned.collect()
    assert ask(tuned, {"kd": 3.0}, "a") is first
    assert tuned.parameters.end_of("a").tick == 1
    for number in range(MOST_ENDS):
        ask(tuned, {"kd": 2.0}, str(number))
        tuned.collect()
    assert tuned.parameters.end_of("a") is None


@pytest.mark.parametrize(
    ("writable", "remote", "words"),
    [
        (False, False, "the program alone sets it"), ("anywhere", True, ""),
        (True, True, 'it is set on the robot alone (writable="anywhere" lets others)'),
    ],
)  # fmt: skip
def test_whose_changes_are_taken_is_what_the_program_says(new_logger, writable, remote, words):
    logger = new_logger()
    logger.parameter("kp", 40.0, writable=writable)
    if not words:
        ask(logger, {"kp": 50.0}, remote=remote)
        return
    with pytest.raises(ElementError) as refused:
        ask(logger, {"kp": 50.0}, remote=remote)
    assert str(refused.value) == f"parameter '/log/kp': {words}; nothing was changed"


def test_what_nobody_confirms_is_taken_back_as_far_as_nobody_changed_it_since(tuned):
    ask(tuned, {"kp": 50.0, "kd": 2.0}, "a", revert_s=1e-9)
    tuned.collect()
    tuned.parameters["kd"].value = 3.0
    tuned.parameters.revert_due()
    tuned.collect()
    assert (read(tuned)["kp"], read(tuned)["kd"]) == (40.0, 3.0)


def test_so_many_changes_wait_to_be_confirmed_and_no_more(tuned):
    for number in range(MOST_REVERTS):
        ask(tuned, {"kp": number % 100}, f"change {number}", revert_s=3600)
        tuned.collect()
    with pytest.raises(ElementError, match=r"wait to be confirmed already.*nothing was changed"):
        ask(tuned, {"kp": 7.0}, "one more", revert_s=3600)
    ask(tuned, {"kp": 8.0})
    assert tuned.parameters.confirm(f"change {MOST_REVERTS - 1}")
    ask(tuned, {"kp": 9.0}, "now", revert_s=3600)


def test_what_nobody_confirms_is_taken_back_also_where_it_came_late_or_the_program_had_closed_it(tuned):
    ask(tuned, {"kp": 50.0}, "a", revert_s=1e-9)
    tuned.parameters.revert_due()  # no tick came in time
    tuned.collect()
    tuned.parameters.lock()
    for _ in range(2):
        tuned.parameters.revert_due()
        tuned.collect()
    assert read(tuned)["kp"] == 50.0  # the program's phase isn't disturbed
    tuned.parameters.unlock()
    wait_until(lambda: tuned.parameters.next_revert_s() < time.monotonic())
    tuned.parameters.revert_due()
    tuned.collect()
    assert read(tuned)["kp"] == 40.0
    wait_until(lambda: tuned.parameters.next_revert_s() < time.monotonic())
    tuned.parameters.revert_due()
    assert tuned.parameters.next_revert_s() is None
    assert [change["/log/legs/kp"] for _, _, change in told(tuned) if "/log/legs/kp" in change] == [
        (None, 40.0), (40.0, 50.0), (50.0, 40.0),
    ]  # fmt: skip


def test_what_is_confirmed_stays(tuned):
    ask(tuned, {"kp": 50.0}, "a", revert_s=1e-9)
    tuned.collect()
    assert tuned.parameters.confirm("a")
    tuned.parameters.revert_due()
    tuned.collect()
    assert read(tuned)["kp"] == 50.0


class Interrupt:
    """A record whose change is interrupted once, at its last step."""

    is_overwritten = False

    def __init__(self, slot):
        self.slot, self.done = slot, False

    def land(self, tick, old):
        self.slot.land(tick, old)
        if not self.done:
            self.done = True
            raise KeyboardInterrupt

    def end(self, tick):
        self.slot.end(tick)


def test_an_interrupt_while_a_change_lands_leaves_it_waiting_and_the_row_whole(tuned):
    change = ask(tuned, {"kp": 50.0})
    change.slot = Interrupt(change.slot)
    with pytest.raises(KeyboardInterrupt):
        tuned.collect()
    assert tuned.ticks == 1
    tuned.collect()
    assert told(tuned)[-1] == (2, "alice", {"/log/legs/kp": (40.0, 50.0)})
    assert read(tuned)["kp"] == 50.0


def test_a_change_that_waits_is_in_no_record(tuned):
    ask(tuned, {"kp": 50.0})
    assert len(told(tuned)) == 1


@pytest.mark.parametrize("kind", ["silo", "csv", "bag"])
def test_a_file_tells_what_held_at_a_time_and_who_changed_it(tuned, kind):
    tuned.collect()
    ask(tuned, {"kp": 50.0, "kd": 2.0})
    for _ in range(5):
        tuned.collect()
    tuned.parameters["kp"].value = 60.0
    tuned.collect()
    log = silo.open_log(tuned.save(kind).path)
    held = [log.parameters.at(time_s)["/log/legs/kp"] for time_s in (0.0, 0.015, 0.02, 0.055, 0.06, 99.0)]
    assert held == [40.0, 40.0, 50.0, 50.0, 60.0, 60.0]
    assert next((event.tick, event.who) for event in log.parameters.changes) == (2, "alice")


def test_of_a_time_that_is_there_twice_the_parameters_are_those_that_were_last(new_logger):
    now = [0]
    logger = new_logger(frequency=100, clock=lambda: now[0])
    kp = logger.parameter("kp", 0.0)
    logger.start()
    for number in range(3):
        for tick in range(20):
            now[0] = tick * 10_000_000
            if tick == 10:
                kp.value = float(number)
            logger.collect()
    log = silo.Log(logger.snapshot())
    assert [log.parameters.at(time_s)["/log/kp"] for time_s in (0.0, 0.095, 0.1, 5.0)] == [1.0, 1.0, 2.0, 2.0]


class Ramps:
    """A run of 100 Hz, and what its parameters were at each tick as the program saw them; they are logged at 10 Hz."""

    def __init__(self, logger):
        self.logger, self.saw = logger, []
        self.slow = logger.parameter("slow", 0.0, rate=1.0, group="leg", locked=True)
        self.with_it = [logger.parameter("on", False, group="leg"), logger.parameter("n", 0, group="leg")]
        logger.start()

    def ticks(self, count):
        for _ in range(count):
            self.saw.append((self.slow.value, *(one.value for one in self.with_it)))
            self.logger.collect()

    def told(self):
        log = silo.open_log(self.logger.save("silo").path)
        held = (log.parameters.at(time_s) for time_s in log.times)
        return [tuple(one[f"/log/leg/{name}"] for name in ("slow", "on", "n")) for one in held], log


def test_a_ramp_is_on_its_way_at_a_time_and_all_that_was_set_with_it(new_logger):
    ramps = Ramps(new_logger(frequency=100, clock=Clock()))
    ramps.ticks(7)
    ask(ramps.logger, {"slow": 0.5, "on": True, "n": 40})  # over within the run
    ramps.ticks(70)
    ask(ramps.logger, {"slow": 0.0, "n": 0})
    ramps.ticks(23)
    ask(ramps.logger, {"slow": 0.4})  # before it was over
    ramps.ticks(25)
    ramps.logger.parameters["slow"].value = -1.0  # the program's own are there at once
    ramps.ticks(8)
    ask(ramps.logger, {"slow": 9.0, "on": False})
    ramps.ticks(33)  # and ends on its way
    told, log = ramps.told()
    assert [one[1:] for one in told] == [one[1:] for one in ramps.saw]
    assert [one[0] for one in told] == pytest.approx([one[0] for one in ramps.saw], abs=1e-9)
    assert log.parameters.last["/log/leg/slow"] == pytest.approx(ramps.slow.value)
    (run,) = silo.runs(log.path.rpartition("/")[0])
    assert run.facts.parameters["/log/leg/slow"] == pytest.approx(ramps.slow.value)


@pytest.mark.parametrize("rate", [100, 333, 40])
def test_a_ramp_is_on_its_way_at_another_rate_too_as_far_as_samples_tell(new_logger, rate):
    ramps = Ramps(new_logger(frequency=100, clock=Clock()))
    ramps.ticks(7)
    ask(ramps.logger, {"slow": 0.5, "n": 40})
    ramps.ticks(70)
    ask(ramps.logger, {"slow": 0.0})
    ramps.ticks(23)
    ask(ramps.logger, {"slow": 0.4})  # before it was over
    ramps.ticks(60)
    _, log = ramps.told()
    other = log.resample(rate)
    held = [other.parameters.at(time_s)["/log/leg/slow"] for time_s in log.times]
    assert held == pytest.approx([one[0] for one in ramps.saw], abs=0.1 + 1 / rate)


@pytest.mark.parametrize(("begin_s", "end_s"), [(0.4, 0.7), (0.43, 0.57), (0.57, 1.0), (0.0, 1.0), (0.95, 1.2)])
def test_a_part_that_begins_on_the_way_of_a_ramp_knows_it_by_the_samples(new_logger, begin_s, end_s):
    ramps = Ramps(new_logger(frequency=100, clock=Clock()))
    ramps.ticks(17)
    ask(ramps.logger, {"slow": 0.5, "n": 40})
    ramps.ticks(100)
    _, log = ramps.told()
    clip = log.clip(begin_s, end_s)
    first = round(begin_s * 100)
    held = [clip.parameters.at(time_s)["/log/leg/slow"] for time_s in clip.times]
    saw = [one[0] for one in ramps.saw[first : first + len(held)]]
    if sum(clip["leg/slow"].values < 0.5) == 1:  # a single sample doesn't tell whether it goes anywhere
        saw = [0.5] * len(saw)
    assert held == pytest.approx(saw, abs=1e-9)
    told = clip.parameters.at(end_s)["/log/leg/n"]
    assert told == pytest.approx(80 * saw[-1], abs=1)


@pytest.mark.parametrize("course", [np.sin, np.ones_like, lambda at: np.where(at < 0.1, 3.0, 0.0)])
def test_of_a_part_in_which_a_parameter_is_excited_it_is_that_around_which_it_goes(course):
    ticks = np.arange(0, 200, 10)
    image = LoggedEvent("parameter", "1 parameter", tick=0, change=ParameterChange((("/log/kp", None, 5.0),)))
    samples = TunedSamples(ticks, 5.0 + course(ticks / 30)[:, None])
    told = LoggedParameters([image], 10**7 * np.arange(200), 200, 0, lambda name: samples)
    assert {told.at(time_s)["/log/kp"] for time_s in (0.0, 0.5, 1.99)} == {5.0}


def test_of_what_was_set_together_that_goes_on_which_was_not_set_again(new_logger):
    ramps = Ramps(new_logger(frequency=100, clock=Clock()))
    ramps.ticks(6)
    ask(ramps.logger, {"slow": 0.5, "on": True, "n": 40})
    ramps.ticks(11)
    ask(ramps.logger, {"n": 3})
    ramps.ticks(20)
    assert ramps.logger.parameters.landing.after()["/log/leg/n"] == 3
    first, _ = ramps.told()
    ramps.logger.restart()  # the rest of it is told there, without what was set again
    ramps.ticks(33)
    then, _ = ramps.told()
    assert ramps.saw[-1] == (0.5, True, 3)
    assert [one[1:] for one in (*first, *then)] == [one[1:] for one in ramps.saw]
    assert [one[0] for one in (*first, *then)] == pytest.approx([one[0] for one in ramps.saw], abs=1e-9)


def test_what_goes_on_together_is_written_at_once_for_who_reads_beside_the_loop(new_logger):
    ramps = Ramps(new_logger(frequency=100, clock=Clock()))
    landing, written = ramps.logger.parameters.landing, []

    class Noted(np.ndarray):
        def __setitem__(self, where, what):
            written.append(len(np.atleast_1d(what)))
            super().__setitem__(where, what)

    ramps.ticks(1)
    ask(ramps.logger, {"slow": 0.5, "on": True, "n": 40})
    ramps.ticks(3)
    landing._words = landing._words.view(Noted)
    ramps.ticks(2)
    ask(ramps.logger, {"n": 3})
    ramps.ticks(3)
    assert written == [3, 3, 3, 1, 2, 2]


def test_what_a_lock_ends_of_two_that_were_set_together_stays_where_it_came_to(new_logger):
    ramps = Ramps(new_logger(frequency=100, clock=Clock()))
    ask(ramps.logger, {"slow": 5.0, "n": 400})
    ramps.ticks(14)
    ask(ramps.logger, {"n": 3})
    ramps.ticks(9)
    ramps.logger.parameters.lock()
    ramps.ticks(40)
    told, _ = ramps.told()
    assert [one[0] for one in told[31:]] == pytest.approx([ramps.slow.value] * 32)


@pytest.mark.parametrize("before", [5, 12, 20])
@pytest.mark.parametrize("between", [1, 2, 3, 5, 9, 11, 25])
def test_a_ramp_that_is_sent_elsewhere_is_told_also_where_no_sample_was_on_its_way(new_logger, before, between):
    ramps = Ramps(new_logger(frequency=100, clock=Clock()))
    ramps.ticks(before)
    ask(ramps.logger, {"slow": 0.5, "on": True})
    ramps.ticks(between)
    ask(ramps.logger, {"slow": -0.2})
    ramps.ticks(90)
    told, log = ramps.told()
    assert [one[0] for one in told] == pytest.approx([one[0] for one in ramps.saw], abs=1e-9)
    assert log.parameters.last["/log/leg/on"] is True  # nobody set that again: it goes on
    assert [one[1] for one in told] == [one[1] for one in ramps.saw]


def test_a_ramp_that_is_closed_before_its_first_sample_is_told(new_logger):
    ramps = Ramps(new_logger(frequency=100, clock=Clock()))
    ramps.ticks(12)
    ask(ramps.logger, {"slow": 0.5, "on": True})
    ramps.ticks(4)
    ramps.logger.parameters.lock()
    ramps.ticks(40)
    told, log = ramps.told()
    assert [one[0] for one in told] == pytest.approx([one[0] for one in ramps.saw], abs=0.011)
    assert (log.parameters.last["/log/leg/slow"], log.parameters.last["/log/leg/on"]) == (ramps.slow.value, False)


@pytest.mark.parametrize("tick", [100, 101, 46])
def test_a_ramp_that_begins_where_it_is_sampled_and_is_over_before_the_next_sample_is_told(new_logger, tick):
    ramps = Ramps(new_logger(frequency=200, clock=Clock()))
    ramps.ticks(tick - 1)
    ask(ramps.logger, {"slow": 0.04, "n": 77})
    ramps.ticks(90)
    told, _ = ramps.told()
    assert [one[1:] for one in told] == [one[1:] for one in ramps.saw]
    assert [one[0] for one in told] == pytest.approx([one[0] for one in ramps.saw], abs=1e-9)


@pytest.mark.parametrize("number", [2**53 + 1, -(2**63), 2**63 - 1])
def test_a_whole_number_without_a_rate_is_there_at_once_to_its_last_digit(new_logger, number):
    logger = new_logger(frequency=200, clock=Clock())
    count, saw = logger.parameter("count", 3), []
    logger.start()
    for tick in range(125):
        count.value = number if 8 < tick < 26 else 3
        saw.append(count.value)
        logger.collect()
    log = silo.open_log(logger.save("silo").path)
    assert [log.parameters.at(time_s)["/log/count"] for time_s in log.times] == saw


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("old", "new", "rate"),
    [
        (0.0, 1e308, 1.0), (-1.7e308, 1.7e308, 1e308), (1e308, -1e308, 1e-300), (-(2**63), 2**63 - 1, 2**62),
        (2**63 - 1, -(2**63), 1), (0, 2**63 - 1, 1e-9), ((0.0, -1.7e308), (1.0, 1.7e308), 3e307),
    ],
)  # fmt: skip
def test_a_way_longer_than_any_number_is_gone_and_ends_no_loop(new_logger, old, new, rate):
    logger = new_logger(frequency=100, clock=Clock(), max_time=60)
    logger.parameter("far", old, rate=rate)
    logger.start()
    ask(logger, {"far": new})
    saw = []
    for _ in range(500):
        logger.collect()
        saw.append(read(logger)["far"])
    first, last = np.array(old), np.array(new)
    steps = np.array(saw, first.dtype)
    assert ((steps >= np.minimum(first, last)) & (steps <= np.maximum(first, last))).all()
    assert ((steps[1:] >= steps[:-1]) == (last > first)).all() or (steps[1:] == steps[:-1]).all()


@pytest.mark.parametrize("is_logged", [True, False])
@pytest.mark.parametrize("pause_s", [-3600, 0.5])
def test_a_clock_that_is_set_back_stops_no_ramp_and_a_loop_that_stood_goes_on_and_files_say_so(
    new_logger, pause_s, is_logged
):
    clock = Clock()
    logger = new_logger(frequency=100, clock=clock, max_time=60)
    logger.parameter("far", 0.0, rate=1.0)
    logger.set("far", enabled=is_logged)
    logger.start()
    ask(logger, {"far": 4.0})
    saw = []
    for tick in range(500):
        if tick == 200:
            clock.now_ns += round(pause_s * 10**9)
        saw.append(read(logger)["far"])
        logger.collect()
    steps = np.diff(saw)
    assert steps[200] == (0 if pause_s < 0 else pytest.approx(0.51))
    assert np.delete(steps, 200)[1:300] == pytest.approx(np.full(299, 0.01))
    assert saw[-1] == 4.0
    parameters = silo.open_log(logger.save("silo").path).parameters
    assert [parameters._at_tick(tick)["/log/far"] for tick in range(500)] == pytest.approx(saw)


@pytest.mark.parametrize("period_s", [0.001, 1.0, 30.0])
def test_a_ramp_goes_by_the_stamps_however_slow_the_loop_is(new_logger, period_s):
    clock = Clock()
    logger = new_logger(frequency=1 / period_s, clock=lambda: clock.now_ns, max_time=0)
    logger.array("x", buffer="looping", size=10)
    logger.parameter("far", 0.0, rate=1.0)
    logger.start()
    ask(logger, {"far": 1000.0 * period_s})
    for _ in range(500):
        clock.now_ns += round(period_s * 1e9)
        logger.collect()
    assert read(logger)["far"] == pytest.approx(499 * period_s, abs=period_s)


def test_what_fails_while_it_lands_is_refused_and_the_loop_goes_on(tuned, monkeypatch, caplog):
    store = tuned.parameters.landing._store

    def fails(change, *more, **named):
        if change.infos[0].name.endswith("kd"):
            raise OverflowError("no such number")
        return store(change, *more, **named)

    monkeypatch.setattr(tuned.parameters.landing, "_store", fails)
    bad, good = ask(tuned, {"kd": 5.0}), ask(tuned, {"kp": 50.0})
    tuned.collect()
    assert (bad.refused, good.refused) == ("it can't be done: no such number", "")
    assert read(tuned) == {"kp": 50.0, "height": 0.3, "kd": 1.0}
    assert "a change of parameters can't be done" in caplog.text
    tuned.collect()
    assert not tuned.parameters.landing.waiting


@pytest.mark.parametrize("ticks", [1, 30, 120])
def test_a_run_that_begins_on_the_way_of_a_ramp_tells_where_it_goes(new_logger, ticks):
    ramps = Ramps(new_logger(frequency=100, clock=Clock()))
    ask(ramps.logger, {"slow": 0.7, "n": 30})
    ramps.ticks(20)
    ramps.logger.restart()
    ramps.saw.clear()
    ramps.ticks(ticks)
    told, log = ramps.told()
    assert [one[0] for one in told] == pytest.approx([one[0] for one in ramps.saw], abs=1e-9)
    assert [event.change.values[0][2] for event in log.parameters.changes] == [0.7]


@pytest.mark.parametrize("ticks", [30, 33])  # behind which samples go on a distance apart, or have stamps of their own
def test_a_ramp_goes_on_over_a_cut(new_logger, ticks):
    ramps = Ramps(new_logger(frequency=100, clock=Clock()))
    ask(ramps.logger, {"slow": 0.7})
    ramps.ticks(ticks)
    ramps.logger.set("leg/n", size=50, cut=True)
    ramps.ticks(90)
    whole = silo.open_log(ramps.logger.save("silo")[0].path)
    held = [whole.parameters.at(time_s)["/log/leg/slow"] for time_s in whole.times]
    assert held == pytest.approx([one[0] for one in ramps.saw], abs=1e-9)


def test_what_lands_in_the_tick_that_was_under_way_at_a_cut_holds_from_the_next_stretch_on(new_logger):
    clock, asked = Clock(), []

    def cut_at_fifth():
        if clock.now_ns == 50_000_000 and not asked:
            asked.append(threading.Thread(target=lambda: logger.set("x", size=7, cut=True)))
            asked[0].start()
            asked[0].join()
        return clock()

    logger = new_logger(frequency=100, clock=cut_at_fifth)
    logger.array("x")
    kp, saw = logger.parameter("kp", 1.0), []
    logger.start()
    clock.now_ns = 0
    for tick in range(12):
        if tick == 5:
            ask(logger, {"kp": 2.0})
        saw.append(kp.value)
        logger.collect()
    assert [run.segment.ticks for run in logger._present.stretches] == [6, 6]
    log = silo.open_log(logger.save("silo")[0].path)
    assert [log.parameters.at(time_s)["/log/kp"] for time_s in log.times] == saw == [1.0] * 6 + [2.0] * 6


@pytest.mark.parametrize("before", [True, False])
def test_what_lands_in_the_midst_of_a_cut_holds_from_its_row_on(new_logger, monkeypatch, before):
    """Ticks come right before, or behind, the one moment at which the stretch is the present one."""
    logger, saw = new_logger(frequency=100, clock=Clock()), []
    logger.array("x")
    kp, logged = logger.parameter("kp", 1.0), logger.array("seen", buffer="growing")
    logger.start()

    def ticks(count):
        for _ in range(count):
            saw.append(kp.value)
            logged[...] = kp.value
            logger.collect()

    def midst(present, made):
        if not before:
            go_on(present, made)
        ticks(1)
        ask(logger, {"kp": 2.0})
        ticks(3)
        if before:
            go_on(present, made)

    ticks(10)
    go_on = CurrentRun.go_on
    with monkeypatch.context() as patch:
        patch.setattr(CurrentRun, "go_on", midst)
        logger.set("x", divider=2, cut=True)
    ticks(5)
    parts = [silo.open_log(file.path, alone=True) for file in logger.save("silo")]
    assert [len(part.times) for part in parts] == [10, 9]
    for part, there in zip(parts, (saw[:10], saw[10:]), strict=True):
        assert [part.parameters.at(time_s)["/log/kp"] for time_s in part.times] == there
        assert part["seen"].values.tolist() == there


def test_what_lands_while_a_start_hands_its_run_over_holds_from_the_first_row_on(new_logger, monkeypatch):
    logger = new_logger(frequency=100, clock=Clock())
    logger.array("x")
    kp = logger.parameter("kp", 1.0)
    logger.start()
    logger.stop()

    def hand_over():  # the loop turns meanwhile
        ask(logger, {"kp": 2.0})
        logger.collect()

    monkeypatch.setattr(logger, "_hand_over", hand_over)
    logger.start()
    assert kp.value == 2.0
    logger.collect()
    log = silo.open_log(logger.save("silo")[0].path)
    assert log.parameters.at(0.0)["/log/kp"] == 2.0


def test_a_ramp_that_a_lock_ends_stays_where_it_came_to(new_logger):
    ramps = Ramps(new_logger(frequency=100, clock=Clock()))
    ask(ramps.logger, {"slow": 5.0})
    ramps.ticks(40)
    ramps.logger.parameters.lock()
    ramps.ticks(40)
    told, _ = ramps.told()
    assert [one[0] for one in told[:30]] == pytest.approx([one[0] for one in ramps.saw[:30]], abs=1e-9)
    assert [one[0] for one in told[51:]] == pytest.approx([ramps.slow.value] * 29)


def test_changes_that_the_slots_hold_no_more_are_told_from_what_the_next_one_found(tuned):
    tuned.collect()
    for value in range(2000):
        tuned.parameters["kd"].value = float(value)
    tuned.collect()
    log = silo.Log(tuned.snapshot())
    assert log.parameters.at(99.0)["/log/legs/kd"] == 1999.0
    assert len(log.parameters.changes) == 1024


@pytest.mark.parametrize("kind", ["silo", "csv", "bag"])
def test_of_changes_that_are_overwritten_an_image_stays_and_before_it_nobody_knows(tuned, kind):
    tuned.parameters["kp"].value = 45.0
    for value in range(2000):
        tuned.collect()
        tuned.parameters["kd"].value = float(value)
    tuned.collect()
    path = tuned.save(kind).path
    with pytest.warns(silo.LogWarning, match="977 changes are not kept"):
        log = silo.open_log(path)
    kd = {time_s: log.parameters.at(time_s)["/log/legs/kd"] for time_s in (9.77, 15.0, 20.0)}
    assert kd == {9.77: 976.0, 15.0: 1499.0, 20.0: 1999.0}
    assert log.parameters.at(9.77)["/log/legs/kp"] == 45.0
    for time_s in (0.0, 5.0, 9.75):
        with pytest.raises(silo.ElementError, match=r"not known: 977 changes are not kept, from 0 s on to 9\.76 s"):
            log.parameters.at(time_s)
    assert any("977 changes are not kept" in text for text in log.warnings)
    assert len(log.parameters.changes) == 1024


def test_where_the_events_have_all_changes_the_image_hides_none(tuned):
    told = [*tuned._present.run.reader.changes()]
    for value in range(1500):
        tuned.collect()
        tuned.parameters["kd"].value = float(value)
        told += tuned._present.run.reader.changes(len(told) - 1)
    log = silo.Log(with_events(tuned.snapshot(), told))
    assert log.warnings == ()
    assert [log.parameters.at(time_s)["/log/legs/kd"] for time_s in (0.0, 0.01, 3.0)] == [1.0, 0.0, 299.0]


def test_long_changes_push_others_out_before_there_are_many(tuned):
    tuned.collect()
    tuned.parameters["kp"].value = 45.0
    tuned.collect()
    many = tuned.parameter("many", np.zeros(12_000))
    tuned.stop()
    tuned.start()
    tuned.parameters["kp"].value = 46.0
    tuned.collect()
    for value in range(9):
        many.value = np.full(12_000, value)
    tuned.collect()
    log = silo.Log(tuned.snapshot())
    assert log.parameters.at(99.0)["/log/legs/kp"] == 46.0
    assert log.parameters.at(99.0)["/log/many"][-1] == 8.0
    assert len(log.parameters.changes) < 9


@pytest.mark.parametrize("early", [1, 500, 1023, 1024, 1100])
def test_what_others_overtook_is_told_however_many_they_are(tuned, early):
    tuned.collect()
    waits = ask(tuned, {"kp": 55.0})
    for value in range(early):
        tuned.parameters["kd"].value = float(value)
    tuned.collect()
    tuned.collect()
    for value in range(early, 1100):
        tuned.parameters["kd"].value = float(value)
    tuned.collect()
    assert waits.landed
    log = silo.Log(tuned.snapshot())
    assert log.parameters.at(99.0)["/log/legs/kp"] == 55.0
    assert log.parameters.at(99.0)["/log/legs/kd"] == 1099.0


def test_of_the_oldest_events_of_a_recording_of_too_many_the_values_stay(tuned):
    tuned.parameters["kp"].value = 45.0
    tuned.collect()
    tuned.collect()
    marks = [LoggedEvent("marker", str(number), time.time_ns(), 1) for number in range(MOST_EVENTS)]
    log = silo.Log(with_events(tuned.snapshot(), marks))
    assert log.parameters.at(99.0)["/log/legs/kp"] == 45.0


def test_on_the_way_numbers_lie_between_old_and_new_and_all_else_is_as_it_was_until_the_end():
    infos = [
        ParameterInfo("gain", ParameterKind.FLOAT, [0.0, 0.0], (2,)),
        ParameterInfo("on", ParameterKind.BOOL, False),
        ParameterInfo("steps", ParameterKind.INT, 0),
    ]
    old = np.array([*np.array([1.0, -2.0]).view(np.int64), 0, 10])
    new = np.array([*np.array([3.0, 2.0]).view(np.int64), 1, 21])
    part = between(infos, old, new, 0.25)
    assert (part[:2].view(np.float64).tolist(), part[2:].tolist()) == ([1.5, -1.0], [0, 13])
    assert between(infos, old, new, 1.0).tolist() == new.tolist()


def test_a_text_without_end_ends_neither_the_loop_nor_the_history(tmp_path):
    with silo.Logger("bot", frequency=100, folder=tmp_path) as log:
        kp = log.parameter("kp", 1.0)
        log.array("x", ())
        log.start()
        log.parameters.request({"kp": 2.0}, "alice", "network", "one", remote=False)
        log.collect()
        log.parameters.excite(
            Excitation("kp", Wave.STEP, 1.0, 1.0), "alice", "network", "two", remote=False, frequency_hz=100
        )
        log.collect()
        log.parameters.excitations.stop("two", "y" * 2**21)
        log.collect()
        log.parameters.request({"kp": 3.0}, "x" * 2**21, "network", "x" * 2**21, remote=False)
        log.collect()
        assert kp.value == 3.0
        assert [change.change.values[0][2] for change in log._present.run.reader.changes(0)] == [2.0, 2.0, 2.0, 3.0]
        log.close(discard=True)


def test_on_the_way_a_value_is_what_was_logged_from_the_change_to_the_next_one_alone():
    samples = TunedSamples(np.arange(6), np.array([[3.0], [9.5], [9.0], [2.0], [1.0], [7.0]]))
    way = Arrival(0.0, samples, 2, 5, lambda tick: tick)
    assert [way.at(tick) for tick in (2, 3, 4)] == [9.0, 2.0, 1.0]

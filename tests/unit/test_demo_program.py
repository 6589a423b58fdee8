"""The loop around the robot: its rate, its end, its element table."""

import gc
import os
import signal
import threading
from pathlib import Path

import numpy as np
import pytest

from silo.analysis.log import Log
from silo.core.elements import Action, BufferType, FileType
from silo.logger.logger import Logger
from silo.programs.demo.program import (
    LOOP_ELEMENTS,
    DemoOptions,
    judge,
    loop_variables,
    make_robot,
    register,
    tuning,
)
from silo.programs.demo.signals import divider_at
from silo.programs.rate import EndSignals, Rate
from silo.programs.running import ProgramOptions, end_with, farewell, opened
from silo.settings.script import apply_script, read_script
from tests.waiting import DEADLINE_S, wait_until

CONFIG = Path(__file__).resolve().parents[2] / "config"


class FakeClock:
    """Time that passes only by sleeping."""

    def __init__(self) -> None:
        self.now_ns = 0

    def __call__(self) -> int:
        return self.now_ns

    def sleep(self, seconds: float) -> None:
        self.now_ns += round(seconds * 1e9)


@pytest.fixture
def clock() -> FakeClock:
    return FakeClock()


def rate(clock: FakeClock, frequency_hz: float = 100.0) -> Rate:
    return Rate(frequency_hz, clock, clock.sleep)


def test_deadlines_do_not_drift_with_the_work_of_the_loop(clock: FakeClock) -> None:
    ticks = rate(clock)
    for _ in range(50):
        clock.now_ns += 3_000_000
        assert ticks.wait() == 0
    assert clock.now_ns == 50 * 10_000_000


@pytest.mark.parametrize(("late_ms", "told_ms", "end_ms", "skipped"), [(14, 4, 20, 0), (57, 7, 60, 4)])
def test_lateness_is_told_the_next_deadline_stays_and_those_that_were_missed_are_counted(
    clock: FakeClock, late_ms: int, told_ms: int, end_ms: int, skipped: int
) -> None:
    ticks = rate(clock)
    clock.now_ns += late_ms * 1_000_000
    assert ticks.wait() == told_ms * 1_000_000
    assert ticks.wait() == 0
    assert (clock.now_ns, ticks.skipped) == (end_ms * 1_000_000, skipped)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_only_asks_for_the_end(number: signal.Signals) -> None:
    with EndSignals() as ending:
        assert ending.received is None
        os.kill(os.getpid(), number)
        assert ending.received is number


def test_a_second_ctrl_c_acts_as_usual() -> None:
    gc.disable()  # what is raised within a callback of the collector comes nowhere
    usual = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background has it ignored
    try:
        with EndSignals() as ending:
            os.kill(os.getpid(), signal.SIGINT)
            wait_until(lambda: ending.received)  # two at once are one
            with pytest.raises(KeyboardInterrupt):
                os.kill(os.getpid(), signal.SIGINT)
                threading.Event().wait(DEADLINE_S)
    finally:
        signal.signal(signal.SIGINT, usual)
        gc.enable()


def test_handlers_are_put_back() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with EndSignals():
        assert signal.getsignal(signal.SIGTERM) is not before
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.fixture
def demo(tmp_path: Path) -> Logger:
    log = Logger("demo", frequency=400, max_time=0, folder=tmp_path, script=tmp_path / "demo.yaml")
    register(log, make_robot(DemoOptions())[1])
    return log


def test_the_table_has_elements_of_every_sort(demo: Logger) -> None:
    demo.update()
    elements = demo.elements
    assert {element.options.action for element in elements} == set(Action)
    assert {element.options.buffer for element in elements} == set(BufferType)
    assert {"scalar", "vector", "matrix", "pose", "twist", "quaternion"} <= {element.kind for element in elements}
    assert any(entry.labels for element in elements for entry in element.entries)
    assert any("S" in entry.dtype for element in elements for entry in element.entries)
    demo.close()


def test_it_slips_at_random_with_a_limit_and_a_trigger_that_waits_to_be_armed(tmp_path: Path) -> None:
    robot, chosen = make_robot(DemoOptions(frequency_hz=100, elements=12, seed=1))
    with Logger("demo", frequency=100, max_time=60, folder=tmp_path, script=tmp_path / "demo.yaml") as log:
        register(log, chosen)
        log.update()
        judge(log)
        log.start()
        for _ in range(100 * 13):
            robot.step()
            log.collect()
        found = Log(log.snapshot())
        log.stop()
    (trigger,) = log._conditions.now.triggers
    slips = found.eval(f"{trigger.when} and prev({trigger.when}) == 0").values.sum()
    assert 1 <= slips <= 3
    assert not trigger.armed
    assert found["base/tilt"].values.max() > log._conditions.now.limits[0].bounds[3]


def test_a_script_that_says_other_things_goes_first(demo: Logger) -> None:
    demo.derive("own", "battery/voltage * 2")
    demo.update()
    judge(demo)
    assert [one.name for one in demo._conditions.now.derived] == ["/log/own"]
    assert not demo._conditions.now.triggers
    demo.close()


def test_the_script_to_copy_fits_the_demo(demo: Logger) -> None:
    demo.update()
    script = read_script(CONFIG / "demo.yaml")
    plan = apply_script(script, demo.elements, demo.options.frequency_hz)
    demo.close()
    assert script.elements
    assert plan.unknown == ()


@pytest.mark.parametrize(("types", "cut_short"), [((FileType.SILO,), False), ((), True)])  # as asked, by a signal
def test_the_end_says_what_was_saved(
    demo: Logger, tmp_path: Path, types: tuple[FileType, ...], cut_short: bool
) -> None:
    said: list[str] = []
    demo.start()
    demo.collect()
    demo.stop()
    farewell(demo, types, said.append, cut_short=cut_short)
    demo.close()
    (file,) = tmp_path.glob("demo_*.silo")
    assert said[0] == "logger 'demo' ended after 1 tick; what its buffers held is saved:"
    assert str(file) in said[1]


def test_the_end_says_that_nothing_was_saved(demo: Logger) -> None:
    said: list[str] = []
    demo.start()
    demo.collect()
    demo.stop()
    farewell(demo, (), said.append)
    demo.close()
    assert said == ["logger 'demo' ended; 1 tick logged and not saved (use --save, or `silo save demo` before it ends)"]


def test_what_is_in_a_file_is_not_saved_again_by_a_signal(demo: Logger, tmp_path: Path) -> None:
    demo.start()
    demo.collect()
    demo.stop()
    demo.save([FileType.SILO])
    farewell(demo, (), [].append, cut_short=True)
    demo.close()
    assert len(list(tmp_path.glob("demo_*.silo"))) == 1


def test_the_end_of_a_logger_that_never_started_says_so(demo: Logger) -> None:
    said: list[str] = []
    farewell(demo, (FileType.SILO,), said.append)
    demo.close()
    assert said == ["logger 'demo' ended; nothing was logged, so there is nothing to save"]


def test_the_robot_ends_in_order_when_the_program_that_started_it_is_gone() -> None:
    with EndSignals() as ending:
        end_with(parent_pid=-1)  # as if ours had been killed, and another process had taken us over
        assert ending.received


@pytest.mark.parametrize("frequency_hz", [1, 2, 3, 5, 9, 10, 33, 50, 79, 80, 81, 125, 199, 300, 401, 2345, 10_000])
def test_it_starts_at_any_frequency(tmp_path: Path, frequency_hz: float) -> None:
    options = DemoOptions(frequency_hz=frequency_hz)
    log = Logger("demo", frequency=frequency_hz, max_time=0, folder=tmp_path, script=tmp_path / "demo.yaml")
    register(log, make_robot(options)[1])
    assert len(loop_variables(log)) + len(tuning(log)) == LOOP_ELEMENTS
    log.update()
    judge(log)
    assert [trigger.name for trigger in log._conditions.now.triggers] == ["slip"]
    log.close()


def test_rates_are_the_same_at_every_frequency() -> None:
    dividers = {one.row.divider for one in make_robot(DemoOptions())[1]}
    for frequency_hz in range(1, 10_001):
        for divider in dividers:
            rate_hz = frequency_hz / divider_at(divider, frequency_hz)
            assert rate_hz <= frequency_hz
            if frequency_hz >= 400:
                assert rate_hz == pytest.approx(400 / divider, rel=0.5)


def test_what_lands_in_a_tick_the_robot_does_in_its_next_step(demo: Logger) -> None:
    robot, _ = make_robot(DemoOptions(frequency_hz=100, elements=12, seed=1))
    robot.tuning = tuning(demo)
    demo.parameters.set({"body_height": 0.52, "kp": 3000.0})
    for _ in range(40):
        robot.step()
    assert robot.base.pose[2] > 0.5
    assert np.all(robot.joints.gain_p == 3000)


def test_a_program_makes_its_folder_or_has_the_one_that_is_there(tmp_path):
    for _ in range(2):
        log = opened(ProgramOptions(name="bot", frequency_hz=100.0, folder=tmp_path / "new" / "logs"))
        assert list((tmp_path / "new").iterdir()) == [tmp_path / "new" / "logs"]
        log.close()

"""The program of `silo demo`: a control loop at 400 Hz with silo in it, as one would write it for a real robot."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from silo.core.conditions import NO_CONDITIONS
from silo.core.elements import Action
from silo.logger.logger import Logger
from silo.programs.demo.gait import HEIGHT_M, STEP_HEIGHT_M
from silo.programs.demo.robot import SimulatedRobot, Tuning
from silo.programs.demo.signals import GAIN_D_NMS_RAD, GAIN_P_NM_RAD, LoggedSignal, divider_at, signals
from silo.programs.rate import Rate
from silo.programs.running import ProgramOptions, opened, read_own_script, run

FREQUENCY_HZ = 400.0
LOOP_ELEMENTS = 8  # four that the loop watches of itself, four parameters


@dataclass(frozen=True, kw_only=True)
class DemoOptions(ProgramOptions):
    """What `silo demo` can be told besides. `elements` None is the robot as it is, about 500."""

    name: str = "demo"
    frequency_hz: float = FREQUENCY_HZ
    elements: int | None = None
    seed: int = 0


def run_demo(options: DemoOptions, say: Callable[[str], None] = print) -> None:
    """Run the robot until Ctrl-C, SIGTERM or the time limit. Raises SiloError when it can't log."""
    robot, chosen = make_robot(options)
    log = opened(options)
    register(log, chosen)
    step_us, late_us, skipped, ticks = loop_variables(log)
    robot.tuning = tuning(log)
    read_own_script(log, options)
    judge(log)

    def tick(rate: Rate) -> None:
        began_ns = time.perf_counter_ns()
        robot.step()
        step_us[...] = (time.perf_counter_ns() - began_ns) / 1000
        ticks[...] = robot.ticks
        log.collect()
        late_us[...] = rate.wait() / 1000
        skipped[...] = rate.skipped

    ways = (
        "slips   it slips at random: in silo-tui, g t lists the trigger 'slip', and r t arms it",
        f"tune    how it walks: in silo-tui, g p lists its parameters; or `silo param ls {options.name}`",
    )
    run(log, options, tick, say, ways)


def make_robot(options: DemoOptions) -> tuple[SimulatedRobot, Sequence[LoggedSignal]]:
    """Return the robot and the elements to log.

    With more elements than it has, further diagnostic channels are made.
    """
    wanted = options.elements
    robot = SimulatedRobot(options.frequency_hz, options.seed)
    chosen = signals(robot)
    if wanted is None:
        return robot, chosen
    missing = wanted - LOOP_ELEMENTS - len(chosen)
    if missing <= 0:
        return robot, chosen[: max(0, wanted - LOOP_ELEMENTS)]
    robot = SimulatedRobot(options.frequency_hz, options.seed, channels=missing)
    return robot, signals(robot)


def loop_variables(log: Logger) -> tuple[NDArray[Any], ...]:
    """Add what the loop watches of itself; these variables live in silo's own memory."""
    frequency_hz = log.options.frequency_hz
    return (
        log.array(
            "step_time",
            group="loop",
            unit="us",
            action=Action.SAVE_AND_PUBLISH,
            description="how long one step of the simulation took: its load",
        ),
        log.array(
            "lateness",
            group="loop",
            unit="us",
            action=Action.SAVE_AND_PUBLISH,
            description="how late a tick came: the jitter, or delay, of the loop",
        ),
        log.array("skipped", dtype="u4", group="loop", unit="count", divider=divider_at(40, frequency_hz)),
        log.array("ticks", dtype="i8", group="loop", unit="count", divider=divider_at(4, frequency_hz)),
    )


def tuning(log: Logger) -> Tuning:
    """Offer how it walks to be tuned: what lands at the end of a tick, its next step does."""
    return Tuning(
        log.parameter("body_height", HEIGHT_M, min=0.4, max=0.54, step=0.005, unit="m", group="gait",
                      description="hips above ground; lower bends the knees, whose torque rises"),
        log.parameter("step_height", STEP_HEIGHT_M, min=0.02, max=0.16, step=0.005, unit="m", group="gait",
                      description="feet above ground; higher steps take more torque"),
        log.parameter("kp", GAIN_P_NM_RAD, min=500, max=5000, step=50, unit="Nm/rad", group="gains",
                      description="stiffness of all joints; softer ones follow worse, stiffer ones come down harder"),
        log.parameter("kd", GAIN_D_NMS_RAD, min=2, max=50, step=0.5, unit="Nm*s/rad", group="gains",
                      description="damping of all joints"),
    )  # fmt: skip


def register(log: Logger, chosen: Sequence[LoggedSignal]) -> None:
    """Add the elements to the logger."""
    for signal in chosen:
        row = signal.row
        log.add(
            signal.source,
            signal.name,
            attr=signal.attr,
            group=signal.group,
            unit=row.unit,
            divider=divider_at(row.divider, log.options.frequency_hz),
            action=row.action,
            buffer=row.buffer,
            size=row.size,
            kind=row.kind,
            labels=row.labels,
            description=row.description,
        )


def judge(log: Logger) -> None:
    """Derive the tilt, limit it, and set a trigger that waits to be armed; a script that says other things goes first.

    The robot slips at random, and tilts by 0.2 rad then.
    """
    if log._conditions.now != NO_CONDITIONS or "/log/base/euler" not in log:
        return
    log.derive("tilt", "hypot(base/euler_roll, base/euler_pitch)", group="base", unit="rad")
    log.limit("base/tilt", (None, None, 0.08, 0.15), hysteresis=0.01)
    log.trigger("slip", "base/tilt > 0.1", pre=1.0, post=1.0, holdoff=2.0, keep=20, armed=False)

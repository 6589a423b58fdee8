"""The program of `silo demo`: a control loop at 400 Hz with silo in it, as one would write it for a real robot."""

import os
import signal as system_signals
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from silo.core.conditions import NO_CONDITIONS
from silo.core.elements import Action, FileType
from silo.core.quantities.writing import many, size_text
from silo.logger.logger import Logger
from silo.programs.demo.gait import HEIGHT_M, STEP_HEIGHT_M
from silo.programs.demo.robot import SimulatedRobot, Tuning
from silo.programs.demo.signals import GAIN_D_NMS_RAD, GAIN_P_NM_RAD, LoggedSignal, divider_at, signals
from silo.programs.rate import EndSignals, Rate

FREQUENCY_HZ = 400.0
PARENT_LOOK_S = 1.0
LOOP_ELEMENTS = 8  # four that the loop watches of itself, four parameters


@dataclass(frozen=True, kw_only=True)
class ProgramOptions:
    """What `silo demo` and `silo host` can be told; see their help."""

    name: str
    frequency_hz: float
    time_limit_s: float | None = None
    folder: Path = Path()
    script: Path | None = None
    stopped: bool = False
    save: tuple[FileType, ...] = ()
    group: str | None = None  # for `Logger.serve`
    config: Path | None = None


@dataclass(frozen=True, kw_only=True)
class DemoOptions(ProgramOptions):
    """What `silo demo` can be told besides. `elements` None is the robot as it is, about 500."""

    name: str = "demo"
    frequency_hz: float = FREQUENCY_HZ
    elements: int | None = None
    seed: int = 0
    parent_pid: int | None = None  # end when this process, which started us, is gone


def run_demo(options: DemoOptions, say: Callable[[str], None] = print) -> None:
    """Run the robot until Ctrl-C, SIGTERM or the time limit. Raises SiloError when it can't log."""
    robot, chosen = make_robot(options)
    options.folder.mkdir(parents=True, exist_ok=True)
    script = options.script or options.folder / f"{options.name}.yaml"
    log = Logger(
        options.name,
        frequency=options.frequency_hz,
        max_time=0,  # no limit: run until Ctrl-C, looping buffers hold 10 s
        script=script,
        folder=options.folder,
    )
    register(log, chosen)
    step_us, late_us, skipped, ticks = loop_variables(log)
    robot.tuning = tuning(log)
    log.update(read_script=bool(options.script) or script.exists())  # ours need not be there
    judge(log)

    with log, EndSignals() as ending, log.serve(group=options.group, config=options.config):
        if not options.stopped:
            log.start()
        say(welcome(log))
        if options.parent_pid is not None:
            threading.Thread(target=end_with, args=(options.parent_pid,), daemon=True).start()
        rate = Rate(options.frequency_hz)
        end_s = time.monotonic() + (options.time_limit_s or float("inf"))
        while not ending.received and time.monotonic() < end_s:
            began_ns = time.perf_counter_ns()
            robot.step()
            step_us[...] = (time.perf_counter_ns() - began_ns) / 1000
            ticks[...] = robot.ticks
            log.collect()
            late_us[...] = rate.wait() / 1000
            skipped[...] = rate.skipped
        log.stop()
        farewell(log, options.save, say, cut_short=bool(ending.received))
        log.close(discard=True)  # what nobody asked to keep, after a limit of time: `farewell` tells of it


def end_with(parent_pid: int) -> None:
    """End the program in order when its parent is gone: a killed one can't. For a thread, so that the loop pays 0."""
    while os.getppid() == parent_pid:
        time.sleep(PARENT_LOOK_S)
    os.kill(os.getpid(), system_signals.SIGTERM)


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
        log.array("step_time", group="loop", unit="us", action=Action.SAVE_AND_PUBLISH),
        log.array("lateness", group="loop", unit="us", action=Action.SAVE_AND_PUBLISH),
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


def welcome(log: Logger) -> str:
    """Return what a user needs to know at the start."""
    options, running = log.options, "running" if log.is_running else "stopped"
    script = options.script if Path(options.script).exists() else f"{options.script} (none yet: everything is logged)"
    return (
        f"logger '{options.name}': {many(len(log.elements), 'element')} at {options.frequency_hz:g} Hz, {running}\n"
        f"  script  {script}\n"
        f"  folder  {options.folder}\n"
        f"  watch   silo-tui {options.name}   or   silo watch {options.name}\n"
        "  slips   it slips at random: in silo-tui, g t lists the trigger 'slip', and r t arms it\n"
        f"  tune    how it walks: in silo-tui, g p lists its parameters; or `silo param ls {options.name}`\n"
        "  end     Ctrl-C"
    )


def farewell(log: Logger, types: Sequence[FileType], say: Callable[[str], None], *, cut_short: bool = False) -> None:
    """Save if asked to, or as `.silo` what is in no file when `cut_short` by a signal; say where the data is."""
    name = log.options.name
    if cut_short and not types and log.has_unsaved:
        types = (FileType.SILO,)
    if log.ticks == 0:
        say(f"logger '{name}' ended; nothing was logged, so there is nothing to save")
        return
    if types:
        saved = log.save(types)
        say(f"logger '{name}' ended after {many(log.ticks, 'tick')}; what its buffers held is saved:")
        for file in saved:
            say(f"  {file.path} ({size_text(file.size_bytes)})")
        return
    note = "" if not log.has_unsaved else f" and not saved (use --save, or `silo save {name}` before it ends)"
    say(f"logger '{name}' ended; {many(log.ticks, 'tick')} logged{note}")

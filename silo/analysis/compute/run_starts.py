"""Where the run of a log began, by its time stamps, and by how much stamps of another one move to meet it.

A buffer that loops holds the newest ticks alone: the first stamp of a file is not when its run began.
"""

from typing import NamedTuple

import numpy as np

from silo.core.quantities.writing import EPOCH_FROM_NS
from silo.core.recording import Recording


class RunStart(NamedTuple):
    """The stamp at which a run began; of which run; whether it is a capture of it.

    `counted` where the tick isn't held: then it is told by how many there were, and how far one was from the next.
    """

    stamp_ns: int
    run: str
    capture: bool = False
    counted: bool = False


def run_start(recording: Recording) -> RunStart | None:
    """Return where the run of a recording began; None where its file doesn't tell, as those of others don't."""
    time_ns, before = recording.time_ns, recording.offset - len(recording.time_ns)
    if recording.started_ns <= 0 or not len(time_ns) or before < 0:
        return None
    captured = recording.conditions.capture is not None
    run, stretch = recording.likely_run or f"{recording.logger} {recording.started_ns}", recording.stretch
    if stretch is not None and stretch.part > 1:  # ticks of a run that was cut count anew
        run = f"{run} {stretch.part}"
    told = [(event.tick, event.stamp_ns) for event in recording.events if 0 <= event.tick < before and event.stamp_ns]
    tick, stamp_ns = min(told, default=(before, int(time_ns[0])))
    if not tick:
        return RunStart(stamp_ns, run, captured)
    steps = np.diff(time_ns)
    ahead = steps[steps > 0]
    if falls := len(ahead) < len(steps):
        step_ns = float(np.median(ahead)) if len(ahead) else 0.0
    else:
        step_ns = float(time_ns[-1] - time_ns[0]) / len(steps) if len(steps) else 0.0
    step_ns = step_ns or 1e9 / (recording.frequency_hz or np.inf)
    if not step_ns or (falls and not len(ahead)):
        return None
    began_ns = stamp_ns - round(tick * step_ns)
    by_wall = EPOCH_FROM_NS <= recording.started_ns <= stamp_ns
    return RunStart(max(began_ns, recording.started_ns) if by_wall else began_ns, run, captured, True)


def moved_ns(start_ns: int, began: RunStart | None, other_ns: int, other: RunStart | None) -> int:
    """Return by how much stamps of another log move to meet those of one, on the time since their runs began.

    Times count from `start_ns` and `other_ns`: these meet where it isn't known when a run began, where somebody chose
    them, and of two captures. Of one run all stamps are of one clock.
    """
    if began is None or other is None or (began.capture and other.capture):
        return start_ns - other_ns
    return 0 if began.run == other.run else began.stamp_ns - other.stamp_ns

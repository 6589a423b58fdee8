"""How late a loop is, logged by itself: `silo.Logger("robot", timing=True)`.

Stands around a run's `collect`, whose text is the same with it and without. Costs a tick 0.5 us.
"""

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

ELEMENTS = {
    "period": "since the collect() before",
    "lateness": "of this collect(), by the frequency, counted from the tick that came earliest",
    "work": "that the collect() before took",
}


def timed(collect: Callable[[], None], values: list[NDArray[np.float64]], frequency_hz: float) -> Callable[[], None]:
    """Return `collect` of a run with its times, which are written before it is called.

    Args:
        collect: of the run.
        values: scalars for each of `ELEMENTS`, s.
        frequency_hz: how often it is to be called.
    """
    period, lateness, work = values
    step_s, clock = 1 / frequency_hz, time.perf_counter
    before_s = due_s = took_s = float("nan")

    def tick() -> None:
        nonlocal before_s, due_s, took_s
        now_s = clock()
        due_s += step_s
        if not due_s <= now_s:  # the first, or earlier than all before it
            due_s = now_s
        period[...], lateness[...], work[...] = now_s - before_s, now_s - due_s, took_s
        before_s = now_s
        collect()
        took_s = clock() - now_s

    return tick

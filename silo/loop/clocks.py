"""What a logger's own clock may be, what is said when it fails, and how late a loop is by this computer's.

The store into the stamp, which takes whole numbers of 64 bits alone, is the only check of a tick: it costs nothing.
"""

import logging
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.arguments import INT64, shown
from silo.errors import ElementError, StateError

logger = logging.getLogger("silo")

FIRST_LOOK_TICKS = 10
LAST_LOOK_TICKS = 10_000
NEAR = 5.0  # how far the rate of a loop may be from the logger's frequency
# how far a clock may be from this computer's and still be of the right unit: a loop without a pace, as in a test, ticks
# every 4 us, which at 100 Hz looked like microseconds
SAME_TIME = 1.5
# what a clock returned, where its nanoseconds are so many times too few
_UNITS = {
    1e9: "seconds as int",
    1e6: "milliseconds as int",
    1e3: "microseconds as int",
    1e-3: "milliseconds as float",
    1e-6: "microseconds as float",
    1e-9: "nanoseconds as float",
}
NOTHING = object()  # what a clock returned that failed
# how late a loop is, logged by itself: `silo.Logger("robot", timing=True)`
TIMES = {
    "period": "since the collect() before",
    "lateness": "of this collect(), by the frequency, counted from the tick that came earliest: its jitter",
    "work": "that the collect() before took",
}
_WAY_OUT = "this tick is not logged, the next one asks again"


def nanosecond_clock(clock: Callable[[], int | float] | None) -> Callable[[], int]:
    """Return a clock of int nanoseconds, whichever unit it was given in. Raises ElementError for anything else."""
    if clock is None:
        return time.time_ns
    if not callable(clock):
        raise ElementError(f"clock must be a function without arguments, got {shown(clock)}; write clock=lambda: ...")
    try:
        now = clock()
    except Exception as error:
        raise ElementError(
            f"clock failed when it was asked for the first time ({type(error).__name__}: {error}): it must return "
            "int nanoseconds or float seconds from now on"
        ) from error
    seconds = isinstance(now, float | np.floating)
    nanoseconds = isinstance(now, int | np.integer) and not isinstance(now, bool)
    limit = INT64[1] / 1e9 if seconds else INT64[1]
    if not (seconds or nanoseconds) or not -limit <= now <= limit:
        raise ElementError(
            f"clock must return int nanoseconds or float seconds, got {shown(now)}; either must fit into 64 bits of "
            "nanoseconds"
        )
    return _in_nanoseconds(clock) if seconds else clock  # type: ignore[return-value]  # the stamp takes nothing else


def _in_nanoseconds(clock: Callable[[], float]) -> Callable[[], int]:
    def now() -> int:
        seconds: Any = NOTHING
        try:
            seconds = clock()
            return int(seconds * 1e9)
        except Exception as error:  # of the program's own function
            raise clock_failed(seconds, error) from error

    now.__dict__["of"] = "float"
    return now


def looked_at(clock: Callable[[], int], name: str, frequency_hz: float) -> Callable[[], int]:
    """Return a program's own clock, which tells at the tenth tick if its ticks are apart by another unit of time.

    Then it takes itself out of `collect()`, whose later ticks ask the clock alone.
    """
    if clock is time.time_ns:
        return clock
    ticks, first_ns, began_ns, next_look = 0, 0, 0, FIRST_LOOK_TICKS

    def now() -> int:
        nonlocal ticks, first_ns, began_ns, next_look
        stamp = clock()
        if not isinstance(stamp, int | np.integer):
            return stamp  # `collect()` refuses it
        ticks += 1
        if ticks == 1:
            first_ns, began_ns = stamp, time.monotonic_ns()
        elif ticks >= next_look:
            if stamp != first_ns or ticks > LAST_LOOK_TICKS:
                passed_ns = time.monotonic_ns() - began_ns
                if not passed_ns / SAME_TIME <= stamp - first_ns <= passed_ns * SAME_TIME:
                    returns = getattr(clock, "of", "int")
                    _tell_unit(name, (stamp - first_ns) / (ticks - 1), frequency_hz, returns)
                names = sys._getframe(1).f_globals
                if names.get("clock") is now:
                    names["clock"] = clock
            next_look *= 2  # a coarse clock stands still for some ticks
        return stamp

    return now


def _tell_unit(name: str, step_ns: float, frequency_hz: float, returns: str) -> None:
    likely = likely_unit(step_ns, frequency_hz, returns)
    if likely:
        logger.warning(
            "%s: its clock says that ticks are %g s apart, at %g Hz they should be %g s: it seems to return %s; it "
            "must return int nanoseconds or float seconds (time.time_ns, time.time); all times are wrong so",
            name,
            step_ns / 1e9,
            frequency_hz,
            1 / frequency_hz,
            likely,
        )


def likely_unit(step_ns: float, frequency_hz: float, returns: str) -> str:
    """What a clock of "int" or "float" returned whose ticks are so far apart.

    Empty where they are as the frequency says, or anything: a simulation may be slow.
    """
    expected_ns = 1e9 / frequency_hz
    units = {factor: word for factor, word in _UNITS.items() if word.endswith(returns)}
    near = (word for factor, word in units.items() if expected_ns / NEAR <= step_ns * factor <= expected_ns * NEAR)
    return next(near, "")


def clock_failed(now: object, error: Exception) -> StateError:
    """Why a tick has no time. `now` is what the clock returned, NOTHING where it failed."""
    if now is NOTHING:
        return StateError(f"clock failed ({type(error).__name__}: {error}); {_WAY_OUT}")
    if isinstance(now, float | np.floating) and isinstance(error, TypeError):
        return StateError(
            f"clock returned the float {now!r}, but an int (nanoseconds) when the logger was made; "
            f"a clock of seconds must return floats from the start: 0.0, not 0; {_WAY_OUT}"
        )
    return StateError(f"clock must return a time within 64 bits of nanoseconds, got {shown(now)}; {_WAY_OUT}")


def timed(collect: Callable[[], None], values: list[NDArray[np.float64]], frequency_hz: float) -> Callable[[], None]:
    """Return `collect` of a run with its times, which are written before it is called; costs a tick 0.5 us.

    `values` are scalars for each of `TIMES`, s.
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

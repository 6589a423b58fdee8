"""What a logger's own clock may be, and what is said when it fails.

The store into the stamp, which takes whole numbers of 64 bits alone, is the only check of a tick: it costs nothing.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from silo.arguments import INT64, shown
from silo.errors import ElementError, StateError

NOTHING = object()  # what a clock returned that failed
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

    return now


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

"""How tests wait: for what has to come, never for the clock."""

import time
from collections.abc import Callable
from typing import TypeVar

from silo.errors import ConnectionLostError

Result = TypeVar("Result")

# What never comes is a failure after so long. It is no measure of speed: on two processors with 14 programs that want
# them, a minute was too short for the 7 s of processor time that a table of 10,000 elements takes.
DEADLINE_S = 180.0
_PAUSE_S = 0.005


def wait_until(get: Callable[[], Result]) -> Result:
    """Return what `get` returns as soon as that is true; raise AssertionError if it never is."""
    deadline = time.monotonic() + DEADLINE_S
    while not (found := get()):
        assert time.monotonic() < deadline, f"nothing came within {DEADLINE_S} s"
        time.sleep(_PAUSE_S)
    return found


def answered(ask: Callable[[], Result]) -> Result | None:
    """Return what a client is answered; None while one helper process is gone and the next isn't there."""
    try:
        return ask()
    except ConnectionLostError:
        return None

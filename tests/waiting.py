"""How tests wait: for what has to come, never for the clock."""

import time
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")

# What never comes is a failure after so long. It is no measure of speed: busy machines take their time.
DEADLINE_S = 60.0
_PAUSE_S = 0.005


def wait_until(get: Callable[[], Result]) -> Result:
    """Return what `get` returns as soon as that is true; raise AssertionError if it never is."""
    deadline = time.monotonic() + DEADLINE_S
    while not (found := get()):
        assert time.monotonic() < deadline, f"nothing came within {DEADLINE_S} s"
        time.sleep(_PAUSE_S)
    return found

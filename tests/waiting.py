"""How tests wait: for what has to come, never for the clock."""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from silo.errors import ConnectionLostError, RefusedError

Result = TypeVar("Result")

# What never comes is a failure after so long. It is no measure of speed: on two processors with 14 programs that want
# them, a minute was too short for the 7 s of processor time that a table of 10,000 elements takes.
# Where somebody waits for failures, `SILO_DEADLINE_S` may be less.
DEADLINE_S = float(os.environ.get("SILO_DEADLINE_S", "180"))
_PAUSE_S = 0.005


def wait_until(get: Callable[[], Result]) -> Result:
    """Return what `get` returns as soon as that is true; raise AssertionError if it never is."""
    deadline = time.monotonic() + DEADLINE_S
    while not (found := get()):
        assert time.monotonic() < deadline, f"nothing came within {DEADLINE_S} s"
        time.sleep(_PAUSE_S)
    return found


def answered(ask: Callable[[], Result]) -> Result | None:
    """Return what a client is answered; None while a helper process is gone, or says that it is to be asked again."""
    try:
        return ask()
    except ConnectionLostError:
        return None
    except RefusedError as refused:
        assert "ask again" in str(refused), refused
        return None


def freeze(pid: int) -> None:
    """Stop a process, and wait until each of its threads stands still.

    The signal goes to one of them, which stops the others when it gets a processor: on a busy computer a thread that
    has one goes on for 20 ms and more, in which a helper process judges hundreds of ticks.
    """
    os.kill(pid, signal.SIGSTOP)
    wait_until(lambda: all(_state(task) in "TtZX" for task in Path(f"/proc/{pid}/task").iterdir()))


def _state(task: Path) -> str:
    try:
        return (task / "stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return "X"

"""A segment that somebody cuts short while it is mapped: the helper process says so, and lives."""

import os
import signal
from pathlib import Path

import pytest

from silo.client.client import Client
from silo.core.elements import FileType, State
from silo.core.runtime import list_segments
from silo.errors import ConnectionLostError, RefusedError
from silo.rpc.published import EventKind
from silo.rpc.refusals import RequestRefusedError
from tests.ipc.conftest import Heard, RobotProcess
from tests.waiting import freeze

pytestmark = pytest.mark.slow

CUT = "somebody cut the segment short while it was in use|are too few for a segment|cut short, "

TRIES = 5  # one in 40 meets such a moment where four clients read as fast as they can, one in thousands where none does


def died_in_a_copy(robot: RobotProcess) -> bool:
    """Whether a helper process read just when it was cut: SIGBUS ends it, which nothing in Python holds off."""
    state, *_, code = Path(f"/proc/{robot.helper_pid}/stat").read_text().rpartition(")")[2].split()
    return state == "Z" and int(code) & 0x7F == signal.SIGBUS


@pytest.mark.parametrize("left_bytes", [0, 3 * 4096 + 5])
@pytest.mark.usefixtures("cold")
def test_the_helper_process_survives_a_segment_that_is_cut_short(left_bytes, robots, until):
    for _ in range(TRIES):
        robot = robots("bot")
        try:
            cut_short(robot, left_bytes, until)
        except ConnectionLostError:
            if not died_in_a_copy(robot):
                raise
            robot.end()
        else:
            break
    else:
        pytest.fail(f"{TRIES} helper processes were ended by the cut")


def cut_short(robot: RobotProcess, left_bytes: int, until) -> None:
    """Cut the segment of a robot program, and look what its helper process says."""
    with Client.connect("bot") as client:
        heard = Heard(client)
        until(lambda: client.status().ticks > 10)
        with client.view(["/log/x"], ["/log/x"], rate_hz=20) as view:
            until(view.frame)
            freeze(robot.pid)  # the program itself would end by SIGBUS: nothing holds that off
            (segment,) = (path for path in list_segments() if f".{robot.pid}." in path.name)
            os.truncate(segment, left_bytes)
            for _ in range(5):
                status = client.status()
            assert status.ticks == 0
            assert "somebody cut the segment short" in status.reason
            assert not status.saved
            for ask in (
                lambda: client.history(["/log/x"], 0, 10**9, 10**7),
                lambda: client.save([FileType.SILO]),
                lambda: client.history(["/log/x"], 0, 10**9, 10**7),
            ):
                with pytest.raises((RequestRefusedError, RefusedError), match=CUT):
                    ask()
            assert client.table().elements
        robot.kill()
        assert "ended without close(), and what it had logged can't be read" in heard.wait(EventKind.CRASHED).text
        status = client.status()
        assert (status.state, status.helper_pid) == (State.DEAD, robot.helper_pid)

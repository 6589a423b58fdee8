"""A segment that somebody cuts short while it is mapped: the helper process says so, and lives."""

import os

import pytest

from silo.client.client import Client
from silo.core.elements import FileType, State
from silo.core.runtime import list_segments
from silo.errors import RefusedError
from silo.rpc.published import EventKind
from silo.rpc.refusals import RequestRefusedError
from tests.ipc.conftest import Heard
from tests.waiting import freeze

pytestmark = pytest.mark.slow

CUT = "somebody cut the segment short while it was in use|are too few for a segment|cut short, "


@pytest.mark.parametrize("left_bytes", [0, 3 * 4096 + 5])
def test_the_helper_process_survives_a_segment_that_is_cut_short(left_bytes, robots, until):
    robot = robots("bot")
    with Client.connect("bot") as client:
        heard = Heard(client)
        until(lambda: client.status().ticks > 10)
        with client.view(["/log/x"], ["/log/x"], rate_hz=20) as view:
            until(view.frame)
            freeze(robot.pid)  # the program itself would end by SIGBUS: nothing holds that off
            (segment,) = list_segments()
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

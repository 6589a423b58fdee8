"""What a program assigned anew is told while the logger runs: in the status, as an event, in recordings."""

import os
import signal

import numpy as np
import pytest

import silo
from silo.cli.main import run
from silo.client.client import Client
from silo.files.event_log import read_events
from silo.rpc.published import EventKind
from tests.stand_ins.ticking import Robot, collect, warnings_of
from tests.waiting import wait_until

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::silo.LogWarning")]

ALONE = "nobody but silo holds this array any more"


@pytest.fixture
def stale(runtime, tmp_path):
    """A served logger that runs, one of its arrays assigned anew after some ticks."""
    robot, logger = Robot(), silo.Logger("arm", folder=tmp_path, script=tmp_path / "none.yaml")
    robot.q, robot.gains = logger.array("q", 3), np.ones(3)
    logger.add(robot.gains, "gains")
    logger.serve()
    logger.start()
    logger.record(name="all")
    for tick in range(5):
        robot.q[:] = tick
        logger.collect()
    robot.q = robot.q + 1
    logger.robot = robot
    yield logger
    logger.close()


def seen(logger):
    """Turn the loop until a client is told."""
    with Client.connect("arm") as client:
        return wait_until(lambda: collect(logger, 1) or client.status().unheld)


def test_the_status_and_info_name_it_while_the_loop_turns(stale, caplog, capsys):
    assert list(seen(stale)) == ["/log/q"]
    (warning,) = wait_until(lambda: [one for one in warnings_of(caplog) if ALONE in one])  # the status is told first
    assert warning.startswith("/log/q: ")
    assert "never changed" not in warning
    assert run(["info", "arm"]) == 0
    assert "unheld      nobody but silo holds the array any more, its values stay: /log/q" in capsys.readouterr().out


def test_one_event_tells_it_though_another_helper_process_comes(stale, tmp_path):
    tick = seen(stale)["/log/q"]
    wait_until(lambda: [one for one in read_events(tmp_path, "arm") if one.kind == EventKind.UNHELD])
    first = stale._life.serving.helper_pid
    os.kill(first, signal.SIGKILL)
    wait_until(lambda: stale._life.serving.is_up and stale._life.serving.helper_pid != first)
    collect(stale, 5)
    stale.mark("after it")
    events = wait_until(
        lambda: (
            [one for one in read_events(tmp_path, "arm") if one.kind in ("unheld", "marker")][1:]
            and read_events(tmp_path, "arm")
        )
    )
    (told,) = [one for one in events if one.kind == EventKind.UNHELD]
    assert (told.tick, told.text.startswith(f"/log/q: {ALONE}")) == (tick, True)


def test_its_recording_and_what_is_saved_say_it(stale, tmp_path):
    seen(stale)
    stale.stop()
    wait_until(lambda: "stopped" in [one.kind for one in read_events(tmp_path, "arm")])
    stale.stop_recording()
    saved = silo.open_log(stale.save().path)
    assert [warning for warning in saved.warnings if ALONE in warning]
    (part,) = (tmp_path / "recordings").glob("*.mcap")
    assert [warning for warning in silo.open_log(part).warnings if ALONE in warning]


def test_what_is_found_at_the_end_is_told_before_the_end(stale, tmp_path):
    stale.robot.gains = None
    stale.stop()
    kinds = wait_until(lambda: "stopped" in (found := [one.kind for one in read_events(tmp_path, "arm")]) and found)
    assert kinds.index("unheld") < kinds.index("stopped")

"""What could not be read is told while the logger runs, of the elements that failed."""

import json

import numpy as np
import pytest

import silo
from silo.cli.main import run
from silo.client.client import Client
from tests.waiting import wait_until

pytestmark = pytest.mark.slow


class Robot:
    mode: object = 1
    gait: object = 2


@pytest.fixture
def failing(runtime, tmp_path):
    """A served logger whose mode could not be read at three of eight ticks."""
    robot = Robot()
    logger = silo.Logger("arm", folder=tmp_path, script=tmp_path / "none.yaml")
    for name in ("gait", "mode"):
        logger.add(robot, attr=name, action=silo.Action.SAVE_AND_PUBLISH)
    x = logger.array("x", action=silo.Action.SAVE_AND_PUBLISH)
    logger.serve()
    logger.start()
    for tick in range(8):
        robot.mode = None if tick in (1, 2, 5) else tick
        x[...] = tick
        logger.collect()
    with Client.connect("arm") as client:
        wait_until(lambda: client.status().ticks == 8)  # the helper process knows of the start
    yield logger
    logger.close()


def test_the_status_counts_what_could_not_be_read(failing):
    with Client.connect("arm") as client:
        status = client.status()
    assert (status.failed, status.failed_most) == (3, {"/log/mode": 3})


def test_a_restart_counts_anew(failing):
    failing.restart()
    with Client.connect("arm") as client:
        assert client.status().failed == 0


def test_frames_count_it_for_the_elements_that_failed(failing, until):
    with Client.connect("arm") as client:
        view = client.view(values=["/log/x", "/log/mode", "/log/none"], rate_hz=30)
        frame = until(view.frame)
        assert frame.failed == {1: 3}
        assert np.array_equal(frame.newest[:2], [7, 7])


def test_info_names_the_elements(failing, capsys):
    assert run(["info", "arm"]) == 0
    assert "failed      3 samples could not be read: /log/mode at 3 ticks" in capsys.readouterr().out
    assert run(["info", "arm", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["status"]["failed_most"] == {"/log/mode": 3}

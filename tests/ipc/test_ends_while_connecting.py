"""A logger that ends as somebody connects to it: that is told, and who is there in its place is meant."""

import json
import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

import silo
import silo.types
from silo.client import connection
from silo.client.client import Client
from silo.errors import ConnectionLostError
from silo.fleet.resolving import discover
from tests.thin_net import free_port
from tests.waiting import DEADLINE_S, wait_until

pytestmark = pytest.mark.slow


def served(folder: Path, config: str | None = None) -> tuple[silo.Logger, silo.types.Serving]:
    logger = silo.Logger("bot", frequency=100, folder=folder, script=None)
    logger.add(np.zeros(3), "q")
    return logger, logger.serve(config=config)


@pytest.fixture
def meanwhile(monkeypatch):
    """Has something happen between the look at who is there and the first question."""
    exchange, todo = connection.exchange, []

    def late(*arguments, **options):
        while todo:
            todo.pop()()
        return exchange(*arguments, **options)

    monkeypatch.setattr(connection, "exchange", late)
    return todo


@pytest.fixture(params=["here", "over a network"])
def config(request, tmp_path) -> tuple[str | None, str]:
    if request.param == "here":
        return None, "local"
    port = free_port()
    robot, desk = tmp_path / "robot.json5", tmp_path / "desk.json5"
    robot.write_text(json.dumps({"listen": {"endpoints": [f"tcp/127.0.0.1:{port}"]}}))
    desk.write_text(json.dumps({"connect": {"endpoints": [f"tcp/127.0.0.1:{port}"]}}))
    return str(robot), str(desk)


def test_a_logger_that_is_closed_meanwhile_is_told_to_have_ended(runtime_folder, tmp_path, config, meanwhile) -> None:
    logger, _ = served(tmp_path / "logs", config[0])
    wait_until(lambda: discover(config=config[1]).loggers)
    meanwhile.append(lambda: logger.close(discard=True))
    begun_s = time.monotonic()
    with pytest.raises(ConnectionLostError, match=r"logger .*bot. ended just now"):
        Client.connect("bot", timeout_s=3.0 if config[0] else DEADLINE_S, config=config[1])
    assert config[0] or time.monotonic() - begun_s < DEADLINE_S / 2


def test_of_one_that_was_found_before_it_is_told_too(runtime_folder, tmp_path, meanwhile) -> None:
    logger, _ = served(tmp_path / "logs")
    (found,) = discover().loggers
    meanwhile.append(lambda: logger.close(discard=True))
    with pytest.raises(ConnectionLostError, match="logger 'bot' ended just now"):
        Client.connect(found, timeout_s=DEADLINE_S)


def test_one_that_was_made_anew_meanwhile_is_meant(runtime_folder, tmp_path, config, meanwhile) -> None:
    (logger, _), after = served(tmp_path / "logs", config[0]), []
    wait_until(lambda: discover(config=config[1]).loggers)

    def again():
        logger.close(discard=True)
        after.append(served(tmp_path / "logs", config[0]))

    meanwhile.append(again)
    with Client.connect("bot", timeout_s=DEADLINE_S, config=config[1]) as client:
        assert client.status().helper_pid == after[0][1].helper_pid
    after[0][0].close(discard=True)


def test_one_whose_helper_process_is_replaced_meanwhile_is_waited_for(
    runtime_folder, tmp_path, config, meanwhile
) -> None:
    logger, serving = served(tmp_path / "logs", config[0])
    with logger:
        wait_until(lambda: discover(config=config[1]).loggers)
        pid = serving.helper_pid
        meanwhile.append(lambda: os.kill(pid, signal.SIGKILL))
        with Client.connect("bot", timeout_s=DEADLINE_S, config=config[1]) as client:
            assert client.status().helper_pid != pid

"""What goes over a network is compressed where both sides have that; a thin link carries a table in parts."""

import contextlib
import json
import random
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import silo
from silo.client.client import Client
from silo.fleet.resolving import discover
from silo.net.session import close, open_router
from tests.thin_net import free_port
from tests.waiting import DEADLINE_S, wait_until

ELEMENTS = 400
PLAIN = {"transport": {"unicast": {"compression": {"enabled": False}}}}


class CountingLink:
    """A port that leads to another one, and how many bytes came back from there. A context manager.

    `bytes_per_s` is how many of them come at most, 0: as they come.
    """

    def __init__(self, port: int, bytes_per_s: int = 0) -> None:
        self.came_bytes, self._to, self._bytes_per_s = 0, port, bytes_per_s
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listening.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listening.accept()
                far = socket.socket()
                if self._bytes_per_s:  # else the kernel takes megabytes that nobody has read
                    far.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
                far.connect(("127.0.0.1", self._to))
                for ends in ((near, far), (far, near)):
                    threading.Thread(target=self._carry, args=(*ends, near), daemon=True).start()

    def _carry(self, source: socket.socket, target: socket.socket, near: socket.socket) -> None:
        with source, contextlib.suppress(OSError):
            is_back, at_once = target is near, 1024 if self._bytes_per_s else 65536
            while data := source.recv(at_once):
                self.came_bytes += len(data) if is_back else 0
                if self._bytes_per_s and is_back:
                    time.sleep(len(data) / self._bytes_per_s)
                target.sendall(data)
            target.shutdown(socket.SHUT_WR)

    def __enter__(self) -> "CountingLink":
        return self

    def __exit__(self, *_: object) -> None:
        self._listening.close()


@pytest.fixture
def robot(runtime_folder: Path, tmp_path: Path) -> Iterator[silo.Logger]:
    with silo.Logger("bot", frequency=100, folder=tmp_path / "logs", script=None) as logger:
        for number in range(ELEMENTS):
            logger.add(np.zeros(1), f"leg{number % 4}/torque{number}", unit="Nm")
        yield logger


def configured(folder: Path, **said: object) -> Path:
    path = folder / f"{'-'.join(said)}{len(list(folder.iterdir()))}.json5"
    path.write_text(json.dumps(said))
    return path


def table_bytes(link: CountingLink, folder: Path, **said: object) -> int:
    """How many bytes come over the link with the table, whole as it is."""
    desk = str(configured(folder, connect={"endpoints": [f"tcp/127.0.0.1:{link.port}"]}, **said))
    wait_until(lambda: discover(config=desk).loggers)
    with Client.connect("bot", config=desk, timeout_s=DEADLINE_S) as client:
        before = link.came_bytes
        table = client._table().table  # whole, as clients of before ask for it
        assert sum(one.unit == "Nm" for one in table.elements) == ELEMENTS
        return link.came_bytes - before


@pytest.mark.slow
def test_a_table_is_compressed_on_its_way_and_comes_whole_to_who_does_not_have_that(robot, tmp_path) -> None:
    port = free_port()
    config = configured(tmp_path, listen={"endpoints": [f"tcp/127.0.0.1:{port}"]})
    with robot.serve(config=config), CountingLink(port) as link:
        small, plain = table_bytes(link, tmp_path), table_bytes(link, tmp_path, **PLAIN)
    assert plain > 100 * ELEMENTS
    assert small < plain / 4


@pytest.mark.slow
def test_a_router_compresses_what_it_hands_on_also_of_a_robot_that_does_not(robot, tmp_path) -> None:
    port = free_port()
    there = {"endpoints": [f"tcp/127.0.0.1:{port}"]}
    router, _ = open_router(str(configured(tmp_path, listen=there)))
    try:
        with robot.serve(config=configured(tmp_path, connect=there, **PLAIN)), CountingLink(port) as link:
            small = table_bytes(link, tmp_path)
    finally:
        close(router)
    assert small < 25 * ELEMENTS


@pytest.mark.slow
def test_a_table_that_takes_a_thin_link_for_seconds_comes_in_parts(runtime_folder, tmp_path) -> None:
    port, digits = free_port(), random.Random(1)
    robot = configured(tmp_path, listen={"endpoints": [f"tcp/127.0.0.1:{port}"]})
    with silo.Logger("bot", frequency=100, folder=tmp_path / "logs", script=None) as logger:
        for _ in range(4000):  # which can't be compressed
            logger.add(np.zeros(1), f"x{digits.getrandbits(180):x}")
        with logger.serve(config=robot), CountingLink(port, 32_000) as link:
            desk = str(configured(tmp_path, connect={"endpoints": [f"tcp/127.0.0.1:{link.port}"]}))
            wait_until(lambda: discover(config=desk).loggers)
            with (
                Client.connect("bot", config=desk, timeout_s=DEADLINE_S) as far,
                Client.connect("bot", config="local") as near,
            ):
                shares: list[float] = []
                assert far.table(shares.append) == near.table()
                assert len(shares) > 5
                before = link.came_bytes
                far.table()
                assert link.came_bytes - before < 8000

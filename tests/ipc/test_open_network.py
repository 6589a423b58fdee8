"""A router that asks nobody who he is: whoever reaches it can send anything under a robot's keys. Who listens stays."""

import json
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import zenoh

import silo
from silo.errors import ConnectionLostError
from silo.fleet.fleet import Fleet
from silo.fleet.resolving import discover
from silo.net.configuration import FORCED, insert
from silo.net.session import close, open_router
from tests.thin_net import free_port
from tests.waiting import wait_until

pytestmark = pytest.mark.slow


class Open:
    """A router for everybody, a robot, and a session of somebody."""

    def __init__(self, folder: Path) -> None:
        there = f"tcp/127.0.0.1:{free_port()}"
        (folder / "router.json5").write_text(json.dumps({"listen": {"endpoints": [there]}}))
        (folder / "end.json5").write_text(json.dumps({"connect": {"endpoints": [there]}}))
        self.config = str(folder / "end.json5")
        self.router, _ = open_router(str(folder / "router.json5"))
        self.logger = silo.Logger("walker", folder=folder, script=folder / "walker.yaml")
        self.logger.add(np.zeros(3), "x", action=silo.Action.SAVE_AND_PUBLISH)
        self.logger.serve(config=self.config)
        wait_until(self.seen)
        settings = zenoh.Config()
        insert(settings, FORCED)
        for key, value in {"mode": "client", "connect/endpoints": [there], "listen/endpoints": []}.items():
            settings.insert_json5(key, json.dumps(value))
        self.somebody = zenoh.open(settings)

    def seen(self) -> list[str]:
        try:
            return [one.name for one in discover(config=self.config).loggers]
        except ConnectionLostError:
            return []

    def close(self) -> None:
        close(self.somebody)
        self.logger.close()
        close(self.router)


@pytest.fixture
def network(tmp_path: Path) -> Iterator[Open]:
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory(dir="/dev/shm") as runtime:
        patch.setenv("SILO_RUNTIME_DIR", runtime)
        made = Open(tmp_path)
        yield made
        made.close()


def test_bytes_of_somebody_end_no_view_no_stream_no_topic_and_no_list(network, caplog) -> None:
    somebody = network.somebody
    with (
        silo.connect("walker", config=network.config) as client,
        Fleet(network.config) as fleet,
        client.view(["/log/x"], rate_hz=30) as view,
        client.stream(["/log/x"]) as stream,
        client.topic("/log/x") as topic,
    ):
        root = client.found.root
        assert root is not None
        events = []
        client.on_event(events.append)
        for _ in range(10):
            for key in ("event", "summary", f"view/{view.request.view}", f"stream/{stream.request.stream}"):
                somebody.put(root.key(key), b"\x01")
            somebody.put(root.topic("/log/x"), b"\x01\x02\x03", encoding="silo/samples;dtype=<f8;shape=3")
        network.logger.start()
        for read in (view.frame, lambda: stream.read(0.0), topic.read):
            wait_until(lambda: network.logger.collect() or read())  # noqa: B023
        wait_until(lambda: events)
        network.logger.stop()
        wait_until(lambda: fleet.now().members[0].summary)
    told = [one for one in caplog.records if one.name == "silo.client"]
    assert {one.exc_info for one in told} <= {None}
    assert len(told) <= 4  # once of each kind, whatever their number


def test_a_reply_under_another_key_than_was_asked_is_none(network) -> None:
    with silo.connect("walker", config=network.config) as client:
        root = client.found.root
        assert root is not None

        def lie(query: zenoh.Query) -> None:
            with query:
                query.reply("silo/*/*/ask", b"\x81\xa4type\xa4Done")

        declared = network.somebody.declare_queryable("silo/*/*/ask", lie)
        for _ in range(20):
            assert client.status().logger == "walker"
        declared.undeclare()

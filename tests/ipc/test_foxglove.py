"""The Foxglove bridge: every sample of what is subscribed to, for everybody, and nothing for strangers."""

import asyncio
import fcntl
import functools
import http.server
import importlib.util
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlencode

import psutil
import pytest

import silo
from silo.bridges.feed import LoggerFollower
from silo.bridges.foxglove.guard import refusal
from silo.bridges.listening import bound
from silo.bridges.services import services, setting
from silo.client.client import Client
from silo.core.elements import Edit, ElementOptions, State
from silo.fleet.exchange import client_name
from tests import chromium
from tests.ipc.conftest import Bench
from tests.stand_ins.ticking import turning
from tests.waiting import DEADLINE_S, wait_until

pytestmark = pytest.mark.skipif(importlib.util.find_spec("websockets") is None, reason="needs silo-logger[foxglove]")
if importlib.util.find_spec("websockets"):
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    from silo.bridges.foxglove import server as viewers
    from silo.bridges.foxglove.server import Terms, ViewerServer
    from tests.stand_ins.foxglove_viewer import WEBSOCKET, Viewer

SCRIPTS = {"foxglove_client.mjs": "node", "foxglove_page.mjs": "browser"}
NODE_PACKAGES = (
    "@foxglove/ws-protocol@0.8.0", "@foxglove/rosmsg@5.0.5", "@foxglove/rosmsg2-serialization@3.1.0", "ws@8.23.0",
    "esbuild@0.28.2",
)  # fmt: skip
ALL_TOPICS = [f"/log/{name}" for name in ("x", "q", "matrix", "gait", "word", "mixed", "kept")]

READS = ["time", "parameters", "parametersSubscribe"]
DAMAGED = [
    '{"op": "setParameters"}', '{"op": "setParameters", "parameters": [{"name": "/log/kp", "value": {"a": 1}}]}',
    '{"op": "setParameters", "parameters": [{"name": "/log/kp"}]}', '{"op": "getParameters"}',
    '{"op": "getParameters", "parameterNames": 5}',
    "{", "[]", '"op"', "{}", '{"op": "subscribe"}', '{"op": "subscribe", "subscriptions": [{"id": "x"}]}',
    '{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}]}',
    '{"op": "unsubscribe", "subscriptionIds": 5}', '{"op": "unsubscribe", "subscriptionIds": [Infinity]}',
    json.dumps({"op": "subscribeParameterUpdates", "parameterNames": [*range(70_000)]}),
    '{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 99999}]}', '{"op": "advertise", "channels": []}',
    b"", b"\x02", b"\x02" + b"\xff" * 12, b"\x01" * 40,
]  # fmt: skip


class Bridge:
    """A server in a thread of this process, and what it said."""

    def __init__(self, **terms: object) -> None:
        self.said: list[str] = []
        self.listening = bound("127.0.0.1", 0)
        self.listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)  # soon full for who doesn't read
        self.port = self.listening.getsockname()[1]
        self.url = f"ws://localhost:{self.port}"
        self._terms = Terms("bot", **terms)
        self._begun = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()))
        self._thread.start()
        self._begun.wait()

    async def _serve(self) -> None:
        self._loop, self._ended = asyncio.get_running_loop(), asyncio.Event()
        self._begun.set()
        self.server = ViewerServer(
            self._terms, lambda listener: LoggerFollower(lambda: Client.connect("bot"), listener), self.said.append
        )
        await self.server.serve(self.listening, self._ended)

    def reads(self, *names: str) -> None:
        """Wait until the samples of exactly these elements come."""
        wait_until(lambda: self.server._feed._streamed == set(names))

    def has_read(self, time_ns: int) -> None:
        """Wait until the tick of this time has come."""
        wait_until(lambda: self.server._newest_ns >= time_ns)

    def close(self) -> None:
        self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join()
        self.listening.close()


@pytest.fixture
def bridge(bench: Bench) -> Iterator[Callable[..., Bridge]]:
    """Starts bridges to the bench's logger."""
    started: list[Bridge] = []

    def start(**terms: object) -> Bridge:
        started.append(Bridge(**terms))
        return started[-1]

    yield start
    for one in started:
        one.close()


@pytest.fixture
def look(bridge: Callable[..., Bridge]) -> Iterator[Callable[..., "Viewer"]]:
    """Connects viewers to a bridge, the first one's unless another is named."""
    opened: list[Viewer] = []
    bridges: list[Bridge] = []

    def connect(*topics: str, to: Bridge | None = None, **arguments: object) -> Viewer:
        if to is None:
            bridges.extend([bridge()] if not bridges else [])
            to = bridges[0]
        opened.append(Viewer(to.url, **arguments))
        opened[-1].wait_for(*topics or ("/log/x",))
        return opened[-1]

    yield connect
    for one in opened:
        one.close()


def switch(client: Client, name: str, on: bool) -> None:
    client.apply([Edit(name, ElementOptions(enabled=on, action=silo.Action.SAVE_AND_PUBLISH))], -1)


class TestTopics:
    def test_every_element_that_is_on_is_offered_and_without_control_no_request_does_anything(self, bench, look):
        viewer = look("/log/kept", "/log/mixed")
        assert set(viewer.channels) == {
            f"/log/{name}" for name in ("x", "q", "matrix", "gait", "word", "mixed", "slow", "kept")
        }
        assert {channel["encoding"] for channel in viewer.channels.values()} == {"cdr"}
        assert {channel["schemaEncoding"] for channel in viewer.channels.values()} == {"ros2msg"}
        assert (viewer.info["supportedEncodings"], viewer.info["capabilities"]) == (["cdr"], READS)
        assert b"read-only" in viewer.call(1, 1)
        assert bench.logger._life.state is State.STOPPED
        for request in DAMAGED:
            viewer.socket.send(request)
            assert viewer.json("status")["message"], request
        viewer.subscribe(_1="/log/x")

    def test_what_can_be_offered_is_found_out_by_the_feed_and_no_viewer_waits_for_that(self, bench, look, monkeypatch):
        threads, found_out = set(), viewers.live_topics

        def noted(elements):
            threads.add(threading.current_thread().name)
            return found_out(elements)

        monkeypatch.setattr(viewers, "live_topics", noted)
        look("/log/x")
        assert threads == {"feed"}

    def test_what_is_switched_off_is_taken_back_and_keeps_its_number_until_it_is_on_again(self, client, bridge, look):
        one = bridge()
        viewer = look("/log/q", to=one)
        viewer.subscribe(_1="/log/q")
        (known,) = one.server._viewers
        wait_until(lambda: known.channels)
        number = viewer.channels["/log/q"]["id"]
        switch(client, "/log/q", False)
        assert viewer.json("unadvertise")["channelIds"] == [number]
        switch(client, "/log/q", True)
        viewer.json("advertise")
        assert viewer.channels["/log/q"]["id"] == number
        viewer.subscribe(_2="/log/q")
        wait_until(lambda: known.subscriptions == {2: number})


class TestSamples:
    def test_each_is_there_once_with_its_time_and_value_as_other_people_decode_it(self, bench, client, bridge, look):
        one = bridge()
        viewer = look("/log/x", "/log/q", to=one)
        viewer.subscribe(_1="/log/x", _2="/log/q")
        one.reads("/log/x", "/log/q")
        client.start()
        bench.q[:] = 1, 2, 3
        bench.ticks(300)
        found = {"/log/x": [], "/log/q": []}
        for _ in range(600):
            topic, time_ns, message = viewer.message()
            stamp = message.header.stamp
            assert stamp.sec * 10**9 + stamp.nanosec == time_ns
            found[topic].append((time_ns, message))
        times = [bench.begin_ns + tick * bench.tick_ns for tick in range(300)]
        assert [time_ns for time_ns, _ in found["/log/x"]] == times
        assert [message.value for _, message in found["/log/x"]] == list(range(1, 301))
        assert [time_ns for time_ns, _ in found["/log/q"]] == times
        vector = found["/log/q"][0][1].vector
        assert (vector.x, vector.y, vector.z) == (1, 2, 3)

    def test_every_type_arrives(self, bench, client, bridge, look):
        expected = {
            "/log/matrix": [1, 2, 3, 4], "/log/gait": 1, "/log/word": "größe", "/log/kept": 2.5, "/log/mixed": (0.5, 7),
        }  # fmt: skip
        one = bridge()
        viewer = look(*expected, to=one, subprotocol=WEBSOCKET)
        viewer.subscribe(**{f"_{number}": topic for number, topic in enumerate(expected)})
        one.reads(*expected)
        bench.matrix[:], bench.gait[...], bench.kept[...], bench.mixed[...] = [[1, 2], [3, 4]], 1, 2.5, (0.5, 7)
        bench.word[...] = "größe".encode()
        client.start()
        bench.ticks(1)
        got = {}
        for _ in expected:
            topic, _, message = viewer.message()
            value = (message.a, message.n) if topic == "/log/mixed" else message.value
            got[topic] = value.tolist() if hasattr(value, "tolist") else value
        assert got == expected

    def test_a_derived_signal_is_one_of_them_from_when_it_is_derived(self, bench, client, bridge, look):
        one = bridge()
        viewer = look("/log/x", to=one)
        client.start()
        client.derive("twice", "2 * x")
        viewer.wait_for("/log/twice")
        viewer.subscribe(_1="/log/twice")
        one.reads("/log/twice")
        bench.ticks(3)
        assert [viewer.message()[2].value for _ in range(3)] == [2, 4, 6]
        client.derive("twice", None)
        viewer.json("unadvertise")
        assert "/log/twice" not in viewer.channels

    def test_a_subscription_more_or_less_costs_the_others_no_sample(self, bench, client, bridge, look):
        one = bridge()
        viewer = look("/log/x", "/log/q", "/log/kept", to=one)
        viewer.subscribe(_1="/log/x")
        one.reads("/log/x")
        client.start()
        found = []

        def turn() -> None:
            bench.ticks(1)
            while len(found) < int(bench.x):
                topic, _, message = viewer.message()
                if topic == "/log/x":
                    found.append(message.value)

        for change, names in [
            (lambda: viewer.subscribe(_2="/log/q"), {"/log/x", "/log/q"}),
            (lambda: viewer.subscribe(_3="/log/kept"), {"/log/x", "/log/q", "/log/kept"}),
            (lambda: viewer.unsubscribe(2, 3), {"/log/x"}),
        ]:
            change()
            while one.server._feed._streamed != names:
                turn()
            turn()
        assert found == list(range(1, len(found) + 1))

    def test_what_nobody_subscribes_to_is_not_read(self, bridge, look):
        one = bridge()
        viewer = look("/log/x", to=one)
        viewer.subscribe(_1="/log/x")
        one.reads("/log/x")
        viewer.close()
        one.reads()

    def test_a_stream_that_is_refused_comes_when_there_is_room_for_it(self, bench, client, bridge, look):
        others = [Client.connect("bot") for _ in range(4)]
        for _ in range(8):
            for other in others:
                other.stream(["/log/x"])
        one = bridge()
        viewer = look("/log/x", to=one)
        viewer.subscribe(_1="/log/x")
        wait_until(lambda: one.said)
        for other in others:
            other.close()
        one.reads("/log/x")
        client.start()
        bench.ticks(5)
        assert viewer.message()[0] == "/log/x"
        assert one.said == ["the stream can't be opened: 32 streams are open already; close others first"]

    def test_a_frozen_viewer_loses_messages_and_holds_up_nobody(self, bench, client, bridge, look, monkeypatch):
        monkeypatch.setattr(viewers, "QUEUE_BYTES", 20_000)
        one = bridge()
        frozen, other = look("/log/q", to=one), look("/log/q", to=one)
        for viewer in (frozen, other):
            viewer.subscribe(_1="/log/q")
        one.reads("/log/q")
        client.start()
        got = 0
        while not any(viewer.dropped for viewer in one.server._viewers):
            bench.ticks(500)
            for _ in range(500):
                assert other.message()[0] == "/log/q"
                got += 1
        assert [bool(viewer.dropped) for viewer in one.server._viewers].count(True) == 1


class TestStrangers:
    @pytest.mark.parametrize(("origin", "path", "host", "says"), [
        (None, "/key", "localhost:1", ""), ("https://my.page", "/key?a", "127.0.0.1", ""),
        ("", "/key", "localhost", "pages of  may not connect"), ("null", "/key", "localhost", "may not connect"),
        ("http://localhost.evil", "/key", "localhost", "may not connect"), (None, "/kez", "localhost", "not the token"),
        (None, "/", "localhost", "not the token"), (None, "/key", "evil.example", "is no address of this computer"),
    ])  # fmt: skip
    def test_who_may_connect(self, origin, path, host, says):
        said = refusal(path, host, origin, "key", ["https://my.page"], on_loopback=True)
        assert says in said
        assert bool(says) == bool(said)

    def test_viewers_that_are_known_may_connect_and_no_page_of_somebody_by_whatever_name(self, bridge, look):
        one = bridge()
        for origin in ("https://app.foxglove.dev", "http://localhost:8080", "file://"):
            assert look(origin=origin, to=one).info["op"] == "serverInfo"
        with pytest.raises(InvalidStatus, match="403"):
            look(origin="https://evil.example", to=one)
        bent = one.url.replace("localhost", "127.0.0.1.nip.example")  # a name that leads to this computer
        with (
            pytest.raises(InvalidStatus, match="403"),
            connect(bent, sock=socket.create_connection(("127.0.0.1", one.port))),
        ):
            pass

    def test_a_request_that_says_twice_where_it_goes_or_is_from_is_refused(self, bridge, caplog, capfd):
        one = bridge()
        for more in ("Host: evil.example", "Origin: file://\r\nOrigin: https://evil.example"):
            head = f"GET / HTTP/1.1\r\nHost: localhost\r\n{more}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
            with socket.create_connection(("127.0.0.1", one.port)) as stream:
                stream.sendall(f"{head}Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {'A' * 22}==\r\n\r\n".encode())
                assert stream.recv(1000).startswith(b"HTTP/1.1 400 ")
        assert "Traceback" not in caplog.text + "".join(capfd.readouterr())

    def test_a_topic_is_subscribed_to_once_by_each_viewer(self, bench, bridge, look):
        one = bridge()
        viewer = look(to=one)
        viewer.subscribe(_1="/log/x", _2="/log/q")
        viewer.subscribe(_3="/log/x")
        assert "is subscribed to already" in viewer.json("status")["message"]
        viewer.unsubscribe(1)
        viewer.subscribe(_3="/log/x")
        (known,) = one.server._viewers
        wait_until(lambda: sorted(known.subscriptions) == [2, 3])
        assert known.channels == set(known.subscriptions.values())

    def test_with_control_and_its_token_it_is_started_and_stopped_and_events_say_by_whom(self, bench, bridge, look):
        one = bridge(token="secret", services=services(lambda: Client.connect("bot"), "bot"))
        with pytest.raises(InvalidStatus, match="403"):
            look(to=one)
        one.url += "/secret"
        viewer = look(to=one)
        assert viewer.info["capabilities"] == [*READS, "services"]
        assert viewer.wait_for_services() == ["/bot/start", "/bot/stop", "/bot/save"]
        answer = viewer.call(1, 44)
        assert (answer[4], b"running" in answer) == (1, True)
        assert bench.logger._life.state is State.RUNNING
        with Client.connect("bot") as client:
            told = wait_until(lambda: [one for one in client.events() if one.kind == "started"])
        assert told[-1].who.startswith(client_name())  # who runs the bridge, beside who called it
        assert told[-1].who.endswith(" for a Foxglove viewer at 127.0.0.1")
        assert b"stopped" in viewer.call(2, 45)
        assert bench.logger._life.state is State.STOPPED

    def test_a_flood_of_what_is_refused_is_told_once(self, bench, bridge, look):
        one = bridge()
        viewer = look(to=one)
        for number in range(100):
            viewer.socket.send(json.dumps({"op": "setParameters", "parameters": [{"name": "kp", "value": number}]}))
        for _ in range(100):
            assert "read-only" in viewer.json("status")["message"]
        assert len(one.said) == 1

    def test_who_asks_and_does_not_read_fills_no_memory(self, bench, bridge, look, monkeypatch):
        waited: list[int] = []
        monkeypatch.setattr(viewers, "QUEUE_BYTES", 20_000)
        for number in range(50):
            bench.logger.parameter(f"p{number}", 1.0)
        one = bridge()
        viewer = look(to=one)
        wait_until(lambda: len(one.server._parameters) == 50)
        (known,) = one.server._viewers
        write = known.write

        def seen(frames: bytes) -> None:
            waited.append(known.connection.transport.get_write_buffer_size())
            write(frames)

        monkeypatch.setattr(known, "write", seen)
        asks = [json.dumps({"op": "getParameters", "parameterNames": [], "id": str(number)}) for number in range(2000)]
        asking = threading.Thread(target=lambda: [viewer.socket.send(ask) for ask in asks])
        asking.start()
        wait_until(lambda: waited and waited[-1] > 40_000 - 5_000)
        assert [viewer.json("parameterValues")["id"] for _ in asks] == [str(number) for number in range(2000)]
        asking.join()
        assert max(waited) <= 40_000


class TestParameters:
    @pytest.fixture
    def tuned(self, bench, bridge, look):
        """A viewer of a logger with four parameters, whose loop turns, and that may set them."""
        logger = bench.logger
        logger.parameter("kp", 40.0, min=0, max=200)
        logger.parameter("style", "trot", choices=("walk", "trot"))
        logger.parameter("limits", [1.0, 2.0], writable="anywhere")
        logger.parameter("steps", 5)
        one = bridge(tune=setting(lambda: Client.connect("bot")))
        viewer = look(to=one)
        wait_until(lambda: len(one.server._parameters) == 4)
        logger.start()
        with turning(logger.collect):
            yield viewer, logger

    def test_they_are_read_set_together_and_whoever_subscribes_hears_of_each_change(self, tuned, look):
        viewer, logger = tuned
        known = {"/log/kp": 40.0, "/log/style": "trot", "/log/limits": [1.0, 2.0], "/log/steps": 5}
        assert viewer.parameters("getParameters", parameterNames=[]) == known
        viewer.socket.send(json.dumps({"op": "subscribeParameterUpdates", "parameterNames": ["/log/kp", "/log/none"]}))
        first = viewer.json("parameterValues")
        assert first["parameters"] == [{"name": "/log/kp", "value": 40.0, "type": "float64"}]
        new = {"/log/style": "walk", "/log/limits": [3, 4], "/log/steps": 6}
        given = [{"name": name, "value": value} for name, value in new.items()]
        assert viewer.parameters("setParameters", parameters=given) == new
        (change,) = logger._present.run.reader.changes(0)
        assert change.who.endswith(" for a Foxglove viewer at 127.0.0.1")
        logger.parameters["kp"].value = 50.0
        assert viewer.json("parameterValues")["parameters"] == [{"name": "/log/kp", "value": 50.0, "type": "float64"}]

    def test_what_is_refused_is_told_in_the_robots_words_and_answered_with_what_is(self, tuned):
        viewer, logger = tuned
        for value in (201, "much", [1.0, 2.0], 10**400):
            given = [{"name": "/log/steps", "value": 6}, {"name": "/log/kp", "value": value}]
            viewer.told.clear()
            assert viewer.parameters("setParameters", parameters=given) == {"/log/steps": 5, "/log/kp": 40.0}
            assert "nothing was" in viewer.told[-1]
        assert logger.parameters.read()["/log/steps"] == 5

    def test_who_comes_from_another_computer_sets_what_is_open_to_those(self, tuned, monkeypatch):
        from silo.bridges.foxglove import server

        viewer, logger = tuned
        monkeypatch.setattr(server, "LOOPBACK", ())
        for name, value, words in (("/log/kp", 50.0, "it is set on the robot alone"), ("/log/limits", [3.0, 4.0], "")):
            viewer.told.clear()
            viewer.parameters("setParameters", parameters=[{"name": name, "value": value}])
            assert words in "".join(viewer.told)
            assert bool(viewer.told) == bool(words)
        assert logger.parameters["limits"].value.tolist() == [3.0, 4.0]

    def test_without_control_they_are_read_alone(self, bench, look):
        bench.logger.parameter("kp", 40.0)
        viewer = look()
        wait_until(lambda: viewer.parameters("getParameters", parameterNames=[]))
        viewer.parameters("setParameters", parameters=[{"name": "/log/kp", "value": 50.0}])
        assert "read-only" in viewer.told[-1]
        bench.logger.collect()
        assert bench.logger.parameters["kp"].value == 40.0


def taken(bind: str, port: int) -> socket.socket:
    raise silo.SiloError("the port is taken")


class TestPrograms:
    @pytest.mark.slow
    def test_serve_has_a_bridge_of_its_own_that_ends_with_it_and_says_nothing(self, runtime_folder, tmp_path, capfd):
        with silo.Logger("bot", frequency=100, folder=tmp_path) as log:
            log.array("x", 2)
            with log.serve(foxglove=0) as serving:
                viewer = Viewer(f"ws://localhost:{serving.foxglove_port}")
                viewer.wait_for("/log/x")
                pid = serving._viewers.process.pid
                viewer.close()
        assert not Path(f"/proc/{pid}").exists()
        assert capfd.readouterr().err == ""

    @pytest.mark.slow
    def test_that_bridge_ends_by_itself_while_a_forked_child_lives_on(self, runtime_folder, tmp_path):
        with silo.Logger("bot", frequency=100, folder=tmp_path) as log:
            log.array("x", 2)
            serving = log.serve(foxglove=0)
            child = os.fork()
            if child == 0:
                signal.pause()
            try:
                bridge, serving.alive = serving._viewers.process, False  # else it would be started anew
                os.eventfd_write(serving._wake, 1)
                serving._thread.join()
                bridge.stdin.close()
                assert bridge.wait_within(DEADLINE_S) == 0
            finally:
                os.kill(child, signal.SIGKILL)
                os.waitpid(child, 0)

    @pytest.mark.slow
    def test_when_that_bridge_dies_another_is_started_at_its_port(self, runtime_folder, tmp_path, caplog, monkeypatch):
        monkeypatch.setattr("silo.logger.serving.process.RESPAWN_DELAYS_S", (0.0,))
        with silo.Logger("bot", frequency=100, folder=tmp_path) as log:
            log.array("x", 2)
            with log.serve(foxglove=0) as serving:
                for sent in (signal.SIGKILL, signal.SIGTERM):
                    died, port = serving._viewers.process, serving.foxglove_port
                    os.kill(died.pid, sent)
                    wait_until(lambda: serving._viewers.process is not died)  # noqa: B023
                    viewer = Viewer(f"ws://localhost:{port}")
                    viewer.wait_for("/log/x")
                    viewer.close()
        assert "the process that serves Foxglove died (exit code -9), starting a new one" in caplog.text

    @pytest.mark.slow
    def test_while_its_port_is_taken_that_is_said_and_tried_again(self, runtime_folder, tmp_path, caplog, monkeypatch):
        monkeypatch.setattr("silo.logger.serving.process.RESPAWN_DELAYS_S", (0.3,))
        with silo.Logger("bot", frequency=100, folder=tmp_path) as log:
            log.array("x", 2)
            serving = log.serve(foxglove=0)
            died, port = serving._viewers.process, serving.foxglove_port
            with monkeypatch.context() as broken:
                broken.setattr("silo.logger.serving.process.bound", taken)
                os.kill(died.pid, signal.SIGKILL)
                wait_until(lambda: caplog.text.count("it is tried again in 0.3 s") > 1)
            assert "Foxglove isn't served: the port is taken; logging goes on" in caplog.text
            wait_until(lambda: serving._viewers.process is not died)
            viewer = Viewer(f"ws://localhost:{port}")
            viewer.wait_for("/log/x")
            viewer.close()

    @pytest.mark.slow
    def test_a_port_that_is_taken_is_said_and_no_helper_is_left(self, runtime_folder, tmp_path):
        with bound("127.0.0.1", 0) as taken, silo.Logger("bot", frequency=100, folder=tmp_path) as log:
            port = taken.getsockname()[1]
            words = f"can't listen at 127.0.0.1 port {port}: Address already in use; port 0 takes one that is free"
            with pytest.raises(silo.SiloError) as refused:
                log.serve(foxglove=port)
            assert str(refused.value) == words
            log.serve().close()

    @pytest.mark.slow
    def test_the_bridge_of_a_robot_that_is_killed_ends(self, robots, tmp_path):
        robot = robots("bot", "", "foxglove")
        (pid,) = [
            one.pid  # others end meanwhile
            for one in psutil.process_iter(["cmdline"])
            if f"--logger bot.{robot.pid} " in " ".join(one.info["cmdline"] or ()) + " "
        ]
        robot.kill()
        wait_until(lambda: not Path(f"/proc/{pid}").exists())

    def test_the_command_says_where_and_goes_on_when_the_robot_is_started_anew(self, bench, tmp_path):
        command = [sys.executable, "-c", "from silo.cli import main; main()", "foxglove", "bot", "--port", "0"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
            address = program.stdout.readline().split()[-1]
            try:
                viewer = Viewer(address)
                viewer.wait_for("/log/kept")
                bench.logger.close()
                viewer.json("unadvertise")
                with silo.Logger("bot", frequency=100, folder=tmp_path) as again:
                    again.array("fresh", 2)
                    again.serve()
                    viewer.wait_for("/log/fresh")
                viewer.close()
            finally:
                program.send_signal(signal.SIGINT)
            assert program.wait(DEADLINE_S) == 0


@pytest.fixture(scope="module")
def bundles(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with Foxglove's own client and decoders from npm, as a program for node and a page for browsers."""
    if shutil.which("npm") is None:
        pytest.skip("needs node and npm")
    own = tmp_path_factory.getbasetemp()
    folder = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "foxglove"  # one for all workers of a run
    folder.mkdir(exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "page.html").exists():
            bundle(folder)
    return folder


def bundle(folder: Path) -> None:
    for script in Path(__file__).parent.glob("foxglove_*.mjs"):
        shutil.copy(script, folder)
    options = ["--silent", "--no-audit", "--no-fund", "--prefer-offline", "--fetch-retries", "0"]
    command = ["npm", "install", *options, *NODE_PACKAGES]
    if subprocess.run(command, cwd=folder, capture_output=True, check=False).returncode:
        pytest.skip("npm can't install Foxglove's client")
    for script, platform in SCRIPTS.items():
        command = ["npx", "esbuild", script, "--bundle", f"--platform={platform}", f"--outfile={script}.js"]
        subprocess.run(command, cwd=folder, capture_output=True, check=True)
    page = '<!doctype html><link rel="icon" href="data:,"><script src="foxglove_page.mjs.js"></script>'
    (folder / "page.html").write_text(page)


def tick_once_read(bench: Bench, client: Client, one: Bridge) -> None:
    """Give a viewer that subscribes to all topics 3,000 ticks, as fast as they are read."""
    one.reads(*ALL_TOPICS)
    client.start()
    for _ in range(10):
        bench.ticks(300)
        one.has_read(bench.now_ns - bench.tick_ns)


@pytest.mark.slow
@pytest.mark.parametrize("subprotocol", ["foxglove.sdk.v1", "foxglove.websocket.v1"])
def test_foxgloves_own_client_decodes_every_message(bench, client, bridge, bundles, subprotocol):
    one = bridge()
    command = ["node", "foxglove_client.mjs.js", one.url, subprotocol, "20000", *ALL_TOPICS]
    with subprocess.Popen(command, cwd=bundles, stdout=subprocess.PIPE, text=True) as program:
        tick_once_read(bench, client, one)
        got = json.loads(program.stdout.readline())
    assert got == {"total": 20_000, "wrong": 0, "topics": len(ALL_TOPICS)}


@pytest.fixture
def site(bundles: Path) -> Iterator[str]:
    """Where a browser finds the page."""
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=bundles)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever).start()
        yield f"http://localhost:{server.server_port}"
        server.shutdown()


@pytest.mark.slow
@pytest.mark.skipif(chromium.PROGRAM is None, reason="needs Chromium (apt install chromium)")
@pytest.mark.skipif(importlib.util.find_spec("aiohttp") is None, reason="needs silo-logger[web]")
def test_it_does_so_in_a_browser(bench, client, bridge, site):
    one = bridge()
    facts = {"url": one.url, "subprotocol": "foxglove.sdk.v1", "count": 20_000, "topic": ALL_TOPICS}

    async def counted() -> object:
        async with chromium.opened(f"{site}/page.html?{urlencode(facts, doseq=True)}") as page:
            await asyncio.to_thread(tick_once_read, bench, client, one)
            while (found := await page.value("window.counted")) is None:
                await asyncio.sleep(0.05)
            assert not page.complaints
            return found

    got = asyncio.run(asyncio.wait_for(counted(), DEADLINE_S))
    assert got == {"total": 20_000, "wrong": 0, "topics": len(ALL_TOPICS)}

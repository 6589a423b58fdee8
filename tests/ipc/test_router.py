"""A router by the files of `silo remote init`: robots connect to it with a password of theirs, desks with a role."""

import contextlib
import json
import re
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

import silo
from silo.cli.loggers.follow import screen_lines
from silo.cli.main import run
from silo.cli.network.authority import Made, make_network
from silo.client.client import Client
from silo.errors import ConnectionLostError, RefusedError
from silo.fleet.exchange import exchange
from silo.fleet.fleet import Fleet
from silo.fleet.resolving import discover
from silo.net.session import close, open_router
from silo.net.sessions import borrowed
from silo.state.requests import Hello
from silo.version import VERSION
from silo_tui.sessions.finder import ClientFinder
from tests.thin_net import free_port
from tests.waiting import wait_until

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("openssl") is None, reason="makes certificates with openssl"),
]


class Site:
    """A router, and a robot that is connected to it."""

    def __init__(self, folder: Path) -> None:
        port = free_port()
        users = {"alice": "operator", "bob": "viewer", "robots": "robot"}
        self.made: Made = make_network(folder / "lab", ["localhost"], port, users, "127.0.0.1")
        self.server = str(self.made.server / "server.json5")
        self.router, self.endpoints = open_router(self.server)
        self.logger = silo.Logger("walker", folder=folder / "logs", script=folder / "walker.yaml")
        self.logger.add(np.zeros(3), "x", action=silo.Action.SAVE_AND_PUBLISH)
        self.serving = self.logger.serve(config=self.made.clients["robots"])
        wait_until(lambda: self.sees("alice"))

    def config(self, user: str) -> str:
        return str(self.made.clients[user])

    def sees(self, user: str) -> list[str]:
        try:
            return [found.name for found in discover(config=self.config(user)).loggers]
        except ConnectionLostError:
            return []

    def close(self) -> None:
        self.logger.close()
        close(self.router)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory(dir="/dev/shm") as runtime:
        patch.setenv("SILO_RUNTIME_DIR", runtime)
        made = Site(tmp_path_factory.mktemp("site"))
        yield made
        made.close()


def test_roles_hold_at_the_router(site) -> None:
    with silo.connect("walker", config=site.config("bob")) as viewer:
        assert not viewer._hello().may_edit
        with (
            viewer.view(["/log/x"], rate_hz=30) as view,
            silo.connect("walker", config=site.config("alice")) as operator,
        ):
            operator.start()
            site.logger.collect()
            wait_until(view.frame)
            with pytest.raises(RefusedError, match=r"may look at .*, not change it"):
                viewer.stop()
            operator.stop()


def test_a_user_is_admitted_to_its_own_name_alone_and_so_events_say_proven(site) -> None:
    question = Hello(version=VERSION, client="alice@desk silo 1")
    with borrowed("", site.config("alice")) as mine:
        (found,) = discover(config=site.config("alice")).loggers
        for name in ("bob", "carol", "robots", "@local", "*"):
            with pytest.raises(ConnectionLostError, match="gave no answer"):
                exchange(replace(mine, user=name), found.root, question, 1.0, "walker", as_change=True)
        exchange(mine, found.root, question, 1.0, "walker", as_change=True)
    with silo.connect("walker", config=site.config("alice")) as operator:
        operator.start("discard")
        operator.stop()
        told = wait_until(lambda: [one for one in operator.events() if one.kind == "stopped"])
    assert told[-1].who.startswith(f"alice (proven) from {socket.gethostname()}, ")


def test_a_change_that_the_router_keeps_from_the_robot_is_told_there_by_a_proven_name(site) -> None:
    with silo.connect("walker", config=site.config("alice")) as operator:
        with (
            silo.connect("walker", config=site.config("bob")) as viewer,
            pytest.raises(RefusedError, match="not change"),
        ):
            viewer.save()
        told = [one for one in operator.events() if one.kind == "denied" and "save" in one.text]
    assert told[-1].who.startswith("bob (proven) from ")


@pytest.fixture
def refusing(tmp_path, monkeypatch) -> Iterator[tuple["subprocess.Popen[str]", Made, str]]:
    """A router of its own, its files, and that of somebody who guesses a password."""
    users = {"alice": "operator", "bob": "viewer"}
    made = make_network(tmp_path / "lab", ["localhost"], free_port(), users, "127.0.0.1")
    alice = made.clients["alice"]
    wrong = alice.with_name("wrong.json5")
    wrong.write_text(re.sub(r'"password": "[^"]*"', '"password": "guess"', alice.read_text()))
    program = "import sys; from silo.cli.main import run; sys.exit(run(sys.argv[1:]))"
    command = [sys.executable, "-c", program, "router", "--config", str(made.server / "server.json5")]
    with (
        tempfile.TemporaryDirectory(dir="/dev/shm") as runtime,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as router,
    ):
        monkeypatch.setenv("SILO_RUNTIME_DIR", runtime)
        assert "router on tls/" in router.stdout.readline()
        yield router, made, str(wrong)
        router.terminate()
        assert "router ended" in router.stdout.read()


def guess(wrong: str) -> None:
    with pytest.raises(ConnectionLostError, match="password is refused"):
        discover(config=wrong)


def test_a_router_tells_of_wrong_passwords_where_it_runs(refusing) -> None:
    router, _, wrong = refusing
    guess(wrong)
    assert router.stderr.readline() == "login refused: wrong user or password, by somebody at 127.0.0.1\n"


REFUSED = "refused within the last hour, the last: login refused: wrong user or password, by somebody at 127.0.0.1"


def test_everybody_who_looks_at_its_robots_is_told_what_a_router_refused(refusing, capsys) -> None:
    _, made, wrong = refusing
    viewer = str(made.clients["bob"])
    with Fleet(viewer) as fleet:
        wait_until(lambda: fleet.now().ready)
        assert fleet.now().routers == ()
        for count in (1, 2):
            guess(wrong)
            wait_until(lambda count=count: [one for one in fleet.now().routers if one.denied == count])
        (router,) = fleet.now().routers
        assert router.words == f"router {socket.gethostname()}: 2 logins {REFUSED}"
        assert router.words in screen_lines(fleet.now(), [], 20, 0.0, 0)
    with Fleet(viewer) as fleet:  # who comes later hears of it at once
        assert wait_until(lambda: fleet.now().routers) == (router,)
    run(["--config", viewer, "ls"])
    assert router.words in capsys.readouterr().err
    with contextlib.closing(ClientFinder(viewer)) as finder:
        wait_until(lambda: router.words in finder.find().advice)


def test_the_status_says_who_of_the_network_is_there(site) -> None:
    with silo.connect("walker", config=site.config("alice")) as operator:
        operator._hello()
        found = wait_until(lambda: [one for one in operator.status().clients if one.identity])
        assert found[0].who.startswith("alice (proven) from ")


def test_a_viewer_sees_how_robots_stand_and_who_is_not_let_in_is_told(site) -> None:
    with Fleet(site.config("bob")) as fleet:
        wait_until(lambda: any(one.summary is not None for one in fleet.now().members))
        site.logger.start()
        wait_until(lambda: fleet.now().members[0].running)
        site.logger.stop()
        wait_until(lambda: not fleet.now().members[0].running)
    with Fleet(site.config("robots")) as fleet:
        assert wait_until(lambda: fleet.now().unreachable)
        assert "sees no logger" in fleet.now().unreachable[site.config("robots")]


def test_a_robot_with_a_password_for_the_router_still_answers_its_own_users(site, monkeypatch) -> None:
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(Path(site.serving.socket_path).parent))
    with Client.connect("walker", config="local") as client:
        assert client._hello().may_edit
        assert client.found.socket


def test_a_robot_is_served_while_its_router_is_away_and_seen_when_that_comes_back(site) -> None:
    close(site.router)
    wait_until(lambda: not site.sees("alice"))
    site.logger.start()
    site.logger.collect()
    assert site.logger.ticks == 1
    site.logger.stop()
    site.router, _ = open_router(site.server)
    wait_until(lambda: site.sees("alice") == ["walker"])


def test_the_router_listens_where_its_file_says_and_nowhere_else(site, tmp_path) -> None:
    assert [endpoint.partition("/")[0] for endpoint in site.endpoints] == ["tls"]
    (tmp_path / "empty.json5").write_text(json.dumps({"mode": "router"}))
    with pytest.raises(ConnectionLostError, match="names nothing to listen on"):
        open_router(str(tmp_path / "empty.json5"))

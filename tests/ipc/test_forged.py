"""Who has a viewer's file, or that of another robot, tries to be a robot, by plain Zenoh, while an operator works."""

import json
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import zenoh

import silo
from silo.cli.network.authority import Made, make_network
from silo.fleet.resolving import discover
from silo.net.configuration import FORCED, from_file, insert
from silo.net.keys import Root
from silo.net.session import close, open_router
from tests.thin_net import free_port
from tests.waiting import wait_until

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("openssl") is None, reason="makes certificates with openssl"),
]
USERS = {"alice": "operator", "bob": "viewer", "robot3": "robot", "robot4": "robot", "robots": "robot"}
FILES = {"robot3": "robot3", "robot4": "robot4", "older": "robots"}  # a logger's name, and by which file it comes


class Site:
    """A router with three robots: two with files of their own, one with that which robots share."""

    def __init__(self, folder: Path) -> None:
        self.made: Made = make_network(folder / "lab", ["localhost"], free_port(), USERS, "127.0.0.1")
        self.router, _ = open_router(str(self.made.server / "server.json5"))
        self.loggers = {}
        for name, file in FILES.items():
            logger = silo.Logger(name, folder=folder / name, script=folder / f"{name}.yaml")
            logger.add(np.zeros(3), "x", action=silo.Action.SAVE_AND_PUBLISH)
            logger.serve(config=self.made.clients[file])
            self.loggers[name] = logger
        wait_until(lambda: len(discover(config=self.config("alice")).loggers) == len(FILES))

    def config(self, user: str) -> str:
        return str(self.made.clients[user])

    def plain(self, user: str) -> zenoh.Session:
        """A session by the file of a user, and nothing else of silo."""
        settings = from_file(self.config(user))
        insert(settings, FORCED)
        settings.insert_json5("mode", '"client"')
        settings.insert_json5("listen/endpoints", "[]")
        return zenoh.open(settings)

    def root(self, name: str) -> Root:
        (found,) = [one for one in discover(config=self.config("alice")).loggers if one.name == name]
        assert found.root is not None
        return found.root

    def close(self) -> None:
        for logger in self.loggers.values():
            logger.close()
        close(self.router)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory(dir="/dev/shm") as runtime:
        patch.setenv("SILO_RUNTIME_DIR", runtime)
        made = Site(tmp_path_factory.mktemp("site"))
        yield made
        made.close()


def test_a_robot_comes_as_the_host_that_its_file_is_called_after(site) -> None:
    hosts = {one.name: one.host for one in discover(config=site.config("alice")).loggers}
    assert (hosts["robot3"], hosts["robot4"]) == ("robot3", "robot4")
    with silo.connect("robot3/robot3", config=site.config("alice")) as client:
        assert client.status().host == "robot3"


@pytest.mark.parametrize("attacker", ["bob", "alice", "robot4"])
def test_nobody_answers_or_publishes_or_is_there_in_the_name_of_a_robot(site, attacker) -> None:
    root = site.root("robot3")
    asked, seen = [], []

    def lie(query: zenoh.Query) -> None:
        asked.append(str(query.key_expr))
        with query:
            query.reply(str(query.key_expr), b"\x81\xa4type\xa4Done")

    session = site.plain(attacker)
    try:
        forged = (root.key("ask"), root.do("alice"), root.key("do", "*"), "silo/*/*/ask", "silo/**")
        declared = [session.declare_queryable(key, lie) for key in forged]
        twin = Root("robot3", "robot3", "00000000ff")
        tokens = [session.liveliness().declare_token(twin.key("alive"))]
        with (
            silo.connect("robot3/robot3", config=site.config("alice")) as operator,
            operator.view(["/log/x"], rate_hz=30) as view,
        ):
            operator.on_event(seen.append)
            for _ in range(5):
                operator.start("discard")
                session.put(root.key("event"), b"\x01")
                session.put(root.key("summary"), b"\x01")
                session.put(root.key("view", view.request.view), b"\x01")
                operator.status()
                operator.stop()
            view.frame()
            assert len(operator.events()) >= 10
        assert [one.root for one in discover(config=site.config("alice")).loggers if one.name == "robot3"] == [root]
        assert asked == []
        for one in [*declared, *tokens]:
            one.undeclare()
    finally:
        close(session)


def test_a_token_of_a_client_that_somebody_else_lets_go_of_ends_no_view_of_it(site) -> None:
    session = site.plain("bob")
    try:
        with (
            silo.connect("robot3/robot3", config=site.config("alice")) as operator,
            operator.view(["/log/x"], rate_hz=30) as view,
        ):
            token = session.liveliness().declare_token(
                operator._connection.root.key("client", operator._connection.mine.id)
            )
            operator.status()
            token.undeclare()
            operator.start("discard")
            site.loggers["robot3"].collect()
            wait_until(view.frame)
            operator.stop()
    finally:
        close(session)


def test_a_robot_can_not_come_as_another_host_than_its_file_says(site, tmp_path) -> None:
    text = Path(site.config("robot4")).read_text()
    (tmp_path / "posing.json5").write_text(text.replace('"robot": "robot4"', '"robot": "robot3"'))
    assert json.dumps("robot3") in (tmp_path / "posing.json5").read_text()
    with silo.Logger("posing", folder=tmp_path, script=tmp_path / "posing.yaml") as logger:
        logger.add(np.zeros(1), "x")
        before = len(site.router.info.peers_zid())
        logger.serve(config=tmp_path / "posing.json5")
        with silo.connect("posing", config="local") as client:
            client.status()  # its own users reach it
        wait_until(lambda: len(site.router.info.peers_zid()) > before)
        assert "posing" not in {one.name for one in discover(config=site.config("alice")).loggers}

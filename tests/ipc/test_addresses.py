"""One robot, one address: two robots of one cloned image behind a router, and words that mean one of them or none."""

import contextlib
import json
import os
import signal
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import zenoh

import silo
from silo.cli.codes import EXIT_USAGE
from silo.cli.main import run
from silo.client.client import Client
from silo.core.elements import State
from silo.core.names import is_glob
from silo.errors import ConnectionLostError
from silo.fleet.fleet import Fleet as Followed
from silo.fleet.resolving import Discovery, SeveralError, discover
from silo.logger.serving.process import drawn_id, machine_digits
from silo.net.found import LoggerAddress, told_apart
from silo.net.keys import Root, robot_of, root_of
from tests.stand_ins.shared_sessions import open_configurations
from tests.thin_net import free_port
from tests.waiting import wait_until

HOST = socket.gethostname()


# ------------------------------------------------------------------------------------------------------------- words


def far(host: str, name: str, drawn: str) -> LoggerAddress:
    return LoggerAddress(name, 0, "", "", "desk.json5", host, id=drawn)


def near(name: str, pid: int, copy: int = 0) -> LoggerAddress:
    return LoggerAddress(name, pid, f"/run/{name}.{pid}.sock", "me", "", "here", id=f"aaaa{pid:06x}", copy=copy)


def test_a_key_leads_back_to_host_id_and_logger() -> None:
    root = Root("robot ~3", "anymal", "3fa977b2e0")
    assert root_of(root.key("alive")) == root
    assert root.address == "robot ~3~3fa977b2e0/anymal"
    assert str(zenoh.KeyExpr(str(root))) == str(root)


def test_keys_before_ids_are_still_understood() -> None:
    assert root_of("silo/robot3/anymal/ask") == Root("robot3", "anymal")


@pytest.mark.parametrize("key", ["silo/robot3", "other/robot3/anymal/ask"])
def test_a_key_of_somebody_else_is_of_no_logger(key) -> None:
    with pytest.raises(ValueError, match="is not a key of silo"):
        root_of(key)


@pytest.mark.parametrize(
    "key",
    ["silo/%1B[2Jevil~01ab/anymal/alive", "silo/robot3~01ab/an%0Aymal/alive", "silo/x~1/%/alive", "silo/%/x/alive",
     f"silo/{'h' * 65}~01ab/anymal/alive", f"silo/robot3~01ab/{'n' * 41}/alive", "silo/robot3~%1B[2J/anymal/alive"],
)  # fmt: skip
def test_a_key_that_would_garble_a_list_is_of_no_robot(key) -> None:
    zenoh.KeyExpr(key)
    assert robot_of(key) is None


def test_the_keys_of_robots_are_of_robots() -> None:
    for root in (Root("robot3", "anymal", drawn_id()), Root("röbot ~3", "an.y_m-al"), Root("h" * 64, "n" * 40)):
        assert robot_of(root.key("alive")) == root


def test_two_ids_of_one_computer_begin_alike_and_differ() -> None:
    first, second = drawn_id(), drawn_id()
    assert first != second
    assert first[:4] == second[:4] == machine_digits()


@pytest.mark.parametrize("word", ["", "anymal", "anymal.7", "here/anymal", "here/anymal.7", "here~aaaa000007/anymal"])
def test_a_logger_is_meant_by_its_name_its_process_its_host_and_its_id(word) -> None:
    assert near("anymal", 7).is_meant_by(word)


@pytest.mark.parametrize(
    "word", ["any", "anymal.8", "there/anymal", "here~aaaa000008/anymal", "here/", "/anymal", "here"]
)
def test_no_other_word_means_it(word) -> None:
    assert not near("anymal", 7).is_meant_by(word)


@pytest.mark.parametrize(
    "loggers",
    [
        [far("same", "anymal", "1111000001"), far("same", "anymal", "2222000002")],
        [far("one", "anymal", "1111000001"), far("two", "anymal", "2222000002")],
        [near("anymal", 7), near("anymal", 8), near("anymal", 8, 1)],
        [near("anymal", 7), far("here", "anymal", "2222000002")],
        [near("anymal", 7), far("there", "anymal", "2222000002"), far("there", "other", "2222000003")],
    ],
)
def test_every_address_that_is_listed_means_one_logger_when_it_is_typed(loggers) -> None:
    found = Discovery(loggers, [])
    for word, logger in zip(told_apart(loggers), loggers, strict=True):
        assert found.one(word) == logger


def test_a_name_that_fits_two_is_refused_with_both_addresses() -> None:
    found = Discovery([far("one", "anymal", "1111000001"), far("two", "anymal", "2222000002")], [])
    with pytest.raises(SeveralError, match=r"2 loggers are called 'anymal', say which one: one/anymal, two/anymal;"):
        found.one("anymal")


def test_a_glob_means_many_and_is_refused_where_one_is_meant() -> None:
    found = Discovery([far("robot1", "anymal", "1111000001"), far("robot2", "spot", "2222000002")], [])
    assert is_glob("robot*/*")
    with pytest.raises(SeveralError, match=r"'robot1/\*' can mean several loggers.*`silo ls 'robot1/\*'`"):
        found.one("robot1/*")
    assert [one.name for one in found.matching("robot*/*")] == ["anymal", "spot"]
    assert [one.name for one in found.matching("*/spot")] == ["spot"]


# ------------------------------------------------------------------------------------------ two robots behind a router


class Fleet:
    """A router, and two loggers called `same` on hosts that are called the same."""

    def __init__(self, folder: Path) -> None:
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.folder = folder
        self.router = self.open_router()
        self.robot, self.desk = folder / "robot.json5", str(folder / "desk.json5")
        self.robot.write_text(json.dumps({"connect": {"endpoints": [self.endpoint]}}))
        Path(self.desk).write_text(json.dumps({"connect": {"endpoints": [self.endpoint]}}))
        self.loggers = [silo.Logger("same", folder=folder / name, script=folder / f"{name}.yaml") for name in "01"]
        self.servings = []
        for logger in self.loggers:
            logger.add(np.zeros(3), "x", action=silo.Action.SAVE_AND_PUBLISH)
            self.servings.append(logger.serve(config=self.robot))
        wait_until(lambda: len(self.found()) == 2)

    def open_router(self) -> zenoh.Session:
        config = zenoh.Config()
        for key, value in {
            "mode": "router",
            "listen/endpoints": [self.endpoint],
            "scouting/multicast/enabled": False,
            "scouting/gossip/enabled": False,
            "scouting/delay": 0,
        }.items():
            config.insert_json5(key, json.dumps(value))
        return zenoh.open(config)

    def found(self) -> list[LoggerAddress]:
        try:
            return discover(config=self.desk).loggers
        except ConnectionLostError:
            return []  # none is connected to the router yet

    def logger_of(self, found: LoggerAddress) -> silo.Logger:
        with Client.connect(found) as client:
            folder = client.status().folder
        return self.loggers[int(Path(folder).name)]

    def close(self) -> None:
        for logger in self.loggers:
            logger.close()
        self.router.close()


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fleet]:
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory(dir="/dev/shm") as runtime:
        patch.setenv("SILO_RUNTIME_DIR", runtime)
        patch.setattr("silo.logger.logger.end_namesakes", lambda _: None)  # two robots in one process
        made = Fleet(tmp_path_factory.mktemp("fleet"))
        yield made
        made.close()


@pytest.mark.slow
def test_a_token_that_no_robot_has_is_in_no_list(fleet) -> None:
    settings = zenoh.Config.from_file(fleet.desk)
    settings.insert_json5("mode", '"client"')
    with zenoh.open(settings) as stranger, Followed(fleet.desk) as followed:
        garbled, plain = (
            stranger.liveliness().declare_token(f"silo/{host}~01ab/x/alive") for host in ("%1B[2Jevil", "stranger")
        )
        wait_until(lambda: "stranger" in {one.found.host for one in followed.now().members})
        assert {one.found.host for one in followed.now().members} == {HOST, "stranger"}
        assert {one.host for one in fleet.found()} == {HOST, "stranger"}
        garbled.undeclare()
        plain.undeclare()
    wait_until(lambda: len(fleet.found()) == 2)


@pytest.mark.slow
@pytest.mark.parametrize("words", [["stop", "same"], ["set", "same", "x", "off"], ["start", f"{HOST}/same"], ["stop"]])
def test_a_command_to_a_name_of_two_reaches_none_and_lists_addresses(fleet, words, capsys) -> None:
    states = [(logger.is_running, logger._table.revision) for logger in fleet.loggers]
    assert run(["--config", fleet.desk, *words]) == EXIT_USAGE
    said = " ".join(capsys.readouterr().err.split())
    assert all(found.root.address in said for found in fleet.found())
    assert "nothing was asked" in said
    assert [(logger.is_running, logger._table.revision) for logger in fleet.loggers] == states


@pytest.mark.slow
def test_a_command_to_an_address_reaches_that_robot_alone(fleet) -> None:
    for found in fleet.found():
        mine = fleet.logger_of(found)
        others = [logger for logger in fleet.loggers if logger is not mine]
        assert run(["--config", fleet.desk, "start", found.root.address]) == 0
        assert mine.is_running
        assert not any(logger.is_running for logger in others)
        assert run(["stop", found.root.address, "--config", fleet.desk]) == 0
        assert not mine.is_running


@pytest.mark.slow
def test_connect_takes_an_address_and_refuses_a_name_of_two(fleet) -> None:
    address = fleet.found()[1].root.address
    with silo.connect(address, config=fleet.desk) as client:
        assert client.found.root.address == address
    with pytest.raises(ConnectionLostError, match="2 loggers are called 'same'"):
        silo.connect("same", config=fleet.desk)


@pytest.mark.slow
def test_ls_shows_hosts_and_what_tells_the_two_apart(fleet, capsys) -> None:
    assert run(["--config", fleet.desk, "ls"]) == 0
    head, *rows = capsys.readouterr().out.splitlines()
    assert head.split()[:3] == ["LOGGER", "HOST", "STATE"]
    assert head.split()[-1] == "ADDRESS"
    assert sorted(row.split()[-1] for row in rows) == sorted(found.root.address for found in fleet.found())
    assert {row.split()[1] for row in rows} == {HOST}
    assert run(["--config", fleet.desk, "ls", "--json"]) == 0  # for machines
    told = [one["address"] for one in json.loads(capsys.readouterr().out)]
    assert sorted(told) == sorted(found.root.address for found in fleet.found())


@pytest.mark.slow
def test_clients_of_one_configuration_share_one_session(fleet) -> None:
    first, second = (Client.connect(found) for found in fleet.found())
    with first, second:
        assert first._connection.borrowed().session.zid() == second._connection.borrowed().session.zid()
        assert open_configurations() == {fleet.desk: 2}
        with first.view(["/log/x"], rate_hz=30), second.topic("x"):
            first.close()
            assert second.status().logger == "same"
    assert open_configurations() == {}


@pytest.mark.slow
def test_a_remote_is_looked_at_beside_this_computer_and_a_robot_that_both_show_is_one(
    fleet, tmp_path, monkeypatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    (tmp_path / "silo" / "remotes").mkdir(parents=True)
    (tmp_path / "silo" / "remotes" / "lab.json5").write_text(Path(fleet.desk).read_text())
    ids = {found.id for found in fleet.found()}
    assert {(found.id, found.config) for found in discover().loggers} == {(one, "lab") for one in ids}
    assert {found.id for found in discover(config="lab").loggers} == ids
    assert discover(config="local").loggers == []
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(Path(fleet.servings[0].socket_path).parent))
    assert {(found.id, found.config) for found in discover().loggers} == {(one, "") for one in ids}


@pytest.mark.slow
def test_a_client_waits_for_its_robot_and_never_goes_over_to_another_of_its_name(fleet, monkeypatch) -> None:
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(Path(fleet.servings[0].socket_path).parent))  # served there again
    mine, other = fleet.loggers
    (found,) = [one for one in fleet.found() if fleet.logger_of(one) is mine]
    with Client.connect(found) as client:
        fleet.servings[0].close()
        wait_until(lambda: not client.connected)
        with pytest.raises(ConnectionLostError, match="no connection to logger"):
            client.start()
        assert not other.is_running
        fleet.servings[0] = mine.serve(config=fleet.robot)
        wait_until(lambda: client.connected)
        assert client.status().folder == str(fleet.folder / "0")


@pytest.mark.slow
def test_a_client_elsewhere_waits_for_the_next_helper_process_though_a_namesake_came(fleet, monkeypatch) -> None:
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(Path(fleet.servings[0].socket_path).parent))
    (found,) = [one for one in fleet.found() if fleet.logger_of(one) is fleet.loggers[0]]
    came = silo.Logger("same", folder=fleet.folder / "2", script=fleet.folder / "2.yaml")
    with Client.connect(found) as client, contextlib.closing(came):
        came.serve(config=fleet.robot)
        wait_until(lambda: len(fleet.found()) == 3)
        links: list[bool] = []
        client.on_link(links.append)
        os.kill(fleet.servings[0].helper_pid, signal.SIGKILL)
        wait_until(lambda: links[-1:] == [True])
        assert client.status().folder == str(fleet.folder / "0")
    wait_until(lambda: len(fleet.found()) == 2)


@pytest.mark.slow
def test_clients_come_back_when_their_router_does(fleet) -> None:
    first, second = (Client.connect(found) for found in fleet.found())
    with first, second, second.view(["/log/x"], rate_hz=30):
        fleet.router.close()
        wait_until(lambda: not first.connected and not second.connected)  # as long as there is no router
        fleet.router = fleet.open_router()
        wait_until(lambda: first.connected and second.connected)
        assert first.status().state is State.STOPPED
        assert first._connection.borrowed().session.zid() == second._connection.borrowed().session.zid()


@pytest.mark.slow
def test_a_logger_keeps_its_address_when_its_helper_process_is_killed(bench, client) -> None:
    (before,) = discover().loggers
    links: list[bool] = []
    client.on_link(links.append)
    os.kill(bench.serving.helper_pid, signal.SIGKILL)
    wait_until(lambda: links[-1:] == [True])
    wait_until(lambda: [one.id for one in discover().loggers] == [client.found.id])  # the killed one is still told of
    assert [one.root for one in discover().loggers] == [before.root]


@pytest.mark.slow
def test_a_client_without_the_file_beside_the_socket_asks_who_is_there(bench) -> None:
    Path(f"{bench.serving.socket_path}.key").unlink()
    with Client.connect("bot") as client:
        assert client.found.host == HOST
        assert client.status().logger == "bot"

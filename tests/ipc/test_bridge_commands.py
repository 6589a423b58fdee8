"""The commands of the bridges: what they need, and that they never take one robot for another."""

import importlib.util
import json
import socket

import pytest

import silo
from silo.bridges.services import pinned, services
from silo.cli.codes import EXIT_FAILED
from silo.cli.main import run
from silo.client.client import Client
from silo.net.access.rights import access_control
from tests.thin_net import free_port


@pytest.mark.parametrize(("command", "extra"), [("foxglove", "foxglove"), ("ros2", "ros2")])
def test_without_its_extra_a_command_says_what_to_install(monkeypatch, capsys, command, extra):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert run([command]) == 1
    assert f"pip install 'silo-logger[{extra}]'" in capsys.readouterr().err


@pytest.mark.parametrize(("words", "wrong"), [(["--domain", "300"], "300"), (["--distro", "foxy"], "foxy")])
def test_what_ros_doesnt_have_is_refused(capsys, words, wrong):
    assert run(["ros2", *words]) == 2
    assert wrong in capsys.readouterr().err


@pytest.mark.slow
def test_a_bridge_that_was_given_no_name_never_commands_another_robot(bench, tmp_path):
    name, reach = pinned(Client.connect, "")
    calls = services(reach, name)
    bench.logger.close()
    with silo.Logger("other", frequency=100, folder=tmp_path) as other:
        other.array("x", 2)
        other.serve()
        with pytest.raises(silo.SiloError, match="bot"):
            calls["/bot/start"]("somebody")
        assert not other.is_running
        with silo.Logger("bot", frequency=100, folder=tmp_path) as again:
            again.array("x", 2)
            again.serve()
            assert "running" in calls["/bot/start"]("somebody")
            assert (again.is_running, other.is_running) == (True, False)


@pytest.mark.slow
def test_who_may_only_look_offers_no_control_to_others(runtime, tmp_path, capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        rules = {**access_control({"all": "viewer"}), "subjects": [{"id": "all"}]}  # whoever comes
        (tmp_path / "robot.json5").write_text(
            json.dumps({"listen": {"endpoints": [endpoint]}, "access_control": rules})
        )
        (tmp_path / "desk.json5").write_text(json.dumps({"connect": {"endpoints": [endpoint]}}))
        with silo.Logger("bot", frequency=100, folder=tmp_path, script=tmp_path / "x.yaml") as logger:
            logger.array("x", 2)
            logger.serve(config=tmp_path / "robot.json5")
            for words in (["foxglove", "--port", str(taken.getsockname()[1])], ["ros2", "--router", endpoint[:-1]]):
                assert run([*words, "--control", "--config", str(tmp_path / "desk.json5")]) == EXIT_FAILED
                said = capsys.readouterr()
                assert "not change it: the role is viewer" in said.err
                assert "can start" not in said.out + said.err


@pytest.mark.parametrize(
    ("words", "is_secret", "host", "told"),
    [
        ([], False, "localhost", "read-only"),
        (["--token"], True, "localhost", "read-only"),
        (["--control"], True, "localhost", "whoever has this address can start, stop, save and set parameters"),
        (["--bind", "0.0.0.0"], True, "0.0.0.0", "read-only"),
    ],
)
def test_a_viewer_has_an_address_that_can_be_guessed_only_where_it_looks_from_this_computer(
    words, is_secret, host, told, monkeypatch, capsys
) -> None:
    server = pytest.importorskip("silo.bridges.foxglove.server", exc_type=ImportError)
    ran = []
    monkeypatch.setattr("silo.cli.programs.viewers._pinned", lambda logger, control: ("bot", None))
    monkeypatch.setattr(
        server, "run", lambda terms, reach, listening, tell: ran.append((terms, *listening.getsockname()))
    )
    assert run(["foxglove", "--port", "0", *words]) == 0
    ((terms, _, port),) = ran
    said = capsys.readouterr()
    assert said.out == f"bot at ws://{host}:{port}{'/' if is_secret else ''}{terms.token}\n"
    assert (len(terms.token) > 30, said.err.splitlines()[0]) == (is_secret, told)
    assert (terms.services is not None, terms.tune is not None) == ("--control" in words,) * 2

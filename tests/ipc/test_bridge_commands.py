"""The commands of the bridges: what they need, and that they never take one robot for another."""

import importlib.util

import pytest

import silo
from silo.bridges.services import pinned, services
from silo.cli.main import run
from silo.ipc.client import Client


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
            calls["/bot/start"]()
        assert not other.is_running
        with silo.Logger("bot", frequency=100, folder=tmp_path) as again:
            again.array("x", 2)
            again.serve()
            assert "running" in calls["/bot/start"]()
            assert (again.is_running, other.is_running) == (True, False)

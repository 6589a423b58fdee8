"""The commands of the bridges, where what they need is missing."""

import importlib.util

import pytest

from silo.cli.main import run


@pytest.mark.parametrize(("command", "extra"), [("foxglove", "foxglove"), ("ros2", "ros2")])
def test_without_its_extra_a_command_says_what_to_install(monkeypatch, capsys, command, extra):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert run([command]) == 1
    assert f"pip install 'silo-logger[{extra}]'" in capsys.readouterr().err


@pytest.mark.parametrize(("words", "wrong"), [(["--domain", "300"], "300"), (["--distro", "foxy"], "foxy")])
def test_what_ros_doesnt_have_is_refused(capsys, words, wrong):
    assert run(["ros2", *words]) == 2
    assert wrong in capsys.readouterr().err

"""`silo config`: the examples that come with silo."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from silo.cli.group import cli
from silo.cli.main import run
from silo.cli.programs import config as command
from silo.settings.script import read_script

EXAMPLES = Path(__file__).resolve().parents[2] / "config"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_example_is_listed_with_a_line_that_says_what_it_is():
    listed = json.loads(CliRunner().invoke(cli, ["config", "ls", "--json"]).output)
    assert [one["name"] for one in listed] == sorted(path.name for path in EXAMPLES.iterdir())
    assert all(len(one["summary"]) > 30 for one in listed)


def test_a_copy_has_every_byte_and_its_place_is_told(folder, capsys):
    assert run(["config", "cp", "demo"]) == 0
    assert capsys.readouterr().out == "demo.yaml\n"
    assert (folder / "demo.yaml").read_bytes() == (EXAMPLES / "demo.yaml").read_bytes()
    assert read_script(folder / "demo.yaml").elements


def test_a_copy_may_have_another_name_or_folder(folder):
    (folder / "etc").mkdir()
    assert run(["config", "cp", "tls.json5", "etc"]) == 0
    assert run(["config", "cp", "tls.json5", "etc/robot.json5"]) == 0
    assert sorted(path.name for path in (folder / "etc").iterdir()) == ["robot.json5", "tls.json5"]


def test_what_is_there_is_never_overwritten(folder, capsys):
    (folder / "demo.yaml").write_text("mine")
    assert run(["config", "cp", "demo.yaml"]) == 1
    assert capsys.readouterr().err == "silo: demo.yaml exists; name another file; nothing was copied\n"
    assert (folder / "demo.yaml").read_text() == "mine"


def test_an_unknown_example_is_told_with_those_that_there_are(capsys):
    assert run(["config", "cp", "walk"]) == 1
    said = capsys.readouterr().err
    assert said.startswith("silo: no example 'walk'; there are access-control.json5, demo.yaml, host.yaml, ")
    assert "router.json5, tls.json5" in said


def test_a_folder_that_is_not_there_is_told(capsys):
    assert run(["config", "cp", "demo.yaml", "nowhere/demo.yaml"]) == 1
    assert capsys.readouterr().err == "silo: nowhere is no folder; make it first; nothing was copied\n"


def test_an_installation_without_examples_says_so(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(command, "FOLDER", tmp_path / "none")
    assert run(["config", "ls"]) == 1
    assert "this silo was not installed whole" in capsys.readouterr().err

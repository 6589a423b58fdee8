"""Processes of silo's own: what they load, how they end, what became of them."""

import os
import subprocess
import sys

import pytest

import silo.errors
import silo.version
from silo.core.child import PIPE, ChildProcess, own_program

pytestmark = pytest.mark.slow


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Makes a module of these lines that children can run."""
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "elsewhere"))

    def make(text: str) -> str:
        (tmp_path / "elsewhere" / "grown.py").write_text(text)
        return "grown"

    return make


def said_by(child: ChildProcess) -> str:
    with child:
        return child.stdout.read().decode().strip()


def test_a_file_in_the_present_folder_that_is_called_as_a_module_is_not_the_childs(
    module, tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("queue", "json", "runpy", "silo"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('not that one')")
    program = module("import json, queue, sys, silo.errors; print(*sys.argv, silo.errors.__file__)")
    told = f"{tmp_path / 'elsewhere' / program}.py 7 {silo.errors.__file__}"
    assert said_by(ChildProcess(program, [7], stdout=PIPE)) == told
    assert subprocess.check_output([*own_program(program), "7"], text=True).strip() == told  # by every Python


def test_a_program_of_its_own_is_found_where_this_silo_is(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    words = own_program("silo.cli")
    isolated = [words[0], "-S", *words[1:]]  # no packages: as from a clone that is not installed
    told = subprocess.run([*isolated, "--version"], capture_output=True, text=True, check=False)
    assert told.stdout == f"silo, version {silo.version.VERSION}\n", told.stderr


def test_it_gets_descriptors_by_their_numbers_and_the_environment_that_is_said(module) -> None:
    program = module("import os, sys; os.write(int(sys.argv[1]), os.environ['MORE'].encode())")
    end, theirs = os.pipe()
    with ChildProcess(program, [theirs], [theirs], environment={"MORE": "more"}):
        os.close(theirs)
    assert os.read(end, 10) == b"more"
    os.close(end)


def test_one_that_ends_tells_how_and_one_that_does_not_is_killed(module) -> None:
    child = ChildProcess(module("import sys; sys.stdin.read(); sys.exit(3)"), [], stdin=PIPE)
    assert child.is_there
    assert child.wait_within(0.0) is None
    child.stdin.close()
    assert child.wait() == 3
    assert not child.is_there
    child = ChildProcess(module("import time; time.sleep(1000)"), [])
    assert child.end(0.0) == -9


def test_it_is_in_a_session_of_its_own(module) -> None:
    assert said_by(ChildProcess(module("import os; print(os.getsid(0) == os.getpid())"), [], stdout=PIPE)) == "True"


def test_a_program_that_is_not_there_is_an_error_of_the_system(module, monkeypatch) -> None:
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    with pytest.raises(OSError, match="No such file"):
        ChildProcess(module(""), [])

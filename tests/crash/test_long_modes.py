"""The eyes of the long modes (`.bench/long/`): a harness that sees nothing wrong must be able to see it."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import silo
from tests.waiting import DEADLINE_S

LONG = Path(__file__).resolve().parents[2] / ".bench" / "long"
TICKS, SIZE = 50, 20
PROGRAMS = ["recorder.py", "kills.py", "soak.py", "quick_start.py", "memory.py", "power_cuts.py"]


@pytest.fixture(scope="module")
def truth():
    spec = importlib.util.spec_from_file_location("truth_of_long_modes", LONG / "truth.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def saved(truth, tmp_path):
    """A file that the robot program of the long modes saved."""
    truth.new_page(tmp_path / "page")
    steps = ["start", f"ticks {TICKS}", "save silo", "close"]
    case = {"name": "bot", "folder": str(tmp_path), "page": str(tmp_path / "page"), "size": SIZE, "steps": steps}
    environment = dict(os.environ, PYTHONPATH=str(Path(silo.__file__).parents[1]))
    subprocess.run(
        [sys.executable, str(LONG / "robot.py"), json.dumps(case)], env=environment, check=True, timeout=DEADLINE_S
    )
    return next(tmp_path.glob("*.silo"))


def test_a_whole_file_is_seen_as_whole(truth, saved):
    found = truth.look(saved, 1, SIZE, 0)
    assert (found.last, found.torn, found.missing) == (TICKS - 1, 0, 0)


def test_one_wrong_value_is_seen_as_torn(truth, saved):
    column = truth.values(TICKS - 5, truth.WIDE, 1)[70]
    data = saved.read_bytes()
    wrong = int(column).to_bytes(8, "little")
    assert data.count(wrong) == 1
    saved.write_bytes(data.replace(wrong, int(column + 1).to_bytes(8, "little")))
    assert truth.look(saved, 1, SIZE, 0).torn == 1


def test_samples_that_the_buffer_should_hold_are_seen_as_missing(truth, saved):
    assert truth.look(saved, 1, SIZE + 1, 0).missing > 0
    assert truth.look(saved, 1, 0, 0).missing > 0


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_long_mode_says_how_it_is_used(name):
    environment = dict(os.environ, PYTHONPATH=str(Path(silo.__file__).parents[1]))
    command = [sys.executable, str(LONG / name), "--help"]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=DEADLINE_S)
    assert f".bench/long/{name}" in run.stdout

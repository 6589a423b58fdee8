"""The fixture `silo_log` in somebody else's tests."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import silo

ROOT = Path(__file__).resolve().parents[2]

TESTS = """
import pytest

@pytest.mark.parametrize("wanted", [3, 4])
def test_the_height(silo_log, wanted):
    height = silo_log.array("height")
    silo_log.start()
    for _ in range(3):
        height[...] += 1
        silo_log.collect()
    assert height == wanted

def test_another_one_logs_nothing(silo_log):
    pass
"""


@pytest.mark.slow
def test_the_log_of_a_test_is_saved_and_found_where_it_fails(tmp_path):
    (tmp_path / "test_robot.py").write_text(TESTS)
    # by its module, as an environment that was made before the fixture has no entry of it
    options = ["-p", "no:silo", "-p", "silo.pytest_plugin", "-p", "no:cacheprovider", "--basetemp=run", "--rootdir=."]
    command = [sys.executable, "-m", "pytest", *options, "test_robot.py"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert "1 failed, 2 passed" in done.stdout
    found = {saved.parent.name: saved for saved in tmp_path.glob("run/*0/*.silo")}
    assert len(found) == 2
    for folder, saved in found.items():
        assert silo.open_log(saved)["height"].values.tolist() == [1.0, 2.0, 3.0]
        assert (str(saved.relative_to(tmp_path)) in done.stdout) == ("4" in folder), done.stdout


def test_pytest_finds_it():
    described = (ROOT / "pyproject.toml").read_text()
    assert '[project.entry-points.pytest11]\nsilo = "silo.pytest_plugin"\n' in described

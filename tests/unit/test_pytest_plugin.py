"""The fixture `silo_log` in somebody else's tests."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import silo

ROOT = Path(__file__).resolve().parents[2]

TESTS = """
def test_that_fails(silo_log):
    height = silo_log.array("height")
    silo_log.start()
    for _ in range(3):
        height[...] += 1
        silo_log.collect()
    assert {wanted}

def test_another_one_logs_nothing(silo_log):
    pass
"""


@pytest.mark.slow
@pytest.mark.parametrize(("wanted", "failed"), [("height == 4", 1), ("height == 3", 0)])
def test_the_log_of_a_test_is_saved_and_found_where_it_fails(tmp_path, wanted, failed):
    (tmp_path / "test_robot.py").write_text(TESTS.replace("{wanted}", wanted))
    # by its module, as an environment that was made before the fixture has no entry of it
    options = ["-p", "no:silo", "-p", "silo.pytest_plugin", "-p", "no:cacheprovider", "--basetemp=run", "--rootdir=."]
    command = [sys.executable, "-m", "pytest", *options, "test_robot.py"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == failed, done.stdout
    (saved,) = tmp_path.glob("run/*0/*.silo")
    assert silo.open_log(saved)["height"].values.tolist() == [1.0, 2.0, 3.0]
    assert (saved.name in done.stdout) == bool(failed)


def test_pytest_finds_it():
    described = (ROOT / "pyproject.toml").read_text()
    assert '[project.entry-points.pytest11]\nsilo = "silo.pytest_plugin"\n' in described

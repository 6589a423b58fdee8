"""`silo demo` and `silo host` as processes: they start, log, and end as they are told to."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from silo.programs.demo.program import DemoOptions, run_demo
from silo.programs.demo.robot import SimulatedRobot
from silo.programs.host.program import HostOptions, run_host
from tests.waiting import DEADLINE_S

pytestmark = pytest.mark.slow

Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts `silo` with some words and waits until it logs; ends what is still running."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    started: list[subprocess.Popen[str]] = []

    def starter(*words: str) -> "subprocess.Popen[str]":
        command = [sys.executable, "-c", "from silo.cli import main; main()", *words, "--folder", str(tmp_path)]
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, start_new_session=True
        )
        started.append(process)
        assert process.stdout is not None
        while "Ctrl-C" not in (line := process.stdout.readline()):
            if not line:
                break
        return process

    yield starter
    for process in started:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


@pytest.mark.parametrize("words", [("demo", "--elements", "50"), ("host",)])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_program_ends_in_order_when_told_to(start: Start, words: tuple[str, ...], number: signal.Signals) -> None:
    process = start(*words)
    os.killpg(process.pid, number)  # a terminal sends Ctrl-C to the helper process, too
    out, err = process.communicate(timeout=DEADLINE_S)
    assert (process.returncode, err) == (0, "")
    assert f"logger '{words[0]}' ended" in out


def test_a_program_saves_at_its_end(start: Start, tmp_path: Path) -> None:
    process = start("demo", "--elements", "30", "--save", "silo", "--save", "csv", "--time-limit", "1")
    out, err = process.communicate(timeout=DEADLINE_S)
    assert (process.returncode, err) == (0, "")
    saved = sorted(path.suffix for path in tmp_path.glob("demo_*"))
    assert saved == [".csv", ".json", ".silo"]
    assert all(str(path) in out for path in tmp_path.glob("demo_*") if path.suffix != ".json")


def test_a_program_ends_by_itself_at_its_time_limit(start: Start) -> None:
    process = start("host", "--time-limit", "0.3")
    out, err = process.communicate(timeout=DEADLINE_S)
    assert (process.returncode, err) == (0, "")
    assert "ticks logged and not saved" in out


def test_a_stopped_program_logs_nothing(start: Start) -> None:
    process = start("demo", "--elements", "10", "--stopped", "--time-limit", "0.2", "--save", "silo")
    out, _ = process.communicate(timeout=DEADLINE_S)
    assert "nothing was logged, so there is nothing to save" in out


def test_a_wrong_script_is_told_before_anything_runs(start: Start, tmp_path: Path) -> None:
    script = tmp_path / "wrong.yaml"
    script.write_text("log_elements:\n- name: /log/base/pose\n  divider: 0\n")
    process = start("demo", "--script", str(script))
    _, err = process.communicate(timeout=DEADLINE_S)
    reason = "element '/log/base/pose': divider must be a whole number from 1 to 2147483647, got 0; nothing was changed"
    assert (process.returncode, err) == (1, f"silo: {script}:3: {reason}\n")


def test_ctrl_c_saves_what_the_demo_logged_and_says_where(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    step = SimulatedRobot.step

    def step_and_end(robot: SimulatedRobot) -> None:
        step(robot)
        if robot.ticks == 5:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(SimulatedRobot, "step", step_and_end)
    said: list[str] = []
    run_demo(DemoOptions(elements=20, folder=tmp_path), said.append)
    (saved,) = tmp_path.glob("demo_*.silo")
    assert str(saved) in said[-1]


def test_this_computer_is_not_said_to_walk_or_slip(tmp_path: Path) -> None:
    said: list[str] = []
    run_host(HostOptions(folder=tmp_path, time_limit_s=0.01), said.append)
    assert [line.split()[0] for line in said[0].splitlines()[1:]] == ["script", "folder", "watch", "end"]

"""The program of the README, as it is printed, until Ctrl-C: what it logged stands in files, in words that it uses."""

import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import silo
from tests.waiting import DEADLINE_S, wait_until

README = Path(__file__).resolve().parents[2] / "README.md"


def blocks():
    return re.findall(r"```python\n(.*?)```", README.read_text(), re.S)


@pytest.mark.slow
def test_the_program_of_the_readme_saves_on_ctrl_c_and_its_log_answers_as_printed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    program, analysis = blocks()[:2]
    runtime = tmp_path / "runtime"
    runtime.mkdir(mode=0o700)
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(runtime))
    process = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.PIPE, text=True)
    try:
        wait_until(lambda: has_ticks() or process.poll() is not None)
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=DEADLINE_S)[1]
    finally:
        process.kill()
        process.wait()
    assert said.rstrip().endswith("KeyboardInterrupt")
    assert "Error" not in said.replace("KeyboardInterrupt", "")
    endings = sorted(path.suffix for path in (tmp_path / "logs").iterdir() if path.name.startswith("anymal_"))
    assert {".silo", ".csv"} <= set(endings)
    when = next(line for line in analysis.splitlines() if "STANCE" in line)
    log = silo.open_log("logs")
    assert len(log["joints/q"]) > 10
    assert log.eval("state/mode == STANCE").values.all()
    eval(when, {"log": log})


def has_ticks():
    from silo.errors import SiloError

    try:
        with silo.connect("anymal") as client:
            return client.status().ticks > 50
    except SiloError:
        return False

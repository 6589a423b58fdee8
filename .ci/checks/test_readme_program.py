"""The README as printed: its program runs until Ctrl-C, its commands look at it, its analysis reads what it left."""

import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import silo
from silo.errors import SiloError
from tests.waiting import DEADLINE_S, wait_until

README = Path(__file__).resolve().parents[2] / "README.md"
BESIDE = Path(sys.executable).parent
FOR_EVER = ("silo watch", "silo-tui")


def blocks(kind):
    return re.findall(rf"```{kind}\n(.*?)```", README.read_text(), re.S)


@pytest.mark.slow
def test_the_program_of_the_readme_takes_its_commands_and_what_it_saved_on_ctrl_c_answers_as_printed(
    tmp_path, monkeypatch, runtime_folder
):
    monkeypatch.chdir(tmp_path)
    program, analysis = blocks("python")
    process = subprocess.Popen([sys.executable, "-c", program], stderr=subprocess.PIPE, text=True)
    try:
        wait_until(lambda: ticks() > 1000 or process.poll() is not None)
        five = next(block for block in blocks("bash") if "silo ls" in block).splitlines()
        assert len(five) == 5
        for command in five:
            run(shlex.split(command, comments=True))
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=DEADLINE_S)[1]
    finally:
        process.kill()
        process.wait()
    assert re.search(r"KeyboardInterrupt\n.*/logs/arm_\w+\.silo", said.replace("-", "_"), re.S), said
    assert "Error" not in said
    assert list(Path("logs").glob("arm_*.csv"))
    monkeypatch.setenv("MPLBACKEND", "Agg")
    exec(analysis, {"silo": silo, "np": np})


def run(words):
    """Run a command to its end; of one that goes on until Ctrl-C, see that it begins."""
    command = [str(BESIDE / words[0]), *words[1:]]
    if words[0] == "silo-tui":  # it wants a terminal; its own tests give it one
        assert subprocess.run([command[0], "--version"], check=False, capture_output=True).returncode == 0
        return
    if " ".join(words).startswith(FOR_EVER):
        begun = subprocess.Popen(command, stdout=subprocess.PIPE, env={**os.environ, "PYTHONUNBUFFERED": "1"})
        try:
            assert begun.stdout.readline()
        finally:
            begun.kill()
            begun.communicate()
        return
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=DEADLINE_S)
    assert done.returncode == 0, (words, done.stdout, done.stderr)


def ticks():
    try:
        with silo.connect("arm") as client:
            return client.status().ticks
    except SiloError:
        return 0

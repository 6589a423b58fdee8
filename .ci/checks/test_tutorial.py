"""The tutorial as it is typed by who follows it: each command, each line of Python runs, and prints what it shows."""

import itertools
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import silo
from silo.errors import SiloError
from tests.waiting import DEADLINE_S, wait_until

TUTORIAL = Path(__file__).resolve().parents[2] / ".docs" / "tutorial"
STEPS = sorted(TUTORIAL.glob("[0-9]-*.md"))
BLOCK = re.compile(r"```(bash|python|text)\n(.*?)```", re.S)
BEFORE, BESIDE = (re.compile(rf"<!-- {word}: (.*) -->") for word in ("before", "beside"))
TICKS = 2000  # after a push, and more than a second


@pytest.fixture
def folder(tmp_path, monkeypatch, runtime_folder):
    shutil.copy(TUTORIAL / "pendulum.py", tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("COLUMNS", "120")
    return tmp_path


def typed(line: str) -> str:
    """What a line of a shell prints; it must succeed."""
    done = subprocess.run(["bash", "-c", line], check=False, capture_output=True, text=True, timeout=DEADLINE_S)
    assert done.returncode == 0, (line, done.stdout, done.stderr)
    return done.stdout + done.stderr


def shown(text: str, printed: str) -> bool:
    """Whether a page shows what was printed, three dots for anything."""
    pattern = ".*".join(re.escape(part) for part in text.strip().split("..."))
    return re.fullmatch(pattern, printed.strip(), re.S) is not None


def ticks() -> int:
    try:
        with silo.connect("pendulum") as client:
            return client.status().ticks
    except SiloError:
        return 0


@pytest.mark.slow
@pytest.mark.parametrize("page", STEPS, ids=lambda page: page.stem)
def test_a_step_of_the_tutorial_does_and_prints_what_it_says(page, folder, capsys):
    text = page.read_text()
    if "openssl" in text and shutil.which("openssl") is None:
        pytest.skip("this computer has no openssl")
    for line in BEFORE.findall(text):
        typed(line)
    beside = [subprocess.Popen(line.split(), stderr=subprocess.DEVNULL) for line in BESIDE.findall(text)]
    try:
        if beside:
            wait_until(lambda: ticks() > TICKS)
        names, printed = {}, ""
        for kind, block in BLOCK.findall(text):
            if kind == "bash":
                printed = "".join(typed(line) for line in block.splitlines() if line.strip())
            elif kind == "python":
                exec(block, names)
                printed = capsys.readouterr().out
            elif "--8<--" not in block:
                assert shown(block, printed), printed
    finally:
        for one in beside:
            one.send_signal(signal.SIGINT)
            one.wait()


def test_each_step_leads_to_the_next_and_the_first_page_to_all():
    index = (TUTORIAL / "index.md").read_text()
    assert [step.name for step in STEPS if f"]({step.name})" not in index] == []
    pairs = itertools.pairwise(STEPS)
    assert [step.name for step, following in pairs if f"]({following.name})" not in step.read_text()] == []


def test_a_step_is_read_in_ten_minutes():
    assert [step.name for step in STEPS if len(step.read_text().split()) > 400] == []

"""Sessions of the shell on saved logs print, word by word, what they printed before.

A session is a file of `tests/data/sessions`: command lines behind `$ `, and what each prints (`exit` where that isn't
0). They run one after the other in a folder that `folder` fills. `SILO_WRITE=1 pytest tests/files/test_sessions.py`
runs the lines that stand there, and writes the rest anew: read the difference before you commit it.
"""

import os
import re
import shlex
import shutil
import time
from pathlib import Path

import pytest
from click.testing import CliRunner

from silo.cli.group import cli
from silo.files import write
from tests.stand_ins.fake_signals import START_NS
from tests.stand_ins.saved import SECOND, twenty_seconds

DIGITS = re.compile(r"-?\d+\.\d{11,}(?:e[+-]?\d+)?")
SESSIONS = Path(__file__).parents[1] / "data" / "sessions"


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Three runs, one of them as a bag, with labels and what else stands beside them."""
    root = tmp_path_factory.mktemp("sessions")
    for number in range(3):
        write(
            twenty_seconds(3600 * number, number + 1),
            root / "logs",
            "robot",
            ["silo"],
            f"robot_{number:05}",
            why="saved by ann",
        )
    write(twenty_seconds(7200, 4), root / "logs", "arm", ["bag"], "arm_00001")
    (root / "broken.silo").write_bytes((root / "logs" / "robot_00000.silo").read_bytes()[:20000])
    (root / "notes.silo").write_text("not a log")
    for path in root.rglob("*"):
        os.utime(path, ns=(START_NS + SECOND, START_NS + SECOND))
    return root


@pytest.fixture
def folder(written, tmp_path, monkeypatch):
    shutil.copytree(written, tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    for name, value in {"COLUMNS": "100", "LINES": "30", "TZ": "UTC", "NO_COLOR": "1"}.items():
        monkeypatch.setenv(name, value)
    time.tzset()
    yield
    monkeypatch.delenv("TZ")
    time.tzset()


def rounded(found):
    """A number with so many digits that the last ones are those of the processor, without these."""
    return f"{float(found[0]):.10g}"


def printed(line):
    result = CliRunner().invoke(cli, shlex.split(line)[1:], prog_name="silo")
    words = DIGITS.sub(rounded, result.output.replace(str(Path.cwd()), "HERE"))
    return words.rstrip("\n") + f"\nexit {result.exit_code}" * (result.exit_code != 0)


@pytest.mark.parametrize("name", sorted(path.stem for path in SESSIONS.glob("*.txt")))
def test_a_session(name, folder):
    path = SESSIONS / f"{name}.txt"
    lines = path.read_text().rstrip("\n").split("$ silo ")[1:]
    for place, (line, _, expected) in enumerate(each.rstrip("\n").partition("\n") for each in lines):
        found = printed(f"silo {line}")
        if os.environ.get("SILO_WRITE"):
            lines[place] = f"{line}\n{found}"
        else:
            assert found.strip() == expected.strip(), line
    if os.environ.get("SILO_WRITE"):
        path.write_text("\n".join(f"$ silo {each}" for each in lines) + "\n")

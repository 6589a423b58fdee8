"""`silo recover` after a program that was killed."""

import fcntl
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from silo.analysis.opening import open_log
from silo.cli.codes import EXIT_FAILED, EXIT_NO_LOGGER
from silo.cli.main import run
from silo.errors import SaveError
from silo.files.event_log import read_events
from tests.waiting import DEADLINE_S, wait_until

pytestmark = pytest.mark.slow

SEGMENT = r"/[^ ]+/arm\.[0-9]+\.0\.segment"

DYING = """
import os, signal, sys
import silo
log = silo.Logger("arm", folder=sys.argv[1], script="none.yaml", storage=sys.argv[2])
x = log.array("x")
log.start()
for i in range(int(sys.argv[3])):
    x[...] = i
    log.collect()
os.kill(os.getpid(), signal.SIGKILL)
"""


def die(folder: Path, storage: str = "memory", ticks: int = 5) -> None:
    """Run a program that logs some ticks and is killed."""
    done = subprocess.run(
        [sys.executable, "-c", DYING, str(folder), storage, str(ticks)], timeout=DEADLINE_S, check=False
    )
    assert done.returncode == -signal.SIGKILL


def test_what_was_left_is_listed_and_not_touched(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    die(tmp_path)
    for _ in range(2):
        assert run(["recover", "--list"]) == 0
        assert "logger 'arm': 5 samples of 1 element over " in capsys.readouterr().out
    assert not list(tmp_path.glob("*.silo"))


@pytest.mark.parametrize("words", [[], ["--list"]])
def test_a_folder_that_is_not_there_is_told_in_words(tmp_path: Path, capsys: pytest.CaptureFixture[str], words) -> None:
    assert run(["recover", str(tmp_path / "none"), *words]) == EXIT_FAILED
    assert f"'{tmp_path / 'none'}': there is no such folder or segment; `silo recover" in capsys.readouterr().err


def test_what_was_left_is_saved_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    die(tmp_path)
    assert run(["recover"]) == 0
    (path,) = tmp_path.glob("*.silo")
    what = rf"{SEGMENT}: saved 5 samples of 1 element over [0-9.e-]+ s, of 5 ticks since start"
    assert re.fullmatch(rf"{what}\n  {path}  [0-9.]+ kB\n", capsys.readouterr().out)
    assert open_log(path)["/log/x"].values.tolist() == [0, 1, 2, 3, 4]
    assert run(["recover"]) == 0
    assert capsys.readouterr().out == "nothing to recover\n"
    assert run(["recover", str(tmp_path)]) == 0
    what, why, name = capsys.readouterr().out.splitlines()
    assert (what, why) == (
        "nothing to recover",
        "what 'arm' logged last was saved already (program died):",
    )
    assert name.split()[0] == str(path)


SERVED = """
import os, signal, sys
import silo
log = silo.Logger("arm", folder=sys.argv[1], script="none.yaml")
x = log.array("x")
log.serve()
log.start()
log.collect()
if sys.argv[2] == "saved":
    log.save()
if sys.argv[2] == "closed":
    log.save()
    log.close()
else:
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize(
    ("ends", "why"), [("killed", "program died"), ("saved", "saved by the robot program"), ("closed", "")]
)
def test_what_was_saved_of_a_killed_program_is_named(
    ends: str, why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    subprocess.run([sys.executable, "-c", SERVED, str(tmp_path), ends], timeout=DEADLINE_S, check=False)
    wait_until(lambda: ends == "closed" or any(one.kind == "crashed" for one in read_events(tmp_path, "arm")))
    wait_until(lambda: not list(Path(os.environ["SILO_RUNTIME_DIR"]).glob("arm.*.segment")))  # it is freed after that
    (path,) = tmp_path.glob("*.silo")
    assert run(["recover", str(tmp_path)]) == 0
    what, *named = capsys.readouterr().out.splitlines()
    assert what == "nothing to recover"
    assert [line.split()[0] for line in named[1:]] == ([str(path)] if why else [])
    assert not why or f"({why})" in named[0]


def test_files_go_to_the_folder_that_is_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    die(tmp_path)
    assert run(["recover", "--folder", str(tmp_path / "new"), "-t", "csv", "--json"]) == 0
    (file,) = json.loads(capsys.readouterr().out)
    assert Path(file["path"]).parent == tmp_path / "new"
    assert Path(file["path"]).suffix == ".csv"


def test_a_log_kept_on_disk_is_found_in_its_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    die(tmp_path, storage="file")
    assert run(["recover", "--look-in", str(tmp_path)]) == 0
    assert len(list(tmp_path.glob("*.silo"))) == 1


def test_a_program_that_logged_nothing_only_gives_its_memory_back(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    die(tmp_path, ticks=0)
    assert run(["recover"]) == 0
    assert re.fullmatch(rf"{SEGMENT}: held no tick; its memory was freed\n", capsys.readouterr().out)
    assert run(["recover", "--list"]) == 0
    assert capsys.readouterr().out == "nothing to recover\n"


def test_a_file_that_is_no_segment_is_refused_and_stays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("mine")
    assert run(["recover", str(path)]) == EXIT_FAILED
    told = (
        "4 bytes are too few for a segment\nsilo: 1 of 1 segment could not be recovered; what failed stays as it is\n"
    )
    assert capsys.readouterr().err == f"{path}: {told}"
    assert path.read_text() == "mine"


@pytest.mark.parametrize("storage", ["memory", "file"])
def test_ls_sweeps_the_rests_of_saves_of_a_dead_program_that_nobody_served(storage, tmp_path, monkeypatch, capsys):
    die(tmp_path, storage)
    rest = tmp_path / ".silo-1-0a0b0c0d.part"
    rest.write_bytes(b"half a file")
    with (tmp_path / ".silo-2-0a0b0c0d.part").open("wb") as living:
        fcntl.flock(living, fcntl.LOCK_EX)
        monkeypatch.chdir("/")
        assert run(["ls"]) == EXIT_NO_LOGGER  # no logger runs
        assert [path.name for path in tmp_path.glob(".silo-*")] == [Path(living.name).name]
    assert "1 recording of programs that died may be in no file" in capsys.readouterr().err


def test_what_its_folder_has_no_room_for_is_told_how_to_save_elsewhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    die(tmp_path)

    def no_room(*_: object, **__: object) -> None:
        raise SaveError("no space left on device")

    with monkeypatch.context() as patched:
        patched.setattr("silo.helper.left_logs.recover", no_room)
        assert run(["recover", str(tmp_path)]) == EXIT_FAILED
        assert capsys.readouterr().err.endswith("stays as it is; `silo recover --folder DIR` saves it elsewhere\n")
        assert run(["recover", str(tmp_path), "--folder", str(tmp_path / "other")]) == EXIT_FAILED
        assert capsys.readouterr().err.endswith("what failed stays as it is\n")
    assert run(["recover", str(tmp_path), "--folder", str(tmp_path / "other")]) == 0
    assert list((tmp_path / "other").glob("*.silo"))

"""Links and pipes that somebody planted in the log folder under silo's own names: nothing goes through them."""

import os
from pathlib import Path

import pytest

from silo.core.runtime import open_own, read_own
from silo.errors import SaveError
from silo.files.event_log import append_events, event_log_path, newest_number, older_event_log, read_events
from silo.files.manifest import Ledger, read_captures, written_path
from silo.files.naming import next_run_number


@pytest.fixture
def victim(tmp_path: Path) -> Path:
    (tmp_path / "home").mkdir()
    made = tmp_path / "home" / "precious"
    made.write_text("mine\n")
    return made


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "logs").mkdir()
    return tmp_path / "logs"


def test_a_planted_counter_is_not_written_through(folder, victim) -> None:
    (folder / ".x_fileNumber").symlink_to(victim)
    with pytest.raises(SaveError, match="link, which silo doesn't follow"):
        next_run_number(folder, "x")
    (folder / ".y_fileNumber").symlink_to(victim.with_name("new"))
    with pytest.raises(SaveError, match="link, which silo doesn't follow"):
        next_run_number(folder, "y")
    assert victim.read_text() == "mine\n"
    assert not victim.with_name("new").exists()


def test_a_planted_event_log_is_neither_written_nor_read_through(folder, victim) -> None:
    for path in (event_log_path(folder, "x"), older_event_log(folder, "x")):
        path.symlink_to(victim)
    with pytest.raises(OSError, match="link, which silo doesn't follow"):
        append_events(folder, "x", [])
    with pytest.raises(OSError, match="link, which silo doesn't follow"):
        read_events(folder, "x")
    assert newest_number(folder, "x") == 0
    assert victim.read_text() == "mine\n"


def test_a_planted_list_of_captures_is_not_read_through(folder, victim) -> None:
    (folder / ".x.captures.jsonl").symlink_to(victim)
    with pytest.raises(OSError, match="link, which silo doesn't follow"):
        read_captures(folder, "x")


def test_a_planted_list_of_parts_is_not_read_through_and_a_pipe_holds_up_no_recorder(folder, victim) -> None:
    victim.write_text('{"recorder": "x", "parts": [{"name": "precious", "inode": 1, "size_bytes": 5}]}')
    written_path(folder, "x").symlink_to(victim)
    with pytest.raises(SaveError, match="link, which silo doesn't follow"):
        Ledger(folder, "x", 0.0, os.getpid())
    os.mkfifo(written_path(folder, "y"))
    with pytest.raises(SaveError, match="it is no file"):
        Ledger(folder, "y", 0.0, os.getpid())


def test_what_is_no_file_is_closed_again(folder) -> None:
    before = len(list(Path("/proc/self/fd").iterdir()))
    for _ in range(20):
        with pytest.raises(OSError, match="it is no file"):
            open_own(folder, os.O_RDONLY)
    assert len(list(Path("/proc/self/fd").iterdir())) < before + 10  # another thread may open some


def test_a_planted_pipe_holds_up_nobody(folder) -> None:
    os.mkfifo(folder / ".x_fileNumber")
    with pytest.raises(SaveError, match="it is no file"):
        next_run_number(folder, "x")
    os.mkfifo(folder / ".x.events.jsonl")
    with pytest.raises(OSError, match="it is no file"):
        read_own(folder / ".x.events.jsonl")


def test_a_file_of_ones_own_is_opened_as_ever(folder) -> None:
    descriptor = open_own(folder / "a", os.O_RDWR | os.O_CREAT)
    os.write(descriptor, b"a")
    os.close(descriptor)
    assert read_own(folder / "a") == b"a"
    with pytest.raises(FileNotFoundError):
        read_own(folder / "b")


def test_a_list_of_parts_that_is_damaged_leaves_its_name_free(tmp_path):
    written_path(tmp_path, "x").write_bytes(b"{")
    for _ in range(2):
        with pytest.raises(SaveError, match="the list of this recorder's files is damaged"):
            Ledger(tmp_path, "x", 0.0, os.getpid())

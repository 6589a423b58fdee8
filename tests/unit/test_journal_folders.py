"""Where journals are found after a power cut: links in the state folder to the log folders that hold some."""

import os
import shutil
import time
from pathlib import Path

import pytest

from silo.core.runtime import announce_segment, list_segments
from silo.journal.folders import KEPT_S, remember_folder, remembered_folders
from silo.segment.held_runs import remove


@pytest.fixture
def state(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "silo" / "journals"


@pytest.fixture
def logs(tmp_path):
    (tmp_path / "logs" / ".arm.1-2.0.journal").mkdir(parents=True)
    return tmp_path / "logs"


def test_a_folder_with_a_journal_is_remembered_once(state, logs, monkeypatch):
    remember_folder(logs)
    monkeypatch.chdir(logs.parent)
    remember_folder(Path("logs"))
    assert remembered_folders() == [logs]
    assert len(list(state.iterdir())) == 1


def test_a_folder_without_journal_is_forgotten(state, logs):
    remember_folder(logs)
    (logs / ".arm.1-2.0.journal").rmdir()
    assert remembered_folders() == []
    assert list(state.iterdir()) == []


def test_a_folder_whose_disk_is_not_mounted_is_kept_for_a_month(state, logs):
    remember_folder(logs)
    shutil.rmtree(logs)
    assert remembered_folders() == [logs]
    (link,) = state.iterdir()
    month_ago = time.time() - KEPT_S - 1
    os.utime(link, (month_ago, month_ago), follow_symlinks=False)
    assert remembered_folders() == []


def test_a_new_journal_renews_the_month(state, logs):
    remember_folder(logs)
    (link,) = state.iterdir()
    os.utime(link, (0, 0), follow_symlinks=False)
    remember_folder(logs)
    assert time.time() - link.lstat().st_mtime < KEPT_S


def test_the_state_folder_is_in_the_home_where_no_other_is_set(logs, tmp_path, monkeypatch):
    for wrong in ("", "relative/folder"):
        monkeypatch.setenv("XDG_STATE_HOME", wrong)
        monkeypatch.setenv("HOME", str(tmp_path / "home"))
        remember_folder(logs)
        assert remembered_folders() == [logs]
    assert len(list((tmp_path / "home/.local/state/silo/journals").iterdir())) == 1


def test_what_is_no_link_is_left_alone(state, logs):
    remember_folder(logs)
    (state / "notes").write_text("mine")
    assert remembered_folders() == [logs]
    assert (state / "notes").read_text() == "mine"


def test_a_segment_in_a_log_folder_is_removed_with_what_tells_of_it(runtime_folder, logs):
    segment = logs / ".arm.1.0.segment"
    segment.touch()
    announce_segment(segment)
    assert list_segments() == [segment]
    remove(segment)
    assert (segment.exists(), list_segments(), list(runtime_folder.iterdir())) == (False, [], [])

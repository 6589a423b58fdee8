"""One save: names, run numbers, several formats, and nothing half-done."""

import errno
import os
import threading
from datetime import datetime
from pathlib import Path
from types import SimpleNamespace

import pytest

import silo
from silo.core.arguments import check_name
from silo.core.elements import FileType, LoggedEvent
from silo.errors import ElementError, LogNotFoundError, SaveError
from silo.files import PartlySavedError, atomic, write
from silo.files.atomic import atomic_file, atomic_folder
from silo.files.event_log import append_events
from silo.files.naming import find_log, find_logs, log_path, next_run_number
from silo.files.silo import writer


@pytest.fixture
def recording(plan, recorded):
    return recorded([plan("/log/a")], 5)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_run_numbers_count_from_one(tmp_path):
    assert [next_run_number(tmp_path, "robot") for _ in range(3)] == [1, 2, 3]
    assert (tmp_path / ".robot_fileNumber").read_text().strip() == "3"


def test_the_number_of_the_original_is_taken_on(tmp_path):
    (tmp_path / ".robot_fileNumber").write_text("99999")
    assert next_run_number(tmp_path, "robot") == 100_000
    path = log_path(tmp_path, "robot", 100_000, datetime(2026, 3, 4, 5, 6, 7), ".silo")
    assert path.name == "robot_20260304_05-06-07_100000.silo"


def test_threads_that_save_at_once_get_different_numbers(tmp_path):
    numbers = []
    threads = [
        threading.Thread(target=lambda: numbers.extend(next_run_number(tmp_path, "robot") for _ in range(100)))
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(numbers) == list(range(1, 401))


@pytest.mark.parametrize("content", ["", "x", "-4", "\0\0"])
def test_a_damaged_counter_goes_on_after_the_newest_log(content, recording, tmp_path):
    (tmp_path / ".robot_fileNumber").write_text("41")
    write(recording, tmp_path, "robot", ["silo"])
    (tmp_path / ".robot_fileNumber").write_text(content)
    assert next_run_number(tmp_path, "robot") == 43


def test_all_formats_of_a_save_share_one_name(recording, tmp_path):
    saved = write(recording, tmp_path, "robot", [FileType.SILO, "csv", "silo"])
    assert [file.type for file in saved] == [FileType.SILO, FileType.CSV]
    stems = {str(Path(file.path).with_suffix("")) for file in saved}
    assert len(stems) == 1
    assert stems.pop().endswith("_00001")
    assert all(Path(file.path).stat().st_size == file.size_bytes for file in saved)


def test_a_bag_is_a_folder_with_the_size_of_its_files(recording, tmp_path):
    (saved,) = write(recording, tmp_path, "robot", ["bag"])
    assert Path(saved.path).is_dir()
    assert saved.size_bytes == sum(path.stat().st_size for path in Path(saved.path).iterdir())


def test_a_custom_name_takes_the_ending_of_the_format(recording, tmp_path):
    assert [Path(file.path).name for file in write(recording, tmp_path, "r", ["silo", "csv"], "my run.silo")] == [
        "my run.silo",
        "my run.csv",
    ]


def test_a_custom_name_that_is_taken_is_refused_before_anything_is_written(recording, tmp_path):
    (tmp_path / "x.csv").write_text("precious")
    with pytest.raises(SaveError, match=r"x\.csv' exists already"):
        write(recording, tmp_path, "robot", ["silo", "csv"], "x")
    assert names(tmp_path) == ["x.csv"]


@pytest.mark.parametrize("name", ["a/b", "../a", ".hidden", "", "  ", "a\nb", "a\0b", "x" * 300, "é" * 150, ".silo"])
def test_names_that_are_no_plain_file_names_are_refused(name, recording, tmp_path):
    with pytest.raises(SaveError, match="can't be the name of a log"):
        write(recording, tmp_path, "robot", ["silo"], name)
    assert names(tmp_path) == []


@pytest.mark.parametrize("name", ["a b", "Ω", "run-1", "x" * 200, "a.b"])
def test_other_names_are_taken(name):
    assert check_name(name) == name


def test_an_unknown_type_is_refused(recording, tmp_path):
    with pytest.raises(ElementError, match="unknown file type 'xls'; there are silo, csv and bag"):
        write(recording, tmp_path, "robot", ["xls"])
    with pytest.raises(SaveError, match="no file type"):
        write(recording, tmp_path, "robot", [])


def test_a_folder_that_can_not_be_made_is_an_error(recording, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(SaveError, match="can't make the folder"):
        write(recording, tmp_path / "file", "robot", ["silo"])


def fail_writing(monkeypatch, error):
    def refuse(*_arguments):
        raise error

    monkeypatch.setattr(writer, "write_all", refuse)


@pytest.mark.parametrize(("inodes", "told"), [(5, "B are free in .*:"), (0, "can hold no more files, .*:")])
def test_a_full_disk_is_told_and_leaves_nothing(recording, tmp_path, monkeypatch, inodes, told):
    fail_writing(monkeypatch, OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    monkeypatch.setattr(
        os, "statvfs", lambda _: SimpleNamespace(f_bavail=9, f_frsize=1, f_blocks=9, f_files=9, f_favail=inodes)
    )
    with pytest.raises(
        SaveError, match=rf"x\.silo': No space left on device; .*{told} make room or choose another folder; nothing was"
    ):
        writer.write_silo(recording, tmp_path / "x.silo")
    assert names(tmp_path) == []


def test_a_failed_save_leaves_what_stood_under_the_name(recording, tmp_path, monkeypatch):
    (tmp_path / "x.silo").write_text("old")
    fail_writing(monkeypatch, OSError(errno.EIO, "broken"))
    with pytest.raises(SaveError):
        writer.write_silo(recording, tmp_path / "x.silo")
    assert (tmp_path / "x.silo").read_text() == "old"
    assert names(tmp_path) == ["x.silo"]


def test_if_one_format_fails_the_others_are_written_and_the_error_names_both(recording, tmp_path, monkeypatch):
    fail_writing(monkeypatch, OSError(errno.ENOSPC, "No space left on device"))
    with pytest.raises(PartlySavedError, match=r"x\.silo': No space.*; saved: .*x\.csv") as caught:
        write(recording, tmp_path, "robot", ["silo", "csv"], "x")
    assert [file.type for file in caught.value.saved] == [FileType.CSV]
    assert names(tmp_path) == ["x.csv", "x.csv.json"]


def test_progress_of_a_save_runs_over_all_formats(recording, tmp_path):
    fractions = []
    write(recording, tmp_path, "robot", ["silo", "csv"], progress=fractions.append)
    assert fractions == sorted(fractions)
    assert (fractions[0], fractions[-1]) == (0.0, 1.0)
    assert 0.5 in fractions


def test_a_file_stands_under_its_name_only_when_it_is_whole(tmp_path):
    with atomic_file(tmp_path / "x") as file:
        file.write(b"1")
        assert not (tmp_path / "x").exists()
    assert (tmp_path / "x").read_bytes() == b"1"
    assert names(tmp_path) == ["x"]


def test_a_folder_stands_under_its_name_only_when_it_is_whole(tmp_path):
    with atomic_folder(tmp_path / "x") as folder:
        (folder / "a").write_text("1")
        assert not (tmp_path / "x").exists()
    assert names(tmp_path / "x") == ["a"]
    with pytest.raises(SaveError, match="exists already"), atomic_folder(tmp_path / "x"):
        pass
    with pytest.raises(KeyboardInterrupt), atomic_folder(tmp_path / "y") as folder:
        (folder / "a").write_text("1")
        raise KeyboardInterrupt
    assert names(tmp_path) == ["x"]


def test_a_missing_folder_is_an_error_of_the_save(recording, tmp_path):
    with pytest.raises(SaveError, match="No such file or directory"):
        writer.write_silo(recording, tmp_path / "none" / "x.silo")


@pytest.fixture
def folder(recording, tmp_path):
    """Logs of two loggers, of two days, one of them also as CSV, and one with a name of its own."""
    for name in (
        "robot_20260301_10-00-00_00001.silo",
        "robot_20260302_10-00-00_00002.csv",
        "robot_20260302_10-00-00_00002.silo",
        "arm_20260303_10-00-00_00001.silo",
        "arm_20260303_10-00-01_100000.silo",
        "my run.silo",
        "notes.txt",
    ):
        (tmp_path / name).write_text("x")
    return tmp_path


@pytest.mark.parametrize(
    ("which", "name"),
    [
        ("robot_20260301_10-00-00_00001.silo", "robot_20260301_10-00-00_00001.silo"),
        ("robot", "robot_20260302_10-00-00_00002.silo"),
        ("robot_20260301", "robot_20260301_10-00-00_00001.silo"),
        ("arm_", "arm_20260303_10-00-01_100000.silo"),
        ("my", "my run.silo"),
        (2, "robot_20260302_10-00-00_00002.silo"),
        (100_000, "arm_20260303_10-00-01_100000.silo"),
        ("2", "robot_20260302_10-00-00_00002.silo"),
    ],
)
def test_logs_are_found_by_path_start_and_run_number(which, name, folder):
    assert find_log(which, folder) == folder / name


def test_captures_stand_among_the_logs_by_the_date_and_number_in_their_names(folder):
    capture = folder / "robot_20260301_12-00-00_00007_fall_1.silo"
    capture.write_text("x")  # written after all the others
    assert find_log("robot", folder).name == "robot_20260302_10-00-00_00002.silo"
    assert find_logs("robot_2", folder)[-2] == capture
    assert find_log(7, folder) == capture


def test_what_is_left_out_is_told_of_at_the_line_that_opens(recording, tmp_path):
    write(recording, tmp_path, "robot", ["silo"], "robot_20260309_10-00-00_00008")
    (tmp_path / "robot_20260309_10-00-05_00009_fall_1.silo").write_text("x")
    with pytest.warns(silo.LogWarning, match="captures? .*left out") as caught:
        silo.open_logs(tmp_path)
    assert [warning.filename for warning in caught] == [__file__]


def test_a_folder_means_its_newest_run_and_captures_are_meant_by_name(tmp_path):
    captures = ["robot_20260309_10-00-05_00009_fall_1", "robot_20260309_10-00-07_00010_fall_2"]
    names = ["robot_20260309_10-00-00_00008", *captures]
    for name in names:
        (tmp_path / f"{name}.silo").write_text("x")
    told = []
    for which in (tmp_path, "robot", "robot_*", "*.silo"):
        assert find_log(which, tmp_path, told.append).stem == names[0]
    newer = f"2 captures are newer, and meant by name, like '{names[2]}.silo'"
    assert told == [f"'{names[0]}.silo' was taken, the newest run; {newer}"] * 4
    assert find_log("*_fall_*", tmp_path, told.append).stem == names[2]
    assert find_log(names[1], tmp_path, told.append).stem == names[1]
    assert len(told) == 4
    assert [path.stem for path in find_logs("robot_20260309", tmp_path, told.append, captures=False)] == names[:1]
    assert told[4:] == ["one run is taken, 2 captures are left out: those are meant by name, like '*_TRIGGER_*'"]
    assert [path.stem for path in find_logs("*_fall_*", tmp_path, told.append, captures=False)] == names[1:]
    assert [path.stem for path in find_logs("robot_20260309", tmp_path)] == names


def test_of_a_run_number_the_run_is_meant_not_what_was_captured_of_it(tmp_path):
    for name in ("robot_20260309_10-00-00_00008", "robot_20260309_10-00-05_00008_fall_1"):
        (tmp_path / f"{name}.silo").write_text("x")
    assert find_log(8, tmp_path).stem == "robot_20260309_10-00-00_00008"


def test_a_path_is_found_from_anywhere(folder, tmp_path_factory):
    path = folder / "my run.silo"
    assert find_log(path, tmp_path_factory.mktemp("else")) == path
    assert find_log(str(path)[:-7]) == path


def test_a_name_means_the_logger_of_just_that_name_and_none_where_several_begin_so(tmp_path):
    stems = [f"{name}_20260309_10-00-0{at}_00001" for at, name in enumerate(("alpha", "alpha_left", "alphabet"))]
    for stem in stems:
        (tmp_path / f"{stem}.silo").write_text("x")
    assert [find_log(which, tmp_path).stem for which in ("alpha", "alpha_", "alphabet", "alpha_l", tmp_path)] == [
        stems[0], stems[0], stems[2], stems[1], stems[2]
    ]  # fmt: skip
    assert [path.stem for path in find_logs("alpha", tmp_path)] == stems[:1]
    with pytest.raises(LogNotFoundError, match=r"several loggers \(alpha, alpha_left, alphabet\); .* like 'alpha'"):
        find_log("alp", tmp_path)


def test_a_run_number_of_two_loggers_is_ambiguous(folder):
    with pytest.raises(LogNotFoundError, match=r"several loggers \(arm, robot\); say which .* like 'arm_'"):
        find_log(1, folder)


def test_what_is_there_is_told_when_nothing_is_found(folder, tmp_path):
    with pytest.raises(LogNotFoundError, match=r"no log 'leg' in .*; there are: .* and \d more"):
        find_log("leg", folder)
    with pytest.raises(LogNotFoundError, match="no log of run 7"):
        find_log(7, folder)
    (tmp_path / "empty").mkdir()
    with pytest.raises(LogNotFoundError, match="the folder holds no log"):
        find_log("x", tmp_path / "empty")


def test_a_folder_of_what_logs_were_converted_to_says_how_to_open_it(tmp_path):
    for name in ("run.npz", "flight.ulg"):
        (tmp_path / name).write_bytes(b"")
    with pytest.raises(LogNotFoundError, match=r"holds no log; run\.npz is what one was converted to: name the file"):
        find_log(tmp_path)


def test_a_folder_that_holds_no_log_names_those_in_it_that_do(tmp_path):
    for name in ("silo-logs", "other", ".hidden"):
        (tmp_path / name).mkdir()
    for name in ("silo-logs", ".hidden"):
        (tmp_path / name / "robot_20260301_10-00-00_00001.silo").write_text("x")
    for which in ("robot", 2):
        with pytest.raises(LogNotFoundError, match=r"holds no log, but there are some in 'silo-logs': say where\)"):
            find_log(which, tmp_path)


def test_of_one_logger_the_run_number_says_which_is_the_newest(tmp_path):
    # local time went back from 03:00 to 02:00 between the two
    for name in ("robot_20261025_02-50-00_00007.silo", "robot_20261025_02-10-00_00008.silo"):
        (tmp_path / name).touch()
    assert find_log("robot", tmp_path).name.endswith("_00008.silo")
    assert find_log(tmp_path).name.endswith("_00008.silo")
    assert [path.stem[-1] for path in find_logs("robot", tmp_path)] == ["7", "8"]
    (tmp_path / "other_20261025_02-30-00_00001.silo").touch()
    (tmp_path / "late_20261026_02-30-00_00001.silo").touch()
    assert [path.stem.partition("_")[0] for path in find_logs("*.silo", tmp_path)] == [
        "other",
        "robot",
        "robot",
        "late",
    ]


def test_where_locks_are_not_known_runs_are_counted_and_events_written(tmp_path, monkeypatch):
    def refused(descriptor, how):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(atomic.fcntl, "flock", refused)
    assert [next_run_number(tmp_path, "robot"), next_run_number(tmp_path, "robot")] == [1, 2]
    append_events(tmp_path, "robot", [LoggedEvent("marker", "here", 10**18)])
    assert (tmp_path / ".robot.events.jsonl").read_text().count("here") == 1


def test_a_name_that_may_not_outlast_a_power_cut_is_said_to_stand_there(tmp_path, monkeypatch):
    def broken(path):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(atomic, "sync_folder", broken)
    for kind in (atomic.atomic_file, atomic.atomic_folder):
        path = tmp_path / kind.__name__
        with pytest.raises(SaveError, match="the new one stands under that name, but may be gone"), kind(path):
            pass
        assert path.exists()


@pytest.mark.parametrize("made", [atomic_file, atomic_folder])
def test_who_refuses_while_a_file_is_made_is_heard_in_their_own_words(tmp_path, made):
    with pytest.raises(SaveError) as told, made(tmp_path / "x"):
        raise SaveError("the log has no rows")
    assert str(told.value) == "the log has no rows"
    assert list(tmp_path.iterdir()) == []

"""What people take for a log of silo, or for a logger: each is told for what it is, with the way on."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import silo
from silo.cli.group import cli
from silo.cli.loggers.events import events
from silo.cli.loggers.info import info
from silo.errors import FileFormatError, LogNotFoundError
from silo_tui.cli import _file


@pytest.fixture
def saved(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    log = silo.Logger("robot", frequency=100, folder=tmp_path / "logs", script=tmp_path / "no.yaml")
    log.array("x")
    log.start()
    log.collect()
    log.mark("slipped")
    (done,) = log.save()
    log.close()
    return done.path


@pytest.mark.parametrize(
    ("name", "start", "words"),
    [
        ("x.mcap", b"version https://git-lfs.github.com/spec/v1\n", "a pointer of Git LFS.*git lfs pull"),
        ("x.silo", b"version https://git-lfs.github.com/spec/v1\n", "a pointer of Git LFS"),
    ],
)
def test_files_of_others_are_called_by_their_names(name, start, words, tmp_path):
    (tmp_path / name).write_bytes(start + bytes(100))
    with pytest.raises(FileFormatError, match=words):
        silo.open_log(tmp_path / name)


@pytest.mark.parametrize("name", ["x.parquet", "x.mat", "x.h5", "x.npz"])
def test_a_table_that_is_none_is_called_by_its_name(name, tmp_path):
    (tmp_path / name).write_bytes(bytes(100))
    with pytest.raises(FileFormatError, match=f"{name}' (can't be read|was not written by silo)"):
        silo.open_log(tmp_path / name)


def test_a_table_of_others_says_that_silo_did_not_write_it(tmp_path):
    np.savez(tmp_path / "x.npz", a=np.arange(3))
    with pytest.raises(FileFormatError, match="was not written by silo"):
        silo.open_log(tmp_path / "x.npz")


@pytest.mark.parametrize("name", ["x.dat", "x.txt"])
def test_info_of_a_file_that_silo_does_not_read_speaks_of_the_file(name, tmp_path):
    (tmp_path / name).write_bytes(bytes(100))
    error = CliRunner().invoke(info, [str(tmp_path / name)]).exception
    assert isinstance(error, FileFormatError)
    assert f"silo doesn't read {name[1:]}" in str(error)


def test_info_of_a_file_that_is_not_there_speaks_of_the_file(tmp_path):
    error = CliRunner().invoke(info, [str(tmp_path / "run.parquet")]).exception
    assert isinstance(error, LogNotFoundError)


def test_events_of_a_run_are_those_of_its_file(saved, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path / "logs")
    of_file = CliRunner().invoke(events, [saved]).output
    assert "slipped" in of_file
    assert CliRunner().invoke(events, ["1"]).output == of_file


def test_a_path_is_a_file_for_silo_tui_wherever_it_looks_for_loggers(saved):
    opened = _file(saved, lambda: {saved})
    assert opened is not None
    assert _file("robot3/anymal", lambda: {"robot3/anymal"}) is None


def test_a_folder_in_the_home_is_meant_by_its_sign(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    log = silo.Logger("home", frequency=100, folder="~/logs", script="~/none.yaml")
    x = log.array("x")
    log.start()
    x[...] = 3
    log.collect()
    (done,) = log.save()
    log.close()
    assert done.path.startswith(str(tmp_path / "logs"))
    assert not (tmp_path / "~").exists()
    assert np.asarray(silo.open_log("home", "~/logs")["x"]).tolist() == [3]


POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:" + b"0" * 64 + b"\nsize 12345\n"


@pytest.mark.parametrize("names", [["x.db3"], ["x_0.mcap", "metadata.yaml"], ["x.db3", "metadata.yaml"]])
def test_a_bag_folder_of_pointers_of_git_lfs_says_so(names, tmp_path):
    for name in names:
        (tmp_path / name).write_bytes(POINTER)
    with pytest.raises(FileFormatError, match=r"a pointer of Git LFS.*`git lfs pull`"):
        silo.open_log(tmp_path)


def test_a_description_that_is_a_pointer_of_git_lfs_is_told_and_the_messages_are_read(tmp_path):
    from mcap.writer import Writer

    for number in range(2):
        with (tmp_path / f"x_{number}.mcap").open("wb") as file:
            writer = Writer(file)
            writer.start()
            schema = writer.register_schema("J", "jsonschema", b"{}")
            writer.add_message(writer.register_channel("/j", "json", schema), number, b'{"a": 1}', number)
            writer.finish()
    (tmp_path / "metadata.yaml").write_bytes(POINTER)
    with pytest.warns(silo.LogWarning, match=r"metadata.yaml' is a pointer of Git LFS.*is not known without it"):
        log = silo.open_log(tmp_path)
    assert log["j/a"].values.tolist() == [1, 1]


@pytest.mark.parametrize(
    "words",
    [
        ["info", "~/logs/run.silo"],
        ["events", "~/logs/run.silo"],
        ["stats", "~/logs/run.silo"],
        ["check", "~/logs/run.silo", "--never", "x > 5"],
        ["diff", "~/logs/run.silo", "~/logs/run.silo"],
        ["plot", "~/logs/run.silo", "x"],
        ["convert", "~/logs/run.silo", "~/logs/run.csv"],
        ["verify", "~/logs"],
    ],
)
def test_a_quoted_sign_of_the_home_is_the_home_in_every_command(words, saved, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    Path(saved).rename(tmp_path / "logs" / "run.silo")
    result = CliRunner().invoke(cli, words)
    assert result.exit_code == 0, result.output
    assert not (tmp_path / "~").exists()


def test_a_log_in_the_home_is_opened_by_its_sign(saved, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    for which in ("~/logs", "~/logs/robot_", "~/logs/*.silo"):
        assert silo.open_log(which).path == saved
        assert [log.path for log in silo.open_logs(which)] == [saved]
    assert silo.open_log(1, folder="~/logs").path == saved
    with pytest.raises(LogNotFoundError, match="no log '~nobody-of-this-name/x'"):
        silo.open_log("~nobody-of-this-name/x")

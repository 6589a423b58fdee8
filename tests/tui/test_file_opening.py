"""What the command line takes for a logger, what for a file, and how it says that there is none."""

import numpy as np
import pytest
from click.testing import CliRunner

from silo.core.elements import BufferType, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.errors import LogNotFoundError
from silo.files.silo.writer import write_silo
from silo_tui.cli import command
from silo_tui.sessions.target import file_meant

NAME = "robot_20260921_14-00-00_00007.silo"


def nobody():
    return ()


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(tmp_path / "run"))
    return tmp_path


def write(path, ticks=10):
    values = np.arange(float(ticks))
    entries = (RecordedEntry("/log/a", Entry("", "<f8"), values),)
    element = RecordedElement("/log/a", "-", "scalar", (), 1, BufferType.FIXED, 0, entries)
    write_silo(Recording("robot", np.arange(ticks, dtype=np.int64) * 10**6, ticks, (element,)), path)
    return path


def test_a_known_ending_always_means_a_file(folder):
    write(folder / NAME)
    assert file_meant(NAME, lambda: [NAME]).name == NAME


def test_a_separator_always_means_a_file(folder):
    write(folder / NAME).rename(folder / "robot")
    assert file_meant("./robot", lambda: ["robot"]) is not None


def test_a_running_logger_comes_before_a_file_of_its_name(folder):
    write(folder / NAME).rename(folder / "robot")
    assert file_meant("robot", lambda: ["robot"]) is None
    assert file_meant("robot", nobody) is not None


def test_a_run_number_and_a_beginning_mean_the_file(folder):
    write(folder / NAME)
    assert file_meant("7", nobody).name == NAME
    assert file_meant("robot_2026", nobody).name == NAME


def test_the_name_of_a_logger_is_no_beginning_of_a_file_name(folder):
    write(folder / NAME)
    assert file_meant("robot", nobody) is None


def test_nor_is_it_of_the_name_of_a_capture(folder):
    write(folder / NAME.replace(".silo", "_fall_3.silo"))
    assert file_meant("robot", nobody) is None
    assert file_meant("robot_2026", nobody) is not None


def test_an_unknown_word_is_the_name_of_a_logger(folder):
    assert file_meant("anymal", nobody) is None


def test_a_folder_without_a_bag_is_no_log(folder):
    (folder / "logs").mkdir()
    with pytest.raises(LogNotFoundError, match="without a bag"):
        file_meant("logs/", nobody)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("missing.silo", None, "no log 'missing.silo'"),
        ("picture.silo", b"\x89PNG\r\n\x1a\n" * 40, "picture.silo"),
        ("void.silo", b"", "void.silo"),
        ("words.csv", b"hello\n", "words.csv"),
        ("robot.mcap", b"MCAP", "robot.mcap"),
    ],
)
def test_what_can_t_be_opened_is_told_in_one_line(folder, name, content, words):
    if content is not None:
        (folder / name).write_bytes(content)
    result = CliRunner().invoke(command, [name])
    assert result.exit_code == 1
    assert words in result.stderr
    assert result.stderr.startswith("Error: ")
    assert len(result.stderr.strip().splitlines()) == 1


def test_a_log_without_ticks_is_empty(folder):
    write(folder / "empty.silo", ticks=0)
    result = CliRunner().invoke(command, ["empty.silo"])
    assert (result.exit_code, "empty" in result.stderr) == (1, True)


def test_help_tells_how_a_file_is_meant():
    text = CliRunner().invoke(command, ["--help"]).output
    assert "LOGGER | FILE" in text
    assert "run.silo" in text
    assert "Needs pip install 'silo-logger[web]'" in " ".join(text.split())


def test_a_file_is_a_file_wherever_one_looks_for_loggers(folder):
    result = CliRunner().invoke(command, ["there/is-none.silo"], env={"SILO_CONFIG": "robot3"})
    assert (result.exit_code, "is-none.silo" in result.stderr) == (1, True)
    write(folder / "run.silo")
    result = CliRunner().invoke(command, ["--config", "robot3", "./run.silo"])
    assert "silo-tui needs a terminal" in result.stderr, "which comes behind reading the file"

"""Which logs a data set is made of: how a folder or a glob is typed, and moments that two of them have."""

from pathlib import Path

import pytest
from click.testing import CliRunner

import silo
from silo.cli.group import cli
from silo.datasets.lerobot import write_lerobot


@pytest.fixture
def folder(tmp_path, new_logger):
    """Three runs of 100 ticks, and what triggers captured of the last two: its ticks 20 to 40, and 30 to 60."""
    where = tmp_path / "runs"
    for number in range(3):
        stamps = iter(range(0, 10**10, 10**7))
        log = new_logger("le", frequency=100, folder=where, clock=lambda stamps=stamps: next(stamps))
        q = log.array("q")
        log.start()
        for tick in range(100):
            q[...] = tick
            log.collect()
        path = Path(log.save().path)
        log.close()
        if number:
            part = silo.open_log(path).clip(0.1 + 0.1 * number, 0.2 + 0.2 * number)
            part.save(path.with_name(f"{path.stem}_fall_{number}.silo"))
    return where


def convert(*words):
    made = CliRunner().invoke(cli, ["convert", *map(str, words), "--to", "episodes", "--fps", "50", "--state", "q"])
    assert made.exit_code == 0, made.output
    return made.output


@pytest.mark.parametrize("which", ["", "le_*.silo", "*"])
def test_a_folder_and_a_glob_mean_all_runs_and_no_capture_and_say_so(folder, tmp_path, which):
    shown = convert(folder / which, tmp_path / "out")
    assert "3 runs are taken, 2 captures are left out: those are meant by name" in shown
    assert f"{folder / which}: 3 logs" in shown
    assert shown.splitlines()[-1].endswith("out  3 episodes, 150 frames at 50/s")


def test_captures_are_those_of_a_folder_where_these_are_asked_for(folder, tmp_path):
    shown = convert(folder, tmp_path / "out", "--episodes", "captures")
    assert f"{folder}: 5 logs" in shown
    assert shown.count(": it is no capture") == 3
    assert "out  2 episodes" in shown


def test_names_that_the_shell_made_of_a_glob_are_all_taken_and_moments_in_two_of_them_are_told(folder, tmp_path):
    paths = sorted(folder.glob("le_*.silo"))
    shown = convert(*paths, tmp_path / "out")
    assert "out  5 episodes" in shown
    captures = [path for path in paths if "_fall_" in path.name]
    whole = [path.with_name(f"{path.stem.rpartition('_fall_')[0]}.silo") for path in captures]
    assert [line for line in shown.splitlines() if line.startswith("warning: ")] == [
        f"warning: {capture}: ticks {first} to {last} of its run are in {run}, too: the same moments count twice"
        for capture, run, first, last in zip(captures, whole, (20, 30), (40, 60), strict=True)
    ]


def test_what_is_written_by_a_program_tells_moments_that_are_in_two_episodes(folder, tmp_path):
    run = silo.open_log(folder)
    made = write_lerobot(
        [run.clip(0.0, 0.3), run.clip(0.31, 0.5), run.clip(0.4, 0.6)],
        tmp_path / "out",
        fps=50,
        state=["q"],
        to="episodes",
    )
    assert [words for _, words in made.again] == [
        f"ticks 40 to 50 of its run are in {run.path}, too: the same moments count twice"
    ]
    marked = write_lerobot([run], tmp_path / "other", fps=50, state=["q"], to="episodes")
    assert marked.again == []

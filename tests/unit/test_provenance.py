"""Each file says where it comes from: host, versions, commit, and what the program said."""

import os
import subprocess

import pytest

import silo
from silo.cli.group import cli
from silo.errors import ElementError
from silo.logger.arguments.provenance import git_state
from silo.version import VERSION


def git(folder, *words):
    environment = {**os.environ, "GIT_CONFIG_GLOBAL": "/dev/null", "GIT_CONFIG_NOSYSTEM": "1"}
    who = ("-c", "user.name=a", "-c", "user.email=a@b")
    command = ["git", "-C", str(folder), *who, *words]
    return subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout.strip()


@pytest.fixture
def tree(tmp_path):
    folder = tmp_path / "robot"
    (folder / "src").mkdir(parents=True)
    (folder / "src" / "walk.py").write_text("step()\n")
    (folder / "README").write_text("walks\n")
    git(folder, "init", "-q", "-b", "main")
    git(folder, "add", ".")
    git(folder, "commit", "-q", "-m", "first")
    return folder


@pytest.mark.slow
class TestGit:
    def test_the_commit_of_a_folder_below_is_found(self, tree):
        assert git_state(tree / "src", 60) == git(tree, "rev-parse", "HEAD")

    @pytest.mark.parametrize("version", [2, 3])  # of the index: one file that is skipped makes it the later
    def test_a_file_that_was_changed_is_told_whatever_its_size_and_time(self, tree, version):
        if version == 3:
            git(tree, "update-index", "--skip-worktree", "README")
        assert (tree / ".git" / "index").read_bytes()[7] == version
        commit, path = git(tree, "rev-parse", "HEAD"), tree / "src" / "walk.py"
        os.utime(path, (1, 1))
        assert git_state(tree, 60) == commit
        path.write_text("stop()\n")
        assert git_state(tree, 60) == f"{commit} (with changes)"
        path.unlink()
        assert git_state(tree, 60) == f"{commit} (with changes)"

    def test_branches_that_are_packed_worktrees_and_detached_heads_are_found(self, tree, tmp_path):
        commit = git(tree, "rev-parse", "HEAD")
        git(tree, "worktree", "add", "-q", "-b", "side", str(tmp_path / "side"))
        git(tree, "pack-refs", "--all")
        assert git_state(tree, 60) == git_state(tmp_path / "side", 60) == commit
        git(tree, "checkout", "-q", "--detach")
        assert git_state(tree, 60) == commit

    def test_looking_ends_in_time_and_says_so(self, tree):
        assert git_state(tree, -1).endswith(" (not all files were looked at)")

    def test_what_is_damaged_or_no_repository_says_nothing(self, tree, tmp_path):
        (tree / ".git" / "index").write_bytes(b"DIRC\0\0\0\2\0\0\0\5")
        assert git_state(tree, 60) == ""
        assert git_state(tmp_path, 60) == ""


@pytest.mark.parametrize("ending", ["silo", "csv", "bag", "mcap", "parquet", "npz", "h5", "mat"])
def test_every_format_keeps_it(ending, new_logger, tmp_path, capsys):
    log = new_logger(about={"operator": "alice", "trial": 7})
    log.array("q", 2)
    log.start()
    log.collect()
    path = tmp_path / f"out.{ending}"
    if ending in ("silo", "csv", "bag"):
        path = log.save(ending).path
    else:
        pytest.importorskip({"parquet": "pyarrow", "h5": "h5py", "mat": "scipy"}.get(ending, "numpy"))
        silo.Log(log.snapshot()).save(path)
    about = silo.open_log(path).recording.about
    assert (about["operator"], about["trial"], about["silo"]) == ("alice", "7", VERSION)
    assert {"host", "python", "numpy"} <= about.keys()


def test_info_shows_it(new_logger):
    from click.testing import CliRunner

    log = new_logger(about={"operator": "alice"})
    log.array("q", 2)
    log.start()
    log.collect()
    said = CliRunner().invoke(cli, ["info", log.save().path]).output
    assert "operator: alice" in said
    assert f"silo: {VERSION}" in said


@pytest.mark.parametrize("given", ["alice", ["a"], {1: "x"}, {"a\nb": "x"}, {"x": "y" * 1001}])
def test_what_is_no_dictionary_of_texts_is_refused(given, new_logger):
    with pytest.raises(ElementError, match="about"):
        new_logger(about=given)

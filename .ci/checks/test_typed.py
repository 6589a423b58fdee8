"""What is written wrong is found before it runs: mypy and pyright read a file of mistakes, and of what is right."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from silo.core.elements import FileTypeWord, GroupRole, Storage, Threads
from silo.files.formats import SAVED_NAMES
from silo.logger.arguments.keywords import (
    ActionWord,
    BufferWord,
    ElementKeywords,
    GroupRoleWord,
    OptionKeywords,
    StorageWord,
    SwitchWord,
    ThreadsWord,
)
from silo.logger.logger import Logger
from silo.settings.options import OPTION, OPTIONS

ROOT = Path(__file__).resolve().parents[2]
MISTAKES = Path(__file__).with_name("typed_mistakes.py")


def words(kind):
    return set(kind.__args__)


@pytest.mark.slow
def test_mypy_finds_each_mistake_and_nothing_else(tmp_path):
    shutil.copy(MISTAKES, tmp_path / "program.py")
    command = [sys.executable, "-m", "mypy", "--config-file=", "--follow-imports=silent", "--no-error-summary"]
    command += [f"--cache-dir={ROOT / '.mypy_cache'}", "--disable-error-code=import-untyped", "program.py"]
    done = subprocess.run(
        command, cwd=tmp_path, env={"MYPYPATH": str(ROOT)}, check=False, capture_output=True, text=True
    )
    told = {int(line.split(":")[1]) for line in done.stdout.splitlines() if ": error:" in line}
    assert told == wrong_lines(), done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pyright") is None, reason="needs pyright, which npm brings: pip install pyright")
def test_pyright_finds_each_mistake_and_nothing_else(tmp_path):
    shutil.copy(MISTAKES, tmp_path / "program.py")
    (tmp_path / "pyrightconfig.json").write_text(json.dumps({"extraPaths": [str(ROOT)], "pythonVersion": "3.10"}))
    command = ["pyright", "--outputjson", "--pythonpath", sys.executable, "program.py"]
    done = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)
    errors = [one for one in json.loads(done.stdout)["generalDiagnostics"] if one["severity"] == "error"]
    assert {one["range"]["start"]["line"] + 1 for one in errors} == wrong_lines(), done.stdout


def wrong_lines():
    lines = MISTAKES.read_text().splitlines()
    return {number for number, line in enumerate(lines, 1) if line.endswith("# wrong")}


def test_the_words_of_the_types_are_those_of_the_rules():
    for kind, name in ((ActionWord, "action"), (BufferWord, "buffer"), (SwitchWord, "enabled")):
        spellings = set().union(*(word.spellings for word in OPTION[name].words))
        assert words(kind) <= spellings
        assert {word.word for word in OPTION[name].words} <= words(kind)
    assert words(FileTypeWord) == set(SAVED_NAMES)
    assert words(StorageWord) == {kind.value for kind in Storage}
    assert words(ThreadsWord) == {kind.value for kind in Threads}
    assert words(GroupRoleWord) == {role.value for role in GroupRole}


def test_the_keywords_of_set_are_the_keys_of_the_rules():
    assert set(OptionKeywords.__annotations__) == {key for option in OPTIONS for key in (option.name, *option.keys)}


def test_the_keywords_of_array_are_those_of_add():
    import inspect

    own = set(inspect.signature(Logger.add).parameters) - {"self", "source", "name"}
    assert set(ElementKeywords.__annotations__) == own

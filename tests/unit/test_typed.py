"""What is written wrong is found before it runs: mypy reads a file of mistakes, and of what is right."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from silo.files.formats import SAVED_NAMES
from silo.logger.keywords import (
    ActionWord,
    BufferWord,
    ElementKeywords,
    FileTypeWord,
    OptionKeywords,
    StorageWord,
    SwitchWord,
    ThreadsWord,
)
from silo.logger.logger import Logger
from silo.model import Storage, Threads
from silo.settings.rules import OPTION, OPTIONS

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
    lines = MISTAKES.read_text().splitlines()
    wrong = {number for number, line in enumerate(lines, 1) if line.endswith("# wrong")}
    assert told == wrong, done.stdout + done.stderr


def test_the_words_of_the_types_are_those_of_the_rules():
    for kind, name in ((ActionWord, "action"), (BufferWord, "buffer_type"), (SwitchWord, "enabled")):
        spellings = set().union(*(word.spellings for word in OPTION[name].words))
        assert words(kind) <= spellings
        assert {word.word for word in OPTION[name].words} <= words(kind)
    assert words(FileTypeWord) == set(SAVED_NAMES)
    assert words(StorageWord) == {kind.value for kind in Storage}
    assert words(ThreadsWord) == {kind.value for kind in Threads}


def test_the_keywords_of_set_are_the_keys_of_the_rules():
    assert set(OptionKeywords.__annotations__) == {key for option in OPTIONS for key in (option.name, *option.keys)}


def test_the_keywords_of_array_are_those_of_add():
    import inspect

    own = set(inspect.signature(Logger.add).parameters) - {"self", "source", "name"}
    assert set(ElementKeywords.__annotations__) == own

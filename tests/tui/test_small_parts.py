"""Small parts of screens, each by itself."""

import os
import signal
import subprocess
import sys
import time

import pytest
from textual import events

from silo.core.elements import FileType
from silo.errors import ElementError
from silo_tui.model.words import command_line, paths
from silo_tui.screens.dialogs.questions import Choice, Question
from silo_tui.sessions.demo import Demo

KEEP, STOP, DROP = Choice("", "Keep", "e"), Choice("stop", "Stop", "s"), Choice("drop", "Drop", "D", loses=True)


@pytest.mark.parametrize(
    ("choices", "begin", "key", "may"),
    [
        ([KEEP, DROP], "", "D", True),
        ([KEEP, DROP], "", "x", True),
        ([KEEP, DROP], "", "e", False),
        ([KEEP, DROP], "", "escape", False),
        ([KEEP, DROP], "", "enter", False),
        ([KEEP, DROP], "drop", "enter", True),
        ([KEEP, DROP], "drop", "escape", False),
        ([KEEP, STOP], "", "s", False),
        ([KEEP, STOP], "", "x", False),
    ],
)
def test_what_is_typed_into_a_question_may_lose_something_unless_it_is_known_not_to(choices, begin, key, may):
    question = Question("Stop?", "", choices, begin)
    assert question.may_lose(events.Key(key, key if len(key) == 1 else None)) is may
    assert question.may_lose(events.MouseDown(None, 0, 0, 0, 0, 1, False, False, False)) is question.loses


@pytest.mark.parametrize(
    ("typed", "read_as"),
    [
        ([], ([FileType.SILO], "")), (["walk"], ([FileType.SILO], "walk")), (["csv", "walk"], ([FileType.CSV], "walk")),
        (["walk", "csv", "bag"], ([FileType.CSV, FileType.BAG], "walk")),
    ],
)  # fmt: skip
def test_what_to_save_is_typed_in_any_order(typed, read_as):
    assert command_line.read_save(typed) == read_as


@pytest.mark.parametrize(
    ("line", "lines"),
    [
        (":sa", ["save", "sand"]), (":save", []), ("save ", ["save bag", "save both"]), ("save bag", []),
        (":save csv b", ["save csv bag", "save csv both"]), (":save c b", ["save c bag", "save c both"]),
        (":save x", []), (":", ["save", "sand", "stop"]),
    ],
)  # fmt: skip
def test_a_line_is_completed_by_words_and_then_by_what_they_are_about(line, lines):
    assert command_line.complete(line, ["save", "sand", "stop"], ["bag", "both"]) == lines


def test_a_line_is_completed_at_once_of_many_names_that_begin_so_and_hold_it():
    names = [f"joints/joint_{joint}/q{entry}" for joint in range(1000) for entry in range(10)]
    begun_s = time.process_time()
    assert len(command_line.complete("goto j", ["goto"], names)) == len(names)
    assert time.process_time() - begun_s < 2.0  # 5 ms; 20 s where each is looked for among those that begin so


def test_a_command_is_split_as_a_shell_does():
    spelled = command_line.read(": note 'two words' more")
    assert (spelled.word, spelled.first, spelled.rest) == ("note", "two words", "two words more")
    assert command_line.read("stop").first == ""


def test_two_names_of_one_save_are_refused():
    with pytest.raises(ValueError, match="one name is enough, got 'walk' and 'run'"):
        command_line.read_save(["walk", "run"])


@pytest.mark.parametrize("line", ["", ":", " : ", ":say 'x"])
def test_a_line_without_a_command_or_with_an_open_quote_is_refused(line):
    with pytest.raises(ValueError, match=r"empty command|No closing quotation"):
        command_line.read(line)


def test_a_path_of_a_log_is_completed_by_logs_and_folders(tmp_path, monkeypatch):
    for name in ("walk.silo", "wave.csv", "notes.txt", ".hidden.silo"):
        (tmp_path / name).touch()
    for name in ("week", "bag.silo.d", ".git"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path)
    os.utime(tmp_path / "walk.silo", (1, 1))
    assert command_line.logs("") == ["wave.csv", "walk.silo", "bag.silo.d/", "week/"]
    assert command_line.logs("", f"{tmp_path}/week")[0] == "week/", "where the logger saves"
    assert command_line.logs("wa", f"{tmp_path}/week") == ["wave.csv", "walk.silo"]
    assert command_line.logs(".") == [".hidden.silo", ".git/"]
    assert command_line.logs(f"{tmp_path}/we") == [f"{tmp_path}/week/"]
    assert command_line.logs("none/x") == []


def test_a_file_as_it_is_typed_gets_an_ending_where_it_has_none(tmp_path):
    assert paths.typed_file("the view", f"{tmp_path}/a", ".yaml") == tmp_path / "a.yaml"
    assert paths.typed_file("the view", f"{tmp_path}/a.yml", ".yaml") == tmp_path / "a.yml"
    for folder in (f"{tmp_path}", f"{tmp_path}/new/", f"{tmp_path}/..", "/"):
        with pytest.raises(ElementError, match=r"the view must be a file, .* is a folder; write .*name.yaml"):
            paths.typed_file("the view", folder, ".yaml")


def test_a_demo_tells_that_it_began_with_what_was_saved_before(tmp_path):
    demo, script = Demo(), tmp_path / "demo.yaml"
    assert demo.begun_with("") == demo.begun_with(str(script)) == ""
    script.touch()
    demo._began_s = script.stat().st_mtime + 1.0
    assert demo.begun_with(str(script)) == "the demo began with demo.yaml, a script that was saved before"
    demo._began_s -= 2.0
    assert demo.begun_with(str(script)) == ""


@pytest.mark.slow
def test_a_demo_that_ended_tells_how_and_what_it_said(tmp_path):
    demo = Demo()
    assert demo.ended() == ""
    demo._output = tmp_path / "said"
    demo._output.write_text("one\ntwo\nwhy\n")
    demo._process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    assert demo.ended() == ""
    demo._process.kill()
    demo._process.wait()
    assert demo.ended() == "The demo ended with exit code -9:\none\ntwo\nwhy"
    demo.stop()


NAMES = ["/base/q", "/legs/LF/HFE/torque", "/legs/LF/KFE/q", "/legs/LF/KFE/torque", "/legs/RF/HFE/torque", "/legs/yaw"]


@pytest.mark.parametrize(
    ("here", "first"),
    [
        ("/legs/LF/KFE/q", ["/legs/LF/KFE/torque", "/legs/LF/KFE/q", "/legs/LF/HFE/torque", "/legs/RF/HFE/torque"]),
        ("/legs/RF/HFE/torque", ["/legs/RF/HFE/torque", "/legs/LF/HFE/torque", "/legs/LF/KFE/q"]),
        ("", NAMES), ("3 marked elements", NAMES),
    ],
)  # fmt: skip
def test_names_beside_the_one_that_is_looked_at_come_first(here, first):
    found = command_line.neighbours_first(NAMES, here)
    assert found[: len(first)] == first
    assert sorted(found) == NAMES


class Child:
    """A child process that ends at an interrupt, or at nothing but a kill."""

    def __init__(self, listens: bool, returncode: int | None = None) -> None:
        self.listens, self.returncode, self.had = listens, returncode, []

    def poll(self) -> int | None:
        return self.returncode

    def send_signal(self, number: int) -> None:
        self.had.append(number)
        self.returncode = 0 if self.listens else None

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)
        self.returncode = -9

    def wait(self, timeout_s: float) -> None:
        if self.returncode is None:
            raise subprocess.TimeoutExpired("demo", timeout_s)


@pytest.mark.parametrize(
    ("child", "had"),
    [(Child(True), [signal.SIGINT]), (Child(False), [signal.SIGINT, signal.SIGKILL]), (Child(True, returncode=1), [])],
)
def test_a_demo_is_ended_as_by_an_interrupt_then_harder_and_one_that_ended_is_left(child, had, tmp_path):
    demo = Demo()
    demo.stop()  # of none
    demo._process, demo._output = child, tmp_path / "said"
    demo._output.write_text("hello\n\nlogger 'demo' ended after 7 ticks; saved:\n/l/a.silo\n")
    demo.stop()
    assert child.had == had
    assert demo.farewell == ("logger 'demo' ended after 7 ticks; saved:\n/l/a.silo" if had else "")

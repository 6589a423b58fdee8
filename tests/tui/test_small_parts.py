"""Small parts of screens, each by itself."""

import subprocess
import sys

import pytest
from textual import events

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

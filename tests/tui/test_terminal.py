"""The app in a real terminal that goes away, stalls, or asks it to end."""

import codecs
import fcntl
import os
import pty
import re
import select
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path

import pytest

from silo_tui.terminal.answers import ALIVE_QUERY
from silo_tui.terminal.parser import QUERY
from tests.tui.emulator import Emulator
from tests.waiting import DEADLINE_S, wait_until

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
PROGRAM = """
import importlib.util, os, threading, sys
spec = importlib.util.spec_from_file_location("fakes", {fake!r})
fakes = importlib.util.module_from_spec(spec)
spec.loader.exec_module(fakes)
from silo_tui.app import SiloApp
from silo_tui.terminal import backed_up, pacing
if {patient}:
    pacing.FIRST_S = pacing.TIMEOUT_S = pacing.LONGEST_TIMEOUT_S = 3600.0
fake = fakes.FakeClient()
fake.run()
def clock():
    while True:
        threading.Event().wait(0.05)
        fake.advance(0.05)
        if backed_up(app):
            os.write({told}, b"!")
app = SiloApp(fakes.FakeFinder(fake), rate_hz=10)
threading.Thread(target=clock, daemon=True).start()
app.run()
print("ended in order", flush=True)
"""


class Terminal:
    def __init__(self, *, answers=False, patient=False):
        """`patient`: its answers are never overdue, however busy the computer is."""
        self.master, self.slave = pty.openpty()
        slave = self.slave
        self.answers = answers
        self.held = None  # answers that are on their way, where they are held back
        self.glass = Emulator(80, 24)
        self.decode = codecs.getincrementaldecoder("utf-8")().decode
        self.rest = ""
        self.stalls, told = os.pipe()
        fake = Path(__file__).parents[1] / "stand_ins" / "fake_logger.py"
        code = PROGRAM.format(fake=str(fake), told=told, patient=patient)
        self.process = subprocess.Popen(
            [sys.executable, "-c", code], stdin=slave, stdout=slave, stderr=slave,
            start_new_session=True, pass_fds=[told],
            preexec_fn=_take_terminal,  # noqa: PLW1509 - no threads here
            env={**os.environ, "TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24", "PYTHONPATH": str(ROOT)},
        )  # fmt: skip
        os.close(told)
        self.seen = b""

    def until(self, words):
        def comes():
            self.read(0.1)
            return words in self.seen

        wait_until(comes)

    def until_stalled(self):
        """Reads nothing: the terminal's buffer and the app's queue fill."""
        assert select.select([self.stalls], [], [], DEADLINE_S)[0]
        assert os.read(self.stalls, 1) == b"!", "it ended"

    def read(self, timeout):
        if select.select([self.master], [], [], timeout)[0]:
            data = os.read(self.master, 65536)
            self.seen += data
            self.show(self.rest + self.decode(data))

    def show(self, words):
        begun = _BEGUN.search(words)
        self.rest = begun[0] if begun else ""
        words = words[: len(words) - len(self.rest)]
        self.glass.feed(words)
        for found in _QUERIES.findall(words) if self.answers else ():
            self.answer(b"\x1b[?2026;2$y" if found == QUERY else b"\x1b[0n")

    def answer(self, words):
        if self.held is None:
            os.write(self.master, words)
        else:
            self.held.append(words)

    def until_shown(self, words):
        def comes():
            self.read(0.1)
            return words in self.glass.text

        wait_until(comes)

    def press(self, keys):
        os.write(self.master, keys)

    def drain_until_exit(self):
        def is_over():
            self.read(0.05)
            return self.process.poll() is not None

        wait_until(is_over)
        return self.process.returncode


_BEGUN = re.compile("\x1b(?:\\[[0-?]*[ -/]*|\\][^\x07\x1b]*)?\\Z")
_QUERIES = re.compile("|".join(re.escape(query) for query in (QUERY, ALIVE_QUERY)))


def _take_terminal():
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


def _end(terminal):
    if terminal.process.poll() is None:
        terminal.process.kill()
        terminal.process.wait()
    os.close(terminal.stalls)


@pytest.fixture
def terminal():
    found = Terminal()
    yield found
    _end(found)


@pytest.fixture
def answering():
    """A terminal that says how far it has read."""
    found = Terminal(answers=True)
    yield found
    _end(found)


@pytest.fixture
def waited_for():
    """One whose answers are waited for as long as they take."""
    found = Terminal(answers=True, patient=True)
    yield found
    _end(found)


def test_sigterm_ends_it_in_order(terminal):
    terminal.until(b"RUNNING")
    terminal.process.send_signal(signal.SIGTERM)
    assert terminal.drain_until_exit() == 0
    terminal.until(b"ended in order")


def test_a_terminal_that_goes_away_ends_it(terminal):
    terminal.until(b"RUNNING")
    os.close(terminal.slave)
    os.close(terminal.master)
    assert terminal.process.wait(DEADLINE_S) is not None


def test_a_stalled_terminal_doesn_t_keep_it_from_ending(terminal):
    terminal.until(b"RUNNING")
    os.set_blocking(terminal.master, True)
    terminal.until_stalled()
    terminal.process.send_signal(signal.SIGTERM)
    assert terminal.process.wait(DEADLINE_S) is not None


def test_after_a_stall_it_goes_on_where_it_is(terminal):
    terminal.until(b"RUNNING")
    terminal.until_stalled()
    before = terminal.glass.text
    wait_until(lambda: terminal.read(0.1) or (terminal.glass.text != before and "lost" in terminal.glass.text))
    terminal.press(b"q")
    assert terminal.drain_until_exit() == 0


def test_a_key_shows_though_the_terminal_has_not_answered(answering):
    answering.until_shown("RUNNING")
    answering.until_shown("1 of ")
    answering.held = []
    answering.press(b"j")
    answering.until_shown("2 of ")


def test_nothing_piles_up_for_a_terminal_that_is_slow_to_answer(waited_for):
    waited_for.until_shown("RUNNING")
    waited_for.until_shown("1 of ")
    waited_for.held, waited_for.seen = [], b""
    wait_until(lambda: waited_for.read(0.1) or waited_for.held)
    begin = time.monotonic()
    while time.monotonic() < begin + 4.0:  # unasked, twice as much comes; of a program that is slower, less
        waited_for.read(0.1)
    assert len(waited_for.seen) < 8_000


def test_answers_that_come_at_the_end_are_not_typed_into_the_shell(answering):
    answering.until_shown("RUNNING")
    answering.held, answering.seen = [], b""
    wait_until(lambda: answering.read(0.1) or answering.held)
    answering.press(b"q")
    answering.until(b"\x1b[?2004l")  # it is leaving
    for words in answering.held:
        os.write(answering.master, words)
    answering.held = None
    assert answering.drain_until_exit() == 0
    termios.tcsetattr(answering.slave, termios.TCSANOW, _raw(answering.slave))
    assert not select.select([answering.slave], [], [], 0)[0]


def _raw(descriptor):
    found = termios.tcgetattr(descriptor)
    found[3] &= ~termios.ICANON
    return found


def test_suspended_and_back_it_paints_the_whole_screen(answering):
    answering.until_shown("RUNNING")
    answering.press(b"\x1a")
    answering.until(b"\x1b[?1049l")
    wait_until(lambda: Path(f"/proc/{answering.process.pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "T")
    answering.glass.feed("\x1b[2J\x1b[1;1H$ fg")
    answering.process.send_signal(signal.SIGCONT)
    answering.until_shown("RUNNING")
    answering.until_shown("space Mark")
    assert "$ fg" not in answering.glass.text
    assert b"\x1b[?2026$p" not in answering.seen[answering.seen.rindex(b"\x1b[?1049h") :].split(b"\x1b[?1004h")[0]
    answering.press(b"q")
    assert answering.drain_until_exit() == 0


def test_stopped_from_outside_it_paints_the_whole_screen_when_it_goes_on(answering):
    answering.until_shown("RUNNING")
    answering.until_shown("space Mark")
    answering.process.send_signal(signal.SIGSTOP)
    wait_until(lambda: Path(f"/proc/{answering.process.pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "T")
    answering.read(0)
    answering.glass.feed("\x1b[2J")
    answering.process.send_signal(signal.SIGCONT)
    answering.until_shown("space Mark")
    answering.until_shown("RUNNING")

"""The app in a real terminal that goes away, stalls, or asks it to end."""

import os
import pty
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.waiting import DEADLINE_S, wait_until

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
PROGRAM = """
import importlib.util, os, threading, sys
spec = importlib.util.spec_from_file_location("fakes", {fake!r})
fakes = importlib.util.module_from_spec(spec)
spec.loader.exec_module(fakes)
from silo_tui.app import SiloApp
from silo_tui.terminal import backed_up
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
    def __init__(self):
        self.master, slave = pty.openpty()
        self.stalls, told = os.pipe()
        fake = Path(__file__).parents[1] / "stand_ins" / "fake_logger.py"
        code = PROGRAM.format(fake=str(fake), told=told)
        self.process = subprocess.Popen(
            [sys.executable, "-c", code], stdin=slave, stdout=slave, stderr=slave,
            start_new_session=True, pass_fds=[told],
            preexec_fn=_take_terminal,  # noqa: PLW1509 - no threads here
            env={**os.environ, "TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24", "PYTHONPATH": str(ROOT)},
        )  # fmt: skip
        os.close(slave)
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
            try:
                self.seen += os.read(self.master, 65536)
            except OSError:  # the other end is closed
                self.seen += b""

    def drain_until_exit(self):
        def is_over():
            self.read(0.05)
            return self.process.poll() is not None

        wait_until(is_over)
        return self.process.returncode


def _take_terminal():
    import fcntl
    import termios

    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


@pytest.fixture
def terminal():
    found = Terminal()
    yield found
    if found.process.poll() is None:
        found.process.kill()
        found.process.wait()
    os.close(found.stalls)


def test_sigterm_ends_it_in_order(terminal):
    terminal.until(b"RUNNING")
    terminal.process.send_signal(signal.SIGTERM)
    assert terminal.drain_until_exit() == 0
    terminal.until(b"ended in order")


def test_a_terminal_that_goes_away_ends_it(terminal):
    terminal.until(b"RUNNING")
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
    terminal.seen = b""
    terminal.until(b"Hz")
    os.write(terminal.master, b"q")
    assert terminal.drain_until_exit() == 0

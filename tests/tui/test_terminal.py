"""The app in a real terminal that goes away, stalls, or asks it to end."""

import os
import pty
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

PROGRAM = """
import importlib.util, threading, sys
spec = importlib.util.spec_from_file_location("fakes", {conftest!r})
fakes = importlib.util.module_from_spec(spec)
spec.loader.exec_module(fakes)
from silo_tui.app import SiloApp
fake = fakes.FakeClient()
fake.run()
def clock():
    while True:
        threading.Event().wait(0.05)
        fake.advance(0.05)
threading.Thread(target=clock, daemon=True).start()
SiloApp(fakes.FakeFinder(fake), rate_hz=10).run()
print("ended in order", flush=True)
"""
DEADLINE_S = 15.0


class Terminal:
    def __init__(self):
        self.master, slave = pty.openpty()
        code = PROGRAM.format(conftest=str(Path(__file__).parents[1] / "stand_ins" / "fake_logger.py"))
        self.process = subprocess.Popen(
            [sys.executable, "-c", code], stdin=slave, stdout=slave, stderr=slave, start_new_session=True,
            preexec_fn=_take_terminal,  # noqa: PLW1509 - no threads here
            env={**os.environ, "TERM": "xterm-256color", "COLUMNS": "80", "LINES": "24"},
        )  # fmt: skip
        os.close(slave)
        self.seen = b""

    def until(self, words):
        end = time.monotonic() + DEADLINE_S
        while words not in self.seen:
            assert time.monotonic() < end, self.seen[-400:]
            self.read(0.1)

    def read(self, timeout):
        if select.select([self.master], [], [], timeout)[0]:
            try:
                self.seen += os.read(self.master, 65536)
            except OSError:  # the other end is closed
                self.seen += b""

    def drain_until_exit(self):
        end = time.monotonic() + DEADLINE_S
        while self.process.poll() is None:
            assert time.monotonic() < end, "still running"
            self.read(0.05)
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
    time.sleep(1.5)  # nobody reads: the terminal's buffer and our queue fill
    terminal.process.send_signal(signal.SIGTERM)
    assert terminal.process.wait(DEADLINE_S) is not None


def test_after_a_stall_it_goes_on_where_it_is(terminal):
    terminal.until(b"RUNNING")
    time.sleep(1.5)  # nobody reads
    terminal.seen = b""
    terminal.until(b"Hz")
    os.write(terminal.master, b"q")
    assert terminal.drain_until_exit() == 0

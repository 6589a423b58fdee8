"""Where the screen goes: silo-tui says so at its start when that is no terminal."""

import os
import pty
import subprocess
import sys

import pytest


@pytest.mark.slow
def test_a_screen_that_would_go_into_a_file_is_refused_with_words():
    master, slave = pty.openpty()
    try:
        ended = subprocess.run(
            [sys.executable, "-m", "silo_tui"],
            check=False,
            stdin=slave,
            stdout=slave,
            stderr=subprocess.PIPE,
            timeout=120,
        )
    finally:
        os.close(master)
        os.close(slave)
    assert ended.returncode == 1
    assert "stderr, which is no terminal here" in ended.stderr.decode()
    assert "\x1b" not in ended.stderr.decode()

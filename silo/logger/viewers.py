"""Bridges to other people's viewers that end with the logger: processes of their own, never a thread of the robot's."""

import contextlib
import os
import subprocess
import sys
from pathlib import Path

from silo.bridges.listening import bound, check_installed
from silo.logger.helper_process import ENDING_S


class FoxgloveProcess:
    """Serves a logger to Foxglove, Lichtblick and PlotJuggler on a port of this computer, for reading alone."""

    def __init__(self, logger: str, port: int) -> None:
        """Start it; it listens, and waits for `begin`.

        Args:
            logger: its name.
            port: of 127.0.0.1; 0: one that is free.

        Raises:
            SiloError: the port is taken, or `websockets` is missing.
            OSError: no process can be started.
        """
        check_installed("websockets", "foxglove")
        home = str(Path(__file__).resolve().parents[2])
        paths = [home, *filter(None, [os.environ.get("PYTHONPATH")])]
        with bound("127.0.0.1", port) as listening:
            self.port: int = listening.getsockname()[1]
            command = [sys.executable, "-m", "silo.bridges.foxglove", "--fd", str(listening.fileno())]
            # standard input is a pipe that ends with this process, whatever ends it
            self._process = subprocess.Popen(
                [*command, "--logger", f"{logger}.{os.getpid()}"],
                pass_fds=[listening.fileno()],
                env=dict(os.environ, PYTHONPATH=os.pathsep.join(paths), PYTHONSAFEPATH="1"),
                start_new_session=True,
                stdin=subprocess.PIPE,
            )

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def begin(self) -> None:
        """Let it connect to the logger, which can be reached now."""
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it ended; what it said stands in the program's standard error
            self._process.stdin.write(b"\n")
            self._process.stdin.flush()

    def close(self) -> None:
        """End it; closing twice is fine."""
        if self._process.stdin is not None:
            with contextlib.suppress(BrokenPipeError):
                self._process.stdin.close()
        try:
            self._process.wait(ENDING_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

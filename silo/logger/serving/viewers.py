"""Bridges to other people's viewers that end with the logger: processes of their own, never a thread of the robot's."""

import contextlib
import os

from silo.bridges.listening import bound, check_installed
from silo.core.child import PIPE, ChildProcess


class FoxgloveProcess(ChildProcess):
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
        with bound("127.0.0.1", port) as listening:
            self.port: int = listening.getsockname()[1]
            arguments: list[str | int] = ["--fd", listening.fileno(), "--logger", f"{logger}.{os.getpid()}"]
            # standard input is a pipe that ends with this process, whatever ends it
            super().__init__("silo.bridges.foxglove", arguments, [listening.fileno()], stdin=PIPE)

    def begin(self) -> None:
        """Let it connect to the logger, which can be reached now."""
        with contextlib.suppress(BrokenPipeError):  # it ended; what it said stands in the program's standard error
            self.stdin.write(b"\n")
            self.stdin.flush()

    def close(self) -> None:
        """End it; closing twice is fine."""
        with contextlib.suppress(BrokenPipeError):
            self.stdin.close()
        self.end()

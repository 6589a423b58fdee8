"""Helper processes that start warm: forked off one that has loaded silo, numpy and Zenoh already.

A start of Python with all that takes 0.3 s of processor time, half of what a test of a logger with its helper process
takes, and there are 600 of these. What is tested is the same but for the very start, which the tests of `tests/crash`,
and all robot programs that are processes of their own, have as users have it.
"""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

NURSERY = Path(__file__).parent / "stand_ins" / "helper_nursery.py"


class Nursery:
    """The process that forks; begun with the first helper process."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._search = ""
        self._asking = threading.Lock()

    def popen(self, command: Sequence[str], **options: Any) -> Any:
        """Start a process: what `silo.core.child` has of `subprocess.Popen`. Helper processes alone start warm."""
        if command[2] != "silo.helper":
            return subprocess.Popen(command, **options)
        environment, descriptors = options["env"], options["pass_fds"]
        with self._asking:
            if self._process is None and command[0] == sys.executable:
                self._begin(environment)
            if command[0] != sys.executable or environment["PYTHONPATH"] != self._search:
                return subprocess.Popen(command, **options)
            sys.audit("subprocess.Popen", command[0], command, None, None)  # so that it is noted as a process
            asked = {"arguments": command[7:], "environment": environment, "folder": str(Path.cwd())}
            end, told = os.pipe()
            try:
                message = [json.dumps(asked).encode()]
                socket.send_fds(self._control, message, [*descriptors, 1, 2, told])
            finally:
                os.close(told)
            return WarmProcess(int(self._control.recv(32)), end)

    def _begin(self, environment: dict[str, str]) -> None:
        self._search = environment["PYTHONPATH"]
        self._control, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, str(NURSERY), str(theirs.fileno()), "silo.helper"],
                pass_fds=[theirs.fileno()],
                env=environment,
                stdin=subprocess.DEVNULL,
            )

    def end(self) -> None:
        """End it; it has no children any more."""
        if self._process is not None:
            self._control.close()
            self._process.wait()

    @property
    def subprocess(self) -> SimpleNamespace:
        """What stands for the module in `silo.core.child`."""
        names = ("DEVNULL", "PIPE", "TimeoutExpired")
        return SimpleNamespace(Popen=self.popen, **{name: getattr(subprocess, name) for name in names})


class WarmProcess:
    """A process whose parent is the nursery, which tells how it ended."""

    def __init__(self, pid: int, end: int) -> None:
        self.pid, self._end = pid, end
        self._code: int | None = None

    def wait(self, timeout: float | None = None) -> int:
        """As that of `subprocess.Popen`."""
        if self._code is None:
            if not select.select([self._end], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired("silo.helper", timeout or 0.0)
            told = os.read(self._end, 32)
            self._code = int(told) if told else -signal.SIGKILL
            os.close(self._end)
        return self._code

    def kill(self) -> None:
        """As that of `subprocess.Popen`."""
        if self._code is None and not select.select([self._end], [], [], 0)[0]:
            with suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)

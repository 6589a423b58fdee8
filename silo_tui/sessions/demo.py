"""`silo-tui --demo`: a simulated robot in a child process that ends with the screen, and saves what it logged."""

import contextlib
import os
import signal
import subprocess
import tempfile
import time
from pathlib import Path

from silo.core.child import own_program

STOP_S = 30.0  # as long as saving may take on a busy computer


class Demo:
    """`silo demo` as a child process, logging into `./silo-logs` where one can write, else into a temporary folder."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._output = Path()
        self._began_s = 0.0
        self.farewell = ""  # what it said when it was ended

    def start(self) -> None:
        """Start the child; its output goes to a file, because the screen is ours."""
        if self._process is not None and self._process.poll() is None:
            return
        folder = _folder()
        self._output = folder / ".demo-output"
        with self._output.open("wb") as output:
            # a session of its own: Ctrl-C and a closed terminal reach us alone, and we end it in order
            # with its parent: if we are killed, nobody else ends it
            self._began_s = time.time()
            program = [*own_program("silo.cli"), "demo", "--folder", str(folder), "--with-parent", str(os.getpid())]
            self._process = subprocess.Popen(
                program, stdin=subprocess.DEVNULL, stdout=output,
                stderr=subprocess.STDOUT, start_new_session=True, env={**os.environ, "PYTHONUNBUFFERED": "1"},
            )  # fmt: skip

    def owns(self, pid: int) -> bool:
        """Return whether a logger is the one that we started."""
        return self._process is not None and self._process.pid == pid

    def begun_with(self, script: str) -> str:
        """Return what to say where its script was there when it began: others saved it."""
        with contextlib.suppress(OSError):
            if script and Path(script).stat().st_mtime < self._began_s:
                return f"the demo began with {Path(script).name}, a script that was saved before"
        return ""

    def ended(self) -> str:
        """Return why the child is gone; empty while it runs."""
        if self._process is None or self._process.poll() is None:
            return ""
        said = self._output.read_text("utf-8", "replace").strip().splitlines()[-6:]
        return f"The demo ended with exit code {self._process.returncode}:\n" + "\n".join(said)

    def stop(self) -> None:
        """End the child as Ctrl-C would, then harder."""
        process = self._process
        if process is None or process.poll() is not None:
            return
        process.send_signal(signal.SIGINT)
        try:
            process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait(STOP_S)
        said = self._output.read_text("utf-8", "replace") if self._output.is_file() else ""
        _, begins, words = said.rpartition("\nlogger '")
        self.farewell = f"logger '{words}".strip() if begins else ""


def _folder() -> Path:
    wanted = Path("silo-logs").absolute()
    with contextlib.suppress(OSError):
        wanted.mkdir(exist_ok=True)
    if os.access(wanted, os.W_OK):
        return wanted
    return Path(tempfile.mkdtemp(prefix="silo-demo-"))

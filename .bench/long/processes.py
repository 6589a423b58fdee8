"""Processes of the long modes: their memory and descriptors, `silo` commands, and ends that leave nobody behind."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import psutil

from silo.client.client import Client
from silo.errors import ConnectionLostError

HERE = Path(__file__).resolve().parent
ROBOT = HERE / "robot.py"
SILO = (sys.executable, "-c", "from silo.cli import main; main()")


@contextmanager
def workplace() -> Iterator[tuple[Path, dict[str, str]]]:
    """A folder in memory for logs and pages, and an environment in which loggers meet nobody else."""
    root = Path("/dev/shm")
    folder = Path(tempfile.mkdtemp(prefix="silo-long-", dir=root if root.is_dir() else None))
    runtime = folder / "run"
    runtime.mkdir(mode=0o700)
    (folder / "logs").mkdir()
    try:
        yield folder, dict(os.environ, SILO_RUNTIME_DIR=str(runtime), XDG_STATE_HOME=str(folder / "state"))
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def wait_until(get: Callable[[], object], timeout_s: float, pause_s: float = 0.0005) -> bool:
    """Whether something became true in time."""
    deadline = time.monotonic() + timeout_s
    while not get():
        if time.monotonic() > deadline:
            return False
        time.sleep(pause_s)
    return True


def silo_command(words: list[str], environment: dict[str, str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run `silo WORDS` as a user would, in a folder; at most two minutes."""
    return subprocess.run(
        [*SILO, *words], cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False
    )


def gone(pid: int) -> bool:
    """Whether a process has ended (a zombie has)."""
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def signal_process(pid: int, number: int) -> None:
    """Send a signal to a process that may have ended."""
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        return


def end_process(pid: int, timeout_s: float = 20.0) -> bool:
    """End a helper as a service manager does; False if it had to be killed."""
    signal_process(pid, signal.SIGTERM)
    signal_process(pid, signal.SIGCONT)
    if wait_until(lambda: gone(pid), timeout_s, 0.01):
        return True
    signal_process(pid, signal.SIGKILL)
    return wait_until(lambda: gone(pid), timeout_s, 0.01) and False


@dataclass(frozen=True)
class Memory:
    """Of one process, MB: resident, and private (`Pss_Anon`: what no file or other process stands behind)."""

    rss: float
    private: float


def memory_of(pid: int) -> Memory:
    """The memory of a process now; zero if it has ended."""
    try:
        lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    except (OSError, ProcessLookupError):
        return Memory(0.0, 0.0)
    sizes = {line.split(":")[0]: int(line.split()[1]) / 1e3 for line in lines if line.endswith(" kB")}
    return Memory(sizes.get("Rss", 0.0), sizes.get("Pss_Anon", 0.0))


def descriptors_of(pid: int) -> int:
    """Open descriptors of a process; 0 if it has ended."""
    try:
        return sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir())
    except OSError:
        return 0


class Peak:
    """The highest private memory of a process while the block lasts, sampled all 20 ms."""

    def __init__(self, pid: int) -> None:
        self.private = 0.0
        self._pid = pid
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._sample)

    def _sample(self) -> None:
        while not self._end.wait(0.02):
            self.private = max(self.private, memory_of(self._pid).private)

    def __enter__(self) -> "Peak":
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end.set()
        self._thread.join()


def connected(name: str, timeout_s: float = 20.0) -> Client:
    """A client of a logger that may only just be starting. Raises ConnectionLostError."""
    deadline = time.monotonic() + timeout_s
    while True:
        try:
            return Client.connect(name)
        except ConnectionLostError:
            if time.monotonic() > deadline:
                raise
        time.sleep(0.05)


def show(rows: list[tuple[str, ...]]) -> None:
    """A table, its first row the head; the first column to the left, the others to the right."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for row in rows:
        cells = [
            text.ljust(width) if not at else text.rjust(width)
            for at, (text, width) in enumerate(zip(row, widths, strict=True))
        ]
        print("  ".join(cells), flush=True)

"""Real loggers with real helper processes on private sockets; only the clock is made up."""

import enum
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import silo
from silo.client.client import Client
from silo.errors import ConnectionLostError
from silo.rpc.published import Event, EventKind
from tests.waiting import wait_until

TICK_NS = 10_000_000
BEGIN_NS = 1_700_000_000_000_000_000
ROBOT_PROGRAM = Path(__file__).with_name("robot_program.py")


@pytest.fixture(autouse=True)
def _warm(warm: None) -> None:
    """Processes start warm here."""


class Gait(enum.IntEnum):
    STAND = 0
    TROT = 1


class Bench:
    """A logger with one element of each sort, and the hand that turns its loop."""

    begin_ns, tick_ns, gaits = BEGIN_NS, TICK_NS, Gait

    def __init__(self, folder: Path) -> None:
        self.now_ns = BEGIN_NS
        (folder / "scripts").mkdir()
        self.script = folder / "scripts" / "bot.yaml"
        self.logger = silo.Logger(
            "bot", frequency=100, max_time=10, folder=folder / "logs", script=self.script, clock=lambda: self.now_ns
        )
        self.x = np.zeros(())
        self.q = np.zeros(3)
        self.matrix = np.zeros((2, 2), np.float32)
        self.gait = np.zeros((), np.int8)
        self.word = np.array(b"", "S8")
        self.mixed = np.zeros((), np.dtype([("a", "<f8"), ("n", "<i4")]))
        self.kept = np.zeros(())
        live = silo.Action.SAVE_AND_PUBLISH
        self.logger.add(self.x, "x", action=live, unit="m")
        self.logger.add(self.q, "q", action=live)
        self.logger.add(self.matrix, "matrix", action=live)
        self.logger.add(self.gait, "gait", action=live, labels=Gait)
        self.logger.add(self.word, "word", action=live)
        self.logger.add(self.mixed, "mixed", action=live)
        self.logger.add(self.x, "slow", action=live, divider=5)
        self.logger.add(self.kept, "kept")
        self.serving = self.logger.serve()

    def ticks(self, count: int) -> None:
        """Runs the loop; `x` counts the ticks."""
        for _ in range(count):
            self.x[...] += 1
            self.logger.collect()
            self.now_ns += TICK_NS

    def start(self, count: int) -> None:
        """Starts it, and runs the loop."""
        self.logger.start()
        self.ticks(count)


@pytest.fixture
def runtime(runtime_folder: Path) -> Path:
    """The private runtime folder."""
    return runtime_folder


@pytest.fixture
def bench(runtime: Path, tmp_path: Path) -> Iterator[Bench]:
    """A served logger in this process."""
    made = Bench(tmp_path)
    yield made
    made.logger.close()


@pytest.fixture
def client(bench: Bench) -> Iterator[Client]:
    """A client of that logger."""
    with Client.connect("bot") as made:
        yield made


class Heard:
    """The events that a client heard."""

    def __init__(self, client: Client) -> None:
        self.events: list[Event] = []
        client.on_event(self.events.append)

    def wait(self, kind: EventKind) -> Event:
        """The next event of a kind, heard already or to come."""
        return wait_until(lambda: next((event for event in self.events if event.kind is kind), None))


@pytest.fixture
def heard(client: Client) -> Heard:
    """What the client hears."""
    return Heard(client)


class RobotProcess:
    """A robot program of its own process: 500 Hz, elements x and q."""

    def __init__(self, *arguments: str, **options: object) -> None:
        command = [sys.executable, str(ROBOT_PROGRAM), *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, **options)  # type: ignore[call-overload]
        line = self.process.stdout.readline()
        self.helper_pid = int(line or "0")

    @property
    def pid(self) -> int:
        return self.process.pid

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()

    def end(self) -> None:
        """Ends program and helper; what they logged stays unsaved."""
        self.kill()
        self.process.stdout.close()
        end_helper(self.helper_pid)


@pytest.fixture
def robots(runtime: Path, tmp_path: Path) -> Iterator[Callable[..., RobotProcess]]:
    """Starts robot programs; ends them, and waits for their helpers."""
    started: list[RobotProcess] = []

    def start(name: str = "bot", *arguments: str, **options: object) -> RobotProcess:
        started.append(RobotProcess(name, str(tmp_path / "logs"), *arguments, **options))
        return started[-1]

    yield start
    for robot in started:
        robot.end()


def no_process(_arguments: object, _changes: int) -> None:
    """In place of `HelperProcess`: no computer starts one now."""
    raise ConnectionLostError("no process can be started")


def end_helper(pid: int) -> None:
    """Ends a helper that we know by its pid, and only if it is one."""
    try:
        if b"silo.helper" in Path(f"/proc/{pid}/cmdline").read_bytes():
            os.kill(pid, 9)
    except (FileNotFoundError, ProcessLookupError):
        return

"""The two sides of the contract: a real logger with its helper process, and the fake that the tests of silo-tui use."""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

import silo
from silo.client.client import Client
from silo.core.elements import BufferType, Edit, ElementInfo, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.files import write
from silo.rpc.published import Event, EventKind
from tests.stand_ins.fake_logger import FakeClient
from tests.stand_ins.fake_signals import HZ, START_NS
from tests.waiting import DEADLINE_S

TICK_NS = round(1e9 / HZ)


@pytest.fixture(autouse=True)
def _warm(warm: None) -> None:
    """Processes start warm here."""


class Heard:
    """The events and changes of the link that a client reports, waited for without a clock."""

    def __init__(self, client: Any) -> None:
        self.events: list[Event] = []
        self.links: list[bool] = []
        self._changed = threading.Condition()
        client.on_event(lambda event: self._add(self.events, event))
        client.on_link(lambda connected: self._add(self.links, connected))

    def _add(self, where: list[Any], what: Any) -> None:
        with self._changed:
            where.append(what)
            self._changed.notify_all()

    def event(self, kind: EventKind) -> Event:
        """The first event of a kind, heard already or to come."""
        with self._changed:
            assert self._changed.wait_for(lambda: any(event.kind is kind for event in self.events), DEADLINE_S), kind
            return next(event for event in self.events if event.kind is kind)

    def lost(self) -> bool:
        """Whether the loss of the link is reported."""
        with self._changed:
            return self._changed.wait_for(lambda: False in self.links, DEADLINE_S)


def new_logger(folder: Path, clock: Callable[[], int]) -> silo.Logger:
    """A logger with an element of each sort: one number, a vector, labels, text, one that is saved only."""
    both = silo.Action.SAVE_AND_PUBLISH
    (folder / "scripts").mkdir()
    logger = silo.Logger(
        "robot", frequency=HZ, max_time=10, folder=folder / "logs", script=folder / "scripts" / "robot.yaml",
        clock=clock,
    )  # fmt: skip
    logger.array("x", action=both, unit="m")
    logger.array("q", 3, action=both)
    logger.add(np.zeros((), np.int8), "gait", action=both, labels={0: "stand", 1: "trot"})
    logger.add(np.array(b"hans", "S8"), "word", action=both, divider=4)
    logger.array("kept")
    logger.update()
    return logger


class RealSide:
    """A logger of this process with a real helper process, asked over a real Zenoh connection."""

    def __init__(self, folder: Path) -> None:
        self._now_ns = START_NS
        self._folder = folder
        self._logger = new_logger(folder, lambda: self._now_ns)
        self._serving = self._logger.serve()
        self.client = Client.connect("robot")
        self._other = Client.connect("robot")
        self.heard = Heard(self.client)

    def log_of(self, logger: str, name: str) -> Path:
        """Put a log into the logger's folder."""
        return log_in(self._folder / "logs", logger, name)

    def ticks(self, count: int) -> None:
        """Run the loop."""
        for _ in range(count):
            self._logger.collect()
            self._now_ns += TICK_NS

    def somebody_edits(self, name: str, **changes: Any) -> None:
        """Edit through another client."""
        self._other.apply([edit_of(self._other, name, **changes)], -1)

    def add_script(self, name: str, text: str) -> None:
        """Put a script into the logger's script folder."""
        (self._folder / "scripts" / name).write_text(text)

    def cut(self) -> None:
        """Kill the helper process."""
        os.kill(self.client.status().helper_pid, signal.SIGKILL)

    def close(self) -> None:
        """End everything."""
        self.client.close()
        self._other.close()
        self._logger.close()


class FakeSide:
    """The fake, with the table of the same logger."""

    def __init__(self, folder: Path) -> None:
        logger = new_logger(folder, lambda: START_NS)
        elements: list[ElementInfo] = list(logger.elements)
        logger.close()
        self.client = FakeClient(elements)
        self.client.files.clear()
        self.client.logs = folder / "logs"
        self.heard = Heard(self.client)

    def log_of(self, logger: str, name: str) -> Path:
        """Put a log into the logger's folder."""
        return log_in(self.client.logs, logger, name)

    def ticks(self, count: int) -> None:
        """Move the clock."""
        self.client.advance(count / HZ)

    def somebody_edits(self, name: str, **changes: Any) -> None:
        """Edit as another client would."""
        self.client.somebody_edits(name, **changes)

    def add_script(self, name: str, text: str) -> None:
        """Put a script into the folder that the fake has."""
        self.client.files[name] = text

    def cut(self) -> None:
        """Break the link."""
        self.client.cut()

    def close(self) -> None:
        """End everything."""
        self.client.close()


def log_in(folder: Path, logger: str, name: str) -> Path:
    """Write a log of one second of a signal."""
    entry = RecordedEntry("/log/x", Entry("", "<f8"), np.arange(11.0))
    element = RecordedElement("/log/x", "m", "scalar", (), 1, BufferType.LOOPING, 0, (entry,))
    time_ns = START_NS + np.arange(11, dtype=np.int64) * 10**8
    (saved,) = write(Recording(logger, time_ns, 11, [element]), folder, logger, ["silo"], name, why="trigger fall")
    return Path(saved.path)


def edit_of(client: Any, name: str, **changes: Any) -> Edit:
    """An edit of some options of an element, the others as they are."""
    element = next(element for element in client.table().elements if element.name == name)
    return Edit(name, msgspec.structs.replace(element.options, **changes))


@pytest.fixture
def edit() -> Callable[..., Edit]:
    """Makes edits."""
    return edit_of


@pytest.fixture(params=["fake", pytest.param("real", marks=pytest.mark.slow)])
def side(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[RealSide | FakeSide]:
    """One side of the contract: `client`, `heard`, and the hand that moves the robot."""
    made = (RealSide if request.param == "real" else FakeSide)(tmp_path)
    yield made
    made.close()


@pytest.fixture
def client(side: RealSide | FakeSide) -> Any:
    """The client of that side."""
    return side.client

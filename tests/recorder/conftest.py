"""Recorders in processes of their own on buffers of this process, and without a process where a disk is made up."""

import os
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from rosbags.rosbag2 import Reader

from silo.core.elements import RecorderState
from silo.core.recording import Recording
from silo.files.manifest import Ledger
from silo.logger.logger import Logger
from silo.recorder.event_tail import EventTail
from silo.recorder.layout import layout_of
from silo.recorder.orders import (
    MAX_PACKET_BYTES,
    Finish,
    Follow,
    Progress,
    RecordOrder,
    Report,
    conditions_file,
    decode_report,
    encode,
)
from silo.recorder.ring_cursor import RingCursor
from silo.recorder.writing import RecorderDisk, Writing
from silo.segment.reader import SegmentReader
from tests.waiting import wait_until

STEP_NS = 1_000_003
# a recorder that reads, writes and reports at once: others do so four times, twice and once a second
PROMPT = """
import sys
from silo.recorder import __main__, recorder, ring_cursor
recorder.FLUSH_S = recorder.MOST_PERIOD_S = ring_cursor.MOST_PERIOD_S = 0.02
recorder.REPORT_S = {report_s}
sys.exit(__main__.main())
"""
BEGIN_NS = 1_700_000_000_000_000_000


@pytest.fixture(autouse=True)
def _warm(warm: None) -> None:
    """Processes start warm here."""


class Robot:
    """A logger whose every value follows from its tick, counted over all runs."""

    def __init__(self, folder: Path, size: int = 2000, **options: object) -> None:
        self.tick = 0
        self.run_first = 0
        self.log = Logger(
            "bot", frequency=1000, max_time=0, folder=folder, script=folder / "none.yaml", clock=self._clock, **options
        )
        self.x = self.log.array("x", (), np.int64, buffer="looping", size=size)
        self.q = self.log.array("q", 3, buffer="looping", size=size)
        self.slow = self.log.array("slow", (), np.int64, buffer="looping", size=size, divider=5)
        self.word = np.array(b"", "S6")
        self.log.add(self.word, "word", buffer="looping", size=size)

    def _clock(self) -> int:
        return BEGIN_NS + self.tick * STEP_NS

    def start(self) -> None:
        self.run_first = self.tick
        (self.log.restart if self.log.is_running else self.log.start)()

    def ticks(self, count: int) -> None:
        for _ in range(count):
            self.x[...] = self.tick
            self.q[:] = self.tick / 8 + np.arange(3)
            self.slow[...] = -self.tick
            self.word[...] = b"w%d" % (self.tick % 1000)
            self.log.collect()
            self.tick += 1


def check_recording(found: Recording, run_first: int = 0) -> tuple[int, int]:
    """Every value is that of its tick, or said to be missing; returns which ticks of the run x has."""
    first = found.offset - len(found.time_ns)
    span = (0, 0)
    for element in found.elements:
        ticks = first + element.stamp_indices
        missing = np.zeros(element.count, bool)
        for low, high in element.failures.spans:
            missing |= (ticks >= low) & (ticks <= high)
        assert missing.sum() == element.lost == element.failures.count
        there = ~missing
        world = ticks[there] + run_first
        assert (found.time_ns[element.stamp_indices][there] == BEGIN_NS + world * STEP_NS).all()
        values = [entry.values[there] for entry in element.entries]
        name = element.name.rpartition("/")[2]
        if name == "x":
            assert (values[0] == world).all()
            if len(ticks):  # a kill may come between two rings: the next part has all of the other then
                span = int(ticks[0]), int(ticks[-1]) + 1
        elif name == "q":
            assert all((column == world / 8 + k).all() for k, column in enumerate(values))
        elif name == "slow":
            assert (values[0] == -world).all()
            assert (ticks % 5 == 0).all()
        else:
            assert values[0].tolist() == [b"w%d" % (one % 1000) for one in world.tolist()]
    return span


def finished(folder: Path) -> list[Path]:
    """The finished parts, oldest first."""
    return sorted(folder.glob("*.mcap"), key=lambda path: path.name.rpartition("_")[2])


def read_by_others(path: Path) -> dict[str, int]:
    """Messages by topic, as `mcap` reads them; rosbags must find as many."""
    counts: dict[str, int] = {}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        for _, channel, _ in reader.iter_messages():
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
        for index in (*summary.metadata_indexes, *summary.attachment_indexes):
            file.seek(index.offset)
            opcode, size = struct.unpack("<BQ", file.read(9))
            assert (opcode in {Opcode.METADATA, Opcode.ATTACHMENT}, size + 9) == (True, index.length)
        for chunk in summary.chunk_indexes:
            for channel, at in chunk.message_index_offsets.items():
                file.seek(at)
                opcode, _, of = struct.unpack("<BQH", file.read(11))
                assert (opcode, of) == (Opcode.MESSAGE_INDEX, channel)
    assert summary.statistics.message_count == sum(counts.values())
    found: dict[str, int] = {}
    with Reader(path) as other:
        for connection, _, _ in other.messages():
            found[connection.topic] = found.get(connection.topic, 0) + 1
    assert found == counts
    return counts


class Process:
    """A recorder of which this process is the helper."""

    def __init__(self, order: RecordOrder, report_s: float = 0.02) -> None:
        self.socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        command = [sys.executable, "-c", PROMPT.format(report_s=report_s), str(theirs.fileno()), str(os.getpid())]
        self.process = subprocess.Popen(command, pass_fds=[theirs.fileno()])
        theirs.close()
        self.reports: list[Report] = []
        self.socket.send(encode(order))
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _listen(self) -> None:
        while body := self._received():
            self.reports.append(decode_report(body))

    def _received(self) -> bytes:
        try:
            return self.socket.recv(MAX_PACKET_BYTES)
        except ConnectionResetError:
            return b""

    def follow(self, log: Logger) -> None:
        conditions = conditions_file(log._conditions.now)
        with log._present.run.segment.open_read_only() as file:
            socket.send_fds(self.socket, [encode(Follow(log._present.path))], [file.fileno(), conditions])
        os.close(conditions)

    def follow_run(self, reader: SegmentReader) -> None:
        """Hand over a run of another program."""
        socket.send_fds(self.socket, [encode(Follow(str(reader.path)))], [reader.fileno()])

    def wait_recording(self) -> None:
        """Until it has begun with the run."""
        wait_until(lambda: self.reports and self.reports[-1].state is RecorderState.RECORDING)

    def finish(self) -> Report:
        self.socket.send(encode(Finish("the test is over")))
        return self.end()

    def end(self) -> Report:
        self._join()
        return self.reports[-1]

    def kill(self) -> None:
        self.process.kill()
        self._join()

    def _join(self) -> None:
        self.process.wait()
        self._thread.join()
        self.socket.close()


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    made = Robot(tmp_path)
    yield made
    made.log.close()


@pytest.fixture
def recorders() -> Iterator[Callable[..., Process]]:
    made: list[Process] = []

    def start(order: RecordOrder, **options: float) -> Process:
        made.append(Process(order, **options))
        return made[-1]

    yield start
    for one in made:
        if one.process.poll() is None:
            one.kill()


class Direct:
    """A recorder without its process: `step` does what its loop does, as often as a test likes."""

    def __init__(self, robot: Robot, order: RecordOrder, disk: RecorderDisk | None = None) -> None:
        self.robot = robot
        if not robot.log.is_running:
            robot.start()
        Path(order.folder).mkdir(exist_ok=True)
        self.ledger = Ledger(Path(order.folder), order.name, 0.0, os.getpid())
        self.writing = Writing(order, self.ledger, disk or RecorderDisk())
        self.writing.start()
        reader = SegmentReader(robot.log._present.path)
        self.drain = RingCursor(reader, layout_of(reader.schema, order.patterns), None)
        begun = self.drain.layout, self.drain.begun_with, EventTail(reader, 0)
        self.writing.put(self.writing.begin_run, *begun)

    def ticks(self, count: int) -> None:
        """Have the robot log so often, and all of it written."""
        self.robot.ticks(count)
        self.step()

    def step(self) -> None:
        """Read all that is in the rings, and have it written."""
        complete = False
        while not complete:
            complete = self.put()
            wait_until(lambda: self.writing.is_idle or self.writing.over.is_set())

    def put(self) -> bool:
        """Read what there is room for; False if that is not all."""
        room = self.writing.room_bytes
        if not room:
            self.drain.is_held_up = True
            return False
        found = self.drain.read(room)
        self.writing.put(self.writing.write, found)
        self.writing.put(self.writing.look_for_events)
        return found.complete

    def told(self) -> list[Report]:
        """What it has told by now, and had not said before."""
        return [self.writing.news.popleft()(self.writing.totals.state) for _ in range(len(self.writing.news))]

    def finish(self) -> Progress:
        self.writing.put(self.writing.end_run)
        self.writing.end()
        self.writing.join()
        self.ledger.close()
        return self.writing.totals


class Truth:
    """What files must hold."""

    span = staticmethod(check_recording)
    by_others = staticmethod(read_by_others)
    robot = Robot
    direct = Direct


@pytest.fixture
def truth() -> Truth:
    return Truth()


@pytest.fixture
def direct(robot: Robot, tmp_path: Path) -> Direct:
    """A recorder of all that the robot logs."""
    return Direct(robot, RecordOrder("bot", str(tmp_path / "rec")))

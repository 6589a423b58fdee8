"""Saves of a large log while the robot goes on: nothing is lost, nothing emptied; and saves that fail harm nothing.

A robot program, its helper process, clients and commands, each a process or a session of its own.
"""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import silo
from silo.client.client import Client
from silo.core.elements import BufferType, FileType
from silo.errors import RefusedError, SaveError
from silo.files.formats import SAVED
from silo.rpc.published import EventKind
from silo.segment.layout import RingSchema
from silo.segment.reader import SegmentReader
from tests.waiting import DEADLINE_S

PROGRAM = Path(__file__).with_name("saving_robot.py")
LARGE, SMALL = 7000, 50  # ticks: 100 MB, or next to nothing
LOOPING_SIZE = 4000


class Robot:
    """The robot program, its folder and its helper."""

    def __init__(self, name: str, folder: Path, ticks: int) -> None:
        self.name, self.folder = name, folder
        command = [sys.executable, str(PROGRAM), name, str(folder), str(ticks)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.helper_pid = int(self.process.stdout.readline())

    def asked(self, line: str) -> str:
        self.process.stdin.write(f"{line}\n")
        self.process.stdin.flush()
        return self.process.stdout.readline().strip()

    def end(self) -> None:
        """End it as its user would: at the end of its input it closes the logger."""
        self.process.stdin.close()
        try:
            self.process.wait(DEADLINE_S)
        finally:
            self.process.kill()
            self.process.stdout.close()

    def files(self) -> set[str]:
        """What stands in its folder, hidden files too, the counter of runs and the event log left out."""
        apart = ("_fileNumber", ".events.jsonl")
        return {path.name for path in self.folder.iterdir() if not path.name.endswith(apart)}


def saved_by_api(robot: Robot, client: Client, name: str) -> list[str]:
    return [robot.asked(f"save silo {name} -")]


def saved_by_command(robot: Robot, client: Client, name: str) -> list[str]:
    command = [
        sys.executable,
        "-c",
        "from silo.cli import main; main()",
        "save",
        robot.name,
        "-t",
        "silo",
        "--name",
        name,
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=True)
    return [line.split("  ")[0] for line in done.stdout.splitlines()]


def saved_by_client(robot: Robot, client: Client, name: str) -> list[str]:
    return [file.path for file in client.wait_saved(client.save([FileType.SILO, FileType.BAG], name), 60)]


@pytest.fixture(scope="module")
def large_runtime() -> Iterator[Path]:
    folder = Path(tempfile.mkdtemp(prefix="", dir=os.environ["SILO_TEST_ROOM"]))
    yield folder
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="module")
def large_robot(large_runtime: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("SILO_RUNTIME_DIR", str(large_runtime))
        robot = Robot("large", tmp_path_factory.mktemp("logs"), LARGE)
    yield robot
    robot.end()


@pytest.fixture
def large(large_robot: Robot, large_runtime: Path, monkeypatch: pytest.MonkeyPatch) -> Robot:
    """A robot program that logged 100 MB and goes on."""
    monkeypatch.setenv("SILO_RUNTIME_DIR", str(large_runtime))
    return large_robot


@pytest.fixture
def small(runtime_folder: Path, tmp_path: Path) -> Iterator[Robot]:
    """A robot program that logged little and goes on."""
    robot = Robot("small", tmp_path / "logs", SMALL)
    (tmp_path / "logs").mkdir(exist_ok=True)
    yield robot
    robot.end()


@pytest.fixture
def clients(request: pytest.FixtureRequest) -> Iterator[Callable[[Robot], Client]]:
    """Clients of a robot, closed at the end of the test."""
    made: list[Client] = []

    def connect(robot: Robot) -> Client:
        made.append(Client.connect(robot.name))
        return made[-1]

    yield connect
    for client in made:
        client.close()


def check_file(path: str, at_least: int, at_most: int) -> int:
    """Everything in the file is cut at one tick, gapless, and each value at its own time; returns the ticks.

    Where the computer is so busy that rings turn over while they are copied, that is told, of which.
    """
    log = silo.open_log(path)
    overtaken = [text for text in log.warnings if text.endswith("were overwritten while the snapshot was taken")]
    assert log.warnings == tuple(overtaken)
    ticks = log.recording.offset
    assert at_least <= ticks <= at_most
    np.testing.assert_array_equal(log.time_ns, np.arange(ticks) * 1_000_000)
    for name, count, last in (
        ("grow", ticks, ticks - 1),
        ("loop", LOOPING_SIZE, ticks - 1),
        ("beat", LOOPING_SIZE, ticks - 1),
        ("slow", min(LOOPING_SIZE, (ticks - 1) // 7 + 1), (ticks - 1) // 7 * 7),
    ):
        signal = log[name]
        is_overtaken = any(f"/log/{name}" in text for text in overtaken)
        assert 0 < len(signal) < count if is_overtaken else len(signal) == count
        expected = last - np.arange(len(signal))[::-1] * signal.divider
        np.testing.assert_array_equal(signal.time_ns, expected * 1_000_000)
        columns = signal.values.reshape(len(signal), -1)
        assert (columns == expected[:, None]).all()
        assert {element.lost for element in log.recording.elements} == {0}
    return ticks


@pytest.mark.parametrize("save", [saved_by_api, saved_by_command, saved_by_client])
def test_a_large_log_is_saved_while_the_robot_goes_on(save, large, clients) -> None:
    client = clients(large)
    before = client.status().ticks
    paths = save(large, client, save.__name__)
    after = client.status().ticks
    for path in paths:
        # growing buffers begin at tick 0 although the log was saved before: no save empties a buffer
        check_file(path, before, after)
    assert after > before
    assert client.status().lost == 0


def test_publishing_goes_on_while_a_large_log_is_saved(large, clients, until) -> None:
    client, listener = clients(large), clients(large)
    done = []
    client.on_event(lambda event: done.append(event) if event.kind is EventKind.SAVED else None)
    with listener.topic("/log/beat") as topic:
        batches = until(topic.read)
        client.save([FileType.SILO, FileType.BAG], "published")
        meanwhile = 0

        def is_saved() -> bool:
            nonlocal meanwhile
            new = topic.read()
            meanwhile += len(new)
            batches.extend(new)
            return bool(done)

        until(is_saved)
        assert topic.missed == 0
    seen = np.concatenate([batch.values for batch in batches]).ravel()
    np.testing.assert_array_equal(np.diff(seen), 1)
    assert meanwhile >= 3


def test_all_ticks_of_a_robot_that_saves_are_logged(small) -> None:
    for number in range(5):
        small.asked(f"save silo n{number} -")
    ticks, lost, turns = map(int, small.asked("end").split())
    assert (ticks, lost) == (turns, 0)


def test_a_growing_buffer_that_takes_long_to_copy_costs_the_looping_ones_nothing(new_logger, monkeypatch) -> None:
    log = new_logger(frequency=100, max_time=0)
    log.array("a_grows", 3, buffer=BufferType.GROWING)
    log.array("loops", 3, size=50)
    log.start()
    for _ in range(100):
        log.collect()
    copy = SegmentReader._copy

    def copy_slowly(reader: SegmentReader, ring: RingSchema, *rows: Any) -> NDArray[np.uint64]:
        if ring.buffer_type is BufferType.GROWING:
            for _ in range(500):
                log.collect()
        return copy(reader, ring, *rows)

    monkeypatch.setattr(SegmentReader, "_copy", copy_slowly)
    recording = log.snapshot()
    assert log.ticks > 500
    assert (recording.offset, recording.warnings) == (100, ())
    assert {element.name: element.count for element in recording.elements} == {"/log/a_grows": 100, "/log/loops": 50}


# ------------------------------------------------------------------------------------------------- saves that fail


class Told:
    """What a client hears of failed saves."""

    def __init__(self, client: Client) -> None:
        self.texts: list[str] = []
        client.on_event(lambda event: self.texts.append(event.text) if event.kind is EventKind.SAVE_FAILED else None)


@pytest.fixture
def limited() -> Iterator[Callable[[Robot, int], None]]:
    """Lets a helper process write no file larger than so many bytes: it meets a full disk."""

    def limit(robot: Robot, size_bytes: int) -> None:
        hard = resource.prlimit(robot.helper_pid, resource.RLIMIT_FSIZE)[1]
        resource.prlimit(robot.helper_pid, resource.RLIMIT_FSIZE, (size_bytes, hard))

    return limit


@pytest.mark.usefixtures("cold_children")
@pytest.mark.parametrize("file_type", [FileType.SILO, FileType.CSV, FileType.BAG])
def test_a_full_disk_is_told_to_every_client_and_leaves_nothing(file_type, small, clients, limited, until) -> None:
    client, other = clients(small), clients(small)
    told, others = Told(client), Told(other)
    limited(small, 20_000)
    with pytest.raises(SaveError, match="too large") as failed:
        client.wait_saved(client.save([file_type], "walk"), 60)
    assert until(lambda: told.texts) == until(lambda: others.texts) == [str(failed.value)]
    assert "choose another folder" in str(failed.value)
    assert "still in memory" in str(failed.value)
    assert small.files() == set()
    limited(small, resource.RLIM_INFINITY)
    (file,) = client.wait_saved(client.save([file_type], "walk"), 60)
    beside = SAVED[file_type].beside
    assert small.files() == {Path(file.path).name} | ({f"{Path(file.path).name}{beside}"} if beside else set())


def test_a_log_that_finds_no_room_can_be_saved_elsewhere(small, clients, tmp_path, until) -> None:
    def put_in_the_way() -> bool:
        shutil.rmtree(small.folder)
        try:
            small.folder.write_text("in the way")
        except IsADirectoryError:
            return False  # the event log has just made it anew
        return True

    until(put_in_the_way)
    assert "failed" in small.asked("save silo walk -")
    elsewhere = small.asked(f"save silo walk {tmp_path / 'elsewhere'}")
    assert silo.open_log(elsewhere)["beat"].values[0] == 0


def test_a_folder_that_may_not_be_written_is_told_to_every_client(runtime_folder, clients, until, tmp_path) -> None:
    # nobody may make folders there, root neither
    robot = Robot("barred", Path("/sys/silo-logs"), SMALL)
    try:
        client, other = clients(robot), clients(robot)
        told, others = Told(client), Told(other)
        with pytest.raises(SaveError, match=r"can't make the folder '/sys/silo-logs'.*choose another"):
            client.wait_saved(client.save(), 60)
        assert until(lambda: told.texts) == until(lambda: others.texts)
        assert Path(robot.asked(f"save silo walk {tmp_path}")) == tmp_path / "walk.silo"
    finally:
        robot.end()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write every folder")
def test_a_read_only_folder_is_told(small, clients) -> None:
    small.folder.chmod(0o500)
    client = clients(small)
    with pytest.raises(SaveError, match=r"Permission denied.*choose another folder"):
        client.wait_saved(client.save(), 60)


@pytest.mark.parametrize("name", ["a/b", ".hidden", "x" * 300])
def test_a_bad_name_is_told_to_every_client(name, small, clients, until) -> None:
    client, other = clients(small), clients(small)
    others = Told(other)
    with pytest.raises(RefusedError, match=r"can't be the name of a log.*choose a name") as refused:
        client.save([FileType.SILO], name)
    assert until(lambda: others.texts) == [str(refused.value)]
    assert small.files() == set()


def test_a_name_that_is_taken_is_told_and_the_file_stays(small, clients, until) -> None:
    client, other = clients(small), clients(small)
    others = Told(other)
    (file,) = client.wait_saved(client.save([FileType.SILO], "walk"), 60)
    content = Path(file.path).read_bytes()
    with pytest.raises(SaveError, match="exists already; remove it or choose another name"):
        client.wait_saved(client.save([FileType.SILO], "walk"), 60)
    assert until(lambda: others.texts)
    assert Path(file.path).read_bytes() == content


def test_a_name_that_is_taken_in_one_format_is_taken_in_all(small, clients, until) -> None:
    client = clients(small)
    told = Told(client)
    (small.folder / "walk.rosbag2").mkdir()
    with pytest.raises(SaveError, match="exists already"):
        client.wait_saved(client.save([FileType.SILO, FileType.BAG], "walk"), 60)
    assert until(lambda: told.texts)
    assert small.files() == {"walk.rosbag2"}

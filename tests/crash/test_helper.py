"""Kill and freeze everything: helper, robot program, client. The screen must come right by itself, the data survive."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import silo
from silo.client.client import Client
from silo.core.elements import FileType, State
from silo.errors import ConnectionLostError, GoesOnError, RefusedError
from silo.fleet.fleet import asked_all
from silo.fleet.resolving import discover
from silo.rpc.published import Event, EventKind
from silo.rpc.refusals import RefusedWhy
from tests.waiting import DEADLINE_S, freeze


@pytest.fixture
def robot(robots):
    return robots("bot")


class Watcher:
    """A client with a view and a topic, and all that it heard."""

    def __init__(self) -> None:
        self.client = Client.connect("bot")
        self.events: list[Event] = []
        self.links: list[bool] = []
        self.client.on_event(self.events.append)
        self.client.on_link(self.links.append)
        self.view = self.client.view(["/log/x"], ["/log/x"], rate_hz=30)
        self.topic = self.client.topic("/log/q")

    def sees(self) -> bool:
        """Whether a frame with values came since the last call: the helper may not have taken over the run yet."""
        frame = self.view.frame()
        return frame is not None and frame.held.any()

    def heard(self, kind: EventKind) -> Event | None:
        return next((event for event in self.events if event.kind is kind), None)


@pytest.fixture
def watcher(robot, until) -> Iterator[Watcher]:
    made = Watcher()
    until(made.sees)
    yield made
    made.client.close()


def test_killed_helper_is_replaced_and_everything_goes_on(robot, watcher, until) -> None:
    ticks = watcher.client.status().ticks
    os.kill(robot.helper_pid, signal.SIGKILL)
    until(lambda: watcher.links[-1:] == [True])
    status = watcher.client.status()
    assert status.helper_pid != robot.helper_pid
    assert status.ticks >= ticks
    watcher.view.frame()
    until(watcher.sees)
    watcher.topic.read()
    until(watcher.topic.read)
    os.kill(status.helper_pid, signal.SIGKILL)


def test_loss_of_the_helper_is_noticed_sooner_than_its_silence(robot, watcher, until) -> None:
    freeze(robot.pid)  # so that it starts no other
    began = time.monotonic()
    freeze(robot.helper_pid)
    until(lambda: watcher.links[-1:] == [False])
    silence_s = time.monotonic() - began
    os.kill(robot.helper_pid, signal.SIGCONT)
    until(lambda: watcher.links[-1:] == [True])
    began = time.monotonic()
    os.kill(robot.helper_pid, signal.SIGKILL)
    until(lambda: watcher.links[-1:] == [False])
    assert time.monotonic() - began < silence_s
    with pytest.raises(ConnectionLostError, match="connecting again by itself"):
        watcher.client.status()


def test_frozen_helper_is_told_and_comes_back(robot, watcher, until) -> None:
    freeze(robot.helper_pid)
    until(lambda: "T (stopped)" in Path(f"/proc/{robot.helper_pid}/status").read_text())  # it may answer until then
    with pytest.raises(ConnectionLostError):
        watcher.client.status()
    until(lambda: watcher.links[-1:] == [False])
    os.kill(robot.helper_pid, signal.SIGCONT)
    until(lambda: watcher.links[-1:] == [True])
    watcher.view.frame()
    until(watcher.sees)


def test_killed_robot_program_is_saved_and_told(robot, watcher, until) -> None:
    ticks = watcher.client.status().ticks
    robot.kill()
    crashed = until(lambda: watcher.heard(EventKind.CRASHED))
    (file,) = crashed.files
    assert crashed.status.state is State.DEAD
    assert file.path in crashed.text
    assert len(silo.open_log(file.path)["/log/x"].values) >= ticks
    assert watcher.client.status().state is State.DEAD


def test_segment_of_a_killed_program_is_removed_once_it_is_saved(robot, watcher, until, runtime) -> None:
    (runtime / ".bot.1.7.segment.new").write_bytes(bytes(4096))  # killed while it started again
    robot.kill()
    until(lambda: watcher.heard(EventKind.CRASHED))
    assert [*runtime.glob("*.segment*"), *runtime.glob(".*.segment*")] == []


def test_dead_logger_changes_nothing_but_still_saves(robot, watcher, until) -> None:
    robot.kill()
    until(lambda: watcher.heard(EventKind.CRASHED))
    with pytest.raises(RefusedError, match="start the robot program again") as refused:
        watcher.client.start()
    assert refused.value.why is RefusedWhy.DEAD
    assert watcher.client.wait_saved(watcher.client.save([FileType.CSV]), 30)


def _pid_of(client: Client) -> int:
    """The robot program that a client talks to, 0 while it goes over from one helper process to the next."""
    try:
        return client.status().pid
    except ConnectionLostError:
        return 0


def test_program_that_is_started_again_is_found_by_its_old_clients(robot, robots, watcher, until) -> None:
    robot.kill()
    until(lambda: watcher.heard(EventKind.CRASHED))
    again = robots("bot")
    until(lambda: _pid_of(watcher.client) == again.pid)
    watcher.view.frame()
    until(watcher.sees)


def test_dead_logger_makes_way_for_its_successor_in_the_list(robot, robots, watcher, until) -> None:
    robot.kill()
    until(lambda: watcher.heard(EventKind.CRASHED))
    (dead,) = asked_all().members
    assert dead.status.state is State.DEAD
    again = robots("bot")
    assert [found.pid for found in discover().loggers] == [again.pid]


def test_dead_logger_is_not_hidden_by_another_that_ran_beside_it(robots, until) -> None:
    first, second = robots("bot"), robots("bot")
    first.kill()
    both = {(first.pid, True), (second.pid, False)}
    until(lambda: {(found.pid, found.dead) for found in discover().loggers} == both)


def test_program_killed_together_with_its_helper_is_recovered_by_hand(robot, tmp_path, until) -> None:
    from silo.helper.left_logs import recover
    from silo.recovery.segments import left_segments

    with Client.connect("bot") as client:
        until(lambda: client.status().ticks > 100)
    freeze(robot.helper_pid)
    robot.kill()
    os.kill(robot.helper_pid, signal.SIGKILL)
    (stale,) = left_segments()
    assert stale.ticks > 100
    (file,) = recover(stale.path, tmp_path / "recovered").files
    assert len(silo.open_log(file.path)["/log/x"].values) == stale.ticks
    assert left_segments() == []


def test_segment_of_a_living_program_is_not_stale(robot, runtime) -> None:
    from silo.errors import StateError
    from silo.helper.left_logs import recover
    from silo.recovery.segments import left_segments

    assert left_segments() == []
    with pytest.raises(StateError, match="still logging"):
        recover(next(runtime.glob("*.segment")))


def test_frozen_robot_program_holds_up_no_status(robot, watcher) -> None:
    freeze(robot.pid)
    refused = []

    def stop() -> None:
        with pytest.raises(GoesOnError, match="stop goes on: the robot program has not answered for 5 s"):
            watcher.client.stop()
        refused.append(True)

    stopping = threading.Thread(target=stop)
    stopping.start()
    answered = 0
    while not refused:
        watcher.client.status()
        answered += 1
    stopping.join()
    assert answered > 10
    os.kill(robot.pid, signal.SIGCONT)


CLIENT = """
import sys
from silo.client.connect import Client
client = Client.connect("bot")
view = client.view(["/log/x", "/log/q"], ["/log/x"], rate_hz=30)
topics = [client.topic("/log/q"), client.topic("/log/x")]
print("ready", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def stranger(robot):
    """Another client in a process of its own."""
    process = subprocess.Popen([sys.executable, "-c", CLIENT], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    yield process
    process.kill()
    process.wait()
    process.stdin.close()
    process.stdout.close()


def test_frozen_client_costs_the_others_nothing(robot, stranger, watcher, until) -> None:
    freeze(stranger.pid)
    for _ in range(30):
        until(watcher.sees)
        watcher.client.status()
    assert watcher.links == []
    os.kill(stranger.pid, signal.SIGCONT)


def test_ctrl_c_in_the_terminal_of_the_robot_does_not_end_the_helper(robots, until) -> None:
    robot = robots("bot", start_new_session=True)
    with Client.connect("bot") as client:
        os.killpg(robot.pid, signal.SIGINT)
        robot.process.wait()
        until(lambda: client.status().state is State.DEAD)


def test_service_manager_that_ends_both_loses_no_data(robot, watcher, until, tmp_path) -> None:
    os.kill(robot.helper_pid, signal.SIGTERM)
    robot.process.terminate()
    robot.process.wait()
    until(lambda: list((tmp_path / "logs").glob("*.silo")))
    until(lambda: not Path(f"/proc/{robot.helper_pid}").exists() or watcher.heard(EventKind.CRASHED))


def resident_kb(status: str) -> int:
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS"))


def test_helper_takes_little_beside_what_its_libraries_do(cold, robot, watcher) -> None:
    watcher.client.wait_saved(watcher.client.save(), 30)
    size = resident_kb(Path(f"/proc/{robot.helper_pid}/status").read_text())
    libraries = "import msgspec, numpy, zenoh; print(open('/proc/self/status').read())"
    bare = resident_kb(subprocess.check_output([sys.executable, "-c", libraries], text=True))
    # of which 2.5 MB are rules at its socket, and a thread per lane
    assert size - bare < 36_000, f"{size} kB, its libraries alone {bare} kB"


def test_it_ends_in_order_where_the_program_was_started_without_output(tmp_path):
    program = (
        f"import silo; log = silo.Logger('quiet', folder={str(tmp_path)!r}); log.array('x', 3); log.serve(); "
        "log.start(); log.collect(); log.close()"
    )
    words = ["sh", "-c", f'exec {sys.executable} -c "$0" >&-', program]
    done = subprocess.run(words, stderr=subprocess.PIPE, text=True, timeout=DEADLINE_S, check=False)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr

"""Many loggers at a glance: who comes and goes, a summary of each, one session for all of them."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest

import silo
from silo.client.client import Client
from silo.core.elements import State
from silo.fleet.fleet import Fleet
from silo.fleet.member import Member
from silo.fleet.near import HERE, unreachable_text
from silo.fleet.resolving import discover
from silo.live.publisher import differs, room_of
from silo.net.access.senders import network_words
from silo.net.session import close, open_router
from silo.rpc.published import MOST_REASON, Summary
from silo_tui.sessions.live import NO_STATUS
from tests.stand_ins.shared_sessions import open_configurations
from tests.stand_ins.simulated_robots import SimulatedRobot, SimulatedRobots
from tests.thin_net import free_port
from tests.waiting import answered, freeze, wait_until

HOST = socket.gethostname()
RUNNING = Summary(state=State.RUNNING, measured_hz=400.0, disk_free_bytes=50, disk_bytes=1000)


# ---------------------------------------------------------------------------------------------------------- summaries


@pytest.mark.parametrize(
    ("change", "is_new"),
    [
        ({"measured_hz": 400.3, "ticks": 9, "disk_free_bytes": 49}, False),
        ({"measured_hz": 380.0}, True),
        ({"disk_free_bytes": 20}, True),
        ({"lost": 1}, True),
        ({"clients": ["ann"]}, True),
        ({"state": State.STOPPED}, True),
    ],
)
def test_a_summary_is_told_when_it_says_something_new(change, is_new) -> None:
    assert differs(RUNNING, msgspec.structs.replace(RUNNING, **change)) is is_new


def test_a_summary_takes_a_few_hundred_bytes_at_most() -> None:
    full = msgspec.structs.replace(
        RUNNING, ticks=2**40, started_ns=2**60, lost=2**30, disk_free_bytes=2**40, disk_bytes=2**41, alarm="HH",
        alarms=100, clients=[f"operator{place}@desk{place}" for place in range(8)], user="robot",
        reason="x" * MOST_REASON,
    )  # fmt: skip
    assert len(msgspec.msgpack.encode(RUNNING)) < 80
    assert len(msgspec.msgpack.encode(full)) < 500


def test_a_summary_keeps_the_end_of_why_a_program_died_where_the_file_stands() -> None:
    reason = f"the robot program (process 3833) ended without close(); {'words ' * 40}: /home/ann/logs/arm.silo (9 MB)"
    told = Summary.of(msgspec.structs.replace(NO_STATUS, reason=reason)).reason
    assert len(told) <= MOST_REASON
    assert told.startswith("the robot program (process 3833) ended without close()")
    assert told.endswith("words : /home/ann/logs/arm.silo (9 MB)")


def test_a_summary_of_a_newer_silo_with_more_fields_is_read() -> None:
    payload = msgspec.msgpack.encode([*msgspec.to_builtins(RUNNING), "more", 7])
    assert msgspec.msgpack.decode(payload, type=Summary) == RUNNING


def test_a_disk_has_room_also_where_the_folder_will_be_made_at_the_first_save(tmp_path) -> None:
    free, size = room_of(tmp_path / "not" / "yet")
    assert 0 < free <= size


# ---------------------------------------------------------------------------------------------------- on this computer


@pytest.mark.slow
def test_who_follows_goes_on_while_the_folder_of_sockets_cant_be_used_and_tells_why(tmp_path, monkeypatch) -> None:
    with tempfile.TemporaryDirectory(dir="/dev/shm") as runtime:
        monkeypatch.setenv("SILO_RUNTIME_DIR", runtime)
        monkeypatch.setattr("silo.fleet.fleet.SCAN_S", 0.01)
        with Fleet("local") as fleet:
            fleet.wait_ready(60)
            assert not fleet.now().unreachable
            Path(runtime).chmod(0o755)
            wait_until(lambda: "others could look in; run: chmod 700" in fleet.now().unreachable.get(HERE, ""))
            Path(runtime).chmod(0o700)
            wait_until(lambda: not fleet.now().unreachable)
            with silo.Logger("walker", folder=tmp_path) as logger:
                logger.add(np.zeros(3), "x")
                logger.serve()
                waited(fleet, "walker", lambda one: one.here)
    assert unreachable_text(HERE, "why") == "why"
    assert unreachable_text("desk", "why") == "remote 'desk': why"


# ------------------------------------------------------------------------------------------------------ behind a router


class Site:
    """A router, and the file of a desk or robot that connects to it."""

    def __init__(self, folder: Path) -> None:
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.folder, self.server, self.desk = folder, str(folder / "router.json5"), str(folder / "desk.json5")
        # a short lease, so that a silent link is told soon
        link = {"transport": {"link": {"tx": {"lease": 500}}}}
        Path(self.server).write_text(json.dumps({"listen": {"endpoints": [self.endpoint]}, **link}))
        Path(self.desk).write_text(json.dumps({"connect": {"endpoints": [self.endpoint]}, **link}))
        self.router, _ = open_router(self.server)

    def close(self) -> None:
        close(self.router)


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Site]:
    with tempfile.TemporaryDirectory(dir="/dev/shm") as runtime:
        monkeypatch.setenv("SILO_RUNTIME_DIR", runtime)
        made = Site(tmp_path)
        yield made
        made.close()


@pytest.fixture
def served(site: Site) -> Iterator[silo.Logger]:
    """A real logger behind the router."""
    logger = silo.Logger("walker", folder=site.folder / "logs", script=site.folder / "walker.yaml")
    logger.add(np.zeros(3), "x", action=silo.Action.SAVE_AND_PUBLISH)
    logger.serve(config=site.desk)
    yield logger
    logger.close()


def member(fleet: Fleet, name: str) -> Member | None:
    return next((one for one in fleet.now().members if one.found.name == name), None)


def waited(fleet: Fleet, name: str, fact: Callable[[Member], object]) -> Member:
    return wait_until(lambda: (one := member(fleet, name)) is not None and fact(one) and one)


@pytest.mark.slow
def test_state_rate_losses_disk_alarms_and_who_is_there_are_told_without_asking(site, served) -> None:
    served.add(np.full((), 5.0), "hot", limits=(None, None, None, 2.0))
    with Fleet(site.desk) as fleet:
        waited(fleet, "walker", lambda one: one.state is State.STOPPED)
        with Client.connect("walker", config=site.desk) as client:
            client.start()
            waited(fleet, "walker", lambda one: one.state is State.RUNNING)
            served.collect()
            one = waited(fleet, "walker", lambda one: one.summary.alarms)
            assert (one.summary.alarm, one.summary.alarms) == ("HH", 1)
            one = waited(fleet, "walker", lambda one: one.summary.clients)
            assert one.summary.clients == [network_words(client._connection.user, client._name, proven=False)]
            assert 0 < one.summary.disk_free_bytes <= one.summary.disk_bytes
            client.stop()
        waited(fleet, "walker", lambda one: one.state is State.STOPPED and not one.summary.clients)
        assert open_configurations() == {site.desk: 1}
    assert open_configurations() == {}


@pytest.mark.slow
def test_a_program_that_closes_its_logger_is_closed_and_not_lost(site, served, monkeypatch) -> None:
    tell, gone = Fleet._tell, list[Member]()

    def told(fleet: Fleet) -> None:
        tell(fleet)
        gone.extend(one for one in fleet._now.members if not one.here)

    monkeypatch.setattr(Fleet, "_tell", told)
    with Fleet(site.desk) as fleet:
        waited(fleet, "walker", lambda one: one.summary)
        served.close()
        one = waited(fleet, "walker", lambda one: not one.here)
        assert one.closed
        assert not one.lost
        assert all(one.closed for one in gone)  # at no moment
        fleet.look_again()
        wait_until(lambda: member(fleet, "walker") is None)


ROBOT = """
import sys, time, numpy as np, silo
logger = silo.Logger("runner", frequency=200, max_time=10, folder=sys.argv[1], script=sys.argv[1] + "/runner.yaml")
logger.add(np.zeros(3), "x")
print(logger.serve(config=sys.argv[2]).helper_pid, flush=True)
logger.start()
while True:
    logger.collect()
    time.sleep(0.005)
"""


@pytest.fixture
def runner(site: Site) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """A robot program of its own, and its helper's process id."""
    command = [sys.executable, "-c", ROBOT, str(site.folder), site.desk]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    helper = int(process.stdout.readline())
    yield process, helper
    process.kill()
    process.wait()
    with contextlib.suppress(ProcessLookupError):
        os.kill(helper, signal.SIGTERM)  # it would stay for some seconds
    wait_until(lambda: not Path(f"/proc/{helper}").exists())


@pytest.mark.slow
def test_a_killed_program_is_dead_with_what_became_of_its_log_also_when_its_helper_has_gone(site, runner) -> None:
    process, helper = runner
    with Fleet(site.desk) as fleet:
        waited(fleet, "runner", lambda one: one.state is State.RUNNING and one.summary.measured_hz)
        process.kill()
        waited(fleet, "runner", lambda one: one.state is State.DEAD)
        one = waited(fleet, "runner", lambda one: one.summary.saved)
        assert "ended without close()" in one.summary.reason
        os.kill(helper, signal.SIGTERM)  # it would stay for some seconds
        one = waited(fleet, "runner", lambda one: not one.here)
        assert one.state is State.DEAD
        assert not one.lost


@pytest.mark.slow
def test_a_robot_that_ends_without_a_word_is_lost_and_its_last_words_stay(site) -> None:
    with SimulatedRobots(site.desk, ["robot1"]) as made, Fleet(site.desk) as fleet:
        waited(fleet, "anymal", lambda one: one.state is State.RUNNING)
        made.close()
        one = waited(fleet, "anymal", lambda one: not one.here)
        assert one.lost
        assert one.state is State.RUNNING
        made.robots = []


@pytest.mark.slow
def test_a_robot_that_was_started_again_takes_the_place_of_the_one_that_was_lost(site) -> None:
    with Fleet(site.desk) as fleet:
        for drawn in ("aaaa000001", "aaaa000002"):
            robot = SimulatedRobot(site.desk, "robot1", drawn=drawn)
            one = waited(fleet, "anymal", lambda one: one.here)
            assert one.found.id == drawn
            assert len(fleet.now().members) == 1
            robot.close()
            waited(fleet, "anymal", lambda one: one.lost)


@pytest.mark.slow
def test_a_robot_that_falls_silent_is_lost_after_its_lease_and_is_here_again_when_it_speaks(site, runner) -> None:
    _, helper = runner
    with Fleet(site.desk) as fleet:
        before = waited(fleet, "runner", lambda one: one.state is State.RUNNING)
        freeze(helper)
        try:
            one = waited(fleet, "runner", lambda one: one.lost)
            assert one.since_s > before.since_s
        finally:
            os.kill(helper, signal.SIGCONT)
        waited(fleet, "runner", lambda one: one.here and one.state is State.RUNNING)


@pytest.mark.slow
def test_a_router_that_goes_takes_all_along_and_brings_them_back(site, served) -> None:
    with Fleet(site.desk) as fleet:
        waited(fleet, "walker", lambda one: one.here)
        close(site.router)
        waited(fleet, "walker", lambda one: one.lost)
        wait_until(lambda: "link is cut" in fleet.now().unreachable.get(site.desk, ""))
        site.router, _ = open_router(site.server)
        waited(fleet, "walker", lambda one: one.here)
        wait_until(lambda: not fleet.now().unreachable)


@pytest.mark.slow
def test_one_that_answers_nothing_holds_up_no_other_and_says_so(site) -> None:
    with SimulatedRobots(site.desk, [f"robot{place}" for place in range(20)]) as made:
        made.robots[7].mute = True
        for robot in made.robots:
            robot.publish = lambda: None
        with Fleet(site.desk) as fleet:
            wait_until(lambda: sum(one.summary is not None for one in fleet.now().members) == 19)
            silent = wait_until(
                lambda: next((one for one in fleet.now().members if one.problem and one.summary is None), None)
            )
            assert silent.found.host == "robot7"
            assert "gave no answer" in silent.problem
            assert open_configurations() == {site.desk: 1}


@pytest.mark.slow
def test_a_way_that_is_not_there_is_told_and_the_others_are_seen(site, served, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    folder = tmp_path / "config" / "silo" / "remotes"
    folder.mkdir(parents=True)
    (folder / "lab.json5").write_text(Path(site.desk).read_text())
    (folder / "gone.json5").write_text(json.dumps({"connect": {"endpoints": ["tcp/127.0.0.1:1"]}}))
    with Fleet() as fleet:
        found = fleet.wait_ready(100.0)
        assert found.ready
        assert "nobody listens on port 1" in found.unreachable["gone"]
        one = waited(fleet, "walker", lambda one: one.summary)
        assert one.found.socket  # the short way is taken
        assert len(fleet.now().members) == 1


@pytest.mark.slow
def test_a_way_that_was_tried_has_all_that_are_there(site) -> None:
    with SimulatedRobots(site.desk, [f"robot{place}" for place in range(20)]):
        with Fleet(site.desk) as fleet:
            wait_until(lambda: len(fleet.now().members) == 20)
        for _ in range(10):
            with Fleet(site.desk) as fleet:
                found = wait_until(lambda: (now := fleet.now()).ready and now)
            assert (len(found.members), found.unreachable) == (20, {})


@pytest.mark.slow
def test_who_looks_once_beside_a_fleet_that_begins_sees_all(site) -> None:
    with SimulatedRobots(site.desk, [f"robot{place}" for place in range(20)]):
        wait_until(lambda: len(answered(lambda: discover(1.0, site.desk).loggers) or []) == 20)
        for _ in range(10):
            with Fleet(site.desk):
                assert len(discover(8.0, site.desk).loggers) == 20

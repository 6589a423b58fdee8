"""Loggers of a network that are gone without a word are missed by who looks once, too."""

import stat
import time
from pathlib import Path

import pytest
from msgspec.structs import replace

from silo.cli import codes
from silo.cli.main import run
from silo.core.elements import State
from silo.core.runtime import runtime_dir
from silo.fleet import memory
from silo.fleet.fleet import Fleet, FleetLink
from silo.fleet.member import Member, lost_lines
from silo.fleet.memory import NAME, remember, remembered
from silo.net.found import LoggerAddress
from silo.net.keys import Root
from silo.rpc.published import Summary
from tests.ipc.test_fleet import served as served  # noqa: PLC0414  # a fixture
from tests.ipc.test_fleet import site as site  # noqa: PLC0414  # a fixture
from tests.ipc.test_fleet import waited
from tests.stand_ins.simulated_robots import SimulatedRobot, SimulatedRobots
from tests.waiting import wait_until

LEGS = ["leg1", "leg2", "leg3"]


def listed(capsys: pytest.CaptureFixture[str], config: str, *words: str) -> tuple[int, str, str]:
    """`silo ls` of a desk, once it sees somebody or tells that nobody is there."""
    code = run(["--config", config, "ls", *words])
    shown = capsys.readouterr()
    return code, shown.out, shown.err


# ---------------------------------------------------------------------------------------------------------------- once


@pytest.mark.slow
def test_ls_tells_of_a_host_whose_loggers_are_gone_in_one_line_and_lists_the_others_as_ever(site, capsys) -> None:
    with SimulatedRobots(site.desk, ["rob1"]):
        with SimulatedRobots(site.desk, ["rob4"], LEGS):
            wait_until(lambda: listed(capsys, site.desk)[1].count("\n") == 5)
        code, out, err = wait_until(lambda: (now := listed(capsys, site.desk))[1].count("\n") == 2 and now)
        assert code == 0
        assert "rob1" in out
        assert "rob4: 3 loggers closed or unreachable, last seen " in err
        assert "rob1" not in err
        *_, gone = wait_until(lambda: run(["--config", site.desk, "ls", "--json"]) == 0 and [capsys.readouterr().out])
        assert gone.count('"silent"') == 3
        assert listed(capsys, site.desk, "rob1/*")[2] == ""


@pytest.mark.slow
def test_ls_that_sees_nobody_any_more_tells_who_was_there(site, capsys) -> None:
    with SimulatedRobots(site.desk, ["rob1"]):
        wait_until(lambda: listed(capsys, site.desk)[0] == 0)
    code, out, err = wait_until(lambda: (now := listed(capsys, site.desk))[0] and now)
    assert (code, out) == (codes.EXIT_NO_LOGGER, "")
    assert "/anymal: closed or unreachable, last seen " in err
    assert "no robot is connected to this router now" in err


@pytest.mark.slow
def test_of_one_that_went_while_somebody_followed_ls_says_since_when(site, capsys) -> None:
    with Fleet(site.desk) as fleet:
        robot = SimulatedRobot(site.desk, "rob1")
        waited(fleet, "anymal", lambda one: one.here)
        robot.close()
        waited(fleet, "anymal", lambda one: one.lost)
    assert f"{robot.root.address}: unreachable since " in listed(capsys, site.desk)[2]


@pytest.mark.slow
def test_one_that_goes_at_the_first_look_is_noted_as_well(site, monkeypatch) -> None:
    take, tried = FleetLink._take_tokens, list[bool]()

    def taken(link: FleetLink, *given: object) -> None:
        tried.append(link._name in link._told._tried)
        take(link, *given)

    monkeypatch.setattr(FleetLink, "_take_tokens", taken)
    with SimulatedRobots(site.desk, ["rob1"]), Fleet(site.desk):
        wait_until(lambda: tried)
    assert tried[0]


@pytest.mark.slow
def test_one_that_is_closed_while_somebody_follows_is_forgotten(site, served, capsys) -> None:
    with Fleet(site.desk) as fleet:
        waited(fleet, "walker", lambda one: one.summary)
        wait_until(lambda: remembered(site.desk))
        served.close()
        waited(fleet, "walker", lambda one: one.closed and not one.here)
    assert remembered(site.desk) == []
    assert "walker" not in listed(capsys, site.desk)[2]


@pytest.mark.slow
def test_one_that_was_started_again_is_not_missed(site, capsys) -> None:
    for drawn in ("aaaa000001", "aaaa000002"):
        robot = SimulatedRobot(site.desk, "rob1", drawn=drawn)
        try:
            with SimulatedRobots(site.desk, ["other"]):
                wait_until(lambda: listed(capsys, site.desk)[1].count("rob1") == 1)
        finally:
            robot.close()
    assert [one.found.id for one in remembered(site.desk)].count("aaaa000001") == 0


@pytest.mark.slow
def test_who_begins_to_follow_takes_nobody_who_is_there_for_one_that_is_gone(site) -> None:
    with SimulatedRobots(site.desk, ["rob1"]):
        with Fleet(site.desk) as fleet:
            # what was behind a way before is replaced once that was tried
            wait_until(lambda: fleet.now().ready and fleet.now().members)
        assert remembered(site.desk)
        with Fleet(site.desk) as fleet:
            number, words = -1, set()
            while not fleet.now().ready:
                found = fleet.wait(number, 1.0)
                number = found.number
                words |= {one.lost for one in found.members}
        assert words == {False}


@pytest.mark.slow
def test_who_looks_anew_in_silo_tui_forgets_them(site) -> None:
    with SimulatedRobots(site.desk, ["rob1"]), Fleet(site.desk) as fleet:
        wait_until(lambda: fleet.now().ready and fleet.now().members)
    with Fleet(site.desk) as fleet:
        waited(fleet, "anymal", lambda one: one.lost)  # seen to go, where the router still told of it as this one came
        fleet.look_again()
        wait_until(lambda: not fleet.now().members)
    assert remembered(site.desk) == []


# ------------------------------------------------------------------------------------------------------------ the file


@pytest.fixture
def desk(runtime_folder: Path, tmp_path: Path) -> str:
    path = tmp_path / "desk.json5"
    path.write_text("{}")
    return str(path)


def there(config: str, host: str, **more) -> Member:
    return Member(LoggerAddress.behind(config, Root(host, "anymal", "aaaa000001")), seen_s=time.monotonic(), **more)


def test_the_file_is_for_this_user_alone_and_holds_so_many(desk, monkeypatch) -> None:
    monkeypatch.setattr(memory, "MOST", 3)
    remember([desk], [there(desk, f"rob{place}") for place in range(9)])
    assert len(remembered(desk)) == 3
    assert stat.S_IMODE((runtime_dir() / NAME).stat().st_mode) == 0o600


def test_configurations_keep_their_loggers_apart_whatever_their_file_is_called(desk, tmp_path, monkeypatch) -> None:
    other = tmp_path / "other.json5"
    other.write_text("{}")
    remember([desk], [there(desk, "rob1")])
    remember([str(other)], [])
    monkeypatch.chdir(tmp_path)
    assert [one.found.host for one in remembered("desk.json5")] == ["rob1"]
    assert remembered(str(other)) == []


def test_one_that_went_unseen_is_remembered_for_a_shorter_time_than_one_that_was_lost(desk, monkeypatch) -> None:
    lost = there(desk, "rob2", here=False, since_s=time.monotonic())
    remember([desk], [there(desk, "rob1"), lost])
    assert [one.unwatched for one in remembered(desk)] == [False, True]
    for later_s, hosts in ((memory.GONE_S, ["rob2"]), (memory.LOST_S, [])):
        now_ns = time.time_ns() + int(later_s * 1e9)
        monkeypatch.setattr(memory.time, "time_ns", lambda now_ns=now_ns: now_ns)
        assert [one.found.host for one in remembered(desk)] == hosts
        monkeypatch.undo()


def test_since_when_one_is_gone_is_remembered_by_the_clock(desk, monkeypatch) -> None:
    now_s = time.monotonic()
    gone = there(desk, "rob1", here=False, since_s=now_s - 60.0)
    remember([desk], [replace(gone, seen_s=now_s - 90.0)])
    (one,) = remembered(desk)
    assert (one.seen_s, one.since_s) == (pytest.approx(now_s - 90.0, abs=5.0), pytest.approx(now_s - 60.0, abs=5.0))
    assert (one.problem, one.here, one.found) == ("it can't be reached", False, gone.found)
    assert (memory.GONE_S, memory.LOST_S) == (2 * 3600, 12 * 3600)  # as the guide says


@pytest.mark.parametrize("text", ["", "[{}]", '{"a": 1}', "\0"])
def test_a_file_that_was_damaged_is_no_reason_not_to_look(desk, text) -> None:
    (runtime_dir() / NAME).write_text(text)
    assert remembered(desk) == []
    remember([desk], [there(desk, "rob1")])
    assert len(remembered(desk)) == 1


def test_dead_and_closed_ones_are_not_missed(desk) -> None:
    dead = there(desk, "rob1", here=False, summary=Summary(state=State.DEAD))
    closed = there(desk, "rob2", here=False, summary=Summary(state=State.STOPPED, closed=True))
    remember([desk], [dead, closed])
    assert remembered(desk) == []


def test_lines_of_those_that_are_gone_are_one_for_a_host_of_several() -> None:
    now_s, now_ns = 1000.0, 10**18
    at = time.strftime("%H:%M:%S", time.localtime(now_ns / 1e9 - 75))
    legs = [
        Member(LoggerAddress(f"leg{n}", 0, "", "", "lab", "rob4", id="aa"), here=False, since_s=925.0 + n)
        for n in (0, 1)
    ]
    single = Member(
        LoggerAddress("anymal", 0, "", "", "lab", "rob1", id="bb"), here=False, since_s=925.0, unwatched=True
    )
    assert lost_lines([*legs, single], now_s, now_ns) == [
        f"rob4: 2 loggers unreachable since {at}",
        f"rob1~bb/anymal: closed or unreachable, last seen {at}",
    ]

"""`silo ls --follow`: what is printed, in place on a terminal, one line per change elsewhere."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import msgspec
import pytest

from silo.cli.loggers.follow import changed, meant, screen_lines, sentence, told_lines
from silo.core.elements import State
from silo.fleet.fleet import FleetNow
from silo.fleet.member import Member
from silo.net.found import LoggerAddress
from silo.net.session import close, open_router
from silo.rpc.published import Summary
from tests.stand_ins.simulated_robots import SimulatedRobots
from tests.thin_net import free_port

NOW_S, NOW_NS = 1000.0, 10**18
FINE = Summary(
    state=State.RUNNING, frequency_hz=400.0, measured_hz=400.0, started_ns=NOW_NS - 12 * 10**9, clients=["ann@desk 7"],
    disk_free_bytes=40 * 10**9, disk_bytes=100 * 10**9,
)  # fmt: skip


def member(host: str, *, here: bool = True, **told) -> Member:
    found = LoggerAddress("anymal", 0, "", "", "lab", host, id="aaaa000001")
    return Member(found, msgspec.structs.replace(FINE, **told), here, since_s=NOW_S - 75)


def fleet(*members: Member) -> FleetNow:
    return FleetNow(1, members)


def test_lines_on_a_terminal_say_how_each_stands_the_worst_first() -> None:
    found = fleet(member("rob1"), member("rob2", here=False), member("rob3", alarm="HH", alarms=2, lost=4))
    head, *rows, total = screen_lines(found, meant(found, ""), 20, NOW_S, NOW_NS)
    assert head.split() == ["LOGGER", "STATE", "FOR", "HZ", "LOST", "FREE", "!", "SEEN", "WHO"]
    assert [row.split() for row in rows] == [
        ["rob2/anymal", "silent", "-", "-", "0", "40", "GB", "~~", "01:15", "ago", "was", "running"],
        ["rob3/anymal", "running", "00:12", "400", "4", "40", "GB", "HH", "2", "now", "ann@desk"],
        ["rob1/anymal", "running", "00:12", "400", "0", "40", "GB", "now", "ann@desk"],
    ]
    assert total == "3 loggers: 1 silent, 2 running; Ctrl-C ends"


@pytest.mark.parametrize(
    ("lost", "cell", "words"), [(0, "-", "dead  40 GB free"), (4, "4", "dead  lost 4  40 GB free")]
)
def test_what_a_dead_program_lost_is_told_only_where_it_is_known(lost, cell, words) -> None:
    found = fleet(died := member("rob1", state=State.DEAD, lost=lost))
    assert screen_lines(found, meant(found, ""), 20, NOW_S, NOW_NS)[1].split()[4] == cell
    assert sentence(died).startswith(words)


@pytest.mark.parametrize("room", [4, 10, 23])
def test_there_are_never_more_lines_than_the_terminal_has_and_what_is_left_out_is_told(room) -> None:
    found = fleet(*(member(f"rob{place:02}", lost=int(place == 29)) for place in range(30)))
    lines = screen_lines(found, meant(found, ""), room, NOW_S, NOW_NS)
    assert len(lines) == room
    assert lines[1].startswith("rob29/anymal")
    assert lines[-2] == f"and {30 - (room - 3)} more that are no worse"


def test_a_pattern_chooses() -> None:
    found = fleet(member("rob1"), member("rob2"), member("spot"))
    assert [one.found.host for one in meant(found, "rob*/anymal")] == ["rob1", "rob2"]
    assert [one.found.host for one in meant(found, "spot/anymal")] == ["spot"]


def test_a_line_is_printed_for_what_changes_and_not_for_what_wavers() -> None:
    known: dict = {}

    def told(one: Member) -> list[str]:
        return [name for name, _ in changed(fleet(one), [one], known)]

    assert told(member("rob1")) == ["rob1/anymal"]
    assert told(member("rob1", measured_hz=401.0, ticks=9, disk_free_bytes=39 * 10**9)) == []
    assert told(member("rob1", lost=1)) == ["rob1/anymal"]
    assert told(member("rob1", lost=1, measured_hz=300.0)) == ["rob1/anymal"]
    assert told(member("rob1", lost=1, here=False)) == ["rob1/anymal"]


def test_what_was_denied_is_told_when_it_is_more_and_not_when_an_hour_has_passed() -> None:
    known: dict = {}

    def told(denied: int) -> bool:
        one = member("rob1", denied=denied)
        return any(changed(fleet(one), [one], known))

    assert [told(denied) for denied in (0, 3, 3, 1, 2)] == [True, True, False, False, True]
    denied = fleet(member("rob1", denied=3))
    assert "DENIED 3" in sentence(denied.members[0])
    assert "DENIED 3" in screen_lines(denied, meant(denied, ""), 20, NOW_S, NOW_NS)[1]


def test_a_change_in_words() -> None:
    assert sentence(member("rob1", lost=2, alarm="H", alarms=1)) == "running  400 Hz  lost 2  40 GB free  H 1  ann@desk"
    assert sentence(member("rob1", here=False)).startswith("silent, was running")
    assert sentence(Member(LoggerAddress("x", 0, "", ""), problem="gives no\nanswer")) == "no answer: gives no answer"


@pytest.mark.slow
def test_in_a_pipe_each_change_is_a_line_until_ctrl_c(tmp_path) -> None:
    endpoints = [f"tcp/127.0.0.1:{free_port()}"]
    (tmp_path / "router.json5").write_text(json.dumps({"listen": {"endpoints": endpoints}}))
    desk = tmp_path / "desk.json5"
    desk.write_text(json.dumps({"connect": {"endpoints": endpoints}}))
    router, _ = open_router(str(tmp_path / "router.json5"))
    program = "from silo.cli import main; main()"
    command = [sys.executable, "-c", program, "--config", str(desk), "ls", "--follow", "--json", "rob1/*"]
    try:
        with SimulatedRobots(str(desk), ["rob1", "rob2"]) as made:
            process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[2])
            first = json.loads(process.stdout.readline())
            assert (first["address"], first["state"], first["here"]) == ("rob1/anymal", "running", True)
            made.robots[1].lost = 7  # nobody asked for that one
            made.robots[0].lost = 1
            made.robots[0].publish()
            assert json.loads(process.stdout.readline())["lost"] == 1
            made.close()
            gone = json.loads(process.stdout.readline())
            assert (gone["state"], gone["last_state"], gone["here"]) == ("silent", "running", False)
            made.robots = []
        process.send_signal(signal.SIGINT)
        assert process.communicate()[0] == ""
        assert process.returncode == 0
    finally:
        close(router)


def of_one_host(count: int, *, here: bool = True, since_s: float = NOW_S - 75) -> list[Member]:
    return [
        Member(
            LoggerAddress(f"leg{number:02}", 0, "", "", "lab", "rob4", id="aaaa000001"),
            FINE,
            here,
            since_s=since_s + number,
        )
        for number in range(count)
    ]


def test_loggers_of_a_host_whose_link_is_down_are_told_in_one_line_and_stay() -> None:
    since = time.strftime("%H:%M:%S", time.localtime(NOW_NS / 1e9 - 75))
    told = f"rob4: 30 loggers unreachable since {since}"
    found = fleet(member("rob1"), *of_one_host(30, here=False))
    lines = screen_lines(found, meant(found, ""), 10, NOW_S, NOW_NS)
    assert [line.split()[0] for line in lines] == ["LOGGER", "rob1/anymal", "rob4:", "31"]
    assert lines[2] == told
    assert lines[-1] == "31 loggers: 30 silent, 1 running; Ctrl-C ends"
    news = [(one.found.name, one) for one in found.members]
    assert told_lines(news, found.members, NOW_S, NOW_NS) == [told, f"anymal  {sentence(member('rob1'))}"]
    single = fleet(*of_one_host(1, here=False))
    assert told_lines([("leg00", one) for one in single.members], single.members, NOW_S, NOW_NS)[0].startswith(
        "leg00  "
    )

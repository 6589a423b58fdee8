"""A program that is frozen is not one that runs: for how long there was no tick is told wherever its rate is."""

import os
import signal

import msgspec
import pytest

from silo.cli.loggers.ls import _ls_row
from silo.client.client import Client
from silo.core.elements import State, is_stalled
from silo.core.quantities.writing import idle_words
from silo.fleet.member import HELPER_DOWN, NO_ANSWER, Member, Stands
from silo.live.publisher import differs
from silo.net.found import LoggerAddress
from silo.rpc.published import Summary
from tests.waiting import freeze, wait_until

RUNS = Summary(state=State.RUNNING, frequency_hz=5.0)
FOUND = LoggerAddress("walker", 7, "/run/walker.sock", "lab", host="robot3")


@pytest.mark.parametrize(
    ("idle_s", "frequency_hz", "stalled"),
    [(0.0, 400.0, False), (2.9, 400.0, False), (3.0, 400.0, True), (9.0, 0.5, False), (10.0, 0.5, True)],
)
def test_a_logger_that_has_no_tick_for_three_seconds_and_five_periods_is_stalled(idle_s, frequency_hz, stalled) -> None:
    assert is_stalled(idle_s, frequency_hz) is stalled


@pytest.mark.parametrize(("idle_s", "words"), [(14.7, "14 s"), (119.0, "119 s"), (250.0, "4 min"), (9000.0, "2 h")])
def test_the_time_without_a_tick_is_told_in_whole_units(idle_s, words) -> None:
    assert idle_words(idle_s) == f"no tick for {words}"


def test_of_a_fleet_it_stands_before_all_that_answer_and_its_time_goes_on() -> None:
    frozen = Member(FOUND, msgspec.structs.replace(RUNS, idle_s=240.0), told_s=1000.0)
    assert (frozen.word, frozen.sign, frozen.rate) == ("no tick", "!!", "0")
    assert frozen.idle_s(1060.0) == 300.0
    assert Stands.SILENT < frozen.stands < min(Stands.MUTE, Stands.RED)
    assert not Member(FOUND, msgspec.structs.replace(RUNS, idle_s=240.0, state=State.STOPPED)).stalled


def test_a_nominal_rate_is_never_shown_as_a_measured_one() -> None:
    assert Member(FOUND, RUNS).rate == "-"
    assert Member(FOUND, msgspec.structs.replace(RUNS, measured_hz=4.9)).rate == "4.9"


def test_a_summary_tells_at_once_that_ticks_have_stopped_and_come_again_and_not_each_second() -> None:
    frozen = msgspec.structs.replace(RUNS, idle_s=3.5)
    assert differs(RUNS, frozen)
    assert differs(frozen, RUNS)
    assert not differs(frozen, msgspec.structs.replace(RUNS, idle_s=4.5))
    assert not differs(RUNS, msgspec.structs.replace(RUNS, idle_s=1.0))


@pytest.mark.slow
def test_the_time_since_the_last_tick_is_told_until_the_next_one(bench, client) -> None:
    assert client.status().idle_s == 0.0
    client.start()
    bench.ticks(5)
    client.status()
    idle_s = wait_until(lambda: (now := client.status().idle_s) > 0.5 and now)
    with client.view(["/log/x"]) as view:
        wait_until(lambda: (frame := view.frame()) is not None and frame.idle_s > idle_s)
    bench.ticks(1)
    before = client.status().idle_s
    assert before < wait_until(lambda: (now := client.status().idle_s) > before and now)
    client.stop()
    assert client.status().idle_s == 0.0


@pytest.mark.slow
def test_a_frozen_program_is_told_so_and_its_rate_is_no_nominal_one(robots) -> None:
    robot = robots("bot")
    with Client.connect("bot") as client:
        # what a program is in the middle of saying when it is frozen, its start, nobody hears
        wait_until(lambda: client.status().state is State.RUNNING)
        freeze(robot.pid)
        try:
            status = wait_until(lambda: (now := client.status()).idle_s > 3 and now)
            answer = Member(client.found, Summary.of(status), status=status)
            assert answer.stalled
            assert _ls_row(answer)[2].startswith("no tick ")
            assert _ls_row(answer)[4] == "0"
        finally:
            os.kill(robot.pid, signal.SIGCONT)


@pytest.mark.parametrize(("mute", "since"), [(HELPER_DOWN, "02:05"), (NO_ANSWER, "-")])
def test_of_a_logger_that_is_down_is_told_since_when(monkeypatch, mute, since) -> None:
    monkeypatch.setattr("time.time", lambda: 1125.0)
    found = LoggerAddress("arm", 7, "/run/arm.7.sock", "ann", since=1000.0)
    assert _ls_row(Member(found, problem="gone", mute=mute))[:4] == ("arm.7", "-", mute, since)

"""What `silo alarms` prints and ends with, of limits as a client is told of them."""

import json
import time
from types import SimpleNamespace

import pytest

from silo.cli.conditions import alarms
from silo.cli.main import run
from silo.conditions.requests import Alarms
from silo.conditions.standing import LimitStatus, LimitWord
from silo.core.elements import State

HH, H, BLIND, OK = (LimitWord(word) for word in ("HH", "H", "~~", "OK"))
HEAT = LimitStatus(
    "/log/heat", "/log/heat", HH, "K", 9.25, 9.0, 9.5, HH, since_ns=1, count=2, stale_count=1, alarm=True
)
AGAIN = LimitStatus("/log/tau", "/log/tau", OK, "-", 1.0, 4.0, 5.0, H, since_ns=1, last_ns=310_000_001, count=1,
                    seen_by="ann")  # fmt: skip
WELL, DARK = LimitStatus("/log/x", "/log/x", OK), LimitStatus("/log/y", "/log/y", BLIND, why="/log/y is off")


class Robot:
    """Tells of one list of limits after the other; who looks on ends with the last of them."""

    def __init__(self, *told):
        self.told, self.pauses = list(told), []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def acknowledge(self):
        return "2 alarms are acknowledged"

    def status(self):
        return SimpleNamespace(state=State.RUNNING, last_tick_ns=3 * 10**9)

    def alarms(self):
        return Alarms(run="r", tick=7, limits=self.told.pop(0))

    def sleep(self, pause_s):
        self.pauses.append(pause_s)
        if not self.told:
            raise KeyboardInterrupt


@pytest.fixture
def shown(monkeypatch, capsys):
    def show(words, *told):
        robot = Robot(*told)
        monkeypatch.setattr(alarms, "connect", lambda _: robot)
        monkeypatch.setattr(time, "sleep", robot.sleep)
        monkeypatch.setattr(time, "time_ns", lambda: 61 * 10**9 + 1)
        code = run(["alarms", "bot", *words])
        return code, *capsys.readouterr(), robot

    return show


NO_LIMITS = (
    "no limits: log.limit('joints/tau', (-40, -30, 30, 40)) in the program, or in the script\n"
    "signal_limits:\n  - {name: joints/tau, bounds: [-40, -30, 30, 40]}"
)
ONE_JUDGED = "nothing of the 1 that could be judged was beyond its limits"
HEAD = "!   SIGNAL     VALUE  LIMIT   WORST     FOR  COUNT  SEEN BY\n"
HEAT_ROW = "HH  /log/heat   9.25      9  HH 9.5    61 s      3  NEW\n"
AGAIN_ROW = "OK  /log/tau       1      4     H 5  0.31 s      1  ann\n"


@pytest.mark.parametrize(
    ("words", "limits", "code", "text"),
    [
        ([], [], 0, f"{NO_LIMITS}\n"),
        ([], [WELL], 0, "nothing was beyond its limits in this run (1 watched)\n"),
        ([], [HEAT, AGAIN, WELL], 4, f"{HEAD}{HEAT_ROW}{AGAIN_ROW}1 beyond now, 1 well again (3 watched)\n"),
        ([], [HEAT, DARK], 4, "/log/y is blind: /log/y is off\n1 beyond now, 0 well again (2 watched, 1 blind)\n"),
        ([], [DARK], 5, "/log/y is blind: /log/y is off\nnothing was judged in this run (1 watched, 1 blind)\n"),
        ([], [WELL, DARK], 5, f"{ONE_JUDGED} in this run (2 watched, 1 blind)\n"),
        (["--all"], [WELL], 0, "OK  /log/x\nnothing was beyond its limits in this run (1 watched)\n"),
        (["--seen"], [WELL], 0, "2 alarms are acknowledged\nnothing was beyond its limits in this run (1 watched)\n"),
    ],
)  # fmt: skip
def test_a_row_for_each_that_was_beyond_and_a_line_for_all(shown, words, limits, code, text):
    found, out, _, _ = shown(words, limits)
    assert (found, out[-len(text) :]) == (code, text)


def test_what_is_beyond_its_limits_has_been_until_the_newest_tick_of_a_logger_that_was_stopped(shown, monkeypatch):
    monkeypatch.setattr(Robot, "status", lambda _: SimpleNamespace(state=State.STOPPED, last_tick_ns=3 * 10**9))
    assert "  HH 9.5  2 s      3  NEW\n" in shown([], [HEAT])[1]


def test_machines_get_what_was_beyond_or_all(shown):
    code, out, told, _ = shown(["--json", "--seen"], [HEAT, WELL])
    assert (code, told) == (4, "2 alarms are acknowledged\n")
    found = json.loads(out)
    assert (found["run"], found["tick"], [one["name"] for one in found["limits"]]) == ("r", 7, ["/log/heat"])
    assert len(json.loads(shown(["--json", "--all"], [HEAT, WELL])[1])["limits"]) == 2


def test_who_follows_is_told_of_each_change_in_a_line(shown):
    code, out, _, robot = shown(["--follow"], [HEAT, WELL, DARK], [HEAT, WELL, DARK], [AGAIN, WELL])
    heat, dark = "HH /log/heat 9.25 K, worst 9.5 K, 3x\n", "~~ /log/y: /log/y is off\n"
    assert (code, out) == (4, f"{heat}{dark}OK /log/tau 1, worst 5, 1x\n")
    assert robot.pauses == [0.5, 0.5, 0.5]
    assert [json.loads(line)["word"] for line in shown(["-f", "--json"], [HEAT])[1].splitlines()] == ["HH"]

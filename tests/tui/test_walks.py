"""Walks through all screens show, key by key, what they showed before: see `walking`."""

import importlib
import os
import pkgutil
import sys
import time
from dataclasses import replace
from types import SimpleNamespace

import pytest
from msgspec import structs
from textual.widgets import Input

import silo_tui
from silo.conditions.standing import LimitStatus, LimitWord, TriggerStatus
from silo.core.conditions import Derived, TriggerOptions, TriggerWord
from silo.core.elements import RecorderState, State
from silo.files import write
from silo.fleet.member import Member
from silo.live.quantities import FROZEN, LOST, NOT_FINITE
from silo.net.found import LoggerAddress
from silo.recorder.requests import RecorderInfo
from silo.rpc.published import Summary
from silo_tui.app import SiloApp
from silo_tui.layouts import files
from silo_tui.layouts.layout import KeptLayout
from silo_tui.sessions.recorded import open_file
from silo_tui.settings.options import Settings
from tests.stand_ins.fake_logger import FakeClient, FakeFinder
from tests.stand_ins.fake_signals import START_NS
from tests.stand_ins.saved import twenty_seconds
from tests.tui.walking import FOLDER, Walk

pytestmark = [pytest.mark.slow, pytest.mark.through_all]

SECOND = 10**9
NOW_NS = START_NS + 3600 * SECOND
LF = "/log/legs/LF"
STANDING = ("held", "scope", "messages", "loggers", "fleet", "holding", "parameters")  # modules without a stopwatch


def over(name, word, **more):
    values = {"value": 84.2, "limit": 80.0, "worst": 86.31, "worst_word": word, "worst_ns": START_NS + 15 * SECOND,
              "since_ns": START_NS + 14 * SECOND, "count": 2, "bounds": (None, None, 70.0, 80.0)}  # fmt: skip
    return LimitStatus(name, name, word, "Nm", **values, **more)


def robot(logs, *, runs=True):
    """A logger with something of everything."""
    fake = FakeClient()
    if runs:
        fake.run(20)
    fake.derived = (Derived("/log/power", "legs/LF/HAA/torque * legs/LF/HAA/velocity", "W"),)
    fake.lost = 3
    fake.facts = {"signs": {"/log/imu/temperature": NOT_FINITE, "/log/base/velocity": FROZEN, f"{LF}/HFE/torque": LOST},
                  "bad": {"/log/imu/temperature": 7.0}, "share": {f"{LF}/HFE/torque": 0.5}}  # fmt: skip
    fall = TriggerOptions("fall", "abs(legs/LF/HAA/torque) > 30", 5.0, 1.0)
    fake.trigger_statuses = [
        TriggerStatus(fall, TriggerWord.FIRING, 3, 3, 7600, NOW_NS - 400_000_000),
        TriggerStatus(structs.replace(fall, name="slip"), TriggerWord.ARMED, 17, 9, 7, NOW_NS - 120 * SECOND),
        TriggerStatus(structs.replace(fall, name="low"), TriggerWord.BLIND, why="/log/x is off"),
    ]
    fake.limit_statuses = [
        over(f"{LF}/HAA/temperature", LimitWord.RED_HIGH, alarm=True),
        over("/log/imu/temperature", LimitWord.YELLOW_LOW, seen_by="op1@desk"),
        LimitStatus("/log/x", "/log/x", LimitWord.BLIND, why="it is off"),
    ]
    fake.recorder_infos = [
        RecorderInfo("walk", "/home/ann/logs/walks", RecorderState.RECORDING, ["legs/*/*/torque"], 10**9, 0.0,
                     50 * 10**9, "walk_3.mcap", 20, 21 * 10**9, 1000, 0, NOW_NS - 9067 * SECOND),
        RecorderInfo("imu", "/home/ann/logs/recordings", RecorderState.FAILED, ["imu"], parts=12, lost=3,
                     since_ns=NOW_NS - SECOND, text="1.9 GB disk left"),
    ]  # fmt: skip
    for at_s, kind, text in (
        (1, "started", "started"), (4, "marker", "push 3"), (6, "triggered", "fall fired"),
        (9, "marker", 'episode "walk" begin'), (12, "marker", 'episode "walk" end good'), (15, "edited", "4 edits"),
    ):  # fmt: skip
        fake.happen(kind, text, START_NS + at_s * SECOND, "op1@desk")
    trigger = "triggers:\n  - name: fall\n    when: abs(legs/LF/HAA/torque) > 0.6\n    pre_s: 5\n"
    fake.files["walk.yaml"] = fake.files["robot.yaml"].replace("divider: 40", "divider: 20") + trigger
    fake.logs, listed, status = logs, fake.recordings, fake.status
    fake.status = lambda: structs.replace(status(), room_bytes=256 * 10**6)
    fake.recordings = lambda most=1000: structs.replace(listed(most), disk_bytes=256 * 10**9, free_bytes=48 * 10**9)
    for place, (name, why) in enumerate([("arm_2_00003", "saved by bob@lab"), ("robot_20260921_14-00-00_00006", "died"),
                                         ("robot_20260921_14-00-00_00007_fall_3", "trigger fall")]):  # fmt: skip
        (file,) = write(twenty_seconds(100 * place), logs, name.partition("_")[0], ["silo"], name, why=why)
        os.utime(file.path, ns=(START_NS + place, START_NS + place))
    return fake


def live(folder, **options):
    return SiloApp(FakeFinder(robot(folder / "logs")), **options)


def folded(folder, **options):
    shown = KeptLayout("tree", set="statistics", folded=("/legs/RF", "/legs/LH", "/legs/LF/HFE"))
    files.save(files.place("walk"), shown)
    return live(folder, view="walk", **options)


def stopped(folder, **options):
    return SiloApp(FakeFinder(robot(folder / "logs", runs=False)), **options)


def file(folder, **options):
    write(twenty_seconds(), folder / "logs", "robot", ["silo"], "robot_20260921_14-00-00_00007")
    return SiloApp(FakeFinder(), file=open_file(folder / "logs" / "robot_20260921_14-00-00_00007.silo"), **options)


def runs(folder, **options):
    for number in range(3):
        write(twenty_seconds(3600 * number, number + 1), folder / "logs", "robot", ["silo"], f"run{number}")
    return live(folder / "others", **options)


def fleet(folder, **options):
    fine = Summary(
        state=State.RUNNING, frequency_hz=400.0, measured_hz=400.0, ticks=118_024, started_ns=NOW_NS - 330 * SECOND,
        disk_free_bytes=40 * 10**9, disk_bytes=256 * 10**9, clients=["ann@desk silo-tui 7"],
    )  # fmt: skip
    told = {
        "anymal": {"alarm": "HH", "alarms": 3, "lost": 12, "control": "ann@desk silo-tui 7"}, "arm": {},
        "dog": {"state": State.DEAD, "reason": "the robot program (process 7) ended without close(); saved 9.8 MB"},
        "legs": {"measured_hz": 301.0}, "spot": {"disk_free_bytes": 4 * 10**9, "state": State.STOPPED},
    }  # fmt: skip
    finder = FakeFinder(*(FakeClient(name=name).run() for name in told))
    finder.members = {
        name: Member(LoggerAddress(name, 1, "", "ann"), structs.replace(fine, **more)) for name, more in told.items()
    }
    return SiloApp(finder, **options)


@pytest.fixture
def standing(monkeypatch):
    """Clocks that stand, in Greenwich, wherever what is shown depends on them."""
    wall = {"time": lambda: NOW_NS / SECOND, "time_ns": lambda: NOW_NS}
    kept = {"strftime": time.strftime, "localtime": time.localtime, "sleep": time.sleep}
    for module in pkgutil.walk_packages(silo_tui.__path__, "silo_tui."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
    for name, module in list(sys.modules.items()):
        if name.startswith("silo_tui.") and getattr(module, "time", None) is time:
            stands = name.rpartition(".")[2] in STANDING
            clock = SimpleNamespace(**wall, **kept, monotonic=(lambda: 1000.0) if stands else time.monotonic)
            monkeypatch.setattr(module, "time", clock)
    monkeypatch.setattr("silo_tui.model.lists.recorders.RATE_S", 1e9)
    monkeypatch.setattr(Input, "_toggle_cursor", lambda _: None)  # it blinks
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    yield
    monkeypatch.delenv("TZ")
    time.tzset()


@pytest.mark.parametrize("name", sorted(path.stem for path in FOLDER.glob("*.txt")))
async def test_a_walk(name, screen_of, standing, tmp_path, monkeypatch):
    walk = Walk(name)
    begins, size, *settings = walk.head.split()
    if "NO_COLOR" in settings:
        settings.remove("NO_COLOR")
        monkeypatch.setenv("NO_COLOR", "1")
    app = globals()[begins](tmp_path, settings=replace(Settings(), **dict(one.split("=") for one in settings)))
    columns, lines = map(int, size.split("x"))
    async with screen_of(app, (columns, lines)) as screen:
        await walk.through(screen)

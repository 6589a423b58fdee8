"""Pictures of the main screens; the facts on them are pinned elsewhere, these guard the look."""

import time
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from silo.conditions.standing import LimitStatus, LimitWord, TriggerStatus
from silo.core.conditions import TriggerOptions, TriggerWord
from silo.core.elements import BufferType, Entry, FileType, RecorderState, State
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.files.silo.writer import write_silo
from silo.fleet.member import Member
from silo.live.quantities import FROZEN, NOT_FINITE
from silo.net.found import LoggerAddress
from silo.recorder.requests import RecorderInfo
from silo.recordings.requests import RecordingFile, Recordings, SavedRecording
from silo.rpc.published import Summary
from silo_tui.app import SiloApp
from silo_tui.layouts import files
from silo_tui.layouts.layout import KeptLayout
from silo_tui.sessions.recorded import open_file
from silo_tui.settings.options import Settings
from tests.stand_ins.fake_signals import START_NS
from tests.waiting import DEADLINE_S

STEADY_LOOKS = 10
pytestmark = pytest.mark.slow


def text_of(app):
    return ["".join(segment.text for segment in line) for line in app.screen._compositor.render_strips()]


async def settle(pilot, ready=lambda app: True):
    """Wait until it is ready and draws the same again and again; the fake's clock stands."""
    deadline = time.monotonic() + DEADLINE_S
    same, before = 0, []
    while same < STEADY_LOOKS:
        assert time.monotonic() < deadline, before
        await pilot.pause()
        now = text_of(pilot.app)
        same = same + 1 if now == before and ready(pilot.app) else 0
        before = now


def table_is_live(app):
    return app.context.has_session and bool(app.context.session.live.readings) and not app.context.session.columns.empty


def readings_are_there(app):
    return app.context.has_session and bool(app.context.session.live.readings)


@pytest.mark.parametrize("size", [(80, 24), (120, 40), (160, 50)], ids="{0[0]}x{0[1]}".format)
def test_the_table(fake, new_finder, snap_compare, size):
    fake.run()

    async def steps(pilot):
        await settle(pilot, table_is_live if size[0] > 80 else readings_are_there)
        await pilot.press("j", "space", "t", "j", "d", "5", "enter")
        await settle(pilot)

    assert snap_compare(SiloApp(new_finder(fake)), terminal_size=size, run_before=steps)


def test_the_table_without_colours(fake, new_finder, snap_compare, monkeypatch):
    monkeypatch.setenv("NO_COLOR", "1")
    fake.run()

    async def steps(pilot):
        await settle(pilot, readings_are_there)
        await pilot.press("j", "space", "t", "j", "d", "5", "enter")
        await settle(pilot)

    assert snap_compare(SiloApp(new_finder(fake)), terminal_size=(80, 24), run_before=steps)


def test_the_monitor(fake, new_finder, snap_compare):
    fake.run(20)

    async def steps(pilot):
        await settle(pilot, readings_are_there)
        await pilot.press("slash", "L", "F", "space", *"torque", "enter", "asterisk", "m")
        await settle(pilot, lambda app: not app.screen.stack.store.empty)

    assert snap_compare(SiloApp(new_finder(fake)), terminal_size=(120, 40), run_before=steps)


@pytest.fixture
def still(monkeypatch):
    """A wall clock that stands, in Greenwich."""
    now_ns = START_NS + 3600 * 10**9
    clock = SimpleNamespace(time=lambda: now_ns / 1e9, time_ns=lambda: now_ns, monotonic=time.monotonic)
    for module in ("recordings", "recorders", "conditions"):
        monkeypatch.setattr(f"silo_tui.model.lists.{module}.time", clock)
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    yield now_ns
    monkeypatch.delenv("TZ")
    time.tzset()


def by_keys(ready, *keys):
    """Press keys once values are there, and wait until what they lead to is."""

    async def steps(pilot):
        await settle(pilot, readings_are_there)
        await pilot.press(*keys)
        await settle(pilot, lambda app: any(ready in line for line in text_of(app)))

    return steps


def typed(line):
    names = {" ": "space", ".": "full_stop"}
    return ["colon", *(names.get(char, char) for char in line), "enter"]


def test_recordings(fake, new_finder, snap_compare, still, monkeypatch):
    fake.run()
    told = (
        ("robot_20260921_14-00-00_00007_fall_3", "trigger fall", 6.0, 1_900_000, 2, (FileType.SILO, FileType.BAG)),
        ("robot_20260921_14-00-00_00007", "saved by op1", 300.0, 41_200_000, 0, (FileType.SILO,)),
        ("robot_20260921_14-00-00_00006", "program died: killed, -9", 25.0, 9_800_000, 0, (FileType.SILO,)),
    )
    rows = [
        SavedRecording(stem, [RecordingFile(f"{stem}.{kind.name.lower()}", kind, size, still) for kind in kinds],
                       still - place * 10**12, span_s, why, "robot", marks, own=True)
        for place, (stem, why, span_s, size, marks, kinds) in enumerate(told)
    ]  # fmt: skip
    listed = Recordings("/home/ann/logs", rows, 3, 256 * 10**9, 48 * 10**9)
    monkeypatch.setattr(fake, "recordings", lambda most=1000: listed)
    fake.recorder_infos = [
        RecorderInfo("all", "/home/ann/logs/endless", RecorderState.WAITING, [], 10**9, 0.0, 50 * 10**9, "x", 20,
                     21 * 10**9, since_ns=still - 9067 * 10**9),
        RecorderInfo("imu", "/home/ann/logs/recordings", RecorderState.FAILED, ["imu"], parts=12, lost=3,
                     since_ns=still - 10**9, text="1.9 GB disk left"),
    ]  # fmt: skip
    monkeypatch.setattr("silo_tui.model.lists.recorders.RATE_S", 1e9)
    steps = by_keys("1.9 GB disk left", "F")
    assert snap_compare(SiloApp(new_finder(fake)), terminal_size=(80, 24), run_before=steps)


def test_triggers(fake, new_finder, snap_compare, still):
    fake.run()
    fall = TriggerOptions("fall", "abs(base/roll) > 0.6", 5.0, 1.0)
    fake.trigger_statuses = [
        TriggerStatus(fall, TriggerWord.FIRING, 3, 3, 7, still - 400_000_000),
        TriggerStatus(msgspec.structs.replace(fall, name="slip"), TriggerWord.ARMED, 17, 9, 7, still - 120 * 10**9),
        TriggerStatus(msgspec.structs.replace(fall, name="low"), TriggerWord.BLIND, why="/log/x is off"),
    ]
    steps = by_keys("low", "T")
    assert snap_compare(SiloApp(new_finder(fake)), terminal_size=(80, 24), run_before=steps)


def over(name, word, now_ns, **more):
    return LimitStatus(name, name, word, "Nm", 84.2, 80.0, 86.31, word, since_ns=now_ns - 12 * 10**9, count=2, **more)


def test_alarms(fake, new_finder, snap_compare, still):
    fake.run()
    fake.limit_statuses = [
        over("/log/legs/LF/HAA/temperature", LimitWord.RED_HIGH, still, alarm=True),
        over("/log/imu/temperature", LimitWord.YELLOW_LOW, still, seen_by="op1@desk"),
        LimitStatus("/log/x", "/log/x", LimitWord.BLIND, why="it is off"),
    ]
    steps = by_keys("3 limits", "A")
    assert snap_compare(SiloApp(new_finder(fake)), terminal_size=(80, 24), run_before=steps)


def test_the_fleet(new_fake, new_finder, snap_compare, still, monkeypatch):
    clock = SimpleNamespace(time=lambda: still / 1e9, time_ns=lambda: still, monotonic=lambda: 1000.0)
    for module in ("model.lists.fleet", "screens.lists.loggers"):
        monkeypatch.setattr(f"silo_tui.{module}.time", clock)
    fine = Summary(
        state=State.RUNNING, frequency_hz=400.0, measured_hz=400.0, ticks=118_024, started_ns=still - 330 * 10**9,
        disk_free_bytes=40 * 10**9, disk_bytes=256 * 10**9, clients=["ann@desk silo-tui 7"],
    )  # fmt: skip
    told = (
        ("anymal", {"alarm": "HH", "alarms": 3, "lost": 12, "control": "ann@desk silo-tui 7"}), ("arm", {}),
        ("dog", {"state": State.DEAD, "reason": "the robot program (process 7) ended without close(); saved 9.8 MB"}),
        ("legs", {"measured_hz": 301.0}), ("spot", {"disk_free_bytes": 4 * 10**9, "state": State.STOPPED}),
    )  # fmt: skip
    finder = new_finder(*(new_fake(name=name) for name in ("gone", *(name for name, _ in told))))
    lost = Member(LoggerAddress("gone", 1, "", "ann", host="rob5"), fine, here=False, since_s=1000.0 - 14)
    finder.members = {"gone": lost} | {
        name: Member(LoggerAddress(name, 1, "", "ann"), msgspec.structs.replace(fine, **more)) for name, more in told
    }

    async def steps(pilot):
        await settle(pilot, lambda app: any("SILENT" in line for line in text_of(app)))
        await pilot.press("j", "space", "space")
        await settle(pilot, lambda app: any("2 marked" in line for line in text_of(app)))

    assert snap_compare(SiloApp(finder), terminal_size=(80, 24), run_before=steps)


def test_events(fake, new_finder, snap_compare, still):
    fake.run()
    for seconds, kind, text in ((1, "started", "started"), (4, "marker", "push 3"), (6, "triggered", "fall fired")):
        fake.happen(kind, text, fake.started_ns + seconds * 10**9, "op1@desk")
    steps = by_keys("push 3", "E")
    assert snap_compare(SiloApp(new_finder(fake)), terminal_size=(80, 24), run_before=steps)


def test_the_apply_dialog(fake, new_finder, snap_compare, monkeypatch):
    fake.run()
    status = fake.status
    monkeypatch.setattr(fake, "status", lambda: msgspec.structs.replace(status(), room_bytes=256 * 10**6))
    steps = by_keys("available", "asterisk", *typed("set div=5 size=9000"), "a")
    assert snap_compare(SiloApp(new_finder(fake)), terminal_size=(80, 24), run_before=steps)


def test_the_difference_of_a_script(fake, new_finder, snap_compare):
    fake.run()
    trigger = "triggers:\n  - name: fall\n    when: abs(base/roll) > 0.6\n    pre_s: 5\n"
    fake.files["walk.yaml"] = fake.files["robot.yaml"].replace("divider: 40", "divider: 20") + trigger
    steps = by_keys("trigger fall", *typed("load walk.yaml"))
    assert snap_compare(SiloApp(new_finder(fake)), terminal_size=(80, 24), run_before=steps)


def test_a_view_of_folded_branches_with_their_signs(fake, new_finder, snap_compare, still):
    fake.run()
    fake.facts = {"signs": {"/log/imu/temperature": NOT_FINITE, "/log/base/velocity": FROZEN}}
    fake.limit_statuses = [over("/log/legs/LF/HAA/torque", LimitWord.RED_HIGH, still)]
    files.save(
        files.place("walk"), KeptLayout("tree", set="statistics", folded=("/legs/RF", "/legs/LH", "/legs/LF/HFE"))
    )
    steps = by_keys("HH 1 of 16")
    assert snap_compare(SiloApp(new_finder(fake), view="walk"), terminal_size=(80, 24), run_before=steps)


TORQUE = ["slash", *"HAA", "space", *"torque", "enter", "m"]


def plotted(app):
    return not app.screen.stack.store.empty


async def to_plots(pilot, *keys):
    await settle(pilot, readings_are_there)
    await pilot.press(*TORQUE)
    await settle(pilot, plotted)
    await pilot.press(*keys)


@pytest.mark.parametrize(
    ("keys", "ready"),
    [
        (("enter",), "Tab"),  # large
        (("space", "f"), "highest"),
        (("c", "exclamation_mark"), "SCOPE"),
        (("f2",), "theme"),
        (("question_mark",), "silo help"),
    ],
    ids=["large", "find", "scope", "settings", "help"],
)
def test_what_opens_over_plots(fake, new_finder, snap_compare, still, monkeypatch, keys, ready):
    fake.run(20)
    for module in ("sessions.pause", "screens.plots.scope"):  # how long it stands still, or waits
        monkeypatch.setattr(f"silo_tui.{module}.time", SimpleNamespace(monotonic=lambda: 0.0))

    async def steps(pilot):
        await to_plots(pilot, *keys)
        await settle(pilot, lambda app: any(ready in line for line in text_of(app)))

    assert snap_compare(SiloApp(new_finder(fake)), terminal_size=(80, 24), run_before=steps)


@pytest.mark.parametrize("theme", ["light", "16"])
def test_plots_in_other_colours(fake, new_finder, snap_compare, theme):
    fake.run(20)
    settings = Settings(theme=theme)

    async def steps(pilot):
        await to_plots(pilot)
        await settle(pilot)

    assert snap_compare(SiloApp(new_finder(fake), settings=settings), terminal_size=(80, 24), run_before=steps)


def test_a_saved_log(tmp_path, new_finder, snap_compare):
    seconds = np.arange(4000) / 400
    signals = {"legs/LF/torque": 30 * np.sin(seconds), "legs/LF/contact": np.sin(9 * seconds) > 0, "base/roll": seconds}
    elements = tuple(
        RecordedElement(
            f"/log/{name}", "Nm" if "torque" in name else "-", "scalar", (), 1, BufferType.LOOPING, 0,
            (RecordedEntry(f"/log/{name}", Entry("", values.dtype.str), values),),
        )
        for name, values in signals.items()
    )  # fmt: skip
    times = START_NS + 2_500_000 * np.arange(4000, dtype=np.int64)
    path = tmp_path / "robot_00007.silo"
    write_silo(Recording("robot", times, 4000, elements, frequency_hz=400.0, started_ns=START_NS), path)

    async def steps(pilot):
        await settle(pilot)
        await pilot.press("j", "space")
        await settle(pilot)

    assert snap_compare(SiloApp(new_finder(), file=open_file(path)), terminal_size=(80, 24), run_before=steps)

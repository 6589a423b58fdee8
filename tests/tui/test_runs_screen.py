"""The runs of a folder on the screen: what the index knows, narrowed, ordered, opened, over each other."""

import threading
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

import silo
from silo.analysis.compare import compare
from silo.analysis.log import Log
from silo.core.elements import BufferType, Entry, LoggedEvent, Stretch
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.errors import ElementError
from silo.files import write
from silo.run_index.facts import RunFacts
from silo.run_index.listed import ListedRun
from silo_tui.app import SiloApp
from silo_tui.model.lists import runs
from silo_tui.model.lists.runs import together
from silo_tui.screens.dialogs.questions import Choice, Question
from silo_tui.screens.files.file_table import FileTableScreen
from silo_tui.screens.lists import runs as runs_screen
from silo_tui.screens.lists.runs import ComparisonScreen, RunsScreen
from tests.stand_ins.saved import cut_in_two, recorded_in_two
from tests.waiting import DEADLINE_S

pytestmark = pytest.mark.slow  # each walks through the whole app

SECOND = 10**9
BEGIN = 1_790_000_000 * SECOND


def run_of(number, seconds=3, mark_s=1.0):
    """A run of 100 Hz whose torque is the seconds since its start, times its number, with a mark."""
    time_ns = BEGIN + number * 3600 * SECOND + np.arange(100 * seconds + 1, dtype=np.int64) * SECOND // 100
    entry = RecordedEntry("/log/tau", Entry("", "<f8"), (number + 1) * np.arange(len(time_ns)) / 100)
    tau = RecordedElement(entry.name, "Nm", "scalar", (), 1, BufferType.LOOPING, 0, (entry,))
    tick = round(mark_s * 100)
    events = [LoggedEvent("marker", "push", int(time_ns[tick]), tick, int(time_ns[tick])),
              LoggedEvent("marker", 'episode "walk" begin', int(time_ns[tick]), tick),
              LoggedEvent("marker", 'episode "walk" end good', int(time_ns[-1]), len(time_ns) - 1)]  # fmt: skip
    return Recording("robot", time_ns, len(time_ns), [tau], events=tuple(events), about={"task": f"gait{number}"})


@pytest.fixture
def folder(tmp_path):
    for number in range(3):
        write(run_of(number, mark_s=0.5 * (number + 1)), tmp_path / "logs", "robot", ["silo"], f"run{number}")
    return tmp_path / "logs"


async def test_a_recording_of_several_files_is_one_run_and_opens_whole(fake, opened, tmp_path):
    recorded_in_two(tmp_path)
    async with opened(fake) as screen:
        await screen.press(":", *f"runs {tmp_path}", "enter")
        await screen.until(lambda: isinstance(screen.app.screen, RunsScreen) and len(screen.app.screen.shown) == 1)
        await screen.shows("2 parts")
        await screen.press("enter", at="file")
        of = screen.app.screen.session.source
        assert [of.readings(["/log/n"], int(at))["/log/n"].newest[0] for at in of.time_ns] == list(range(20))


async def on_runs(screen, folder):
    await screen.press(":", *f"runs {folder}", "enter")
    await screen.until(lambda: isinstance(screen.app.screen, RunsScreen) and len(screen.app.screen.shown) == 3)


async def test_while_a_folder_is_read_it_says_how_far_that_is(fake, opened, folder, monkeypatch):
    go_on, read = threading.Event(), runs_screen.runs

    def slowly(folder, told):
        told(2, 9)
        go_on.wait(DEADLINE_S)
        return read(folder, told=told)

    monkeypatch.setattr(runs_screen, "runs", slowly)
    async with opened(fake) as screen:
        try:
            await screen.press(":", *f"runs {folder}", "enter", shows="2 of 9 new files")
            await screen.shows("each is read once")
        finally:
            go_on.set()
        await screen.until(lambda: len(screen.app.screen.shown) == 3)


async def test_runs_are_listed_narrowed_by_what_was_measured_opened_and_two_that_are_marked_compared(screen, folder):
    await on_runs(screen, folder)
    assert [one.name for one in screen.app.screen.shown] == ["run2", "run1", "run0"]
    await screen.shows("1/1")
    await screen.press("/", *"max(tau) > 5", "enter")
    await screen.until(lambda: [one.name for one in screen.app.screen.shown] == ["run2", "run1"])
    await screen.press("escape")
    await screen.press("/", *"gait0", "enter")
    await screen.until(lambda: [one.name for one in screen.app.screen.shown] == ["run0"])
    await screen.press("enter", at="file")
    await screen.press("escape")
    await screen.until(lambda: isinstance(screen.app.screen, RunsScreen))
    await on_runs(screen, folder)
    assert sum(isinstance(one, RunsScreen) for one in screen.app.screen_stack) == 1
    await screen.do("compare_runs", shows="two are compared, 1 is marked")
    await screen.do("mark", "mark")
    await screen.until(lambda: " Compare" in screen.text.splitlines()[-1], "what two marks are for")
    await screen.do("compare_runs", shows="run1, then run2")
    await screen.shows("1 entry differs")
    assert "/tau" in screen.text and "/log/tau" not in screen.text
    assert "mean" not in screen.text.splitlines()[1]
    await screen.pilot.resize_terminal(120, 30)
    await screen.until(lambda: "mean" in screen.text.splitlines()[1], "the columns for which there is room now")
    await screen.press("enter", at="file_monitor")
    assert [[one.name for one in panel] for panel in screen.app.screen.stack.panels] == [
        ["/log/tau/run1", "/log/tau/run2"]
    ]
    await screen.until(lambda: "Its table" in (screen.text.splitlines() or [""])[-1], "the way to the file")
    await screen.press("escape", at="comparison")
    await screen.press("slash")
    await screen.enter("nothing", shows="No line has 'nothing'")
    await screen.press("escape", "escape", at="runs")


async def test_without_a_logger_runs_are_listed_and_opened_too(new_finder, screen_of, folder, monkeypatch):
    monkeypatch.chdir(folder)
    async with screen_of(SiloApp(new_finder())) as screen:
        await screen.shows("No logger is running")
        await screen.do("runs")
        await screen.until(lambda: isinstance(screen.app.screen, RunsScreen) and len(screen.app.screen.shown) == 3)
        await screen.press("enter", at="file")
        await screen.press("escape")
        await screen.until(lambda: isinstance(screen.app.screen, RunsScreen))
        await screen.press("escape", shows="No logger is running")


async def test_marked_runs_lie_over_each_other_and_a_statistic_is_a_column_and_an_order(screen, folder):
    await on_runs(screen, folder)
    await screen.do("overlay_runs", shows="two or more lie over each other")
    await screen.do("*", "overlay_runs")
    await screen.enter("push", at="file")
    assert list(screen.app.screen.file.table.names) == [f"/log/tau/run{number}" for number in range(3)]
    await screen.do("back")
    await screen.until(lambda: isinstance(screen.app.screen, RunsScreen))
    await screen.until(lambda: "reading 3 runs" not in screen.text, "no word of what is over")
    await screen.do("runs_column")
    await screen.enter("max(tau)", shows="max(tau)")
    assert list(screen.app.screen.values["max(tau)"].values()) == [3.0, 6.0, 9.0]
    await screen.press("o", "v", "o", "v")
    await screen.until(lambda: [one.name for one in screen.app.screen.shown] == ["run0", "run1", "run2"])
    await screen.do("runs_column")
    await screen.enter("max(nothing)", shows="no run has 'nothing'")


async def test_while_runs_that_are_to_lie_over_each_other_are_read_that_is_said_and_esc_keeps_the_marks(
    fake, opened, folder, monkeypatch
):
    reads, read = threading.Event(), ListedRun.open
    monkeypatch.setattr(ListedRun, "open", lambda one: reads.wait(DEADLINE_S) and read(one))
    async with opened(fake) as screen:
        await on_runs(screen, folder)
        await screen.do("*", "overlay_runs")
        await screen.enter("push", shows="reading 3 runs")
        await screen.do("back", shows="given up")
        reads.set()
        assert len(screen.app.screen.marks.keys) == 3
        await screen.do("back")
        await screen.until(lambda: not screen.app.screen.marks.keys, "no marks, of which nothing is read")


async def test_what_differs_is_plotted_at_the_moment_of_the_largest_difference(fake, opened):
    logs = [(f"run{number}", Log(run_of(number))) for number in range(2)]
    found = compare(*(log for _, log in logs))
    found = replace(found, rows=tuple(replace(one, at_s=1.25) for one in found.rows))
    async with opened(fake) as screen:
        screen.app.push_screen(ComparisonScreen(logs, found))
        await screen.shows("/tau")
        push, pushed = screen.app.push_screen, []

        def pushes(one, *given, **named):
            pushed.append((one.scope, screen.app._batch_count > 0))
            return push(one, *given, **named)

        screen.app.push_screen = pushes
        await screen.press("enter", at="file_monitor")
        assert pushed[1:] == [("file", True), ("file_monitor", True)], "nobody sees the table below it first"
        await screen.until(lambda: screen.app.screen.window.at_ns == 1_250_000_000, "the moment")


async def test_what_was_not_compared_stands_below_the_differences(fake, opened):
    found = compare(Log(run_of(0)), Log(run_of(1)))
    reasons = {f"/log/{number}": f"there is no time in common; from {number} s" for number in range(12)}
    logs = [("run0", Log(run_of(0))), ("run1", Log(run_of(1)))]
    async with opened(fake, size=(120, 30)) as screen:
        screen.app.push_screen(ComparisonScreen(logs, replace(found, not_compared=reasons)))
        await screen.shows("1 entry differs, 0 are alike, 12 signals not compared")
        await screen.shows("not compared: there is no time in common; from 0 s: /0, the like of 11 more")


async def test_both_names_and_what_was_not_compared_have_room_on_a_small_screen(fake, opened):
    found = compare(Log(run_of(0)), Log(run_of(1)))
    reasons = {f"/log/{number}": f"for reason {number} " + 20 * "long " for number in range(12)}
    names = [f"robot_20260921_14-00-00_0000{number}_torque_slip_{number}" for number in range(2)]
    async with opened(fake, size=(80, 24)) as screen:
        logs = [(name, Log(run_of(number))) for number, name in enumerate(names)]
        screen.app.push_screen(ComparisonScreen(logs, replace(found, not_compared=reasons)))
        await screen.shows("…00000_torque_slip_0, then …00001_torque_slip_1")
        await screen.shows(" … (g m)")
        assert "for reason 11" not in screen.text
        await screen.do("messages", shows="1 entry differs, 0 are alike, 12 signals not compared")
        await screen.press("j", shows="not compared: for reason 0 long")


async def test_the_largest_difference_at_the_very_end_is_plotted_and_one_of_a_derived_signal_has_no_samples(
    fake, opened
):
    logs = [(f"run{number}", Log(run_of(number))) for number in range(2)]
    found = compare(*(log for _, log in logs))
    async with opened(fake) as screen:
        for at_s, end in ((1e6, 1), (-1e6, 0)):
            there = replace(found, rows=tuple(replace(one, at_s=at_s) for one in found.rows))
            screen.app.push_screen(ComparisonScreen(logs, there))
            await screen.shows("/tau")
            await screen.press("enter", at="file_monitor")
            await screen.until(
                lambda end=end: screen.app.screen.window.at_ns == screen.app.screen.held_ns[end], "its end"
            )
            assert screen.app.screen.gone_words("4 s") == "4 s: not in this file, which goes from 0.000 s to 3.000 s"
            await screen.press("escape", "escape", at="table")
        (one,) = found.rows
        screen.app.push_screen(ComparisonScreen(logs, replace(found, rows=(replace(one, name="/log/double"),))))
        await screen.shows("/double")
        await screen.press("enter", shows="/double is derived, and stands in no file")


@pytest.mark.parametrize(
    ("width", "head"),
    [(76, "signal  largest at s rms differ"), (117, "signal unit largest at s rms mean differ")],
)  # fmt: skip
def test_a_row_of_differences_stands_below_its_titles(width, head):
    found = compare(Log(run_of(0)), Log(run_of(1))).rows
    made = runs.Differences(found, "/log", width)
    row = made.row(found[0])
    assert " ".join(made.head.split()) == " ".join(head.split())
    assert row.startswith("/tau ") and row.endswith("%") and "differ" in made.head
    assert len(row) == len(made.head) == width


async def test_home_and_end_move_a_long_body(screen):
    await screen.do()
    screen.app.push_screen(Question("Much", "\n".join(str(line) for line in range(200)), [Choice("", "Close")]))
    await screen.until(lambda: screen.app.screen.query(".dialog-body"))
    body = screen.app.screen.query_one(".dialog-body")
    for key, where in (("end", lambda: body.max_scroll_y), ("home", lambda: 0), ("G", lambda: body.max_scroll_y)):
        await screen.press(key)
        await screen.until(lambda where=where: body.scroll_offset.y == where() and body.max_scroll_y, key)


def test_together_stand_the_moments_that_are_alike():
    logs = [(f"run{number}", Log(run_of(number, 3 + number, 0.5 * (number + 1)))) for number in range(2)]
    made = Log(together(logs))
    assert made["tau/run1"].values.tolist() == [2 * one for one in made["tau/run0"].values.tolist()]
    assert made.duration_s == 3.0
    assert made.warnings == (
        "all at 100 Hz, as values held: samples and div are of that",
        "only from 0 to 3 s, the time that all of them have",
    )
    moved = Log(together(logs, "push"))
    (mark,) = moved.events
    assert moved["tau/run0"].value(mark.seconds) == pytest.approx(0.5)
    assert moved["tau/run1"].value(mark.seconds) == pytest.approx(2.0)
    with pytest.raises(ElementError, match="no event with 'slip'"):
        together(logs, "slip")


async def test_from_a_file_over_a_logger_the_list_of_runs_leads_back_to_the_logger(screen, folder):
    await on_runs(screen, folder)
    await screen.press("enter", at="file")
    await screen.press("m", at="file_monitor")
    await screen.enter(f":runs {folder}")
    await screen.until(lambda: isinstance(screen.app.screen, RunsScreen) and len(screen.app.screen.shown) == 3)
    assert sum(isinstance(one, RunsScreen | FileTableScreen) for one in screen.app.screen_stack) == 1
    assert not screen.app.context.file_over_logger
    await screen.press("escape", at="table")


def test_runs_whose_samples_have_no_time_in_common_say_which_they_have():
    long = run_of(1, 9)
    (tau,) = long.elements
    entry = replace(tau.entries[0], values=tau.entries[0].values[-100:])
    newest = replace(long, elements=[replace(tau, first=801, entries=(entry,))])  # a buffer held the last second
    with pytest.raises(ElementError, match=r"run0 has samples from 0 s to 3 s; run1 has samples from 8.01 s to 9 s"):
        together([("run0", Log(run_of(0))), ("run1", Log(newest))])
    made = Log(together([("whole", Log(long)), ("newest", Log(newest))]))
    assert made["tau/whole"].values.tolist() == made["tau/newest"].values.tolist()


def test_a_run_that_was_cut_lies_over_others_too(tmp_path):
    cut_in_two(tmp_path)
    log = silo.open_log(tmp_path)
    made = Log(together([("one", log), ("two", log)]))
    for name in ("q/one", "q/two"):
        values = made[name].values[:, 0]
        assert set(values.tolist()) <= set(log["q"].values[:, 0].tolist())
        assert values[0] == 0
        assert values[-1] >= 16  # the grid ends within the last period of it
        assert (np.diff(values) >= 0).all()


async def test_marks_of_a_list_are_taken_back_by_the_menu_and_runs_of_another_folder_typed_there(
    new_finder, screen_of, folder, tmp_path, monkeypatch
):
    monkeypatch.chdir(folder)
    async with screen_of(SiloApp(new_finder())) as screen:
        await screen.shows("No logger is running")
        await screen.do("runs")
        await screen.until(lambda: isinstance(screen.app.screen, RunsScreen) and len(screen.app.screen.shown) == 3)
        await screen.press("*", shows="3 marked")
        await screen.do("unmark")
        await screen.until(lambda: "3 marked" not in screen.text)
        recorded_in_two(tmp_path / "else")
        await screen.enter(f":runs {tmp_path / 'else'}")
        await screen.until(lambda: len(screen.app.screen.shown) == 1)


def recorded_beside(saved, recorded):
    """A run that was saved to a folder, and recorded to another one, or the same."""
    for folder in (saved, recorded):
        folder.mkdir(exist_ok=True)
    made = run_of(0)
    stretch = Stretch("r1", 1, recorder="walks", since=0)
    told = tuple(msgspec.structs.replace(event, run="r1") for event in made.events)
    write(replace(made, events=told), saved, "robot", ["silo"], "robot_20260921_14-00-00_00001")
    shorter = replace(made, time_ns=made.time_ns[:200], offset=200, stretch=stretch, events=())
    (tau,) = made.elements
    cut = replace(tau, entries=(replace(tau.entries[0], values=tau.entries[0].values[:200]),))
    write(replace(shorter, elements=[cut]), recorded, "robot", ["bag"], "robot_20260921_14-00-00_00002")


@pytest.mark.parametrize(
    ("saved", "recorded", "said"),
    [(".", "walks", " in walks"), (".", ".", ": robot_2026"), ("walks", ".", ": robot_2026"), ("a", "b", " in b")],
)
def test_where_another_file_of_a_run_lies_is_said_or_what_it_is_called(tmp_path, saved, recorded, said):
    recorded_beside(tmp_path / saved, tmp_path / recorded)
    (run,) = silo.runs(tmp_path)
    assert run.said.startswith(f"1 more file{said}")


async def test_a_recording_of_a_run_that_was_saved_is_named_beside_it(fake, opened, tmp_path):
    recorded_beside(tmp_path, tmp_path / "walks")
    async with opened(fake) as screen:
        await screen.press(":", *f"runs {tmp_path}", "enter")
        await screen.until(lambda: isinstance(screen.app.screen, RunsScreen) and len(screen.app.screen.shown) == 1)
        assert screen.app.screen.shown[0].said == "1 more file in walks"
        await screen.press("/", *"walks/", "enter", shows="/walks/: 1 of 1")


async def test_a_folder_without_runs_says_what_to_do(screen, tmp_path):
    (tmp_path / "none").mkdir()
    await screen.press(":", *f"runs {tmp_path / 'none'}", "enter", shows="There is no run in")
    assert silo.runs(tmp_path / "none").values("lost") == []


def test_a_name_of_a_run_has_the_room_that_nobody_needs():
    path = "demo_20261130_21-36-48_00009_torque_5.silo"
    one = ListedRun(RunFacts(path, begun_ns=BEGIN, span_s=7.25, kind="capture"), Path("runs"))
    made = runs.widths([one], 80, 0)
    assert one.said == "capture"
    assert made.name == 80 - 41 - len(" capture")
    assert len("  " + runs.row(one, "x" * made.name, made, 0.0)) == 79


@pytest.mark.parametrize("width", [80, 120])
def test_a_row_of_the_list_of_runs_has_room_beside_a_scrollbar(width):
    one = ListedRun(RunFacts(f"{'long' * 20}.silo", begun_ns=BEGIN, span_s=7.25, lost=12, limits=345), Path("runs"))
    made = runs.widths([one], width, 0)
    assert len("  " + runs.row(one, "x" * made.name, made, 0.0)) == width - 1

"""The recordings of a robot on the screen, driven by keys: listed, opened in place, fetched, deleted."""

import csv
import os
import re
import threading
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from textual import events

from silo.analysis import opening
from silo.conditions.standing import TriggerStatus
from silo.core.conditions import TriggerOptions, TriggerWord
from silo.core.elements import BufferType, Entry, FileType, LoggedEvent, SavedFile, State
from silo.core.recording import RecordedElement, RecordedEntry, Recording, stamped
from silo.errors import ConnectionLostError
from silo.files import write
from silo.rpc.published import EventKind
from silo_tui.screens.files.file_table import FileTableScreen
from silo_tui.screens.lists.recordings import FIRST, RecordingsScreen
from silo_tui.screens.plots.monitor import MonitorScreen
from tests.tui.conftest import character_of
from tests.waiting import DEADLINE_S

pytestmark = pytest.mark.slow  # each walks through the whole app

SECOND = 10**9
BEGIN = 1_790_000_000 * SECOND


def log_of(seconds: int = 5, logger: str = "robot") -> Recording:
    time_ns = BEGIN + np.arange(100 * seconds + 1, dtype=np.int64) * SECOND // 100
    entry = RecordedEntry("/log/legs/LF/HAA/torque", Entry("", "<f8"), np.sin(np.arange(len(time_ns)) / 20))
    torque = RecordedElement(entry.name, "Nm", "scalar", (), 1, BufferType.LOOPING, 0, (entry,))
    return Recording(logger, time_ns, len(time_ns), [torque])


@pytest.fixture
def logs(fake, tmp_path, monkeypatch):
    """Three recordings in the folder of the fake logger: the newest is a capture, the oldest is of another logger."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    fake.logs = tmp_path / "logs"
    stem = "robot_20260921_14-00-00"
    for place, (name, why, seconds) in enumerate(
        [("arm_20260921_14-00-00_00003", "saved by bob@lab", 3), (f"{stem}_00006", "program died", 25),
         (f"{stem}_00007_fall_3", "trigger fall", 6)]
    ):  # fmt: skip
        logger = name.partition("_")[0]
        recording = log_of(seconds, logger)
        recording = replace(recording, time_ns=recording.time_ns + 100 * place * SECOND)
        (file,) = write(recording, fake.logs, logger, ["silo"], name, why=why)
        os.utime(file.path, ns=(BEGIN + place, BEGIN + place))
    return fake.logs


def far(fake, monkeypatch):
    """As if the logger were on another machine: its folder isn't here."""
    told = fake.recordings
    monkeypatch.setattr(fake, "recordings", lambda most=1000: msgspec.structs.replace(told(most), folder="/robot/logs"))


async def at_recordings(screen):
    await screen.do("recordings", at="recordings")
    await screen.shows("trigger fall")


def lines_with(screen, words):
    return [line for line in screen.text.splitlines() if words in line]


# ------------------------------------------------------------------------------------------------------- the list


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
async def test_the_list_says_why_when_how_long_how_large(screen, logs, size):
    await at_recordings(screen)
    (line,) = lines_with(screen, "trigger fall")
    assert "00007_fall_3" in line
    assert "6 s" in line
    assert "kB" in line
    assert line.rstrip().endswith("T")
    found = screen.text.splitlines()
    order = [next(place for place, line in enumerate(found) if words in line) for words in ("fall_3", "00006")]
    assert order == sorted(order)
    assert re.search(r"3 saved │ [\d.]+ .?B of [\d.]+ .?B free", screen.text)
    assert "by bob@lab" in screen.text
    assert size[0] > 80 or (lines_with(screen, "arm…00003") and lines_with(screen, "  …00006"))  # ours apart
    assert all(len(line) <= size[0] for line in found)


async def test_the_list_begins_with_what_a_program_that_died_left(fake, logs, screen, ran_s=12):
    fake.state, fake.reason = State.DEAD, f"it was killed; saved: {logs}/robot_20260921_14-00-00_00006.silo"
    fake.publish(EventKind.CRASHED, fake.reason)
    await screen.shows("robot died")
    await at_recordings(screen)
    assert screen.app.screen.chosen_key.endswith("_00006")  # which others began after


async def test_nothing_saved_yet_is_told_with_the_key_that_saves(screen):
    await screen.do("recordings")
    await screen.shows("Nothing is saved in /home/ann/logs yet. w in the table")


# ------------------------------------------------------------------------------------------------ opening in place


async def test_esc_gives_an_opening_up_and_what_is_typed_meanwhile_is_for_the_table_of_the_file(
    opened, fake, logs, monkeypatch
):
    reads, read = threading.Event(), opening.open_log
    monkeypatch.setattr(opening, "open_log", lambda which: reads.wait(DEADLINE_S) and read(which))
    async with opened(fake) as screen:
        await at_recordings(screen)
        await screen.press("enter", shows="opening robot")
        await screen.press("escape", shows=": given up")
        reads.set()
        await screen.press("j")
        await screen.until(lambda: screen.app.screen.lines.highlighted == 1, "the list goes on")
        reads.clear()
        await screen.press("k")
        for key in ("enter", "slash", *"torque", "enter", "m"):
            screen.app.post_message(events.Key(key, character_of(key)))
        await screen.shows("opening robot_20260921_14-00-00_00007_fall_3.silo")
        await screen.shows("Esc Gives it up")
        reads.set()
        await screen.until(lambda: isinstance(screen.app.screen, MonitorScreen), "the plots of what was filtered")
        assert screen.app.screen_stack[-2].session.rows.filter.text == "torque"
        assert not screen.app.screen_stack[-3].asked, "nothing of it was for the list"


async def test_enter_opens_the_file_escape_comes_back_to_table_or_plots_and_what_happened_meanwhile_is_followed(
    screen, fake, logs, ran_s=12
):
    await at_recordings(screen)
    await screen.press("j", "enter", at="file")
    await screen.shows("legs/LF/HAA/torque")
    assert "FILE " in screen.text.splitlines()[0]
    assert "00006" in screen.text.splitlines()[0]
    await screen.press("m", at="file_monitor")
    await screen.press("escape", at="file")
    await screen.press("escape", at="recordings")
    assert screen.app.screen.chosen.stem.endswith("00006")
    await screen.press("escape", at="table")
    await screen.press("m", at="monitor")
    plotted = [each.name for each in screen.app.screen.stack.plots]
    await at_recordings(screen)
    await screen.press("enter", at="file")
    await screen.press("escape", "escape")
    await screen.until(lambda: type(screen.app.screen) is MonitorScreen, "plots")
    assert [each.name for each in screen.app.screen.stack.plots] == plotted
    fake.advance(1.0)
    before = screen.session.frame_time_ns
    fake.advance(1.0)
    await screen.until(lambda: screen.session.frame_time_ns > before, "frames")
    await screen.press("escape")
    live = screen.session
    await at_recordings(screen)
    await screen.press("enter", at="file")
    fake.state = State.STOPPED
    fake.somebody_edits("/log/base/position", divider=7)
    await screen.press("escape")
    await screen.until(lambda: not live.running and live.table.revision == fake.revision, "the news")
    await screen.shows("STOPPED")
    await screen.press("enter", at="file")
    fake.cut()
    await screen.press("escape", shows="NO LINK")


async def test_pending_edits_are_asked_for_when_one_quits_from_a_file(screen, logs):
    await screen.do("toggle")
    await at_recordings(screen)
    await screen.press("enter", at="file")
    await screen.press("q", shows="Quit without applying?")
    assert screen.session.table.pending_count[0] == 1


async def test_a_file_that_vanished_is_told(screen, logs):
    await at_recordings(screen)
    for path in logs.glob("*fall*"):
        path.unlink()
    await screen.press("enter", shows="can't be opened")
    assert isinstance(screen.app.screen, RecordingsScreen)


async def test_a_recording_from_far_away_is_fetched_first_and_only_once(opened, fake, logs, tmp_path, monkeypatch):
    far(fake, monkeypatch)
    fetched: list[str] = []
    fetch = fake.fetch
    monkeypatch.setattr(fake, "fetch", lambda name, *rest, **how: fetched.append(name) or fetch(name, *rest, **how))
    async with opened(fake) as screen:
        await at_recordings(screen)
        for _ in range(2):
            await screen.press("enter", at="file")
            await screen.shows("legs/LF/HAA/torque")
            await screen.press("escape", at="recordings")
    assert len(fetched) == 1
    assert len(list((tmp_path / "cache" / "silo" / "recordings" / "anymal-robot").iterdir())) == 1


async def test_after_a_save_one_key_opens_the_file(opened, fake, logs, monkeypatch):
    fake.run()
    name = "robot_20260921_14-00-00_00007_fall_3.silo"

    def save(types, name_given=""):
        told = [SavedFile(str(logs / name), FileType.SILO, 1)]
        fake.publish(EventKind.SAVED, "saved", by="ann@here silo-tui 1", job=1, progress=1.0, files=told)
        return 1

    monkeypatch.setattr(fake, "save", save)
    async with opened(fake) as screen:
        await screen.press("w", "enter", shows="o Opens it")
        await screen.press("o", at="file")
        await screen.until(lambda: "fall_3" in screen.text.partition("\n")[0], "its name")
        await screen.press("escape", at="table")


async def at_the_capture(screen):
    await screen.do("triggers", shows="last capture: robot_20260921_14-00-00_00007_fall_3.silo")
    await screen.press("enter", at="file_monitor")


@pytest.fixture
def captured(fake, logs):
    """The trigger whose newest capture is among the recordings."""
    path = logs / "robot_20260921_14-00-00_00007_fall_3.silo"
    options = TriggerOptions("fall", "legs/LF/HAA/torque > 3", 5.0, 1.0)
    fake.trigger_statuses = [TriggerStatus(options, TriggerWord.ARMED, 3, 3, 7, BEGIN, files=(str(path),))]
    return path


@pytest.mark.parametrize("place", ["here", "far"])
async def test_a_capture_is_opened_from_the_triggers_as_any_file_is(opened, fake, captured, monkeypatch, place):
    fake.run()
    if place == "far":
        far(fake, monkeypatch)
        hidden = "/robot/logs/" + captured.name
        fake.trigger_statuses = [msgspec.structs.replace(fake.trigger_statuses[0], files=(hidden,))]
    async with opened(fake) as screen:
        live = screen.session
        await at_the_capture(screen)
        assert screen.app.context.file_over_logger
        assert screen.session.name == captured.name
        assert [plotted.name for plotted in screen.app.screen.stack.plots] == ["/log/legs/LF/HAA/torque"]
        await screen.do("events", at="file_events")
        await screen.press("escape", "escape", at="triggers")
        assert screen.session is live
        await screen.shows("legs/LF/HAA/torque > 3")


async def test_home_leads_from_a_file_to_its_table_and_from_there_to_that_of_the_logger(opened, fake, captured):
    fake.run()
    async with opened(fake) as screen:
        live = screen.session
        await at_the_capture(screen)
        screen.app.screen.action_command("go_home")
        await screen.until(lambda: isinstance(screen.app.screen, FileTableScreen), "its table")
        await screen.shows("again: robot")
        screen.app.screen.action_command("go_home")
        await screen.until(lambda: screen.app.screen.scope == "table", "the table of the logger")
        assert screen.session is live
        assert not screen.app.context.file_over_logger


async def test_a_capture_that_is_nowhere_any_more_is_told(opened, fake, captured):
    captured.unlink()
    fake.trigger_statuses = [msgspec.structs.replace(fake.trigger_statuses[0], fires=18)]
    async with opened(fake) as screen:
        await screen.do("triggers", shows="18 fires in 3 captures, the last: ")
        await screen.press("enter")
        await screen.until(lambda: "F lists what is there" in " ".join(screen.text.split()), "where it isn't")
        assert screen.app.screen.scope == "triggers"


async def test_on_the_table_of_a_dead_robot_enter_opens_what_it_left_also_without_a_link(screen, fake, logs, ran_s=12):
    fake.state, fake.reason = State.DEAD, "the robot program ended without close(); saved 25 s: somewhere"
    left = [SavedFile(str(logs / "robot_20260921_14-00-00_00006.silo"), FileType.SILO, 1)]
    fake.publish(EventKind.CRASHED, fake.reason, files=left)
    await screen.shows("Enter opens it")
    await screen.shows("m Open the file")
    assert "S Start" not in screen.text
    screen.app.begin_command("open")
    await screen.shows(f"open {left[0].path}"[:60])
    await screen.press("escape")
    await screen.do("monitor", at="file")
    await screen.until(lambda: "00006" in screen.text.partition("\n")[0], "its name")
    await screen.press("escape")
    fake.cut()
    await screen.shows("NO LINK")
    await screen.do("edit", at="file")


async def test_a_file_is_named_in_the_folder_where_the_logger_saves(opened, fake, logs, monkeypatch):
    monkeypatch.chdir(logs.parent)
    status = fake.run().status
    monkeypatch.setattr(fake, "status", lambda: msgspec.structs.replace(status(), folder=str(logs)))
    async with opened(fake) as screen:
        screen.app.begin_command("open")
        await screen.until(lambda: screen.app.screen.query("Line"), "the line")
        assert screen.app.screen.query_one("Line").value == f"open {logs.name}/"


async def test_on_the_plots_of_a_dead_robot_enter_opens_what_it_left_and_why_is_said_once(screen, fake, logs, ran_s=12):
    await screen.press("m", at="monitor")
    screen.app.context.hear("saved what was before")
    await screen.shows("saved what was before")
    fake.state, fake.reason = State.DEAD, "the robot program ended without close(); saved 25 s: somewhere"
    left = [SavedFile(str(logs / "robot_20260921_14-00-00_00006.silo"), FileType.SILO, 1)]
    fake.publish(EventKind.CRASHED, fake.reason, files=left)
    await screen.shows("Enter opens it")
    assert screen.text.count("ended without close()") == 1
    assert "saved what was before" not in screen.text
    screen.app.context.hear("it was a battery")
    await screen.shows("it was a battery")
    await screen.press("enter")
    await screen.until(lambda: screen.app.context.file_over_logger, "the file")
    await screen.until(lambda: "RUN" not in screen.text and "battery" not in screen.text, "the file alone")


@pytest.mark.parametrize("may_edit", [True, False])
async def test_who_comes_later_to_a_dead_robot_opens_it_too(opened, fake, logs, may_edit):
    fake.run()
    fake.may_edit = may_edit
    fake.state, fake.reason = State.DEAD, "the robot program ended without close(); saved 25 s: somewhere"
    async with opened(fake) as screen:
        await screen.shows("Enter opens it")
        await screen.do("edit", at="file")
        await screen.until(lambda: "00006" in screen.text.partition("\n")[0], "its name")


async def test_the_banner_names_the_key_that_opens_it_on_the_screen_where_it_stands(
    screen, fake, logs, ran_s=12, size=(160, 50)
):
    fake.state, fake.reason = State.DEAD, "the robot program ended without close(); saved 25 s: somewhere"
    fake.publish(EventKind.CRASHED, fake.reason, files=[])
    await screen.shows("Enter opens it")
    for key, says in (("A", "F lists it"), ("F", "It is in this list")):
        await screen.press(key, shows=says)
        assert "Enter opens it" not in screen.text


def marked(logs, words):
    """A recording in the folder that has a mark."""
    recording = log_of(8)
    marks = stamped([LoggedEvent("marker", words, 1, 250)], recording.time_ns, len(recording.time_ns))
    write(replace(recording, events=marks), logs, "robot", ["silo"], "robot_20260921_14-00-00_00009", why="marked")


async def test_over_a_file_the_events_are_those_of_the_file(opened, fake, logs):
    fake.run()
    fake.happen("marker", "on the live robot", fake.now_ns)
    marked(logs, "in the file")
    async with opened(fake) as screen:
        await screen.press("m", at="monitor")
        live = screen.app.screen
        await at_recordings(screen)
        await screen.press("o", "n", "G", "enter", at="file")
        await screen.do("events", shows='M "in the file"')
        assert "on the live robot" not in screen.text
        await screen.press("enter")  # to plots of the file: those of the live robot are of another clock
        await screen.until(lambda: screen.app.screen.scope == "file_monitor", "plots of the file")
        await screen.shows("at 2.5")
        await screen.shows(': "in the file"')
        assert live.window.at_ns is None


@pytest.mark.parametrize("on_file", [False, True])
async def test_end_and_home_are_the_same_in_the_events_of_a_file_and_of_a_logger(opened, fake, logs, on_file):
    fake.run()
    for words in ("one", "two", "three"):
        fake.happen("marker", words, fake.now_ns)
    marked(logs, "in the file")
    async with opened(fake) as screen:
        if on_file:
            await at_recordings(screen)
            await screen.press("o", "n", "G", "enter", at="file")
        await screen.do("events", shows="1 event" if on_file else "follows")
        await screen.press("end")
        assert screen.app.screen.lines.highlighted == (0 if on_file else 2)
        await screen.shows("1 event" if on_file else "g follows")
        await screen.press("home", shows="1 event" if on_file else "s, follows")
        assert not on_file or "follows" not in screen.text, "of what nothing is added to any more"


async def test_events_that_are_shown_are_written_to_a_csv_file(opened, fake, tmp_path):
    fake.run()
    fake.happen("marker", 'pushed, "hard"', fake.now_ns)
    fake.happen("edited", "3 elements changed", fake.now_ns)
    async with opened(fake) as screen:
        await screen.do("events", "/", "M", "enter", shows="/M: 1 of")
        await screen.press("w", shows="1 event as filtered")
        await screen.enter(str(tmp_path / "marks"), shows="1 event written")
        with (tmp_path / "marks.csv").open() as file:
            (line,) = csv.DictReader(file)
        assert line["what"] == 'pushed, "hard"'
        assert line["kind"] == "marker"
        assert int(line["time_ns"]) % SECOND == int(line["time"].partition(".")[2].removesuffix("Z"))


# --------------------------------------------------------------------------------------------- fetching, deleting


async def test_w_fetches_to_a_folder_and_says_where_it_is_and_what_is_saved_meanwhile_comes_into_the_list(
    screen, fake, logs, tmp_path
):
    await at_recordings(screen)
    await screen.press("w", shows="to a folder of this")
    await screen.shows("It lies on this machine already: ")
    screen.app.screen.query_one("Input").value = str(tmp_path / "here")
    await screen.press("enter", shows="fetched:")
    (file,) = (tmp_path / "here").iterdir()
    assert file.read_bytes() == (logs / file.name).read_bytes()
    write(log_of(), logs, "robot", ["silo"], "robot_20260921_14-00-00_00009", why="saved by bob@lab")
    fake.publish(EventKind.SAVED, "saved it", by="bob@lab")
    await screen.shows("…00009")


async def test_a_fetch_shows_how_far_it_is_and_the_keys_go_on(opened, fake, logs, tmp_path, monkeypatch):
    go_on = threading.Event()

    def fetch(name, folder, progress=None, **how):
        progress(0, 1000)
        progress(620, 1000)
        assert go_on.wait(DEADLINE_S)
        return Path(folder) / name

    monkeypatch.setattr(fake, "fetch", fetch)
    async with opened(fake) as screen:
        await at_recordings(screen)
        await screen.press("w", "enter", shows="62%")
        await screen.press("j")
        assert screen.app.screen.chosen.stem.endswith("00006")
        go_on.set()
        await screen.until(lambda: not screen.session.fetches, "its end")


async def test_a_fetch_that_fails_says_what_is_kept_and_x_asks_with_the_size_and_deletes_only_then(
    opened, fake, logs, monkeypatch
):
    def fetch(name, folder, progress=None, **how):
        raise ConnectionLostError("the link is cut; 1.0 MB of 2.0 MB are kept in 'x.part': fetch again to go on")

    monkeypatch.setattr(fake, "fetch", fetch)
    async with opened(fake) as screen:
        await at_recordings(screen)
        await screen.press("w", "enter", shows="fetch again to go on")
        await screen.do("delete_recording", shows="Delete robot_20260921_14-00-00_00007_fall_3, ")
        await screen.press("enter")  # the harmless answer has the focus
        assert len(list(logs.glob("*fall*"))) == 1
        await screen.do("delete_recording", "y")
        await screen.until(lambda: not list(logs.glob("*fall*")), "its end")
        await screen.until(lambda: not lines_with(screen, "trigger fall"), "the list without it")
        await screen.do("delete_recording")
        await screen.shows("Delete robot_")  # the next one did not slip there by itself


async def test_marked_ones_are_deleted_together_and_what_another_logger_wrote_is_not(opened, fake, logs):
    async with opened(fake) as screen:
        await at_recordings(screen)
        await screen.do("space", "space", "delete_recording", shows="Delete 2 recordings, ")
        await screen.press("y")
        await screen.until(lambda: [path.name for path in logs.glob("*.silo")] == ["arm_20260921_14-00-00_00003.silo"])
        await screen.until(lambda: [one.own for one in screen.app.screen.all] == [False], "the list without them")
        await screen.do("G", "delete_recording", shows="(the logger arm wrote")
    assert ("delete", "arm_20260921_14-00-00_00003") not in fake.calls


async def test_who_may_only_look_may_not_delete(opened, fake, logs):
    fake.may_edit = False
    async with opened(fake) as screen:
        await at_recordings(screen)
        await screen.do("delete_recording", shows="user 'bob' may look at anymal/robot, not change it")
    assert len(list(logs.glob("*.silo"))) == 3


async def test_without_a_link_the_list_stays_and_says_so(screen, fake, logs):
    await at_recordings(screen)
    fake.cut()
    await screen.shows("NO LINK")
    assert lines_with(screen, "trigger fall")
    await screen.do("delete_recording", shows="no link to robot")
    await screen.press("enter", at="file")  # it lies on this machine


@pytest.mark.parametrize("keys", [("G",), ("/", "b", "o", "b", "enter")])
async def test_the_older_ones_come_when_one_goes_there_or_filters(opened, fake, logs, monkeypatch, keys):
    monkeypatch.setattr("silo_tui.screens.lists.recordings.FIRST", 2)
    async with opened(fake) as screen:
        await at_recordings(screen)
        await screen.shows("the newest 2 of 3 saved")
        assert not lines_with(screen, "arm…00003")
        await screen.press(*keys, shows="arm…00003")


async def test_what_is_being_written_is_neither_deleted_nor_fetched(opened, fake, logs, monkeypatch):
    told = fake.recordings

    def unfinished(most=1000):
        found = told(most)
        return msgspec.structs.replace(
            found, recordings=[msgspec.structs.replace(one, unfinished=True) for one in found.recordings]
        )

    monkeypatch.setattr(fake, "recordings", unfinished)
    async with opened(fake) as screen:
        await screen.do("recordings", shows="not finished yet")
        for key, says in (("x", "nothing to delete here"), ("w", "nothing to fetch here")):
            await screen.press(key, shows=says)
            await screen.press("*", key)
            assert not screen.app.screen.is_modal
            await screen.press("*")


async def test_while_the_older_ones_are_asked_for_a_filter_says_so(opened, fake, logs, monkeypatch):
    told, answers = fake.recordings, threading.Event()

    def recordings(most=1000):
        if most > FIRST:
            assert answers.wait(DEADLINE_S)
        return msgspec.structs.replace(told(most), count=FIRST + 1)

    monkeypatch.setattr(fake, "recordings", recordings)
    async with opened(fake) as screen:
        await at_recordings(screen)
        await screen.press("/")
        await screen.type("rob", shows="asking for the older ones")
        await screen.press("enter")
        assert "asking for the older ones" in screen.text
        answers.set()
        await screen.until(lambda: "asking" not in screen.text)


async def test_two_marked_recordings_are_compared(screen, logs):
    await at_recordings(screen)
    await screen.do("compare_runs", shows="two are compared, 1 is marked")
    await screen.do("mark", "mark")
    await screen.until(lambda: " Compare" in screen.text.splitlines()[-1], "what two marks are for")
    await screen.do("overlay_recording", shows="one at a time lies over the plots, 2 are marked")
    await screen.do("compare_runs", shows="00006, then robot_20260921_14-00-00_00007_fall_3")
    await screen.press("escape", at="recordings")


async def test_what_cannot_be_fetched_is_not_compared(opened, fake, logs, monkeypatch):
    far(fake, monkeypatch)
    async with opened(fake) as screen:
        await at_recordings(screen)
        for path in logs.glob("*.silo"):
            path.unlink()
        await screen.do("mark", "mark", "compare_runs", shows="can't be opened")
        await screen.until(lambda: isinstance(screen.app.screen, RecordingsScreen), "the list")
        assert screen.app.screen.message._failed

"""A saved log on the screen, driven by keys."""

import asyncio
import re
from dataclasses import replace

import numpy as np
import pytest

from silo.analysis.log import Log
from silo.core.elements import BufferType, Entry
from silo.core.recording import Failures, RecordedElement, RecordedEntry, Recording
from silo.files.silo.writer import write_silo
from silo_tui.actions import BY_ID, FILE_SCOPES, commands_for
from silo_tui.app import SiloApp
from silo_tui.modal import run_alone
from silo_tui.model.samples.recorded import RecordingSource
from silo_tui.model.table.fields import Field
from silo_tui.screens.files import file_table
from silo_tui.sessions.recorded import FileSession
from tests.stand_ins.saved import cut_in_two, recorded_in_two

pytestmark = pytest.mark.slow  # each walks through the whole app

START_NS = 1_790_000_000_000_000_000
STEP_NS = 2_500_000
TICKS = 8000
SIZES = [(80, 24), (120, 40)]


def element(name, values, unit="-", divider=1, first=0, suffixes=("",), kind="scalar", labels=None, lost=0):
    columns = values if len(suffixes) > 1 else [values]
    entries = tuple(
        RecordedEntry(f"/log/{name}{suffix}", Entry(suffix, column.dtype.str, labels), column)
        for suffix, column in zip(suffixes, columns, strict=True)
    )
    shape = (len(suffixes),) if len(suffixes) > 1 else ()
    return RecordedElement(f"/log/{name}", unit, kind, shape, divider, BufferType.LOOPING, first, entries, lost=lost)


def recording(**changes):
    seconds = np.arange(TICKS) / 400
    torque = np.sin(seconds)
    torque[4000] = 40.0  # at 10 s
    elements = (
        element("legs/LF/torque", torque, "Nm"),
        element(
            "base/position", np.stack([seconds, seconds**2, -seconds]), "m", suffixes=("_x", "_y", "_z"), kind="vector"
        ),
        element(
            "state/gait", (seconds[::4] // 5).astype("i4") % 3, divider=4, labels={0: "stand", 1: "walk", 2: "trot"}
        ),
        element("state/operator", np.array([b"ann"] * 100 + [b"bob"] * 100, "S8"), divider=40),
        element("imu/temperature", np.full(100, 36.5), "degC", divider=40, first=4000, lost=3),
    )
    times = START_NS + STEP_NS * np.arange(TICKS, dtype=np.int64)
    facts = {"elements": elements, "frequency_hz": 400.0, "started_ns": START_NS, **changes}
    return Recording("robot", times, TICKS, **facts)


@pytest.fixture
def path(tmp_path):
    found = tmp_path / "robot_20260921_14-00-00_00007.silo"
    write_silo(recording(), found)
    return found


@pytest.fixture
def screen(on_file, path):
    return on_file(path)


def monitor(screen):
    return screen.app.screen


async def plot(screen, words):
    await screen.enter(f"/{words}", "m")
    await screen.curves()
    await screen.pilot.pause()


def to(screen):
    """Where the cursor is, in seconds."""
    return screen.session.seconds


async def test_what_is_read_is_told_no_more_once_something_else_is_read_in_its_place(path, on_file, monkeypatch):
    reading, measured = asyncio.Event(), FileSession.measure

    async def never(session, details, quantities, tell):
        tell(1)
        reading.set()
        await asyncio.Event().wait()

    async with on_file(path) as screen:
        table = screen.app.screen
        monkeypatch.setattr(file_table, "TELLS_AFTER_S", 0.0)
        monkeypatch.setattr(FileSession, "measure", never)
        table.say("what was answered")
        run_alone(table, "facts", table._measured, [])
        await screen.until(reading.is_set)
        await screen.shows("reading all samples: 1 of 5 elements │ what was answered")
        monkeypatch.setattr(FileSession, "measure", measured)
        monkeypatch.setattr(file_table, "TELLS_AFTER_S", 1e9)
        run_alone(table, "facts", table._measured, [])
        await screen.until(lambda: "reading all samples" not in screen.text)
        assert "what was answered" in screen.text


@pytest.mark.parametrize("size", SIZES)
async def test_header_table_and_plots_say_what_is_in_the_file(path, on_file, size):
    async with on_file(path, size) as screen:
        head = screen.text.splitlines()[0]
        for words in (path.name, "20 s", "8 000 ticks", "lost 3"):
            assert words in head
        rows = [line.lstrip("> ").split() for line in screen.text.splitlines()[2:8]]
        lines = {row[0]: row for row in rows if row}
        assert lines["/legs/LF/torque"][1:4] == ["Nm", "1", "8000"]
        assert "f64[3]" in lines["/base/position"]
        assert "enum" in lines["/state/gait"]
        assert lines["/imu/temperature"][2:4] == ["40", "100"]
        assert {"loop", "3"} <= set(lines["/imu/temperature"])
        await plot(screen, "torque")
        await screen.shows("whole file")
        await screen.shows("max 40")
        await screen.shows("mean ")


async def test_a_wide_table_shows_values_and_the_inspector(path, on_file):
    async with on_file(path, (160, 50)) as screen:
        await screen.shows("at 19.9975 s")
        await screen.shows("stand")
        await screen.shows("bob")
        await screen.do("inspector", "G", shows="divider   40")


async def test_a_narrow_table_of_a_file_has_the_inspector_below(screen):
    await screen.type("//imu/temperature")
    await screen.do("enter", "inspector")
    for words in ("divider   40", "buffer    looping", "lost      3", "at 19.9975 s:"):
        await screen.shows(words)
    line = next(line for line in screen.text.splitlines() if "kind  " in line)
    assert "at 19.9975 s:" in line  # beside the facts: lines are few
    inspector = screen.app.screen.inspector
    await screen.until(lambda: not inspector.store.empty, "a plot")
    assert inspector.store.count <= 2 * inspector.plot_width + 2  # of all samples, not of their last half
    await screen.press("escape")  # what was opened last goes first
    await screen.until(lambda: not inspector.display)
    assert screen.session.rows.filter.text == "/imu/temperature"
    await screen.press("escape")
    await screen.until(lambda: not screen.session.rows.filter.text)


async def test_goto_says_that_several_have_the_words_and_filter_and_marks_work_as_on_a_logger(screen):
    await screen.enter(":goto at", shows="the first of 3 that have 'at'; / at shows all")
    await screen.enter(":goto operator", shows=">/state/operator")
    await screen.enter("/unit:Nm", shows="1 of 5")
    await screen.press("asterisk", shows="1 marked")


async def test_the_inspector_says_at_how_many_ticks_an_element_could_not_be_read(tmp_path, on_file):
    found = tmp_path / "robot_00008.silo"
    mode = replace(element("mode", np.arange(TICKS)), failures=Failures(3, ((5, 6), (9, 9))))
    write_silo(recording(elements=(mode,)), found)
    async with on_file(found, (160, 50)) as screen:
        await screen.do("inspector", shows="not read  at 3 ticks")


async def test_sorting_leaves_out_what_files_don_t_tell(screen):
    orders = list(screen.session.rows.orders.values())
    kept = [order.name for order in orders if not order.quantity]
    measured = [order.name for order in orders if order.quantity]
    assert kept == ["tree", "name", "added", "unit", "div", "size", "buf"]
    assert measured == [
        "state",
        "value",
        "|value|",
        "min",
        "max",
        "mean",
        "std",
        "noise/median",
        "rate",
        "jitter",
        "changed",
    ]
    await screen.press("o", shows="the other way round")
    assert "fill" not in screen.text  # how large a buffer was is not in a file
    await screen.press("u")
    await screen.until(lambda: screen.session.rows.sort == "unit")


async def test_all_marked_elements_are_plotted(path, on_file):
    async with on_file(path, (120, 40)) as screen:
        await screen.press("asterisk", "m")
        await screen.curves()
        names = [plotted.name for plotted in monitor(screen).stack.plots]
        assert len(names) == 7


async def test_the_cursor_reads_the_value_that_held_and_steps_from_sample_to_sample(screen):
    await plot(screen, "gait")
    await screen.shows("(stand … trot)")
    assert "mean" not in screen.text
    await screen.shows("= stand")
    await screen.press("home")
    await screen.until(lambda: to(screen) == 0)
    for _ in range(25):
        await screen.press("right")
    await screen.until(lambda: 5 < to(screen) < 10, f"walking {to(screen)}")
    await screen.shows("= walk")
    await screen.do("home", "next_sample")
    assert to(screen) == pytest.approx(0.01)
    await screen.do("next_sample", "previous_sample", "previous_sample")
    assert to(screen) == 0
    await screen.do("previous_sample", shows="first sample")


async def test_the_moment_of_the_cursor_has_as_many_decimals_as_tell_samples_apart(screen):
    await plot(screen, "torque")
    await screen.press("left", "left", "left")
    await screen.until(lambda: re.search(r"cursor at 1\d\.\d{3} s", screen.text))


async def test_before_its_curves_are_read_a_plot_has_its_times(path, on_file, monkeypatch):
    read = asyncio.Event()
    history = RecordingSource.history

    async def late(source, *asked):
        await read.wait()
        return await history(source, *asked)

    monkeypatch.setattr(RecordingSource, "history", late)
    async with on_file(path) as screen:
        await screen.enter("/torque", "m", shows="= -")
        await screen.shows("15 s")
        assert "20 s" in screen.text.splitlines()[-3]
        assert "-1790000000" not in screen.text
        read.set()
        await screen.curves()


async def test_the_cursor_reads_texts(screen):
    await plot(screen, "operator")
    await screen.shows("bob")
    await screen.press("home", shows="ann")


async def test_before_its_first_sample_a_signal_has_no_value(screen):
    await plot(screen, "temperature")
    await screen.shows("= 36.5")
    await screen.press("home", shows="= -")
    await screen.press("plus", "plus", shows="begins at 10 s")


async def test_home_and_end_jump_to_the_ends_of_the_file_facts_are_of_the_window_and_zero_shows_all(screen):
    await plot(screen, "torque")
    await screen.press("plus", "plus", "plus")
    await screen.press("home")
    await screen.until(lambda: to(screen) == 0 and monitor(screen).window.cursor is not None)
    await screen.press("end")
    await screen.until(lambda: to(screen) == 19.9975 and monitor(screen).window.cursor is not None)
    await screen.until(lambda: "max 40" not in screen.text)
    await screen.shows("s shown")
    await screen.do("all_held", shows="whole file")
    await screen.do("drop_plot", at="file")  # the last one


async def test_zooming_keeps_the_cursor_on_its_moment(screen):
    await plot(screen, "torque")
    await screen.press("home", "shift+right", "shift+right", "shift+right")
    before = to(screen)
    for _ in range(40):
        await screen.press("plus")
    await screen.shows("that is the shortest span")
    assert to(screen) == before
    assert monitor(screen).window.span_s == 0.001
    await screen.until(lambda: monitor(screen).stack.store.column_ns < 10_000)
    await screen.until(lambda: monitor(screen).window.cursor is not None)


async def as_far_as_it_goes(screen, key):
    window, before = monitor(screen).window, None
    while before != (before := window.paused_end_ns):
        await screen.press(key)


async def test_a_window_walks_over_the_whole_file_both_ways_and_its_cursor_takes_it_along(screen):
    await plot(screen, "torque")
    await screen.press("plus", "plus", "plus", "plus")
    span_ns = monitor(screen).window.span_ns
    await as_far_as_it_goes(screen, "pageup")
    await screen.shows("beginning of the file")
    source = screen.session.source
    await screen.until(lambda: abs(monitor(screen).window.paused_end_ns - source.begin_ns - span_ns) < span_ns / 10)
    stack = monitor(screen).stack
    await screen.until(lambda: stack.store.first <= source.begin_ns // stack.store.column_ns)
    await as_far_as_it_goes(screen, "pagedown")
    await screen.until(lambda: monitor(screen).window.paused_end_ns == source.end_ns)
    await screen.do("all_held")
    await screen.press("plus", "plus", "plus", "plus", "plus")
    for _ in range(30):
        await screen.press("shift+left")
    await screen.until(lambda: monitor(screen).window.cursor is not None)
    assert to(screen) < 19.9975 - monitor(screen).window.span_s


async def test_the_detail_plot_counts_time_from_the_start(screen):
    await plot(screen, "torque")
    await screen.press("enter", at="file_detail")
    await screen.shows("TIME")
    await screen.press("plus", "home", shows="0 … 10 s")
    await screen.press("escape", shows="10 s shown")  # the monitor has the window as it was left


@pytest.mark.parametrize("size", SIZES)
async def test_nothing_that_changes_a_logger_is_offered(path, on_file, size):
    async with on_file(path, size) as screen:
        for word in ("Edit", "Apply", "Start", "Save", "On/Off", "Loggers"):
            assert word not in screen.text.splitlines()[-1]
        await screen.press("question_mark", shows="silo help of the table of a file")
        for word in ("pending", "buffer size", "start or stop", "script"):
            assert word not in screen.text


def test_no_command_on_a_file_writes():
    assert not [command.id for scope in FILE_SCOPES for command in commands_for(scope) if command.writes]
    assert not {"undo", "redo", "discard", "pause", "refresh", "loggers"} & {
        command.id for scope in FILE_SCOPES for command in commands_for(scope)
    }
    assert "whole_file" not in BY_ID  # 0 is all that is held, in files too


async def test_keys_that_edit_a_logger_change_nothing_and_say_that_a_file_has_nothing_to_edit(screen):
    before = screen.session.table.values.copy()
    for key in "detSu":
        screen.app.screen.say("")
        assert "nothing to edit" not in screen.text
        await screen.press(key, shows="a saved file: nothing to edit")
    await screen.press("t", "d", "5", "b", "p", "u", "a", "S", "w", "x")
    assert not screen.session.table.pending.any()
    np.testing.assert_array_equal(screen.session.table.values[Field.DIVIDER], before[Field.DIVIDER])


async def test_words_are_typed_over_a_file_and_its_plots(screen, tmp_path):
    await screen.enter(":goto operator")
    names, rows = screen.session.table.names, screen.session.rows
    await screen.until(lambda: names[rows.row] == "/log/state/operator", "the element")
    await screen.enter(":filter torque")
    await screen.until(lambda: len(rows.shown) == 1, "the filter")
    await screen.enter(":start", shows=":start: a saved file: nothing to edit")
    await screen.press("m", ":")
    await screen.enter(f"picture {tmp_path}/x.svg")
    await screen.until((tmp_path / "x.svg").exists, "the picture")
    await screen.enter(":help", shows="help of")


async def test_a_damaged_file_says_what_is_missing(path, on_file):
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 2 // 3])
    async with on_file(path) as screen:
        await screen.until(lambda: screen.session.warnings)
        assert screen.session.warnings[0][:30] in screen.text.splitlines()[1]
        assert any("name" in line for line in screen.text.splitlines()[2:4]), "two lines at most"
        await screen.press("m")
        await screen.curves()
        await screen.shows(screen.session.warnings[0][:30])


async def test_a_csv_file_looks_the_same(path, tmp_path, on_file):
    from silo.files.convert import convert

    convert(path, tmp_path / "log.csv")
    async with on_file(tmp_path / "log.csv") as screen:
        assert "log.csv" in screen.text.splitlines()[0]
        await plot(screen, "torque")
        await screen.shows("max 40")


async def test_an_element_without_samples_says_so(new_finder, screen_of):
    empty = recording(elements=(element("never", np.zeros(0)), element("torque", np.zeros(TICKS))))
    async with screen_of(SiloApp(new_finder(), file=FileSession(Log(empty, "log.silo")))) as screen:
        await screen.shows("/never")
        await screen.press("m", shows="no samples")


async def test_the_end_of_a_long_run_fills_the_window(screen):
    await plot(screen, "temperature")
    low = monitor(screen).stack.store.piece("/log/imu/temperature", monitor(screen).stack.store.end, 130).low
    assert np.isfinite(low).sum() > 60
    assert monitor(screen).window.span_s < 11
    await screen.do("enter", "plus", "minus", "all_held", "escape", "all_held", shows="whole file")


async def test_the_values_of_the_table_are_those_at_the_cursor(path, on_file):
    async with on_file(path, (160, 50)) as screen:
        await screen.press("G", "k", "m")
        await screen.curves()
        await screen.press("home", "escape", shows="at 0 s")
        await screen.shows("ann")


async def test_a_run_that_was_cut_is_shown_whole_whichever_part_is_opened(tmp_path, on_file):
    cut_in_two(tmp_path)
    for part in (1, 2):
        async with on_file(next(tmp_path.glob(f"*part{part}.silo"))) as screen:
            await screen.shows("2 parts")
            assert screen.session.report.ticks == 20
            assert "alone" not in screen.text


async def test_a_part_of_a_run_of_which_no_other_is_there_is_not_said_to_be_opened_whole(tmp_path, on_file):
    cut_in_two(tmp_path)
    next(tmp_path.glob("*part1.silo")).unlink()
    async with on_file(next(tmp_path.glob("*part2.silo"))) as screen:
        await screen.shows("; no other part of it lies beside this")
        assert ":runs" not in screen.text


async def test_a_file_of_a_recording_is_shown_alone_and_says_so(tmp_path, on_file):
    recorded_in_two(tmp_path)
    async with on_file(next(tmp_path.glob("*00001*"))) as screen:
        await screen.shows("one file of recording")
        await screen.shows("alone: :runs opens all of it as one")
        assert "(all: silo info" not in screen.text
        assert screen.session.report.ticks == 10


async def test_what_lies_between_cursors_is_told_over_time_alone_however_late_it_is_known(path, on_file, monkeypatch):
    async with on_file(path, (120, 40)) as screen:
        await plot(screen, "torque")
        await screen.do("detail", "cursor_left", "cursor_b")
        shown = monitor(screen)
        await screen.until(lambda: shown.between.display)
        measure, known = shown.pause.held.measure, asyncio.Event()

        async def late(*given):
            await known.wait()
            return await measure(*given)

        monkeypatch.setattr(shown.pause.held, "measure", late)
        await screen.do("cursor_left")
        shown.action_command("mode_spectrum")
        known.set()
        await screen.shows("peak 1")
        assert not shown.between.display
        shown.action_command("mode_time")
        await screen.until(lambda: shown.between.display)


async def test_the_chosen_plot_stays_on_the_screen_when_the_table_between_cursors_takes_its_room(screen):
    await screen.do("mark_shown", "plot")
    await screen.curves()
    await screen.do("plot_down", "plot_down", "cursor_left", "cursor_b")
    shown = monitor(screen)
    await screen.until(lambda: shown.between.display)
    stack = shown.stack  # it comes a moment after the table
    await screen.until(lambda: 0 < stack.first <= stack.chosen_panel < stack.first + stack.fitting)


async def test_what_lies_between_two_cursors_is_written_alone(path, on_file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    async with on_file(path, (120, 40)) as screen:
        await plot(screen, "torque")
        await screen.do("export_plots", shows="What is shown: .csv")
        await screen.press("escape")
        await screen.do("cursor_left", "cursor_b", "cursor_far_left")
        window = screen.app.screen.window
        begin_ns, end_ns = sorted((window.at_ns, window.other_ns))
        await screen.do("export_plots", shows="What lies between A and B: .csv")
        await screen.press("enter", shows="are in")
        rows = [line.split(",")[0] for line in (tmp_path / "plots.csv").read_text().splitlines()[1:]]
        times = screen.session.source.time_ns
        assert list(map(int, rows)) == [at for at in times.tolist() if begin_ns <= at <= end_ns]
        assert len(rows) > 10

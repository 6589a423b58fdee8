"""Find moments, two cursors, plots that share an axis: driven by keys, on a file and on a logger."""

import asyncio
import threading
from dataclasses import replace

import numpy as np
import pytest

from silo.analysis.log import Log
from silo.conditions.requests import TriggerTried
from silo.core.elements import BufferType, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.expressions.over_recordings import RecordingJudge
from silo_tui.app import SiloApp
from silo_tui.menus import MenuReader
from silo_tui.model.drawing.plots import plots_of
from silo_tui.model.lists.conditions import tried_lines
from silo_tui.model.samples.find import Search, What
from silo_tui.screens.plots.monitor import MonitorScreen
from silo_tui.screens.plots.searching import events, look, turned, within
from silo_tui.sessions.recorded import FileSession
from tests.waiting import DEADLINE_S

pytestmark = pytest.mark.slow  # each walks through the whole app

START_NS = 1_790_000_000_000_000_000
STEP_NS = 2_500_000
TICKS = 4000


def element(name, values, unit="Nm", labels=None):
    entry = RecordedEntry(f"/log/{name}", Entry("", values.dtype.str, labels), values)
    return RecordedElement(f"/log/{name}", unit, "scalar", (), 1, BufferType.LOOPING, 0, (entry,))


def recording():
    seconds = np.arange(TICKS) / 400
    torque = np.sin(2 * np.pi * seconds)
    torque[2345] = 40.0
    elements = (
        element("LF/torque", torque),
        element("LF/contact", np.sin(2 * np.pi * seconds) > 0, "-"),
        element("RF/torque", np.cos(2 * np.pi * seconds)),
        element("position", seconds, "rad"),
        element("phase", np.array([b"stand"] * 1000 + [b"walk"] * 3000, "S8"), "-"),
    )
    times = START_NS + STEP_NS * np.arange(TICKS, dtype=np.int64)
    times[3000:] += 1_000_000_000  # a second is missing
    return Recording("robot", times, TICKS, elements, frequency_hz=400.0, started_ns=START_NS)


@pytest.fixture
def monitor(new_finder, screen_of):
    """Opens the monitor of a file on some of its elements."""
    from contextlib import asynccontextmanager

    @asynccontextmanager
    async def open_monitor(*names, size=(80, 24)):
        session = FileSession(Log(recording(), "robot.silo"))
        async with screen_of(SiloApp(new_finder(), file=session), size) as screen:
            await screen.shows("/LF/torque")
            shown = MonitorScreen(session, [f"/log/{name}" for name in names])
            screen.app.push_screen(shown)
            await screen.until(lambda: shown.is_mounted and not shown.stack.store.empty, "plots")
            await screen.pilot.pause()
            yield screen, shown

    return open_monitor


async def test_samples_holes_and_the_highest_are_few_keys_away_and_exact_and_steps_count_that_do_not_wait(
    monitor, monkeypatch
):
    async with monitor("LF/torque") as (screen, shown):
        await screen.do("find")
        await screen.enter("fast", shows="no element is called 'fast'")
        await screen.press("escape", shows="whole file")
        await screen.do("home", "next_sample", "next_sample", "previous_sample")
        await screen.until(lambda: shown.file.time_ns == START_NS + STEP_NS, "the second sample")
        await screen.do("home", "next_event", shows="1 s without sample")
        assert shown.file.time_ns == START_NS + 2999 * STEP_NS
        await screen.do("find", "n", "enter", shows="nan or inf: none in 11 s held of /LF/torque")
        await screen.do("find", "t", "enter", shows="trigger fired: none in 11 s held ")
        await screen.do("find", "h", "enter", shows="highest in /LF/torque, 1 of 1: 40")
        assert shown.file.time_ns == START_NS + 2345 * STEP_NS
        assert shown.window.cursor is not None
        await screen.do("home", "next_sample")
        await screen.until(lambda: shown.file.time_ns == START_NS + STEP_NS, "the second sample")
        samples, asked = shown.source.samples, []

        async def slow_samples(name, start_ns, end_ns):
            asked.append(start_ns)
            for _ in range(20):
                await asyncio.sleep(0)
            return await samples(name, start_ns, end_ns)

        monkeypatch.setattr(shown.source, "samples", slow_samples)
        shown.search.command_step_sample(1)
        shown.search.command_step_sample(1)
        shown.search.command_step_sample(1)
        await screen.until(lambda: shown.file.time_ns == START_NS + 4 * STEP_NS, "three samples on")
        assert len(asked) == len(set(asked)) == 3


async def test_who_steps_on_from_the_highest_is_led_to_the_peaks(monitor):
    async with monitor("RF/torque") as (screen, shown):
        await screen.do("find", "h", "enter", shows="highest in /RF/torque, ")
        for _ in range(20):
            await screen.do("next_found")
        await screen.shows("f peak finds each")
        await screen.do("find", "p", "enter", shows="peak of a swing, ")
        for at in (8, 7, 6, 5):
            await screen.do("previous_found", shows=f"{at} of 9: 1.0")
        assert shown.file.time_ns == START_NS + 5 * 400 * STEP_NS


async def test_where_a_condition_of_any_signals_turns_true_is_found_by_a_form_that_keeps_what_is_typed(monitor):
    async with monitor("position") as (screen, _):
        await screen.do("find")
        await screen.type("LF/torqe > 0.5")
        await screen.shows("LF/torque'")
        await screen.press("enter", *["left"] * 7, "u")
        await screen.shows("turned true 11 × in the 11 s that are held")  # ten waves, and the spike between two of them
        await screen.press("enter", shows="LF/torque > 0.5, 11 of 11: turns true at")
        await screen.shows("([ before)")  # of the last one nothing leads on
        await screen.do("previous_found", "previous_found", shows="9 of 11")
        await screen.do("find")
        assert screen.app.screen.fields == {"find": "LF/torque > 0.5"}


async def test_of_a_condition_that_nothing_tells_a_file_says_that_it_was_blind():
    whole = recording()
    bad = replace(whole, elements=(*whole.elements, element("bad", np.full(TICKS, np.nan))))
    tried = await FileSession(Log(bad, "robot.silo")).turns_true("bad > 1")
    assert (tried.fires, tried.judged, tried.blind) == (0, TICKS, TICKS)


@pytest.mark.parametrize("batch", [1, 7, 40, TICKS])
async def test_where_a_condition_turns_true_does_not_depend_on_how_much_is_judged_at_once(monkeypatch, batch):
    monkeypatch.setattr("silo.expressions.over_recordings.BATCH_TICKS", batch)
    tried = await FileSession(Log(recording(), "robot.silo")).turns_true("LF/torque > 0.5")
    assert tried.ticks == [34, 434, 834, 1234, 1634, 2034, 2345, 2434, 2834, 3234, 3634]
    assert tried.time_ns == recording().time_ns[tried.ticks].tolist()


@pytest.mark.parametrize(
    ("fires", "times_s", "begin_s", "says"),
    [
        (0, [], 21, "has overwritten what is held here; f > 5 looks for a value there"),
        (2000, range(21, 30), 0, "none, only later ones are told"),
        (0, [], 0, "none in 20 s held"),
        (0, [], 5, "none in 15 s held; not looked through further: only the newest 15 s can be searched"),
        (0, [], 16.7, "none in 3.3 s held; not looked through further: only the newest 3.3 s can be searched"),
    ],
)
def test_of_a_pause_it_is_told_what_a_test_of_now_says_nothing_of(fires, times_s, begin_s, says):
    times = [each * 10**9 for each in times_s]
    tried = TriggerTried(fires, [0] * len(times), times, 0, 1, round(begin_s * 10**9), 60 * 10**9)
    assert turned(Search(What.CONDITION, condition="x > 1"), tried, (0, 20 * 10**9)).none().endswith(says)


@pytest.mark.parametrize(
    ("times_s", "begin_s", "line"),
    [
        ([3, 8, 30], 0, "turned true 2 × in the 20 s that are held; maybe some of it can't be judged"),
        ([30], 0, "turned true 0 × in the 20 s that are held; maybe some of it can't be judged"),
        (
            [30],
            25,
            "blind: the logger, which judges it, has overwritten what is held here; f > 5 looks for a value there",
        ),
    ],
)
def test_the_form_counts_what_is_held_of_a_pause_alone(times_s, begin_s, line):
    times = [each * 10**9 for each in times_s]
    tried = TriggerTried(len(times), [0] * len(times), times, 0, 1, begin_s * 10**9, 60 * 10**9, 600, 60, held=300)
    assert tried_lines(within(tried, (0, 20 * 10**9)), 60, "turned true")[0] == line
    assert "; 10 % of it can't be judged" in tried_lines(within(tried, (0, 60 * 10**9)), 60)[0]


async def test_before_the_oldest_moment_that_is_told_it_says_how_many_there_are_and_judges_nothing_anew(monitor):
    judged = []

    async def newest_two(condition):
        judged.append(condition)
        end_ns = START_NS + 3 * 10**9
        return TriggerTried(1500, [400, 800], [START_NS + 10**9, START_NS + 2 * 10**9], 0, 1, START_NS, end_ns)

    async with monitor("position") as (screen, shown):
        await screen.do("find")
        await screen.until(lambda: screen.app.screen.is_modal, "the form")
        shown.session.turns_true = newest_two
        await screen.type("LF/torque > 0.5")
        await screen.press("enter", shows="1500 of 1500")
        await screen.do("previous_found", shows="1499 of 1500")
        before = len(judged)
        await screen.do("previous_found", shows="1498 older ones are not told")
        assert len(judged) == before


async def test_a_condition_that_is_judged_in_a_file_for_nobody_any_more_reads_no_further(monkeypatch):
    batches, begun, ended, whole = RecordingJudge.batches, threading.Event(), threading.Event(), []

    def many(judge, bound):
        first = next(iter(batches(judge, bound)))
        try:
            for _ in range(20_000):
                begun.set()
                yield first
            whole.append(True)
        finally:
            ended.set()

    monkeypatch.setattr(RecordingJudge, "batches", many)
    judging = asyncio.create_task(FileSession(Log(recording(), "robot.silo")).turns_true("LF/torque > 0.5"))
    await asyncio.to_thread(begun.wait, DEADLINE_S)
    judging.cancel()
    await asyncio.to_thread(ended.wait, DEADLINE_S)
    assert ended.is_set()
    assert not whole


async def test_brackets_go_from_crossing_to_crossing_a_star_looks_in_all_plots_and_a_key_makes_one_of_them(monitor):
    async with monitor("LF/torque", "RF/torque") as (screen, shown):
        await screen.do("home", "find")
        await screen.enter(">0.5", shows="rises above 0.5 in /LF/torque, 1 of")
        first = shown.file.time_ns
        assert first == START_NS + 34 * STEP_NS  # sin(pi / 6) lies between ticks 33 and 34
        await screen.do("next_found")
        await screen.until(lambda: shown.file.time_ns > first, "the next one")
        await screen.do("previous_found")
        await screen.until(lambda: shown.file.time_ns == first, "the one before")
        await screen.do("home", "find", shows="in all 2 signals that are plotted")
        await screen.enter("b above 0.5 and a > 0.5", shows="RF/torque > 0.5 and LF/torque > 0.5, 1 of 11: turns true")
        await screen.do("find")
        await screen.enter("b", shows=">b /RF/torque")
        await screen.do("home", "find")
        await screen.enter("* highest")
        await screen.shows("of 11")  # ten times one, once forty
        await screen.until(lambda: " Join" in screen.text.splitlines()[-1])
        await screen.do("join_plots")
        await screen.until(lambda: len(shown.stack.panels) == 1 and " Join" not in screen.text.splitlines()[-1])


@pytest.mark.parametrize(("chosen", "other"), [("home", "/position"), ("j", "/LF/torque")])
async def test_what_a_plot_is_joined_with_stands_in_the_menu_and_after_it_the_key_that_parts_them(
    monitor, chosen, other
):
    async with monitor("LF/torque", "position") as (screen, shown):
        await screen.press(chosen)
        assert shown.value_now("join_plots") == f"with {other}"
        await screen.do("join_plots", shows=f"joined with {other}; I parts them again")
        assert shown.value_now("isolate_plot") == "parts again"
        await screen.do("isolate_plot")
        await screen.until(lambda: len(shown.stack.panels) == 2)


async def test_moments_of_several_signals_at_one_time_are_each_gone_to_and_two_cursors_tell_what_lies_between(monitor):
    async with monitor("LF/torque", "position", size=(120, 40)) as (screen, _):
        await screen.do("home", "find")
        await screen.enter("*hole", shows="hole in /LF/torque, 1 of 2")
        await screen.do("next_found", shows="hole in /position, 2 of 2")
        await screen.do("next_found", shows="that is the last of 2 in 11 s held")
        await screen.do("previous_found", shows="hole in /LF/torque, 1 of 2")
        await screen.do("home", "cursor_b", *["shift+right"] * 3, shows="slope/s")
        await screen.shows("B-A -")
        line = [line for line in screen.text.splitlines() if line.startswith(" b /position")][-1]
        assert float(line.split()[4]) == pytest.approx(1.0, abs=0.01)  # a second a second
        await screen.do("cursor_b")
        await screen.until(lambda: "slope/s" not in screen.text, "the table to go")


async def test_a_boolean_goes_from_change_to_change_once_that_is_looked_for_and_its_lane_can_t_be_joined(monitor):
    async with monitor("LF/contact", "LF/torque") as (screen, shown):
        await screen.do("home", "next_found", shows="f first: type what to look for; ] then goes on from there")
        assert (shown.file.time_ns, shown.search.found) == (START_NS, None)
        await screen.do("find", "c", "enter")
        await screen.until(lambda: shown.file.time_ns == START_NS + STEP_NS, "the first edge")
        await screen.shows("true at")
        await screen.do("join_plots", shows="lanes stay alone")


async def test_a_tick_that_came_late_is_a_hole_and_no_event():
    late = recording().time_ns.copy()
    late[500:] += 50_000_000
    session = FileSession(Log(replace(recording(), time_ns=late), "robot.silo"))
    plots = plots_of(session.source.elements[:1])
    assert (await look(session.source, plots, Search(What.HOLE), {}, 0)).total == 2
    found = await events(session.source, plots, {}, 0)
    assert [moment.time_ns for moment in found.moments] == [late[2999]]


async def test_of_a_loop_that_jitters_the_holes_well_above_that_are_found_and_how_many_are_left_out():
    late = recording().time_ns.copy()
    for at in range(10, 2990, 10):
        late[at:] += 2_000_000
    session = FileSession(Log(replace(recording(), time_ns=late), "robot.silo"))
    plots = plots_of(session.source.elements[:1])
    found = await look(session.source, plots, Search(What.HOLE), {}, 0)
    assert [moment.time_ns for moment in found.moments] == [late[2999]]
    assert (found.search, found.partly) == (Search(What.HOLE), "298 up to 14 ms left out")


async def test_the_menu_brackets_what_one_plot_alone_can_t_do(monitor):
    needing_two = ("join_plots", "arrange_plots")
    async with monitor("LF/torque") as (screen, shown):
        reader = MenuReader(screen.app, lambda: True)
        reader._menu = "menu_plots"
        assert [letter for letter in "jia" if f"({letter}) " in reader.picture(shown, 78).plain] == list("jia")
        assert all(map(shown.why_not_now, needing_two))
        await screen.do("join_plots", shows="no next plot to join with")
    async with monitor("LF/torque", "RF/torque") as (screen, shown):
        assert not any(map(shown.why_not_now, needing_two))
        assert shown.why_not_now("isolate_plot") == "it is alone in its plot"
        await screen.do("join_plots")
        assert not shown.why_not_now("isolate_plot")


async def test_joined_plots_have_letters_and_both_units(monitor):
    async with monitor("LF/torque", "RF/torque", "position", size=(120, 40)) as (screen, shown):
        await screen.do("join_plots")
        await screen.until(lambda: len(shown.stack.panels) == 2, "one plot of two")
        await screen.do("join_plots")
        await screen.until(lambda: len(shown.stack.panels) == 1, "all in one")
        await screen.shows("c /position→")
        await screen.do("j", "isolate_plot")
        await screen.until(lambda: [len(panel) for panel in shown.stack.panels] == [2, 1], "one alone")
        assert shown.stack.chosen_plot.name == "/log/RF/torque"
        await screen.do("drop_plot")
        await screen.shows("/RF/torque is left out; m plots it again")


async def test_tab_goes_through_the_arrangements_and_back(monitor):
    async with monitor("LF/torque", "LF/contact", "RF/torque", "position") as (screen, shown):
        counts = []
        for _ in range(3):
            await screen.press("tab")
            await screen.pilot.pause()
            counts.append(len(shown.stack.panels))
        assert counts == [3, 2, 4]


async def test_texts_hang_at_their_time(monitor):
    async with monitor("phase") as (screen, _):
        await screen.shows("stand")
        await screen.shows("│walk")


async def test_the_detail_plot_goes_from_time_to_histogram(monitor):
    async with monitor("RF/torque", "position", size=(160, 50)) as (screen, _):
        await screen.press("enter", shows="TIME")
        await screen.press("tab", shows="r = ")
        await screen.press("tab", shows="SPECTRUM linear")
        await screen.shows("longest whole piece: 3000 of 4000")
        await screen.shows(" samples  7.5 s ")
        await screen.do("level", "level", shows="0 dB = 1 Nm")
        await screen.do("next_found", shows="peak 1: ")
        await screen.press("tab", shows="median")

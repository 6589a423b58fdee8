"""Marks and events on the screen: M, E, lines in plots, find, jump there."""

import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from msgspec.structs import replace

from silo.conditions.standing import TriggerStatus
from silo.core.conditions import TriggerOptions, TriggerWord
from silo.core.elements import GOES_ON, BufferType, Entry, LoggedEvent
from silo.core.quantities.writing import wall_clock
from silo.core.recording import RecordedElement, RecordedEntry, Recording, stamped
from silo.files.silo.writer import write_silo
from silo.recordings.requests import SavedRecording
from silo.rpc.published import EventKind
from silo_tui.app import SiloApp
from silo_tui.model.lists.happened import (
    MOST,
    columns_of,
    csv_text,
    folded,
    gone_words,
    in_plots,
    in_time,
    line,
    long_words,
    matches,
    newest,
    of_last_run,
    words,
)
from silo_tui.screens.lists.events import EventsScreen
from silo_tui.sessions.recorded import open_file
from tests.waiting import DEADLINE_S

SECOND = 10**9


def event(kind="marker", text="push 3", at_ns=SECOND, **more):
    return LoggedEvent(kind, text, at_ns, 5, at_ns, **{"who": "me@desk silo-tui 1", "run": "r", "number": 1, **more})


@pytest.mark.parametrize(
    ("asked", "found"),
    [("", True), ("push", True), ("PUSH desk", True), ("-E", True), ("M", True), ("-M", False), ("X", False),
     ("-push", False), ("marker", True), ("nothing", False), ("-", True)],
)  # fmt: skip
def test_a_filter_takes_words_and_letters_and_leaves_out(asked, found):
    assert matches(event(), asked, '"push 3"') == found


def test_a_line_is_never_wider_than_the_screen():
    for width in (30, 80, 160):
        assert len(line(event(), "x" * 300, width, "bot")) <= width
        assert len(line(event(), "xyz " * 300, width, "bot")) <= width
    assert line(event(), '"push 3"', 80, "bot").endswith("me@desk")
    assert line(event(who="bot"), "push", 80, "bot").endswith("push" + " " * 47)  # nobody but the logger


def test_a_table_of_events_has_their_time_in_full():
    late, start = event(at_ns=1_790_000_000_000_000_007), replace(event("started", "", SECOND, who=""), tick=-1)
    rows = csv_text([late, start]).splitlines()
    assert rows[1] == "2026-09-21T14:13:20.000000007Z,1790000000000000007,5,marker,push 3,me@desk silo-tui 1,r"
    assert rows[2] == "1970-01-01T00:00:01.000000000Z,1000000000,,started,,,r"


@pytest.mark.parametrize(
    ("room", "told"),
    [(33, "ticks 8040 to 12680 held  me@desk"), (32, "ticks 8040 to 12680 held  "), (24, "ticks 8040 to 12680 held"),
     (23, "ticks 8040 to 12680…"), (19, "ticks 8040 to…"), (4, "tic…")],
)  # fmt: skip
def test_what_has_no_room_in_its_line_is_cut_at_a_blank_once_who_did_it_has_given_way(room, told):
    head = line(event(), "", 80, "bot").index("M") + 2
    shown = line(event(), "ticks 8040 to 12680 held", head + room, "bot")[head:]
    assert shown.rstrip() == told.rstrip()


def test_the_tick_that_stands_in_its_column_is_not_told_again():
    over = event("limit", "/x H 35.2 Nm at tick 5, limit 35")
    assert "H /x H 35.2 Nm, limit 35 " in line(over, over.text, 80, "bot")
    assert "at tick 5" in line(replace(over, tick=7), over.text, 80, "bot")  # another one
    assert "at tick 51" in line(over, "/x H 1 at tick 51", 80, "bot")


def test_a_long_name_loses_what_does_not_tell_it_apart_before_the_line_is_cut():
    told = [f"/robot/left_front/{leg}_KFE/winding_temperature over 50: 51.25" for leg in ("LF", "LH")]
    events = [event("limit", f"/log{each}") for each in told]
    names = long_words(events, lambda word: word.removeprefix("/log"))
    shown = [line(each, words, 70, "bot", names) for each, words in zip(events, told, strict=True)]
    assert [words.split(" H ")[1].rstrip() for words in shown] == [
        "…/LF…winding_temperature over 50: 51.25", "…/LH…winding_temperature over 50: 51.25",
    ]  # fmt: skip


@pytest.mark.parametrize("width", [72, 78, 90])
def test_a_long_name_keeps_its_end_where_a_line_has_room_for_some_of_it(width):
    one = event("other", f"finished /work/{'robot/' * 12}demo_00009_torque_5.silo")
    shown = line(one, one.text, width, "bot")
    assert shown.rstrip().endswith("torque_5.silo")
    assert "finished …" in shown
    assert len(shown) <= width


def test_control_characters_stay_off_the_screen():
    wild = event(text="\x1b[2J", who="\x1b[31m")
    assert "\x1b" not in line(wild, words(wild), 80, "bot")


def test_an_event_has_the_cell_of_its_column():
    found = columns_of([event(at_ns=95), event("lost", at_ns=10), event("saved", at_ns=50)], 10, 10, 5)
    assert found == {4: "M", 0: "X"}
    assert columns_of([event("started", GOES_ON, at_ns=95)], 10, 10, 5) == {4: "E"}  # by what an edit is applied


def test_of_several_events_in_a_cell_the_rarer_one_is_shown_whatever_came_last():
    for kind, letter in (("marker", "M"), ("triggered", "T"), ("started", "S"), ("lost", "X"), ("edited", "E")):
        assert columns_of([event(kind, at_ns=95), event("limit", at_ns=96)], 10, 10, 5) == {4: letter}
        assert columns_of([event("limit", at_ns=95), event(kind, at_ns=96)], 10, 10, 5) == {4: letter}


def test_limits_stand_in_plots_of_their_signal_alone():
    over = event("limit", "/log/a H 35.2 Nm at tick 4, limit 35")
    assert in_plots([over, event()], 0, SECOND, {"/log/b", "/log/a_more"}) == [event()]
    assert in_plots([over, event()], 0, SECOND, {"/log/a"}) == [over, event()]


def test_marks_stand_where_they_were_set_not_where_they_were_written():
    early, alarm, mark = (
        event("started", at_ns=1, number=1),
        event("limit", at_ns=30, number=2),
        event(at_ns=20, number=3),
    )
    assert in_time([early, alarm, mark]) == [early, mark, alarm]
    other = event("started", at_ns=5, number=4, run="s")  # a run by another clock
    loose = event("crashed", at_ns=2, number=5, run="")
    assert in_time([early, alarm, other, mark, loose]) == [early, mark, alarm, other, loose]
    late = event("limit ended", at_ns=40, number=6)  # told when the next run goes on already
    cut = event("lost", at_ns=7, number=3, run="")
    assert in_time([early, cut, alarm, other, late, loose]) == [early, cut, alarm, late, other, loose]


def test_what_was_told_late_stands_where_its_tick_was():
    saved, mark = event("saved", at_ns=90), replace(event(at_ns=40), time_ns=95)
    assert in_time([saved, mark]) == [mark, saved]
    of_no_tick = replace(event("recording"), time_ns=92, stamp_ns=0, tick=-1)
    assert in_time([saved, of_no_tick, mark]) == [mark, saved, of_no_tick]


@pytest.mark.parametrize(
    ("kind", "late_ns", "of_tick"),
    [("limit ended", 800_000_000, True), ("triggered", 10**6, True), ("limit", 0, True), ("saved", 10**9, False),
     ("edited", 7 * 10**6, True), ("started", 0, True), ("edited", -1, False),
     ("captured", 3599 * SECOND, True), ("limit", 3600 * SECOND, False), ("limit", -1, False)],
)  # fmt: skip
def test_what_is_of_a_tick_was_then_as_plots_have_it_not_when_it_was_told(kind, late_ns, of_tick):
    stamp_ns = 1_790_000_000_000_000_000
    seen = LoggedEvent(kind, "seen", stamp_ns + late_ns, 3, stamp_ns, "robot", "run1", 2)
    assert seen.clock_ns == (stamp_ns if of_tick else seen.time_ns)
    assert wall_clock(seen.clock_ns, 3) in line(seen, "seen", 80, "robot")
    told = LoggedEvent("edited", "1 edit", stamp_ns + SECOND, 4, stamp_ns, "robot", "run1", 1)
    assert in_time([told, seen]) == ([seen, told] if seen.clock_ns <= stamp_ns else [told, seen])


def test_a_flickering_limit_pushes_out_no_marks():
    mark = event(number=1)
    many = [event("limit", number=number) for number in range(2, 3 * MOST)]
    kept = newest([mark, *many])
    assert kept[0] == mark
    assert kept[1:] == many[-MOST:]
    assert newest([event(number=number) for number in range(MOST + 5)])[0].number == 5


def test_a_limit_that_is_crossed_again_and_again_is_one_line_with_how_often_and_how_long():
    crossed = [
        event(kind, f"/{name} {words}", at_ns=at * SECOND, number=at)
        for at, (name, kind, words) in enumerate(
            [("a", "limit", "H 3 Nm"), ("b", "limit", "H 1 V"), ("a", "limit ended", "is well")] * 3
            + [("c", "limit", "")],
            start=1,
        )
    ]
    mark = event(at_ns=20 * SECOND, number=20)
    few = [event("limit", "/a H 3 Nm", at_ns=at * SECOND, number=at) for at in (21, 22, 23)]
    found = folded([*crossed, mark, *few])
    assert [(one.number, one.times) for one in found[:6]] == [(2, 1), (5, 1), (8, 1), (1, 6), (10, 1), (20, 1)]
    assert (found[3].text, found[3].kind, found[6:]) == ("6 events in 8 s: /a is well", "limit", few)
    several = event("limit", "/a H 9 Nm at tick 4, limit 2, 7 times", at_ns=10 * SECOND, times=7)
    assert folded([*crossed[:-1], several])[-1].text == "7 events in 9 s: /a H 9 Nm at tick 4, limit 2"


def test_the_parts_that_a_recording_finished_are_one_line():
    parts = [
        event("recording", f"recording 'demo': finished a part, it goes on in the next (it has 5 MB): /d/{at}.mcap",
              at_ns=at * SECOND, number=at)
        for at in range(1, 6)
    ]  # fmt: skip
    ended = event("recording", "recording 'demo' ended: 5 files", at_ns=6 * SECOND, number=6)
    found = folded([*parts, ended])
    assert [(one.number, one.times, one.kind) for one in found] == [(1, 5, "recording"), (6, 1, "recording")]
    assert found[0].text.startswith("5 events in 4 s: recording 'demo': finished a part")
    assert folded(parts[:3]) == parts[:3]


def test_the_robot_program_is_named_whole():
    assert line(event(who="the robot program"), "x", 80, "demo").endswith("  the robot program")


def test_only_the_newest_run_is_on_the_clock_of_the_plots():
    old, new = event(run="a"), event(run="b", number=2)
    assert of_last_run([old, new, event("saved", run="")]) == [new]


def test_rows_that_are_gone_are_told_with_the_file_that_has_them():
    mark, saved = event(), event("saved", "saved logs/x.silo (3 kB)", number=2)
    assert gone_words(mark, [mark, saved]) == "rows gone; saved logs/x.silo (3 kB)"
    assert "no save" in gone_words(mark, [mark])
    files = [SavedRecording(f"at{at}", [], begun_ns=at, span_s=s) for at, s in ((1, 1e9), (mark.at_ns, 1), (9**19, 1))]
    assert gone_words(mark, [mark, saved], files) == f"rows gone; at{mark.at_ns} has them"
    begun = replace(mark, kind="recording", number=mark.number - 1, text="recording 'demo' of all to /logs")
    part = replace(mark, kind="recording", number=mark.number + 1, text="recording 'demo': finished demo_1.mcap")
    assert gone_words(mark, [begun, mark, part]) == f"rows gone; {part.text}"
    assert "no save" in gone_words(mark, [mark, replace(begun, number=mark.number + 1), part]), "it began later"


@pytest.fixture
def running(fake):
    fake.run(20.0)
    fake.happen("started", "started", fake.started_ns)
    fake.happen("marker", "push 3", fake.now_ns - 2 * SECOND)
    fake.happen("edited", "3 elements changed", fake.now_ns - SECOND, who="op@desk silo-tui 3")
    return fake


async def test_the_events_screen_shows_newest_first_and_follows_and_a_line_that_the_mouse_chose_stays_under_the_cursor(
    running, screen
):
    await screen.do("events", shows="3 events, follows")
    lines = [each for each in screen.text.splitlines()[1:] if ":" in each]
    assert "E 3 elements changed" in lines[0]
    assert 'M "push 3"' in lines[1]
    running.happen("lost", "12 rows lost", running.now_ns)
    await screen.shows("X 12 rows lost")
    await screen.shows("4 events, follows")
    await screen.pilot.click("#list-lines", offset=(5, 2))
    await screen.shows("4 events, g follows")
    running.happen("lost", "13 rows lost", running.now_ns)
    await screen.shows("5 events, g follows")
    assert screen.app.screen.chosen.text == "push 3"
    await screen.do("list_top", shows="5 events, follows")


@pytest.mark.parametrize("lost", [1, 2, 5])
async def test_lines_whose_news_got_lost_are_asked_for_with_the_next_one(running, monkeypatch, lost, screen):
    await screen.do("events", shows="3 events, follows")
    with monkeypatch.context() as thin:
        thin.setattr(running, "publish", lambda *_, **__: None)
        for number in range(lost):
            running.happen("marker", f"unheard {number}", running.now_ns)
    running.happen("marker", "heard", running.now_ns)
    await screen.shows('M "heard"')
    await screen.shows(f"{4 + lost} events, follows")
    assert all(f'M "unheard {number}"' in screen.text for number in range(lost))
    numbers = [event.number for event in screen.app.context.session.happened]
    assert numbers == list(range(1, 5 + lost))


async def test_signals_and_files_have_one_name_in_events_and_messages(running, opened):
    running.happen("limit", "/log/legs/LF/HAA/torque H 12 Nm at tick 3, limit 10", running.now_ns)
    running.happen("captured", "capture 3 of 'fall': /home/ann/logs/robot_fall_3.silo", running.now_ns)
    async with opened(running) as screen:
        running.publish(running.kinds.BLIND, "fall sees nothing: /log/legs/LF/HAA/torque is off")
        await screen.shows("fall sees nothing: /legs/LF/HAA/torque is off")
        running.publish(running.kinds.CAPTURED, "capture 4 of 'fall': /home/ann/logs/robot_fall_4.silo")
        await screen.shows("capture 4 of 'fall': robot_fall_4.silo")
        await screen.do("events", shows="H /legs/LF/HAA/torque H 12 Nm")
        await screen.shows("capture 3 of 'fall': robot_fall_3.silo")
        await screen.press("/", *"/log/legs", "enter", shows="1 of 5")


@pytest.mark.parametrize("words", ["1:20:3", "4 000", "4000"])
def test_a_filter_finds_a_moment_and_a_tick_as_they_are_read_and_typed(words):
    stamp_ns = int(time.mktime((2026, 9, 21, 1, 20, 35, 0, 0, -1))) * SECOND
    one = LoggedEvent("marker", "push", stamp_ns, 4000, stamp_ns, "ann", "run1", 1)
    assert matches(one, words, "")
    assert not matches(one, "1:21", "")
    assert line(one, "push", 80, "robot").startswith("  01:20:35.000       4 000 M push")


async def test_enter_goes_there_in_the_plots(running, screen):
    await screen.plot("m")
    await screen.do("events", "j", "enter", shows="at -1.998 s")
    await screen.shows(': "push 3"')
    assert "PAUSED" in screen.text
    assert screen.app.screen.window.at_ns == running.happened[1].at_ns


async def test_what_happens_meanwhile_stands_above_the_event_under_the_cursor(running, opened):
    running.happen("marker", "push 3", running.now_ns - SECOND)
    async with opened(running) as screen:
        await screen.plot("m")
        await screen.do("events", shows='M "push 3"')
        running.happen("marker", "push 4", running.now_ns)
        await screen.shows('M "push 4"')
        await screen.shows("5 events, follows")
        lines = [each for each in screen.text.splitlines()[1:] if " M " in each]
        assert ("push 4" in lines[0], lines[1][0], "push 3" in lines[1]) == (True, ">", True)
        await screen.press("enter", shows=': "push 3"')


async def test_a_line_of_several_goes_up_as_another_one_comes(running, opened):
    def over(name, before):
        running.happen("limit", f"/log/{name} H 3 Nm", running.now_ns - round(before * SECOND / 10))

    for before in range(20, 10, -1):
        over("ab"[before % 2], before)
    async with opened(running) as screen:
        await screen.do("events", "j", shows="5 events in ")

        def shown():
            return [
                line.split(": /log/")[1][0]
                for line in screen.text.splitlines()
                if " H 5 ev" in line or " H 6 ev" in line
            ]

        await screen.until(lambda: shown() == ["a", "b"] or shown() == ["b", "a"], "both lines")
        first, second = shown()
        over(second, 10.5)  # before what stands above both
        await screen.until(lambda: shown() == [second, first], "the newest at the top")
        assert "orders anew" not in screen.text


async def test_an_event_that_others_push_off_the_screen_leaves_the_cursor_to_the_newest(running, screen, size=(80, 24)):
    await screen.do("events", shows="3 events, follows")
    for number in range(30):
        running.happen("marker", f"push {number}", running.now_ns)
    await screen.shows("33 events, follows")
    await screen.until(lambda: screen.app.screen.lines.scroll_offset.y == 0)
    assert int(screen.app.screen.chosen.text.split()[1]) >= 10
    assert screen.app.screen.lines.highlighted < screen.app.screen.lines.size.height
    assert '"push 29"' in screen.text


@pytest.mark.parametrize(
    ("kind", "words", "plotted"),
    [("limit", "/log/imu/temperature HH: 71 > 70", "/log/imu/temperature"),
     ("triggered", "trigger 'fall' fired 1 time", "/log/base/velocity"),
     ("marker", "push", "/log/legs/LF/contact")],
)  # fmt: skip
async def test_without_plots_enter_opens_those_of_what_it_is_about_else_of_the_cursor(
    running, opened, kind, words, plotted
):
    running.trigger_statuses = [TriggerStatus(TriggerOptions("fall", "base/velocity_x > 1"), TriggerWord.ARMED)]
    running.happen(kind, words, running.now_ns)
    async with opened(running) as screen:
        await screen.until(lambda: screen.session.triggers)
        await screen.enter(":goto /log/legs/LF/contact")
        await screen.do("events", "enter", shows=words.removeprefix("/log") if kind == "limit" else words)
        await screen.until(lambda: screen.app.screen.scope == "monitor", "plots")
        assert {each.element.name for each in screen.app.screen.stack.plots} == {plotted}
        await screen.until(lambda: screen.app.screen.window.at_ns is not None, "the moment")
        await screen.press("escape", at="events")  # what one key entered


@pytest.mark.parametrize(("about", "plotted"), [("/log/imu/temperature", 1), ("/log/legs/LF/contact", 0), ("", 0)])
async def test_an_event_about_a_signal_is_never_shown_in_plots_of_others(running, opened, about, plotted):
    running.happen("limit" if about else "marker", f"{about} HH: 71 > 70", running.now_ns)
    async with opened(running) as screen:
        await screen.enter(":goto /log/legs/LF/contact")
        await screen.plot("m")
        below = screen.app.screen
        await screen.do("events", "enter", at="monitor")
        await screen.until(lambda: screen.app.screen.window.at_ns is not None, "the moment")
        names = {each.element.name for each in screen.app.screen.stack.plots}
        assert (screen.app.screen is below, names) == (not plotted, {about or "/log/legs/LF/contact"})


async def test_a_marker_has_the_tick_of_the_key_press_and_the_words_that_follow_and_left_by_esc_is_none(
    running, screen
):
    await screen.do("set_marker", "x", "escape")
    for typed, told in (("it slipped", "it slipped"), ("", "marker")):
        await screen.until(lambda: screen.session.frame_time_ns == running.now_ns)
        pressed_ns = running.now_ns
        await screen.do("set_marker")
        running.advance(5.0)
        await screen.enter(typed)
        await screen.until(lambda asked=("mark", told, pressed_ns): asked in running.calls)
        await screen.shows(f'"{told}"')
    assert len([call for call in running.calls if call[0] == "mark"]) == 2


@pytest.fixture
def flickering(fake):
    fake.run(20.0)
    fake.happen("marker", "push 3", fake.now_ns - 2 * SECOND)
    for step in range(200):
        fake.happen("limit", "/log/nowhere H 3 Nm at tick 1, limit 2", fake.now_ns - step * SECOND // 20)
    return fake


async def test_limits_of_other_signals_hide_neither_plots_nor_marks(flickering, opened):
    async with opened(flickering) as screen:
        await screen.plot("m")
        await screen.until(lambda: "M" in screen.text.splitlines()[-3], "the letter of the mark")
        assert "H" not in screen.text.splitlines()[-3]
        await screen.do("space", "previous_event")
        await screen.shows('event, 1 of 1: "push 3"')
        await screen.do("events", shows=" events in 7.9 s: ")
        await screen.shows("201 events in 3 lines (/ shows each)")
        await screen.do("write_events", shows="201 events as shown, to a CSV file")
        await screen.press("escape")
        await screen.enter("/limit")
        await screen.until(lambda: screen.text.count(" H 3 Nm at tick 1") > 10, "each of them")


async def test_plots_have_a_line_and_a_letter_where_something_happened_and_keys_go_there(running, screen):
    await screen.plot("m")
    await screen.until(lambda: "╎" in screen.text and "M" in screen.text.splitlines()[-3], "a line and its letter")
    await screen.do("space", "find", "m", "enter", shows="marker, 1 of 1")
    assert screen.app.screen.window.at_ns == running.happened[1].at_ns
    await screen.do("next_event")
    await screen.until(lambda: screen.app.screen.window.at_ns == running.happened[2].at_ns)


async def test_where_nothing_is_marked_the_menu_says_so_of_unmark(running, screen):
    await screen.do("mark", "events", at="events")
    assert screen.app.screen.why_not_now("unmark") == "none marked"


async def test_a_read_only_session_sees_events_and_marks_nothing(running, screen, read_only=True):
    await screen.do("set_marker", shows="read-only")
    await screen.do("events", shows="3 events")


async def test_a_file_has_its_events_too(tmp_path, screen_of, new_finder):
    time_ns = 1_700_000_000 * SECOND + np.arange(500) * 10_000_000
    entry = RecordedEntry("/log/x", Entry("", "<f8"), np.sin(np.arange(500) / 20))
    x = RecordedElement("/log/x", "-", "scalar", (), 1, BufferType.GROWING, 0, (entry,))
    limit = LoggedEvent("limit", "/log/x H 0.9 at tick 40, limit 0.8", 1, 40)
    marks = stamped([limit, LoggedEvent("marker", "push 3", 1, 250)], time_ns, 500)
    write_silo(Recording("bot", time_ns, 500, [x], events=marks), tmp_path / "x.silo")
    async with screen_of(SiloApp(new_finder(), file=open_file(tmp_path / "x.silo"))) as screen:
        await screen.shows("/log/x"[5:])
        await screen.plot("m")
        await screen.until(lambda: "╎" in screen.text)
        await screen.do("events", shows='M "push 3"')
        await screen.shows("H /x H 0.9, limit 0.8")
        assert "what it was" in screen.text
        assert " who" not in screen.text  # nobody did it
        assert "│ 2 events" in screen.text
        assert "follows" not in screen.text  # nothing comes to a file
        await screen.press("enter", shows="at 2.5")
        await screen.shows(': "push 3"')


async def test_letters_stand_beside_the_times_of_the_axis_never_over_them(flickering, opened):
    fake = flickering
    async with opened(fake) as screen:
        await screen.plot("m")
        name = screen.app.screen.stack.on_screen()[0].name
        for step in range(200):
            fake.happen("limit", f"{name} H 3 Nm at tick 1, limit 2", fake.now_ns - step * SECOND // 20)
        await screen.until(lambda: "H" in screen.text.splitlines()[-3], "limits under the plots")
        axis = screen.text.splitlines()[-3]
        assert [word in axis for word in ("-10 s", "-7.5 s", "-5 s", "-2.5 s", "now", "M")] == [True] * 6


async def test_both_cursors_have_their_letter_where_they_stand_on_one_another(running, screen):
    await screen.plot("m")
    await screen.do("space", "cursor_b")

    def axis():
        return next((line for line in screen.text.splitlines() if "-7.5 s" in line), "")

    await screen.until(lambda: "A" in axis() and "B" in axis(), "both letters")
    assert "-5 s" in axis()


@pytest.mark.parametrize(
    ("keys", "mark"),
    [
        (["f5"], 'episode "pick" good'),
        (["f6"], 'episode "pick" bad'),
        (["f7"], 'episode "pick" redo'),
        (["f8", "c", "u", "p", "enter"], 'episode "cup" begin'),
        ([":", *"episode end", "enter"], 'episode "pick" end'),
    ],
)
async def test_a_key_says_how_an_episode_went(running, opened, keys, mark):
    running.happen("marker", 'episode "pick" begin', running.now_ns)
    async with opened(running) as screen:
        await screen.press(*keys)
        await screen.until(lambda: [call[1] for call in running.calls if call[0] == "mark"] == [mark])
        await screen.shows(mark)


async def test_of_an_episode_one_may_say_how_it_went_before_it_was_told_that_it_began(running, opened, monkeypatch):
    running.happen("marker", 'episode "pick" begin', running.now_ns)
    told, events = threading.Event(), running.events
    monkeypatch.setattr(running, "events", lambda *given: events(*given) if told.wait(DEADLINE_S) else [])
    async with opened(running, ready=False) as screen:
        await screen.until(lambda: screen.app.context.has_session and len(screen.session.table), "the table")
        await screen.press("f7")
        told.set()
        await screen.until(lambda: [call[1] for call in running.calls if call[0] == "mark"] == ['episode "pick" redo'])


async def test_without_an_episode_it_is_said_that_there_is_none(running, screen):
    await screen.press("f5")
    await screen.shows("no episode was begun in this run to say good of: begin one first")


@pytest.mark.parametrize(("at_s", "scope"), [(None, "events"), (0.0, "file_events")])
def test_the_keys_of_events_of_a_file_are_those_of_a_file(at_s, scope):
    assert EventsScreen(SimpleNamespace(at_s=at_s)).scope == scope


@pytest.mark.parametrize(("about", "plotted"), [("", ""), ("/imu/temperature ", ""), ("", "/imu/temperature")])
async def test_the_list_shows_which_moments_are_overwritten_and_enter_says_which_file_has_them(
    fake, opened, about, plotted
):
    longest = replace(fake.elements[0].options, size=40_000 if about or plotted else 4000)
    fake.elements[0] = replace(fake.elements[0], options=longest)  # what another one shows is gone before
    async with opened(fake.run(20)) as screen:
        if plotted:
            await screen.enter(plotted, "m")
        await _look_for_what_is_gone(fake, screen, f"{about}old")


async def _look_for_what_is_gone(fake, screen, told):
    await screen.do("set_marker")
    await screen.enter(told)
    await screen.until(lambda: [each for each in screen.session.happened if each.text == told], "the marker")
    fake.advance(30.0)  # three times what the buffers hold
    await screen.until(lambda: screen.session.frame_time_ns == fake.now_ns, "what came since")
    await screen.do("set_marker")
    await screen.enter("new")
    await screen.until(lambda: [each for each in screen.session.happened if each.text == "new"], "the marker")
    await screen.do("events", shows="× no longer in memory")
    listed = screen.app.screen
    (old,) = [at for at, each in enumerate(listed.shown) if each.text == told]
    (new,) = [at for at, each in enumerate(listed.shown) if each.text == "new"]
    assert [line for line in screen.text.splitlines() if f'"{told}"' in line and "×" in line[:3]]
    assert not [line for line in screen.text.splitlines() if '"new"' in line and "×" in line[:3]]
    listed.move(old)
    await screen.shows("held no more")
    assert "Enter Go there" not in screen.text
    await screen.do("go_to_event", shows="no plot has it: its rows are held no more")
    assert screen.app.screen is listed
    listed.move(new)
    await screen.shows("Enter Go there")
    await screen.do("go_to_event")
    await screen.until(lambda: screen.app.screen is not listed, "the plots")


async def test_a_moment_that_a_pause_holds_is_not_gone(fake, screen, ran_s=20):
    await screen.enter("/torque", "m")
    await screen.curves()
    await screen.do("set_marker")
    await screen.enter("here")
    await screen.until(lambda: [each for each in screen.session.happened if each.text == "here"], "the marker")
    fake.advance(2.0)
    await screen.do("pause")
    await screen.until(lambda: screen.app.screen.pause.source is not None, "what is held")
    await screen.until(lambda: screen.app.screen.pause.settled, "what is held")
    fake.advance(30.0)
    await screen.do("events")
    listed = screen.app.screen
    await screen.until(lambda: listed.session.status.last_tick_ns == fake.now_ns, "how it stands")
    (one,) = [each for each in listed.shown if each.text == "here"]
    assert not listed._is_gone(one)
    fake.elements.pop(next(at for at, each in enumerate(fake.elements) if each.name.endswith("/torque")))
    fake.revision += 1
    fake.publish(EventKind.EDITED, "another table")
    await screen.shows("71/71")
    listed._buffers_s = {}  # as when the list is read again
    assert not listed._is_gone(one)  # the plots below are of what there is no more

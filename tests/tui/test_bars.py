"""The lines around the table, without an app: the head, the banner, the key bar, and the line of messages."""

import asyncio
import itertools
import time
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest
from rich.console import Console

from silo.conditions.standing import LimitStatus, LimitWord, TriggerStatus
from silo.core.conditions import TriggerOptions, TriggerWord
from silo.core.elements import Control, LoggedEvent, Present, RecorderState, State
from silo.core.tuning.parameters import ParameterChange
from silo.recorder.requests import RecorderInfo
from silo.rpc.published import Event, EventKind
from silo_tui.actions import BY_ID, key_of
from silo_tui.model.samples.live import Reading
from silo_tui.model.table.facts import Facts
from silo_tui.model.table.fields import Field
from silo_tui.model.words import text
from silo_tui.sessions.live import Session
from silo_tui.widgets import bars, messages
from silo_tui.widgets.bars import Banner, KeyBar, StatusBar
from tests.stand_ins.desk import NAME, SAVED, Desk, Drawn
from tests.stand_ins.fake_signals import scalar


class Head(Drawn, StatusBar):
    """The head."""


class Top(Drawn, Banner):
    """The banner."""

    display = False


class Keys(Drawn, KeyBar):
    """The key bar."""


class Said(Drawn, messages.InfoLine):
    """The line of messages of a table."""


class OfList(Drawn, messages.ListLine):
    """The line of messages of a list."""


class OfPlots(Drawn, messages.MonitorLine):
    """The line of messages of plots."""


@pytest.fixture
def desk(fake):
    return Desk(fake.run())


def head(desk: Desk, width: int = 80, *, read_only: bool = False, mode: str = "") -> str:
    drawn = Head(desk.session)
    drawn.width, drawn.read_only, drawn.mode = width, read_only, mode
    return drawn.render().plain


def told(desk: Desk, **status: Any) -> Desk:
    """As the logger tells of itself."""
    desk.session.status = msgspec.structs.replace(desk.session.status, **status)
    return desk


# ------------------------------------------------------------------------------------------------------------- the head

RUNS = "silo anymal/robot  ● RUNNING 00:12  lost 0"
RATE = "  400.0 of 400 Hz"
STILL = f"{RUNS}{RATE}"
ALL_ON = "       72/72 elements on"  # behind the room for "slow"


@pytest.mark.parametrize(
    ("width", "line"),
    [
        (44, "silo robot  ● RUNNING 00:12  lost 0"),
        (59, f"silo robot  ● RUNNING 00:12  lost 0{RATE}"),
        (60, STILL),
        (99, f"{STILL}       72/72 on"),
        (100, f"{STILL}{ALL_ON}  4 800 ticks"),
    ],
)
def test_the_head_says_who_in_what_state_how_long_and_how_fast_as_far_as_it_has_room(width, line, desk):
    assert head(desk, width) == line


def at_end(line: str, words: str, width: int) -> str:
    return f"{line}{words:>{width - len(line)}}"


@pytest.mark.parametrize(
    ("change", "width", "line"),
    [
        ({"state": State.STOPPED}, 80, "silo anymal/robot  ■ STOPPED 00:12  lost 0  72/72 on"),
        ({"state": State.DEAD}, 80, "silo anymal/robot  ✖ DEAD 00:12"),
        ({"started_ns": 0}, 80, f"silo anymal/robot  ● RUNNING  lost 0{RATE}       72/72 on"),
        ({"host": ""}, 80, f"silo robot  ● RUNNING 00:12  lost 0{RATE}       72/72 on"),
        ({"helper_pid": 0}, 80, "silo anymal/robot  connecting …"),
        ({"recorders": 2}, 80, at_end(STILL, "REC 2", 80)),
        ({"recorders": 2}, 100, at_end(f"{STILL}{ALL_ON}", "REC 2", 100)),
        ({"derived": 3}, 120, f"{STILL}{ALL_ON} +3 derived  4 800 ticks"),
        ({"derived": 3}, 100, f"{STILL}{ALL_ON} +3 derived"),
        ({"derived": 3, "frequency_hz": 900.0}, 90, f"{RUNS}  400.0 of 900 Hz slow  72/72 on +3 derived"),
        ({"before_ticks": 1200}, 130, f"{STILL}{ALL_ON}  1 200 ticks before the cut, 4 800 since"),
        ({"before_ticks": 1200}, 110, f"{STILL}{ALL_ON}  4 800 ticks since the cut"),
        ({"durable_ticks": 0}, 120, at_end(f"{STILL}{ALL_ON}  4 800 ticks", "durable to tick 0", 120)),
        ({"durable_ticks": 4000}, 160, at_end(f"{STILL}{ALL_ON}  4 800 ticks", "durable to tick 4 000", 160)),
        ({"control": Control("me@here silo 1", "@local me", 0, 0)}, 80,
         f"{RUNS}  400.0 Hz  you have control in silo 1"),
        ({"clients": [Present("a", 0), Present("b", 0)]}, 80, at_end(STILL, "1 other client", 80)),
    ],
)  # fmt: skip
def test_the_head_follows_what_the_logger_tells(change, width, line, desk):
    assert head(told(desk, **change), width) == line


@pytest.mark.parametrize(
    ("keep", "width", "words"),
    [
        (50_000_000_000, 80, "REC 1  21 of 50 GB"), (0, 80, "REC 1  21 GB"), (50_000_000_000, 61, "REC 1"),
        (50_000_000_000, 120, "REC 1  21 of 50 GB"),
    ],
)  # fmt: skip
def test_of_what_records_the_head_tells_how_much_is_on_the_disk_where_there_is_room(keep, width, words, desk):
    one = RecorderInfo("all", "/logs/all", RecorderState.RECORDING, size_bytes=21_000_000_000, keep_bytes=keep)
    one = msgspec.structs.replace(one, written_bytes=21_000_000_000)
    desk.session.recorders = [one, msgspec.structs.replace(one, state=RecorderState.FAILED)]
    assert head(told(desk, recorders=1), width).endswith(f"  {words}")


@pytest.mark.parametrize(
    ("change", "width", "line"),
    [
        ({"lost_total": 3}, 80, f"{STILL}       72/72 on".replace("lost 0", "lost 3")),
        ({"measured_hz": 399.6}, 80, f"{RUNS}  399.6 of 400 Hz       72/72 on"),
        ({"measured_hz": 0.0}, 80, f"{RUNS}      … of 400 Hz       72/72 on"),
        ({"measured_hz": 99.04}, 80, f"{RUNS}   99.0 of 400 Hz slow  72/72 on"),
        ({"measured_hz": 200.0, "jitter_s": 0.0012}, 80, f"{RUNS}  200.0 of 400 Hz slow  72/72 on"),
        ({"measured_hz": 200.0, "jitter_s": 0.0012}, 120, f"{RUNS}  200.0 of 400 Hz slow  72/72 elements on"
         "  4 800 ticks  jitter 1.2 ms"),
        ({"idle_s": 60.0}, 80, f"{RUNS}  ‼ no tick for 60 s       72/72 on"),
        ({"may_edit": False}, 80, at_end(STILL, "read-only", 80)),
        ({"address": "here/robot"}, 80, f"silo here/robot  ● RUNNING 00:12  lost 0{RATE}       72/72 on"),
        ({"link": None}, 80, "silo anymal/robot  connecting …"),
    ],
)  # fmt: skip
def test_the_head_follows_what_is_measured_and_who_one_is(change, width, line, desk):
    desk.session.measured_hz = 400.0
    for name, value in change.items():
        setattr(desk.session, name, value)
    assert head(desk, width) == line


@pytest.mark.parametrize("mode", ["", "PAUSED"])
@pytest.mark.parametrize("width", [80, 120, 160])
def test_nothing_of_the_head_moves_whatever_comes_and_goes(width, mode, desk, monkeypatch):
    """Slow or not, busy or not, alarms or none: what stays stands where it stood."""
    desk.session.measured_hz, desk.session.address = 400.0, "vm/demo"
    limits = [LimitStatus(NAME, NAME, word, alarm=True) for word in (LimitWord.RED_HIGH, LimitWord.OK)]
    always = head(desk, width, mode=mode)
    for rate, busy, alarms in itertools.product(
        (399.96, 400.0, 361.4, 99.9), ("", "DRAWN 3.4 of 5 Hz"), ([], limits[1:], limits[:1] if mode else limits)
    ):
        desk.session.measured_hz, desk.session.limits = rate, alarms
        monkeypatch.setattr(bars, "thin_head", lambda _, room, busy=busy: busy if room >= len(busy) else "")
        line = head(desk, width, mode=mode)
        assert "1 alarm" in line or limits[0] in alarms or not alarms
        assert line.index("lost 0") == always.index("lost 0")
        assert " of 400 Hz" not in line or line.index(" of 400 Hz") == always.index(" of 400 Hz")
        assert (" slow" in line) == (rate < 370)
        assert "72/72" not in line or line.index("72/72") == always.index("72/72")
        assert "DRAWN" not in line or (busy and not mode)  # what stands still is not drawn too rarely
        assert "1 alarm (HH)" in line or limits[0] not in alarms, "it gives way first"
        assert len(line) <= width


@pytest.mark.parametrize(
    ("rate", "nominal", "words"),
    [(400.0, 400.0, "400.0"), (0.0, 400.0, "    …"), (99.96, 100.0, "100.0"), (7.5, 50.0, " 7.50"),
     (999.6, 1000.0, "1000"), (0.5, 1.0, "0.500"), (12.25, 0.0, "12.2")],
)  # fmt: skip
def test_a_rate_is_as_wide_as_what_it_should_be(rate, nominal, words):
    assert bars.rate_words(rate, nominal) == words


def test_who_looks_alone_is_told_so(desk):
    assert head(desk, read_only=True).endswith("  read-only")


def test_without_a_link_the_head_says_since_when_and_what_it_was(desk, monkeypatch):
    desk.session.lost_since = 100.0
    monkeypatch.setattr(time, "monotonic", lambda: 175.0)
    assert head(desk) == "silo anymal/robot  ~ NO LINK 75 s, was RUNNING"
    closed = Event(1, 1, EventKind.CLOSED, "the robot program closed its logger", status=desk.session.status)
    asyncio.run(desk.session.take_event(closed))
    assert head(desk) == "silo anymal/robot  - CLOSED 75 s, was RUNNING"
    asyncio.run(desk.session.regain())  # another program of that name, which is cut off
    desk.session.lost_since = 100.0
    desk.session.lost_total = 2
    assert head(desk) == "silo anymal/robot  ~ NO LINK 75 s, was RUNNING  lost 2"


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(None, "…"), (0.9, "0 s"), (1.0, "1 s"), (119.9, "119 s"), (120, "2 min"), (7199, "119 min"), (7200, "2 h")],
)
def test_since_when_is_told_in_whole_units(seconds, words):
    assert text.since(seconds) == words


@pytest.mark.parametrize(
    ("width", "line"),
    [
        (100, f"{RUNS[:-8]}   paused, 3 s ago  y held   lost 0{RATE}"),
        (54, "silo robot  ● RUNNING 00:12   paused   lost 0"),
        (42, "silo robot  ● RUNNING   paused, y   lost 0"),
        (36, "silo robot  ● RUNNING   paused, y "),
        (28, "robot  ● RUNNING   paused, y "),
    ],
)
def test_a_mode_stands_behind_the_state_and_is_shortened_before_it_goes(width, line, desk):
    drawn = Head(desk.session)
    drawn.width, drawn.mode = width, "paused, 3 s ago  y held"
    assert drawn.render().plain == line


@pytest.mark.parametrize(
    ("word", "alarm", "words", "style"),
    [
        ("HH", True, "1 alarm (HH)", "alarm"),
        ("H", True, "1 alarm (H)", "warning"),
        ("H", False, "1 alarm (H) seen", "warning"),
    ],
)
def test_an_alarm_stands_in_the_head_and_its_words_give_way_at_last(word, alarm, words, style, desk):
    desk.session.limits = [LimitStatus(NAME, NAME, LimitWord(word), alarm=alarm)]
    drawn = Head(desk.session)
    parts = drawn.parts()
    (part,) = (part for part in parts if part.words.strip() == words)
    assert part.style == f"bold {drawn.app.theme_variables.get(style)}"
    drawn.width = 24
    assert drawn.render().plain.endswith(f"  {word} 1")


def test_that_others_are_there_gives_way_before_alarms_are_letters(desk):
    limits = [LimitStatus(NAME, NAME, word, alarm=True) for word in (LimitWord.RED_HIGH, LimitWord.OK)]
    desk.session.limits, desk.session.measured_hz = limits, 200.0
    desk.session.status = msgspec.structs.replace(desk.session.status, clients=[Present("a", 0), Present("b", 0)])
    assert head(desk, 120).endswith("  1 alarm (HH), 1 ended unseen  1 other client")
    assert head(desk, 100).endswith("of 400 Hz slow        1 alarm (HH), 1 ended unseen")
    assert head(desk, 80).endswith("200.0 Hz slow  1 alarm (HH), 1 ended")
    assert head(desk, 56).endswith("200.0 Hz slow  HH 1")


def test_a_rate_gives_way_before_alarms_are_letters_but_that_it_is_slow(desk):
    desk.session.limits = [LimitStatus(NAME, NAME, LimitWord.RED_HIGH, alarm=True)]
    assert head(desk, 64) == at_end(RUNS, "1 alarm (HH)", 64)
    desk.session.measured_hz = 200.0
    assert head(desk, 72) == at_end(f"{RUNS}  200.0 Hz slow", "1 alarm (HH)", 72)


def test_triggers_stand_in_the_head_while_there_is_room(desk):
    options = TriggerOptions("fall", "x > 1")
    desk.session.triggers = [TriggerStatus(options, TriggerWord.ARMED)]
    assert head(desk).endswith("Hz      1 trigger armed")
    assert head(desk, 30).endswith("  1 armed")
    desk.session.triggers = [TriggerStatus(options, TriggerWord.FIRING)]
    assert head(desk).endswith("Hz   trigger fall fires")


def test_of_a_dead_robot_nothing_is_told_that_would_watch(desk):
    desk.session.triggers = [TriggerStatus(TriggerOptions("fall", "x > 1"), TriggerWord.ARMED)]
    desk.session.limits = [LimitStatus(NAME, NAME, LimitWord.OK, alarm=True)]
    assert "1 trigger armed" in head(desk, 100)
    assert not {"armed", "alarm"} & set(head(told(desk, state=State.DEAD), 100).split())


@pytest.mark.parametrize(
    ("state", "words", "is_told"),
    [(State.RUNNING, "DRAWN 3.4 of 5 Hz", True), (State.STOPPED, "DRAWN 0.74 of 1 Hz", False),
     (State.STOPPED, "THIN 64 kbit/s", True)],
)  # fmt: skip
def test_of_what_stands_still_nothing_is_drawn_too_rarely(state, words, is_told, desk, monkeypatch):
    monkeypatch.setattr(bars, "thin_head", lambda _, room: words)
    assert (words in head(told(desk, state=state), 100)) is is_told


def test_words_of_alarms_and_triggers_give_way_before_the_name_of_the_logger_and_what_it_lost(desk):
    desk.session.limits = [LimitStatus(NAME, NAME, LimitWord.OK, alarm=True)]
    desk.session.triggers = [TriggerStatus(TriggerOptions("fall", "x > 1"), TriggerWord.FIRING)]
    desk.session.measured_hz = 200.0
    assert head(desk, 91) == at_end(f"{RUNS}  200.0 Hz slow", "1 alarm ended unseen  FIRES", 91)
    assert head(desk, 77) == at_end(f"{RUNS}  200.0 Hz slow".replace(" 00:12", ""), "1 alarm ended  FIRES", 77)


def test_a_thin_link_is_told_at_the_end_with_as_much_as_has_room(desk, monkeypatch):
    def thin(_: Any, room: int) -> str:
        return "THIN 1.2 of 5 Hz" if room >= 16 else "1.2 Hz"

    monkeypatch.setattr(bars, "thin_head", thin)
    assert head(desk, 80) == at_end(STILL, "THIN 1.2 of 5 Hz", 80)
    line = head(desk, 50)
    assert line.endswith("  1.2 Hz")
    assert len(line) <= 50


def test_a_head_is_painted_when_it_reads_differently(desk):
    drawn = Head(desk.session)
    drawn.render()
    drawn.painted = 0
    drawn.update()
    before = drawn.painted
    desk.session.lost_total = 1
    drawn.update()
    assert (before, drawn.painted) == (0, 1)


# ----------------------------------------------------------------------------------------------------------- the banner


def banner(desk: Desk, scope: str = "table", *, has_demo: bool = False) -> tuple[str, bool]:
    drawn = Top(desk.session)
    drawn.has_demo = has_demo
    drawn.screen = SimpleNamespace(scope=scope)
    drawn.update()
    return " ".join(line.strip() for line in drawn.render().plain.split("\n")), drawn.display


def test_where_all_is_well_there_is_no_banner(desk):
    assert banner(desk) == ("", False)
    desk.session.link = None
    assert banner(desk) == ("", False)


@pytest.mark.parametrize(
    ("scope", "edited", "words"),
    [
        ("table", False, "No link to robot. Values are 75 s old. ^l tries now."),
        ("table", True, "No link to robot. Values are 75 s old, pending edits are kept. ^l tries now."),
        ("settings", False, "No link to robot. Values are 75 s old."),
    ],
)
def test_a_lost_link_is_told_with_what_can_be_done(scope, edited, words, desk, monkeypatch):
    if edited:
        desk.edit()
    desk.session.lost_since = 100.0
    monkeypatch.setattr(time, "monotonic", lambda: 175.0)
    assert banner(desk, scope) == (words, True)


def test_a_robot_program_that_closed_its_logger_left_no_broken_link(desk):
    desk.session.lost_since = 100.0
    asyncio.run(desk.session.take_event(Event(1, 1, EventKind.CLOSED, "closed", status=desk.session.status)))
    words = "The robot program closed robot; g m tells how. silo-tui follows when it starts again."
    assert banner(desk) == (words, True)


@pytest.mark.parametrize(
    ("reason", "files", "scope", "words"),
    [
        ("", [], "table", "nothing is known of why"),
        ("killed by SIGSEGV", [], "table", "killed by SIGSEGV"),
        ("killed; saved a.silo", [], "table", "killed; saved a.silo. m opens it."),
        ("killed: saved a.silo", [], "table", "killed: saved a.silo. m opens it."),
        ("killed", [SAVED], "monitor", "killed. Enter opens it."),
        ("killed", [SAVED], "recordings", "killed. It is in this list."),
        ("killed", [SAVED], "settings", "killed. g r lists it."),
    ],
)
def test_how_a_robot_program_died_is_told_with_how_its_file_is_opened(reason, files, scope, words, desk):
    told(desk, state=State.DEAD, reason=reason)
    desk.session.left_files = files
    assert banner(desk, scope) == (f"robot died: {words}", True)
    again = "; g l, then g d starts the demo again."
    assert banner(desk, scope, has_demo=True)[0] == f"robot died: {words.rstrip('.')}{again}"


def test_that_nothing_is_logged_is_told_with_the_keys_that_change_it(desk):
    off = [
        msgspec.structs.replace(one, options=msgspec.structs.replace(one.options, enabled=False))
        for one in desk.session.table.elements
    ]
    desk.session.table.load(desk.fake.table().__class__(9, off))
    assert banner(desk)[0].startswith("Nothing is logged, every element is off: mark elements, press ")
    told(desk, state=State.STOPPED)
    assert banner(desk) == ("", False)


# ---------------------------------------------------------------------------------------------------------- the key bar


def label(command: Any) -> str:
    """As of a logger that runs, without edits."""
    return {"start_stop": "Stop", "closer": "- Zoom", "apply": "", "undo": "", "again": "", "arrange_plots": ""}.get(
        command.id, command.label
    )


def keys(
    width: int = 80, scope: str = "table", *, lost: bool = False, mode: Any = (), read_only: bool = False, **labels: str
) -> str:
    drawn = Keys()
    drawn.width, drawn.read_only = width, read_only
    session = SimpleNamespace(lost_s=3.0 if lost else None)
    drawn.screen = SimpleNamespace(
        scope=scope,
        mode_keys=lambda: mode,
        label_now=lambda command: labels.get(command.id, label(command)),
        session=session,
    )
    return drawn.render().plain


def test_plots_say_at_80_columns_how_one_leaves_them():
    assert all("Esc Back" in keys(80, scope) for scope in ("monitor", "detail", "file_monitor", "file_detail"))
    assert "e Edit" not in keys(200, "monitor")  # of the logger alone: it is no key of plots


def test_plots_have_what_holds_them_in_the_bar_at_80_columns():
    drawn = Keys()
    drawn.screen = SimpleNamespace(scope="monitor", mode_keys=lambda: (), session=None, label_now=label)
    assert drawn.render().plain.startswith(" space Pause + - Zoom")


def test_while_edits_wait_the_bar_says_how_they_are_taken_back():
    pending = {"apply": "Apply 6", "undo": "Undo", "back": ""}
    line = keys(80, mode=[("filter", "Filter"), ("back", "No filter")], **pending)
    assert all(each in line for each in ("a Apply 6", "u Undo", "e Edit", "S Stop"))
    line = keys(80, **pending)  # without a filter marks are made still
    assert all(each in line for each in ("space Mark", "u Undo", "e Edit", "g Go"))


@pytest.mark.parametrize("scope", sorted({scope for command in BY_ID.values() for scope in command.scopes} - {"any"}))
def test_each_screen_says_at_80_columns_how_one_leaves_it(scope):
    assert " Esc " in keys(80, scope)


def test_a_key_that_has_room_stands_in_the_bar_though_one_that_is_more_wanted_has_none():
    with_room = keys(60, mode=[("filter", "A word that is so long"), ("mark", "Take it")])
    assert len(with_room.rpartition("  ? Help")[0].rstrip()) > 60 - len("  ? Help q Quit") - len(" p Plots")


def test_what_a_mode_asks_for_comes_first_by_its_own_name():
    line = keys(60, mode=[("filter", "Find it"), ("mark", "Take it")])
    assert line.startswith(" / Find it space Take it ")
    assert "Filter" not in line


def test_where_the_link_is_lost_the_key_that_tries_it_comes_first():
    assert keys(80, lost=True).startswith(" ^l Try now")
    assert "Try now" not in keys(80)


def test_the_bar_is_painted_when_other_keys_count():
    drawn, mode = Keys(), []
    session = SimpleNamespace(lost_s=None)
    drawn.screen = SimpleNamespace(
        scope="table", mode_keys=lambda: mode, label_now=lambda command: command.label, session=session
    )
    drawn.render()
    drawn.painted = 0
    drawn.update()
    assert drawn.painted == 0
    mode.append(("mark", "Take it"))
    drawn.update()
    assert drawn.painted == 1


@pytest.mark.parametrize(
    ("id_of", "label", "keys"),
    [("closer", "- Zoom", "+ -"), ("scale", "Y scale", "y"), ("cursor_left", "⇧← Cursor", "←→ ⇧←")],
)
def test_all_keys_of_an_entry_look_like_keys(id_of, label, keys):
    drawn = Keys()
    word = drawn._word(msgspec.structs.replace(BY_ID[id_of], label=label))
    assert word.plain[word.spans[0].start : word.spans[0].end] == keys


def test_without_colours_keys_are_bold_alone(monkeypatch):
    drawn = Keys()
    app = drawn.app
    monkeypatch.setattr(Keys, "app", app)
    with_colour = drawn._word(BY_ID["apply"]).spans[0].style
    app.no_color = True
    assert (str(drawn._word(BY_ID["apply"]).spans[0].style), with_colour != "bold") == ("bold", True)


def test_other_keys_stand_in_the_bar_for_a_while():
    drawn = Keys()
    drawn.painted = 0
    drawn.show_instead("Enter Saves")
    assert drawn.render().plain == " Enter Saves"
    assert drawn.painted == 1


@pytest.mark.parametrize(
    ("width", "shown"),
    [(66, "Enter Stop and start again  j k Move  PgDn PgUp Scroll  Esc Back"),
     (56, "Enter Stop and start again  j k Move  Esc Back"), (40, "Enter Stop and start again  Esc Back"),
     (31, "Enter Stop and…  Esc Back")],
)  # fmt: skip
def test_of_the_keys_of_a_dialog_what_enter_does_and_the_way_back_stay(width, shown):
    drawn = Keys()
    drawn.width = width
    drawn.show_instead("Enter Stop and start again  j k Move  PgDn PgUp Scroll  Esc Back")
    assert drawn.render().plain == f" {shown}"


def test_a_click_on_a_key_does_what_it_does():
    drawn = Keys()
    word = drawn._word(BY_ID["apply"])
    assert {span.style.meta["@click"] for span in word.spans if getattr(span.style, "meta", None)} == {
        "screen.command('apply')"
    }


# ------------------------------------------------------------------------------------------------- the line of messages


@pytest.fixture
def said(desk):
    return Said(desk.session)


def test_a_table_says_how_much_of_it_there_is(said):
    rows = said.session.rows
    rows.refresh()
    assert said.words().plain == "element 1 of 72"
    rows.order_by("tree")
    rows.refresh()
    assert said.words().plain == f"72 in {len(rows.tree.branches)} name spaces"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda rows, table: rows.set_filter("torque"), "/torque: 12 of 72"),
        (lambda rows, table: rows.marked.__setitem__(slice(0, 3), True), "3 marked │ v u unmarks"),
        (lambda rows, table: table.edit([0, 1], Field.DIVIDER, 5), "2 pending in 2 elements (a to apply)"),
        (lambda rows, table: setattr(rows, "sort", "div"), "by div ↓; o l: by name"),
    ],
)
def test_of_a_table_it_is_told_what_is_marked_pending_filtered_and_ordered(change, words, desk, said):
    change(desk.session.rows, desk.session.table)
    desk.session.rows.refresh()
    assert said.words().plain == words


@pytest.mark.parametrize(
    ("marked", "words", "stays"),
    [
        (0, "torque", "/torque: 12 of 72 │ "), (12, "", "12 marked │ "), (0, "", ""),
        (2, "q", "2 marked, 2 not shown │ /q: 12 of 72 │ "),
    ],
)  # fmt: skip
def test_an_answer_stands_behind_the_facts_and_with_marks_and_filter_where_others_have_no_room(
    desk, said, marked, words, stays
):
    desk.session.rows.marked[:marked] = True
    desk.session.rows.set_filter(words)
    desk.session.rows.sort = "div"
    desk.session.rows.refresh()
    said.say("done")
    assert said.words().plain.startswith(stays)
    assert said.words().plain.endswith(" │ done")
    long = "word " * 15
    said.say(long)
    assert said.words().plain.split() == f"{stays}{long}".split()
    said.say("it failed " + long, failed=True)
    assert said.words().plain.split() == f"{stays}it failed {long}".split()
    assert [(span.start, span.end) for span in said.words().spans] == [(len(stays), len(said.words()))]
    said.ask("what is to be typed")
    assert said.words().plain == "what is to be typed"


def test_an_answer_goes_once_it_could_be_read(said, monkeypatch):
    said.say("done")
    said._said_s = 100.0
    monkeypatch.setattr(messages.time, "monotonic", lambda: 100.0 + messages.READ_S - 0.1)
    said.read()
    assert said.said == "done"
    monkeypatch.setattr(messages.time, "monotonic", lambda: 100.0 + messages.READ_S)
    said.read()
    assert said.said == ""


def test_news_stand_above_and_leave_the_answer_its_rows(said):
    said.say("done")
    said.tell("news " + "word " * 60)
    lines = said.words().wrap(Console(width=78), 78)
    assert len(lines) == messages.MOST_ROWS
    assert lines[1].plain.rstrip().endswith("… (g m)")
    assert "done" in lines[2].plain
    said.say("answer " * 60)
    lines = said.words().wrap(Console(width=78), 78)
    assert lines[0].plain.rstrip().endswith("… (g m)")
    assert lines[2].plain.rstrip().endswith("… (g m)")
    assert len(lines) == messages.MOST_ROWS


def test_a_tour_stands_above_the_news(said):
    said.tell("‣ tour 1 of 5\n‣ news")
    assert said.words().plain.split("\n")[:2] == ["‣ tour 1 of 5", "‣ news"]


def test_the_line_is_laid_out_anew_where_it_takes_other_rows(said):
    painted = []
    said.refresh = lambda *_, layout=False: painted.append(layout)
    said.say("a")
    said.say("b " * 80)
    said.say("c " * 80)
    said.tell("news")
    said.tell("news")
    said.say("")
    assert painted == [False, True, False, False, True]


def test_of_a_session_without_rows_nothing_is_told():
    assert Said(Session("robot")).words().plain == ""


@pytest.mark.parametrize(
    ("state", "span_s", "held", "said", "words"),
    [
        ("live", 10.0, False, "", "10 s shown │ live │ y follows │ A 3 s"),
        ("paused", 10.0, True, "", "10 s shown │ paused │ y held │ A 3 s"),
        (None, 10.0, True, "", "10 s shown │ y held │ A 3 s"),
        (None, 10.0, False, "", "10 s shown │ A 3 s"),
        (None, 60.0, False, "", "whole file │ A 3 s"),
        ("live", 60.0, False, "", "60 s shown │ live │ y follows │ A 3 s"),
        ("live", 10.0, False, "x" * 40, f"live │ y follows │ A 3 s │ {'x' * 40}"),
    ],
)
def test_below_plots_it_is_told_what_is_shown_of_what(state, span_s, held, said, words):
    window = SimpleNamespace(span_s=span_s, spans=(1.0, 60.0), fixed_scale=held)
    line = OfPlots(window, lambda: ["A 3 s"], None if state is None else lambda: state)
    line.width = 70
    line.said = said
    assert line.words().plain == words


def test_of_the_row_under_the_cursor_it_is_told_what_its_columns_have_no_room_for(desk, said):
    rows, table = desk.session.rows, desk.session.table
    rows.refresh()
    assert said.words().plain == "element 1 of 72"
    rows.move_to(3)
    name = table.names[rows.row]
    assert said.words().plain == "element 4 of 72"
    table.facts = Facts({}, 0, 0, {name: {"bad": 2.0}})
    assert said.words().plain.endswith(" │ 2 samples nan or inf: min to std leave nan out")
    said.width = 160
    table.take_beyond({name: "HH"})
    assert " │ HH: " in said.words().plain
    desk.session.lose()
    assert " │ HH: " not in said.words().plain
    said.say("done")
    assert "2 samples" not in said.words().plain


@pytest.mark.parametrize(("text", "shown"), [("12345678901", True), ("1234567890", False)])
def test_a_whole_number_that_a_column_has_no_room_for_is_told(text, shown, new_fake):
    desk = Desk(new_fake([scalar("/log/a/count", dtype="<i8"), scalar("/log/b")]).run())
    desk.session.rows.refresh()
    desk.session.live.readings["/log/a/count"] = Reading(np.array([np.nan]), {0: text}, 1, 0, 0)
    assert Said(desk.session).words().plain.endswith(f" │ {text}") is shown


def test_of_a_list_a_failure_stands_alone_and_an_answer_before_what_is_told():
    line = OfList(0.3)
    line.told = ["2 marked", "", "by name"]
    assert line.words().plain == "2 marked │ by name"
    line.say("done")
    assert line.words().plain == "done │ 2 marked │ by name"
    line.told = [" ".join(map(str, range(1000)))]
    assert line.words().plain.endswith(f" … ({key_of('messages')})")
    line.say("it failed", failed=True)
    assert line.words().plain == "it failed"


@pytest.mark.parametrize("failed", [False, True])
@pytest.mark.parametrize("advice", ["", "; g r lists it", ". w saves it"])
@pytest.mark.parametrize("made", [lambda: OfList(0.3), lambda: Said(Session("robot"))])
def test_while_a_menu_covers_the_rows_above_a_message_shows_its_beginning_and_what_to_do(made, advice, failed):
    line = made()
    line.told = ["1 limit"]
    line.say(" ".join(map(str, range(60))) + advice, failed=failed)
    assert len(line.words().wrap(line.app.console, 78)) == 3
    line.cover(True)
    (row,) = line.words().wrap(line.app.console, 78)
    assert row.plain.startswith("0 1 2 3") and row.plain.endswith(f"… ({key_of('messages')}){advice}")
    line.cover(False)
    assert len(line.words().wrap(line.app.console, 78)) == 3


@pytest.mark.parametrize(("values", "quiet"), [([("kp", None, 1.0)], True), ([("kp", 2.0, 1.0)], False)])
def test_what_all_parameters_are_at_a_start_is_no_news(values, quiet, desk):
    change = ParameterChange(tuple(values))
    desk.session.happened = [LoggedEvent("parameter", "told", 1, 0, number=number, change=change) for number in (4, 5)]
    event = Event(1, 1, EventKind.PARAMETER, "told", logged=5)
    assert desk.session.tells_no_change(event) == quiet
    assert not desk.session.tells_no_change(msgspec.structs.replace(event, logged=9))  # its line isn't here

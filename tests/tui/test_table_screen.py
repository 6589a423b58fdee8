"""The table screen, driven by keys."""

import msgspec
import numpy as np
import pytest
from rich.cells import cell_len
from textual import events

from silo.core.elements import State
from silo.rpc.published import EventKind
from silo_tui.model.table.fields import Field
from silo_tui.widgets.inputs import CellEditor
from tests.stand_ins.fake_signals import scalar, signal

FIRST = "/log/base/orientation"


async def test_a_single_logger_opens_by_itself_with_live_values_also_of_what_is_only_saved(fake, screen, ran_s=12):
    assert "● RUNNING" in screen.text
    assert "/base/position" in screen.text
    await screen.shows("-2.3896")  # the position of the first joint
    await screen.type("/solver_cost")
    await screen.until(lambda: fake.views and fake.views[-1].values == ("/log/state/solver_cost",))
    value = float(signal("/log/state/solver_cost", np.array([fake.seconds]))[0])
    await screen.shows(f"{value:.4f}")


async def test_how_far_a_logger_with_a_journal_is_durable_stands_in_the_header_and_moves_on(fake, opened):
    fake.durable_ticks = 12
    async with opened(fake.run(), size=(120, 30)) as screen:
        await screen.shows("durable to tick 12")
        fake.durable_ticks = 98
        await screen.shows("durable to tick 98")


async def test_the_value_of_a_full_buffer_is_its_last_one_and_says_so(screen, ran_s=20, size=(180, 40)):
    await screen.press("slash")
    await screen.enter("LF/HAA/current", shows="│ buffer full: this is its last sample")


async def test_the_filter_works_while_it_is_typed_says_what_its_terms_may_be_and_replaces_another(screen):
    await screen.press("slash", shows="changed<1s   marked pending")
    await screen.type("torque LF", shows="3 of 72")
    assert "changed<1s" not in screen.text
    await screen.press("escape")
    assert len(screen.session.rows.shown) == 72
    await screen.type("/unit:N")
    await screen.press("tab")
    assert screen.session.rows.filter.text == "unit:Nm"
    await screen.type(" LF")
    await screen.until(lambda: len(screen.session.rows.shown) == 3)
    await screen.press("enter", shows="3 of 72")
    await screen.press("slash", shows="Type anew, → adds to it")
    await screen.type("LH")
    assert "Type anew" not in screen.text, "which was done"
    assert "Enter keeps the filter" in screen.text
    await screen.press("enter")
    assert screen.session.rows.filter.text == "LH"
    await screen.press("slash", "right")
    assert "Type anew" not in screen.text
    await screen.type(" torque")
    await screen.press("enter")
    assert screen.session.rows.filter.text == "LH torque"
    await screen.press("slash", "enter")
    assert screen.session.rows.filter.text == "LH torque"
    await screen.press("slash", "backspace", "enter")
    assert screen.session.rows.filter.text == ""


async def test_t_switches_logging_off_as_a_pending_edit_space_marks_and_quit_asks_while_one_pends(fake, screen):
    await screen.do("toggle")
    assert screen.value(FIRST, Field.ENABLED) == "off"
    await screen.shows("1 pending in 1 element (a to apply)")
    assert fake.calls == []
    await screen.press("space", "space")
    assert (screen.session.rows.marked_count, screen.session.rows.position) == (2, 2)
    await screen.shows("2 marked")
    await screen.press("q", shows="Quit without applying?")
    await screen.press("escape", "u", "q")
    await screen.until(lambda: screen.app._exit)


async def test_a_number_is_edited_in_place_for_all_marked_and_tab_leaves_no_editor_behind(screen):
    await screen.do("space", "space", "edit_divider", "5", "enter")
    assert [screen.value(name, Field.DIVIDER) for name in (FIRST, "/log/base/position")] == ["5", "5"]
    await screen.do("edit_divider", "tab", "9", "enter")
    assert screen.value(FIRST, Field.DIVIDER) == "9"
    assert not screen.app.screen.query_one("#cell-editor").display


async def test_enter_lets_a_value_of_the_field_under_the_cursor_be_chosen(screen):
    await screen.do("l", "l", "edit", shows="now save and publish")
    await screen.press("p")
    assert screen.value(FIRST, Field.ACTION) == "publish"


async def test_the_field_that_is_chosen_is_told_in_words_with_its_value_and_the_key_that_edits_it(screen):
    """On the line of a name space there is no cell to be seen, and without colours none anywhere."""
    await screen.press("right", shows="divider: 1; e edits it")
    await screen.press("o", "n", "right", shows="action: save and publish; e edits it")
    await screen.do("asterisk", "right", shows="buffer: looping, fixed, growing; e edits it")


async def test_undo_redo_and_an_edit_to_what_is_so_already(screen):
    await screen.do("edit_divider", "7", "enter", "asterisk", "toggle")
    await screen.press("u", shows="undone: logging of 72 elements; u again: divider of 1")
    await screen.press("u", shows="undone: divider of 1 element; no more to undo")
    assert screen.session.table.pending_count == (0, 0)
    await screen.press("ctrl+r", "ctrl+r")
    assert screen.session.table.pending_count == (73, 72)
    screen.session.table.note_applied(())  # all steps are done with
    await screen.press("u", shows="nothing to undo; x drops what is pending")
    await screen.press("escape", "escape")
    value = screen.value(FIRST, Field.DIVIDER)
    await screen.press("d")
    await screen.enter(value, shows=f"divider is {value} already")
    await screen.enter(f":set div={value}", shows="that is so already")


async def test_apply_shows_the_difference_sends_one_transaction_and_tells_of_buffers_of_gigabytes(
    fake, opened, monkeypatch
):
    large = "these buffers take 9.6 GB [and a start of them some seconds]"
    apply = fake.apply
    monkeypatch.setattr(
        fake, "apply", lambda *edits, **cut: msgspec.structs.replace(apply(*edits, **cut), warnings=[large])
    )
    async with opened(fake) as screen:
        await screen.do("space", "space", "edit_divider", "5", "enter", "a", shows="1 → 5")
        await screen.press("enter")
        await screen.until(lambda: fake.calls)
        assert [(call[0], len(call[1])) for call in fake.calls] == [("apply", 2)]
        await screen.shows("applied to 2 elements")
        assert screen.session.table.pending_count == (0, 0)
        await screen.until(lambda: large in " ".join(screen.text.split()))


async def test_the_editor_lies_over_a_row_that_is_edited(screen):
    await screen.do("space", "j", "j", "edit_divider")
    await screen.shows("divider of marked /base/orientation, not of acceleration, e.g. 5 50Hz")
    assert screen.app.screen.query_one(CellEditor).region.y == screen.app.screen.table.region.y
    for key in ("escape", "enter"):  # and the cursor goes back
        await screen.press(key)
        await screen.until(lambda: screen.session.rows.row == 3, "the row of the cursor")
        await screen.do("edit_divider")


async def test_a_running_logger_goes_on_and_is_stopped_and_started_only_when_that_was_chosen(fake, screen, ran_s=12):
    await screen.do("toggle", "a", shows="stop, apply, start again")
    await screen.press("j", "enter", shows="Apply 1 edit to 1 element? Keep them pending: nothing was done")
    assert fake.calls == []
    assert screen.session.table.pending_count == (1, 1)
    await screen.press("a", shows="stop, apply, start again")
    await screen.press("D", shows="logging again")
    assert [call[0] for call in fake.calls] == ["stop", "apply", "start"]
    await screen.do("toggle", "a", "enter", shows="it goes on")
    assert [call[0] for call in fake.calls[3:]] == ["cut"]


async def test_somebody_elses_edit_of_the_same_field_is_a_conflict_and_never_overwritten(fake, screen):
    await screen.do("edit_divider", "5", "enter")
    fake.somebody_edits(FIRST, divider=3)
    await screen.shows("! 1 conflict")
    await screen.press("a", shows="was 1, theirs 3, yours 5")
    line = next(line for line in screen.text.splitlines() if "was 1, theirs 3" in line)
    above = screen.text.splitlines()[screen.text.splitlines().index(line) - 1]
    assert " /base/orientation " in above, "which signal"
    await screen.press("t")
    await screen.until(lambda: screen.session.table.pending_count == (0, 0))
    assert screen.value(FIRST, Field.DIVIDER) == "3"
    await screen.do("edit_divider", "5", "enter", "a", shows="3 → 5")
    fake.connected = False  # the news of it doesn't reach us
    fake.somebody_edits(FIRST, divider=4)
    fake.connected = True
    await screen.press("enter", shows="was 3, theirs 4, yours 5")
    assert fake.info(FIRST).options.divider == 4


async def test_pending_edits_survive_a_lost_link_and_are_rebased(fake, screen, ran_s=12):
    await screen.do("edit_divider", "5", "enter")
    fake.cut()
    await screen.shows("No link to robot")
    await screen.shows("pending edits are kept")
    fake.somebody_edits("/log/base/position", divider=7)
    fake.mend()
    await screen.until(lambda: "No link" not in screen.text)
    assert screen.value(FIRST, Field.DIVIDER) == "5"
    assert screen.value("/log/base/position", Field.DIVIDER) == "7"


async def test_a_dead_robot_is_told_with_where_the_data_is(fake, screen, ran_s=12):
    screen.app.screen.say("nothing was saved")
    await screen.shows("nothing was saved")
    fake.state, fake.reason = State.DEAD, "Its data was saved to /home/ann/logs/x.silo."
    fake.publish(EventKind.CRASHED, "the robot program died")
    await screen.until(lambda: "nothing was saved" not in screen.text, "an answer from before")
    await screen.until(lambda: "the robot program died" in [one.words for one in screen.app.context.told])
    await screen.shows("robot died:")
    await screen.shows("/home/ann/logs/x.silo")


async def test_the_head_goes_on_where_no_row_passes_the_filter(fake, screen, ran_s=12):
    await screen.shows("● RUNNING")
    await screen.enter("/zzz", shows="0 of 72")
    for _ in range(2):
        fake.advance(2.0)
        await screen.until(lambda: screen.session.frame_time_ns == fake.now_ns, "what came since")


async def test_start_needs_no_question_and_stop_does(fake, screen):
    await screen.press("S")
    await screen.until(lambda: fake.calls == [("start",)])
    await screen.shows("● RUNNING")
    await screen.press("S", shows="Stop logging?")
    await screen.press("enter")  # No
    assert fake.calls == [("start",)]
    await screen.press("S", shows="Stop logging?")
    await screen.press("y", shows="■ STOPPED")


async def test_read_only_stands_in_the_head_and_refuses_what_changes_the_logger(
    screen, ran_s=12, read_only=True, size=(120, 24)
):
    assert "read-only" in screen.text.splitlines()[0]
    assert "RUNNING" in screen.text and "durable" not in screen.text  # it has no journal
    assert screen.text.count("read-only") == 1
    await screen.do("toggle")
    await screen.until(lambda: screen.text.count("read-only") > 1, "why not")
    assert screen.session.table.pending_count == (0, 0)


async def test_a_logger_that_lets_us_only_watch_says_so(fake, opened):
    fake.may_edit = False
    async with opened(fake) as screen:
        await screen.do("toggle")
        await screen.shows("user 'bob' may look at anymal/robot, not change it: the role is viewer")


async def test_escape_backs_out_of_range_filter_and_marks_but_keeps_edits(screen):
    await screen.do("toggle", "space", "V")
    await screen.enter("/base", "escape", "escape", "escape")
    rows = screen.session.rows
    assert (rows.anchor, rows.filter.text, rows.marked_count) == (None, "", 0)
    assert screen.session.table.pending_count == (1, 1)


async def test_one_view_is_about_what_is_on_the_screen(fake, screen, ran_s=12):
    await screen.until(lambda: fake.views)
    assert len(fake.views[-1].values) == 20
    await screen.press("G")
    await screen.until(lambda: "/log/state/solver_cost" in fake.views[-1].values)
    assert fake.views[0].closed


@pytest.mark.slow
async def test_ten_thousand_elements_are_there_and_the_last_is_a_key_away(new_fake, wide_table, opened):
    async with opened(new_fake(wide_table(10_000))) as screen:
        await screen.press("G")
        assert "signal09999" in screen.text
        assert np.array_equal(screen.session.rows.shown[-1:], [9999])


async def test_a_click_puts_the_cursor_there_marks_in_front_of_a_name_and_does_what_a_key_of_the_bar_does(screen):
    await screen.pilot.click("ElementTable", offset=(10, 3))
    assert screen.session.rows.position == 3
    await screen.pilot.click("ElementTable", offset=(0, 5))
    assert list(np.flatnonzero(screen.session.rows.marked)) == [screen.session.rows.shown[5]]
    await screen.press("home")
    await screen.pilot.click("KeyBar", offset=(screen.text.splitlines()[-1].index("Mark"), 0))
    assert screen.session.rows.marked_count == 2


async def test_nothing_enabled_is_told(new_fake, robot, opened):
    off = [
        msgspec.structs.replace(info, options=msgspec.structs.replace(info.options, enabled=False)) for info in robot
    ]
    fake = new_fake(off)
    async with opened(fake.run()) as screen:
        await screen.shows("Nothing is logged")


async def test_letters_of_two_cells_don_t_move_the_columns(new_fake, robot, opened):
    odd = msgspec.structs.replace(robot[0], name="/log/関節/角度")
    async with opened(new_fake([odd, *robot[1:3]])) as screen:
        lines = [line for line in screen.text.splitlines() if "[x]" in line]
        assert len(lines) == 3
        assert len({cell_len(line[: line.index("[x]")]) for line in lines}) == 1


async def test_keys_that_come_all_at_once_keep_their_order(screen):
    for key, char in (("d", "d"), ("7", "7"), ("enter", "\r"), ("j", "j"), ("d", "d"), ("8", "8"), ("enter", "\r")):
        screen.app.post_message(events.Key(key, char))
    await screen.until(lambda: screen.session.table.pending_count == (2, 2))
    assert [screen.value(name, Field.DIVIDER) for name in (FIRST, "/log/base/position")] == ["7", "8"]


async def test_several_fields_are_set_by_words_in_one_line(screen):
    assert not screen.app.screen.value_now("edit_all")  # what the menu tells as the present value
    await screen.do("edit_all", shows="or words: div=5 size=10s buf=loop")
    await screen.type("div=5 size=10s bfu=grow")
    await screen.press("enter", shows="bfu")
    await screen.press(*["left"] * 5, "backspace", "backspace", "u", "f", "enter")
    await screen.until(lambda: screen.session.table.pending_count == (3, 1), "the edits")
    await screen.shows("by words: 3 changed")
    assert screen.value(FIRST, Field.DIVIDER) == "5"


async def test_a_term_that_can_t_be_read_is_underlined_and_one_that_leaves_nothing_is_named(screen):
    await screen.type("/torque div>x LF", shows="torque div>x LF")
    await screen.shows("3 of 72")

    def is_over_its_word():  # once what is said has as many lines as it needs
        lines = screen.text.splitlines()
        over = next((at for at, line in enumerate(lines) if "^^^^^" in line), None)
        return over is not None and lines[over].index("^^^^^") == lines[over + 1].find("div>x")

    await screen.until(is_over_its_word, "the term underlined")
    assert len(screen.session.rows.shown) == 3
    await screen.press("escape")
    await screen.type("/torque LF unit:V", shows="0 of 72; without unit:V: 3")
    await screen.press("escape")
    await screen.type("/torque$", shows="torque$ is no glob; *torque is one, ~torque$ a regular expression")
    for typed, says in (
        ("left hip torque", "nothing has left or hip; did you mean 'LF'?"),
        ("LF torqe", "; did you mean 'torque'?"),
        ("LF RF LH", "each term has some, no element has all"),
        ("LF/(HAA|KFE)/torque", "brackets group nothing here: LF|RF is either, ~ begins a"),
        ("acceleration[9]", "acceleration[9]: [ ] stands for one of the letters in it"),
        ("LF\\d", "LF\\d has signs of a regular expression, which begins with ~"),
    ):
        await screen.press("escape")
        await screen.type(f"/{typed}", shows=says)


async def test_the_namespace_of_what_is_shown_stands_once_in_the_head(new_fake, opened):
    names = [f"/log/legs/{leg}/{joint}/winding_temperature" for leg in ("LF", "RH") for joint in ("HAA", "KFE")]
    async with opened(new_fake([*map(scalar, names), scalar("/log/battery/voltage")])) as screen:
        await screen.shows("…/LF/KFE/win…temperature")  # a joint is never left out
        assert "name in" not in screen.text
        await screen.press("/", *"winding", "enter", shows="name in /legs ")
        await screen.shows("RH/KFE/windi…temperature")
        assert "/legs/" not in screen.text


async def test_what_all_that_is_shown_share_stands_in_the_head_where_names_would_fit_too(new_fake, opened):
    async with opened(new_fake([scalar(f"/log/{name}") for name in ("joints/q", "joints/dq", "time")])) as screen:
        await screen.shows("/joints/dq ")
        await screen.press("/", *"joints", "enter", shows="name in /joints ")
        await screen.shows(">dq ")
        assert "/joints/" not in screen.text


async def test_what_was_said_long_before_is_gone_where_one_comes_back(screen, monkeypatch):
    for read_s, stays in ((60.0, True), (0.0, False)):
        screen.app.context.say("limits of x are set")
        await screen.shows("limits of x are set")
        screen.app.screen.action_command("events")
        await screen.until(lambda: screen.app.screen.scope == "events", "the events")
        monkeypatch.setattr("silo_tui.widgets.messages.READ_S", read_s)
        await screen.press("escape", at="table")
        await screen.until(lambda stays=stays: ("limits of x are set" in screen.text) is stays)


async def test_a_filter_is_typed_while_a_vector_is_unfolded(screen, ran_s=12):
    await screen.enter(":goto base/position")
    await screen.do("fold")
    await screen.until(lambda: screen.session.rows.unfolded, "its entries")
    await screen.press("slash", *"base")
    await screen.until(lambda: all("base" in screen.session.table.names[row] for row in screen.session.rows.shown))
    await screen.press("enter")
    await screen.until(lambda: screen.session.rows.filter.text == "base")
    assert screen.app.unforeseen.errors == []
    assert screen.session.short_name(screen.session.table.names[screen.session.rows.row]).startswith("/base")


async def test_what_failed_is_read_before_a_filter_takes_its_place(screen, ran_s=12):
    screen.app.context.fail("the disk of the robot is full")
    await screen.press("slash", "b", "enter")
    await screen.until(lambda: screen.session.rows.filter.text == "b")
    assert "the disk of the robot is full" in screen.text
    await screen.press("slash", "escape")
    assert "the disk of the robot is full" in screen.text


async def test_where_several_are_marked_it_is_said_that_a_new_thing_is_of_one(screen, ran_s=12):
    await screen.enter("/torque")
    await screen.do("new_of_row", shows="New for /legs/LF/HAA/torque?")
    assert "not of the" not in screen.text
    await screen.press("escape", "asterisk", shows="12 marked")
    await screen.do("new_of_row", shows="New for /legs/LF/HAA/torque?")
    await screen.shows("not of the 12 that are")

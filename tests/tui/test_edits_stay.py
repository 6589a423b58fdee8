"""Edits reach what they are meant for: hidden marks, slow dialogs, equal changes, lost terminals."""

import os
import threading

import msgspec
import pytest

from silo_tui.actions import key_of
from silo_tui.model.table.fields import Field
from silo_tui.screens.dialogs.questions import Question
from silo_tui.sessions import kept
from silo_tui.settings.options import Settings
from tests.waiting import DEADLINE_S

pytestmark = pytest.mark.slow  # each walks through the whole app

FIRST = "/log/base/orientation"
TORQUE = "/log/legs/LF/HAA/torque"


@pytest.fixture
def slow(fake):
    """Holds the answers of the logger to some calls until they are let go."""
    gate = threading.Event()

    def hold(*names):
        for name in names:
            answer = getattr(fake, name)

            def waiting(*arguments, answer=answer, **options):
                assert gate.wait(DEADLINE_S)
                return answer(*arguments, **options)

            setattr(fake, name, waiting)
        return gate

    yield hold
    gate.set()


async def test_a_file_name_typed_behind_w_at_once_goes_into_the_dialog_and_the_screen_below_a_question_goes_on(
    fake, screen
):
    await screen.type("Wdmbpt.yaml")
    await screen.until(lambda: screen.app.screen.query("Input"), "the dialog")
    await screen.until(lambda: screen.app.screen.query_one("Input").value == "dmbpt.yaml", "the name")
    assert "waiting for" not in screen.text
    await screen.press("enter")
    await screen.until(lambda: any(call[:2] == ("save_script", "dmbpt.yaml") for call in fake.calls))
    assert screen.session.table.pending_count == (0, 0)
    await screen.press("d", "7", "enter", "a")
    await screen.until(lambda: isinstance(screen.app.screen, Question), "the question")
    fake.run()
    await screen.session.refresh_status()
    screen.app.context.status_changed()
    # a picture of all screens as the terminal has them, those below a dialog too
    await screen.until(lambda: "RUNNING" in screen.app.export_screenshot(), "the state of the robot")


async def test_a_slow_dialog_owns_the_keys_and_says_for_what_it_waits_until_esc_lets_it_go_on(fake, screen, slow):
    gate = slow("table")
    await screen.press("r", shows="waiting for robot")
    await screen.shows("Esc Closes, the request goes on")
    await screen.press("escape")
    await screen.press("j")
    assert screen.session.rows.position == 1
    gate.set()
    gate.clear()
    await screen.press("d", "7", "enter")
    fake.run()
    await screen.session.refresh_status()
    gate = slow("status")
    await screen.press("a")
    await screen.type("td9t", shows="waiting for robot")
    assert screen.session.table.pending_count == (1, 1)
    gate.set()
    await screen.shows("Apply 1 edit to 1 element?")
    assert not fake.calls


async def test_edits_of_hidden_marks_typed_or_by_a_key_are_made_only_after_a_question_that_counts_them(screen):
    await screen.enter("/torque", "asterisk", "escape")
    await screen.enter("/LF")
    await screen.enter(":set dvi=5", shows="dvi")
    assert not screen.app.screen.is_modal
    await screen.enter(":set div=5", shows="9 of the 12 marked elements are hidden")
    assert screen.session.table.pending_count == (0, 0)
    await screen.press("enter")
    assert screen.session.table.pending_count == (0, 0)
    await screen.enter(":set div=5", shows="9 of the 12 marked elements are hidden")
    await screen.press("y")
    await screen.until(lambda: screen.session.table.pending_count == (12, 12))
    await screen.press("u", "t", shows="9 of the 12 marked elements are hidden")
    assert screen.session.table.pending_count == (0, 0)
    await screen.press("s")
    await screen.until(lambda: screen.session.table.pending_count == (3, 3))
    assert screen.session.rows.marked_count == 3


async def test_marks_that_the_filter_hides_are_plotted_only_after_a_question(screen):
    await screen.enter("/torque", "asterisk", "escape")
    await screen.enter("/temperature")
    await screen.enter(":sort value", shows="12 marked, 12 not shown")
    await screen.press("m", shows="12 of the 12 marked elements are hidden. Plot all 12?")
    here = screen.session.short_name(screen.session.table.names[screen.session.rows.row])
    await screen.shows(f"Only {here}, where the cursor is; the marks go")
    await screen.press("c", at="monitor")
    assert [screen.session.short_name(each.element.name) for each in screen.app.screen.stack.plots] == [here]
    await screen.press("escape", at="table")
    assert screen.session.rows.marked_count == 0


async def test_b_and_p_choose_from_a_list_and_e_asks_which_field_until_one_was_chosen(screen):
    await screen.press("b", shows="buffer of /base/orientation")
    await screen.press("f")
    await screen.until(lambda: screen.value(FIRST, Field.BUFFER) == "fixed")
    await screen.press("p", shows="action of /base/orientation")
    await screen.press("escape")
    assert screen.session.table.pending_count == (1, 1)
    await screen.press("e", shows="Edit what of /base/orientation?")
    await screen.press("d")
    await screen.until(lambda: screen.app.screen.query("#cell-editor").first().display, "the editor")
    await screen.press("6", "enter")
    assert screen.value(FIRST, Field.DIVIDER) == "6"
    assert screen.session.table.pending_count == (2, 1)


async def test_equal_edits_stand_in_one_line_with_what_they_cost(screen):
    await screen.enter("/torque", "asterisk", "d", "5", "enter", "a")
    await screen.shows("12 × /legs/*/*/torque  divider 1 → 5")
    for words in ("memory", "recorded", "topics", "held", "shortest:"):
        assert words in screen.text


async def test_the_memory_of_an_edit_stands_beside_what_there_is_of_it(fake, opened, monkeypatch):
    status = fake.status
    monkeypatch.setattr(fake, "status", lambda: msgspec.structs.replace(status(), room_bytes=50_000_000))
    async with opened(fake) as screen:
        await screen.enter(":set size=5000", "a", shows="of 50 MB available")
        assert "!!" not in screen.text
        await screen.press("escape")
        await screen.until(lambda: screen.app.screen is screen.app.context.upper_screen)
        await screen.enter(":set size=50M", "a", shows="!! of 50 MB available")


async def test_a_script_that_differs_in_a_trigger_alone_is_shown_and_loaded(fake, opened):
    trigger = "triggers:\n  - name: fall\n    when: abs(base/roll) > 0.6\n    pre_s: 5\n"
    fake.files["walk.yaml"] = fake.files["robot.yaml"] + trigger
    async with opened(fake) as screen:
        await screen.enter(":load walk.yaml", shows="trigger fall")
        assert "new: abs(base/roll) > 0.6, pre 5 s" in screen.text
        await screen.press("l", shows="loaded walk.yaml: 0 elements changed; trigger fall")
        await screen.until(lambda: [one.options.name for one in screen.session.triggers] == ["fall"])
        fake.files["other.yaml"] = fake.files["walk.yaml"].replace("pre_s: 5", "pre_s: 2")
        await screen.enter(":load other.yaml", shows="pre 5 s → 2 s")


async def test_a_script_that_changes_nothing_says_so_and_that_pending_edits_stay(fake, screen):
    await screen.press("L", shows="It would change nothing")
    await screen.press("enter", shows="nothing to load")
    assert not fake.calls
    await screen.press("d", "7", "enter", shows="1 pending")
    await screen.press("L", shows="It would change nothing")
    assert "Kept, whatever is loaded: 1 pending edit in 1 element" in screen.text
    await screen.press("enter", shows="kept: 1 pending edit in 1 element")
    await screen.shows("(x takes back those of an element)")


async def test_edits_that_a_lost_terminal_left_are_offered_at_the_next_start(fake, new_fake, opened):
    async with opened(fake) as screen:
        await screen.press("d", "7", "enter")
        path = kept.path_of("anymal", "robot")
        await screen.until(path.exists, "the kept edits")
    again = new_fake()
    async with opened(again) as screen:
        await screen.shows("Take up 1 edit of robot again?")
        await screen.press("t")
        await screen.until(lambda: screen.session.table.pending_count == (1, 1))
        assert screen.value(FIRST, Field.DIVIDER) == "7"
        await screen.press("u")
        await screen.until(lambda: not path.exists(), "nothing is kept")


async def test_a_second_terminal_without_edits_leaves_those_of_the_first_alone(fake, new_fake, opened):
    path = kept.path_of("anymal", "robot")
    first = path.with_name(path.name.replace(str(os.getpid()), "1"))  # a process that lives
    kept.keep(first, [kept.KeptEdit(FIRST, int(Field.DIVIDER), 1, 7)])
    async with opened(fake) as screen:
        assert "Take up" not in screen.text
        await screen.press("d", "7", "enter", "u")
    assert first.exists()


async def test_edits_that_were_dropped_at_the_end_are_not_offered_again(screen):
    await screen.press("d", "7", "enter", "q", shows="Quit without applying?")
    await screen.press("y")
    await screen.pilot.pause()
    assert not kept.path_of("anymal", "robot").exists()


async def test_what_a_branch_costs_is_seen_at_once_in_a_small_terminal_too(screen, ran_s=12):
    await screen.press("d", "7", "enter", "j", "d", "8", "enter", "j", "d", "9", "enter")
    await screen.press("j", "d", "6", "enter", "j", "d", "5", "enter", "a")
    await screen.until(lambda: isinstance(screen.app.screen, Question), "the question")
    await screen.shows("the shortest:")
    body = screen.app.screen.query_one(".dialog-body")
    line = next(at for at, line in enumerate(screen.text.splitlines()) if "the shortest:" in line)
    assert line < body.region.bottom


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
async def test_rows_stay_under_a_filter_by_the_setting_that_was_edited_until_it_is_applied(size, screen):
    await screen.enter("/HAA/torque div=1", shows="4 of 72")
    await screen.do("mark_shown", "edit_divider", "5", "enter", shows="divider: 4 changed")
    assert "LF/HAA/torque" in screen.text and "not shown" not in screen.text
    await screen.do("apply", shows="Apply 4 edits to 4 elements?")
    await screen.press("a", shows="No element passes the filter 'HAA/torque div=1'")


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
async def test_the_question_that_applies_says_how_the_edits_of_one_element_are_dropped(size, screen):
    await screen.do("mark", "mark", "edit_divider", "5", "enter", "apply")
    await screen.shows(f"Keep them pending; to drop one: :unmark, then {key_of('discard')} on its line")
    await screen.press("escape", shows="Keep them pending: nothing")
    await screen.enter(":unmark")
    await screen.do("up", "apply", shows=f"Keep them pending; to drop one: {key_of('discard')} on its line")
    await screen.press("escape")
    await screen.do("discard", shows="1 edit discarded")
    await screen.do("apply", shows="Apply 1 edit to 1 element?")
    assert "drops one" not in screen.text


async def test_a_key_of_the_users_own_drops_one_edit_as_the_question_says(fake, opened):
    async with opened(fake, settings=Settings(keys={"discard": "Z"})) as screen:
        await screen.do("edit_divider", "5", "enter", "down", "edit_divider", "5", "enter", "apply")
        await screen.shows("Keep them pending; to drop one: Z on its line")

"""A robot program that was killed: what its helper process still does, what nobody does any more and says so."""

from contextlib import asynccontextmanager

import pytest

from silo.core.elements import State
from silo.rpc.published import EventKind
from silo_tui.actions import BY_ID, COMMANDS
from silo_tui.context import gone_words
from silo_tui.keymap import in_bar

NOBODY = "robot program is gone: start it again"
# what a helper process does, or this program alone, of what writes
STILL_DONE = {
    "save_data", "save_script", "set_marker", "episode", "episode_good", "episode_bad", "episode_redo",
    "delete_recording", "acknowledge",
}  # fmt: skip


@pytest.fixture
def killed(fake, opened):
    """`async with killed() as screen:` the table of a robot program that was killed."""

    @asynccontextmanager
    async def open_killed(*keys, **options):
        async with opened(fake.run(), **options) as screen:
            await screen.press(*keys)
            fake.state, fake.reason = State.DEAD, "it was killed by SIGKILL"
            fake.publish(EventKind.CRASHED, fake.reason)
            await screen.shows("robot died: it was killed")
            yield screen

    return open_killed


@pytest.mark.parametrize(
    "command",
    ["record", "derive", "new_of_row", "limits_of_row", "edit_divider", "toggle", "edit_all", "start_stop", "apply",
     "restart", "load_script", "excite", "restore"],
)  # fmt: skip
async def test_what_only_the_robot_program_does_says_that_it_is_gone_and_opens_nothing(command, killed):
    async with killed(size=(200, 30)) as screen:
        below = screen.app.screen
        below.action_command(command)
        await screen.shows(f"{BY_ID[command].label}: the {NOBODY}")
        assert screen.app.screen is below
        assert not below.is_typing


@pytest.mark.parametrize("keys", ["rr", "ed", "rd", "rn", "ea"])
async def test_a_menu_says_of_a_robot_program_that_is_gone_what_nobody_does_any_more(keys, killed):
    async with killed(size=(200, 30)) as screen:
        await screen.press(keys[0], shows=f"({keys[1]})")
        assert f"({keys[1]}) " in screen.text
        assert "program gone" in screen.text
        await screen.press(keys[1], shows=NOBODY)
        assert screen.app.screen.scope == "table"


async def test_where_a_menu_leaves_one_row_the_beginning_of_the_sentence_says_what_to_do(killed):
    async with killed() as screen:
        await screen.press("r", shows="Record: program gone")
        await screen.press("r")
        await screen.shows("r r (Record): the robot program is gone: start it again, silo-tui follows")


async def test_of_edits_that_wait_it_is_said_that_they_stay(killed):
    async with killed("e", "t", size=(200, 30)) as screen:
        await screen.do("apply", shows=f"Apply: the {NOBODY}")
        assert "the edits stay pending" in screen.text
        assert screen.session.table.pending_count[0] == 1
        await screen.do("undo")
        assert screen.session.table.pending_count[0] == 0


async def test_the_marker_of_who_looks_for_the_reason_is_still_set(killed, fake):
    async with killed() as screen:
        await screen.do("set_marker")
        await screen.enter("here it fell")
        await screen.until(lambda: [each for each in fake.events() if "here it fell" in each.text], "the marker")


async def test_the_bar_of_a_dead_robot_offers_nothing_that_it_cannot_do(killed):
    async with killed(size=(200, 30)) as screen:
        last = screen.text.splitlines()[-1]
        offered = {command.id for command, _ in in_bar("table", read_only=False) if command.label in last}
        assert not {each for each in offered if BY_ID[each].robot}
        assert {"filter", "monitor"} <= offered
        assert "lost 0" not in screen.text


async def test_the_bar_of_a_dead_demo_has_the_keys_that_start_it_again(killed):
    async with killed() as screen:
        assert "Demo again" not in screen.text
        screen.app.context.has_demo = lambda: True
        screen.app.screen.update_keys()
        await screen.until(lambda: screen.text.splitlines()[-1].startswith(" g l Loggers, then g d Demo again"))


async def test_what_was_lost_before_a_program_died_is_still_told(fake, killed):
    fake.lost = 5
    async with killed() as screen:
        await screen.shows("✖ DEAD")
        assert "lost 5" in screen.text.splitlines()[0]


def test_each_command_that_changes_a_logger_is_done_by_the_program_or_by_its_helper():
    helped = {each.id for each in COMMANDS if each.writes and each.asks and not each.robot}
    assert helped == STILL_DONE
    assert "silo-tui follows" in gone_words()

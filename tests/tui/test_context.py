"""What app and screens ask of one another, without an app: what is let through, what is told, in which words."""

import asyncio
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from silo.core.elements import Problem, State
from silo.errors import ConnectionLostError, RefusedError
from silo.rpc.refusals import RefusedWhy
from silo_tui import context as module
from silo_tui.actions import BY_ID
from silo_tui.sessions import kept
from silo_tui.settings.reading import SettingsProblem
from silo_tui.widgets.messages import READ_S
from tests.stand_ins.desk import NAME, Plain, Sheet
from tests.stand_ins.fake_signals import refused


@pytest.fixture
def desk(fake):
    return Plain(fake)


@pytest.fixture
def now(monkeypatch):
    """The time, which stands still."""
    clock = SimpleNamespace(s=1000.0)
    monkeypatch.setattr(module.time, "time", lambda: clock.s)
    return clock


# ------------------------------------------------------------------------------------------------- what is let through


def without_link(desk: Plain) -> None:
    desk.session.lose()


def viewer(desk: Plain) -> None:
    desk.session.may_edit, desk.session.why_not = False, "bob may look"


def read_only(desk: Plain) -> None:
    desk.read_only = True


def nothing_open(desk: Plain) -> None:
    desk.take_session(None)


@pytest.mark.parametrize(
    ("change", "command", "says"),
    [
        (None, "toggle", None),
        (None, "apply", None),
        (viewer, "toggle", "On/Off: bob may look"),
        (viewer, "filter", None),
        (viewer, "save_into_loggers", None),
        (read_only, "toggle", "On/Off: this is read-only"),
        (read_only, "filter", None),
        (read_only, "restart_loggers", "this is read-only"),
        (without_link, "filter", None),
        (without_link, "toggle", None),
        (without_link, "save_script", "Save script: no link to robot; ^l tries now"),
        (without_link, "refresh", "no link to robot: trying now"),
        (nothing_open, "toggle", ""),
        (nothing_open, "refresh", None),
    ],
)
def test_a_command_that_may_not_be_carried_out_says_why(change, command, says, desk):
    if command not in BY_ID:
        command = next(one.id for one in BY_ID.values() if one.writes and "loggers" in one.scopes)
    if change is not None:
        change(desk)
    assert desk.allows(BY_ID[command]) is (says is None)
    assert (says or "") in desk.heard
    assert bool(desk.heard) is bool(says)
    assert (("try_now",) in desk.fake.calls) is (command == "refresh" and change is without_link)


def test_a_link_that_is_there_is_not_tried(desk):
    desk.try_link()
    assert (desk.heard, desk.fake.calls) == ("the link is there", [])


@pytest.mark.parametrize("scope", ["settings", ""])
def test_where_no_key_tries_the_link_none_is_named(scope, desk):
    without_link(desk)
    desk.sheet.scope = scope
    assert not desk.allows(BY_ID["save_script"])
    assert desk.heard == "Save script: no link to robot"


# -------------------------------------------------------------------------------------------------------- what is told


def test_what_is_said_goes_to_the_uppermost_full_screen(desk):
    below = Sheet()
    desk.screen_stack = [below, desk.sheet, SimpleNamespace()]
    desk.say("a")
    assert (below.told, desk.sheet.told) == ([], ["a"])
    assert desk.screen_of("table") is below
    assert desk.screen_of("events") is None


def test_only_screens_that_are_there_are_told(desk):
    gone = Sheet(is_there=False)
    desk.screen_stack = [desk.sheet, SimpleNamespace(), gone]
    desk.table_changed()
    desk.status_changed()
    desk.tell_upper(lambda screen: screen.request_view())
    assert (gone.told, desk.sheet.told) == ([], ["table", "status", "keys"])


def test_news_stand_one_below_the_other_and_the_newest_is_told_with_how_many_there_are(desk, now):
    clock = module.Message(now.s, "", True).clock
    desk.hear("")
    assert (desk.news, desk.sheet.told) == ("", [])
    desk.hear("bob edited")
    assert desk.heard == f"‣ {clock} bob edited"
    desk.hear("bob stopped")
    desk.hear("bob started")
    assert desk.heard == f"‣ {clock} bob started (2 more: g m)"
    assert [(one.words, one.is_news) for one in desk.told] == [
        ("bob edited", True), ("bob stopped", True), ("bob started", True),
    ]  # fmt: skip
    desk.tour = SimpleNamespace(words="1 of 5")
    assert desk.news == f"‣ tour 1 of 5\n‣ {clock} bob started (2 more: g m)"


def test_news_go_at_a_key_once_they_could_be_read(desk, now):
    desk.read_news()
    assert desk.sheet.told == []
    desk.hear("bob edited")
    now.s += READ_S - 0.1
    desk.read_news()
    assert "bob edited" in desk.news
    now.s += 0.1
    desk.read_news()
    assert (desk.news, desk.heard) == ("", "")


@pytest.mark.parametrize("change", [lambda desk: desk.take_session(None), lambda desk: desk.show_file(desk.session)])
def test_news_of_what_was_open_are_not_told_over_what_is(change, desk):
    desk.hear("bob edited")
    change(desk)
    assert desk.news == ""


def test_what_is_said_is_kept_as_an_answer_and_nothing_is_not(desk):
    assert desk.note("a").is_news is False
    desk.note("")
    assert [one.words for one in desk.told] == ["a"]


@pytest.mark.parametrize(("count", "says"), [(0, ""), (1, "first"), (3, "first (2 more: g s)")])
def test_of_what_was_left_out_of_the_settings_the_first_is_said(count, says, desk):
    problems = [SettingsProblem("", word) for word in ("first", "second", "third")[:count]]
    desk.settings_problems = tuple(problems)
    desk.say_settings_problems()
    assert desk.heard.removeprefix(": ") == says or desk.heard == str(problems[0]) + says.removeprefix("first")


def test_a_file_over_a_logger_leaves_it_behind_and_gives_it_back(desk):
    live, file, back = desk.session, SimpleNamespace(rows=desk.session.rows), []
    desk.came_back = lambda: back.append(True)
    assert not desk.file_over_logger
    desk.show_file(file)
    assert (desk.file_over_logger, desk.session, desk.logger_session) == (True, file, live)
    desk.screen_stack.append(Sheet())
    desk.leave_file()
    assert (desk.file_over_logger, desk.session, desk.logger_session, back) == (False, live, live, [True])
    assert desk.sheet.told == ["table", "status", "view"]


@pytest.mark.parametrize(("depth", "open_", "left"), [(2, True, 2), (3, True, 2), (3, False, 3)])
def test_from_the_list_one_goes_back_to_a_logger_that_is_open(depth, open_, left, desk):
    desk.screen_stack = [Sheet() for _ in range(depth)]
    if not open_:
        desk.take_session(None)
    desk.back_to_table()
    assert len(desk.screen_stack) == left


# ------------------------------------------------------------------------------------------------------------- errors


def test_an_error_stands_on_the_screen_and_over_a_dialog_whole(desk):
    desk.fail("/log/imu/temperature is wrong\nand more")
    assert (desk.heard, desk.noted) == ("failed: /imu/temperature is wrong\nand more", [])
    desk.screen_stack.append(SimpleNamespace(is_modal=True))
    desk.fail("wrong\nand more")
    assert (desk.heard, desk.noted) == ("failed: wrong", ["wrong\nand more"])
    desk.screen_stack.clear()
    desk.fail("nobody sees it")


def test_how_a_robot_program_ended_is_told_once_by_the_banner(desk):
    desk.fake.state, desk.fake.reason = State.DEAD, "it was killed by SIGSEGV"
    asyncio.run(desk.session.refresh_status())
    desk.fail("no such thing: it was killed by SIGSEGV")
    assert desk.heard == "failed: no such thing: the robot program is gone"
    desk.fake.state = State.STOPPED
    asyncio.run(desk.session.refresh_status())
    desk.fail("it was killed by SIGSEGV")
    assert desk.heard == "failed: it was killed by SIGSEGV"


async def raises(error: Exception) -> None:
    raise error


PROBLEMS = [Problem(f"/log/x{at}", "divider", "too large") for at in range(8)]


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (RefusedError("no"), "no"),
        (ConnectionLostError("no answer"), "no answer"),
        (OSError("the disk is full"), "the disk is full"),
        (refused(RefusedWhy.INVALID, "2 are refused", PROBLEMS[:2]),
         "2 are refused\nelement '/x0': too large\nelement '/x1': too large"),
        (refused(RefusedWhy.INVALID, "element '/log/x0': too large", PROBLEMS[:2]),
         "element '/x0': too large\nelement '/x1': too large"),
        (refused(RefusedWhy.INVALID, "8 are refused", PROBLEMS),
         "\n".join(["8 are refused", *(f"element '/x{at}': too large" for at in range(6))])),
    ],
)  # fmt: skip
def test_what_ends_a_flow_is_told_and_the_next_one_may_begin(error, words, desk):
    desk.fake.elements = [msgspec.structs.replace(desk.fake.elements[0], name=one.name) for one in PROBLEMS]
    desk.fake.revision += 1
    asyncio.run(desk.session.reload())
    holding = SimpleNamespace(end=lambda: desk.sheet.told.append("ended"))
    desk._flow_running = True
    desk.saved_first([])
    asyncio.run(desk._guarded(raises(error), holding))
    assert desk.sheet.told[0] == "ended"
    assert desk.sheet.told[1].startswith(f"failed: {words}")
    assert desk.sheet.told[2:] == ["table", "status", "keys"]
    assert (desk._flow_running, desk._saved_first) == (False, "")


def test_one_flow_goes_on_at_a_time(desk):
    begun: list[Any] = []
    desk.run_worker = lambda work, **_: begun.append(work)
    first, second = raises(RefusedError("a")), raises(RefusedError("b"))
    desk.run_flow(first)
    desk.run_flow(second)
    assert (len(begun), desk.heard) == (1, "still busy with the last command")
    assert desk.holding._what == "robot"
    begun[0].close()
    first.close()


@pytest.mark.parametrize(
    ("connected", "error", "news"),
    [
        (True, RefusedError("no"), "no"), (False, RefusedError("no"), ""), (True, OSError("full"), "full"),
        (False, ConnectionLostError("no answer"), ""),
    ],
)  # fmt: skip
def test_what_goes_wrong_aside_is_news_unless_the_banner_tells_it(connected, error, news, desk):
    if not connected:
        desk.session.lose()
    asyncio.run(desk.quietly(raises(error)))
    assert [one.words for one in desk.told] == [news] * bool(news)


# ------------------------------------------------------------------------------------------------- edits that are kept


@pytest.mark.parametrize(("change", "is_kept"), [(None, True), (read_only, False), (nothing_open, False)])
def test_edits_are_kept_for_a_lost_terminal_by_who_may_edit(change, is_kept, desk):
    desk.edit()
    if change is not None:
        change(desk)
    desk.keep_edits()
    found = kept.left_behind("anymal", "robot")
    assert [edit.name for each in found.values() for edit in each.edits] == [NAME] * is_kept


def test_edits_that_can_t_be_kept_are_told_of(desk, monkeypatch):
    def full(*_: Any) -> None:
        raise OSError("the disk is full")

    monkeypatch.setattr(kept, "keep", full)
    desk.edit().keep_edits()
    assert desk.heard == "pending edits can't be kept for a lost terminal: the disk is full"


@pytest.mark.parametrize("there", [True, False])
def test_edits_are_offered_where_there_are_some(there, desk):
    offered = []
    desk.take_up = lambda: offered.append(True)
    if there:
        desk.edit().keep_edits()
    desk.offer_edits()
    assert offered == [True] * there

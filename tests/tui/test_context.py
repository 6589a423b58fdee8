"""What app and screens ask of one another, without an app: what is let through, what is told, in which words."""

import asyncio
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
from textual import events

from silo.core.elements import Problem, State
from silo.errors import ConnectionLostError, RefusedError
from silo.rpc.refusals import RefusedWhy
from silo_tui import context as module
from silo_tui.actions import BY_ID
from silo_tui.context import SiloScreen
from silo_tui.model.words.command_line import Spelled
from silo_tui.sessions import kept
from silo_tui.settings.file import SettingsProblem
from silo_tui.widgets.inputs import Fleeting
from silo_tui.widgets.messages import READ_S, MessageLine
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


def test_a_page_in_a_browser_says_how_one_is_served_that_changes_something(desk, monkeypatch):
    read_only(desk)
    assert not desk.allows(BY_ID["toggle"])
    assert "--control" not in desk.heard
    monkeypatch.setenv("TEXTUAL_DRIVER", "textual_serve.driver:WebDriver")
    assert not desk.allows(BY_ID["toggle"])
    assert "`silo-tui --serve --control`" in desk.heard


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


def test_news_of_one_thing_count_up_in_their_place_and_hide_no_other(desk):
    desk.hear("fall fired at 1", of="triggered 'fall'")
    desk.hear("bob stopped")
    desk.hear("fall fired at 2", of="triggered 'fall'")
    desk.hear("fall fired at 3", of="triggered 'fall'")
    assert desk.heard.endswith("bob stopped (1 more: g m)"), "what came once stays"
    assert [one.words for one in desk.told][-1] == "fall fired at 3", "each is kept among the messages"
    desk.forget_news()
    for at in range(58):
        desk.hear(f"fall fired at {at}", of="triggered 'fall'")
    assert desk.heard.endswith("fall fired at 57 (58 ×)")


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
    told = desk.settings_trouble
    assert told.removeprefix(": ") == says or told == str(problems[0]) + says.removeprefix("first")


def test_a_file_over_a_logger_leaves_it_behind_and_gives_it_back(desk):
    live, file, back = desk.session, SimpleNamespace(rows=desk.session.rows), []
    desk.came_back = lambda: back.append(True)
    assert not desk.file_over_logger
    desk.show_file(file)
    assert (desk.file_over_logger, desk.session, desk.logger_session) == (True, file, live)
    desk.screen_stack += [Sheet(), Sheet()]  # its table, and plots of it
    desk.screen_stack[-2].scope = "file"
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


def test_an_error_stands_on_the_screen_whole_below_a_dialog_too(desk):
    desk.fail("/log/imu/temperature is wrong\nand more")
    assert desk.heard == "failed: /imu/temperature is wrong\nand more"
    desk.screen_stack.append(SimpleNamespace(is_modal=True))
    desk.fail("wrong\nand more")
    assert desk.heard == "failed: wrong\nand more"
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
    assert desk.holding._what == "waiting for robot"
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


# ----------------------------------------------------------------------------------------- how a screen does commands


class Line(MessageLine):
    """The line of messages of a screen, which keeps what it is told."""

    def __init__(self) -> None:
        self.told: list[str] = []

    def read(self) -> None:
        self.told.append("read")

    def say(self, words: str, *, failed: bool = False, hint: bool = False) -> None:
        self.told.append(("failed: " if failed else "") + words)

    def tell(self, news: str) -> None:
        self.told.append(f"news: {news}")


class Bar:
    """The key bar."""

    def __init__(self) -> None:
        self.told: list[str] = []

    def update(self) -> None:
        self.told.append("new")

    def show_instead(self, keys: str) -> None:
        self.told.append(keys)


class Paper(SiloScreen):
    """A screen as it is, but for the widgets."""

    scope = "table"
    focused: Any = None
    is_there: Any = True

    def __init__(self, desk: Plain) -> None:
        super().__init__()
        self.desk, self.line, self.bar, self.done = desk, Line(), Bar(), []
        desk.screen_stack = [self]
        desk.runner = SimpleNamespace(
            run=lambda line: self.done.append(f":{line}"), command_apply=lambda: self.done.append("apply")
        )

    app = property(lambda self: self.desk)
    context = property(lambda self: self.desk)

    def walk_children(self, kind: Any) -> Any:
        return [self.line] if kind is MessageLine else [self.bar]

    def begin_command(self, word: str) -> None:
        self.done.append(f":{word} ")

    def command_filter(self, typed: Spelled) -> None:
        self.done.append(f"filter {typed.rest}")


class Part:
    """A part of a screen that carries out commands of it."""

    def __init__(self, done: list[str]) -> None:
        self.done = done

    def command_edit_field(self, name: str) -> None:
        self.done.append({"ENABLED": "toggle"}[name])

    def command_filter(self, typed: Spelled) -> None:
        self.done.append("never: the screen has it")


@pytest.fixture
def paper(desk):
    found = Paper(desk)
    found.parts = (Part(found.done),)
    desk.command_quit = lambda: found.done.append("quit")
    return found


@pytest.mark.parametrize(
    ("scope", "command", "done"),
    [
        ("table", ("filter", Spelled("filter", ("a", "b"))), "filter a b"),
        ("table", ("filter",), "filter "),
        ("table", ("toggle",), "toggle"),
        ("table", ("apply",), "apply"),
        ("table", ("quit",), "quit"),
        ("table", ("fold",), ""),  # nobody here does it
        ("triggers", ("toggle",), ""),  # it is no key there, and has no word
        ("triggers", ("apply",), "apply"),
        ("triggers", ("refresh",), ":refresh"),
        ("triggers", ("sort",), ":sort "),
        ("triggers", ("goto",), ":goto "),
        ("table", ("unmark",), ":unmark"),
        ("table", ("picture",), ":picture "),
        ("file", ("apply",), ""),
        ("settings", ("apply", Spelled("apply", ())), "apply"),
    ],
)
def test_a_command_is_done_by_the_screen_its_parts_the_runner_or_the_app(scope, command, done, paper):
    paper.scope = scope
    paper.action_command(*command)
    assert paper.done == [done] * bool(done)


def test_a_command_that_is_refused_is_not_done_and_answers_are_read_before(paper):
    viewer(paper.desk)
    paper.action_command("toggle")
    assert (paper.done, paper.line.told) == ([], ["read", "On/Off: bob may look"])
    assert paper.bar.told == []
    paper.action_command("filter")
    assert paper.bar.told == ["new"]


@pytest.mark.parametrize(("typing", "says"), [(False, ["Q is no key of silo-tui; ? shows those that are"]), (True, [])])
def test_a_key_without_a_use_says_so_unless_it_is_typed_into_a_line(typing, says, paper, monkeypatch):
    if typing:
        monkeypatch.setattr(Fleeting, "display", True)
        paper.focused = Fleeting.__new__(Fleeting)
    paper.on_key(events.Key("Q", "Q"))
    assert paper.line.told == says
    assert (paper.check_action("x", ("toggle",)), paper.check_action("x", ("quit_now",))) == (not typing, True)


@pytest.mark.parametrize(
    ("state", "command", "label"),
    [
        ("STOPPED", "start_stop", "Start"), ("RUNNING", "start_stop", "Stop"), ("DEAD", "start_stop", ""),
        ("DEAD", "save_data", ""), ("STOPPED", "save_data", "Save"), ("STOPPED", "again", ""),
    ],
)  # fmt: skip
def test_the_bar_calls_keys_by_what_they_do_now(state, command, label, paper):
    paper.desk.fake.state = State[state]
    asyncio.run(paper.desk.session.refresh_status())
    assert paper.label_now(BY_ID[command]) == label
    paper.repeated = "toggle"
    assert paper.label_now(BY_ID["again"]) == ("" if state == "DEAD" else "again: On/Off")


def test_without_a_logger_the_bar_calls_keys_as_always(paper):
    paper.desk.take_session(None)
    assert paper.label_now(BY_ID["start_stop"]) == "Start/Stop"


@pytest.mark.parametrize(("above", "keys"), [("Enter Saves", "Enter Saves"), (None, "Enter Does it  Esc Closes")])
def test_the_keys_of_a_dialog_stand_in_the_bar_while_it_is_there(above, keys, paper):
    dialog = SimpleNamespace(is_modal=True, **({"KEYS_HERE": above} if above else {}))
    paper.desk.screen_stack.append(dialog)
    paper.on_screen_suspend()
    assert paper.bar.told == [keys]
    dialog.is_modal = False
    paper.on_screen_suspend()
    assert paper.bar.told == [keys]


@pytest.mark.parametrize(("typing", "bar"), [(False, ["new", ""]), (True, ["new"])])
def test_back_on_a_screen_its_keys_and_news_are_there_and_old_answers_read(typing, bar, paper):
    if typing:
        paper.focused = Fleeting.__new__(Fleeting)
    paper.desk.hear("bob edited")
    paper.line.told.clear()
    paper.on_screen_resume()
    assert paper.bar.told == bar
    assert paper.line.told == ["read", f"news: {paper.desk.news}"]


@pytest.mark.parametrize("failed", [True, False])
def test_what_is_said_of_a_screen_that_is_still_made_is_shown_when_it_is_there(failed, paper):
    paper.say("/log/imu is up", failed=failed)
    shown = f"{'failed: ' * failed}/imu is up"
    assert paper.line.told == [shown]
    paper.is_there, later = False, []
    paper.call_later = lambda do, *given, **named: later.append((do, given, named))
    paper.say("b", failed=failed)
    assert paper.line.told == [shown]
    do, given, named = later[0]
    do(*given, **named)
    assert paper.line.told == [shown, f"{'failed: ' * failed}b"]
    assert [one.words for one in paper.desk.told] == ["/imu is up", "b"]


@pytest.mark.parametrize("upper", [True, False])
def test_the_tour_follows_what_is_done_on_the_uppermost_screen(upper, paper):
    followed: list[Any] = []
    paper.desk.tour = SimpleNamespace(words="1 of 5", follow=followed.append)
    if not upper:
        paper.desk.screen_stack.append(Sheet())
    paper.update_keys()
    assert followed == [paper] * upper
    assert paper.line.told == ["news: ‣ tour 1 of 5"] * upper

"""Screens that go while something for them is under way: no work wakes up without widgets, no word is lost."""

import asyncio
import gc
import itertools
import math
import threading
import time
import warnings
from types import SimpleNamespace

import pytest
from msgspec import structs
from textual import events
from textual.color import Color
from textual.renderables.background_screen import BackgroundScreen
from textual.screen import Screen as TextualScreen
from textual.strip import Strip
from textual.style import Style
from textual.visual import RichVisual

from silo.conditions.standing import LimitStatus, LimitWord, TriggerStatus
from silo.core.conditions import TriggerOptions, TriggerWord
from silo.core.elements import FileType, SavedFile, State
from silo.rpc.published import EventKind
from silo_tui import modal
from silo_tui.commands.flows import left_words
from silo_tui.layouts import views
from silo_tui.layouts.layout import KeptLayout
from silo_tui.modal import Behind, run_aside
from silo_tui.screens.dialogs.questions import Choice, Question
from silo_tui.screens.lists.messages import MessagesScreen
from silo_tui.screens.lists.recordings import RecordingsScreen
from silo_tui.screens.lists.settings import SettingsScreen
from silo_tui.screens.lists.triggers import TriggersScreen
from silo_tui.screens.table import TableScreen
from silo_tui.widgets.lines import Lines

pytestmark = pytest.mark.slow  # each walks through the whole app


async def gone(screen):
    """Wait until a screen has lost its widgets; it is not yet told of it."""
    while screen.children:
        await asyncio.sleep(0)


@pytest.fixture
def slow_recordings(monkeypatch):
    """The list of recordings comes when the screen that asked for it has no widgets any more."""
    asked = []

    def use(screen):
        answer = screen.session.recordings

        async def late(most):
            found, asking = await answer(most), screen.app.screen
            asked.append(asking)
            await gone(asking)
            return found

        monkeypatch.setattr(screen.session, "recordings", late)
        return asked

    return use


async def test_what_a_screen_asked_for_may_come_while_it_is_left(opened, fake, tmp_path, slow_recordings):
    fake.logs = tmp_path
    async with opened(fake) as screen:
        asked = slow_recordings(screen)
        await screen.press("F")
        await screen.until(lambda: asked, "the question")
        await screen.press("escape")
        await screen.until(lambda: not asked[0].is_running and not asked[0].children, "the list is gone")
        await screen.until(lambda: isinstance(screen.app.screen, TableScreen), "the table")


async def test_what_a_screen_asked_for_may_come_while_the_program_ends(opened, fake, tmp_path, slow_recordings):
    fake.logs = tmp_path
    async with opened(fake) as screen:
        asked = slow_recordings(screen)
        await screen.press("F")
        await screen.until(lambda: asked, "the question")
    assert isinstance(asked[0], RecordingsScreen)
    assert not asked[0].children


async def test_what_was_asked_of_a_screen_that_was_left_is_told_where_one_is(opened, fake, monkeypatch):
    fake.trigger_statuses = [TriggerStatus(TriggerOptions("fall", "x > 1", 5.0, 1.0), TriggerWord.ARMED)]
    answer, arm_trigger = threading.Event(), fake.arm_trigger

    def late(*given, **named):
        answer.wait()
        return arm_trigger(*given, **named)

    monkeypatch.setattr(fake, "arm_trigger", late)
    async with opened(fake) as screen:
        await screen.press("T")
        await screen.until(lambda: isinstance(screen.app.screen, TriggersScreen), "the triggers")
        triggers = screen.app.screen
        await screen.shows("x > 1")
        await screen.press("t", "escape", "escape")
        await screen.until(lambda: isinstance(screen.app.screen, TableScreen) and not triggers.children, "it is left")
        answer.set()
        await screen.shows("trigger 'fall' is off")


async def test_news_and_words_to_a_screen_that_is_being_made_wait_for_it_and_a_key_where_it_opens_by_itself(
    opened, fake, tmp_path
):
    fake.logs = tmp_path
    async with opened(fake) as screen:
        screen.app.push_screen(RecordingsScreen(screen.session))
        screen.app._second()
        await screen.shows("Nothing is saved")
        await screen.press("escape")
        screen.app.push_screen(SettingsScreen(screen.app.take_settings))
        screen.app.context.say("these words came early")
        await screen.shows("these words came early")
        await screen.press("escape")
        gate, let_through = screen.app.gate, screen.app.gate._let_through

        def opens_meanwhile():
            last = gate._kept[0].key == "escape"
            let_through()
            if last:
                del gate._let_through
                screen.app.push_screen(MessagesScreen())

        gate._let_through = opens_meanwhile
        screen.app.post_message(events.Key("down", None))
        await screen.press("escape")
        assert isinstance(screen.app.screen, TableScreen)


@pytest.mark.parametrize("key", ["F", "E", "T", "A", "f2", "question_mark", "enter", "D"])
async def test_a_screen_that_was_asked_for_as_the_program_ends_is_not_made(opened, fake, tmp_path, key):
    fake.logs = tmp_path
    async with opened(fake) as screen:
        screen.app.post_message(events.Key(key, None))
        screen.app.post_message(events.Key("ctrl+q", None))


@pytest.mark.parametrize("turns", range(4))
async def test_a_line_of_commands_that_is_made_as_the_program_ends_is_told_nothing_of_it(screen, turns):
    screen.app.begin_command("")
    for _ in range(turns):
        await asyncio.sleep(0)
    screen.app.exit()


async def test_a_screen_that_is_closed_while_it_is_made_is_told_nothing_of_it(opened, fake, tmp_path, monkeypatch):
    fake.logs = tmp_path
    async with opened(fake, size=(100, 30)) as screen:
        app, push = screen.app, screen.app.push_screen

        async def close(turns):
            for _ in range(turns):  # nearer to where it is drawn
                await asyncio.sleep(0)
            app.pop_screen()

        closed = []

        def push_and_close(*given):
            closed.append(asyncio.create_task(close(len(closed))))
            return push(*given)

        monkeypatch.setattr(app, "push_screen", push_and_close)
        keys = ["F", "E", "T", "A", "m", "f2", "question_mark", "enter", "colon", "o", "asked"]
        for key, turns in itertools.product(keys, range(12)):
            if not turns:
                closed.clear()
            if key == "asked":
                app.push_screen(Question("Stop logging?", "", [Choice("stop", "Stop", "s")]))
            else:
                await screen.press(key)
            await screen.until(lambda asked=turns: len(closed) > asked, key)
            await closed[turns]
            await screen.settled()
            assert len(closed) == turns + 1
            assert not app.unforeseen.errors, key


@pytest.mark.parametrize("what", ["a logger", "a view"])
async def test_what_closes_screens_may_end_meanwhile_and_the_program_goes_on(new_fake, opened, monkeypatch, what):
    async with opened(new_fake(name="arm"), new_fake(name="legs"), name="arm") as screen:
        app = screen.app
        await screen.press("m")
        await screen.until(lambda: app.screen.is_there, "the plots")
        pop = app.pop_screen

        def pop_and_end():
            asyncio.get_running_loop().call_soon(app.workers.cancel_group, app, "closing")
            return pop()

        monkeypatch.setattr(app, "pop_screen", pop_and_end)
        if what == "a view":
            run_aside(app, "closing", views.show, app.context, KeptLayout())
        else:
            (legs,) = [one for one in app._finder.find().loggers if one.name == "legs"]
            run_aside(app, "closing", app._opener._open, legs)
        await screen.until(lambda: all(one.is_finished for one in app.workers if one.group == "closing"), "its end")
        heard = []
        app.call_later(heard.append, "a message")
        await screen.until(lambda: heard, "what the program hears")


async def test_a_list_that_goes_is_drawn_no_more_whatever_it_still_has(opened, fake, tmp_path):
    fake.logs = tmp_path
    async with opened(fake, size=(100, 30)) as screen:
        for key in ("f2", "A", "T", "F"):
            await screen.press(key)
            left = screen.app.screen
            screen.app.pop_screen()
            while left.children:
                await asyncio.sleep(0)
                heads = left.query("#list-head")
                if left._pruning and heads:
                    left._nodes._remove(heads.first())  # they go in no order that we know
                    break
            left.show()
            assert not left.is_there, key
            await screen.settled()


@pytest.mark.parametrize("what", ["cursor", "key"])
async def test_a_list_that_goes_does_no_key_that_still_reaches_it(opened, fake, what):
    fake.limit_statuses = [LimitStatus("x", "x", LimitWord.OK)]
    async with opened(fake, size=(100, 30)) as screen:
        await screen.press("A")
        left = screen.app.screen
        screen.app.pop_screen()
        while not left._pruning:
            await asyncio.sleep(0)
        left._nodes._remove(left.lines)  # the first that goes, where another widget has the key
        if what == "cursor":
            await left._dispatch_message(Lines.CursorMoved())
        else:
            left.action_command("list_bottom")
        await screen.settled()
        assert not screen.app.unforeseen.errors


async def test_what_is_behind_a_dialog_is_drawn_as_textual_draws_it_and_once_a_second(screen, monkeypatch):
    table = screen.app.screen
    await screen.press("question_mark")
    tint = Color(10, 20, 30, 0.5)
    base = Style(Color(1, 2, 3), Color(4, 5, 6), bold=True)
    mine = Behind(table, tint).render_strips(80, 24, base, None)
    theirs = RichVisual(table, BackgroundScreen(table, tint)).render_strips(80, 24, base, None)
    assert [Strip(one).simplify() for one in mine] == [Strip(one).simplify() for one in theirs]
    assert len({style for strip in mine for _, style, _ in strip}) > 3

    drawn, now = [], [100.0]
    table._shone_s = -math.inf
    monkeypatch.setattr(modal, "BEHIND_S", 1.0)
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    monkeypatch.setattr(TextualScreen, "_compositor_refresh", lambda one: drawn.append((one, now[0])))
    monkeypatch.setattr(
        type(table), "set_timer", lambda one, wait_s, do: drawn.append((do, wait_s)) or SimpleNamespace(stop=int)
    )
    for now_s in (100.0, 100.4, 100.9, 101.0):
        now[0] = now_s
        table._compositor_refresh()
    assert drawn[0] == (table, 100.0)
    assert [round(wait_s, 3) for do, wait_s in drawn[1:3] if do == table._compositor_refresh] == [0.6, 0.1]
    assert drawn[3:] == [(table, 101.0)]
    screen.app.pop_screen()
    table._compositor_refresh()  # in front it is drawn whenever something changes
    assert drawn[-1] == (table, 101.0)
    assert len(drawn) == 5
    monkeypatch.undo()


async def test_who_quits_without_applying_sees_what_it_is_about_and_is_told_what_becomes_of_robot_and_data(screen):
    await screen.press("t")
    for is_demo, words in ((True, "The demo robot ends"), (False, "The logger goes on")):
        screen.app.context.has_demo = lambda is_demo=is_demo: is_demo
        await screen.press("q")
        for shown in ("Quit without applying?", words, "/base/position"):
            await screen.shows(shown)
        await screen.press("escape")
    screen.session.take_status(structs.replace(screen.session.status, state=State.DEAD))
    left = SavedFile("/l/a.silo", FileType.SILO, 1)
    for files, words in (([left], "its data is in /l/a.silo."), ([], "would be lost. The robot program is")):
        screen.session.left_files = files
        await screen.press("q", shows=words)
        await screen.press("escape")


async def test_who_leaves_is_told_in_the_terminal_how_the_robot_is_left(screen):
    session = screen.session
    name, status = session.name, session.status
    session.take_status(structs.replace(status, state=State.RUNNING, recorders=2))
    assert left_words(session) == f"{name} logs on, 2 recordings with it"
    stopped = structs.replace(status, state=State.STOPPED, ticks=9, before_ticks=3, saved=False)
    session.take_status(stopped)
    assert left_words(session) == f"{name} is stopped, and 12 ticks stand in no file: `silo save {name}`"
    session.take_status(structs.replace(stopped, saved=True))
    assert screen.app.release() == f"{name} is stopped"
    screen.app.context.has_demo = lambda: True  # which ends with the app, and says so itself
    assert screen.app.release() == ""
    session.take_status(structs.replace(stopped, state=State.DEAD))
    session.left_files = [SavedFile("/l/a.silo", FileType.SILO, 1)]
    assert screen.app.release() == f"{name} is dead: /l/a.silo"


async def test_work_that_is_overtaken_before_it_began_leaves_no_warning(screen):
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        screen.app.context.script_names = ()
        screen.app.context.learn_scripts()
        screen.app.context.learn_scripts()
        await screen.until(lambda: screen.app.context.script_names, "the second one's answer")
        gc.collect()
    assert [str(one.message) for one in told if "never awaited" in str(one.message)] == []


@pytest.mark.parametrize(("keys", "asked", "closes"), [("S", "Stop logging?", True), ("tq", "Quit without", False)])
async def test_a_question_to_a_robot_that_died_closes_and_says_so(keys, asked, closes, fake, screen, ran_s=12):
    await screen.press(*keys, shows=asked)
    fake.state, fake.reason = State.DEAD, "it was killed by SIGSEGV"
    fake.publish(EventKind.CRASHED, fake.reason)
    await screen.shows("robot died: it was killed by SIGSEGV")
    if closes:
        await screen.until(lambda: not screen.app.screen.is_modal, "the question is closed")
        await screen.shows("the robot program is gone: start it again")
    assert (asked in screen.text) is not closes

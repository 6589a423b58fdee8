"""Every key on every screen, and nonsense in every line and dialog it opens: the program goes on."""

import numpy as np
import pytest
from textual.screen import ModalScreen
from textual.widgets import Input

import silo
from silo_tui.actions import commands_for
from silo_tui.commands.runner import CommandRunner
from silo_tui.context import Context
from silo_tui.widgets.inputs import Fleeting
from tests.stand_ins.fake_signals import array_of_one, scalar

pytestmark = pytest.mark.slow

ENDS = {"quit", "quit_now", "suspend", "palette"}  # those that leave, and Textual's own list
KINDS = ["of one", "nothing in it", "never started"]
# how each screen is reached from the table
SCREENS = {
    "table": (), "monitor": ("m",), "detail": ("m", "enter"), "scope": ("m", "c"), "triggers": ("T",), "alarms": ("A",),
    "events": ("E",), "recordings": ("F",), "settings": ("f2",),
}  # fmt: skip
FILES = {"file": (), "file_monitor": ("m",), "file_detail": ("m", "enter"), "file_events": ("E",)}
TYPED = [
    "", ".", "~nobody/", "/", "..", "x" * 300, "-1", "1e400", "[/]", "nan", "\u0664", "'", "> ", "a, b", "= 1, 2, 3",
    "\x00", "\u202e", "(((", "*",
]  # fmt: skip
LINES = [
    "control tkae", "control give", "control take now", "control \x00", "open", "open ~robot", "open ~robot/", "open .",
    "open \x00", "open " + "x" * 5000, "derive", "derive x", "derive x (((", "derive x y z", "derive ../x 1/0", "view",
    "view nope", "view save", "view save ../x", "view robot:", "view robot:\x00", "view save robot:../x", "record",
    "record [", "record \x00", "record *", "marker", "marker \x00", "picture .", "picture ..", "picture ~nobody/x",
    "theme ", "sort \x00", "goto \x00", "mark ~[", "filter ~(", "filter value>1e999", "data \x00", "load \x00",
]  # fmt: skip
COMPLETED = [
    "open ~robot/",
    "open \x00",
    "open ~",
    "view ",
    "control ",
    "derive ",
    "set size=",
    "load ",
    "x" * 999,
    "'",
]


def loggers_of(kind, new_fake):
    if kind == "nothing in it":
        return new_fake([])
    if kind == "never started":
        return new_fake()
    fake = new_fake([array_of_one("/log/one", "m"), scalar("/log/word", dtype="|S8")] if kind == "of one" else None)
    fake.run()
    return fake


async def keys_and_nonsense(screen, scope, way):
    """Press each key of a screen, type nonsense into what it opens, and come back to the screen."""
    typed = 0
    for command in commands_for(scope):
        if command.id in ENDS:
            continue
        upper = screen.app.context.upper_screen
        if screen.app.screen is not upper or upper.scope != scope or isinstance(screen.app.focused, Fleeting):
            await screen.press("escape")
            while len(screen.app.screen_stack) > 2:
                screen.app.pop_screen()
                await screen.settled()
            await screen.press(*way)
        key = command.keys.split(",")[0]
        await screen.press(key)
        for _ in range(3):  # a dialog, and what it leads to
            if isinstance(screen.app.focused, Input | Fleeting):
                await screen.type_or_paste(TYPED[typed % len(TYPED)])
                typed += 1
            elif not isinstance(screen.app.screen, ModalScreen):
                break
            await screen.press("down", "enter")
        assert screen.app.is_running, (scope, key)
        assert screen.text is not None, (scope, key)
        assert not screen.app.unforeseen.errors, (scope, key, screen.app.unforeseen.errors)


@pytest.mark.sampled
@pytest.mark.parametrize("scope", SCREENS)
async def test_every_key_of_a_screen_with_nonsense_behind_it(scope, new_fake, opened, drawn, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for kind in drawn(KINDS, 1):
        async with opened(loggers_of(kind, new_fake), size=(100, 30), ready=kind != "nothing in it") as screen:
            await screen.until(lambda: screen.app.context.has_session, "the table")
            await keys_and_nonsense(screen, scope, SCREENS[scope])


@pytest.fixture(params=["of one", "without a sample"])
def odd_file(request, tmp_path):
    log = silo.Logger("odd", folder=tmp_path, frequency=100.0)
    one = log.array("one", 1, unit="m")
    log.array("word", (), "S8")
    if request.param == "of one":
        log.start()
        for tick in range(200):
            one[:] = np.sin(tick / 10)
            log.collect()
        log.stop()
    else:
        log.start()
        log.collect()
        log.stop()
    path = log.save().path
    log.close()
    return path


@pytest.mark.parametrize("scope", FILES)
async def test_every_key_of_a_file_with_nonsense_behind_it(scope, odd_file, on_file, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    async with on_file(odd_file, size=(100, 30)) as screen:
        await keys_and_nonsense(screen, scope, FILES[scope])


@pytest.mark.sampled
async def test_strange_lines_of_commands(new_fake, opened, drawn, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for kind in drawn(KINDS, 1):
        async with opened(loggers_of(kind, new_fake), ready=kind != "nothing in it") as screen:
            await screen.until(lambda: screen.app.context.has_session, "the table")
            runner = CommandRunner(screen.app.context)
            for line in COMPLETED:
                runner.complete(line)
            for line in LINES:
                runner.run(line)
                await screen.settled()
                assert screen.text is not None, line
                await screen.leave()
                assert screen.app.is_running, line
                assert not screen.app.unforeseen.errors, line


# they move; open an empty pane; begin what takes its time
QUIET = {"back", "refresh", "next_event", "previous_event", "inspector", "demo", "menus"}  # drawn a moment later
MOVES = {"list_down", "list_up", "list_top", "list_bottom", "list_page_down", "list_page_up", "list_read"}


@pytest.mark.parametrize("scope", ["table", "triggers", "alarms", "events", "recordings", "settings", "loggers"])
async def test_no_key_is_silent_where_there_is_nothing_that_it_could_be_about(scope, new_fake, opened, monkeypatch):
    said = []
    monkeypatch.setattr(Context, "say", lambda context, words, **_: said.append(words))
    async with opened(new_fake([]), size=(100, 30), ready=False) as screen:
        await screen.until(lambda: screen.app.context.has_session, "the table")
        way = {**SCREENS, "loggers": ("ctrl+l",)}[scope]
        await screen.press(*way)
        upper = screen.app.context.upper_screen
        monkeypatch.setattr(type(upper), "say", lambda screen, words, **_: said.append(words))
        silent = []
        for command in commands_for(scope):
            if command.id in ENDS | QUIET | MOVES or command.group == "Move":
                continue
            said.clear()
            before = screen.text
            await screen.press(command.keys.split(",")[0])
            marks = [one for one in screen.app.workers if one.group == "mark"]  # they ask the logger
            await screen.until(lambda marks=marks: all(one.is_finished for one in marks), "an answer")
            if not said and screen.text == before:
                silent.append(command.id)
            await screen.press("escape")
            while screen.app.screen is not upper and len(screen.app.screen_stack) > 2:
                screen.app.pop_screen()
                await screen.settled()
            if screen.app.context.upper_screen is not upper:
                await screen.press(*way)
                upper = screen.app.context.upper_screen
        assert silent == []

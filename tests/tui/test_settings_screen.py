"""The settings screen: each change counts at once, `w` keeps it, mistakes of the file are told, keys can be changed."""

import re
import string
from dataclasses import replace
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from silo_tui.cli import _run, command
from silo_tui.keymap import clashes, keys_in
from silo_tui.screens.lists.settings import SettingRow, free_keys, row_text
from silo_tui.settings.file import path
from silo_tui.settings.options import OPTION, OPTIONS, Settings
from silo_tui.settings.reading import read, read_file
from silo_tui.settings.writing import write_file
from silo_tui.theme import theme_name
from silo_tui.widgets.bars import KeyBar

APP = "silo_tui.app"
pytestmark = pytest.mark.slow  # each walks through the whole app


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.delenv("TEXTUAL_THEME", raising=False)
    return tmp_path / "silo"


def line_with(screen, words):
    return next(line for line in screen.text.split("\n") if words in line)


@pytest.mark.parametrize(
    "steps", [("f2", "l"), (":", *"theme light", "enter", "f2"), (":", *"theme", "enter", "l", "f2")]
)
async def test_a_theme_shows_at_once_and_w_keeps_it(steps, screen):
    await screen.press(*("colon" if key == ":" else "space" if key == " " else key for key in steps))
    await screen.shows("silo settings")
    assert screen.app.theme == "silo-light"
    assert line_with(screen, "theme").startswith(">*theme")
    assert read_file() == (Settings(), [])
    await screen.press("w", shows="written")
    assert read_file() == (Settings(theme="light"), [])
    assert not line_with(screen, "theme").startswith(">*theme")
    await screen.press("x", "f2")
    assert screen.app.theme == "silo-dark"
    await screen.shows("the settings count until you quit, which asks; F2 w keeps them")


@pytest.mark.parametrize(("answer", "kept"), [("w", "light"), ("enter", "light"), ("D", "dark")])
async def test_who_quits_is_asked_once_whether_settings_that_were_changed_are_kept(fake, opened, answer, kept):
    async with opened(fake) as screen:
        await screen.press("colon", *"theme", "space", *"light", "enter", "q", shows="Keep the settings?")
        await screen.shows("Changed: theme. The file: ")
        await screen.press("escape", shows="Don't quit: nothing was done")
        assert screen.app.is_running
        assert read_file() == (Settings(), [])
        await screen.press("q", shows="Changed: theme. The file: ")
        await screen.press(answer)
        await screen.until(lambda: not screen.app.is_running)
    assert read_file() == (Settings(theme=kept), [])


@pytest.mark.parametrize("lines", [[], ["theme dark"], ["theme contrast", "theme light"]])
async def test_who_changed_no_setting_is_not_asked_as_one_that_a_command_line_gave_or_one_changed_back(lines, screen):
    context = screen.app.context
    context.settings = context.begun_settings = Settings(theme="light")
    for line in lines:
        await screen.enter(f":{line}")
    await screen.press("q")
    await screen.until(lambda: not screen.app.is_running)


async def test_every_option_can_be_changed_and_goes_back_to_its_default(screen):
    await screen.do("f2")
    for option in OPTIONS:
        await screen.do("change_setting")
        if option.several or not option.words:
            await screen.press("ctrl+u")
            await screen.enter(option.words[0] if option.several else "2")
        changed = getattr(screen.app.context.settings, option.name)
        assert changed != getattr(Settings(), option.name), screen.text
        await screen.shows("x Default")
        await screen.do("default_setting")
        assert screen.app.context.settings == Settings()
        await screen.do("list_down")


async def test_columns_are_chosen_and_the_table_follows(screen):
    assert " buf " in screen.text
    await screen.press("f2", *["j"] * (len(OPTIONS) - 1), shows="[x] unit  [x] on  [x] div")
    await screen.press("right", shows="columns: Enter takes it")
    await screen.shows("e.g. unit on div; nothing: all")
    await screen.enter("size div", "escape")
    await screen.until(lambda: " buf " not in screen.text)
    assert " div " in screen.text


async def test_what_cant_be_is_told_in_the_words_of_the_file_and_a_slower_rate_asks_for_fewer_frames(screen):
    await screen.press("f2", "j", "j", "j", "e", "ctrl+u")
    await screen.enter("99", shows="rate is 0.5 to 10, not 99; nothing was changed")
    assert screen.app.context.settings == Settings()
    await screen.press("e", "ctrl+u")
    await screen.enter("1")
    assert screen.session.link._rate_hz == 1.0


@pytest.mark.parametrize("keymap", ["two-layer", "classic"])
@pytest.mark.parametrize("command", ["filter", "monitor", "closer", "turn_up", "help"])
def test_each_key_that_is_offered_as_free_can_be_taken(keymap, command):
    settings = Settings(keymap=keymap)
    free = free_keys(command, settings)
    assert len(free) >= 4
    for key in free:
        assert not [one for one in clashes(keymap, {command: key}) if command in one[:2]]
    taken = {*string.ascii_letters} - {*free, *keys_in(keymap, command).split(","), "D"}
    assert all([one for one in clashes(keymap, {command: key}) if command in one[:2]] for key in taken)


async def test_escape_leaves_a_key_as_it_was_and_it_is_changed_by_pressing_it(screen):
    await screen.press("f2", "G", "e", shows="Press the key of")
    await screen.press("escape")
    await screen.until(lambda: not screen.app.screen.is_modal)
    assert screen.app.context.settings == Settings()
    await screen.press("escape", "f2", "slash")
    await screen.enter("key filter", "e", shows="Press the key of filter (Filter)")
    await screen.shows("now /; free: ")
    free = screen.text.partition("free: ")[2].partition("│")[0].split()
    assert "f" in free and not {"e", "j", "q"} & set(free)
    await screen.press("e", shows="e is edit (Edit) already (table)")
    await screen.press("f", shows="(yours; / no longer)")
    await screen.press("e", "slash")
    await screen.until(lambda: "yours" not in screen.text, "what it has without a file is nobody's own")
    assert screen.app.context.settings == Settings()
    await screen.press("e", "f", shows="(yours; / no longer)")
    await screen.press("w", "escape", "escape")
    assert read_file()[0].keys == {"filter": "f"}
    await screen.until(lambda: "f Filter" in screen.text)
    await screen.press("slash")
    assert not screen.app.screen.query_one("#filter-line").display
    await screen.press("f")
    await screen.until(lambda: screen.app.screen.query_one("#filter-line").display)


async def test_the_app_starts_over_a_file_with_mistakes_and_says_so(fake, opened):
    settings, problems = read("colums: [div]\ntheme: light\nrate: 77\n")
    async with opened(fake, settings=settings, settings_problems=problems) as screen:
        await screen.shows("tui.yaml line 1: 'colums' is unknown; did you mean 'columns'? Left out (1")
        await screen.shows("more: F2)")
        assert screen.app.theme == "silo-light"
        await screen.press("f2", shows="! tui.yaml line 3: rate is 0.5 to 10, not 77")


async def test_changed_keys_stand_in_bar_help_and_palette(fake, opened):
    settings, _ = read("keys:\n  filter: F10\n  help: F9\n")
    async with opened(fake, settings=settings) as screen:
        bar = line_with(screen, "q Quit")
        assert "F10 Filter" in bar
        assert bar.rstrip().endswith("F9 Help  q Quit")
        await screen.press("ctrl+p", shows="Filter  (F10)")
        await screen.press("escape", "f9", shows="F10")


async def test_a_file_that_cant_be_written_is_told_and_nothing_is_lost(fake, opened, home):
    home.mkdir()
    path().mkdir()
    async with opened(fake, size=(160, 50)) as screen:
        await screen.press("f2", "l", "w", shows="nothing was changed")
        assert line_with(screen, "theme").startswith(">*theme")


async def test_settings_are_there_before_a_logger_is(new_finder, screen_of):
    from silo_tui.app import SiloApp

    async with screen_of(SiloApp(new_finder())) as screen:
        await screen.shows("No logger is running")
        await screen.press("f2", shows="silo settings")
        await screen.press("escape", shows="No logger is running")


SIZES = [(80, 24), (60, 20), (160, 50)]


@pytest.mark.parametrize("size", SIZES)
async def test_the_key_bar_always_ends_with_help_and_quit(size, screen, ran_s=12):
    for keys in ((), ("V", "j"), ("m",), ("space",), ("left",), ("enter",)):
        await screen.press(*keys)
        await screen.pilot.pause()
        bar = screen.text.split("\n")[-1]
        assert bar.rstrip().endswith("? Help  q Quit"), (keys, screen.text)


async def test_the_key_bar_shows_what_counts_in_a_mode(screen, ran_s=12):
    await screen.press("V")
    assert screen.text.split("\n")[-1].startswith(" V Mark the range  Esc Leave it")
    await screen.press("escape")
    assert "Mark the range" not in screen.text
    await screen.press("m", "space")
    await screen.until(lambda: screen.text.split("\n")[-1].startswith(" space Go on"))
    await screen.press("space")
    await screen.until(lambda: screen.text.split("\n")[-1].startswith(" space Pause"))


async def test_above_a_dialog_the_bar_shows_the_keys_of_the_dialog(screen):
    await screen.press("t", "q", shows="Quit without applying?")
    await screen.until(lambda: screen.text.split("\n")[-1].startswith(" Enter "))
    first = screen.text.split("\n")[-1]
    await screen.press("j")
    await screen.until(lambda: screen.text.split("\n")[-1] != first, "what Enter does at the next choice")
    await screen.press("escape")
    await screen.until(lambda: screen.app.screen.query_one(KeyBar)._instead == "")
    await screen.shows("? Help  q Quit")


@pytest.mark.parametrize(
    ("in_file", "wished", "theme"), [("", "", "silo-16"), ("theme: dark\n", "", "silo-dark"), ("", "nord", "nord")]
)
def test_sixteen_colours_count_where_nobody_chose_others_and_are_not_written(home, monkeypatch, in_file, wished, theme):
    home.mkdir()
    path().write_text(in_file)
    monkeypatch.setenv("TEXTUAL_THEME", wished)
    monkeypatch.setattr("silo_tui.terminal.has_few_colors", lambda: True)
    found = []

    def run(app, mouse):
        found.append(app.theme)
        context = app.context
        write_file(context.saved_settings, replace(context.settings, mouse="off"))
        if theme == "silo-16":
            write_file(context.settings, replace(context.settings, theme="dark"))

    monkeypatch.setattr(f"{APP}.SiloApp.run", run)
    monkeypatch.setattr("silo_tui.sessions.finder.ClientFinder.begin", lambda finder: None)
    _run("robot", "local", None, demo=False, read_only=False, rate=None, view="", theme=None, mouse=False)
    assert found == [theme]
    assert path().read_text() == f"{in_file}mouse: off\n" + "theme: dark\n" * (theme == "silo-16")


@pytest.mark.parametrize(
    ("file", "demo", "looks"), [(None, False, True), (None, True, False), ("x.silo", False, False)]
)
def test_loggers_are_looked_for_where_neither_a_file_nor_the_demo_is_shown(home, monkeypatch, file, demo, looks):
    begun, app = [], SimpleNamespace(context=SimpleNamespace(), run=lambda mouse: None, release=str, return_code=3)
    monkeypatch.setattr(f"{APP}.SiloApp", lambda *_, **given: app)
    monkeypatch.setattr("silo_tui.sessions.finder.ClientFinder.begin", lambda _: begun.append(1))
    code = _run("", "local", file, demo=demo, read_only=False, rate=None, view="", theme=None, mouse=False)
    assert (code, len(begun)) == (3, looks)


def test_the_command_line_knows_the_themes():
    done = CliRunner().invoke(command, ["--theme", "drak"])
    assert done.exit_code == 2
    assert "'dark', 'light', 'contrast', '16'" in done.output


async def test_what_another_setting_says_is_done_again_where_it_is_another_one_alone(fake, opened, monkeypatch):
    done, name_of = set(), theme_name
    monkeypatch.setattr(f"{APP}.terminal.take_mouse", lambda app, wanted: done.add("mouse"))
    monkeypatch.setattr(f"{APP}.use_keys", lambda keymap, keys: done.add("keys"))
    monkeypatch.setattr(f"{APP}.theme.theme_name", lambda name: done.add("theme") or name_of(name))
    async with opened(fake) as screen:
        monkeypatch.setattr(screen.session.link, "set_rate", lambda rate: done.add("rate"))
        before = screen.app.context.settings
        for name, word in (
            ("", ""), ("theme", "light"), ("mouse", "off"), ("keys", {"refresh": "f9"}), ("keymap", "two-layer"),
            ("rate", 7.0),
        ):  # fmt: skip
            done.clear()
            screen.app.take_settings(replace(before, **({name: word} if name else {})))
            assert done == {"keys" if name == "keymap" else name} - {""}
            screen.app.take_settings(before)


def test_rows_of_keys_that_do_the_same_say_on_which_screens_they_count():
    told = [
        row_text(SettingRow(each, command=each), Settings(), Settings(), width=80).plain.split("  ")[-1]
        for each in ("monitor", "plot", "plot_conditions", "help")
    ]
    assert told == [
        "Plot (table): plot what is marked, or the element under the cursor",
        "Plot (table of a file): plot what is marked, or the element under the cursor",
        "Plot (triggers, alarms, parameters): plot what the line, or what is marked, is about",
        "Help: this page",
    ]


async def test_enter_after_an_arrow_keeps_what_the_arrow_chose(screen):
    await screen.press("f2", at="settings")
    await screen.press("right", "enter", shows="theme is light already; ")
    await screen.press("enter")
    assert screen.app.context.settings.theme == "light"
    await screen.press("down", "up", "enter")
    await screen.until(lambda: screen.app.context.settings.theme == "contrast", "the next one")


def test_what_a_choice_means_stands_apart_from_the_words_to_choose_from():
    settings = Settings(theme="contrast")
    line = row_text(SettingRow("theme", option=OPTION["theme"]), settings, settings, width=90).plain
    assert re.search(r"► contrast +16 +│ high contrast", line)


@pytest.mark.parametrize(
    ("command", "key", "told"),
    [
        ("sort", "f12", "F12, v o  (yours; o no longer)"),  # its place in a menu stays
        ("list_order", "v x", "v x  (yours; o, v o no longer)"),
        ("inspector", "f12", "F12, v i  (yours)"),
    ],
)
def test_the_line_of_a_key_says_all_that_it_is_now_and_which_no_longer(command, key, told):
    settings = Settings(keymap="two-layer", keys={command: key})
    line = row_text(SettingRow(f"key {command}", command=command), settings, Settings(), width=None)
    assert f" {told}" in line.plain

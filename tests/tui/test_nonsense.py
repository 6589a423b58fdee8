"""Nonsense in the `:` line and in dialogs: words on the screen, and the program goes on."""

import pytest

from silo_tui.commands.runner import CommandRunner
from silo_tui.model.table.fields import Field

pytestmark = pytest.mark.slow

FIRST = "/log/base/orientation"

LINES = [
    "", " ", "nonsense", "'open quote", '"', "\\", ":", "::", "set", "set x", "set div", "set div=", "set div=x",
    "set div=1e400", "set div=*", "set div=/0", "set div=*1e308", "set size=1e400s", "set size=-1s", "set =", "set ==",
    "set div=1 div=2", "set on=maybe", "set size=" + "9" * 500, "filter [", "filter (", "filter div>", "filter div>x",
    "filter unit:", "filter on:maybe", "filter " + "x" * 500, "filter *", "goto", "goto nope", "goto [", "sort",
    "sort x",
    "sort a b", "mark [", "mark div>", "unmark x", "theme", "theme nope", "theme a b", "picture /proc/x.svg",
    "picture /dev/null/x", "picture ~nobody-there/x.svg", "picture " + "x" * 300, "picture \x00", "load nope.yaml",
    "load ../../etc/passwd", "load '' x", "save ../x.yaml", "save ''", "save " + "x" * 300, "data csv x y", "data cvs",
    "data a/b", "data ''", "data csv ..", "start x", "stop x", "help x", "undo x", "apply x", "quit_not",
    "set [red]x[/]",
    "goto [/]", "nonsense[/red]", "\u00e4\u00f6", "set \u0664=5", "filter \u202e",
]  # fmt: skip
TYPED = ["", "x", "-1", "1e400", "9" * 400, "[/]", "\u00b2", "*", "/0", "10x", "nan", "1e308s", " ", "=", "*1e308"]


async def all_typed(key, screen):
    for typed in TYPED:
        await screen.press(key)
        await screen.type_or_paste(typed)
        await screen.press("enter")
        assert screen.text is not None, typed
        await screen.leave()
        assert screen.app.is_running, typed


async def test_strange_lines_are_told_of_and_the_program_goes_on(screen):
    for line in LINES:
        CommandRunner(screen.app.context).run(line)
        assert screen.text is not None, line
        await screen.leave()
        assert screen.app.is_running, line
    CommandRunner(screen.app.context).run("filter")
    CommandRunner(screen.app.context).run("set div=7")
    assert 7 in screen.session.table.values[Field.DIVIDER]


@pytest.mark.parametrize("key", ["d", "b"])
async def test_strange_words_in_a_cell_are_told_of_and_the_program_goes_on(key, screen):
    await all_typed(key, screen)
    await screen.press("d", "7", "enter")
    await screen.until(lambda: screen.value(FIRST, Field.DIVIDER) == "7")


@pytest.mark.parametrize("key", ["/", "e", "w", ":"])
async def test_strange_words_in_a_dialog_are_told_of_and_the_program_goes_on(key, screen, ran_s=12):
    await all_typed(key, screen)

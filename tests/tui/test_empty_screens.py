"""A screen that shows nothing: its bar and its menus offer no more than what can be done about nothing."""

import pytest

from silo_tui.actions import BY_ID

ABOUT_LOGGERS = ("Start/Stop", "Save", "Filter", "Edit", "Mark", "Order", "Open")


def bar(screen):
    return screen.text.splitlines()[-1]


async def test_without_a_logger_the_bar_offers_nothing_that_needs_one(opened):
    async with opened(ready=False, size=(200, 24)) as screen:
        await screen.shows("No logger is running")
        assert not [each for each in ABOUT_LOGGERS if each in bar(screen)]
        for words in ("g Go", "v View", "Look again", "Command", "? Help", "q Quit"):
            assert words in bar(screen)


async def test_a_menu_without_a_logger_says_of_what_is_about_one_that_there_is_none(opened):
    async with opened(ready=False) as screen:
        await screen.shows("No logger is running")
        await screen.press("e", shows="(l) Load")
        assert "what was there" not in screen.text
        await screen.press("l", shows="no line is here")
        assert screen.app.screen.scope == "loggers"


@pytest.mark.parametrize("size", [(80, 24), (200, 24)])
async def test_a_table_whose_filter_lets_nothing_pass_offers_nothing_about_rows(size, screen, ran_s=12):
    await screen.shows("space Mark")
    await screen.enter("/zzzz", shows="0 of 72")
    for each in ("mark_shown", "mark", "monitor", "fold"):
        assert f" {BY_ID[each].label}" not in bar(screen), each
    assert "Esc No filter" in bar(screen)
    await screen.press("asterisk", shows="no element is here")
    await screen.press("e", "d", shows="no element is here")
    assert not screen.app.screen.is_typing


async def test_what_is_marked_elsewhere_is_still_plotted_from_a_table_that_shows_nothing(
    screen, ran_s=12, size=(200, 24)
):
    await screen.press("space")
    await screen.enter("/zzzz", shows="0 of 72")
    assert "m Plot" in bar(screen)
    assert "Mark all" not in bar(screen)


@pytest.mark.parametrize("scope", ["triggers", "alarms", "events", "recordings", "parameters"])
async def test_a_list_without_a_line_offers_nothing_about_lines(scope, fake, screen, ran_s=12, size=(200, 24)):
    fake.trigger_statuses = fake.limit_statuses = []
    await screen.do(scope)
    await screen.until(lambda: screen.app.screen.scope == scope, scope)
    listed = screen.app.screen
    if listed.shown:
        await screen.press("slash")
        await screen.enter("zzzzzz")
        await screen.until(lambda: not listed.shown, "no line")
    for words in ("Mark", "Turn", "Delete", "Fetch", "w Write", "Go there", "Compare"):
        assert words not in bar(screen), words
    await screen.press("space")
    assert listed is screen.app.screen

"""Keys that come in one piece, as over a slow link: none of them goes astray, and no screen is lost."""

import pytest
from textual import events
from textual.geometry import Size

from silo_tui.model.table.fields import Field
from silo_tui.screens.table import TableScreen
from tests.tui.conftest import character_of

pytestmark = pytest.mark.slow  # each walks through the whole app


def burst(screen, keys: str) -> None:
    """Post keys at once."""
    for key in keys.split():
        screen.app.post_message(events.Key(key, character_of(key)))


async def test_keys_typed_fast_go_where_a_choice_leads_and_leave_the_table_where_it_is(screen):
    burst(screen, "e d 5 enter")
    await screen.until(lambda: screen.value("/log/base/orientation", Field.DIVIDER) == "5")
    for keys in (
        "o v v", "o v j", "o n z", "e d d", "e d 6 enter", "b b b", "S S y y", "a a a", "w w escape escape"
    ):  # fmt: skip
        await screen.press("home")
        burst(screen, keys)
        await screen.carried_out()
        while not isinstance(screen.app.screen, TableScreen):
            assert len(screen.app.screen_stack) > 1, screen.app.screen_stack
            await screen.press("escape")
        await screen.press("escape", "escape", "j")
        assert screen.session.rows.position > 0, keys


async def test_keys_typed_fast_into_the_find_menu_leave_the_plots_where_they_are(screen, ran_s=12):
    for keys in ("f h h", "f r o z e n", "f asterisk h l", "f escape escape j"):
        await screen.enter(":home", at="table")
        await screen.do("monitor", at="monitor")
        burst(screen, keys)
        await screen.carried_out()
        assert any(isinstance(each, TableScreen) for each in screen.app.screen_stack), keys
        while screen.app.screen.is_modal:
            await screen.press("escape")


async def test_plots_are_drawn_in_any_size_before_they_are_told_of_it(fake, opened, monkeypatch):
    async with opened(fake.run(), size=(160, 50)) as screen:
        await screen.press("j", "space", "space", "space", "m", at="monitor")
        stack = screen.app.screen.stack
        await screen.until(lambda: not stack.store.empty)
        for size in (Size(160, 48), Size(80, 22), Size(120, 38), Size(80, 22), Size(160, 48)):
            stack.redraw()
            for y in range(0, stack.size.height, 3):  # some lines are drawn in one size, the others in the next
                stack.render_line(y)
            monkeypatch.setattr(type(stack), "size", size)
            assert [len(stack.render_line(y).text) for y in range(size.height)] == [size.width] * size.height

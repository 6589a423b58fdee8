"""Where the cursor was and where it is are painted, also in what has scrolled."""

import pytest
from rich.text import Text
from textual.app import App
from textual.screen import ModalScreen

from silo.rpc.published import EventKind
from silo_tui.widgets.lines import Lines


def painted_of(widget, monkeypatch):
    """Return a set that the lines of the screen go to which are painted from now on."""
    found = set()
    refresh = widget.refresh

    def note(*regions, **what):
        found.update(y for region in regions for y in region.line_range)
        return refresh(*regions, **what)

    monkeypatch.setattr(widget, "refresh", note)
    return found


@pytest.mark.slow
async def test_of_a_table_that_has_scrolled_both_lines_are_painted(screen, monkeypatch):
    table = screen.app.screen.table
    await screen.press("G")
    await screen.until(lambda: table.scroll_offset.y > 0 and screen.text)  # looked at, and so painted
    painted = painted_of(table, monkeypatch)
    await screen.press("k")
    bottom = table.size.height - 1
    assert {bottom - 1, bottom} <= painted
    assert 0 not in painted  # and no more


async def test_of_a_list_that_has_scrolled_both_lines_are_painted(monkeypatch):
    class Listed(App):
        def compose(self):
            yield Lines("some")

    async with Listed().run_test(size=(40, 10)) as pilot:
        lines = pilot.app.query_one(Lines)
        lines.show(100, lambda place: Text(f"line {place}"), 0)
        lines.move(99)
        await pilot.pause()
        painted = painted_of(lines, monkeypatch)
        lines.move(98)
        assert painted == {8, 9}


async def test_what_can_t_be_painted_fails_the_test_also_where_it_was_closed_at_once():
    class Bad(ModalScreen):
        def compose(self):
            yield Unpaintable("some")

    class Unpaintable(Lines):
        def render_line(self, y):
            raise KeyError(y)

    with pytest.raises(KeyError):
        async with App().run_test(size=(40, 10)) as pilot:
            await pilot.app.push_screen(Bad())
            await pilot.app.pop_screen()


async def test_no_word_of_a_robot_moves_the_cursor_of_the_terminal(fake, opened):
    evil = "a\x1b[31mb\x07c\u202ed\x9be\udce9f\u200dg"
    async with opened(fake) as screen:
        fake.host = f"host{evil}"
        fake.publish(EventKind.BLIND, f"gripper {evil} is blind", by=f"bob{evil}")
        await screen.shows("is blind")
        assert "gripper a[31mbcde?fg is blind" in screen.text
        assert not {"\x1b", "\x07", "\u202e", "\x9b"} & set(screen.text)

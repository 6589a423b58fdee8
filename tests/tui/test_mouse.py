"""What the mouse does: rows, heads, plots, the wheel; and it can be left to the terminal while the app runs."""

import pytest

from silo_tui import terminal
from silo_tui.model.plots.picture import AXIS
from silo_tui.screens.plots.monitor import MonitorScreen

pytestmark = pytest.mark.slow  # each walks through the whole app


async def click_on_head(screen, title):
    place = screen.text.split("\n")[1].index(title) - screen.app.screen.table_head.region.x
    await screen.pilot.click("TableHead", offset=(place, 0))


async def test_a_click_on_a_head_sorts_by_it(screen):
    for title in ("unit", "name", "div", "act", "buf", "size"):
        await (screen.pilot.click("TableHead", offset=(3, 0)) if title == "name" else click_on_head(screen, title))
        await screen.shows(f"{'↓' if title in ('div', 'size') else '↑'}{title}")
        assert screen.session.rows.sort == title


@pytest.mark.parametrize("title", ["state", "fill", "value"])
async def test_a_click_on_a_live_head_orders_by_it_and_a_second_one_turns_the_order(
    screen, title, ran_s=12, size=(120, 24)
):
    place = screen.text.split("\n")[1].index(title) - screen.app.screen.table_head.region.x
    for turned in (False, True):
        await screen.pilot.click("TableHead", offset=(place, 0))
        await screen.until(lambda to=(title, turned): (screen.session.rows.sort, screen.session.rows.turned) == to)


async def test_heads_of_statistics_can_be_clicked(screen, ran_s=12):
    await screen.press("C", shows=" mean")
    for title in ("min", "max", "mean", "std"):
        await click_on_head(screen, title)
        await screen.until(lambda title=title: screen.session.rows.sort == title, title)


async def test_a_second_click_on_a_head_turns_the_order_round(screen):
    head = screen.text.split("\n")[1]
    for turned in (False, True, False):
        await screen.pilot.click("TableHead", offset=(head.index("div") + 1, 0))
        await screen.until(lambda turned=turned: screen.session.rows.turned is turned)
    await screen.pilot.click("TableHead", offset=(3, 0))
    await screen.shows("↑name")
    await screen.pilot.click("TableHead", offset=(3, 0))
    await screen.shows("↓name")


async def test_a_click_on_a_plot_chooses_it_and_puts_the_cursor_where_it_was(screen, ran_s=12, size=(100, 40)):
    await screen.press("j", "j", "space", "space", "m")
    await screen.until(lambda: isinstance(screen.app.screen, MonitorScreen) and len(screen.app.screen.stack.plots) > 1)
    monitor = screen.app.screen
    second = next(y for y in range(40) if monitor.stack.place_of(y) == (1, 0))
    await screen.pilot.click("PlotStack", offset=(AXIS + 1 + 20, second + 1))
    await screen.until(lambda: monitor.stack.chosen == 1)
    line = screen.text.split("\n")[2 + second]
    assert monitor.window.cursor == 2 * (monitor.stack.plot_width - 1 - 20)
    assert len(line) > AXIS + 21
    await screen.pilot.click("PlotStack", offset=(2, 0))
    await screen.until(lambda: monitor.stack.chosen == 0)


@pytest.mark.parametrize(
    ("term", "color", "few"), [("xterm-256color", "", False), ("xterm", "truecolor", False), ("linux", "", True)]
)
def test_a_terminal_of_sixteen_colours_is_known(monkeypatch, term, color, few):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", term)
    monkeypatch.setenv("COLORTERM", color)
    assert terminal.has_few_colors() is few


def test_the_word_of_the_settings_decides(monkeypatch):
    for name in ("SSH_CONNECTION", "SSH_TTY", "SSH_CLIENT"):
        monkeypatch.delenv(name, raising=False)
    assert [terminal.mouse_wanted(word) for word in ("auto", "on", "off")] == [True, True, False]
    monkeypatch.setenv("SSH_TTY", "/dev/pts/0")
    assert [terminal.mouse_wanted(word) for word in ("auto", "on", "off")] == [False, True, False]

"""What the key bar must never lack at 80 columns, whatever state a screen is in."""

import pytest

TORQUE = "/LF/HAA/torque"
FILTERED = ("filter", *"torque", "enter")
OF_TABLE = ("e Edit", "? Help", "q Quit")
OF_PLOTS = ("+ - Zoom", "/ Find", "p Plots", "g Go", "? Help", "q Quit")
TABLE = [
    ((), ("S Stop", "/ Filter", "g Go", "space Mark", "m Plot")),
    (FILTERED, ("S Stop", "/ Filter", "Esc No filter", "* Mark all")),
    (("mark", "mark"), ("S Stop", "/ Filter", "g Go", "m Plot")),
    ((*FILTERED, "mark_shown"), ("S Stop", "Esc No filter", "m Plot")),
    (("edit_divider", "5", "enter"), ("S Stop", "a Apply 1", "u Undo", "g Go")),
    ((*FILTERED, "edit_divider", "5", "enter"), ("S Stop", "a Apply 1", "u Undo", "Esc No filter")),
    ((*FILTERED, "mark_shown", "edit_divider", "5", "enter"), ("S Stop", "a Apply 12", "u Undo", "Esc No filter")),
    (("range",), ("S Stop", "V Mark the range", "Esc Leave it")),
    (("inspector",), ("S Stop", "Esc Close", "g Go")),
]
PLOTS = [
    ((), ("space Pause", "←→ PgUp Earlier", "Esc Back")),
    (("cursor_left",), ("←→ Cursor", "Esc No cursor", "space Pause")),
    (("pause",), ("space Go on", "←→ Cursor", "Esc Live")),
    (("cursor_left", "pause"), ("space Go on", "←→ Cursor", "Esc No cursor")),
    (("pause", "cursor_b"), ("space Go on", "←→ Cursor", "Esc No B")),
    (("earlier",), ("←→ Cursor", "Esc Live")),
    (("detail",), ("space Pause", "←→ PgUp Earlier", "Esc Back")),
    (("detail", "cursor_left"), ("←→ Cursor", "Esc No cursor")),
]
KINDS = {"over time": "t", "spectrum": "s", "histogram": "h"}


def bar(screen):
    return screen.text.splitlines()[-1]


def lacks(screen, wanted):
    return [each for each in wanted if f" {each} " not in f"{bar(screen)} "]


@pytest.mark.parametrize(("done", "wanted"), TABLE, ids=lambda each: " ".join(each)[:40])
@pytest.mark.parametrize("runs", [True, False], ids=["running", "stopped"])
async def test_the_bar_of_the_table_never_lacks_what_edits_and_what_starts_or_stops(done, wanted, runs, fake, opened):
    async with opened(fake.run() if runs else fake, size=(80, 24)) as screen:
        await screen.do(*done)
        wanted = [each if runs else each.replace("S Stop", "S Start") for each in (*OF_TABLE, *wanted)]
        await screen.until(lambda: not lacks(screen, wanted), str(wanted))


@pytest.mark.parametrize(("done", "wanted"), PLOTS, ids=lambda each: " ".join(each)[:40])
async def test_the_bar_of_plots_never_lacks_what_zooms_finds_and_leads_on(done, wanted, screen, ran_s=30):
    await screen.enter(TORQUE, "m")
    await screen.curves()
    for each in done:
        await screen.do(each)
    await screen.until(lambda: not lacks(screen, (*OF_PLOTS, *wanted)), str(wanted))


@pytest.mark.parametrize("letter", KINDS.values(), ids=KINDS)
async def test_nor_does_that_of_the_large_plot_whatever_it_shows(letter, screen, ran_s=30):
    await screen.enter(TORQUE, "m")
    await screen.curves()
    await screen.press("p", letter)
    find = "/ Find peak" if letter == "s" else "/ Find"
    wanted = [*(each for each in OF_PLOTS if each != "/ Find"), find, "space Pause", "Esc Back"]
    await screen.until(lambda: not lacks(screen, wanted), str(wanted))

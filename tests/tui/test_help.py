"""Help shows every command of a screen, whole, in columns; it is searched, and does what was found."""

import re

import msgspec
import pytest
from rich.cells import cell_len

from silo.settings.typed import OPTIONS
from silo_tui.actions import BY_ID, COMMANDS, commands_for
from silo_tui.model.table.columns import COLUMNS
from silo_tui.model.table.facts import STATES
from silo_tui.model.table.fields import Field
from silo_tui.model.table.filter import TERMS
from silo_tui.model.words.states import FULL, OLD
from silo_tui.screens.lists.help import _NUMBER, COLOURS, GAP, column_count, entries, page
from silo_tui.theme import ROLES, bold
from silo_tui.widgets.lines import MARKED, ON_MARKED

SCOPES = sorted({scope for command in COMMANDS for scope in command.scopes} - {"any"})


@pytest.mark.parametrize("width", [40, 79, 120, 160])
@pytest.mark.parametrize("scope", SCOPES)
def test_no_word_of_help_is_out_of_sight(scope, width):
    found = entries(scope, everywhere=True)
    text = page(found, width).plain
    assert all(cell_len(line) <= width for line in text.split("\n"))
    shown = " ".join(text.split())
    for entry in found:
        assert entry.left.split()[0] in shown
        assert all(word[:8] in shown for word in entry.right.split()), entry


@pytest.mark.parametrize(("width", "count"), [(80, 2), (119, 2), (120, 3), (160, 3), (60, 1)])
def test_there_are_three_columns_from_120(width, count):
    assert column_count(width) == count


@pytest.mark.parametrize("width", [60, 80, 120, 160])
@pytest.mark.parametrize("scope", SCOPES)
def test_each_column_begins_with_a_title_and_none_is_much_longer_than_the_others(scope, width):
    found = entries(scope, everywhere=False)
    first, *rest = page(found, width).plain.split("\n")
    groups, count = {entry.group for entry in found}, column_count(width)
    step = (width - 2 - GAP * (count - 1)) // count + GAP
    titles = [first[1 + step * column :][:step].strip() for column in range(count)]
    assert {title.removesuffix(" (more)") for title in titles} <= groups
    assert (" (more)" not in titles[0], len(set(titles))) == (True, count)
    if count > 1:
        heights = [
            max(row for row, line in enumerate(rest) if line[1 + step * at :][:step].strip()) for at in range(count)
        ]
        assert max(heights) - min(heights) <= max(12, max(heights) // 3)


@pytest.mark.parametrize("scope", SCOPES)
def test_every_key_of_a_screen_stands_there(scope):
    found = {entry.command for entry in entries(scope, everywhere=False)}
    assert {command.id for command in commands_for(scope)} <= found


def test_the_words_of_options_and_filter_are_those_of_their_tables():
    text = " ".join(f"{entry.left} {entry.right}" for entry in entries("table", everywhere=True))
    for option in OPTIONS:
        assert all(word.word in text for word in option.words)
    assert all(term.names[0] in text for term in TERMS)
    assert ":browser `silo-tui --serve`, typed in a shell, shows all of it as a web page, in a browser" in text
    assert all(example in BY_ID["edit_divider"].help for example in ("50Hz", "*2"))


def test_no_group_is_divided_where_that_makes_no_column_much_longer():
    assert "(more)" not in page(entries("recordings", everywhere=False), 80).plain
    assert "(more)" in page(entries("events", everywhere=False), 160).plain  # half as long again


@pytest.mark.parametrize("sign", ["DRAWN", "THIN", "since the cut"])
def test_every_sign_of_the_first_line_is_explained(sign):
    told = [one for one in entries("table", everywhere=False) if one.group == "First line"]
    assert any(sign in f"{one.left} {one.right}" for one in told)


def test_every_sign_of_the_table_is_explained():
    signs = [entry for entry in entries("table", everywhere=False) if entry.group == "Signs"]
    explained = {letters: entry.right for entry in signs for letters in entry.left.split()}
    assert all(explained[letters] for letters in (*(letters for _, letters in STATES), OLD, FULL, "…", "↓", "↑"))
    assert ON_MARKED in explained[MARKED]


@pytest.mark.parametrize(
    ("scope", "title"), [("monitor", "In plots"), ("file_detail", "In plots"), ("events", "Kinds")]
)
def test_letters_of_events_and_signs_of_plots_are_explained_where_they_stand(scope, title):
    left = {line.left for line in entries(scope, everywhere=False) if line.group == title}
    assert set("MTSEXH") <= left
    assert ({"╎", "│", "┊", "░"} <= left) == (title == "In plots")


@pytest.mark.parametrize("width", [80, 160])
async def test_each_word_and_sign_of_the_first_screen_is_found_in_help(fake, opened, width):
    fake.run(20)
    found = [line for line in entries("table", everywhere=False) if line.group in ("First line", "Columns", "Signs")]
    text = _NUMBER.sub("0", " ".join(f"{line.left} {line.right}" for line in found).casefold())
    told = {word.strip("():;,") for word in text.split()}  # whole words: "on" is in almost any line
    async with opened(fake, size=(width, 24)) as screen:
        session = screen.session
        session.status = msgspec.structs.replace(session.status, recorders=1)
        for slow, busy in ((1.0, "DRAWN 1.2 of 5 Hz"), (0.9, "THIN 64 kbit/s")):
            session.measured_hz = slow * session.status.frequency_hz
            head = f"{screen.app.screen.status_bar._line().plain} {busy}".split()[2:]  # behind silo and its name
            titles = next(line for line in screen.text.splitlines() if "↑name" in line).split()
            for word in (*head, *titles):
                assert _NUMBER.sub("0", word.casefold().strip("()↓↑,")) in told, word


@pytest.mark.parametrize(
    ("words", "left"), [("500/500", "488/500"), ("busy", "DRAWN"), ("vector", "norm"), ("03:12", "●")]
)
def test_numbers_of_the_first_screen_are_found_whatever_they_are_now(words, left):
    found = [line.left for line in entries("table", everywhere=False) if line.holds([words])]
    assert any(each.startswith(left) for each in found)


def test_a_line_of_the_table_has_one_name_whatever_is_done_with_it():
    of_table = [each.help for each in COMMANDS if set(each.scopes) & {"table", "file"}]
    assert not [each for each in of_table if re.search(r"\brows?\b|the signal\b", each)], "it is an element"


def test_what_menus_call_it_is_found():
    found = [line.right for line in entries("table", everywhere=True) if line.holds(["overlay"])]
    assert any(each.startswith("lay it over the live plots") for each in found)


def test_the_sign_before_news_is_explained():
    told = [(line.left, line.right) for line in entries("table", everywhere=False) if line.left.startswith("‣")]
    assert told == [("‣ 12:51:44 …", "news of the robot, and when they came; `:messages` shows all")]


def test_every_column_of_the_tables_is_explained():
    told = " ".join(line.left for line in entries("table", everywhere=False) if line.group == "Columns")
    assert all(column.title in told for column in COLUMNS)


async def test_what_a_colour_means_is_told_in_it(screen):
    await screen.press("question_mark", shows="Colours:")
    title = screen.app.screen.query_one("#help-title").content
    drawn = {title.plain[span.start : span.end]: span.style for span in title.spans}
    assert set(COLOURS) >= set(ROLES)
    assert drawn == {words: bold(screen.app.theme_variables, role) for role, words in COLOURS.items()}


async def test_the_foot_offers_no_enter_for_what_is_only_to_be_read(screen):
    await screen.press("question_mark", "slash")
    await screen.enter("news of the robot, and", shows="‣ 12:51:44 …")
    await screen.shows("Enter has no use here")


async def test_help_is_searched_and_does_what_was_found(screen):
    before = screen.value(screen.session.table.names[int(screen.session.rows.shown[0])], Field.ENABLED)
    await screen.press("question_mark", "slash")
    await screen.enter("switch logging", shows='hold "switch logging"')
    await screen.shows("Enter On/Off  ↑↓ Choose")
    assert screen.app.screen.is_modal
    await screen.press("enter")
    await screen.until(lambda: not screen.app.screen.is_modal)
    assert screen.value(screen.session.table.names[int(screen.session.rows.shown[0])], Field.ENABLED) != before


async def test_what_is_asked_for_by_a_command_from_help_is_answered(fake, screen, ran_s=12, size=(100, 30)):
    await screen.press("question_mark", "slash")
    await screen.enter("mark the tick", "enter", shows="Mark this moment")
    await screen.type("fell")
    await screen.press("enter")
    await screen.until(lambda: [call[:2] for call in fake.calls] == [("mark", "fell")])
    await screen.press("question_mark", "slash")
    await screen.enter("the screen as a picture", shows="Enter Picture  ↑↓ Choose")
    await screen.press("enter", shows="silo-tui.svg")


async def test_the_arrows_choose_among_what_was_found(screen):
    await screen.press("question_mark", "slash")
    await screen.type("off")
    await screen.press("up", "down", "down", "enter", "enter")  # the first stays chosen
    await screen.until(lambda: type(screen.app.screen).__name__ == "ParametersScreen")


async def test_what_is_not_on_this_screen_is_found_on_the_others(screen):
    await screen.press("question_mark", shows="silo help of the table")
    await screen.press("slash")
    await screen.type("hold the y scale", shows="silo help of all screens  1 of")
    await screen.press("enter", "enter")
    await screen.until(lambda: not screen.app.screen.is_modal)
    await screen.shows("it is a key of plots (m)")


async def test_tab_shows_all_screens_and_this_one_again(screen, size=(160, 50)):
    await screen.press("question_mark")

    def is_there():
        page = " ".join(screen.app.screen.query_one("#help-page").content.plain.split())
        return "mark or unmark" in page and "amplitudes by" in page

    assert not is_there()
    await screen.press("tab")
    await screen.until(is_there)
    await screen.press("tab")
    await screen.until(lambda: not is_there())


async def test_letters_are_words_while_they_are_typed(screen):
    await screen.press("question_mark", "slash", "q", "j")
    assert screen.app.screen.is_modal
    await screen.shows('hold "qj"')


async def test_a_command_that_writes_is_refused_from_help_too(screen, read_only=True):
    await screen.press("question_mark", "slash")
    await screen.enter("switch logging", "enter", shows="read-only")

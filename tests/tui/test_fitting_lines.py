"""What a line leaves out where it has no room, and what it never does."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from silo_tui.model.table.fields import Field
from silo_tui.model.words.names import cells
from silo_tui.widgets.bars import LinePart, fitting, lines_of
from silo_tui.widgets.messages import beginning

PART = st.builds(LinePart, st.integers(0, 9), st.text("abc", max_size=9))
PARTS = st.lists(PART, max_size=8, unique_by=lambda part: part.words)


def words(parts):
    return [part.words for part in parts]


@given(PARTS, st.integers(0, 60))
def test_what_is_left_out_is_of_a_lower_rank_than_what_stays(parts, room):
    kept = fitting(parts, room, " │ ")
    left_out = [part for part in parts if part.words and part not in kept]
    assert [part for part in parts if part in kept and part.words][: len(kept)] == kept
    assert all(part.rank for part in left_out)
    if left_out:
        assert max(part.rank for part in left_out) <= min((part.rank for part in kept if part.rank), default=9)
    elif any(part.rank for part in kept):
        assert len(" │ ".join(words(kept))) <= room


def test_shorter_words_come_before_none_and_the_last_of_them_stays():
    mode = LinePart(2, " paused, 3 s ", "reverse", (" paused ", " P "))
    parts = [LinePart(1, "first"), mode, LinePart(0, "alarm")]
    assert [words(fitting(parts, room)) for room in (30, 18, 13, 0)] == [
        ["first", " paused, 3 s ", "alarm"], [" paused, 3 s ", "alarm"], [" paused ", "alarm"], [" P ", "alarm"],
    ]  # fmt: skip


@pytest.mark.slow
async def test_a_filter_hides_neither_what_is_pending_nor_the_key_that_applies_it(screen):
    await screen.press("*")
    screen.session.table.edit(range(4), Field.DIVIDER, 7)
    await screen.press("/")
    await screen.enter("a_filter_of_many_letters|LF|joints|motors|torques|velocity")
    screen.app.context.say("what was said last, in a sentence that takes half of the line")
    await screen.shows("4 pending")
    assert "a Apply" in screen.text
    await screen.shows("half of the line")


@pytest.mark.slow
async def test_the_editor_of_a_cell_leaves_the_columns_before_it_in_sight(screen):
    await screen.do("j", "edit_divider")
    line = screen.text.split("\n")[2 + screen.session.rows.position]
    assert "[x]" in line


@pytest.mark.parametrize(
    ("words", "whole"),
    [("saved 1 225 244 samples", "1 225 244"), ("is held (10.8 MB)", "10.8 MB"), ("so many: 12 345", "12 345"),
     ("e d is in the table", "e d"), ("pressed: g a lists it", "g a"), ("with the keys p 0, all", "p 0"),
     ("it is zoomed by p +", "p +")],
)  # fmt: skip
def test_no_line_ends_within_a_number_before_its_unit_or_within_the_keys_of_a_menu(words, whole):
    for room in range(11, 30):
        lines = lines_of(words, room, Console())
        assert " ".join(line.strip() for line in lines) == words
        assert any(whole in line for line in lines)


def test_an_answer_is_measured_in_cells_and_keeps_its_lines():
    wide = beginning("数" * 30, 40, 2, Console())
    assert [cells(line) for line in wide.split("\n")] == [40, 20]
    lines = beginning(f"first\n{'数' * 30}\nlast", 40, 2, Console()).split("\n")
    assert lines[0] == "first"
    assert lines[1].endswith("… (:messages)")
    assert cells(lines[1]) <= 40

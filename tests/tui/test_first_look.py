"""What helps somebody who has never seen it: the tour, and what one looks for first."""

import pytest
from msgspec.structs import replace

from silo.conditions.standing import LimitStatus, LimitWord
from silo_tui.layouts.presets import BY_NAME, is_near, near_limit, within


@pytest.mark.parametrize(
    ("bounds", "near", "far"),
    [
        ((None, None, None, 80.0), (73.0, 81.0, 72.0), (71.9, -100.0)),
        ((44.0, 45.0, None, None), (49.3, 40.0), (49.5,)),
        ((None, -10.0, 10.0, 20.0), (-8.5, -8.0, 8.0, 25.0), (0.0, -7.9, 7.9)),
        ((None, None, -40.0, None), (-44.0, -30.0), (-44.1,)),
        ((None, None, None, None), (), (1.0, None)),
    ],
)
def test_near_a_limit_is_within_a_tenth_of_it(bounds, near, far):
    for values, found in ((near, True), (far, False)):
        for value in values:
            assert is_near(LimitStatus("a", "a", LimitWord.OK, value=value, bounds=bounds)) is found, value


def test_what_is_near_a_limit_is_a_filter_for_just_that():
    hot = LimitStatus("/log/a.b", "/log/a.b", LimitWord.OK, value=79.0, bounds=(None, None, None, 80.0))
    cold = LimitStatus("/log/a.bc", "/log/a.bc", LimitWord.OK, value=9.0, bounds=(None, None, None, 80.0))
    layout, words = near_limit([hot, cold])
    assert layout.filter == r"~/log/a\.b$"
    assert words.startswith("1 of 2 signals with limits")
    assert near_limit([cold])[0].filter == "alarm -nan"  # a table without rows says why in words that people know


@pytest.mark.parametrize("letter", ["h", "n", "s", "p"])
async def test_a_view_that_is_there_without_being_kept(fake, opened, letter):
    async with opened(fake.run()) as screen:
        await screen.do("view")
        await screen.shows("Look at what?")
        await screen.press(letter)
        preset = next(each for each in BY_NAME.values() if each.letter == letter)
        await screen.until(lambda: screen.session.rows.sort == preset.layout.sort)
        await screen.until(lambda: screen.session.rows.filter.text == preset.layout.filter)
        await screen.shows(f"view {preset.name}")


async def test_what_is_logged_otherwise_than_the_program_began_with_is_told_and_looked_at(fake, opened):
    one = fake.elements[3]
    fake.given = {one.name: replace(one.options, divider=7 * one.options.divider)}
    async with opened(fake) as screen:
        await screen.shows("1 edited since the program began (v v e)")
        (line,) = [each for each in screen.text.splitlines() if each.startswith("E")]
        assert screen.session.short_name(one.name).rpartition("/")[2] in line
        await screen.do("view")
        await screen.press("e")
        await screen.until(lambda: len(screen.session.rows.shown) == 1, "what was edited")
        await screen.shows("view edited")
        await screen.do("inspector")
        await screen.shows("(began as 7)")


async def test_a_word_that_is_no_command_is_told_as_it_is_typed_with_the_key_of_what_is_called_so(fake, opened):
    async with opened(fake) as screen:
        await screen.press(":", *"hist")
        await screen.shows("there is no command 'hist'; Histogram is p h")
        await screen.press("backspace", "backspace", "backspace")
        await screen.until(lambda: "there is no command" not in screen.text, "a word that goes on")


async def test_what_only_counts_is_no_noise(fake, opened):
    async with opened(fake.run()) as screen:
        await screen.do("view")
        await screen.shows("Look at what?")
        await screen.press("n")
        await screen.shows("view noisiest")
        shown = {screen.session.table.elements[row].entries[0].dtype[1] for row in screen.session.rows.shown}
        assert shown == {"f"}
        assert {element.entries[0].dtype[1] for element in screen.session.table.elements} > shown


@pytest.mark.parametrize(
    ("words", "view", "shown"),
    [
        ("torque", "noisiest", "torque type:f"),
        ("torque unit:degC", "noisiest", "torque type:f"),
        ("type:f", "noisiest", "type:f"),
        ("", "hottest", "unit:degC"),
        ("LF RF", "near-limit", "LF RF"),
    ],
)
def test_a_view_is_one_of_what_passes_the_filter(words, view, shown):
    assert within(BY_NAME[view], words).filter == shown


async def test_a_view_of_what_is_filtered_or_of_all_where_that_has_nothing_of_it(fake, opened):
    async with opened(fake.run()) as screen:
        await screen.enter("/torque")
        await screen.do("view")
        await screen.press("n")
        await screen.until(lambda: screen.session.rows.filter.text == "torque type:f")
        assert screen.session.rows.position == 0
        await screen.do("view")
        await screen.press("h")
        await screen.until(lambda: screen.session.rows.filter.text == "unit:degC")
        await screen.shows("view hottest; of all: 'torque' lets nothing of it pass")


async def test_esc_takes_all_of_a_view_back_and_what_was_chosen_since_by_itself(fake, opened):
    async with opened(fake.run()) as screen:
        rows, table = screen.session.rows, screen.app.screen.table
        await screen.enter("/torque")
        for letter in "nh":  # one after another
            await screen.do("view")
            await screen.press(letter)
        await screen.until(lambda: rows.sort == "value")
        await screen.shows("view hottest")
        await screen.press("escape")
        await screen.until(lambda: (rows.filter.text, rows.sort) == ("torque", "name"))
        assert table.column_set == "settings"
        await screen.do("view")
        await screen.press("n")
        await screen.shows("view noisiest")
        await screen.enter(":sort div")
        await screen.press("escape")
        await screen.until(lambda: (rows.filter.text, rows.sort) == ("", "div"))
        assert table.column_set == "statistics"


async def test_the_tour_goes_on_as_its_steps_are_done(fake, opened):
    async with opened(fake.run()) as screen:
        await screen.press("question_mark")
        await screen.shows("t Tour")
        await screen.press("t")
        await screen.shows("tour 1 of 6 (:tour ends it): /, then type torque")
        await screen.do("settings")  # which has no table
        await screen.until(lambda: screen.app.screen.scope == "settings", "the settings")
        await screen.press("escape")
        await screen.press("slash", *"torque", "enter")
        await screen.shows("tour 2 of 6")
        await screen.do("mark", "mark")
        await screen.shows("tour 3 of 6 (:tour ends it): m plots")
        await screen.do("monitor")
        await screen.shows("tour 4 of 6")
        await screen.do("pause")
        await screen.shows("tour 5 of 6 (:tour ends it): g h goes back")
        await screen.do("go_home")
        await screen.shows("tour 6 of 6 (:tour ends it): e d")
        await screen.do("edit_divider", "5", "enter")
        await screen.shows("that was the tour: ? shows all keys, u takes the edit back, g goes")
        await screen.shows("anywhere")
        await screen.press("question_mark", "t")
        await screen.until(lambda: "tour" not in screen.text)


async def test_the_tour_is_left_as_everything_is(fake, opened):
    async with opened(fake.run()) as screen:
        await screen.press("question_mark", "t")
        await screen.shows("tour 1 of 6")
        await screen.press("slash", *"torque", "enter", "escape")  # leaves the filter first
        await screen.shows("tour 2 of 6")
        await screen.press("escape")
        await screen.shows("the tour ends; :tour begins it again")
        await screen.until(lambda: "tour 2" not in screen.text)

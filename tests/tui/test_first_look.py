"""What helps somebody who has never seen it: the tour, and what one looks for first."""

import threading

import numpy as np
import pytest
from msgspec.structs import replace

from silo.conditions.standing import LimitStatus, LimitWord
from silo.core.quantities.writing import wall_clock
from silo.live.quantities import FROZEN, NOT_FINITE
from silo_tui.layouts.presets import BY_NAME, is_near, near_limit
from silo_tui.model.table.columns import NOISE
from silo_tui.model.table.facts import Facts
from tests.waiting import DEADLINE_S


@pytest.mark.parametrize(
    ("bounds", "near", "far"),
    [
        ((None, None, None, 80.0), (73.0, 81.0, 72.0), (71.9, -100.0)),
        ((44.0, 45.0, None, None), (49.4, 40.0), (49.6,)),
        ((None, -10.0, 10.0, 20.0), (-8.5, -8.0, 8.0, 25.0), (0.0, -7.9, 7.9)),
        ((None, None, -40.0, None), (-44.0, -30.0), (-44.1,)),
        ((None, None, None, None), (), (1.0, None)),
    ],
)
def test_near_a_limit_is_within_a_tenth_of_it(bounds, near, far):
    for values, found in ((near, True), (far, False)):
        for value in values:
            assert is_near(LimitStatus("a", "a", LimitWord.OK, value=value, bounds=bounds)) is found, value


@pytest.mark.parametrize(
    ("value", "closest", "share"),
    [
        (2.0, (LimitWord.YELLOW_HIGH, 4.0, 2.0), 0.25),
        (4.5, (LimitWord.YELLOW_HIGH, 4.0, -0.5), -0.0625),
        (6.5, (LimitWord.RED_HIGH, 6.0, -0.5), -0.0625),
        (-4.5, (LimitWord.RED_LOW, -4.0, -0.5), -0.0625),
    ],
)
def test_the_limit_that_a_value_is_about_is_the_next_or_the_outermost_that_it_is_beyond(value, closest, share):
    one = LimitStatus("a", "a", LimitWord.OK, bounds=(-4.0, None, 4.0, 6.0))
    assert one.closest(value) == closest
    assert one.share_left(value) == share
    assert LimitStatus("a", "a", LimitWord.OK).closest(value) is None
    assert np.isnan(LimitStatus("a", "a", LimitWord.OK).share_left(value))
    assert LimitStatus("a", "a", LimitWord.OK, bounds=(None, None, 0.0, None)).share_left(0.0) == 0.0


def test_what_is_near_a_limit_is_a_filter_for_just_that():
    hot = LimitStatus("/log/a.b", "/log/a.b", LimitWord.OK, value=79.0, bounds=(None, None, None, 80.0))
    cold = LimitStatus("/log/a.bc", "/log/a.bc", LimitWord.OK, value=9.0, bounds=(None, None, None, 80.0))
    passing, words = near_limit([hot, cold])
    assert passing == r"~/log/a\.b$"
    assert words.startswith("1 of 2 signals with limits")
    twice = replace(hot, limits="imu/*")
    assert near_limit([hot, twice, cold]) == (passing, words), "signals are counted, not the limits of each"
    assert near_limit([cold]) == ("", "none of 1 signal with limits is within a tenth of one")
    was = replace(cold, alarm=True)
    assert near_limit([was])[0] == r"~/log/a\.bc$", "what goes across its limit is not lost between two looks"
    assert near_limit([hot, was])[1].endswith("or beyond; 1 was beyond, which nobody has seen")
    assert near_limit([was])[1] == "1 was beyond, which nobody has seen; none of 1 signal with limits is near one now"


async def test_the_line_below_tells_of_what_is_near_a_limit_in_words(fake, opened):
    names = [one.name for one in fake.elements if one.name.endswith("/torque")]
    fake.limit_statuses = [
        LimitStatus(name, name, LimitWord.OK, value=79.0, bounds=(None, None, None, 80.0)) for name in names
    ]
    async with opened(fake.run()) as screen:
        await screen.do("view")
        await screen.press("l", shows="near a limit at ")  # values go on
        await screen.shows(f": {len(names)} of {len(fake.elements)}")
        assert "torque$" not in screen.text
        head = screen.text.splitlines()[1]
        at = head.index("↑limit") + len("↑limit")
        cells = [line[:at].split()[-4:] for line in screen.text.splitlines()[2:5]]
        for _, _, *bound in cells:
            assert bound == ["HH", "80"]
        assert {each[1] for each in cells} == {"to"}, "which, and how near, beside the value"
        await screen.enter("/*torque")  # another filter is told as it is typed
        await screen.shows(f"/*torque: {len(names)} of")
        assert "near a limit at" not in screen.text


async def test_where_nothing_is_near_a_limit_the_table_stays_and_a_key_that_sets_limits_is_named(
    fake, screen, ran_s=12
):
    rows = screen.session.rows
    await screen.press(*"vc")
    await screen.enter("/torque")
    await screen.press(*"ov")
    await screen.until(lambda: rows.sort == "value")
    shown = rows.filter.text, rows.sort, screen.app.screen.table.column_set
    await screen.press(*"vvl", shows="no signal has limits: e a sets some")
    assert (rows.filter.text, rows.sort, screen.app.screen.table.column_set) == shown
    name = next(one.name for one in fake.elements if one.name.endswith("/torque"))
    status = LimitStatus(name, name, LimitWord.OK, value=9.0, bounds=(None, None, None, 80.0))
    fake.limit_statuses = [status]
    await screen.press(*"vvl", shows="none of 1 signal with limits is within a tenth")
    await screen.shows("lists them, e a sets more")
    assert (rows.filter.text, rows.sort, screen.app.screen.table.column_set) == shown
    fake.limit_statuses = [replace(status, value=79.0)]
    await screen.press(*"vvl", shows=": 1 of 72")
    assert "near a limit at " in screen.text
    assert (rows.sort, screen.app.screen.table.column_set) == ("limit", shown[2])
    await screen.press("escape")
    await screen.until(lambda: rows.filter.text == "torque")


async def test_the_menu_names_some_views_where_it_leads_to_them(screen, size=(80, 24)):
    await screen.press("v", shows="v  Hottest, stuck, …")
    await screen.press("v", shows="Look at what?")


@pytest.mark.parametrize("letter", ["h", "n", "s", "p"])
async def test_a_view_that_is_there_without_being_kept(letter, screen, ran_s=12):
    await screen.do("view", shows="Look at what?")
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
        await screen.do("inspector", shows="(began as 7)")


async def test_a_word_that_is_no_command_is_told_as_it_is_typed_with_the_key_of_what_is_called_so(screen):
    await screen.press(":", *"hist", shows="there is no command 'hist'; Histogram is p h")
    await screen.press("backspace", "backspace", "backspace")
    await screen.until(lambda: "there is no command" not in screen.text, "a word that goes on")


async def test_what_only_counts_is_no_noise(screen, ran_s=12):
    await screen.do("view", shows="Look at what?")
    await screen.press("n", shows="view noisiest")
    shown = {screen.session.table.elements[row].entries[0].dtype[1] for row in screen.session.rows.shown}
    assert shown == {"f"}
    assert screen.session.rows.filter.text == "type:f"
    assert {element.entries[0].dtype[1] for element in screen.session.table.elements} > shown


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
async def test_a_view_is_of_all_elements_and_the_bar_names_the_filter_that_esc_goes_back_to(size, screen, ran_s=12):
    await screen.enter("/torque")
    torques = len(screen.session.rows.shown)
    for letter in "sh":  # of several, one after another, the filter of before the first
        await screen.do("view")
        await screen.press(letter, shows="Esc Back to torque")
    await screen.shows("view hottest")
    shown = {screen.session.table.elements[row].unit for row in screen.session.rows.shown}
    assert shown == {"degC"}
    await screen.press("escape", shows="Esc No filter")
    assert len(screen.session.rows.shown) == torques


async def test_a_view_that_nothing_passes_says_where_esc_leads(screen, ran_s=12):
    await screen.enter("/torque")
    await screen.do("view")
    await screen.press("e", shows="No element passes the filter 'edited'")
    await screen.shows("goes back to 'torque'.")
    await screen.press("escape", "escape")
    await screen.do("view")
    await screen.press("e", shows="clears it.")
    await screen.shows("Esc No filter")


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
async def test_what_stands_still_from_the_first_sample_on_is_seen_below_what_changed_before(size, fake, opened):
    floats = [element.name for element in fake.elements if element.entries[0].dtype[1] == "f"]
    dead, stopped, moves, just_now = floats[2:6]
    still = dict.fromkeys((element.name for element in fake.elements), 1.0) | {dead: 0.0}
    still |= {element.name: 0.0 for element in fake.elements if element.name not in floats}
    changed = {dead: 999.0, stopped: 50.0, just_now: 5.0}
    fake.facts = {"std": still, "signs": dict.fromkeys((stopped, just_now), FROZEN), "changed": changed}
    fake.facts["change_seen"] = {dead: 0.0}
    async with opened(fake.run(), size=size) as screen:
        await screen.do("view", shows="Stuck: floats, frozen or no change seen (>); last change on top")
        await screen.press("s")
        await screen.until(lambda: screen.session.short_name(moves) not in screen.text, "what stands still alone")
        await screen.shows("↑changed")
        names = [screen.session.short_name(each) for each in (just_now, stopped, dead)]  # by last change, never: below

        def rows() -> list[tuple[bool, bool]]:
            return [
                (name in line, "frozen" in line)
                for name, line in zip(names, screen.text.splitlines()[2:], strict=False)
            ]

        await screen.until(lambda: rows() == [(True, True), (True, True), (True, False)])
        changed = [" 5 s", " 50 s", ">17 min"]  # the last was never seen to change, in all the time it is looked at

        def told() -> bool:
            return all(words in line for words, line in zip(changed, screen.text.splitlines()[2:], strict=False))

        await screen.until(told, "which change was seen")
        assert "view stuck: floats, frozen or no change seen (>)" in " ".join(screen.text.split())
        of_type = {screen.session.table.elements[row].entries[0].dtype[1] for row in screen.session.rows.shown}
        assert of_type == {"f"}, "a flag that never changes is as it should be"
        screen.app.screen.info.give_way()
        await screen.shows("> no change seen yet")


@pytest.mark.parametrize("size", [(80, 24), (160, 50)])
async def test_with_a_filter_the_bar_has_what_stops_the_logger(size, screen, ran_s=12):
    await screen.enter("/torque", shows="Esc No filter")
    assert "S Stop" in screen.text


async def test_esc_takes_all_of_a_view_back_and_what_was_chosen_since_by_itself(screen, ran_s=12):
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
    await screen.press("n", shows="view noisiest")
    await screen.enter(":sort div")
    await screen.press("escape")
    await screen.until(lambda: (rows.filter.text, rows.sort) == ("", "div"))
    assert table.column_set == "statistics"


async def test_the_tour_goes_on_as_its_steps_are_done(screen, ran_s=12):
    await screen.press("question_mark", shows="t Tour")
    await screen.press("t", shows="tour 1 of 6 (:tour ends it): /, then type torque")
    await screen.do("settings", at="settings")  # which has no table
    await screen.press("escape")
    await screen.press("slash", *"torque", "enter", shows="tour 2 of 6")
    await screen.do("mark", "mark", shows="tour 3 of 6 (:tour ends it): m plots")
    await screen.do("monitor", shows="tour 4 of 6")
    await screen.do("pause", shows="tour 5 of 6 (:tour ends it): g h goes back")
    await screen.do("go_home", shows="tour 6 of 6 (:tour ends it): e d")
    await screen.do("edit_divider", "5", "enter")
    await screen.shows("that was the tour: ? shows all keys, u takes the edit back, g goes")
    await screen.shows("anywhere")
    await screen.press("question_mark", "t")
    await screen.until(lambda: "tour" not in screen.text)


async def test_the_tour_begins_at_the_table_and_is_left_as_everything_is(screen, ran_s=12):
    await screen.do("events")
    await screen.until(lambda: screen.app.screen.scope == "events", "a list that the first step knows nothing of")
    await screen.enter(":tour", shows="tour 1 of 6")
    assert screen.app.screen.scope == "table"
    await screen.press("slash", *"torque", "enter", "escape")  # leaves the filter first
    await screen.shows("tour 2 of 6")
    await screen.press("escape", shows="the tour ends; :tour begins it again")
    await screen.until(lambda: "tour 2" not in screen.text)


@pytest.mark.parametrize(("letter", "quantity", "most"), [("h", "value", 10), ("n", "noise", 10)])
async def test_the_first_ten_of_a_view_are_ten_and_stand_still_while_one_looks(letter, quantity, most, fake, opened):
    words = {"h": "temperatures: the first 10 of 13", "n": "floats: the first 10 of"}
    async with opened(fake.run(20)) as screen:
        rows, table = screen.session.rows, screen.session.table
        await screen.do("view")
        await screen.press(letter)
        if quantity == "noise":  # of statistics that have just begun
            await screen.until(lambda: rows.is_measured and rows.most == most, "a first survey")
            await screen.shows("floats: being measured")
            assert not rows.stood_ns
            fake.advance(4.0)
        await screen.until(lambda: rows.stood_ns, "what was measured")
        keys = rows.orders[rows.sort].keys(table)
        assert len(rows.shown) == most < rows.passing
        assert (np.diff(keys[rows.shown]) <= 0).all()
        stood = rows.shown.tolist()
        head = f"order of {wall_clock(rows.stood_ns)}"  # rows stay while their numbers change: no order of now
        await screen.until(lambda: head in screen.text.splitlines()[1], "of when the order is")
        await screen.shows(words[letter])
        await screen.shows(f"the first 10 of {rows.passing}")
        await screen.shows(" at ")
        screen.app.screen._typed_s = -100.0  # nobody has been at the keys for long
        fake.advance(3.0)
        facts = table.facts
        await screen.until(lambda: table.facts is not facts, "another survey")
        beside = {"min": -1, "max": 1}  # value between them
        names = {*facts.quantities, quantity}
        table.facts = Facts({name: beside.get(name, 0) - np.arange(len(table)) for name in names})
        rows.refresh()
        assert rows.shown.tolist() == stood
        await screen.do("down", "sort")  # an `o` at once after the `n` would spell on what that chose
        await screen.shows("name, as a tree")
        await screen.press("n")
        await screen.until(lambda: len(rows.shown) == rows.passing > most, "all of them")


async def test_the_first_ten_of_a_view_are_chosen_anew_where_it_is_asked_for_again(screen, ran_s=20):
    rows = screen.session.rows
    for _ in range(2):
        before = rows.stood_ns
        await screen.do("view")
        await screen.press("h")
        await screen.until(lambda before=before: rows.stood_ns > before, "the ten of now")
    await screen.press("escape")
    await screen.until(lambda: len(rows.shown) == 72, "all of them")
    assert rows.most == 0


async def test_of_what_nothing_is_known_is_no_hottest(screen, ran_s=20):
    rows, table = screen.session.rows, screen.session.table
    rows.sort = "value"
    rows.set_filter("unit:degC")
    values = np.full(len(table), np.nan)
    values[rows.shown[:3]] = 3.0, 5.0, 4.0
    table.facts = Facts({"value": values, "signs": np.where(np.isnan(values), NOT_FINITE, 0)})
    rows.show_first(10)
    rows.refresh()
    assert values[rows.shown].tolist() == [5.0, 4.0, 3.0]


async def test_a_table_that_takes_a_thin_link_for_seconds_tells_how_far_it_is(fake, opened):
    come, whole = threading.Event(), fake.table

    def table(told):
        told(0.25)
        assert come.wait(DEADLINE_S)
        return whole()

    fake.table = table
    async with opened(fake.run(), ready=False) as screen:
        await screen.shows("reading the table: 18 of 72 elements")
        come.set()
        await screen.until(lambda: len(screen.app.context.session.table) == 72)
        await screen.until(lambda: "reading the table" not in screen.text)


async def test_the_noisiest_are_ordered_by_the_number_that_stands_beside_them(fake, opened):
    """The head said `by std/median`, and no column showed the number."""
    fake.run()
    torques = [info.name for info in fake.infos if info.name.endswith("/torque")]
    fake.facts = {"noise": {name: 8.0 if name == torques[0] else 1.0 for name in torques}}
    async with opened(fake, size=(80, 24)) as screen:
        await screen.do("view", shows="Look at what?")
        await screen.press("n")
        row = screen.session.table.row(torques[0])
        await screen.until(lambda: screen.session.rows.shown[:1] == [row], "the noisiest")
        head, first = screen.text.splitlines()[1:3]
        at = head.index(f"↓{NOISE}")
        assert first[at : at + 1 + len(NOISE)].split() == ["8.0"], f"{head}\n{first}"
        await screen.press("escape")
        await screen.until(lambda: NOISE not in screen.text.splitlines()[1], "shown as long as it is the order")

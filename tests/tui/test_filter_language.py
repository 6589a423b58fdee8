"""The filter language beyond words: either, regular expressions, what is measured."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from silo.core.elements import Table
from silo.live.quantities import FROZEN, NOT_FINITE, SLOW
from silo_tui.model.table import filter as filters
from silo_tui.model.table.facts import Facts
from silo_tui.model.table.fields import Field
from silo_tui.model.table.state import TableState


@pytest.fixture
def table(robot):
    state = TableState()
    state.load(Table(1, robot))
    state.prefix = "/log"
    numbers = np.arange(len(state), dtype=float)
    signs = np.zeros(len(state))
    signs[3], signs[4], signs[5] = NOT_FINITE, FROZEN, SLOW | FROZEN
    state.facts = Facts({
        "value": np.where(numbers == 3, np.nan, -numbers), "std": numbers / 10, "rate": 400.0 - numbers,
        "share": 1 - numbers / 100, "changed": numbers, "fill": numbers / 100, "signs": signs,
    })  # fmt: skip
    return state


def passing(table, text):
    found = filters.parse(text)
    assert not found.problems
    return [table.names[row] for row in np.flatnonzero(found.mask(table, np.zeros(len(table), bool)))]


def count(table, text):
    return len(passing(table, text))


def test_words_stand_in_any_order(table):
    assert passing(table, "torque HAA LF") == ["/log/legs/LF/HAA/torque"]


def test_an_underscore_is_a_slash_too_as_names_are_typed_by_heart(table):
    assert passing(table, "LF_HAA_torque") == ["/log/legs/LF/HAA/torque"]
    assert passing(table, "-LF_HAA torque LF/HAA") == []


def test_a_bar_means_either(table):
    assert count(table, "LF|RF torque") == 6


def test_a_minus_before_alternatives_excludes_all_of_them(table):
    assert count(table, "torque -LF|RF") == 6


def test_a_field_asks_for_one_of_several_values(table):
    assert count(table, "unit:Nm|A") == 24
    assert count(table, "unit!=Nm|A") == len(table) - 24


def test_a_tilde_begins_a_regular_expression_with_its_bars(table):
    assert count(table, "~h(aa|fe)/torque$") == 8
    assert count(table, "torque -~HA+") == 8


def test_quotes_keep_blanks_and_bars_together(table):
    assert count(table, '"LF|RF"') == 0
    assert count(table, '"no such thing"') == 0


def test_a_glob_may_leave_the_prefix_out_that_the_table_leaves_out(table):
    assert count(table, "/legs/*/HAA/torque") == count(table, "/log/legs/*/HAA/torque") == 4
    assert count(table, "/HAA/*") == 0


def test_a_number_may_have_a_suffix(table):
    assert count(table, "size>=4k") == count(table, "size>=4000") > 0


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("value<-60", 11), ("|value|>60", 11), ("|value|>60|torque", 21), ("std>1", 61), ("rate<95%", 66),
        ("rate>=399", 2), ("rate>=399Hz", 2), ("changed<1s", 1), ("changed>1min", 11), ("changed>1m", 11),
        ("fill>=50%", 22),
    ],
)  # fmt: skip
def test_rows_are_chosen_by_what_is_measured(table, text, expected):
    assert count(table, text) == expected
    assert filters.parse(text).measured


def test_what_was_not_measured_is_neither_equal_nor_unequal(table):
    assert count(table, "value!=1e9") == len(table) - 1


def test_before_anything_was_measured_such_terms_hide_nothing(table):
    table.facts = Facts()
    assert count(table, "value>60 std>1") == len(table)


def test_facts_of_another_table_are_not_taken_for_this_one(table):
    table.facts = Facts({"value": np.zeros(3)})
    assert count(table, "value>60") == len(table)


@pytest.mark.parametrize(("text", "expected"), [("nan", 1), ("frozen", 2), ("slow", 1), ("alarm", 3), ("-alarm", 69)])
def test_rows_are_chosen_by_their_signs(table, text, expected):
    assert count(table, text) == expected


def test_off_shows_what_is_switched_off_also_as_a_pending_edit(table):
    table.edit([2], Field.ENABLED, 0)
    assert passing(table, "off") == [table.names[2]]


def test_an_unreadable_term_tells_its_place_and_the_others_count(table):
    found = filters.parse("torque div>many LF")
    assert found.places == ((7, 15),)
    assert int(found.mask(table, np.zeros(len(table), bool)).sum()) == 3


@pytest.mark.parametrize("text", ["~(", "~[a", "value>x", "rate<fast%", "changed<soon", "x>1"])
def test_what_can_t_be_read_says_so(table, text):
    assert len(filters.parse(text).problems) == 1


def test_the_term_that_takes_everything_away_is_told(table):
    found = filters.parse("LF value>60 torque")
    assert found.blocked_by(table, np.zeros(len(table), bool)) == ("value>60", 3)


def test_no_single_term_is_blamed_where_none_is_it(table):
    found = filters.parse("nope value>60")
    assert found.blocked_by(table, np.zeros(len(table), bool)) is None


@given(st.text(alphabet='ab|~-"*/ value<>=9.%(', max_size=24))
def test_every_text_is_a_filter(text):
    state = TableState()
    assert filters.parse(text).mask(state, np.zeros(0, bool)).shape == (0,)


def test_a_word_that_no_name_has_is_looked_for_in_what_the_program_says_of_its_elements(robot):
    said = {"/log/imu/temperature": "how late it came: its Jitter", "/log/base/position": "of the torque"}
    state = TableState()
    state.load(Table(1, [structs.replace(one, description=said.get(one.name, "")) for one in robot]))
    assert passing(state, "jitter") == passing(state, 'imu|nothing "its jitter"') == ["/log/imu/temperature"]
    assert passing(state, "jitter -imu") == []
    assert "/log/base/position" not in passing(state, "torque"), "names have it"
    found = filters.parse("jitter")
    rows, none = np.flatnonzero(found.mask(state, np.zeros(len(state), bool))), np.zeros(len(state), bool)
    assert found.by_description(state, none, rows.tolist()) == rows.tolist()

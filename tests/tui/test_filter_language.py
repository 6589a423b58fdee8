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
from silo_tui.model.table.fields import Field, synonym
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


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("torque HAA LF", ["/log/legs/LF/HAA/torque"]),  # words in any order
        ("LF_HAA_torque", ["/log/legs/LF/HAA/torque"]),  # `_` is a slash too, as names are typed by heart
        ("-LF_HAA torque LF/HAA", []),
        ("LF|RF torque", 6),  # either
        ("torque -LF|RF", 6),  # none of them
        ("unit:Nm|A", 24), ("unit!=Nm|A", 48),
        ("~h(aa|fe)/torque$", 8), ("torque -~HA+", 8),  # a regular expression has its own bars
        ('"LF|RF"', 0), ('"no such thing"', 0),  # quotes keep blanks and bars together
        ("/legs/*/HAA/torque", 4), ("/log/legs/*/HAA/torque", 4), ("/HAA/*", 0),  # without the prefix of the table too
        ("nan", 1), ("frozen", 2), ("slow", 1), ("alarm", 3), ("problem", 3), ("-problem", 69),
        ("state:nan", 1), ("state:slow|Frozen", 2), ("state!=nan", 71), ("state:hh", 0), ("state:full", 0),
        ("value!=1e9", 71),  # what was not measured is neither equal nor unequal
    ],
)  # fmt: skip
def test_what_passes(table, text, expected):
    found = passing(table, text)
    assert (found if isinstance(expected, list) else len(found)) == expected


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


@pytest.mark.parametrize("facts", [Facts(), Facts({"value": np.zeros(3)})])  # of nothing, of another table
def test_what_was_not_measured_hides_nothing(table, facts):
    table.facts = facts
    assert count(table, "value>60 std>1") == len(table)
    texts = ("-changed<10m", "frozen", "-nan", "state:slow", "-state:full", "rate!=5", "legs|std=0", "-frozen|std=0")
    for text in texts:
        assert count(table, text) == len(table), text


@pytest.mark.parametrize("word", ["frozen", "-frozen", "slow", "state:frozen", "monotone", "problem", "edited", "off"])
def test_the_filters_own_words_are_explained_as_they_are_typed(word):
    assert filters.explained(f"LF {word}").startswith(f"{word.removeprefix('-')}: ")
    assert filters.explained(f"{word} LF") == "", "a part of a name speaks for itself"
    assert all(len(f"{each}: {meaning}") + len("500 of 500") < 80 - 2 for each, meaning in filters.EXPLAINED.items())


def test_monotone_is_what_is_at_its_extreme_of_all(table):
    count_of = len(table)
    steady = {"min": np.full(count_of, -1.0), "max": np.full(count_of, 5.0)}
    value = np.array([5.0, -1.0, np.nan, *[2.0] * (count_of - 3)])
    table.facts = Facts({"value": value, **steady})
    assert passing(table, "monotone") == table.names[:2]
    assert count(table, "-monotone") == count_of - 2
    assert filters.parse("-monotone").measured


def test_off_shows_what_is_switched_off_also_as_a_pending_edit(table):
    table.edit([2], Field.ENABLED, 0)
    assert passing(table, "off") == [table.names[2]]


@pytest.mark.parametrize(
    "text",
    ["buf:grow", "buf:loop", "-buf:grow", "buf!=loop", "div=1", "div:5", "div>1", "buf:grow div:5", "on:yes", "off"],
)
def test_an_edited_row_passes_by_what_it_has_and_by_what_is_wanted(table, text):
    grow, loop = synonym(Field.BUFFER, "grow"), synonym(Field.BUFFER, "loop")
    table.server[Field.BUFFER], table.server[Field.DIVIDER], table.server[Field.ENABLED] = grow, 1, 1
    for field, value in ((Field.BUFFER, loop), (Field.DIVIDER, 5), (Field.ENABLED, 0)):
        table.edit([7], field, value)
    assert table.names[7] in passing(table, text)
    assert table.names[7] not in passing(table, "div=3|buf:fixed")
    assert count(table, text) in (1, len(table))


def test_an_unreadable_term_tells_its_place_and_the_others_count(table):
    found = filters.parse("torque div>many LF")
    assert found.places == ((7, 15),)
    assert int(found.mask(table, np.zeros(len(table), bool)).sum()) == 3


@pytest.mark.parametrize("text", ["~(", "~[a", "value>x", "rate<fast%", "changed<soon", "x>1"])
def test_what_can_t_be_read_says_so(table, text):
    assert len(filters.parse(text).problems) == 1


@pytest.mark.parametrize(("text", "blamed"), [("LF value>60 torque", ("value>60", 3)), ("nope value>60", None)])
def test_the_term_that_takes_everything_away_is_told_where_a_single_one_does(table, text, blamed):
    assert filters.parse(text).blocked_by(table, np.zeros(len(table), bool)) == blamed


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
    assert found.more_described(state, none) == 0, "it is shown"
    assert filters.parse("torque").more_described(state, none) == 1, "that of base/position, which names stand before"


def test_where_no_name_has_all_words_each_may_be_in_name_or_description(robot):
    """`left` is in the name of a sonar, which hides nothing of the left leg: all words together say what is meant."""
    said = {"/log/legs/LF/HAA/torque": "Left hip", "/log/imu/temperature": "beside the left hip"}
    said["/log/base/velocity"] = "torque and hip"
    names = {"/log/base/position": "/log/base/left", "/log/base/velocity": "/log/of_left"}
    state = TableState()
    state.load(Table(1, [
        structs.replace(one, name=names.get(one.name, one.name), description=said.get(one.name, "")) for one in robot
    ]))  # fmt: skip
    assert passing(state, "left") == ["/log/base/left", "/log/of_left"], "names have it"
    assert passing(state, "left hip torque") == ["/log/of_left", "/log/legs/LF/HAA/torque"]
    assert passing(state, "left hip") == ["/log/of_left", "/log/imu/temperature", "/log/legs/LF/HAA/torque"]
    assert passing(state, "left hip -torque") == ["/log/imu/temperature"]
    assert passing(state, "lf torque") == [f"/log/legs/LF/{each}/torque" for each in ("HAA", "HFE", "KFE")]
    found, none = filters.parse("left hip"), np.zeros(len(state), bool)
    rows = np.flatnonzero(found.mask(state, none)).tolist()
    assert [state.names[row] for row in found.by_description(state, none, rows)] == [
        "/log/of_left", "/log/imu/temperature", "/log/legs/LF/HAA/torque"
    ]  # fmt: skip
    state.facts = Facts({"value": np.array([5.0 * ("left" not in name) for name in state.names])})
    assert passing(state, "left value>1") == [], "what is measured takes rows away, and brings none"


class Names(list):
    """Names that count how often they are looked through."""

    looks = 0

    def __iter__(self):
        self.looks += 1
        return super().__iter__()


@pytest.mark.parametrize(
    ("text", "looks"),
    [("torque LF", 2), ("~LF_H -RF", 2), ("LF|RF div>1", 2), ("*/LF/*", 2)],  # a pattern at names, then at entries
)
def test_names_are_looked_through_once_by_each_word_be_there_edits_or_not(table, text, looks):
    table.edit(np.array([2]), Field.DIVIDER, 7)
    table.searched = Names(table.searched)
    found = filters.parse(text)
    marked = np.zeros(len(table), bool)
    first = found.mask(table, marked)
    assert (table.searched.looks, len(first)) == (looks, len(table))
    assert (found.mask(table, marked) == first).all()
    assert table.searched.looks == looks


def test_only_what_asks_of_settings_is_asked_of_those_wanted_and_of_those_in_force(table):
    rows, asked = np.array([2]), []

    def test(table, marked, settings):
        asked.append(int(settings[Field.DIVIDER, 2]))
        return np.zeros(len(table), bool)

    was = int(table.server[Field.DIVIDER, 2])
    table.edit(rows, Field.DIVIDER, 7)
    marked = np.zeros(len(table), bool)
    filters.Condition("a", test).passes(table, marked)
    assert asked == [7]
    filters.Condition("a", test, of_settings=True).passes(table, marked)
    assert asked == [7, 7, was]


@pytest.mark.parametrize("text", ["div=7", "-div=7", "div!=7", "on:no", "off", "act:save", "size>9999", "buf:fix"])
def test_an_edit_hides_no_row_from_a_filter_of_what_it_edits(table, text):
    before = set(passing(table, text))
    table.edit(np.array([2]), Field.DIVIDER, 7)
    table.edit(np.array([2]), Field.ENABLED, 0)
    assert before <= set(passing(table, text))
    assert text not in {"div=7", "off", "on:no"} or table.names[2] in passing(table, text)

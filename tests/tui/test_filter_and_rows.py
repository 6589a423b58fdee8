"""The filter language, the order, the cursor and the marks."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from silo.core.elements import Action, BufferType, ElementInfo, ElementOptions, Entry, Table
from silo.settings.typed import apply_settings
from silo_tui.model.table import filter as filters
from silo_tui.model.table.columns import ADDED, NAME, TREE
from silo_tui.model.table.fields import Field, parse_change, values_of
from silo_tui.model.table.rows import RowList
from silo_tui.model.table.state import TableState


@pytest.fixture
def table(robot):
    state = TableState()
    state.load(Table(1, robot))
    return state


@pytest.fixture
def rows(table):
    found = RowList(table)
    found.refresh()
    return found


def shown(rows, text):
    rows.set_filter(text)
    return [rows.table.names[row] for row in rows.shown]


@given(st.text(max_size=40))
def test_no_text_makes_the_filter_fail(text):
    state = TableState()
    assert filters.parse(text).mask(state, np.zeros(0, bool)).shape == (0,)


@given(st.text(alphabet='abdisuvun:=<>!*?[]"-/ 159.', max_size=20))
def test_filter_terms_are_total_on_a_table(text):
    state = TableState()
    state.load(Table(1, [ElementInfo("/log/a", "Nm", "scalar", (), (Entry("", "<f8"),), ElementOptions())]))
    assert filters.parse(text).mask(state, np.zeros(1, bool)).shape == (1,)


JOINTS, LEGS = ("HAA", "HFE", "KFE"), ("LF", "LH", "RF", "RH")


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("lf TORQUE", [f"LF/{joint}" for joint in JOINTS]),  # words must all be in the name
        ("torque LF -HAA -HFE", ["LF/KFE"]),
        ("/log/*/H?A/torque", [f"{leg}/HAA" for leg in LEGS]),  # a glob with a slash in front: the whole name
        ("LF/*/torq*e", [f"LF/{joint}" for joint in JOINTS]),  # without one: its end
    ],
)
def test_words_and_globs_are_about_names(rows, text, names):
    assert shown(rows, text) == [f"/log/legs/{name}/torque" for name in names]


@pytest.mark.parametrize(
    ("text", "passes", "by_component"),
    [("LF torque", [True, True, False], [0]), ("torque", [True, True, True], []),
     ("-LF", [False, False, True], []), ("~LF_H..$", [True, False, False], [0])],
)  # fmt: skip
def test_what_passes_by_the_name_of_a_component_alone_is_known(text, passes, by_component):
    entries = (Entry("_LF_HAA", "<f8"), Entry("_RF_HAA", "<f8"))
    named = [
        ("joints/torque", entries),
        ("legs/LF/torque", (Entry("", "<f8"),)),
        ("legs/RF/torque", (Entry("", "<f8"),)),
    ]
    state, none = TableState(), np.zeros(3, bool)
    state.load(Table(1, [ElementInfo(f"/log/{name}", "Nm", "vector", (), of, ElementOptions()) for name, of in named]))
    found = filters.parse(text)
    assert found.mask(state, none).tolist() == passes
    assert found.by_component(state, none, np.flatnonzero(passes).tolist()) == by_component


def test_a_filter_leads_to_the_first_whose_name_has_the_words():
    entries = (Entry("_LF_KFE", "<f8"), Entry("_RF_KFE", "<f8"))
    state = TableState()
    named = [("joints/position", entries), ("legs/LF/KFE/position", (Entry("", "<f8"),))]
    state.load(Table(1, [ElementInfo(f"/log/{name}", "rad", "vector", (), of, ElementOptions()) for name, of in named]))
    rows = RowList(state)
    rows.refresh()
    for text, name in (
        ("LF KFE position", "legs/LF/KFE/position"),
        ("position", "joints/position"),
        ("RF", "joints/position"),
    ):
        rows.set_filter(text)
        assert rows.row is not None
        assert state.names[rows.row] == f"/log/{name}"


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("unit:Nm", 12), ("unit:nm", 12), ("div>1", 14), ("div>=40 size<1000", 14), ("buf:grow", 1), ("buf:fix", 12),
        ("act:publish", 59), ("act:save", 72), ("act:both", 59), ("on:no", 0), ("kind:quat", 1), ("type:S16", 1),
        ("live", 72), ("-live", 0), ("marked", 0), ("dirty", 0), ("unit!=Nm", 60), ("div:40", 14),
    ],
)  # fmt: skip
def test_field_terms(rows, text, count):
    assert (len(shown(rows, text)), rows.filter.problems) == (count, ())


def test_dirty_shows_what_is_pending(rows):
    rows.table.edit([3], Field.DIVIDER, 9)
    assert shown(rows, "dirty") == [rows.table.names[3]]


def test_a_term_that_makes_no_sense_is_reported_and_left_out(rows):
    assert len(shown(rows, "div>many")) == len(rows.table)
    assert "'many' is no number" in rows.filter.problems[0]


@pytest.mark.parametrize("text", ["-", "div>", "unit:", "act:", '"'])
def test_a_term_being_typed_hides_nothing(rows, text):
    assert len(shown(rows, text)) == len(rows.table)


def test_names_sort_as_people_count():
    from silo_tui.model.table.rows import natural_key

    assert sorted(["/j10", "/j2", "/J1"], key=natural_key) == ["/J1", "/j2", "/j10"]


def test_the_cursor_goes_to_the_first_that_passes_another_filter_and_stays_there_without_one(rows):
    rows.move_to_row(rows.table.row("/log/legs/RF/KFE/torque"))
    rows.set_filter("RF torque")
    assert rows.position == 0
    rows.move_to_row(rows.table.row("/log/legs/RF/KFE/torque"))
    rows.set_filter("RF torque")
    assert rows.table.names[rows.row] == "/log/legs/RF/KFE/torque", "the same once more"
    rows.set_filter("")
    assert rows.table.names[rows.row] == "/log/legs/RF/KFE/torque"


@pytest.mark.parametrize(
    ("order", "text", "first"),
    [(NAME, "LF mode", "/log/LF/mode"), (NAME, "LF mod", "/log/LF/a_mode"), (TREE, "MODE", "/log/LF/mode"),
     (ADDED, "LF mode", "/log/LF/a_mode")],
)  # fmt: skip
def test_the_cursor_goes_to_the_name_that_was_typed_whole_where_names_are_in_their_order(order, text, first):
    state = TableState()
    names = [f"/log/LF/{name}" for name in ("a_mode", "mode")]
    state.load(Table(1, [ElementInfo(name, "", "scalar", (), (Entry("", "<f8"),), ElementOptions()) for name in names]))
    rows = RowList(state)
    rows.sort = order
    rows.set_filter(text)
    assert state.names[rows.row] == first


def test_marks_survive_a_filter_and_are_counted_as_hidden(rows):
    rows.set_filter("torque")
    rows.mark_shown()
    rows.set_filter("velocity")
    assert (rows.marked_count, rows.hidden_marked, len(rows.hidden_targets())) == (12, 12, 12)
    rows.toggle_mark()
    assert (rows.marked_count, rows.hidden_marked) == (13, 12)
    assert all("torque" in rows.table.names[row] for row in rows.hidden_targets())
    rows.toggle_mark()
    assert (rows.marked_count, rows.hidden_marked) == (12, 12)
    rows.begin_range()  # which is about what is shown
    assert not len(rows.hidden_targets())


def test_marking_all_twice_unmarks(rows):
    rows.mark_shown()
    assert rows.mark_shown() == 0


def test_edits_are_about_the_marks_or_else_the_cursor(rows):
    assert list(rows.targets()) == [rows.row]
    rows.set_filter("unit:Nm")
    rows.mark_shown()
    assert len(rows.targets()) == 12


def test_an_editor_opens_on_the_nearest_row_that_is_edited(rows):
    assert not rows.move_to_target()  # the cursor's own row is edited
    for at in (2, 9):
        rows.move_to(at)
        rows.toggle_mark()
    for at, there in ((5, 2), (7, 9), (9, 9)):
        rows.move_to(at)
        assert (rows.move_to_target(), rows.position) == (at != there, there)
    rows.set_filter("velocity")
    place = rows.position
    assert (rows.move_to_target(), rows.position) == (False, place)  # those are hidden


def test_a_range_marks_from_its_begin_to_the_cursor(rows):
    rows.move_to(2)
    rows.begin_range()
    rows.move_to(5)
    assert (len(rows.targets()), rows.end_range(), rows.marked_count) == (4, 4, 4)


@pytest.mark.parametrize(
    ("field", "text", "old", "new"),
    [
        (Field.SIZE, "1000", 10, 1000), (Field.SIZE, "=1k", 10, 1000), (Field.SIZE, "*2", 10, 20),
        (Field.SIZE, "/3", 10, 4), (Field.SIZE, "+5", 10, 15), (Field.SIZE, "10s", 10, 1000),
        (Field.SIZE, "500ms", 10, 50), (Field.DIVIDER, "50Hz", 4, 8), (Field.DIVIDER, "5", 4, 5),
        (Field.ACTION, "both", 1, Action.SAVE_AND_PUBLISH), (Field.BUFFER, "=grow", 1, BufferType.GROWING),
    ],
)  # fmt: skip
def test_what_may_be_typed_for_a_field(field, text, old, new):
    before = ElementOptions(divider=4, size=10, action=Action.SAVE, buffer=BufferType.LOOPING)
    assert values_of(before)[field] == old
    (made,) = apply_settings(parse_change(field, text), [("/x", before)], 400.0)
    assert values_of(made)[field] == new


@pytest.mark.parametrize(
    ("field", "text", "reason"),
    [
        (Field.DIVIDER, "0", "from 1 to 2147483647, got 0"), (Field.DIVIDER, "x", "50Hz, *2, /2 or +1, got x"),
        (Field.DIVIDER, "10s", "only sets the size"), (Field.DIVIDER, "1.5", "whole number"),
        (Field.SIZE, "*1e30", "from 1 to 2147483647, got 1e+31"), (Field.SIZE, "/0", "got inf"),
        (Field.ACTION, "shout", "save (1), both (0) or publish (2), got shout"), (Field.DIVIDER, "0Hz", "rate"),
    ],
)  # fmt: skip
def test_what_may_not_be_typed_says_why(field, text, reason):
    with pytest.raises(ValueError, match=re.escape(reason)):
        apply_settings(parse_change(field, text), [("/x", ElementOptions(divider=4, size=10))], 400.0)


def test_the_cursor_goes_to_the_first_element_where_its_own_is_filtered_out(rows):
    rows.set_filter("RF torque")
    rows.move_to(len(rows.shown) - 1)
    rows.set_filter("imu")
    assert rows.position == 0


def test_a_scalar_is_found_in_the_table_as_it_is_now(table, robot):
    several = next(one for one in robot if len(one.entries) > 1)
    name = several.name + several.entries[1].suffix
    assert table.scalar(name) == (several, several.entries[1])
    assert table.scalar(f"{name}_too") is None
    table.load(Table(2, [one for one in robot if one is not several]))
    assert table.scalar(name) is None

"""Orders by what is measured, and the tree: folding, counts, edits on a branch, entries of vectors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from silo.core.elements import Table
from silo.live.quantities import FROZEN, NOT_FINITE
from silo_tui.model.table.columns import TREE
from silo_tui.model.table.facts import Facts
from silo_tui.model.table.rows import RowList
from silo_tui.model.table.state import TableState
from silo_tui.model.table.tree import entry_of, row_of, tree_of
from tests.stand_ins.fake_signals import vector


@pytest.fixture
def rows(robot):
    table = TableState()
    table.load(Table(1, robot))
    table.prefix = "/log"
    found = RowList(table)
    found.refresh()
    return found


def words(rows):
    """Branches as `legs/`, entries as `_x`, elements by their last level."""
    found = []
    for line in rows.tree.lines.tolist():
        row, entry = row_of(line), entry_of(line)
        if row is None:
            found.append(rows.tree.branches[-1 - line].path.rpartition("/")[2] + "/")
        elif entry is not None:
            found.append(rows.table.elements[row].entries[entry].suffix)
        else:
            found.append(rows.table.names[row].rpartition("/")[2])
    return found


def measure(rows, **quantities):
    rows.table.facts = Facts({name: np.array(values, float) for name, values in quantities.items()})


def test_a_tree_has_a_line_per_name_space(rows):
    rows.order_by("tree")
    assert words(rows)[:7] == ["base/", "orientation", "position", "velocity", "imu/", "acceleration", "temperature"]
    assert [each.path for each in rows.tree.branches if each.depth == 0] == ["/base", "/imu", "/legs", "/state"]
    legs = next(branch for branch in rows.tree.branches if branch.path == "/legs")
    assert len(legs.rows) == 64


def test_z_folds_the_branch_of_an_element_and_stands_on_it(rows):
    rows.order_by("tree")
    rows.move_to_row(rows.table.row("/log/imu/temperature"))
    rows.fold()
    assert rows.branch.path == "/imu"
    assert words(rows)[4:6] == ["imu/", "legs/"]
    rows.fold()
    assert words(rows)[4:6] == ["imu/", "acceleration"]


def test_edits_and_marks_on_a_branch_are_about_all_below(rows):
    rows.order_by("tree")
    rows.move_to(0)
    assert [rows.table.names[row] for row in rows.targets()] == [
        "/log/base/orientation", "/log/base/position", "/log/base/velocity",
    ]  # fmt: skip
    rows.toggle_mark()
    assert rows.marked_count == 3


def test_a_branch_counts_what_passes_the_filter(rows):
    rows.order_by("tree")
    rows.set_filter("torque")
    assert words(rows)[:4] == ["legs/", "LF/", "HAA/", "torque"]
    assert len(rows.tree.branches[0].rows) == 12


def test_a_vector_unfolds_into_its_entries_in_list_and_tree(rows):
    rows.move_to_row(rows.table.row("/log/imu/acceleration"))
    rows.fold()
    at = rows.position
    assert words(rows)[at : at + 4] == ["acceleration", "_x", "_y", "_z"]
    assert len(words(rows)) == len(rows.table) + 3
    rows.move_to(at + 2)
    assert (rows.entry, rows.table.names[rows.row]) == (1, "/log/imu/acceleration")
    assert len(rows.shown) == len(rows.table)
    rows.order_by("tree")
    assert rows.entry == 1
    assert [rows.tree.depth(rows.position + step) for step in (-3, -2, -1, 0, 1, 2)] == [0, 1, 2, 2, 2, 1]
    rows.fold()
    assert (rows.entry, "_x" in words(rows)) == (None, False)


def test_a_vector_is_shown_by_its_norm_then_entry_by_entry_then_whole_again(rows):
    def shown():
        return rows.next_component(), rows.component(rows.row)

    rows.move_to_row(rows.table.row("/log/imu/acceleration"))
    assert (rows.component(rows.row), [shown() for _ in range(5)]) == (
        0,
        [
            ("the norm of its 3 entries alone", 1), ("entry x alone, 1 of 3", 2), ("entry y alone, 2 of 3", 3),
            ("entry z alone, 3 of 3", 4), ("its entries side by side", 0),
        ],
    )  # fmt: skip
    rows.move_to_row(rows.table.row("/log/imu/temperature"))
    assert shown() == ("it has one value only", 0)


def test_what_has_entries_of_several_units_has_no_norm_whatever_is_asked_for():
    table = TableState()
    table.load(Table(1, [vector("/log/pose", "-", kind="pose"), vector("/log/push", "N", "xy")]))
    rows = RowList(table)
    rows.refresh()
    assert (rows.next_component(), rows.component(0)) == ("entry x alone, 1 of 3", 2)
    rows.next_component(), rows.next_component(), rows.next_component()
    rows.order_by("value")  # of a vector by its norm
    assert [rows.component(row) for row in range(2)] == [0, 1]


def test_going_to_an_element_unfolds_what_hides_it(rows):
    rows.order_by("tree")
    rows.folded = frozenset({"/legs", "/legs/LF"})
    rows.refresh()
    row = rows.table.row("/log/legs/LF/HAA/torque")
    assert rows.move_to_row(row)
    assert rows.row == row


def test_the_cursor_stands_on_the_folded_branch_over_its_element(rows):
    rows.order_by("tree")
    rows.move_to_row(rows.table.row("/log/legs/LF/HAA/torque"))
    rows.folded = frozenset({"/legs"})
    rows.refresh()
    assert rows.branch.path == "/legs"


def test_a_range_over_a_folded_branch_has_all_of_it(rows):
    rows.order_by("tree")
    rows.folded = frozenset({"/imu"})
    rows.refresh()
    rows.move_to_row(rows.table.row("/log/base/velocity"))
    rows.begin_range()
    rows.move_to(rows.position + 1)
    found = [rows.table.elements[row].name for row in rows.range_rows().tolist()]
    assert found == ["/log/base/velocity", "/log/imu/acceleration", "/log/imu/temperature"]


@pytest.mark.parametrize("order", ["name", "tree"])
def test_a_range_that_begins_at_an_entry_has_no_vector_whose_line_is_not_in_it(rows, order):
    rows.sort = order
    rows.unfolded = {"/log/base/velocity": 3}
    rows.refresh()
    rows.move_to_row(rows.table.row("/log/base/velocity"))
    rows.move_to(rows.position + 3)
    rows.begin_range()
    rows.move_to(rows.position + 2)
    found = [rows.table.elements[row].name for row in rows.range_rows().tolist()]
    assert found[0] == "/log/imu/acceleration"


NAMES = st.lists(
    st.lists(st.sampled_from(["a", "b", "B", "a1", "a10"]), min_size=1, max_size=4).map(lambda p: "/" + "/".join(p)),
    unique=True, max_size=12,
)  # fmt: skip


@given(NAMES, st.sets(st.sampled_from(["/a", "/a/b", "/B", "/b/a1"])))
def test_every_element_is_on_one_line_or_below_a_folded_branch(names, folded):
    order = np.array(sorted(range(len(names)), key=lambda each: names[each].split("/")), np.intp)
    tree = tree_of(order, names, frozenset(folded), {})
    lines = tree.lines.tolist()
    assert len(set(lines)) == len(lines) == len(tree.depths)
    for row, name in enumerate(names):
        hidden = any(name.startswith(path + "/") for path in folded)
        assert (row in lines) != hidden
        assert all((row in branch.rows) == name.startswith(branch.path + "/") for branch in tree.branches)
    assert len({branch.path for branch in tree.branches}) == len(tree.branches)


@pytest.mark.parametrize("turned", [False, True])
def test_nan_and_what_is_not_known_stand_last_either_way_and_inf_where_it_belongs(rows, turned):
    values = np.arange(len(rows.table), dtype=float)
    values[[4, 5, 6, 7]] = np.nan, np.nan, np.inf, -np.inf
    signs = np.where(np.arange(len(rows.table)) == 5, NOT_FINITE, 0)
    measure(rows, value=values, signs=signs.astype(float))
    rows.order_by("value")
    if turned:
        rows.order_by("value")
    assert rows.arrow == "↓↑"[turned]
    assert (rows.shown[0], rows.shown[-3]) == ((7, 6) if turned else (6, 7))
    assert set(rows.shown[-2:]) == {4, 5}


@pytest.mark.parametrize(("order", "last"), [("std", True), ("mean", True), ("max", False)])
def test_between_labels_is_nothing_to_order_by(rows, order, last):
    count = len(rows.table)
    row = next(at for at, one in enumerate(rows.table.elements) if any(entry.labels for entry in one.entries))
    measure(rows, **{order: np.where(np.arange(count) == row, 0.0, 1.0 + np.arange(count))}, signs=np.zeros(count))
    for _ in range(2):
        rows.order_by(order)
        if rows.arrow == "↑":
            assert rows.shown[-1 if last else 0] == row


def test_what_filter_and_order_are_by_is_known_when_all_of_it_was_measured(rows):
    assert not rows.is_measured
    measure(rows, signs=np.zeros(len(rows.table)))
    assert rows.is_measured  # by name and unfiltered the signs are all there is
    rows.set_filter("std=0")
    assert not rows.is_measured
    assert len(rows.shown) == len(rows.table)  # which is why nobody says so many passed
    rows.order_by("value")
    measure(rows, signs=np.zeros(len(rows.table)), std=np.ones(len(rows.table)))
    assert not rows.is_measured
    measure(rows, signs=np.zeros(len(rows.table)), std=np.ones(len(rows.table)), value=np.ones(len(rows.table)))
    assert rows.is_measured
    rows.refresh()
    assert len(rows.shown) == 0


def test_the_worst_signs_come_first(rows):
    signs = np.zeros(len(rows.table))
    signs[7], signs[9] = FROZEN, NOT_FINITE
    measure(rows, signs=signs)
    rows.order_by("state")
    assert list(rows.shown[:2]) == [9, 7]


@pytest.mark.parametrize("order", ["name", "added"])
def test_a_list_order_turns_round_by_its_letter_again(rows, order):
    rows.order_by(order)
    before = list(rows.shown)
    rows.order_by(order)
    assert list(rows.shown) == before[::-1]


def test_a_tree_has_no_other_way_round_and_its_arrow_stays(rows):
    rows.order_by("tree")
    before, arrow = words(rows), rows.arrow
    rows.order_by("tree")
    assert (words(rows), rows.arrow, rows.turned) == (before, arrow, False)
    rows.order_by("name")
    assert not rows.turned


def test_the_place_of_the_cursor_counts_elements_not_unfolded_entries(rows):
    rows.order_by("added")
    vector = next(row for row, element in enumerate(rows.table.elements) if len(element.entries) == 3)
    rows.move_to_row(vector)
    rows.fold()
    rows.move_to_row(vector + 1)
    assert (rows.place, rows.position) == (vector + 2, vector + 4)


def test_what_is_asked_of_all_elements_is_what_order_and_filter_need(rows):
    assert rows.wanted() == {"signs"}
    rows.order_by("|value|")
    rows.set_filter("std>1 rate<95% torque")
    assert rows.wanted() == {"signs", "value", "std", "rate", "share"}


def test_a_filter_leads_to_the_first_element_that_passes_in_a_tree_too(rows):
    """Not to the name space above it: plots, edits and triggers are of what was looked for."""
    rows.order_by(TREE)
    rows.set_filter("LF torque")
    assert rows.row == rows.shown[0]
    rows.folded = frozenset({"/legs"})
    rows.set_filter("LF velocity")
    assert rows.branch is not None, "what is folded stays so"


def test_rows_that_a_measured_filter_lets_go_stay_for_two_seconds(rows):
    measure(rows, signs=np.zeros(len(rows.table)), value=np.full(len(rows.table), 70.0))
    rows.set_filter("value>60")
    measure(rows, signs=np.zeros(len(rows.table)), value=[50.0, *[70.0] * (len(rows.table) - 1)])
    rows.refresh(10.0)
    assert (0 in rows.shown, rows.leaving) == (True, frozenset({0}))
    rows.refresh(12.5)
    assert (0 in rows.shown, rows.leaving) == (False, frozenset())


def test_rows_that_were_shown_only_as_nothing_was_measured_yet_go_at_once(rows):
    rows.set_filter("changed<1s")
    assert len(rows.shown) == len(rows.table)
    measure(rows, signs=np.zeros(len(rows.table)), changed=[0.5, *[110.0] * (len(rows.table) - 1)])
    rows.refresh(10.0)
    assert (rows.shown.tolist(), rows.leaving) == ([0], frozenset())
    measure(rows, signs=np.zeros(len(rows.table)), changed=np.full(len(rows.table), 110.0))
    rows.refresh(11.0)
    assert rows.leaving == {0}


@pytest.mark.slow
async def test_a_branch_and_a_vector_show_by_a_sign_whether_they_are_open(screen, size=(80, 48)):
    await screen.press("o", "n")
    for words in ("▼ base  ", "▼ legs  ", "  ▼ LF  ", "    ▼ HAA  ", "► velocity |3|"):
        await screen.shows(words)
    screen.session.rows.folded = frozenset({"/legs", "/base"})
    screen.app.context.table_changed()
    await screen.shows("► legs  ")
    assert "LF" not in screen.text
    await screen.press("g", "g", "plus", shows="▼ base  ")
    assert "► legs  " in screen.text
    await screen.press("j", "j", "j", "plus", shows="▼ velocity |3|")
    lines = screen.text.splitlines()
    at = next(at for at, line in enumerate(lines) if "▼ velocity" in line)
    assert [line.split()[0] for line in lines[at + 1 : at + 4]] == ["x", "y", "z"]


@pytest.mark.slow
async def test_a_mark_on_a_name_space_says_how_many_it_marked_and_stays(screen, size=(80, 48)):
    await screen.press("o", "n", shows="▼ base  ")
    await screen.do("top", "mark", shows="3 elements of /base marked")
    assert (screen.session.rows.marked_count, screen.session.rows.branch.path) == (3, "/base")
    await screen.do("mark", shows="3 elements of /base no longer marked")


async def test_what_orders_nothing_leaves_the_choice_of_an_order_open(screen):
    await screen.press("o", "question_mark", shows="? is no letter of an order")
    await screen.press("v")
    await screen.until(lambda: screen.session.rows.sort == "value")

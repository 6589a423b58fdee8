"""Columns of minimum and maximum, and how they are drawn."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from silo.core.arrays.columns import ColumnStore, grid_of
from silo_tui.model.drawing import braille
from silo_tui.model.drawing.dots import BLANK
from silo_tui.model.drawing.plots import hold
from silo_tui.model.drawing.window import PlotWindow

values = st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=1, max_size=60).map(np.array)


def store(*pieces, count=8):
    found = ColumnStore(["a"], count, 100)
    for first, low, high in pieces:
        found.merge(["a"], grid_of(first, np.array([low], float), np.array([high], float)))
    return found


@pytest.mark.parametrize(
    ("step", "kept"), [(0, [1, 2, 3, 4]), (1, [2, 3, 4, 0]), (3, [4, 0, 0, 0]), (4, [0] * 4), (9, [0] * 4)]
)
def test_columns_leave_with_their_marks_as_newer_ones_come(step, kept):
    found = ColumnStore(["a"], 4, 100)
    found.advance_to(4)
    for array in (found.low, found.high, found.marks):
        array[:] = [1, 2, 3, 4]
    found.advance_to(4 + step)
    assert (found.first, found.end, found.marks.tolist()) == (step, 4 + step, [kept])
    assert np.nan_to_num(found.low).tolist() == np.nan_to_num(found.high).tolist() == [kept]


@given(st.lists(st.tuples(st.integers(0, 6), st.lists(st.floats(-5, 5), min_size=1, max_size=4)), max_size=6))
def test_pieces_may_come_in_any_order(pieces):
    pieces = [(first, some, some) for first, some in pieces]
    ends = max((first + len(low) for first, low, _ in pieces), default=0)
    one, other = store(count=32), store(count=32)
    for each in (one, other):
        each.advance_to(max(ends, 1))
    for first, low, high in pieces:
        one.merge(["a"], grid_of(first, np.array([low]), np.array([high])))
    for first, low, high in reversed(pieces):
        other.merge(["a"], grid_of(first, np.array([low]), np.array([high])))
    assert np.array_equal(one.low, other.low, equal_nan=True)
    assert np.array_equal(one.high, other.high, equal_nan=True)


def test_a_column_that_comes_again_only_gets_wider():
    found = store((5, [0.0], [1.0]), (5, [0.2], [3.0]))
    piece = found.piece("a", 6, 1)
    assert (piece.low[0], piece.high[0]) == (0.0, 3.0)


def test_old_columns_leave_when_new_ones_come():
    found = store((0, [1, 2], [1, 2]), (9, [5], [5]), count=4)
    assert (found.first, found.end) == (6, 10)
    assert np.isnan(found.low[0, :3]).all()


def test_a_window_beyond_what_there_is_is_empty():
    assert np.isnan(store((0, [1], [1])).piece("a", 100, 5).low).all()


def test_a_slow_signal_holds_between_its_samples_but_not_for_ever():
    low = np.array([1.0, np.nan, np.nan, np.nan])
    held, _ = hold(low, low, 2)
    assert np.array_equal(held, [1.0, 1.0, 1.0, np.nan], equal_nan=True)


@given(values, st.integers(1, 20), st.integers(1, 6))
def test_any_values_give_a_picture_of_the_right_size(some, width, height):
    lines = braille.rasterise(some, some, (-1.0, 1.0), width, height)
    assert [len(line) for line in lines] == [width] * height


@given(st.integers(0, 79), st.integers(2, 8))
def test_a_spike_of_one_sample_always_reaches_the_top(at, height):
    low, high = np.zeros(80), np.zeros(80)
    high[at] = 10.0
    top = braille.rasterise(low, high, (0.0, 10.0), 40, height)[0]
    assert top[at // 2] != BLANK


def test_gaps_stay_empty():
    some = np.full(10, np.nan)
    assert braille.rasterise(some, some, (0.0, 1.0), 5, 2) == [BLANK * 5] * 2


def test_a_steep_line_has_no_holes():
    some = np.array([0.0, 0.0, 10.0, 10.0])
    picture = braille.rasterise(some, some, (0.0, 10.0), 2, 4)
    assert all(any(char != BLANK for char in line) for line in picture)


@given(st.floats(-1e9, 1e9), st.floats(0, 1e9))
def test_a_nice_range_holds_the_values(smallest, extent):
    bottom, top = braille.nice_range(smallest, smallest + extent)
    slack = 1e-6 * max(abs(bottom), abs(top), 1e-9)
    assert bottom <= smallest + slack
    assert top >= smallest + extent - slack
    assert bottom < top


def test_the_range_of_nothing_is_none():
    assert braille.value_range(np.array([np.nan]), np.array([np.nan])) is None


@pytest.mark.parametrize(
    ("extent", "expected"), [((0.0, 9.7), (0.0, 10.0)), ((-38.0, 41.0), (-40.0, 50.0)), ((5.0, 5.0), (4.5, 5.5))]
)
def test_nice_ranges_have_round_ends(extent, expected):
    assert braille.nice_range(*extent) == pytest.approx(expected)


def test_the_cursor_stays_in_the_window_at_both_ends():
    window = PlotWindow()
    window.move_cursor(1, 40)
    assert window.cursor == 38, "to the right it comes in at the left"
    for _ in range(60):
        window.move_cursor(-1, 40)
    assert window.cursor == 38, "the first cell of 20: two columns each"
    for _ in range(60):
        window.move_cursor(1, 40)
    assert window.cursor == 0
    window.cursor = None
    window.move_cursor(-1, 40)
    assert window.cursor == 2, "to the left it comes in at the right"

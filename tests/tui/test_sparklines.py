"""Trends of all rows at once show what each by itself would."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from silo.core.arrays.columns import ColumnStore, Gap, grid_of, hole_mark
from silo.core.elements import Table
from silo_tui.model.drawing import braille
from silo_tui.model.drawing.plots import HOLD, hold_piece, trends
from silo_tui.model.table.state import TableState
from tests.stand_ins.fake_signals import scalar, vector

WIDTH = 6
VALUES = st.one_of(
    st.just(np.nan), st.sampled_from([0.0, 1.0, -1.0, 1e308, -1e308, 5e-324]), st.floats(-10, 10, allow_nan=False)
)

MARKS = st.sampled_from([0, 0, 0, 1, 2, 4, *(hole_mark(hole) for hole in Gap)])


@given(
    arrays.arrays(np.float64, (4, 2 * WIDTH), elements=VALUES), st.integers(0, 2 * WIDTH),
    arrays.arrays(np.uint8, (4, 2 * WIDTH), elements=MARKS), st.booleans(),
)  # fmt: skip
@settings(max_examples=60, deadline=None)
def test_trends_drawn_together_are_those_drawn_one_by_one(values, filled, marks, marked):
    names = ["/a", "/b", "/c", "/d"]
    store = ColumnStore(names, 2 * WIDTH, 1)
    low = values.copy()
    low[:, : 2 * WIDTH - filled] = np.nan
    store.merge(names, grid_of(0, low, low + 0.25, marks * marked))
    expected = [one_trend(hold_piece(store.piece(name, store.end, 2 * WIDTH), HOLD)) for name in names]
    assert trends(store, names, WIDTH) == expected


def one_trend(piece):
    low, high = braille.value_range(piece.low, piece.high) or (math.nan, math.nan)
    scale = (low - 1, high + 1) if braille.is_constant(low, high) else (low, high)
    return braille.rasterise(piece.low, piece.high, scale, WIDTH, 1, piece.marks)[0]


def test_a_signal_with_nan_keeps_its_mark_among_others():
    store = ColumnStore(["/a", "/b"], 20, 1)
    low = np.vstack([np.arange(20.0), np.arange(20.0)])
    marks = np.zeros((2, 20), np.uint8)
    marks[1, 9] = 1
    store.merge(["/a", "/b"], grid_of(0, low, low, marks))
    plain, marked = trends(store, ["/a", "/b"], 10)
    assert "×" in marked
    assert "×" not in plain


def test_time_without_samples_is_shaded_between_two_and_not_before_the_first():
    store = ColumnStore(["/a", "/b"], 20, 1)
    low = np.vstack([np.arange(20.0), np.arange(20.0)])
    low[0, 4:16] = low[1, :16] = np.nan
    store.merge(["/a", "/b"], grid_of(0, low, low))
    gap, begun = trends(store, ["/a", "/b"], 10)
    assert gap.strip(braille.SHADE) == gap
    assert gap.count(braille.SHADE) == 4  # the value before holds for a while
    assert braille.SHADE not in begun


@pytest.mark.parametrize("width", [0, 5, 80])
def test_trends_have_their_width_whatever_is_stored(width):
    store = ColumnStore(["/a"], 20, 1)
    store.merge(["/a"], grid_of(0, np.ones((1, 20)), np.ones((1, 20))))
    assert [len(line) for line in trends(store, ["/a", "/not there"], width)] == [width, width]


def test_words_have_no_trend():
    table = TableState()
    table.load(Table(0, [scalar("/log/x"), scalar("/log/words", dtype="|S8"), vector("/log/v", "m")]))
    assert [table.drawn_name(row) for row in range(3)] == ["/log/x", "", "/log/v_x"]

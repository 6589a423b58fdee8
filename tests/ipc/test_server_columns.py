"""Columns by time: every sample counts once, in the column of its time stamp."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from silo.core.arrays.columns import MAX_COLUMNS, ColumnGrid, as_floats, bins_of

TIMES = st.lists(st.integers(-5_000, 5_000), min_size=1, max_size=60)


@given(TIMES, st.integers(1, 700), st.data())
def test_columns_have_the_minimum_and_maximum_of_their_samples(times, column_ns, data) -> None:
    values = data.draw(arrays.arrays(float, len(times), elements=st.floats(-9, 9) | st.just(np.nan)))
    time_ns = np.array(times)
    first = int(time_ns.min()) // column_ns
    grid = ColumnGrid(1, first, min(int(time_ns.max()) // column_ns - first + 1, MAX_COLUMNS))
    grid.add(0, bins_of(time_ns, column_ns), values)
    want = np.full((2, grid.low.shape[1]), np.nan)
    columns = time_ns // column_ns - first
    for column in set(columns.tolist()) & set(range(grid.low.shape[1])):
        inside = values[columns == column]
        want[:, column] = np.fmin.reduce(inside), np.fmax.reduce(inside)
    kept = slice(max(0, int(bins_of(time_ns, column_ns).columns[0]) - first), None)  # of more than 4096 the newest
    np.testing.assert_array_equal((grid.low[0, kept], grid.high[0, kept]), want[:, kept])


@given(TIMES, st.integers(1, 700), st.integers(0, 60))
def test_samples_in_two_pieces_give_the_columns_of_one(times, column_ns, cut) -> None:
    time_ns, values = np.array(times), np.arange(float(len(times)))
    first = int(time_ns.min()) // column_ns
    count = min(int(time_ns.max()) // column_ns - first + 1, MAX_COLUMNS // 4)
    whole, pieces = ColumnGrid(1, first, count), ColumnGrid(1, first, count)
    whole.add(0, bins_of(time_ns, column_ns), values)
    for part in (slice(None, cut), slice(cut, None)):
        if len(time_ns[part]):
            pieces.add(0, bins_of(time_ns[part], column_ns), values[part])
    if len(np.unique(time_ns // column_ns)) < MAX_COLUMNS // 4 and np.ptp(time_ns // column_ns) < MAX_COLUMNS:
        np.testing.assert_array_equal(whole.high, pieces.high)
        np.testing.assert_array_equal(whole.low, pieces.low)


def test_clock_that_jumps_years_makes_no_more_than_4096_columns() -> None:
    bins = bins_of(np.array([0, 10**18, 10**18 + 1]), 1_000)
    assert bins.columns.tolist() == [10**15]


def test_no_samples_give_no_columns() -> None:
    assert len(bins_of(np.zeros(0, np.int64), 10).columns) == 0


def test_every_kind_of_number_becomes_a_float() -> None:
    assert as_floats(np.array([True, False])).tolist() == [1, 0]
    assert as_floats(np.array([7], "m8[ns]")).tolist() == [7]
    assert as_floats(np.array([1 + 2j])).tolist() == [1]
    assert np.isnan(as_floats(np.array([b"a"]))).all()

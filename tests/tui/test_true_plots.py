"""From samples to cells: nothing is drawn that isn't in the data, and no sample goes undrawn."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from silo.core.arrays.columns import HOLE_TEXTS, ColumnGrid, ColumnStore, Gap, NonFinite, bins_of, grid_of, hole_mark
from silo.core.elements import ElementInfo, ElementOptions, Entry
from silo_tui.model.drawing import braille
from silo_tui.model.drawing.dots import BLANK
from silo_tui.model.drawing.plots import Plotted, draw, trends
from silo_tui.model.drawing.window import PlotWindow
from silo_tui.model.samples.live import entry_text, offset_text
from silo_tui.model.words import text

WIDTH, HEIGHT = 12, 4
COLUMNS = 2 * WIDTH
_BITS = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]]

any_float = st.floats(allow_nan=True, allow_infinity=True)
samples = st.lists(st.tuples(st.integers(0, COLUMNS * 10 - 1), any_float), max_size=60)


def plotted(dtype="<f8", labels=None):
    entry = Entry("", dtype, labels)
    return Plotted(ElementInfo("/a", "-", "scalar", (), (entry,), ElementOptions()), 0)


def store_of(times, values, count=COLUMNS):
    """Columns of ten nanoseconds."""
    values = np.asarray(values)
    store = ColumnStore(["/a"], count, 10)
    store.advance_to(count)
    grid = ColumnGrid(1, 0, count)
    grid.add(0, bins_of(np.asarray(times, np.int64), 10), values)
    store.merge(["/a"], grid)
    return store


def picture_of(times, values, dtype="<f8", width=WIDTH, height=HEIGHT):
    store = store_of(times, values, 2 * width)
    return draw(store, PlotWindow(), plotted(dtype), width, height, 1)


def dots_of(line_of_cells):
    return [[(ord(char) - 0x2800) if 0x2800 <= ord(char) < 0x2900 else None for char in line] for line in line_of_cells]


def row_of(value, scale):
    bottom, top = (float(end) / 2**600 / 2**500 for end in scale) if max(map(abs, scale)) > 1e200 else scale
    value = value / 2**600 / 2**500 if max(map(abs, scale)) > 1e200 else value
    share = 0.5 if not top > bottom else (value - bottom) / (top - bottom)
    return min(1.0, max(0.0, share)) * (4 * HEIGHT - 1)


@settings(deadline=None, max_examples=300)
@given(samples)
def test_every_sample_lights_its_cell_and_every_lit_cell_has_one(rows):
    times, values = [time for time, _ in rows], np.array([value for _, value in rows], float)
    drawn = picture_of(times, values)
    finite = [(time // 10, value) for time, value in rows if math.isfinite(value)]
    marked = {(0, time // 20) for time, value in rows if value == math.inf}
    marked |= {(HEIGHT - 1, time // 20) for time, value in rows if value == -math.inf or math.isnan(value)}
    lit = {
        (line, cell)
        for line, cells in enumerate(drawn.lines)
        for cell, char in enumerate(cells)
        if char in braille.POS_INF + braille.NEG_INF + braille.NAN + braille.SEVERAL or 0x2800 < ord(char) < 0x2900
    }
    assert marked <= lit
    for column, value in finite:
        row = row_of(value, drawn.axis.scale)
        near = {(HEIGHT - 1 - math.floor((row + slack) / 4 + 1e-9), column // 2) for slack in (-0.51, 0, 0.51)}
        near = {(min(HEIGHT - 1, max(0, line)), cell) for line, cell in near}
        assert near & lit, (column, value)
    with_value = {column for column, _ in finite}
    allowed = {cell for _, cell in marked}
    for _, cell in lit:
        # of a column itself, or of one before whose value holds over at most three columns
        held = any(2 * cell + 1 - back in with_value for back in range(5))
        assert cell in allowed or held, (cell, sorted(with_value))


@settings(deadline=None)
@given(st.lists(st.floats(-1e6, 1e6), min_size=COLUMNS, max_size=COLUMNS))
def test_dots_stay_within_what_a_column_and_the_way_to_its_neighbours_cover(values):
    drawn = picture_of([10 * column for column in range(COLUMNS)], values)
    rows = [round(row_of(value, drawn.axis.scale)) for value in values]
    for line, cells in enumerate(dots_of(drawn.lines)):
        for cell, bits in enumerate(cells):
            for part in range(2):
                for dot in range(4):
                    if not (bits or 0) & _BITS[dot][part]:
                        continue
                    row, column = 4 * HEIGHT - 1 - (4 * line + dot), 2 * cell + part
                    near = rows[max(0, column - 1) : column + 2]
                    assert min(near) - 1 <= row <= max(near) + 1, (row, column, near)


@pytest.mark.parametrize(
    ("value", "sign", "line"),
    [(np.inf, braille.POS_INF, 0), (-np.inf, braille.NEG_INF, HEIGHT - 1), (np.nan, braille.NAN, HEIGHT - 1)],
)
def test_what_is_no_number_has_its_mark_and_no_axis_of_minus_one_to_one(value, sign, line):
    drawn = picture_of(range(0, COLUMNS * 10, 10), [value] * COLUMNS)
    assert drawn.lines[line] == sign * WIDTH
    assert text.axis_ends(*drawn.axis.scale, drawn.axis.base) == ("", "", "")
    assert drawn.signs == {np.inf: "inf", -np.inf: "-inf"}.get(value, "nan")


def test_a_nat_is_drawn_as_a_nan_not_as_a_number():
    drawn = picture_of(range(0, COLUMNS * 10, 10), np.full(COLUMNS, "NaT", "M8[ns]"), "<M8[ns]")
    assert (drawn.lines[-1], drawn.signs) == (braille.NAN * WIDTH, "nan")
    assert math.isnan(drawn.smallest)


@pytest.mark.parametrize("scale", [1e-300, 1e-310, 5e-324, 1e-12, 1.0, 1e300, 1.7e308])
def test_a_wave_is_a_wave_at_every_size(scale):
    wave = np.where(np.arange(COLUMNS) // 4 % 2 == 0, -scale, scale)
    drawn = picture_of(range(0, COLUMNS * 10, 10), wave)
    assert drawn.lines[0].strip(), drawn.lines
    assert drawn.lines[-1].strip(), drawn.lines


@pytest.mark.parametrize("scale", [1e-300, 1.0, 1e300, 1.7e308])
def test_the_newest_value_is_marked_where_the_curve_ends(scale):
    values = scale * np.array([-1.0, 1.0, 0.6, 0.6])
    drawn = picture_of(range(0, 40, 10), values)
    assert drawn.newest == 4 * HEIGHT - 1 - braille.row_of(values[-1:], drawn.axis.scale, 4 * HEIGHT)[0]


@pytest.mark.parametrize("start", [2**62, 2**53, -(2**63), 2**63 - 100])
def test_a_counter_far_from_zero_rises(start):
    counts = np.array([start + number for number in range(COLUMNS)], "i8")
    drawn = picture_of(range(0, COLUMNS * 10, 10), counts, "<i8")
    assert drawn.lines[0][-1] != BLANK != drawn.lines[-1][0]
    assert drawn.lines[-1][-1] == BLANK == drawn.lines[0][0]
    entry = Entry("", "<i8")
    assert offset_text(entry, drawn.smallest, drawn.axis.base, 8) == str(start)
    assert offset_text(entry, drawn.largest, drawn.axis.base, 8) == str(start + COLUMNS - 1)


def test_an_unsigned_counter_at_its_end_rises():
    counts = np.array([2**64 - COLUMNS + number for number in range(COLUMNS)], "u8")
    drawn = picture_of(range(0, COLUMNS * 10, 10), counts, "<u8")
    assert offset_text(Entry("", "<u8"), drawn.largest, drawn.axis.base, 8) == str(2**64 - 1)
    assert drawn.lines[0][0] == BLANK


@given(st.lists(st.integers(-(2**63), 2**63 - 1), min_size=1, max_size=20), st.integers(0, 20))
@settings(deadline=None)
def test_integers_that_come_in_pieces_are_those_that_come_at_once(values, cut):
    whole, pieces = ColumnGrid(1, 0, 20), ColumnGrid(1, 0, 20)
    values = np.array(values, "i8")
    times = np.arange(len(values)) * 10
    whole.add(0, bins_of(times, 10), values)
    for part in (slice(None, cut), slice(cut, None)):
        if len(values[part]):
            pieces.add(0, bins_of(times[part], 10), values[part])
    spread = int(values.max()) - int(values.min()) if len(values) else 0
    for grid in (whole, pieces):
        found = [grid.bases[0] + int(low) for low in grid.low[0][: len(values)]]
        off = [abs(mine - int(value)) for mine, value in zip(found, values, strict=True)]
        # exact unless what is on one screen spans more than a float can tell apart
        assert max(off) == 0 if spread <= 2**52 else max(off) <= 2**11


def test_small_changes_of_a_large_number_are_no_constant():
    wave = 1e6 + 1e-4 * np.where(np.arange(COLUMNS) // 4 % 2 == 0, -1, 1)
    drawn = picture_of(range(0, COLUMNS * 10, 10), wave)
    assert drawn.lines[0].strip()
    bottom, top, origin = text.axis_ends(*drawn.axis.scale, drawn.axis.base)
    assert bottom != top
    assert float(origin) == pytest.approx(1e6, abs=1)


# ---------------------------------------------------------------------------------------------------------- holes


def with_hole(hole, start, stop, width=40):
    store = ColumnStore(["/a"], 2 * width, 10)
    store.advance_to(2 * width)
    grid = ColumnGrid(1, 0, 2 * width)
    times = [10 * column for column in range(2 * width) if not start <= column < stop]
    grid.add(0, bins_of(np.array(times), 10), np.zeros(len(times)))
    grid.add_hole(0, 0, 2 * width, hole)
    store.merge(["/a"], grid_of(0, grid.low, grid.high, grid.marks))
    return draw(store, PlotWindow(), plotted(), width, HEIGHT, 1)


@pytest.mark.parametrize("hole", [Gap.OVERWRITTEN, Gap.LOST, Gap.OFF, Gap.FULL])
def test_a_hole_is_drawn_as_one_with_its_reason(hole):
    drawn = with_hole(hole, 0, 70)
    assert drawn.holes == (braille.DrawnHole(0, 35, hole),)
    assert HOLE_TEXTS[hole] in "".join(drawn.lines)
    assert braille.SHADE in drawn.lines[1]
    assert all(braille.SHADE not in line[35:] for line in drawn.lines)


def test_a_hole_is_drawn_in_small_plots_too():
    low = np.where((np.arange(80) < 30) | (np.arange(80) >= 60), 0.0, np.nan)
    lines = braille.rasterise(low, low, (-1.0, 1.0), 40, 2, np.zeros(80, np.uint8))
    assert lines[0][15:30].strip(braille.SHADE) == f" {HOLE_TEXTS[Gap.NONE]} "
    assert braille.SHADE not in lines[0][:15] + lines[0][30:] + lines[1]


def test_before_the_start_nothing_is_missing():
    drawn = with_hole(Gap.BEFORE, 0, 60)
    assert HOLE_TEXTS[Gap.BEFORE] in "".join(drawn.lines)
    assert braille.SHADE not in "".join(drawn.lines)


def test_time_without_ticks_between_samples_is_a_hole():
    drawn = with_hole(Gap.NONE, 20, 60)
    (hole,) = drawn.holes
    assert hole.why is Gap.NONE
    assert (hole.start, hole.stop) == (11, 30)  # after what the last value holds over


def test_a_column_with_samples_is_no_hole_whatever_came_first():
    for order in (0, 1):
        grid = ColumnGrid(1, 0, 1)
        for step in (order, 1 - order):
            if step:
                grid.add(0, bins_of(np.array([5]), 10), np.array([np.nan]))
            else:
                grid.add_hole(0, 0, 1, Gap.OVERWRITTEN)
        assert grid.marks.tolist() == [[NonFinite.NAN]]


@given(st.lists(st.sampled_from([0, 1, 2, 4, 7, *(hole_mark(hole) for hole in Gap)]), min_size=2, max_size=30))
def test_any_marks_give_a_picture_of_the_right_size(marks):
    low = np.full(len(marks), np.nan)
    lines = braille.rasterise(low, low, (math.nan, math.nan), 7, 3, np.array(marks, np.uint8))
    assert [len(line) for line in lines] == [7] * 3


def test_a_trend_shows_nan_and_inf_too():
    (line,) = trends(store_of([0, 45, 90], [np.nan, np.inf, -np.inf], 20), ["/a"], 10)
    assert line.replace(braille.SHADE, " ").split() == [braille.NAN, braille.POS_INF, braille.NEG_INF]


# ---------------------------------------------------------------------------------------------------------- texts


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0, "0"), (12_500, "12.5k"), (-3.2e6, "-3.2M"), (1e-300, "1e-300"), (2.5e-4, "250e-6"), (999_999, "1M"),
        (4.6e18, "4.6e18"), (0.125, "0.125"), (999.6, "1k"), (1e15, "1e15"), (-1e-6, "-1e-6"), (1.7e308, "170e306"),
        (12_345, "12.3k"),
    ],
)  # fmt: skip
def test_engineering_notation(value, shown):
    assert text.engineering(value) == shown


@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(allow_nan=False, allow_infinity=False))
@example(0.0, -5e-324)
@example(-5e-324, 5e-324)
def test_ends_of_an_axis_fit_and_differ(one, other):
    smallest, largest = sorted((one, other))
    bottom, top = braille.nice_range(smallest, largest)
    words = text.axis_ends(bottom, top)
    assert words[0] != words[1]
    assert max(map(len, words[:2])) <= 9


@pytest.mark.parametrize(
    ("ends", "words"),
    [
        ((0.0, 2e6), ("0", "2000000", "")),
        ((999_999.4, 1_000_000.6), ("999999.4", "1000000.6", "")),
        ((1_000_000.0, 1_000_000.6), ("1000000.0", "1000000.6", "")),
        ((-3.5, 2.25, 10**18), ("+0.5", "+6.25", "999999999999999996")),  # from the whole number below
    ],
)
def test_ends_of_an_axis_are_as_short_as_their_distance_lets_them(ends, words):
    assert text.axis_ends(*ends) == words


@pytest.mark.parametrize(
    ("dtype", "word", "width", "shown"),
    [
        ("<i8", "4611686018427387905", 19, "4611686018427387905"), ("<i8", "4611686018427387905", 11, "4.61169e18"),
        ("<M8[s]", "NaT", 11, "NaT"), ("<M8[ns]", "2026-09-21T14:13:20.123456789", 30, "14:13:20.123 2026-09-21"),
        ("|S4", "\\xffab", 11, "\\xffab"),
    ],
)  # fmt: skip
def test_a_value_with_a_word_reads_as_its_type_wants(dtype, word, width, shown):
    value = float(word) if word.isdecimal() else math.nan
    assert entry_text(Entry("", dtype), value, word, width) == shown

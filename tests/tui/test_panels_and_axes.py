"""Which signals share a plot, lanes and bands, ticks, and the dots that plots are drawn with."""

import math
import re
import unicodedata
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from rich.color import ColorSystem

from silo.core.arrays.columns import ColumnPiece, ColumnStore, grid_of
from silo.core.elements import ElementInfo, ElementOptions, Entry
from silo_tui.model.drawing import axes, braille, dots, lanes
from silo_tui.model.drawing.plots import Plotted, draw_panel, together
from silo_tui.model.drawing.window import PlotWindow
from silo_tui.model.plots.panels import first_to_show, gathered, heights, isolate, join, least_height, sides, stacked
from silo_tui.model.plots.time_axis import QUARTERS, axis_line
from silo_tui.widgets.styled import _style


def plotted(name, unit="Nm", dtype="<f8", labels=None):
    entry = Entry("", dtype, labels)
    return Plotted(ElementInfo(name, unit, "scalar", (), (entry,), ElementOptions()), 0)


A, B, C = plotted("/a"), plotted("/b"), plotted("/c", "rad")
D, ON, GAIT = plotted("/d", "N"), plotted("/on", "-", "|b1"), plotted("/gait", "-", "<i8", {0: "stand", 1: "walk"})


def names(panels):
    return ["".join(each.name for each in panel) for panel in panels]


def test_a_plot_joins_with_the_next_one_and_the_second_unit_takes_the_right_axis():
    panels = join(stacked([A, B, C]), 0)
    assert names(panels) == ["/a/b", "/c"]
    panels = join(panels, 0)
    assert sides(panels[0]) == (False, False, True)


@pytest.mark.parametrize(
    ("plots", "most", "reason"),
    [
        ([A], 8, "no next plot"),
        ([A, ON], 8, "lanes stay alone"),
        ([A, B, plotted("/e")], 2, "without colours two curves fit"),
        ([A, C, D], 8, "two axes, these have 3 units: Nm, rad, N"),
    ],
)
def test_what_can_t_share_a_plot_says_why(plots, most, reason):
    panels = [*gathered(plots[:-1], by_unit=False), (plots[-1],)] if len(plots) > 2 else stacked(plots)
    with pytest.raises(ValueError, match=reason):
        join(panels, 0, most)


def test_letters_leave_a_cell_beside_the_words_of_the_axis():
    events = dict.fromkeys([*range(15, 26), *range(35, 46), 77, 78], "T")
    line = axis_line(80, [(share, f"{share:.2f} s") for share in QUARTERS], [(18, "A")], events)
    assert re.findall(r"[TA] ?[\d.]+ s ?[TA]", line) == re.findall(r"[TA] [\d.]+ s [TA]", line) != []


@pytest.mark.parametrize(
    ("width", "events", "told"),
    [
        (20, {3: "E"}, "   E edit           "), (20, {12: "S"}, "            S       "),
        (20, {3: "H", 9: "H", 12: "E"}, "   H     H  E edit  "), (20, {2: "E", 3: "S"}, "  ES                "),
        (22, {2: "E", 3: "E", 10: "S"}, "  EE edit S start/stop"), (20, {15: "E"}, "               E    "),
    ],
)  # fmt: skip
def test_what_a_letter_is_stands_behind_it_once_where_there_is_room(width, events, told):
    assert axis_line(width, (), (), events) == told


def test_the_last_plot_joins_with_the_one_above():
    assert names(join(stacked([A, B, C]), 2)) == ["/a", "/b/c"]


def test_an_isolated_signal_stands_alone_below_its_panel():
    panels = gathered([A, B, C], by_unit=False)
    assert names(panels) == ["/a/b/c"]
    assert names(isolate(panels, B)) == ["/a/c", "/b"]
    assert names(isolate(stacked([A, B]), A)) == ["/a", "/b"]


def test_signals_gather_by_unit_and_lanes_stay_alone():
    assert names(gathered([A, C, ON, B, GAIT], by_unit=True)) == ["/a/b", "/c", "/on", "/gait"]
    nine = [plotted(f"/{number}") for number in range(9)]
    assert [len(panel) for panel in gathered(nine, by_unit=True)] == [8, 1]
    assert [len(panel) for panel in gathered(nine, by_unit=True, most=2)] == [2, 2, 2, 2, 1]


@given(st.lists(st.sampled_from([A, B, C, ON, GAIT]), min_size=1, max_size=40), st.integers(4, 60), st.data())
def test_the_chosen_panel_is_on_the_screen_and_curves_fill_it(plots, room, data):
    panels = stacked(plots)
    wanted = data.draw(st.integers(0, len(panels) - 1))
    first = first_to_show(panels, data.draw(st.integers(0, len(panels) - 1)), wanted, room, 80)
    found = heights(panels, first, room, 80)
    assert first <= wanted < first + len(found)
    assert all(height >= least_height(panel, 80) for height, panel in zip(found, panels[first:], strict=False))
    assert sum(found) <= max(room, least_height(panels[first], 80))


def test_a_plot_alone_fills_the_screen():
    assert heights(stacked([A]), 0, 47, 160) == [47]


# ------------------------------------------------------------------------------------------------------------- axes


def are_round(ticks: list[tuple[int, float]]) -> bool:
    """Whether numbers from the top down are multiples of one step of 1, 2 or 5."""
    steps = [above - below for (_, above), (_, below) in pairwise(ticks)]
    step = float(f"{steps[0]:.3e}")
    return (
        steps == pytest.approx([step] * len(steps), rel=1e-3)
        and f"{step:.3e}"[:5] in ("1.000", "2.000", "5.000")
        and all(abs(value / step - round(value / step)) < 1e-3 for _, value in ticks)
    )


def is_at_its_place(line: int, value: float, scale: axes.Scale, lines: int) -> bool:
    """Whether a number stands on the line that is next to its value."""
    per_line = (scale[1] - scale[0]) / (lines - 1)
    return abs((scale[1] - value) / per_line - line) <= 0.5 + 1e-3


@settings(deadline=None)
@given(st.floats(-1e9, 1e9), st.floats(1e-6, 1e9), st.integers(3, 50))
def test_a_scale_holds_its_values_and_its_ticks_are_even_and_round(low, extent, lines):
    assume(extent > 1e-8 * abs(low))  # else no step is round
    high = low + extent
    scale = axes.round_scale(low, high, lines)
    slack = 1e-6 * (scale[1] - scale[0])
    assert scale[0] - slack <= low <= high <= scale[1] + slack
    assert scale[1] - scale[0] <= 2.5 * extent
    ticks = axes.ticks_of(scale, lines)
    assert len(ticks) > 1
    assert all(0 <= line < lines for line, _ in ticks)
    gaps = [second[0] - first[0] for first, second in pairwise(ticks)]
    assert max(gaps) - min(gaps) <= 1
    if lines > 6:  # in fewer there may be room for both ends alone
        assert are_round(ticks), ticks
        assert ticks[0][0] <= max(gaps), ticks
    else:  # how far a small plot reaches is read at its top, if that is round
        assert ticks[0][0] == 0 or float(f"{scale[1]:.2g}") != float(f"{scale[1]:.9g}"), ticks
    assert all(is_at_its_place(*tick, scale, lines) for tick in ticks)
    words, _ = axes.tick_words(ticks, 0, 9)
    assert max(map(len, words.values())) <= 10
    assert len(set(words.values())) == len(words) > 1


@pytest.mark.parametrize(
    ("low", "high", "lines", "words"),
    [
        (-12.9, 13.8, 17, ["10", "0", "-10"]),  # not 7.5
        (0, 1, 3, ["1.0", "0.5", "0.0"]),
        (0, 0, 6, ["1.0", "0.5", "0.0", "-0.5", "-1.0"]),  # nothing but zeros lies in the middle
        (0, 0, 8, ["1", "0", "-1"]),
        (0, 0, 9, ["1.0", "0.5", "0.0", "-0.5", "-1.0"]),
        (0, 3.5e6, 8, ["3000000", "2000000", "1000000", "0"]),
        (0, 3.5, 8, ["3", "2", "1", "0"]),
        (0, 1, 8, ["1.0", "0.5", "0.0"]),  # not 0.90, 0.60, 0.30
        (0.4, 1, 29, ["1.0", "0.8", "0.6", "0.4"]),
        (40.2, 45.1, 10, ["46", "44", "42", "40"]),
        (0, 9.55, 18, ["10", "5", "0"]),  # not 10.2 above 9.0
        (-3.8, 3.8, 4, ["4", "-4"]),
        (-44, -14, 4, ["-10", "-45"]),  # not -20 below a line without a number
        (-1e-300, 1e-300, 9, None),
        (1e300, 2e300, 9, None),
    ],
)
def test_ticks_read_well(low, high, lines, words):
    scale = axes.round_scale(low, high, lines)
    found, _ = axes.tick_words(axes.ticks_of(scale, lines), 0, 9)
    assert found
    if words:
        assert [found[line] for line in sorted(found)] == words


@settings(deadline=None)
@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6), st.integers(7, 50))
def test_of_a_range_that_is_held_or_met_numbers_are_round_too(low, extent, lines):
    """As one that was of a plot of another height."""
    assume(extent > 1e-6 * abs(low))
    scale = low, low + extent
    ticks = axes.ticks_of(scale, lines)
    assert are_round(ticks)
    assert all(is_at_its_place(*tick, scale, lines) for tick in ticks)


@settings(deadline=None)
@given(st.floats(-1e12, 1e12), st.floats(0, 1e12), st.integers(4, 50))
def test_an_axis_by_powers_of_ten_has_a_number_at_its_top_and_at_its_bottom(low, extent, lines):
    values = np.array([low, low + extent])
    axis = axes.axis_of([values])
    places = axis.place(values)
    scale = (
        axes.scale_of(axis, *values[np.isfinite(places)][[0, -1]].tolist()) if np.isfinite(places).any() else (0.0, 1.0)
    )
    words = axes.words_of(axis, scale, lines)
    assert {0, lines - 1} <= set(words)
    assert len(set(words.values())) == len(words)


def test_a_scale_stays_while_its_values_do():
    window = PlotWindow()
    first = window.follow_scale("/a", (0.0, 10.0), 9)
    assert window.follow_scale("/a", (0.5, 7.0), 9) == first
    assert window.follow_scale("/a", (0.5, 20.0), 9) != first
    wide = window.follow_scale("/a", (0.0, 100.0), 9)
    assert window.follow_scale("/a", (0.0, 1.0), 9) != wide


# ------------------------------------------------------------------------------------------------------------- dots


@pytest.fixture
def style():
    yield dots.choose
    dots.choose("braille")


def test_octants_are_256_different_characters_and_those_of_unicode_16_are_230(style):
    style("octants")
    patterns = np.array([[pattern >> place & 1 for place in range(8)] for pattern in range(256)], bool)
    found = [int(dots.cells(pattern.reshape(4, 2))[0, 0]) for pattern in patterns]
    assert len(set(found)) == 256
    new = [code for code in found if 0x1CD00 <= code <= 0x1CDE5]
    assert (len(new), min(new), max(new)) == (230, 0x1CD00, 0x1CDE5)
    assert chr(found[0b00001111]) == "▀"
    assert chr(found[0b10101010]) == "▐"
    assert found[0b00000100] == 0x1CD00  # BLOCK OCTANT-3, the first of them
    assert found[0b11111110] == 0x1CDE5  # BLOCK OCTANT-2345678, the last


def test_characters_from_before_the_octants_show_the_dots_of_their_names(style):
    """`QUADRANT UPPER LEFT AND LOWER RIGHT`, `LOWER THREE QUARTERS BLOCK`."""
    style("octants")
    known = 0
    for pattern in range(256):
        lit = np.array([pattern >> place & 1 for place in range(8)], bool).reshape(4, 2)
        name = unicodedata.name(chr(dots.cells(lit)[0, 0]), "")
        parts = name.removeprefix("QUADRANT ").removesuffix(" BLOCK").split(" AND ")
        if name and not name.startswith("BLOCK OCTANT") and {"UPPER", "LOWER", "LEFT", "RIGHT"} & set(parts[0].split()):
            drawn = np.zeros((4, 2), bool)
            for words in map(str.split, parts):
                high = 1 if "ONE" in words else 3 if "THREE" in words else 2
                rows = np.s_[:high] if "UPPER" in words else np.s_[4 - high :] if "LOWER" in words else np.s_[:]
                columns = np.s_[:1] if "LEFT" in words else np.s_[1:] if "RIGHT" in words else np.s_[:]
                drawn[rows, columns] = True
            assert (lit == drawn).all(), name
            known += 1
    assert known >= 18


def test_blocks_are_two_dots_high(style):
    style("blocks")
    curve = braille.rasterise(np.array([0.0, 0.0, 1.0, 1.0]), np.array([0.0, 0.0, 1.0, 1.0]), (0, 1), 2, 1)
    assert curve == ["▄▀"] or curve == ["██"] or set("".join(curve)) <= set("▀▄█ ")


def test_an_unknown_style_is_refused(style):
    with pytest.raises(ValueError, match="'sixel' is unknown; one of auto, braille, octants, blocks"):
        style("sixel")


@settings(deadline=None)
@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=40))
def test_a_curve_is_one_line(values):
    """From each column one gets to the next without lifting the pen."""
    low = np.array(values)
    lit = braille.curve(low, low, axes.round_scale(low.min(), low.max(), 6), 20, 6)[:, -len(values) :]
    for before, after in zip(lit.T, lit.T[1:], strict=False):
        rows, others = np.flatnonzero(before), np.flatnonzero(after)
        assert len(rows) == rows.max() - rows.min() + 1
        assert min(abs(int(a) - int(b)) for a in rows for b in others) <= 1


# ----------------------------------------------------------------------------------------------- several in one plot


def store_of(**signals):
    count = len(next(iter(signals.values())))
    store = ColumnStore([f"/{name}" for name in signals], count, 10)
    store.advance_to(count)
    values = np.array(list(signals.values()), float)
    store.merge(store.names, grid_of(0, values, values))
    return store


def test_a_spike_of_another_curve_shows_under_the_one_in_front():
    spike = [0.0] * 20
    spike[9] = 10.0
    store = store_of(a=[0.0] * 20, b=spike)
    pictures = draw_panel(store, PlotWindow(), [A, B], [False, False], 10, 4, lambda name: 10)
    _, owners = together(pictures, front=0)
    assert owners[0].tolist().count(1) == 1


def test_the_axis_on_the_right_has_a_scale_of_its_own():
    store = store_of(a=[0.0, 1.0] * 10, c=[0.0, 1000.0] * 10)
    pictures = draw_panel(store, PlotWindow(), [A, C], [False, True], 10, 4, lambda name: 10)
    assert pictures[0].axis.scale[1] < 10 < pictures[1].axis.scale[1]


def test_the_zeros_of_both_axes_are_on_one_line_and_no_curve_leaves_its_plot():
    store = store_of(a=[-1.0, 3.0] * 10, c=[-900.0, 100.0] * 10)
    pictures = draw_panel(store, PlotWindow(), [A, C], [False, True], 10, 4, lambda name: 10)
    shares = [-low / (high - low) for low, high in (picture.axis.scale for picture in pictures)]
    assert shares[0] == pytest.approx(shares[1])
    for picture, (least, most) in zip(pictures, ((-1, 3), (-900, 100)), strict=True):
        assert picture.axis.scale[0] <= least
        assert picture.axis.scale[1] >= most


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(-1e6, 0), st.floats(0, 1e6)), min_size=2, max_size=2), st.integers(3, 40))
def test_where_the_zeros_of_two_axes_meet_the_numbers_of_both_are_round(scales, lines):
    assume(all(high - low > 1e-3 for low, high in scales))
    met = axes.zeros_met(scales, lines)
    zeros = [-low / (high - low) for low, high in met]
    assert zeros[0] == pytest.approx(zeros[1])
    for scale, (low, high) in zip(met, scales, strict=True):
        assert scale[0] <= low + 1e-9 * (high - low)
        assert scale[1] >= high - 1e-9 * (high - low)
        ticks = axes.ticks_of(scale, lines)
        assert are_round(ticks) or (lines <= 6 and not ticks[0][0]), (scale, ticks)


def test_an_axis_without_a_zero_stays_as_it_is():
    store = store_of(a=[-1.0, 3.0] * 10, c=[490.0, 500.0] * 10)
    pictures = draw_panel(store, PlotWindow(), [A, C], [False, True], 10, 4, lambda name: 10)
    assert pictures[1].axis.scale[0] > 400


def test_eight_series_differ_in_16_colours_too():
    few = [_style(place, True, True).color.downgrade(ColorSystem.STANDARD).number for place in range(8)]
    assert few == [14, 11, 13, 10, 9, 12, 15, 6]
    for dark in (True, False):
        assert len({_style(place, False, dark).color for place in range(8)}) == 8


# ------------------------------------------------------------------------------------------------------------ lanes


def piece(values, highs=None):
    low = np.array(values, float)
    return ColumnPiece(low, low if highs is None else np.array(highs, float), np.zeros(len(values), np.uint8))


def test_a_boolean_lane_tells_false_true_and_both():
    nan = math.nan
    assert lanes.bool_lane(piece([0, 0, 1, 1, 0, 1, nan, nan, nan, 1]), 5) == "▁█▄ █"


def test_a_band_has_the_words_where_they_begin_and_dots_where_they_are_cut():
    labels = {0: "stand", 1: "walk"}
    word = lambda value: labels[int(value)]  # noqa: E731
    assert lanes.band(piece([0] * 14 + [1] * 14), word, 14) == "stand  │walk  "
    assert lanes.band(piece([0] * 4 + [1] * 4), word, 4) == "s…│…"
    mixed = lanes.band(piece([0] * 8 + [0, 1] * 3 + [1] * 8), word, 11)
    assert mixed == "sta…│……walk"


def test_texts_hang_at_their_time():
    events = [(0, "walk"), (100, "trot")]
    assert lanes.events_band(events, 20, 10, 10) == "walk │trot"
    assert lanes.events_band([(-500, "walk")], 20, 10, 10) == "walk      "
    assert "several" not in lanes.events_band([(0, "a"), (101, "b"), (111, "c")], 20, 10, 10)


def test_two_texts_in_one_cell_are_told_as_several():
    line = lanes.events_band([(0, "a"), (101, "b"), (111, "c"), (150, "d")], 20, 10, 10)
    assert line[5] == "│"
    beyond = lanes.events_band([(0, "a"), (201, "b"), (202, "c")], 20, 10, 10)
    assert beyond == lanes.events_band([(0, "a")], 20, 10, 10)


@given(st.lists(st.sampled_from([0.0, 1.0, math.nan]), min_size=20, max_size=20))
def test_a_band_is_as_wide_as_its_plot_and_shows_no_value_that_isn_t_there(values):
    line = lanes.band(piece(values), lambda value: "xy"[int(value)] * 3, 10)
    assert len(line) == 10
    for value, char in ((0.0, "x"), (1.0, "y")):
        assert char not in line or value in values

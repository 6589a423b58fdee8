"""Limits in plots stand at their value, and an axis by powers of ten shows any values in their order."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from silo.conditions.standing import LimitStatus, LimitWord
from silo.core.arrays.columns import ColumnPiece
from silo_tui.model.drawing import braille
from silo_tui.model.drawing.axes import axis_of, scale_of, words_of
from silo_tui.model.drawing.plots import NOBODY, Axis, _axis_of
from silo_tui.model.drawing.window import PlotWindow
from silo_tui.model.plots.limits import inner, level_line, lines_of
from silo_tui.model.plots.picture import RED, _draw_limits

HEIGHT = 12
TORQUE = "/log/legs/LF/HAA/torque"
numbers = st.floats(-1e6, 1e6).filter(lambda value: value == 0 or abs(value) > 1e-6)
bound = st.none() | numbers


@settings(deadline=None)
@given(st.tuples(bound, bound, bound, bound), numbers, numbers, st.sampled_from([0, 2**53]))
def test_a_limit_stands_in_the_cell_of_its_value_or_is_told_at_the_border_that_it_lies_beyond(bounds, low, high, base):
    assume(high - low > 1e-3)
    bounds = tuple(None if one is None else one + base for one in bounds)
    drawn = {one.word: one for one in lines_of(bounds, Axis((low, high), base), HEIGHT)}
    assert set(drawn) == {word for word, value in zip(("LL", "L", "H", "HH"), bounds, strict=True) if value is not None}
    for word, value in zip(("LL", "L", "H", "HH"), bounds, strict=True):
        if value is None:
            continue
        one, offset = drawn[word], value - base
        assert one.beyond == (-1 if offset > high else 1 if offset < low else 0)
        if one.beyond:
            assert one.line == (0 if one.beyond < 0 else HEIGHT - 1)
            assert one.mark[-1] in "▲▼"
        else:
            row = braille.row_of(np.array([offset]), (low, high), 4 * HEIGHT)[0]  # where a sample of that value stands
            assert one.line == (4 * HEIGHT - 1 - row) // 4


def test_of_two_limits_in_a_line_both_words_stand_there_and_the_red_one_gives_the_colour():
    cells, owners = np.full((HEIGHT, 8), ord(" "), np.uint32), np.full((HEIGHT, 8), NOBODY)
    source = SimpleNamespace(bounds={"a": (0.0, 0.1, 9.9, 10.0)}, level=None)
    pictures = [SimpleNamespace(axis=Axis((0, 10)))]
    words = _draw_limits(source, [SimpleNamespace(name="a")], pictures, cells, owners)
    assert words == {0: ("H HH", RED), HEIGHT - 1: ("LL L", RED)}
    assert owners[0].tolist() == owners[HEIGHT - 1].tolist() == [RED, NOBODY] * 4


@pytest.mark.parametrize("scale", [(math.nan, math.nan), (2.0, 2.0)])
def test_without_a_scale_there_are_no_lines(scale):
    assert lines_of((1.0, 2.0, 3.0, 4.0), Axis(scale), HEIGHT) == level_line(2.0, Axis(scale), HEIGHT) == []


def test_a_level_that_is_waited_for_has_a_line_of_its_own():
    told = [(one.line, one.mark) for level in (10.0, 0.0, 11.0, -1.0) for one in level_line(level, Axis((0, 10)), 12)]
    assert told == [(0, "level"), (11, "level"), (0, "level▲"), (11, "level▼")]


def test_inside_is_within_the_yellow_limits_or_the_red_ones_where_there_is_no_other():
    bounds = {"a": (1.0, 2.0, 3.0, 4.0), "b": (1.0, None, None, 4.0)}
    assert (inner(bounds, "a"), inner(bounds, "b"), inner(bounds, "c")) == ((2.0, 3.0), (1.0, 4.0), (None, None))


@settings(deadline=None)
@given(st.lists(numbers, min_size=1, max_size=20))
def test_places_on_a_log_axis_keep_the_order_and_lie_on_its_scale(values):
    axis = axis_of([np.array(values)])
    places = axis.place(np.array(sorted(values)))
    assert np.all(np.diff(places) >= 0)
    bottom, top = scale_of(axis, min(values), max(values))
    assert bottom <= places[0] <= places[-1] <= top
    for value, place in zip(sorted(values), places, strict=True):
        assert axis.value(float(place)) == pytest.approx(value, rel=1e-6, abs=axis.least * 1e-6)


def test_positive_values_have_powers_of_ten_and_no_zero():
    axis = axis_of([np.array([0.002, 30.0])])
    scale = scale_of(axis, 0.002, 30.0)
    assert scale == (-3.0, 2.0)
    assert set(words_of(axis, scale, 24).values()) == {"1e-3", "1e-2", "1e-1", "1e0", "1e1", "1e2"}


def test_zeros_and_negative_values_stand_around_a_zero():
    axis = axis_of([np.array([-20.0, 0.0, 0.5])])
    scale = scale_of(axis, -20.0, 0.5)
    words = words_of(axis, scale, 24)
    assert set(words.values()) >= {"-1e2", "-1e1", "0", "1e0"}
    by_line = [words[line] for line in sorted(words)]
    assert by_line.index("0") < by_line.index("-1e1")


@pytest.mark.parametrize(("held", "wider"), [((1, 100), (0.01, 1e4)), ((-5, 100), (-1e4, 1e3)), ((-2, 3), (50, 60))])
def test_a_held_log_axis_keeps_its_ends_whatever_comes_and_one_that_follows_does_not(held, wider):
    window = PlotWindow()

    def ends(key, span):
        low, high = (np.array([float(end)]) for end in span)
        axis = _axis_of(window, key, [ColumnPiece(low, high, np.zeros(1, np.uint8))], 10, 0, log=True)
        return [axis.log.value(place) for place in axis.scale]

    window.fixed_scale = True
    first = ends("a", held)
    assert first[0] <= held[0] < held[1] <= first[1]
    assert ends("a", wider) == pytest.approx(first)
    assert ends("b", wider) != pytest.approx(first), "another axis"
    window.fixed_scale = False
    assert ends("a", wider) != pytest.approx(first)


def test_what_is_no_number_has_no_axis():
    assert axis_of([np.array([math.nan, math.inf])]) is None
    assert axis_of([np.zeros(3)]).signed


def limited(low, high):
    return LimitStatus(TORQUE, TORQUE, LimitWord.OK, "Nm", bounds=(None, low, high, 1000.0))


@pytest.mark.slow
class TestScreens:
    async def test_limits_are_drawn_with_their_letters_and_those_outside_are_told(self, fake, opened):
        fake.run(61)
        fake.limit_statuses = [limited(-4.0, 20.0)]
        async with opened(fake, size=(100, 30)) as screen:
            await screen.until(lambda: TORQUE in screen.session.bounds)
            await screen.enter("/LF/HAA/torque", "m")
            await screen.curves()
            await screen.shows("├HH▲")
            lines = screen.text.splitlines()
            assert any("╌" in line and line.rstrip().endswith("├H") for line in lines)
            assert any("╌" in line and line.rstrip().endswith("├L") for line in lines)
            assert not any("╌" in line and "HH" in line for line in lines)

    async def test_what_is_outside_the_limits_is_found_sample_by_sample(self, fake, opened):
        fake.run(61)
        fake.limit_statuses = [limited(None, 20.0)]
        async with opened(fake) as screen:
            await screen.until(lambda: TORQUE in screen.session.bounds)
            await screen.enter("/LF/HAA/torque", "m")
            await screen.curves()
            await screen.press("f", "o", "enter", shows="outside limits, 3 of 3: 40")

    async def test_without_limits_that_is_said(self, screen, ran_s=61):
        await screen.enter("/LF/HAA/torque", "m")
        await screen.curves()
        await screen.press("f", "o", "enter", shows="none, no limits are set on these signals")

    async def test_y_makes_powers_of_ten_of_any_plot_and_goes_back(self, screen, ran_s=61):
        await screen.enter("/LF/HAA/torque", "m")
        await screen.curves()
        await screen.press("Y", shows="1e2 ┤")
        assert any(line.strip().startswith("0 ┤") for line in screen.text.splitlines())
        await screen.press("Y")
        await screen.until(lambda: "1e2 ┤" not in screen.text)

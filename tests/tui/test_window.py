"""The time window without a screen: wherever it is moved, it shows what is held, and cursor A is a moment of that."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from silo_tui.model.drawing.window import SECOND_NS, SPANS_S, PlotWindow

COLUMNS = 130
MOMENTS = st.integers(0, 4000 * SECOND_NS)
MOVES = st.one_of(
    st.tuples(st.just("go_to"), MOMENTS),
    st.tuples(st.just("jump_to"), MOMENTS),
    st.tuples(st.just("pan"), st.sampled_from([-1, 1])),
    st.tuples(st.just("zoom"), st.booleans()),
    st.tuples(st.just("show"), MOMENTS),
)


@st.composite
def standing(draw):
    """A window that stands still somewhere in what is held."""
    oldest = draw(st.integers(0, 100 * SECOND_NS))
    held = oldest, oldest + draw(st.integers(1, 4000 * SECOND_NS))
    window = PlotWindow(draw(st.sampled_from(SPANS_S)))
    window.show(draw(st.integers(*held)), held, COLUMNS)
    return window, held


def move(window, held, kind, by):
    """Do one of MOVES, and draw the cursor where it is then, as a screen does."""
    if kind == "zoom":
        window.zoom_still(held, COLUMNS, closer=by)
    else:
        getattr(window, kind)(by, held, COLUMNS)
    column_ns = window.column_ns(COLUMNS)
    window.place_cursor(window.paused_end_ns // column_ns + 1, column_ns, COLUMNS)


@given(standing(), st.lists(MOVES, max_size=12))
def test_wherever_it_is_moved_it_shows_what_is_held_and_the_cursor_is_a_moment_of_it(made, moves):
    window, held = made
    for kind, by in moves:
        move(window, held, kind, by)
        begins_ns = window.paused_end_ns - window.span_ns + window.column_ns(COLUMNS)
        assert window.paused_end_ns <= held[1]
        assert begins_ns >= held[0] or window.paused_end_ns == held[1]
        assert window.at_ns is None or held[0] <= window.at_ns <= held[1]
        assert window.cursor is None or 0 <= window.cursor < COLUMNS


@given(standing(), MOMENTS, st.sampled_from(["go_to", "jump_to"]))
def test_the_moment_gone_to_is_in_the_window_that_follows(made, moment, way):
    window, held = made
    move(window, held, way, moment)
    assert window.at_ns == max(held[0], min(moment, held[1]))
    assert window.cursor is not None


@given(standing(), st.floats(0, 1), st.sampled_from(SPANS_S[1:]))
def test_zooming_in_and_out_is_a_round_trip_around_the_cursor(made, share, span):
    window, _ = made
    held = 0, 20_000 * SECOND_NS  # so that no edge is near
    window.span_s = span
    window.show(10_000 * SECOND_NS, held, COLUMNS)
    move(window, held, "go_to", window.paused_end_ns - int(share * 0.98 * window.span_ns))
    before, at_ns, cursor = window.paused_end_ns, window.at_ns, window.cursor
    move(window, held, "zoom", True)
    assert (window.at_ns, window.span_s) == (at_ns, SPANS_S[SPANS_S.index(span) - 1])
    assert abs(window.cursor - cursor) <= 1
    move(window, held, "zoom", False)
    assert (window.at_ns, window.span_s) == (at_ns, span)
    assert abs(window.paused_end_ns - before) <= 2 * SPANS_S[-1]  # rounded to whole ns twice


@given(standing(), st.sampled_from([-1, 1]))
def test_panning_there_and_back_is_where_it_was_away_from_the_edges(made, direction):
    window, _ = made
    held = 0, 20_000 * SECOND_NS
    window.show(10_000 * SECOND_NS, held, COLUMNS)
    move(window, held, "go_to", 10_000 * SECOND_NS - window.span_ns // 3)
    before = window.paused_end_ns, window.at_ns, window.cursor
    move(window, held, "pan", direction)
    assert window.at_ns - before[1] == window.paused_end_ns - before[0] != 0
    assert abs(window.cursor - before[2]) <= 1
    move(window, held, "pan", -direction)
    assert all(abs(now - then) <= 1 for now, then in zip((window.paused_end_ns, window.at_ns), before, strict=False))


@given(standing())
def test_at_an_edge_panning_moves_nothing_and_says_so(made):
    window, held = made
    window.show(held[1], held, COLUMNS)
    assert not window.pan(1, held, COLUMNS)
    assert window.paused_end_ns == held[1]


@given(standing())
def test_all_held_is_shown_by_the_shortest_span_that_can(made):
    window, held = made
    window.fit(held)
    fitting = [span for span in SPANS_S if span * SECOND_NS >= held[1] - held[0]]
    assert window.span_s == (fitting or SPANS_S[-1:])[0]


@given(st.lists(st.integers(-40, 40), max_size=20))
def test_a_live_cursor_stays_in_the_window(cells):
    window = PlotWindow()
    for some in cells:
        before = window.cursor
        window.move_cursor(some, COLUMNS)
        if before is None:  # it comes in from the side it moves away from
            before = 0 if some < 0 else COLUMNS // 2 * 2
        assert window.cursor == max(0, min(COLUMNS - 2, before - 2 * some))  # columns from the right edge, two per cell


@pytest.mark.parametrize("span", [SPANS_S[0], SPANS_S[-1]])
def test_at_the_end_of_the_spans_zooming_changes_nothing(span):
    window, held = PlotWindow(span), (0, 10 * SECOND_NS)
    window.show(8 * SECOND_NS, held, COLUMNS)
    before = window.paused_end_ns
    assert not window.zoom_still(held, COLUMNS, closer=span == SPANS_S[0])
    assert (window.span_s, window.paused_end_ns) == (span, before)


@st.composite
def standing_and_a_moment(draw):
    """A window amid much that is held, and a moment some windows from it."""
    held = 0, 100_000 * SECOND_NS
    window = PlotWindow(draw(st.sampled_from(SPANS_S)))
    window.show(draw(st.integers(20_000, 80_000)) * SECOND_NS, held, COLUMNS)
    return window, held, window.paused_end_ns + draw(st.integers(-3000, 3000)) * window.span_ns // 1000


@given(standing_and_a_moment())
def test_a_moment_outside_the_window_comes_into_its_middle_and_one_inside_moves_nothing(made):
    window, held, moment = made
    end_ns, column_ns = window.paused_end_ns, window.column_ns(COLUMNS)
    moved = window.jump_to(moment, held, COLUMNS)
    if end_ns - window.span_ns + column_ns < moment <= end_ns:
        assert (moved, window.paused_end_ns) == (False, end_ns)
    elif not end_ns - window.span_ns < moment <= end_ns:
        assert moved
        assert abs(window.paused_end_ns - moment - window.span_ns // 2) <= column_ns


@given(standing_and_a_moment())
def test_a_window_follows_the_cursor_by_a_quarter_of_itself_or_as_far_as_it_goes(made):
    window, held, moment = made
    end_ns, quarter_ns, column_ns = window.paused_end_ns, window.span_ns // 4, window.column_ns(COLUMNS)
    begin_ns = end_ns - window.span_ns
    window.go_to(moment, held, COLUMNS)
    if moment > end_ns + column_ns:
        assert abs(window.paused_end_ns - max(end_ns + quarter_ns, moment)) <= column_ns
    elif moment < begin_ns - column_ns:
        assert abs(window.paused_end_ns - window.span_ns - min(begin_ns - quarter_ns, moment)) <= column_ns
    elif begin_ns + column_ns < moment <= end_ns:
        assert window.paused_end_ns == end_ns


@given(st.integers(-500, 500), st.integers(1, 1000))
def test_an_axis_stays_while_values_lie_in_it_and_use_half_of_it_and_follows_when_they_do_not(low, size):
    low, size = float(low), float(size)
    window = PlotWindow()
    bottom, top = held = window.follow_scale("a", (low, low + size), 4)
    assert bottom <= low < low + size <= top
    assert window.follow_scale("a", None, 4) == held
    room = top - bottom
    for inside in ((bottom, bottom + 0.55 * room), (top - 0.55 * room, top), (low, low)):
        assert window.follow_scale("a", inside, 4) == held
    for other in ((bottom, bottom + 0.2 * room), (bottom - room, top), (bottom, top + room)):
        fresh = PlotWindow().follow_scale("a", other, 4)
        assert PlotWindow(scales={"a": held}, _bases=dict(window._bases)).follow_scale("a", other, 4) == fresh != held
    window.fixed_scale = True
    assert window.follow_scale("a", (bottom - room, top + room), 4) == held
    assert window.follow_scale("b", (bottom - room, top + room), 4) != held


def test_what_goes_on_follows_what_comes_with_a_span_of_those_for_live_values():
    window = PlotWindow(0.001)
    window.spans = (0.001, *SPANS_S)
    window.paused_end_ns, window.at_ns, window.other_ns, window.cursor = 7, 5, 3, 0
    window.go_on()
    assert (window.paused_end_ns, window.at_ns, window.other_ns, window.cursor) == (None, None, None, None)
    assert (window.spans, window.span_s) == (SPANS_S, SPANS_S[0])


@given(standing_and_a_moment(), st.booleans())
def test_without_a_cursor_zooming_keeps_the_middle(made, closer):
    window, held, _ = made
    middle_ns = window.paused_end_ns - window.span_ns // 2
    if window.zoom_still(held, COLUMNS, closer=closer):
        assert abs(window.paused_end_ns - window.span_ns // 2 - middle_ns) <= SPANS_S[-1]


@given(st.integers(-5, COLUMNS + 5), st.integers(0, 10**7 - 1))
def test_a_cursor_is_in_the_column_of_its_moment_or_in_none(column, within):
    window, end = PlotWindow(), 10_000
    window.at_ns = (end - 1 - column) * 10**7 + within
    window.place_cursor(end, 10**7, COLUMNS)
    assert window.cursor == (column if 0 <= column < COLUMNS else None)


@given(standing_and_a_moment())
def test_as_much_is_shown_as_there_is_on_either_side(made):
    window, held, moment = made
    column_ns = window.column_ns(COLUMNS)
    window.show(held[0] + moment % 1000, held, COLUMNS)
    assert window.paused_end_ns - window.span_ns + column_ns == held[0]
    window.show(held[1] + 1, held, COLUMNS)
    assert window.paused_end_ns == held[1]

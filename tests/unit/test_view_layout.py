"""How a view of the present table is laid out: what is in it, what isn't live, what there isn't."""

from types import SimpleNamespace

import pytest

from silo.live.requests import OpenView
from silo.live.views import MAX_PLOTS, MAX_VALUES, MIN_COLUMN_NS, MIN_RATE_HZ, _problem, layout_of
from tests.stand_ins.fake_signals import scalar, vector

ELEMENTS = {one.name: one for one in (scalar("/log/q"), vector("/log/p", "m"), scalar("/log/off", enabled=False))}
PLACES = {name + entry.suffix: (name, at) for name, one in ELEMENTS.items() for at, entry in enumerate(one.entries)}
OF = {name: (name, -1) for name in ELEMENTS} | PLACES


def entry(found):
    """As of a snapshot: an element that is one entry alone is that one."""
    if found is None or (found[1] < 0 and len(ELEMENTS[found[0]].entries) > 1):
        return None
    return found[0], max(found[1], 0)


NOW = SimpleNamespace(
    element=ELEMENTS.get, found_all=lambda names: [OF.get(name) for name in names], entry=entry, generation=7
)


def test_values_and_plots_stand_in_the_order_that_was_asked_for():
    layout = layout_of(OpenView("a-1", ["/log/p", "/log/q"], ["/log/p_y", "/log/q"]), NOW)
    assert layout.opened.entries == ["/log/p_x", "/log/p_y", "/log/p_z", "/log/q"]
    assert layout.counts == [3, 1]
    assert layout.plots == [("/log/p", 1), ("/log/q", 0)]
    assert (layout.opened.generation, layout.opened.missing, layout.opened.unpublished) == (7, [], [])


def test_what_there_is_not_has_no_entries_and_is_told():
    layout = layout_of(OpenView("a-1", ["/log/none", "/log/q"], ["/log/p", "/log/p_z"]), NOW)
    assert layout.opened.missing == ["/log/none", "/log/p"]
    assert (layout.counts, layout.opened.entries) == ([0, 1], ["/log/q"])
    assert layout.plots == [("", 0), ("/log/p", 2)]


def test_what_is_off_is_told_once():
    layout = layout_of(OpenView("a-1", ["/log/off"], ["/log/off", "/log/q"]), NOW)
    assert layout.opened.unpublished == ["/log/off"]
    assert layout.counts == [1]


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        ({}, ""),
        ({"view": "a/b"}, "its id must be"),
        ({"values": [f"x{number}" for number in range(MAX_VALUES)]}, ""),
        ({"values": ["x", "y", "x"]}, "name each of its values once"),
        (
            {"values": ["x"] * (MAX_VALUES + 1)},
            f"at most {MAX_VALUES} values and {MAX_PLOTS} plots, got {MAX_VALUES + 1}",
        ),
        ({"plots": ["x"] * MAX_PLOTS}, ""),
        ({"plots": ["x"] * (MAX_PLOTS + 1)}, f"got 0 and {MAX_PLOTS + 1}"),
        ({"rate_hz": MIN_RATE_HZ}, ""),
        ({"rate_hz": 0.99 * MIN_RATE_HZ}, "rate_hz must be"),
        ({"rate_hz": float("nan")}, "rate_hz must be"),
        ({"rate_hz": 1e7}, "rate_hz must be"),
        ({"column_ns": MIN_COLUMN_NS}, ""),
        ({"column_ns": MIN_COLUMN_NS - 1}, "column_ns must be"),
        ({"column_ns": 2**62}, "column_ns must be"),
    ],
)
def test_a_view_that_no_screen_can_show_is_refused_in_words(asked, why):
    found = _problem(OpenView(**{"view": "a-1", **asked}))
    assert why in found
    assert bool(found) is bool(why)

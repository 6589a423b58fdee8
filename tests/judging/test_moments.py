"""Looking for moments block by block finds what one look at the whole finds, whatever the blocks."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silo.core.elements import Sought
from silo.expressions.search import LONG_GAP, Finder, Looking, places

PERIOD = 10
floats = st.lists(st.sampled_from([0.0, 1.0, 2.5, -3.0, 7.0, math.nan, math.inf, -math.inf]), max_size=40)
whole_numbers = st.lists(st.sampled_from([2**63 - 1, 2**63 - 2, 2**53 + 1, 0, 5, -7]), max_size=40)
looks = st.builds(
    Looking, st.sampled_from(list(Sought)), st.sampled_from([-3.0, 0.0, 1.5, 7.0]), st.sampled_from([-1, 0, 1]),
    st.sampled_from([(None, 2.0), (-1.0, None), (-1.0, 2.0), (None, None)]), st.just(PERIOD),
)  # fmt: skip


def finder_of(looking, times, values, cuts, around=0, most=1000):
    finder = Finder(looking, around, most)
    ends = sorted({min(cut, len(values)) for cut in cuts} | {0, len(values)})
    blocks = [slice(begin, end) for begin, end in pairwise(ends)]
    if looking.needs_span:
        for block in blocks:
            finder.measure(values[block])
    for block in blocks:
        finder.feed(times[block], values[block])
    return finder.found


@settings(deadline=None, max_examples=300)
@given(floats | whole_numbers, looks, st.lists(st.integers(0, 40), max_size=6),
       st.lists(st.integers(1, 40), min_size=40, max_size=40))  # fmt: skip
def test_blocks_of_any_size_find_what_the_whole_finds(samples, looking, cuts, steps):
    kind = "i8" if samples and all(isinstance(value, int) for value in samples) else "f8"
    values, times = np.array(samples, kind), np.cumsum(np.array(steps[: len(samples)], np.int64))
    wanted = times[places(looking, times, values)]
    if kind == "i8" and looking.what in (Sought.HIGHEST, Sought.LOWEST) and len(values):
        exact = values == (values.max() if looking.what is Sought.HIGHEST else values.min())
        wanted = times[exact & ~np.concatenate([[False], exact[:-1]])]  # numbers that a float64 can't tell apart
    found = finder_of(looking, times, values, cuts)
    assert found.time_ns.tolist() == wanted.tolist()
    assert (found.total, found.before) == (len(wanted), 0)
    if len(samples):
        assert (found.begin_ns, found.end_ns) == (times[0], times[-1])


def sought_one_by_one(looking, values):
    """The moments of whole numbers by the words of the guide, sample after sample."""
    low, high = looking.bounds
    says = {
        Sought.HIGHEST: lambda value: value == max(values),
        Sought.LOWEST: lambda value: value == min(values),
        Sought.OUTSIDE: lambda value: (low is not None and value < low) or (high is not None and value > high),
    }
    if looking.what in says:
        here = [says[looking.what](value) for value in values]
        if looking.what is Sought.OUTSIDE and looking.direction < 0:
            return [at for at, one in enumerate(here) if one and not any(here[at + 1 : at + 2])]
        return [at for at, one in enumerate(here) if one and not (at and here[at - 1])]
    if looking.what is Sought.PEAK:
        return peaks_one_by_one([-value if looking.direction < 0 else value for value in values])
    steps = list(enumerate(pairwise(values), 1))
    if looking.what is Sought.CHANGE:
        return [at for at, (before, after) in steps if before != after]
    if looking.what is Sought.EDGE:
        return [at for at, (before, after) in steps if 2 * abs(after - before) > max(values) - min(values)]
    rises = [at for at, (before, after) in steps if before < looking.level <= after]
    falls = [at for at, (before, after) in steps if after < looking.level <= before]
    return sorted([*(rises if looking.direction >= 0 else []), *(falls if looking.direction <= 0 else [])])


def peaks_one_by_one(values):
    low, high = min(values), max(values)
    found, top = [], None
    for at, value in enumerate(values):
        height = 0 if low == high else (value - low) / (high - low)
        if top is not None and height < 3 / 8:
            found += [top] if top else []  # the first sample of all: nobody knows what was before
            top = None
        elif (top is None and height > 5 / 8) or (top is not None and value > values[top]):
            top = at
    return found


def test_each_swing_has_one_peak_and_one_trough_whatever_ripples_on_it():
    times = np.arange(4000, dtype=np.int64)
    values = np.sin(times / 100) + 0.1 * np.sin(times * 3.0)
    for direction, phase in ((1, 0.5), (-1, 1.5)):
        found = finder_of(Looking(Sought.PEAK, direction=direction), times, values, [7, 90, 1500, 1501]).time_ns
        swings = (np.arange(6) * 2 + phase) * np.pi * 100
        assert len(found) == 6
        assert np.abs(found - swings).max() < 20


@settings(deadline=None, max_examples=600)
@given(st.lists(st.integers(-4, 4), min_size=1, max_size=40), st.sampled_from(["i1", "i8", "f4", "f8"]),
       st.builds(Looking, st.sampled_from([one for one in Sought if one not in (Sought.HOLE, Sought.NOT_FINITE)]),
                 st.integers(-4, 4), st.sampled_from([-1, 0, 1]),
                 st.tuples(st.none() | st.integers(-4, 4), st.none() | st.integers(-4, 4)), st.just(PERIOD)),
       st.lists(st.integers(0, 40), max_size=6))  # fmt: skip
def test_whole_numbers_that_lie_at_levels_and_bounds_are_found_as_one_by_one(samples, kind, looking, cuts):
    values, times = np.array(samples, kind), np.arange(len(samples), dtype=np.int64)
    assert finder_of(looking, times, values, cuts).time_ns.tolist() == sought_one_by_one(looking, samples)


@pytest.mark.parametrize("kind", ["i1", "u2", "i8", "f4", "f8"])
def test_a_step_of_half_of_what_a_signal_spans_is_no_edge_and_a_larger_one_is(kind):
    times = np.arange(6, dtype=np.int64)
    assert places(Looking(Sought.EDGE), times[:3], np.array([0, 2, 4], kind)).tolist() == []
    assert places(Looking(Sought.EDGE), times, np.array([0, 2, 4, 1, 3, 0], kind)).tolist() == [3, 5]


@settings(deadline=None, max_examples=200)
@given(st.lists(st.integers(1, 6).map(lambda halves: halves * PERIOD // 2), max_size=40),
       st.lists(st.integers(0, 40), max_size=6))  # fmt: skip
def test_a_hole_is_more_than_so_many_periods_and_not_exactly_so_many(steps, cuts):
    times = np.cumsum(np.array([0, *steps], np.int64))
    wanted = [int(times[at]) for at, step in enumerate(steps) if step > LONG_GAP * PERIOD]
    assert (
        finder_of(Looking(Sought.HOLE, period_ns=PERIOD), times, np.zeros(len(times)), cuts).time_ns.tolist() == wanted
    )


@settings(deadline=None, max_examples=200)
@given(st.lists(st.booleans(), min_size=2, max_size=60), st.integers(0, 70), st.integers(1, 12),
       st.lists(st.integers(0, 60), max_size=6))  # fmt: skip
def test_the_moments_next_to_a_time_are_kept_and_all_are_counted(samples, around, most, cuts):
    values, times = np.array(samples), np.arange(len(samples), dtype=np.int64)
    wanted = times[places(Looking(Sought.CHANGE), times, values)].tolist()
    found = finder_of(Looking(Sought.CHANGE), times, values, cuts, around, most)
    kept = found.time_ns.tolist()
    assert found.total == len(wanted)
    assert kept == wanted[found.before : found.before + len(kept)]
    before, after = ([each for each in wanted if (each < around) is early] for early in (True, False))
    assert len(kept) == min(most, len(wanted))  # a side that has less leaves its room to the other one
    assert sum(each < around for each in kept) >= min(len(before), most // 2)
    assert sum(each >= around for each in kept) >= min(len(after), most - most // 2)


@pytest.mark.parametrize("what", list(Sought))
def test_texts_are_only_looked_through_for_changes_and_holes(what):
    values, times = np.array([b"a", b"a", b"b"]), np.array([0, 10, 40], np.int64)
    found = finder_of(Looking(what, period_ns=PERIOD), times, values, [1, 2])
    wanted = {Sought.EDGE: [40], Sought.CHANGE: [40], Sought.HOLE: [10]}
    assert found.time_ns.tolist() == wanted.get(what, [])


def test_of_a_hole_its_length_is_told_and_one_may_look_for_longer_ones_alone():
    longer = finder_of(Looking(Sought.HOLE, 25e-9, period_ns=PERIOD), np.array([0, 20, 50, 60]), np.zeros(4), [2])
    assert longer.time_ns.tolist() == [20]
    found = finder_of(Looking(Sought.HOLE, period_ns=PERIOD), np.array([0, 10, 40, 50]), np.zeros(4), [2])
    assert (found.time_ns.tolist(), found.values.tolist()) == ([10], [30])


def test_edges_of_integers_next_to_the_largest_are_found_in_blocks_as_in_the_whole():
    values, times = np.array([2**63 - 1, 2**63 - 2, 2**63 - 1], np.int64), np.array([0, 10, 20], np.int64)
    assert finder_of(Looking(Sought.EDGE, period_ns=PERIOD), times, values, [1, 2]).time_ns.tolist() == [10, 20]
    assert places(Looking(Sought.EDGE, period_ns=PERIOD), times, values).tolist() == [1, 2]

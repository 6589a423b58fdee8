"""The rules that `start()` follows: the time buffer, the size tiers, and which rings there are."""

import itertools
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from silo.core.elements import (
    Action,
    BufferType,
    ElementInfo,
    ElementOptions,
    Entry,
    LoggerOptions,
    buffer_size_for,
    join_name,
)
from silo.loop.plan import Element, TimeBuffer, make_plan, size_tiers, time_buffer
from silo.loop.sources import refer
from silo.loop.types import Component
from silo.segment.layout import TIME_RING

LOOPING, FIXED, GROWING = BufferType.LOOPING, BufferType.FIXED, BufferType.GROWING


def options(kind=LOOPING, size=10, divider=1, **more):
    return ElementOptions(buffer=kind, size=size, divider=divider, **more)


def element(name="/x", array=None, **chosen):
    array = np.zeros(1) if array is None else array
    info = ElementInfo(name, "-", "scalar", array.shape, (Entry("", array.dtype.str),), options(**chosen))
    return Element(info, (Component("", refer(array, name)),))


def plan(*elements, frequency=100, max_time=10, tiers=3):
    return make_plan(elements, frequency, max_time, tiers)


# --------------------------------------------------------------------------------------------------- time buffer


@pytest.mark.parametrize(
    ("elements", "frequency", "max_time", "made"),
    [
        pytest.param([options(size=5), options(size=9)], 100, 10, (LOOPING, 9), id="all loop"),
        pytest.param([options(size=10, divider=7), options(size=60)], 100, 10, (LOOPING, 70), id="longest in ticks"),
        pytest.param([options(FIXED, 5, divider=3), options(FIXED, 9)], 100, 10, (FIXED, 15), id="all are fixed"),
        pytest.param([options(FIXED), options(LOOPING)], 200, 10, (FIXED, 2000), id="mixed: as long as max time"),
        pytest.param([options(GROWING)], 200, 3, (FIXED, 600), id="growing, with a max time"),
        pytest.param([options(GROWING)], 200, 0, (GROWING, 2000), id="without max time it grows from ten seconds"),
        pytest.param([options(FIXED), options(LOOPING)], 200, 0, (GROWING, 2000), id="mixed, without max time"),
        pytest.param(
            [options(LOOPING, 8), options(FIXED, 99, enabled=False)], 100, 10, (LOOPING, 8), id="off has no say"
        ),
        pytest.param(
            [options(LOOPING, 8), options(FIXED, 9, action=Action.PUBLISH)],
            100,
            10,
            (FIXED, 1000),
            id="published has one",
        ),
        pytest.param([], 100, 10, (FIXED, 1000), id="an empty table has one"),
    ],
)
def test_the_time_buffer_follows_the_elements_that_are_on(elements, frequency, max_time, made):
    assert time_buffer(elements, frequency, max_time) == TimeBuffer(*made)


# ------------------------------------------------------------------------------------------- names and sizes


@pytest.mark.parametrize(
    ("seconds", "frequency", "divider", "size"),
    [(10, 100, 1, 1000), (10, 100, 3, 334), (0.1, 30, 1, 3), (1, 3, 7, 1), (0.001, 100, 1, 1), (2, 0.1, 1, 1)],
)
def test_a_buffer_for_a_time_is_rounded_up_and_at_least_one_sample(seconds, frequency, divider, size):
    assert buffer_size_for(seconds, frequency, divider) == size


def test_without_max_time_a_default_buffer_holds_ten_seconds():
    assert LoggerOptions(frequency_hz=50, max_time_s=0).default_buffer_size(2) == 250


@pytest.mark.parametrize(
    ("prefix", "group", "name", "full"),
    [
        ("/log", "", "q", "/log/q"),
        ("/log", "joints", "q", "/log/joints/q"),
        ("/log/", "/joints//", "//q/", "/log/joints/q"),
        ("", "", "q", "/q"),
        ("log", "a/b", "c/d", "/log/a/b/c/d"),
        ("/log", "", "/log/joints/q", "/log/joints/q"),
        ("/log", "/", "log/q", "/log/q"),
        ("/log", "", "/log", "/log/log"),
        ("/log", "", "/logs/q", "/log/logs/q"),
        ("/log", "log", "q", "/log/log/q"),
        ("/a/b", "", "/a/b/q", "/a/b/q"),
        ("/a/b", "", "/a/q", "/a/b/a/q"),
    ],
)
def test_a_name_is_prefix_group_and_name_with_runs_of_slashes_folded(prefix, group, name, full):
    assert join_name(prefix, group, name) == full


# ---------------------------------------------------------------------------------------------------- size tiers


def cost(bounds, sizes, weights):
    return sum(
        weight * min(bound for bound in bounds if bound >= size) for size, weight in zip(sizes, weights, strict=True)
    )


@given(
    table=st.lists(st.tuples(st.integers(1, 30), st.integers(1, 9)), min_size=1, max_size=7), tiers=st.integers(1, 5)
)
def test_size_tiers_waste_as_little_memory_as_can_be(table, tiers):
    sizes, weights = [size for size, _ in table], [weight for _, weight in table]
    found = size_tiers(sizes, weights, tiers)
    distinct = sorted(set(sizes))
    choices = [
        [*below, distinct[-1]]
        for count in range(min(tiers, len(distinct)))
        for below in itertools.combinations(distinct[:-1], count)
    ]
    assert cost(found, sizes, weights) == min(cost(choice, sizes, weights) for choice in choices)
    assert len(found) <= tiers


def test_thousands_of_sizes_are_merged_into_tiers_that_hold_the_largest():
    bounds = size_tiers(range(1, 5001), [1] * 5000, 3)
    assert len(bounds) <= 3
    assert bounds[-1] == 5000


# --------------------------------------------------------------------------------------------------------- rings


def test_there_is_one_ring_per_divider_type_and_tier():
    made = plan(
        element("/a"),
        element("/b"),
        element("/c", divider=2),
        element("/d", kind=FIXED),
        element("/e", size=1000),
        tiers=2,
    )
    rings = [(ring.schema.divider, ring.schema.buffer_type) for ring in made.rings]
    assert sorted(rings[1:]) == [(1, FIXED), (1, LOOPING), (1, LOOPING), (2, LOOPING)]


def test_the_time_ring_has_nothing_but_stamps():
    ring = plan(element()).rings[TIME_RING]
    assert (ring.schema.row_words, len(ring.words)) == (2, 0)


def test_a_disabled_element_has_no_place_in_any_ring():
    assert plan(element(enabled=False)).elements == ()


def test_words_that_two_entries_share_are_gathered_once():
    made = plan(element(array=np.zeros(16, np.uint8)))
    assert len(made.rings[1].words) in (2, 3)


def test_a_word_is_gathered_wholly_where_an_entry_crosses_its_end():
    raw = np.zeros(24, np.uint8)
    odd = np.ndarray((1,), np.float64, raw.data, 5 - raw.__array_interface__["data"][0] % 8 + 8)
    assert len(plan(element(array=odd)).rings[1].words) == 2


def test_a_looping_element_that_is_published_is_watched_in_its_own_ring():
    made = plan(element(size=1000, action=Action.SAVE_AND_PUBLISH))
    assert made.elements[0].live_ring == made.elements[0].ring


@pytest.mark.parametrize("kind", [FIXED, GROWING])
def test_a_published_element_whose_buffer_can_end_has_a_live_ring_too(kind):
    made = plan(element(kind=kind, size=10_000, action=Action.SAVE_AND_PUBLISH))
    live = made.rings[made.elements[0].live_ring].schema
    assert made.elements[0].live_ring != made.elements[0].ring
    assert live.live
    assert live.buffer_type is LOOPING


def test_a_short_looping_buffer_that_is_published_has_a_live_ring_of_two_seconds():
    made = plan(element(size=3, action=Action.PUBLISH), frequency=1000)
    assert made.rings[made.elements[0].live_ring].schema.capacity == 2000


def test_an_element_that_is_only_saved_has_no_live_ring():
    assert plan(element()).elements[0].live_ring == -1


@pytest.mark.slow
def test_the_work_of_planning_does_not_explode_with_ten_thousand_elements():
    arrays = [np.zeros(1) for _ in range(10_000)]
    elements = [element(f"/e{i}", array, size=1 + i % 500, divider=1 + i % 20) for i, array in enumerate(arrays)]

    def work_s(count: int) -> float:
        begin = time.process_time()
        plan(*elements[:count])
        return time.process_time() - begin

    # ten times the elements are ten times the work, with room for noise; the square of it would be a hundred times
    assert work_s(10_000) < 40 * min(work_s(1000) for _ in range(3))

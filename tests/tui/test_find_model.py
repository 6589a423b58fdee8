"""Find the moment, and what lies between two cursors: exact to the sample, as a naive loop has it."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silo.expressions.span import Measuring, between
from silo_tui.model.samples.find import Search, What, neighbour, parse_find, places_of

PERIOD = 10
values = st.lists(st.sampled_from([0.0, 1.0, 2.5, -3.0, 7.0, math.nan, math.inf, -math.inf]), max_size=30)
steps = st.lists(st.integers(1, 40), min_size=30, max_size=30)


def found(search, samples, times=None, dtype="f8"):
    samples = np.array(samples, dtype)
    times = np.arange(len(samples)) * PERIOD if times is None else np.array(times)
    return places_of(search, times.astype(np.int64), samples, PERIOD).tolist()


def naive(search, samples):
    places, last = [], None
    numbered = [value for value in samples if not math.isnan(value)]
    finite = [value for value in samples if math.isfinite(value)]
    for at, value in enumerate(samples):
        before = samples[at - 1] if at else None
        if search.what is What.HIGHEST:
            hit = numbered and value == max(numbered) and value != before
        elif search.what is What.LOWEST:
            hit = numbered and value == min(numbered) and value != before
        elif search.what is What.NOT_FINITE:
            hit = not math.isfinite(value) and (before is None or math.isfinite(before))
        elif search.what is What.CHANGE:
            hit = before is not None and value != before and not (math.isnan(value) and math.isnan(before))
        elif search.what is What.EDGE:
            both = before is not None and math.isfinite(before) and math.isfinite(value)
            hit = both and max(finite) > min(finite) and abs(value - before) > (max(finite) - min(finite)) / 2
        else:
            hit = False
            if not math.isnan(value):
                rose = last is not None and last < search.level <= value
                fell = last is not None and value < search.level <= last
                hit = (rose and search.direction >= 0) or (fell and search.direction <= 0)
                last = value
        if hit:
            places.append(at)
    return places


@settings(deadline=None, max_examples=300)
@given(values, st.sampled_from(list(What)), st.sampled_from([-3.0, 0.0, 1.5, 7.0]), st.sampled_from([-1, 0, 1]))
def test_every_search_finds_what_a_loop_finds(samples, what, level, direction):
    if what in {
        What.HOLE,
        What.OUTSIDE,
        What.TRIGGER,
        What.MARKER,
        What.CONDITION,
        What.PEAK,
        What.BEYOND,
        What.MOMENT,
        What.SIGNAL,
    }:  # others find these
        return
    search = Search(what, level, direction)
    assert found(search, samples) == naive(search, samples)


@given(steps)
def test_a_hole_is_the_last_sample_before_it(gaps):
    times = np.cumsum(gaps)
    expected = [at for at in range(len(gaps) - 1) if times[at + 1] - times[at] > 15]
    assert found(Search(What.HOLE), np.zeros(len(gaps)), times) == expected


def test_the_highest_of_counters_beyond_2_to_the_53_is_exact():
    counts = [2**62, 2**62 + 1, 2**62 + 3, 2**62 + 2]
    assert found(Search(What.HIGHEST), counts, dtype="i8") == [2]


def test_texts_and_booleans_have_changes_and_no_highest_text():
    words = np.array([b"walk", b"walk", b"trot", b"walk"])
    times = np.arange(4, dtype=np.int64)
    assert places_of(Search(What.CHANGE), times, words, 1).tolist() == [2, 3]
    assert not len(places_of(Search(What.HIGHEST), times, words, 1))
    assert found(Search(What.EDGE), [False, True, True, False], dtype="?") == [1, 3]


@pytest.mark.parametrize("what", list(What))
def test_nothing_is_found_in_nothing(what):
    assert found(Search(what), []) == []


def test_next_and_before_never_return_the_moment_itself():
    assert neighbour([10, 20, 30], 20, 1) == 2
    assert neighbour([10, 20, 30], 20, -1) == 0
    assert neighbour([10, 20, 30], 30, 1) is None
    assert neighbour([], 30, -1) is None


@pytest.mark.parametrize(
    ("typed", "search", "words"),
    [
        (" >20 ", Search(What.CROSSING, 20.0, 1), "rises above 20"),
        ("above 5", Search(What.CROSSING, 5.0, 1), "rises above 5"),
        ("<-1e-3", Search(What.CROSSING, -1e-3, -1), "falls below -0.001"),
        ("0", Search(What.CROSSING, 0.0), "crosses 0"),
        ("last above 5", Search(What.BEYOND, 5.0, 1, begin=-1), "last above 5"),
        ("First < .5", Search(What.BEYOND, 0.5, -1, begin=1), "first below 0.5"),
        ("last 5", Search(What.CROSSING, 5.0, begin=-1), "last crosses 5"),
        ("h", Search(What.HIGHEST), "highest"),
        ("* Max", Search(What.HIGHEST, everywhere=True), "highest"),
        ("last gap", Search(What.HOLE, begin=-1), "last hole"),
        ("-3s", Search(What.MOMENT, condition="-3s"), ""),
        ("at 12.5", Search(What.MOMENT, condition="12.5"), ""),
        ("13:07:32", Search(What.MOMENT, condition="13:07:32"), ""),
        ("above 5 Nm", Search(What.CONDITION, condition="> 5 Nm"), "> 5 Nm"),
        ("q above 5 and x < 2", Search(What.CONDITION, condition="q > 5 and x < 2"), "q > 5 and x < 2"),
        ("LF/torque", Search(What.SIGNAL, condition="LF/torque"), "LF/torque"),
        ("last", "last of what?", ""),
        ("> nan", "nothing crosses nan", ""),
    ],
)  # fmt: skip
def test_what_is_looked_for_is_typed_in_words(typed, search, words):
    if isinstance(search, str):
        with pytest.raises(ValueError, match=search):
            parse_find(typed)
    else:
        assert parse_find(typed) == search
        assert parse_find(typed).words == words or not words


def test_the_last_moment_above_a_value_is_the_last_sample_that_is():
    samples = [0.0, 7.0, 8.0, 5.0, 6.0, math.nan, 6.5]
    assert found(parse_find("last above 5"), samples) == [2, 4, 6]  # in order: it begins with the last
    assert found(parse_find("first above 5"), samples) == [1, 4, 6]
    assert found(parse_find("last below 5"), samples) == [0]


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=40), st.integers(0, 400), st.integers(0, 400))
def test_statistics_between_the_cursors_are_those_of_their_samples(samples, a_ns, b_ns):
    times = np.arange(len(samples), dtype=np.int64) * PERIOD
    facts = between(times, np.array(samples), a_ns, b_ns)
    inside = samples[min(a_ns, b_ns) // PERIOD : max(a_ns, b_ns) // PERIOD + 1] or samples[-1:]  # which holds on
    assert facts.samples == len(inside)
    assert facts.at_a == samples[min(len(samples) - 1, a_ns // PERIOD)]
    near = pytest.approx
    assert facts.mean == near(np.mean(inside), abs=1e-9)
    assert facts.std == near(np.std(inside), abs=1e-6)
    assert facts.rms == near(math.sqrt(np.mean(np.square(inside))), abs=1e-6)
    assert (facts.smallest, facts.largest) == (min(inside), max(inside))
    if a_ns != b_ns:
        assert facts.slope == pytest.approx(facts.difference / ((b_ns - a_ns) / 1e9))


@pytest.mark.parametrize("size", [1e-300, 1e300])
def test_rms_of_very_small_and_very_large_numbers_is_one(size):
    facts = between(np.arange(4, dtype=np.int64), np.array([size, -size, size, -size]), 0, 3)
    assert facts.rms == pytest.approx(size)
    assert facts.std == pytest.approx(size)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ([1.0, math.nan, 3.0], (2.0, 1.0, 1.0, 3.0, 1)),
        ([1.0, math.nan, 3.0, math.inf], (math.inf, math.nan, 1.0, math.inf, 2)),
        ([-math.inf, 1.0], (-math.inf, math.nan, -math.inf, 1.0, 1)),
        ([-math.inf, math.inf], (math.nan, math.nan, -math.inf, math.inf, 2)),
        ([math.nan], (math.nan,) * 4 + (1,)),
    ],
)
def test_nan_is_counted_and_left_out_infinite_ones_are_in(values, told):
    facts = between(np.arange(len(values), dtype=np.int64), np.array(values), 0, 3)
    np.testing.assert_equal((facts.mean, facts.std, facts.smallest, facts.largest, facts.not_finite), told)


@settings(max_examples=50)
@given(
    st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=1, max_size=30),
    st.lists(st.integers(0, 30), max_size=3),
    st.integers(-1, 31),
    st.integers(-1, 31),
)
def test_facts_added_up_block_by_block_are_those_of_all_samples(samples, cuts, a_ns, b_ns):
    values, times = np.array(samples), np.arange(len(samples), dtype=np.int64)
    measuring = Measuring(a_ns, b_ns)
    for begin, end in pairwise([0, *sorted(cuts), len(samples) + 31]):
        measuring.feed(times[begin:end], values[begin:end])
    whole, found = between(times, values, a_ns, b_ns), measuring.found
    assert (found.samples, found.not_finite) == (whole.samples, whole.not_finite)
    size = max((abs(one) for one in samples if math.isfinite(one)), default=0.0)
    for name in ("at_a", "at_b", "mean", "std", "rms", "smallest", "largest"):
        one, other = getattr(found, name), getattr(whole, name)
        assert one == other or abs(one - other) <= 1e-6 * size or (math.isnan(one) and math.isnan(other)), name

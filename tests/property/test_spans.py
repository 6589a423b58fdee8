"""Stretches of ticks, against sets of the ticks themselves."""

from collections import Counter
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from silo.core.arrays.spans import doubled, merged, spans_text, without

SPANS = st.lists(
    st.tuples(st.integers(0, 40), st.integers(0, 8)).map(lambda one: (one[0], one[0] + one[1])), max_size=8
)


def ticks(spans):
    return {tick for first, last in spans for tick in range(first, last + 1)}


@given(SPANS)
def test_merged_stretches_hold_the_same_ticks_and_do_not_touch(spans):
    found = merged(spans)
    assert ticks(found) == ticks(spans)
    assert all(before[1] + 1 < after[0] for before, after in pairwise(found))


@given(SPANS, SPANS)
def test_what_others_have_is_taken_out(spans, others):
    left = without(spans, others)
    assert ticks(left) == ticks(spans) - ticks(others)
    assert all(first <= last for first, last in left)


@given(SPANS)
def test_what_stands_in_several_is_doubled(spans):
    counts = Counter(tick for first, last in spans for tick in range(first, last + 1))
    assert ticks(doubled(spans)) == {tick for tick, count in counts.items() if count > 1}


def test_they_are_shown_in_words():
    assert spans_text([(3, 3)]) == "1 tick (3)"
    assert spans_text([(at * 10, at * 10 + 1) for at in range(7)]) == "14 ticks (0-1, 10-11, 20-21, 30-31, 40-41, ...)"

"""What a feed of a bridge remembers of the samples that it passed on."""

import numpy as np

from silo.bridges.feed import LoggerFollower
from silo.history.arrays import SampleArrays


def samples(first, count):
    ticks = np.arange(first, first + count)
    return SampleArrays(ticks, ticks * 1000, ticks.astype(float))


def test_no_sample_is_passed_on_twice_and_runs_that_are_over_are_forgotten():
    feed = LoggerFollower(lambda: None, None)
    for run in ("one", "two", "three"):
        assert feed._unseen(run, "/log/x", samples(0, 10)).ticks.tolist() == list(range(10))
        assert feed._unseen(run, "/log/x", samples(5, 10)).ticks.tolist() == list(range(10, 15))
    assert feed._last_tick == {"/log/x": 14}

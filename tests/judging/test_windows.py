"""Moving windows beside what NumPy says of each of them, for any length, with what is missing and with breaks."""

import warnings
from itertools import pairwise

import numpy as np
import pytest

from silo.expressions.windows import SHORT, Window


def _sum(values, axis):
    return np.where(np.isnan(values).all(axis=axis), np.nan, np.nansum(values, axis=axis))


FUNCTIONS = {"min": np.nanmin, "max": np.nanmax, "sum": _sum, "mean": np.nanmean, "std": np.nanstd}


def fed(window, times, values, breaks, cuts):
    """The results of all batches between the cuts."""
    return np.concatenate([
        window.feed(times[low:high], values[low:high], np.array(
            [at - low for at in sorted(breaks) if low <= at < high], int
        ))
        for low, high in pairwise([0, *cuts, len(times)])
    ])  # fmt: skip


def expected(function, length, times, values, breaks):
    found, begin = np.empty_like(values), 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # NumPy's word for windows without a value
        for at in range(len(times)):
            if at in breaks or (at and times[at] < times[at - 1]):
                begin = at
            inside = np.flatnonzero(times[begin : at + 1] > times[at] - length) + begin
            found[at] = FUNCTIONS[function](values[inside], axis=0)
    return found


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("length", [1, 7, SHORT - 1, SHORT, SHORT + 1, 2 * SHORT, 200])
@pytest.mark.parametrize("seed", range(3))
def test_each_row_has_what_numpy_says_of_its_window(function, length, seed):
    rng = np.random.default_rng(seed)
    breaks, cuts = set(rng.integers(0, 400, 2).tolist()), np.sort(rng.integers(0, 400, 6)).tolist()
    times = np.cumsum(rng.integers(0, 3, 400))
    if seed % 3 == 0:
        times[rng.integers(1, 400) :] -= 50
    values = 1e6 + rng.normal(size=(400, 2)) * 10.0 ** rng.integers(-3, 9, (400, 1))
    values[rng.random((400, 2)) < 0.1 * (seed % 4)] = np.nan
    found = fed(Window(function, length), times, values, breaks, cuts)
    wanted = expected(function, length, times, values, breaks)
    assert np.array_equal(np.isnan(found), np.isnan(wanted))
    assert np.allclose(found, wanted, rtol=1e-9, atol=1e-9, equal_nan=True)
    assert found.tobytes() == fed(Window(function, length), times, values, breaks, []).tobytes()


@pytest.mark.parametrize("function", FUNCTIONS)
@pytest.mark.parametrize("length", [20, 150])
def test_another_one_goes_on_with_the_same_bits_from_what_it_remembers(function, length):
    rng = np.random.default_rng(3)
    times, values = np.arange(600), rng.normal(size=(600, 3)) * 1e3
    values[rng.random((600, 3)) < 0.05] = np.nan
    whole = fed(Window(function, length), times, values, {250}, [])
    first, second = Window(function, length), Window(function, length)
    begun = fed(first, times[:333], values[:333], {250}, [])
    second.recall(first.memory())
    rest = fed(second, times[333:], values[333:], (), [100])
    assert np.concatenate([begun, rest]).tobytes() == whole.tobytes()


@pytest.mark.parametrize("length", [10, 200])
def test_a_spike_of_any_size_is_gone_with_its_sample(length):
    values = np.ones(900)
    values[100], values[101] = 1e300, np.inf
    found = fed(Window("std", length), np.arange(900), values, (), [])
    assert (found[101 + length :] == 0).all()
    assert (fed(Window("mean", length), np.arange(900), values, (), [])[101 + length :] == 1).all()

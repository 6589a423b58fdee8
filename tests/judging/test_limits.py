"""Limits: no sample beyond a bound is missed, states follow the rules, the same for any cut."""

import math
from itertools import pairwise

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from silo.errors import ElementError
from silo.judging.limits import EntryState, Level, Limit, LimitRule, beside_bounds, limit_rule
from tests.examples import examples

RULE = LimitRule(-20, -10, 10, 20)
MS = 10**6


def fed(rule, values, cuts=(), context=None, times=None):
    """The limit after samples at ticks 0, 1, ... a millisecond apart, and all its violations."""
    values = np.asarray(values)
    limit = Limit(rule, 1 if values.ndim == 1 else values.shape[1])
    ticks = np.arange(len(values))
    times = ticks * MS if times is None else np.asarray(times)
    codes = None if context is None else np.asarray(context, np.int8)
    found = {}
    edges = [0, *cuts, len(values)]
    for low, high in pairwise(edges):
        part = None if codes is None else codes[low:high]
        for violation in limit.feed(ticks[low:high], times[low:high], values[low:high], part):
            found[violation.entry, violation.number] = violation
    return limit, list(found.values())


class Slow:
    """The rules, one sample after the other."""

    def __init__(self, rule):
        self.rule, self.level, self.alarm = rule, 0, 0
        self.recent = []  # levels that count, since they were last in context
        self.moved = 0  # how many of them were there when the state changed
        self.open, self.violations = None, []
        self.fresh, self.last, self.stale, self.stale_count = None, math.nan, False, 0

    def row(self, tick, value, context):
        rule = self.rule
        if rule.stale_ns:
            time_ns = tick * MS
            self.fresh = time_ns if self.fresh is None else self.fresh
            if time_ns - self.fresh > rule.stale_ns and not self.stale:
                self.stale, self.stale_count = True, self.stale_count + 1
            if not math.isnan(value):
                if value != self.last:
                    self.fresh, self.stale = time_ns, False
                self.last = value
        if context is not None and context != 1:
            self.level, self.open, self.recent, self.moved = 0, None, [], 0
            return
        if math.isnan(value):
            return
        raw = (value > rule.yellow_high) + (value > rule.red_high) - (value < rule.yellow_low) - (value < rule.red_low)
        if self.open is not None and self.open["worst"] * raw <= 0:
            self.open = None
        if raw:
            if self.open is None:
                self.open = {"worst": raw, "first": tick, "peak": value, "peak_tick": tick, "samples": 0}
                self.violations.append(self.open)
            self.open["worst"] = max(self.open["worst"], raw, key=abs)
            self.open["samples"] += 1
            if abs(value) > abs(self.open["peak"]):
                self.open["peak"], self.open["peak_tick"] = value, tick
        bounds = {-2: rule.red_low, -1: rule.yellow_low, 1: rule.yellow_high, 2: rule.red_high}
        held = False
        if rule.hysteresis and self.level and abs(raw) < abs(self.level) and raw * self.level >= 0:
            bound = bounds[self.level]
            held = value > bound - rule.hysteresis if self.level > 0 else value < bound + rule.hysteresis
        self.recent.append(self.level if held else raw)
        newest = self.recent[-rule.persistence :]
        if len(newest) < rule.persistence:
            return
        side = -1 if newest[-1] < 0 else 1
        wanted = []
        if all(abs(one) == 2 for one in newest):
            wanted.append(2 * side)
        elif not self.level and all(newest):
            wanted.append(side)
        if len(self.recent) - self.moved >= rule.persistence and all(one * self.level < 0 for one in newest):
            wanted.append(side)
        if not any(newest):
            wanted.append(0)
        elif abs(self.level) == 2 and all(abs(one) < 2 for one in newest):
            wanted.append(self.level // 2)
        to = max(wanted, key=lambda one: abs(one - self.level), default=self.level)
        if to != self.level:
            self.level, self.moved = to, len(self.recent)
            self.alarm = max(self.alarm, to, key=abs)


def judged_alike(rule, values, context, cuts):
    """Hold the judge of blocks against the one of samples."""
    slow = Slow(rule)
    for tick, value in enumerate(values):
        slow.row(tick, value, None if context is None else context[tick])
    limit, found = fed(rule, values, cuts, None if context is None else context[: len(values)])
    (state,) = limit.states
    assert (state.level, state.alarm, state.count) == (slow.level, slow.alarm, len(slow.violations))
    assert (state.stale, state.stale_count) == (slow.stale, slow.stale_count)
    assert [(v.worst, v.first_tick, v.peak, v.peak_tick, v.samples) for v in found] == [
        (v["worst"], v["first"], v["peak"], v["peak_tick"], v["samples"]) for v in slow.violations
    ]
    assert state.is_open == (slow.open is not None)


@settings(max_examples=examples(400))
@given(
    st.lists(st.sampled_from([0.0, 5.0, 9.0, 11.0, 19.0, 25.0, 30.0, -9.0, -15.0, -21.0, math.nan]), max_size=40),
    st.integers(1, 3), st.sampled_from([0.0, 3.0]), st.sampled_from([0, 2 * MS]), st.booleans(), st.data(),
)  # fmt: skip
def test_any_cut_gives_what_a_judge_sample_by_sample_gives(values, persistence, hysteresis, stale_ns, limited, data):
    context = data.draw(st.lists(st.sampled_from([1, 1, 0, -1]), min_size=40, max_size=40)) if limited else None
    cuts = data.draw(st.lists(st.integers(0, len(values)), max_size=5).map(sorted))
    judged_alike(LimitRule(-20, -10, 10, 20, persistence, hysteresis, stale_ns), values, context, cuts)


@settings(max_examples=examples(600))
@given(
    st.lists(st.integers(-4, 4), max_size=40), st.sampled_from([(-3, -2, 2, 3), (-2, -2, 1, 1), (0, 1, 2, 4)]),
    st.integers(1, 3), st.sampled_from([0, 1]), st.sampled_from([0, MS, 2 * MS]), st.booleans(), st.data(),
)  # fmt: skip
def test_whole_numbers_that_lie_at_bounds_are_judged_as_sample_by_sample(
    values, bounds, persistence, hysteresis, stale_ns, limited, data
):
    hysteresis = min(hysteresis, (bounds[2] - bounds[1]) / 2)
    context = data.draw(st.lists(st.sampled_from([1, 1, 0, -1]), min_size=40, max_size=40)) if limited else None
    cuts = data.draw(st.lists(st.integers(0, len(values)), max_size=5).map(sorted))
    judged_alike(LimitRule(*bounds, persistence, hysteresis, stale_ns), values, context, cuts)


@given(st.lists(st.integers(-4, 4), min_size=1), st.sampled_from([(-3, -2, 2, 3), (-2, -2, 1, 1), (0, 1, 2, 4)]))
def test_samples_at_a_bound_alone_stir_nothing_and_are_no_violation(values, bounds):
    within = [min(max(value, bounds[1]), bounds[2]) for value in values]
    limit, found = fed(LimitRule(*bounds), within)
    assert (found, limit.states[0].level, limit.states[0].count) == ([], Level.GREEN, 0)


@pytest.mark.parametrize("values", [[25, 15] * 5, [15, 25] * 5, [-25, -15] * 5])
def test_time_beyond_yellow_counts_also_when_it_is_beyond_red(values):
    limit, _ = fed(LimitRule(-20, -10, 10, 20, persistence=4), values)
    assert abs(limit.states[0].level) == 1
    assert abs(limit.states[0].alarm) == 1
    assert limit.states[0].since_tick == 3


def test_one_sample_beyond_a_bound_is_kept_with_its_peak_and_tick_whatever_the_persistence():
    limit, (violation,) = fed(LimitRule(-20, -10, 10, 20, persistence=5), [0, 0, 99, 0, 0])
    assert (violation.peak, violation.peak_tick, violation.peak_ns, violation.over) == (99, 2, 2 * MS, True)
    assert limit.states[0].level is Level.GREEN
    assert limit.states[0].count == 1


def test_an_alarm_stays_until_somebody_acknowledges_it():
    limit, _ = fed(RULE, [0, 99, 0])
    assert (limit.states[0].level, limit.states[0].alarm) == (Level.GREEN, Level.RED_HIGH)
    assert limit.acknowledge("ann", 5) == 1
    assert limit.states[0].alarm is Level.GREEN
    assert limit.states[0].acknowledged.who == "ann"
    assert limit.acknowledge("ann", 6) == 0


def test_who_has_seen_alarms_is_told_how_many_were_new():
    limit, _ = fed(RULE, [0, 99, 0, 99, 0, 99, 0])
    assert (limit.states[0].count, limit.acknowledge("ann", 7)) == (3, 3)
    limit.feed(np.array([7, 8]), np.array([7, 8]) * MS, np.array([99.0, 0.0]))
    assert (limit.states[0].count, limit.acknowledge("ann", 9)) == (4, 1)


def test_each_scalar_of_a_vector_has_a_state_of_its_own():
    limit, (violation,) = fed(RULE, [[0, 0], [0, -50]])
    assert violation.entry == 1
    assert [state.level for state in limit.states] == [Level.GREEN, Level.RED_LOW]


@pytest.mark.parametrize("cuts", [[], [100], [105], [110], [111, 112], [110, 115]])
@pytest.mark.parametrize("at", [100, 101, 110, 155])
def test_a_value_that_froze_before_the_clock_was_set_back_is_stale_in_time(at, cuts):
    ticks, values = np.arange(300), np.minimum(np.arange(300.0), 99.0)  # it freezes at tick 99
    time_ns = ticks * 10_000_000 + 10**18
    time_ns[at:] -= 3600 * 10**9
    limit = Limit(LimitRule(stale_ns=500_000_000), 1)
    told = 0
    for some in np.split(ticks, cuts):
        for tick in some if len(some) > 150 else [some]:  # the rest tick by tick
            limit.feed(np.atleast_1d(tick), time_ns[np.atleast_1d(tick)], values[np.atleast_1d(tick)])
            told = told or (int(np.max(tick)) if limit.states[0].stale else 0)
    assert 150 <= told <= 151  # how long the tick of the step took isn't known
    assert limit.states[0].stale_count == 1


@pytest.mark.parametrize("first", [1, 2**60, -(2**53) - 1, 2**63 + 1, 0.5])
def test_a_value_that_stays_the_same_too_long_is_stale_until_it_is_new(first):
    rule = LimitRule(stale_ns=2 * MS)
    limit, _ = fed(rule, [first] * 5, cuts=(2,))
    assert limit.states[0].stale
    assert limit.states[0].stale_count == 1
    (limit.states[0],) = msgspec.msgpack.decode(msgspec.msgpack.encode(limit.states), type=list[EntryState])
    limit.feed(np.array([5]), np.array([5 * MS]), np.array([first]))
    assert limit.states[0].stale  # where another helper process goes on, too
    assert not fed(rule, [first, first, first, first, first + 1])[0].states[0].stale
    assert not fed(rule, [first + step for step in range(9)], cuts=(3, 4))[0].states[0].stale_count
    quiet, _ = fed(rule, [1, 2])
    assert quiet.check_stale(9 * MS) == [0]
    assert quiet.check_stale(10 * MS) == []


@pytest.mark.parametrize(
    "bounds", [(1, 2, 3), (4, 3, 2, 1), (None, None, None, None), 5, "abcd", (math.nan, 1, 2, 3), (0, 1, 1, 2)]
)
def test_bounds_that_make_no_sense_are_refused(bounds):
    with pytest.raises(ElementError, match="red_low, yellow_low"):
        limit_rule(bounds)


def test_a_bound_that_there_is_not_is_infinite_and_red_alone_needs_no_yellow():
    assert limit_rule((None, None, 50, 80)) == LimitRule(-math.inf, -math.inf, 50, 80)
    levels = [fed(limit_rule((None, None, None, 80)), [value])[0].states[0].level for value in (81, 79)]
    assert levels == [Level.RED_HIGH, Level.GREEN]


@pytest.mark.parametrize("bound", [2**53, -(2**53), 2**62, 2**63])
@pytest.mark.parametrize("dtype", [np.int64, np.uint64])
def test_an_integer_is_beyond_a_bound_or_not_to_the_last_digit(dtype, bound):
    near = [bound + step for step in range(-3, 4) if np.iinfo(dtype).min <= bound + step <= np.iinfo(dtype).max]
    edge, values = float(bound), np.array(near, dtype)
    high, low = LimitRule(yellow_high=edge, red_high=edge), LimitRule(red_low=edge, yellow_low=edge)
    assert [one > edge for one in beside_bounds(values, high).tolist()] == [one > bound for one in near]
    assert [one < edge for one in beside_bounds(values, low).tolist()] == [one < bound for one in near]

"""Triggers and captures: fires by the rule, exact spans, the same for any cut of the results."""

import dataclasses
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from silo.core.conditions import TriggerOptions, TriggerWord
from silo.core.elements import Action, BufferType, ElementInfo, ElementOptions
from silo.errors import ElementError
from silo.judging.checks import as_held, check_held, fixed_text
from silo.judging.triggers import Slope, Trigger, TriggerMode, TriggerRule, check_pre
from tests.examples import examples

T, F, U = 1, 0, -1


def fed(rule, condition, rearm=None, cuts=(), ticks=None):
    """The trigger after results at ticks 0, 1, ..., and all its captures."""
    trigger = Trigger(rule)
    ticks = np.arange(len(condition)) if ticks is None else np.asarray(ticks)
    codes = np.array(condition, np.int8)
    rearms = None if rearm is None else np.array(rearm, np.int8)
    found = {}
    edges = [0, *cuts, len(codes)]
    for low, high in pairwise(edges):
        part = None if rearms is None else rearms[low:high]
        for capture in trigger.feed(ticks[low:high], ticks[low:high] * 1000, codes[low:high], part):
            found[capture.number] = capture
    return trigger, list(found.values())


def fires(rule, condition, rearm=None, **more):
    return [fire.tick for capture in fed(rule, condition, rearm, **more)[1] for fire in capture.fires]


class Slow:
    """The rules, one row after the other."""

    def __init__(self, rule):
        self.rule = rule
        self.armed = self.ready = True
        self.turned, self.known, self.since, self.seen = False, U, None, False
        self.holdoff_end, self.patient = 0, None
        self.fires, self.captures = [], []

    def row(self, tick, condition, rearm):
        rule, level = self.rule, self.rule.slope is Slope.LEVEL
        if rule.slope is Slope.FALLING and condition != U:
            condition = 1 - condition
        if (rearm == T) if rearm is not None else (condition == F or level):
            self.ready = True
        if condition == T:
            if self.since is None:
                self.since = tick
                before = self.known == F or (self.known == U and self.seen)
                if level or (before and self.armed and self.ready and tick >= self.holdoff_end):
                    self.turned = True
        else:
            self.since = None
            if condition == F:
                self.turned = False
        self.seen = True
        if condition != U:
            self.known = condition
        if rule.mode is TriggerMode.AUTO and self.patient is None:
            self.patient = tick + rule.patience
        due = condition == T and self.armed and self.ready and (self.turned or level)
        due = due and tick >= self.since + rule.persist and tick >= self.holdoff_end
        waited = self.armed and self.patient is not None and tick >= self.patient
        if due or waited:
            self.fire(tick, forced=not due)

    def fire(self, tick, forced):
        rule = self.rule
        self.fires.append((tick, forced))
        goes_on = self.captures and tick <= self.captures[-1][1]
        if goes_on and tick + rule.post - self.captures[-1][0] < rule.longest:
            self.captures[-1][1] = tick + rule.post
        else:
            self.captures.append([max(0, tick - rule.pre), tick + rule.post])
        if rule.mode is TriggerMode.AUTO:
            self.patient = tick + rule.post + 1 + rule.patience
        if rule.mode is TriggerMode.SINGLE:
            self.armed, self.turned = False, False
        self.holdoff_end = tick + max(rule.holdoff, rule.post + 1 if rule.slope is Slope.LEVEL else 0)
        if not forced:
            self.ready = self.turned = False


rules = st.builds(
    TriggerRule, pre=st.integers(0, 4), post=st.integers(0, 5), slope=st.sampled_from(Slope),
    persist=st.integers(0, 3), holdoff=st.integers(0, 6), mode=st.sampled_from(TriggerMode), patience=st.integers(0, 5),
    longest=st.sampled_from([10, 15, 2**62]),
)  # fmt: skip
codes = st.lists(st.tuples(st.sampled_from([T, F, U]), st.integers(1, 4)), max_size=15).map(
    lambda runs: [code for code, length in runs for _ in range(length)]
)


@settings(max_examples=examples(400))
@given(rules, codes, st.none() | st.lists(st.sampled_from([T, F, U]), min_size=60, max_size=60), st.data())
def test_any_cut_fires_as_row_by_row(rule, condition, rearm, data):
    rearm = None if rearm is None else rearm[: len(condition)]
    step = data.draw(st.sampled_from([1, 3]))
    cuts = data.draw(st.lists(st.integers(0, len(condition)), max_size=4).map(sorted))
    ticks = [step * at for at in range(len(condition))]
    slow = Slow(rule)
    for at, code in enumerate(condition):
        slow.row(ticks[at], code, None if rearm is None else rearm[at])
    trigger, captures = fed(rule, condition, rearm, cuts, ticks)
    assert [(fire.tick, fire.forced) for capture in captures for fire in capture.fires] == slow.fires
    assert [[capture.first, capture.last] for capture in captures] == slow.captures
    assert trigger.fires == len(slow.fires)


@settings(max_examples=examples(400))
@given(rules, codes, st.lists(st.integers(0, 60), max_size=4).map(sorted))
@example(TriggerRule(0, 0, Slope.LEVEL, holdoff=5), [T, *[F] * 9, T], [8, 9])
def test_no_cut_of_the_run_changes_what_fires(rule, condition, cuts):
    if (
        rule.slope is Slope.LEVEL
    ):  # what lasts begins a capture of its own behind a cut, without its holdoff ticks count
        rule = dataclasses.replace(rule, holdoff=max(rule.holdoff, rule.post + 1))
    trigger, fired = Trigger(rule), []
    ends = [0, *(cut for cut in cuts if cut < len(condition)), len(condition)]
    for low, high in pairwise(ends):
        ticks = np.arange(high - low)
        trigger.feed(ticks, ticks * 1000, np.array(condition[low:high], np.int8))
        fired += [low + fire.tick for fire in trigger.fired]
        trigger = trigger.shifted(high - low)
    assert fired == fires(rule, condition)


def test_a_level_that_was_armed_by_hand_in_its_holdoff_fires_at_once_behind_a_cut_too():
    trigger = fed(TriggerRule(0, 0, Slope.LEVEL, holdoff=9), [T, T, F])[0]
    trigger.disarm()
    trigger.arm(3)
    trigger = trigger.shifted(3)
    trigger.feed(np.arange(2), np.arange(2), np.array([T, T], np.int8))
    assert [fire.tick for fire in trigger.fired] == [0]


AT_ONCE = TriggerRule(0, 0)


@pytest.mark.parametrize(
    ("rule", "condition", "ticks"),
    [
        (AT_ONCE, [F, F, T, T, F, T], [2, 5]),  # at the tick at which it turns true
        (AT_ONCE, [T, T, F, T], [3]),  # what is true from the start has not turned
        (TriggerRule(0, 0, Slope.LEVEL, holdoff=9), [T, T, F, T], [0]),  # and a level need not
        (AT_ONCE, [F, U, T], [2]),  # what turned while nobody could see it fires when it is seen
        (AT_ONCE, [U, T, U, T], [1]),  # as does what was never known
        (AT_ONCE, [T, U, T], []),
        (TriggerRule(0, 0, Slope("leave")), [F, T, T, F], [3]),  # as falling
        (TriggerRule(0, 0, persist=2), [F, T, T, F, T, T, T, T], [6]),  # of a pulse that is as long
        (TriggerRule(0, 0, holdoff=3), [F, T, F, T, F, T], [1, 5]),  # turns within it are ignored
        (TriggerRule(0, 1, mode=TriggerMode.AUTO, patience=3), [F] * 10, [3, 8]),  # where no fire comes
    ],
)
def test_it_fires_where_its_rule_says(rule, condition, ticks):
    assert fires(rule, condition) == ticks
    assert Slope("enter") is Slope.RISING


def test_single_fires_once_until_it_is_armed_again():
    trigger, captures = fed(TriggerRule(0, 0, mode=TriggerMode.SINGLE), [F, T, F, T])
    assert len(captures) == 1
    assert trigger.state(3) is TriggerWord.OFF
    trigger.arm(4)
    assert trigger.feed(np.array([4, 5]), np.zeros(2, np.int64), np.array([F, T], np.int8))[0].fires[0].tick == 5


def test_force_fires_whatever_the_condition_says():
    trigger, _ = fed(TriggerRule(1, 1), [F, F])
    (capture,) = trigger.force(2, 0)
    assert (capture.first, capture.last, capture.fires[0].forced) == (1, 3, True)


def test_a_disarmed_trigger_does_not_fire():
    trigger = Trigger(TriggerRule(0, 0))
    trigger.disarm()
    assert trigger.feed(np.arange(2), np.arange(2), np.array([F, T], np.int8)) == []


def test_states_tell_what_it_does():
    trigger, _ = fed(TriggerRule(0, 1, holdoff=5), [F, T])
    assert trigger.state(2) is TriggerWord.FIRING
    assert trigger.state(3) is TriggerWord.HOLDOFF
    assert trigger.state(6) is TriggerWord.ARMED
    assert fed(TriggerRule(0, 0), [F, U])[0].state(1) is TriggerWord.BLIND


def test_a_pre_longer_than_a_buffer_is_refused_with_the_size_that_would_do():
    check_pre(500, 1000, [_kept(1, 1502), _kept(1, 10, BufferType.GROWING), _kept(1, 10, BufferType.FIXED)])
    with pytest.raises(ElementError, match=r"'/log/q' holds 1501 samples, 1.501 s at divider 1: set size=1502"):
        check_pre(500, 1000, [_kept(1, 1501)])
    with pytest.raises(ElementError, match="size=152"):
        check_pre(500, 1000, [_kept(10, 151)])


def _kept(divider, size, buffer=BufferType.LOOPING):
    options = ElementOptions(divider=divider, buffer=buffer, size=size)
    return ElementInfo("/log/q", "", "scalar", (), (), options)


@pytest.mark.parametrize("spans", [[(1, 1501)], [(10, 151), (1, 1400)], [(7, 40), (1, 280)], [(1, 20)]])
def test_a_pre_that_is_refused_is_told_with_the_longest_that_all_buffers_hold(spans):
    buffers = [_kept(divider, size) for divider, size in spans]
    held = [pre for pre in range(2000) if all(size >= -(-(pre + 1000) // divider) + 2 for divider, size in spans)]
    with pytest.raises(ElementError, match="too short for pre of 2 s") as refused:
        check_pre(2000, 1000, buffers)
    if held:
        assert f" (all hold pre={max(held) / 1000:g}s): " in str(refused.value)
        check_pre(max(held), 1000, buffers)
    else:
        assert "all hold" not in str(refused.value)


@pytest.mark.parametrize(("size", "pre_s"), [(100, 0.225), (50, 0.0), (1000, 1.0)])
def test_a_trigger_as_all_buffers_hold_it_is_taken_with_the_longest_pre_that_is(size, pre_s):
    elements = [_kept(5, size), _kept(1, 4000), _kept(1, 10, BufferType.FIXED)]
    held = as_held(TriggerOptions("fall", "x > 1", 1.0, 1.0), elements, 400.0)
    assert (held.pre_s, held.post_s) == (pre_s, 1.0)
    if size >= 82:  # of less not even the second till it is judged is held
        check_held(held, elements, 400.0)
    if 0 < pre_s < 1:
        with pytest.raises(ElementError, match=r"all hold pre=0.225s"):
            check_held(replace(held, pre_s=pre_s + 1 / 400), elements, 400.0)


KEPT = ElementInfo("/log/kept", "", "scalar", (), (), ElementOptions(buffer=BufferType.FIXED, size=10))
SEEN = replace(KEPT, name="/log/seen", options=ElementOptions(divider=2, buffer=BufferType.GROWING, size=30))


@pytest.mark.parametrize("why_not", [{"enabled": False}, {"action": Action.PUBLISH}])
def test_captures_tell_what_keeps_first_samples_only_and_ask_the_past_of_all_else_that_is_saved(why_not):
    assert fixed_text([KEPT, SEEN]) == "'/log/kept' keeps first samples only (buffer=fixed), in captures too"
    assert fixed_text([KEPT, SEEN, KEPT]).startswith("'/log/kept' and 1 more keep")
    looping = replace(SEEN, options=replace(SEEN.options, buffer=BufferType.LOOPING))
    asked = TriggerOptions("slip", "q > 1", pre_s=9.0)
    with pytest.raises(ElementError, match="'/log/seen' holds 30 samples"):
        check_held(asked, [KEPT, looping], 10)
    not_saved = [replace(one, options=replace(one.options, **why_not)) for one in (KEPT, looping)]
    check_held(asked, [KEPT, SEEN, *not_saved], 10)
    assert (fixed_text(not_saved), fixed_text([SEEN])) == ("", "")

"""Triggers and limits while people arm, force and acknowledge between the results: held against judges row by row."""

import hypothesis.strategies as st
import numpy as np
from hypothesis import settings
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from silo.core.conditions import TriggerWord
from silo.judging.limits import Limit, LimitRule
from silo.judging.triggers import Trigger
from tests.examples import examples
from tests.judging import test_limits, test_triggers

F, T, U = 0, 1, -1
CODES = st.lists(st.sampled_from([F, T, T, U]), min_size=1, max_size=8)
MS = 10**6


class TriggerMachine(RuleBasedStateMachine):
    """A trigger is fed, forced, armed and disarmed in any order; the model takes one row after the other."""

    def __init__(self) -> None:
        super().__init__()
        self.tick, self.newest = -1, U
        self.found: dict[int, list[int]] = {}
        self.fires: list[tuple[int, bool]] = []

    @initialize(its=test_triggers.rules, rearms=st.booleans())
    def it_is_set(self, its, rearms) -> None:
        self.trigger, self.model, self.rearms = Trigger(its), test_triggers.Slow(its), rearms

    def _take(self, captures) -> None:
        self.found |= {one.number: [one.first, one.last] for one in captures}
        self.fires += [(fire.tick, fire.forced) for fire in self.trigger.fired]

    @rule(
        codes=CODES, rearm=st.lists(st.sampled_from([F, F, T, U]), min_size=8, max_size=8), step=st.sampled_from([1, 3])
    )
    def results_come(self, codes, rearm, step) -> None:
        ticks = self.tick + step * np.arange(1, len(codes) + 1)
        given = np.array(rearm[: len(codes)], np.int8) if self.rearms else None
        self._take(self.trigger.feed(ticks, ticks * 1000, np.array(codes, np.int8), given))
        for at, (tick, code) in enumerate(zip(ticks.tolist(), codes, strict=True)):
            self.model.row(tick, code, rearm[at] if self.rearms else None)
        self.tick, self.newest = int(ticks[-1]), codes[-1]

    @rule()
    def nothing_comes(self) -> None:
        empty = np.zeros(0, np.int64)
        assert self.trigger.feed(empty, empty, empty.astype(np.int8)) == []

    @rule()
    def somebody_forces_it(self) -> None:
        tick = max(self.tick, 0)
        self._take(self.trigger.force(tick, tick * 1000))
        self.model.fire(tick, forced=True)

    @rule()
    def somebody_arms_it(self) -> None:
        self.trigger.arm(self.tick)
        if not self.model.armed:
            self.model.armed = self.model.ready = True
            self.model.turned, self.model.patient, self.model.holdoff_end = False, None, self.tick

    @rule()
    def somebody_disarms_it(self) -> None:
        self.trigger.disarm()
        self.model.armed = self.model.turned = False

    @rule(ticks=st.integers(1, 5))
    def nothing_can_be_told_for_a_while(self, ticks) -> None:
        self.tick, self.newest = self.tick + ticks, U
        self.trigger.blind(self.tick)
        self.model.since = None

    @invariant()
    def it_fired_and_captured_what_the_model_did(self) -> None:
        if hasattr(self, "model"):
            assert self.fires == self.model.fires
            assert [self.found[number] for number in sorted(self.found)] == self.model.captures
            assert (self.trigger.fires, self.trigger.captures) == (len(self.fires), len(self.found))

    @invariant()
    def it_says_how_it_stands(self) -> None:
        if not hasattr(self, "model"):
            return
        for tick in (max(self.tick, 0), self.tick + 3):
            left = max(0, self.model.holdoff_end - tick)
            if self.model.captures and tick <= self.model.captures[-1][1]:
                word = TriggerWord.FIRING
            elif not self.model.armed:
                word = TriggerWord.OFF
            elif self.tick >= 0 and self.newest == U:
                word = TriggerWord.BLIND
            else:
                word = TriggerWord.HOLDOFF if left else TriggerWord.ARMED
            assert (self.trigger.state(tick), self.trigger.holdoff_left(tick)) == (word, left)


class LimitMachine(RuleBasedStateMachine):
    """Two scalars are fed, looked at and acknowledged in any order; the model takes one sample after the other."""

    def __init__(self) -> None:
        super().__init__()
        self.tick = -1
        self.acknowledged: list[tuple[str, int, int] | None] = [None, None]
        self.stale_alarms = [False, False]

    @initialize(
        persistence=st.integers(1, 3), hysteresis=st.sampled_from([0.0, 3.0]), stale_ns=st.sampled_from([0, 2 * MS])
    )
    def it_is_set(self, persistence, hysteresis, stale_ns) -> None:
        its = LimitRule(-20, -10, 10, 20, persistence, hysteresis, stale_ns)
        self.limit, self.models = Limit(its, 2), [test_limits.Slow(its), test_limits.Slow(its)]

    @rule(
        rows=st.lists(
            st.tuples(*[st.sampled_from([0.0, 7.0, 9.0, 11.0, 17.0, 25.0, -7.0, -15.0, -21.0, float("nan")])] * 2),
            min_size=1, max_size=6,
        ),
        context=st.none() | st.lists(st.sampled_from([T, T, F, U]), min_size=6, max_size=6),
    )  # fmt: skip
    def samples_come(self, rows, context) -> None:
        ticks = self.tick + np.arange(1, len(rows) + 1)
        given = None if context is None else np.array(context[: len(rows)], np.int8)
        self.limit.feed(ticks, ticks * MS, np.array(rows), given)
        for at, tick in enumerate(ticks.tolist()):
            for entry, model in enumerate(self.models):
                stale = model.stale_count
                model.row(tick, rows[at][entry], None if context is None else context[at])
                self.stale_alarms[entry] |= model.stale_count > stale
        self.tick = int(ticks[-1])

    @rule(later=st.integers(0, 4))
    def time_goes_on_without_samples(self, later) -> None:
        now_ns, found = (self.tick + later) * MS, []
        for entry, model in enumerate(self.models):
            limit_ns = model.rule.stale_ns
            if limit_ns and not model.stale and model.fresh is not None and now_ns - model.fresh > limit_ns:
                model.stale = self.stale_alarms[entry] = True
                model.stale_count += 1
                found.append(entry)
        assert self.limit.check_stale(now_ns) == found

    @rule(who=st.sampled_from(["anna", "bob"]), entries=st.none() | st.sets(st.integers(0, 1)))
    def somebody_acknowledges(self, who, entries) -> None:
        seen = [
            entry
            for entry, model in enumerate(self.models)
            if (entries is None or entry in entries) and (model.alarm or self.stale_alarms[entry])
        ]
        told, new = self.limit.acknowledge(who, self.tick, entries), 0
        for entry in seen:
            model, note = self.models[entry], self.acknowledged[entry]
            count = len(model.violations) + model.stale_count
            new += max(1, count - (note[2] if note else 0))  # 1: one that was seen became worse
            model.alarm, self.stale_alarms[entry] = 0, False
            self.acknowledged[entry] = who, self.tick, count
        assert told == new

    @invariant()
    def it_stands_as_the_model_does(self) -> None:
        if not hasattr(self, "models"):
            return
        for state, model, stale, seen in zip(
            self.limit.states, self.models, self.stale_alarms, self.acknowledged, strict=True
        ):
            assert (state.level, state.alarm, state.count) == (model.level, model.alarm, len(model.violations))
            assert (state.stale, state.stale_count, state.stale_alarm) == (model.stale, model.stale_count, stale)
            assert state.is_open == (model.open is not None)
            note = state.acknowledged
            assert (note and (note.who, note.time_ns, note.count)) == seen


TestTriggers = TriggerMachine.TestCase
TestLimits = LimitMachine.TestCase
TestTriggers.settings = TestLimits.settings = settings(max_examples=examples(150), stateful_step_count=25)

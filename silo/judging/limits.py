"""Limits of signals, judged on every sample: red and yellow bounds in the words of COSMOS.

A violation of one sample is never missed: its peak and its time are kept, whatever the state shows. The state follows
after `persistence` samples in a row, and leaves a range only `hysteresis` inside of it, so that noise at a bound is one
alarm. It stays to be acknowledged after the value is well again.
"""

import enum
import math
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.arguments import real, shown, whole
from silo.core.arrays.values import EXACT
from silo.errors import ElementError
from silo.expressions.evaluation import TRUE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_PERSISTENCE = 1_000_000
_ORDER = "(red_low, yellow_low, yellow_high, red_high), None for a bound that there isn't"


class Level(enum.IntEnum):
    """Where a value is. The larger its distance from 0, the worse."""

    RED_LOW = -2
    YELLOW_LOW = -1
    GREEN = 0
    YELLOW_HIGH = 1
    RED_HIGH = 2


@dataclass(frozen=True)
class LimitRule:
    """Bounds of each scalar of a signal: a value at a bound is within it. Infinite where there is none.

    `persistence` samples in a row make a state (those beyond red are beyond yellow too), `hysteresis` is how far inside
    a bound it ends. `stale_ns`: no value that is new for so long is an alarm too; 0 for never.
    """

    red_low: float = -math.inf
    yellow_low: float = -math.inf
    yellow_high: float = math.inf
    red_high: float = math.inf
    persistence: int = 1
    hysteresis: float = 0.0
    stale_ns: int = 0

    def bound(self, level: Level) -> float:
        """Return the bound that a level is beyond, which is called like it; NaN within all."""
        return math.nan if level is Level.GREEN else float(getattr(self, level.name.lower()))

    def how_bad(self, violation: "Violation") -> tuple[int, float]:
        """Return what the worst of several has most of: red goes before yellow, then the farthest beyond its bound."""
        return abs(violation.worst), abs(violation.peak - self.bound(violation.worst))


def beside_bounds(values: NDArray[Any], rule: LimitRule) -> Floats:
    """Return integers as float64s that lie beyond the same bounds: no one beyond 2^53 is rounded to where it is not."""
    made: Floats = values.astype(np.float64, copy=False)
    if values.dtype.kind not in "iu" or not (np.abs(made) >= EXACT).any():
        return made
    for bound in (rule.red_low, rule.yellow_low, rule.yellow_high, rule.red_high):
        at = made == bound
        if at.any():
            sides = [(int(value) > bound) - (int(value) < bound) for value in values[at].tolist()]  # Python's are exact
            made[at] = np.choose(
                np.array(sides) + 1, (np.nextafter(bound, -np.inf), bound, np.nextafter(bound, np.inf))
            )
    return made


def limit_rule(
    bounds: object, persistence: int = 1, hysteresis: float = 0.0, stale_ns: int = 0, name: str = "limits"
) -> LimitRule:
    """Return the rule of four bounds as a program gives them. Raises ElementError."""
    given = list(bounds) if isinstance(bounds, tuple | list) else []
    if len(given) != 4 or all(bound is None for bound in given):
        raise ElementError(f"{name} must be {_ORDER}, got {shown(bounds)}; nothing was changed")
    each = f"each of {name} {_ORDER},"
    low = [-math.inf if bound is None else real(each, bound, -1e308, 1e308, "") for bound in given[:2]]
    high = [math.inf if bound is None else real(each, bound, -1e308, 1e308, "") for bound in given[2:]]
    # red alone: what goes beyond it goes beyond yellow there too
    yellow_low = low[0] if given[1] is None else low[1]
    yellow_high = high[1] if given[2] is None else high[0]
    if not low[0] <= yellow_low < yellow_high <= high[1]:
        raise ElementError(f"{name} must rise: {_ORDER}, got {shown(bounds)}; nothing was changed")
    return LimitRule(
        low[0], yellow_low, yellow_high, high[1], whole(f"persistence of {name}", persistence, 1, MOST_PERSISTENCE),
        real(f"hysteresis of {name}", hysteresis, 0, (yellow_high - yellow_low) / 2, ""), stale_ns,
    )  # fmt: skip


@dataclass(frozen=True)
class Violation:
    """Samples in a row (but for such as are not judged) of one scalar beyond a yellow bound.

    `worst` is the worst range it was in, `peak` the value farthest beyond, at `peak_tick`. `last_tick` is its newest
    sample, at `last_ns`; while `over` is False it may go on.
    """

    number: int
    entry: int
    worst: Level
    first_tick: int
    first_ns: int
    last_tick: int
    peak: float
    peak_tick: int
    peak_ns: int
    samples: int
    over: bool = False
    last_ns: int = 0

    def elsewhere(self) -> "Violation":
        """Return it as it is known where ticks count anew: its times tell where it was."""
        return replace(self, first_tick=-1, last_tick=-1, peak_tick=-1)


@dataclass(frozen=True)
class Acknowledgement:
    """Who has seen an alarm, when, and how many violations and stale times there were until then."""

    who: str
    time_ns: int
    count: int = 0


@dataclass
class EntryState:
    """How one scalar stands. `alarm` is the worst that is not acknowledged, GREEN where there is none; `acknowledged`
    the newest time that somebody saw one.
    """

    level: Level = Level.GREEN
    stale: bool = False
    count: int = 0  # violations so far
    violation: Violation | None = None  # the newest
    alarm: Level = Level.GREEN
    acknowledged: Acknowledgement | None = None
    since_tick: int = -1  # of the state
    # how many of the newest samples in a row are so; what is beyond red is beyond yellow too, opposite is on the other
    # side than the state
    beyond_yellow: int = 0
    beyond_red: int = 0
    within_red: int = 0
    within_yellow: int = 0
    opposite: int = 0
    fresh_ns: int | None = None  # when the value was new
    seen_ns: int = 0  # the newest sample's
    last: float = math.nan  # an integer as one, which is a float where another helper process goes on
    stale_count: int = 0
    stale_alarm: bool = False
    missing_ns: int = 0  # where it has no value now, since when; 0 where it never had one

    @property
    def is_open(self) -> bool:
        """Whether the newest violation may go on."""
        return self.violation is not None and not self.violation.over

    def edited(self) -> "EntryState":
        """Return it as it goes on under another rule: what there was stays to be seen, all else begins anew."""
        return EntryState(
            count=self.count, violation=self.violation and replace(self.violation, over=True), alarm=self.alarm,
            acknowledged=self.acknowledged, stale_count=self.stale_count, stale_alarm=self.stale_alarm,
            missing_ns=self.missing_ns,
        )  # fmt: skip

    def elsewhere(self) -> "EntryState":
        """Return it as it goes on where ticks count anew."""
        return replace(self, since_tick=-1, violation=self.violation and self.violation.elsewhere())


@dataclass
class Limit:
    """The limits of one signal of `width` scalars, over all its samples."""

    rule: LimitRule
    width: int = 1
    states: list[EntryState] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.states = [EntryState() for _ in range(self.width)]

    def feed(
        self, ticks: Ints, time_ns: Ints, values: NDArray[Any], context: NDArray[np.int8] | None = None
    ) -> list[Violation]:
        """Take the next samples in; returns the violations that began, grew or ended, as they are then.

        `values` has shape `(n,)` or `(n, width)`. Where a `context` is not TRUE nothing is judged, and what was pending
        begins anew; None: it always is. NaN samples are no value.
        """
        if not len(ticks):
            return []
        given = values.reshape(len(values), -1)
        columns = beside_bounds(given, self.rule)
        judged = None if context is None else context == TRUE
        found: list[Violation] = []
        for entry in self._stirred(columns, context):
            if self.rule.stale_ns:
                self._freshen(self.states[entry], time_ns, given[:, entry])
            found += self._feed_entry(entry, self.states[entry], ticks, time_ns, columns[:, entry], judged)
        return found

    def check_stale(self, now_ns: int) -> list[int]:
        """Return the scalars that have become stale by now: nothing new came for `stale_ns`."""
        return [entry for entry, state in enumerate(self.states) if self._check_stale(state, now_ns)]

    def acknowledge(self, who: str, time_ns: int, entries: Collection[int] | None = None) -> int:
        """Note that somebody has seen the alarms, of these scalars only if given; returns how many were new."""
        chosen = [state for at, state in enumerate(self.states) if entries is None or at in entries]
        alarms, new = [state for state in chosen if state.alarm or state.stale_alarm], 0
        for state in alarms:
            count, before = state.count + state.stale_count, state.acknowledged
            new += max(1, count - (before.count if before else 0))  # 1: one that was seen became worse
            state.alarm, state.stale_alarm = Level.GREEN, False
            state.acknowledged = Acknowledgement(who, time_ns, count)
        return new

    # ------------------------------------------------------------------------------------------------ the rules

    def _stirred(self, columns: Floats, context: Any) -> list[int]:
        """The scalars that must be looked at: nearly always all samples are green, and nothing waits for them."""
        if context is not None or self.rule.stale_ns:
            return list(range(self.width))
        # False too where there is a NaN
        green = (columns.min(axis=0) >= self.rule.yellow_low) & (columns.max(axis=0) <= self.rule.yellow_high)
        return [
            entry
            for entry, (state, quiet) in enumerate(zip(self.states, green.tolist(), strict=True))
            if not quiet or state.level or state.is_open  # as it is while any count goes on
        ]

    def _feed_entry(
        self, entry: int, state: EntryState, ticks: Ints, time_ns: Ints, values: Floats, judged: Any
    ) -> list[Violation]:
        # a NaN says nothing, what is out of context ends everything
        codes = np.where(np.isnan(values), _SKIP, self._levels(values))
        if judged is not None:
            codes = np.where(judged, codes, _OUT)
        starts = [0, *(np.flatnonzero(codes[1:] != codes[:-1]) + 1).tolist()]
        found: dict[int, Violation] = {}
        for start, stop in zip(starts, [*starts[1:], len(codes)], strict=True):
            code, run = int(codes[start]), slice(start, stop)
            if code == _SKIP:
                continue
            level = Level.GREEN if code == _OUT else Level(code)
            for changed in self._violate(entry, state, ticks[run], time_ns[run], values[run], level):
                found[changed.number] = changed
            if code == _OUT:
                self._move(state, Level.GREEN, int(ticks[start]))
                _count(state, Level.GREEN, 0)
            else:
                self._persist(state, ticks[run], values[run], level)
        return list(found.values())

    def _levels(self, values: Floats) -> NDArray[np.int8]:
        rule = self.rule
        high = (values > rule.yellow_high).astype(np.int8) + (values > rule.red_high)
        low = (values < rule.yellow_low).astype(np.int8) + (values < rule.red_low)
        return (high - low).astype(np.int8)

    def _violate(
        self, entry: int, state: EntryState, ticks: Ints, time_ns: Ints, values: Floats, level: Level
    ) -> list[Violation]:
        """Begin, go on with or end the violation by samples of one range."""
        changed = []
        before = state.violation if state.is_open else None
        if before is not None and before.worst * level <= 0:
            state.violation = replace(before, over=True)
            changed.append(state.violation)
            before = None
        if level is Level.GREEN:
            return changed
        at = int(np.argmax(values)) if level > 0 else int(np.argmin(values))
        peak, peak_tick, peak_ns = float(values[at]), int(ticks[at]), int(time_ns[at])
        if before is None:
            state.count += 1
            state.violation = Violation(
                state.count, entry, level, int(ticks[0]), int(time_ns[0]), int(ticks[-1]), peak, peak_tick, peak_ns,
                len(ticks), last_ns=int(time_ns[-1]),
            )  # fmt: skip
        else:
            if peak <= before.peak if level > 0 else peak >= before.peak:
                peak, peak_tick, peak_ns = before.peak, before.peak_tick, before.peak_ns
            state.violation = replace(
                before, worst=max(before.worst, level, key=abs), last_tick=int(ticks[-1]), peak=peak,
                peak_tick=peak_tick, peak_ns=peak_ns, samples=before.samples + len(ticks),
                last_ns=int(time_ns[-1]),
            )  # fmt: skip
        return [*changed, state.violation]

    def _persist(self, state: EntryState, ticks: Ints, values: Floats, level: Level) -> None:
        """Change the state after enough samples in a row that ask for it, by samples of one range."""
        at = 0
        while at < len(ticks):
            held = self._held(state.level, level, values[at:])
            changes = np.flatnonzero(held[1:] != held[:-1])
            count = int(changes[0]) + 1 if len(changes) else len(held)
            # what is still within the hysteresis of a state agrees with it
            counted = state.level if held[0] else level
            moves_to, after = self._next_move(state, counted)
            taken = min(count, after)
            _count(state, counted, taken)
            at += taken
            if after <= count:
                self._move(state, moves_to, int(ticks[at - 1]))

    def _next_move(self, state: EntryState, level: Level) -> tuple[Level, int]:
        """Which state samples of this level lead to next, and how many of them it takes; very many: to none."""
        now, size, side = abs(state.level), abs(level), -1 if level < 0 else 1
        needed = self.rule.persistence
        found: list[tuple[int, Level]] = []
        if size == 2 and (now < 2 or level * state.level < 0):
            found.append((needed - state.beyond_red, level))
        if size and not now:
            found.append((needed - state.beyond_yellow, Level(side)))
        if level * state.level < 0:
            found.append((needed - state.opposite, Level(side)))
        if now == 2 and size < 2:
            found.append((needed - state.within_red, Level(state.level // 2)))
        if now and not size:
            found.append((needed - state.within_yellow, Level.GREEN))
        if not found:
            return state.level, _NEVER
        # of two that are due at once the one that goes farther
        after, moves_to = min(found, key=lambda one: (max(one[0], 1), -abs(one[1] - state.level)))
        return moves_to, max(after, 1)

    def _held(self, state: Level, level: Level, values: Floats) -> NDArray[np.bool_]:
        """Where values that are less bad than the state are still within its hysteresis."""
        rule = self.rule
        if not rule.hysteresis or abs(level) >= abs(state) or level * state < 0:
            return np.zeros(len(values), bool)
        low, high = (rule.red_low, rule.red_high) if abs(state) == 2 else (rule.yellow_low, rule.yellow_high)
        held: NDArray[np.bool_] = values > high - rule.hysteresis if state > 0 else values < low + rule.hysteresis
        return held

    def _move(self, state: EntryState, level: Level, tick: int) -> None:
        if level is state.level:
            return
        state.level, state.since_tick, state.opposite = level, tick, 0
        if abs(level) > abs(state.alarm):
            state.alarm = level

    def _freshen(self, state: EntryState, time_ns: Ints, values: NDArray[Any]) -> None:
        """Note when values were new, and how often one came too late. A clock that is set back makes none younger."""
        there = ~np.isnan(values)
        begin_ns = int(time_ns[0])
        if state.fresh_ns is None:
            state.fresh_ns = state.seen_ns = begin_ns
        state.fresh_ns -= max(0, state.seen_ns - begin_ns)
        steps = np.diff(time_ns, prepend=begin_ns)
        back_ns = np.cumsum(np.where(steps < 0, -steps, 0))
        time_ns = time_ns + back_ns  # as the clock had gone on
        known = values[there]
        like = float if isinstance(state.last, float) else int  # Python's integers are exact
        is_new = np.array([like(one) != state.last for one in known[:1].tolist()], bool)
        stamps = time_ns[there][np.concatenate([is_new, known[1:] != known[:-1]])]
        if len(stamps):
            late = np.diff(stamps, prepend=state.fresh_ns) > self.rule.stale_ns
            self._note_stale(state, int(late.sum()) - int(state.stale and late[0]))
            state.fresh_ns, state.stale = int(stamps[-1]), False
        if len(known):
            state.last = known[-1].item()
        state.fresh_ns -= int(back_ns[-1])
        state.seen_ns = int(time_ns[-1] - back_ns[-1])
        self._check_stale(state, state.seen_ns)

    def _check_stale(self, state: EntryState, now_ns: int) -> bool:
        rule = self.rule
        if not rule.stale_ns or state.stale or state.fresh_ns is None:
            return False
        state.fresh_ns = min(state.fresh_ns, now_ns)
        if now_ns - state.fresh_ns <= rule.stale_ns:
            return False
        state.stale = True
        self._note_stale(state, 1)
        return True

    def _note_stale(self, state: EntryState, times: int) -> None:
        if times:
            state.stale_count += times
            state.stale_alarm = True


def _count(state: EntryState, level: Level, samples: int) -> None:
    """Count samples of one level in; 0 of them: nothing is counted any more."""
    size = abs(level) if samples else -1
    state.beyond_yellow = state.beyond_yellow + samples if size >= 1 else 0
    state.beyond_red = state.beyond_red + samples if size == 2 else 0
    state.within_red = state.within_red + samples if 0 <= size < 2 else 0
    state.within_yellow = state.within_yellow + samples if size == 0 else 0
    state.opposite = state.opposite + samples if level * state.level < 0 and samples else 0


_NEVER = 2**62
# beside the levels: out of context, and no value
_OUT, _SKIP = 9, 8

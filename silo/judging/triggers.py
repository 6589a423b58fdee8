"""When a trigger fires, and which ticks its captures hold: rules on results of conditions, exact to the tick.

The words are those of oscilloscopes and of NI-DAQmx reference triggers. Ticks are nominal: clocks may jump, ticks
don't. Results come in batches of any size; what comes out is the same.
"""

import enum
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from silo.core.conditions import TriggerWord
from silo.core.elements import BufferType, ElementInfo
from silo.errors import ElementError
from silo.expressions.evaluation import FALSE, TRUE, UNOBSERVABLE

# of rows: they stay in memory until the capture is whole, and twice while it is written
MOST_CAPTURE_BYTES = 256 * 2**20
NO_END = 2**62
SLACK_S = 1.0  # what a ring must hold beyond `pre`, so that a late judge still finds the oldest row

Codes = NDArray[np.int8]
Ints = NDArray[np.int64]


class Slope(str, enum.Enum):
    """What fires: the condition turns true, turns false, or is true. `enter` and `leave` are the first two."""

    RISING = "rising"
    FALLING = "falling"
    LEVEL = "level"

    @classmethod
    def _missing_(cls, value: object) -> "Slope | None":
        return {"enter": cls.RISING, "leave": cls.FALLING}.get(str(value))


class TriggerMode(str, enum.Enum):
    """NORMAL captures each fire, SINGLE one and then disarms, AUTO captures without a fire too when none comes."""

    NORMAL = "normal"
    SINGLE = "single"
    AUTO = "auto"


@dataclass(frozen=True)
class TriggerRule:
    """What a trigger does, all times in ticks.

    It fires where its condition has turned true and stayed so for `persist` ticks, and captures `[k - pre, k + post]`.
    Then it must rearm: by its rearm condition, or, without, by the condition having been false. Within `holdoff` ticks
    after a fire, turns are ignored. In AUTO mode it fires by itself `patience` ticks after the end of a capture. A fire
    within `post` extends the capture, up to `longest` ticks: then it begins the next one, and no tick is in neither.
    """

    pre: int
    post: int
    slope: Slope = Slope.RISING
    persist: int = 0
    holdoff: int = 0
    mode: TriggerMode = TriggerMode.NORMAL
    patience: int = 0
    longest: int = NO_END


@dataclass(frozen=True)
class Fire:
    """A trigger fired at a tick; `forced` where its condition did not say so."""

    tick: int
    time_ns: int
    forced: bool = False


@dataclass(frozen=True)
class Capture:
    """Ticks `first ... last` around the fires in it, both included; `full` where the next one had to go on."""

    number: int
    first: int
    last: int
    fires: tuple[Fire, ...]
    full: bool = False


@dataclass
class Trigger:
    """A trigger over the results of its conditions."""

    rule: TriggerRule
    armed: bool = True
    captures: int = 0  # begun so far
    fires: int = 0
    capture: Capture | None = None  # the newest one; more fires may extend it
    before: Capture | None = None  # the one before it
    ready: bool = True  # rearmed since the last fire
    turned: bool = False  # the condition turned true while that counted
    known: int = UNOBSERVABLE  # the last result that was one
    now: int = UNOBSERVABLE
    seen: bool = False  # a result, be it that nobody can tell
    since: int | None = None  # from when on it is true without a break
    holdoff_end: int = 0
    patient_until: int | None = None
    tick: int = -1  # the newest that was judged
    fired: list[Fire] = field(default_factory=list)  # by the last batch, or by force
    _new: list[Capture] = field(default_factory=list)

    def feed(self, ticks: Ints, time_ns: Ints, condition: Codes, rearm: Codes | None = None) -> list[Capture]:
        """Take the next results in; returns the captures that began or grew, each as it is at the end of the batch.

        `condition` and `rearm` hold TRUE, FALSE, UNOBSERVABLE at each tick; `rearm` None: there is no such condition.
        """
        self._new, self.fired = [], []
        if not len(ticks):
            return []
        if self.rule.slope is Slope.FALLING:
            condition = np.where(condition == UNOBSERVABLE, condition, 1 - condition).astype(np.int8)
        changes = condition[1:] != condition[:-1]
        if rearm is not None:
            changes |= rearm[1:] != rearm[:-1]
        starts = [0, *(np.flatnonzero(changes) + 1).tolist()]
        for start, stop in zip(starts, [*starts[1:], len(ticks)], strict=True):
            self._stretch(ticks[start:stop], time_ns[start:stop], int(condition[start]),
                          None if rearm is None else int(rearm[start]))  # fmt: skip
        self.tick, self.now = int(ticks[-1]), int(condition[-1])
        return self._new

    def force(self, tick: int, time_ns: int) -> list[Capture]:
        """Fire now, whatever the condition says, armed or not. `tick` is not before the last that was judged."""
        self._new, self.fired = [], []
        self._fire(tick, time_ns, forced=True)
        return self._new

    def blind(self, tick: int) -> None:
        """Take in that up to this tick nothing could be told, and that there is nothing to tell it from."""
        self.now, self.since, self.tick = UNOBSERVABLE, None, tick

    def arm(self, tick: int) -> None:
        """Watch again from this tick on, also after the one capture of SINGLE mode."""
        if not self.armed:
            self.armed, self.ready = True, True
            self.turned, self.patient_until = False, None
            self.holdoff_end = tick

    def disarm(self) -> None:
        """Fire no more until `arm`. A capture that began goes on."""
        self.armed, self.turned = False, False

    def state(self, tick: int) -> TriggerWord:
        """What it does at a tick, fit to show."""
        if self.capture is not None and tick <= self.capture.last:
            return TriggerWord.FIRING
        if not self.armed:
            return TriggerWord.OFF
        if self.now == UNOBSERVABLE and self.tick >= 0:
            return TriggerWord.BLIND
        return TriggerWord.HOLDOFF if tick < self.holdoff_end else TriggerWord.ARMED

    def holdoff_left(self, tick: int) -> int:
        """Return for how many ticks from this one on turns are ignored."""
        return max(self.holdoff_end - tick, 0)

    def shifted(self, ticks: int) -> "Trigger":
        """Return it as it goes on where ticks count anew, `ticks` after they did before.

        Of its captures is known when the newest fired: they are over, and what still lasts begins another one.
        """
        end, until, known = self.holdoff_end, self.patient_until, self.capture
        if known is not None:
            fire = known.fires[-1]
            # only the holdoff lasts: not until the end of a capture that is over, nor anew in each part that follows
            end = min(end, fire.tick + self.rule.holdoff) if self.rule.slope is Slope.LEVEL else end
            known = replace(known, first=-1, last=-1, fires=(replace(fire, tick=-1),))
        return replace(
            self, capture=known, before=None, tick=-1, fired=[], _new=[], holdoff_end=max(end - ticks, 0),
            since=None if self.since is None else self.since - ticks,
            patient_until=None if until is None else until - ticks,
        )  # fmt: skip

    # ----------------------------------------------------------------------------------------------- the rules

    def _stretch(self, ticks: Ints, time_ns: Ints, condition: int, rearm: int | None) -> None:
        """Take in ticks at all of which the results are these."""
        level = self.rule.slope is Slope.LEVEL
        rearms = (condition == FALSE or level) if rearm is None else rearm == TRUE
        self.ready = self.ready or rearms
        if condition != TRUE:
            self.since = None
            if condition == FALSE:
                self.turned = False
        elif self.since is None:
            self.since = int(ticks[0])
            counts = self.armed and self.ready and self.since >= self.holdoff_end
            # what nobody could tell before may have been false: a fire too many is better than one that is missed
            unknown = self.known == UNOBSERVABLE and self.seen
            self.turned = self.turned or level or ((self.known == FALSE or unknown) and counts)
        self.seen = True
        if condition != UNOBSERVABLE:
            self.known = condition
        if self.rule.mode is TriggerMode.AUTO and self.patient_until is None:
            self.patient_until = int(ticks[0]) + self.rule.patience
        at = 0
        while at < len(ticks):
            by_condition = self._next_fire(ticks) if condition == TRUE else len(ticks)
            by_patience = self._next_by_patience(ticks)
            at = max(at, min(by_condition, by_patience))
            if at >= len(ticks):
                return
            self._fire(int(ticks[at]), int(time_ns[at]), forced=by_patience < by_condition)
            at += 1
            if at < len(ticks):
                self.ready = self.ready or rearms
                ticks, time_ns, at = ticks[at:], time_ns[at:], 0

    def _next_fire(self, ticks: Ints) -> int:
        if not (self.armed and self.ready and (self.turned or self.rule.slope is Slope.LEVEL)):
            return len(ticks)
        assert self.since is not None
        return int(np.searchsorted(ticks, max(self.since + self.rule.persist, self.holdoff_end)))

    def _next_by_patience(self, ticks: Ints) -> int:
        if self.patient_until is None or not self.armed:
            return len(ticks)
        return int(np.searchsorted(ticks, self.patient_until))

    def _fire(self, tick: int, time_ns: int, *, forced: bool) -> None:
        rule = self.rule
        fire, last = Fire(tick, time_ns, forced), tick + rule.post
        open_now = self.capture
        goes_on = open_now is not None and tick <= open_now.last
        if open_now is not None and goes_on and last - open_now.first < rule.longest:
            self.capture = replace(open_now, last=last, fires=(*open_now.fires[:999], fire))
        else:
            if open_now is not None and goes_on:
                open_now = replace(open_now, full=True)
                self._note(open_now)
            self.captures += 1
            self.before = open_now
            self.capture = Capture(self.captures, max(tick - rule.pre, 0), last, (fire,))
        self._note(self.capture)
        self.fired.append(fire)
        self.fires += 1
        self.patient_until = last + 1 + rule.patience if rule.mode is TriggerMode.AUTO else None
        if rule.mode is TriggerMode.SINGLE:
            self.disarm()
        # what lasts is captured end to end, not as one capture without end
        self.holdoff_end = tick + max(rule.holdoff, rule.post + 1 if rule.slope is Slope.LEVEL else 0)
        if not forced:
            self.ready, self.turned = False, False

    def _note(self, capture: Capture) -> None:
        if self._new and self._new[-1].number == capture.number:
            self._new[-1] = capture
        else:
            self._new.append(capture)


def longest_capture(bytes_per_tick: float) -> int:
    """Return how many ticks a capture may have, by the bytes that rows take per tick."""
    return max(1, int(MOST_CAPTURE_BYTES // max(bytes_per_tick, 1.0)))


def check_length(ticks: int, frequency_hz: float, bytes_per_tick: float) -> None:
    """Raise ElementError where a capture of so many ticks takes more memory than one may, with what would do."""
    longest = longest_capture(bytes_per_tick)
    if ticks > longest:
        raise ElementError(
            f"pre and post of {ticks / frequency_hz:g} s are {ticks * bytes_per_tick / 2**20:,.0f} MB, a capture "
            f"has at most {MOST_CAPTURE_BYTES // 2**20} MB: {longest / frequency_hz:.3g} s of these signals; make them "
            "shorter, save fewer signals, or record (`silo record`); nothing was changed"
        )


def longest_pre(frequency_hz: float, saved: Sequence[ElementInfo]) -> int | None:
    """Return the longest pre in ticks that all buffers hold with their slack, negative where they don't hold that.

    None where each is long enough. Left out is what keeps its first samples, as somebody wanted: no size would hold
    the past.
    """
    loops = [info.options for info in saved if info.options.buffer is BufferType.LOOPING]
    # two rows that may be under way in the slots of the oldest
    held = ((each.size - 2) * each.divider for each in loops)
    return min(held) - round(SLACK_S * frequency_hz) if loops else None


def check_pre(pre: int, frequency_hz: float, saved: Sequence[ElementInfo]) -> None:
    """Raise ElementError where buffers can't hold `pre` ticks with their slack, and the size, or pre, that would."""
    longest = longest_pre(frequency_hz, saved)
    if longest is None or pre <= longest:
        return
    problems = []
    for info in saved:
        size, divider = info.options.size, info.options.divider
        needed = -(-(pre + round(SLACK_S * frequency_hz)) // divider) + 2
        if info.options.buffer is BufferType.LOOPING and size < needed:
            spans = f"{size} samples, {size * divider / frequency_hz:.4g} s at divider {divider}"
            problems.append(f"'{info.name}' holds {spans}: set size={needed}")
    more = f", and {len(problems) - 3} more" if len(problems) > 3 else ""
    held_by_all = f" (all hold pre={longest / frequency_hz:.6g}s)" if longest >= 0 else ""
    raise ElementError(
        f"too short for pre of {pre / frequency_hz:g} s{held_by_all}: {'; '.join(problems[:3])}{more}; a capture has "
        f"all that is saved, of which buffers hold {SLACK_S:g} s more than pre until it is judged; nothing was changed"
    )

"""How triggers and limits of a logger stand: what its helper process tells of them."""

import math

import msgspec

from silo.core.conditions import Bounds, LimitOptions, SignalLimits, TriggerOptions, TriggerWord
from silo.core.elements import Word


class CapturedSpan(msgspec.Struct, frozen=True, omit_defaults=True):
    """Ticks `first` to `last` around the fire at `tick`, with its time stamp; `forced` where no condition fired."""

    number: int
    first: int
    last: int
    tick: int
    time_ns: int
    forced: bool = False


class TriggerStatus(msgspec.Struct, frozen=True, omit_defaults=True):
    """One trigger. `fires` and `captures` count those of this run; `why` tells why it is blind.

    `last_tick` and `last_ns` are of the last fire, -1 and 0 where there was none; `files` those of its newest capture.
    `whole` is the newest capture that has all its ticks. `owner` is the client that holds it under a lease.
    `capturing_s` is how much the capture that is under way holds so far.
    """

    options: TriggerOptions
    state: TriggerWord
    fires: int = 0
    captures: int = 0
    last_tick: int = -1
    last_ns: int = 0
    holdoff_s: float = 0.0
    why: str = ""
    files: tuple[str, ...] = ()
    whole: CapturedSpan | None = None
    owner: str = ""
    capturing_s: float = 0.0


class LimitWord(Word):
    """Where a value is now."""

    RED_HIGH = "HH"
    YELLOW_HIGH = "H"
    YELLOW_LOW = "L"
    RED_LOW = "LL"
    STALE = "=="
    OK = "OK"
    BLIND = "~~"
    OTHER = "?"

    @property
    def is_over(self) -> bool:
        """Whether a limit is violated."""
        return self not in (LimitWord.OK, LimitWord.BLIND, LimitWord.OTHER)

    @property
    def is_red(self) -> bool:
        """Whether an outer bound is violated."""
        return abs(SIDES.get(self, 0)) == 2

    @property
    def rank(self) -> tuple[bool, bool, int]:
        """What sorts the worst first: red before yellow before stale before what is well, blind last."""
        return not self.is_over, self is LimitWord.BLIND, -abs(SIDES.get(self, 0))


_BOUND_WORDS = LimitWord.RED_LOW, LimitWord.RED_HIGH, LimitWord.YELLOW_LOW, LimitWord.YELLOW_HIGH
SIDES = dict(zip((*_BOUND_WORDS, LimitWord.OK), (-2, 2, -1, 1, 0), strict=True))


def reach_of(bounds: Bounds) -> float:
    """Return the range between the bounds that are met first, or how large the only one is; 0 without any."""
    red_low, low, high, red_high = bounds
    met = [each for each in (red_low if low is None else low, red_high if high is None else high) if each is not None]
    return abs(met[-1] - met[0]) if len(met) > 1 else abs(met[0]) if met else 0.0


class LimitStatus(LimitOptions, frozen=True, omit_defaults=True):
    """One scalar with limits, and what it is held against. `limits` is the name that they were given to.

    `limit` is the bound that is or was violated worst, and `worst` the value farthest beyond, `worst_word` the range it
    was in; None where no bound ever was. `count` and `stale_count` count violations and stale times of this run,
    `samples` the samples of the newest violation. `alarm`: it was violated, and nobody has acknowledged that; `seen_by`
    tells who acknowledged one last, `since_seen` how many violations and stale times began since. `since_ns` is when
    the newest violation began.
    """

    name: str
    limits: str
    word: LimitWord
    unit: str = ""
    value: float | None = None
    limit: float | None = None
    worst: float | None = None
    worst_word: LimitWord = LimitWord.OK
    worst_tick: int = -1
    worst_ns: int = 0
    since_tick: int = -1
    since_ns: int = 0
    last_ns: int = 0
    count: int = 0
    samples: int = 0
    stale_count: int = 0
    alarm: bool = False
    seen_by: str = ""
    why: str = ""
    since_seen: int = 0

    @property
    def seen(self) -> str:
        """Who has seen it, and how often it came again since; NEW where nobody has, or it became worse since."""
        if not self.alarm:
            return self.seen_by
        return f"{self.seen_by}, {self.since_seen} since" if self.since_seen else "NEW"

    @property
    def options(self) -> SignalLimits:
        """The limits that were given."""
        return SignalLimits(self.limits, **{name: getattr(self, name) for name in LimitOptions.__struct_fields__})

    def given(self, options: SignalLimits) -> "LimitStatus":
        """Return it with the limits that were given."""
        given = msgspec.structs.asdict(options)
        return msgspec.structs.replace(self, limits=given.pop("name"), **given)

    @property
    def violated(self) -> bool:
        """Whether it was in this run, if only for one sample."""
        return self.count > 0 or self.stale_count > 0

    @property
    def is_over(self) -> bool:
        """Whether it is now."""
        return self.word.is_over

    def lasted_s(self, now_ns: int) -> float | None:
        """Return for how long the newest violation has been going on, or lasted, s; None where there was none."""
        if self.is_over:
            return (now_ns - self.since_ns) / 1e9 if self.since_ns else None
        is_known = self.count and self.last_ns >= self.since_ns > 0
        return max((self.last_ns - self.since_ns) / 1e9, 1e-3) if is_known else None

    def closest(self, value: float) -> tuple[LimitWord, float, float] | None:
        """Return the bound that a value meets first, or the outermost that it is beyond; None where there is none.

        Returns: the word of what is beyond it, itself, and how far inside of it the value is, negative beyond it.
        """
        left = [
            (word, bound, (value - bound) * (-1 if SIDES[word] > 0 else 1))
            for word, bound in zip(_BOUND_WORDS, self._outer_first, strict=True)
            if bound is not None
        ]
        beyond = [each for each in left if each[2] < 0]
        return max(beyond, key=lambda each: each[2]) if beyond else min(left, key=lambda each: each[2], default=None)

    def share_left(self, value: float) -> float:
        """Return how far inside the bound that it meets first a value is, as a share of the range between both, or of
        the only one; NaN where there is none.
        """
        found, reach = self.closest(value), reach_of(self.bounds)
        if found is None:
            return math.nan
        return found[2] / reach if reach else math.copysign(math.inf, found[2]) if found[2] else 0.0

    @property
    def bound(self) -> float | None:
        """The bound that its word is about; None where that is about none."""
        return dict(zip(_BOUND_WORDS, self._outer_first, strict=True)).get(self.word)

    @property
    def is_back(self) -> bool:
        """Whether it is over a bound that its newest value is not beyond any more, as by its hysteresis."""
        if self.bound is None or self.value is None:
            return False
        return (self.value - self.bound) * SIDES[self.word] <= 0

    @property
    def _outer_first(self) -> Bounds:
        red_low, low, high, red_high = self.bounds
        return red_low, red_high, low, high

    def word_of(self, value: float) -> LimitWord:
        """Return the range of a value that is newer than what was judged; what was, where more than it tells that."""
        bounded = any(bound is not None for bound in self.bounds)
        if self.word not in SIDES or self.persistence > 1 or self.when or not bounded:
            return self.word
        side = SIDES[self.word]
        for word, bound in zip(_BOUND_WORDS, self._outer_first, strict=True):
            its = SIDES[word]
            slack = self.hysteresis if its * side > 0 and abs(its) <= abs(side) else 0.0
            if bound is not None and (value - bound) * (1 if its > 0 else -1) > -slack:
                return word
        return LimitWord.OK


def worst_first(found: list[LimitStatus]) -> list[LimitStatus]:
    """Return alarms in the order to look at: red before yellow, not seen before seen, newest first, blind ones last."""
    return sorted(found, key=lambda one: (one.word.rank, not one.alarm, not one.violated, -one.since_ns, one.name))

"""Limits judged on every sample of a run: states, worst values, and words for clients.

Belongs to the judge thread. Nearly always all is green: signals of one ring are looked at together, by one minimum and
one maximum per batch, and only what is not green, or was not, is judged sample by sample.
"""

import math
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.conditions.rows import JudgedRows
from silo.conditions.standing import LimitStatus, LimitWord
from silo.core.arrays.values import EXACT
from silo.core.conditions import SignalLimits
from silo.core.names import grouped
from silo.core.quantities.writing import EPOCH_FROM_NS, many, wall_clock
from silo.errors import ElementError
from silo.expressions.binding import OFF, BoundExpression, BoundSignal, ScalarPlace, means_else
from silo.expressions.evaluation import Evaluator, EvaluatorMemory, SourceRows
from silo.judging.checks import bind_limits, scalar_names
from silo.judging.limits import EntryState, Floats, Level, Limit, LimitRule, Violation, beside_bounds

TELL_AGAIN_S = 1.0  # a scalar that flutters is one event in so long
MOST_NEWS = 20  # events of one look; the others wait for the next ones
MOST_LAST_NEWS = 1000  # events of the last look

_WORDS = {level: LimitWord.OK if level is Level.GREEN else LimitWord[level.name] for level in Level}


@dataclass
class ScalarMemory:
    """What is kept of a scalar beside its state: the worst of its violations, and what clients were told.

    `untold` is the worst that they know nothing of, or that became worse than they know; `told` the range that they
    were told of last, `going` what became since of one that they know.
    """

    name: str
    worst: Violation | None = None
    untold: Violation | None = None
    going: Violation | None = None
    told: Level = Level.GREEN
    told_peak: int = -1  # its tick
    told_count: int = 0
    told_stale: int = 0
    told_s: float = -math.inf
    told_over: bool = False
    begun: int = 0  # the newest violation that began, with the worst range it has been in
    begun_worst: Level = Level.GREEN

    def fires(self, violation: Violation) -> bool:
        """Note a violation; returns whether it began just now, or became worse."""
        before = self.begun_worst if violation.number == self.begun else Level.GREEN
        self.begun, self.begun_worst = violation.number, violation.worst
        return abs(violation.worst) > abs(before)

    def elsewhere(self) -> "ScalarMemory":
        """Return it as it goes on where ticks count anew."""
        worst, untold, going = (one and one.elsewhere() for one in (self.worst, self.untold, self.going))
        return replace(self, worst=worst, untold=untold, going=going, told_peak=-1)


@dataclass
class LimitMemory:
    """What is kept of the limits of one signal, to go on elsewhere."""

    options: SignalLimits
    scalars: list[ScalarMemory]
    states: list[EntryState]
    newest: np.ndarray
    evaluator: EvaluatorMemory | None


@dataclass
class _Limited:
    """The limits of one signal. Without an evaluator its columns are those of one ring, and no context."""

    options: SignalLimits
    why: str = ""
    scalars: list[ScalarMemory] = field(default_factory=list)
    unit: str = ""
    limit: Limit = field(default_factory=lambda: Limit(LimitRule()))
    expressions: tuple[BoundExpression, ...] = ()
    evaluator: Evaluator | None = None
    newest: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    stirred: bool = False  # not all of it is green, or was
    silent: str = ""  # why nothing of it is recorded any more
    fired: str = ""  # what it was that fired first since that was asked for
    known: LimitMemory | None = None  # of one that can't be judged now, from when it could

    def columns(self) -> list[ScalarPlace]:
        return [column for bound in self.expressions for column in bound.columns]

    def note_newest(self, time_ns: NDArray[np.int64], values: Floats) -> None:
        """Keep the newest values; of one that is none, since when there is none."""
        before, self.newest = self.newest, values[-1]
        for at in np.flatnonzero(np.isnan(self.newest)).tolist():
            known = np.flatnonzero(~np.isnan(values[:, at]))
            if len(known) or not math.isnan(before[at]):
                self.limit.states[at].missing_ns = int(time_ns[known[-1] + 1 if len(known) else 0])

    def take(self, found: Sequence[Violation]) -> None:
        how_bad = self.limit.rule.how_bad
        for violation in found:
            scalar = self.scalars[violation.entry]
            if scalar.fires(violation) and not self.fired:
                self.fired = _violation_text(self, scalar, violation)
            worst = scalar.worst
            if worst is None or worst.number == violation.number or how_bad(violation) > how_bad(worst):
                scalar.worst = violation
            if violation.number <= scalar.told_count and abs(violation.worst) <= abs(scalar.told):
                scalar.going = violation
                continue
            waits = scalar.untold
            if waits is None or waits.number == violation.number or how_bad(violation) > how_bad(waits):
                scalar.untold = violation
        self.stirred = bool(self.limit.rule.stale_ns) or any(
            state.level or state.beyond_yellow or state.is_open for state in self.limit.states
        )


@dataclass(frozen=True)
class LimitNews:
    """What clients must be told of a scalar: whether it is beyond its limits (else well again), in words, and where.

    `tick` is that of the worst sample, or of the first that is well; -1 where there is none.
    """

    over: bool
    text: str
    tick: int = -1
    stamp_ns: int = 0
    times: int = 1


class _Together:
    """Plain limits whose signals have their samples in one ring."""

    def __init__(self, limited: list[_Limited]) -> None:
        self.limited = limited
        self.keys = [(column.element, column.entry) for one in limited for column in one.columns()]
        widths = [len(one.scalars) for one in limited]
        self.starts = np.concatenate([[0], np.cumsum(widths)[:-1]]).astype(np.intp)
        self.low = np.repeat([one.limit.rule.yellow_low for one in limited], widths)
        self.high = np.repeat([one.limit.rule.yellow_high for one in limited], widths)

    def feed(self, rows: SourceRows) -> None:
        if not len(rows.ticks):
            return
        block = np.stack([rows.columns[key].astype(np.float64, copy=False) for key in self.keys], axis=1)
        low, high = block.min(axis=0), block.max(axis=0)
        is_wide = np.fmax.reduce(np.fmax(high, -low)) >= EXACT
        if is_wide:
            low, high = self._to_the_last_digit(rows, block)
        # False too where there is a NaN
        green = (low >= self.low) & (high <= self.high)
        quiet = np.logical_and.reduceat(green, self.starts).tolist()
        for one, is_quiet, start in zip(self.limited, quiet, self.starts.tolist(), strict=True):
            stop = start + len(one.scalars)
            if is_quiet:
                one.newest = block[-1, start:stop]
            else:
                one.note_newest(rows.time_ns, block[:, start:stop])
            if not is_quiet or one.stirred:
                values = block[:, start:stop]
                if is_wide and one.limit.rule.stale_ns:
                    values = np.stack([rows.columns[key] for key in self.keys[start:stop]], axis=1)
                one.take(one.limit.feed(rows.ticks, rows.time_ns, values))

    def _to_the_last_digit(self, rows: SourceRows, block: Floats) -> tuple[Floats, Floats]:
        for one, start in zip(self.limited, self.starts.tolist(), strict=True):
            for place in range(start, start + len(one.scalars)):
                block[:, place] = beside_bounds(rows.columns[self.keys[place]], one.limit.rule)
        return block.min(axis=0), block.max(axis=0)


class LimitJudge:
    """All limits of one run."""

    def __init__(self, rows: JudgedRows) -> None:
        self._rows = rows
        self._limited: dict[str, _Limited] = {}
        self._together: dict[int, _Together] = {}

    def adopt(self, limits: Iterable[SignalLimits], problems: list[str], since: int = 0, *, anew: bool = False) -> None:
        """Judge these from tick `since` on; those that stay the same go on as they are.

        With other derived signals than before (`anew`) the same words may mean something else.
        """
        before = self._limited
        self._limited = {}
        for options in limits:
            known = before.get(options.name)
            if known is None or known.options != options or (anew and self._means_else(known)):
                known = _keeping_alarms(self._begun(options, problems, since), known)
            self._limited[options.name] = known
        simple = [one for one in self._limited.values() if one.evaluator is None and not one.why]
        by_ring = grouped((one.expressions[0].columns[0].source, one) for one in simple)
        self._together = {ring: _Together(limited) for ring, limited in by_ring.items()}

    def _means_else(self, known: _Limited) -> bool:
        return means_else(known.expressions, lambda: bind_limits(known.options, self._rows.catalogue)[1])

    def _begun(self, options: SignalLimits, problems: list[str], since: int) -> _Limited:
        catalogue = self._rows.catalogue
        try:
            rule, expressions = bind_limits(options, catalogue)
        except ElementError as error:
            problems.append(f"limits of '{options.name}' are not judged: {error}")
            return _Limited(options, str(error), [ScalarMemory(options.name)])
        signal = expressions[0]
        scalars = [ScalarMemory(name) for name in scalar_names(signal, catalogue, options.name)]
        if not signal.sources or any(bound.columns and not bound.sources for bound in expressions):
            off = ", ".join(self._rows.off_names(expressions)[:3])
            problems.append(f"limits of '{options.name}' are blind: {off} is off")
            return _Limited(options, f"{off} is off", scalars, signal.unit)
        others = (bound for one in self._limited.values() for bound in one.expressions)
        if no_room := self._rows.no_room(expressions, others):
            problems.append(f"limits of '{options.name}' are not judged: {no_room}")
            return _Limited(options, no_room, scalars, signal.unit)
        sources = {column.source for column in signal.columns}
        plain = (
            len(expressions) == 1 and isinstance(signal.root, BoundSignal) and len(sources) == 1 and OFF not in sources
        )
        evaluator = None if plain else self._rows.begin(expressions, Evaluator(*expressions, whole=True), since)
        return _Limited(
            options, "", scalars, signal.unit, Limit(rule, len(scalars)), expressions, evaluator,
            np.full(len(scalars), np.nan), bool(rule.stale_ns),
        )  # fmt: skip

    def memory(self) -> list[LimitMemory]:
        """Return what it remembers."""
        found = [
            one.known
            if one.why
            else LimitMemory(
                one.options,
                one.scalars,
                one.limit.states,
                one.newest,
                one.evaluator.memory() if one.evaluator else None,
            )
            for one in self._limited.values()
        ]
        return [one for one in found if one is not None]

    def recall(self, memory: Iterable[LimitMemory]) -> None:
        """Go on where another one stood. Raises ValueError."""
        for kept in memory:
            one = self._limited.get(kept.options.name)
            if one is not None and one.why and one.options == kept.options:
                one.known = kept
            if one is None or one.why or one.options != kept.options or len(kept.states) != len(one.scalars):
                continue
            one.scalars, one.limit.states, one.newest = kept.scalars, kept.states, kept.newest
            if one.evaluator is not None and kept.evaluator is not None:
                one.evaluator.recall(kept.evaluator)
            one.take(())

    def follow(self, before: "LimitJudge") -> None:
        """Go on after a cut of the run that `before` judged: alarms stay, and who has seen them; ticks count anew."""
        self.recall(
            replace(
                kept,
                scalars=[scalar.elsewhere() for scalar in kept.scalars],
                states=[state.elsewhere() for state in kept.states],
                evaluator=None,
            )
            for kept in before.memory()
        )
        for name, one in self._limited.items():
            if one.known is not None:  # of what is off for a while no new value can come
                one.known.states = [replace(state, fresh_ns=None) for state in one.known.states]
            known = before._limited.get(name)
            if known is None:
                continue
            if known.options != one.options:
                _keeping_alarms(one, known)
                one.scalars = [scalar.elsewhere() for scalar in one.scalars]
                one.limit.states = [state.elsewhere() for state in one.limit.states]
            else:
                self._rows.go_on(one.expressions, one.evaluator, before._rows, known.expressions, known.evaluator)

    @property
    def active(self) -> bool:
        """Whether there is any limit."""
        return bool(self._limited)

    @property
    def columns(self) -> list[ScalarPlace]:
        """What must be read for them."""
        return [column for one in self._limited.values() if not one.why for column in one.columns()]

    def feed(self, rows: Mapping[int, SourceRows]) -> None:
        """Judge the next rows of each ring."""
        for ring, together in self._together.items():
            together.feed(rows[ring])
        for one in self._limited.values():
            if one.evaluator is not None:
                self._evaluate(one, one.evaluator, rows)

    def _evaluate(self, one: _Limited, evaluator: Evaluator, rows: Mapping[int, SourceRows]) -> None:
        judged = evaluator.feed({ring: rows[ring] for ring in evaluator.sources})
        if not len(judged.ticks):
            return
        # held values of a slower signal are no new samples
        ticks = [rows[ring].ticks for ring in one.expressions[0].sources]
        own = np.isin(judged.ticks, np.concatenate(ticks)) if len(evaluator.sources) > 1 else slice(None)
        values = judged.numbers()[own].reshape(-1, len(one.scalars))
        if len(values):
            context = judged.codes(1)[own] if len(one.expressions) > 1 else None
            one.note_newest(judged.time_ns[own], beside_bounds(values, one.limit.rule))
            one.take(one.limit.feed(judged.ticks[own], judged.time_ns[own], values, context))

    def check_silent(self) -> list[str]:
        """Note what is recorded no more, and return in words what is so since the last time."""
        silent = self._rows.silent
        found = []
        for one in self._limited.values():
            if one.why:
                continue
            why = self._rows.silent_why(one.expressions) if not silent.isdisjoint(one.expressions[0].sources) else ""
            if why and not one.silent:
                found.append(f"limits of '{one.options.name}' are blind from here on: {why}")
            one.silent = why
        return found

    def check_stale(self, now_ns: int) -> None:
        """Note what has had no new value for too long."""
        for one in self._limited.values():
            if not one.why and not one.silent and one.limit.rule.stale_ns:
                one.limit.check_stale(now_ns)

    def acknowledge(self, names: Sequence[str], who: str, time_ns: int) -> int:
        """Note that somebody has seen the alarms of these scalars, of all without names; returns how many."""
        count = 0
        for one in self._limited.values():
            chosen = None if not names else {at for at, scalar in enumerate(one.scalars) if scalar.name in names}
            if not one.why:
                count += one.limit.acknowledge(who, time_ns, chosen)
        return count

    def worst(self) -> tuple[str, int]:
        """Return the worst that is violated now, in the letters of `LimitWord`, and how many are; ("", 0) for none."""
        count, worst, rank = 0, "", -1
        for one in self._limited.values():
            if one.why or one.silent:
                continue
            for state in one.limit.states:
                if state.level or state.stale:
                    count += 1
                    if abs(state.level) > rank:
                        rank, worst = abs(state.level), _word(state, 0.0).value
        return worst, count

    def take_fired(self) -> str:
        """Return the first violation that began, or became worse, since the last time, told to clients or not."""
        found = [one.fired for one in self._limited.values() if one.fired]
        for one in self._limited.values() if found else ():
            one.fired = ""
        return found[0] if found else ""

    # ------------------------------------------------------------------------------------------------------- words

    def statuses(self) -> list[LimitStatus]:
        """Return how each scalar stands."""
        return [_status(one, at) for one in self._limited.values() for at in range(len(one.scalars))]

    def news(self, *, last: bool = False) -> list[LimitNews]:
        """Return what clients must be told now, the worst first; at the `last` look all that waits."""
        now_s = math.inf if last else time.monotonic()
        found = [
            (one, scalar, state)
            for one in self._limited.values()
            if not one.why
            for scalar, state in zip(one.scalars, one.limit.states, strict=True)
            if (state.count or state.stale_count) and _is_due(scalar, state, now_s)
        ]
        most = MOST_LAST_NEWS if last else MOST_NEWS
        if len(found) > most:
            found.sort(key=lambda due: (-_severity(due[1]), due[1].told_s))
        news = [text for due in found[:most] for text in _news(*due)]
        if last and len(found) > most:
            news.append(LimitNews(True, f"{many(len(found) - most, 'more signal')} changed; `silo alarms` lists them"))
        return news


def _keeping_alarms(one: _Limited, before: _Limited | None) -> _Limited:
    """Return limits that are judged from now on with the alarms of those that they take the place of.

    They stay until somebody has seen them, with their counts and what was worst; what goes on is judged anew.
    """
    if before is None or [scalar.name for scalar in one.scalars] != [scalar.name for scalar in before.scalars]:
        return one
    states = before.known.states if before.why and before.known is not None else before.limit.states
    kept = LimitMemory(one.options, before.scalars, [state.edited() for state in states], one.newest, None)
    if one.why:
        one.known = kept
    elif len(kept.states) == len(one.scalars):
        one.scalars, one.limit.states = kept.scalars, kept.states
    return one


def _bound_of(rule: LimitRule, level: Level) -> float | None:
    found = rule.bound(level)
    return found if math.isfinite(found) else None


def _word(state: EntryState, value: float) -> LimitWord:
    if state.level:
        return _WORDS[state.level]
    if state.stale:
        return LimitWord.STALE
    return LimitWord.BLIND if math.isnan(value) else LimitWord.OK


def _no_value(since_ns: int) -> str:
    if not since_ns:
        return "it has no value yet"
    since = wall_clock(since_ns, 3) if since_ns >= EPOCH_FROM_NS else f"{since_ns * 1e-9:.6g} s"
    return f"it has no value (NaN) since {since}"


def _status(one: _Limited, at: int) -> LimitStatus:
    scalar = one.scalars[at]
    if one.why:
        return LimitStatus(scalar.name, "", LimitWord.BLIND, one.unit, why=one.why).given(one.options)
    state, value = one.limit.states[at], float(one.newest[at])
    seen = state.acknowledged
    word = LimitWord.BLIND if one.silent else _word(state, value)
    made = LimitStatus(
        scalar.name, one.options.name, word, one.unit, value if math.isfinite(value) else None,
        count=state.count, stale_count=state.stale_count, alarm=bool(state.alarm or state.stale_alarm),
        seen_by=seen.who if seen else "", since_seen=state.count + state.stale_count - seen.count if seen else 0,
        why=(one.silent or _no_value(state.missing_ns)) if word is LimitWord.BLIND else "",
    ).given(one.options)  # fmt: skip
    return _with_worst(made, one.limit.rule, state, scalar.worst)


def _with_worst(made: LimitStatus, rule: LimitRule, state: EntryState, worst: Violation | None) -> LimitStatus:
    stale_s = rule.stale_ns * 1e-9
    if worst is None or state.violation is None:
        return msgspec.structs.replace(made, limit=stale_s, since_ns=state.fresh_ns or 0) if state.stale_count else made
    newest = state.violation
    level = state.level or worst.worst
    return msgspec.structs.replace(
        made, limit=stale_s if made.word is LimitWord.STALE else _bound_of(rule, level), worst=worst.peak,
        worst_word=_WORDS[worst.worst], worst_tick=worst.peak_tick, worst_ns=worst.peak_ns,
        since_tick=newest.first_tick, since_ns=newest.first_ns, last_ns=newest.last_ns, samples=newest.samples,
    )  # fmt: skip


def _severity(scalar: ScalarMemory) -> int:
    return abs(scalar.untold.worst) if scalar.untold is not None else 0


def _is_over(state: EntryState) -> bool:
    return bool(state.level or state.stale or state.is_open)


def _is_due(scalar: ScalarMemory, state: EntryState, now_s: float) -> bool:
    """Whether clients must be told of it: at once of what is worse than they know."""
    if _severity(scalar) > abs(scalar.told):
        return True
    known = (scalar.told_count, scalar.told_stale, scalar.told_over)
    changed = known != (state.count, state.stale_count, _is_over(state))
    return changed and now_s - scalar.told_s >= TELL_AGAIN_S


def _unit(one: _Limited) -> str:
    return "" if one.unit in ("", "-") else f" {one.unit}"


def _violation_text(one: _Limited, scalar: ScalarMemory, violation: Violation) -> str:
    unit, bound = _unit(one), _bound_of(one.limit.rule, violation.worst)
    limit = "" if bound is None else f", limit {bound:.6g}{unit}"  # of one from before an edit there may be none now
    return (
        f"{scalar.name} {_WORDS[violation.worst].value} {violation.peak:.6g}{unit}{_tick_words(violation.peak_tick)}"
        f"{limit}"
    )


def _news(one: _Limited, scalar: ScalarMemory, state: EntryState) -> list[LimitNews]:
    """Say what has become of it since clients were told, and take it as told."""
    unit = _unit(one)
    new, new_stale, over = state.count - scalar.told_count, state.stale_count - scalar.told_stale, _is_over(state)
    untold, going, told = scalar.untold, scalar.going, scalar.told
    grew = going is not None and going.peak_tick != scalar.told_peak
    scalar.told_count, scalar.told_stale, scalar.told_over = state.count, state.stale_count, over
    scalar.untold, scalar.told_s = None, time.monotonic()
    scalar.going = going if going is not None and over and not going.over else None
    found: list[LimitNews] = []
    if going is not None and grew and going.over and new > 0:
        text = f"{_violation_text(one, scalar, going)}; within its limits again"
        found.append(LimitNews(True, text, going.peak_tick, going.peak_ns))
    if untold is not None and (new > 0 or abs(untold.worst) > abs(told)):
        scalar.told, scalar.told_peak = untold.worst, untold.peak_tick
        times = f", {new} times" if new > 1 else ""
        well = _well_tick(state)
        ended = "" if over else "; within its limits again" + (f" from tick {well} on" if well >= 0 else "")
        text = f"{_violation_text(one, scalar, untold)}{times}{ended}"
        found.append(LimitNews(True, text, untold.peak_tick, untold.peak_ns, max(new, 1)))
    if new_stale > 0:
        stale_s = one.limit.rule.stale_ns * 1e-9
        found.append(LimitNews(True, f"{scalar.name} is frozen: no new value for {stale_s:g} s"))
    if not found and not over:
        peak = f"; its peak was {going.peak:.6g}{unit}{_tick_words(going.peak_tick)}" if going and grew else ""
        found.append(LimitNews(False, f"{scalar.name} is within its limits again{peak}", _well_tick(state)))
    return found


def _tick_words(tick: int) -> str:
    return f" at tick {tick}" if tick >= 0 else ""


def _well_tick(state: EntryState) -> int:
    """The tick at which a scalar was well again, -1 where only the newest is known."""
    return -1 if state.violation is None else max(state.since_tick, state.violation.last_tick)

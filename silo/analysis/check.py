"""Limits and conditions judged on a recording: what `silo check` finds. Pure functions on a `Recording`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from silo.core.conditions import SignalLimits
from silo.core.quantities.writing import count, many
from silo.core.recording import Recording
from silo.errors import ElementError
from silo.expressions.binding import bind
from silo.expressions.evaluation import FALSE, TRUE, UNOBSERVABLE
from silo.expressions.over_recordings import RecordingJudge, narrowed
from silo.expressions.search import run_begins
from silo.judging.checks import bind_limits, rule_of, scalar_names
from silo.judging.limits import Level, Limit, LimitRule, Violation

UNCHANGED = "; nothing was changed"  # of errors that are none here


@dataclass(frozen=True)
class Finding:
    """One limit of one scalar, or one condition, and what became of it. Times are seconds since the log's start.

    `violations` counts stretches, `samples` the samples in them. `worst` is `RED_HIGH` ... , `GREEN` where there was no
    violation, `UNOBSERVABLE` where nothing could be judged. `missing` counts samples, or ticks, without a value (NaN),
    which could not be judged. `why` tells what could not, and why. Of a condition there is no peak.
    """

    what: str
    worst: str
    violations: int = 0
    samples: int = 0
    first_s: float | None = None
    peak: float | None = None
    peak_s: float | None = None
    unit: str = ""
    stale: int = 0
    why: str = ""
    missing: int = 0

    @property
    def violated(self) -> bool:
        """Whether it was, if only for one sample."""
        return self.violations > 0 or self.stale > 0


def check(
    recording: Recording, limits: Sequence[SignalLimits], never: Sequence[str] = (), always: Sequence[str] = ()
) -> list[Finding]:
    """Return what limits and conditions found, in their order: each scalar of a signal is one finding.

    `never` are conditions that must not be true, `always` ones that must not be false. Raises ElementError, with the
    place in the expression where it is one.
    """
    needed = [text for one in limits for text in (one.name, one.when)]
    judge = RecordingJudge(narrowed(recording, [*needed, *never, *always]))
    found = [finding for one in limits for finding in _limited(judge, recording, one)]
    found += [_conditioned(judge, recording, text, TRUE, f"never {text}") for text in never]
    return found + [_conditioned(judge, recording, text, FALSE, f"always {text}") for text in always]


def _limited(judge: RecordingJudge, recording: Recording, limits: SignalLimits) -> list[Finding]:
    try:
        rule, expressions = bind_limits(limits, judge.catalogue)
    except ElementError as error:
        rule_of(limits)  # bounds that make no sense are a mistake, a signal that isn't there only can't be told
        return [Finding(limits.name, "UNOBSERVABLE", why=str(error).replace(UNCHANGED, ""))]
    signal = expressions[0]
    limit = Limit(rule, max(signal.width, 1))
    found: list[dict[int, Violation]] = [{} for _ in limit.states]
    total, known = (np.zeros(len(limit.states), int) for _ in range(2))  # samples, and those of them that have a value
    start_ns = last_ns = int(recording.time_ns[0]) if len(recording.time_ns) else 0
    for judged in judge.batches(*expressions, whole=True):
        if not len(judged.ticks):
            continue
        # held values of a slower signal are no new samples
        own = np.ones(len(judged.ticks), bool)
        if len(expressions) > 1:
            own = judge.has_sample(signal, judged.ticks)
        values = judged.numbers()[own].reshape(-1, len(limit.states))
        context = judged.codes(1)[own] if len(expressions) > 1 else None
        for violation in limit.feed(judged.ticks[own], judged.time_ns[own], values, context):
            found[violation.entry][violation.number] = violation
        meant = values if context is None else values[context == TRUE]
        total, known = total + len(meant), known + (~np.isnan(meant)).sum(axis=0)
        last_ns = int(judged.time_ns[-1])
    limit.check_stale(last_ns)
    names, rule = scalar_names(signal, judge.catalogue, limits.name), limit.rule
    return [
        _without_value(
            _finding(name, violations, rule, stale=state.stale_count, unit=signal.unit, start_ns=start_ns), *samples
        )
        for name, violations, state, *samples in zip(
            names, found, limit.states, total.tolist(), known.tolist(), strict=True
        )
    ]  # fmt: skip


def _finding(
    name: str, found: dict[int, Violation], rule: LimitRule, *, stale: int, unit: str, start_ns: int
) -> Finding:
    violations = list(found.values())
    if not violations:
        return Finding(name, Level.GREEN.name, unit=unit, stale=stale)
    most = max(violations, key=rule.how_bad)
    return Finding(
        name, most.worst.name, len(violations), sum(one.samples for one in violations),
        (violations[0].first_ns - start_ns) * 1e-9, most.peak, (most.peak_ns - start_ns) * 1e-9, unit, stale,
    )  # fmt: skip


def _without_value(finding: Finding, total: int, known: int, noun: str = "sample") -> Finding:
    """Return a finding that says how many samples, or ticks, that were meant have no value, and so are not judged."""
    worst = finding.worst if known else "UNOBSERVABLE"
    if total == known:
        return replace(finding, worst=worst)
    why = f"{count(total - known)} of {many(total, noun)} have no value (NaN) and are not judged"
    return replace(finding, worst=worst, missing=total - known, why=why)


def _conditioned(judge: RecordingJudge, recording: Recording, text: str, bad: int, what: str) -> Finding:
    """Each stretch of ticks at which a condition is what it must not be is one violation."""
    batches = list(judge.batches(bind(text, judge.catalogue).condition()))
    codes = np.concatenate([judged.codes() for judged in batches] or [np.zeros(0, np.int8)])
    times = np.concatenate([judged.time_ns for judged in batches] or [np.zeros(0, np.int64)])
    wrong, known = codes == bad, int((codes != UNOBSERVABLE).sum())
    if not wrong.any():
        return _without_value(Finding(what, Level.GREEN.name), len(codes), known, "tick")
    begins = run_begins(wrong)
    first_s = float(times[begins[0]] - recording.time_ns[0]) * 1e-9
    found = Finding(what, "VIOLATED", len(begins), int(wrong.sum()), first_s)
    return _without_value(found, len(codes), known, "tick")

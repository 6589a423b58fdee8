"""A run held against rules and against a run that was good: what it found, each as a `Finding`."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

from silo.analysis.check import Finding, check
from silo.analysis.compare import Comparison, NoMomentError, SignalDifference, compare
from silo.analysis.log import Log
from silo.core.quantities.writing import and_more, many
from silo.core.recording import Recording
from silo.core.tuning.parameters import ParameterValue
from silo.core.units import factor
from silo.errors import ElementError, ScriptError
from silo.files.atomic import atomic_file
from silo.guards.rules import NEW, Bound, Rule
from silo.run_index.facts import IndexedRun, SignalFacts, facts_of, scaled
from silo.run_index.tables import short
from silo.run_index.where import Query, said_by

BAD, GOOD, BLIND = "VIOLATED", "GREEN", "UNOBSERVABLE"


def guard(run: Recording, rules: Sequence[Rule], baseline: Recording | None = None) -> list[Finding]:
    """Return what rules found in a run, in their order; with a baseline nothing may be new, unless rules say so.

    Args:
        run: the recording that is judged.
        rules: of `read_rules`.
        baseline: one that was good.

    Raises:
        ScriptError: a rule can't be understood, or needs a baseline; the message has its file and line.
    """
    if baseline is not None and not any(rule.kind == "new" for rule in rules):
        rules = [*rules, Rule("new", parts=NEW)]
    pair = _Pair(run, baseline)
    return [finding for rule in rules for finding in _found(rule, pair)]


def junit(path: Path, suite: str, found: Sequence[Finding]) -> None:
    """Write findings as a JUnit report. Raises SaveError."""
    violated = sum(one.violated for one in found)
    blind = sum(one.worst == BLIND for one in found)
    counts = {"tests": str(len(found)), "failures": str(violated), "skipped": str(blind), "errors": "0"}
    root = ElementTree.Element("testsuites", counts)
    of_suite = ElementTree.SubElement(root, "testsuite", {"name": "silo check", **counts})
    for one in found:
        case = ElementTree.SubElement(of_suite, "testcase", {"classname": suite, "name": one.what})
        if one.violated:
            ElementTree.SubElement(case, "failure", {"message": words(one)})
        elif one.worst == BLIND:
            ElementTree.SubElement(case, "skipped", {"message": one.why or "nothing could be judged"})
    with atomic_file(path) as file:
        file.write(ElementTree.tostring(root, "utf-8", xml_declaration=True))


def words(finding: Finding) -> str:
    """What a violation is, in a line."""
    if finding.why:
        return finding.why
    peak = "" if finding.peak is None else f", peak {finding.peak:.6g} {finding.unit}".rstrip(" -")
    first = "" if finding.first_s is None else f", first at {finding.first_s:.6g} s"
    return f"{finding.worst.lower().replace('_', ' ')} {many(finding.violations, 'time')}{first}{peak}"


class _Pair:
    """A run and its baseline, their facts read when they are asked for."""

    def __init__(self, run: Recording, baseline: Recording | None) -> None:
        self.run, self.good = run, baseline
        self._facts: dict[int, IndexedRun] = {}

    def facts(self, recording: Recording) -> IndexedRun:
        """Return what an index would keep of one of them."""
        if id(recording) not in self._facts:
            self._facts[id(recording)] = facts_of(recording, "", 0, Path())
        return self._facts[id(recording)]

    @property
    def baseline(self) -> Recording:
        """The one that was good. Raises ElementError where there is none."""
        if self.good is None:
            raise ElementError("this needs a run to be held against: --against BASELINE")
        return self.good

    def number(self, text: str, recording: Recording) -> float:
        """Return what an expression over a whole run is; NaN where the run lacks something."""
        query = self._query(text)
        facts = self.facts(recording)
        signals = facts.signals if recording is self.run else self._in_units_of_run(recording, facts.signals)
        return query.number(facts.run, (), signals)

    def why_unknown(self, text: str, value: float) -> str:
        """Return in words why a value is not to be told, of the run or else of the baseline."""
        facts = self.facts(self.good) if self.good is not None else None
        if math.isnan(value) or facts is None:
            return "the run lacks something that it speaks of"
        if math.isnan(self._query(text).number(facts.run, (), facts.signals)):
            return "the baseline lacks something that it speaks of"
        return "the baseline has something that it speaks of in units that don't fit those of the run"

    def _in_units_of_run(self, good: Recording, signals: Sequence[SignalFacts]) -> list[SignalFacts]:
        """The baseline's signals in the units that the run has; without those whose units say something else."""
        units = {short(self.run.prefix, one.name): one.unit for one in self.facts(self.run).signals}
        found = []
        for one in signals:
            unit = units.get(short(good.prefix, one.name), one.unit)
            if unit == one.unit or not {unit, one.unit}.isdisjoint(("", "-")):
                found.append(one)
            elif (times := factor(one.unit, unit)) is not None:
                found.append(scaled(one, times, unit))
        return found

    def _query(self, text: str) -> Query:
        known: dict[str, list[str]] = {}
        words: list[dict[str, set[str]]] = []
        parameters: list[Mapping[str, ParameterValue]] = []
        for one in (self.run, self.good):
            facts = self.facts(one) if one is not None else None
            for signal in facts.signals if facts is not None else ():
                known.setdefault(signal.element, []).append(signal.name)
                words.append({signal.element: {*signal.labels.values()}})
            parameters += [facts.run.parameters] if facts is not None else []
        scalars = {name: list(dict.fromkeys(some)) for name, some in known.items()}
        return Query(text, scalars, {name for some in parameters for name in some}, (), said_by(words, parameters))


def _found(rule: Rule, pair: _Pair) -> Iterator[Finding]:
    try:
        if rule.needs_baseline:
            pair.baseline  # noqa: B018  # raises
        made = {"never": _ticks, "always": _ticks, "holds": _holds, "value": _value, "signals": _signals, "new": _new}
        found = list(made[rule.kind](rule, pair))
    except ElementError as error:
        raise ScriptError(f"{rule.where}: {error}" if rule.where else str(error)) from error
    for one in found:
        yield replace(one, what=rule.name) if rule.name else one


def _ticks(rule: Rule, pair: _Pair) -> list[Finding]:
    return check(pair.run, (), *(((rule.text,), ()) if rule.kind == "never" else ((), (rule.text,))))


def _holds(rule: Rule, pair: _Pair) -> list[Finding]:
    what, number = f"holds {rule.text}", pair.number(rule.text, pair.run)
    if math.isnan(number):
        return [Finding(what, BLIND, why="the run lacks something that it speaks of")]
    return [Finding(what, GOOD) if number else Finding(what, BAD, 1, why="it doesn't hold of this run")]


def _value(rule: Rule, pair: _Pair) -> list[Finding]:
    value = pair.number(rule.text, pair.run)
    usual = pair.number(rule.text, pair.good) if pair.good is not None else math.nan
    found = []
    for key, bound in rule.bounds.items():
        size = f"{bound.number:.4g}" if not bound.of_baseline else f"{bound.number * 100:.4g} %"
        what = f"{rule.text} {key.replace('_', ' ')} {size}"
        low, high = _range(key, bound, usual)
        if math.isnan(value) or math.isnan(low) or math.isnan(high):
            found.append(Finding(what, BLIND, why=pair.why_unknown(rule.text, value)))
            continue
        digits = _digits(value, low, high)
        beside = "" if math.isnan(usual) else f", the baseline has {usual:.{digits}g}"
        why = f"it is {value:.{digits}g}{beside}; {low:.{digits}g} to {high:.{digits}g} is allowed"
        found.append(Finding(what, GOOD) if low <= value <= high else Finding(what, BAD, 1, why=why))
    return found


def _digits(value: float, *bounds: float) -> int:
    """How many digits tell a value from bounds that it isn't: 6, or as many as it takes."""
    texts = ((n, [f"{bound:.{n}g}" for bound in bounds if bound != value]) for n in range(6, 17))
    return next((n for n, others in texts if f"{value:.{n}g}" not in others), 17)


def _range(key: str, bound: Bound, usual: float) -> tuple[float, float]:
    size = bound.number
    if bound.of_baseline:  # also of a negative one 110 % are more, 90 % less
        size = bound.number * abs(usual) if key == "within" else usual + (bound.number - 1) * abs(usual)
    if key == "within":
        return usual - size, usual + size
    return (-math.inf, size) if key == "at_most" else (size, math.inf)


def _signals(rule: Rule, pair: _Pair) -> list[Finding]:
    run, good = Log(pair.run), Log(pair.baseline)
    event = (lambda log: log.eval(rule.event)) if rule.event else None
    what = f"{rule.text} as the baseline"
    try:
        found = compare(good, run, rule.text, event=event, tolerance=rule.tolerance)
    except NoMomentError as error:
        # what happened in the good run, and doesn't here, is the difference
        return [Finding(what, BLIND if error.which == "first" else BAD, int(error.which != "first"), why=str(error))]
    unseen = {**dict.fromkeys(found.only_a, "the run does not have it"), **found.not_compared}
    if not (len(found) or found.alike or unseen):
        raise ElementError(f"the baseline has no signals '{rule.text}'")
    bad = [
        Finding(f"{row.name} as the baseline", BAD, 1, row.count, row.first_s, *_peak(row), row.unit)
        for row in found.rows
    ]
    blind = [Finding(f"{name} as the baseline", BLIND, why=why) for name, why in unseen.items()]
    blind += [
        Finding(f"{what} to its end", BLIND, why=f"{why}: {and_more(names, 3)}")
        for why, names in _short(good, run, found).items()
    ]
    return bad + blind if bad or unseen else [Finding(what, GOOD), *blind]


def _short(good: Log, run: Log, found: Comparison) -> dict[str, list[str]]:
    """Which signals end before those of the baseline do, by what there is to say of that."""
    short_of: dict[str, list[str]] = {}
    for name, words in found.partly.items():
        ours, theirs = run[name], good[name]
        if theirs.times.max() > ours.times.max() + found.shift_s + theirs._step_ns * 1e-9:
            short_of.setdefault(words, []).append(name)
    return short_of


def _peak(row: SignalDifference) -> tuple[float | None, float | None]:
    """The largest difference and when; none of words and texts."""
    return (None, None) if math.isnan(row.most) else (row.most, row.at_s)


def _new(rule: Rule, pair: _Pair) -> Iterator[Finding]:
    run, good = pair.run, pair.baseline
    if "missing" in rule.parts:
        there = {short(run.prefix, one.name) for one in run.elements if one.count}
        gone = [name for one in good.elements if one.count and (name := short(good.prefix, one.name)) not in there]
        why = f"{many(len(gone), 'element')} of the baseline have no samples: {and_more(gone, 5)}"
        yield Finding("nothing is missing", BAD, len(gone), why=why) if gone else Finding("nothing is missing", GOOD)
    if "limits" in rule.parts:
        before = {short(good.prefix, one.what) for one in check(good, good.conditions.limits) if one.violated}
        broken = [
            one
            for one in check(run, run.conditions.limits)
            if one.violated and short(run.prefix, one.what) not in before
        ]
        yield from broken or [Finding("no new limit is broken", GOOD)]
    if "lost" in rule.parts:
        lost, usual = (sum(one.lost for one in each.elements) for each in (run, good))
        why = f"{many(lost, 'sample')} lost, {usual} of the baseline"
        yield Finding("no more is lost", BAD, 1, why=why) if lost > usual else Finding("no more is lost", GOOD)

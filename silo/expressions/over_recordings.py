"""Expressions over a recording: what `Log.eval`, `silo plot` and `silo check` compute, and derived signals in files.

The judge is the same as of triggers and limits (`silo.expressions.evaluation`). What is computed has a value at every
tick that the rates of its signals have in common, where they hold (`silo.expressions.derived_signals`).
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.values import as_exact
from silo.core.conditions import Derived
from silo.core.elements import Entry
from silo.core.recording import (
    RecordedElement,
    RecordedEntry,
    Recording,
    common_axis,
    falls,
    has_own_stamps,
    held_ticks,
    places_on,
    read_ahead,
    samples_between,
    ticks_of,
)
from silo.expressions.binding import BoundExpression, Catalogue, Known, bind
from silo.expressions.derived_signals import lookback
from silo.expressions.evaluation import UNOBSERVABLE, Evaluator, Judged, SourceRows
from silo.expressions.operations import Truth, raw

BATCH_TICKS = 16_384  # what is computed at once stays in the cache
# sources from here on down have no values, but a row at every tick that rates have in common: each has one by what they
# are, as several threads may evaluate at once
_RATES = -2
_FAR = 2**40  # ticks: more than any value holds


@dataclass(frozen=True)
class Evaluated:
    """An expression at the ticks at which it could be told: `values` of shape `(m,)` or `(m, k)`, bool of a condition.

    `ticks` are time stamps of the recording, by number.
    """

    bound: BoundExpression
    ticks: NDArray[np.int64]
    time_ns: NDArray[np.int64]
    values: NDArray[np.float64] | NDArray[np.bool_] | NDArray[np.int64] | NDArray[np.uint64]


@dataclass(frozen=True)
class _Ticks:
    """At which ticks a source has samples: `first`, then every `divider`-th, `count` in all.

    Of elements with stamps of their own, `own` are the ticks themselves, and `divider` the longest that one holds: to
    the next one, or, of a run that was cut, as many ticks as `holds` says.
    """

    first: int
    divider: int
    count: int
    own: NDArray[np.int64] | None = None
    holds: NDArray[np.int64] | None = None

    def between(self, begin: int, end: int) -> tuple[int, int]:
        """Which samples belong to the ticks `begin ... end - 1`."""
        if self.own is not None:
            low, high = np.searchsorted(self.own, [begin, end]).tolist()
            return low, high
        return samples_between(self.first, self.divider, self.count, begin, end)

    def numbers(self, low: int, high: int) -> NDArray[np.int64]:
        if self.own is not None:
            return self.own[low:high]
        return self.first + np.arange(low, high, dtype=np.int64) * self.divider

    def among(self, ticks: NDArray[np.int64]) -> NDArray[np.bool_]:
        """At which of these ticks there is a sample."""
        if self.own is not None:
            return np.isin(ticks, self.own)
        place, off = np.divmod(ticks - self.first, self.divider)
        return np.asarray((off == 0) & (place >= 0) & (place < self.count))


def narrowed(recording: Recording, texts: Iterable[str]) -> Recording:
    """Return a bag of others with only the elements that expressions may mean; any other recording as it is.

    Their stamps are the ticks of what is computed, and nothing of other topics is read.
    """
    if not has_own_stamps(recording):
        return recording
    words = " ".join(texts)
    kept = recording.elements
    if not _WILDCARD.search(words):
        kept = [element for element in kept if element.name.rpartition("/")[2] in words]
    return replace(recording, elements=tuple(kept))


def is_expression(pattern: str) -> bool:
    """Whether what somebody typed for a signal computes something."""
    return (
        any(letter in pattern for letter in "()<>=+%")
        or any(f" {sign} " in pattern for sign in "*/-")
        or (pattern.startswith("-"))
    )


def labels_of(bound: BoundExpression) -> Mapping[int, str]:
    """Return the names of values of what an expression gives."""
    return {0: "false", 1: "true"} if bound.logical else bound.labels


_WILDCARD = re.compile(r"\S[*?]|[*?]\S")


class RecordingJudge:
    """Computes expressions over one recording; the ticks of a bag of others are the stamps of all its elements."""

    def __init__(self, recording: Recording) -> None:
        self._elements = list(recording.elements)
        its_own = [element for element in self._elements if element.own_ns is not None]
        stamps = [element.own_ns for element in its_own if element.own_ns is not None]
        # of a run that was cut elements have stamps of their own, all of them from among those of the recording
        cut = any(element.holds for element in its_own)
        alone = bool(stamps) and not cut and len(stamps) == len(self._elements)
        self.time_ns = common_axis(stamps) if alone else recording.time_ns
        self._numbers, self._gaps = _apart(self.time_ns, recording.gaps), recording.gaps
        stretch = recording.stretch  # one that goes on another is not whole by itself
        goes_on = stretch is not None and stretch.part > 1
        # where the run began, by number: nothing was before; any sample of others may be the first
        self._begin = None if goes_on else len(self.time_ns) if alone else len(recording.time_ns) - recording.offset
        # elements of one topic have the same array
        own = {key: _own_ticks(self.time_ns, one) for key, one in {id(one.own_ns): one for one in its_own}.items()}
        numbers: dict[tuple[int, int, int, int], int] = {}
        keys = [(one.first, one.divider, one.count, id(one.own_ns)) for one in self._elements]
        self._sources = [numbers.setdefault(key, len(numbers)) for key in keys]
        self._layouts = {source: own.get(key[3]) or _Ticks(*key[:3]) for key, source in numbers.items()}
        known = [
            Known(element.name, tuple(_entry(element, entry) for entry in element.entries), element.unit, source,
                  self._layouts[source].divider, element.kind)
            for element, source in zip(self._elements, self._sources, strict=True)
        ]  # fmt: skip
        self.catalogue = Catalogue(known, recording.prefix, recording.conditions.derived)

    def batches(self, *expressions: BoundExpression, whole: bool = False) -> Iterator[Judged]:
        """Judge bound expressions together from the first tick to the last; what is `whole` gives integers."""
        evaluator = Evaluator(*expressions, whole=whole)
        lacking = [self._lacking(bound) for bound in expressions]
        wanted: dict[int, set[tuple[int, int]]] = {source: set() for source in evaluator.sources if source <= _RATES}
        for column in (column for bound in expressions for column in bound.columns):
            wanted.setdefault(column.source, set()).add((column.element, column.entry))
        read_ahead(self._elements[place] for keys in wanted.values() for place, _ in keys)
        for begin in range(0, len(self.time_ns), BATCH_TICKS):
            end = begin + BATCH_TICKS
            judged = evaluator.feed({at: self.rows(at, keys, begin, end) for at, keys in wanted.items()})
            if self._numbers is not None:
                judged = replace(judged, ticks=np.searchsorted(self._numbers, judged.ticks))
            yield _without(judged, lacking) if any(lacking) else judged

    def _lacking(self, bound: BoundExpression) -> list[tuple[int, int]]:
        """From and before which stamps windows lack what was there and is not kept: behind the begin, and each gap."""
        window_ns = lookback(bound).window_ns
        first, end = self.common_span(bound)
        if not window_ns or first >= end:
            return []
        places = [np.searchsorted(self.time_ns, behind) for _, behind in self._gaps if self._numbers is not None]
        begins = [
            (int(at), max(self._next(one, int(at)) for one in bound.sources)) for at in places if first < at < end
        ]
        if self._begin is None or first > self._begin:
            begins.append((0, first))
        return [(int(self.time_ns[at]), int(self.time_ns[full]) + window_ns) for at, full in begins]

    def _next(self, source: int, tick: int) -> int:
        """The tick of the first sample of a source from this one on; the last of all where none comes."""
        low, high = self._layouts[source].between(tick, len(self.time_ns))
        return int(self._layouts[source].numbers(low, low + 1)[0]) if low < high else len(self.time_ns) - 1

    def rows(self, source: int, keys: set[tuple[int, int]], begin: int, end: int) -> SourceRows:
        """Return the samples of some columns of a source at the ticks `begin ... end - 1`."""
        layout = self._layouts[source]
        low, high = layout.between(begin, end)
        ticks = layout.numbers(low, high)
        columns = {key: as_exact(self._elements[key[0]].entries[key[1]].values[low:high]) for key in keys}
        holds = None if layout.holds is None else layout.holds[low:high]
        numbers = ticks if self._numbers is None else self._numbers[ticks]
        return SourceRows(numbers, self.time_ns[ticks], columns, holds)

    def span(self, source: int) -> tuple[int, int]:
        """Return the time stamps, by number, from which on and before which the samples of a source hold."""
        layout = self._layouts[source]
        if layout.own is not None and len(layout.own):
            last = layout.divider if layout.holds is None else int(layout.holds[-1])
            return int(layout.own[0]), int(layout.own[-1]) + last
        return layout.first, layout.first + layout.divider * layout.count

    def common_span(self, bound: BoundExpression) -> tuple[int, int]:
        """Return the time stamps, by number, from which on and before which all signals of an expression hold."""
        spans = [self.span(source) for source in bound.sources] or [(0, len(self.time_ns))]
        return max(begin for begin, _ in spans), min(len(self.time_ns), *(end for _, end in spans))

    def has_sample(self, bound: BoundExpression, ticks: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return at which ticks a signal of an expression has a sample of its own, not one that is held."""
        found = np.zeros(len(ticks), bool)
        for source in bound.sources:
            found |= self._layouts[source].among(ticks)
        return found

    def derived(self, name: str) -> Derived | None:
        """Return the derived signal of this name (whole, or from behind a `/`), None where there is none."""
        found = self.catalogue.before(name)
        return found and found[0]

    def evaluate(self, text: str, *, whole: bool = False) -> Evaluated:
        """Return an expression over the whole recording; of integers alone as such, if what is `whole` is asked for.

        Raises ExpressionError with the place.
        """
        bound = self._with_rate(bind(text, self.catalogue))
        ticks, times = [_NO_TICKS], [_NO_TICKS]
        values: list[NDArray[Any]] = []
        for judged in self.batches(bound, whole=whole):
            found, known = _known(bound, judged)
            ticks.append(judged.ticks[known])
            times.append(judged.time_ns[known])
            values.append(found[known])
        shape = (0, bound.width) if bound.width else (0,)
        empty = np.zeros(shape, bool if bound.logical else np.float64)
        return Evaluated(bound, np.concatenate(ticks), np.concatenate(times), _joined(values or [empty]))

    def _with_rate(self, bound: BoundExpression) -> BoundExpression:
        """Return it with what has it judged at every tick that its rates have in common, too; a bag of others has none.

        That of every third tick and every second is every tick: where none has a sample, all hold.
        """
        layouts = [self._layouts[source] for source in bound.sources]
        divider = math.gcd(*bound.sources.values())
        if divider in bound.sources.values() or any(one.own is not None for one in layouts) or not layouts:
            return bound  # the fastest is at each of them, or nobody is
        first = layouts[0].first % divider
        source = _RATES - (first << 32 | divider)
        self._layouts[source] = _Ticks(first, divider, max(0, -((first - len(self.time_ns)) // divider)))
        return replace(bound, sources={**bound.sources, source: divider})


_NO_TICKS = np.zeros(0, np.int64)


def _without(judged: Judged, lacking: Sequence[Sequence[tuple[int, int]]]) -> Judged:
    """Have nothing told by expressions from and before these time stamps."""
    values, seen = list(judged.values), list(judged.seen)
    for which, spans in enumerate(lacking):
        early = np.zeros(len(judged.time_ns), bool)
        for begin, full in spans:
            early |= (judged.time_ns >= begin) & (judged.time_ns < full)
        if early.any():
            value, there = values[which], seen[which]
            seen[which] = ~early if there is None else there & ~early
            rows = early[:, None] if np.ndim(raw(value)) == 2 else early
            if isinstance(value, Truth):
                unknown = rows if value.unknown is None else rows | value.unknown
                values[which] = Truth(value.true & ~rows, np.broadcast_to(unknown, np.shape(value.true)))
            else:
                values[which] = np.where(rows, np.nan, value)
    return replace(judged, values=tuple(values), seen=tuple(seen))


def _apart(time_ns: NDArray[np.int64], gaps: Sequence[tuple[int, int]]) -> NDArray[np.int64] | None:
    """Numbers of ticks of which those with missing ones between them are far apart; None where none are missing."""
    if not gaps or falls(time_ns):
        return None
    numbers = np.arange(len(time_ns), dtype=np.int64)
    for _, behind in gaps:
        numbers[np.searchsorted(time_ns, behind) :] += _FAR
    return numbers


def _own_ticks(axis: NDArray[np.int64], element: RecordedElement) -> _Ticks:
    stamps: Any = element.own_ns
    holds = held_ticks(element)
    ticks = places_on(axis, stamps) if holds is None else ticks_of(axis, element)
    if holds is not None and len(holds):
        return _Ticks(0, int(holds.max()), len(ticks), ticks, holds)
    # a single message, as of a map, holds to the end
    return _Ticks(0, int(np.diff(ticks).max()) if len(ticks) > 1 else len(axis) + 1, len(ticks), ticks)


def _joined(batches: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Return batches as one; NumPy would make floats of integers of which some batches need the 64th bit."""
    kinds = {one.dtype.kind for one in batches}
    if kinds == {"i", "u"} and not any((one < 0).any() for one in batches):
        batches = [one.astype(np.uint64) for one in batches]
    return np.concatenate(batches)


def _known(bound: BoundExpression, judged: Judged) -> tuple[NDArray[np.float64] | NDArray[np.bool_], NDArray[np.bool_]]:
    """The results at all ticks, and at which of them they can be told."""
    if bound.logical:
        codes = judged.codes()
        known = codes != UNOBSERVABLE
        return codes == 1, known.all(axis=1) if known.ndim == 2 else known
    seen = judged.seen[0]
    return judged.numbers(), np.ones(len(judged.ticks), bool) if seen is None else seen


def _entry(element: RecordedElement, entry: RecordedEntry) -> Entry:
    suffix = entry.name.removeprefix(element.name)
    return entry.entry if suffix == entry.entry.suffix else msgspec.structs.replace(entry.entry, suffix=suffix)

"""Expressions over a recording: what `Log.eval`, `silo plot` and `silo check` compute, and derived signals in files.

The judge is the same as of triggers and limits: an expression has a value at every tick where one of its signals has a
sample, the others hold (`silo.judging.evaluation`).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.judging.binding import Bound, Catalogue, Known, bind
from silo.judging.evaluation import UNOBSERVABLE, Evaluator, Judged, SourceRows
from silo.model import Derived, Entry
from silo.recording import RecordedElement, RecordedEntry, Recording
from silo.values import as_floats

BATCH_TICKS = 16_384  # what is computed at once stays in the cache


@dataclass(frozen=True)
class Evaluated:
    """An expression at the ticks at which it could be told: `values` of shape `(m,)` or `(m, k)`, bool of a condition.

    `ticks` are time stamps of the recording, by number.
    """

    bound: Bound
    ticks: NDArray[np.int64]
    time_ns: NDArray[np.int64]
    values: NDArray[np.float64] | NDArray[np.bool_]


class RecordingJudge:
    """Computes expressions over one recording."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._elements = list(recording.elements)
        numbers: dict[tuple[int, int, int], int] = {}
        self._sources = [
            numbers.setdefault((element.first, element.divider, element.count), len(numbers))
            for element in self._elements
        ]
        self._layouts = {source: layout for layout, source in numbers.items()}
        known = [
            Known(element.name, tuple(_entry(element, entry) for entry in element.entries), element.unit, source,
                  element.divider)
            for element, source in zip(self._elements, self._sources, strict=True)
        ]  # fmt: skip
        self.catalogue = Catalogue(known, recording.prefix, recording.extras.derived)

    def batches(self, *expressions: Bound) -> Iterator[Judged]:
        """Judge bound expressions together from the first tick to the last."""
        evaluator = Evaluator(*expressions)
        wanted: dict[int, set[tuple[int, int]]] = {}
        for column in (column for bound in expressions for column in bound.columns):
            wanted.setdefault(column.source, set()).add((column.element, column.entry))
        for begin in range(0, len(self._recording.time_ns), BATCH_TICKS):
            end = begin + BATCH_TICKS
            yield evaluator.feed({source: self.rows(source, keys, begin, end) for source, keys in wanted.items()})

    def rows(self, source: int, keys: set[tuple[int, int]], begin: int, end: int) -> SourceRows:
        """Return the samples of some columns of a source at the ticks `begin ... end - 1`."""
        first, divider, count = self._layouts[source]
        low, high = (min(max(-(-(tick - first) // divider), 0), count) for tick in (begin, end))
        ticks = first + np.arange(low, high, dtype=np.int64) * divider
        columns = {key: as_floats(self._elements[key[0]].entries[key[1]].values[low:high]) for key in keys}
        return SourceRows(ticks, self._recording.time_ns[ticks], columns)

    def span(self, source: int) -> tuple[int, int]:
        """Return the time stamps, by number, from which on and before which the samples of a source hold."""
        first, divider, count = self._layouts[source]
        return first, first + divider * count

    def has_sample(self, bound: Bound, ticks: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return at which ticks a signal of an expression has a sample of its own, not one that is held."""
        found = np.zeros(len(ticks), bool)
        for source in bound.sources:
            first, divider, count = self._layouts[source]
            place, off = np.divmod(ticks - first, divider)
            found |= (off == 0) & (place >= 0) & (place < count)
        return found

    def derived(self, name: str) -> Derived | None:
        """Return the derived signal of this name (whole, or from behind a `/`), None where there is none."""
        found = self.catalogue.before(name)
        return found and found[0]

    def evaluate(self, text: str) -> Evaluated:
        """Return an expression over the whole recording. Raises ExpressionError with the place."""
        bound = bind(text, self.catalogue)
        ticks, times, values = [_NO_TICKS], [_NO_TICKS], []
        for judged in self.batches(bound):
            found, known = _known(bound, judged)
            ticks.append(judged.ticks[known])
            times.append(judged.time_ns[known])
            values.append(found[known])
        shape = (0, bound.width) if bound.width else (0,)
        empty = np.zeros(shape, bool if bound.logical else np.float64)
        return Evaluated(bound, np.concatenate(ticks), np.concatenate(times), np.concatenate([empty, *values]))


_NO_TICKS = np.zeros(0, np.int64)


def _known(bound: Bound, judged: Judged) -> tuple[NDArray[np.float64] | NDArray[np.bool_], NDArray[np.bool_]]:
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

"""What tells runs, or episodes, from others: each signal by the statistic that differs most, from the index alone.

How far apart two groups are is the correlation of a number with the group that it is of: 1 where the number says which
group it is, 0 where it says nothing. Of few runs some of many signals differ by chance.
"""

import math
from collections.abc import Callable, Iterator, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.run_index.facts import RunFacts, SignalFacts
from silo.run_index.listed import ListedRun
from silo.run_index.tables import short
from silo.run_index.where import FACTS, OF_SIGNALS

_STATISTICS = {how: OF_SIGNALS[how][0] for how in ("max", "min", "mean", "rms", "std")}
_FACTS: dict[str, tuple[str, Callable[[RunFacts], float]]] = {
    name: FACTS[name] for name in ("span", "limits", "triggers", "marks", "lost", "failed")
}


class Apart(msgspec.Struct, frozen=True):
    """A number that differs.

    Attributes:
        what: the signal, without the prefix of its logger, or a fact of runs, such as `span`.
        how: which statistic of the signal; empty for a fact.
        unit: of the numbers.
        these: the median of those that were asked about.
        others: the median of the others.
        apart: from -1 to 1; negative where the others have more.
    """

    what: str
    how: str
    unit: str
    these: float
    others: float
    apart: float


RunSignals = tuple[ListedRun, Sequence[SignalFacts]]


def what_tells(these: Sequence[RunSignals], others: Sequence[RunSignals]) -> list[Apart]:
    """Return what differs, the farthest apart first; what is the same, or is known of one group alone, is left out."""
    found: dict[str, Apart] = {}
    numbers = [dict(_numbers(*known)) for known in (*these, *others)]
    for what, how, unit in dict.fromkeys(key for some in numbers for key in some):
        values = np.array([some.get((what, how, unit), math.nan) for some in numbers])
        mine = np.arange(len(values)) < len(these)
        there = np.isfinite(values)
        if not (there & mine).any() or not (there & ~mine).any():
            continue
        apart = _correlation(values[there], mine[there])
        best = found.get(what)
        if abs(apart) > (abs(best.apart) if best is not None else 0.0):
            one, other = (float(np.median(values[there & group])) for group in (mine, ~mine))
            found[what] = Apart(what, how, unit, one, other, apart)
    return sorted(found.values(), key=lambda one: abs(one.apart), reverse=True)


def _numbers(run: ListedRun, signals: Sequence[SignalFacts]) -> Iterator[tuple[tuple[str, str, str], float]]:
    for name, (unit, read) in _FACTS.items():
        yield (name, "", unit), read(run.facts)
    for signal in signals:
        if signal.kind == "number":
            for how, field in _STATISTICS.items():
                value = getattr(signal, field)
                if value is not None:
                    yield (short(run.facts.prefix, signal.name), how, signal.unit), value


def _correlation(values: NDArray[np.float64], mine: NDArray[np.bool_]) -> float:
    most = float(np.abs(values).max())
    scaled = values / most if most else values  # squares of what is large are infinite
    spread = float(scaled.std())
    if spread <= 1e-12:  # the same, but for rounding
        return 0.0
    share = float(mine.mean())
    return float((scaled[mine].mean() - scaled[~mine].mean()) / spread * math.sqrt(share * (1 - share)))

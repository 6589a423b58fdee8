"""Find the moment: which samples of a signal are what one looks for, exact to the sample. Pure functions on arrays.

Triggers and markers come from what happened, limits from sources that are added to `EVENT_SOURCES`; where there is
none, the screen says so.
"""

import enum
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.values import numbers
from silo_tui.model.happened import in_plots, letter, words
from silo_tui.model.source import PlotSource

Places = NDArray[np.intp]
LONG_GAP = 1.5  # periods between two samples from which on some are missing


class What(enum.Enum):
    """What one looks for; the value is its key."""

    HIGHEST = "h"
    LOWEST = "l"
    CROSSING = "x"
    EDGE = "e"
    CHANGE = "c"
    NOT_FINITE = "n"
    OUTSIDE = "o"
    HOLE = "g"
    TRIGGER = "t"
    MARKER = "m"


WORDS = {
    What.HIGHEST: "highest",
    What.LOWEST: "lowest",
    What.CROSSING: "crossing of a value",
    What.EDGE: "edge",
    What.CHANGE: "change",
    What.NOT_FINITE: "nan or inf",
    What.OUTSIDE: "outside limits",
    What.HOLE: "hole",
    What.TRIGGER: "trigger fired",
    What.MARKER: "marker",
}


@dataclass(frozen=True)
class Moment:
    """Something that happened: when, where, and in a few words."""

    time_ns: int
    name: str
    words: str = ""


EventSource = Callable[[PlotSource, Sequence[str], int, int], Awaitable[Sequence[Moment]]]
# what is no matter of the samples alone: each source returns what happened to these entries from start_ns to end_ns
EVENT_SOURCES: dict[What, list[EventSource]] = {What.OUTSIDE: [], What.TRIGGER: [], What.MARKER: []}


def happened(source: PlotSource, start_ns: int, end_ns: int, letters: str) -> list[Moment]:
    """Return what happened from one moment to another, of the kinds with these letters (all: none given)."""
    found = in_plots(source.happened, start_ns, end_ns)
    return [Moment(one.at_ns, "", words(one)) for one in found if not letters or letter(one) in letters]


def _source_of(letters: str) -> EventSource:
    async def ask(source: PlotSource, _names: Sequence[str], start_ns: int, end_ns: int) -> Sequence[Moment]:
        return happened(source, start_ns, end_ns, letters)

    return ask


EVENT_SOURCES[What.TRIGGER].append(_source_of("T"))
EVENT_SOURCES[What.MARKER].append(_source_of("M"))
EVENT_SOURCES[What.OUTSIDE].append(_source_of("H"))
OTHERS = "SEX"  # an event too, whichever, though none that one looks for by its kind


@dataclass(frozen=True)
class Search:
    """What one looks for, and where; `direction` is 1 for rising, -1 for falling, 0 for either."""

    what: What
    level: float = 0.0
    direction: int = 0
    everywhere: bool = False

    @property
    def words(self) -> str:
        """The search as it is read."""
        if self.what is not What.CROSSING:
            return WORDS[self.what]
        way = {1: " rising", -1: " falling", 0: ""}[self.direction]
        return f"crossing of {self.level:.6g}{way}"


def parse_crossing(words: str) -> Search:
    """Return the search for `20` (either way), `>20` (rising) or `<20` (falling). Raises ValueError."""
    words = words.strip()
    direction = {">": 1, "<": -1}.get(words[:1], 0)
    try:
        level = float(words[1:] if direction else words)
    except ValueError:
        raise ValueError(f"{words!r} is no number: 20 (either way), >20 (rising) or <20 (falling)") from None
    if np.isnan(level):
        raise ValueError("nothing crosses nan; key n finds it")
    return Search(What.CROSSING, level, direction)


def places_of(search: Search, time_ns: NDArray[np.int64], values: NDArray[Any], period_ns: int) -> Places:
    """Return which samples are what one looks for, ascending; both arrays of shape `(n,)`.

    A crossing is the first sample on the other side of the level (on it counts as above), the nan in between left out.
    A hole is the last sample before it.
    """
    if search.what is What.HOLE:
        return np.flatnonzero(np.diff(time_ns) > LONG_GAP * period_ns)
    if search.what is What.CHANGE:
        return _changes(values)
    if values.dtype.kind in "SUV":
        return _changes(values) if search.what is What.EDGE else np.zeros(0, np.intp)
    found = numbers(values)
    offsets = found.offsets
    if search.what is What.NOT_FINITE:
        return _begins(~np.isfinite(offsets))
    if search.what is What.CROSSING:
        # the level moves to the base: it is the float, the samples are exact
        return _crossings(offsets, search.level - found.base, search.direction)
    if search.what is What.EDGE:
        return _changes(values) if values.dtype.kind == "b" else _edges(offsets)
    if search.what in {What.HIGHEST, What.LOWEST}:
        numbered = offsets[~np.isnan(offsets)]
        if not len(numbered):
            return np.zeros(0, np.intp)
        return _begins(offsets == (numbered.max() if search.what is What.HIGHEST else numbered.min()))
    return np.zeros(0, np.intp)


def _begins(here: NDArray[np.bool_]) -> Places:
    """Where each unbroken run begins."""
    before = np.concatenate([[False], here[:-1]])
    return np.flatnonzero(here & ~before)


def _changes(values: NDArray[Any]) -> Places:
    if len(values) < 2:
        return np.zeros(0, np.intp)
    after, before = values[1:], values[:-1]
    # a nan after a nan is no change
    missing = np.isnan(values) if values.dtype.kind in "fc" else np.isnat(values) if values.dtype.kind in "Mm" else None
    both = np.zeros(len(after), np.bool_) if missing is None else missing[1:] & missing[:-1]
    return np.flatnonzero((after != before) & ~both) + 1


def _crossings(values: NDArray[np.float64], level: float, direction: int) -> Places:
    known = np.flatnonzero(~np.isnan(values))
    above = values[known] >= level
    rising = ~above[:-1] & above[1:]
    falling = above[:-1] & ~above[1:]
    wanted = rising if direction > 0 else falling if direction < 0 else rising | falling
    return known[1:][wanted] if len(known) else known


def _edges(values: NDArray[np.float64]) -> Places:
    """Steps of more than half of what the signal spans, from one sample to the next."""
    finite = values[np.isfinite(values)]
    if len(finite) < 2:
        return np.zeros(0, np.intp)
    half = finite.max() / 2 - finite.min() / 2
    with np.errstate(invalid="ignore"):
        steps = np.abs(values[1:] / 2 - values[:-1] / 2)
    return np.flatnonzero(np.isfinite(steps) & (steps > half / 2) & (half > 0)) + 1


def neighbour(times: Sequence[int], now_ns: int, step: int) -> int | None:
    """Return which of some moments, ascending, is the next one after now (`step` 1) or the last one before (-1)."""
    at = int(np.searchsorted(np.asarray(times, np.int64), now_ns, "right" if step > 0 else "left"))
    at = at if step > 0 else at - 1
    return at if 0 <= at < len(times) else None

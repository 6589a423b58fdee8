"""Find the moment: which samples of a signal are what one looks for, exact to the sample. Pure functions on arrays.

The rules for samples are `silo.expressions.search`: a helper process judges by the same. Triggers and markers come from
what happened.
"""

import enum
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import Sought
from silo.expressions.search import LONG_GAP, Looking, Places, places
from silo_tui.model.drawing.window import SECOND_NS
from silo_tui.model.lists.happened import in_plots, letter, words
from silo_tui.model.samples.source import PlotSource
from silo_tui.model.words import text


class What(enum.Enum):
    """What one looks for; the value is its key."""

    HIGHEST = "h"
    LOWEST = "l"
    PEAK = "p"
    CROSSING = "x"
    EDGE = "e"
    CHANGE = "c"
    NOT_FINITE = "n"
    OUTSIDE = "o"
    HOLE = "g"
    TRIGGER = "t"
    MARKER = "m"
    CONDITION = "w"


WORDS = {
    What.HIGHEST: "highest",
    What.LOWEST: "lowest",
    What.PEAK: "peak of a swing",
    What.CROSSING: "crossing of a value, up or down",
    What.EDGE: "edge",
    What.CHANGE: "change",
    What.NOT_FINITE: "nan or inf",
    What.OUTSIDE: "outside limits",
    What.HOLE: "hole",
    What.TRIGGER: "trigger fired",
    What.MARKER: "marker",
    What.CONDITION: "where a condition turns true",
}


SOUGHT = {what: Sought[what.name] for what in What if what.name in Sought.__members__}  # in samples
Bounds = tuple[float | None, float | None]


@dataclass(frozen=True)
class Moment:
    """Something that happened: when, where, and in a few words."""

    time_ns: int
    name: str
    words: str = ""
    told: Callable[[], str] | None = None  # the words, made when they are read

    @property
    def said(self) -> str:
        """What is said of it."""
        return self.told() if self.told is not None else self.words


LETTERS = {What.TRIGGER: "T", What.MARKER: "M"}  # what is no matter of the samples, but of the event log
EVENTS = "TMHSEX"


def happened(
    source: PlotSource, start_ns: int, end_ns: int, letters: str, names: Collection[str] | None = None
) -> list[Moment]:
    """Return what happened from one moment to another, of the kinds with these letters; limits of `names` only."""
    found = in_plots(source.happened, start_ns, end_ns, names)
    return [Moment(one.at_ns, "", words(one)) for one in found if letter(one) in letters]


@dataclass(frozen=True)
class Search:
    """What one looks for, and where; `direction` is 1 for rising, -1 for falling, 0 for either.

    `condition` is an expression of any signals, `everywhere` plays no part for it. A hole is longer than `least_s`.
    """

    what: What
    level: float = 0.0
    direction: int = 0
    everywhere: bool = False
    condition: str = ""
    least_s: float = 0.0

    def looking(self, period_ns: int, bounds: Bounds = (None, None)) -> Looking | None:
        """Return what to look for in the samples of a signal; None for what is no matter of these."""
        sought = SOUGHT.get(self.what)
        period_ns = max(period_ns, round(self.least_s * SECOND_NS / LONG_GAP))
        return Looking(sought, self.level, self.direction, bounds, period_ns) if sought is not None else None

    @property
    def words(self) -> str:
        """The search as it is read."""
        if self.what is not What.CROSSING:
            return self.condition or WORDS[self.what]
        way = {1: " rising", -1: " falling", 0: " either way"}[self.direction]
        return f"crossing of {text.short(self.level, 6)}{way}"


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

    What is no matter of the samples (triggers, markers) is none of them.
    """
    looking = search.looking(period_ns)
    return places(looking, time_ns, values) if looking is not None else np.zeros(0, np.intp)


def neighbour(times: Sequence[int], now_ns: int, step: int) -> int | None:
    """Return which of some moments, ascending, is the next one after now (`step` 1) or the last one before (-1)."""
    at = int(np.searchsorted(np.asarray(times, np.int64), now_ns, "right" if step > 0 else "left"))
    at = at if step > 0 else at - 1
    return at if 0 <= at < len(times) else None

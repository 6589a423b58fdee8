"""Find the moment: which samples of a signal are what one looks for, exact to the sample. Pure functions on arrays.

The rules for samples are `silo.expressions.search`: a helper process judges by the same. Triggers and markers come from
what happened.
"""

import enum
import re
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import Sought
from silo.expressions.search import Looking, Places, places
from silo_tui.model.lists.happened import in_plots, letter, words
from silo_tui.model.samples.source import PlotSource
from silo_tui.model.words import text


class What(enum.Enum):
    """What one looks for; the value is the letter that is short for it."""

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
    BEYOND = "b"
    CONDITION = "w"
    MOMENT = "a"
    SIGNAL = "s"


WORDS = {
    What.HIGHEST: "highest",
    What.LOWEST: "lowest",
    What.PEAK: "peak of a swing",
    What.EDGE: "edge",
    What.CHANGE: "change",
    What.NOT_FINITE: "nan or inf",
    What.OUTSIDE: "outside limits",
    What.HOLE: "hole",
    What.TRIGGER: "trigger fired",
    What.MARKER: "marker",
}
# what else is typed for them
_TYPED = {
    What.HIGHEST: "highest max maximum", What.LOWEST: "lowest min minimum", What.PEAK: "peak peaks",
    What.EDGE: "edge edges", What.CHANGE: "change changes", What.NOT_FINITE: "nan inf",
    What.OUTSIDE: "outside limit limits", What.HOLE: "hole holes gap gaps", What.TRIGGER: "trigger triggers fired",
    What.MARKER: "marker markers mark marks",
}  # fmt: skip
_KINDS = {each: what for what, words in _TYPED.items() for each in (what.value, *words.split())}
_WAYS = dict.fromkeys((">", ">=", "above", "over"), 1) | dict.fromkeys(("<", "<=", "below", "under"), -1)
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?|[-+]?inf|nan"
_LEVEL = re.compile(
    rf"(?:is |rises |falls |crosses |crossing )?(above|over|[<>]=?|below|under|)\s*({_NUMBER})", re.IGNORECASE
)
_MOMENT = re.compile(r"at\s+(.+)|([-+]?[\d.]+\s*(?:[mun]?s|min|h)|\d{1,2}:\d\d\S*)")
_SIGN = re.compile(r"[<>=!]|\b(?:and|or|not)\b")


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
    """What one looks for, and where; `direction` is 1 for rising or above, -1 for falling or below, 0 for either.

    `condition` is an expression of any signals, `everywhere` plays no part for it; of a moment and a signal what was
    typed. A hole is longer than `least_s`. It begins with the next one, the last (`begin` -1) or the first (1).
    """

    what: What
    level: float = 0.0
    direction: int = 0
    everywhere: bool = False
    condition: str = ""
    least_s: float = 0.0
    begin: int = 0

    def looking(self, period_ns: int, bounds: Bounds = (None, None)) -> Looking | None:
        """Return what to look for in the samples of a signal; None for what is no matter of these."""
        if self.what is What.BEYOND:  # of the last stretch its end, of the first where it begins
            beyond = (None, self.level) if self.direction > 0 else (self.level, None)
            return Looking(Sought.OUTSIDE, direction=self.begin, bounds=beyond, period_ns=period_ns)
        sought, level = SOUGHT.get(self.what), self.least_s if self.what is What.HOLE else self.level
        return Looking(sought, level, self.direction, bounds, max(1, period_ns)) if sought is not None else None

    @property
    def words(self) -> str:
        """The search as it is read."""
        level, begin = text.short(self.level, 6), {-1: "last ", 1: "first ", 0: ""}[self.begin]
        if self.what is What.BEYOND:
            return f"{begin}{'above' if self.direction > 0 else 'below'} {level}"
        if self.what is What.CROSSING:
            return begin + {1: "rises above", -1: "falls below", 0: "crosses"}[self.direction] + f" {level}"
        return begin + (self.condition or WORDS.get(self.what, ""))


def parse_find(typed: str) -> Search:
    """Return the search for what is typed: `> 5`, `last above 5`, `highest`, `-3s`, a condition, a name of a signal.

    One with a `*` before it is of all that is plotted. Raises ValueError.
    """
    words, everywhere = typed.strip("* "), typed.lstrip().startswith("*")
    first, _, rest = words.partition(" ")
    begin = {"last": -1, "first": 1}.get(first.casefold(), 0)
    words = rest.strip() if begin else words
    if (what := _KINDS.get(words.casefold())) is not None:
        return Search(what, everywhere=everywhere, begin=begin)
    if (found := _LEVEL.fullmatch(words)) is not None:
        direction, level = _WAYS.get(found[1].casefold(), 0), float(found[2])
        if np.isnan(level):
            raise ValueError("nothing crosses nan; nan alone finds it")
        what = What.BEYOND if begin and direction else What.CROSSING
        return Search(what, level, direction, everywhere, begin=begin)
    if begin and not words:
        raise ValueError(f"{first} of what? {first} above 5, {first} change, ...")
    if (moment := _MOMENT.fullmatch(words)) is not None:
        return Search(What.MOMENT, condition=moment[1] or moment[2])
    for word in (each for each in _WAYS if each.isalpha()):
        words = f" {words}".replace(f" {word} ", " > " if _WAYS[word] > 0 else " < ").strip()
    return Search(What.CONDITION if _SIGN.search(words) else What.SIGNAL, condition=words, begin=begin)


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

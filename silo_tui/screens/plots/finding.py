"""Find the moment, for the monitor: what was found in all that is held, and where to go from there.

The source looks (`HeldRows.find`): a file by itself, a logger's helper process in its buffers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from silo.core.arrays.values import numbers
from silo.core.elements import Entry
from silo.expressions.search import FoundMoments as FoundIn
from silo_tui.model.drawing.plots import Plotted
from silo_tui.model.plots.limits import Bounds4, inner
from silo_tui.model.samples.find import (
    EVENTS,
    LETTERS,
    Moment,
    Search,
    What,
    happened,
    neighbour,
)
from silo_tui.model.samples.live import offset_text
from silo_tui.model.samples.source import HeldRows
from silo_tui.model.words import text

if TYPE_CHECKING:
    from silo.conditions.requests import TriggerTried

MOST_MOMENTS = 1000  # of a signal that are here at a time
HOLE_S = 0.1  # that is an event: what is shorter is how a busy computer ticks


@dataclass(frozen=True)
class SearchResult:
    """What a search came to: `total` moments, of which those after the first `before` are here, in the order of time.

    `held_s` is how much was looked through, `partly` why not all that is held was.
    """

    search: Search
    names: tuple[str, ...]
    end_ns: int
    moments: tuple[Moment, ...]
    held_s: float
    total: int
    before: int = 0
    partly: str = ""

    def none(self) -> str:
        """Return what to say when nothing was found."""
        if not self.held_s and self.partly:
            return f"{self.search.words}: none, {self.partly}"
        words = f"{self.search.words}: none in {text.span(self.held_s, 3)} held"
        return f"{words}; not looked through further: {self.partly}" if self.partly else words

    def place(self, now_ns: int, step: int, last: int | None = None) -> int | None:
        """Return which moment to go to; of the first of a search the next one, or else the last before.

        Who stands where `last` led goes on from it: several signals may have theirs at one time.
        """
        times = [moment.time_ns for moment in self.moments]
        if step and last is not None and times[last] == now_ns:
            return last + step if 0 <= last + step < len(times) else None
        if step:
            return neighbour(times, now_ns, step)
        at = neighbour(times, now_ns - 1, 1)
        return at if at is not None else neighbour(times, now_ns, -1)

    def ends_before(self, now_ns: int, step: int) -> bool:
        """Return whether the next one isn't here, but there may be more that way."""
        if self.search.condition or self.place(now_ns, step) is not None:
            return False  # of a condition the newest are told, wherever one asks from
        return self.before > 0 if step < 0 else self.before + len(self.moments) < self.total


async def look(
    source: HeldRows, plots: Sequence[Plotted], search: Search, bounds: Mapping[str, Bounds4], around_ns: int
) -> SearchResult:
    """Look through all that is held of some entries, for the moments next to a time. Raises a SiloError."""
    if search.what in LETTERS:
        return _happened(source, plots, search)
    looking = {}
    for plotted in plots:
        one = search.looking(source.period_ns(plotted.element.name), inner(bounds, plotted.name))
        if one is not None and not (search.what is What.OUTSIDE and one.bounds == (None, None)):
            looking[plotted.name] = one
    names = tuple(plotted.name for plotted in plots)
    if not looking:
        return SearchResult(search, names, source.end_ns, (), 0.0, 0, 0, "no limits are set on these signals")
    most = max(1, min(MOST_MOMENTS, 10_000 // len(looking)))
    found, partly = await source.find(looking, around_ns, most)
    entries = {plotted.name: plotted.entry for plotted in plots}
    begins = [one.begin_ns for one in found.values() if one.end_ns]
    ends = [one.end_ns for one in found.values() if one.end_ns]
    held_s = (max(ends) - min(begins)) / 1e9 if ends else 0.0
    moments, before, total = merged(found, entries, search.what)
    return SearchResult(search, names, source.end_ns, moments, held_s, total, before, partly)


def merged(
    found: Mapping[str, FoundIn], entries: Mapping[str, Entry], what: What
) -> tuple[tuple[Moment, ...], int, int]:
    """Return the moments of several signals in the order of time, how many come before them, and how many there are.

    Only where those of every signal are known: what lies beyond is asked for when one goes there.
    """
    first = max((int(one.time_ns[0]) for one in found.values() if one.before and len(one.time_ns)), default=None)
    last = min(
        (int(one.time_ns[-1]) for one in found.values() if one.before + len(one.time_ns) < one.total), default=None
    )
    moments: list[Moment] = []
    before = 0
    for name, one in found.items():
        begin = 0 if first is None else int(np.searchsorted(one.time_ns, first, "left"))
        stop = len(one.time_ns) if last is None else int(np.searchsorted(one.time_ns, last, "right"))
        before += one.before + begin
        moments += [
            Moment(int(one.time_ns[at]), name, "", _Told(entries[name], one.values[at : at + 1], what))
            for at in range(begin, stop)
        ]
    moments.sort(key=lambda moment: moment.time_ns)
    return tuple(moments), before, sum(one.total for one in found.values())


@dataclass(frozen=True)
class _Told:
    """What is said of a moment, made when it is looked at."""

    entry: Entry
    value: np.ndarray
    what: What

    def __call__(self) -> str:
        if self.what is What.HOLE:
            return f"{text.span(int(self.value[0]) / 1e9, 3)} without sample"
        return value_words(self.entry, self.value)


def turned(search: Search, tried: "TriggerTried", end_ns: int) -> SearchResult:
    """Return the moments until a time at which a condition turned true, as a test of it found them.

    The test judged what is held now: of a pause that may be nothing any more, and only the newest are told.
    """
    moments = tuple(Moment(time_ns, "", "turns true") for time_ns in tried.time_ns if time_ns <= end_ns)
    older = tried.fires - len(tried.time_ns)
    gone, unseen = tried.begin_ns > end_ns, older > 0 and not moments
    held_s = 0.0 if gone or unseen else max(0, min(tried.end_ns, end_ns) - tried.begin_ns) / 1e9
    lost = "the logger has overwritten what is held here" if gone else "only later ones are told" if unseen else ""
    return SearchResult(search, (), end_ns, moments, held_s, older + len(moments), older, tried.why or lost)


def _happened(source: HeldRows, plots: Sequence[Plotted], search: Search) -> SearchResult:
    moments = happened(source, source.begin_ns, source.end_ns, LETTERS[search.what])
    names = tuple(plotted.name for plotted in plots)
    held_s = (source.end_ns - source.begin_ns) / 1e9
    return SearchResult(search, names, source.end_ns, tuple(moments), held_s, len(moments))


async def events(
    source: HeldRows, plots: Sequence[Plotted], bounds: Mapping[str, Bounds4], around_ns: int
) -> SearchResult:
    """Look for all that is an event, whichever: long holes, and what happened."""
    found = await look(source, plots, Search(What.HOLE, least_s=HOLE_S), bounds, around_ns)
    more = happened(source, source.begin_ns, source.end_ns, EVENTS, {plotted.name for plotted in plots})
    moments = sorted([*found.moments, *more], key=lambda moment: moment.time_ns)
    held_s = max(found.held_s, (source.end_ns - source.begin_ns) / 1e9)
    return replace(found, moments=tuple(moments), held_s=held_s, total=found.total + len(more))


def value_words(entry: Entry, value: np.ndarray) -> str:
    """Return one value, shape `(1,)`, as it is read."""
    if value.dtype.kind in "SU":
        word = value[0]
        return text.clean(word.decode("utf-8", "backslashreplace") if isinstance(word, bytes) else str(word))
    found = numbers(value)
    return offset_text(entry, float(found.offsets[0]), found.base, 14)

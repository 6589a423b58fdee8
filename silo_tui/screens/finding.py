"""Find the moment, for the monitor: it asks for samples, looks through them in a thread, and keeps what was found."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from silo.model import Entry
from silo.values import numbers
from silo_tui.model import text
from silo_tui.model.find import (
    EVENT_SOURCES,
    OTHERS,
    WORDS,
    Moment,
    Search,
    What,
    happened,
    neighbour,
    places_of,
)
from silo_tui.model.live import offset_text
from silo_tui.model.plots import Plotted
from silo_tui.model.source import PlotSource, Samples
from silo_tui.screens.dialogs import Choice

MOST_MOMENTS = 100_000
NONE_YET = {
    What.OUTSIDE: "no limits are set on these signals",
    What.TRIGGER: "there are no triggers",
    What.MARKER: "there are no markers",
}


@dataclass(frozen=True)
class Found:
    """What a search came to: moments in the order of time, and how much was looked through."""

    search: Search
    names: tuple[str, ...]
    end_ns: int
    moments: tuple[Moment, ...]
    held_s: float

    def none(self, older_gone: bool) -> str:
        """Return what to say when nothing was found."""
        if self.search.what in EVENT_SOURCES and not EVENT_SOURCES[self.search.what]:
            return f"{WORDS[self.search.what]}: none, {NONE_YET[self.search.what]}"
        gone = "; older rows are not in this pause" if older_gone else ""
        return f"{self.search.words}: none in {text.span(float(f'{self.held_s:.3g}'))} held{gone}"

    def place(self, now_ns: int, step: int) -> int | None:
        """Return which moment to go to; of the first of a search the next one, or else the last before."""
        times = [moment.time_ns for moment in self.moments]
        if step:
            return neighbour(times, now_ns, step)
        at = neighbour(times, now_ns - 1, 1)
        return at if at is not None else neighbour(times, now_ns, -1)


async def look(source: PlotSource, plots: Sequence[Plotted], search: Search, begin_ns: int, end_ns: int) -> Found:
    """Look through all samples of some entries from one time to another. Raises a SiloError where there are none."""
    names = tuple(plotted.name for plotted in plots)
    moments: list[Moment] = []
    first, last = end_ns, begin_ns
    for plotted in plots:
        found = await source.samples(plotted.name, begin_ns, end_ns)
        period_ns = source.period_ns(plotted.element.name)
        moments += await asyncio.to_thread(_moments, plotted, search, found, period_ns)
        if len(found[0]):
            first, last = min(first, int(found[0][0])), max(last, int(found[0][-1]))
    for ask in EVENT_SOURCES.get(search.what, ()):
        moments += await ask(source, names, begin_ns, end_ns)
    moments.sort(key=lambda moment: moment.time_ns)
    return Found(search, names, end_ns, tuple(moments), max(0, last - first) / 1e9)


async def events(source: PlotSource, plots: Sequence[Plotted], begin_ns: int, end_ns: int) -> Found:
    """Look for all that is an event, whichever: holes, and what any of the sources knows."""
    found = await look(source, plots, Search(What.HOLE), begin_ns, end_ns)
    moments = list(found.moments)
    for sources in EVENT_SOURCES.values():
        for ask in sources:
            moments += await ask(source, found.names, begin_ns, end_ns)
    moments += happened(source, begin_ns, end_ns, OTHERS)
    moments.sort(key=lambda moment: moment.time_ns)
    return Found(found.search, found.names, end_ns, tuple(moments), found.held_s)


def _moments(plotted: Plotted, search: Search, samples: Samples, period_ns: int) -> list[Moment]:
    time_ns, values = samples
    places = places_of(search, time_ns, values, period_ns)[:MOST_MOMENTS]
    if search.what is What.HOLE:
        lengths = np.diff(time_ns)
        return [
            Moment(int(time_ns[at]), plotted.name, f"{text.span(float(f'{lengths[at] / 1e9:.3g}'))} without sample")
            for at in places.tolist()
        ]
    return [Moment(int(time_ns[at]), plotted.name, value_words(plotted.entry, values[at : at + 1])) for at in places]


def value_words(entry: Entry, value: np.ndarray) -> str:
    """Return one value, shape `(1,)`, as it is read."""
    if value.dtype.kind in "SU":
        word = value[0]
        return text.clean(word.decode("utf-8", "backslashreplace") if isinstance(word, bytes) else str(word))
    found = numbers(value)
    return offset_text(entry, float(found.offsets[0]), found.base, 14)


def choices(unit_value: str) -> list[Choice]:
    """Return what can be looked for; `unit_value` is what the signal has at the cursor."""
    found = []
    for what in What:
        none = what in EVENT_SOURCES and not EVENT_SOURCES[what]
        more = f" (at the cursor: {unit_value})" if what is What.CROSSING and unit_value else ""
        found.append(Choice(what.value, f"{WORDS[what]}{more}{': none' if none else ''}", what.value))
    return found

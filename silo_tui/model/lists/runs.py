"""The list of runs as rows of text, and several runs over each other as one log.

Plain functions; nothing is asked or drawn here.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from silo.analysis.compare import HEADS, SignalDifference
from silo.analysis.log import Log, run_begins
from silo.analysis.stretches import resampled
from silo.core.elements import LoggedEvent
from silo.core.quantities.writing import and_more, many
from silo.core.recording import RecordedElement, Recording, stamps_of
from silo.errors import ElementError
from silo.run_index.listed import ListedRun
from silo_tui.model.lists.ordering import Order
from silo_tui.model.words import text
from silo_tui.model.words.names import below, cells, fitting_names

Key = Callable[[ListedRun], float]
MOST_TICKS = 2_000_000
ALL_COLUMNS = 100  # of characters
NAME_WIDTH = 22  # at least
SAID_WIDTH = 20  # at least, where there is anything to be said
VALUE_WIDTH = 12

ORDERS: tuple[Order[ListedRun], ...] = (
    Order("begun", "b", "begun, the newest first", lambda one: (one.facts.begun_ns, one.facts.path), True),
    Order("name", "n", "name", lambda one: one.facts.path.casefold()),
    Order("task", "k", "task", lambda one: (one.facts.task.casefold(), -one.facts.begun_ns)),
    Order("span", "s", "span, the longest first", lambda one: one.facts.span_s, True),
    Order("lost", "l", "lost, the most first", lambda one: one.facts.lost, True),
)


def told(one: ListedRun) -> str:
    """Return what a filter looks in: name, robot, task, why, tags, notes, episodes."""
    facts = one.facts
    said = (facts.path, facts.kind, facts.robot, facts.task, facts.why, *one.tags, *one.notes, *facts.about.values(),
            *one.others)  # fmt: skip
    return " ".join([*said, *(f"{each.name} {each.verdict}" for each in facts.episodes)])


def is_condition(words: str) -> bool:
    """Whether a filter is a condition on what was measured: `max(tau) > 30`."""
    return any(letter in words for letter in "<>=(")


class Widths(NamedTuple):
    """The cells of the name in a list of runs, and whether it has columns for episodes and tasks."""

    name: int
    episodes: bool
    task: bool


def widths(found: Sequence[ListedRun], width: int, columns: int) -> Widths:
    """Return the widths of the columns beside a scrollbar: names whole where they fit, what no run has takes none."""
    episodes, task = any(one.facts.episodes for one in found), any(one.facts.task for one in found)
    said = min(max(SAID_WIDTH, width // 4), max((cells(one.said) for one in found), default=0))
    room = width - 41 - columns * (VALUE_WIDTH + 1) - 6 * episodes - 9 * task - (said and said + 1)
    longest = max((cells(one.facts.path) for one in found), default=0)
    return Widths(max(NAME_WIDTH, min(room, longest)), episodes, task)


def head(widths: Widths, columns: Sequence[str] = ()) -> str:
    """Return the titles of the columns."""
    titles = ("run", "begun", "span", "lost", "limits", "eps", "task", "said")
    return "  " + _line(titles, fitting_names(columns, VALUE_WIDTH), widths)


def row(one: ListedRun, name: str, widths: Widths, now_s: float, values: Sequence[float] = ()) -> str:
    """Return a row, without the gutter; `name` as it fits."""
    facts = one.facts
    good = sum(each.success is True for each in facts.episodes)
    told = (
        name, text.day_and_time(facts.begun_ns, now_s), text.span(facts.span_s, 3),
        text.count(facts.lost) if facts.lost else "", str(facts.limits or ""),
        f"{good}/{len(facts.episodes)}" if facts.episodes else "", text.clean(facts.task),
        one.said,
    )  # fmt: skip
    return _line(told, ["-" if math.isnan(value) else text.short(value, 5) for value in values], widths)


def _line(told: tuple[str, ...], values: Sequence[str], widths: Widths) -> str:
    name, begun, span, lost, limits, episodes, task, said = told
    shown = "".join(f" {value:>{VALUE_WIDTH}}" for value in values) + (f" {episodes:>5}" if widths.episodes else "")
    kinds = f" {task:<8.8}" if widths.task else ""
    return f"{name:<{widths.name}} {begun:<14} {span:>8}{shown} {lost:>6} {limits:>6}{kinds} {said}".rstrip()


COMPARED: tuple[Order[SignalDifference], ...] = (
    Order("different", "d", "the most different first: by the rms, for how far it moves", lambda one: 0),
    Order("name", "n", "name", lambda one: one.name.casefold()),
    Order("largest", "a", "the largest difference first", lambda one: one.largest, True),
    Order("differ", "f", "how much of it differs, the most first", lambda one: one.differ, True),
)


class Differences:
    """What differs between two runs as lines of so many cells: a head, and a row for each signal."""

    def __init__(self, found: Sequence[SignalDifference], prefix: str, width: int) -> None:
        # names before all else: where there is no room for all of it, without units and means
        columns = range(1, len(HEADS)) if width >= ALL_COLUMNS else (2, 3, 4, 6)
        self._sizes = {at: max(len(HEADS[at]), *(len(one.cells[at]) for one in found)) for at in columns if found}
        self._room = width - sum(size + 2 for size in self._sizes.values())
        names = fitting_names([below(prefix, one.name) for one in found], self._room)
        self._names = dict(zip((one.name for one in found), names, strict=True))
        self.head = self._line("signal", HEADS)

    def row(self, one: SignalDifference) -> str:
        """Return the row of a signal."""
        return self._line(self._names[one.name], one.cells)

    def _line(self, name: str, cells: Sequence[str]) -> str:
        rest = "".join(f"  {cells[at]:{'<' if at == 1 else '>'}{size}}" for at, size in self._sizes.items())
        return f"{name:<{self._room}}{rest}"


class OneOfRuns(NamedTuple):
    """The element of a scalar of several runs over each other, what it is called there, and where the first begins."""

    recording: Recording
    names: list[str]
    start_ns: int


def of_one(logs: Sequence[tuple[str, Log]], signal: str) -> OneOfRuns | None:
    """Return the element of a scalar over each other; None of a derived one. Raises ElementError."""
    elements = logs[0][1].recording.elements
    found = next((each for each in elements if signal in (entry.name for entry in each.entries)), None)
    if found is None:
        return None
    alone = []
    for run, log in logs:
        mine = [each for each in log.recording.elements if each.name == found.name]
        alone.append((run, Log(replace(log.recording, elements=mine), log.path)))
    names = [f"{found.name}/{run}{signal[len(found.name) :]}" for run, _ in logs]
    begun = run_begins([log for _, log in alone])
    first_ns = max(_extent_ns(log)[0] - at for (_, log), at in zip(alone, begun, strict=True))
    return OneOfRuns(together(alone), names, alone[0][1].start_ns - begun[0] - first_ns)


def together(logs: Sequence[tuple[str, Log]], event: str = "") -> Recording:
    """Return several runs as one log: each signal that all have once per run, `q/run3`, by the time since the start.

    It goes as far as all of them do. With the words of an event it is the time since the first such one of each.
    Raises ElementError.
    """
    starts = run_begins([log for _, log in logs])
    begun = [_begin_ns(name, log, event, start) for (name, log), start in zip(logs, starts, strict=True)]
    ends = [[end - at for end in _extent_ns(log)] for (_, log), at in zip(logs, begun, strict=True)]
    first, last = max(begin for begin, _ in ends), min(end for _, end in ends)
    if last <= first:
        told = "; ".join(
            f"{name} has samples from {begin * 1e-9:.3g} s to {end * 1e-9:.3g} s"
            for (name, _), (begin, end) in zip(logs, ends, strict=True)
        )
        raise ElementError(f"these runs have no time in common ({told}); choose others, or another event")
    step = max(min(int(np.median(np.diff(log.time_ns))) for _, log in logs), (last - first) // MOST_TICKS, 1)
    ticks = np.arange(first, last + 1, step, dtype=np.int64)
    shared = set.intersection(*({one.name for one in log.recording.elements if one.kind != "text"} for _, log in logs))
    elements, warnings = [], [f"all at {1e9 / step:.4g} Hz, as values held: samples and div are of that"]
    if max(end for _, end in ends) > last + step or min(begin for begin, _ in ends) < first - step:
        warnings.append(f"only from {first * 1e-9:.4g} to {last * 1e-9:.4g} s, the time that all of them have")
    for (name, log), at in zip(logs, begun, strict=True):
        mine = [one for one in resampled(log.recording, ticks + at, linear=False).elements if one.name in shared]
        none = [one.name for one in mine if not one.count]
        if none:
            warnings.append(
                f"{name} has no samples then of {many(len(none), 'signal')} of {len(mine)}: {and_more(none, 2)}"
            )
        elements += [_named(element, name) for element in mine]
    elements.sort(key=lambda one: one.name)
    at = int(np.searchsorted(ticks, 0))
    marks = (LoggedEvent("marker", event, tick=at, stamp_ns=-first),) if event and at < len(ticks) else ()
    prefix = logs[0][1].recording.prefix
    return Recording("runs", ticks - first, len(ticks), elements, prefix=prefix, events=marks, warnings=tuple(warnings))


def _extent_ns(log: Log) -> tuple[int, int]:
    """The first and the last moment that any signal has a sample of: of a long run buffers hold the end alone."""
    stamps = [stamps_of(log.recording, element) for element in log.recording.elements if element.count]
    return min(int(each[0]) for each in stamps), max(int(each[-1]) for each in stamps)


def _begin_ns(name: str, log: Log, event: str, start_ns: int) -> int:
    if len(log.time_ns) < 2 or not any(element.count > 1 for element in log.recording.elements):
        raise ElementError(f"{name} has no ticks that could lie over those of others")
    if not event:
        return start_ns
    found = next((one.time_ns for one in log.events if event.casefold() in one.words.casefold()), None)
    if found is None:
        raise ElementError(f"{name} has no event with '{event}'")
    return found


def _named(element: RecordedElement, run: str) -> RecordedElement:
    name = f"{element.name}/{run}"
    entries = tuple(replace(one, name=f"{name}{one.entry.suffix}") for one in element.entries)
    return replace(element, name=name, entries=entries)

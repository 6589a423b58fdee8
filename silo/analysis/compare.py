"""`silo.compare(a, b)`: what differs between two runs, signal by signal, as a table and as plots.

The runs are laid on each other by their starts, by an event in each, or by a signal that both have.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from silo.analysis.compute.arithmetic import in_common
from silo.analysis.compute.samples import in_order
from silo.analysis.log import Log
from silo.analysis.reports import table
from silo.analysis.signal import Signal
from silo.core import units
from silo.core.arguments import real, shown, text
from silo.core.arrays.values import with_nan
from silo.core.calls import told, told_class
from silo.core.printing import html_table
from silo.errors import ElementError

Event = Callable[[Log], "Signal | float"]

MOST_SHIFT_SAMPLES = 200_000  # of a signal by which runs are aligned
HEADS = ("signal", "unit", "largest", "at s", "rms", "mean", "differ")


@dataclass(frozen=True)
class SignalDifference:
    """One scalar of both runs, at the stamps of the faster one: `b - a`.

    `largest` is the largest absolute difference, at `at_s` seconds of the first run; `differ` is the share of samples
    that differ by more than the tolerance. NaN in both is no difference, in one of them it is one.
    """

    name: str
    unit: str
    largest: float
    at_s: float
    rms: float
    mean: float
    differ: float
    a: Signal
    b: Signal

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of a table."""
        numbers = (f"{self.largest:.4g}", f"{self.at_s:.6g}", f"{self.rms:.4g}", f"{self.mean:.4g}")
        return (self.name, self.unit, *numbers, f"{self.differ:.1%}")


@told_class("comparison")
@dataclass(frozen=True)
class Comparison:
    """What differs between two runs: `rows`, the most different first. Print it, or `plot()` it.

    `shift_s` is how far the second run was moved. `alike` counts the signals without a difference, `only_a` and
    `only_b` are names that one run has, `not_compared` says of others why not. `partly` says of signals that go on
    longer in one run which time both have.
    """

    rows: tuple[SignalDifference, ...]
    shift_s: float
    alike: int
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    not_compared: dict[str, str]
    partly: dict[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.rows)

    def __bool__(self) -> bool:
        """Whether anything differs."""
        return bool(self.rows or self.only_a or self.only_b)

    def __str__(self) -> str:
        lines = table(HEADS, [row.cells for row in self.rows], 120, "llrrrrr") if self.rows else []
        return "\n".join([*lines, *self._notes()])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return html_table("differences of two runs", HEADS, [row.cells for row in self.rows], "; ".join(self._notes()))

    def _notes(self) -> list[str]:
        differ = "1 signal differs" if len(self.rows) == 1 else f"{len(self.rows)} signals differ"
        notes = [f"{differ}, {self.alike} {'is' if self.alike == 1 else 'are'} alike"]
        if self.shift_s:
            notes.append(f"the second run is moved by {self.shift_s:.6g} s")
        for which, names in (("first", self.only_a), ("second", self.only_b)):
            if names:
                more = f" and {len(names) - 5} more" if len(names) > 5 else ""
                notes.append(f"only in the {which}: {', '.join(names[:5])}{more}")
        for words, count in Counter(self.partly.values()).most_common(5):
            which = next(name for name, each in self.partly.items() if each == words)
            notes.append(f"{words}: {which}{f' and {count - 1} more' if count > 1 else ''}")
        notes += [f"not compared: {name}: {why}" for name, why in list(self.not_compared.items())[:10]]
        return notes

    def plot(self, name: str = "", **options: Any) -> Any:
        """Plot a signal of both runs.

        Args:
            name: which; the most different one by default.
            **options: those of `Signal.plot`.

        Returns:
            What `Signal.plot` returns.

        Raises:
            ElementError: nothing differs, or that signal doesn't.
        """
        text("name", name, 'comparison.plot("/log/joints/q_0")')
        found = [row for row in self.rows if not name or name in (row.name, row.name.split("/", 2)[-1])]
        if not found:
            raise ElementError(f"there is no difference of '{name}' to plot" if name else "nothing differs: no plot")
        row = found[0]
        one, other = (replace(each, name=f"{label}: {row.name}") for label, each in (("a", row.a), ("b", row.b)))
        return one.plot(other, **{"title": row.name, **options})


@told("silo.compare")
def compare(
    a: Log | str | int,
    b: Log | str | int,
    pattern: str = "*",
    *,
    event: Event | None = None,
    signal: str = "",
    tolerance: float = 0.0,
    by: Literal["start", "stamps"] = "start",
) -> Comparison:
    """Compare two runs: every scalar that both have, at the times that both have.

    `silo diff` compares values by the same rule.

    Args:
        a: a log, or what `open_log` takes.
        b: the other one.
        pattern: which elements.
        event: a function of a log that returns a mask (`lambda log: log["mode"] == "TROT"`), whose first truth is the
            same moment in both runs, or the time itself in seconds. By default their starts are.
        signal: name of a signal by whose course the runs are laid on each other.
        tolerance: by how much numbers may differ.
        by: `"start"` lays the starts of both on each other; `"stamps"` takes the time stamps as they are, for two files
            of one run.

    Returns:
        What differs, most different first; false where nothing does.

    Raises:
        ElementError: an event that isn't in both, a signal without a course, an argument out of range.
    """
    first, second = _log(a), _log(b)
    allowed = real("tolerance", tolerance, 0, float("inf"), "")
    shift_s = _shift(first, second, event, signal, by)
    if by == "stamps":
        second = Log(second.recording, second.path, first.start_ns)
    mine, theirs = dict.fromkeys(first.names(pattern)), dict.fromkeys(second.names(pattern))
    rows: list[SignalDifference] = []
    wrong: dict[str, str] = {}
    partly: dict[str, str] = {}
    alike = 0
    for name in [one for one in mine if one in theirs]:
        try:
            found, partly[name] = _differences(first[name], second[name], shift_s, allowed)
        except ElementError as error:
            wrong[name] = str(error)
            continue
        rows += [row for row in found if row.differ > 0]
        alike += sum(row.differ == 0 for row in found)
    rows.sort(key=lambda row: -_weight(row))
    only_a, only_b = (tuple(n for n in x if n not in y) for x, y in ((mine, theirs), (theirs, mine)))
    told = {name: words for name, words in partly.items() if words}
    return Comparison(tuple(rows), shift_s, alike, only_a, only_b, wrong, told)


def _log(given: Any) -> Log:
    from silo.analysis.opening import open_log

    return given if isinstance(given, Log) else open_log(given)


def _weight(row: SignalDifference) -> float:
    """How different a signal is, in multiples of how far it moves: metres and volts stand in one list."""
    spread = float(np.nanstd(row.a.values.astype(float))) if np.isfinite(row.a.values.astype(float)).any() else 0.0
    return row.rms / spread if spread > 0 else (float("inf") if row.rms else row.differ)


def _differences(one: Signal, other: Signal, shift_s: float, tolerance: float) -> tuple[list[SignalDifference], str]:
    """The scalars of a signal of both, and which time both have where one goes on longer."""
    if one.values.dtype.kind not in "biufc" or other.values.dtype.kind not in "biufc":
        raise ElementError("its values are no numbers")
    other = in_order(other, one.components)
    if one.components != other.components:
        raise ElementError(f"components {one.components or 'none'} and {other.components or 'none'}")
    if not units.same(one.unit, other.unit) and {one.unit, other.unit}.isdisjoint(("", "-")):
        other = other.in_unit(one.unit)
    if shift_s:
        other = replace(other, start_ns=other.start_ns - round(shift_s * 1e9))
    mine, theirs, span = in_common(one, other)
    if len(mine) == 0:
        raise ElementError("there is no sample in common")
    whole = (one, other.as_if_started(one.start_ns))
    if not one.components:
        return [_difference(mine, theirs, tolerance, *whole)], span
    every = [[each.component(place) for each in (mine, theirs, *whole)] for place in range(len(one.components))]
    return [_difference(a, b, tolerance, c, d) for a, b, c, d in every], span


def _difference(mine: Signal, theirs: Signal, tolerance: float, one: Signal, other: Signal) -> SignalDifference:
    """Of two signals at the same stamps; `one` and `other` are the whole ones, for a plot."""
    first, second = with_nan(mine.values), with_nan(theirs.values)
    gap = second.astype(float) - first.astype(float)
    same = (first == second) | (np.isnan(first.astype(float)) & np.isnan(second.astype(float)))
    gap = np.where(same, 0.0, gap)
    differ = ~(np.abs(gap) <= tolerance)
    sizes = np.where(np.isnan(gap), np.inf, np.abs(gap))
    where = int(np.argmax(sizes))
    known = gap[np.isfinite(gap)]
    rms, mean = (float(np.sqrt(np.mean(known**2))), float(known.mean())) if len(known) else (np.nan, np.nan)
    return SignalDifference(
        one.name, one.unit, float(sizes[where]), float(mine.times[where]), rms, mean, float(differ.mean()), one, other
    )


def _shift(a: Log, b: Log, event: Event | None, signal: str, by: str) -> float:
    """By how many seconds the second run is moved."""
    if by not in ("start", "stamps"):
        raise ElementError(f"by must be 'start' or 'stamps', got {shown(by)}")
    if by == "stamps" and (event is not None or signal):
        raise ElementError("by='stamps' leaves both runs where they are: leave out event= and signal=")
    if event is not None and signal:
        raise ElementError("compare takes event= or signal=, not both")
    if event is not None:
        if not callable(event):
            raise ElementError(
                f"event must be a function of a log, got {shown(event)}; write event=lambda log: log['x'] > 1"
            )
        return _moment(a, event, "first") - _moment(b, event, "second")
    if not text("signal", signal, 'signal="/log/joints/q_0"'):
        return 0.0
    return _by_course(a[signal], b[signal])


def _moment(log: Log, event: Event, which: str) -> float:
    found = event(log)
    if isinstance(found, Signal):
        moments = found.when()
        if not len(moments):
            raise ElementError(f"the event '{found.name}' doesn't happen in the {which} run, which {found.span}")
        return float(moments[0])
    return real(f"the time of the event in the {which} run", found, -1e9, 1e9, "s")


def _by_course(one: Signal, other: Signal) -> float:
    """The shift at which two courses are most alike: the peak of their cross-correlation."""
    if one.values.ndim > 1 or other.values.ndim > 1:
        raise ElementError(f"'{one.name}' has components: name one of them, such as '{one.name}_{one.components[0]}'")
    if len(one) < 2 or len(other) < 2:
        raise ElementError(f"'{one.name}' has too few samples to lay runs on each other by it")
    step_s = min(one.step_ns, other.step_ns) * 1e-9
    one, other = one.in_order(), other.in_order()
    spans = [each.times[-1] - each.times[0] for each in (one, other)]
    step_s = max(step_s, max(spans) / MOST_SHIFT_SAMPLES)
    courses = []
    for each in (one, other):
        grid = np.arange(each.times[0], each.times[-1] + step_s / 2, step_s)
        values = np.nan_to_num(np.interp(grid, each.times, each.columns("align by")[0]))
        courses.append(values - values.mean())
    if not all(course.any() for course in courses):
        raise ElementError(f"'{one.name}' stands still in a run: runs can't be laid on each other by it")
    size = 1 << (len(courses[0]) + len(courses[1]) - 1).bit_length()
    spectra = [np.fft.rfft(course, size) for course in courses]
    likeness = np.fft.irfft(spectra[0] * np.conj(spectra[1]), size)
    best = int(np.argmax(likeness))
    steps = best - size if best > size // 2 else best
    return float(one.times[0] - other.times[0] + steps * step_s)

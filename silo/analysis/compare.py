"""`silo.compare(a, b)`: what differs between two runs, signal by signal, as a table and as plots.

The runs are laid on each other by their starts, by an event in each, or by a signal that both have.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute.arithmetic import in_common
from silo.analysis.compute.samples import Samples, in_order
from silo.analysis.log import Log, run_begins, time_facts
from silo.analysis.plots.curves import text_of
from silo.analysis.reports import table, type_text
from silo.analysis.signal import Signal
from silo.core import units
from silo.core.arguments import real, shown, text
from silo.core.arrays.enumerations import contradiction, to_compare
from silo.core.arrays.values import as_floats, difference, from_base
from silo.core.calls import told, told_class, told_names
from silo.core.quantities.writing import and_more, count, html_table, many
from silo.core.recording import RecordedElement, Recording, falls, stamps_of
from silo.errors import ElementError

Event = Callable[[Log], "Signal | float"]

_CELLS = 1 << 20  # of signals that are looked at together
_NEVER_NS = 2**62  # later than any stamp, and room to move it
MOST_SHIFT_SAMPLES = 200_000  # of a signal by which runs are aligned
HEADS = ("signal", "unit", "largest", "at s", "rms", "mean", "differ")


@dataclass(frozen=True)
class SignalDifference:
    """One scalar of both runs, at the stamps of the faster one: `b - a`.

    `largest` is the largest absolute difference, at `at_s` seconds of the first run; `differ` is the share of samples
    that differ by more than the tolerance, `count` of `samples`, from `first_s` on. NaN in both is no difference, in
    one of them it is one; `most` is the largest difference of numbers. Texts differ or don't, as do the words of
    enumerations whose numbers are others in the second run.
    """

    name: str
    unit: str
    largest: float
    at_s: float
    rms: float
    mean: float
    differ: float
    count: int
    samples: int
    first_s: float
    most: float
    _weight: float = field(repr=False, compare=False)
    _signals: Callable[[], tuple[Signal, Signal]] = field(repr=False, compare=False)

    @property
    def a(self) -> Signal:
        """The signal of the first run."""
        return self._signals()[0]

    @property
    def b(self) -> Signal:
        """That of the second, moved and in the unit of the first."""
        return self._signals()[1]

    @property
    def facts(self) -> dict[str, str | float | int | None]:
        """What `silo compare --json` has of it; None for what is no finite number."""
        found = {key: value for key, value in vars(self).items() if not key.startswith("_")}
        return {
            key: None if isinstance(value, float) and not np.isfinite(value) else value for key, value in found.items()
        }

    @property
    def words(self) -> str:
        """What differs, in a line of `silo diff`."""
        size = f", by at most {self.most:.6g}" if self.most > 0 else ""
        return f"{count(self.count)} of {many(self.samples, 'sample')} differ{size}, first at {self.first_s:.6g} s"

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of a table."""
        numbers = (f"{self.largest:.4g}", f"{self.at_s:.6g}", f"{self.rms:.4g}", f"{self.mean:.4g}")
        return (self.name, self.unit, *numbers, f"{self.differ:.1%}")


_ROWS = "for row in comparison: row.name, row.rms, row.largest; the most different first"
_OTHER_NAMES = {
    **dict.fromkeys(("equal", "same", "differs"), "bool(comparison) says whether anything differs"),
    **dict.fromkeys(("diff", "differences", "signals", "worst", "max", "items", "to_pandas", "to_dict"), _ROWS),
}


class NoMomentError(ElementError):
    """An event by which runs are laid on each other doesn't happen in `which` of them, the first or the second."""

    def __init__(self, text: str, which: str) -> None:
        super().__init__(text)
        self.which = which


@told_names("a comparison", _OTHER_NAMES)
@told_class("comparison")
@dataclass(frozen=True)
class Comparison:
    """What differs between two runs: `rows`, the most different first. Print it, or `plot()` it.

    `shift_s` is how far the second run was moved. `alike` counts the entries without a difference, `only_a` and
    `only_b` are names that one run has, `not_compared` says of others why not. `partly` says of signals that go on
    longer in one run which time both have, and of enumerations whose words have other numbers which. `laid` says how
    the starts of the runs meet where a file holds no more than the end of its run.
    """

    rows: tuple[SignalDifference, ...]
    shift_s: float
    alike: int
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    not_compared: dict[str, str]
    partly: dict[str, str] = field(default_factory=dict)
    laid: str = ""

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[SignalDifference]:
        return iter(self.rows)

    def __bool__(self) -> bool:
        """Whether anything differs."""
        return bool(self.rows or self.only_a or self.only_b)

    @property
    def blind(self) -> bool:
        """Whether nothing could be compared, so that nothing is known to be alike."""
        return not (self or self.alike) and bool(self.not_compared)

    @property
    def weight(self) -> tuple[float, float]:
        """How different the most different signal is: in multiples of how far it moves, and in its unit; 0 for none."""
        return (self.rows[0]._weight, self.rows[0].rms) if self.rows else (0.0, 0.0)

    def __str__(self) -> str:
        lines = table(HEADS, [row.cells for row in self.rows], 120, "llrrrrr") if self.rows else []
        return "\n".join([*lines, self.counted, *self.notes])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return html_table(
            "differences of two runs", HEADS, [row.cells for row in self.rows], "; ".join([self.counted, *self.notes])
        )

    @property
    def counted(self) -> str:
        """How many entries differ, in which order they stand, how many are alike, how many could not be compared."""
        differ = "1 entry differs" if len(self.rows) == 1 else f"{len(self.rows)} entries differ"
        order = " (first the largest rms for how far it moves)" if len(self.rows) > 1 else ""
        blind = f", {many(len(self.not_compared), 'signal')} not compared" if self.not_compared else ""
        return f"{differ}{order}, {self.alike} {'is' if self.alike == 1 else 'are'} alike{blind}"

    @property
    def notes(self) -> list[str]:
        """What else is to be said: of the shift, of signals of one run alone, of those compared partly or not."""
        notes = []
        if self.shift_s:
            notes.append(f"the second run is moved by {self.shift_s:.6g} s")
        notes += [self.laid] if self.laid else []
        reasons: dict[str, dict[str, str]] = {}
        for name, why in self.not_compared.items():
            reasons.setdefault(why.partition(";")[0], {})[name] = why
        for of in reasons.values():  # the reason first, as of the names there may be no room for all
            first, why = next(iter(of)), next(iter(of.values())).removeprefix("can't compare them: ")
            alike = len(set(of.values())) == 1
            which = and_more(list(of), 3) if alike else f"{first}, the like of {len(of) - 1} more"
            notes.append(f"not compared: {why}: {which}")
        for which, names in (("first", self.only_a), ("second", self.only_b)):
            if names:
                notes.append(f"only in the {which}: {and_more(names, 5)}")
        for words, times in Counter(self.partly.values()).most_common(5):
            which = next(name for name, each in self.partly.items() if each == words)
            notes.append(f"{words}: {which}{f' and {times - 1} more' if times > 1 else ''}")
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
    episode: str | int = "",
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
        by: `"start"` lays the starts of both runs on each other, also where their files hold the end alone (of two
            captures their first samples); `"stamps"` takes the time stamps as they are, for two files of one run.
        episode: compare this episode of both, from its beginning on: the first of a name, or a number.

    Returns:
        What differs, most different first; false where nothing does.

    Raises:
        ElementError: an event that isn't in both, a signal without a course, an argument out of range.
    """
    first, second = (_episode(one, episode) for one in (_log(a), _log(b)))
    allowed = real("tolerance", tolerance, 0, float("inf"), "")
    shift_s = _shift(first, second, event, signal, by)
    if by == "stamps":
        second = Log(second.recording, second.path, first.start_ns)
    mine, theirs = dict.fromkeys(first.names(pattern)), dict.fromkeys(second.names(pattern))
    rows: list[SignalDifference] = []
    wrong: dict[str, str] = {}
    partly: dict[str, str] = {}
    alike = 0
    for one in _compared(first, second, [name for name in mine if name in theirs], shift_s, allowed):
        rows += one.rows
        alike += one.alike
        if one.wrong:
            wrong[one.name] = one.wrong
        elif one.span:
            partly[one.name] = one.span
    rows.sort(key=lambda row: -row._weight)
    only_a, only_b = (tuple(n for n in x if n not in y) for x, y in ((mine, theirs), (theirs, mine)))
    laid = _laid(first, second) if by == "start" and event is None and not signal else ""
    return Comparison(tuple(rows), shift_s, alike, only_a, only_b, wrong, partly, laid)


class Difference(msgspec.Struct, frozen=True):
    """One difference between two logs: which signal, and what; or, with `differs` false, what is to be known of it."""

    name: str
    what: str
    differs: bool = True


def differences(
    a: Recording, b: Recording, tolerance: float = 0.0, by: Literal["start", "stamps"] = "start"
) -> list[Difference]:
    """Return how two logs differ: elements, what is known of them, stamps and values, these as `compare` does."""
    ours, theirs = ({element.name: element for element in each.elements} for each in (a, b))
    found = [Difference(name, "only in the first log") for name in ours if name not in theirs]
    found += [Difference(name, "only in the second log") for name in theirs if name not in ours]
    if len(a.time_ns) != len(b.time_ns):
        found.append(Difference("time", f"{many(len(a.time_ns), 'tick')}, then {count(len(b.time_ns))}"))
    first = Log(a)
    second = Log(b, start_ns=first.start_ns if by == "stamps" else None)
    shift_s = _by_starts(first, second)
    for one in _compared(first, second, [name for name in ours if name in theirs], shift_s, tolerance):
        facts = zip(_facts(ours[one.name]), _facts(theirs[one.name]), strict=True)
        found += [Difference(one.name, f"{what}: {old}, then {new}") for (what, old), (_, new) in facts if old != new]
        found += [Difference(one.name, one.span, differs=False)] if one.span else []
        found += [Difference(one.name, one.wrong)] if one.wrong else []
        found += [Difference(row.name, row.words) for row in one.rows]
    return found


def _facts(element: RecordedElement) -> tuple[tuple[str, object], ...]:
    return (
        ("unit", element.unit),
        ("divider", element.divider),
        ("type", type_text(element)),
        ("samples", element.count),
        ("lost samples", element.lost),
        ("ticks that could not be read", element.failures.count),
    )


def _episode(log: Log, which: str | int) -> Log:
    """The part of a log that is an episode, counted from its beginning; all of it where none is asked for."""
    if which == "":
        return log
    found = [one for one in log.episodes if which in (one.name, one.number, str(one.number))]
    if not found:
        names = ", ".join(dict.fromkeys(one.name for one in log.episodes)) or "none"
        raise ElementError(f"{log.path or 'a run'} has no episode {shown(which)}; it has {names}")
    part = log.clip(found[0])
    return Log(part.recording, part.path, log.start_ns + round(found[0].start_s * 1e9))


def _log(given: Any) -> Log:
    from silo.analysis.opening import open_log

    return given if isinstance(given, Log) else open_log(given)


class _Pair(NamedTuple):
    """An element of both logs: the scalars that differ, how many don't, which time both have, or why neither.

    `span` says which words have other numbers, too.
    """

    name: str
    rows: Sequence[SignalDifference] = ()
    alike: int = 0
    span: str = ""
    wrong: str = ""


class _Scalar(NamedTuple):
    """A scalar of both logs that is to be looked at, at the places of both where they meet."""

    name: str
    unit: str
    values: tuple[NDArray[Any], NDArray[Any]]
    meeting: "_Meeting"
    signals: Callable[[], tuple[Signal, Signal]]

    @property
    def group(self) -> tuple[object, ...]:
        """What can be looked at together: plain numbers of one type each, at the same times."""
        types = [each.dtype for each in self.values]
        plain = all(each.kind in "bf" or (each.kind in "iu" and each.itemsize < 8) for each in types)
        if not plain or any(isinstance(each, np.ma.MaskedArray) for each in self.values):
            return (id(self.values),)
        return (id(self.meeting), *types)


class _Meeting(NamedTuple):
    """Where samples of two time bases meet: places in both (None: all), their times, the stamps of the other one as if
    it had started with the first, and which time that is where one goes on longer.
    """

    places: tuple[NDArray[np.int64], NDArray[np.int64]] | None
    times: NDArray[np.float64]
    moved_ns: NDArray[np.int64]
    span: str
    bases: tuple[NDArray[np.int64], NDArray[np.int64]]  # held, as they are known by where they lie


def _compared(a: Log, b: Log, names: Sequence[str], shift_s: float, tolerance: float) -> list[_Pair]:
    """Compare these signals of both. What has the same bytes at the same times is alike without a look at it."""
    met: dict[tuple[object, ...], _Meeting] = {}
    found: list[_Pair] = []
    groups: dict[tuple[object, ...], list[tuple[int, _Scalar]]] = {}
    # a log has the names of its elements first, in their order
    elements = [dict(zip(log, range(len(log.recording.elements)), strict=False)) for log in (a, b)]
    for name in names:
        try:
            scalars, made = _scalars(a, b, name, [each.get(name) for each in elements], shift_s, met)
        except ElementError as error:
            scalars, made = [], _Pair(name, wrong=str(error))
        for one in scalars:
            groups.setdefault(one.group, []).append((len(found), one))
        found.append(made)
    rows: dict[int, list[SignalDifference]] = {}
    for group in groups.values():
        step = max(1, _CELLS // max(1, len(group[0][1].values[0])))
        for begin in range(0, len(group), step):
            some = group[begin : begin + step]
            try:
                for place, row in _different([one for _, one in some], tolerance):
                    rows.setdefault(some[place][0], []).append(row)
            except ElementError as error:  # of texts beside numbers, which are looked at one by one
                found[some[0][0]] = _Pair(found[some[0][0]].name, wrong=str(error))
    return [
        one if place not in rows or one.wrong else one._replace(rows=rows[place], alike=one.alike - len(rows[place]))
        for place, one in enumerate(found)
    ]


def _scalars(
    a: Log, b: Log, name: str, places: Sequence[int | None], shift_s: float, met: dict[tuple[object, ...], _Meeting]
) -> tuple[list[_Scalar], _Pair]:
    """What is to be looked at of an element of both logs. Raises ElementError where they can't be compared."""
    ours, theirs = (
        None if place is None else log.recording.elements[place] for log, place in zip((a, b), places, strict=True)
    )
    starts = a.start_ns, b.start_ns
    if ours is not None and theirs is not None and _same_kind(ours, theirs):
        stamps = stamps_of(a.recording, ours), stamps_of(b.recording, theirs)
        meeting = _meeting(name, stamps, starts, shift_s, met, lambda: (time_facts(a, ours), time_facts(b, theirs)))
        if meeting.places is None and _same_bytes(ours, theirs):
            return [], _Pair(name, alike=len(ours.entries))
        if len(ours.entries) == 1 and not ours.shape and ours.entries[0].values.ndim == 1:
            values = ours.entries[0].values, theirs.entries[0].values

            def signals() -> tuple[Signal, Signal]:
                return _signals(a[name], b[name], shift_s, met)[0]

            return [_Scalar(name, ours.unit, values, meeting, signals)], _Pair(name, alike=1, span=meeting.span)
    one, other = a[name], b[name]
    if not len(one) and not len(other):
        return [], _Pair(name)
    (one, other), meeting = _signals(one, other, shift_s, met)
    every = [(one, other)]
    if one.components:
        every = [(one.component(place), other.component(place)) for place in range(len(one.components))]
    words = dict.fromkeys(contradiction(*(each.labels for each in pair)) for pair in every)
    told = [meeting.span, *(f"compared by words, whose numbers differ: {each}" for each in words if each)]
    return [_Scalar(pair[0].name, pair[0].unit, _by_words(*pair), meeting, _always(pair)) for pair in every], _Pair(
        name, alike=len(every), span="; ".join(filter(None, told))
    )


def _by_words(one: Signal, other: Signal) -> tuple[NDArray[Any], NDArray[Any]]:
    """The values of two signals, as texts where their enumerations contradict each other."""
    mine, theirs = to_compare(one.labels, other.labels)
    if mine == theirs:
        return one.values, other.values
    return replace(one, labels=mine).texts, replace(other, labels=theirs).texts


def _always(pair: tuple[Signal, Signal]) -> Callable[[], tuple[Signal, Signal]]:
    return lambda: pair


def _same_kind(one: RecordedElement, other: RecordedElement) -> bool:
    known, theirs = (
        (each.unit, each.kind, each.shape, each.count, [entry.entry.labels or None for entry in each.entries])
        for each in (one, other)
    )
    return bool(one.count) and known == theirs


def _same_bytes(one: RecordedElement, other: RecordedElement) -> bool:
    for mine, theirs in zip(one.entries, other.entries, strict=True):
        values = mine.values, theirs.values
        if mine.entry.suffix != theirs.entry.suffix or values[0].dtype != values[1].dtype:
            return False
        if any(isinstance(each, np.ma.MaskedArray) for each in values) or values[0].tobytes() != values[1].tobytes():
            return False
    return True


def _meeting(
    name: str,
    stamps: tuple[NDArray[np.int64], NDArray[np.int64]],
    starts: tuple[int, int],
    shift_s: float,
    met: dict[tuple[object, ...], _Meeting],
    when: Callable[[], tuple[Mapping[str, Any], Mapping[str, Any]]],
) -> _Meeting:
    """Where two time bases meet, found once for each pair of them. Raises ElementError where there is no such time."""
    key = tuple((each.__array_interface__["data"][0], each.strides, len(each)) for each in stamps)
    if key in met:
        return met[key]
    # its own places are the values of each: what is common has the places of both
    one, other = (
        Samples(name, np.arange(len(each)), each, start_ns=start, **some)
        for each, start, some in zip(stamps, starts, when(), strict=True)
    )
    if shift_s:
        other = replace(other, start_ns=other.start_ns - round(shift_s * 1e9))
    mine, theirs, span = in_common(_of_one_sample(one, other._step_ns), _of_one_sample(other, one._step_ns))
    if len(mine) == 0:
        raise ElementError("there is no sample in common")
    each_with_each = np.array_equal(mine.values, one.values) and np.array_equal(theirs.values, other.values)
    places = None if each_with_each else (mine.values, theirs.values)
    moved = other._met(one)
    if one._in_hole(moved.time_ns).any() or moved._in_hole(one.time_ns).any():
        span = "; ".join(filter(None, [span, "not where it was off, overwritten or not recorded, in one of them"]))
    moved_ns = moved.time_ns
    return met.setdefault(key, _Meeting(places, mine.times, moved_ns, span, stamps))


def _of_one_sample(one: Samples, step_ns: float) -> Samples:
    """A single sample holds until the next would have come; of a run of one tick until the other run's next one."""
    axis = one.axis_ns
    if axis is None or len(one) != 1 or falls(axis):
        return one
    ticks, early = 1, 0.0
    if len(axis) > 1:
        ticks, early, step_ns = one.divider, 0.5, float(np.median(np.diff(axis)))  # the other run's clock may be early
    if not np.isfinite(step_ns):
        return one
    due = int(np.searchsorted(axis, one.time_ns[0])) + ticks
    beyond = due - (len(axis) - 1)
    until_ns = int(axis[due]) if beyond <= 0 else int(axis[-1]) + int((beyond - early) * step_ns)
    return replace(one, _holes=((until_ns, _NEVER_NS),))


def _signals(
    one: Signal, other: Signal, shift_s: float, met: dict[tuple[object, ...], _Meeting]
) -> tuple[tuple[Signal, Signal], _Meeting]:
    other = in_order(other, one.components)
    if one.components != other.components:
        raise ElementError(f"components {one.components or 'none'} and {other.components or 'none'}")
    if not units.same(one.unit, other.unit) and {one.unit, other.unit}.isdisjoint(("", "-")):
        other = other.to(one.unit)
    stamps, starts = (one.time_ns, other.time_ns), (one.start_ns, other.start_ns)
    meeting = _meeting(one.name, stamps, starts, shift_s, met, lambda: (one._when, other._when))
    return (one, replace(other, time_ns=meeting.moved_ns, start_ns=one.start_ns, _began=one._began)), meeting


def _different(scalars: Sequence[_Scalar], tolerance: float) -> Iterator[tuple[int, SignalDifference]]:
    """Those of one group that differ where both logs have them, by their places."""
    meeting = scalars[0].meeting
    first, second = (
        np.stack([one.values[side] for one in scalars]) if len(scalars) > 1 else scalars[0].values[side][None]
        for side in (0, 1)
    )
    whole = first
    if meeting.places is not None:
        first, second = first[:, meeting.places[0]], second[:, meeting.places[1]]
    gaps = _gap(first, second) if len(scalars) > 1 else _gap(first[0], second[0])[None]
    with np.errstate(invalid="ignore"):
        differ = ~(np.abs(gaps) <= tolerance)
    (places,) = np.nonzero(differ.any(axis=1))
    if not len(places):
        return
    gaps, differ = gaps[places], differ[places]
    sizes = np.where(np.isnan(gaps), np.inf, np.abs(gaps))
    where, begin = np.argmax(sizes, axis=1), np.argmax(differ, axis=1)
    largest = np.take_along_axis(sizes, where[:, None], 1)[:, 0]
    counts = differ.sum(axis=1)
    rms, mean, most = _of_finite(gaps)
    spread = _spread([whole[place] for place in places])
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = np.where(rms > 0, np.where(spread > 0, rms / spread, np.inf), counts / differ.shape[1])
    columns = (largest, meeting.times[where], rms, mean, counts / differ.shape[1], counts, meeting.times[begin], most)
    numbers = zip(*(each.tolist() for each in columns), weight.tolist(), strict=True)
    for place, (size, at_s, root, middle, share, times, first_s, largest_known, heavy) in zip(
        places.tolist(), numbers, strict=True
    ):
        one = scalars[place]
        yield place, SignalDifference(
            one.name, one.unit, size, at_s, root, middle, share, times, differ.shape[1], first_s, largest_known, heavy,
            one.signals,
        )  # fmt: skip


def _of_finite(gaps: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Root mean square, mean and largest size of the finite numbers of each row; NaN where there are none."""
    known = np.isfinite(gaps)
    if known.all():
        return np.sqrt(np.mean(gaps**2, axis=1)), gaps.mean(axis=1), np.abs(gaps).max(axis=1)
    rows = [row[there] for row, there in zip(gaps, known, strict=True)]
    told = [
        (float(np.sqrt(np.mean(row**2))), float(row.mean()), float(np.abs(row).max())) if len(row) else (np.nan,) * 3
        for row in rows
    ]
    return tuple(np.array(told).T)


def _spread(rows: Sequence[NDArray[Any]]) -> NDArray[np.float64]:
    """How far each signal moves: metres and volts stand in one list."""
    floats = [as_floats(from_base(row)) for row in rows]
    if all(np.isfinite(one).all() for one in floats):
        return np.stack(floats).std(axis=1) if len(floats[0]) else np.zeros(len(floats))
    finite = [one[np.isfinite(one)] for one in floats]
    return np.array([one.std() if len(one) else 0.0 for one in finite])


def _gap(first: NDArray[Any], second: NDArray[Any]) -> NDArray[np.float64]:
    """The difference of values: NaN of what isn't there in one of them, and of texts that differ."""
    texts = [each.dtype.kind in "SUV" for each in (first, second)]
    if texts[0] != texts[1]:
        raise ElementError("one is text or bytes, the other is a number")
    if texts[0]:
        told = [[text_of(value) for value in each.tolist()] for each in (first, second)]
        return np.where(np.array(told[0], object) == np.array(told[1], object), 0.0, np.nan)
    with np.errstate(invalid="ignore", over="ignore"):
        # the raw values: integers beyond 2**53 are not told apart as floats
        same = np.asarray(np.ma.filled(first == second, False))
        gap = difference(first, second)
    gap[~same & (gap == 0)] = np.finfo(float).tiny
    gap[same] = 0.0
    if np.isnan(gap).any():
        gap[np.isnan(as_floats(first)) & np.isnan(as_floats(second))] = 0.0
    return gap


def _shift(a: Log, b: Log, event: Event | None, signal: str, by: str) -> float:
    """By how many seconds the second run is moved."""
    if by not in ("start", "stamps"):
        raise ElementError(f"by must be 'start' or 'stamps', got {shown(by)}")
    if by == "stamps" and (event is not None or signal):
        raise ElementError("by='stamps' leaves both runs where they are: leave out event= and signal=")
    if event is not None and signal:
        raise ElementError("compare takes event= or signal=, not both")
    if by == "start" and event is None and not signal:
        return _by_starts(a, b)
    if event is not None:
        if not callable(event):
            raise ElementError(
                f"event must be a function of a log, got {shown(event)}; write event=lambda log: log['x'] > 1"
            )
        return _moment(a, event, "first") - _moment(b, event, "second")
    if not text("signal", signal, 'signal="/log/joints/q_0"'):
        return 0.0
    return _by_course(a[signal], b[signal])


def _by_starts(a: Log, b: Log) -> float:
    """By how much the second run moves, from first sample to first sample, that the starts of both runs meet."""
    first_ns, last_ns = run_begins([a, b])
    return ((first_ns - last_ns) - (a.start_ns - b.start_ns)) * 1e-9


def _laid(a: Log, b: Log) -> str:
    """How the starts of runs meet where a file begins later, or why its first sample counts as the start."""
    told = []
    for which, log in (("first", a), ("second", b)):
        start, recording = log._began, log.recording
        if start is None and log._start_ns is None and recording.time_looping:
            return f"laid on each other by their first samples: the file of the {which} doesn't tell when its run began"
        if start is not None and not start.capture and (late_s := (log.start_ns - start.stamp_ns) * 1e-9) > 0:
            ticks = many(recording.offset - len(recording.time_ns), "tick")
            how = f", counted by {ticks} that it doesn't hold" if start.counted else ""
            told.append(f"the {which} file begins {late_s:.6g} s after its run did{how}")
    return "; ".join(told)


def _moment(log: Log, event: Event, which: str) -> float:
    found = event(log)
    if isinstance(found, Signal):
        moments = found.when()
        if not len(moments):
            words = f"the event '{found.name}' doesn't happen in the {which} run, which {found._span}"
            raise NoMomentError(words, which)
        return float(moments[0])
    return real(f"the time of the event in the {which} run", found, -1e9, 1e9, "s")


def _by_course(one: Signal, other: Signal) -> float:
    """The shift at which two courses are most alike: the peak of their cross-correlation."""
    if one.values.ndim > 1 or other.values.ndim > 1:
        part = (one.components or other.components)[0]
        raise ElementError(f"'{one.name}' has components: name one of them, such as '{one.name}_{part}'")
    if len(one) < 2 or len(other) < 2:
        raise ElementError(f"'{one.name}' has too few samples to lay runs on each other by it")
    step_s = min(one._step_ns, other._step_ns) * 1e-9
    one, other = one._in_order(), other._in_order()
    spans = [each.times[-1] - each.times[0] for each in (one, other)]
    step_s = max(step_s, max(spans) / MOST_SHIFT_SAMPLES)
    courses = []
    for each in (one, other):
        grid = np.arange(each.times[0], each.times[-1] + step_s / 2, step_s)
        values = np.nan_to_num(np.interp(grid, each.times, each._columns("align by")[0]))
        courses.append(values - values.mean())
    if not all(course.any() for course in courses):
        raise ElementError(f"'{one.name}' stands still in a run: runs can't be laid on each other by it")
    size = 1 << (len(courses[0]) + len(courses[1]) - 1).bit_length()
    spectra = [np.fft.rfft(course, size) for course in courses]
    best = int(np.argmax(np.fft.irfft(spectra[0] * np.conj(spectra[1]), size)))
    return float(one.times[0] - other.times[0] + (best - size if best > size // 2 else best) * step_s)

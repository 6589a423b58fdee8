"""What was logged, as plain data: the one noun between segments, files and analysis.

The segment's reader makes a `Recording` (a snapshot), every file writer takes one, every file reader returns one.
It knows no logger, no file and no process.
"""

import re
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.columns import Gap
from silo.core.arrays.spans import spans_text
from silo.core.calls import no_attribute
from silo.core.conditions import NO_CONDITIONS, Conditions
from silo.core.elements import BufferType, Entry, LoggedEvent, Stretch
from silo.core.parameter_images import image_after, unknown_texts
from silo.core.quantities.writing import html_table
from silo.errors import ArgumentError, LogWarning

Progress = Callable[[float], None]  # called with the share that is done, 0 to 1


@dataclass(frozen=True)
class RecordedEntry:
    """One scalar signal: `values` has shape `(m,)`, oldest first; it may be a strided view or a memory map.

    Enumerations stay integers here, `entry.labels` names them. Strings are bytes (`S` dtype).
    """

    name: str
    entry: Entry
    values: NDArray[Any]

    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of the values, which are not read for it."""
        return self.values.dtype

    @property
    def count(self) -> int:
        """How many values there are, which are not read for it."""
        return len(self.values)


class LazyEntry(RecordedEntry):
    """An entry whose values are read when they are first asked for; `lazy_entry` makes it."""

    def __getattr__(self, name: str) -> NDArray[Any]:
        # called for what is not there: a cached_property takes 1 us more for each of thousands of entries
        if name != "values":
            raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")
        load: Callable[[], NDArray[Any]] = self.__dict__["load"]
        values = self.__dict__["values"] = load()
        return values

    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of the values; of those that are read the one they have."""
        kind: np.dtype[Any] = self.values.dtype if "values" in self.__dict__ else self.__dict__["kind"]
        return kind

    @property
    def count(self) -> int:
        """How many values there are."""
        length: int | Callable[[], int] = len(self.values) if "values" in self.__dict__ else self.__dict__["length"]
        return length if isinstance(length, int) else length()


def silent(_: float) -> None:
    """Tell nobody how much is done."""


def lazy_entry(
    name: str,
    entry: Entry,
    load: Callable[[], NDArray[Any]],
    dtype: np.dtype[Any],
    count: int | Callable[[], int],
    ahead: Callable[[], None] | None = None,
) -> RecordedEntry:
    """An entry whose values `load` gives, so many of this type; of texts the type may be without a length.

    `ahead` has them read together with the next that are loaded, of a file in which that is one way.
    """
    made = LazyEntry.__new__(LazyEntry)
    fields = {"name": name, "entry": entry, "load": load, "kind": dtype, "length": count, "ahead": ahead}
    object.__setattr__(made, "__dict__", fields)
    return made


@dataclass(frozen=True)
class Failures:
    """Samples that are not what the program had: its attribute or function could not be read, or did not fit.

    `count` is the number of ticks; `spans` are stretches `(first, last)` of such ticks since start, both included, in
    the order of time; where there were more than 15, some in the middle are left out. NaN or NaT stands in their place
    where the type has one, the last value elsewhere.
    """

    count: int = 0
    spans: tuple[tuple[int, int], ...] = ()


NO_FAILURES = Failures()


def failures_text(failures: Failures) -> str:
    """What failed, fit to show: `could not be read at 3 ticks (12, 20-21): ...`."""
    ticks = spans_text(failures.spans, failures.count)
    return f"could not be read at {ticks}: NaN, or its last value, stands there instead"


NEVER_CHANGED = ", and it never changed during the run"
KEPT_ALIKE = ", and all its samples that are kept are the same"
NEWEST_ALIKE = ", and its newest {} samples are the same"


def unheld_text(tick: int, same: str = "") -> str:
    """What is known of an array that nobody but silo holds any more, seen at a tick; fit to show behind its name.

    `same` is one of the above, or empty.
    """
    seen = f"seen at tick {tick}" if tick else "seen at the start"
    return (
        f"nobody but silo holds this array any more ({seen}){same}: right for a constant; if it was assigned "
        "anew (x = x + 1), that made another array: change it in place (x[:] = x + 1), or log the attribute "
        "(log.add(owner, attr=...)), which follows assignments"
    )


@dataclass(frozen=True)
class RecordedElement:
    """One element with its samples.

    Sample i of every entry belongs to time stamp `first + i * divider` of the recording: a buffer keeps either the
    first or the newest samples, so what it holds is always one unbroken run. `lost` counts the samples that fell
    due and could not be kept although the policy asked for them (memory limit). `dtype` are the fields of a NumPy
    structure (`silo.core.kinds.struct_text`), empty for all else. `own_ns`, shape `(count,)`, are time stamps of its
    own: bags of others have no ticks, `first` and `divider` say nothing of them. `holds` are of an element that was
    changed while it was logged, of which there are stretches: pairs of how many ticks samples hold (until the next is
    due, or the stretch ends) and how many do; without them a sample with a stamp of its own holds until the next one.
    `own_ticks`, shape `(count,)`: at which stamps of the recording it has samples, where that is known beside `own_ns`.
    `absent`, of parts as one: from which stamp on, and before which, it has no samples, and why.
    """

    name: str
    unit: str
    kind: str
    shape: tuple[int, ...]
    divider: int
    buffer_type: BufferType
    first: int
    entries: tuple[RecordedEntry, ...]
    description: str = ""
    lost: int = 0
    dtype: str = ""
    failures: Failures = NO_FAILURES
    own_ns: NDArray[np.int64] | None = None
    holds: tuple[tuple[int, int], ...] = ()
    own_ticks: NDArray[np.int64] | None = None
    absent: tuple[tuple[int, int, Gap], ...] = ()

    @property
    def count(self) -> int:
        """Samples per entry."""
        if self.own_ns is not None:
            return len(self.own_ns)
        return self.entries[0].count if self.entries else 0

    @property
    def stamp_indices(self) -> NDArray[np.int64]:
        """Shape `(count,)`: which time stamp of the recording each sample belongs to."""
        return self.first + np.arange(self.count, dtype=np.int64) * self.divider


def held_ticks(element: RecordedElement) -> NDArray[np.int64] | None:
    """Shape `(count,)`: how many ticks each sample holds; None where it holds as its divider says, or to the next."""
    if not element.holds:
        return None
    ticks, counts = np.array(element.holds, np.int64).T
    return np.repeat(ticks, counts)


def as_holds(ticks: NDArray[np.int64]) -> tuple[tuple[int, int], ...]:
    """What `held_ticks` reads."""
    begins = np.flatnonzero(np.diff(ticks, prepend=-1))
    counts = np.diff(begins, append=len(ticks))
    return tuple(zip(ticks[begins].tolist(), counts.tolist(), strict=True))


_OF_LOGS = ("save", "to_pandas", "to_polars", "to_xarray", "plot", "eval", "clip", "resample", "names", "glob", "times")
_OTHER_NAMES = {
    "extras": "it is .conditions",
    "signals": "recording.elements are its elements, silo.Log(recording)['x'] is a signal",
    "keys": "list(silo.Log(recording)) has the names",
    "values": "silo.Log(recording)['x'].values has them",
    "data": "silo.Log(recording)['x'].values has them",
    "time": "it is .time_ns; silo.Log(recording).times are seconds",
    "frequency": "it is .frequency_hz",
    "name": "it is .logger",
}


@dataclass(frozen=True, repr=False)
class Recording:
    """A whole log at one moment.

    Attributes:
        logger: its name.
        time_ns: shape `(n,)`: int64 nanoseconds since 1970 (or of the logger's own clock), one per kept tick, oldest
            first; the last one is tick `offset - 1`.
        offset: ticks since start (the original's "time synchronization offset").
        elements: the samples of each.
        prefix: start of all element names.
        frequency_hz: control ticks per second, None where unknown.
        started_ns: the wall clock at start, 0 where unknown.
        time_looping: whether the oldest ticks were overwritten.
        warnings: what is missing or damaged; of a bag a list that grows by what is found when values are read.
        conditions: derived signals, limits and triggers.
        why: it was saved, in a few words.
        events: what happened in this run, marks and all, in the order of time; their ticks may lie outside of those
            that are kept.
        about: where it comes from: host, versions, the program's commit, and what the program said of it.
        stretch: which part of a run that was cut, or file of a recording, it is, or of how many; None of any other.
        gaps: of parts as one, between which stamps ticks are missing: the last before, and the first behind.
        cut_off: samples that the file was to have, and ends before.
        overwritten: of parts as one, the ticks that looping buffers had no longer as the parts were saved; of several
            elements the most of any.
        run: its id, empty where that isn't known.
    """

    logger: str
    time_ns: NDArray[np.int64]
    offset: int
    elements: Sequence[RecordedElement]
    prefix: str = "/log"
    frequency_hz: float | None = None
    started_ns: int = 0
    time_looping: bool = False
    warnings: Sequence[str] = field(default=())
    why: str = ""
    conditions: Conditions = NO_CONDITIONS
    events: tuple[LoggedEvent, ...] = ()
    about: Mapping[str, str] = field(default_factory=dict)
    stretch: Stretch | None = None
    gaps: tuple[tuple[int, int], ...] = ()
    cut_off: int = 0
    overwritten: int = 0
    run: str = ""

    @property
    def likely_run(self) -> str:
        """The id of its run; of a file that doesn't tell it, of the one of which most events are, if there are any."""
        found = Counter(event.run for event in self.events if event.run).most_common(1)
        return self.run or (found[0][0] if found else "")

    @property
    def lost(self) -> int:
        """Samples that are missing: buffers had no room for them, or the file ends before."""
        return sum(element.lost for element in self.elements) + self.cut_off

    @property
    def early(self) -> int:
        """Time stamps before the first that was asked for: the signals of a capture may have a sample from before."""
        capture, ticks = self.conditions.capture, len(self.time_ns)
        return min(max(0, capture.first - (self.offset - ticks)), ticks - 1) if capture is not None else 0

    def __repr__(self) -> str:
        span = (int(self.time_ns[-1]) - int(self.time_ns[0])) * 1e-9 if len(self.time_ns) else 0.0
        more = f", {len(self.warnings)} warnings" if self.warnings else ""
        return (
            f"<Recording {self.logger}: {len(self.elements)} elements, {len(self.time_ns)} ticks, {span:.6g} s{more}>"
        )

    def _repr_html_(self) -> str:
        rows = [(one.name, one.unit, one.kind, one.count, one.divider, one.lost or "") for one in self.elements]
        return html_table(repr(self)[1:-1], ("element", "unit", "kind", "samples", "divider", "lost"), rows)

    def __getitem__(self, name: object) -> NoReturn:
        # what iterating comes to as well
        shown = repr(name) if isinstance(name, str) else "'x'"
        raise ArgumentError(
            f"a recording is plain data: silo.Log(recording)[{shown}] is a signal of it, with its times and unit; "
            "recording.elements are its elements"
        )

    if not TYPE_CHECKING:  # type checkers find it themselves

        def __getattr__(self, name: str) -> NoReturn:
            logs = f"write silo.Log(recording).{name}, a log has more than a recording, which is plain data"
            others = dict.fromkeys(_OF_LOGS, logs) | _OTHER_NAMES
            no_attribute("a recording", name, type(self), others)

    @property
    def told_about(self) -> dict[str, str]:
        """What is shown of where it comes from: `about`, and which part of a run that was cut or recorded it is."""
        if self.stretch is None:
            return {**self.about}
        return {"recording" if self.stretch.recorder else "cut": self.stretch.text, **self.about}

    @property
    def entry_count(self) -> int:
        """Scalar signals of all elements, the time stamps not counted."""
        return sum(len(element.entries) for element in self.elements)


_STRETCH_TOLD = re.compile(r"(?:part (\d+)|(\d+) parts) of run (\w+)")


def with_stretch(recording: Recording) -> Recording:
    """The recording with `stretch` where its file told that in `about` alone, as files did at first."""
    told = _STRETCH_TOLD.fullmatch(recording.about.get("cut", "")) if recording.stretch is None else None
    if told is None:
        return recording
    about = {key: text for key, text in recording.about.items() if key != "cut"}
    return replace(recording, about=about, stretch=Stretch(told[3], int(told[1] or 0), int(told[2] or 1)))


def falls(time_ns: NDArray[np.int64]) -> bool:
    """Whether a stamp is smaller than the one before: the clock stepped back."""
    return bool((time_ns[1:] < time_ns[:-1]).any())


def lasted_s(time_ns: NDArray[np.int64]) -> float:
    """Return how long it took from the first stamp to the last, in s: what passed between steps back of the clock."""
    if falls(time_ns):
        return float(np.maximum(np.diff(time_ns), 0).sum()) * 1e-9
    return float(time_ns[-1] - time_ns[0]) * 1e-9 if len(time_ns) else 0.0


def within(time_ns: NDArray[np.int64], first_ns: int, last_ns: int) -> slice | NDArray[np.bool_]:
    """Which stamps lie from `first_ns` to `last_ns`, both included: no stretch where the clock stepped back."""
    if falls(time_ns):
        return (time_ns >= first_ns) & (time_ns <= last_ns)
    low = int(np.searchsorted(time_ns, first_ns, side="left"))
    return slice(low, max(low, int(np.searchsorted(time_ns, last_ns, side="right"))))


def has_own_stamps(recording: Recording) -> bool:
    """Whether elements have time stamps of their own, not those of ticks: a bag of others."""
    return any(element.own_ns is not None for element in recording.elements)


def stamps_of(recording: Recording, element: RecordedElement) -> NDArray[np.int64]:
    """The time stamps of an element, shape `(count,)`: its own, or those of its ticks."""
    if element.own_ns is not None:
        return element.own_ns
    stop = element.first + (element.count - 1) * element.divider + 1 if element.count else element.first
    return recording.time_ns[element.first : stop : element.divider]


def samples_between(first: int, divider: int, count: int, begin: int, end: int) -> tuple[int, int]:
    """Which of `count` samples, at `first` and every `divider`-th tick from there, belong to ticks `begin ... end - 1`.

    As the number of the first and of the one after the last.
    """
    low = min(count, max(0, -((first - begin) // divider)))
    return low, min(count, max(low, -((first - end) // divider)))


def are_samples_of(ticks: int, first: int, divider: int, count: int) -> bool:
    """Whether `count` samples, at `first` and every `divider`-th tick from there, are all at one of so many ticks."""
    return count >= 0 and divider >= 1 and (not count or 0 <= first <= first + (count - 1) * divider < ticks)


def places_of_ticks(recording: Recording, first: int, last: int) -> tuple[int, int]:
    """Where the kept ones of the ticks `first ... last` stand among the stamps: the first, and the one after the last.

    The clock of a simulation begins anew with each reset: which ticks an episode has, its times don't tell.
    """
    before = recording.offset - len(recording.time_ns)
    low = min(max(first - before, 0), len(recording.time_ns))
    return low, min(max(last + 1 - before, low), len(recording.time_ns))


def samples_of_ticks(recording: Recording, element: RecordedElement, low: int, high: int) -> slice | NDArray[np.bool_]:
    """Which samples of an element belong to the ticks whose stamps stand at `low <= place < high`.

    Of what has stamps of its own those that lie between the times of these ticks.
    """
    if element.own_ns is None:
        return slice(*samples_between(element.first, element.divider, element.count, low, high))
    if element.holds:  # a cut changed it
        places = ticks_of(recording.time_ns, element)
        return slice(*np.searchsorted(places, [low, high]).tolist())
    time_ns = recording.time_ns[low:high]
    return within(element.own_ns, int(time_ns.min()), int(time_ns.max())) if len(time_ns) else slice(0, 0)


def common_axis(stamps: Iterable[NDArray[np.int64]]) -> NDArray[np.int64]:
    """All stamps that there are, rising; one that somebody has twice is there twice."""
    parts = list({id(each): each for each in stamps}.values())
    axis = distinct(np.concatenate([np.empty(0, np.int64), *parts]))
    times = np.ones(len(axis), np.int64)
    for part in parts:
        if len(part) > 1 and (part[1:] == part[:-1]).any():
            found, counts = np.unique(part, return_counts=True)
            at = np.searchsorted(axis, found)
            times[at] = np.maximum(times[at], counts)
    return axis if (times == 1).all() else np.repeat(axis, times)


def rate_of(time_ns: NDArray[np.int64], gaps: Sequence[tuple[int, int]] = ()) -> float:
    """Return the rate of time stamps, Hz, exact where they are; 0 where nothing tells.

    Where a clock begins anew, as in each episode of a simulation, only the steps ahead count, and no step over `gaps`.
    """
    ahead = steps_of(time_ns, gaps)
    span_ns = int(ahead.sum())
    return len(ahead) * 10**9 / span_ns if span_ns else 0.0


def steps_of(time_ns: NDArray[np.int64], gaps: Sequence[tuple[int, int]]) -> NDArray[np.int64]:
    """Return the steps ahead from stamp to stamp, but for those over `gaps`."""
    steps = np.diff(time_ns)
    counted = steps >= 0
    for before, behind in gaps:
        counted &= (time_ns[:-1] > before) | (time_ns[1:] < behind)
    return steps[counted]


def ticks_of(time_ns: NDArray[np.int64], element: RecordedElement) -> NDArray[np.int64]:
    """Shape `(count,)`: which of these time stamps, those of the recording, each sample belongs to."""
    if element.own_ns is None:
        return element.stamp_indices
    known = element.own_ticks
    fits = known is not None and len(known) == element.count and known.max(initial=-1) < len(time_ns)
    if known is not None and fits and np.array_equal(time_ns[known], element.own_ns):
        return known
    return places_on(time_ns, element.own_ns, held_ticks(element))


def places_on(
    axis: NDArray[np.int64], stamps: NDArray[np.int64], holds: NDArray[np.int64] | None = None
) -> NDArray[np.int64]:
    """Where stamps stand on an axis, as one after the other came.

    They rise, on one that `common_axis` made of them and of others; or they are those of ticks, of which each `holds`
    so many: the clock may step back, or stand still.
    """
    if holds is not None and (found := _walked(axis, stamps, holds)) is not None:
        return found
    again = np.arange(len(stamps)) - np.searchsorted(stamps, stamps)  # the how many-th of equal ones
    return np.searchsorted(axis, stamps) + again


def rises(time_ns: NDArray[np.int64]) -> bool:
    """Whether each stamp is larger than the one before: the clock neither stepped back nor stood still."""
    return bool((time_ns[1:] > time_ns[:-1]).all())


def distinct(stamps: NDArray[np.int64]) -> NDArray[np.int64]:
    """Each stamp once, rising. NumPy 2.3 and later make a set of them: of a million 2 s, where sorting takes 20 ms."""
    if rises(stamps):
        return stamps
    ordered = np.sort(stamps)
    return ordered[np.flatnonzero(np.diff(ordered, prepend=ordered[:1] - 1))]


def _walked(axis: NDArray[np.int64], stamps: NDArray[np.int64], holds: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """Where stamps stand on ticks, each behind the one before; None for what needs no walk, and for others."""
    if rises(axis):
        return None
    places, since = np.empty(len(stamps), np.int64), np.cumsum(holds) - holds
    done, at = 0, -1
    while done < len(stamps):
        later = np.flatnonzero(axis[at + 1 :] == stamps[done])
        if not len(later):
            return None
        guess = at + 1 + later[0] + since[done:] - since[done]
        guess = guess[guess < len(axis)]
        wrong = np.flatnonzero(axis[guess] != stamps[done : done + len(guess)])
        count = int(wrong[0]) if len(wrong) else len(guess)
        places[done : done + count] = guess[:count]
        done, at = done + count, int(guess[count - 1])
    return places


MOST_SPANS = 15  # of failures: the first ones, and the last


def failures_at(failures: Failures, ticks: NDArray[np.int64], step: int) -> Failures:
    """Failures with more ticks, which rise; those that are `step` apart or less make one stretch."""
    if not len(ticks):
        return failures
    cuts = np.flatnonzero(np.diff(ticks) > step)
    firsts, lasts = np.append(ticks[:1], ticks[cuts + 1]), np.append(ticks[cuts], ticks[-1:])
    spans = sorted({*failures.spans, *zip(firsts.tolist(), lasts.tolist(), strict=True)})
    shown = spans if len(spans) <= MOST_SPANS else [*spans[: MOST_SPANS - 1], spans[-1]]
    return Failures(failures.count + len(ticks), tuple(shown))


def masked(values: NDArray[Any], missing: NDArray[np.bool_]) -> NDArray[Any]:
    """Values of which some are missing: NaN or NaT where the type has it, an empty text, else a masked array.

    Takes the array over.
    """
    if not missing.any():
        return values
    kind = values.dtype.kind
    if kind in "fcmM":
        values[missing] = np.array("NaT", values.dtype) if kind in "mM" else np.nan
    elif kind in "SU":
        values[missing] = ""
    return values if kind in "fcmMSU" else np.ma.masked_array(values, missing)


def read_ahead(elements: Iterable[RecordedElement]) -> None:
    """Tell files whose values will be asked for: a bag unpacks its chunks once for all of them."""
    for entry in (entry for element in elements for entry in element.entries):
        ahead: Callable[[], None] | None = entry.__dict__.get("ahead")
        if ahead is not None:
            ahead()


def read_whole(recording: Recording) -> None:
    """Have all values read, so that `recording.warnings` has all that is damaged in them."""
    read_ahead(recording.elements)
    for element in recording.elements:
        for entry in element.entries:
            _ = entry.values


class DamageNotes(list[str]):
    """What is missing or damaged in a file; what is found once it is open is a `LogWarning` too.

    The first `stored` of them stand in the file.
    """

    def __init__(self, file: Path, texts: Iterable[str] = ()) -> None:
        super().__init__(texts)
        self.file = file
        self.stored = len(self)
        self.loud = False
        self.parts: list[DamageNotes] = []
        self._wholes: list[tuple[DamageNotes, str]] = []

    def add(self, text: str) -> None:
        """Tell something, once."""
        if text not in self:
            self.append(text)
            if self.loud:
                warnings.warn(f"{self.file}: {text}", LogWarning, stacklevel=2)
            for whole, label in self._wholes:
                whole.append(f"{label}: {text}")

    def take_in(self, part: "DamageNotes", label: str) -> None:
        """Have what is found later in a part stand here, too, behind this label."""
        self.parts.append(part)
        part._wholes.append((self, label))


def keep_quiet(recording: Recording) -> None:
    """Have what is found later stand in the recording's warnings alone, for who prints these himself."""
    if isinstance(recording.warnings, DamageNotes):
        for notes in (recording.warnings, *recording.warnings.parts):
            notes.loud = False


MOST_EVENTS = 10_000  # of a recording: the newest


def stamped(events: Iterable[LoggedEvent], time_ns: NDArray[np.int64], offset: int) -> tuple[LoggedEvent, ...]:
    """Events with the time stamps of their ticks, as far as these are held: `time_ns` ends with tick `offset - 1`."""
    first = offset - len(time_ns)
    return tuple(
        msgspec.structs.replace(event, stamp_ns=int(time_ns[event.tick - first]))
        if not event.stamp_ns and first <= event.tick < offset
        else event
        for event in events
    )


def with_events(recording: Recording, events: Iterable[LoggedEvent]) -> Recording:
    """The recording with what else happened in its run, in the order of time; what it has already stays once."""
    merged = once_each([*recording.events, *stamped(events, recording.time_ns, recording.offset)])
    if len(merged) > MOST_EVENTS:
        image = image_after(merged[:-MOST_EVENTS])
        merged = [*([image] if image is not None else []), *merged[-MOST_EVENTS:]]
    return replace(recording, events=tuple(merged))


def told_unknown(recording: Recording) -> Recording:
    """The recording with a warning where its events don't tell what parameters were; to be asked when all are there."""
    time_ns, first = recording.time_ns, recording.offset - len(recording.time_ns)

    def seconds(tick: int) -> float:
        place = min(max(tick - first, 0), len(time_ns) - 1)
        return int(time_ns[place] - time_ns[0]) * 1e-9 if len(time_ns) else 0.0

    texts = unknown_texts(recording.events, first, seconds)
    return replace(recording, warnings=(*recording.warnings, *texts)) if texts else recording


def once_each(events: Iterable[LoggedEvent]) -> list[LoggedEvent]:
    """The events of a run in the order of time; of what is told twice, the later one."""
    known = {(event.kind, event.time_ns, event.tick, event.text): event for event in events}
    return sorted(known.values(), key=lambda event: (event.time_ns, event.number))

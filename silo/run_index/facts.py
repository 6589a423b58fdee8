"""What the index knows of a run: where it is from, when, how long, what happened, and each signal in a few numbers."""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from hashlib import sha1
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute.samples import Samples
from silo.analysis.parameters import parameters_of
from silo.analysis.plots.curves import as_numbers, is_text, picked
from silo.analysis.plots.events import episodes_of
from silo.analysis.reports import moments, numbers_of
from silo.core.arrays import spans
from silo.core.arrays.values import from_base
from silo.core.elements import MARKER, LoggedEvent
from silo.core.episodes.words import Episode, said_by
from silo.core.names import grouped
from silo.core.quantities.writing import EPOCH_FROM_NS
from silo.core.recording import Recording, lasted_s, places_of_ticks, rate_of, read_ahead, samples_of_ticks
from silo.core.structs import alike
from silo.core.tuning.parameters import ParameterValue
from silo.errors import SiloError
from silo.files.added import added_formats
from silo.files.formats import read_recording
from silo.files.naming import is_capture

NUMBERS = ("count", "least", "most", "mean", "std", "rms", "last")  # of a signal, in a run or an episode
# in the words of a limit that was broken again and again, and of a trigger, in files that tell it by words alone
_TIMES = re.compile(r", (\d+) times(?:;|$)|fired (\d+) times, at ticks")


class EpisodeFacts(msgspec.Struct, frozen=True, array_like=True):
    """What happened in an episode; overwritten: how many scalars a looping buffer had forgotten the beginning of."""

    marks: int
    limits: int
    triggers: int
    overwritten: int


class RunFacts(msgspec.Struct, frozen=True, omit_defaults=True):
    """What a list of runs shows of one; `path` is relative to the folder of the index.

    prefix: of the names of its elements. kind: `run`, or `capture` of a trigger. begun_ns: when its first tick was,
    where its stamps are times, else when its run began. span_s: from the first tick to the last. rate_hz: of its ticks.
    lost: samples. limits, triggers, marks: how often; a mark of an episode is none. in_episodes: of each of `episodes`.
    problem: why it can't be read, then all else is empty. run: its id, of a run that was cut that of its first stretch;
    empty where the file doesn't tell. Of a file that is one of several, part is the stretch, and recorder who wrote it.
    stamp_ns: the first time stamp, by the clock of the logger. offset: the tick of its stretch behind its last one, 0
    where nobody noted it. names: alike in files that have the same elements. cut_off: how many of `lost` the file ends
    before. dividers: how many elements have which.
    """

    path: str
    prefix: str = ""
    kind: str = "run"
    robot: str = ""
    task: str = ""
    begun_ns: int = 0
    span_s: float = 0.0
    ticks: int = 0
    elements: int = 0
    rate_hz: float = 0.0
    why: str = ""
    marks: int = 0
    limits: int = 0
    triggers: int = 0
    lost: int = 0
    failed: int = 0
    warnings: int = 0
    size_bytes: int = 0
    about: dict[str, str] = {}
    parameters: dict[str, ParameterValue] = {}
    episodes: tuple[Episode, ...] = ()
    in_episodes: tuple[EpisodeFacts, ...] = ()
    problem: str = ""
    run: str = ""
    part: int = 0
    recorder: str = ""
    stamp_ns: int = 0
    offset: int = 0
    names: str = ""
    cut_off: int = 0
    dividers: dict[int, int] = {}


Piece = tuple[str, int | None]  # of a run of several files: one of them, and an episode in it; None: all of it


class SignalFacts(msgspec.Struct, frozen=True, array_like=True):
    """One scalar of a run and its element, over its finite samples; None where there are none. Labels are words."""

    name: str
    element: str
    unit: str
    count: int
    least: float | None
    most: float | None
    mean: float | None
    std: float | None
    rms: float | None
    last: float | None
    kind: str = "number"  # or text, enum
    labels: Mapping[int, str] = {}


class EventFacts(msgspec.Struct, frozen=True, array_like=True):
    """Something that happened in a run; at_s counts from its first tick, tick since its start, -1 for none."""

    at_s: float
    tick: int
    time_ns: int
    kind: str
    text: str
    who: str


class IndexedRun(NamedTuple):
    """All that the index keeps of a run; parts: of each signal the numbers of each episode, of shape (episodes, 7)."""

    run: RunFacts
    signals: Sequence[SignalFacts] = ()
    events: Sequence[EventFacts] = ()
    parts: Sequence[NDArray[np.float64]] = ()


def read_facts(root: Path, name: str, size_bytes: int) -> IndexedRun:
    """Read a log below a folder as a whole; one that can't be read says why."""
    path = root / name
    try:
        return facts_of(read_recording(path, added_formats), name, size_bytes, path)
    except (SiloError, OSError, MemoryError) as error:
        begun_ns = path.stat().st_mtime_ns if path.exists() else 0
        problem = str(error) or type(error).__name__
        return IndexedRun(RunFacts(name, begun_ns=begun_ns, size_bytes=size_bytes, problem=problem))


def facts_of(recording: Recording, name: str, size_bytes: int, path: Path) -> IndexedRun:
    """Return what the index keeps of a recording. Raises SiloError, OSError where it can't be read as a whole."""
    facts = _facts(recording, name, size_bytes, path)
    read_ahead(recording.elements)
    begin_ns = int(recording.time_ns[0]) if len(recording.time_ns) else recording.started_ns
    signals, parts = [], []
    for element in recording.elements:
        pieces = [
            samples_of_ticks(recording, element, *places_of_ticks(recording, one.first, one.last))
            for one in facts.episodes
        ]
        for entry in element.entries:
            signal, of_episodes = _of_signal(picked(recording, element, entry), element.name, pieces)
            signals.append(signal)
            parts.append(of_episodes)
    facts = msgspec.structs.replace(facts, in_episodes=_in_episodes(recording, facts.episodes))
    events = [
        EventFacts((one.at_ns - begin_ns) * 1e-9, one.tick, one.time_ns, one.kind, one.text, one.who)
        for one in recording.events
    ]
    return IndexedRun(facts, signals, events, parts)


def _facts(recording: Recording, name: str, size_bytes: int, path: Path) -> RunFacts:
    stamps = recording.time_ns
    ticks = len(stamps)
    span_s = lasted_s(stamps)
    happened = _happened(recording.events)
    # buffers hold the end
    began = max(recording.started_ns, int(stamps[0]) if ticks and stamps[0] >= EPOCH_FROM_NS else 0)
    return alike(
        RunFacts,
        recording,
        path=name,
        kind="capture" if is_capture(path) else "run",
        robot=recording.logger,
        task=recording.about.get("task", ""),
        begun_ns=began or path.stat().st_mtime_ns - round(span_s * 1e9),
        span_s=span_s,
        ticks=ticks,
        elements=len(recording.elements),
        rate_hz=rate_of(stamps) or recording.frequency_hz or 0.0,
        marks=happened[0],
        limits=happened[1],
        triggers=happened[2],
        lost=recording.lost,
        failed=sum(element.failures.count for element in recording.elements),
        warnings=len(recording.warnings),
        size_bytes=size_bytes,
        about=recording.told_about,
        parameters=parameters_of(recording, 0).last,
        episodes=tuple(episodes_of(recording, int(stamps[0]) if ticks else 0)),
        run=recording.stretch.run if recording.stretch is not None else recording.likely_run,
        part=recording.stretch.part if recording.stretch is not None else 0,
        recorder=recording.stretch.recorder if recording.stretch is not None else "",
        stamp_ns=int(stamps[0]) if ticks else 0,
        dividers=Counter(one.divider for one in recording.elements),
        names=sha1("\n".join(sorted(one.name for one in recording.elements)).encode()).hexdigest()[:16],
    )


def _rate_of_all(files: Sequence[RunFacts]) -> float:
    """Return the rate of files that follow one another, Hz, by the steps within them; 0 where nothing tells."""
    steps = [(one.ticks - 1, one.rate_hz) for one in files if one.ticks > 1 and one.rate_hz]
    total_s = sum(count / rate for count, rate in steps)
    return sum(count for count, _ in steps) / total_s if total_s else 0.0


def _happened(events: Iterable[LoggedEvent]) -> tuple[int, int, int]:
    """Count marks, limits, triggers; what is said of an episode is none of them."""
    found: Counter[str] = Counter()
    for event in events:
        if event.kind != MARKER or said_by(event.text) is None:
            found[event.kind] += event.times if event.times > 1 else _told_times(event)
    return found[MARKER], found["limit"], found["triggered"]


def _told_times(event: LoggedEvent) -> int:
    told = _TIMES.search(event.text) if event.kind in ("limit", "triggered") else None
    return int(told[1] or told[2]) if told else 1


def _in_episodes(recording: Recording, episodes: Sequence[Episode]) -> tuple[EpisodeFacts, ...]:
    oldest = recording.offset - len(recording.time_ns)
    begun = [(oldest + one.first - one.divider, len(one.entries)) for one in recording.elements if one.own_ns is None]
    return tuple(
        EpisodeFacts(
            *_happened(event for event in recording.events if one.first <= event.tick <= one.last),
            sum(scalars for tick, scalars in begun if tick >= max(one.first, oldest)),
        )
        for one in episodes
    )


def _of_signal(
    signal: Samples, element: str, pieces: Sequence[slice | NDArray[np.bool_]]
) -> tuple[SignalFacts, NDArray[np.float64]]:
    values, _ = as_numbers(signal)
    offsets = from_base(signal.values) if signal.values.dtype.kind in "iu" else values
    text = is_text(signal)
    kind = "text" if text else "enum" if signal.labels else "number"
    parts = np.array([_numbers(values[piece], offsets[piece], text) for piece in pieces]).reshape(-1, len(NUMBERS))
    numbers = _numbers(values, offsets, text)
    return signal_facts(signal.name, element, signal.unit, numbers, kind, signal.labels), parts


def signal_facts(
    name: str, element: str, unit: str, numbers: Sequence[float], kind: str, labels: Mapping[int, str]
) -> SignalFacts:
    """Return them of numbers as `IndexedRun.parts` has them; NaN is None."""
    count, *told = numbers
    found: dict[str, Any] = {
        number: None if math.isnan(one) else float(one) for number, one in zip(NUMBERS[1:], told, strict=True)
    }
    return SignalFacts(name, element, unit, int(count), kind=kind, labels=labels, **found)


def scaled(facts: SignalFacts, times: float, unit: str) -> SignalFacts:
    """Return them in another unit."""
    told = {name: value * times for name in NUMBERS[1:] if (value := getattr(facts, name)) is not None}
    return msgspec.structs.replace(facts, unit=unit, **told)


def _numbers(values: NDArray[np.float64], offsets: NDArray[Any], is_text: bool) -> tuple[float, ...]:
    """Count, minimum, maximum, mean, standard deviation, RMS of all but NaN, and the last one; NaN for none."""
    numbers = numbers_of(values)
    if is_text or not len(numbers):
        return (len(numbers), *[math.nan] * (len(NUMBERS) - 1))
    return (len(numbers), *moments(numbers, offsets), float(values[-1]))


# ------------------------------------------------------------------------------------------- several files of one run


Elements = Callable[[str], frozenset[str]]  # of a file, by its path


def by_run(
    files: Sequence[RunFacts], elements: Elements = lambda path: frozenset()
) -> list[tuple[tuple[RunFacts, ...], tuple[str, ...]]]:
    """Return what there is as one or more files for each run, in their order; captures are runs of their own.

    With the paths of others of that run, of which these have all.
    """
    runs: dict[tuple[str, str], list[RunFacts]] = {}
    found: list[tuple[tuple[RunFacts, ...], tuple[str, ...]]] = []
    for one in files:
        if one.run and one.kind == "run" and not one.problem:
            runs.setdefault((one.robot, one.run), []).append(one)
        else:
            found.append(((one,), ()))
    for some in runs.values():
        together = [list(its) for _, its in groupby(sorted(some, key=_place), key=lambda one: _place(one)[:2])]
        saved = [save for group in together if not group[0].recorder for save in _saves(group)]
        recorded = [tuple(group) for group in together if group[0].recorder]
        best = max(
            [*saved, *recorded], key=lambda of: (sum(one.ticks * one.elements for one in of), not of[0].recorder)
        )
        # recordings of other elements, and saves of other times, are each a thing of their own
        kept = saved if not recorded else recorded if best in recorded else [best]
        rest = [group for group in [*saved, *recorded] if group not in kept]
        kept = [*kept, *(filter(_more_than(kept, elements), rest) if rest else ())]
        paths = {one.path for group in kept for one in group}
        others = tuple(one.path for one in some if one.path not in paths)
        found += [(group, () if place else others) for place, group in enumerate(kept)]
    return found


def _more_than(kept: Sequence[Sequence[RunFacts]], elements: Elements) -> Callable[[Sequence[RunFacts]], bool]:
    """Return what tells whether files have samples of ticks of which these have none of that element."""
    files = [one for some in kept for one in some if one.ticks]
    named: dict[str, frozenset[str]] = {}
    of = grouped(((max(1, one.part), one.names), _ticks(one)) for one in files)
    beside = {key: spans.merged(some) for key, some in of.items()}
    paths = {one.names: one.path for one in files}

    def names_of(names: str, path: str) -> frozenset[str]:
        if names not in named:
            named[names] = elements(path)
        return named[names]

    def has_more(one: RunFacts) -> bool:
        if not one.ticks or not one.offset:
            return False
        beside_it = [(names, some) for (part, names), some in beside.items() if part == max(1, one.part)]
        if paths.keys() <= {one.names}:  # of the same elements: which these are need not be asked
            return bool(spans.without([_ticks(one)], [span for _, some in beside_it for span in some]))
        there = [(names_of(names, paths[names]), some) for names, some in beside_it]
        return any(
            spans.without([_ticks(one)], [span for names, some in there if not name or name in names for span in some])
            for name in names_of(one.names, one.path) or [""]
        )

    return lambda group: any(map(has_more, group))


def _ticks(one: RunFacts) -> spans.Span:
    return (one.offset - one.ticks, one.offset - 1) if one.offset else (0, 2**62)  # all, where that isn't known


def _place(one: RunFacts) -> tuple[str, str, int, int, str]:
    """Where a file stands among those of its run: copies in another folder are apart."""
    return one.recorder, one.path.rpartition("/")[0], one.part, one.begun_ns, one.path


def _saves(files: Sequence[RunFacts]) -> list[tuple[RunFacts, ...]]:
    """The saves of a run: one that was not cut each, of one that was its parts, of each the newest of what has most.

    Another save of a part is one by itself, if it has what that one doesn't.
    """
    whole: list[tuple[RunFacts, ...]] = [(one,) for one in files if not one.part]
    parts: dict[int, RunFacts] = {}
    for one in files:
        if one.part and (one.part not in parts or one.ticks >= parts[one.part].ticks):
            parts[one.part] = one
    more = [(one,) for one in files if one.part and not _is_within(one, parts[one.part])]
    return [*whole, *more, tuple(parts[part] for part in sorted(parts))] if parts else whole


def _is_within(one: RunFacts, other: RunFacts) -> bool:
    ends = [each.stamp_ns + round(each.span_s * 1e9) for each in (one, other)]
    return one is other or not one.ticks or (other.stamp_ns <= one.stamp_ns and ends[0] <= ends[1])


def _shifts(files: Sequence[RunFacts]) -> list[float]:
    """By how many seconds each file begins after the first one that has ticks."""
    begin = next((one.stamp_ns for one in files if one.ticks), 0)
    return [(one.stamp_ns - begin) * 1e-9 if one.ticks else 0.0 for one in files]


def merged(files: Sequence[RunFacts]) -> tuple[RunFacts, tuple[tuple[Piece, ...], ...]]:
    """Return the facts of several files as one, with where the pieces of each episode stand."""
    first, shifts = files[0], _shifts(files)
    episodes, happened, pieces = _episodes(files, shifts)
    ticks = sum(one.ticks for one in files)
    span_s = max(shift + one.span_s for shift, one in zip(shifts, files, strict=True))
    missing = _missing(files)
    facts = msgspec.structs.replace(
        first,
        span_s=span_s,
        ticks=ticks,
        elements=max(one.elements for one in files),
        rate_hz=_rate_of_all(files) or first.rate_hz,
        about={key: value for one in files for key, value in one.about.items()},
        parameters={key: value for one in files for key, value in one.parameters.items()},
        episodes=tuple(episodes),
        in_episodes=tuple(happened),
        part=0,
        **{
            name: sum(getattr(one, name) for one in files) + missing.get(name, 0)
            for name in ("marks", "limits", "triggers", "lost", "failed", "warnings", "size_bytes", "cut_off")
        },
    )
    return facts, tuple(map(tuple, pieces))


def _missing(files: Sequence[RunFacts]) -> dict[str, int]:
    """What is missing of a run that was cut, as warnings of its log tell it, and samples: as many as fit in between.

    With the dividers of the file before: with which they were logged, they alone would tell.
    """
    first = files[0]
    found = {"lost": 0, "warnings": 0 if first.recorder else first.part - 1}
    for one, other in pairwise(files):
        if other.part > one.part + 1:
            between_s = (other.stamp_ns - one.stamp_ns) * 1e-9 - one.span_s
            ticks = max(1, round(between_s * one.rate_hz) - 1)
            # of an archive of before, nothing is known of dividers
            dividers = one.dividers or {1: one.elements}
            found["lost"] += sum(count * -(-ticks // divider) for divider, count in dividers.items())
            found["warnings"] += other.part - one.part - 1
    return found


def _episodes(
    files: Sequence[RunFacts], shifts: Sequence[float]
) -> tuple[list[Episode], list[EpisodeFacts], list[list[Piece]]]:
    """The episodes of all files; one that goes on in another file is one, also over files without a word of it."""
    found: list[Episode] = []
    happened: list[EpisodeFacts] = []
    pieces: list[list[Piece]] = []
    before = 0  # ticks
    between: list[Piece] = []  # since the last episode
    for one, shift in zip(files, shifts, strict=True):
        for number, (episode, what) in enumerate(zip(one.episodes, one.in_episodes, strict=True)):
            moved = replace(
                episode,
                first=episode.first + before, last=episode.last + before, number=len(found),
                start_s=episode.start_s + shift, stop_s=episode.stop_s + shift,
            )  # fmt: skip
            goes_on = found and not found[-1].whole and not episode.whole and not number
            if goes_on and found[-1].name == episode.name and pieces[-1][-1][0] != one.path:
                open_one = found[-1]
                found[-1] = replace(
                    moved, first=open_one.first, start_s=open_one.start_s, number=open_one.number, whole=True,
                    about={**open_one.about, **moved.about}, verdict=moved.verdict or open_one.verdict,
                )  # fmt: skip
                numbers = [a + b for a, b in zip(*map(msgspec.structs.astuple, (happened[-1], what)), strict=True)]
                happened[-1] = EpisodeFacts(*numbers)
                pieces[-1] += [*between, (one.path, number)]
            else:
                found.append(moved)
                happened.append(what)
                pieces.append([(one.path, number)])
            between = []
        if not one.episodes:
            between.append((one.path, None))
        before += one.ticks
    return found, happened, pieces


def signals_of(several: Sequence[Sequence[SignalFacts]]) -> list[SignalFacts]:
    """Return the facts of scalars over the samples of several pieces, which follow one another."""
    if len(several) == 1:
        return list(several[0])
    found = grouped((one.name, one) for some in several for one in some)
    return [_signal(some) for _, some in sorted(found.items())]


def _signal(some: Sequence[SignalFacts]) -> SignalFacts:
    numbers = [one for one in some if one.least is not None and one.most is not None]
    last = some[-1]
    count = sum(one.count for one in some)
    if not numbers:
        return msgspec.structs.replace(last, count=count)
    weights = np.array([one.count for one in numbers], float)
    means, stds, roots = np.array([(one.mean, one.std, one.rms) for one in numbers], float).T  # NaN for None
    with np.errstate(over="ignore", invalid="ignore"):
        mean = float(np.average(means, weights=weights))
        std, rms = (
            float(np.sqrt(np.average(some, weights=weights))) for some in (stds**2 + (means - mean) ** 2, roots**2)
        )
    return msgspec.structs.replace(
        last,
        count=count,
        least=min(one.least for one in numbers if one.least is not None),
        most=max(one.most for one in numbers if one.most is not None),
        mean=None if math.isnan(mean) else mean,
        std=None if math.isnan(std) else std,
        rms=None if math.isnan(rms) else rms,
        last=next((one.last for one in reversed(some) if one.last is not None), None),
    )


def events_of(files: Sequence[RunFacts], found: Mapping[str, Sequence[EventFacts]]) -> list[EventFacts]:
    """Return what happened in several files, in seconds since the first one begins."""
    return [
        msgspec.structs.replace(event, at_s=event.at_s + shift)
        for one, shift in zip(files, _shifts(files), strict=True)
        for event in found.get(one.path, ())
    ]

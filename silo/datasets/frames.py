"""Frames of a run: signals of different rates at one rate, side by side.

A frame holds what was known at its time: the newest sample of each signal, the mean of the samples since the frame
before, or all of these (a window). What an episode knows of a slow signal may be older than its begin; the last sample
holds until the next would come, as everywhere.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute.samples import MOST_SAMPLES
from silo.analysis.compute.spectra import stills, told_stills
from silo.analysis.log import Log
from silo.analysis.signal import Signal
from silo.core.arguments import INT64
from silo.core.arrays.enumerations import contradiction
from silo.core.quantities.writing import and_more
from silo.errors import ElementError, UnknownSignalError

How = Literal["last", "mean", "window"]
_MOST_TOLD = 5
HOWS: tuple[How, ...] = ("last", "mean", "window")


class Feature(msgspec.Struct, frozen=True):
    """A column of a data set: its name, its type there, the shape of one frame, the names and units of its numbers.

    `labels` are the words of enumerations, by the names of these numbers.
    """

    name: str
    dtype: str
    shape: tuple[int, ...]
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    labels: dict[str, dict[int, str]] = {}


@dataclass(frozen=True)
class Wanted:
    """What a feature is made of: signals side by side."""

    name: str
    signals: tuple[Signal, ...]
    how: How = "last"
    prefix: str = ""  # of the log: no number is called by it
    dtype: str = ""  # in the data set; what fits the signals if it is empty


@dataclass(frozen=True)
class FrameTable:
    """What was made of one run: `columns[i]` is of shape `(frames, *features[i].shape)`; a shape of 1 is left out."""

    features: tuple[Feature, ...]
    columns: tuple[NDArray[Any], ...]
    begin_s: float
    lacks: str = ""  # which frames there are not, in words
    held: str = ""  # and which hold what was long before

    def __len__(self) -> int:
        return len(self.columns[0])

    @property
    def not_finite(self) -> str:
        """Which numbers are NaN or infinite in how many frames, in words."""
        told = [_not_finite(*each) for each in zip(self.features, self.columns, strict=True)]
        return f"no finite numbers: {'; '.join(filter(None, told))}" if any(told) else ""


def wanted_of(
    log: Log, state: Sequence[str], action: Sequence[str], also: Sequence[str], how: How, window: Sequence[str] = ()
) -> list[Wanted]:
    """Return the features of a log by patterns: all states and all actions side by side, the others each by itself.

    Raises UnknownSignalError for a pattern that means nothing, ElementError for signals that are no numbers.
    """
    prefix = f"{log.recording.prefix.rstrip('/')}/"
    way_out = "name it in `also`, or one of its parts"
    made = [
        Wanted(name, tuple(_checked(signal, "biuf", way_out) for signal in signals), how, prefix, "float32")
        for name, signals in (("observation.state", _signals(log, state)), ("action", _signals(log, action)))
        if signals
    ]
    for patterns, by in ((also, how), (window, "window")):
        made += [
            Wanted(f"observation.{_short(one, prefix).replace('/', '.')}", (one,), by, prefix)
            for one in (_checked(signal, "biufUS", "name its parts") for signal in _signals(log, patterns))
        ]
    twice = [one.name for place, one in enumerate(made) if one.name in {other.name for other in made[:place]}]
    if twice:
        raise ElementError(f"'{twice[0]}' is asked for twice; name it once")
    return made


def frames(
    wanted: Sequence[Wanted], fps: int, widths: Mapping[str, int] | None = None, span_ns: tuple[int, int] | None = None
) -> FrameTable:
    """Return the frames in which each of the signals has a value, from the first such time on.

    `widths` are those of its windows, by name: what `widths_of` gives for it, or more. Within `span_ns`, where that is
    given, of signals that may begin before. Raises ElementError where there is no such time.
    """
    wanted, grid_ns, lacks, held = _on_grid(wanted, fps, span_ns)
    widths = _widths(wanted, grid_ns) if widths is None else widths
    made = [_column(one, grid_ns, widths.get(one.name, 1)) for one in wanted]
    return FrameTable(
        tuple(feature for feature, _ in made),
        tuple(values for _, values in made),
        (int(grid_ns[0]) - wanted[0].signals[0].start_ns) * 1e-9,
        lacks,
        held,
    )


def widths_of(wanted: Sequence[Wanted], fps: int, span_ns: tuple[int, int] | None = None) -> dict[str, int]:
    """Return by name how many samples come between two frames at most, of what windows are asked for.

    Raises ElementError where there are no frames.
    """
    wanted, grid_ns, _, _ = _on_grid(wanted, fps, span_ns)
    return _widths(wanted, grid_ns)


def _widths(wanted: Sequence[Wanted], grid_ns: NDArray[np.int64]) -> dict[str, int]:
    places = {one.name: _places(one.signals[0], grid_ns) for one in wanted if one.how == "window"}
    return {name: int(np.diff(found).max(initial=1)) for name, found in places.items()}


def _on_grid(
    wanted: Sequence[Wanted], fps: int, span_ns: tuple[int, int] | None
) -> tuple[list[Wanted], NDArray[np.int64], str, str]:
    """The time of each frame, ns, the signals from the sample on that is known at the first, which frames lack, and
    which hold what was long before.
    """
    signals = [signal for one in wanted for signal in one.signals]
    empty = next((signal.name for signal in signals if not len(signal)), "")
    if empty:
        raise ElementError(f"'{empty}' has no samples")
    for signal in signals:
        _check_clock(signal, fps, whole_run=span_ns is None)
    # no frame is behind all samples, though the last ones hold
    low_ns, high_ns = span_ns or (min(one._bounds[0] for one in signals), max(one._bounds[1] for one in signals))
    slack_ns = _half_a_tick(signals)
    late, early = max(signals, key=lambda one: one._bounds[0]), min(signals, key=lambda one: one._holds_until(slack_ns))
    begin_ns, end_ns = max(low_ns, late._bounds[0]), min(high_ns, early._holds_until(slack_ns) - 1)
    if end_ns < begin_ns:
        why = f"'{late.name}' begins after another one has ended"
        why = why if begin_ns > low_ns else f"the last sample of '{early.name}' holds no longer when it begins"
        raise ElementError(f"its signals have no time in common: {why}")
    for signal in signals:
        _check_holes(signal, begin_ns, end_ns, fps, whole_run=span_ns is None)
    count, all_of_them = (
        (to - since) * fps // 1_000_000_000 + 1 for since, to in ((begin_ns, end_ns), (low_ns, high_ns))
    )
    reasons = [f"'{late.name}' has no sample before"] if begin_ns > low_ns else []
    reasons += [f"the last sample of '{early.name}' holds no longer"] if end_ns < high_ns else []
    lacks = f"{all_of_them - count} of {all_of_them} frames are not there: {', '.join(reasons)}"
    held = _held(signals, begin_ns, end_ns, fps, whole_run=span_ns is None)
    known = [replace(one, signals=tuple(_from_known(each, begin_ns) for each in one.signals)) for one in wanted]
    # whole numbers: a frame's time never drifts from i / fps
    grid_ns = begin_ns + np.arange(count, dtype=np.int64) * 1_000_000_000 // fps
    return known, grid_ns, lacks if all_of_them > count else "", held


def _half_a_tick(signals: Sequence[Signal]) -> float:
    """Nanoseconds by which the tick at which one more sample would have come may be early; 0 where nobody knows."""
    ticks = [one.axis_ns for one in signals if one.axis_ns is not None and len(one.axis_ns) > 1]
    steps = [one._step_ns for one in signals if len(one) > 1] + [float(np.median(np.diff(one))) for one in ticks[:1]]
    return min(steps, default=0.0) / 2


def _check_clock(signal: Signal, fps: int, *, whole_run: bool) -> None:
    """Raise ElementError where the clock went back by more than a frame: what was known when isn't clear then."""
    back_ns = int((np.maximum.accumulate(signal.time_ns) - signal.time_ns).max()) if signal._falls else 0
    if back_ns * fps > 1_000_000_000:
        raise ElementError(f"the clock of '{signal.name}' goes back by {back_ns * 1e-9:.3g} s{_way_out(whole_run)}")


def _check_holes(signal: Signal, begin_ns: int, end_ns: int, fps: int, *, whole_run: bool) -> None:
    """Raise ElementError where a cut had it switched off, or ticks are missing, for more than a frame."""
    for hole in signal._holes:
        since, to = max(hole[0], begin_ns), min(hole[1], end_ns)
        if (to - since) * fps > 1_000_000_000:
            span = " to ".join(f"{(at - signal.start_ns) * 1e-9:.3g} s" for at in (since, to))
            raise ElementError(f"'{signal.name}' was off, overwritten or not recorded from {span}{_way_out(whole_run)}")


def _held(signals: Sequence[Signal], begin_ns: int, end_ns: int, fps: int, *, whole_run: bool) -> str:
    """Which frames hold what was before, as none of the signals has a sample for long: the loop stood still, or its
    clock was set forward. Raises ElementError for more frames than are made.
    """
    stamps = np.sort(max(signals, key=len).time_ns)
    wide = stills(stamps)
    # those of the others matter only in there
    stamps = np.sort(np.concatenate([stamps, *(_between(one.time_ns, stamps, wide) for one in signals if len(wide))]))
    stamps = stamps[(stamps >= begin_ns) & (stamps <= end_ns)]
    at, steps = stills(stamps), np.diff(stamps)
    usual = int(np.median(steps)) if len(steps) else 0
    without = sum((step - usual) * fps // 1_000_000_000 for step in steps[at].tolist())
    total = (end_ns - begin_ns) * fps // 1_000_000_000 + 1
    told = f"{without} of {total} frames {told_stills(stamps, at, signals[0].start_ns)}" if without else ""
    if total > MOST_SAMPLES:
        way_out = f"at most {MOST_SAMPLES:,} frames are made of a run{_way_out(whole_run)}"
        raise ElementError(f"{told or f'it has {total} frames'}: {way_out}")
    return told


def _between(time_ns: NDArray[np.int64], stamps: NDArray[np.int64], places: NDArray[np.intp]) -> NDArray[np.int64]:
    """What is behind one of these places of stamps that rise, and before the next stamp."""
    behind = np.searchsorted(stamps[places], time_ns, side="right") - 1
    return time_ns[(behind >= 0) & (time_ns < stamps[places + 1][np.maximum(behind, 0)])]


def _way_out(whole_run: bool) -> str:
    return ": episodes that the program marks are taken one by one (episodes='episodes')" if whole_run else ""


def _from_known(signal: Signal, begin_ns: int) -> Signal:
    """The signal in the order of its stamps, from the newest sample on that is known at a time."""
    signal = signal._in_order()
    first = int(np.searchsorted(signal.time_ns, begin_ns, side="right")) - 1
    return signal if first <= 0 else replace(signal, values=signal.values[first:], time_ns=signal.time_ns[first:])


def _places(signal: Signal, grid_ns: NDArray[np.int64]) -> NDArray[np.intp]:
    """Which sample is the newest of each frame."""
    return np.searchsorted(signal.time_ns, grid_ns, side="right") - 1


def same_features(known: tuple[Feature, ...], made: FrameTable, name: str) -> tuple[Feature, ...]:
    """Return the features of an episode, with the words that are known of the others, too.

    Raises ElementError where they aren't those that are known of the others.
    """
    if not known:
        return made.features
    plain, others = ([msgspec.structs.replace(one, labels={}) for one in some] for some in (known, made.features))
    if plain != others:
        raise ElementError(f"'{name}': {_difference(known, made.features)}; take runs of one kind")
    return tuple(_with_words(one, other, name) for one, other in zip(known, made.features, strict=True))


def _with_words(known: Feature, made: Feature, name: str) -> Feature:
    labels = {number: {**known.labels.get(number, {}), **words} for number, words in made.labels.items()}
    for number, words in made.labels.items():
        if wrong := contradiction(known.labels.get(number, {}), words):
            raise ElementError(
                f"'{name}': '{number}' of '{known.name}' means something else than in the runs before: {wrong}; take "
                "runs whose words have the same numbers"
            )
    return msgspec.structs.replace(known, labels={**known.labels, **labels})


def _difference(first: Sequence[Feature], other: Sequence[Feature]) -> str:
    mine, theirs = ({one.name: one for one in some} for some in (first, other))
    for name in (*mine, *theirs):
        if mine.get(name) != theirs.get(name):
            says = [
                f"{one.dtype} {list(one.shape)}" if one else "missing" for one in (mine.get(name), theirs.get(name))
            ]
            if says[0] == says[1]:
                return f"'{name}' is made of other signals, or has other units, than in the first run"
            return f"'{name}' is {says[0]} in the first run and {says[1]} here"
    return "its features have another order than in the first run"


def _column(wanted: Wanted, grid_ns: NDArray[np.int64], width: int) -> tuple[Feature, NDArray[Any]]:
    parts, names, units = [], [], []
    labels: dict[str, dict[int, str]] = {}
    for signal in wanted.signals:
        places = _places(signal, grid_ns)
        flat = np.asarray(signal.values if signal.values.dtype.kind in "US" else np.asarray(signal))
        flat = flat.reshape(len(signal), -1)
        if wanted.how == "window":
            # oldest first; where fewer came since the frame before, it begins with samples that are in that one, too
            parts.append(flat[np.maximum(places[:, None] + np.arange(1 - width, 1), 0)])
        elif wanted.how == "mean" and _has_mean(signal, flat, wanted):
            parts.append(_means(flat, places))
        else:
            parts.append(flat[places])
        short = _short(signal, wanted.prefix)
        own = {f"{short}_{part}": signal.component_labels.get(part, signal.labels) for part in signal.components}
        names += [*(own or (own := {short: signal.labels}))]
        labels |= {name: dict(words) for name, words in own.items() if words}
        units += [signal.unit] * flat.shape[1]
    values = parts[0] if len(parts) == 1 else np.concatenate(parts, axis=-1)
    shape = values.shape[1:] if wanted.how == "window" else (values.shape[1],)
    dtype = wanted.dtype or _dtype(wanted.signals[0].name, values)
    feature = Feature(wanted.name, dtype, shape, tuple(names), tuple(units), labels)
    with np.errstate(over="ignore"):  # beyond float32 it is infinite, which is told
        values = values.astype(object if dtype == "string" else dtype, copy=False)
    return feature, values[:, 0] if shape == (1,) else values


def _not_finite(feature: Feature, values: NDArray[Any]) -> str:
    if values.dtype.kind != "f" or np.isfinite(values).all():
        return ""
    frames_of = (~np.isfinite(values)).reshape(len(values), -1, len(feature.names)).any(axis=1).sum(axis=0)
    found = [
        f"'{name}' in {some} of {len(values)} frames"
        for name, some in zip(feature.names, frames_of.tolist(), strict=True)
        if some
    ]
    return f"{and_more(found, _MOST_TOLD)} ({feature.name})"


def _has_mean(signal: Signal, values: NDArray[Any], wanted: Wanted) -> bool:
    """Whether a mean of its samples is meant: not of bools and enumerations, nor where whole numbers stay such."""
    if values.dtype.kind in "iu":
        return wanted.dtype == "float32" and not signal.labels and not signal.component_labels
    return values.dtype.kind == "f"


def _dtype(name: str, values: NDArray[Any]) -> str:
    kind = values.dtype.kind
    if kind == "u" and values.size and int(values.max()) > INT64[1]:
        raise ElementError(
            f"'{name}': {int(values.max())} is more than a whole number of a data set holds ({INT64[1]})"
        )
    return {"f": "float32", "b": "bool", "U": "string", "S": "string"}.get(kind, "int64")


def _means(values: NDArray[Any], places: NDArray[np.intp]) -> NDArray[Any]:
    """Of each frame the mean of its samples since the frame before, but NaN; where there are none, what held."""
    made = values[places].astype(np.float64)
    begins, ends = places[:-1] + 1, places[1:] + 1
    some = np.flatnonzero(ends > begins)
    if some.size:
        # pairs of bounds: of every other one the sum is what lies between two frames, and left out
        bounds = np.stack([begins[some], ends[some]], axis=1).reshape(-1)
        padded = np.concatenate([values.astype(np.float64), np.zeros((1, values.shape[1]))])
        known = ~np.isnan(padded)
        counts = np.add.reduceat(known, bounds, axis=0, dtype=np.int64)[::2]
        with np.errstate(invalid="ignore"):  # of NaN alone there is no mean, nor of both infinities
            made[some + 1] = np.add.reduceat(np.where(known, padded, 0.0), bounds, axis=0)[::2] / counts
    return made


def _signals(log: Log, patterns: Sequence[str]) -> list[Signal]:
    found: dict[str, Signal] = {}
    for pattern in patterns:
        names = log._named(pattern)
        if not names and pattern not in log:
            raise UnknownSignalError(f"no signal is meant by '{pattern}'{log._hint(pattern)}")
        found |= {name: log[name] for name in names or [pattern]}
    return list(found.values())


def _checked(signal: Signal, kinds: str, way_out: str) -> Signal:
    dtype = signal.values.dtype
    if dtype.kind not in kinds:
        held = {"U": "text", "S": "text", "V": "values of several types", "c": "complex numbers"}
        raise ElementError(f"'{signal.name}' holds {held.get(dtype.kind, str(dtype))}, no numbers; {way_out}")
    return signal


def _short(signal: Signal, prefix: str) -> str:
    return signal.name.removeprefix(prefix).strip("/")

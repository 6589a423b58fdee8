"""Signals of a recording by name, as curves: for `silo plot`, `silo stats` and `silo diff`.

Pure functions on a `Recording`; enumerations and strings become numbers with names, so that they can be drawn.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute.arithmetic import warn_outside
from silo.analysis.compute.calculus import Floats
from silo.analysis.compute.samples import Samples
from silo.analysis.lookup import names_of
from silo.core.arrays.values import as_floats
from silo.core.arrays.values import text_of as value_text
from silo.core.names import Names, is_glob
from silo.core.quantities.writing import there_are
from silo.core.recording import RecordedElement, RecordedEntry, Recording, read_ahead, stamps_of
from silo.errors import ElementError
from silo.expressions.over_recordings import RecordingJudge, is_expression, labels_of, narrowed
from silo.printing import printable

_MOST_NAMES = 50


def is_text(signal: Samples) -> bool:
    """Whether the values are strings."""
    return signal.values.dtype.kind in "SU"


def as_numbers(signal: Samples) -> tuple[Floats, Mapping[int, str]]:
    """Return the values as float64, and names of values: labels of an enumeration, or a number per distinct string.

    Dates become seconds since 1970; of all else `silo.core.arrays.values` tells what it counts as.
    """
    values = signal.values
    kind = values.dtype.kind
    if kind in "SU":
        distinct, codes = np.unique(values, return_inverse=True)
        names = [text_of(value) for value in distinct[:_MOST_NAMES].tolist()]
        return codes.astype(np.float64), dict(enumerate(names))
    if kind in "mM":
        return _seconds(values), {}
    return as_floats(values), signal.labels if kind in "biuf" else {}


def pick(recording: Recording, patterns: Sequence[str]) -> list[Samples]:
    """Return the signals that the patterns name, each once, in the order of the patterns.

    A pattern is a name of elements (all their entries) or of entries, by the rule of `silo.core.names`, or an
    expression that computes a signal (`abs(a) - b`). Raises `ElementError` for a pattern that names nothing, with close
    names.
    """
    chosen: dict[str, Samples] = {}
    names = names_of(recording)
    for pattern in patterns:
        found = _find(recording, names, pattern)
        computed = [] if found else _computed(recording, pattern)
        for signal in computed:
            chosen.setdefault(signal.name, signal)
        if computed:
            continue
        if not found:
            raise ElementError(f"no signal matches '{pattern}'{_hint(names, pattern)}")
        read_ahead(element for element, _ in found)
        for element, entry in found:
            chosen.setdefault(entry.name, picked(recording, element, entry))
    return list(chosen.values())


def pick_all(recording: Recording) -> list[Samples]:
    """Return every signal, in the table's order."""
    read_ahead(recording.elements)
    return [picked(recording, element, entry) for element in recording.elements for entry in element.entries]


def picked(recording: Recording, element: RecordedElement, entry: RecordedEntry) -> Samples:
    """Return one entry with its time stamps, by the rule of `RecordedElement`."""
    stamps = stamps_of(recording, element)
    return Samples(entry.name, entry.values, stamps, element.unit, labels=entry.entry.labels or {})


def window(signal: Samples, start_ns: float, stop_ns: float) -> Samples:
    """Return the samples with stamps from `start_ns` to `stop_ns`, both included."""
    inside = (signal.time_ns >= start_ns) & (signal.time_ns <= stop_ns)
    return signal._part(inside)


def text_of(value: Any) -> str:
    """Return a logged value as text that can be shown; bytes that are no UTF-8 are escapes."""
    return printable(value_text(value))


def _find(recording: Recording, names: Names, pattern: str) -> list[tuple[RecordedElement, RecordedEntry]]:
    found = names.every(pattern, scalars=True)
    if found and not is_glob(pattern) and found != (next_time := names.find(pattern, scalars=True)):
        warn_outside(
            f"'{pattern}' means {len(found)} signals here, from the next release on '{names.name(next_time[0])}' alone "
            f"({len(next_time)}): write '*/{pattern}' for all"
        )
    if not found and not is_expression(pattern) and names.part_of(pattern):
        found = names.part_of(pattern)
        warn_outside(f"'{pattern}' is only a part of names: from the next release on write '*{pattern.strip('*')}*'")
    made = []
    for place, number in found:
        element = recording.elements[place]
        made += [(element, entry) for entry in (element.entries if number is None else (element.entries[number],))]
    return made


def _computed(recording: Recording, pattern: str) -> list[Samples]:
    """What an expression or a derived signal gives: one curve, or one per value of a vector. None for another word."""
    judge = RecordingJudge(narrowed(recording, [pattern]))
    derived = judge.derived(pattern)
    if derived is None and not is_expression(pattern):
        return []
    found = judge.evaluate(pattern if derived is None else f"`{derived.name}`")
    name, labels, unit = derived.name if derived else pattern, labels_of(found.bound), found.bound.unit
    if not found.bound.width:
        return [Samples(name, found.values, found.time_ns, unit, labels=labels)]
    stem = name if derived else f"({name})"
    return [
        Samples(f"{stem}_{at}", found.values[:, at], found.time_ns, unit, labels=labels)
        for at in range(found.bound.width)
    ]


def _hint(names: Names, pattern: str) -> str:
    if not names.names:
        return ": the log holds no signals"
    near = names.near(pattern, scalars=True) or names.names[:3]
    return f"; {there_are(len(names.names), 'element')}, such as {', '.join(near)}"


def _seconds(values: NDArray[Any]) -> Floats:
    fine = values.astype("M8[ns]" if values.dtype.kind == "M" else "m8[ns]")
    seconds = fine.view(np.int64) / 1e9
    seconds[np.isnat(fine)] = np.nan
    return np.asarray(seconds)

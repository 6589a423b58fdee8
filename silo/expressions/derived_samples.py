"""Derived signals as samples of a recording, so that a file has them like any other signal.

They are computed when a recording is written. Who reads the file finds them among its elements, with their definitions
in the conditions, and computes nothing twice.
"""

import math
import operator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from silo.core.conditions import Derived
from silo.core.elements import BufferType, Entry
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.core.structs import alike
from silo.expressions.binding import BoundExpression
from silo.expressions.derived_signals import bound_derived, entries_of, info_of
from silo.expressions.evaluation import UNOBSERVABLE
from silo.expressions.over_recordings import RecordingJudge

NOTHING_IN_COMMON = "its signals have no sample in common"


def with_derived_samples(recording: Recording) -> Recording:
    """Return the recording with its derived signals among its elements; what can't be computed is a warning.

    A condition is of type bool where it can be told at every tick, else 0, 1 and NaN.
    """
    if not recording.conditions.derived:
        return recording
    known = {element.name for element in recording.elements}
    judge = RecordingJudge(recording)
    made: list[RecordedElement] = []
    warnings = list(recording.warnings)
    for one, bound, why in bound_derived(judge.catalogue):
        if one.name in known:
            continue
        element = _computed(judge, recording, one, bound) if bound is not None else None
        if element is not None and element.count:
            made.append(element)
            continue
        text = f"{one.name} = {one.expression} is not in it: {why or NOTHING_IN_COMMON}"
        if text not in warnings:
            warnings.append(text)
    if not made and len(warnings) == len(recording.warnings):
        return recording
    return replace(recording, elements=[*recording.elements, *made], warnings=tuple(warnings))


def _computed(judge: RecordingJudge, recording: Recording, one: Derived, bound: BoundExpression) -> RecordedElement:
    """The samples from where all its signals have one to where the first of them ends.

    Of looping buffers readers expect the newest samples: where it ends earlier, NaN follows.
    """
    info = info_of(one, bound)
    divider = math.gcd(*bound.sources.values())
    first, end = judge.common_span(bound)
    buffer_type = _buffer(recording, bound)
    until = len(recording.time_ns) if buffer_type is BufferType.LOOPING and end > first else end
    wanted = np.arange(first, max(first, until), divider, dtype=np.int64)
    ticks: list[NDArray[np.int64]] = []
    values: list[NDArray[np.float64]] = []
    told = bound.logical
    for judged in judge.batches(bound):
        ticks.append(judged.ticks)
        values.append(judged.numbers().reshape(len(judged.ticks), bound.width or 1))
        inside = (judged.ticks >= first) & (judged.ticks < end)
        told = told and not bool((judged.codes()[inside] == UNOBSERVABLE).any())
    held = np.searchsorted(np.concatenate(ticks), wanted, "right") - 1 if ticks else wanted[:0]
    columns = np.concatenate(values)[held] if ticks else np.zeros((0, bound.width or 1))
    columns[wanted >= end] = np.nan
    dtype = "|b1" if told and until == end else "<f8"
    return alike(
        RecordedElement,
        info,
        divider=divider,
        buffer_type=buffer_type,
        first=first,
        entries=tuple(
            RecordedEntry(one.name + entry.suffix, Entry(entry.suffix, dtype), columns[:, at].astype(dtype))
            for at, entry in enumerate(entries_of(bound.width))
        ),
    )


def _buffer(recording: Recording, bound: BoundExpression) -> BufferType:
    """The type of the buffers that it is computed from; looping if one of them is."""
    elements = list(recording.elements)
    kinds = [elements[column.element].buffer_type for column in bound.columns]
    return BufferType.LOOPING if BufferType.LOOPING in kinds else kinds[0]


def computable(judge: RecordingJudge) -> dict[str, str]:
    """Return the names of derived signals, each with why it can't be computed of a recording; empty where it can."""
    return {
        one.name: why or ("" if bound is None or operator.lt(*judge.common_span(bound)) else NOTHING_IN_COMMON)
        for one, bound, why in bound_derived(judge.catalogue)
    }

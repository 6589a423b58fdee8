"""Parts of a recording, and the same at other times: what `Log.clip` and `Log.resample` give; a run that was cut.

Pure functions on a `Recording`; values stay views of the file where they can.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.arguments import INT64
from silo.core.elements import BufferType, Stretch
from silo.core.recording import (
    Failures,
    RecordedElement,
    RecordedEntry,
    Recording,
    alike,
    falls,
    lazy_entry,
    samples_between,
    stamps_of,
    within,
)


def clipped(recording: Recording, first_ns: int, last_ns: int) -> Recording:
    """Return the ticks with stamps from `first_ns` to `last_ns`, both included, and what was logged at them."""
    kept = within(recording.time_ns, first_ns, last_ns)
    if not isinstance(kept, slice):
        return _kept(recording, kept, first_ns, last_ns)
    low, high = kept.start, kept.stop
    elements = tuple(
        _between(element, low, high)
        if element.own_ns is None
        else _own_between(element, element.own_ns, first_ns, last_ns)
        for element in recording.elements
    )
    offset = recording.offset - (len(recording.time_ns) - high)
    begin = offset - (high - low)
    events = tuple(event for event in recording.events if begin <= event.tick < offset)
    time_ns = recording.time_ns[low:high]
    return replace(recording, time_ns=time_ns, offset=max(offset, 0), elements=elements, events=events)


def _kept(recording: Recording, kept: NDArray[np.bool_], first_ns: int, last_ns: int) -> Recording:
    """The ticks of a mask: those of a log whose clock stepped back are no stretch."""
    places = np.cumsum(kept) - 1

    def cut(element: RecordedElement) -> RecordedElement:
        if element.own_ns is not None:
            return _own_between(element, element.own_ns, first_ns, last_ns)
        ticks = element.first + np.arange(element.count) * element.divider
        mine = kept[ticks]
        at = places[ticks[mine]]
        steps = np.unique(np.diff(at))
        entries = _cut(element, mine, int(mine.sum()))
        if len(steps) > 1:  # where the clock stepped, a slow element has another distance
            return alike(RecordedElement, element, own_ns=recording.time_ns[ticks[mine]], first=0, entries=entries)
        first, divider = int(at[0]) if len(at) else 0, int(steps[0]) if len(steps) else element.divider
        return replace(element, first=first, divider=divider, entries=entries, buffer_type=BufferType.GROWING)

    zero = recording.offset - len(kept)
    events = tuple(
        msgspec.structs.replace(event, tick=int(places[event.tick - zero]))
        for event in recording.events
        if 0 <= event.tick - zero < len(kept) and kept[event.tick - zero]
    )
    time_ns = recording.time_ns[kept]
    elements = tuple(map(cut, recording.elements))
    return replace(recording, time_ns=time_ns, offset=len(time_ns), elements=elements, events=events)


def _between(element: RecordedElement, low: int, high: int) -> RecordedElement:
    """The samples of an element that belong to the ticks `low <= tick < high`."""
    begin, end = samples_between(element.first, element.divider, element.count, low, high)
    first = element.first + begin * element.divider - low
    entries = _cut(element, slice(begin, end), end - begin)
    # a stretch from the middle is what a growing buffer would have held
    return replace(element, first=max(first, 0), entries=entries, buffer_type=BufferType.GROWING)


def _own_between(element: RecordedElement, own: NDArray[np.int64], first_ns: int, last_ns: int) -> RecordedElement:
    """The samples of an element with time stamps of its own, read when they are asked for."""
    kept = within(own, first_ns, last_ns)
    stamps = own[kept]
    return alike(RecordedElement, element, own_ns=stamps, entries=_cut(element, kept, len(stamps)))


def _cut(element: RecordedElement, kept: slice | NDArray[np.bool_], count: int) -> tuple[RecordedEntry, ...]:
    """Some of the samples, read when they are asked for."""

    def values(entry: RecordedEntry) -> NDArray[Any]:
        return entry.values[kept]

    return tuple(lazy_entry(e.name, e.entry, partial(values, e), e.dtype, count) for e in element.entries)


def joined(stretches: Sequence[Recording]) -> Recording:
    """Return the stretches of a run that was cut as one: each sample, event and mark at its own time stamp.

    An element that was changed between two has time stamps of its own.
    """
    by_number = {one.stretch.part: one for one in stretches if one.stretch is not None}
    numbers = sorted(by_number)
    parts = [by_number[number] for number in numbers]
    last = parts[-1]
    places = np.cumsum([0, *(len(part.time_ns) for part in parts)]).tolist()
    time_ns = np.concatenate([part.time_ns for part in parts])
    begin = parts[0].offset - len(parts[0].time_ns)
    by_name: dict[str, list[tuple[int, RecordedElement]]] = {}
    for place, part in zip(places, parts, strict=False):
        for element in part.elements:
            by_name.setdefault(element.name, []).append((place, element))
    own: dict[tuple[tuple[int, int, int], ...], NDArray[np.int64]] = {}
    elements = tuple(_as_one(pieces, time_ns, own) for pieces in by_name.values())
    events = [
        msgspec.structs.replace(event, tick=begin + place + max(event.tick - (part.offset - len(part.time_ns)), 0))
        if place and event.tick >= 0
        else event
        for place, part in zip(places, parts, strict=False)
        for event in part.events
    ]
    missing = [number for number in range(1, numbers[-1]) if number not in numbers]
    told = [f"part {number} of this run, which was cut, is missing: its samples are not here" for number in missing]
    for number, part in zip(numbers, parts, strict=True):
        lost = part.offset - len(part.time_ns) if number > 1 else 0
        told += [f"part {number}: its oldest {lost} ticks were overwritten"] if lost else []
        told += [f"part {number}: {text}" for text in part.warnings]
    return replace(
        last,
        time_ns=time_ns,
        offset=begin + len(time_ns),
        elements=elements,
        started_ns=parts[0].started_ns,
        time_looping=parts[0].time_looping,
        warnings=tuple(told),
        events=tuple(sorted(events, key=lambda event: (event.time_ns, event.number))),
        stretch=last.stretch and Stretch(last.stretch.run, parts=len(parts)),
    )


def _as_one(
    pieces: list[tuple[int, RecordedElement]],
    time_ns: NDArray[np.int64],
    own: dict[tuple[tuple[int, int, int], ...], NDArray[np.int64]],
) -> RecordedElement:
    """An element of several stretches; `own` are time stamps that others have, too, by where they stand."""
    begin, last = pieces[0][0] + pieces[0][1].first, pieces[-1][1]
    if len(pieces) == 1:
        return replace(last, first=begin)
    layout = tuple((place + one.first, one.divider, one.count) for place, one in pieces)
    follows, steps = begin, True
    for first, divider, count in layout:
        steps = steps and first == follows and divider == last.divider
        follows = first + count * divider
    if not steps and layout not in own:
        own[layout] = time_ns[np.concatenate([first + np.arange(count) * step for first, step, count in layout])]
    failed = [(place, one.failures) for place, one in pieces]
    spans = tuple((low + place, high + place) for place, one in failed for low, high in one.spans)
    return alike(
        RecordedElement,
        last,
        first=begin if steps else 0,
        own_ns=None if steps else own[layout],
        entries=tuple(_one_entry([one.entries[number] for _, one in pieces]) for number in range(len(last.entries))),
        lost=sum(one.lost for _, one in pieces),
        failures=Failures(sum(one.count for _, one in failed), spans),
        buffer_type=BufferType.GROWING,
    )


def _one_entry(entries: list[RecordedEntry]) -> RecordedEntry:
    def values() -> NDArray[Any]:
        found: NDArray[Any] = np.concatenate([entry.values for entry in entries])
        return found

    return lazy_entry(
        entries[-1].name, entries[-1].entry, values, entries[-1].dtype, sum(entry.count for entry in entries)
    )


def resampled(recording: Recording, time_ns: NDArray[np.int64], linear: bool) -> Recording:
    """Return every element at the same stamps: the value that held, or, of real numbers, what lies between.

    Stamps before an element's first sample have none of it, nor those at which one more would have come behind its last
    (`linear`: those after its last).
    """
    elements = tuple(_at(recording, element, time_ns, linear) for element in recording.elements)
    rate = None
    if len(time_ns) > 1:
        rate = float((len(time_ns) - 1) / ((time_ns[-1] - time_ns[0]) * 1e-9))
    events = tuple(
        msgspec.structs.replace(event, tick=int(np.searchsorted(time_ns, event.at_ns, side="right")) - 1)
        for event in recording.events
    )
    return replace(
        recording,
        time_ns=time_ns,
        offset=len(time_ns),
        elements=elements,
        frequency_hz=rate,
        time_looping=False,
        events=events,
    )


def _last(own: NDArray[np.int64], time_ns: NDArray[np.int64], smooth: bool) -> int:
    """The last stamp at which there is a value; a single sample, as of a map, holds on."""
    if not len(own) or (len(own) == 1 and not smooth):
        return INT64[1]
    steps = [float(np.median(np.diff(each))) for each in (own, time_ns) if len(each) > 1]
    # the tick at which one more would have come may be early
    return int(own[-1]) if smooth else int(own[-1] + steps[0] - min(steps) / 2)


def _at(recording: Recording, element: RecordedElement, time_ns: NDArray[np.int64], linear: bool) -> RecordedElement:
    own = stamps_of(recording, element)
    order: slice | NDArray[np.intp] = np.argsort(own, kind="stable") if falls(own) else slice(None)
    own = own[order]
    places = np.searchsorted(own, time_ns, side="right") - 1
    begin = int(np.searchsorted(places, 0))
    smooth = linear and all(e.dtype.kind == "f" for e in element.entries)
    end = int(np.searchsorted(time_ns, _last(own, time_ns, smooth), side="right"))
    places = places[begin : max(begin, end)]
    wanted = time_ns[begin : max(begin, end)]

    def values(entry: RecordedEntry) -> NDArray[Any]:
        if not smooth or not len(own):
            return entry.values[order][places]
        zero = own[0]  # doubles hold nanoseconds only over a few months
        made = np.interp((wanted - zero).astype(float), (own - zero).astype(float), entry.values[order].astype(float))
        found: NDArray[Any] = made.astype(entry.dtype)
        return found

    first = begin if len(places) else 0
    entries = tuple(lazy_entry(e.name, e.entry, partial(values, e), e.dtype, len(places)) for e in element.entries)
    if element.own_ns is not None:
        return alike(RecordedElement, element, own_ns=None, first=first, entries=entries)
    return replace(element, divider=1, first=first, entries=entries, buffer_type=BufferType.GROWING)

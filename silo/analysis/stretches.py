"""Parts of a recording, and the same at other times: what `Log.clip` and `Log.resample` give; parts as one.

Pure functions on a `Recording`; values stay views of the file where they can.
"""

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import groupby, pairwise
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute.calculus import between, goes_straight
from silo.analysis.compute.samples import Unfolded
from silo.core.arguments import INT64
from silo.core.arrays.columns import Gap
from silo.core.elements import BufferType, LoggedEvent, Stretch
from silo.core.names import grouped
from silo.core.parameter_images import between as told_between
from silo.core.quantities.writing import many
from silo.core.recording import (
    DamageNotes,
    Failures,
    RecordedElement,
    RecordedEntry,
    Recording,
    as_holds,
    falls,
    held_ticks,
    lazy_entry,
    masked,
    once_each,
    places_of_ticks,
    samples_between,
    samples_of_ticks,
    stamps_of,
    ticks_of,
    within,
)
from silo.core.structs import alike
from silo.errors import ElementError
from silo.expressions.derived_signals import bound_derived, lookback, remembers
from silo.expressions.over_recordings import RecordingJudge


def clipped(recording: Recording, first_ns: int, last_ns: int) -> Recording:
    """Return the ticks with stamps from `first_ns` to `last_ns`, both included, and what was logged at them."""
    kept = within(recording.time_ns, first_ns, last_ns)
    if not isinstance(kept, slice):
        return _kept(recording, kept, first_ns, last_ns)
    elements = tuple(
        _between(element, kept.start, kept.stop)
        if element.own_ns is None
        else _own_between(element, element.own_ns, within(element.own_ns, first_ns, last_ns))
        for element in recording.elements
    )
    return _stretch(recording, kept.start, kept.stop, elements)


def clipped_to_ticks(recording: Recording, first: int, last: int, *, known: bool = False) -> Recording:
    """Return the ticks from `first` to `last` since the start, both included, and what was logged at them.

    `known`: with what was known of each element at the first of them, since the clock stepped back before it.
    """
    low, high = places_of_ticks(recording, first, last)
    begin = _last_reset(recording.time_ns, low) if known and low < high else low
    elements = tuple(
        _between(element, begin, high, _known_from(element, begin, low) if known else begin)
        if element.own_ns is None
        else _own_between(element, element.own_ns, samples_of_ticks(recording, element, begin, high))
        for element in recording.elements
    )
    return _stretch(recording, begin, high, elements)


def _last_reset(time_ns: NDArray[np.int64], place: int) -> int:
    """Where the clock begins that a tick has: at the last stamp, up to its own, that is smaller than the one before."""
    backward = np.flatnonzero(np.diff(time_ns[: place + 1]) < 0)
    return int(backward[-1]) + 1 if len(backward) else 0


def _known_from(element: RecordedElement, begin: int, low: int) -> int:
    """Where the last two samples up to a tick begin, of those from `begin` on: a value, and how long one holds."""
    since, to = samples_between(element.first, element.divider, element.count, begin, low + 1)
    return element.first + max(since, to - 2) * element.divider if to > since else begin


def _stretch(recording: Recording, low: int, high: int, elements: tuple[RecordedElement, ...]) -> Recording:
    """The ticks whose stamps stand at `low <= place < high`, with what was logged at them and happened there."""
    offset = recording.offset - (len(recording.time_ns) - high)
    begin = offset - (high - low)
    events = tuple(told_between(recording.events, begin, offset))
    time_ns = recording.time_ns[low:high]
    return replace(recording, time_ns=time_ns, offset=max(offset, 0), elements=elements, events=events)


def _kept(recording: Recording, kept: NDArray[np.bool_], first_ns: int, last_ns: int) -> Recording:
    """The ticks of a mask: those of a log whose clock stepped back are no stretch."""
    places = np.cumsum(kept) - 1

    def cut(element: RecordedElement) -> RecordedElement:
        if element.own_ns is not None and not element.holds:
            return _own_between(element, element.own_ns, within(element.own_ns, first_ns, last_ns))
        ticks = ticks_of(recording.time_ns, element)
        mine = kept[ticks]
        at = places[ticks[mine]]
        steps = np.unique(np.diff(at))
        entries = _cut(element, mine, int(mine.sum()))
        if element.own_ns is None and len(steps) <= 1:
            first, divider = int(at[0]) if len(at) else 0, int(steps[0]) if len(steps) else element.divider
            return replace(element, first=first, divider=divider, entries=entries, buffer_type=BufferType.GROWING)
        # where the clock stepped, a slow element has another distance
        held = held_ticks(element)
        most = np.full(len(at), element.divider) if held is None else held[mine]
        holds = as_holds(np.minimum(np.diff(at, append=int(kept.sum())), most))
        stamps = recording.time_ns[ticks[mine]]
        return alike(RecordedElement, element, own_ns=stamps, own_ticks=at, holds=holds, first=0, entries=entries)

    zero = recording.offset - len(kept)
    events = tuple(
        msgspec.structs.replace(event, tick=int(places[event.tick - zero]))
        for event in recording.events
        if 0 <= event.tick - zero < len(kept) and kept[event.tick - zero]
    )
    time_ns = recording.time_ns[kept]
    elements = tuple(map(cut, recording.elements))
    return replace(recording, time_ns=time_ns, offset=len(time_ns), elements=elements, events=events)


def _between(element: RecordedElement, low: int, high: int, since: int | None = None) -> RecordedElement:
    """The samples of an element that belong to the ticks `low <= tick < high`; those `since` one of them alone."""
    begin, end = samples_between(element.first, element.divider, element.count, low if since is None else since, high)
    first = element.first + begin * element.divider - low
    entries = _cut(element, slice(begin, end), end - begin)
    # a stretch from the middle is what a growing buffer would have held
    return replace(element, first=max(first, 0), entries=entries, buffer_type=BufferType.GROWING)


def _own_between(element: RecordedElement, own: NDArray[np.int64], kept: slice | NDArray[np.bool_]) -> RecordedElement:
    """Some samples of an element with time stamps of its own, read when they are asked for."""
    stamps, held = own[kept], held_ticks(element)
    holds = () if held is None else as_holds(held[kept])
    return alike(RecordedElement, element, own_ns=stamps, holds=holds, entries=_cut(element, kept, len(stamps)))


def _cut(element: RecordedElement, kept: slice | NDArray[np.bool_], count: int) -> tuple[RecordedEntry, ...]:
    """Some of the samples."""
    return _entries(element, lambda place: element.entries[place].values[kept], count)


def _entries(element: RecordedElement, values: Callable[[int], NDArray[Any]], count: int) -> tuple[RecordedEntry, ...]:
    """The entries of an element with so many other values, which are read when they are asked for."""
    return tuple(
        lazy_entry(one.name, one.entry, partial(values, place), one.dtype, count)
        for place, one in enumerate(element.entries)
    )


@dataclass(frozen=True)
class _Piece:
    """A part among others: `place` is where its first tick stands among all that are kept, `shift` what its ticks are
    numbered higher in the whole. `elements` are without samples that stand in a piece before it.
    """

    part: Recording
    stretch: Stretch
    elements: Sequence[RecordedElement]
    place: int
    shift: int

    @property
    def label(self) -> str:
        """How its warnings begin."""
        if not self.stretch.recorder:
            return f"part {self.stretch.part}"
        ticks = f"ticks {_first(self.part)} to {self.part.offset - 1}" if len(self.part.time_ns) else "no ticks"
        return ticks if self.stretch.part == 1 else f"part {self.stretch.part}, {ticks}"


def joined(parts: Sequence[Recording]) -> Recording:
    """Return the parts of a run that was cut, or of a recording, as one: each sample, event and mark at its own time.

    An element that was changed between two, or lacks samples there, has time stamps of its own. What is missing between
    two is told in `warnings`, and ticks count on over it. Of samples that two files of a recording have, those of the
    first are taken. Values are read when they are asked for.
    """
    ordered = _in_order(parts)
    begin, (pieces, time_ns, told, gaps, overwritten) = _begin(ordered), _placed(ordered)
    begun = [piece.place for before, piece in pairwise(pieces) if piece.stretch.part != before.stretch.part]
    ends = sorted({*gaps, *begun})
    first, last = pieces[0].part, pieces[-1]
    by_name = grouped((element.name, (piece, element)) for piece in pieces for element in piece.elements)
    own: dict[tuple[tuple[int, int, int], ...], tuple[NDArray[np.int64], NDArray[np.int64]]] = {}
    events = _events(pieces, begin)
    whole = replace(
        last.part,
        time_ns=time_ns,
        offset=begin + len(time_ns),
        elements=tuple(
            replace(_as_one(found, time_ns, own, ends), absent=_absent(found, pieces, time_ns))
            for found in by_name.values()
        ),
        started_ns=first.started_ns,
        time_looping=first.time_looping,
        cut_off=sum(piece.part.cut_off for piece in pieces),
        overwritten=overwritten,
        warnings=_warnings(pieces, told),
        events=tuple(once_each(events)),
        stretch=Stretch(last.stretch.run, parts=len(pieces), recorder=last.stretch.recorder),
        gaps=tuple((int(time_ns[at - 1]), int(time_ns[at])) for at in gaps if 0 < at < len(time_ns)),
    )
    cuts = [place for place in begun if place < len(time_ns)]
    return _over_cuts(whole, cuts) if cuts else whole


def _over_cuts(whole: Recording, cuts: Sequence[int]) -> Recording:
    """Return it with derived signals that look back over cuts, at these places: files know nothing of before."""
    known = {one.name for one in whole.conditions.derived}
    plain = [element for element in whole.elements if element.name not in known]
    if len(plain) == len(whole.elements):
        return whole
    judge = RecordingJudge(replace(whole, elements=tuple(plain)))
    looks_back = {
        one.name: lookback(bound)
        for one, bound, why in bound_derived(judge.catalogue)
        if bound is not None and not why and remembers(bound)
    }

    def values(element: RecordedElement, number: int) -> NDArray[Any]:
        stored, stamps = element.entries[number].values, stamps_of(whole, element)
        back, time_ns = looks_back[element.name], whole.time_ns
        ends = [time_ns[min(cut + back.ticks, len(time_ns)) - 1] + back.window_ns for cut in cuts]
        late = np.logical_or.reduce(
            [(stamps >= time_ns[cut]) & (stamps <= end) for cut, end in zip(cuts, ends, strict=True)]
        )
        found = judge.evaluate(f"`{element.name}`")
        places = np.searchsorted(found.time_ns, stamps[late], "right") - 1
        made = stored.copy()
        columns = found.values if found.values.ndim == 2 else found.values[:, None]
        made[late] = np.where(places >= 0, columns[places, number], made[late]) if len(columns) else made[late]
        whole_column: NDArray[Any] = made
        return whole_column

    def over(element: RecordedElement) -> RecordedElement:
        if element.name not in looks_back:
            return element
        return replace(element, entries=_entries(element, partial(values, element), element.count))

    return replace(whole, elements=tuple(map(over, whole.elements)))


def _first(part: Recording) -> int:
    """The tick of its first time stamp."""
    return part.offset - len(part.time_ns)


def _begin(parts: Sequence[tuple[Recording, Stretch]]) -> int:
    """The first tick of all."""
    return next((_first(part) for part, _ in parts if len(part.time_ns)), 0)


def _in_order(parts: Sequence[Recording]) -> list[tuple[Recording, Stretch]]:
    """The stretches of a run by their numbers, each once; the files of a recording as they follow one another."""
    ordered: dict[tuple[int, ...], tuple[Recording, Stretch]] = {}
    for number, part in enumerate(parts):
        stretch = part.stretch
        if stretch is not None:
            # of events alone: behind what is there
            first = _first(part) if len(part.time_ns) else max((0, *(event.tick for event in part.events)))
            key = (stretch.part, first, -part.offset, number) if stretch.recorder else (stretch.part,)
            ordered[key] = part, stretch
    return [ordered[key] for key in sorted(ordered)]


class _Placed(NamedTuple):
    """Where each part stands, the time stamps of all, what is missing between them and at which places, and how many
    ticks looping buffers had no longer.
    """

    pieces: list[_Piece]
    time_ns: NDArray[np.int64]
    told: list[str]
    gaps: list[int]
    overwritten: int


def _placed(parts: Sequence[tuple[Recording, Stretch]]) -> _Placed:
    """Put parts one behind the other."""
    pieces: list[_Piece] = []
    told: list[str] = []
    gaps: list[int] = []
    stamps: list[NDArray[np.int64]] = [np.empty(0, np.int64)]
    known: list[tuple[int, NDArray[np.int64], NDArray[np.int64]]] = []
    taken: dict[str, list[range]] = {}  # by element of the stretch, the ticks of which it has samples
    overwritten = 0
    begin, end, after = _begin(parts), 0, 0  # after: the tick after the last one of the stretch
    for part, stretch in parts:
        first = _first(part)
        elements = [_fresh(element, first, taken) for element in part.elements] if stretch.recorder else part.elements
        if not pieces or stretch.part != pieces[-1].stretch.part:
            missing = _missing(pieces[-1].stretch if pieces else None, stretch)
            cut_on = stretch.part > 1 and not stretch.recorder
            gone, words = _overwritten(part) if cut_on else (0, "")
            overwritten += gone
            told += [*missing, *[f"part {stretch.part}: {words}"] * bool(gone)]
            gaps += [end] * bool(missing or (cut_on and first))
            taken, elements, after = {}, part.elements, first
            if stretch.recorder and (pieces or stretch.since >= 0) and len(part.time_ns):
                after = min(first, max(0, stretch.since))
        if any(one.count for one in part.elements) and not any(one.count for one in elements):
            continue  # a copy
        over = max(0, after - first) if len(part.time_ns) else 0
        if len(part.time_ns) and first > after:
            told.append(_gap(stretch, after, first - 1))
            gaps.append(end)
        place = end - over
        pieces.append(_Piece(part, stretch, elements, place, begin + place - first))
        if over:  # rings end some ticks apart: which of two stamps was logged is told by samples
            for ticks in (one.stamp_indices for one in elements):
                logged = ticks[ticks < over]
                known.append((place, logged, part.time_ns[logged]))
        stamps.append(part.time_ns[over:])
        end, after = end + len(stamps[-1]), max(after, part.offset)
        for one in elements:
            if one.count:
                taken.setdefault(one.name, []).append(_ticks_of(one, first))
    time_ns = np.concatenate(stamps)
    for place, logged, stamp_ns in known:
        time_ns[place + logged] = stamp_ns
    return _Placed(pieces, time_ns, told, gaps, overwritten)


def _missing(before: Stretch | None, stretch: Stretch) -> list[str]:
    """What to tell of the stretches before one, where it comes behind another, or behind none."""
    begin = before.part + 1 if before is not None else stretch.part if stretch.recorder else 1
    return [
        f"part {number} of this run, which was cut, is missing: its samples are not here"
        for number in range(begin, stretch.part)
    ]


def _overwritten(part: Recording) -> tuple[int, str]:
    """Ticks that looping buffers had no longer as a part was saved, the most of any element, and what to tell of it."""
    first = _first(part)
    loops = [one for one in part.elements if one.count and one.buffer_type is BufferType.LOOPING]
    ticks = [max(first, first + one.first - one.divider + 1) for one in loops] or [first]
    least, most = min(ticks), max(ticks)
    told = f"its oldest {many(least or most, 'tick')}, of some elements {many(most, 'tick')}"
    if least + max((one.divider for one in loops), default=0) >= most:
        told = f"its oldest {many(most, 'tick')}"
    elif not least:
        told = f"up to {many(most, 'tick')} of some elements, its oldest"
    return most, f"looping buffers, which keep what is newest, had overwritten {told}"


def _gap(stretch: Stretch, first: int, last: int) -> str:
    of = f" of part {stretch.part}" if stretch.part > 1 else ""
    return (
        f"ticks {first} to {last}{of} are missing: the file that has them was deleted, or is not among these, or "
        "nothing was recorded then"
    )


def _ticks_of(element: RecordedElement, first: int) -> range:
    """The ticks of its samples, in a part that begins with tick `first`."""
    begin = first + element.first
    return range(begin, begin + element.count * element.divider, element.divider)


def _fresh(element: RecordedElement, first: int, taken: Mapping[str, Sequence[range]]) -> RecordedElement:
    """An element of a part that begins with tick `first`, without the samples that are taken already.

    A part that has rows of slow elements alone may come behind one that begins sooner and goes on later.
    """
    ticks = _ticks_of(element, first)
    low, high = 0, len(ticks)
    for other in sorted(taken.get(element.name, ()), key=lambda one: one.start):
        if low < high and other.start <= ticks[low] < other.stop:
            low = min(high, -(-(other.stop - ticks.start) // ticks.step))
        elif low < high and ticks[low] < other.start <= ticks[high - 1]:
            high = -(-(other.start - ticks.start) // ticks.step)
    if (low, high) == (0, len(ticks)):
        return element
    entries = _cut(element, slice(low, high), high - low)
    return replace(element, first=element.first + low * element.divider, entries=entries)


def _events(pieces: Sequence[_Piece], begin: int) -> list[LoggedEvent]:
    """What happened, with ticks as in the whole; what parameters were is told by the first of files that go on."""
    found: list[LoggedEvent] = []
    for _, its in groupby(pieces, key=lambda piece: piece.stretch.part):
        group = list(its)
        filled = [piece for piece in group if len(piece.part.time_ns)]
        place = (filled or group)[0].place
        firsts = [_first(piece.part) for piece in filled]
        goes_on = {id(piece) for before, piece in pairwise(filled) if _first(piece.part) <= before.part.offset}
        for piece in group:
            again = id(piece) in goes_on
            told = (one for one in piece.part.events if not (again and one.change is not None and one.change.is_image))
            found += [_moved(event, filled, firsts, begin, place) for event in told]
    return found


def _moved(event: LoggedEvent, pieces: Sequence[_Piece], firsts: Sequence[int], begin: int, place: int) -> LoggedEvent:
    """An event with its tick as in the whole: one of a tick that is missing stands at the next that is there.

    `pieces` are those of its stretch that have ticks, `firsts` their first ones, `place` is where it begins.
    """
    at = bisect_right(firsts, event.tick)
    if at and (at == len(pieces) or event.tick < pieces[at - 1].part.offset):
        tick = event.tick + pieces[at - 1].shift
    elif at or place:
        before_all = event.tick < 0  # the first tick of its stretch comes after it
        tick = begin + (pieces[at].place if pieces else place) - before_all
    else:
        return event
    if tick == event.tick:
        return event
    change = event.change
    if change is not None and change.until >= 0:
        change = msgspec.structs.replace(change, until=change.until + tick - event.tick)
    return msgspec.structs.replace(event, tick=tick, change=change)


def _warnings(pieces: Sequence[_Piece], told: Sequence[str]) -> Sequence[str]:
    """What is missing, and what the parts tell; of bags it grows by what is found when values are read."""
    texts = [*told, *(f"{piece.label}: {text}" for piece in pieces for text in piece.part.warnings)]
    growing = [(piece.part.warnings, piece.label) for piece in pieces if isinstance(piece.part.warnings, DamageNotes)]
    if not growing:
        return tuple(texts)
    whole = DamageNotes(growing[-1][0].file, texts)
    for notes, label in growing:
        whole.take_in(notes, label)
    return whole


def _as_one(
    found: list[tuple[_Piece, RecordedElement]],
    time_ns: NDArray[np.int64],
    own: dict[tuple[tuple[int, int, int], ...], tuple[NDArray[np.int64], NDArray[np.int64]]],
    ends: Sequence[int],
) -> RecordedElement:
    """An element of several parts; `own` are time stamps, and their places, that others have, too, by where they stand.

    `ends` are the places, rising, before which nothing holds on.
    """
    pieces = sorted(
        [(piece, one) for piece, one in found if one.count] or found[-1:],
        key=lambda pair: pair[0].place + pair[1].first,
    )
    last = pieces[-1][1]
    layout = tuple((piece.place + one.first, one.divider, one.count) for piece, one in pieces)
    begin = follows = layout[0][0]
    steps = True
    for first, divider, count in layout:
        steps = steps and first == follows and divider == last.divider
        follows = first + count * divider
    if not steps and layout not in own:
        ticks = np.concatenate([first + np.arange(count) * step for first, step, count in layout])
        own[layout] = time_ns[ticks], ticks

    def values(number: int) -> NDArray[Any]:
        parts = [one.entries[number].values for _, one in pieces]
        masked = any(isinstance(part, np.ma.MaskedArray) for part in parts)  # values that are none
        found: NDArray[Any] = np.ma.concatenate(parts) if masked else np.concatenate(parts)  # type: ignore[no-untyped-call]
        return found

    spans = tuple((low + piece.shift, high + piece.shift) for piece, one in pieces for low, high in one.failures.spans)
    if len(pieces) == 1:
        return replace(last, first=begin, failures=Failures(last.failures.count, spans))
    return alike(
        RecordedElement,
        last,
        first=begin if steps else 0,
        own_ns=None if steps else own[layout][0],
        own_ticks=None if steps else own[layout][1],
        holds=() if steps else tuple(pair for place in layout for pair in _holds(*place, ends)),
        entries=_entries(last, values, sum(one.count for _, one in pieces)),
        lost=sum(one.lost for _, one in pieces),
        failures=Failures(sum(one.failures.count for _, one in pieces), spans),
    )


def _absent(
    found: Sequence[tuple[_Piece, RecordedElement]], pieces: Sequence[_Piece], time_ns: NDArray[np.int64]
) -> tuple[tuple[int, int, Gap], ...]:
    """What `RecordedElement.absent` is of an element of several parts."""
    its = {id(piece): one for piece, one in found}
    spans: list[tuple[int, int, Gap]] = []
    for piece, stop in zip(pieces, [*(piece.place for piece in pieces[1:]), len(time_ns)], strict=True):
        one = its.get(id(piece))
        if one is None:
            spans.append((piece.place, stop, Gap.OFF))
        elif piece.stretch.recorder:
            continue
        elif one.buffer_type is not BufferType.LOOPING:
            spans.append((piece.place + one.first + one.count * one.divider, stop, Gap.LOST if one.lost else Gap.FULL))
        elif one.count and _first(piece.part) + one.first >= one.divider:
            spans.append((max(0, piece.place - 1), piece.place + one.first, Gap.OVERWRITTEN))
    last = len(time_ns) - 1
    return tuple((int(time_ns[low]), int(time_ns[min(high, last)]), why) for low, high, why in spans if low < high)


def _holds(first: int, divider: int, count: int, ends: Sequence[int]) -> list[tuple[int, int]]:
    """How long samples hold, as `RecordedElement.holds`: the last one to the next end."""
    last = first + (count - 1) * divider
    at = bisect_right(ends, last)
    ticks = min(divider, ends[at] - last) if at < len(ends) else divider
    return [(divider, count - 1), (ticks, 1)] if count > 1 else [(ticks, 1)] * count


def resampled(recording: Recording, time_ns: NDArray[np.int64], linear: bool) -> Recording:
    """Return every element at the same stamps: the value that held, or, of real numbers, what lies between.

    Stamps before an element's first sample have none of it, nor those at which one more would have come behind its last
    (`linear`: those after its last). Where a cut had it switched off, and where ticks are missing, there is none
    (`silo.core.recording.masked`).
    """
    elements = tuple(_at(recording, element, time_ns, linear) for element in recording.elements)
    rate = None
    if len(time_ns) > 1:
        rate = float((len(time_ns) - 1) / ((time_ns[-1] - time_ns[0]) * 1e-9))
    by_name = {element.name: element for element in recording.elements}

    @cache
    def stamps(name: str) -> NDArray[np.int64]:
        element = by_name.get(name)
        if element is None or _is_smooth(element, linear):
            return time_ns[:0]  # what lies between two samples tells nothing
        own = stamps_of(recording, element)
        return np.maximum.accumulate(own)  # where a clock stepped back, the first that is as late is found

    events = tuple(_event_at(event, recording, time_ns, stamps) for event in recording.events)
    return replace(
        recording,
        time_ns=time_ns,
        offset=len(time_ns),
        elements=elements,
        frequency_hz=rate,
        time_looping=False,
        events=events,
        gaps=(),
    )


def resampled_by_ticks(recording: Recording, fold: Unfolded, time_ns: NDArray[np.int64], linear: bool) -> Recording:
    """Return the same of a recording whose clock stepped back, at stamps of its ticks as they rise.

    Raises ElementError for an element whose own stamps are no ticks.
    """
    elements = []
    for element in recording.elements:
        own = element.own_ns
        if own is not None and element.holds:
            own = fold.risen_ns[ticks_of(fold.axis_ns, element)]
        elif own is not None:
            own = fold.of_episodes(own)
        if own is None and element.own_ns is not None:
            raise ElementError(
                f"the clock stepped back, and '{element.name}' has stamps of its own, which tell no episode: take "
                "log.clip(episode) first"
            )
        elements.append(replace(element, own_ns=own))
    before = recording.offset - len(fold.axis_ns)
    events = [
        msgspec.structs.replace(event, stamp_ns=int(fold.risen_ns[event.tick - before]))
        if before <= event.tick < recording.offset
        else event
        for event in recording.events
    ]
    gaps = _risen_gaps(recording.gaps, fold)
    risen = replace(recording, time_ns=fold.risen_ns, elements=tuple(elements), events=tuple(events), gaps=gaps)
    made = resampled(risen, time_ns, linear)
    told = [
        msgspec.structs.replace(event, stamp_ns=one.stamp_ns)
        for event, one in zip(made.events, recording.events, strict=True)
    ]
    return replace(made, time_ns=fold.stamps(time_ns), events=tuple(told))


def _risen_gaps(gaps: Sequence[tuple[int, int]], fold: Unfolded) -> tuple[tuple[int, int], ...]:
    """Between which stamps of ticks as they rise some are missing."""
    found, since = [], 0
    for before, behind in gaps:
        places = np.flatnonzero((fold.axis_ns[since:-1] == before) & (fold.axis_ns[since + 1 :] == behind))
        if len(places):
            since += int(places[0])
            found.append((int(fold.risen_ns[since]), int(fold.risen_ns[since + 1])))
    return tuple(found)


def _event_at(
    event: LoggedEvent, recording: Recording, time_ns: NDArray[np.int64], sampled: Callable[[str], NDArray[np.int64]]
) -> LoggedEvent:
    """An event by the ticks of other stamps; of a change of parameters those at which it was there, and over."""
    change, ticks = event.change, recording.time_ns
    if change is None or not len(ticks) or not len(time_ns):
        return msgspec.structs.replace(event, tick=int(np.searchsorted(time_ns, event.at_ns, side="right")) - 1)
    if event.tick < 0:
        return event  # the logger stood still: no row has it
    before = recording.offset - len(ticks)
    here = event.tick - before
    asked = np.clip([here - change.span, change.until - before], 0, len(ticks) - 1)
    stamps = [event.at_ns, *ticks[asked].tolist()]
    tick, begin, until = np.minimum(np.searchsorted(time_ns, stamps), len(time_ns) - 1).tolist()
    # samples from there on are no older than the change
    since = here + change.held
    fresh_ns = int(ticks[max(since, 0)]) if since < len(ticks) else INT64[1]
    fresh = [own[np.searchsorted(own, fresh_ns) :][:1] for own in (sampled(name) for name, _, _ in change.values)]
    held = max((int(np.searchsorted(time_ns, one[0])) if len(one) else len(time_ns) for one in fresh), default=tick)
    told = msgspec.structs.replace(
        change, span=max(0, tick - begin), until=until if change.until >= 0 else -1, held=max(0, held - tick)
    )
    return msgspec.structs.replace(event, tick=tick, change=told)


def held_until(recording: Recording, element: RecordedElement) -> NDArray[np.int64] | None:
    """Before which stamp each sample holds, where a cut changed it or ticks are missing; None: to the next one."""
    held, own, ticks = held_ticks(element), stamps_of(recording, element), recording.time_ns
    if (held is None and not recording.gaps) or not len(own) or falls(own):
        return None
    step = int(np.median(np.diff(ticks))) if len(ticks) > 1 else 0
    ends = element.stamp_indices + element.divider if held is None else ticks_of(ticks, element) + held
    last = len(ticks) - 1
    until = ticks[np.minimum(ends, last)] + np.maximum(ends - last, 0) * step
    for before, _ in recording.gaps:
        at = int(np.searchsorted(own, before, side="right")) - 1
        if at >= 0:
            until[at] = min(int(until[at]), before + step)
    return np.asarray(until, np.int64)


def off_ticks(recording: Recording, element: RecordedElement) -> tuple[tuple[int, int], ...]:
    """From which ticks on, and before which, an element that a cut changed holds no value between two samples."""
    held = held_ticks(element)
    if held is None or element.own_ns is None or len(held) < 2:
        return ()
    places = ticks_of(recording.time_ns, element)
    ends, following = (places + held)[:-1], places[1:]
    off = ends < following
    return tuple(zip(ends[off].tolist(), following[off].tolist(), strict=True))


def holes(recording: Recording, element: RecordedElement) -> tuple[tuple[int, int], ...]:
    """From which stamps on, and before which, an element between two of its samples holds no value."""
    until = held_until(recording, element)
    if until is None:
        return ()
    own = stamps_of(recording, element)
    at = np.flatnonzero(until[:-1] < own[1:])
    return tuple(zip(until[at].tolist(), own[at + 1].tolist(), strict=True))


def _last(own: NDArray[np.int64], time_ns: NDArray[np.int64], smooth: bool) -> int:
    """The last stamp at which there is a value; a single sample, as of a map, holds on."""
    if not len(own) or (len(own) == 1 and not smooth):
        return INT64[1]
    steps = [float(np.median(np.diff(each))) for each in (own, time_ns) if len(each) > 1]
    # the tick at which one more would have come may be early
    return int(own[-1]) if smooth else int(own[-1] + steps[0] - min(steps) / 2)


def _is_smooth(element: RecordedElement, linear: bool) -> bool:
    return linear and all(goes_straight(e.dtype, e.entry.labels) for e in element.entries)


def _at(recording: Recording, element: RecordedElement, time_ns: NDArray[np.int64], linear: bool) -> RecordedElement:
    own = stamps_of(recording, element)
    order: slice | NDArray[np.intp] = np.argsort(own, kind="stable") if falls(own) else slice(None)
    own = own[order]
    places = np.searchsorted(own, time_ns, side="right") - 1
    begin = int(np.searchsorted(places, 0))
    smooth = _is_smooth(element, linear)
    until = held_until(recording, element)
    last = _last(own, time_ns, smooth) if until is None or smooth else int(until[-1]) - 1
    end = int(np.searchsorted(time_ns, last, side="right"))
    places = places[begin : max(begin, end)]
    wanted = time_ns[begin : max(begin, end)]
    off = None if until is None else wanted >= until[places]

    @cache
    def straight() -> NDArray[np.float64]:
        zero = own[0]  # doubles hold nanoseconds only over a few months
        columns = np.stack([e.values[order].astype(float) for e in element.entries], axis=-1)
        return between(element.kind, (own - zero).astype(float), columns, (wanted - zero).astype(float))

    def values(place: int) -> NDArray[Any]:
        entry, held = element.entries[place], not smooth or not len(own)
        found: NDArray[Any] = entry.values[order][places] if held else straight()[:, place].astype(entry.dtype)
        return found if off is None or not off.any() else masked(found, off)

    first = begin if len(places) else 0
    entries = _entries(element, values, len(places))
    if element.own_ns is not None:
        return alike(RecordedElement, element, own_ns=None, holds=(), divider=1, first=first, entries=entries)
    return replace(element, divider=1, first=first, entries=entries, buffer_type=BufferType.GROWING)

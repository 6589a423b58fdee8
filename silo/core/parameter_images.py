"""Images of all parameters: what is known of them once changes are kept no more, and of which ticks nothing is.

Pure rules, used by whatever leaves out the oldest events of a run, and by who reads them.
"""

import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import msgspec

from silo.core.elements import PARAMETER, LoggedEvent
from silo.core.tuning.parameters import ParameterChange, ParameterValue

FOR_EVER = 1 << 62
NOT_KNOWN = "what parameters were is not always known: "


class Unknown(NamedTuple):
    """Ticks of which nobody knows what the parameters were: `first` is the first one, `end` the next that is known.

    `whole`: an image tells what all are at the end, and not a change what it found.
    """

    first: int
    end: int
    changes: int
    whole: bool

    def text(self, seconds: Callable[[int], float]) -> str:
        """Why that is so, in words; `seconds` tells when a tick was."""
        changes = "1 change is" if self.changes == 1 else f"{self.changes:,} changes are"
        until = "" if self.end == FOR_EVER else f" to {seconds(self.end):g} s"
        return f"{changes} not kept, from {seconds(self.first):g} s on{until}: a run keeps the newest"


def image_after(events: Iterable[LoggedEvent]) -> LoggedEvent | None:
    """Return what parameters were after these events, which are kept no more; None where they tell of none."""
    told = [event for event in events if event.change is not None]
    if not told:
        return None
    values: dict[str, ParameterValue] = {}
    ticks, order, count, held = [], -1, 0, 0
    for event in told:
        change = event.change
        assert change is not None
        values |= {name: new for name, _, new in change.values}
        order, held = max(order, change.order), max(held, event.tick + change.held)
        count += not change.is_image
        ticks += [event.tick - change.span] if not change.is_image or change.order > 0 else []
    last = max(event.tick for event in told)
    change = ParameterChange(
        tuple((name, None, value) for name, value in values.items()),
        order=order,
        span=last - min(ticks, default=last),
        held=max(0, held - last),
    )
    text = f"{len(values)} parameter{'s' * (len(values) != 1)} after {count:,} changes that are not kept"
    return msgspec.structs.replace(told[-1], kind=PARAMETER, text=text, tick=last, change=change)


def between(events: Iterable[LoggedEvent], first: int, end: int) -> list[LoggedEvent]:
    """Return what is left of events where ticks before `first`, and from `end` on, are left out.

    An image tells what parameters were before, and one without values that nobody knows.
    """
    every = list(events)
    told = [event for event in every if event.change is not None and event.tick >= 0]
    told.sort(key=lambda event: (event.tick, event.time_ns, event.number))
    unknown = unknown_of_runs(told)
    begin = _before([event for event in told if event.tick < first], first, unknown)
    kept = [*begin, *(event for event in every if first <= event.tick < end)]
    late = next((one for one in unknown if max(one.first, first) < end <= one.end), None)
    changes = [event.change for event in kept if event.change is not None]
    if late is None or not changes or (begin and not changes[0].values):
        return kept
    order = max(change.order for change in changes) + 1
    nothing = ParameterChange(order=order, span=end - 1 - max(late.first, first))
    last = next(event for event in reversed(kept) if event.change is not None)
    text = "changes of parameters that are not kept"
    return [*kept, msgspec.structs.replace(last, kind=PARAMETER, text=text, tick=end - 1, number=order, change=nothing)]


def _before(told: Sequence[LoggedEvent], first: int, unknown: Sequence[Unknown]) -> list[LoggedEvent]:
    """An image of what parameters were after these; `unknown` are the ticks of all."""
    told = [event for event in told if event.run == told[-1].run]  # a run begins with an image
    gaps = unknown_ticks(told)
    known = max((one.end for one in gaps if not one.whole and one.end <= first), default=-1)
    image = image_after(event for event in told if event.tick >= known)
    if image is None or image.change is None:
        return []
    change, at_start = image.change, told[0].change
    if any(one.first < first < one.end for one in unknown):
        order = change.order + (not any(one.end > first for one in gaps))
        change = msgspec.structs.replace(change, values=(), order=order)
    elif len(told) == 1 and at_start is not None and at_start.is_image:
        return list(told)
    text = f"{len(change.values)} parameter{'s' * (len(change.values) != 1)} before this part of the run"
    return [msgspec.structs.replace(image, text=text, number=max(change.order, 0), change=change)]


def image_until(event: LoggedEvent, last: int) -> LoggedEvent | None:
    """Return what is left of a change where ticks after this one are left out.

    Of an image behind it, of which some changes may have been at ticks before, that these are not known.
    """
    if event.tick <= last:
        return event
    change = event.change
    if change is None or change.order <= 0 or not change.is_image or event.tick - change.span > last:
        return None
    nothing = msgspec.structs.replace(change, values=(), span=last - (event.tick - change.span))
    return msgspec.structs.replace(event, tick=last, change=nothing)


def unknown_ticks(events: Sequence[LoggedEvent]) -> list[Unknown]:
    """Return of which ticks the events of one run, oldest first, don't tell what parameters were.

    By the count of its changes: where one is missing, until the next image that comes after it.
    """
    told = [(event, event.change) for event in events if event.change is not None]
    ticks = {change.order: event.tick for event, change in told if change.order > 0 and not change.is_image}
    images = [(event, change) for event, change in told if change.order > 0 and change.is_image]
    starts = [event.tick for event, change in told if change.order == 0 and change.is_image]
    if starts:
        ticks[0] = starts[0]
    elif images:  # what came before them stands in another part
        first = min(change.order for _, change in images)
        if not any(order <= first for order in ticks):
            ticks[first - 1] = min(event.tick - change.span for event, change in images if change.order == first)
    orders = sorted(ticks.keys() | {change.order for _, change in images})
    found = []
    for before, order in itertools.pairwise(orders):
        missing = order - before - (order in ticks)
        if missing > 0:
            covering = [
                (event, change)
                for event, change in images
                if change.order >= before + missing and event.tick - change.span < ticks.get(order, FOR_EVER)
            ]
            image = next((one for one in covering if one[1].values), None)
            begin = max([ticks.get(before, -1), *(event.tick - change.span for event, change in covering[:1])])
            end = image[0].tick if image is not None else FOR_EVER if covering else ticks.get(order, FOR_EVER)
            if begin < end or not covering:
                found.append(Unknown(max(begin, 0), end, missing, bool(covering)))
    return found


def unknown_of_runs(events: Sequence[LoggedEvent]) -> list[Unknown]:
    """Return the same of the events of several runs."""
    told = [event for event in events if event.change is not None]
    told.sort(key=lambda event: (event.tick, event.time_ns, event.number))
    runs = dict.fromkeys(event.run for event in told)
    return [one for run in runs for one in unknown_ticks([event for event in told if event.run == run])]


def unknown_texts(events: Sequence[LoggedEvent], first: int, seconds: Callable[[int], float]) -> tuple[str, ...]:
    """Return the same as warnings of a log that begins with tick `first`."""
    unknown = [one for one in unknown_of_runs(events) if one.end > first]
    return tuple(f"{NOT_KNOWN}{one.text(seconds)}" for one in unknown)

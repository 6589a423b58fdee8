"""When a condition turns true in samples that are here: of a file, or held while a picture stands still."""

import asyncio
import threading
from collections.abc import Callable, Sequence

import msgspec
import numpy as np

from silo.conditions.requests import TriggerTried
from silo.core.conditions import Conditions, Derived
from silo.core.elements import ElementInfo
from silo.core.recording import RecordedElement, RecordedEntry, Recording
from silo.expressions.binding import bind
from silo.expressions.evaluation import FALSE, TRUE, UNOBSERVABLE
from silo.expressions.over_recordings import RecordingJudge
from silo.judging.checks import table_catalogue
from silo_tui.model.samples.source import Samples


async def turned_true(recording: Recording, condition: str) -> TriggerTried:
    """Return when a condition turned true in a recording. Raises ExpressionError with the place of a mistake."""
    left = threading.Event()
    try:
        return await asyncio.to_thread(_turned_true, recording, condition, left)
    finally:
        left.set()  # a thread goes on when nobody waits for it any more


def _turned_true(recording: Recording, condition: str, left: threading.Event) -> TriggerTried:
    judge = RecordingJudge(recording)
    bound, found = bind(condition, judge.catalogue).condition(), list[tuple[int, int]]()
    before, judged, blind = UNOBSERVABLE, 0, 0
    for batch in judge.batches(bound):
        if left.is_set():
            break
        codes = batch.codes()
        known = codes != UNOBSERVABLE
        told = np.concatenate([[before], codes[known]])
        rises = np.flatnonzero((told[1:] == TRUE) & (told[:-1] == FALSE))
        found += zip(batch.ticks[known][rises].tolist(), batch.time_ns[known][rises].tolist(), strict=True)
        before, judged, blind = int(told[-1]), judged + len(codes), blind + int(np.count_nonzero(~known))
    ticks, times = map(list, zip(*found, strict=True)) if found else ([], [])
    begin_ns, end_ns = judge.time_ns[[0, -1]].tolist() if len(judge.time_ns) else (0, 0)
    return TriggerTried(len(found), ticks, times, 0, len(judge.time_ns) - 1, begin_ns, end_ns, judged, blind)


def together(there: TriggerTried, here: TriggerTried) -> TriggerTried:
    """Return what was found in samples that are here, and before them what the logger found there."""
    if there.why or there.begin_ns >= here.begin_ns:
        return here
    older = sum(time_ns < here.begin_ns for time_ns in there.time_ns)
    untold = there.fires - len(there.time_ns) if older else 0
    return msgspec.structs.replace(
        here, fires=untold + older + here.fires, ticks=[*there.ticks[:older], *here.ticks],
        time_ns=[*there.time_ns[:older], *here.time_ns], begin_ns=there.begin_ns,
    )  # fmt: skip


def samples_for(
    condition: str,
    elements: Sequence[ElementInfo],
    prefix: str,
    derived: Sequence[Derived],
    held: Callable[[str], Samples | None],
) -> Recording | None:
    """Return the samples that a condition is judged by, as a recording of its signals; None where some aren't `held`.

    `elements` and `derived` are those of the logger's table. Raises ExpressionError with the place of a mistake.
    """
    columns = bind(condition, table_catalogue(elements, prefix, derived)).condition().columns
    found = []
    for info in (elements[place] for place in dict.fromkeys(column.element for column in columns)):
        wanted = {column.entry for column in columns if elements[column.element] is info}
        samples = {at: held(info.name + info.entries[at].suffix) for at in wanted}
        stamps = next(iter(samples.values()))
        if stamps is None or any(one is None or len(one[0]) != len(stamps[0]) for one in samples.values()):
            return None
        nothing = np.full(len(stamps[0]), np.nan)
        values = [one[1] if (one := samples.get(at)) else nothing for at in range(len(info.entries))]
        entries = tuple(
            RecordedEntry(info.name + entry.suffix, entry, each)
            for entry, each in zip(info.entries, values, strict=True)
        )
        now = info.options
        found.append(
            RecordedElement(
                info.name, info.unit, info.kind, info.shape, now.divider, now.buffer, 0, entries, own_ns=stamps[0]
            )
        )
    if not found:
        return None
    none = np.zeros(0, np.int64)
    return Recording("", none, 0, found, prefix, conditions=Conditions(tuple(derived)))

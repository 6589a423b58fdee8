"""Looking through samples that are here, and adding them up; where only columns are, through these."""

from collections.abc import Awaitable, Callable, Sequence

import numpy as np

from silo.core.arrays.values import newest_values
from silo.core.elements import ElementInfo
from silo.expressions.search import Finder, FoundMoments, Looking
from silo.expressions.span import HELD_PERIODS
from silo_tui.model.samples.live import Reading
from silo_tui.model.samples.source import Samples


def found_in(looking: Looking, samples: Samples, around_ns: int, most: int) -> FoundMoments:
    """Return the moments of one signal, the `most` next to a time."""
    finder = Finder(looking, around_ns, most)
    if looking.needs_span:
        finder.measure(samples[1])
    finder.feed(*samples)
    return finder.found


async def reading_of(
    samples: Callable[[str, int, int], Awaitable[Samples]], period_ns: int, element: ElementInfo, time_ns: int
) -> Reading:
    """Return what held at a time: the newest sample up to then. Raises a SiloError where a logger doesn't answer."""
    newest = np.full(len(element.entries), np.nan)
    texts: dict[int, str] = {}
    held = 0
    begin_ns = time_ns - HELD_PERIODS * period_ns
    for position, entry in enumerate(element.entries):
        stamps, values = await samples(element.name + entry.suffix, begin_ns, time_ns)
        held = max(held, len(stamps))
        if len(stamps):
            floats, words = newest_values(values[-1:])
            newest[position] = floats[0]
            texts.update((position, word) for word in words.values())
    return Reading(newest, texts, held, 0, time_ns)


def joined(parts: Sequence[Samples]) -> Samples:
    """Return the samples of pieces, which are in the order of time, as one."""
    parts = [part for part in parts if len(part[0])] or list(parts[:1])
    if not parts:
        return np.zeros(0, np.int64), np.zeros(0)
    if len(parts) == 1:
        return parts[0]
    return np.concatenate([time_ns for time_ns, _ in parts]), np.concatenate([values for _, values in parts])

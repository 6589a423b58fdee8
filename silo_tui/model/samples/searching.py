"""Looking through samples that are here, and adding them up; where only columns are, through these."""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from silo.core.arrays.values import newest_values
from silo.core.elements import ElementInfo, Sought
from silo.expressions.search import Finder, FoundMoments, Looking
from silo.expressions.span import HELD_PERIODS, NAN, Between, between
from silo_tui.model.samples.live import Reading
from silo_tui.model.samples.pinned import PinnedSource
from silo_tui.model.samples.source import PlotSource, Samples
from silo_tui.model.words import text


def found_in(looking: Looking, samples: Samples, around_ns: int, most: int) -> FoundMoments:
    """Return the moments of one signal, the `most` next to a time."""
    finder = Finder(looking, around_ns, most)
    if looking.needs_span:
        finder.measure(samples[1])
    finder.feed(*samples)
    return finder.found


async def find_here(
    pieces: Sequence[PinnedSource], looking: Mapping[str, Looking], around_ns: int, most: int, why: str, *, pinned: bool
) -> tuple[dict[str, FoundMoments], str]:
    """Look through what is here of some pieces: samples, and columns for those that can't come.

    Returns why some could not be looked through, too: `why`, or how wide these columns are.
    """
    for piece in pieces:
        await piece.fetch(piece.begin_ns, piece.end_ns)
    found, widest_ns = {}, 0
    for name, one in looking.items():
        if one.what is Sought.EDGE:  # a step from sample to sample: columns have none
            parts = [(piece.held(name, piece.begin_ns, piece.end_ns), 0) for piece in pieces]
        else:
            parts = [piece.with_columns(name) for piece in pieces]
        wide_ns = max(wide for _, wide in parts)
        here = joined([some for some, _ in parts])
        sought = replace(one, period_ns=max(one.period_ns, wide_ns))
        found[name] = await asyncio.to_thread(found_in, sought, here, around_ns, most)
        widest_ns = max(widest_ns, wide_ns)
    return found, _only(widest_ns, pinned=pinned) if widest_ns else why


async def measure_here(
    pieces: Sequence[PinnedSource], names: Sequence[str], a_ns: int, b_ns: int, why: str, *, pinned: bool
) -> tuple[dict[str, Between], str]:
    """Measure what is here; where only columns are, what these tell: the ends, the smallest, the largest."""
    found, widest_ns = {}, 0
    for name in names:
        parts = [piece.with_columns(name) for piece in pieces]
        wide_ns = max(wide for _, wide in parts)
        time_ns, values = joined([some for some, _ in parts])
        facts = await asyncio.to_thread(between, time_ns, values, a_ns, b_ns)
        found[name] = facts if not wide_ns else replace(facts, mean=NAN, std=NAN, rms=NAN, not_finite=0)
        widest_ns = max(widest_ns, wide_ns)
    return found, _only(widest_ns, pinned=pinned) if widest_ns else why


async def reading_of(source: PlotSource | PinnedSource, element: ElementInfo, time_ns: int) -> Reading:
    """Return what held at a time: the newest sample up to then. Raises a SiloError where a logger doesn't answer."""
    newest = np.full(len(element.entries), np.nan)
    texts: dict[int, str] = {}
    held = 0
    begin_ns = time_ns - HELD_PERIODS * source.period_ns(element.name)
    for position, entry in enumerate(element.entries):
        stamps, values = await source.samples(element.name + entry.suffix, begin_ns, time_ns)
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


def _only(widest_ns: int, *, pinned: bool) -> str:
    return f"{'columns' if pinned else 'picture'} only, to {text.span(widest_ns / 1e9, 2)}"

"""Which samples a buffer keeps: the one place where its type is turned into rows. Several elements share a ring."""

import functools
import re
from collections.abc import Iterable, Mapping

import numpy as np

from silo.core.elements import BufferType, ElementInfo, ElementOptions
from silo.core.quantities.writing import and_more

LARGE_BYTES = 1_000_000_000  # of one run: so much takes seconds to allocate and to touch, and not every robot has it

_DTYPE = re.compile(r"[<>=|]?(b1|[iu][1248]|f(2|4|8|12|16)|c(8|16|24|32)|[SU]\d{1,9}|[mM]8(\[\d{0,9}[A-Za-z]{1,2}\])?)")


def kept_rows(options: ElementOptions, begin: int, end: int) -> tuple[int, int]:
    """Return which of the rows `begin <= row < end` of its ring belong to an element's buffer, as begin and end."""
    if options.buffer is BufferType.FIXED:
        end = min(end, options.size)
    elif options.buffer is BufferType.LOOPING:
        begin = max(begin, end - options.size)
    return begin, max(begin, end)


def most_kept(options: ElementOptions) -> int:
    """Return how many samples the buffer can keep; a number beyond any for one that grows."""
    return 2**62 if options.buffer is BufferType.GROWING else options.size


def buffer_bytes(info: ElementInfo) -> int:
    """Return what the samples of an element's buffer take, one that grows at its begin; 0 where it isn't logged."""
    if not info.options.enabled:
        return 0
    return info.options.size * sum(item_bytes(entry.dtype) for entry in info.entries)


@functools.lru_cache(maxsize=1000)
def item_bytes(dtype: str) -> int:
    """Bytes of a type that a segment may hold, -1 for what is none."""
    try:
        return np.dtype(dtype).itemsize if _DTYPE.fullmatch(dtype) else -1
    except TypeError:  # a unit of time that NumPy doesn't know
        return -1


def kept_how(infos: Iterable[ElementInfo]) -> dict[str, BufferType]:
    """Return how each element is kept that is logged."""
    return {info.name: info.options.buffer for info in infos if info.options.enabled}


def ending_by_time(kept: Mapping[str, BufferType], max_time_s: float) -> list[str]:
    """Return the elements for which a run ends after `max_time`, all others with them: none where nothing ends it.

    A run whose buffers are all looping has no end, one whose buffers are all fixed ends as these are full.
    """
    if not max_time_s or set(kept.values()) in ({BufferType.LOOPING}, {BufferType.FIXED}, set()):
        return []
    return [name for name, buffer in kept.items() if buffer is not BufferType.LOOPING]


def end_text(kept: Mapping[str, BufferType], max_time_s: float) -> str:
    """Return that a run ends by itself after `max_time`, and what to do about it; empty where time doesn't end it."""
    if not (ending := ending_by_time(kept, max_time_s)):
        return ""
    return (
        f"logging stops by itself after {max_time_s:g} s (max_time), as not all buffers are looping "
        f"({and_more(ending, 3)}): for a run without end give max_time=0, or make them looping"
    )


def new_end_text(before: Mapping[str, BufferType], after: Mapping[str, BufferType], max_time_s: float) -> str:
    """Return what is to be told of the end of a run by an edit; empty where it would have ended before, too."""
    return "" if ending_by_time(before, max_time_s) else end_text(after, max_time_s)


def large_text(infos: Iterable[ElementInfo]) -> str:
    """Return how much memory a run of these elements takes, fit to show; empty where that is nothing to speak of."""
    sizes = sorted(((buffer_bytes(info), info.name) for info in infos), reverse=True)
    total = sum(size for size, _ in sizes)
    if total < LARGE_BYTES:
        return ""
    size, name = sizes[0]
    return (
        f"the buffers take {total / 1e9:.1f} GB from the next start on, which takes the longer for it "
        f"(most: {name}, {size / 1e9:.2f} GB): make buffers smaller unless that is meant"
    )

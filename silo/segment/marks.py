"""Marks: words that the program leaves at a tick, `log.mark("push 3")`.

They stand in the segment, in a ring of slots of 256 bytes, so that a mark outlives a program that is killed in the next
instruction: once `mark` returned it is as safe as a committed row. One `pack_into` writes a slot, 0.27 us in all; its
number stands at both ends, so that a slot that is being written, or never was finished, is no mark.
"""

import struct
import time
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import MARKER, LoggedEvent

SLOTS = 1024  # the newest that are kept for readers; a power of two
TEXT_BYTES = 224
SLOT = struct.Struct(f"@qqq{TEXT_BYTES}sq")  # number from 1 on, tick, wall clock in ns, text, the number again
SLOT_WORDS = SLOT.size // 8
SLOT_SHIFT = SLOT.size.bit_length() - 1
LAST_SLOT = SLOTS - 1
MARKS_BYTES = SLOTS * SLOT.size

Mark = Callable[..., None]  # of words, as `Logger.mark` takes them
NO_WORDS = "mark"

# where those of a run go: the bytes of the slots; words of which the one at that place counts ticks; the next number
MarksOfRun: TypeAlias = "tuple[memoryview, memoryview[int], int, Callable[[], int]]"


def marker() -> "tuple[Mark, Callable[[MarksOfRun | None], None]]":
    """Return `mark(text)` of a logger, and what tells it the run that is marked from now on; None: none is.

    Threads may call it at once: each takes a number of its own. Who keeps it marks the present run with it.
    """

    pack, now = SLOT.pack_into, time.time_ns
    marked: MarksOfRun | None = None

    def mark(text: str = NO_WORDS, *more: object) -> None:
        run = marked
        if run is None:
            return
        area, words, head, take = run
        if more:
            text = " ".join(map(str, (text, *more)))
        number = take()
        try:
            data = text.encode()
        except (AttributeError, UnicodeEncodeError):  # no text, or letters that Unicode doesn't have: said all the same
            data = str(text).encode("utf-8", "backslashreplace")
        pack(area, (number & LAST_SLOT) << SLOT_SHIFT, number, words[head] - 1, now(), data, number)

    def mark_in(run: "MarksOfRun | None") -> None:
        nonlocal marked
        marked = run

    mark.__qualname__ = "log.mark"  # as it stands in what Python says of a wrong call
    return mark, mark_in


def read_marks(words: NDArray[np.uint64], since: int, logger: str, run: str) -> list[LoggedEvent]:
    """The marks with numbers above `since` that the slots still hold, in their order; `words` are those of the slots.

    `number` is that of the mark in its run.
    """
    slots = words.reshape(-1, SLOT_WORDS)
    fresh = np.flatnonzero(slots[:, 0] > since)
    if not len(fresh):
        return []
    copied = np.ascontiguousarray(slots[fresh])
    whole = copied[(copied[:, 0] == copied[:, -1]) & (copied[:, 0] > since)]
    return [_event(row.tobytes(), logger, run) for row in whole[np.argsort(whole[:, 0])]]


def _event(slot: bytes, logger: str, run: str) -> LoggedEvent:
    number, tick, time_ns, text, _ = SLOT.unpack(slot)
    shown = text.rstrip(b"\0").decode("utf-8", "ignore")  # one that was cut may end within a letter
    return LoggedEvent(MARKER, shown, time_ns, tick, who=logger, run=run, number=number)

"""Why a logger stopped, and why rows were lost: numbers in the segment, and their words, each once."""

import enum
from collections.abc import Iterable

LAST_TICK_S = 1.0  # longer than a tick takes: of a run that was cut, and has ended so long, none is under way


class StopReason(enum.IntEnum):
    """Why collection ended."""

    NONE = 0
    ASKED = 1
    TIME_FULL = 2
    MEMORY_LIMIT = 3
    NO_ROOM = 4
    CUT = 5
    ERROR = 6


STOP_TEXTS = {
    StopReason.NONE: "",
    StopReason.ASKED: "stopped on request",
    StopReason.TIME_FULL: "stopped by itself: the time buffer is full (max_time, or every fixed buffer, is reached)",
    StopReason.MEMORY_LIMIT: "stopped by itself: memory_limit_mb is reached; save the log, then raise the limit",
    StopReason.NO_ROOM: (
        "stopped by itself: the folder of the buffers is full; save the log, then free or enlarge it, "
        "or take smaller buffers"
    ),
    StopReason.CUT: "cut: it was changed, and goes on in its next stretch",
    StopReason.ERROR: "stopped by an error, or Ctrl-C, that ended the program's `with`",
}


class LostWhy(enum.IntEnum):
    """Why a growing ring keeps no more rows. Layout 1 didn't say: UNKNOWN."""

    UNKNOWN = 0
    MEMORY_LIMIT = 1
    NO_ROOM = 2


LOST_TEXTS = {
    LostWhy.UNKNOWN: "the buffer could not grow",
    LostWhy.MEMORY_LIMIT: "the memory limit was reached (memory_limit_mb)",
    LostWhy.NO_ROOM: "the folder of the buffers was full",
}
LOST_ADVICE = "save and restart, or take smaller buffers"


def lost_text(count: int, whys: Iterable[LostWhy]) -> str:
    """Say how many samples could not be kept, and why."""
    return f"{count} samples could not be kept: {' and '.join(LOST_TEXTS[why] for why in whys)}"

"""Following the present run: one way to notice another one, to let go, and to go on after what can't be read."""

import time
from collections.abc import Callable
from typing import TypeAlias

from silo.segment.reader import SegmentReader
from silo.segment.reasons import LAST_TICK_S
from silo.state.replica import Replica

# Returns a reader of the run behind that of an id: the present one, as it is given, or one between the two.
Between: TypeAlias = Callable[[str, SegmentReader], SegmentReader]
RELEASE_PERIOD_S = 2.0  # a segment of 16 MB that is followed made the process 14 MB larger within 10 s


def is_next(before: SegmentReader, following: SegmentReader) -> bool:
    """Whether a run began right behind another one: of many short ones those between may not be known yet."""
    return following.schema.number <= before.schema.number + 1


def is_over(before: SegmentReader, following: SegmentReader, waited_s: float) -> bool:
    """Whether a run has all its rows, as far as the one that began behind it tells: of a cut a tick may be under way.

    waited_s: since that one is known. Raises SegmentError.
    """
    if not is_next(before, following) and waited_s <= LAST_TICK_S:
        return False
    return bool(not before.running or following.ticks or not following.running or waited_s > LAST_TICK_S)


class RunFollower:
    """The present run, as one that follows it reads it: by a reader of its own, for one thread at a time.

    The reader of a run that is over stays until the next look: its rows are mapped, and may be read to their end. It is
    never closed here, as others may read on; it goes with the last of them.
    """

    def __init__(self, replica: Replica, *, derived: bool = False) -> None:
        """`derived`: with the derived signals, and gone over when others are derived, too."""
        self._replica, self._derived = replica, derived
        self.reader: SegmentReader | None = None
        self._known: object = None
        self._release_s = 0.0

    @property
    def run(self) -> str:
        """The id of the run that is followed; empty for none."""
        return self.reader.schema.run if self.reader is not None else ""

    def look(self) -> bool:
        """Go over to the present run, None where there is none; whether that is another reader than before.

        A run that can't be opened is tried again at the next look: it was replaced meanwhile, and the next one is
        handed over soon. Raises SegmentError for one that is damaged.
        """
        derived = self._replica.now.robot.conditions.derived if self._derived else ()
        if self.reader is not None and self._known == (self._replica.run, derived):
            self._release(self.reader)
            return False
        before, self.reader = self.reader, None
        self.reader = self._replica.open_watcher() if self._derived else self._replica.open_reader()
        self._known = (self.run, derived)  # of what was opened: the replica may know another one by now
        return self.reader is not before

    def forget(self) -> None:
        """Let go of the run, as of one that can't be read; the next look opens it anew."""
        self.reader = None

    def _release(self, reader: SegmentReader) -> None:
        """Let go of pages that were read: a follower would count the whole segment as its own memory by and by."""
        now_s = time.monotonic()
        if now_s >= self._release_s:
            self._release_s = now_s + RELEASE_PERIOD_S
            reader.release_pages()

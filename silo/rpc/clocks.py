"""Until when somebody waits, by the clock of who is asked: a request that arrives late is known to be late.

Computers show different times, a link may hold back a request, and a helper process may be frozen with requests before
it; so a client learns the helper's clock from its hello, and says by that clock when it gives up.
"""

import math
import time

FRESH_S = 300.0  # two clocks that nobody disciplines drift apart by 30 ms in that time


def clock_s() -> float:
    """Return seconds since this computer was started, also those in which it slept."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


class TheirClock:
    """What a client knows of the clock of a helper process."""

    def __init__(self) -> None:
        self._ahead_s = 0.0
        self._told = False
        self._asked_s = -math.inf

    def learn(self, told_s: float) -> None:
        """Take in what it showed just before its answer came; 0 is that of an older silo, which doesn't tell."""
        now_s = clock_s()
        # its answer was on its way for a while: so it is ahead by this or more, and who counts on it gives up too early
        self._ahead_s, self._asked_s, self._told = told_s - now_s, now_s, bool(told_s)

    @property
    def is_fresh(self) -> bool:
        """Whether it was asked for not long ago."""
        return clock_s() - self._asked_s < FRESH_S

    def after(self, timeout_s: float) -> float:
        """Return what it shows when so long has passed from now on; 0 where that isn't known."""
        return clock_s() + timeout_s + self._ahead_s if self._told else 0.0


UNKNOWN = TheirClock()

"""An excitation on its way, in the thread of the loop: where the value is at each tick, and when it has to end.

It ends by itself, or because somebody says so, nobody renews it, its parameter is closed, or the run is over: then it
goes back in a straight line, at once, to what the value was. Only where somebody else set it, nothing is brought back.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from silo.core.tuning.excitation import LEASE_S
from silo.core.tuning.parameters import Excitation, ParameterInfo, ParameterKind
from silo.parameters.courses import Course, course_of

FADE_S = 0.25  # at most, to go back before its time
OVER = "it is over"
GONE = "whoever asked for it is gone"


@dataclass(eq=False)
class Excited:
    """What moves a value around `before`, between `low` and `high`."""

    what: Excitation
    info: ParameterInfo
    place: "memoryview[float]"  # where the value stands in memory
    before: float
    low: float
    high: float
    monotonic: Callable[[], float] = time.monotonic
    ended: str = ""  # why it has ended
    until: int = -1  # the first row without it
    at_s: float = 0.0
    course: Course = field(init=False)
    kept_s: float = field(init=False)  # when whoever asked said for the last time that it is there
    went_s: float = field(init=False)  # when it moved for the last time
    _stop: str = ""
    _dropped: bool = False
    _fading_s: float = -1.0
    _left: float = 0.0
    _exact: float = 0.0

    def __post_init__(self) -> None:
        self.course, self._exact = course_of(self.what), self.before
        self.kept_s = self.went_s = self.monotonic()

    # ------------------------------------------------------------------------------------------------ of any thread

    def keep(self) -> None:
        """Whoever asked for it is there."""
        self.kept_s = self.monotonic()

    def end_soon(self, why: str) -> None:
        """Go back from now on."""
        self._stop = self._stop or why

    def let_go(self, why: str) -> None:
        """It is over; the value stays what it is."""
        self.ended = self.ended or why

    def drop(self, why: str) -> None:
        """Go back at once, where the loop doesn't: it stands still, so no law sees that."""
        self._dropped = True
        self.let_go(why)
        self.place[0] = self._native(self.before)

    def why_ended(self) -> str:
        """Why it is to end, or has ended; empty while it goes on."""
        gone = GONE if self.monotonic() > self.kept_s + LEASE_S else ""
        return self.ended or self._stop or gone

    # ------------------------------------------------------------------------------------------------ of the loop's

    def go(self, at_s: float) -> bool:
        """Go to where the value is so many seconds after its begin. Returns whether it is over."""
        if self.ended:
            if self._dropped:  # once more: the loop may have woken while that was done
                self.place[0] = self._native(self.before)
            return True
        since_s, self.at_s = self.at_s, max(self.at_s, at_s)
        self.went_s = self.monotonic()
        if self._fading_s < 0 and (self._stop or self.went_s > self.kept_s + LEASE_S):
            self._stop, self._fading_s, self._left = self._stop or GONE, since_s, self._exact - self.before
        if self._fading_s < 0:
            over = self.at_s >= self.what.duration_s
            goal = self.before + self.course(self.at_s)
        else:
            fade_s = min(FADE_S, self.what.ramp_s)
            left = max(0.0, 1.0 - (self.at_s - self._fading_s) / fade_s) if fade_s else 0.0
            over, goal = not left, self.before + self._left * left
        if self.info.rate:
            most = self.info.rate * (self.at_s - since_s)
            over = over and abs(self.before - self._exact) <= most
            goal = min(max(goal, self._exact - most), self._exact + most)
        self._exact = self.before if over else min(max(goal, self.low), self.high)
        self.place[0] = self._native(self.before if over else self._fitting(self._exact))
        self.ended = (self._stop or OVER) if over else ""
        return bool(over)

    def _native(self, value: float) -> float:
        return round(value) if self.info.kind is ParameterKind.INT else value

    def _fitting(self, value: float) -> float:
        """The nearest value that the parameter may have, not farther away than the amplitude."""
        grid = self.info.step or (1.0 if self.info.kind is ParameterKind.INT else 0.0)
        if not grid:
            return value
        most = math.floor(abs(self.what.amplitude) / grid + 1e-9)
        value = self.before + min(max(round((value - self.before) / grid), -most), most) * grid
        return min(max(value, self.low), self.high)

"""An excitation on its way, in the thread of the loop: where the value is at each tick, and when it has to end.

It ends by itself, or because somebody says so, nobody renews it, its parameter is closed, or the run is over: then it
goes back in a straight line, at once, to what the value was. Only where somebody else set it, nothing is brought back.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from silo.core.tuning.excitation import LEASE_S, OVER, period_s
from silo.core.tuning.parameters import Excitation, ParameterInfo, ParameterKind, Wave

Course = Callable[[float], float]

MOST_LINES = 40  # sines of a multisine
POINTS = 1 << 13  # of its period, at which its peak is looked for
# with these two stages a shift register of so many goes through all of its states
TAPS = {5: 3, 6: 5, 7: 6, 9: 5, 10: 7, 11: 9, 15: 14, 17: 14}

FADE_S = 0.25  # at most, to go back before its time
GONE = "whoever asked for it is gone"


def course_of(what: Excitation) -> Course:
    """Return by how much the value is off at each second of the excitation; asked for moments that only rise."""
    waves = {Wave.CHIRP: _chirp, Wave.MULTISINE: _multisine, Wave.PRBS: _prbs, Wave.STEP: _step}
    wave = waves[what.wave](what)
    amplitude, duration_s, ramp_s = what.amplitude, what.duration_s, what.ramp_s

    def course(at_s: float) -> float:
        if not 0.0 <= at_s < duration_s:
            return 0.0
        edge_s = min(at_s, duration_s - at_s)
        return amplitude * wave(at_s) * (edge_s / ramp_s if edge_s < ramp_s else 1.0)

    return course


def _step(_: Excitation) -> Course:
    return lambda _: 1.0


def _chirp(what: Excitation) -> Course:
    sin, expm1 = math.sin, math.expm1
    pace = math.log(what.high_hz / what.low_hz) / what.duration_s
    if not pace:
        return lambda at_s: sin(2 * math.pi * what.low_hz * at_s)
    turns = 2 * math.pi * what.low_hz / pace
    return lambda at_s: sin(turns * expm1(pace * at_s))


def _multisine(what: Excitation) -> Course:
    """Harmonics that lie evenly in octaves, with phases after Schroeder: a flat crest; never beyond 1."""
    base_hz = 1 / period_s(what)
    spread = what.low_hz / base_hz * (what.high_hz / what.low_hz) ** (np.arange(MOST_LINES) / (MOST_LINES - 1))
    harmonics = np.unique(np.minimum(np.rint(spread), math.floor(what.high_hz / base_hz + 1e-9)))
    places = np.arange(len(harmonics))
    turns, phases = 2 * np.pi * base_hz * harmonics, -np.pi * places * (places + 1) / len(harmonics)
    times = np.arange(POINTS) / (POINTS * base_hz)
    peak = float(np.abs(sum(np.sin(turn * times + phase) for turn, phase in zip(turns, phases, strict=True))).max())
    sin, lines = math.sin, list(zip(turns.tolist(), phases.tolist(), strict=True))

    def wave(at_s: float) -> float:
        found = sum([sin(turn * at_s + phase) for turn, phase in lines]) / peak
        return min(1.0, max(-1.0, found))  # between two points it may be a little more

    return wave


def _prbs(what: Excitation) -> Course:
    """The bits of a shift register that doesn't repeat within it, drawn when they are due."""
    count, rate_hz = what.high_hz * what.duration_s + 1, what.high_hz
    stages = next((one for one in TAPS if (1 << one) > count), max(TAPS))
    back, state, drawn = stages - TAPS[stages], (1 << stages) // 3, 0

    def wave(at_s: float) -> float:
        nonlocal state, drawn
        for _ in range(int(at_s * rate_hz + 1e-6) - drawn):
            state = state >> 1 | ((state ^ state >> back) & 1) << (stages - 1)
            drawn += 1
        return 1.0 if state & 1 else -1.0

    return wave


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

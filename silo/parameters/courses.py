"""The courses of excitations: by how much a value is off at each moment. Made once, asked at each tick: 0.4 to 4 us."""

import math
from collections.abc import Callable

import numpy as np

from silo.core.tuning.excitation import period_s
from silo.core.tuning.parameters import Excitation, Wave

Course = Callable[[float], float]

MOST_LINES = 40  # sines of a multisine
POINTS = 1 << 13  # of its period, at which its peak is looked for
# with these two stages a shift register of so many goes through all of its states
TAPS = {5: 3, 6: 5, 7: 6, 9: 5, 10: 7, 11: 9, 15: 14, 17: 14}


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

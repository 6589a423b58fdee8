"""How one signal answers to another: the transfer function between them, and the answer to a step.

Pure functions. The transfer function is Welch's H1: cross spectrum by power of the input, over Hann windows that
overlap by three quarters. So noise of the output falls out; noise of the input makes the gain too small. The last
windows reach over both ends, where a chirp has its lowest and highest frequencies. Measured on systems whose function
is known, a chirp of 20 s at 1 kHz: 0.25 dB and 1.3 degrees at most (a resonance of 14 dB), 0.03 dB without one.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute.spectra import HOLE, UNEVEN
from silo.core.arrays.values import Floats
from silo.errors import ElementError

FEWEST_SAMPLES = 64
SEGMENTS = 3  # windows beside each other in the excited span: fewer resolve a resonance, more average noise
OVERLAP = 4  # of a window, by which part the next one is later
FIRST_LINE = 2  # below, a window has not two periods
EXCITED = 0.3  # of the power around it, within a tenth of its frequency: between, a line is what a window leaked
BAND, LINES = 0.1, 4
NOTHING = 1e-12  # of the highest: rounding errors
SETTLED = 0.02  # of a step
AS_LARGE = 0.9  # as the largest one: the first of such is meant, not the way back
LEFT = 0.1  # of a step, by which the input leaves where it came to
AVERAGED = 0.1  # of the time before and after a step, whose mean is what it goes from and to


class Bode(NamedTuple):
    """A transfer function, each of shape `(f,)`.

    `frequency_hz`, `magnitude_db`, `phase_deg` without jumps, and `coherence`: the share that the input explains.
    """

    frequency_hz: Floats
    magnitude_db: Floats
    phase_deg: Floats
    coherence: Floats


class StepResponse(NamedTuple):
    """The answer to a step: `times` since it and `values` of the output, then what they come to.

    The `step` is at `at_s` seconds of the run. It goes from `start` to `final`, `gain` is that by the step of the
    input.
    `rise_s` is from 10 to 90 %, `overshoot` the share beyond `final`, `settled_s` when it stays within 2 %; NaN where
    there is none.
    """

    times: Floats
    values: Floats
    at_s: float
    step: float
    start: float
    final: float
    gain: float
    rise_s: float
    overshoot: float
    settled_s: float


def evenly(times: Floats, values: Floats) -> tuple[float, Floats]:
    """Return the period, and the values of shape `(n, signals)` at an even distance; NaN are bridged.

    Raises ElementError for too few, and for a hole.
    """
    good = np.isfinite(values).all(axis=1)
    times, values = times[good], values[good]
    if len(times) < FEWEST_SAMPLES:
        raise ElementError(f"{len(times)} samples of both are too few, at least {FEWEST_SAMPLES} are needed")
    steps = np.diff(times)
    usual = float(np.median(steps))
    if steps.min() < 0 or steps.max() > HOLE * max(usual, 1e-12):
        at = times[int(np.argmax(np.abs(steps - usual)))]
        raise ElementError(f"there is a hole, or a step back, at {at:.6g} s: take a stretch before it or after it")
    period = float(times[-1] - times[0]) / (len(times) - 1)
    even = times[0] + np.arange(len(times)) * period
    if np.abs(times - even).max() <= UNEVEN * period:
        return period, values
    return period, np.stack([np.interp(even, times, column) for column in values.T], axis=1)


def bode_of(period: float, given: Floats, answer: Floats, segment_s: float, low_hz: float, high_hz: float) -> Bode:
    """Return the transfer function where the input has power, from `low_hz` to `high_hz`."""
    count = min(len(given), max(FEWEST_SAMPLES // 2, round(segment_s / period)))
    window = np.hanning(count + 1)[:-1]
    power, cross, answered = np.zeros(count // 2 + 1), np.zeros(count // 2 + 1, complex), np.zeros(count // 2 + 1)
    for begin in range(0, len(given) - count + 1, max(1, count // OVERLAP)):
        part = slice(begin, begin + count)
        u, y = (np.fft.rfft((one[part] - one.mean()) * window) for one in (given, answer))
        power += np.abs(u) ** 2
        answered += np.abs(y) ** 2
        cross += np.conj(u) * y
    hz = np.fft.rfftfreq(count, period)
    wanted = (hz >= max(low_hz, FIRST_LINE / (count * period))) & (hz <= high_hz) & _excited(power)
    if not wanted.any():
        raise ElementError(f"the input has no power from {low_hz:g} to {high_hz:g} Hz")
    function = cross[wanted] / power[wanted]
    whole = power[wanted] * answered[wanted]
    coherence = np.divide(np.abs(cross[wanted]) ** 2, whole, out=np.zeros(len(whole)), where=whole > 0)
    with np.errstate(divide="ignore"):
        magnitude: Floats = 20 * np.log10(np.abs(function))
    phase: Floats = np.degrees(np.unwrap(np.angle(function)))
    return Bode(np.asarray(hz[wanted], np.float64), magnitude, phase, coherence)


def _excited(power: Floats) -> NDArray[np.bool_]:
    """Which lines have power compared with those around them."""
    far = [max(LINES, int(at * BAND)) for at in range(len(power))]
    highest = np.array([power[max(1, at - width) : at + width + 1].max() for at, width in enumerate(far)])
    found: NDArray[np.bool_] = (power >= EXCITED * highest) & (power > NOTHING * power.max())
    return found


def step_of(times: Floats, given: Floats, answer: Floats) -> StepResponse:
    """Return the answer to the largest step of the input, until the input leaves where it came to."""
    good = np.isfinite(given) & np.isfinite(answer)
    times, given, answer = times[good], given[good], answer[good]
    if len(times) < 4 or not np.ptp(given):
        raise ElementError("the input has no step")
    rises = np.diff(given)
    first = last = int(np.flatnonzero(np.abs(rises) >= AS_LARGE * np.abs(rises).max())[0])
    while first and rises[first - 1] * rises[first] > 0:  # a ramp
        first -= 1
    while last + 1 < len(rises) and rises[last + 1] * rises[last] > 0:
        last += 1
    at, there = first + 1, last + 1
    step = float(given[there] - given[first])
    left = np.flatnonzero(np.abs(given[there:] - given[there]) > LEFT * abs(step))
    end = there + int(left[0]) if len(left) else len(given)
    after = slice(at, end)
    start = float(answer[max(0, at - max(1, round(AVERAGED * (end - at)))) : at].mean())
    final = float(answer[end - max(1, round(AVERAGED * (end - at))) : end].mean())
    change = final - start
    shown = answer[after]
    since = times[after] - times[at]
    share = (shown - start) / change if change else np.full(len(shown), np.nan)
    late = np.flatnonzero(~(np.abs(share - 1) <= SETTLED))
    return StepResponse(
        since,
        shown,
        float(times[at]),
        step,
        start,
        final,
        change / step,
        _crossing(since, share, 0.9) - _crossing(since, share, 0.1),
        max(0.0, float(share.max()) - 1) if change else np.nan,
        float(since[late[-1] + 1]) if len(late) and late[-1] + 1 < len(since) else 0.0 if not len(late) else np.nan,
    )


def _crossing(times: Floats, share: Floats, level: float) -> float:
    """When a course first comes to a level, between two samples."""
    beyond = np.flatnonzero(share >= level)
    if not len(beyond):
        return float("nan")
    at = int(beyond[0])
    if not at:
        return float(times[0])
    part = (level - share[at - 1]) / (share[at] - share[at - 1])
    return float(times[at - 1] + part * (times[at] - times[at - 1]))

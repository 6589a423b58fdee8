"""The spectrum of a signal, its peaks, how two signals go together, and how often which value comes. Pure functions."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.values import Floats, as_floats

LEAST_SAMPLES = 64
MOST_SAMPLES = 1 << 17
MOST_PEAKS = 8
HOLE = 10.0  # periods without a sample: more than a late loop
UNEVEN = 0.02  # of a period
_LOBE = 2  # lines on each side that the main lobe of a Hann window covers
_NOISE = 4.0  # times the median that a peak must reach
_FAINT = 1e-3  # of the highest: below, what a window leaks looks like peaks


@dataclass(frozen=True)
class Piece:
    """The longest stretch without a hole: values of shape `(n,)`, one per period, and what it was taken from."""

    values: Floats
    period_s: float
    jitter_s: float
    held: int

    @property
    def seconds(self) -> float:
        """How long it is."""
        return len(self.values) * self.period_s


def longest_piece(time_ns: NDArray[np.int64], values: NDArray[Any]) -> Piece:
    """Return the longest stretch of finite samples without a hole; the newest of equal ones.

    A loop that is late makes no hole: its samples are brought to an even distance by straight lines, and the jitter is
    told.
    """
    floats = as_floats(values)
    if len(floats) < 2:
        return Piece(floats, 1.0, 0.0, len(floats))
    steps = np.diff(time_ns)
    period = float(np.median(steps)) or 1.0
    ends = np.flatnonzero((steps > HOLE * period) | (steps <= 0)) + 1
    finite = np.isfinite(floats)
    begins = np.unique(np.concatenate([[0], ends, np.flatnonzero(np.diff(finite.astype(np.int8))) + 1]))
    lengths = np.diff(np.append(begins, len(floats))) * finite[begins]
    at = len(lengths) - 1 - int(np.argmax(lengths[::-1]))
    piece = slice(int(begins[at]), int(begins[at]) + int(lengths[at]))
    own = steps[piece][: max(0, int(lengths[at]) - 1)]
    jitter = float(np.std(own)) / 1e9 if len(own) else 0.0
    found, times = floats[piece][-MOST_SAMPLES:], time_ns[piece][-MOST_SAMPLES:]
    mean = float(np.mean(np.diff(times))) if len(times) > 1 else period
    if len(times) > 1 and jitter * 1e9 > UNEVEN * mean:
        found = np.interp(np.arange(len(times)) * mean, (times - times[0]).astype(np.float64), found)
    return Piece(found, mean / 1e9, jitter, len(floats))


@dataclass(frozen=True)
class Spectrum:
    """Single-sided amplitudes by a Hann window, without the mean: line k is at `(k + 1) * step_hz`."""

    amplitudes: Floats
    step_hz: float


def spectrum_of(piece: Piece) -> Spectrum:
    """Return the spectrum of a piece. Raises ValueError with what is missing where it is too short."""
    count = len(piece.values)
    if count < LEAST_SAMPLES:
        raise ValueError(f"{count} held, {LEAST_SAMPLES} needed")
    size = float(np.abs(piece.values).max()) or 1.0
    shares = piece.values / size  # neither 1e300 nor 1e-300 squared is a float
    hann = np.hanning(count + 1)[:-1]
    # the mean under the window: that of the samples leaves a rest in the first line
    shares = shares - (shares * hann).sum() / hann.sum()
    amplitudes = 2 * np.abs(np.fft.rfft(shares * hann)) / hann.sum()
    if count % 2 == 0:
        amplitudes[-1] /= 2  # half the sampling rate has no mirror
    return Spectrum(amplitudes[1:] * size, 1 / (count * piece.period_s))


@dataclass(frozen=True)
class Peak:
    """A line that stands out: where, how high, both between the lines."""

    frequency_hz: float
    amplitude: float


def peaks_of(spectrum: Spectrum, most: int = MOST_PEAKS) -> list[Peak]:
    """Return the highest peaks, at most so many, by frequency; they rise over the noise and lie apart."""
    heights = spectrum.amplitudes
    if len(heights) < 2 * _LOBE + 1:
        return []
    floor = max(_NOISE * float(np.median(heights)), _FAINT * float(heights.max()))
    found: list[int] = []
    for line in np.argsort(heights)[::-1].tolist():
        around = heights[max(0, line - _LOBE) : line + _LOBE + 1]
        if not heights[line] > floor:
            break
        if heights[line] == around.max() and all(abs(line - other) > _LOBE for other in found):
            found.append(line)
        if len(found) == most:
            break
    return [_between_lines(heights, line, spectrum.step_hz) for line in sorted(found)]


def _between_lines(heights: Floats, line: int, step_hz: float) -> Peak:
    """A parabola through the logarithms of three lines: a Hann window's lobe is one, nearly."""
    if not 0 < line < len(heights) - 1 or not heights[line - 1 : line + 2].min() > 0:
        return Peak((line + 1) * step_hz, float(heights[line]))
    before, here, after = np.log(heights[line - 1 : line + 2])
    bend = before - 2 * here + after
    shift = 0.5 * (before - after) / bend if bend else 0.0
    return Peak((line + 1 + float(shift)) * step_hz, float(np.exp(here - 0.25 * (before - after) * shift)))


@dataclass(frozen=True)
class Pair:
    """Two signals over one another: `x` and `y` of shape `(n,)`, oldest first, and how they go together."""

    x: Floats
    y: Floats
    correlation: float  # NaN where one of them is constant
    slope: float
    area: float  # that they run around, in the product of their units: work, where it is a force over a way


def pair_of(x_ns: NDArray[np.int64], x_values: NDArray[Any], y_ns: NDArray[np.int64], y_values: NDArray[Any]) -> Pair:
    """Return y over the x that held then; what is no finite number is left out."""
    at = np.searchsorted(x_ns, y_ns, "right") - 1
    x, y = as_floats(x_values), as_floats(y_values)
    x = np.where(at >= 0, x[at], np.nan) if len(x) else np.full(len(y), np.nan)
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if len(x) < 2:
        return Pair(x, y, math.nan, math.nan, math.nan)
    sizes = float(np.abs(x).max()) or 1.0, float(np.abs(y).max()) or 1.0
    dx, dy = x / sizes[0], y / sizes[1]
    dx, dy = dx - dx.mean(), dy - dy.mean()
    xx, yy, xy = float(dx @ dx), float(dy @ dy), float(dx @ dy)
    area = float(np.sum(dx * np.roll(dy, -1) - np.roll(dx, -1) * dy)) / 2
    tiny = 1e-24 * len(x)
    correlation = xy / math.sqrt(xx * yy) if xx > tiny and yy > tiny else math.nan
    slope = xy / xx * sizes[1] / sizes[0] if xx > tiny else math.nan
    return Pair(x, y, correlation, slope, abs(area) * sizes[0] * sizes[1])


@dataclass(frozen=True)
class Histogram:
    """How many values lie in each of equal steps from `first` on."""

    counts: NDArray[np.int64]
    first: float
    step: float


def histogram_of(values: Floats, most: int) -> Histogram:
    """Return a histogram of finite values of at most `most` steps: one per number where there are few whole ones."""
    low, high = float(values.min()), float(values.max())
    if high - low < most and (values == np.round(values)).all() and abs(high) < 2**52:
        counts = np.bincount((values - low).astype(np.int64), minlength=int(high - low) + 1)
        return Histogram(counts, low - 0.5, 1.0)
    count = int(min(most, max(8, 2 * math.ceil(len(values) ** (1 / 3)))))
    if not low < high or not math.isfinite((high - low) / count) or (high - low) / count == 0:
        half = abs(low) * 0.05 or 0.5
        return Histogram(np.array([len(values)]), low - half, 2 * half)
    step = (high - low) / count
    places = np.clip(((values - low) / step).astype(np.int64), 0, count - 1)
    return Histogram(np.bincount(places, minlength=count), low, step)

"""The spectrum of a signal and its peaks: `Signal.spectrum`, `silo plot --spectrum` and the large plot of silo-tui.

Pure functions. A spectrum is that of one stretch without a hole: a line drawn over a hole is a wave that nobody logged
(a sine of amplitude 1 with a hole of a second in four read 0.58).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.values import Floats, as_floats
from silo.core.quantities.writing import and_more

LEAST_SAMPLES = 64  # to show one
FEWEST_SAMPLES = 4  # to compute one
MOST_SAMPLES = 1 << 17
MOST_PEAKS = 8
HOLE = 10.0  # periods without a sample: more than a late loop
BURSTS = 3.0  # times the distance that 95 % of samples keep
STILL_NS = 1_000_000_000  # such a hole is one in which the loop stood still, or before which its clock was set forward
MISSING = 2.5  # periods: a sample is missing, or a loop was very late
UNEVEN = 0.02  # of a period
_LOBE = 2  # lines on each side that the main lobe of a Hann window covers
_DIP = 0.7  # of a peak's height, that a line between it and a higher one so near must fall below
_ROUNDING = 1e-13  # of the largest value: below, what floats leave of a constant looks like peaks
_STAYS = 0.7  # of that, for one that was a peak a moment ago
_NOISE = 4.0  # times the median that a peak must reach
_QUARTER = 1.55  # how far the median of noise lies above its lower quarter
_AROUND = 12  # lines on each side at least that tell of the noise
FEWEST_PERIODS = 1.7  # in a piece, of a wave
_FAINT = 1e-3  # of the highest: below, what a window leaks looks like peaks


@dataclass(frozen=True)
class GaplessStretch:
    """The longest stretch without a hole: values of shape `(n,)`, one per period, and what it was taken from."""

    values: Floats
    period_s: float
    jitter_s: float
    held: int

    @property
    def left_out(self) -> str:
        """How much of the signal it is, in words; "" for all of it."""
        count = len(self.values)
        return "" if count == self.held else f"longest whole piece: {count} of {self.held} samples"

    @property
    def seconds(self) -> float:
        """How long it is."""
        return len(self.values) * self.period_s


def longest_piece(time_ns: NDArray[np.int64], values: NDArray[Any], most: int | None = MOST_SAMPLES) -> GaplessStretch:
    """Return the longest stretch of finite samples without a hole; the newest of equal ones, and its newest samples.

    A loop that is late makes no hole: its samples are brought to an even distance by straight lines, and the jitter is
    told. Where samples are missing so often that less than half would be left, lines bridge some of them too; where
    they come in bursts, as of a loop that a busy computer holds up, so that too few would be left, what is usual
    between bursts.
    """
    floats = as_floats(values)
    if len(floats) < 2:
        return GaplessStretch(floats, 1.0, 0.0, len(floats))
    finite = np.isfinite(floats)
    period = float(np.median(np.diff(time_ns[finite]))) if finite.sum() > 1 else 1.0
    # where a value isn't finite there is a hole as well
    strict = _longest(time_ns, finite, MISSING * period)
    bridged = np.flatnonzero(finite)
    loose = _longest(time_ns[bridged], np.ones(len(bridged), bool), HOLE * period)
    if 2 * (strict.stop - strict.start) < loose.stop - loose.start:
        times, found = time_ns[bridged][loose], floats[bridged][loose]
    else:
        times, found = time_ns[strict], floats[strict]
    if loose.stop - loose.start < LEAST_SAMPLES <= len(bridged):
        usual = BURSTS * float(np.percentile(np.diff(time_ns[bridged]), 95))
        bursts = _longest(time_ns[bridged], np.ones(len(bridged), bool), usual)
        times, found = time_ns[bridged][bursts], floats[bridged][bursts]
    if most is not None:
        times, found = times[-most:], found[-most:]
    own = np.diff(times)
    jitter = float(np.std(own)) / 1e9 if len(own) else 0.0
    mean = float(np.mean(own)) if len(own) else period or 1.0
    if jitter * 1e9 > UNEVEN * mean:
        found = np.interp(np.arange(len(times)) * mean, (times - times[0]).astype(np.float64), found)
    return GaplessStretch(found, mean / 1e9, jitter, len(floats))


def stills(stamps: NDArray[np.int64]) -> NDArray[np.intp]:
    """Behind which of the stamps, which rise, none comes for ten periods, and for a second."""
    steps = np.diff(stamps)
    return np.flatnonzero(steps > max(HOLE * float(np.median(steps)), STILL_NS)) if len(steps) else np.zeros(0, np.intp)


def told_stills(stamps: NDArray[np.int64], places: NDArray[np.intp], start_ns: int, most: int = 5) -> str:
    """These in words, in seconds since a start."""
    times = (stamps - start_ns) * 1e-9
    spans = [f"from {times[one]:.3g} s to {times[one + 1]:.3g} s" for one in places.tolist()]
    return f"hold what was before, as no sample came {and_more(spans, most)}"


def _longest(time_ns: NDArray[np.int64], finite: NDArray[np.bool_], hole_ns: float) -> slice:
    """The longest stretch of finite samples that rise by no more than `hole_ns` each; the newest of equal ones."""
    if not len(time_ns):
        return slice(0, 0)
    steps = np.diff(time_ns)
    ends = np.flatnonzero((steps > hole_ns) | (steps <= 0)) + 1
    begins = np.unique(np.concatenate([[0], ends, np.flatnonzero(np.diff(finite.astype(np.int8))) + 1]))
    lengths = np.diff(np.append(begins, len(time_ns))) * finite[begins]
    at = len(lengths) - 1 - int(np.argmax(lengths[::-1]))
    return slice(int(begins[at]), int(begins[at]) + int(lengths[at]))


@dataclass(frozen=True)
class Spectrum:
    """Single-sided amplitudes by a Hann window, without the mean: line k is at `(k + 1) * step_hz`."""

    amplitudes: Floats
    step_hz: float
    largest: float = 0.0  # of what it is of, the mean not taken out

    @property
    def top_hz(self) -> float:
        """The frequency of its last line."""
        return len(self.amplitudes) * self.step_hz


def spectrum_of(piece: GaplessStretch, least: int = LEAST_SAMPLES) -> Spectrum:
    """Return the spectrum of a piece. Raises ValueError with what is missing where it is too short."""
    count = len(piece.values)
    if count < least:
        raise ValueError(f"{piece.left_out or f'{count} held'}, {least} needed")
    size = float(np.abs(piece.values).max()) or 1.0
    shares = piece.values / size  # neither 1e300 nor 1e-300 squared is a float
    hann = np.hanning(count + 1)[:-1]
    # the mean under the window: that of the samples leaves a rest in the first line
    shares = shares - (shares * hann).sum() / hann.sum()
    amplitudes = 2 * np.abs(np.fft.rfft(shares * hann)) / hann.sum()
    if count % 2 == 0:
        amplitudes[-1] /= 2  # half the sampling rate has no mirror
    return Spectrum(amplitudes[1:] * size, 1 / (count * piece.period_s), size)


def lines_of(piece: GaplessStretch) -> tuple[Floats, Floats]:
    """Return the frequencies in Hz from 0 on, and the amplitude of the sine at each; none of fewer than 4 samples."""
    if len(piece.values) < FEWEST_SAMPLES:
        return np.zeros(0), np.zeros(0)
    found = spectrum_of(piece, FEWEST_SAMPLES)
    # the mean is taken out
    amplitudes: Floats = np.concatenate([[0.0], found.amplitudes])
    return np.arange(len(amplitudes), dtype=np.float64) * found.step_hz, amplitudes


@dataclass(frozen=True)
class Peak:
    """A line that stands out: where, how high, both between the lines."""

    frequency_hz: float
    amplitude: float


def peaks_of(spectrum: Spectrum, most: int = MOST_PEAKS, known: Sequence[Peak] = ()) -> list[Peak]:
    """Return the highest peaks, at most so many, the highest first; they rise over the noise around them and lie apart.

    What hardly goes round twice is none: a drift, or a step, looks the same there. Of a spectrum that goes on in time
    peaks that were `known` a moment ago stay while they are about as high, and the first of them stays the first.
    """
    heights = spectrum.amplitudes
    if len(heights) < 2 * _LOBE + 1:
        return []
    floor = max(_NOISE * float(np.median(heights)), _FAINT * float(heights.max()), _ROUNDING * spectrum.largest)
    noise = _noise_of(heights)
    was = [round(peak.frequency_hz / spectrum.step_hz) - 1 for peak in known]
    least = np.ones(len(heights))  # of what a peak must reach
    for line in was:
        least[max(0, line - 1) : line + 2] = _STAYS
    found: list[int] = []
    for line in np.argsort(heights)[::-1].tolist():
        if not heights[line] > floor * _STAYS:
            break
        if not heights[line] > floor * least[line]:
            continue
        is_top = heights[line] == heights[max(0, line - 1) : line + 2].max()
        if (
            is_top
            and heights[line] > noise[line] * least[line]
            and all(_is_apart(heights, line, other) for other in found)
        ):
            found.append(line)
        if len(found) == most:
            break
    peaks = [_between_lines(heights, line, spectrum.step_hz) for line in found]
    peaks = [peak for peak in peaks if peak.frequency_hz > FEWEST_PERIODS * spectrum.step_hz]
    first_hz = known[0].frequency_hz if known else -math.inf

    def height(peak: Peak) -> float:
        return peak.amplitude / (_STAYS if abs(peak.frequency_hz - first_hz) < 1.5 * spectrum.step_hz else 1.0)

    return sorted(peaks, key=height, reverse=True)


def _noise_of(heights: Floats) -> Floats:
    """Return what a peak must reach at each line: noise is seldom as high at all lines of about its frequency.

    Of these the lower quarter is looked at: harmonics are many of them.
    """
    lines = np.unique(np.geomspace(1, len(heights), 8 * len(heights).bit_length()).astype(np.intp)) - 1
    reach = np.maximum(_AROUND, (lines + 1) // 2)
    ends = zip(np.maximum(0, lines - reach), lines + reach + 1, strict=True)
    lower = [float(np.quantile(heights[begin:end], 0.25)) for begin, end in ends]
    return np.interp(np.arange(len(heights)), lines, lower) * _NOISE * _QUARTER


def _is_apart(heights: Floats, line: int, higher: int) -> bool:
    """Whether a line is beyond the lobe of a higher one, or there is a dip between them."""
    between = heights[min(line, higher) + 1 : max(line, higher)]
    return abs(line - higher) > _LOBE or bool((between < _DIP * heights[line]).any())


def _between_lines(heights: Floats, line: int, step_hz: float) -> Peak:
    """Where a sine lies between two lines, and how high it is, by what a Hann window makes of one: 15 % less half-way.

    A parabola through the logarithms of three lines read up to 4 % too much.
    """
    here = float(heights[line])
    sides = [float(heights[line + step]) if 0 <= line + step < len(heights) else 0.0 for step in (-1, 1)]
    ratio = max(sides) / here
    shift = min(max((2 * ratio - 1) / (1 + ratio), 0.0), 0.5)
    amplitude = here * (1 - shift**2) / float(np.sinc(shift))
    return Peak((line + 1 + (shift if sides[1] > sides[0] else -shift)) * step_hz, amplitude)

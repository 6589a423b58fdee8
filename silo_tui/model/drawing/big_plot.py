"""One plot that fills the screen: over time, a spectrum, one signal over another, a histogram; as cells and words."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute.samples import Samples
from silo.analysis.compute.spectra import Peak, Spectrum, peaks_of
from silo.core.arrays.columns import bins_at, reduce
from silo.core.arrays.values import Floats, as_floats
from silo_tui.model.drawing import axes, braille, dots
from silo_tui.model.drawing.dots import BLANK
from silo_tui.model.drawing.plots import NOBODY, Owners, over_one_another
from silo_tui.model.words import text


@dataclass(frozen=True)
class Pair:
    """Two signals over one another: `x` and `y` of shape `(n,)`, oldest first, and how they go together."""

    x: Floats
    y: Floats
    correlation: float  # NaN where one of them is constant
    slope: float
    area: float  # that they run around, in the product of their units: work, where it is a force over a way


def pair_of(x_ns: NDArray[np.int64], x_values: NDArray[Any], y_ns: NDArray[np.int64], y_values: NDArray[Any]) -> Pair:
    """Return y over the x that held then, at the time that both have; what is no finite number is left out."""
    x, y = as_floats(x_values), as_floats(y_values)
    if len(x):
        source = Samples("x", x, x_ns)
        x = np.where(source._holding(y_ns), x[source._places(y_ns)], np.nan)
    else:
        x = np.full(len(y), np.nan)
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


TRAIL = "·∙•●"  # by age, the newest last
DECADES = 6  # that are shown, and 20 dB each


@dataclass(frozen=True)
class BigPlot:
    """Cells of a plot, whose colour each has (in an x-y plot: how old it is), its axes, and what is said of it."""

    lines: list[str]
    owners: Owners
    left: dict[int, str]
    below: list[tuple[float, str]]  # words under the plot, each at its share of the way from left to right
    notes: tuple[str, ...] = ()
    spots: tuple[tuple[int, int, str], ...] = ()  # line, cell and sign of what is marked in it
    aged: bool = False


def levels(amplitudes: Floats, way: str) -> Floats:
    """Return amplitudes as they are drawn: `linear`, `log` (powers of ten) or `dB` (of one unit)."""
    if way == "linear":
        return amplitudes
    top = float(amplitudes.max(initial=0.0))
    floor = top * 10.0**-DECADES
    with np.errstate(divide="ignore"):
        logs = np.log10(np.maximum(amplitudes, floor)) if top else np.zeros(len(amplitudes))
    return logs if way == "log" else 20 * logs


def level_words(amplitude: float, way: str, unit: str) -> str:
    """Return an amplitude as it is read beside a peak."""
    if way == "dB":
        return f"{20 * math.log10(amplitude):.1f} dB" if amplitude > 0 else "-inf dB"
    return f"{text.compact(amplitude)}{'' if unit == '-' else ' ' + unit}"


def of_spectra(
    spectra: Sequence[Spectrum],
    peaks: Sequence[Peak],
    way: str,
    size: tuple[int, int],
    chosen: int | None,
    top_hz: float = 0.0,
) -> BigPlot:
    """Return amplitudes over frequency, up to `top_hz` (0: all); the peaks of the first signal have numbers, the chosen
    one brackets.

    A number that has no room beside one before it is left out, and with it those of its cell, which would be read as
    its own: the chosen one comes first, then the highest.
    """
    width, height = size
    top_hz = top_hz or max(each.top_hz for each in spectra)
    curves = [_curve(each, way, top_hz, 2 * width) for each in spectra]
    low = min(float(np.nanmin(curve[0])) for curve in curves)
    high = max(float(np.nanmax(curve[1])) for curve in curves)
    if way == "log":
        scale = float(math.floor(low + 1e-9)), float(max(math.ceil(high - 1e-9), math.floor(low + 1e-9) + 1))
    else:
        scale = axes.round_scale(min(low, 0.0) if way == "linear" else low, high, height)
    lit = [braille.curve(*curve, scale, width, height) for curve in curves]
    cells, owners = over_one_another(lit, reversed(range(len(lit))))
    words, origin = axes.tick_words(axes.ticks_of(scale, height), 0, 9)
    if way == "log":
        words = axes.words_of(axes.LogAxis(), scale, height)
    spots: list[tuple[int, int, str]] = []
    named: set[int] = set()  # cells
    for at, peak in sorted(enumerate(peaks), key=lambda each: each[0] != chosen):
        cell = cell_of(peak.frequency_hz, top_hz, width)
        if cell in named:
            continue
        named.add(cell)
        # above its own height: its cell may be filled by the skirt of a higher one
        top = 4 * height - 1 - int(braille.row_of(levels(np.array([peak.amplitude]), way), scale, 4 * height)[0])
        line = max(0, top // 4 - 1)
        sign = f"{at + 1}" if at != chosen else f"[{at + 1}]"
        if all(line != taken or cell > first + len(other) or first > cell + len(sign) for taken, first, other in spots):
            spots.append((line, cell, sign))
    below = _below(0.0, top_hz, " Hz")
    notes = (f"counted from {origin}",) if origin else ()
    return BigPlot(dots.lines_of(cells), owners, words, below, notes=notes, spots=tuple(spots))


def cell_of(frequency_hz: float, top_hz: float, width: int) -> int:
    """Return in which cell a frequency is drawn."""
    return min(width - 1, int(frequency_hz / top_hz * width))


def line_in(spectrum: Spectrum, peaks: Sequence[Peak], cell: int, top_hz: float, width: int) -> Peak:
    """Return what a cursor reads in a cell: the peak that is drawn there, else the strongest line, else the nearest."""
    here = [peak for peak in peaks if cell_of(peak.frequency_hz, top_hz, width) == cell]
    if here:
        return max(here, key=lambda peak: peak.amplitude)
    frequencies = (np.arange(len(spectrum.amplitudes)) + 1) * spectrum.step_hz
    inside = np.flatnonzero((frequencies / top_hz * width).astype(np.intp) == cell)
    if not len(inside):
        inside = np.array([np.abs(frequencies - (cell + 0.5) / width * top_hz).argmin()])
    at = int(inside[spectrum.amplitudes[inside].argmax()])
    return Peak(float(frequencies[at]), float(spectrum.amplitudes[at]))


def line_at(spectrum: Spectrum, peaks: Sequence[Peak], frequency_hz: float) -> Peak:
    """Return what a cursor reads that stands at a frequency: a peak within a line of it, else the nearest line."""
    near = min(peaks, key=lambda peak: abs(peak.frequency_hz - frequency_hz), default=None)
    if near is not None and abs(near.frequency_hz - frequency_hz) <= spectrum.step_hz:
        return near
    at = max(1, min(len(spectrum.amplitudes), round(frequency_hz / spectrum.step_hz)))
    return Peak(frequency_hz, float(spectrum.amplitudes[at - 1]))


def _curve(spectrum: Spectrum, way: str, top_hz: float, columns: int) -> tuple[Floats, Floats]:
    """Smallest and largest level of the lines in each column; a straight line where there are fewer than columns.

    Peaks are as high as they are told: a sine between two lines is higher than both.
    """
    peaks = peaks_of(spectrum)
    found = levels(np.append(spectrum.amplitudes, [peak.amplitude for peak in peaks]), way)
    values, tops = np.split(found, [len(spectrum.amplitudes)])
    step_hz = spectrum.step_hz
    if min(len(values), top_hz / step_hz) < 2 * columns:
        at = (np.arange(columns) + 0.5) / columns * top_hz / step_hz - 1
        low = np.interp(at, np.arange(len(values)), values, right=np.nan)
        high = low.copy()
    else:
        ends = np.arange(columns) / columns * top_hz / step_hz
        inside = values[: math.ceil(top_hz / step_hz)]
        bins = reduce(inside, bins_at(np.minimum(ends.astype(np.intp), len(inside) - 1)))
        low, high = np.where(ends < len(values), (bins.low, bins.high), np.nan)  # another signal is faster
    for peak, top in zip(peaks, tops, strict=True):
        if peak.frequency_hz > top_hz:
            continue
        column = min(columns - 1, int(peak.frequency_hz / top_hz * columns))
        high[column] = np.fmax(high[column], top)
    return low, high


def of_pair(pair: Pair, size: tuple[int, int]) -> BigPlot:
    """Return y over x, a sign per cell: the newest in it tells how old it is."""
    width, height = size
    x_scale = axes.round_scale(float(pair.x.min()), float(pair.x.max()), 5)
    y_scale = axes.round_scale(float(pair.y.min()), float(pair.y.max()), height)
    across = braille.row_of(pair.x, x_scale, width)
    up = height - 1 - braille.row_of(pair.y, y_scale, height)
    count = len(pair.x)
    ages = np.minimum(2, np.arange(count) * 3 // max(1, count)).astype(np.int8)
    owners = np.full((height, width), NOBODY, np.int8)
    owners[up, across] = ages  # later ones over earlier ones
    owners[up[-1], across[-1]] = 3
    lines = ["".join(TRAIL[age] if age >= 0 else BLANK for age in line) for line in owners.tolist()]
    left, origin = axes.tick_words(axes.ticks_of(y_scale, height), 0, 9)
    below = _below(*x_scale)
    notes = (f"y counted from {origin}",) if origin else ()
    return BigPlot(lines, owners, left, below, notes=notes, aged=True)


def of_histogram(histogram: Histogram, size: tuple[int, int]) -> BigPlot:
    """Return how often which value comes, as bars from the bottom."""
    width, height = size
    columns = 2 * width
    heights = histogram.counts[np.arange(columns) * len(histogram.counts) // columns].astype(np.float64)
    scale = axes.round_scale(0.0, float(max(1, heights.max())), height)
    high = np.where(heights > 0, heights, np.nan)
    bars = braille.curve(np.where(heights > 0, 0.0, np.nan), high, scale, width, height)
    cells, owners = over_one_another([bars], [0])
    left, _ = axes.tick_words(axes.ticks_of(scale, height), 0, 9)
    end = histogram.first + histogram.step * len(histogram.counts)
    below = _below(histogram.first, end)
    return BigPlot(dots.lines_of(cells), owners, left, below)


def _below(first: float, last: float, unit: str = "") -> list[tuple[float, str]]:
    """Return the round numbers between two values, each at its share of the way from left to right."""
    places = axes.across(first, last)
    words = text.row(*(value for _, value in places), width=9)
    return [(share, f"{word}{unit}") for (share, _), word in zip(places, words, strict=True)]

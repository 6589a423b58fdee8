"""How two signals go together, and how often which value comes: what the large plot shows besides spectra."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute.samples import Samples
from silo.core.arrays.values import Floats, as_floats


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

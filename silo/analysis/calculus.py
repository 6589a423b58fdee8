"""Derivative, integral and spectrum of samples at uneven times, the same for `Signal`, `silo plot` and any other plot.

Pure functions on float64 arrays of shape `(m,)`; times are in seconds.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def derivative(times: Floats, values: Floats) -> Floats:
    """Change per second, by central differences; NaN where a neighbour is missing or time stands still."""
    if len(times) < 2:
        return np.full(len(times), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.diff(values) / np.where(np.diff(times) > 0, np.diff(times), np.nan)
        inner = (values[2:] - values[:-2]) / np.where(times[2:] > times[:-2], times[2:] - times[:-2], np.nan)
    return np.concatenate([steps[:1], inner, steps[-1:]])


def integral(times: Floats, values: Floats) -> Floats:
    """Return the area under the values since the first sample, by trapezoids; a NaN sample adds nothing."""
    areas = np.nan_to_num((values[1:] + values[:-1]) / 2 * np.diff(times), nan=0.0)
    return np.concatenate([np.zeros(min(1, len(values))), np.cumsum(areas)])


def spectrum(times: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return frequencies in Hz, and the amplitude of the sine at each (Hann window, mean taken out).

    Samples are put on an even grid first; what is not finite is left out. Fewer than 4 samples have no spectrum.
    """
    good = np.isfinite(values)
    times, values = times[good], values[good]
    order = np.argsort(times, kind="stable")
    times, values = times[order], values[order]
    count = len(times)
    if count < 4 or times[-1] <= times[0]:
        return np.zeros(0), np.zeros(0)
    even = np.linspace(times[0], times[-1], count)
    samples = np.interp(even, times, values)
    shape = np.hanning(count)
    with np.errstate(over="ignore", invalid="ignore"):
        amplitudes = np.abs(np.fft.rfft((samples - samples.mean()) * shape)) * 2 / shape.sum()
    return np.fft.rfftfreq(count, even[1] - even[0]), amplitudes

"""Derivative and integral of samples at uneven times, the same for `Signal`, `silo plot` and any other plot.

Pure functions on float64 arrays of shape `(m,)`; times are in seconds.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def derivative(times: Floats, values: Floats) -> Floats:
    """Change per second: the slopes to both neighbours, that to the nearer one counting more; of second order.

    As `numpy.gradient` of these times. The ends have one neighbour. Over a time without samples it goes straight, as
    the integral does; NaN where a neighbour is missing. A step over which time doesn't rise is none.
    """
    if len(times) < 2:
        return np.full(len(times), np.nan)
    steps = np.diff(times)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        slopes = np.diff(values) / np.where(steps > 0, steps, np.nan)
        before, behind = steps[:-1], steps[1:]
        inner = slopes[:-1] + (slopes[1:] - slopes[:-1]) * (before / (before + behind))
        across = (values[2:] - values[:-2]) / (before + behind)  # of a sample that is missing itself
    inner = np.where(np.isfinite(values[1:-1]), inner, across)
    inner = np.where((before > 0) & (behind > 0), inner, np.where(before > 0, slopes[:-1], slopes[1:]))
    return np.concatenate([slopes[:1], inner, slopes[-1:]])


def integral(times: Floats, values: Floats) -> Floats:
    """Return the area under the values since the first sample, by trapezoids; NaN and steps back add nothing."""
    areas = np.nan_to_num((values[1:] + values[:-1]) / 2 * np.maximum(np.diff(times), 0.0), nan=0.0)
    return np.concatenate([np.zeros(min(1, len(values))), np.cumsum(areas)])

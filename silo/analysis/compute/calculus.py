"""Derivative and integral of samples at uneven times, the same for `Signal`, `silo plot` and any other plot.

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
    """Return the area under the values since the first sample, by trapezoids; NaN and steps back add nothing."""
    areas = np.nan_to_num((values[1:] + values[:-1]) / 2 * np.maximum(np.diff(times), 0.0), nan=0.0)
    return np.concatenate([np.zeros(min(1, len(values))), np.cumsum(areas)])

"""What lies between two cursors: a signal at both, its difference and slope, and the statistics of its samples."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.values import as_floats

NAN = math.nan


@dataclass(frozen=True)
class Between:
    """Facts of a signal from A to B; NaN where there is none. `samples` are those between, both ends included."""

    at_a: float = NAN
    at_b: float = NAN
    difference: float = NAN
    slope: float = NAN  # per second
    mean: float = NAN
    std: float = NAN
    rms: float = NAN
    smallest: float = NAN
    largest: float = NAN
    samples: int = 0
    not_finite: int = 0


def between(time_ns: NDArray[np.int64], values: NDArray[Any], a_ns: int, b_ns: int) -> Between:
    """Return the facts from A to B, whichever is earlier; of texts only how many there are.

    At a cursor counts the sample that held then; what is no finite number is counted and left out.
    """
    first = int(np.searchsorted(time_ns, min(a_ns, b_ns), "left"))
    last = int(np.searchsorted(time_ns, max(a_ns, b_ns), "right"))
    if values.dtype.kind in "SUVMm":
        return Between(samples=last - first)
    floats = as_floats(values)
    at_a, at_b = _held(time_ns, floats, a_ns), _held(time_ns, floats, b_ns)
    seconds = (b_ns - a_ns) / 1e9
    difference = at_b - at_a
    inside = floats[first:last]
    finite = inside[np.isfinite(inside)]
    slope = difference / seconds if seconds else NAN
    found = Between(at_a, at_b, difference, slope, samples=last - first, not_finite=len(inside) - len(finite))
    if not len(finite):
        return found
    # as shares of the largest one: neither 1e300 nor 1e-300 squared is a float
    size = float(np.abs(finite).max()) or 1.0
    shares = finite / size
    mean = float(shares.mean())
    std = float(np.sqrt(np.mean((shares - mean) ** 2)))
    rms = float(np.sqrt(np.mean(shares**2)))
    return Between(
        at_a, at_b, difference, slope, mean * size, std * size, rms * size,
        float(finite.min()), float(finite.max()), last - first, len(inside) - len(finite),
    )  # fmt: skip


def _held(time_ns: NDArray[np.int64], floats: NDArray[np.float64], at_ns: int) -> float:
    at = int(np.searchsorted(time_ns, at_ns, "right")) - 1
    return float(floats[at]) if at >= 0 else NAN

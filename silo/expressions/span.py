"""What lies between two moments: a signal at both, its difference and slope, and the statistics of its samples.

Added up block by block, wherever the rows are: of what a viewer has fetched, of a file, or in the helper process.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.values import as_floats

NAN = math.nan
HELD_PERIODS = 100  # a slow loop is late by many: so far back the sample is looked for that held at a moment


@dataclass(frozen=True)
class Between:
    """Facts of a signal from A to B; NaN where there is none. `samples` are those that held from the one to the other.

    `not_finite` of these are NaN, which is left out, or infinite.
    """

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


class Measuring:
    """Adds up a signal from A to B, whichever is earlier; of texts only how many there are.

    At a cursor counts the sample that held then, with which the statistics begin. NaN is left out; of infinite ones, as
    everywhere, extremes, mean and RMS are infinite, too, and there is no deviation.
    """

    def __init__(self, a_ns: int, b_ns: int) -> None:
        self._a_ns, self._b_ns = a_ns, b_ns
        self._at_a = self._at_b = NAN
        self._samples = self._not_finite = self._finite = 0
        self._smallest, self._largest = math.inf, -math.inf
        # as shares of the largest one: neither 1e300 nor 1e-300 squared is a float
        self._size = self._mean = self._squares = self._spread = 0.0
        self._numbers = True
        self._begun: NDArray[Any] = np.zeros(0)  # what held at the earlier one, as far as it is known

    def feed(self, time_ns: NDArray[np.int64], values: NDArray[Any]) -> None:
        """Add the next samples, oldest first, from before the earlier moment on; both arrays of shape `(n,)`."""
        first, last = (int(np.searchsorted(time_ns, at_ns, "right")) for at_ns in sorted((self._a_ns, self._b_ns)))
        if first:
            self._begun = values[first - 1 : first].copy()
        if self._take(values[first:last]):
            floats = as_floats(values)
            self._at_a = _held(time_ns, floats, self._a_ns, self._at_a)
            self._at_b = _held(time_ns, floats, self._b_ns, self._at_b)

    def _take(self, values: NDArray[Any]) -> bool:
        """Add these samples; False where they are no numbers."""
        self._samples += len(values)
        self._numbers = values.dtype.kind not in "SUVMm"
        if not self._numbers:
            return False
        inside = as_floats(values)
        finite = inside[np.isfinite(inside)]
        self._not_finite += len(inside) - len(finite)
        if len(finite) < len(inside):
            self._smallest = min(self._smallest, float(np.fmin.reduce(inside, initial=math.inf)))
            self._largest = max(self._largest, float(np.fmax.reduce(inside, initial=-math.inf)))
        if len(finite):
            self._add(finite)
        return True

    def _add(self, finite: NDArray[np.float64]) -> None:
        self._smallest = min(self._smallest, float(finite.min()))
        self._largest = max(self._largest, float(finite.max()))
        size = max(self._size, float(np.abs(finite).max())) or 1.0
        share = self._size / size
        self._mean, self._squares, self._spread = self._mean * share, self._squares * share**2, self._spread * share**2
        self._size = size
        shares = finite / size
        count, mean = len(shares), float(shares.mean())
        spread, before = float(np.sum((shares - mean) ** 2)), self._finite
        self._finite += count
        step = mean - self._mean
        self._spread += spread + step * step * before * count / self._finite
        self._mean += step * count / self._finite
        self._squares += float(np.sum(shares**2))

    @property
    def found(self) -> Between:
        """The facts of what was added."""
        if len(self._begun):
            self._take(self._begun)
            self._begun = self._begun[:0]
        if not self._numbers:
            return Between(samples=self._samples)
        seconds, difference = (self._b_ns - self._a_ns) / 1e9, self._at_b - self._at_a
        ends = (self._at_a, self._at_b, difference, difference / seconds if seconds else NAN)
        if self._smallest == -math.inf or self._largest == math.inf:
            mean = self._smallest if self._largest < math.inf else self._largest if self._smallest > -math.inf else NAN
            return Between(*ends, mean, NAN, math.inf, self._smallest, self._largest, self._samples, self._not_finite)
        if not self._finite:
            return Between(*ends, samples=self._samples, not_finite=self._not_finite)
        std, rms = (math.sqrt(some / self._finite) * self._size for some in (self._spread, self._squares))
        mean = self._mean * self._size
        return Between(*ends, mean, std, rms, self._smallest, self._largest, self._samples, self._not_finite)


def between(time_ns: NDArray[np.int64], values: NDArray[Any], a_ns: int, b_ns: int) -> Between:
    """Return the facts from A to B of samples that begin before the earlier one."""
    measuring = Measuring(a_ns, b_ns)
    measuring.feed(time_ns, values)
    return measuring.found


def _held(time_ns: NDArray[np.int64], floats: NDArray[np.float64], at_ns: int, before: float) -> float:
    at = int(np.searchsorted(time_ns, at_ns, "right")) - 1
    return float(floats[at]) if at >= 0 else before

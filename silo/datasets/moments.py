"""Statistics of a data set that is never in memory as a whole: of each episode, and merged over all.

Minimum, maximum, mean and standard deviation are exact; quantiles of all episodes are the means of theirs, weighted by
their frames, as LeRobot 0.6 merges them. NaN and infinite numbers are left out, as one of them would make all that a
policy is scaled by NaN.
"""

import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}


@dataclass(frozen=True)
class Moments:
    """Of one feature: arrays of the shape of a frame, and how many frames they are of.

    What is no finite number is in none of them: `known` are how many were, and where that is 0 there stands NaN.
    """

    count: int
    known: NDArray[np.int64]
    least: Numbers
    most: Numbers
    mean: Numbers
    std: Numbers
    quantiles: Numbers

    @classmethod
    def of(cls, values: NDArray[Any]) -> "Moments":
        """Of frames of one episode, of shape `(frames, ...)`."""
        numbers = values.astype(np.float64)
        numbers = numbers[:, None] if numbers.ndim == 1 else numbers
        finite = np.isfinite(numbers)
        least, most, mean, std, quantile = (np.min, np.max, np.mean, np.std, np.quantile)
        if not finite.all():
            least, most, mean, std, quantile = (np.nanmin, np.nanmax, np.nanmean, np.nanstd, np.nanquantile)
            numbers = np.where(finite, numbers, np.nan)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # of NaN alone there is NaN
            return cls(
                len(numbers),
                finite.sum(axis=0),
                least(numbers, axis=0),
                most(numbers, axis=0),
                mean(numbers, axis=0),
                std(numbers, axis=0),
                quantile(numbers, list(QUANTILES.values()), axis=0),
            )

    def and_of(self, other: "Moments") -> "Moments":
        """Return those of both, by Chan's rule for mean and variance."""
        known = self.known + other.known
        share = other.known / np.maximum(known, 1)
        apart = other.mean - self.mean
        variance = (1 - share) * self.std**2 + share * other.std**2 + share * (1 - share) * apart**2

        def of_both(mine: Numbers, theirs: Numbers, made: Numbers) -> Numbers:
            return np.where(other.known == 0, mine, np.where(self.known == 0, theirs, made))

        return Moments(
            self.count + other.count,
            known,
            np.fmin(self.least, other.least),
            np.fmax(self.most, other.most),
            of_both(self.mean, other.mean, self.mean + share * apart),
            of_both(self.std, other.std, np.sqrt(variance)),
            of_both(self.quantiles, other.quantiles, (1 - share) * self.quantiles + share * other.quantiles),
        )

    def told(self) -> dict[str, list[Any]]:
        """As the files of a data set say them."""
        return {
            "min": self.least.tolist(),
            "max": self.most.tolist(),
            "mean": self.mean.tolist(),
            "std": self.std.tolist(),
            "count": [self.count],
            **{name: self.quantiles[place].tolist() for place, name in enumerate(QUANTILES)},
        }


def merged(before: dict[str, Moments], more: Iterable[tuple[str, Moments]]) -> dict[str, Moments]:
    """Return the moments of each feature with those of another episode."""
    return {name: before[name].and_of(one) if name in before else one for name, one in more}

"""Statistics of a data set that is never in memory as a whole: of each episode, and merged over all.

Minimum, maximum, mean and standard deviation are exact; quantiles of all episodes are the means of theirs, weighted by
their frames, as LeRobot 0.6 merges them.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}


@dataclass(frozen=True)
class Moments:
    """Of one feature: arrays of the shape of a frame, and how many frames they are of."""

    count: int
    least: NDArray[np.float64]
    most: NDArray[np.float64]
    mean: NDArray[np.float64]
    std: NDArray[np.float64]
    quantiles: NDArray[np.float64]

    @classmethod
    def of(cls, values: NDArray[Any]) -> "Moments":
        """Of frames of one episode, of shape `(frames, ...)`."""
        numbers = values.astype(np.float64)
        numbers = numbers[:, None] if numbers.ndim == 1 else numbers
        return cls(
            len(numbers),
            numbers.min(axis=0),
            numbers.max(axis=0),
            numbers.mean(axis=0),
            numbers.std(axis=0),
            np.quantile(numbers, list(QUANTILES.values()), axis=0),
        )

    def and_of(self, other: "Moments") -> "Moments":
        """Return those of both, by Chan's rule for mean and variance."""
        count = self.count + other.count
        share = other.count / count
        apart = other.mean - self.mean
        variance = (1 - share) * self.std**2 + share * other.std**2 + share * (1 - share) * apart**2
        return Moments(
            count,
            np.minimum(self.least, other.least),
            np.maximum(self.most, other.most),
            self.mean + share * apart,
            np.sqrt(variance),
            (1 - share) * self.quantiles + share * other.quantiles,
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

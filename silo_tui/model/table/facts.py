"""What was measured of all elements of the table: newest values, statistics, rates, signs, as columns of numbers.

A logger answers them in a survey (`silo.live.statistics`), once or twice a second. Rows are those of the table; what
isn't known is NaN. Filter terms, orders and columns read them by the names of their quantities.
"""

from collections.abc import Mapping
from functools import cached_property

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.columns import Floats
from silo.live.quantities import FROZEN, LOST, NOT_FINITE, SLOW

STATISTICS = ("min", "max", "mean", "std")  # since they begin, of each sample
# of limits, which the survey knows nothing of
RED_HIGH, RED_LOW, YELLOW_HIGH, YELLOW_LOW = 1 << 16, 1 << 17, 1 << 18, 1 << 19
LIMIT_BITS = {"HH": RED_HIGH, "LL": RED_LOW, "H": YELLOW_HIGH, "L": YELLOW_LOW, "==": FROZEN}
# worst first, as process control writes them: every font has letters
SIGNS = (
    (RED_HIGH, "HH"), (RED_LOW, "LL"), (NOT_FINITE, "NN"), (YELLOW_HIGH, "H"), (YELLOW_LOW, "L"), (FROZEN, "=="),
    (SLOW, "<<"), (LOST, "XX"),
)  # fmt: skip
OLD = "~~"  # nothing comes
FULL = "##"  # of one row: its buffer keeps no more
MEANINGS = {
    "HH": "above its red limit", "LL": "below its red limit", "H": "above its yellow limit",
    "L": "below its yellow limit", "NN": "nan or inf among its newest values",
    "==": "frozen: it changes no more, or a limit calls it stale",
    "<<": "slow: fewer samples than its divider asks for",
    "XX": "samples lost: the buffer could not keep them",
    OLD: "the value is old: no link, the program is dead, or it was switched on later",
    FULL: "its buffer is full and keeps what it has: this is its last sample",
}  # fmt: skip
WORDS = {"nan": NOT_FINITE, "frozen": FROZEN, "slow": SLOW}
BAD = frozenset({"HH", "LL", "NN", "XX"})


class Facts(msgspec.Struct, frozen=True, dict=True):
    """Quantities of shape `(n,)` by name; `since_ns` is when the statistics begin, `time_ns` when they were made."""

    quantities: Mapping[str, Floats] = msgspec.field(default_factory=dict)
    since_ns: int = 0
    time_ns: int = 0
    # of elements and entries on the screen
    details: Mapping[str, Mapping[str, float]] = msgspec.field(default_factory=dict)

    def of(self, quantity: str, count: int) -> Floats | None:
        """Return a quantity of all rows; None where it wasn't surveyed, or of another table."""
        found = self.quantities.get(quantity)
        return found if found is not None and len(found) == count else None

    def detail(self, name: str, quantity: str) -> float:
        """Return a quantity of an element or entry that is on the screen, NaN where it isn't known."""
        return self.details.get(name, {}).get(quantity, float("nan"))

    def signs(self, count: int) -> NDArray[np.int64]:
        """Return the bits of what is the matter with each row, 0 where nothing is known."""
        return self._signs if len(self._signs) == count else np.zeros(count, np.int64)

    @cached_property
    def _signs(self) -> NDArray[np.int64]:
        return np.nan_to_num(self.quantities.get("signs", np.zeros(0))).astype(np.int64)


def worst(bits: int) -> str:
    """Return the two letters of the worst of some signs; empty for none."""
    return next((letters for bit, letters in SIGNS if bits & bit), "")


def worst_of(bits: NDArray[np.int64]) -> tuple[str, int]:
    """Return the two letters of the worst sign that some rows have, and how many have it; "" and 0 for none."""
    together = int(np.bitwise_or.reduce(bits, initial=0))
    bit, letters = next(((bit, letters) for bit, letters in SIGNS if together & bit), (0, ""))
    return letters, int(((bits & bit) != 0).sum())


def ranks(bits: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how bad the worst of each row's signs is: 0 for none, then larger the worse."""
    found = np.zeros(len(bits), np.int64)
    for rank, (bit, _) in enumerate(reversed(SIGNS), 1):
        found[(bits & bit) != 0] = rank
    return found


NOTHING = Facts()

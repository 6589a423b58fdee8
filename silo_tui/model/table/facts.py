"""What was measured of all elements of the table: newest values, statistics, rates, signs, as columns of numbers.

A logger answers them in a survey (`silo.live.statistics`), once or twice a second. Rows are those of the table; what
isn't known is NaN. Filter terms, orders and columns read them by the names of their quantities.
"""

from collections.abc import Mapping
from functools import cached_property

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.conditions.standing import LimitWord
from silo.core.arrays.columns import Floats
from silo.live.quantities import FROZEN, LOST, NOT_FINITE, SLOW
from silo_tui.model.words.states import limit_word

STATISTICS = ("min", "max", "mean", "std")  # since they begin, of each sample
SINCE = (*STATISTICS, "noise")
# of limits, which the survey knows nothing of
RED_HIGH, RED_LOW, YELLOW_HIGH, YELLOW_LOW = 1 << 16, 1 << 17, 1 << 18, 1 << 19
# worst first; limits as process control writes them
STATES = (
    (RED_HIGH, "HH"), (RED_LOW, "LL"), (NOT_FINITE, "nan"), (YELLOW_HIGH, "H"), (YELLOW_LOW, "L"), (FROZEN, "frozen"),
    (SLOW, "slow"), (LOST, "lost"),
)  # fmt: skip
BITS = {word: bit for bit, word in STATES}
LIMIT_BITS = {word.value: BITS[limit_word(word)] for word in LimitWord if word.is_over}
BAD = frozenset({"HH", "LL", "nan", "lost"})


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
    """Return the word of the worst of some signs; empty for none."""
    return next((word for bit, word in STATES if bits & bit), "")


def worst_of(bits: NDArray[np.int64]) -> tuple[str, int]:
    """Return the word of the worst sign that some rows have, and how many have it; "" and 0 for none."""
    word = worst(int(np.bitwise_or.reduce(bits, initial=0)))
    return word, int(((bits & BITS.get(word, 0)) != 0).sum())


def ranks(bits: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how bad the worst of each row's signs is: 0 for none, then larger the worse."""
    found = np.zeros(len(bits), np.int64)
    for rank, (bit, _) in enumerate(reversed(STATES), 1):
        found[(bits & bit) != 0] = rank
    return found


NOTHING = Facts()

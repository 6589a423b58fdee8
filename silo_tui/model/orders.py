"""The orders of a table: one entry each, with the letter that picks it, its words, and the key per element.

An order by what is measured (`quantity`) is live: it is made anew once a second. Those by columns of settings stand
with their column in `table_columns.py`; `LETTERS` gives them theirs.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.columns import Floats
from silo_tui.model.facts import ranks
from silo_tui.model.table import TableState

TREE, NAME, ADDED = "tree", "name", "added"
STEADY = (TREE, NAME, ADDED)
LETTERS = {
    TREE: "n", NAME: "l", ADDED: "g", "unit": "u", "div": "d", "size": "s", "buf": "b", "act": "p", "on": "o",
    "value": "v", "|value|": "a", "changed": "c", "!": "!", "fill": "f", "rate": "r", "jitter": "j", "max": "m",
    "min": "i", "mean": "e", "std": "t",
}  # fmt: skip
WORDS = {
    TREE: "name, as a tree", NAME: "name, as a list", ADDED: "as the program added them", "act": "action",
    "changed": "last change", "!": "signs, worst first",
}  # fmt: skip


@dataclass(frozen=True)
class LiveOrder:
    """An order by what is measured; `falling` ones begin with the largest."""

    name: str
    quantity: str
    falling: bool = True
    of: Callable[[Floats], Floats] | None = None

    def keys(self, table: TableState) -> Floats:
        """Return a key per element, NaN where nothing is known."""
        if self.quantity == "signs" and table.signs_known:
            return ranks(table.signs).astype(float)
        known = table.facts.of(self.quantity, len(table))
        if known is None:
            return np.full(len(table), np.nan)
        if self.name in OF_NORMS:
            known = np.where(table.mixed, np.nan, known)  # of metres and radians there is no norm
        return known if self.of is None else self.of(known)


OF_NORMS = frozenset({"value", "|value|", "max", "min", "mean", "std"})  # by which a vector is ordered as its norm
LIVE_ORDERS = {
    order.name: order
    for order in (
        LiveOrder("value", "value"), LiveOrder("|value|", "value", of=np.abs), LiveOrder("changed", "changed", False),
        LiveOrder("!", "signs"), LiveOrder("fill", "fill"), LiveOrder("rate", "rate"), LiveOrder("jitter", "jitter"),
        LiveOrder("max", "max"), LiveOrder("min", "min", False), LiveOrder("mean", "mean"), LiveOrder("std", "std"),
    )
}  # fmt: skip

FILE_ORDERS = tuple(order for order in LIVE_ORDERS if order != "fill")  # how large a buffer was is not in a file


def ordered(keys: Floats, base: NDArray[np.intp], *, falling: bool, unknown: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return `base` ordered by `keys` of all elements: NaN first, what is unknown last, equal ones as before."""
    of = keys[base]
    turned = np.where(np.isnan(of), 0.0, -of if falling else of)
    group = np.where(unknown[base], 2, np.where(np.isnan(of), 0, 1))
    found: NDArray[np.intp] = base[np.lexsort((turned, group))]
    return found

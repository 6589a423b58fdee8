"""What the lists of triggers, alarms, recordings and events share: filter, order, marks.

Plain functions and data; nothing is drawn here.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

Line = TypeVar("Line")


@dataclass(frozen=True)
class Order(Generic[Line]):
    """One way to order a list, with the letter that chooses it. `backwards`: the largest first, at first."""

    name: str
    letter: str
    words: str
    key: Callable[[Line], Any]
    backwards: bool = False


def arranged(found: Iterable[Line], order: Order[Line], *, turned: bool) -> list[Line]:
    """Return lines in an order; `turned`: the other way round."""
    lines = sorted(found, key=order.key)
    return lines[::-1] if order.backwards != turned else lines  # lines that are alike turn round too


def passes(told: str, asked: str) -> bool:
    """Return whether a line that says `told` has all the words asked for; `a|b` either, `-a` not."""
    whole = told.casefold()
    for word in asked.casefold().split():
        wanted, not_wanted = word.removeprefix("-"), word.startswith("-") and len(word) > 1
        if any(each and each in whole for each in wanted.split("|")) == not_wanted:
            return False
    return True


class Marks:
    """The marked lines of a list, by their keys, and where a range began."""

    def __init__(self) -> None:
        self.keys: set[str] = set()
        self.anchor: str | None = None

    def toggle(self, key: str) -> None:
        """Mark a line, or unmark it."""
        self.keys ^= {key}

    def toggle_all(self, shown: Sequence[str]) -> None:
        """Mark all lines, or unmark them where all are marked."""
        if set(shown) <= self.keys:
            self.keys -= set(shown)
        else:
            self.keys |= set(shown)

    def range_to(self, key: str, shown: Sequence[str]) -> str:
        """Begin a range at a line, or end it there and mark it; return what to say."""
        if self.anchor is None or self.anchor not in shown:
            self.anchor = key
            return "a range begins here; V again ends it"
        first, last = sorted((shown.index(self.anchor), shown.index(key)))
        self.keys |= set(shown[first : last + 1])
        self.anchor = None
        return f"range of {last - first + 1} marked"

    def keep(self, known: Iterable[str]) -> None:
        """Forget marks of lines that are gone."""
        known = set(known)
        self.keys &= known
        self.anchor = self.anchor if self.anchor in known else None

    def clear(self) -> bool:
        """Unmark everything and leave the range; return whether there was something."""
        had = bool(self.keys) or self.anchor is not None
        self.keys.clear()
        self.anchor = None
        return had

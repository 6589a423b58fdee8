"""What the lists of triggers, alarms, recordings and events share: filter, order, marks.

Plain functions and data; nothing is drawn here.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Generic, TypeVar

import msgspec

Line = TypeVar("Line")


class Order(msgspec.Struct, Generic[Line], frozen=True):
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


def standing(found: Iterable[Line], key_of: Callable[[Line], str], before: Sequence[str]) -> list[Line]:
    """Return lines in order so that those which stood there `before`, by their keys, stand as they did.

    A new one comes below the line that it belongs below: `before` is the order in which a person saw them.
    """
    below: dict[str, list[Line]] = {key: [] for key in ("", *before)}
    above = ""
    for one in found:
        if (key := key_of(one)) in below:
            above = key
        below[above].append(one)
    return [one for lines in below.values() for one in lines]


def passes(told: str, asked: str) -> bool:
    """Return whether a line that says `told` has all the words asked for; `a|b` either, `-a` not."""
    whole = told.casefold()
    for word in asked.casefold().split():
        wanted, not_wanted = word.removeprefix("-"), word.startswith("-") and len(word) > 1
        if any(each and each in whole for each in wanted.split("|")) == not_wanted:
            return False
    return True


class Marks:
    """Which lines of a list a key is about, by their keys: what is marked, where a range began, what slipped away."""

    def __init__(self) -> None:
        self.keys: set[str] = set()
        self.anchor: str | None = None
        self._slipped: tuple[str, str] | None = None  # the line under the cursor that went, and that in its place

    def follow(self, known: str, shown: Sequence[str], place: int | None) -> int | None:
        """Return where the cursor goes as other lines are shown: with its line `known`, else it stays at its place.

        Who presses a key then means the line that was there: `meant` leaves out the one that took its place.
        """
        if known in shown:
            return shown.index(known)
        at = max(0, min(place or 0, len(shown) - 1)) if shown else None
        if known and at is not None:
            self._slipped = (self._slipped[0] if self._slipped else known, shown[at])
        return at

    def settle(self) -> None:
        """Take the line under the cursor for meant: whoever is at the keys changed what is shown."""
        self._slipped = None

    def meant(self, shown: Sequence[str], chosen: str) -> list[str]:
        """Return the lines that a key is about: the marked ones that are shown; where none is marked, the cursor's.

        None where all that is marked is filtered out, and none where another line slipped under the cursor.
        """
        if self.keys:
            return [key for key in shown if key in self.keys]
        slipped = self._slipped is not None and chosen == self._slipped[1]
        return [chosen] if chosen and not slipped else []

    def why_none(self, shown: Sequence[str], chosen: str, named: Callable[[str], str] = str) -> str:
        """Return why a key is about no line, empty where that is plain; the key again is about what slipped there."""
        if self.keys and not self.keys & set(shown):
            return "the filter leaves out what is marked: Esc ends it; nothing was asked"
        slipped, self._slipped = self._slipped, None
        if slipped is None or slipped[1] != chosen:
            return ""
        return f"{named(slipped[0])} is gone, {named(chosen)} stands there now: nothing was done; once more is about it"

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
            return "a range begins here; the same key ends it"
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

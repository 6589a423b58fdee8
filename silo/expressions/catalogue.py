"""The names that expressions may use: elements, scalars of them, patterns, derived signals."""

import fnmatch
import re
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property

from silo.core.elements import Derived, Entry

OFF = -1  # the source of an element that isn't logged


@dataclass(frozen=True)
class Known:
    """An element that an expression may name. Elements of one `source` have their samples at the same ticks.

    `source` is OFF where it isn't logged: what depends on it is unobservable.
    """

    name: str
    entries: tuple[Entry, ...]
    unit: str
    source: int
    divider: int


class Catalogue:
    """The elements that expressions may name, in the order of the table. Made once for many expressions."""

    def __init__(self, elements: Sequence[Known], prefix: str = "/log", derived: Sequence[Derived] = ()) -> None:
        self.elements = elements
        self.prefix = prefix
        self.derived = derived

    def before(self, name: str) -> tuple[Derived, "Catalogue"] | None:
        """Return the derived signal of this name, and what its expression may name: elements, and those before it."""
        names = (name, f"{self.prefix.rstrip('/')}/{name.lstrip('/')}")
        for exact in (True, False):
            for place, one in enumerate(self.derived):
                if one.name in names if exact else one.name.endswith(f"/{name.lstrip('/')}"):
                    made = Catalogue(self.elements, self.prefix, self.derived[:place])
                    vars(made).update({key: vars(self)[key] for key in ("_places", "_by_end") if key in vars(self)})
                    return one, made
        return None

    @cached_property
    def _places(self) -> dict[str, tuple[int, int | None]]:
        """Element and entry by name; the entry is None for a whole element, which goes before scalars of others."""
        found: dict[str, tuple[int, int | None]] = {}
        for place, element in enumerate(self.elements):
            found.setdefault(element.name, (place, None))
        for place, element in enumerate(self.elements):
            for number, entry in enumerate(element.entries):
                found.setdefault(element.name + entry.suffix, (place, number))
        return found

    @cached_property
    def _by_end(self) -> dict[str, list[str]]:
        """Full names by their last part."""
        ends: dict[str, list[str]] = {}
        for name in self._places:
            ends.setdefault(name.rpartition("/")[2], []).append(name)
        return ends

    def find(self, text: str) -> list[tuple[int, int | None]]:
        """Return what a name or a pattern names: one thing, or several where the name isn't unique."""
        if any(letter in text for letter in "*?["):
            return self._glob(text)
        for name in (text, f"{self.prefix.rstrip('/')}/{text.lstrip('/')}"):
            if name in self._places:
                return [self._places[name]]
        end = f"/{text.lstrip('/')}"
        known = self._by_end.get(text.rpartition("/")[2], ())
        return [self._places[name] for name in known if name.endswith(end)]

    def _glob(self, pattern: str) -> list[tuple[int, int | None]]:
        anchored = pattern if pattern.startswith(("/", "*")) else f"*/{pattern}"
        matches = re.compile(fnmatch.translate(anchored)).match
        whole: list[tuple[int, int | None]] = [
            (place, None) for place, element in enumerate(self.elements) if matches(element.name)
        ]
        if whole:
            return whole
        return [
            (place, number)
            for place, element in enumerate(self.elements)
            for number, entry in enumerate(element.entries)
            if matches(element.name + entry.suffix)
        ]

    def name(self, place: int, entry: int | None) -> str:
        """Return the full name of an element or of a scalar."""
        element = self.elements[place]
        return element.name if entry is None else element.name + element.entries[entry].suffix

    def near(self, text: str) -> list[str]:
        """Return the three names nearest to one that is not there, as short as they may be written."""
        known = [*self._places, *(one.name for one in self.derived)]
        shorts = {name.removeprefix(f"{self.prefix.rstrip('/')}/"): name for name in known}
        bare = text.strip("/*")
        found = get_close_matches(bare, list(shorts)[:20_000], 3, 0.6)
        return found or [name for name in shorts if bare.lower() in name.lower()][:3]

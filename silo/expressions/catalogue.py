"""The names that expressions may use: elements, scalars of them, patterns, derived signals."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial

from silo.core.elements import Derived, Entry
from silo.core.names import Found, Names, is_glob

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
        found = Names((one.name for one in self.derived), self.prefix).find(name, namespaces=False)
        if not found or is_glob(name):
            return None
        place = found[0][0]
        made = Catalogue(self.elements, self.prefix, self.derived[:place])
        if "_names" in vars(self):
            vars(made)["_names"] = self._names
        return self.derived[place], made

    @cached_property
    def _names(self) -> Names:
        return Names((one.name for one in self.elements), self.prefix, partial(_scalar_names, self.elements))

    def find(self, text: str) -> list[Found]:
        """Return what a name or a pattern names: one thing, or several where the name isn't unique."""
        return self._names.find(text, scalars=True, namespaces=False)

    def name(self, place: int, entry: int | None) -> str:
        """Return the full name of an element or of a scalar."""
        element = self.elements[place]
        return element.name if entry is None else element.name + element.entries[entry].suffix

    def near(self, text: str) -> list[str]:
        """Return the three names nearest to one that is not there, as short as they may be written."""
        if inside := self._names.find(text):  # a namespace
            text = self._names.name(inside[0])
        near = self._names.near(text, scalars=True, more=[one.name for one in self.derived])
        return [name.removeprefix(f"{self._names.prefix}/") for name in near]


def _scalar_names(elements: Sequence[Known]) -> list[list[str]]:
    return [[element.name + entry.suffix for entry in element.entries] for element in elements]

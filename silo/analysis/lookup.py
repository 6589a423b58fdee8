"""From a name to an element of a log, or to a scalar of one."""

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from functools import cached_property

from silo.core.recording import RecordedElement
from silo.files.bags.index import BagElements
from silo.files.silo.whole import FileElements


class Names:
    """The names in a log: `elements` are places by name; of several elements of one name, later ones get a number."""

    def __init__(self, elements: Sequence[RecordedElement], prefix: str) -> None:
        self.elements: dict[str, int] = {}
        self._prefix = prefix
        self._all = elements
        for place, name in enumerate(_names(elements)):
            self.elements[_unused(name, self.elements)] = place

    def keys(self, name: str) -> tuple[str, str]:
        """Return what a name may stand for: with and without the prefix."""
        return name, f"{self._prefix}/{name.lstrip('/')}"

    def find(self, name: str) -> tuple[str, int, int | None] | None:
        """Return the whole name, the place of the element, and of the scalar where one is meant; None: unknown.

        A scalar is `imu/acc_x`, in bags of others `imu/acc/x`; either is understood.
        """
        # elements with and without the prefix first: names of scalars may cost reading all of the log
        for key in self.keys(name):
            if key in self.elements:
                return key, self.elements[key], None
        stem, _, last = name.rpartition("/")
        bare, bracket, number = name.removesuffix("]").partition("[")
        front, _, end = name.rpartition("_")
        others = (f"{stem}_{last}", f"{front}/{end}", f"{bare}_{number}" if bracket else "")
        for key in (key for one in (name, *others) if one for key in self.keys(one)):
            if key in self._entries:
                return key, *self._entries[key]
        return None

    def hint(self, name: str, more: Sequence[str]) -> str:
        """Return what is said of a name that there isn't; `more` are other names that there are."""
        if any(letter in name for letter in "*?"):
            return f"; log.glob({name!r}) are all signals that match"
        near = get_close_matches(name, [*self.elements, *self._entries, *more], 3, 0.5)
        near = near or [key for key in self.elements if name.lower() in key.lower()][:3]
        return (
            f"; did you mean {', '.join(near)}?" if near else f"; it has {len(self.elements)} elements, see list(log)"
        )

    @cached_property
    def _entries(self) -> dict[str, tuple[int, int]]:
        # made only for who asks for a scalar of an element, or for a name that is not there
        found: dict[str, tuple[int, int]] = {}
        for place, names in enumerate(_entry_names(self._all)):
            for index, name in enumerate(names):
                found.setdefault(name, (place, index))
        return found


def _names(elements: Sequence[RecordedElement]) -> list[str]:
    if isinstance(elements, FileElements | BagElements):
        return elements.names
    return [element.name for element in elements]


def _entry_names(elements: Sequence[RecordedElement]) -> list[list[str]]:
    if isinstance(elements, BagElements):
        return elements.entry_names
    return [[entry.name for entry in element.entries] for element in elements]


def _unused(name: str, taken: Mapping[str, object]) -> str:
    number = 1
    unique = name
    while unique in taken:
        number += 1
        unique = f"{name}#{number}"
    return unique

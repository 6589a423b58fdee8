"""The names in a log: its elements, their scalars, and what is derived of them."""

from collections.abc import Sequence

from silo.core.names import Names
from silo.core.recording import RecordedElement, Recording
from silo.files.silo.reader import FileElements


def names_of(recording: Recording, derived: Sequence[str] = ()) -> Names:
    """Return the names of elements, then the derived ones; of several elements of one name, later ones get a number."""
    taken: dict[str, None] = {}
    for name in element_names(recording.elements):
        number, unique = 1, name
        while unique in taken:
            number += 1
            unique = f"{name}#{number}"
        taken[unique] = None
    return Names((*taken, *derived), recording.prefix, lambda: entry_names(recording.elements))


def element_names(elements: Sequence[RecordedElement]) -> list[str]:
    """Return the names of elements, without reading them."""
    return elements.names if isinstance(elements, FileElements) else [element.name for element in elements]


def entry_names(elements: Sequence[RecordedElement]) -> list[list[str]]:
    """Return the names of the scalars of each."""
    return [[entry.name for entry in element.entries] for element in elements]

"""The element table: what is registered, under which name, with which options. Its owner does the locking."""

from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase

import msgspec

from silo.core.elements import Edit, ElementInfo, ElementOptions, Problem, join_name
from silo.errors import ElementError
from silo.loop.plan import Element
from silo.settings.options import checked, edit_problems


class Registrations:
    """Elements in the order of registration. What was added waits in `pending` until `adopt`."""

    def __init__(self, prefix: str) -> None:
        self.prefix = prefix
        self.revision = 0
        self.pending: list[Element] = []
        self.elements: tuple[Element, ...] = ()
        self._places: dict[str, int] = {}
        self._names: set[str] = set()
        self._entry_names: set[str] = set()

    def add(self, element: Element) -> None:
        """Keep a new element for the next `adopt`. Raises ElementError if the name is taken."""
        name = element.info.name
        if not name.isprintable() or name == "/":
            raise ElementError(f"element name {name!r}: write a name of printable characters, without line breaks")
        if name in self._names:
            raise ElementError(f"element '{name}' is there already; give this one another name or group")
        entries = {name + entry.suffix for entry in element.info.entries}
        if not self._entry_names.isdisjoint(entries):
            twice = min(self._entry_names & entries)
            raise ElementError(f"element '{name}': another element has a value named '{twice}' already; rename one")
        self._names.add(name)
        self._entry_names |= entries
        self.pending.append(element)

    def adopt(self) -> None:
        """Make what was added part of the table."""
        if self.pending:
            self.elements += tuple(self.pending)
            self.pending = []
            self._places = {element.info.name: place for place, element in enumerate(self.elements)}
            self.revision += 1

    def remove(self, name: str) -> int:
        """Forget an element or a namespace, also what waits for `adopt`. Returns how many there were.

        Raises ElementError for a name that nothing has. The others keep their order.
        """
        try:
            gone = {self.elements[place].info.name for place in self.select(name)}
        except ElementError:
            gone = set()
            if not (waiting := self._waiting(name)):
                raise
        else:
            waiting = self._waiting(name)
        gone |= waiting
        for element in [*self.elements, *self.pending]:
            if element.info.name in gone:
                self._names.discard(element.info.name)
                self._entry_names -= {element.info.name + entry.suffix for entry in element.info.entries}
        kept = tuple(element for element in self.elements if element.info.name not in gone)
        self.pending = [element for element in self.pending if element.info.name not in gone]
        if len(kept) < len(self.elements):
            self.elements = kept
            self._places = {element.info.name: place for place, element in enumerate(kept)}
            self.revision += 1
        return len(gone)

    def _waiting(self, name: str) -> set[str]:
        fulls = (join_name("", "", name), join_name(self.prefix, "", name))
        names = [element.info.name for element in self.pending]
        return {one for one in names for full in fulls if one == full or one.startswith(full.rstrip("/") + "/")}

    def release(self) -> None:
        """Let go of the variables, so that the program may resize or close what holds them. The rows stay."""
        self.elements = tuple(Element(element.info, ()) for element in self.elements)
        self.pending = []

    @property
    def infos(self) -> list[ElementInfo]:
        """The rows of the table."""
        return [element.info for element in self.elements]

    def has(self, name: str) -> bool:
        """Whether an element has this name, with or without the prefix."""
        return any(candidate in self._places for candidate in (name, join_name(self.prefix, "", name)))

    def place(self, name: str) -> int:
        """Return where an element stands, by its full name or the name after the prefix. Raises ElementError."""
        for candidate in (name, join_name(self.prefix, "", name)):
            if candidate in self._places:
                return self._places[candidate]
        raise ElementError(f"no element '{name}'{self._hint(name)}")

    def select(self, name: str) -> list[int]:
        """Return an element, or every element of a namespace; all for `/` or an empty name. Raises ElementError."""
        if not name.strip("/"):
            return list(range(len(self.elements)))
        fulls = (join_name("", "", name), join_name(self.prefix, "", name))
        if any(letter in name for letter in "*?["):
            matching = [place for other, place in self._places.items() if any(fnmatchcase(other, f) for f in fulls)]
            if matching:
                return matching
        for full in fulls:
            if full in self._places:
                return [self._places[full]]
            inside = [place for other, place in self._places.items() if other.startswith(full + "/")]
            if inside:
                return inside
        raise ElementError(f"no element or namespace '{name}'{self._hint(name)}")

    def named(self, name: str) -> Element | None:
        """The element whose name ends so, also one that waits for `adopt`."""
        ending = f"/{name}"
        return next((one for one in (*self.elements, *self.pending) if one.info.name.endswith(ending)), None)

    def _hint(self, name: str) -> str:
        if any(element.info.name.endswith(name) for element in self.pending):
            return "; it was added after the last update(): call update() first"
        return hint(name, self.prefix, [*self._places, *(element.info.name for element in self.pending)])

    def change(self, changes: Mapping[int, ElementOptions]) -> int:
        """Give elements new options, all or none. Returns how many differ; the revision grows if any does."""
        changed = {
            place: checked(self.elements[place].info.name, options)
            for place, options in changes.items()
            if options != self.elements[place].info.options
        }
        if changed:
            elements = list(self.elements)
            for place, options in changed.items():
                element = elements[place]
                elements[place] = Element(msgspec.structs.replace(element.info, options=options), element.parts)
            self.elements = tuple(elements)
            self.revision += 1
        return len(changed)

    def set_all(self, options: Sequence[ElementOptions]) -> int:
        """Give the whole table new options, in its order."""
        return self.change(dict(enumerate(options)))

    def problems(self, edits: Iterable[Edit]) -> list[Problem]:
        """Why edits from outside can't be applied, one per field; empty when they can."""
        return edit_problems(edits, self._places)

    def apply(self, edits: Iterable[Edit]) -> int:
        """Apply edits without `problems`. Returns how many elements changed."""
        return self.change({self._places[edit.name]: edit.options for edit in edits})


def hint(name: str, prefix: str, names: Iterable[str]) -> str:
    """Which element was meant by a name that none has, or how many there are."""
    from difflib import get_close_matches

    # without the prefix, which would make all names alike
    bare = {full.removeprefix(f"{prefix}/"): full for full in names}
    asked = join_name("", "", name).removeprefix(f"{prefix}/").lstrip("/")
    near = get_close_matches(asked, bare, 1, 0.6) or [
        one for one in bare if asked.lower() in (one.lower(), one.rsplit("/", 1)[-1].lower())
    ]
    return f"; did you mean '{bare[near[0]]}'?" if near else f"; the table has {len(bare)} elements"

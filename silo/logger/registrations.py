"""The element table: what is registered, under which name, with which options. Its owner does the locking."""

import logging
from collections.abc import Iterable, Mapping

import msgspec

from silo.core.elements import Edit, ElementInfo, ElementOptions, Problem
from silo.core.names import Names, did_you_mean, is_glob
from silo.core.quantities.writing import many
from silo.core.units import doubt
from silo.errors import ElementError
from silo.loop.plan import Element
from silo.settings.options import checked, edit_problems

log = logging.getLogger("silo")


class Registrations:
    """Elements in the order of registration. What was added waits in `pending` until `adopt`."""

    def __init__(self, prefix: str) -> None:
        self.prefix = prefix
        self.revision = 0
        self.pending: list[Element] = []
        self.elements: tuple[Element, ...] = ()
        self._known = Names((), prefix)
        self._names: set[str] = set()
        self._entry_names: set[str] = set()
        self._doubted: set[str] = set()  # units of which was told

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
            self._known = Names((element.info.name for element in self.elements), self.prefix)
            self.revision += 1

    def remove(self, name: str) -> int:
        """Forget an element or a namespace, also what waits for `adopt`. Returns how many there were.

        Raises ElementError for a name that nothing has. The others keep their order.
        """
        known = Names((element.info.name for element in (*self.elements, *self.pending)), self.prefix)
        gone = {known.names[place] for place, _ in known.find(name)}
        if not gone:
            raise ElementError(f"no element or namespace '{name}'{self._hint(name)}")
        for element in [*self.elements, *self.pending]:
            if element.info.name in gone:
                self._names.discard(element.info.name)
                self._entry_names -= {element.info.name + entry.suffix for entry in element.info.entries}
        kept = tuple(element for element in self.elements if element.info.name not in gone)
        self.pending = [element for element in self.pending if element.info.name not in gone]
        if len(kept) < len(self.elements):
            self.elements = kept
            self._known = Names((element.info.name for element in kept), self.prefix)
            self.revision += 1
        return len(gone)

    def release(self) -> None:
        """Let go of the variables, so that the program may resize or close what holds them. The rows stay."""
        self.elements = tuple(Element(element.info, ()) for element in self.elements)
        self.pending = []

    @property
    def state(self) -> tuple[tuple[Element, ...], int]:
        """The elements and the revision, as they are put back where a change comes to nothing."""
        return self.elements, self.revision

    @state.setter
    def state(self, state: tuple[tuple[Element, ...], int]) -> None:
        self.elements, self.revision = state

    @property
    def infos(self) -> list[ElementInfo]:
        """The rows of the table."""
        return [element.info for element in self.elements]

    @property
    def all_infos(self) -> list[ElementInfo]:
        """The rows of the table, and of what waits for `adopt`."""
        return [element.info for element in (*self.elements, *self.pending)]

    def unit(self, name: str, given: str) -> str:
        """Return the unit of a new element or derived signal; each that silo doesn't know is told once."""
        unit = given.strip() or "-"
        wrong = doubt(unit)
        if wrong and unit not in self._doubted:
            self._doubted.add(unit)
            log.warning("element '%s': %s; it is taken as given, and the next release will refuse it", name, wrong)
        return unit

    def has(self, name: str) -> bool:
        """Whether an element has this name, by the rule of `silo.core.names`."""
        return len(self._known.find(name, namespaces=False)) == 1

    def place(self, name: str) -> int:
        """Return where an element stands. Raises ElementError where there is none, or several may be meant."""
        found = self._known.find(name, namespaces=False)
        if len(found) > 1:
            raise ElementError(self._known.several(name, found))
        if not found:
            raise ElementError(f"no element '{name}'{self._hint(name)}")
        return found[0][0]

    def select(self, name: str) -> list[int]:
        """Return every element that a name or a pattern means; all for `/` or an empty name. Raises ElementError."""
        found = self._known.find(name)
        if is_glob(name) and (before := self._known.whole(name)) and before != found:
            log.warning(
                "'%s' means %d elements here, and behind every '/' from the next release on (%d): write '%s' for the "
                "former", name, len(before), len(found), self._known.keys(name)[1],
            )  # fmt: skip
            found = before
        if not found and name.strip("/"):
            raise ElementError(f"no element or namespace '{name}'{self._hint(name)}")
        return [place for place, _ in found]

    def named(self, name: str) -> Element | None:
        """The element whose name ends so, also one that waits for `adopt`."""
        ending = f"/{name}"
        return next((one for one in (*self.elements, *self.pending) if one.info.name.endswith(ending)), None)

    def _hint(self, name: str) -> str:
        if any(element.info.name.endswith(name) for element in self.pending):
            return "; it was added since: the next start takes it in, and update() does while the logger stands still"
        near = self._known.near(name, 1, more=[element.info.name for element in self.pending])
        return did_you_mean(near, f"the table has {many(len(self._known.names), 'element')}")

    def change(self, changes: Mapping[int, ElementOptions], *, by_client: bool = False) -> int:
        """Give elements new options, all or none. Returns how many differ; the revision grows if any does.

        What the program itself gives is no client's change any more.
        """
        changed = {
            place: checked(self.elements[place].info.name, options)
            for place, options in changes.items()
            if options != self.elements[place].info.options
        }
        if changed:
            elements = list(self.elements)
            for place, options in changed.items():
                element = elements[place]
                given = (element.given or element.info.options) if by_client else None
                info = msgspec.structs.replace(element.info, options=options)
                elements[place] = Element(info, element.parts, given if given != options else None)
            self.elements = tuple(elements)
            self.revision += 1
        return len(changed)

    @property
    def given(self) -> dict[str, ElementOptions]:
        """The options that the program gave, by name, of elements that have others now by a client's wish."""
        return {element.info.name: element.given for element in self.elements if element.given is not None}

    def problems(self, edits: Iterable[Edit]) -> list[Problem]:
        """Why edits from outside can't be applied, one per field; empty when they can."""
        return edit_problems(edits, self._known.places)

    def apply(self, edits: Iterable[Edit], *, by_client: bool = False) -> int:
        """Apply edits without `problems`. Returns how many elements changed."""
        return self.change({self._known.places[edit.name]: edit.options for edit in edits}, by_client=by_client)

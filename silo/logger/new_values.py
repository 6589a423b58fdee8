"""`read_new_values`: what came since the last call, per element."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from silo.core.calls import no_attribute
from silo.errors import ArgumentError, StateError
from silo.loop.run import Run
from silo.segment.layout import ElementSchema
from silo.segment.picking import Packer, shaped
from silo.segment.retention import kept_rows
from silo.segment.rows import Rows

_OTHER_NAMES = {
    "value": "they are .values, oldest first; the newest alone is log['x'].newest",
    "data": "they are .values",
    "newest": "it is .values[-1], or log['x'].newest",
    "time": "it is .time_ns",
    "times": "it is .time_ns",
    "timestamps": "it is .time_ns",
    "lost": "it is .missed",
}


@dataclass(frozen=True)
class NewValues:
    """Samples of one element, oldest first.

    `time_ns` has shape `(n,)`. `values` has shape `(n, *shape)` where all entries have one type, else it is a
    structured array of shape `(n,)` with a field per suffix. `missed` counts samples overwritten before they were read.
    """

    time_ns: NDArray[np.int64]
    values: NDArray[Any]
    missed: int

    def __repr__(self) -> str:
        missed = f", {self.missed} missed" if self.missed else ""
        return f"<NewValues {len(self)} of {self.values.dtype} {self.values.shape[1:]}{missed}>"

    def __len__(self) -> int:
        return len(self.time_ns)

    def __getitem__(self, place: object) -> NoReturn:
        # what unpacking and iterating come to as well
        raise ArgumentError("new values are two arrays: new = log.read_new_values('x'), then new.time_ns, new.values")

    if not TYPE_CHECKING:  # type checkers find it themselves

        def __getattr__(self, name: str) -> NoReturn:
            no_attribute("new values", name, type(self), _OTHER_NAMES)


class NewValuesReader:
    """Remembers up to where each element of a run was read."""

    def __init__(self) -> None:
        self._run = ""
        self._next: dict[str, int] = {}
        self._elements: dict[str, ElementSchema] = {}

    def read(self, run: Run, name: str) -> NewValues:
        """Raise StateError for an element that isn't logged in this run."""
        reader = run.reader
        if run.id != self._run:
            self._run, self._next = run.id, {}
            self._elements = {element.info.name: element for element in reader.schema.elements}
        if name not in self._elements:
            raise StateError(f"element '{name}' is not logged in this run: enable it and start again")
        element = self._elements[name]
        since = self._next.get(name, 0)
        rows = reader.rows(element.ring, since)
        begin, end = kept_rows(element.info.options, rows.first, rows.first + len(rows))
        begin, end = max(begin, since), max(end, since)
        self._next[name] = end
        kept = rows.part(begin, end)
        return NewValues(kept.time_ns.copy(), sample_values(element, kept), begin - since)


def sample_values(element: ElementSchema, rows: Rows) -> NDArray[Any]:
    """Return the samples in rows, shape `(n, *shape)`, or a structured array of shape `(n,)` where types differ."""
    packer = Packer(element.entries, [entry.entry.suffix.removeprefix("_") for entry in element.entries])
    return shaped(packer.of(rows.words), element.info.shape)

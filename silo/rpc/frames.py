"""What a view shows, for those who draw it and know no network."""

import math

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.columns import Floats, Marks
from silo.core.elements import State
from silo.rpc.published import NotLive


class Frame(msgspec.Struct, frozen=True):
    """What a view shows. `held`, `lost`: int64 per element of `elements`; `newest`: float64 per entry of them.

    `entries` names the entries. `texts` holds by position in `newest` each value that a float64 can't tell (see
    `silo.core.arrays.values`). `low` and `high` have shape `(len(plots), count)` and begin at column `first`; they hold
    only what came since the last frame, so merge them with `fmin` and `fmax`, best in a
    `silo.core.arrays.columns.ColumnStore`. They are offsets from `bases` (by place in `plots`), `marks` are bytes of
    their shape or None for none. `missed` counts frames that never arrived, since the view was opened. `since_ns` is 0
    where this frame continues the one before; else its columns are whole from that time on, and the history knows what
    was before. `sizes` are the buffer sizes of the held recording by place in `elements`, where they aren't the
    table's. `failed`: by place in `elements`, at how many ticks an element could not be read, of those that ever
    failed. `not_live`: by place in `elements` why the newest value isn't of now. `unpublished` are those that are off.
    `idle_s`: since the last tick, while it runs.
    """

    elements: tuple[str, ...]
    entries: tuple[str, ...]
    plots: tuple[str, ...]
    unpublished: frozenset[str]
    missing: frozenset[str]
    time_ns: int
    tick: int
    state: State
    measured_hz: float
    lost_total: int
    held: NDArray[np.int64]
    lost: NDArray[np.int64]
    newest: Floats
    texts: dict[int, str]
    column_ns: int
    first: int
    low: Floats
    high: Floats
    marks: Marks | None
    bases: dict[int, int]
    since_ns: int
    sizes: dict[int, int]
    missed: int
    failed: dict[int, int] = msgspec.field(default_factory=dict)
    not_live: dict[int, NotLive] = msgspec.field(default_factory=dict)
    idle_s: float = 0.0

    @property
    def running(self) -> bool:
        """Whether the logger collects."""
        return self.state is State.RUNNING

    def exact(self, place: int, dtype: str) -> float | int | str | bool:
        """Return a newest value of that type as JSON has it: integers and truth values as such, whatever the frame
        carries.
        """
        value, word, kind = float(self.newest[place]), self.texts.get(place), dtype.lstrip("<|>=")[0]
        if kind in "iu" and word is not None:
            return int(word)  # the digits of an integer that a float can't hold
        if word is not None or not math.isfinite(value) or kind not in "iub":
            return value if word is None else word
        return bool(value) if kind == "b" else int(value)

"""Where plots get their data: a live logger, or a recording. The monitor knows only this."""

from collections.abc import Awaitable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.columns import HistoryColumns
from silo.core.elements import ElementInfo, LoggedEvent

if TYPE_CHECKING:
    from silo.expressions.search import FoundMoments, Looking
    from silo.expressions.span import Between

Samples: TypeAlias = tuple[NDArray[np.int64], NDArray[Any]]  # time stamps in ns and values, both of shape `(n,)`


def entry_samples(time_ns: NDArray[np.int64], values: NDArray[Any]) -> Samples:
    """Return samples of an entry, its values of shape `(n,)`: its name may be that of an array of one value."""
    return time_ns, values.reshape(len(values)) if values.size == len(values) else values


class PlotSource(Protocol):
    """What a monitor screen needs of its data."""

    @property
    def live(self) -> bool:
        """Whether time goes on by itself."""

    @property
    def end_ns(self) -> int:
        """The newest moment that there is."""

    @property
    def begin_ns(self) -> int:
        """The oldest moment worth to look at; 0 where unknown."""

    @property
    def happened(self) -> Sequence[LoggedEvent]:
        """What happened on the clock of these data, oldest first."""

    def element(self, name: str) -> ElementInfo | None:
        """Return the element of that name."""

    def period_ns(self, element: str) -> int:
        """Return the time between two samples of an element."""

    def is_live(self, element: str) -> bool:
        """Return whether the element has data to plot (a live logger's may be off)."""

    def history(self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int) -> Awaitable[HistoryColumns]:
        """Return columns of a stretch of time, at most 4096."""

    def samples(self, name: str, start_ns: int, end_ns: int) -> Awaitable[Samples]:
        """Return all samples of an entry from `start_ns` to `end_ns`, both included, oldest first.

        The values are of the entry's own type. Empty where there is none. A live source raises a SiloError where the
        logger doesn't answer.
        """


class HeldRows(PlotSource, Protocol):
    """A source that stands still: all that is held of some signals can be looked through."""

    def find(
        self, looking: "Mapping[str, Looking]", around_ns: int, most: int
    ) -> "Awaitable[tuple[dict[str, FoundMoments], str]]":
        """Look for moments in all samples of entries, and return why some could not be looked through."""

    def measure(self, names: Sequence[str], a_ns: int, b_ns: int) -> "Awaitable[tuple[dict[str, Between], str]]":
        """Measure entries between two moments, and return of what the facts are where these aren't all samples."""

"""A live logger as a source of plots: columns and samples straight from its buffers."""

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from silo.core.arrays.columns import MAX_COLUMNS, HistoryColumns
from silo.core.elements import ElementInfo, LoggedEvent
from silo.errors import RefusedError
from silo_tui.model.drawing.columns import ColumnStore
from silo_tui.model.lists.happened import of_last_run
from silo_tui.model.samples.source import Samples, entry_samples
from silo_tui.sessions.link import Link
from silo_tui.sessions.live import Session

if TYPE_CHECKING:
    from silo.client.client import Client

MAX_HISTORY_NAMES = 64
AHEAD_NS = 2_000_000_000


async def in_pieces(
    link: Link, names: Sequence[str], column_ns: int, ask: Callable[["Client", Sequence[str]], HistoryColumns]
) -> HistoryColumns:
    """Return columns of any number of entries, asked for in pieces as large as a logger answers."""
    store: ColumnStore | None = None
    until: int | None = None
    for begin in range(0, len(names), MAX_HISTORY_NAMES):
        some = list(names[begin : begin + MAX_HISTORY_NAMES])
        past = await link.read(functools.partial(_called, ask, some))
        if store is None:
            store = ColumnStore(names, max(1, past.low.shape[1]), column_ns)
            until = past.until_ns
        store.take(past)
    if store is None:
        empty = np.zeros((0, 0))
        return HistoryColumns((), 0, column_ns, empty, empty)
    return store.stretch(until)


def _called(
    ask: Callable[["Client", Sequence[str]], HistoryColumns], names: Sequence[str], client: "Client"
) -> HistoryColumns:
    return ask(client, names)


class LiveSource:
    """A live logger as a source of plots."""

    live = True
    begin_ns = 0

    def __init__(self, session: Session) -> None:
        self._session = session

    @property
    def happened(self) -> Sequence[LoggedEvent]:
        """What happened in the newest run."""
        return of_last_run(self._session.happened)

    @property
    def end_ns(self) -> int:
        """The time of the newest frame, or of the last tick."""
        status = self._session.status
        running = self._session.running and self._session.frame_time_ns
        return self._session.frame_time_ns if running else (status.last_tick_ns or self._session.frame_time_ns)

    def element(self, name: str) -> ElementInfo | None:
        """Return the element of that name."""
        row = self._session.table.row(name)
        return self._session.table.elements[row] if row is not None else None

    def period_ns(self, element: str) -> int:
        """Return the time between two samples."""
        row = self._session.table.row(element)
        divider = int(self._session.table.server[1, row]) if row is not None else 1
        return int(1e9 * divider / (self._session.status.frequency_hz or 1.0))

    def is_live(self, element: str) -> bool:
        """Return whether the element is on."""
        row = self._session.table.row(element)
        return row is not None and self._session.table.is_live(row)

    async def history(self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int) -> HistoryColumns:
        """Return columns straight from the logger's buffers.

        What came after `end_ns` until the logger answers is in it too: frames that a new view brings go on from there.
        """
        if end_ns <= start_ns:
            names = ()
        ahead = min(AHEAD_NS, (MAX_COLUMNS - 2) * column_ns - (end_ns - start_ns))
        asked = end_ns + max(0, ahead) if end_ns >= self.end_ns else end_ns

        def ask(client: "Client", some: Sequence[str]) -> HistoryColumns:
            return client.history(some, start_ns, asked, column_ns)

        past = await in_pieces(self._link, names, column_ns, ask)
        newest = end_ns if past.until_ns is None else max(end_ns, min(asked, past.until_ns))
        count = max(0, newest // column_ns + 1 - past.first)
        marks = None if past.marks is None else past.marks[:, :count]
        return replace(past, low=past.low[:, :count], high=past.high[:, :count], marks=marks)

    async def samples(self, name: str, start_ns: int, end_ns: int) -> Samples:
        """Return raw samples straight from the logger's buffers."""
        found = await self._link.read(lambda client: client.samples([name], start_ns, end_ns + 1))
        return entry_samples(found[name].time_ns, found[name].values)

    @property
    def _link(self) -> Link:
        if self._session.link is None:
            raise RefusedError(f"not connected to {self._session.name} yet")
        return self._session.link

"""Holding the picture: what is plotted is pinned in the helper process and fetched, as long as one looks at it.

`Pause` has the logic, the screen its keys: it calls `hold`, awaits `fetch` in a worker, and `release`s.
"""

import asyncio
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from silo.columns import ColumnStore, HistoryColumns
from silo.errors import RefusedError, SiloError
from silo.model import BufferType
from silo_tui.model import text
from silo_tui.model.pinned import PinnedSource
from silo_tui.model.plots import Plotted
from silo_tui.model.source import PlotSource, Samples
from silo_tui.sessions.link import Link
from silo_tui.sessions.live import Session, in_pieces

if TYPE_CHECKING:
    from silo.ipc.client import Client
    from silo.ipc.samples import Pin

REPLY_BYTES = 2**18  # on a thin link a key gets its turn after half a minute at most


class _LinkPin:
    """A pin of a helper process, read over the link of a session."""

    def __init__(self, link: Link, pin: "Pin") -> None:
        self._link = link
        self._pin = pin

    async def columns(self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int) -> HistoryColumns:
        """Return columns of what is pinned."""

        def ask(client: "Client", some: Sequence[str]) -> HistoryColumns:
            return client.history(some, start_ns, end_ns, column_ns, self._pin)

        return await in_pieces(self._link, names, column_ns, ask)

    async def samples(self, names: Sequence[str], start_ns: int, end_ns: int) -> dict[str, Samples]:
        """Return samples of what is pinned."""
        found = await self._link.read(
            lambda client: client.samples(names, start_ns, end_ns, pin=self._pin, reply_bytes=REPLY_BYTES)
        )
        return {name: (some.time_ns, some.values) for name, some in found.items()}


class Pause:
    """Of one monitor. Lives in the event loop."""

    def __init__(self, session: Session, live: PlotSource, changed: Callable[[], None]) -> None:
        """`changed` is called when more is here."""
        self._session = session
        self._live = live
        self._changed = changed
        self._pin: Pin | None = None
        self.note = ""  # what could not be had
        self._since_s = 0.0
        self.source: PinnedSource | None = None
        self._settled = asyncio.Event()
        self._settled.set()

    async def settled(self) -> None:
        """Wait until it is known what is pinned, or that nothing is."""
        await self._settled.wait()

    @property
    def possible(self) -> bool:
        """Whether there is anything that goes on by itself."""
        return self._live.live

    @property
    def text(self) -> str:
        """How much is held; empty while nothing is."""
        if self.source is None:
            return ""
        return f"{self.source.text}; {self.note}" if self.note else self.source.text

    @property
    def head(self) -> str:
        """For the head of the screen: `PAUSED 12 s ago, 41 s held`; empty while nothing is held."""
        if self.source is None:
            return ""
        ago = text.span(float(f"{max(0.0, time.monotonic() - self._since_s):.0f}"))
        return f"PAUSED {ago} ago, {self.source.held_text} held"

    def held_ns(self, plots: Sequence[Plotted]) -> tuple[int, int]:
        """The oldest and the newest moment that can be looked at: of what is held, or of the logger's buffers."""
        if self.source is not None:
            return self.source.begin_ns, self.source.end_ns
        newest_ns, started_ns = self._live.end_ns, self._session.status.started_ns
        spans = [0]
        for element in {plotted.element.name: plotted.element for plotted in plots}.values():
            loops = element.options.buffer_type is BufferType.LOOPING
            period_ns = self._live.period_ns(element.name)
            spans.append(element.options.buffer_size * period_ns if loops else newest_ns - started_ns)
        return max(started_ns, newest_ns - max(spans)), newest_ns

    def hold(self, plots: Sequence[Plotted], end_ns: int, span_ns: int, shown: ColumnStore) -> PinnedSource:
        """Hold the picture that ends there, and what was before it for at least as long."""
        self.release()
        self._settled.clear()
        self._since_s = time.monotonic()
        plots = [plotted for plotted in plots if self._live.is_live(plotted.element.name)]
        self.source = PinnedSource(self._live, plots, end_ns - 2 * span_ns, end_ns, shown)
        return self.source

    async def fetch(self, column_ns: int, span_ns: int) -> None:
        """Have the logger pin it; then fetch columns of all, samples of the picture, and the rest if quick."""
        try:
            opened = await self._open()
        finally:
            self._settled.set()
        source = self.source
        if not opened or source is None:
            return
        await source.fetch_columns(column_ns)
        self._changed()
        await source.fetch(source.end_ns - span_ns, source.end_ns)
        self._changed()
        while self.source is source and await source.fetch_rest():
            self._changed()

    async def _open(self) -> bool:
        """Have the logger pin it; False where there is nothing to fetch."""
        source, link = self.source, self._session.link
        if source is None or link is None or not source.names:
            return False
        names, start_ns, end_ns = list(source.names), source.begin_ns, source.end_ns
        try:
            pin = await link.read(lambda client: client.pin(names, start_ns, end_ns))
        except SiloError as error:
            source.problem = "nothing is pinned: " + (str(error) if isinstance(error, RefusedError) else "no link")
            self._changed()
            return False
        if self.source is not source:
            pin.close()
            return False
        self._pin = pin
        if not pin.opened.run:
            source.problem = "the logger holds nothing of it"
            return False
        source.opened(_LinkPin(link, pin), pin.opened.begin_ns, pin.opened.end_ns)
        self.note = pin.opened.text
        self._changed()
        return True

    async def look(self, start_ns: int, end_ns: int) -> None:
        """Fetch the samples of what is looked at now; after a link that was lost too."""
        source = self.source
        if source is None:
            return
        if self._pin is not None and self._session.connected and not self._pin.refused:
            source.problem = ""
        await source.fetch(start_ns, end_ns)
        self._changed()

    def release(self) -> None:
        """Let go of what is held."""
        pin, self._pin, self.source, self.note = self._pin, None, None, ""
        self._settled.set()
        if pin is not None:
            pin.close()

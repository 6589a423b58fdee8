"""Holding the picture: what is plotted is pinned in the helper process and fetched, as long as one looks at it.

`Pause` has the logic, the screen its keys: it calls `hold`, awaits `fetch` in a worker, and `release`s.
"""

import asyncio
import time
from collections.abc import Callable, Sequence
from typing import cast

from silo.core.arrays.columns import ColumnStore
from silo.core.elements import BufferType
from silo.errors import RefusedError, SiloError
from silo_tui.model.drawing.plots import Plotted
from silo_tui.model.drawing.window import SECOND_NS, SPANS_S
from silo_tui.model.samples.source import HeldRows
from silo_tui.model.words import text
from silo_tui.sessions.held import HeldSource
from silo_tui.sessions.live import Session
from silo_tui.sessions.pinned import Buffers

PINNED_BYTES = 16 * 2**20  # of what was before the picture: all clients of a helper process share 64 MB


class Pause:
    """Of one monitor. Lives in the event loop."""

    def __init__(self, session: Session, changed: Callable[[], None]) -> None:
        """`changed` is called when more is here."""
        self._session = session
        self._live = session.source
        self._changed = changed
        self.note = ""  # what could not be had
        self._since_s = 0.0
        self.source: HeldSource | None = None
        self._deep_ns = 0  # how much is pinned at once
        self._unreached = False  # nothing could be pinned, because nobody answered
        self._settled = asyncio.Event()
        self._settled.set()

    def tell(self, changed: Callable[[], None]) -> None:
        """Call this from now on when more is here."""
        self._changed = changed

    async def settled(self) -> None:
        """Wait until it is known what is pinned, or that nothing is."""
        await self._settled.wait()

    @property
    def possible(self) -> bool:
        """Whether there is anything that goes on by itself."""
        return self._live.live

    @property
    def held(self) -> HeldRows:
        """What is held, and the logger's buffers behind it; of a file all."""
        held = self.source or self._live
        if held.live:
            raise RefusedError("nothing is held: space holds the picture")
        return cast(HeldRows, held)

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
        ago = text.span(max(1, round(time.monotonic() - self._since_s)))
        held = self.source.held_text
        return f"PAUSED {ago} ago, {held} held" if held else f"PAUSED {ago} ago"

    def held_ns(self, plots: Sequence[Plotted]) -> tuple[int, int]:
        """The oldest and the newest moment that can be looked at: held or drawn, in a file, or surely in the buffers.

        These have room for more than they were asked to hold.
        """
        if self.source is not None:
            return self.source.drawn_ns, self.source.end_ns
        if not self.possible:
            return self._live.begin_ns, self._live.end_ns
        newest_ns, started_ns = self._live.end_ns, self._session.status.started_ns
        spans = [0]
        for element in {plotted.element.name: plotted.element for plotted in plots}.values():
            loops = element.options.buffer is BufferType.LOOPING
            period_ns = self._live.period_ns(element.name)
            spans.append(element.options.size * period_ns if loops else newest_ns - started_ns)
        return max(started_ns, newest_ns - max(spans)), newest_ns

    def hold(
        self, plots: Sequence[Plotted], end_ns: int, span_ns: int, shown: ColumnStore, newest_ns: int = 0
    ) -> HeldSource:
        """Hold the picture that ends there, and what was before it: for at least as long, and as the buffers have it.

        `newest_ns` is now, where the picture is an earlier one.
        """
        self.release()
        self._settled.clear()
        self._unreached = False
        self._since_s = time.monotonic()
        plots = [plotted for plotted in plots if self._live.is_live(plotted.element.name)]
        buffers = Buffers(self._session) if self._session.link is not None else None
        elements = {plotted.element.name: plotted.element for plotted in plots}
        bytes_s = sum(
            (16 + 8 * len(one.entries)) * SECOND_NS / self._live.period_ns(name) for name, one in elements.items()
        )
        self._deep_ns = round(min(SPANS_S[-1], PINNED_BYTES / max(1, bytes_s)) * SECOND_NS)
        self.source = HeldSource(self._live, plots, (end_ns - 2 * span_ns, end_ns), newest_ns, shown, buffers)
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
        main = source.main
        await main.fetch_columns(column_ns)
        self._changed()
        await main.fetch(main.end_ns - span_ns, main.end_ns)
        self._changed()
        while self.source is source and await main.fetch_rest():
            self._changed()
        for piece in source.pieces:
            if piece is not main:
                await piece.fetch_columns(column_ns)
                if main.complete and piece.held_s <= main.held_s:  # it comes as quickly
                    await piece.fetch(piece.begin_ns, piece.end_ns)
                self._changed()

    async def _open(self) -> bool:
        """Have the logger pin it; False where there is nothing to fetch."""
        source = self.source
        if source is None or self._session.link is None or not source.names:
            return False
        try:
            note = await source.open()
            # at once: a window that is wider later asks for what is overwritten by then
            note = await source.cover(source.end_ns - self._deep_ns, source.end_ns) or note
        except SiloError as error:
            self._unreached = not isinstance(error, RefusedError)
            source.main.unpinned("nothing is pinned: " + ("no link" if self._unreached else str(error)))
            self._changed()
            return False
        if self.source is not source:
            source.close()
            return False
        self.note, self._unreached = note, False
        self._changed()
        return not source.main.problem

    async def look(self, start_ns: int, end_ns: int, column_ns: int) -> None:
        """Pin and fetch what is looked at now, as far as the logger has it still; after a link that was lost too."""
        await self.settled()
        source = self.source
        if source is None:
            return
        if self._session.connected:
            source.mended()
            if self._unreached or not (source.pinned or source.main.problem):
                await self._open()
        before = source.pieces
        span_ns = end_ns - start_ns
        if not (source.covers(start_ns) and source.covers(end_ns)):
            # a window more: who goes back mostly goes on
            told = await source.cover(start_ns - span_ns, min(end_ns, source.end_ns))
            self.note = told or self.note
        for piece in source.pieces:
            if piece not in before:
                await piece.fetch_columns(column_ns)
        self._changed()
        await source.fetch(start_ns, end_ns)
        self._changed()

    async def bring(self, time_ns: int, around_ns: int) -> bool:
        """Have a moment pinned; False where neither pins nor the logger's buffers hold it any more."""
        await self.settled()
        if not self.possible:
            return self._live.begin_ns <= time_ns <= self._live.end_ns
        return self.source is not None and await self.source.bring(time_ns, around_ns)

    def release(self) -> None:
        """Let go of what is held."""
        source, self.source, self.note = self.source, None, ""
        self._settled.set()
        if source is not None:
            source.close()

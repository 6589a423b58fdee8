# ruff: noqa: D102 - what a command does stands in actions.py, once
"""Holding the plots of a logger: what is on the screen is pinned, fetched, looked at, and let go again."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from silo.errors import SiloError
from silo_tui.modal import run_alone
from silo_tui.model.live import Reading
from silo_tui.model.recorded import SHORT_SPANS_S
from silo_tui.model.searching import reading_of
from silo_tui.model.window import SPANS_S

if TYPE_CHECKING:
    from silo_tui.screens.monitor import MonitorScreen


class Holder:
    """The pause of a monitor."""

    def __init__(self, screen: "MonitorScreen") -> None:
        self.screen = screen

    def pause_here(self) -> None:
        """Hold the rows before they are looked through: a logger that goes on overwrites them."""
        if self.screen.pause.source is None:
            self.command_pause()

    def command_pause(self) -> None:
        """Hold what is on the screen, with as much before it; or go on."""
        if not self.screen.pause.possible:
            return
        if self.screen.pause.source is not None:
            self.go_on()
            return
        newest_ns = self.screen.live_source.end_ns if self.screen.window.paused else 0  # looking back, time goes on
        self.screen.stand_still()
        store, span_ns = self.screen.stack.store, self.screen.window.span_ns
        held = self.screen.pause.hold(self.screen.pinned_plots, self.screen.end_ns, span_ns, store, newest_ns)
        self.screen.source = self.screen.stack.source = held
        self.screen.window.spans = (*SHORT_SPANS_S, *SPANS_S)
        run_alone(self.screen, "pause", self.screen.pause.fetch, store.column_ns, span_ns)
        self.screen.more_is_here()
        self.screen.request_view()

    def go_on(self) -> None:
        """Show what comes again."""
        self.screen.pause.release()
        self.screen.source = self.screen.stack.source = self.screen.live_source
        self.screen.window.go_on()
        self.screen.finder.found = None
        self.screen.show_between()
        self.screen.more_is_here()
        self.screen.request_view()

    async def look(self) -> None:
        """Pin and fetch what is on the screen; where its rows are gone by now, show the oldest that there are."""
        window, columns = self.screen.window, self.screen.stack.columns
        start_ns, end_ns = self.screen.shown_ns
        await self.screen.pause.look(start_ns, end_ns, window.column_ns(columns))
        source = self.screen.pause.source
        if source is None:
            return
        if window.at_ns is not None and window.at_ns < source.begin_ns:
            window.at_ns = source.begin_ns
        half_empty = (
            start_ns + window.column_ns(columns) < source.begin_ns and end_ns - source.begin_ns < window.span_ns // 2
        )
        if half_empty:  # a window wider than all that is held stays where it is
            window.show(end_ns, self.screen.held_ns, columns)
            if window.paused_end_ns != end_ns:
                self.screen.moved()

    async def read(self) -> None:
        readings = await self.readings_here()
        if self.screen.window.paused:
            self.screen.stack.readings = readings
            self.screen.stack.bounds = self.screen.session.bounds
            self.screen.stack.redraw()

    async def readings_here(self) -> Mapping[str, Reading]:
        """Return what held at the cursor, or at the right end of the window; nothing of what can't be had."""
        if not self.screen.window.paused or self.screen.file is not None:
            return self.screen.session.live.readings
        await self.screen.pause.settled()
        at_ns = self.screen.now_ns if self.screen.window.cursor is not None else self.screen.end_ns
        plots = (
            *self.screen.stack.on_screen(),
            *self.screen.stack.plots[self.screen.stack.chosen : self.screen.stack.chosen + 1],
        )
        shown = {plotted.element.name: plotted.element for plotted in plots}
        try:
            if self.screen.pause.source is not None:
                return await self.screen.pause.source.readings(list(shown), at_ns)
            return {name: await reading_of(self.screen.live_source, element, at_ns) for name, element in shown.items()}
        except SiloError:
            return {}

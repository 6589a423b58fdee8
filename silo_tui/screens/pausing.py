"""Holding the plots of a logger: what is on the screen is pinned, fetched, looked at, and let go again."""

from collections.abc import Sequence

from silo.errors import RefusedError, SiloError
from silo_tui.modal import run_alone
from silo_tui.model.live import Reading
from silo_tui.model.plots import SPANS_S, Plotted
from silo_tui.model.recorded import SHORT_SPANS_S
from silo_tui.model.searching import reading_of
from silo_tui.model.source import HeldRows, PlotSource
from silo_tui.screens.arranging import Arranging
from silo_tui.widgets.bars import StatusBar


class Pausing(Arranging):
    """The pause of a monitor."""

    _live: PlotSource  # what it shows when nothing is held

    @property
    def status_bar(self) -> StatusBar:
        """The line on top."""
        raise NotImplementedError

    async def _look(self) -> None:
        """Pin and fetch what is on the screen; where its rows are gone by now, show the oldest that there are."""
        start_ns, end_ns = self._shown_ns
        await self.pause.look(start_ns, end_ns, self._column_ns)
        source, at_ns = self.pause.source, self._at_ns
        if source is None:
            return
        if at_ns is not None and at_ns < source.begin_ns:
            self._at_ns = source.begin_ns
        half_empty = (
            start_ns + self._column_ns < source.begin_ns and end_ns - source.begin_ns < self.window.span_ns // 2
        )
        if half_empty and self._edge_at(end_ns) != end_ns:  # a window wider than all that is held stays where it is
            self._show(end_ns)

    @property
    def held(self) -> HeldRows:
        """What the pause holds, and the logger's buffers behind it."""
        if self.pause.source is None:
            raise RefusedError("nothing is held: space holds the picture")
        return self.pause.source

    async def bring(self, time_ns: int) -> bool:
        """Have a moment pinned, with a window around it."""
        return await self.pause.bring(time_ns, self.window.span_ns)

    def _moment_shown(self) -> None:
        """Read the values of what stands still: those at the cursor, or at the right end."""
        if self.window.paused and self._live.live:
            run_alone(self, "moment", self._read_moment)

    async def _read_moment(self) -> None:
        readings = await self._readings_here()
        if self.window.paused:
            self.stack.readings = readings
            self.stack.bounds = self.session.bounds
            self.stack.redraw()

    async def _readings_here(self) -> dict[str, Reading]:
        """Return what held at the cursor, or at the right end of the window; nothing of what can't be had."""
        if not self.window.paused:
            return self.session.live.readings
        await self.pause.settled()
        at_ns = self._at_ns if self._at_ns is not None and self.window.cursor is not None else self._end_ns
        plots = (*self.stack.on_screen(), *self.stack.plots[self.stack.chosen : self.stack.chosen + 1])
        shown = {plotted.element.name: plotted.element for plotted in plots}
        try:
            if self.pause.source is not None:
                return await self.pause.source.readings(list(shown), at_ns)
            return {name: await reading_of(self._live, element, at_ns) for name, element in shown.items()}
        except SiloError:
            return {}

    @property
    def _held_ns(self) -> tuple[int, int]:
        """The oldest and the newest moment that one can look at."""
        return self.pause.held_ns(self.stack.plots)

    @property
    def live_source(self) -> PlotSource:
        """What it shows when nothing is held."""
        return self._live

    @property
    def pinned_plots(self) -> Sequence[Plotted]:
        """What a pause holds."""
        return self.stack.plots

    def take_back(self) -> None:
        """Show what the pause holds by now, or what comes: another screen used it meanwhile."""
        self.pause.tell(self._more_is_here)
        self.source = self.stack.source = self.pause.source or self._live
        if self.is_mounted:
            self._more_is_here()
            self._show_moment()
            self.request_view()

    def _more_is_here(self) -> None:
        self.status_bar.mode = self.pause.head
        self.status_bar.update()
        self.line.refresh()

    def command_pause(self) -> None:
        """Hold what is on the screen, with as much before it; or go on."""
        if not self.pause.possible:
            return
        if self.pause.source is not None:
            self._go_on()
            return
        newest_ns = self._live.end_ns if self.window.paused else 0  # looking back, time goes on
        self._stand_still()
        store, end = self.stack.store, self._end_ns
        held = self.pause.hold(self.pinned_plots, end, self.window.span_ns, store, newest_ns)
        self.source = self.stack.source = held
        self.window.spans = (*SHORT_SPANS_S, *SPANS_S)
        run_alone(self, "pause", self.pause.fetch, store.column_ns, self.window.span_ns)
        self._more_is_here()
        self.request_view()

    def _go_on(self) -> None:
        """Show what comes again."""
        self.pause.release()
        self.source = self.stack.source = self._live
        self.window.paused_end_ns = self.window.cursor = self.window.at_ns = self.window.other_ns = None
        self.window.spans = SPANS_S
        self.window.span_s = max(SPANS_S[0], self.window.span_s)
        self._found = None
        self._show_between()
        self._more_is_here()
        self.request_view()

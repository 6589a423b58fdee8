# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The monitor on a file: its window goes over the whole recording, its cursor says what held at a moment."""

from typing import ClassVar

from textual.binding import Binding

from silo_tui.actions import bindings_for
from silo_tui.model import text
from silo_tui.model.columns import ColumnStore
from silo_tui.model.plots import SECOND_NS, PlotWindow
from silo_tui.model.recorded import WHOLE
from silo_tui.screens.file_detail import FileDetailScreen
from silo_tui.screens.monitor import MonitorScreen
from silo_tui.sessions.recorded import FileSession
from silo_tui.widgets.bars import Banner, MonitorLine, StatusBar
from silo_tui.widgets.recorded import FileBanner, FileBar, RecordedLine, RecordedStack


class FileMonitorScreen(MonitorScreen, inherit_bindings=False):
    """Plots of elements of a file. The cursor is a moment of the file, whatever the zoom."""

    scope = "file_monitor"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("file_monitor")

    def __init__(self, session: FileSession, names: list[str]) -> None:
        super().__init__(session, session.source, names)
        self.file = session
        begin, end = session.source.extent_ns(names)
        spans = session.source.spans_s
        fitting = (end - begin) / SECOND_NS * WHOLE  # a looping buffer has the end of a long run only
        span = fitting if spans[0] < fitting < 0.7 * spans[-1] else spans[-1]
        self.window = PlotWindow(span, end, spans=tuple(sorted({*spans, span})))
        self.stack = RecordedStack(session, names, self.window)

    def bars(self) -> tuple[StatusBar, Banner, MonitorLine]:
        """Return facts of the file, what is wrong with it, and the line of facts."""
        return FileBar(self.file), FileBanner(self.file), RecordedLine(self.window, self._words)

    def _words(self) -> str:
        clock = f" ({self.file.clock})" if self.file.clock and self.size.width >= 100 else ""
        words = [f"cursor at {self.file.seconds:.9g} s{clock}"]
        total, fitting = len(self.stack.panels), self.stack.fitting
        if total > fitting:
            words.append(f"plots {self.stack.first + 1}-{min(total, self.stack.first + fitting)} of {total}")
        return " │ ".join([*words, *([self._said] if self._said else [])])

    # ------------------------------------------------------------------------------------------------- the window

    @property
    def _column_ns(self) -> int:
        return self.window.column_ns(self.stack.columns)

    @property
    def _end_ns(self) -> int:
        end = self.window.paused_end_ns
        return self.file.source.end_ns if end is None else end

    def request_view(self) -> None:
        """Read what is on the screen; nothing is taken from the last picture, the source keeps what it read."""
        if self.context.upper_screen is not self:
            return
        names = [plotted.name for plotted in self.stack.on_screen() if plotted.numeric]
        columns = self.stack.columns
        store = ColumnStore(names, columns, self.window.column_ns(columns))
        self.run_worker(self._fill(store, names), group="history", exclusive=True)

    async def _fill(self, store: ColumnStore, names: list[str]) -> None:
        await super()._fill(store, names)
        self._show_moment()

    def _show(self, end_ns: int) -> None:
        """Put the right edge of the window there, as far as there is something to see."""
        self.window.paused_end_ns = self.file.source.clamp_end(end_ns, self.window.span_ns - self._column_ns)
        self._show_moment()
        self.request_view()

    def _show_moment(self) -> None:
        """Show the cursor's column in the window that is on the screen, and the values there."""
        store = self.stack.store
        cursor = store.end - 1 - self.file.time_ns // store.column_ns
        self.window.cursor = cursor if 0 <= cursor < self.stack.columns else None
        self.file.read(list(dict.fromkeys(plotted.element.name for plotted in self.stack.on_screen())))
        self.stack.readings = self.file.live.readings
        self.stack.redraw()
        self.line.refresh()

    def _go_to(self, time_ns: int) -> None:
        """Move the cursor to a moment; the window follows when it leaves it."""
        source = self.file.source
        self.file.time_ns = time_ns = max(source.begin_ns, min(time_ns, source.end_ns))
        end, span, column_ns = self._end_ns, self.window.span_ns, self._column_ns
        # in whole columns: where the window begins and ends is between two of them
        if time_ns // column_ns > end // column_ns:
            self._show(max(end + span // 4, time_ns))
        elif time_ns // column_ns <= end // column_ns - self.stack.columns:
            self._show(min(end - span // 4, time_ns + span - column_ns))
        else:
            self._show_moment()

    def _zoom(self, *, closer: bool) -> None:
        """Zoom around the cursor, or around the middle when the cursor is elsewhere."""
        before, end = self.window.span_ns, self._end_ns
        if not self.window.zoom(closer=closer):
            self.say("that is the shortest span" if closer else "that is the whole file")
            return
        seen = self.window.cursor is not None
        fixed = self.file.time_ns if seen else end - before // 2
        self._said = ""
        self._show(fixed + round((end - fixed) * self.window.span_ns / before))

    def _move_cursor(self, cells: int) -> None:
        self._said = ""
        if self.window.cursor is None:  # it is elsewhere: take it here
            self._go_to(self._end_ns - self.window.span_ns // 2)
        else:
            self._go_to(self.file.time_ns + 2 * cells * self._column_ns)

    # --------------------------------------------------------------------------------------------------- commands

    def command_first_plot(self) -> None:
        self.command_plot_top()

    def command_last_plot(self) -> None:
        self.command_plot_bottom()

    def command_earlier(self) -> None:
        self._pan(-1)

    def command_later(self) -> None:
        self._pan(1)

    def _pan(self, direction: int) -> None:
        """Pan by half a window; the cursor stays where it is in the picture."""
        end, seen = self._end_ns, self.window.cursor is not None
        self._show(end + direction * self.window.span_ns // 2)
        moved = self._end_ns - end
        self._said = "" if moved else f"that is the {'end' if direction > 0 else 'beginning'} of the file"
        if seen:
            source = self.file.source
            self.file.time_ns = max(source.begin_ns, min(self.file.time_ns + moved, source.end_ns))
        self.line.refresh()

    def command_file_start(self) -> None:
        self._go_to(self.file.source.begin_ns)

    def command_file_end(self) -> None:
        self._go_to(self.file.source.end_ns)

    def command_whole_file(self) -> None:
        self.window.span_s = self.window.spans[-1]
        self._show(self.file.source.end_ns)

    def command_next_sample(self) -> None:
        self._step(1)

    def command_previous_sample(self) -> None:
        self._step(-1)

    def _step(self, step: int) -> None:
        plotted = self.stack.plots[self.stack.chosen]
        there = self.file.source.neighbour(plotted.name, self.file.time_ns, step)
        if there == self.file.time_ns:
            self.say(f"that is the {'last' if step > 0 else 'first'} sample of {self.file.short_name(plotted.name)}")
        else:
            self._said = ""
            self._go_to(there)

    def command_plot_down(self) -> None:
        super().command_plot_down()
        self._show_moment()

    def command_plot_up(self) -> None:
        super().command_plot_up()
        self._show_moment()

    def command_detail(self) -> None:
        chosen = self.stack.plots[self.stack.chosen]
        plots = [chosen, *(plotted for plotted in self.stack.plots if plotted is not chosen)]
        plots = [plotted for plotted in plots if plotted.numeric]
        if not plots:
            self.say(f"{text.plural(len(self.stack.plots), 'text')}: nothing to draw")
            return
        self.app.push_screen(FileDetailScreen(self.file, plots, self._end_ns, self.window.span_s, self.window.spans))

    def command_back(self) -> None:
        self.context.leave_screen()

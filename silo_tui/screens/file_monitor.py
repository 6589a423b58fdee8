# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The monitor on a file: its window goes over the whole recording, its cursor says what held at a moment."""

from collections.abc import Sequence
from typing import ClassVar

from textual.binding import Binding

from silo_tui.actions import bindings_for
from silo_tui.modal import run_alone
from silo_tui.model.columns import ColumnStore
from silo_tui.model.live import Reading
from silo_tui.model.plots import SECOND_NS, PlotWindow
from silo_tui.model.recorded import WHOLE
from silo_tui.model.source import HeldRows
from silo_tui.screens.monitor import MonitorScreen
from silo_tui.sessions.recorded import FileSession
from silo_tui.widgets.bars import Banner, MonitorLine, StatusBar
from silo_tui.widgets.recorded import RecordedStack


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
        line = MonitorLine(self.window, self._words)
        return StatusBar(self.file, read_only=False), Banner(self.file), line

    def _words(self) -> Sequence[str]:
        clock = f" ({self.file.clock})" if self.file.clock and self.size.width >= 100 else ""
        words = [f"cursor at {self.file.seconds:.9g} s{clock}"]
        total, fitting = len(self.stack.panels), self.stack.fitting
        if total > fitting:
            words.append(f"plots {self.stack.first + 1}-{min(total, self.stack.first + fitting)} of {total}")
        return [*words, *([self._said] if self._said else [])]

    # ------------------------------------------------------------------------------------------------- the window

    @property
    def _at_ns(self) -> int | None:
        """The moment whose values are shown; there always is one."""
        return self.file.time_ns

    @_at_ns.setter
    def _at_ns(self, time_ns: int | None) -> None:
        self.file.time_ns = self.file.time_ns if time_ns is None else time_ns

    def request_view(self) -> None:
        """Read what is on the screen; nothing is taken from the last picture, the source keeps what it read."""
        if self.context.upper_screen is not self:
            return
        names = [plotted.name for plotted in self.stack.on_screen() if plotted.numeric]
        columns = self.stack.columns
        store = ColumnStore(names, columns, self.window.column_ns(columns))
        run_alone(self, "history", self._fill, store, names)

    def _moment_shown(self) -> None:
        """Read the values at the cursor."""
        self.file.read(list(dict.fromkeys(plotted.element.name for plotted in self.stack.on_screen())))
        self.stack.readings = self.file.live.readings
        self.stack.bounds = self.file.bounds

    async def _readings_here(self) -> dict[str, Reading]:
        return self.file.live.readings

    def moment_words(self, time_ns: int) -> str:
        """Return a moment: from the start of the file, and by the clock."""
        return f"{(time_ns - self.file.source.begin_ns) / SECOND_NS:.{self._decimals}f} s{self._clock(time_ns)}"

    def _longest(self) -> str:
        return "that is the whole file"

    def _edge(self, direction: int) -> str:
        return f"that is the {'end' if direction > 0 else 'beginning'} of the file"

    @property
    def _held_ns(self) -> tuple[int, int]:
        """All of the file."""
        return self.file.source.begin_ns, self.file.source.end_ns

    @property
    def held(self) -> HeldRows:
        """The file."""
        return self.file.source

    async def bring(self, time_ns: int) -> bool:
        """Return whether the file has the moment."""
        return self.file.source.begin_ns <= time_ns <= self.file.source.end_ns

    # --------------------------------------------------------------------------------------------------- commands

    def command_all_held(self) -> None:
        self.window.span_s = self.window.spans[-1]
        self._show(self.file.source.end_ns)

    def command_plot_down(self) -> None:
        super().command_plot_down()
        self._show_moment()

    def command_plot_up(self) -> None:
        super().command_plot_up()
        self._show_moment()

    def command_back(self) -> None:
        self.context.leave_screen()

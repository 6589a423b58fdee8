# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The large plot of a file: its time counts from the first time stamp, its window goes over the whole recording."""

from typing import ClassVar

from textual.binding import Binding

from silo_tui.actions import bindings_for
from silo_tui.model import text
from silo_tui.model.plots import SECOND_NS
from silo_tui.screens.detail import LargePlot
from silo_tui.screens.file_monitor import FileMonitorScreen
from silo_tui.widgets.recorded import RecordedStack


class FileDetailScreen(LargePlot, FileMonitorScreen, inherit_bindings=False):
    """A plot of up to eight entries of a file."""

    scope = "file_detail"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("file_detail")

    def __init__(self, monitor: FileMonitorScreen) -> None:
        FileMonitorScreen.__init__(self, monitor.file, [])
        self.share(monitor, RecordedStack(monitor.file, [], monitor.window))

    def _place(self) -> str:
        source = self.file.source
        begin = max(0.0, (self._end_ns - source.begin_ns) / SECOND_NS - self.span_s)
        end = min((source.end_ns - source.begin_ns) / SECOND_NS, begin + self.span_s)
        return f"{begin:.6g} … {end:.6g} s ({text.span(self.span_s)})"

    def command_back(self) -> None:
        self.leave()

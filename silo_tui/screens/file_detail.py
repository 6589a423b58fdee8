# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The detail plot on a file: its time counts from the first time stamp, its window goes over the whole recording."""

from collections.abc import Sequence
from typing import ClassVar

from textual.binding import Binding

from silo_tui.actions import bindings_for
from silo_tui.model import text
from silo_tui.model.plots import SECOND_NS, Plotted
from silo_tui.screens.detail import DetailScreen
from silo_tui.sessions.recorded import FileSession


class FileDetailScreen(DetailScreen, inherit_bindings=False):
    """A plot of up to eight entries of a file."""

    scope = "file_detail"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("file_detail")

    def __init__(
        self,
        session: FileSession,
        plots: Sequence[Plotted],
        end_ns: int,
        span_s: float,
        spans: tuple[float, ...],
        count: int = 1,
    ) -> None:
        super().__init__(session, session.source, plots, end_ns, span_s, count)
        self.file = session
        self.spans = spans

    @property
    def zero_ns(self) -> int:
        """The moment that the axis calls 0."""
        return self.file.source.begin_ns

    def _place(self) -> str:
        end = (self.end_ns - self.file.source.begin_ns) / SECOND_NS
        return f"{max(0.0, end - self.span_s):.6g} … {end:.6g} s ({text.span(self.span_s)})"

    def _show(self, end_ns: int) -> None:
        self.end_ns = self.file.source.clamp_end(end_ns, round(self.span_s * SECOND_NS))
        self.draw_soon()

    def _zoom(self, step: int) -> None:
        spans = self.spans
        middle = self.end_ns - round(self.span_s * SECOND_NS) // 2
        self.span_s = spans[max(0, min(len(spans) - 1, spans.index(self.span_s) + step))]
        self._show(middle + round(self.span_s * SECOND_NS) // 2)

    def command_detail_earlier(self) -> None:
        self._show(self.end_ns - round(self.span_s * SECOND_NS) // 4)

    def command_detail_later(self) -> None:
        self._show(self.end_ns + round(self.span_s * SECOND_NS) // 4)

    def command_file_start(self) -> None:
        self._show(self.file.source.begin_ns)

    def command_file_end(self) -> None:
        self._show(self.file.source.end_ns)

    def command_whole_file(self) -> None:
        self.span_s = self.spans[-1]
        self._show(self.file.source.end_ns)

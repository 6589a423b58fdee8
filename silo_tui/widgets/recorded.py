"""Plots of a file: the drawing of live ones, with what a file says of them."""

import numpy as np

from silo_tui.model.drawing.plots import Plotted
from silo_tui.model.drawing.window import PlotWindow
from silo_tui.model.samples.live import offset_text
from silo_tui.model.words import text
from silo_tui.sessions.recorded import FileSession
from silo_tui.widgets.plot_stack import PlotStack


class RecordedStack(PlotStack):
    """Plots of a file: the value at the cursor, minimum, maximum and mean of the window; the axis counts its time."""

    def __init__(self, session: FileSession, plots: list[Plotted], window: PlotWindow) -> None:
        super().__init__(plots, window, session.source)
        self.prefix = session.status.prefix.rstrip("/")
        self._file = session

    def _facts(self, at: int, plotted: Plotted) -> str:
        store = self.store
        facts = self._file.source.facts(plotted.name, store.end - self.columns, store.end, store.column_ns)
        words = f"= {self.facts.now(plotted)}"
        report = self._file.rows_of[plotted.element.name]
        if not facts.samples and report.start_s is not None and self._file.seconds < report.start_s:
            return f"{words}  begins at {text.short(report.start_s, 6)} s"
        if not facts.samples or self.size.width < 60:
            return words
        ends = [offset_text(plotted.entry, end, facts.base, 12) for end in (facts.smallest, facts.largest)]
        words += f"  {facts.signs}" if facts.signs else ""
        if not facts.finite:
            return words
        if plotted.entry.labels or plotted.entry.dtype[1:2] in "Mm":  # their mean means nothing
            return words + ("" if ends[0] == ends[1] else f"  ({ends[0]} … {ends[1]})")
        if plotted.entry.dtype[1:2] == "b":
            return f"{words}  true {facts.mean:.1%}"
        if facts.base:
            mean = offset_text(plotted.entry, round(facts.mean), facts.base, 12)
            return f"{words}  min {ends[0]}  max {ends[1]}  mean {mean}"
        smallest, largest = text.told_apart(facts.smallest, facts.largest)
        words += f"  min {smallest}  max {largest}"
        return f"{words}  mean {text.compact(facts.mean)}"

    def _axis_word(self, share: float) -> str:
        store, source, width_ns = self.store, self._file.source, self.columns * self.store.column_ns
        end_ns = store.end * store.column_ns
        if store.empty:  # nothing is read yet
            end_ns, width_ns = self.window.paused_end_ns or source.end_ns, self.window.span_ns
        at = end_ns - width_ns * (1 - share) - source.begin_ns
        digits = max(0, min(9, 2 - int(np.floor(np.log10(self.window.span_s / 4)))))
        return f"{at / 1e9 + 0.0:.{digits}f} s"

"""The widgets of a live logger where a file has other things to say: the same drawing, other columns and words."""

import numpy as np
from rich.text import Text
from textual.app import RenderResult

from silo.core.elements import ElementInfo
from silo.core.quantities.writing import many, size_text
from silo_tui.model import text
from silo_tui.model.cells import span_words, type_word
from silo_tui.model.columns import ColumnStore
from silo_tui.model.live import Reading, offset_text
from silo_tui.model.plots import Plotted, PlotWindow, plots_of
from silo_tui.sessions.recorded import FileSession
from silo_tui.widgets.bars import Banner, MonitorLine, StatusBar, color
from silo_tui.widgets.inspector import Inspector, InspectorLines
from silo_tui.widgets.plot_stack import PlotStack

MAX_LABELS = 8


class RecordedInspector(Inspector):
    """What the file says of the element under the cursor."""

    def __init__(self, session: FileSession) -> None:
        super().__init__(session)
        self._file = session
        self.store = ColumnStore((), 1, 1)

    @property
    def columns(self) -> ColumnStore:
        """Of the time that the element has samples of."""
        return self.store

    def _facts(self, pane: InspectorLines, element: ElementInfo, row: int, reading: Reading | None) -> None:
        report = self._file.rows_of[element.name]
        if element.description:
            pane.append(element.description + "\n", style=self._quiet)
        rate = f"{report.rate_hz:.5g} Hz" if report.rate_hz else "-"
        facts = [
            ("kind", element.kind), ("type", type_word(element, report)), ("unit", element.unit),
            ("divider", str(report.divider)), ("samples", text.count(report.samples)),
            ("span s", span_words(report, wide=True)), ("rate", rate),
            ("buffer", report.buffer), ("lost", text.count(report.lost)),
        ]  # fmt: skip
        if report.failures.count:
            facts.append(("not read", f"at {many(report.failures.count, 'tick')}"))
        for label, words in facts:
            style = self._error if label == "not read" or (label == "lost" and report.lost) else ""
            pane.append(f"{label:<9} ", style=self._quiet)
            pane.append(words + "\n", style=style)
        if report.labels:
            shown = [f"{number} {word}" for number, word in list(report.labels.items())[:MAX_LABELS]]
            more = ", …" if len(report.labels) > MAX_LABELS else ""
            pane.append(", ".join(shown) + more + "\n", style=self._quiet)

    def _values(self, pane: InspectorLines, element: ElementInfo, row: int, reading: Reading | None) -> None:
        pane.append(f"\nat {self._file.seconds:.6g} s:", style=self._quiet)
        if reading is None or not reading.held:
            none = not self._file.rows_of[element.name].samples
            pane.append("\nno samples in this file\n" if none else "\nno sample yet\n", style=self._quiet)
            return
        super()._values(pane, element, row, reading)


class FileBar(StatusBar):
    """The file at a glance: name, duration, ticks, what was lost."""

    def __init__(self, session: FileSession) -> None:
        super().__init__(session, read_only=False)
        self._file = session

    def _line(self) -> Text:
        report = self._file.report
        wide = self.size.width >= 100
        facts = f"  {text.span(report.duration_s)}  {text.count(report.ticks)} ticks"
        facts += f"  {many(len(report.elements), 'element')}" if wide else ""
        facts += f"  {report.rate_hz:.4g} Hz" if report.rate_hz else ""
        facts += f"  {size_text(report.size_bytes)}" if wide and report.size_bytes else ""
        lost = f"  lost {text.count(report.lost)}"
        room = max(8, self.content_size.width - len(facts) - len(lost) - (10 if wide else 5))
        line = Text(no_wrap=True, overflow="ellipsis")
        if wide:
            line.append("silo ", style="bold")
        line.append("FILE", style="reverse")  # on a small screen instead: the file's name is worth more
        line.append(" ")
        line.append(text.shorten_left(self._file.name, room))
        line.append(facts)
        line.append(lost, style=f"bold {color(self.app.theme_variables, 'error')}" if report.lost else "")
        return line


class FileBanner(Banner):
    """What is missing or damaged in the file."""

    def __init__(self, session: FileSession) -> None:
        super().__init__(session)
        self._file = session

    def _words(self) -> str:
        words = "; ".join(text.clean(warning) for warning in self._file.warnings)
        room = 2 * self.app.size.width - 16  # two lines, and what breaking at words costs
        rest = " … (all: silo info FILE)"
        return words if len(words) <= room else words[: room - len(rest)] + rest


class RecordedLine(MonitorLine):
    """Span and scale of the monitor, the moment that its cursor is at."""

    def render(self) -> RenderResult:
        """Return the line."""
        window = self._window
        whole = window.span_s == window.spans[-1]
        parts = ["whole file" if whole else f"{text.span(window.span_s)} shown"]
        parts += ["y held"] if window.fixed_scale else []
        parts += self._words()
        while len(parts) > 1 and len(" │ ".join(parts)) > self.content_size.width:
            parts.pop(0)  # what was said last is read whole
        return Text(" │ ".join(parts), no_wrap=True, overflow="ellipsis")


class RecordedStack(PlotStack):
    """Plots of a file: the value at the cursor, minimum, maximum and mean of the window; the axis counts its time."""

    def __init__(self, session: FileSession, names: list[str], window: PlotWindow) -> None:
        elements = [element for name in names if (element := session.source.element(name)) is not None]
        super().__init__(plots_of(elements), window, session.source)
        self.prefix = session.status.prefix.rstrip("/")
        self._file = session

    def _facts(self, at: int, plotted: Plotted) -> str:
        store = self.store
        facts = self._file.source.facts(plotted.name, store.end - self.columns, store.end, store.column_ns)
        words = f"= {self.facts.now(plotted)}"
        report = self._file.rows_of[plotted.element.name]
        if not facts.samples and report.start_s is not None and self._file.seconds < report.start_s:
            return f"{words}  begins at {report.start_s:.6g} s"
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
        store = self.store
        at = (store.end - self.columns * (1 - share)) * store.column_ns - self._file.source.begin_ns
        digits = max(0, min(9, 2 - int(np.floor(np.log10(self.window.span_s / 4)))))
        return f"{at / 1e9 + 0.0:.{digits}f} s"

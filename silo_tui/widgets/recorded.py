"""The widgets of a live logger where a file has other things to say: the same drawing, other columns and words."""

from collections.abc import Iterator

import numpy as np
from rich.segment import Segment
from rich.text import Text
from textual.app import RenderResult
from textual.geometry import Region
from textual.strip import Strip

from silo.analysis.reports import ElementReport
from silo.columns import coarser
from silo.model import ElementInfo
from silo_tui.model import text
from silo_tui.model.columns import ColumnStore, Piece
from silo_tui.model.fields import Field, word_for
from silo_tui.model.live import Reading, offset_text, value_text
from silo_tui.model.plots import Plotted, PlotWindow, plots_of, trend
from silo_tui.sessions.recorded import FileSession
from silo_tui.widgets.bars import Banner, MonitorLine, StatusBar, color
from silo_tui.widgets.element_table import FLAGS, UNIT, ElementTable, TableHead
from silo_tui.widgets.inspector import Inspector
from silo_tui.widgets.live_pane import LivePane
from silo_tui.widgets.plot_stack import PlotStack

WIDE_SPAN = 96  # from this width the span says when it begins
# head, width, whether numbers stand at its right end; the fields by which one sorts have theirs
COLUMNS = (("div", 4, True), ("samples", 7, True), ("span s", 6, True), ("type", 10, False), ("buf", 4, False),
           ("lost", 5, True))  # fmt: skip
SORT_HEADS = {"div": "div", "samples": "size", "buf": "buf"}
MAX_LABELS = 8


def columns_for(width: int) -> tuple[tuple[str, int, bool], ...]:
    """The columns behind name and unit in a table of `width` cells."""
    wide = 16 if width >= WIDE_SPAN else 6
    return tuple((head, wide if head == "span s" else cells, right) for head, cells, right in COLUMNS)


def span_words(report: ElementReport, *, wide: bool) -> str:
    """`40.95 … 51.14`, or how long that is."""
    if report.start_s is None or report.end_s is None:
        return "-"
    if wide:
        return f"{report.start_s:.5g} … {report.end_s:.5g}"
    return f"{report.end_s - report.start_s:.4g}"


class RecordedTable(ElementTable):
    """Name, unit and what there is of each element in the file."""

    def __init__(self, session: FileSession) -> None:
        super().__init__(session)
        self.file = session
        self.field = Field.DIVIDER  # no field can be chosen

    @property
    def columns(self) -> tuple[tuple[str, int, bool], ...]:
        """Head, width and alignment of each column behind the unit."""
        return columns_for(self.size.width)

    @property
    def name_width(self) -> int:
        """Cells for names."""
        return max(8, self.size.width - FLAGS - 1 - UNIT - sum(1 + width for _, width, _ in self.columns))

    def field_spans(self) -> dict[Field, tuple[int, int]]:
        """Nothing can be edited."""
        return {}

    def cell_region(self) -> Region:
        """Nothing can be edited."""
        return Region()

    def _segments(self, row: int, *, is_cursor: bool) -> Iterator[Segment]:
        marked, in_range = bool(self.rows.marked[row]), bool(self._range[row])
        base = ["table--row", *(["table--range"] if in_range else []), *(["table--cursor"] if is_cursor else [])]
        quiet = [] if is_cursor else ["table--quiet"]  # grey on the cursor's line is hard to read in 16 colours
        marks = ["table--marked"] if marked or in_range else []
        yield Segment(" ", self._style(*base))
        yield Segment(">" if marks else " ", self._style(*base, "table--marked"))
        width = self.name_width
        full = self.session.table.names[row]
        name = self._fitted(text.shorten_left(self.session.short_name(full), width), width)
        yield Segment(name, self._style(*base, *marks))
        yield Segment(" " + self._unit(row), self._style(*base, *quiet))
        report = self.file.rows_of[full]
        for head, cells, right in self.columns:
            word = self._word(head, report, self.session.table.elements[row])
            word = word if len(word) <= cells else word[: cells - 1] + "…"
            word = word.rjust(cells) if right else word.ljust(cells)
            alarm = head == "lost" and report.lost > 0
            yield Segment(" " + word, self._style(*base, *(["table--conflict"] if alarm else quiet)))

    def _word(self, head: str, report: ElementReport, element: ElementInfo) -> str:
        if head == "div":
            return str(report.divider)
        if head == "samples":
            return str(report.samples) if report.samples < 10**7 else text.compact(report.samples)
        if head == "span s":
            return span_words(report, wide=self.size.width >= WIDE_SPAN)
        if head == "type":
            return short_type(type_word(element, report))
        if head == "buf":
            return word_for(Field.BUFFER_TYPE, element.options.buffer_type)
        return str(report.lost)


def type_word(element: ElementInfo, report: ElementReport) -> str:
    """`float64[7]`, `enum`."""
    is_enum = bool(element.entries) and all(entry.labels for entry in element.entries)
    return report.type.replace(report.type.split("[", 1)[0], "enum") if is_enum else report.type


def short_type(words: str) -> str:
    """`f64[12]` for `float64[12]`, because a cell is small."""
    for long, short in (("uint", "u"), ("int", "i"), ("float", "f"), ("complex", "c"), ("datetime", "date")):
        words = words.replace(long, short)
    return words


class RecordedHead(TableHead):
    """The heads of those columns."""

    def __init__(self, table: RecordedTable) -> None:
        super().__init__(table)
        self._recorded = table

    def render_line(self, y: int) -> Strip:
        """The one line."""
        plain = self.get_component_rich_style("head--text")
        sort = self._recorded.rows.sort
        name = {"name": " ↓name", "added": " ↓added"}.get(sort, " name")
        line = " " * (FLAGS - 1) + name.ljust(self._recorded.name_width + 1)
        line += (" ↓unit" if sort == "unit" else " unit").ljust(UNIT + 1)
        for head, width, right in self._recorded.columns:
            word = ("↓" if SORT_HEADS.get(head) == sort else "") + head
            word = word[:width]
            line += " " + (word.rjust(width) if right else word.ljust(width))
        return Strip([Segment(line, plain)]).adjust_cell_length(self.size.width, plain)


class RecordedPane(LivePane):
    """The value at the moment shown, and the whole file as a trend."""

    def __init__(self, session: FileSession, table: RecordedTable) -> None:
        super().__init__(session, table)
        self._file = session

    @property
    def wanted_width(self) -> int:
        """Cells of all columns with the rail of the scroll position."""
        value = 1 + self.value_width if self.value_width else 0
        return value + (1 + self.trend_width if self.trend_width else 0) + 1

    @property
    def head(self) -> str:
        """The heads of the columns."""
        value = f" {f'at {self._file.seconds:.6g} s'[: self.value_width]:>{self.value_width}}"
        return (value if self.value_width else "") + (f" {'all':<{self.trend_width}}" if self.trend_width else "") + " "

    def _pieces(self, row: int) -> list[tuple[str, str]]:
        pieces = []
        if self.value_width:
            element = self.session.table.elements[row]
            reading = self.session.live.readings.get(element.name)
            there = reading is not None and reading.held
            words = value_text(element, reading, self.value_width) if there else "-"
            style = "live--value" if there else "live--quiet"
            pieces.append((f" {words[: self.value_width]:>{self.value_width}}", style))
        if self.trend_width:
            pieces.append((" " + self._trend(row), "live--trend"))
        return pieces

    def _trend(self, row: int) -> str:
        """All columns that there are, drawn together until they fit."""
        names, store = self.session.table.entry_names(row), self.session.columns
        place = store.row(names[0]) if names else None
        if place is None or store.empty:
            return " " * self.trend_width
        begins = np.linspace(0, store.count, 2 * self.trend_width, endpoint=False).astype(np.intp)
        together = coarser(store.low[place], store.high[place], store.marks[place], begins)
        return trend(Piece(*together, store.base(place)), self.trend_width)


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

    def _facts(self, pane: Text, element: ElementInfo, row: int, reading: Reading | None) -> None:
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
        for label, words in facts:
            style = self._error if label == "lost" and report.lost else ""
            pane.append(f"{label:<9} ", style=self._quiet)
            pane.append(words + "\n", style=style)
        if report.labels:
            shown = [f"{number} {word}" for number, word in list(report.labels.items())[:MAX_LABELS]]
            more = ", …" if len(report.labels) > MAX_LABELS else ""
            pane.append(", ".join(shown) + more + "\n", style=self._quiet)
        pane.append(f"\nat {self._file.seconds:.6g} s:", style=self._quiet)

    def _values(self, pane: Text, element: ElementInfo, row: int, reading: Reading | None) -> None:
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
        facts += f"  {text.plural(len(report.elements), 'element')}" if wide else ""
        facts += f"  {report.rate_hz:.4g} Hz" if report.rate_hz else ""
        facts += f"  {text.size(report.size_bytes)}" if wide and report.size_bytes else ""
        lost = f"  lost {text.count(report.lost)}"
        room = max(8, self.content_size.width - len(facts) - len(lost) - 5)
        line = Text(no_wrap=True, overflow="ellipsis")
        line.append("silo ", style="bold")
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
        """The line."""
        window = self._window
        whole = window.span_s == window.spans[-1]
        parts = ["whole file" if whole else f"{text.span(window.span_s)} shown"]
        parts += ["y held"] if window.fixed_scale else []
        parts.append(self._words())
        return Text(" │ ".join(parts), no_wrap=True, overflow="ellipsis")


class RecordedStack(PlotStack):
    """Plots of a file: the value at the cursor, minimum, maximum and mean of the window; the axis counts its time."""

    def __init__(self, session: FileSession, names: list[str], window: PlotWindow) -> None:
        elements = [element for name in names if (element := session.source.element(name)) is not None]
        super().__init__(plots_of(elements), window, session.source)
        self.prefix = session.status.prefix.rstrip("/")
        self._file = session

    def _facts(self, index: int, plotted: Plotted) -> str:
        store = self.store
        facts = self._file.source.facts(plotted.name, store.end - self.columns, store.end, store.column_ns)
        words = f"= {self._now(plotted)}"
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

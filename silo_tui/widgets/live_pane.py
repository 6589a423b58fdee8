"""The live columns beside the table: fill, value, trend.

They are a widget of their own, because Textual resends all that is left of a change on its line: drawn together, a
frame was 11 - 20 kB; apart, it is 3 kB.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget
from textual.widgets import Static

from silo.core.elements import BufferType, ElementInfo, Entry, State
from silo.rpc.published import NotLive
from silo_tui.model.fields import Field
from silo_tui.model.live import Reading, component_text, fill_share, value_text
from silo_tui.model.sparklines import trends
from silo_tui.model.table import Rows
from silo_tui.model.tree import entry_of, row_of
from silo_tui.sessions.live import Session
from silo_tui.terminal import pace_of
from silo_tui.unforeseen import Guarded
from silo_tui.widgets.element_table import ElementTable, TableHead

VALUE, TREND = 11, 10

# whether a line is the cursor's, its words with their styles, its piece of the rail
Content = tuple[bool, tuple[tuple[str, str], ...], str]


@dataclass(frozen=True)
class PaneColumn:
    """One live column: head, width (0: not shown), and `draw`: words and style for the element of a row."""

    title: "Callable[[LivePane], str]"
    width: "Callable[[LivePane], int]"
    draw: "Callable[[LivePane, int], tuple[str, str]]"
    right: bool = False
    branch: "Callable[[LivePane, Rows], tuple[str, str]] | None" = None  # of the elements below a branch
    entry: "Callable[[LivePane, int, int], tuple[str, str]] | None" = None  # of one entry of an element
    order: str = ""  # that a click on its head gives


class LivePane(Guarded, Widget):
    """Draws the readings of the rows that the table shows; only lines that changed are painted again."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {
        "live--row", "live--cursor", "live--quiet", "live--value", "live--stale", "live--lost", "live--trend",
        "live--full", "live--rail", "live--caution",
    }  # fmt: skip
    DEFAULT_CSS = "LivePane { height: 1fr; width: 18; }"

    def __init__(self, session: Session, table: ElementTable, columns: "Sequence[PaneColumn] | None" = None) -> None:
        super().__init__()
        self.session = session
        self._table = table
        self._columns = LIVE_PANE if columns is None else columns
        self.value_width: int = VALUE
        self.trend_width: int = 0
        self._styles: dict[str, Style] = {}
        self._lines: dict[int, Content] = {}  # as they were painted
        self._ready: dict[int, Content] = {}  # found to differ, not painted yet
        self.digits_fewer: int = 0  # of values, on a thin link
        self._trends: dict[int, str] = {}  # by row; all of them are drawn together, once a second
        self._trends_of: object = None
        self._trends_due_s = 0.0

    def lay_out(self, value_width: int, *, trend: bool) -> None:
        """Take more room where there is some."""
        self.value_width = value_width
        self.trend_width = TREND if trend else 0
        self.styles.width = self.wanted_width
        self._ready.clear()
        self._trends.clear()
        self.refresh()

    def entry_of(self, row: int) -> Entry | None:
        """Return the entry that the row tells of; None where that is the norm of several."""
        element, chosen = self.session.table.elements[row], self.session.rows.component(row)
        return element.entries[max(0, chosen - 2)] if len(element.entries) == 1 or chosen >= 2 else None

    def tells_one(self, row: int) -> bool:
        """Return whether the row tells of one number: a scalar, the entry or the norm that was asked for."""
        return len(self.session.table.elements[row].entries) == 1 or self.session.rows.component(row) > 0

    @property
    def shown(self) -> list[tuple[PaneColumn, int]]:
        """The columns that are shown, and their widths."""
        return [(column, width) for column in self._columns if (width := column.width(self))]

    def order_at(self, x: int) -> str:
        """Return the order of the column whose head is at a cell of the heads; empty for none."""
        start = 0
        for column, width in self.shown:
            if start < x <= start + width:
                return column.order
            start += 1 + width
        return ""

    @property
    def wanted_width(self) -> int:
        """Cells of all columns with the rail of the scroll position."""
        return sum(1 + width for _, width in self.shown) + 1

    @property
    def head(self) -> str:
        """The heads of the columns."""
        return "".join(" " + _fitted(column.title(self), width, column) for column, width in self.shown) + " "

    def live_changed(self) -> None:
        """Paint the lines that read differently now."""
        pace, now_s = pace_of(self.app), time.monotonic()
        self.digits_fewer = pace.digits_fewer
        store = self.session.columns
        # what came of the past is shown at once
        if now_s >= self._trends_due_s or self._trends_of != (store, store.past_until_ns):
            self._trends.clear()
            self._trends_of = (store, store.past_until_ns)
            self._trends_due_s = now_s + pace.trend_s
        for line in range(self.size.height):
            content = self._content(line)
            if self._lines.get(line) != content:
                self._ready[line] = content
                self.refresh(Region(0, line, self.size.width, 1))

    def notify_style_update(self) -> None:
        """Follow a change of the theme."""
        super().notify_style_update()
        self._styles.clear()

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        """Scroll the table."""
        self._table.scroll_to(y=self._table.scroll_y + 3, animate=False)

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        """Scroll the table."""
        self._table.scroll_to(y=self._table.scroll_y - 3, animate=False)

    # ------------------------------------------------------------------------------------------------ drawing

    def render_line(self, y: int) -> Strip:
        """Return one element."""
        content = self._ready.pop(y, None) or self._content(y)
        self._lines[y] = content
        is_cursor, pieces, rail = content
        base = ["live--row", "live--cursor"] if is_cursor else ["live--row"]
        segments = [Segment(words, self._style(*base, style)) for words, style in pieces]
        line = Strip(segments).adjust_cell_length(self.size.width - 1, self._style(*base))
        return Strip([*line, Segment(rail, self._style("live--row", "live--rail"))])

    def _style(self, *names: str) -> Style:
        key = " ".join(names)
        if key not in self._styles:
            style = self.get_component_rich_style(names[0])
            for name in names[1:]:
                if name:
                    style += self.get_component_rich_style(name, partial=True)
            self._styles[key] = style
        return self._styles[key]

    def _content(self, line: int) -> Content:
        """Return what a line says: is it the cursor's, its words with their styles, and its piece of the rail."""
        top = self._table.scroll_offset.y
        position = top + line
        rows = self.session.rows
        if position >= len(rows.tree.lines):
            return False, (), " "
        is_cursor = position == rows.position
        pieces = self._pieces(int(rows.tree.lines[position]))
        if is_cursor:  # grey on the cursor's line is hard to read in 16 colours
            pieces = [(words, "" if style == "live--quiet" else style) for words, style in pieces]
        return is_cursor, tuple(pieces), self._rail(line, top)

    def _rail(self, line: int, top: int) -> str:
        total, height = len(self.session.rows.tree.lines), max(1, self.size.height)
        if total <= height:
            return " "
        length = max(1, height * height // total)
        start = round((height - length) * top / (total - height))
        return "▐" if start <= line < start + length else " "

    def _pieces(self, line: int) -> list[tuple[str, str]]:
        row, entry = row_of(line), entry_of(line)
        pieces = [(" ", "")]
        for place, (column, width) in enumerate(self.shown):
            words, style = "", ""
            if row is None:
                if column.branch is not None:
                    words, style = column.branch(self, self.session.rows.tree.branches[-1 - line].rows)
                    return [*pieces, (" " * (place > 0) + words, style)]
            elif entry is None:
                words, style = column.draw(self, row)
            elif column.entry is not None:
                words, style = column.entry(self, row, entry)
            pieces.append((" " * (place > 0) + _fitted(words, width, column), style))
        return pieces

    def entry_name(self, row: int, entry: int) -> str:
        """Return the full name of an entry."""
        element = self.session.table.elements[row]
        return element.name + element.entries[entry].suffix

    def shown_name(self, row: int) -> str:
        """Return of what the row tells: the element, or the entry of it that was chosen."""
        chosen = self.session.rows.component(row)
        return self.entry_name(row, chosen - 2) if chosen >= 2 else self.session.table.names[row]

    def trend(self, row: int) -> str:
        """Return the newest columns of the first entry, drawn."""
        if row not in self._trends:
            table = self.session.table
            rows = [row, *self._table.rows_on_screen()]
            drawn = [each for each in rows if table.is_live(each) and table.entry_names(each)]
            names = [table.entry_names(each)[0] for each in drawn]
            self._trends = dict.fromkeys(rows, " " * self.trend_width)
            self._trends |= zip(drawn, trends(self.session.columns, names, self.trend_width), strict=True)
        return self._trends[row]


class LiveHead(Guarded, Static):
    """The heads of the live columns; a click asks for the order by one."""

    def __init__(self, pane: LivePane) -> None:
        super().__init__("", id="live-head", markup=False)
        self._pane = pane

    def on_click(self, event: events.Click) -> None:
        """Ask for the order by this column."""
        if order := self._pane.order_at(event.x):
            self.post_message(TableHead.Picked(order))


def _fitted(words: str, width: int, column: PaneColumn) -> str:
    return f"{words[:width]:>{width}}" if column.right else f"{words[:width]:<{width}}"


def _fill(pane: LivePane, row: int) -> tuple[str, str]:
    """Return how full the buffer is; nothing where that isn't known."""
    session = pane.session
    element = session.table.elements[row]
    reading = session.live.readings.get(element.name)
    if not session.table.server[Field.ENABLED, row] or reading is None or reading.size == 0:
        return "", ""
    size = reading.size or int(session.table.server[Field.BUFFER_SIZE, row])
    share = fill_share(reading.held, size)
    stopped = share >= 1 and int(session.table.server[Field.BUFFER_TYPE, row]) == BufferType.FIXED
    style = "live--lost" if reading.lost or reading.failed else ("live--full" if stopped else "live--quiet")
    return f"{100 * share:.0f}%", style


WHY_NOT_LIVE: dict[NotLive | None, str] = {
    NotLive.ABSENT: "not begun", NotLive.FULL: "full", NotLive.LIMIT: "mem limit", NotLive.OTHER: "not live",
}  # fmt: skip


def _value(pane: LivePane, row: int) -> tuple[str, str]:
    """Return the newest value, or why there is none."""
    session = pane.session
    element = session.table.elements[row]
    if not session.table.server[Field.ENABLED, row]:
        return "off", "live--quiet"
    reading = session.live.readings.get(element.name)
    if reading is None or not reading.held:
        waiting = "…" if session.running and session.fresh else "-"
        return waiting, "live--quiet"
    if session.running and reading.why in WHY_NOT_LIVE:  # what it kept last isn't its value
        return WHY_NOT_LIVE[reading.why], "live--quiet"
    style = "live--value" if session.fresh and session.status.state is State.RUNNING else "live--stale"
    return value_words(pane, row, element, reading), style


def value_words(pane: LivePane, row: int, element: ElementInfo, reading: Reading) -> str:
    """Return a value: all entries of a vector, or the one that was chosen, or its norm.

    Where statistics stand beside it, or rows are ordered by it, it is of the moment of these.
    """
    width, chosen = pane.value_width - pane.digits_fewer, pane.session.rows.component(row)
    told = pane.session.table.facts.detail(pane.shown_name(row), "value")
    if len(element.entries) == 1 or chosen >= 2:
        reading = reading.with_value(max(0, chosen - 2), told)
    if chosen:
        return component_text(element, reading, chosen, width, told=told)
    return value_text(element, reading, width)


def _entry_value(pane: LivePane, row: int, entry: int) -> tuple[str, str]:
    words, style = _value(pane, row)
    element = pane.session.table.elements[row]
    reading = pane.session.live.readings.get(element.name)
    if reading is None or style not in {"live--value", "live--stale"}:
        return words, style
    reading = reading.with_value(entry, pane.session.table.facts.detail(pane.entry_name(row, entry), "value"))
    return component_text(element, reading, entry + 2, pane.value_width, named=False), style


LIVE_PANE = (
    PaneColumn(lambda pane: "fill", lambda pane: 4, _fill),
    PaneColumn(
        lambda pane: "value", lambda pane: pane.value_width, _value, right=True, entry=_entry_value,
    ),
    PaneColumn(
        lambda pane: "trend",
        lambda pane: pane.trend_width,
        lambda pane, row: (pane.trend(row), "live--trend" if pane.session.fresh else "live--stale"),
    ),
)  # fmt: skip

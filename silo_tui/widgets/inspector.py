"""The pane on the right of a wide terminal: everything about the element under the cursor, with small plots."""

import math

from rich.text import Text
from textual.app import RenderResult
from textual.widget import Widget

from silo.ipc.published import NOT_LIVE_TEXTS
from silo.model import ElementInfo
from silo_tui.model import braille, text
from silo_tui.model.columns import ColumnStore, hold_piece
from silo_tui.model.fields import Field, phrase_for
from silo_tui.model.live import Reading, entry_text, fill_share
from silo_tui.model.plots import signs_of, small_plot
from silo_tui.sessions.live import Session
from silo_tui.widgets.bars import color

MAX_PLOTS = 6
MAX_VALUES = 16


class Inspector(Widget):
    """Name, options with what is pending, values of all entries, plots of the first few."""

    DEFAULT_CSS = "Inspector { width: 40; padding: 0 1; }"

    def __init__(self, session: Session) -> None:
        super().__init__()
        self.session = session
        self._shown = Text()
        self._ready: Text | None = None

    @property
    def columns(self) -> ColumnStore:
        """What the small plots show."""
        return self.session.columns

    def live_changed(self) -> None:
        """Paint anew if it reads differently; a logger that stands still costs nothing."""
        pane = self._pane()
        if pane != self._shown:
            self._ready = pane
            self.refresh()

    def plot_names(self) -> list[str]:
        """Return the entries that the pane plots."""
        row = self.session.rows.row
        if row is None or not self.session.table.is_live(row):
            return []
        element = self.session.table.elements[row]
        return [element.name + entry.suffix for entry in element.entries if entry.dtype[1:2] not in "SU"][:MAX_PLOTS]

    def render(self) -> RenderResult:
        """Return the pane."""
        pane, self._ready = self._ready, None
        self._shown = pane if pane is not None else self._pane()
        return self._shown

    def _pane(self) -> Text:
        row = self.session.rows.row
        if row is None:
            return Text("")
        element = self.session.table.elements[row]
        reading = self.session.live.readings.get(element.name)
        pane = Text(no_wrap=True, overflow="ellipsis")
        width = self.content_size.width
        name = self.session.short_name(element.name)
        for start in range(0, len(name), max(8, width)):
            pane.append(name[start : start + max(8, width)] + "\n", style="bold")
        self._facts(pane, element, row, reading)
        self._values(pane, element, row, reading)
        self._plots(pane, width)
        return pane

    def _facts(self, pane: Text, element: ElementInfo, row: int, reading: Reading | None) -> None:
        quiet = self._quiet
        shape = " x ".join(str(side) for side in element.shape)
        dtype = element.entries[0].dtype.lstrip("<>|=") if element.entries else ""
        unit = "" if element.unit == "-" else f"  [{element.unit}]"
        pane.append(f"{element.kind} {shape} {dtype}{unit}".replace("  ", " ") + "\n", style=quiet)
        if element.description:
            pane.append(element.description + "\n", style=quiet)
        table = self.session.table
        values, server, pending, conflicts = table.values, table.server, table.pending, table.conflicts
        for field in Field:
            pane.append(f"{field.label:<12} ", style=quiet)
            if pending[field, row]:
                pane.append(f"{phrase_for(field, int(server[field, row]))} → ")
                pane.append(phrase_for(field, int(values[field, row])), style=f"underline {self._warning}")
                pane.append(" ! changed by somebody else" if conflicts[field, row] else "")
            else:
                pane.append(phrase_for(field, int(values[field, row])))
            pane.append("\n")
        frequency = self.session.status.frequency_hz
        if frequency:
            divider, size = int(values[Field.DIVIDER, row]), int(values[Field.BUFFER_SIZE, row])
            holds = text.span(size * divider / frequency)
            pane.append(f"{'which holds':<12} ", style=quiet)
            pane.append(f"{holds} at {frequency / divider:.4g} Hz\n")
        if reading is not None:
            size = reading.size or int(server[Field.BUFFER_SIZE, row])
            share = fill_share(reading.held, size)
            pane.append(f"{'held':<12} ", style=quiet)
            pane.append(f"{text.count(reading.held)} ")
            pane.append(text.bar(share, 4 if self.content_size.width < 34 else 8), style=self._plot)
            pane.append(f" {share:.0%}\n")
            if reading.lost:
                pane.append(f"{'lost':<12} {text.count(reading.lost)}\n", style=self._error)
            if reading.failed:
                pane.append(f"{'not read':<12} at {text.plural(reading.failed, 'tick')}\n", style=self._error)

    def _values(self, pane: Text, element: ElementInfo, row: int, reading: Reading | None) -> None:
        pane.append("\n")
        if not self.session.table.server[Field.ENABLED, row]:
            pane.append("not logged; t switches it on\n", style=self._quiet)
            return
        if reading is None or not reading.held:
            pane.append("no values yet\n" if self.session.running else "not running; S starts it\n", style=self._quiet)
            return
        if reading.why is not None:
            pane.append(f"{NOT_LIVE_TEXTS[reading.why]}\n", style=self._quiet)
        style = "" if self.session.fresh and self.session.running else self._quiet
        if len(element.entries) == 1:
            entry = element.entries[0]
            pane.append(entry_text(entry, float(reading.newest[0]), reading.texts.get(0), 30) + "\n", style=style)
            return
        entries = element.entries[:MAX_VALUES]
        left = min(18, max(len(entry.suffix) for entry in entries) + 1)
        room = min(16, max(8, self.content_size.width - left))
        for position, entry in enumerate(entries):
            word = entry_text(entry, float(reading.newest[position]), reading.texts.get(position), room)
            pane.append(entry.suffix[:left].ljust(left), style=self._quiet)
            pane.append(f"{word:>{room}}\n", style=style)
        if len(element.entries) > MAX_VALUES:
            pane.append(f"and {len(element.entries) - MAX_VALUES} more; m plots them\n", style=self._quiet)

    def _plots(self, pane: Text, width: int) -> None:
        names = self.plot_names()
        columns = self.columns
        names = [name for name in names if columns.row(name) is not None]
        room = self.content_size.height - pane.plain.count("\n") - 1
        if not names or columns.empty or room < 4:
            return
        names = names[: max(1, room // 4)]
        height = max(2, min(7, room // len(names) - 1))
        shown_columns = 2 * max(8, width)
        for name in names:
            piece = hold_piece(columns.piece(name, columns.end, shown_columns), 4)
            found = braille.value_range(piece.low, piece.high)
            scale = braille.nice_range(*found) if found else (math.nan, math.nan)
            bottom, top, origin = text.axis_ends(*scale, piece.base)
            ends = f"{bottom} … {top}" + (f" from {origin}" if origin else "") if found else signs_of(piece.marks)
            row = self.session.rows.row
            prefix = self.session.table.elements[row].name if row is not None else ""
            title = f"{name[len(prefix) :] or 'value'}  {ends}"
            span = text.span(min(columns.count, shown_columns) * columns.column_ns / 1e9)
            pane.append(f"{title}  {span}\n", style=self._quiet)
            for line in small_plot(piece, scale, max(8, width), height):
                pane.append(line + "\n", style=self._plot if self.session.fresh else self._quiet)

    @property
    def _quiet(self) -> str:
        return color(self.app.theme_variables, "quiet")

    @property
    def _warning(self) -> str:
        return color(self.app.theme_variables, "warning")

    @property
    def _error(self) -> str:
        return color(self.app.theme_variables, "error")

    @property
    def _plot(self) -> str:
        return color(self.app.theme_variables, "plot")

"""Everything about the element under the cursor, with small plots: on the right, on a narrow terminal below."""

import itertools
import math
import time
from collections.abc import Sequence
from typing import Any

from rich.cells import cell_len, set_cell_size
from rich.segment import Segment
from rich.style import Style
from textual.geometry import Region
from textual.strip import Strip
from textual.widget import Widget

from silo.core.arrays.columns import ColumnStore
from silo.core.elements import ElementInfo
from silo.core.names import component_name
from silo.core.quantities.writing import many
from silo.rpc.published import NOT_LIVE_TEXTS
from silo_tui.actions import key_of
from silo_tui.model.drawing import braille
from silo_tui.model.drawing.plots import hold_piece, signs_of
from silo_tui.model.samples.live import Reading, fill_share
from silo_tui.model.table import cells
from silo_tui.model.table.cells import Sight, span_words, type_word
from silo_tui.model.table.fields import Field, phrase_for
from silo_tui.model.words import text
from silo_tui.sessions.live import Session
from silo_tui.terminal import pace_of
from silo_tui.theme import color
from silo_tui.unforeseen import Guarded
from silo_tui.widgets.bars import lines_of

MAX_PLOTS = 6
MAX_VALUES = 16
MAX_LABELS = 8
DESCRIBED = 4  # lines
BESIDE_FROM = 54  # cells from which a pane below the table has values and plots beside the facts: of rows it has few


Line = list[tuple[str, str]]  # words with their style


class InspectorLines:
    """Lines of words with their styles. Measured: as one text the pane was a third of what a live table cost."""

    def __init__(self) -> None:
        self.lines: list[Line] = [[]]

    def append(self, words: str, style: str = "") -> None:
        """Add words; each line feed in them begins a line."""
        first, *others = words.split("\n")
        self.lines[-1].append((first, style))
        self.lines += [[(each, style)] for each in others]


def beside(left: Sequence[Line], right: Sequence[Line], width: int) -> list[Line]:
    """Return lines of both, the right ones `width` cells from the left edge; what is longer on the left is cut."""
    lines = []
    for old, new in itertools.zip_longest(left, right, fillvalue=()):
        pieces, room = [], width - 1
        for words, style in old:
            pieces.append((cut_to(words, room), style))
            room = max(0, room - cell_len(words))
        lines.append([*pieces, (" " * (room + 1), ""), *new])
    return lines


def cut_to(words: str, room: int) -> str:
    """Return words of at most `room` cells, cut with an ellipsis."""
    return words if cell_len(words) <= room else set_cell_size(words, max(0, room - 1)) + "…"[:room]


class Inspector(Guarded, Widget):
    """Name, options with what is pending, values of all entries, plots of the first few."""

    def __init__(self, session: Session) -> None:
        super().__init__()
        self.session = session
        self.store = ColumnStore((), 1, 1)  # of a file
        self.below = False  # the table, not beside it
        self._lines: list[Line] | None = None  # None: to be made anew
        self._lines_fit = self.content_size
        self._plotted = InspectorLines()
        self._plotted_of: object = None
        self._plots_due_s = 0.0
        self._styles: dict[str, Style] = {}

    @property
    def columns(self) -> ColumnStore:
        """What the small plots show; of a file the time that the element has samples of."""
        return self.session.columns if self.session.at_s is None else self.store

    @property
    def spread(self) -> bool:
        """Whether values and plots stand beside the facts."""
        return self.below and self.content_size.width >= BESIDE_FROM

    @property
    def plot_width(self) -> int:
        """The cells that a plot takes."""
        width = self.content_size.width
        return width - width // 2 if self.spread else width

    @property
    def shaded(self) -> bool:
        """Whether a plot has a hole."""
        return self.display and any(braille.SHADE in words for line in self._plotted.lines for words, _ in line)

    def live_changed(self) -> None:
        """Paint the lines that read differently now; a logger that stands still costs nothing."""
        before, self._lines = self._lines, self._pane()
        if before is None:
            super().refresh()
            return
        missing: Line = []
        for y in range(max(len(before), len(self._lines))):
            old = before[y] if y < len(before) else missing
            if old != (self._lines[y] if y < len(self._lines) else missing):
                super().refresh(Region(0, y, self.content_size.width, 1))

    def refresh(self, *regions: Region, **what: Any) -> "Inspector":
        """Paint all of it anew."""
        if not regions:
            self._lines = self._plotted_of = None
        return super().refresh(*regions, **what)

    def notify_style_update(self) -> None:
        super().notify_style_update()
        self._styles.clear()
        self._lines = self._plotted_of = None

    def plot_names(self) -> list[str]:
        """Return the entries that the pane plots."""
        row = self.session.rows.row
        if row is None or not self.session.table.is_live(row):
            return []
        element = self.session.table.elements[row]
        return [element.name + entry.suffix for entry in element.entries if entry.dtype[1:2] not in "SU"][:MAX_PLOTS]

    def render_line(self, y: int) -> Strip:
        if self._lines is None or self._lines_fit != self.content_size:
            self._lines = self._pane()
        width, base = self.content_size.width, self.rich_style
        pieces = self._lines[y] if y < len(self._lines) else []
        segments, room = [], width
        for words, style in pieces:
            if cut := cut_to(words, room):
                segments.append(Segment(cut, base + self._style(style)))
            room = max(0, room - cell_len(words))
        return Strip(segments).adjust_cell_length(width, base)

    def _style(self, words: str) -> Style:
        if words not in self._styles:
            self._styles[words] = Style.parse(" ".join(word for word in words.split() if word != "none"))
        return self._styles[words]

    def _color(self, name: str) -> str:
        return color(self.app.theme_variables, name)

    def _pane(self) -> list[Line]:
        self._lines_fit = self.content_size
        row = self.session.rows.row
        if row is None:
            return []
        element = self.session.table.elements[row]
        reading = self.session.live.readings.get(element.name)
        pane = InspectorLines()
        width, height = self.content_size
        name = self.session.short_name(element.name)
        for start in range(0, len(name), max(8, width)):
            pane.append(name[start : start + max(8, width)] + "\n", style="bold")
        if not self.spread:
            self._facts(pane, element, row, reading)
            self._values(pane, element, row, reading)
            lines = pane.lines[:-1]
            return [*lines, *self._plots(row, width, height - len(lines))]
        facts, values, title = InspectorLines(), InspectorLines(), pane.lines[:-1]
        self._facts(facts, element, row, reading)
        self._values(values, element, row, reading)
        shown = [each for each in values.lines[:-1] if any(words for words, _ in each)]  # no blank line: rows are few
        room = height - len(title) - len(shown)
        right = [*shown, *self._plots(row, self.plot_width, room)]
        return [*title, *beside(facts.lines, right, width // 2)]

    def _facts(self, pane: InspectorLines, element: ElementInfo, row: int, reading: Reading | None) -> None:
        if self.session.at_s is not None:
            self._facts_of_file(pane, element)
            return
        quiet = self._color("quiet")
        shape = " x ".join(str(side) for side in element.shape)
        dtype = element.entries[0].dtype.lstrip("<>|=") if element.entries else ""
        unit = "" if element.unit == "-" else f"  [{element.unit}]"
        pane.append(f"{element.kind} {shape} {dtype}{unit}".replace("  ", " ") + "\n", style=quiet)
        self._described(pane, element)
        table = self.session.table
        values, server, pending, conflicts = table.values, table.server, table.pending, table.conflicts
        for field in Field if not element.expression else (Field.ENABLED, Field.DIVIDER):
            pane.append(f"{field.label:<12} ", style=quiet)
            if pending[field, row]:
                pane.append(f"{phrase_for(field, int(server[field, row]))} → ")
                pane.append(phrase_for(field, int(values[field, row])), style=f"underline {self._color('pending')}")
                pane.append(" ! changed by somebody else" if conflicts[field, row] else "")
            else:
                pane.append(phrase_for(field, int(values[field, row])))
            if (given := int(table.given[field, row])) != server[field, row]:
                pane.append(f"  (began as {phrase_for(field, given)})", style=quiet)
            pane.append("\n")
        frequency = self.session.status.frequency_hz
        if frequency and not element.expression:
            divider, size = int(values[Field.DIVIDER, row]), int(values[Field.SIZE, row])
            holds = text.span(size * divider / frequency)
            pane.append(f"{'which holds':<12} ", style=quiet)
            pane.append(f"{holds} at {text.short(frequency / divider)} Hz\n")
        if reading is not None:
            size = reading.size or int(server[Field.SIZE, row])
            share = fill_share(reading.held, size)
            pane.append(f"{'held':<12} ", style=quiet)
            pane.append(f"{text.count(reading.held)} ")
            pane.append(text.bar(share, 4 if self.content_size.width < 34 else 8), style=self._color("plot"))
            pane.append(f" {share:.0%}\n")
            if reading.lost:
                pane.append(f"{'lost':<12} {text.count(reading.lost)}\n", style=self._color("alarm"))
            if reading.failed:
                pane.append(f"{'not read':<12} at {many(reading.failed, 'tick')}\n", style=self._color("alarm"))

    def _described(self, pane: InspectorLines, element: ElementInfo) -> None:
        """Tell what it is, beside the table in some lines; below it lines are few."""
        words = element.description
        lines = [words] if self.spread else lines_of(words, max(8, self.content_size.width), self.app.console)
        for line in lines[:DESCRIBED] if words else ():
            pane.append(line + "\n", style=self._color("quiet"))

    def _facts_of_file(self, pane: InspectorLines, element: ElementInfo) -> None:
        report = self.session.rows_of[element.name]
        self._described(pane, element)
        facts = [
            ("kind", element.kind), ("type", type_word(element, report)), ("unit", element.unit),
            ("divider", str(report.divider)), ("samples", text.count(report.samples)),
            ("span s", span_words(report)),
            ("rate", f"{text.short(report.rate_hz, 5)} Hz" if report.rate_hz else "-"),
            ("buffer", report.buffer), ("lost", text.count(report.lost)),
        ]  # fmt: skip
        if report.failures.count:
            facts.append(("not read", f"at {many(report.failures.count, 'tick')}"))
        for label, words in facts:
            style = self._color("alarm") if label == "not read" or (label == "lost" and report.lost) else ""
            pane.append(f"{label:<9} ", style=self._color("quiet"))
            pane.append(words + "\n", style=style)
        if report.labels:
            shown = [f"{number} {word}" for number, word in list(report.labels.items())[:MAX_LABELS]]
            more = ", …" if len(report.labels) > MAX_LABELS else ""
            pane.append(", ".join(shown) + more + "\n", style=self._color("quiet"))

    def _why_no_value(self, element: ElementInfo, row: int, reading: Reading | None) -> str:
        """Return why there is none, empty where there is one."""
        session, held = self.session, reading is not None and reading.held > 0
        if session.at_s is not None:
            none = "no sample yet" if session.rows_of[element.name].samples else "no samples in this file"
            return "" if held else none
        if not session.table.server[Field.ENABLED, row]:
            return "not computed" if element.expression else f"not logged; {key_of('toggle')} switches it on"
        none = "no values yet" if session.running else f"not running; {key_of('start_stop')} starts it"
        return "" if held else none

    def _values(self, pane: InspectorLines, element: ElementInfo, row: int, reading: Reading | None) -> None:
        at_s, quiet = self.session.at_s, self._color("quiet")
        pane.append("\n" if at_s is None else f"\nat {text.short(at_s, 6)} s:\n", style=quiet)
        why = self._why_no_value(element, row, reading)
        if why or reading is None:
            pane.append(f"{why}\n", style=quiet)
            return
        if reading.why is not None:
            pane.append(f"{NOT_LIVE_TEXTS[reading.why]}\n", style=quiet)
        style = "" if self.session.fresh and self.session.running else quiet
        table, live, running = self.session.table, self.session.live, self.session.running
        sight = Sight(table, live, lambda _: 0, str, at_s=at_s, running=running, room=30, value_room=30)
        if len(element.entries) == 1:
            pane.append(cells.value(sight, row, 30)[0] + "\n", style=style)
            return
        entries = element.entries[:MAX_VALUES]
        called = [component_name(entry.suffix) for entry in entries]
        left = min(18, max(map(len, called)) + 1)
        sight.room = sight.value_room = room = min(16, max(8, self.content_size.width - left))
        for position in range(len(entries)):
            word, _ = cells.entry_value(sight, row, position, room)
            pane.append(called[position][: left - 1].ljust(left), style=quiet)
            pane.append(f"{word:>{room}}\n", style=style)
        if len(element.entries) > MAX_VALUES:
            pane.append(f"and {len(element.entries) - MAX_VALUES} more; {key_of('monitor')} plots them\n", style=quiet)

    def _plots(self, row: int, width: int, room: int) -> list[Line]:
        """Return the plots of the element, drawn once a second: they are most of what a frame sends."""
        columns, now_s = self.columns, time.monotonic()
        key = (row, width, room, columns, columns.past_until_ns, self.session.fresh)
        if self._plotted_of != key or now_s >= self._plots_due_s:
            self._plotted_of, self._plots_due_s = key, now_s + pace_of(self.app).trend_s
            self._plotted = InspectorLines()
            self._draw_plots(self._plotted, row, width, room)
        return self._plotted.lines[:-1]

    def _draw_plots(self, pane: InspectorLines, row: int, width: int, room: int) -> None:
        columns = self.columns
        names = [name for name in self.plot_names() if columns.row(name) is not None]
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
            prefix = self.session.table.elements[row].name
            title = f"{component_name(name[len(prefix) :]) or 'value'}  {ends}"
            span = text.span(min(columns.count, shown_columns) * columns.column_ns / 1e9)
            pane.append(f"{title}  {span}\n", style=self._color("quiet"))
            for line in braille.rasterise(piece.low, piece.high, scale, max(8, width), height, piece.marks):
                pane.append(line + "\n", style=self._color("plot") if self.session.fresh else self._color("quiet"))

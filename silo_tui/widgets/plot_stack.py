"""Live plots one below the other, made of braille by NumPy and drawn line by line.

Measured: 5 - 8 ms for a screen full; twenty of Textual's Sparkline widgets at 10 Hz cost a quarter of a core.
"""

import math
from dataclasses import dataclass
from itertools import groupby
from typing import ClassVar

from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.geometry import Region
from textual.message import Message
from textual.strip import Strip
from textual.widget import Widget

from silo.columns import HOLE_TEXTS, Hole
from silo_tui.model import text
from silo_tui.model.braille import BLANK, band
from silo_tui.model.columns import ColumnStore
from silo_tui.model.live import Reading, entry_text, offset_text
from silo_tui.model.plots import Picture, Plotted, PlotWindow, draw
from silo_tui.model.source import PlotSource

AXIS = 10  # cells for the numbers on the left
LEAST, MOST = 4, 14  # lines of a plot with its title


class PlotStack(Widget):
    """Draws the plots that fit; which one is chosen and which come first is kept here."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {
        "plot--title", "plot--chosen", "plot--quiet", "plot--line", "plot--stale", "plot--cursor",
    }  # fmt: skip
    DEFAULT_CSS = "PlotStack { height: 1fr; width: 1fr; }"

    def __init__(self, plots: list[Plotted], window: PlotWindow, source: PlotSource) -> None:
        super().__init__()
        self.plots = plots
        self.window = window
        self.source = source
        self.store = ColumnStore((), 1, 1)
        self.readings: dict[str, Reading] = {}
        self.prefix = ""
        self.fresh = True
        self.chosen = 0
        self.first = 0
        self._pictures: dict[int, Picture] = {}
        self._drawn: dict[int, list[Segment]] = {}

    # --------------------------------------------------------------------------------------------------- mouse

    @dataclass
    class Pointed(Message):
        """A plot was clicked: which one, and in which column from the right edge (None: beside the curve)."""

        index: int
        column: int | None

    @dataclass
    class Wheeled(Message):
        """The wheel was turned: down (1) or up (-1), to zoom where ctrl was held."""

        step: int
        zooms: bool

    def on_click(self, event: events.Click) -> None:
        """Ask for the plot and the place that was clicked."""
        index = self.first + event.y // self.block
        if index < min(len(self.plots), self.first + self.fitting):
            cell = event.x - AXIS - 1
            inside = 0 <= cell < self.plot_width and event.y % self.block > 0
            self.post_message(self.Pointed(index, 2 * (self.plot_width - 1 - cell) if inside else None))

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        """Ask for the next plot, or a longer span."""
        event.stop()
        self.post_message(self.Wheeled(1, zooms=event.ctrl))

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        """Ask for the plot before, or a shorter span."""
        event.stop()
        self.post_message(self.Wheeled(-1, zooms=event.ctrl))

    # ------------------------------------------------------------------------------------------------ geometry

    @property
    def plot_width(self) -> int:
        """Cells of a curve."""
        return max(4, self.size.width - AXIS - 2)

    @property
    def columns(self) -> int:
        """Columns of a curve: two per cell."""
        return 2 * self.plot_width

    @property
    def block(self) -> int:
        """Lines of a plot with its title."""
        room = max(LEAST, self.size.height - 1)
        return max(LEAST, min(MOST, room // max(1, len(self.plots))))

    @property
    def fitting(self) -> int:
        """Plots that fit on the screen."""
        return max(1, (self.size.height - 1) // self.block)

    def on_screen(self) -> list[Plotted]:
        """The plots that are visible now."""
        return self.plots[self.first : self.first + self.fitting]

    def choose(self, index: int) -> bool:
        """Chooses a plot and brings it on the screen; True when other plots are visible then."""
        self.chosen = max(0, min(index, len(self.plots) - 1))
        first = min(max(self.first, self.chosen - self.fitting + 1), self.chosen)
        first = max(0, min(first, len(self.plots) - self.fitting))
        moved, self.first = first != self.first, first
        self.redraw()
        return moved

    def redraw(self) -> None:
        """Everything anew."""
        self._pictures.clear()
        self._drawn.clear()
        self.refresh()

    def advance(self) -> None:
        """New columns came: only lines that look different are painted."""
        self._pictures.clear()
        drawn, self._drawn = self._drawn, {}
        for line in range(self.size.height):
            if drawn.get(line) != self._line(line):
                self.refresh(Region(0, line, self.size.width, 1))

    # ------------------------------------------------------------------------------------------------- drawing

    def render_line(self, y: int) -> Strip:
        """One line of a plot, or the time axis."""
        return Strip(self._line(y)).adjust_cell_length(self.size.width, self._style("plot--quiet"))

    def _line(self, y: int) -> list[Segment]:
        if y not in self._drawn:
            self._drawn[y] = self._segments(y)
        return self._drawn[y]

    def _style(self, name: str) -> Style:
        return self.get_component_rich_style(name)

    def _segments(self, y: int) -> list[Segment]:
        slot, line = divmod(y, self.block)
        used = min(self.fitting, len(self.plots) - self.first)
        if slot >= used:
            return self._time_axis() if y == used * self.block else []
        index = self.first + slot
        plotted = self.plots[index]
        if line == 0:
            return self._title(index, plotted)
        if not plotted.numeric:
            return self._text(plotted) if line == 1 else []
        if not self.source.is_live(plotted.element.name):
            words = " " * AXIS + " off: t in the table switches it on"
            return [Segment(words if line == 1 else "", self._style("plot--quiet"))]
        return self._curve(index, line - 1)

    def _picture(self, index: int) -> Picture:
        if index not in self._pictures:
            plotted = self.plots[index]
            period = self.source.period_ns(plotted.element.name)
            self._pictures[index] = draw(self.store, self.window, plotted, self.plot_width, self.block - 1, period)
        return self._pictures[index]

    def _title(self, index: int, plotted: Plotted) -> list[Segment]:
        style = self._style("plot--chosen" if index == self.chosen else "plot--title")
        quiet = style + Style(bold=False)
        unit = "" if plotted.element.unit == "-" else f" {plotted.element.unit}"
        facts = ""
        if plotted.numeric and self.source.is_live(plotted.element.name):
            facts = self._facts(index, plotted)
        width = self.size.width
        mark = ">" if index == self.chosen else " "
        room = width - len(facts) - len(unit) - 4
        name = plotted.name
        if self.prefix and name.startswith(self.prefix + "/"):
            name = name[len(self.prefix) :]
        name = text.shorten_left(name, max(8, room))
        origin = self._ends(index)[2] if facts else ""
        if origin and len(name) + len(origin) + 7 <= room:
            name += f"  from {origin}"
        gap = max(1, width - 1 - len(mark) - len(name) - len(unit) - len(facts))
        return [Segment(mark + name, style), Segment(unit + " " * gap + facts + " ", quiet)]

    def _facts(self, index: int, plotted: Plotted) -> str:
        """The numbers at the right end of a title."""
        picture = self._picture(index)
        if picture.at_cursor is not None:
            low, high = (offset_text(plotted.entry, end, picture.base, 12) for end in picture.at_cursor)
            highest = f" … {high}" if high != low else ""
            return f"at cursor {low}{highest}" + (f" {picture.cursor_signs}" if picture.cursor_signs else "")
        if picture.cursor_signs:
            return f"at cursor {picture.cursor_signs}"
        words = [picture.signs] if picture.signs else []
        if not math.isnan(picture.smallest):
            smallest, largest = self._extremes(plotted, picture)
            words += [f"min {smallest}", f"max {largest}"]
        return "  ".join([*words, f"now {self._now(plotted)}"]) if words else ""

    def _extremes(self, plotted: Plotted, picture: Picture) -> tuple[str, str]:
        if picture.base or plotted.entry.dtype[1:2] == "M":
            smallest, largest = (
                offset_text(plotted.entry, end, picture.base, 12) for end in (picture.smallest, picture.largest)
            )
            return smallest, largest
        return text.told_apart(picture.smallest, picture.largest)

    def missing(self) -> str:
        """What the chosen plot has no samples of, and why."""
        if not self.plots or not self.plots[self.chosen].numeric or self.store.empty:
            return ""
        cell_s = 2 * self.store.column_ns / 1e9
        seconds: dict[Hole, float] = {}
        for hole in self._picture(self.chosen).holes:
            seconds[hole.why] = seconds.get(hole.why, 0.0) + (hole.stop - hole.start) * cell_s
        return ", ".join(f"{text.span(float(f'{some:.2g}'))} {HOLE_TEXTS[why]}" for why, some in seconds.items())

    def _now(self, plotted: Plotted) -> str:
        reading = self.readings.get(plotted.element.name)
        if reading is None or plotted.position >= len(reading.newest) or not reading.held:
            return "-"
        word = reading.texts.get(plotted.position)
        # a number has all its digits, however many
        width = max(12, len(word)) if word is not None and plotted.entry.dtype[1:2] in "iu" else 12
        return entry_text(plotted.entry, float(reading.newest[plotted.position]), word, width)

    def _text(self, plotted: Plotted) -> list[Segment]:
        reading = self.readings.get(plotted.element.name)
        word = reading.texts.get(plotted.position, "") if reading is not None else ""
        return [Segment(" " * AXIS + f" {text.clean(word) or '-'}", self._style("plot--line"))]

    def _curve(self, index: int, line: int) -> list[Segment]:
        picture = self._picture(index)
        bottom, top, _ = self._ends(index)
        label = top if line == 0 else bottom if line == len(picture.lines) - 1 else ""
        cells = picture.lines[line]
        style = self._style("plot--line" if self.fresh else "plot--stale")
        axis = Segment(f"{label:>{AXIS - 1}} │", self._style("plot--quiet"))
        styles = [style] * len(cells)
        for hole in picture.holes if line in band(len(picture.lines)) else ():
            styles[hole.start : hole.stop] = [self._style("plot--quiet")] * (hole.stop - hole.start)
        if self.window.cursor is not None:
            at = max(0, len(cells) - 1 - self.window.cursor // 2)
            cells = cells[:at] + cells[at].replace(BLANK, "│") + cells[at + 1 :]
            styles[at] = self._style("plot--cursor")
        pieces = groupby(zip(cells, styles, strict=True), lambda cell: cell[1])
        return [axis, *(Segment("".join(char for char, _ in some), its) for its, some in pieces)]

    def _ends(self, index: int) -> tuple[str, str, str]:
        """What stands at both ends of the scale, and what these count from."""
        picture, entry = self._picture(index), self.plots[index].entry
        ends = picture.scale
        if entry.labels and all(end == end // 1 and int(end) in entry.labels for end in ends):
            bottom, top = (entry.labels[int(end)][: AXIS - 1] for end in ends)
            return bottom, top, ""
        if entry.dtype[1:2] == "M" and not math.isnan(ends[0]):
            words = [offset_text(entry, end, picture.base, 30) for end in ends]
            if words[0][: AXIS - 2] != words[1][: AXIS - 2]:
                return words[0][: AXIS - 2], words[1][: AXIS - 2], ""
        return text.axis_ends(*ends, picture.base)

    def _time_axis(self) -> list[Segment]:
        width = self.plot_width
        line = [" "] * width
        for share in (0.0, 0.25, 0.5, 0.75, 1.0):
            word = self._axis_word(share)
            start = min(width - len(word), max(0, round(share * width) - (len(word) // 2 if 0 < share < 1 else 0)))
            if all(char == " " for char in line[max(0, start - 1) : start + len(word) + 1]):
                line[start : start + len(word)] = word
        return [Segment(" " * (AXIS + 1) + "".join(line), self._style("plot--quiet"))]

    def _axis_word(self, share: float) -> str:
        """What stands under a place of the time axis, 0 ... 1 from left to right."""
        if share == 1.0:
            return "now" if self.source.live and not self.window.paused else "0"
        return "-" + text.span(self.window.span_s * (1 - share))

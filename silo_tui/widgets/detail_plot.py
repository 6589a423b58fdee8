"""One plot that fills the screen, with what is said of it below, or at its right where there is room."""

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap
from typing import ClassVar

from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.message import Message
from textual.strip import Strip

from silo_tui.model.drawing.big_plot import BigPlot
from silo_tui.model.drawing.dots import BLANK
from silo_tui.model.plots.picture import AXIS
from silo_tui.model.plots.time_axis import axis_line
from silo_tui.model.words.text import cut
from silo_tui.unforeseen import Guarded
from silo_tui.widgets.plot_stack import CURSOR_A
from silo_tui.widgets.styled import Styled, segments_of, series_style

WIDE, SIDE = 140, 42  # from how many columns on the notes stand at the right, and how much they take
BELOW = 4  # lines for them elsewhere


class DetailPlot(Guarded, Styled):
    """Draws a `BigPlot`, or says why there is none."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {"plot--quiet", "plot--line", "plot--cursor", "plot--title"}

    def __init__(self) -> None:
        super().__init__(id="detail-plot")
        self.plot: BigPlot | None = None
        self.notes: Sequence[str] = ()
        self.message = "reading …"
        self.cursor: int | None = None  # cell

    @property
    def beside(self) -> bool:
        """Whether the notes stand at the right."""
        return self.size.width >= WIDE

    @property
    def plot_size(self) -> tuple[int, int]:
        """Cells of the plot itself."""
        width = self.size.width - AXIS - 1 - 2 - (SIDE if self.beside else 0)
        return max(10, width), max(3, self.size.height - 1 - (0 if self.beside else BELOW))

    @dataclass
    class CellPointed(Message):
        """A cell of the plot was clicked."""

        cell: int

    def on_click(self, event: events.Click) -> None:
        cell = event.x - AXIS - 1
        if 0 <= cell < self.plot_size[0] and event.y < self.plot_size[1]:
            self.post_message(self.CellPointed(cell))

    def show(self, plot: BigPlot | None, notes: Sequence[str]) -> None:
        """Show a plot and what is said of it."""
        self.plot, self.notes = plot, [*(plot.notes if plot is not None else ()), *notes]
        self.refresh()

    def say(self, message: str) -> None:
        """Say why there is nothing to draw."""
        self.plot, self.message = None, message
        self.refresh()

    def render_line(self, y: int) -> Strip:
        quiet = self._style("plot--quiet")
        if self.plot is None:
            return Strip([Segment(f"  {self.message}" if y == 1 else "", quiet)]).adjust_cell_length(
                self.size.width, quiet
            )
        width, height = self.plot_size
        if y < height:
            found = self._curve(self.plot, y)
        elif y == height:
            line = axis_line(width, self.plot.below, (), {})
            found = [Segment(" " * (AXIS + 1) + line, quiet)]
        else:
            found = self._note(y - height - 1, self.size.width)
        strip = Strip(found)
        if self.beside:
            left = strip.adjust_cell_length(self.size.width - SIDE, quiet)
            return Strip([*left, *self._note(y, SIDE)]).adjust_cell_length(self.size.width, quiet)
        return strip.adjust_cell_length(self.size.width, quiet)

    def _note(self, line: int, width: int) -> list[Segment]:
        words = self._wrapped(width - 2)
        style = self._style("plot--title")
        return [Segment(f" {words[line]}", style + Style(bold=False))] if line < len(words) else []

    def _wrapped(self, width: int) -> list[str]:
        """The notes as lines: several in one where they fit."""
        if self.beside:
            return [line for note in self.notes for line in wrap(note, width, subsequent_indent="  ")]
        lines: list[str] = []
        for note in self.notes:
            if lines and len(lines[-1]) + 3 + len(note) <= width:
                lines[-1] += " │ " + note
            else:
                lines.append(note)
        return [cut(line, width) for line in lines]

    def _color(self, owner: int) -> Style:
        if owner < 0:
            return self._style("plot--quiet")
        line = self._style("plot--line")
        if self.plot is not None and self.plot.aged:
            return (self._style("plot--quiet"), line, line, line + Style(bold=True))[owner]
        return line if owner == 0 else line + series_style(self.app, owner)

    def _curve(self, plot: BigPlot, y: int) -> list[Segment]:
        quiet = self._style("plot--quiet")
        chars = list(plot.lines[y]) if y < len(plot.lines) else []
        styles = [self._color(owner) for owner in plot.owners[y].tolist()] if chars else []
        if self.cursor is not None and self.cursor < len(chars):
            chars[self.cursor] = chars[self.cursor].replace(BLANK, CURSOR_A)
            styles[self.cursor] = self._style("plot--cursor")
        for line, cell, sign in plot.spots:
            for place, char in enumerate(sign):
                if line == y and cell + place < len(chars):
                    chars[cell + place] = char
                    styles[cell + place] = self._style("plot--title")
        label = plot.left.get(y, "")
        found = [Segment(f"{label:>{AXIS - 1}} {'┤' if label else '│'}", quiet)]
        found += segments_of(chars, styles)
        return [*found, Segment("│", quiet)]

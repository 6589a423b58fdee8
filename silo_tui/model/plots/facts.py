"""What the titles of plots say of their signals: the value now, or at the cursor, and what the window shows. Pure."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from silo.core.arrays.columns import HOLE_TEXTS, ColumnPiece, ColumnStore, Gap
from silo_tui.model.drawing import braille
from silo_tui.model.drawing.plots import Picture, Plotted
from silo_tui.model.drawing.window import PlotWindow
from silo_tui.model.samples.live import Reading, entry_text, offset_text
from silo_tui.model.words import text
from silo_tui.model.words.text import Digits


@dataclass(frozen=True)
class PlotFacts:
    """The readings of signals, in a window."""

    window: PlotWindow
    readings: Mapping[str, Reading]
    ended: bool  # nothing comes any more

    @property
    def when(self) -> str:
        """Of when the readings are: of now, or while it stands still of the cursor, or of the right end."""
        if not self.window.paused:
            return "last" if self.ended else "now"
        return "at cursor" if self.window.cursor is not None else "at end"

    def when_of(self, picture: Picture) -> str:
        """Return of when that is what `brief` tells."""
        return "at cursor" if picture.at_cursor is not None or picture.cursor_signs else self.when

    def now(self, plotted: Plotted, digits: Digits | None = None) -> str:
        """Return the value that is told; a dash where none is known."""
        reading = self.readings.get(plotted.element.name)
        if reading is None or plotted.position >= len(reading.newest) or not reading.held:
            return "-"
        word = reading.texts.get(plotted.position)
        # a number has all its digits, however many
        width = max(12, len(word)) if word is not None and plotted.entry.dtype[1:2] in "iu" else 12
        return entry_text(plotted.entry, float(reading.newest[plotted.position]), word, width, digits)

    def sample(self, plotted: Plotted, digits: Digits | None) -> str:
        """Return the sample that held at cursor A; empty where it isn't known."""
        reading = self.readings.get(plotted.element.name)
        known = self.window.paused and reading is not None and reading.held and reading.time_ns == self.window.at_ns
        return self.now(plotted, digits) if known else ""

    def brief(self, plotted: Plotted, picture: Picture) -> str:
        """Return what stands beside the name of one of several: its value at the cursor, or the newest one."""
        digits = digits_of_picture(picture, 9)
        if picture.at_cursor is not None:
            low, high = (offset_text(plotted.entry, end, picture.axis.base, 9, digits) for end in picture.at_cursor)
            return low if low == high else self.sample(plotted, digits) or f"{low}…{high}"
        return picture.cursor_signs or self.now(plotted, digits)

    def of_curve(self, plotted: Plotted, picture: Picture) -> str:
        """Return the numbers at the right end of the title of a curve."""
        digits = digits_of_picture(picture)
        if picture.at_cursor is not None:
            low, high = (offset_text(plotted.entry, end, picture.axis.base, 12, digits) for end in picture.at_cursor)
            highest = f" … {high}" if high != low else ""
            if highest and (sample := self.sample(plotted, digits)):  # the column has more of them
                return f"at cursor {sample} ({low}{highest})"
            return f"at cursor {low}{highest}" + (f" {picture.cursor_signs}" if picture.cursor_signs else "")
        if picture.cursor_signs:
            return f"at cursor {picture.cursor_signs}"
        words = [picture.signs] if picture.signs else []
        if not math.isnan(picture.smallest):
            smallest, largest = extremes(plotted, picture)
            words += [f"min {smallest}", f"max {largest}"]
        return "  ".join([*words, f"{self.when} {self.now(plotted, digits)}"]) if words else ""

    def of_lane(self, plotted: Plotted, piece: ColumnPiece, columns: int) -> str:
        """Return what stands at the right end of the title of a lane, a band or a text."""
        if self.window.cursor is None:
            return f"{self.when} {self.now(plotted)}"
        if self.window.paused and plotted.element.name in self.readings:  # the sample that held then
            return f"at cursor {self.now(plotted)}"
        last = columns - 1 - self.window.cursor
        found = braille.value_range(piece.low[max(0, last - 1) : last + 1], piece.high[max(0, last - 1) : last + 1])
        if found is None:
            return ""
        words = dict.fromkeys(offset_text(plotted.entry, end, piece.base, 12) for end in found)
        return "at cursor " + " … ".join(words)


def digits_of_picture(picture: Picture, width: int = 12) -> Digits | None:
    """Return how the numbers beside a curve are written: for the range of its axis, which stays while they change."""
    axis = picture.axis
    return None if axis.log or axis.base or math.isnan(axis.scale[0]) else text.digits_for(axis.scale, width)


def extremes(plotted: Plotted, picture: Picture) -> tuple[str, ...]:
    """Return the smallest and the largest value of a picture."""
    digits, ends = digits_of_picture(picture), (picture.smallest, picture.largest)
    return tuple(offset_text(plotted.entry, end, picture.axis.base, 12, digits) for end in ends)


def missing(piece: ColumnPiece, store: ColumnStore, width: int, *, before: bool = True) -> str:
    """Return what a curve of so many cells has no samples of, and why; `before`: also what was before the start."""
    cell_s = 2 * store.column_ns / 1e9
    seconds: dict[Gap, float] = {}
    for hole in braille.holes(piece.low, piece.marks, width):
        if before or hole.why is not Gap.BEFORE:
            seconds[hole.why] = seconds.get(hole.why, 0.0) + (hole.stop - hole.start) * cell_s
    words = ", ".join(f"{text.span(some, 2)} {HOLE_TEXTS[why]}" for why, some in seconds.items())
    return f"{braille.SHADE} {words}" if seconds.keys() - {Gap.BEFORE} else words

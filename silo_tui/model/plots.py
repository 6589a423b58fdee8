"""The time window of the monitor, shared by all its plots: span, pause, cursor, y scale; and what a plot is of."""

import math
from dataclasses import dataclass, field

import numpy as np

from silo.columns import Mark, Marks
from silo.model import ElementInfo, Entry
from silo_tui.model import braille
from silo_tui.model.columns import ColumnStore, Floats, Piece, hold_piece

SPANS_S = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0)
MAX_COLUMNS = 4096
SECOND_NS = 1_000_000_000


@dataclass(frozen=True)
class Plotted:
    """One plot: an entry of an element."""

    element: ElementInfo
    position: int

    @property
    def entry(self) -> Entry:
        """The entry that is plotted."""
        return self.element.entries[self.position]

    @property
    def name(self) -> str:
        """Full name of the entry."""
        return self.element.name + self.entry.suffix

    @property
    def numeric(self) -> bool:
        """Whether there is a curve to draw."""
        return self.entry.dtype[1:2] not in "SU"


def plots_of(elements: list[ElementInfo]) -> list[Plotted]:
    """Return every entry of every element, in their order."""
    return [Plotted(element, position) for element in elements for position in range(len(element.entries))]


@dataclass
class PlotWindow:
    """State of the time axis. Widths are in columns, two per cell."""

    span_s: float = 10.0
    paused_end_ns: int | None = None  # right edge while the picture stands still
    cursor: int | None = None  # columns from the right edge
    fixed_scale: bool = False
    scales: dict[str, tuple[float, float]] = field(default_factory=dict)
    spans: tuple[float, ...] = SPANS_S
    _bases: dict[str, int] = field(default_factory=dict)

    @property
    def paused(self) -> bool:
        """Whether the picture stands still while the data goes on."""
        return self.paused_end_ns is not None

    @property
    def span_ns(self) -> int:
        """The span in nanoseconds."""
        return round(self.span_s * SECOND_NS)

    def column_ns(self, columns: int) -> int:
        """Return the width of a column so that `columns` of them cover the span."""
        return max(1, math.ceil(self.span_ns / max(1, min(columns, MAX_COLUMNS))))

    def zoom(self, *, closer: bool) -> bool:
        """Take the next shorter or longer span; False at the end of the list."""
        place = self.spans.index(self.span_s) + (-1 if closer else 1)
        if not 0 <= place < len(self.spans):
            return False
        self.span_s = self.spans[place]
        return True

    def move_cursor(self, cells: int, columns: int) -> int:
        """Move the cursor to the right (positive) or left by cells; it appears in the middle.

        Returns the columns by which it would have left the window: negative to the left.
        """
        if self.cursor is None:
            self.cursor = columns // 4 * 2
            return 0
        wanted = self.cursor - 2 * cells
        self.cursor = max(0, min(columns - 2, wanted))
        return self.cursor - wanted

    def follow_scale(self, name: str, low: Floats, high: Floats, base: int = 0) -> tuple[float, float]:
        """Return bottom and top of a plot: of what is in the window, or as it was when the scale was held."""
        if self.fixed_scale and name in self.scales and self._bases.get(name, 0) == base:
            return self.scales[name]
        self._bases[name] = base
        found = braille.value_range(low, high)
        if found is None:
            return self.scales.get(name, (math.nan, math.nan))
        self.scales[name] = braille.nice_range(*found)
        return self.scales[name]


@dataclass(frozen=True)
class Picture:
    """One plot, ready to be drawn: braille lines, the ends of its scale, and what stands at the cursor.

    All numbers are offsets from `base`; NaN where there is no finite one. `signs` names what is no number.
    """

    lines: tuple[str, ...]
    scale: tuple[float, float]
    smallest: float
    largest: float
    at_cursor: tuple[float, float] | None
    base: int = 0
    holes: tuple[braille.DrawnHole, ...] = ()
    signs: str = ""
    cursor_signs: str = ""


def draw(store: ColumnStore, window: PlotWindow, plotted: Plotted, width: int, height: int, period_ns: int) -> Picture:
    """Draw a plot of `width` x `height` cells from the newest columns of a store."""
    columns = 2 * width
    found = store.piece(plotted.name, store.end, columns)
    piece = hold_piece(found, max(2, 2 * period_ns // max(1, store.column_ns) + 1))
    scale = window.follow_scale(plotted.name, piece.low, piece.high, piece.base)
    ends = braille.value_range(piece.low, piece.high) or (math.nan, math.nan)
    at_cursor, cursor_signs = None, ""
    if window.cursor is not None:
        last = columns - 1 - window.cursor
        here = slice(max(0, last - 1), last + 1)
        if not np.isnan(piece.low[here]).all():
            at_cursor = float(np.nanmin(piece.low[here])), float(np.nanmax(piece.high[here]))
        cursor_signs = signs_of(piece.marks[here])
    return Picture(
        tuple(braille.rasterise(piece.low, piece.high, scale, width, height, piece.marks)),
        scale,
        *ends,
        at_cursor,
        piece.base,
        tuple(braille.holes(piece.low, piece.marks, width)),
        signs_of(piece.marks),
        cursor_signs,
    )


def signs_of(marks: Marks) -> str:
    """Return which samples of these columns are no finite numbers: `nan inf`."""
    flags = int(np.bitwise_or.reduce(marks, initial=0))
    names = ((Mark.NAN, "nan"), (Mark.POS_INF, "inf"), (Mark.NEG_INF, "-inf"))
    return " ".join(name for mark, name in names if flags & mark)


def small_plot(piece: Piece, scale: tuple[float, float], width: int, height: int) -> list[str]:
    """Return the lines of a plot without axes, of what holds between samples already."""
    return braille.rasterise(piece.low, piece.high, scale, width, height, piece.marks)


def trend(piece: Piece, width: int) -> str:
    """Return a whole signal in one line: it fills its height."""
    found = braille.value_range(piece.low, piece.high)
    scale = (math.nan, math.nan)
    if found is not None:
        scale = (found[0] - 1, found[1] + 1) if braille.is_constant(*found) else found
    return small_plot(piece, scale, width, 1)[0]

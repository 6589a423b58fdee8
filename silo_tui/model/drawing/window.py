"""The time window that all plots of a screen share: its end, its span, cursors A and B, and the scales of their axes.

Pure data: where the window may go is what is held, a pair of the oldest and the newest moment, which whoever moves it
hands in. While the picture stands still oldest <= end - span, as far as so much is held, and A is one of its moments.
"""

import math
from typing import TypeAlias

import msgspec

from silo.core.arrays.columns import MAX_COLUMNS
from silo_tui.model.drawing import axes, braille

SPANS_S = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0)
SECOND_NS = 1_000_000_000

Held: TypeAlias = tuple[int, int]  # the oldest and the newest moment that one can look at


class PlotWindow(msgspec.Struct):
    """State of the time axis. Widths are in columns, two per cell."""

    span_s: float = 10.0
    paused_end_ns: int | None = None  # right edge while the picture stands still
    cursor: int | None = None  # columns from the right edge
    at_ns: int | None = None  # while the picture stands still: the moment of cursor A
    other_ns: int | None = None  # the moment of cursor B
    fixed_scale: bool = False
    logs: set[str] = msgspec.field(default_factory=set)  # entries whose axis has powers of ten
    scales: dict[str, tuple[float, float]] = msgspec.field(default_factory=dict)
    log_scales: dict[str, tuple[float, float]] = msgspec.field(default_factory=dict)  # values at the ends of such axes
    spans: tuple[float, ...] = SPANS_S
    _bases: dict[str, tuple[int, int]] = msgspec.field(default_factory=dict)

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

    def fit(self, held: Held) -> None:
        """Take the shortest span that shows all that is held, else the longest."""
        wanted = (held[1] - held[0]) / SECOND_NS
        self.span_s = next((span for span in self.spans if span >= wanted), self.spans[-1])

    def move_cursor(self, cells: int, columns: int) -> None:
        """Move the cursor to the right (positive) or left by cells; it comes in from the side it moves away from."""
        begin = self.cursor if self.cursor is not None else 0 if cells < 0 else columns // 2 * 2
        wanted = begin - 2 * cells
        self.cursor = max(0, min(columns - 2, wanted))

    # ------------------------------------------------------------------------------- while the picture stands still

    def show(self, end_ns: int, held: Held, columns: int) -> None:
        """Put the right edge there, as far as there is something to see."""
        self.paused_end_ns = min(held[1], max(end_ns, held[0] + self.span_ns - self.column_ns(columns)))

    def go_to(self, time_ns: int, held: Held, columns: int) -> bool:
        """Move cursor A to a moment; the window follows when it leaves it: True then."""
        assert self.paused_end_ns is not None
        self.at_ns = time_ns = _inside(time_ns, held)
        end, span, column_ns = self.paused_end_ns, self.span_ns, self.column_ns(columns)
        # in whole columns: where the window begins and ends is between two of them
        if time_ns // column_ns > end // column_ns:
            self.show(max(end + span // 4, time_ns), held, columns)
        elif time_ns // column_ns <= end // column_ns - columns:
            self.show(min(end - span // 4, time_ns + span - column_ns), held, columns)
        else:
            return False
        return True

    def jump_to(self, time_ns: int, held: Held, columns: int) -> bool:
        """Move cursor A to a moment, which comes into the middle if it was not in the window: True then."""
        assert self.paused_end_ns is not None
        leaves = not self.paused_end_ns - self.span_ns < time_ns <= self.paused_end_ns
        if leaves:
            self.show(time_ns + self.span_ns // 2, held, columns)
        return self.go_to(time_ns, held, columns) or leaves

    def pan(self, direction: int, held: Held, columns: int) -> bool:
        """Move by half a window; a cursor in it stays where it is in the picture. False at the edge."""
        assert self.paused_end_ns is not None
        end = self.paused_end_ns
        self.show(end + direction * self.span_ns // 2, held, columns)
        moved = self.paused_end_ns - end
        if self.cursor is not None and self.at_ns is not None:
            self.at_ns = _inside(self.at_ns + moved, held)
        return abs(moved) > 2 * self.column_ns(columns)  # less than a cell is nothing that one sees

    def zoom_still(self, held: Held, columns: int, *, closer: bool) -> bool:
        """Zoom around the cursor if it is in the window, or around its middle; False at the end of the list."""
        assert self.paused_end_ns is not None
        before, end = self.span_ns, self.paused_end_ns
        if not self.zoom(closer=closer):
            return False
        fixed = self.at_ns if self.cursor is not None and self.at_ns is not None else end - before // 2
        self.show(fixed + round((end - fixed) * self.span_ns / before), held, columns)
        return True

    def place_cursor(self, end: int, column_ns: int, columns: int) -> None:
        """Say in which column of the picture the moment of cursor A is, whose columns end before number `end`."""
        if self.at_ns is not None:
            cursor = end - 1 - self.at_ns // column_ns
            self.cursor = cursor if 0 <= cursor < columns else None

    def go_on(self) -> None:
        """Follow what comes again."""
        self.paused_end_ns = self.cursor = self.at_ns = self.other_ns = None
        self.spans = SPANS_S
        self.span_s = max(SPANS_S[0], self.span_s)

    # ------------------------------------------------------------------------------------------------------- scales

    def follow_scale(self, key: str, found: tuple[float, float] | None, lines: int, base: int = 0) -> axes.Scale:
        """Return bottom and top of an axis: around what was found in the window, or as it was when it was held.

        It stays as it is while the values lie inside and use at least half of it: axes that jump can't be read.
        """
        held = self.scales.get(key) if self._bases.get(key, (0, lines)) == (base, lines) else None
        if self.fixed_scale and held is not None:
            return held
        if found is None:
            return self.scales.get(key, (math.nan, math.nan))
        self._bases[key] = (base, lines)
        if held is not None and held[0] <= found[0] and found[1] <= held[1]:
            used = (found[1] / 2 - found[0] / 2) >= (held[1] / 2 - held[0] / 2) / 2
            if used or braille.is_constant(*found):
                return held
        self.scales[key] = axes.round_scale(*found, lines)
        return self.scales[key]


def _inside(time_ns: int, held: Held) -> int:
    return max(held[0], min(time_ns, held[1]))

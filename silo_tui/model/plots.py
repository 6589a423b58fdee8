"""The time window of the monitor: which span it shows, whether it stands still, its cursor, how y is scaled."""

from dataclasses import dataclass, field

from silo_tui.model import braille
from silo_tui.model.columns import Floats

SPANS_S = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0)
MAX_COLUMNS = 4096
SECOND_NS = 1_000_000_000


def column_for(span_s: float, columns: int, shortest_ns: int = 1) -> int:
    """Width of a column so that `columns` of them cover `span_s`, in ns. Not below the sample period of the source."""
    return max(shortest_ns, 1, round(span_s * SECOND_NS / max(1, min(columns, MAX_COLUMNS))))


@dataclass
class PlotWindow:
    """State of the time axis, shared by all plots of a screen. Widths are in columns (two per cell)."""

    span_s: float = 10.0
    paused_end: int | None = None  # absolute column after the newest shown while paused
    cursor: int | None = None  # columns from the right edge
    fixed_scale: bool = False
    scales: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def paused(self) -> bool:
        """Whether the picture stands still while the data goes on."""
        return self.paused_end is not None

    def zoom(self, *, closer: bool) -> bool:
        """The next shorter or longer span; False at the end of the list."""
        place = SPANS_S.index(self.span_s) + (-1 if closer else 1)
        if not 0 <= place < len(SPANS_S):
            return False
        self.span_s = SPANS_S[place]
        return True

    def move_cursor(self, columns: int, width: int) -> None:
        """Moves the cursor by cells to the right (positive) or left; it appears in the middle."""
        if self.cursor is None:
            self.cursor = width // 2
            return
        self.cursor = max(0, min(width - 1, self.cursor - columns))

    def scale(self, name: str, low: Floats, high: Floats) -> tuple[float, float]:
        """Bottom and top of a plot: of what is in the window, or as it was when the scale was fixed."""
        if self.fixed_scale and name in self.scales:
            return self.scales[name]
        found = braille.value_range(low, high)
        scale = braille.nice_range(*found) if found else self.scales.get(name, (-1.0, 1.0))
        self.scales[name] = scale
        return scale

"""Which plots there are, one below the other: which is chosen, which come first, which one a click points at."""

from collections.abc import Sequence
from dataclasses import dataclass

from textual import events
from textual.message import Message
from textual.widget import Widget

from silo_tui.model.panel_picture import AXIS
from silo_tui.model.panels import (
    MAX_SERIES,
    Panel,
    first_to_show,
    has_curves,
    heights,
    per_title_line,
    sides,
    stacked,
    title_lines,
)
from silo_tui.model.plots import Plotted
from silo_tui.model.source import PlotSource
from silo_tui.unforeseen import Guarded
from silo_tui.widgets.series import most_series


class PanelList(Guarded, Widget):
    """The panels of a monitor and how many lines each takes; `PlotStack` draws them."""

    def __init__(self, plots: Sequence[Plotted], source: PlotSource) -> None:
        super().__init__()
        self._take(stacked(plots))
        self.source = source
        self.chosen = 0  # of all signals, those that share a panel counted one by one
        self.first = 0  # panel

    @property
    def plot_width(self) -> int:
        """Cells of a curve."""
        raise NotImplementedError

    def redraw(self) -> None:
        """Draw everything anew."""
        raise NotImplementedError

    # --------------------------------------------------------------------------------------------------- mouse

    @dataclass
    class Pointed(Message, namespace="plot_stack"):
        """A plot was clicked: which one, and in which column from the right edge (None: beside the curve)."""

        index: int
        column: int | None

    @dataclass
    class Wheeled(Message, namespace="plot_stack"):
        """The wheel was turned: down (1) or up (-1), to zoom where ctrl was held."""

        step: int
        zooms: bool

    def on_click(self, event: events.Click) -> None:
        """Ask for the signal and the place that was clicked."""
        found = self.place_of(event.y)
        if found is None:
            return
        at, line = found
        panel = self.panels[at]
        first = sum(len(each) for each in self.panels[:at])
        titles = title_lines(panel, self.size.width)
        if line < titles:
            side_by_side = per_title_line(self.size.width) if len(panel) > 1 else 1
            place = line * side_by_side + event.x * side_by_side // max(1, self.size.width)
            self.post_message(self.Pointed(first + min(place, len(panel) - 1), None))
            return
        cell = event.x - AXIS - 1
        inside = 0 <= cell < self.plot_width
        index = self.chosen if self.chosen_panel == at else first
        self.post_message(self.Pointed(index, 2 * (self.plot_width - 1 - cell) if inside else None))

    def place_of(self, y: int) -> tuple[int, int] | None:
        """Return which panel a line of the widget belongs to, and which line of it that is; None for the time axis."""
        for at, height in enumerate(self.heights(), self.first):
            if y < height:
                return at, y
            y -= height
        return None

    def on_mouse_scroll_down(self, event: events.MouseScrollDown) -> None:
        """Ask for the next plot, or a longer span."""
        event.stop()
        self.post_message(self.Wheeled(1, zooms=event.ctrl))

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        """Ask for the plot before, or a shorter span."""
        event.stop()
        self.post_message(self.Wheeled(-1, zooms=event.ctrl))

    # ---------------------------------------------------------------------------------------------- what is plotted

    @property
    def plots(self) -> list[Plotted]:
        """All signals, in the order of the panels."""
        return self._plots

    def _take(self, panels: Sequence[Panel]) -> None:
        # what is asked for many times a frame is found once: with 700 panels it took 50 ms
        self.panels = list(panels)
        self._plots = [plotted for panel in panels for plotted in panel]
        self.two_sided = any(any(sides(panel)) for panel in panels if has_curves(panel))
        self.worded = any(len(panel) > 1 or not has_curves(panel) for panel in panels)

    @property
    def chosen_plot(self) -> Plotted:
        """The signal that is chosen."""
        return self.plots[self.chosen]

    @property
    def chosen_panel(self) -> int:
        """Where the panel with the chosen signal is."""
        return self._panel_of(self.chosen)

    def _panel_of(self, index: int) -> int:
        for at, panel in enumerate(self.panels):
            index -= len(panel)
            if index < 0:
                return at
        return max(0, len(self.panels) - 1)

    @property
    def most(self) -> int:
        """How many curves may share a panel."""
        return most_series(self.app, MAX_SERIES)

    def show_panels(self, panels: Sequence[Panel]) -> None:
        """Show these panels; the chosen signal stays the chosen one if it is still there."""
        chosen = self.plots[self.chosen] if self.plots else None
        self._take(panels)
        plots = self.plots
        self.choose(plots.index(chosen) if chosen in plots else self.chosen)

    def keep(self, plots: Sequence[Plotted]) -> None:
        """Show these signals: what shares a panel goes on to, new ones come at the end."""
        known = self.plots
        panels = [tuple(plotted for plotted in panel if plotted in plots) for panel in self.panels]
        self.show_panels(
            [panel for panel in panels if panel] + [(plotted,) for plotted in plots if plotted not in known]
        )

    def for_detail(self) -> tuple[list[Plotted], int]:
        """What one large plot shows: the chosen signal, those of its panel, the others; how many share it."""
        shown = [each for each in self.plots if each.numeric and self.source.is_live(each.element.name)]
        chosen, panel = self.chosen_plot, self.panels[self.chosen_panel]
        mine = [each for each in shown if each == chosen] + [each for each in shown if each in panel and each != chosen]
        return mine + [each for each in shown if each not in panel], max(1, len(mine))

    @property
    def _room(self) -> int:
        return max(1, self.size.height - 1)

    def heights(self) -> list[int]:
        """Return how many lines each panel takes that is on the screen."""
        return heights(self.panels, self.first, self._room, self.size.width)

    @property
    def fitting(self) -> int:
        """Panels that are on the screen."""
        return len(self.heights())

    def on_screen(self) -> list[Plotted]:
        """The signals that are visible now."""
        return [plotted for panel in self.panels[self.first : self.first + self.fitting] for plotted in panel]

    def choose(self, index: int) -> bool:
        """Chooses a signal and brings it on the screen; True when other panels are visible then."""
        self.chosen = max(0, min(index, len(self.plots) - 1))
        first = first_to_show(self.panels, self.first, self.chosen_panel, self._room, self.size.width)
        moved, self.first = first != self.first, first
        self.redraw()
        return moved

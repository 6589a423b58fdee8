"""Plots one below the other, made of dots by NumPy and drawn line by line.

Measured: 5 - 8 ms for a screen full; twenty of Textual's Sparkline widgets at 10 Hz cost a quarter of a core.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.geometry import Region, Size
from textual.message import Message
from textual.strip import Strip

from silo.core.arrays.columns import ColumnPiece, ColumnStore, Gap
from silo.core.conditions import Bounds
from silo_tui.actions import key_of
from silo_tui.model.drawing import braille, lanes
from silo_tui.model.drawing.dots import BLANK
from silo_tui.model.drawing.plots import HOLE, NOBODY, Plotted, pieces_of
from silo_tui.model.drawing.window import SECOND_NS, PlotWindow
from silo_tui.model.lists.happened import EVENT_LINE, columns_of, in_plots
from silo_tui.model.plots.facts import PlotFacts, missing
from silo_tui.model.plots.overlay import ghost_piece
from silo_tui.model.plots.panels import (
    LETTERS,
    MAX_SERIES,
    CurveKind,
    Panel,
    first_to_show,
    has_curves,
    heights,
    kind_of,
    per_title_line,
    sides,
    stacked,
    title_lines,
)
from silo_tui.model.plots.picture import AXIS, LIMIT, RED, YELLOW, Drawn, PanelSource, drawn
from silo_tui.model.plots.time_axis import axis_line, axis_words, seconds_words
from silo_tui.model.samples.live import Reading, offset_text
from silo_tui.model.samples.source import PlotSource
from silo_tui.model.words import text
from silo_tui.model.words.names import below, fitted_among
from silo_tui.sessions.recorded import FileSession
from silo_tui.unforeseen import Guarded
from silo_tui.widgets.styled import Styled, segments_of, series_style

CURSOR_A, CURSOR_B = "│", "┊"
GHOST = Style(dim=True)


class PlotStack(Guarded, Styled):
    """Keeps the plots of a screen, which is chosen and which come first, and draws those that fit."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {
        "plot--title", "plot--chosen", "plot--quiet", "plot--line", "plot--stale", "plot--cursor", "plot--band",
        "plot--red", "plot--yellow",
    }  # fmt: skip

    def __init__(self, plots: list[Plotted], window: PlotWindow, source: PlotSource) -> None:
        super().__init__()
        self._take(stacked(plots))
        self.source = source
        self.chosen = 0  # of all signals, those that share a panel counted one by one
        self.first = 0  # panel
        self.window = window
        self.store = ColumnStore((), 1, 1)
        self.readings: Mapping[str, Reading] = {}
        self.bounds: Mapping[str, Bounds] = {}  # the limits of scalars
        self.level: float | None = None  # of a scope that waits for the first signal
        self.events: dict[str, list[tuple[int, str]]] = {}  # of texts: since when which
        self.ghost: ColumnStore | None = None  # a saved run, on the grid of the live one
        self.prefix = ""
        self.fresh = True
        self.ended = False  # nothing comes any more: the program is dead
        self._drawn_panels: dict[int, Drawn] = {}
        self._drawn: dict[int, list[Segment]] = {}
        self._drawn_for = Size(0, 0)
        self._drawn_end = 0  # of the store
        self._right_width = self.right_width  # that was drawn
        self._happened: dict[frozenset[str], dict[int, str]] = {}  # by the signals that it happened to
        self._happened_key: tuple[int, ...] = ()

    # ------------------------------------------------------------------------------------------------ geometry

    @property
    def right_width(self) -> int:
        """Cells right of the curves: for letters, words of lanes, or a second axis."""
        if self.two_sided or self.worded:
            return AXIS + 1 if self.two_sided else 8
        if self.level is not None:
            return 8
        limited = self.bounds and any(plotted.name in self.bounds for plotted in self.plots)
        return 8 if limited else 4 if self.ghost is not None else 2

    @property
    def plot_width(self) -> int:
        """Cells of a curve."""
        return max(4, self.size.width - AXIS - self.right_width)

    @property
    def columns(self) -> int:
        """Columns of a curve: two per cell."""
        return 2 * self.plot_width

    def place_cursor(self) -> None:
        """Have the cursor in the column of its moment, where it has one."""
        self.window.place_cursor(self.store.end, self.store.column_ns, self.columns)

    def redraw(self) -> None:
        """Everything anew."""
        self._forget_drawn()
        self.refresh()

    def notify_style_update(self) -> None:
        """Follow a change of the theme, also while nothing moves."""
        super().notify_style_update()
        self._forget_drawn()

    def _forget_drawn(self) -> None:
        """Have everything drawn anew; with another margin other columns are asked for."""
        self._drawn_panels.clear()
        self._drawn, self._drawn_end = {}, self.store.end
        if self._right_width != (width := self.right_width):
            self._right_width = width
            self.post_message(self.Resized())

    def advance(self) -> None:
        """New columns came: only lines that look different are painted.

        The picture goes on by whole cells of two columns: half a cell on, every cell of a curve would look different.
        """
        if not self.store.empty and (self.store.end - self._drawn_end) % 2:
            self.store.advance_to(self.store.end + 1)
        drawn = self._drawn
        self._forget_drawn()
        self._paint_changed(drawn)

    def _paint_changed(self, drawn: dict[int, list[Segment]]) -> None:
        for line in range(self.size.height):
            if drawn.get(line) != self._line(line):
                self.refresh(Region(0, line, self.size.width, 1))

    # ------------------------------------------------------------------------------------------------- drawing

    def render_line(self, y: int) -> Strip:
        return Strip(self._line(y)).adjust_cell_length(self.size.width, self._style("plot--quiet"))

    def _line(self, y: int) -> list[Segment]:
        if self._drawn_for != self.size:  # lines are asked for before anybody is told of another size
            self._drawn_for = self.size
            self._forget_drawn()
        if y not in self._drawn:
            self.place_cursor()  # in what is drawn now, whatever it was placed in
            self._drawn[y] = self._segments(y)
        return self._drawn[y]

    def _segments(self, y: int) -> list[Segment]:
        found = self.place_of(y)
        if found is None:
            return self._time_axis() if y == sum(self.heights()) else []
        at, line = found
        height = self.heights()[at - self.first]
        titles = title_lines(self.panels[at], self.size.width)
        return self._title(at, line) if line < titles else self._body(at, line - titles, height - titles)

    def _body(self, at: int, line: int, height: int) -> list[Segment]:
        panel = self.panels[at]
        if panel[0].numeric and not any(self.source.is_live(plotted.element.name) for plotted in panel):
            words = " " * AXIS + f" off: {key_of('toggle')} in the table switches it on"
            return [Segment(words if line == 0 else "", self._style("plot--quiet"))]
        if has_curves(panel):
            return self._curve(at, line)
        return self._lane(panel[0]) if line == 0 else []

    def _panel(self, at: int) -> Drawn:
        if at not in self._drawn_panels:
            panel, ghosts = self.panels[at], self.ghosts_of(self.panels[at])
            height = self.heights()[at - self.first] - title_lines(panel, self.size.width)
            source = PanelSource(self.store, self.window, self.source.period_ns, self.letter, self.bounds, self.level)
            self._drawn_panels[at] = drawn(source, panel, self.chosen_plot, ghosts, self.plot_width, height)
        return self._drawn_panels[at]

    def scale_of_first(self) -> tuple[float, float]:
        """The ends of the axis of the first signal, as values."""
        picture = self._panel(0).pictures[0]
        bottom, top = picture.axis.scale
        return bottom + picture.axis.base, top + picture.axis.base

    def ghosts_of(self, panel: Panel) -> dict[int, ColumnPiece]:
        """What a saved run had in the window, by the place of the signal."""
        if self.ghost is None or self.ghost.column_ns != self.store.column_ns:
            return {}
        found = {
            place: ghost_piece(self.ghost, plotted.name, self.store.end, self.columns)
            for place, plotted in enumerate(panel)
        }
        return {place: piece for place, piece in found.items() if piece is not None}

    def letter(self, plotted: Plotted) -> str:
        """The letter of a signal; none where there is one only."""
        plots = self.plots
        return LETTERS[plots.index(plotted) % len(LETTERS)] if len(plots) > 1 else ""

    def _color(self, panel: Panel, place: int) -> Style:
        if not self.fresh:
            return self._style("plot--stale")
        line = self._style("plot--line")
        return line if len(panel) == 1 else line + series_style(self.app, place)

    # --------------------------------------------------------------------------------------------------- titles

    def _title(self, at: int, line: int) -> list[Segment]:
        panel = self.panels[at]
        if len(panel) == 1:
            return self._single_title(at, panel[0])
        side_by_side = per_title_line(panel, self.size.width)
        room = self.size.width // side_by_side
        found: list[Segment] = []
        for place in range(line * side_by_side, min(len(panel), (line + 1) * side_by_side)):
            plotted = panel[place]
            head, unit, style = self._head(plotted)
            now = self._short_fact(at, place)
            when = self.facts.when_of(self._panel(at).pictures[place])
            if len(f"{head}{self._short(plotted)} {when} {now}{unit}") + 3 <= room:
                now = f"{when} {now}"
            name = self._fitted(plotted, max(8, room - len(head) - len(now) - len(unit) - 3))
            colored = Style(color=self._color(panel, place).color, bold=True, bgcolor=style.bgcolor)
            words = f"{name}{'→' if sides(panel)[place] else ''}"
            found += [
                Segment(head, colored),
                Segment(words, style),
                Segment(f" {now}{unit}", style + Style(bold=False)),
            ]
            rest = room - len(head) - len(words) - len(now) - len(unit) - 1
            found.append(Segment(" " * max(1, rest), self._style("plot--quiet")))
        return found

    def _head(self, plotted: Plotted) -> tuple[str, str, Style]:
        """Return what stands before the name of a signal, its unit behind, and how the name looks."""
        chosen, letter = plotted == self.chosen_plot, self.letter(plotted)
        unit = "" if plotted.element.unit == "-" else f" {plotted.element.unit}"
        style = self._style("plot--chosen" if chosen else "plot--title")
        return f"{'>' if chosen else ' '}{letter}{' ' * bool(letter)}", unit, style

    @property
    def facts(self) -> PlotFacts:
        """What is told of signals."""
        return PlotFacts(self.window, self.readings, self.ended)

    def _short_fact(self, at: int, place: int) -> str:
        """What stands beside the name of one of several signals."""
        return self.facts.brief(self.panels[at][place], self._panel(at).pictures[place])

    def _fitted(self, plotted: Plotted, width: int) -> str:
        """Return its name in so many cells, as it differs from those of the other plots."""
        return fitted_among(self._short(plotted), tuple(map(self._short, self.plots)), width)

    def _short(self, plotted: Plotted) -> str:
        return below(self.prefix, plotted.name)

    def _single_title(self, at: int, plotted: Plotted) -> list[Segment]:
        mark, unit, style = self._head(plotted)
        is_drawn = plotted.numeric and self.source.is_live(plotted.element.name)
        facts = self._facts(at, plotted) if is_drawn else ""
        room = self.size.width - len(facts) - len(unit) - len(mark) - 3
        name = self._fitted(plotted, max(8, room))
        origin = self._panel(at).origins[0] if facts and kind_of(plotted) is CurveKind.CURVE else ""
        if origin and len(name) + len(origin) + 7 <= room:
            name += f"  from {origin}"
        gap = max(1, self.size.width - 1 - len(mark) - len(name) - len(unit) - len(facts))
        return [Segment(mark + name, style), Segment(unit + " " * gap + facts + " ", style + Style(bold=False))]

    def _facts(self, at: int, plotted: Plotted) -> str:
        """The numbers at the right end of a title."""
        if kind_of(plotted) is CurveKind.CURVE:
            return self.facts.of_curve(plotted, self._panel(at).pictures[0])
        return self.facts.of_lane(plotted, self._piece(plotted), self.columns)

    def span_of(self, plotted: Plotted) -> tuple[float, float]:
        """The smallest and the largest value that is shown of a signal; 0 and 0 where none is."""
        piece = self._piece(plotted)
        low, high = braille.value_range(piece.low, piece.high) or (0.0, 0.0)
        return low + piece.base, high + piece.base

    def missing(self, *, before: bool = True) -> str:
        """What the chosen plot has no samples of, and why; where it has all, the first that is shown and lacks some."""
        if not self.plots or self.store.empty:
            return ""
        shown = [each for panel in self.panels[self.first : self.first + self.fitting] for each in panel]
        curves = [each for each in (self.chosen_plot, *shown) if each.numeric]
        told = (missing(self._piece(each), self.store, self.plot_width, before=before) for each in curves)
        return next(filter(None, told), "")

    def _piece(self, plotted: Plotted) -> ColumnPiece:
        return pieces_of(self.store, [plotted], self.columns, self.source.period_ns)[0]

    # ------------------------------------------------------------------------------------------- curves and lanes

    def _curve(self, at: int, line: int) -> list[Segment]:
        drawn, panel = self._panel(at), self.panels[at]
        quiet = self._style("plot--quiet")
        colors = {place: self._color(panel, place) for place in range(len(panel))} | {HOLE: quiet, NOBODY: quiet}
        colors |= {RED: self._style("plot--red"), YELLOW: self._style("plot--yellow")}
        for ghost, place in enumerate(self.ghosts_of(panel) if self.ghost is not None else (), len(panel)):
            colors[ghost] = colors[place] + GHOST
        styles = [colors[owner] for owner in drawn.owners[line].tolist()]
        label = drawn.left.get(line, "")
        axis = Segment(f"{label:>{AXIS - 1}} {'┤' if label else '│'}", quiet)
        cells = self._cells(drawn.lines[line], styles, panel)
        return [axis, *cells, *self._right(drawn.right.get(line), colors)]

    def _right(self, mark: tuple[str, int] | None, colors: dict[int, Style]) -> list[Segment]:
        if self.right_width <= 2:
            return []
        if mark is None:
            return [Segment("│", self._style("plot--quiet"))]
        return [Segment("├", self._style("plot--quiet")), Segment(mark[0], colors[mark[1]])]

    def _lane(self, plotted: Plotted) -> list[Segment]:
        kind, width = kind_of(plotted), self.plot_width
        piece = self._piece(plotted)
        if kind is CurveKind.LANE:
            line, word = lanes.bool_lane(piece, width), self.facts.now(plotted)
        elif kind is CurveKind.BAND:
            entry = plotted.entry
            line = lanes.band(piece, lambda value: offset_text(entry, value, piece.base, 40), width)
            word = self.facts.now(plotted)
        else:
            reading = self.readings.get(plotted.element.name)
            word = reading.texts.get(plotted.position, "") if reading is not None else ""
            events = self.events.get(plotted.name) or ([(0, word)] if word else [])
            line = lanes.events_band(events, self.store.end, self.store.column_ns, width)
        body = "plot--line" if kind is CurveKind.LANE else "plot--band"
        styles = [self._style(body if self.fresh else "plot--stale")] * width
        if kind is not CurveKind.TEXT:
            cells = list(line)
            for hole in braille.holes(piece.low, piece.marks, width):
                for cell in range(hole.start, hole.stop):
                    cells[cell] = braille.SHADE if hole.why is not Gap.BEFORE else BLANK
                    styles[cell] = self._style("plot--quiet")
            line = "".join(cells)
        word = text.cut(word, self.right_width - 2)  # the axis takes a cell beside its numbers
        axis = Segment(f"{self.letter(plotted):>{AXIS - 1}} │", self._style("plot--quiet"))
        return [axis, *self._cells(line, styles, [plotted]), Segment("│" + word, self._style("plot--quiet"))]

    def _cells(self, cells: str, styles: list[Style], shown: Sequence[Plotted]) -> list[Segment]:
        """The cells of a line, with the cursors where nothing is drawn."""
        chars = list(cells)
        for at in self._event_cells(shown):
            is_of_words = any(each.isalnum() for each in chars[max(0, at - 1) : at + 2])
            if chars[at] == LIMIT or (chars[at] == BLANK and not is_of_words):
                chars[at], styles[at] = EVENT_LINE, self._style("plot--quiet")
        for cursor, sign in ((self.other_cursor, CURSOR_B), (self.window.cursor, CURSOR_A)):
            if cursor is not None:
                at = max(0, len(chars) - 1 - cursor // 2)
                chars[at] = chars[at].replace(BLANK, sign).replace(EVENT_LINE, sign).replace(LIMIT, sign)
                styles[at] = self._style("plot--cursor")
        return segments_of(chars, styles)

    def _event_cells(self, of: Sequence[Plotted]) -> dict[int, str]:
        """In which cells something happened to these signals, or to all, and its letter."""
        store, happened = self.store, self.source.happened
        key = (store.end, store.column_ns, self.plot_width, len(happened), happened[-1].number if happened else 0)
        if store.empty or not happened:
            return {}
        if key != self._happened_key:
            self._happened, self._happened_key = {}, key
        names = frozenset(plotted.name for plotted in of)
        if names not in self._happened:
            begin_ns, end_ns = (store.end - self.columns) * store.column_ns, store.end * store.column_ns
            shown = in_plots(happened, begin_ns, end_ns, names)
            self._happened[names] = columns_of(shown, store.end, store.column_ns, self.plot_width)
        return self._happened[names]

    @property
    def other_cursor(self) -> int | None:
        """How many columns cursor B is from the right edge; None where it isn't in the picture."""
        if self.window.other_ns is None or self.store.empty:
            return None
        column = self.store.end - 1 - self.window.other_ns // self.store.column_ns
        return column if 0 <= column < self.columns else None

    def _time_axis(self) -> list[Segment]:
        cursors = ((self.window.cursor, "A"), (self.other_cursor, "B")) if self.window.other_ns is not None else ()
        marks = [(max(0, self.plot_width - 1 - cursor // 2), sign) for cursor, sign in cursors if cursor is not None]
        words = self._axis_words()
        if self.window.other_ns is not None and self.other_cursor is None and not self.store.empty:
            is_before = self.window.other_ns < self.store.end * self.store.column_ns
            words.insert(0, (0.0, "←B") if is_before else (1.0, "B→"))  # where it is, as it isn't in the picture
        line = axis_line(self.plot_width, words, marks, self._event_cells(self.on_screen()))
        return [Segment(" " * (AXIS + 1) + line, self._style("plot--quiet"))]

    def _axis_words(self) -> list[tuple[float, str]]:
        """What stands under the time axis, each at its share of the way from left to right."""
        words = axis_words(self.window, self.source.end_ns, self.columns)
        if self.source.live and not self.window.paused:
            words[-1] = 1.0, "end" if self.ended else "now"
        return words

    # --------------------------------------------------------------------------------------------------- mouse

    class Resized(Message):
        """It has more lines, or fewer: other plots may fit; or there is another width for the curves."""

    def on_resize(self) -> None:
        self.post_message(self.Resized())

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
        """Ask for the signal and the place that was clicked."""
        found = self.place_of(event.y)
        if found is None:
            return
        at, line = found
        panel = self.panels[at]
        first = sum(len(each) for each in self.panels[:at])
        titles = title_lines(panel, self.size.width)
        if line < titles:
            side_by_side = per_title_line(panel, self.size.width)
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
        event.stop()
        self.post_message(self.Wheeled(1, zooms=event.ctrl))

    def on_mouse_scroll_up(self, event: events.MouseScrollUp) -> None:
        event.stop()
        self.post_message(self.Wheeled(-1, zooms=event.ctrl))

    # ---------------------------------------------------------------------------------------------- what is plotted

    def _take(self, panels: Sequence[Panel]) -> None:
        # what is asked for many times a frame is found once: with 700 panels it took 50 ms
        self.panels = list(panels)
        self._heights: list[int] = []
        self._heights_for: tuple[Size, int] | None = None
        self.plots = [plotted for panel in panels for plotted in panel]  # in the order of the panels
        self.two_sided = any(any(sides(panel)) for panel in panels if has_curves(panel))
        self.worded = any(len(panel) > 1 or not has_curves(panel) for panel in panels)

    @property
    def chosen_plot(self) -> Plotted:
        """The signal that is chosen."""
        return self.plots[self.chosen]

    @property
    def chosen_panel(self) -> int:
        """Where the panel with the chosen signal is."""
        index = self.chosen
        for at, panel in enumerate(self.panels):
            index -= len(panel)
            if index < 0:
                return at
        return max(0, len(self.panels) - 1)

    @property
    def most(self) -> int:
        """How many curves may share a panel: two can be told apart without colours."""
        return 2 if self.app.no_color else MAX_SERIES

    def show_panels(self, panels: Sequence[Panel]) -> None:
        """Show these panels; the chosen signal stays the chosen one if it is still there."""
        chosen = self.plots[self.chosen] if self.plots else None
        self._take(panels)
        self._forget_drawn()
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
        if (key := (self.size, self.first)) != self._heights_for:
            self._heights_for = key
            self._heights = heights(self.panels, self.first, self._room, self.size.width)
        return self._heights

    @property
    def fitting(self) -> int:
        """Panels that are on the screen."""
        return len(self.heights())

    def on_screen(self) -> list[Plotted]:
        """The signals that are visible now."""
        return [plotted for panel in self.panels[self.first : self.first + self.fitting] for plotted in panel]

    def choose(self, index: int) -> bool:
        """Chooses a signal and brings it on the screen; True when other panels are visible then."""
        before, self.chosen = self.chosen_panel, max(0, min(index, len(self.plots) - 1))
        first = first_to_show(self.panels, self.first, self.chosen_panel, self._room, self.size.width)
        moved, self.first = first != self.first, first
        if moved or not self._drawn or self.chosen_panel == before:
            self.redraw()
            return moved
        drawn, changed = self._drawn.copy(), (before, self.chosen_panel)
        for line in [line for line in drawn if (place := self.place_of(line)) and place[0] in changed]:
            del self._drawn[line]
        for panel in changed:
            self._drawn_panels.pop(panel, None)
        self._paint_changed(drawn)
        return False


class RecordedStack(PlotStack):
    """Plots of a file: the value at the cursor, minimum, maximum and mean of the window; the axis counts its time."""

    def __init__(self, session: FileSession, plots: list[Plotted], window: PlotWindow) -> None:
        super().__init__(plots, window, session.source)
        self.prefix = session.status.prefix.rstrip("/")
        self._file = session

    def _facts(self, at: int, plotted: Plotted) -> str:
        store = self.store
        facts = self._file.source.facts(plotted.name, store.end - self.columns, store.end, store.column_ns)
        digits = text.digits_for((facts.smallest, facts.largest), 12) if facts.finite and not facts.base else None
        words = f"= {self.facts.now(plotted, digits)}"
        report = self._file.rows_of[plotted.element.name]
        if not facts.samples and report.start_s is not None and self._file.seconds < report.start_s:
            return f"{words}  begins at {text.short(report.start_s, 6)} s"
        if not facts.samples or self.size.width < 60:
            return words
        ends = [offset_text(plotted.entry, end, facts.base, 12, digits) for end in (facts.smallest, facts.largest)]
        words += f"  {facts.signs}" if facts.signs else ""
        if not facts.finite:
            return words
        if plotted.entry.labels or plotted.entry.dtype[1:2] in "Mm":  # their mean means nothing
            return words + ("" if ends[0] == ends[1] else f"  ({ends[0]} … {ends[1]})")
        if plotted.entry.dtype[1:2] == "b":
            return f"{words}  true {facts.mean:.1%}"
        mean = digits.write(facts.mean) if digits else offset_text(plotted.entry, round(facts.mean), facts.base, 12)
        return f"{words}  min {ends[0]}  max {ends[1]}  mean {mean}"

    def _axis_words(self) -> list[tuple[float, str]]:
        store, source, width_ns = self.store, self._file.source, self.columns * self.store.column_ns
        end_ns = store.end * store.column_ns
        if store.empty:  # nothing is read yet
            end_ns, width_ns = self.window.paused_end_ns or source.end_ns, self.window.span_ns
        last_s = (end_ns - source.begin_ns) / SECOND_NS
        return [each for each in seconds_words(last_s - width_ns / SECOND_NS, last_s) if not each[1].startswith("-")]

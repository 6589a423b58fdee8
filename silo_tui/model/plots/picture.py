"""A panel of plots as cells: curves, limits behind them, letters on them, and what stands at both sides. Pure."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from silo.core.arrays.columns import ColumnPiece, ColumnStore
from silo.core.conditions import NO_BOUNDS, Bounds
from silo_tui.model.drawing import dots
from silo_tui.model.drawing.dots import BLANK
from silo_tui.model.drawing.plots import NOBODY, Owners, Picture, Plotted, draw_panel, together
from silo_tui.model.drawing.window import PlotWindow
from silo_tui.model.plots.limits import level_line, lines_of
from silo_tui.model.plots.overlay import SIGN
from silo_tui.model.plots.panels import Panel, sides
from silo_tui.model.samples.live import offset_text

LIMIT = "╌"
YELLOW, RED = -3, -4
AXIS = 10  # cells for the numbers on the left


@dataclass(frozen=True)
class Drawn:
    """A panel as cells: the characters, whose colour each has, and what stands at both sides of each line."""

    pictures: list[Picture]
    lines: list[str]
    owners: Owners
    left: dict[int, str]
    right: dict[int, tuple[str, int]]  # text and whose colour
    origins: tuple[str, str] = ("", "")


@dataclass(frozen=True)
class PanelSource:
    """What panels are drawn from."""

    store: ColumnStore
    window: PlotWindow
    period_of: Callable[[str], int]
    letter: Callable[[Plotted], str]
    bounds: Mapping[str, Bounds]
    level: float | None = None  # of a scope that waits for the first signal


def drawn(
    source: PanelSource, panel: Panel, chosen: Plotted, ghosts: Mapping[int, ColumnPiece], width: int, height: int
) -> Drawn:
    """Return a panel in so many cells; `ghosts` are what a saved run had, by the place of the signal."""
    right = sides(panel)
    pictures = draw_panel(source.store, source.window, panel, right, width, height, source.period_of, ghosts)
    cells, owners = together(pictures, panel.index(chosen) if chosen in panel else 0, len(ghosts))
    limits = _draw_limits(source, panel, pictures, cells, owners)
    left, origin = axis_words(panel[0], pictures[0], height)
    other = ""
    if any(right):
        words, other = axis_words(panel[right.index(True)], pictures[right.index(True)], height)
        marks = {line: (word, right.index(True)) for line, word in words.items()}
    else:
        marks = _newest_marks(source, panel, pictures, ghosts)
    if len(panel) > 1:
        for place, plotted in enumerate(panel):
            if (spot := _letter_spot(owners, place, len(panel))) is not None:
                cells[spot] = ord(source.letter(plotted) or BLANK)
    for line, (word, owner) in limits.items():
        known = marks.get(line, ("", owner))
        marks[line] = f"{known[0]} {word}".strip(), known[1]
    return Drawn(pictures, dots.lines_of(cells), owners, left, marks, (origin, other))


def _newest_marks(
    source: PanelSource, panel: Panel, pictures: Sequence[Picture], ghosts: Mapping[int, ColumnPiece]
) -> dict[int, tuple[str, int]]:
    """Return the letters of curves beside their newest ends, where there are several."""
    marks: dict[int, tuple[str, int]] = {}
    if len(panel) < 2 and not ghosts:
        return marks
    for ghost, place in enumerate(ghosts, len(panel)):
        if (line := pictures[ghost].newest) is not None:
            marks[line // 4] = f"{source.letter(panel[place])}{SIGN}", ghost
    for place, picture in enumerate(pictures[: len(panel)]):
        if picture.newest is not None:
            line = picture.newest // 4
            marks[line] = marks.get(line, ("", place))[0] + source.letter(panel[place]), place
    return marks


def _draw_limits(
    source: PanelSource, panel: Panel, pictures: Sequence[Picture], cells: dots.Cells, owners: Owners
) -> dict[int, tuple[str, int]]:
    """Draw the limits of a panel behind its curves; return what stands at the right of which line, and its colour.

    One that lies outside of the scale has no line: an arrow at that border tells of it.
    """
    found: dict[int, tuple[str, int]] = {}
    for place, plotted in enumerate(panel):
        lines = lines_of(source.bounds.get(plotted.name, NO_BOUNDS), pictures[place].axis, len(cells))
        if source.level is not None and place == 0:
            lines += level_line(source.level, pictures[0].axis, len(cells))
        for limit in lines:
            owner = RED if limit.red else YELLOW
            words = f"{source.letter(plotted) if len(panel) > 1 else ''}{limit.mark}"
            known = found.get(limit.line)
            found[limit.line] = (words, owner) if known is None else (f"{known[0]} {words}", min(known[1], owner))
            free = (owners[limit.line] == NOBODY) | (owners[limit.line] == YELLOW)  # of two in a line red is seen
            if not limit.beyond:
                free[1::2] = False  # dashed: a curve is not
                cells[limit.line][free], owners[limit.line][free] = ord(LIMIT), owner
    return found


def axis_words(plotted: Plotted, picture: Picture, height: int) -> tuple[dict[int, str], str]:
    """Return what stands on which line of an axis, and what these numbers count from."""
    ends = picture.axis.scale
    if picture.axis.log is None and plotted.entry.dtype[1:2] == "M" and not math.isnan(ends[0]):
        words = [offset_text(plotted.entry, end, picture.axis.base, 30) for end in ends]
        if words[0][: AXIS - 2] != words[1][: AXIS - 2]:
            return {height - 1: words[0][: AXIS - 2], 0: words[1][: AXIS - 2]}, ""
    return picture.axis.words(height, AXIS - 1)


def _letter_spot(owners: Owners, place: int, count: int) -> tuple[int, int] | None:
    """Return where on its curve the letter of a signal stands: about the same place, so that it doesn't run."""
    width = owners.shape[1]
    wanted = (place + 1) * width // (count + 1)
    for step in range(width):
        for cell in (wanted - step, wanted + step):
            if 0 <= cell < width:
                lines = (owners[:, cell] == place).nonzero()[0]
                if len(lines):
                    return int(lines[len(lines) // 2]), cell
    return None

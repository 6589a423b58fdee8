"""How signals share the plots of a screen: which lie together in one, on which axis, and how high each is.

A panel is one plot: a curve or several of at most two units, or a lane of one boolean, enumeration or text. Pure
functions; the widget keeps the list.
"""

import enum
from collections.abc import Sequence

from silo_tui.model.drawing.plots import Plotted

MAX_SERIES = 8
LETTERS = "abcdefghijklmnopqrstuvwxyz"
LEAST_CURVE, LANE = 4, 2  # lines with a title of one line
TITLE_WIDTH = 36  # cells that a signal of several needs in a title

Panel = tuple[Plotted, ...]


class CurveKind(enum.Enum):
    """How a signal is drawn."""

    CURVE = "curve"
    LANE = "lane"  # false, true
    BAND = "band"  # words of an enumeration
    TEXT = "text"


def kind_of(plotted: Plotted) -> CurveKind:
    """Return how a signal is drawn."""
    if not plotted.numeric:
        return CurveKind.TEXT
    if plotted.entry.dtype[1:2] == "b":
        return CurveKind.LANE
    return CurveKind.BAND if plotted.entry.labels else CurveKind.CURVE


def has_curves(panel: Panel) -> bool:
    """Return whether a panel is a plot with an axis, no lane."""
    return kind_of(panel[0]) is CurveKind.CURVE


def sides(panel: Panel) -> tuple[bool, ...]:
    """Return which signals belong to the axis on the right: those of another unit than the first."""
    return tuple(plotted.element.unit != panel[0].element.unit for plotted in panel)


def refusal(panel: Panel, other: Panel, most: int = MAX_SERIES) -> str:
    """Return why two panels can't be one; empty when they can."""
    if not (has_curves(panel) and has_curves(other)):
        return "only curves can be joined, lanes stay alone"
    if len(panel) + len(other) > most:
        return "without colours two curves fit in a plot" if most < MAX_SERIES else f"{most} curves fit in a plot"
    units = dict.fromkeys(plotted.element.unit for plotted in panel + other)
    if len(units) > 2:
        return f"a plot has two axes, these have {len(units)} units: {', '.join(units)}"
    if any(plotted.entry.dtype[1:2] in "Mm" for plotted in panel) != any(
        plotted.entry.dtype[1:2] in "Mm" for plotted in other
    ):
        return "moments and numbers have no axis in common"
    return ""


def join(panels: Sequence[Panel], at: int, most: int = MAX_SERIES) -> list[Panel]:
    """Return the panels with the one at `at` and the next one as one, the last with the one above it.

    Raises ValueError where they can't be.
    """
    if len(panels) < 2:
        raise ValueError("there is no next plot to join with")
    at = min(at, len(panels) - 2)
    if reason := refusal(panels[at], panels[at + 1], most):
        raise ValueError(reason)
    return [*panels[:at], panels[at] + panels[at + 1], *panels[at + 2 :]]


def isolate(panels: Sequence[Panel], chosen: Plotted) -> list[Panel]:
    """Return the panels with a signal alone in its own, below the one that it came from."""
    found: list[Panel] = []
    for panel in panels:
        rest = tuple(plotted for plotted in panel if plotted != chosen)
        found += [rest] if rest else []
        found += [(chosen,)] if len(rest) < len(panel) else []
    return found


def stacked(plots: Sequence[Plotted]) -> list[Panel]:
    """Return each signal in a panel of its own."""
    return [(plotted,) for plotted in plots]


def gathered(plots: Sequence[Plotted], *, by_unit: bool, most: int = MAX_SERIES) -> list[Panel]:
    """Return signals of one unit together, or as many as two axes can carry; each stays near its first fellow."""
    found: list[Panel] = []
    for plotted in plots:
        alone = (plotted,)
        for at, panel in enumerate(found):
            if not refusal(panel, alone, most) and (not by_unit or not any(sides(panel + alone))):
                found[at] = panel + alone
                break
        else:
            found.append(alone)
    return found


def title_lines(panel: Panel, width: int) -> int:
    """Return how many lines the names of a panel take."""
    return -(-len(panel) // per_title_line(panel, width))


def per_title_line(panel: Panel, width: int) -> int:
    """Return how many names stand side by side, in as much room for each as there is."""
    return max(1, min(len(panel), width // TITLE_WIDTH))


def least_height(panel: Panel, width: int) -> int:
    """Return the lines that a panel needs, with its title."""
    return LEAST_CURVE - 1 + title_lines(panel, width) if has_curves(panel) else LANE


def heights(panels: Sequence[Panel], first: int, room: int, width: int) -> list[int]:
    """Return the lines of each panel from `first` on that fits, at least one; curves fill the room that is left."""
    found: list[int] = []
    for panel in panels[first:]:
        least = least_height(panel, width)
        if found and sum(found) + least > room:
            break
        found.append(least)
    curves = [at for at in range(len(found)) if has_curves(panels[first + at])]
    spare = max(0, room - sum(found))
    for place, at in enumerate(curves):
        found[at] += spare // len(curves) + (place < spare % len(curves))
    return found


def first_to_show(panels: Sequence[Panel], first: int, wanted: int, room: int, width: int) -> int:
    """Return the first panel on the screen so that the wanted one is on it, moving as little as possible."""
    first = max(0, min(first, wanted, len(panels) - 1))
    while first < wanted and first + len(heights(panels, first, room, width)) <= wanted:
        first += 1
    # no blank below the last one while there are more above
    while first and first - 1 + len(heights(panels, first - 1, room, width)) >= len(panels):
        first -= 1
    return first

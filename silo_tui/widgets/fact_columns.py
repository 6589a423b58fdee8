"""The columns of what is measured: sign, statistics, rate, jitter, last change; and the sets that `C` steps through.

They stand in the live pane, beside fill, value and trend, because they change all the time.
"""

import math
from collections.abc import Callable, Mapping, Sequence

from silo.core.elements import Entry
from silo_tui.model import text
from silo_tui.model.facts import BAD, LIMIT_BITS, OLD, worst, worst_of
from silo_tui.model.fields import Field
from silo_tui.model.live import entry_text
from silo_tui.model.orders import LIVE_ORDERS
from silo_tui.model.table import Rows
from silo_tui.widgets.live_pane import LIVE_PANE, LivePane, PaneColumn

LIVE_SETS: Mapping[str, tuple[str, ...]] = {
    "settings": ("!", "fill", "value", "trend"),
    "statistics": ("!", "value", "min", "max", "mean", "std"),
    "timing": ("!", "fill", "value", "rate", "%", "jitter", "changed"),
}
# what takes reading whole signals of a file is shown where it is asked for
FILE_SETS: Mapping[str, tuple[str, ...]] = {
    "values": ("value", "trend"),
    "statistics": ("!", "value", "min", "max", "mean", "std"),
    "timing": ("!", "value", "rate", "%", "jitter", "changed"),
}
_WIDE_FROM = 150  # cells of a screen from which settings show statistics too
ALL = ("!", "fill", "value", "min", "max", "mean", "std", "rate", "jitter", "trend")
# quantities of the columns that need them of what is on the screen
QUANTITIES = {"min": "min", "max": "max", "mean": "mean", "std": "std", "rate": "rate", "%": "share",
              "jitter": "jitter", "changed": "changed"}  # fmt: skip


_OF_LIMITS = sum(set(LIMIT_BITS.values()))


class ColumnSet:
    """Which columns the pane shows now."""

    def __init__(self, sets: Mapping[str, tuple[str, ...]] = LIVE_SETS) -> None:
        self._sets = sets
        self.name = next(iter(sets))
        self.screen_width = 80

    def step(self) -> str:
        """Go to the next set and return its name."""
        names = list(self._sets)
        self.name = names[(names.index(self.name) + 1) % len(names)]
        return self.name

    @property
    def titles(self) -> tuple[str, ...]:
        """The columns of the set."""
        if self._live and self.screen_width >= _WIDE_FROM and self.name != "timing":
            return ALL
        return self._sets[self.name]

    @property
    def quantities(self) -> list[str]:
        """What has to be surveyed of the rows on the screen."""
        found = [QUANTITIES[title] for title in self.titles if title in QUANTITIES]
        if "min" in self.titles:  # of a file the value is that of the moment shown, and statistics are of all
            found += ["bad", "least", "most", *(["value"] if self._live else [])]
        return found

    @property
    def _live(self) -> bool:
        return self._sets is LIVE_SETS


def pane_columns(chosen: ColumnSet, known: Sequence[PaneColumn] = LIVE_PANE) -> tuple[PaneColumn, ...]:
    """Return the columns of a pane, shown as `chosen` says; `known` are its own: value, trend, and fill if it has one.

    Statistics are of one number, of a vector those of the norm or the entry that was asked for; beside all its entries
    stand the smallest and the largest of any of them.
    """
    *fill, value, trend = known

    def only(title: str, column: PaneColumn) -> PaneColumn:
        width = column.width
        return PaneColumn(
            lambda pane: _arrow(pane, title) + column.title(pane),
            lambda pane: width(pane) if title in chosen.titles else 0,
            column.draw, column.right, column.branch, column.entry, title if title in LIVE_ORDERS else "",
        )  # fmt: skip

    def fixed(title: str, width: int, draw: Callable[[LivePane, int], tuple[str, str]]) -> PaneColumn:
        return PaneColumn(
            lambda pane: _arrow(pane, title) + title,
            lambda pane: width if title in chosen.titles else 0,
            draw,
            right=True,
            order=title if title in LIVE_ORDERS else "",
        )

    def statistic(title: str) -> PaneColumn:
        return PaneColumn(
            lambda pane: _arrow(pane, title) + title, lambda pane: 8 if title in chosen.titles else 0,
            lambda pane, row: _statistic(pane, row, title),
            right=True,
            entry=lambda pane, row, entry: _number(
                pane, pane.entry_name(row, entry), title, pane.session.table.elements[row].entries[entry]
            ),
            order=title,
        )  # fmt: skip

    return (
        PaneColumn(
            lambda pane: _arrow(pane, "!") or "!", lambda pane: 2 if "!" in chosen.titles else 0, _sign,
            branch=_branch_sign, order="!",
        ),
        *(only("fill", column) for column in fill), only("value", value),
        statistic("min"), statistic("max"), statistic("mean"), statistic("std"),
        fixed("rate", 7, _rate),
        fixed("%", 4, _share),
        fixed("jitter", 7, lambda pane, row: _time(pane, row, "jitter")),
        fixed("changed", 8, lambda pane, row: _time(pane, row, "changed")),
        only("trend", trend),
    )  # fmt: skip


def _arrow(pane: LivePane, title: str) -> str:
    rows = pane.session.rows
    order = {"|value|": "value"}.get(rows.sort, rows.sort)
    return rows.arrow if order == title and rows.live else ""


def _style(letters: str) -> str:
    return "live--lost" if letters in BAD else "live--caution"


def _sign(pane: LivePane, row: int) -> tuple[str, str]:
    session = pane.session
    if not session.fresh and session.live.readings:
        return OLD, "live--quiet"
    bits = int(session.table.signs[row])
    if not session.table.server[Field.ENABLED, row]:
        bits &= _OF_LIMITS  # what is off isn't measured; its limits may be judged by others
    letters = worst(bits)
    return letters, _style(letters)


def _branch_sign(pane: LivePane, rows: Rows) -> tuple[str, str]:
    """Return the worst sign below a branch, and how many have it; nothing stands beside it."""
    letters, count = worst_of(pane.session.table.signs[rows])
    return (f"{letters:<2} {count} of {len(rows)}" if letters else ""), _style(letters)


def _statistic(pane: LivePane, row: int, title: str) -> tuple[str, str]:
    if pane.tells_one(row):
        return _number(pane, pane.shown_name(row), title, pane.entry_of(row))
    quantity = {"min": "least", "max": "most"}.get(title)
    if quantity is None or pane.session.table.mixed[row]:
        return "", "live--quiet"
    return _number(pane, pane.session.table.names[row], quantity, pane.session.table.elements[row].entries[0])


def _number(pane: LivePane, name: str, quantity: str, entry: Entry | None) -> tuple[str, str]:
    value = pane.session.table.facts.detail(name, quantity)
    if math.isnan(value):
        return "", "live--quiet"
    if entry is not None and (entry.labels or entry.dtype[1:2] == "b"):
        if quantity in {"min", "max"} and value == int(value):
            return entry_text(entry, value, None, 8), "live--quiet"
        if entry.labels:
            return "-", "live--quiet"  # between two labels is nothing
    return text.number(value, 8), "live--quiet"


def _rate(pane: LivePane, row: int) -> tuple[str, str]:
    rate = pane.session.table.facts.detail(pane.session.table.names[row], "rate")
    return ("" if math.isnan(rate) else f"{rate:.4g}"), "live--quiet"


def _share(pane: LivePane, row: int) -> tuple[str, str]:
    share = pane.session.table.facts.detail(pane.session.table.names[row], "share")
    if math.isnan(share):
        return "", ""
    return f"{100 * share:.0f}%", "live--caution" if share < 0.95 else "live--quiet"


def _time(pane: LivePane, row: int, quantity: str) -> tuple[str, str]:
    seconds = pane.session.table.facts.detail(pane.shown_name(row), quantity)
    if math.isnan(seconds):
        seconds = pane.session.table.facts.detail(pane.session.table.names[row], quantity)
    return ("" if math.isnan(seconds) else text.span(float(f"{seconds:.2g}"))), "live--quiet"

"""The columns of the element tables, each one entry: head, width, words, orders, filter terms, sets, what it edits; and
which of them a table shows, how wide.

The table widget, the orders, the filter and the user's settings read what stands here and know no column by name. A new
column touches its entry, its line of help (`screens/lists/help.py`) and its test; how its cells read is in `cells.py`.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.columns import Floats
from silo_tui.model.table import cells
from silo_tui.model.table.cells import Cell, Sight
from silo_tui.model.table.facts import ranks
from silo_tui.model.table.fields import Field
from silo_tui.model.table.state import Rows, TableState
from silo_tui.model.table.terms import (
    Term,
    action_term,
    choice_term,
    fact_term,
    number_term,
    rate_term,
    read_seconds,
    read_share,
    state_term,
    text_term,
)  # fmt: skip
from silo_tui.model.words.names import MIN_WIDTH, Told
from silo_tui.model.words.states import WIDEST

WIDE_FROM = 96  # cells of a table from which columns take their wide width
FLAGS = 2  # cells before a name, for signs
NAME_ROOM = 16  # columns are left out rather than that names get less, or less than tells them apart
TREE, NAME, ADDED, STATE = "tree", "name", "added", "state"
STEADY = (TREE, NAME, ADDED)
LIMIT = "limit"  # how far each is from its limits
NOISE = "noise/median"  # of siblings: so that metres and newtons compare
BEFORE = {"!": STATE, "std/median": NOISE}  # what an order was called, in views that somebody kept
LIVE_SETS = ("settings", "statistics", "timing")
FILE_SETS = ("values", "statistics", "timing")  # what takes reading whole signals is shown where it is asked for


class TableOrder(msgspec.Struct, frozen=True):
    """An order: its name, the letter that picks it, a key per element (NaN: not known), its words where told whole.

    One by what is measured (`quantity`) is made anew once a second; `falling` ones begin with the largest, names and
    words with the first. By
    `of_norm` a vector stands where its norm does.
    """

    name: str
    letter: str
    keys: Callable[[TableState], NDArray[Any]]
    words: str = ""
    quantity: str = ""
    falling: bool = True
    of_norm: bool = False


class TableColumn(msgspec.Struct, frozen=True):
    """One column behind the names.

    `draw` returns words and style of a cell of so many cells, `entry` those of one entry of an element, `branch` what
    stands for all below a branch. `measured` ones are drawn anew with each frame. `leaves` says when one is left out of
    a narrow table (1 first, 0 never): it is whole or not there, a cut number would be a wrong one. `field` is what
    editing a cell changes. `sets` name when it is shown ("wide": beside settings, on a wide screen).
    `quantities` are surveyed of what is on the screen. `head` says more than the title, in so many cells.
    """

    title: str
    width: int
    draw: Callable[[Sight, int, int], Cell]
    sets: tuple[str, ...]
    right: bool = False
    wide: int = 0
    leaves: int = 0
    field: Field | None = None
    measured: bool = False
    live: bool = True
    file: bool = True
    orders: tuple[TableOrder, ...] = ()
    terms: tuple[Term, ...] = ()
    quantities: tuple[str, ...] = ()
    entry: Callable[[Sight, int, int, int], Cell] | None = None
    branch: Callable[[Sight, Rows], Cell] | None = None
    head: Callable[[Sight, int], str] | None = None

    @property
    def order(self) -> str:
        """What a click on its head orders by; empty when there is no order."""
        return self.orders[0].name if self.orders else ""

    def gives(self, order: str) -> bool:
        """Return whether an order is by this column."""
        return any(each.name == order for each in self.orders)

    def width_in(self, sight: Sight, table_width: int) -> int:
        """Return the cells it asks for in a table of that width; 0 where it has no room.

        What is measured has its wide width of what names don't need, whatever the width of the table.
        """
        wide = self.wide if self.wide and not self.measured and table_width >= WIDE_FROM else self.width
        return sight.widths.get(self.title, wide)


ColumnShown = tuple[TableColumn, int]  # with its cells


def _by(name: str, letter: str, field: Field, words: str = "") -> tuple[TableOrder, ...]:
    return (TableOrder(name, letter, lambda table: table.values[field], words, falling=False),)


def _by_number(name: str, letter: str, field: Field) -> tuple[TableOrder, ...]:
    return (TableOrder(name, letter, lambda table: -table.values[field]),)


def _measured(
    name: str, letter: str, quantity: str, *, falling: bool = True, of_norm: bool = False, words: str = "",
    of: Callable[[Floats], Floats] | None = None,
) -> TableOrder:  # fmt: skip
    def keys(table: TableState) -> Floats:
        known = table.facts.of(quantity, len(table))
        if known is None:
            return np.full(len(table), np.nan)
        if of_norm:  # of metres and radians there is no norm, between two labels is nothing
            none = table.mixed | table.labelled if quantity in {"mean", "std"} else table.mixed
            known = np.where(none, np.nan, known)
        return known if of is None else of(known)

    return TableOrder(name, letter, keys, words, quantity, falling, of_norm)


def _sign_ranks(table: TableState) -> NDArray[Any]:
    return ranks(table.signs).astype(float) if table.signs_known else np.full(len(table), np.nan)


def _statistic(
    title: str,
    letter: str,
    leaves: int,
    *,
    falling: bool = True,
    example: str = "60",
) -> TableColumn:  # fmt: skip
    """Of one number, of a vector of the norm or the entry that was asked for."""
    return TableColumn(
        title, 8, lambda sight, row, width: cells.statistic(sight, row, width, title), ("statistics", "wide"),
        right=True, wide=11, leaves=leaves, measured=True,
        orders=(_measured(title, letter, title, falling=falling, of_norm=True),),
        terms=(fact_term((title,), title, example=example),), quantities=(title,),
        entry=lambda sight, row, entry, width: cells.entry_statistic(sight, row, entry, width, title),
    )  # fmt: skip


_ALL_SETS = ("settings", "values", "statistics", "timing")
_SETTINGS, _IN_FILE = ("settings",), ("values",)

COLUMNS: tuple[TableColumn, ...] = (
    TableColumn(
        "unit", 5, cells.unit, _ALL_SETS, leaves=10, wide=8,
        orders=(
            TableOrder(
                "unit", "u", lambda table: np.array([each.unit.casefold() for each in table.elements]), falling=False
            ),
        ),
        terms=(text_term("unit", lambda element, value: element.unit.casefold() == value),),
    ),
    TableColumn(
        "on", 3, cells.option(Field.ENABLED), _SETTINGS, file=False, field=Field.ENABLED,
        terms=(choice_term(("on",), Field.ENABLED),),
    ),
    TableColumn(
        "div", 4, cells.number(Field.DIVIDER), (*_SETTINGS, *_IN_FILE), right=True, leaves=13, field=Field.DIVIDER,
        orders=_by_number("div", "d", Field.DIVIDER), terms=(number_term(("div", "divider"), Field.DIVIDER),),
    ),
    TableColumn(
        "samples", 7, cells.samples, _IN_FILE, live=False, right=True, orders=_by_number("size", "s", Field.SIZE),
    ),
    TableColumn("span s", 6, cells.span, _IN_FILE, live=False, right=True, wide=cells.SPAN_WIDE),
    TableColumn("type", 10, cells.type_cell, _IN_FILE, live=False),
    TableColumn(
        "act", 8, cells.option(Field.ACTION), _SETTINGS, file=False, leaves=12, field=Field.ACTION,
        orders=_by("act", "p", Field.ACTION, "action"), terms=(action_term(("act", "action")),),
        head=lambda sight, width: "action",
    ),
    TableColumn(
        "buf", 4, cells.option(Field.BUFFER), (*_SETTINGS, *_IN_FILE), leaves=11, field=Field.BUFFER,
        orders=_by("buf", "b", Field.BUFFER), terms=(choice_term(("buf", "buffer"), Field.BUFFER),),
    ),
    TableColumn(
        "size", 5, cells.number(Field.SIZE), _SETTINGS, file=False, right=True, wide=7, leaves=14,
        field=Field.SIZE, orders=_by_number("size", "s", Field.SIZE),
        terms=(number_term(("size",), Field.SIZE),),
    ),
    TableColumn("lost", 5, cells.lost, _IN_FILE, live=False, right=True),
    TableColumn(
        "fill", 4, cells.fill, ("settings", "timing", "wide"), right=True, leaves=9, measured=True, file=False,
        orders=(_measured("fill", "f", "fill"),), terms=(fact_term(("fill",), "fill", read_share, "50%"),),
    ),
    TableColumn(
        STATE, WIDEST, cells.sign, ("settings", "statistics", "timing", "wide"), measured=True,
        orders=(TableOrder(STATE, "!", _sign_ranks, "state, worst first", "signs"),), branch=cells.branch_sign,
        terms=(state_term(),),
    ),
    TableColumn(
        "value", 11, cells.value, (*_ALL_SETS, "wide"), right=True, wide=11, measured=True, entry=cells.entry_value,
        orders=(
            _measured("value", "v", "value", of_norm=True),
            _measured("|value|", "a", "value", of_norm=True, of=np.abs),
        ),
        terms=(fact_term(("value",), "value"), fact_term(("|value|", "abs"), "value", of=np.abs)),
        head=cells.value_head,
    ),
    _statistic("min", "i", 5, falling=False), _statistic("max", "m", 4), _statistic("mean", "e", 3),
    _statistic("std", "t", 2, example="1"),
    TableColumn(
        NOISE, len(NOISE), cells.noise, (), right=True, measured=True,  # shown while it is the order
        orders=(TableOrder(NOISE, "y", lambda table: table.noise, "noise among siblings", "noise", of_norm=True),),
    ),
    TableColumn(
        LIMIT, 18, cells.limit, (), right=True, measured=True, file=False,  # shown while it is the order
        orders=(TableOrder(LIMIT, "x", lambda table: table.shares_left, "how near to its limit", falling=False),),
    ),
    TableColumn(
        "rate", 7, cells.rate, ("timing", "wide"), right=True, measured=True, orders=(_measured("rate", "r", "rate"),),
        terms=(rate_term(),), quantities=("rate",),
    ),
    TableColumn("%", 4, cells.share, ("timing",), right=True, leaves=8, measured=True, quantities=("share",)),
    TableColumn(
        "jitter", 7, cells.jitter, ("timing", "wide"), right=True, leaves=7, measured=True,
        orders=(_measured("jitter", "j", "jitter"),), terms=(fact_term(("jitter",), "jitter", read_seconds, "1ms"),),
        quantities=("jitter",),
    ),
    TableColumn(
        "changed", 8, cells.changed, ("timing",), right=True, leaves=6, measured=True,
        orders=(_measured("changed", "c", "changed", falling=False, words="last change"),),
        terms=(fact_term(("changed",), "changed", read_seconds, "1s"),), quantities=("changed", "change_seen"),
    ),
    TableColumn(
        "trend", 10, cells.trend, ("settings", "values", "wide"), leaves=1, measured=True,
        head=lambda sight, width: "trend" if sight.at_s is None else "all",
    ),
)  # fmt: skip
LIVE_COLUMNS = tuple(column for column in COLUMNS if column.live)
FILE_COLUMNS = tuple(column for column in COLUMNS if column.file)
SETTINGS = tuple(column.title for column in LIVE_COLUMNS if not column.measured)  # which of them the user chooses


def orders_of(columns: Iterable[TableColumn]) -> Mapping[str, TableOrder]:
    """Return the orders that a table of these columns has, by name, as the list of orders shows them."""

    def place(table: TableState) -> NDArray[Any]:
        return np.arange(len(table))

    steady = (
        TableOrder(TREE, "n", place, "name, as a tree", falling=False),
        TableOrder(NAME, "l", place, "name, as a list", falling=False),
        TableOrder(ADDED, "g", place, "as the program added them", falling=False),
    )  # fmt: skip
    return {order.name: order for order in (*steady, *(order for column in columns for order in column.orders))}


def in_set(column: TableColumn, name: str, *, wide: bool) -> bool:
    """Return whether a set shows a column.

    On a wide screen statistics stand beside settings, settings beside timing; statistics alone leave values room.
    """
    beside = name != "timing" if column.measured else "settings" in column.sets and name != "statistics"
    return name in column.sets or (wide and beside and ("wide" in column.sets or not column.measured))


def shown_columns(shown: Iterable[ColumnShown], room: int, names: int, sort: str = "") -> list[ColumnShown]:
    """Return the columns that a table shows, with their widths, where `room` cells are for names and columns.

    Whole columns are left out where names would have less than `names` cells; never that of the order, nor, where that
    is of what is measured, its unit.
    """
    kept = [(column, width) for column, width in shown if width]
    by_measured = any(column.measured and column.gives(sort) for column, _ in kept)
    for column, width in sorted(kept, key=lambda pair: pair[0].leaves):
        if room - sum(1 + each for _, each in kept) >= names:
            break
        if column.leaves and not column.gives(sort) and not (by_measured and column.gives("unit")):
            kept.remove((column, width))
    return kept


class Layout(NamedTuple):
    """What stands where in a table of some width: names, settings up to `rest`, then what is measured, the rail.

    `left_out` has the columns for which there is no room.
    """

    width: int
    told: Told
    names: int
    steady: list[ColumnShown]
    rest: int
    measured: list[ColumnShown]
    left_out: tuple[str, ...]

    @property
    def spans(self) -> Iterator[tuple[TableColumn, int, int]]:
        """Each column from left to right, with its first cell and how many it has."""
        start = FLAGS + self.names
        for column, width in (*self.steady, *self.measured):
            yield column, start + 1, width
            start += 1 + width


def laid_out(
    width: int, told: Told, offered: Sequence[TableColumn], sight: Sight, sort: str, value: int, units: Iterable[int]
) -> Layout:
    """Lay a table out: what tells names apart comes first, then columns in their order, whole units, and names whole.

    What names don't need is for statistics, and the entries of vectors. `value` is how many cells the widest value
    takes, `units` those of the units that are shown, 0 for none.
    """
    measured = {
        each.title: max(each.width_in(sight, width), (1 + len(each.title)) * each.gives(sort))
        for each in offered if each.measured
    }  # fmt: skip
    rest = width - 1 - sum(1 + each for each in measured.values() if each)
    asked = [(each, measured.get(each.title, each.width_in(sight, rest))) for each in offered]
    needed = max(NAME_ROOM, min(told.names.readable, width // 2))
    longest = min(told.names.longest, max(needed, width // 2))
    room = width - 1 - FLAGS
    cells = {each.title: given for each, given in shown_columns(asked, room, needed, sort)}

    def spare(names: int) -> int:
        return max(0, room - names - sum(1 + each for each in cells.values()))

    if "unit" in cells:
        most = cells["unit"] + spare(min(longest, needed))
        cells["unit"] = max(unit for unit in (cells["unit"], *units) if unit <= most)
        if min((unit for unit in units if unit), default=0) > cells["unit"]:
            del cells["unit"]  # each would be an ellipsis
    wider = [each for each in offered if each.measured and each.wide > cells.get(each.title, each.wide)]
    step = spare(longest) // max(1, len(wider))
    cells |= {each.title: min(each.wide, cells[each.title] + step) for each in wider}
    if "value" in cells:
        cells["value"] += max(0, min(spare(longest), value - cells["value"]))
    shown = [(each, cells[each.title]) for each in offered if each.title in cells]
    return Layout(
        width, told, max(MIN_WIDTH, spare(0)),
        [each for each in shown if not each[0].measured],
        width - 1 - sum(1 + given for each, given in shown if each.measured),
        [each for each in shown if each[0].measured],
        tuple(each.title for each, given in asked if given and each.title not in cells),
    )  # fmt: skip

"""The columns of the element tables, each one entry: head, width, words, order, what editing it changes, filter term.

The table of a logger shows `LIVE_COLUMNS`, that of a file `FILE_COLUMNS`; the widgets draw what stands here and know no
column by name. A new column touches its entry and its test.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import ElementInfo
from silo_tui.model import text
from silo_tui.model.fields import Field, Ints, word_for
from silo_tui.model.table import TableState
from silo_tui.model.terms import Term, action_term, choice_term, number_term, text_term

if TYPE_CHECKING:
    from silo.analysis.reports import ElementReport

WIDE_FROM = 96  # cells of a table from which columns take their wide width
NAME_ROOM = 16  # columns are left out rather than that names get less

Row = TypeVar("Row")


class LiveRow(NamedTuple):
    """An element of a logger; `values` of shape `(5,)` are those on the screen, pending edits among them."""

    element: ElementInfo
    values: Ints


class FileRow(NamedTuple):
    """An element of a file."""

    element: ElementInfo
    report: "ElementReport"


@dataclass(frozen=True)
class TableColumn(Generic[Row]):
    """One column behind the names.

    `words` returns what stands in a cell of so many cells. `leaves` says when the column is left out of a narrow table
    (1 first, 0 never: a cut number would be a wrong one). `field` is what editing a cell changes. `sort` gives a key
    per element, `sorts` the place among the orders that `o` steps through, and `sort_word` what that order is called
    where it isn't the title. `alarm` tells cells that speak of a loss.
    """

    title: str
    width: int
    words: Callable[[Row, int], str]
    right: bool = False
    wide: int = 0
    leaves: int = 0
    field: Field | None = None
    sort: Callable[[TableState], NDArray[Any]] | None = None
    sorts: int = 0
    sort_word: str = ""
    term: Term | None = None
    alarm: Callable[[Row], bool] | None = None

    @property
    def order(self) -> str:
        """What the order by this column is called; empty when there is none."""
        return (self.sort_word or self.title) if self.sort is not None else ""

    def width_in(self, table_width: int) -> int:
        """Return the cells it takes in a table of that width."""
        return self.wide if self.wide and table_width >= WIDE_FROM else self.width


def _unit(row: LiveRow | FileRow, width: int) -> str:
    return "" if row.element.unit == "-" else row.element.unit


def _units(table: TableState) -> NDArray[Any]:
    return np.array([element.unit.casefold() for element in table.elements])


def _word(field: Field) -> Callable[[LiveRow, int], str]:
    return lambda row, width: word_for(field, int(row.values[field]))


def _number(field: Field) -> Callable[[LiveRow, int], str]:
    def words(row: LiveRow, width: int) -> str:
        value = int(row.values[field])
        # a number that is cut would be another one
        shorter = word_for(field, value), text.compact(float(value)), f"{value:.0e}".replace("e+0", "e")
        return next((word for word in shorter if len(word) <= width), shorter[-1])

    return words


def _by(field: Field) -> Callable[[TableState], NDArray[Any]]:
    return lambda table: table.values[field]


LIVE_COLUMNS: tuple[TableColumn[LiveRow], ...] = (
    TableColumn(
        "unit", 5, _unit, leaves=1, sort=_units, sorts=1,
        term=text_term("unit", lambda element, value: element.unit.casefold() == value),
    ),
    TableColumn(
        "on", 3, _word(Field.ENABLED), field=Field.ENABLED,
        term=choice_term(("on",), Field.ENABLED),
    ),
    TableColumn(
        "div", 4, _number(Field.DIVIDER), right=True, leaves=4, field=Field.DIVIDER,
        sort=_by(Field.DIVIDER), sorts=2, term=number_term(("div", "divider"), Field.DIVIDER),
    ),
    TableColumn(
        "act", 4, _word(Field.ACTION), leaves=3, field=Field.ACTION,
        sort=_by(Field.ACTION), sorts=4, term=action_term(("act", "action")),
    ),
    TableColumn(
        "buf", 4, _word(Field.BUFFER_TYPE), leaves=2, field=Field.BUFFER_TYPE,
        sort=_by(Field.BUFFER_TYPE), sorts=5,
        term=choice_term(("buf", "buffer"), Field.BUFFER_TYPE),
    ),
    TableColumn(
        "size", 7, _number(Field.BUFFER_SIZE), right=True, leaves=5, field=Field.BUFFER_SIZE,
        sort=_by(Field.BUFFER_SIZE), sorts=3, term=number_term(("size",), Field.BUFFER_SIZE),
    ),
)  # fmt: skip


def _cut(words: Callable[[FileRow], str]) -> Callable[[FileRow, int], str]:
    def cell(row: FileRow, width: int) -> str:
        found = words(row)
        return found if len(found) <= width else found[: width - 1] + "…"

    return cell


def _samples(row: FileRow) -> str:
    return str(row.report.samples) if row.report.samples < 10**7 else text.compact(row.report.samples)


def span_words(report: "ElementReport", *, wide: bool) -> str:
    """Return `40.95 … 51.14`, or how long that is."""
    if report.start_s is None or report.end_s is None:
        return "-"
    if wide:
        return f"{report.start_s:.5g} … {report.end_s:.5g}"
    return f"{report.end_s - report.start_s:.4g}"


def _span(row: FileRow, width: int) -> str:
    return _cut(lambda row: span_words(row.report, wide=width >= SPAN_WIDE))(row, width)


def type_word(element: ElementInfo, report: "ElementReport") -> str:
    """Return `float64[7]`, `enum`."""
    is_enum = bool(element.entries) and all(entry.labels for entry in element.entries)
    return report.type.replace(report.type.split("[", 1)[0], "enum") if is_enum else report.type


def _short_type(row: FileRow) -> str:
    """Return `f64[12]` for `float64[12]`, because a cell is small."""
    words = type_word(row.element, row.report)
    for long, short in (("uint", "u"), ("int", "i"), ("float", "f"), ("complex", "c"), ("datetime", "date")):
        words = words.replace(long, short)
    return words


SPAN_WIDE = 16

FILE_COLUMNS: tuple[TableColumn[FileRow], ...] = (
    TableColumn("unit", 5, _unit, sort=_units, sorts=1),
    TableColumn("div", 4, _cut(lambda row: str(row.report.divider)), right=True, sort=_by(Field.DIVIDER), sorts=2),
    TableColumn("samples", 7, _cut(_samples), right=True, sort=_by(Field.BUFFER_SIZE), sorts=3, sort_word="size"),
    TableColumn("span s", 6, _span, right=True, wide=SPAN_WIDE),
    TableColumn("type", 10, _cut(_short_type)),
    TableColumn(
        "buf", 4, _cut(lambda row: word_for(Field.BUFFER_TYPE, row.element.options.buffer_type)),
        sort=_by(Field.BUFFER_TYPE), sorts=4,
    ),
    TableColumn(
        "lost", 5, _cut(lambda row: str(row.report.lost)), right=True, alarm=lambda row: row.report.lost > 0
    ),
)  # fmt: skip


def orders_of(columns: Sequence[TableColumn[Any]]) -> tuple[str, ...]:
    """Return the orders that a table of these columns has, as `o` steps through them."""
    by_place = sorted((column for column in columns if column.sort is not None), key=lambda column: column.sorts)
    return ("name", "added", *(column.order for column in by_place))


def shown_columns(
    columns: Sequence[TableColumn[Row]], room: int, table_width: int
) -> list[tuple[TableColumn[Row], int]]:
    """Return the columns that a table shows, with their widths, where `room` cells are for names and columns.

    Whole columns are left out where names would have less than `NAME_ROOM`.
    """
    shown = [(column, column.width_in(table_width)) for column in columns]
    for column, width in sorted(shown, key=lambda pair: pair[0].leaves):
        if room - sum(1 + each for _, each in shown) >= NAME_ROOM:
            break
        if column.leaves:
            shown.remove((column, width))
    return shown

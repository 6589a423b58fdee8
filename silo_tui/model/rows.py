"""Which elements the table shows, in which order, where the cursor stands, and what is marked."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from silo_tui.model import filter as filters
from silo_tui.model.table import Mask, Rows, TableState
from silo_tui.model.table_columns import LIVE_COLUMNS, TableColumn, orders_of


def natural_key(name: str) -> tuple[object, ...]:
    """Sort `joint2` before `joint10` and `Base` beside `base`."""
    parts = re.split(r"(\d+)", name.casefold())
    return tuple((1, int(part)) if part.isdecimal() else (0, part) for part in parts if part)


class RowList:
    """The shown rows over a `TableState`. Rows are element numbers, positions count what is shown."""

    def __init__(self, table: TableState, columns: Sequence[TableColumn[Any]] = LIVE_COLUMNS) -> None:
        self.table = table
        self.filter = filters.parse("")
        self.sorts = orders_of(columns)
        self._columns = columns
        self.sort = "name"
        self.shown: Rows = np.zeros(0, np.intp)
        self.position = 0
        self.marked: Mask = np.zeros(0, np.bool_)
        self.anchor: int | None = None  # row where a range began
        self._order: Rows = np.zeros(0, np.intp)
        self._names: list[str] = []

    # -------------------------------------------------------------------------------------------- what is shown

    def refresh(self) -> None:
        """Follow a change of table, filter or sort: shown rows anew, the cursor stays on its element."""
        row = self.row
        if self._names != self.table.names:
            self._follow_names()
            row = min(row, len(self.table) - 1) if row is not None and len(self.table) else None
        self._order = self._sorted()
        mask = self.filter.mask(self.table, self.marked)
        self.shown = self._order[mask[self._order]]
        self._place(row)

    def set_filter(self, text: str) -> None:
        """Show what passes this filter. The cursor stays on its element, or goes to the first one that is shown."""
        row = self.row
        self.filter = filters.parse(text)
        self.refresh()
        if row is None or self.row != row:
            self.move_to(0)

    def next_sort(self) -> str:
        """Step to the next order and return its name."""
        self.sort = self.sorts[(self.sorts.index(self.sort) + 1) % len(self.sorts)]
        self.refresh()
        return self.sort

    # ------------------------------------------------------------------------------------------------ the cursor

    @property
    def row(self) -> int | None:
        """The element under the cursor."""
        return int(self.shown[self.position]) if 0 <= self.position < len(self.shown) else None

    def move_to(self, position: int) -> None:
        """Put the cursor on a position, cut to what there is."""
        self.position = max(0, min(position, len(self.shown) - 1))

    def move_to_row(self, row: int) -> bool:
        """Put the cursor on an element; False when the filter hides it."""
        found = np.flatnonzero(self.shown == row)
        if len(found):
            self.position = int(found[0])
        return bool(len(found))

    # --------------------------------------------------------------------------------------------------- marks

    @property
    def marked_count(self) -> int:
        """Marked elements, hidden ones too."""
        return int(self.marked.sum())

    @property
    def hidden_marked(self) -> int:
        """Marked elements that the filter hides."""
        return self.marked_count - int(self.marked[self.shown].sum())

    def toggle_mark(self) -> None:
        """Mark or unmarks the element under the cursor."""
        if self.row is not None:
            self.marked[self.row] = not self.marked[self.row]

    def mark_shown(self) -> int:
        """Mark everything that is shown, or unmarks it when all of it is marked. Returns how many are marked then."""
        self.marked[self.shown] = not self.marked[self.shown].all()
        return self.marked_count

    def clear_marks(self) -> None:
        """Unmark everything, also what the filter hides."""
        self.marked[:] = False
        self.anchor = None

    def begin_range(self) -> None:
        """Begin a range that grows from here with the cursor until it is ended."""
        self.anchor = self.row

    def end_range(self) -> int:
        """Mark the range and return how many rows it had."""
        rows = self.range_rows()
        self.marked[rows] = True
        self.anchor = None
        return len(rows)

    def range_rows(self) -> Rows:
        """Return the rows between where the range began and the cursor."""
        if self.anchor is None or self.row is None:
            return np.zeros(0, np.intp)
        found = np.flatnonzero(self.shown == self.anchor)
        first = int(found[0]) if len(found) else self.position
        return self.shown[min(first, self.position) : max(first, self.position) + 1]

    def targets(self) -> Rows:
        """Return what an edit is about: the range, else what is marked as shown, else the cursor's element."""
        if self.anchor is not None:
            return self.range_rows()
        if self.marked.any():
            return self._order[self.marked[self._order]]
        return np.array([self.row], np.intp) if self.row is not None else np.zeros(0, np.intp)

    # -------------------------------------------------------------------------------------------------- inside

    def _follow_names(self) -> None:
        kept = {name for name, marked in zip(self._names, self.marked, strict=True) if marked}
        self._names = self.table.names
        self.marked = np.fromiter((name in kept for name in self._names), np.bool_, len(self._names))
        self.anchor = None

    def _sorted(self) -> Rows:
        count = len(self.table)
        if self.sort == "added":
            return np.arange(count, dtype=np.intp)
        by_name = self._by_name()
        if self.sort == "name":
            return by_name
        keys = next(column.sort for column in self._columns if column.order == self.sort and column.sort is not None)
        return by_name[np.argsort(keys(self.table)[by_name], kind="stable")]

    def _by_name(self) -> Rows:
        names = self.table.names
        if getattr(self, "_name_order_of", None) is not names:
            keys = [natural_key(name) for name in names]
            self._name_order: Rows = np.array(sorted(range(len(names)), key=keys.__getitem__), np.intp)
            self._name_order_of: Sequence[str] = names
        return self._name_order

    def _place(self, row: int | None) -> None:
        if row is None or not self.move_to_row(row):
            self.move_to(self.position)

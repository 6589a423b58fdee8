"""Which elements the table shows, in which order and on which lines, where the cursor stands, and what is marked."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from silo.core.names import component_name
from silo.core.quantities.writing import many
from silo_tui.model.samples.live import has_norm
from silo_tui.model.table import filter as filters
from silo_tui.model.table.columns import LIVE_COLUMNS, NAME, TREE, TableColumn, orders_of
from silo_tui.model.table.facts import SINCE
from silo_tui.model.table.state import Mask, Rows, TableState
from silo_tui.model.table.tree import ENTRY, Branch, Tree, entry_of, list_of, parts_of, row_of, tree_of
from silo_tui.model.words.names import below

SETTLES_S = 3.0  # of statistics by which the first of an order are chosen: of few samples noise is anything
LEAVES_S = 2.0  # how long a row stays, dim, that a measured filter lets go


def natural_key(name: str) -> tuple[object, ...]:
    """Sort `joint2` before `joint10` and `Base` beside `base`."""
    parts = re.split(r"(\d+)", name.casefold())
    return tuple((1, int(part)) if part.isdecimal() else (0, part) for part in parts if part)


class RowList:
    """The shown rows over a `TableState`. Rows are element numbers; positions count lines, see `model.tree`.

    `shown` are the elements that pass the filter, in order; `tree` has the lines on the screen, on which branches stand
    too and entries of vectors, and where those in folded branches are left out.
    """

    def __init__(self, table: TableState, columns: Sequence[TableColumn] = LIVE_COLUMNS) -> None:
        self.table = table
        self.filter = filters.parse("")
        self.orders = orders_of(columns)
        self.sort = NAME
        self.turned = False  # the order the other way round
        self.held = False  # an order by what is measured stands still, as somebody is at the keys
        self.most = 0  # only so many of what passes, the first of the order; 0: all
        self.stood_ns = 0  # when these were chosen; 0 while the order moves them
        self._stood: list[str] = []  # their names
        self.shown: Rows = np.zeros(0, np.intp)
        self.passing = 0  # elements that pass the filter, be only the first of them shown
        self.tree = Tree(np.zeros(0, np.int64))
        self.folded: frozenset[str] = frozenset()  # paths of branches
        self.unfolded: dict[str, int] = {}  # vectors that show their entries, and how many these are
        self.components: dict[str, int] = {}  # of vectors: 1 for the norm, 2 for the first entry ... instead of a list
        self.leaving: frozenset[int] = frozenset()  # rows that stay for a moment, dim
        self.position = 0
        self.marked: Mask = np.zeros(0, np.bool_)
        self.anchor: int | None = None  # line where a range began
        self._order: Rows = np.zeros(0, np.intp)
        self._names: list[str] = []
        self._orders_made: dict[bool, tuple[list[str], str, Rows]] = {}  # by name: of which names, with which prefix
        self._passed_s: dict[int, float] = {}  # when rows that are leaving passed last
        self._was_measured = False  # as the filter was judged last: else all were shown

    # -------------------------------------------------------------------------------------------- what is shown

    def refresh(self, now_s: float | None = None) -> None:
        """Follow a change of table, filter or order: lines anew, the cursor stays on its element.

        With a time (monotonic) as a filter is judged again: rows that it lets go stay for two seconds.
        """
        line, row = self.line, self.row
        path = self.branch.path if self.branch is not None else None
        if self._names != self.table.names:
            kept = {name for name, marked in zip(self._names, self.marked, strict=True) if marked}
            self._names = self.table.names
            self.marked = np.fromiter((name in kept for name in self._names), np.bool_, len(self._names))
            self.anchor = None
            line, path = None, None
            row = min(row, len(self.table) - 1) if row is not None and len(self.table) else None
        self._order = self._sorted()
        mask = self.filter.mask(self.table, self.marked)
        if now_s is None or not self._was_measured:
            self._passed_s, self.leaving = {}, frozenset()
        else:
            mask = self._with_leaving(mask, now_s)
        self._was_measured = self.is_measured
        passing = self._order[mask[self._order]]
        self.passing = len(passing)
        self.shown = self._first_of(passing) if self.most else passing
        self._lay_lines()
        self._place(line, row, path)

    def _first_of(self, passing: Rows) -> Rows:
        """Return the first of those that pass, of which something is known; once they stand still, those."""
        if self.stood_ns:
            return np.array([row for name in self._stood if (row := self.table.row(name)) is not None], np.intp)
        order = self.orders[self.sort]
        known = passing[~np.isnan(order.keys(self.table)[passing])] if order.quantity and self.is_measured else passing
        return known[: self.most]

    def stand_still(self, now_ns: int) -> None:
        """Let those that are shown stay and stand as they do, whatever is measured from now on, if they are the first
        of an order; a filter or an order lets them go.
        """
        if self.most:
            self.stood_ns, self._stood = now_ns, [self.table.names[row] for row in self.shown]

    def show_first(self, most: int) -> None:
        """Show only so many, as the order has them, till they are to stand still; 0: all."""
        self.most, self.stood_ns = most, 0

    def _with_leaving(self, mask: Mask, now_s: float) -> Mask:
        gone = [int(row) for row in self.shown if not mask[row]]
        for row in gone:
            self._passed_s.setdefault(row, now_s)
        self._passed_s = {
            row: since for row, since in self._passed_s.items() if not mask[row] and now_s - since < LEAVES_S
        }
        self.leaving = frozenset(self._passed_s)
        mask = mask.copy()
        mask[list(self.leaving)] = True
        return mask

    def _lay_lines(self) -> None:
        rows = {row: count for name, count in self.unfolded.items() if (row := self.table.row(name)) is not None}
        if self.sort == TREE:
            self.tree = tree_of(self.shown, self._short_names(), self.folded, rows)
        else:
            self.tree = list_of(self.shown, rows)

    def _short_names(self) -> list[str]:
        return [below(self.table.prefix, name) for name in self.table.names]

    def set_filter(self, text: str) -> None:
        """Show what passes this filter; without one the cursor stays on its element.

        With one it is on the first element whose name passes, as one that passes by a component alone may stand before
        it. In the order of names it is on the first whose own name was typed whole: `torque` before `peak_torque`.
        """
        row, before = self.row, self.filter.text
        self.show_first(0)
        self.filter = filters.parse(text)
        self.refresh()
        if row is None or self.row != row or (text and text != before):
            is_row = (self.tree.lines >= 0) & (self.tree.lines < ENTRY)  # no name space, no entry of an unfolded vector
            places = np.flatnonzero(is_row).tolist() if text else []
            passing = self.tree.lines[places].tolist()
            by_component = set(self.filter.by_component(self.table, self.marked, passing))
            by_name = [at for at, each in zip(places, passing, strict=True) if each not in by_component]
            whole = {word.casefold() for word in text.split()} if self.sort in {TREE, NAME} else set()
            own = [at for at in by_name if self.own_name(int(self.tree.lines[at])) in whole]
            self.move_to((own or by_name or places or [0])[0])

    def own_name(self, row: int) -> str:
        """Return the last level of the name of an element, in small letters."""
        return parts_of(self.table.names[row])[-1].casefold()

    def order_by(self, sort: str) -> None:
        """Take an order; the same once more turns it round."""
        self.turned = not self.turned if sort == self.sort and sort != TREE else False
        self.sort = sort
        self.show_first(0)
        self.refresh()

    @property
    def live(self) -> bool:
        """Whether the order is by what is measured, and moves."""
        return bool(self.orders[self.sort].quantity) and not self.stood_ns

    @property
    def place(self) -> int:
        """Which of the elements shown the cursor is on, from 1; the entries of an unfolded one don't count."""
        row = self.row
        if row is None:
            return 0
        found = np.flatnonzero(self.shown == row)
        return int(found[0]) + 1 if len(found) else 0

    @property
    def arrow(self) -> str:
        """`↓` where it falls: the largest, or last, is on top; `↑` where it rises: names from a to z."""
        return "↓" if self.orders[self.sort].falling != self.turned else "↑"

    def wanted(self) -> set[str]:
        """Return the quantities that have to be surveyed of all elements for filter, order and signs."""
        return {"signs"} | self.filter.quantities | ({self.orders[self.sort].quantity} - {""})

    @property
    def is_measured(self) -> bool:
        """Whether what filter and order are by is known."""
        return self.wanted() <= set(self.table.facts.quantities)

    @property
    def is_young(self) -> bool:
        """Whether the first of an order are to be chosen by statistics that have hardly begun."""
        facts = self.table.facts
        by_statistics = self.most and self.orders[self.sort].quantity in SINCE
        return bool(by_statistics and facts.time_ns - facts.since_ns < SETTLES_S * 1e9)

    # ------------------------------------------------------------------------------------------------- folding

    def fold(self) -> str:
        """Fold or unfold the branch, or the vector, under the cursor, else the branch that holds it; say what."""
        branch, row = self.branch, self.row
        if branch is not None:
            unfold = branch.path in self.folded
            self.folded = self.folded - {branch.path} if unfold else self.folded | {branch.path}
            self.refresh()
            return ""
        if row is None:
            return ""
        if name := self.vector:
            if name in self.unfolded:
                del self.unfolded[name]
            else:
                self.unfolded[name] = len(self.table.elements[row].entries)
            self.refresh()
            self.move_to_row(row)
            return ""
        words = ""
        if self.sort != TREE:
            self.sort, words = TREE, "by name, as a tree"
        path = "/" + "/".join(parts_of(self._short_names()[row])[:-1])
        if path == "/":
            self.refresh()
            return words or "it lies in no name space"
        self.folded |= {path}
        self.refresh()
        self._move_to_branch(path)
        return words

    @property
    def vector(self) -> str:
        """The name of the vector under the cursor; empty on anything else."""
        element = self.table.elements[self.row] if self.row is not None else None
        return element.name if element is not None and len(element.entries) > 1 else ""

    def next_component(self) -> str:
        """Show norm, first entry, second ... of the vector under the cursor, then its entries side by side again."""
        if self.row is None:
            return ""
        element = self.table.elements[self.row]
        if not self.vector:
            return "it has one value only"
        chosen = (self.components.get(element.name, 0) + 1) % (len(element.entries) + 2)
        chosen = 2 if chosen == 1 and not has_norm(element) else chosen
        self.components[element.name] = chosen
        if chosen == 0:
            del self.components[element.name]
            return "its entries side by side"
        count = len(element.entries)
        if chosen == 1:
            return f"the norm of its {count} entries alone"
        return f"entry {component_name(element.entries[chosen - 2].suffix)} alone, {chosen - 1} of {count}"

    def component(self, row: int) -> int:
        """Return what is shown of a vector: 0 its entries side by side, 1 the norm, 2 its first entry, 3 the next ...

        A norm is shown only where somebody asks for it, by `n` or by an order of what a vector has as a whole.
        """
        element = self.table.elements[row]
        if len(element.entries) < 2:
            return 0
        asked = self.components.get(element.name, 0) or int(self.orders[self.sort].of_norm)
        return asked if asked > 1 or has_norm(element) else 0

    def entry_alone(self, row: int) -> int | None:
        """Return which entry of a vector is looked at alone: the one that is chosen, or that the cursor is on.

        Of what is marked none: marks are of whole elements.
        """
        if row == self.row and self.entry is not None and not self.marked[row]:
            return self.entry
        chosen = self.components.get(self.table.names[row], 0)
        return chosen - 2 if chosen >= 2 else None

    def _move_to_branch(self, path: str) -> bool:
        numbers = (number for number, branch in enumerate(self.tree.branches) if branch.path == path)
        return any(self._move_to_line(-1 - number) for number in numbers)

    def _move_to_line(self, line: int) -> bool:
        found = np.flatnonzero(self.tree.lines == line)
        if len(found):
            self.position = int(found[0])
        return bool(len(found))

    # ------------------------------------------------------------------------------------------------ the cursor

    @property
    def line(self) -> int | None:
        """The line under the cursor, as `model.tree` numbers them."""
        return int(self.tree.lines[self.position]) if 0 <= self.position < len(self.tree.lines) else None

    @property
    def row(self) -> int | None:
        """The element under the cursor, also of one of its entries; None on a branch."""
        return None if self.line is None else row_of(self.line)

    @property
    def entry(self) -> int | None:
        """The number of the entry under the cursor; None on a whole element."""
        return None if self.line is None else entry_of(self.line)

    @property
    def branch(self) -> Branch | None:
        """The branch under the cursor."""
        line = self.line
        return self.tree.branches[-1 - line] if line is not None and line < 0 else None

    def move_to(self, position: int) -> None:
        """Put the cursor on a position, cut to what there is."""
        self.position = max(0, min(position, len(self.tree.lines) - 1))

    def move_to_row(self, row: int) -> bool:
        """Put the cursor on an element; False when the filter hides it. Branches that hide it are unfolded."""
        if not (self.tree.lines == row).any() and (self.shown == row).any():
            self.folded -= {branch.path for branch in self.tree.branches if (branch.rows == row).any()}
            self._lay_lines()
        return self._move_to_line(row)

    def move_to_space(self, name: str) -> bool:
        """Put the cursor on a name space, by its path or the end of it; False where none is shown of that name.

        Branches that hide it are unfolded.
        """
        whole = below(self.table.prefix, name.rstrip("/")).casefold()
        paths = [each.path for each in self.tree.branches]
        found = [path for path in paths if path.casefold() == whole or path.casefold().endswith(f"/{whole}")]
        if not whole or not found:
            return False
        path = min(found, key=len)
        self.folded -= {each for each in self.folded if path.startswith(f"{each}/")}
        self._lay_lines()
        return self._move_to_branch(path)

    def move_to_target(self) -> bool:
        """Put the cursor on the nearest row that an edit is about; False where it is on one, or none is shown."""
        targets = self.targets()
        places = np.flatnonzero(np.isin(self.tree.lines, targets))
        if self.branch is not None or self.row in targets or not len(places):
            return False
        self.move_to(int(places[np.abs(places - self.position).argmin()]))
        return True

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
        if self.branch is not None:
            below = self.branch.rows
            self.marked[below] = not self.marked[below].all()
        elif self.row is not None:
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
        self.anchor = self.line

    def end_range(self) -> int:
        """Mark the range and return how many rows it had."""
        rows = self.range_rows()
        self.marked[rows] = True
        self.anchor = None
        return len(rows)

    def range_rows(self) -> Rows:
        """Return the rows between where the range began and the cursor."""
        if self.anchor is None or self.line is None:
            return np.zeros(0, np.intp)
        found = np.flatnonzero(self.tree.lines == self.anchor)
        first = int(found[0]) if len(found) else self.position
        rows: list[int] = []
        for line in self.tree.lines[min(first, self.position) : max(first, self.position) + 1].tolist():
            row = row_of(line)
            # an open branch stands for the lines of the range that lie below it, a folded one for all it hides
            if row is None and (hidden := self.tree.branches[-1 - line]).path in self.folded:
                rows += hidden.rows.tolist()
            elif row is not None and entry_of(line) is None:
                rows.append(row)
        return np.array(rows, np.intp)

    def targets(self) -> Rows:
        """Return what an edit is about: the range, else what is marked, else the cursor's element or branch."""
        if self.anchor is not None:
            return self.range_rows()
        if self.marked.any():
            return self._order[self.marked[self._order]]
        if self.branch is not None:
            return self.branch.rows
        return np.array([self.row], np.intp) if self.row is not None else np.zeros(0, np.intp)

    @property
    def targets_words(self) -> str:
        """What an edit is about, to be told before it is made."""
        targets = self.targets()
        marked = "marked " if self.anchor is None and self.marked.any() else ""
        if len(targets) == 1:
            return f"{marked}{below(self.table.prefix, self.table.names[targets[0]])}{self.not_here}"
        return f"{many(len(targets), f'{marked}element')}{self.not_here}"

    @property
    def not_here(self) -> str:
        """What to add where that is marked elsewhere: one looks at the row under the cursor."""
        row = self.row
        if row is None or row in self.targets():
            return ""
        return f", not of {self.table.names[row].rpartition('/')[2]}"

    def hidden_targets(self) -> Rows:
        """Return targets that the filter hides: marked ones."""
        targets = self.targets()
        marked = self.anchor is None and self.marked.any()
        return targets[~np.isin(targets, self.shown)] if marked else targets[:0]

    # -------------------------------------------------------------------------------------------------- inside

    def _sorted(self) -> Rows:
        if self.sort == TREE:
            return self._by_name(as_tree=True)
        by_name, order = self._by_name(), self.orders[self.sort]
        if self.sort == NAME:
            return by_name[:: -1 if self.turned else 1]
        keys = order.keys(self.table)
        if not order.quantity:
            found = by_name[np.argsort(keys[by_name], kind="stable")]
            return found[::-1] if self.turned else found
        of = keys[by_name]  # NaN stands last either way, as NumPy sorts
        return by_name[np.argsort(-of if order.falling != self.turned else of, kind="stable")]

    def _by_name(self, *, as_tree: bool = False) -> Rows:
        names, prefix = self.table.names, self.table.prefix
        known = self._orders_made.get(as_tree)
        if known is None or known[0] is not names or known[1] != prefix:
            shown = self._short_names()
            levels = ([(natural_key(level), level) for level in parts_of(name)] for name in shown)
            keys: list[Any] = list(levels if as_tree else map(natural_key, shown))
            known = names, prefix, np.array(sorted(range(len(keys)), key=keys.__getitem__), np.intp)
            self._orders_made[as_tree] = known
        return known[2]

    def _place(self, line: int | None, row: int | None, path: str | None) -> None:
        if path is not None and self._move_to_branch(path):
            return
        if line is not None and row is not None:
            if self._move_to_line(line) or self._move_to_line(row):
                return
            for number in reversed(range(len(self.tree.branches))):  # the innermost that is folded over it
                if (self.tree.branches[number].rows == row).any() and self._move_to_line(-1 - number):
                    return
        elif row is not None and self.move_to_row(row):
            return
        self.move_to(self.position)

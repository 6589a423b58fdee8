"""The static columns of the element table: drawn line by line from NumPy state, so that 10,000 elements cost nothing.

Measured: Textual's DataTable needs 4 - 7 s for 10,000 rows and 130 ms per update; this needs the lines on the screen.
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from rich.cells import cell_len, set_cell_size
from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.geometry import Region, Size
from textual.message import Message
from textual.scroll_view import ScrollView
from textual.strip import Strip

from silo_tui.model import text
from silo_tui.model.fields import Field, Ints
from silo_tui.model.names import fitting_names
from silo_tui.model.orders import ADDED, NAME, TREE
from silo_tui.model.rows import RowList
from silo_tui.model.table_columns import LiveRow, TableColumn, shown_columns
from silo_tui.model.tree import entry_of, row_of
from silo_tui.sessions.live import Session
from silo_tui.unforeseen import Guarded

FLAGS = 2
DERIVED = "="  # the sign of what is computed from others
NOT_OF_DERIVED = (Field.ACTION, Field.BUFFER_TYPE, Field.BUFFER_SIZE)
MAX_STRIPS = 4000


class ElementTable(Guarded, ScrollView, can_focus=True):
    """Name, unit and options of the shown elements; holds the cursor."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {
        "table--row", "table--cursor", "table--cell", "table--range", "table--marked", "table--off", "table--quiet",
        "table--pending", "table--conflict",
    }  # fmt: skip
    DEFAULT_CSS = """
    ElementTable { scrollbar-size: 0 0; overflow-x: hidden; width: 1fr; height: 1fr; }
    """

    @dataclass
    class Moved(Message):
        """The cursor or what is on the screen changed."""

    @dataclass
    class Picked(Message):
        """A cell was clicked twice, or once where the cursor was."""

        field: Field | None

    def __init__(
        self, session: Session, columns: Sequence[TableColumn[Any]], facts: Callable[[int, Ints], Any] | None = None
    ) -> None:
        """Show `columns`; `facts` makes what they draw of an element's row and its values (default: a `LiveRow`)."""
        super().__init__()
        self.session = session
        self.field = Field.ENABLED
        self._all_columns = self._columns = self._offered = columns
        self._wanted: tuple[str, ...] = ()
        self._facts = facts or (lambda row, values: LiveRow(session.table.elements[row], values))
        self._strips: dict[tuple[object, ...], Strip] = {}
        self._styles: dict[str, Style] = {}
        self._masks_of = (-1, -1)
        self._drawn: tuple[int, int] = (-1, -1)
        self._names: list[str] = []
        self._names_of: tuple[int, int, int, str] | None = None

    @property
    def rows(self) -> RowList:
        """What is shown."""
        return self.session.rows

    # ---------------------------------------------------------------------------------------------- geometry

    @property
    def shown(self) -> list[tuple[TableColumn[Any], int]]:
        """The columns that fit, and their widths."""
        return shown_columns(self._columns, self.size.width - FLAGS, self.size.width)

    @property
    def name_width(self) -> int:
        """Cells for names."""
        return max(8, self.size.width - FLAGS - sum(1 + width for _, width in self.shown))

    def field_at(self, x: int) -> Field | None:
        """Return the editable field in a column of the screen."""
        for field, (start, width) in self.field_spans().items():
            if start <= x < start + width:
                return field
        return None

    def field_spans(self) -> dict[Field, tuple[int, int]]:
        """Return first column and width of each field that is shown."""
        spans = {}
        start = FLAGS + self.name_width
        for column, width in self.shown:
            if column.field is not None:
                spans[column.field] = (start + 1, width)
            start += 1 + width
        return spans

    def field_beside(self, step: int) -> Field:
        """Return the next field that is shown to the right (1) or left (-1) of the chosen one, or that one."""
        beside = [field for field in self.field_spans() if (field - self.field) * step > 0]
        return min(beside, key=lambda field: abs(field - self.field), default=self.field)

    def cell_region(self) -> Region:
        """Return where the cell under the cursor is on the screen."""
        spans = self.field_spans()
        start, width = spans.get(self.field, (self.size.width - 8, 8))  # a hidden one is edited at the end of the line
        top = self.rows.position - self.scroll_offset.y
        return Region(self.region.x + start, self.region.y + top, width, 1)

    def rows_on_screen(self) -> list[int]:
        """Return the elements that are visible now."""
        top = self.scroll_offset.y
        lines = self.rows.tree.lines[top : top + max(1, self.size.height)].tolist()
        return list(dict.fromkeys(row for line in lines if (row := row_of(line)) is not None))

    def entries_on_screen(self) -> list[str]:
        """Return the full names of the entries that have a line of their own now."""
        top = self.scroll_offset.y
        found = []
        for line in self.rows.tree.lines[top : top + max(1, self.size.height)].tolist():
            row, entry = row_of(line), entry_of(line)
            if row is not None and entry is not None:
                found.append(
                    self.session.table.elements[row].name + self.session.table.elements[row].entries[entry].suffix
                )
        return found

    def choose(self, columns: Sequence[TableColumn[Any]]) -> None:
        """Offer other columns; of these the chosen ones are shown."""
        self._offered = columns
        self._columns = [column for column in columns if not self._wanted or column.title in self._wanted]
        self._strips.clear()
        self.refresh()

    # ---------------------------------------------------------------------------------------------- changing

    @property
    def chosen_columns(self) -> tuple[str, ...]:
        """The titles of the columns that were chosen; none: all."""
        return self._wanted

    def choose_columns(self, titles: Collection[str]) -> list[str]:
        """Show the columns of these titles, all where there is none; return those that there aren't."""
        known = tuple(column.title for column in self._all_columns if column.title in titles)
        self._wanted = known if len(known) < len(self._all_columns) else ()
        self.choose(self._offered)
        return [title for title in titles if title not in known]

    def rows_changed(self) -> None:
        """Follow a change of the rows, their order or their values."""
        self.virtual_size = Size(self.size.width, len(self.rows.tree.lines))
        self.show_cursor()
        self.refresh()

    def show_cursor(self) -> None:
        """Scroll so that the cursor is on the screen, and draws where it was and where it is."""
        height = max(1, self.size.height)
        top, position = round(self.scroll_y), self.rows.position
        wanted = min(max(top, position - height + 1), position)
        wanted = max(0, min(wanted, max(0, len(self.rows.tree.lines) - height)))
        if wanted != top:
            self.scroll_to(y=wanted, animate=False, force=True, immediate=True)
            self.refresh()
        elif self.rows.anchor is not None:
            self.refresh()
        else:
            for line in {self._drawn[0], position}:
                self.refresh_line(line - top)
        self._drawn = (position, int(self.field))
        self.post_message(self.Moved())

    def redraw_cursor(self) -> None:
        """Draw the row under the cursor again."""
        self.refresh_line(self.rows.position - self.scroll_offset.y)

    def watch_scroll_y(self, old_value: float, new_value: float) -> None:
        """Tell other panes of the scroll."""
        super().watch_scroll_y(old_value, new_value)
        if round(old_value) != round(new_value):
            self.post_message(self.Moved())

    def on_resize(self) -> None:
        """Draw columns of another width."""
        self._strips.clear()
        self.virtual_size = Size(self.size.width, len(self.rows.tree.lines))
        self.call_after_refresh(self.show_cursor)

    def notify_style_update(self) -> None:
        """Follow a change of the theme."""
        super().notify_style_update()
        self._strips.clear()
        self._styles.clear()

    def on_click(self, event: events.Click) -> None:
        """Put the cursor there, edit where it was already, mark in front of a name."""
        position = event.y + self.scroll_offset.y
        if position >= len(self.rows.tree.lines):
            return
        field = self.field_at(event.x)
        if event.x < FLAGS:
            self.rows.move_to(position)
            self.rows.toggle_mark()
            self.refresh()
            self.show_cursor()
            return
        again = position == self.rows.position and (field is None or field is self.field)
        self.rows.move_to(position)
        self.field = field if field is not None else self.field
        self.show_cursor()
        if (again and field is not None) or event.chain == 2:
            self.post_message(self.Picked(field))

    # ---------------------------------------------------------------------------------------------- drawing

    def render_line(self, y: int) -> Strip:
        """Return one element."""
        position = y + self.scroll_offset.y
        width = self.size.width
        if position >= len(self.rows.tree.lines):
            return Strip.blank(width, self._style("table--row"))
        self._refresh_masks()
        line = int(self.rows.tree.lines[position])
        is_cursor = position == self.rows.position
        row = row_of(line)
        if row is None or entry_of(line) is not None:
            return Strip(list(self._other_segments(line, position, is_cursor=is_cursor)), width)
        key = (
            row, width, int(self.field) if is_cursor else -1, bool(self.rows.marked[row]), bool(self._range[row]),
            self.rows.tree.depth(position), self.rows.sort == TREE, row in self.rows.leaving,
            self.session.table.names[row] in self.rows.unfolded,
            self._values[:, row].tobytes(), self._pending[:, row].tobytes(), self._conflicts[:, row].tobytes(),
        )  # fmt: skip
        strip = self._strips.get(key)
        if strip is None:
            if len(self._strips) > MAX_STRIPS:
                self._strips.clear()
            depth = self.rows.tree.depth(position)
            strip = Strip(list(self._segments(row, depth, is_cursor=is_cursor)), width)
            self._strips[key] = strip
        return strip

    def _refresh_masks(self) -> None:
        anchor = -1 if self.rows.anchor is None else self.rows.position
        if self._masks_of == (self.session.table.version, anchor):
            return
        table = self.session.table
        self._values, self._pending, self._conflicts = table.values, table.pending, table.conflicts
        self._range = np.zeros(len(table), np.bool_)
        self._range[self.rows.range_rows()] = True
        self._masks_of = (table.version, anchor)

    def _style(self, *names: str) -> Style:
        key = " ".join(names)
        if key not in self._styles:
            style = self.get_component_rich_style(names[0])
            for name in names[1:]:
                style += self.get_component_rich_style(name, partial=True)
            self._styles[key] = style
        return self._styles[key]

    def _other_segments(self, line: int, position: int, *, is_cursor: bool) -> Iterator[Segment]:
        """Yield a branch, or one entry of a vector."""
        base = ["table--row", "table--cursor"] if is_cursor else ["table--row"]
        row, entry = row_of(line), entry_of(line)
        indent = "  " * self.rows.tree.depth(position)
        if row is not None and entry is not None:
            suffix = self.session.table.elements[row].entries[entry].suffix
            words = f"{indent or '  '}  {suffix}"
            room = self.size.width - FLAGS
            yield Segment("  ", self._style(*base))
            yield Segment(self._fitted(words, room), self._style(*base, *([] if is_cursor else ["table--quiet"])))
            return
        branch = self.rows.tree.branches[-1 - line]
        pending, conflicts = self._pending[:, branch.rows].any(), self._conflicts[:, branch.rows].any()
        flag, flag_style = ("!", "table--conflict") if conflicts else ("*" if pending else " ", "table--pending")
        yield Segment(flag, self._style(*base, flag_style))
        marked = bool(self.rows.marked[branch.rows].all())
        yield Segment(">" if marked else " ", self._style(*base, "table--marked"))
        sign = "►" if branch.path in self.rows.folded else "▼"
        name = f"{indent}{sign} {branch.label}"
        width = self.name_width
        yield Segment(self._fitted(name, width), self._style(*base, *(["table--marked"] if marked else [])))
        words = f" {len(branch.rows)}"
        room = self.size.width - FLAGS - width
        yield Segment(self._fitted(words, room), self._style(*base, *([] if is_cursor else ["table--quiet"])))

    def _tree_name(self, row: int, depth: int, width: int) -> str:
        """Return the last level of a name, whole where it fits, behind what shows how deep it lies."""
        element = self.session.table.elements[row]
        several = len(element.entries) > 1
        sign = ("▼ " if element.name in self.rows.unfolded else "► ") if several else "  "
        label = element.name.rpartition("/")[2] + (f" |{len(element.entries)}|" if several else "")
        words = f"{'  ' * depth}{sign}{label}"
        return words if len(words) <= width else self._name_in(row, width)

    def _segments(self, row: int, depth: int, *, is_cursor: bool) -> Iterator[Segment]:
        values, pending, conflicts = self._values[:, row], self._pending[:, row], self._conflicts[:, row]
        marked = bool(self.rows.marked[row]) or bool(self._range[row])
        base = ["table--row"]
        if (not values[Field.ENABLED] or row in self.rows.leaving) and not is_cursor:
            base.append("table--off")
        if bool(self._range[row]):
            base.append("table--range")
        if is_cursor:
            base.append("table--cursor")
        flag, flag_style = (" ", "table--row")
        if conflicts.any():
            flag, flag_style = "!", "table--conflict"
        elif pending.any():
            flag, flag_style = "*", "table--pending"
        derived = row >= self.session.table.own
        if derived:
            flag, flag_style = DERIVED, "table--quiet"
        yield Segment(flag, self._style(*base, flag_style))
        yield Segment(">" if marked else " ", self._style(*base, *(["table--marked"] if marked else [])))
        width = self.name_width
        in_tree = self.rows.sort == TREE
        name = self._fitted(self._tree_name(row, depth, width) if in_tree else self._name_in(row, width), width)
        yield Segment(name, self._style(*base, *(["table--marked"] if marked else [])))
        quiet = [] if is_cursor else ["table--quiet"]  # grey on the cursor's line is hard to read in 16 colours
        facts = self._facts(row, values)
        for column, cell_width in self.shown:
            shown = "-" if derived and column.field in NOT_OF_DERIVED else column.words(facts, cell_width)
            word = self._fitted(shown, cell_width, right=column.right)
            if column.field is None:
                alarm = column.alarm is not None and column.alarm(facts)
                yield Segment(" " + word, self._style(*base, *(["table--conflict"] if alarm else quiet)))
                continue
            styles = list(base)
            if conflicts[column.field]:
                styles.append("table--conflict")
            elif pending[column.field]:
                styles.append("table--pending")
            if is_cursor and column.field is self.field:
                styles.append("table--cell")
            yield Segment(" ", self._style(*base))
            yield from self._cell(word, styles, bool(pending[column.field]))

    def _name_in(self, row: int, width: int) -> str:
        """Return a name as this table at this width has it: made once for all, so that scrolling changes nothing."""
        names = self.session.table.names
        made_for = (id(names), len(names), width, self.session.table.prefix)
        if self._names_of != made_for:
            self._names = fitting_names([self.session.short_name(name) for name in names], width)
            self._names_of = made_for
        return self._names[row]

    def _cell(self, word: str, styles: list[str], underlined: bool) -> Iterator[Segment]:
        """Underline the word alone, not the room around it."""
        style = self._style(*styles)
        core = word.strip()
        start = word.find(core) if core else 0
        before, after = word[:start], word[start + len(core) :]
        if before:
            yield Segment(before, style)
        yield Segment(core, style + Style(underline=True) if underlined else style)
        if after:
            yield Segment(after, style)

    def _fitted(self, words: str, width: int, *, right: bool = False) -> str:
        """Return exactly `width` cells; some letters take two."""
        words = text.clean(words)
        if words.isascii():
            return words[:width].rjust(width) if right else words[:width].ljust(width)
        words = set_cell_size(words, min(width, cell_len(words)))
        room = " " * (width - cell_len(words))
        return room + words if right else words + room


class TableHead(Guarded, ScrollView):
    """The heads of the columns, over the table."""

    DEFAULT_CSS = "TableHead { height: 1; width: 1fr; scrollbar-size: 0 0; }"
    COMPONENT_CLASSES: ClassVar[set[str]] = {"head--text", "head--field"}

    @dataclass
    class Picked(Message):
        """The head of a column was clicked that gives an order."""

        order: str

    def __init__(self, table: ElementTable) -> None:
        super().__init__()
        self._table = table

    def on_click(self, event: events.Click) -> None:
        """Ask for the order by this column."""
        start = FLAGS + self._table.name_width
        order = "name" if event.x < start else ""
        for column, width in self._table.shown:
            order = column.order if start < event.x <= start + width else order
            start += 1 + width
        if order:
            self.post_message(self.Picked(order))

    def render_line(self, y: int) -> Strip:
        """Return the one line."""
        plain, chosen = self.get_component_rich_style("head--text"), self.get_component_rich_style("head--field")
        sort = self._table.rows.sort
        mark = " ↓name" if sort == TREE else f" {self._table.rows.arrow}{sort}" if sort in (NAME, ADDED) else " name"
        segments = [Segment(" " * (FLAGS - 1) + mark.ljust(self._table.name_width + 1), plain)]
        for column, width in self._table.shown:
            word = ((self._table.rows.arrow if sort == column.order else "") + column.title)[:width]
            word = word.rjust(width) if column.right else word.ljust(width)
            is_chosen = column.field is not None and column.field is self._table.field
            segments += [Segment(" ", plain), Segment(word, chosen if is_chosen else plain)]
        return Strip(segments).adjust_cell_length(self.size.width, plain)

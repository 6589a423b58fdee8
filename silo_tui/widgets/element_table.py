"""The element table: names, settings and what is measured, drawn line by line, so that 10,000 elements cost nothing.

Measured: Textual's DataTable needs 4 - 7 s for 10,000 rows and 130 ms per update; this needs the lines on the screen.
Of these only what reads differently is painted: with each frame the measured cells of a line, else the whole line.
"""

import time
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, cast

import numpy as np
from rich.cells import cell_len, set_cell_size
from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.geometry import Region, Size
from textual.message import Message
from textual.scroll_view import ScrollView
from textual.strip import Strip

from silo.core.names import component_name
from silo.core.quantities.writing import wall_clock
from silo_tui.model.drawing.braille import SHADE
from silo_tui.model.samples.live import cells_of_value
from silo_tui.model.table.cells import ENTRY, Sight
from silo_tui.model.table.columns import (
    ADDED,
    FILE_SETS,
    FLAGS,
    LIVE_SETS,
    NAME,
    SETTINGS,
    STATE,
    TREE,
    Layout,
    TableColumn,
    in_set,
    laid_out,
)  # fmt: skip
from silo_tui.model.table.facts import STATISTICS
from silo_tui.model.table.fields import Field
from silo_tui.model.table.rows import RowList
from silo_tui.model.table.state import Rows
from silo_tui.model.table.tree import entry_of, row_of
from silo_tui.model.words import text
from silo_tui.model.words.names import MIN_WIDTH, Told, among, in_tree, inside, shared_space, space_words
from silo_tui.sessions.live import Session
from silo_tui.terminal import pace_of
from silo_tui.unforeseen import Guarded
from silo_tui.widgets.lines import CURSOR, MARKED, ON_MARKED
from silo_tui.widgets.styled import Styled

TREND = 10
MOST_TOLD = 1000  # names that are told apart from those that are shown alone; of more all are looked at, once
DERIVED = "="  # the sign of what is computed from others
EDITED = "E"  # and of what is logged otherwise than its program began with, as events tell edits
MAX_STRIPS = 4000


class Content(NamedTuple):
    """What a line says: what tells its settings apart, measured words with their styles, its piece of the rail."""

    key: tuple[object, ...]
    cursor: bool
    pieces: tuple[tuple[str, str], ...]
    rail: str


class ElementTable(Guarded, ScrollView, Styled, can_focus=True):
    """Name, settings and newest values of the shown elements; holds the cursor."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {
        "table--row", "table--cursor", "table--cell", "table--range", "table--marked", "table--off", "table--quiet",
        "table--pending", "table--conflict", "table--value", "table--stale", "table--lost", "table--trend",
        "table--full", "table--rail", "table--caution",
    }  # fmt: skip

    @dataclass
    class Moved(Message):
        """The cursor or what is on the screen changed."""

    @dataclass
    class Picked(Message):
        """A cell was clicked twice, or once where the cursor was."""

        field: Field | None

    def __init__(self, session: Session, columns: Sequence[TableColumn]) -> None:
        super().__init__()
        self.session = session
        self.field = Field.ENABLED
        self.sight = Sight(
            session.table, session.live, session.rows.component, self._trend, session.rows_of, session.at_s
        )
        self.sets = LIVE_SETS if session.at_s is None else FILE_SETS
        self.column_set = self.sets[0]
        self.chosen_columns: tuple[str, ...] = ()  # titles of settings; none: all
        self._known = columns
        self._wide = self._bare = False
        self._laid: Layout | None = None
        self._shown_rows = 0  # of the screen, for which the cursor was brought there
        self._strips: dict[tuple[object, ...], Strip] = {}
        self._masks_of = (-1, -1)
        self._painted: dict[int, Content] = {}
        self._ready: dict[int, Content] = {}  # found to differ, not painted yet
        self._told: Told | None = None
        self._told_of: tuple[object, ...] = ()
        self._needs: tuple[object, int, Rows] = ((), 0, np.zeros(0, np.intp))
        self._trends: dict[int, str] = {}  # by row; all of them are drawn together, once a second
        self._trends_of: object = None
        self._trends_due_s = 0.0
        self.lay_out()

    @property
    def rows(self) -> RowList:
        """What is shown."""
        return self.session.rows

    # ---------------------------------------------------------------------------------------------- geometry

    def lay_out(
        self, value_width: int = 7, *, trend: bool = False, wide: bool = False, bare: bool = False, fill: bool = True
    ) -> None:
        """Show the columns of the chosen set; `wide`: settings beside it, `bare`: of settings the first alone.

        Without `fill` values have the room of how full buffers are: signs tell what is lost, values what is full.
        """
        self.sight.widths = {"value": value_width, "trend": TREND * trend} | ({} if fill else {"fill": 0})
        self._wide, self._bare = wide, bare
        self.sight.ends.clear()
        self._forget()
        self.refresh()

    def _forget(self) -> None:
        self._laid = None
        for made in (self._strips, self._trends, self._painted, self._ready):
            made.clear()

    @property
    def _offered(self) -> list[TableColumn]:
        """The columns of the set, and those of order and filter: nobody sees by what rows are ordered without them."""
        filtered_by = self.rows.filter.quantities

        def is_wanted(column: TableColumn) -> bool:
            asked = column.gives(self.rows.sort) or any(each.quantity in filtered_by for each in column.orders)
            if asked or not in_set(column, self.column_set, wide=self._wide):
                return asked
            chosen = self.chosen_columns or [column.title]
            return column.measured or (column.title in chosen and not (self._bare and column is not self._known[0]))

        return [column for column in self._known if is_wanted(column)]

    @property
    def laid(self) -> Layout:
        """What stands where."""
        told, sight = self._names_told(), self.sight
        if self._laid is None or self._laid.width != self.size.width or self._laid.told != told:
            self._forget()
            value, units = self._needed()
            self._laid = laid_out(self.size.width, told, self._offered, sight, self.rows.sort, value, units)
            numbers = {each.title: cells for each, cells in self._laid.measured if each.title in ("value", *STATISTICS)}
            sight.room, sight.value_room = min(numbers.values(), default=11), numbers.get("value", 11)
            sight.statistics = "min" in self.quantities
        return self._laid

    def _needed(self) -> tuple[int, list[int]]:
        """Return how many cells the widest value of all rows takes, and the units of those that are told apart."""
        table, rows = self.session.table, self.rows
        made_for = (id(table.names), len(table), table.prefix)
        if self._needs[0] != made_for:
            units = np.array([cell_len(each.unit) * (each.unit != "-") for each in table.elements], np.intp)
            self._needs = made_for, max(map(cells_of_value, table.elements), default=0), units
        value, units = self._needs[1:]
        return value, np.unique(units if self._all_told else units[rows.shown]).tolist()

    @property
    def _all_told(self) -> bool:
        """Whether rows come and go by themselves, or are none: then all of the table have room."""
        return bool(self.rows.filter.measured or self.rows.most or not len(self.rows.shown))

    def _names_told(self) -> Told:
        """Return what tells the names that are shown apart, or all of the table.

        So it is of the first of an order: of the joints of a leg but one may be among them.
        """
        rows, table = self.rows, self.session.table
        of = (rows.shown, rows.sort == TREE, table.prefix, dict(rows.components))
        if self._told is None or self._told_of[0] is not of[0] or self._told_of[1:] != of[1:]:
            self._told_of = of
            shown, everything = rows.shown, np.arange(len(table))
            some = everything if self._all_told else np.sort(shown)  # the same in another order are the same
            names = tuple(map(self._named, some.tolist()))
            space = "" if rows.sort == TREE else shared_space(names)  # branches tell it
            if len(some) > MOST_TOLD:
                names = tuple(map(self._named, everything.tolist()))
            names = tuple(inside(space, name) for name in names)
            self._told = Told(space, in_tree(names) if rows.sort == TREE else among(names))
        return self._told

    def _named(self, row: int) -> str:
        """Return the name of a row, with the entry that is shown alone."""
        named = self.sight.shown_name(row) if self.rows.components else self.session.table.names[row]
        return self.session.short_name(named)

    @property
    def titles(self) -> list[str]:
        """The titles of the columns that are shown."""
        return [column.title for column, _, _ in self.laid.spans]

    @property
    def shows_trends(self) -> bool:
        """Whether trends have room."""
        return "trend" in self.titles

    @property
    def shaded(self) -> bool:
        """Whether a trend has a hole."""
        return any(SHADE in each for each in self._trends.values())

    @property
    def quantities(self) -> list[str]:
        """What has to be surveyed of the rows on the screen."""
        found = [quantity for column in self._offered for quantity in column.quantities]
        if "min" in found:  # of a file the value is that of the moment shown, and statistics are of all
            found += ["bad", "least", "most", *(["value"] if self.session.at_s is None else [])]
        return found

    def field_spans(self) -> dict[Field, tuple[int, int]]:
        """Return first column and width of each field that is shown and can be edited."""
        shown = self.laid.spans if self.session.at_s is None else ()
        return {column.field: (start, width) for column, start, width in shown if column.field is not None}

    def field_at(self, x: int) -> Field | None:
        """Return the editable field in a column of the screen."""
        spans = self.field_spans().items()
        return next((field for field, (start, width) in spans if start <= x < start + width), None)

    def field_beside(self, step: int) -> Field:
        """Return the next field that is shown to the right (1) or left (-1) of the chosen one, or that one."""
        beside = [field for field in self.field_spans() if (field - self.field) * step > 0]
        return min(beside, key=lambda field: abs(field - self.field), default=self.field)

    def cell_region(self) -> Region:
        """Return where the cell under the cursor is on the screen."""
        # a hidden one is edited at the end of the settings
        start, width = self.field_spans().get(self.field, (max(0, self.laid.rest - 8), 8))
        top = self.rows.position - self.scroll_offset.y
        return Region(self.region.x + start, self.region.y + top, width, 1)

    def _lines_on_screen(self, beyond: int = 0) -> list[int]:
        top = self.scroll_offset.y
        found = self.rows.tree.lines[max(0, top - beyond) : top + max(1, self.size.height) + beyond]
        lines: list[int] = found.tolist()
        return lines

    def rows_on_screen(self) -> list[int]:
        """Return the elements that are visible now."""
        return list(dict.fromkeys(row for line in self._lines_on_screen() if (row := row_of(line)) is not None))

    def names_near_screen(self) -> list[str]:
        """Return the names of what is told of now: elements, what is shown of vectors, entries with a line.

        So it is of half a screen beyond, which comes into view measured; not of a file, nor over a thin link.
        """
        spare = self.sight.digits_fewer or self.session.at_s is not None
        lines = self._lines_on_screen(0 if spare else self.size.height // 2)
        rows = dict.fromkeys(row for line in lines if (row := row_of(line)) is not None)
        names = self.session.table.names
        found = [name for row in rows for name in (names[row], self.sight.shown_name(row))]
        if "value" in self.quantities:  # entries that stand beside statistics are of the same moment
            room = sum(cells + 1 for column, cells in self.laid.measured if column.title in ("value", STATE))
            for at in rows:
                count = len(self.session.table.elements[at].entries)
                beside = min(count, room // ENTRY + 1) if count > 1 and not self.sight.component(at) else 0
                found += [self.sight.entry_name(at, entry) for entry in range(beside)]
        for line in lines:
            row, entry = row_of(line), entry_of(line)
            if row is not None and entry is not None:
                found.append(self.sight.entry_name(row, entry))
        return list(dict.fromkeys(found))

    # ---------------------------------------------------------------------------------------------- changing

    def choose_columns(self, titles: Collection[str]) -> list[str]:
        """Show the settings of these titles, all where there is none; return those that there aren't."""
        known = tuple(title for title in SETTINGS if title in titles)
        self.chosen_columns = known if len(known) < len(SETTINGS) else ()
        return [title for title in titles if title not in known]

    def rows_changed(self) -> None:
        """Follow a change of the rows, their order or their values."""
        self._forget()
        self.virtual_size = Size(self.size.width, len(self.rows.tree.lines))
        self.show_cursor()

    def show_cursor(self, below: int = 0) -> None:
        """Scroll so that the cursor is on the screen with lines below it, and draw where it was and where it is."""
        self._shown_rows = self.size.height
        height = max(1, self.size.height)
        top, position = round(self.scroll_y), self.rows.position
        wanted = min(max(top, position + below - height + 1), position)
        wanted = max(0, min(wanted, max(0, len(self.rows.tree.lines) - height)))
        if wanted != top:
            self.scroll_to(y=wanted, animate=False, force=True, immediate=True)
        if wanted != top or not self._painted or self.rows.anchor is not None:
            self.live_changed()
        else:  # two lines alone: to look at all of them is most of what a key costs
            known = (*self._painted.items(), *self._ready.items())
            self._paint([*(y for y, each in known if each.cursor), position - top])
        self.post_message(self.Moved())

    def live_changed(self) -> None:
        """Paint what reads differently now."""
        if self.size.height != self._shown_rows:  # Textual tells of no new size that comes with a scroll
            self.show_cursor()
        session, sight, now_s = self.session, self.sight, time.monotonic()
        pace = pace_of(self.app)
        sight.digits_fewer = pace.digits_fewer
        sight.fresh, sight.running, sight.at_s = session.fresh, session.running, session.at_s
        store = session.columns
        # what came of the past is shown at once
        if now_s >= self._trends_due_s or self._trends_of != (store, store.past_until_ns):
            self._trends.clear()
            self._trends_of = (store, store.past_until_ns)
            self._trends_due_s = now_s + pace.trend_s
        self._paint(range(self.size.height))

    def _paint(self, lines: Iterable[int]) -> None:
        """Paint those of these lines of the screen that read differently now."""
        laid, height = self.laid, self.size.height
        if not self._painted:  # all is still to be painted: nothing needs to be told apart before
            self.refresh()
            return
        for y in lines:
            old, new = self._painted.get(y), self._content(y, laid, height)
            if old != new:
                self._ready[y] = new
                begin = 0 if old is None or old.key != new.key else laid.rest
                self.refresh(Region(begin, y, laid.width - begin, 1))
            else:
                self._ready.pop(y, None)

    def watch_scroll_y(self, old_value: float, new_value: float) -> None:
        """Tell other panes of the scroll."""
        super().watch_scroll_y(old_value, new_value)
        if round(old_value) != round(new_value):
            self.post_message(self.Moved())

    def on_resize(self) -> None:
        self.virtual_size = Size(self.size.width, len(self.rows.tree.lines))
        self.call_after_refresh(self.show_cursor)

    def notify_style_update(self) -> None:
        super().notify_style_update()
        self._forget()

    def on_click(self, event: events.Click) -> None:
        """Put the cursor there, edit where it was already, mark in front of a name."""
        position = event.y + self.scroll_offset.y
        if position >= len(self.rows.tree.lines):
            return
        field = self.field_at(event.x)
        if event.x < FLAGS:
            self.rows.move_to(position)
            self.rows.toggle_mark()
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
        laid = self.laid
        content = self._ready.pop(y) if y in self._ready else self._content(y, laid, self.size.height)
        if content.key not in self._strips and content.key != self._key(y, laid):  # it reads differently by now
            content = self._content(y, laid, self.size.height)
        self._painted[y] = content
        base = ["table--row", "table--cursor"] if content.cursor else ["table--row"]
        segments = [Segment(words, self._style(*base, style)) for words, style in content.pieces]
        measured = Strip(segments).adjust_cell_length(laid.width - 1 - laid.rest, self._style(*base))
        rail = Segment(content.rail, self._style("table--row", "table--rail"))
        return Strip([*self._settings_strip(y, content.key, laid), *measured, rail], laid.width)

    def _settings_strip(self, y: int, key: tuple[object, ...], laid: Layout) -> Strip:
        """Return what stands before what is measured; made as it is drawn: not all that changes is."""
        if key not in self._strips:
            if len(self._strips) > MAX_STRIPS:
                self._strips.clear()
            segments = key
            position = self.scroll_offset.y + y
            if key and not isinstance(key[0], Segment):
                row = row_of(int(self.rows.tree.lines[position])) or 0
                is_cursor = position == self.rows.position
                segments = tuple(self._segments(row, self.rows.tree.depth(position), laid, is_cursor=is_cursor))
            made = Strip(cast(tuple[Segment, ...], segments))
            self._strips[key] = made.adjust_cell_length(laid.rest, self._style("table--row"))
        return self._strips[key]

    def _key(self, y: int, laid: Layout) -> tuple[object, ...]:
        """Return what tells the settings of a line apart, or all that is drawn of it where it has none."""
        position, rows = self.scroll_offset.y + y, self.rows
        if position >= len(rows.tree.lines):
            return ()
        self._refresh_masks()
        line, is_cursor = int(rows.tree.lines[position]), position == rows.position
        row = row_of(line)
        if row is None or entry_of(line) is not None:
            return tuple(self._other_segments(line, position, laid, is_cursor=is_cursor))
        return (
            row, int(self.field) if is_cursor else -1, bool(rows.marked[row]), bool(self._range[row]),
            rows.tree.depth(position), rows.sort == TREE, row in rows.leaving,
            self.session.table.names[row] in rows.unfolded, self._alone(row), self.session.table.version,
        )  # fmt: skip

    def _content(self, y: int, laid: Layout, height: int) -> Content:
        """Return what a line says.

        What stands where is handed over: to find the size of a widget takes as long as some of its cells.
        """
        top, rows = self.scroll_offset.y, self.rows
        position, key = top + y, self._key(y, laid)
        if not key:
            return Content((), False, (), " ")
        line, is_cursor = int(rows.tree.lines[position]), position == rows.position
        pieces = self._pieces(line, row_of(line), entry_of(line), laid)
        if is_cursor:  # grey on the cursor's line is hard to read in 16 colours
            pieces = [(words, "" if style == "table--quiet" else style) for words, style in pieces]
        return Content(key, is_cursor, tuple(pieces), self._rail(y, top, height))

    def _rail(self, y: int, top: int, height: int) -> str:
        total, height = len(self.rows.tree.lines), max(1, height)
        if total <= height:
            return " "
        length = max(1, height * height // total)
        start = round((height - length) * top / (total - height))
        return "▐" if start <= y < start + length else " "

    def _pieces(self, line: int, row: int | None, entry: int | None, laid: Layout) -> list[tuple[str, str]]:
        """Return the measured words of a line, each with its style."""
        self.sight.written.clear()
        pieces: list[tuple[str, str]] = []
        spare = 0
        for column, cells in laid.measured:
            words, style, width, spare = "", "", cells + spare, 0
            if row is None:
                if column.branch is not None:
                    words, style = column.branch(self.sight, self.rows.tree.branches[-1 - line].rows)
                    return [*pieces, (f" {words}", f"table--{style}" if style else "")]
            elif entry is None:
                words, style = column.draw(self.sight, row, width)
            elif column.entry is not None:
                words, style = column.entry(self.sight, row, entry, width)
            told = " " + fitted(words, width, right=column.right)
            if column.title == STATE:  # few rows have a word there: the value has what that leaves
                told = told.rstrip()
                spare = 1 + width - len(told)
            pieces.append((told, f"table--{style}" if style else ""))
        return pieces

    def _trend(self, row: int) -> str:
        if row not in self._trends:
            self._trends = self.session.trends([row, *self.rows_on_screen()], TREND)
        return self._trends[row]

    def _refresh_masks(self) -> None:
        anchor = -1 if self.rows.anchor is None else self.rows.position
        if self._masks_of == (self.session.table.version, anchor):
            return
        table = self.session.table
        self._values, self._pending, self._conflicts = table.values, table.pending, table.conflicts
        self._edited = table.edited
        self._range = np.zeros(len(table), np.bool_)
        self._range[self.rows.range_rows()] = True
        self._masks_of = (table.version, anchor)

    def _other_segments(self, line: int, position: int, laid: Layout, *, is_cursor: bool) -> Iterator[Segment]:
        """Yield a branch, or one entry of a vector."""
        base = ["table--row", "table--cursor"] if is_cursor else ["table--row"]
        row, entry = row_of(line), entry_of(line)
        indent = "  " * self.rows.tree.depth(position)
        quiet = "" if is_cursor else "table--quiet"
        room = laid.rest - FLAGS
        if row is not None and entry is not None:
            called = component_name(self.session.table.elements[row].entries[entry].suffix)
            yield Segment(f" {_sign(is_cursor=is_cursor, marked=False)}", self._style(*base))
            words = text.cut(f"{indent or '  '}  {called}", room)
            yield Segment(fitted(words, room), self._style(*base, quiet))
            return
        branch = self.rows.tree.branches[-1 - line]
        pending, conflicts = self._pending[:, branch.rows].any(), self._conflicts[:, branch.rows].any()
        flag, flag_style = ("!", "table--conflict") if conflicts else ("*" if pending else " ", "table--pending")
        yield Segment(flag, self._style(*base, flag_style))
        marked = "table--marked" if bool(self.rows.marked[branch.rows].all()) else ""
        yield Segment(_sign(is_cursor=is_cursor, marked=bool(marked)), self._style(*base, "table--marked"))
        sign = "►" if branch.path in self.rows.folded else "▼"
        width = min(laid.names, room)
        label = self._tree_name(branch.path, self.rows.tree.depth(position), width, f"{sign} ")
        yield Segment(fitted(label, width), self._style(*base, marked))
        yield Segment(fitted(f" {len(branch.rows)}", room - width), self._style(*base, quiet))

    def _name_words(self, row: int, depth: int, laid: Layout) -> str:
        element, name = self.session.table.elements[row], self._named(row)
        if self.rows.sort != TREE:
            return laid.told.fitted(name, laid.names)
        if (count := len(element.entries)) < 2:
            return self._tree_name(name, depth, laid.names, "  ")
        sign = "▼ " if element.name in self.rows.unfolded else "► "
        return self._tree_name(name, depth, laid.names, sign, "" if self._alone(row) else f" |{count}|")

    def _tree_name(self, name: str, depth: int, width: int, sign: str, count: str = "") -> str:
        """Return the last level of a name as it fits, behind what shows how deep it lies."""
        begin = "  " * max(0, min(depth, (width - cell_len(sign) - MIN_WIDTH) // 2)) + sign
        return begin + self.laid.told.fitted(name, width - cell_len(begin), count)

    def _segments(self, row: int, depth: int, laid: Layout, *, is_cursor: bool) -> Iterator[Segment]:
        values, pending, conflicts = self._values[:, row], self._pending[:, row], self._conflicts[:, row]
        base = ["table--row"]
        if (not values[Field.ENABLED] or row in self.rows.leaving) and not is_cursor:
            base.append("table--off")
        if bool(self._range[row]):
            base.append("table--range")
        if is_cursor:
            base.append("table--cursor")
        flag, flag_style = " ", ""
        if row >= self.session.table.own:
            flag, flag_style = DERIVED, "table--quiet"
        elif conflicts.any():
            flag, flag_style = "!", "table--conflict"
        elif pending.any():
            flag, flag_style = "*", "table--pending"
        elif self._edited[row]:
            flag, flag_style = EDITED, "table--quiet"
        yield Segment(flag, self._style(*base, flag_style))
        marked = "table--marked" if self.rows.marked[row] or self._range[row] else ""
        yield Segment(_sign(is_cursor=is_cursor, marked=bool(marked)), self._style(*base, marked))
        name = fitted(self._name_words(row, depth, laid), laid.names)
        yield Segment(name, self._style(*base, marked))
        for column, cell_width in laid.steady:
            words, style = column.draw(self.sight, row, cell_width)
            word = fitted(words, cell_width, right=column.right)
            if column.field is None or self.session.at_s is not None:
                style = "quiet" if style != "conflict" else style
                style = "" if is_cursor and style == "quiet" else f"table--{style}"
                yield Segment(" " + word, self._style(*base, style))
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

    def _alone(self, row: int) -> str:
        """Return what stands behind the name of a vector of which one entry is shown alone, `_x`; else nothing."""
        return self.sight.shown_name(row).removeprefix(self.session.table.names[row])

    def _cell(self, word: str, styles: list[str], underlined: bool) -> Iterator[Segment]:
        """Underline the word alone, not the room around it."""
        style = self._style(*styles)
        core = word.strip()
        before, core, after = word.partition(core) if core else ("", word, "")
        yield Segment(before, style)
        yield Segment(core, style + Style(underline=True) if underlined else style)
        yield Segment(after, style)


def _sign(*, is_cursor: bool, marked: bool) -> str:
    """Return what stands before a name: there is room for one sign."""
    return (ON_MARKED if is_cursor else MARKED) if marked else CURSOR if is_cursor else " "


def fitted(words: str, width: int, *, right: bool = False) -> str:
    """Return exactly `width` cells; some letters take two."""
    words = text.clean(words)
    if words.isascii():
        return words[:width].rjust(width) if right else words[:width].ljust(width)
    words = set_cell_size(words, min(width, cell_len(words)))
    room = " " * (width - cell_len(words))
    return room + words if right else words + room


class TableHead(Guarded, ScrollView):
    """The heads of the columns, over the table."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {"head--text", "head--field"}

    @dataclass
    class Picked(Message):
        """The head of a column was clicked that gives an order."""

        order: str

    def __init__(self, table: ElementTable) -> None:
        super().__init__()
        self._table = table

    def on_click(self, event: events.Click) -> None:
        laid = self._table.laid
        order = NAME if event.x < FLAGS + laid.names else ""
        if order := next((one.order for one, start, width in laid.spans if start <= event.x < start + width), order):
            self.post_message(self.Picked(order))

    def render_line(self, y: int) -> Strip:
        plain, chosen = self.get_component_rich_style("head--text"), self.get_component_rich_style("head--field")
        table, rows = self._table, self._table.rows
        laid, sort = table.laid, rows.sort
        arrow = "↑" if sort == TREE else rows.arrow * (sort in (NAME, ADDED))
        title = f"order of {wall_clock(rows.stood_ns)}" if rows.stood_ns else sort if sort == ADDED else NAME
        mark = f" {space_words(title, laid.told.space, laid.names, arrow)}"
        steady = [Segment(" " * (FLAGS - 1) + mark.ljust(laid.names + 1), plain)]
        measured: list[Segment] = []
        for column, _, width in laid.spans:
            arrow = rows.arrow if column.gives(sort) else ""
            word = arrow + (column.head(table.sight, width - len(arrow)) if column.head is not None else column.title)
            style = chosen if column.field is table.field and table.session.at_s is None else plain
            segments = measured if column.measured else steady
            segments += [Segment(" ", plain), Segment(fitted(word, width, right=column.right), style)]
        left = Strip(steady).adjust_cell_length(laid.rest, plain)
        return Strip([*left, *measured]).adjust_cell_length(self.size.width, plain)

"""The static columns of the element table: drawn line by line from NumPy state, so that 10,000 elements cost nothing.

Measured: Textual's DataTable needs 4 - 7 s for 10,000 rows and 130 ms per update; this needs the lines on the screen.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from rich.cells import set_cell_size
from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.geometry import Region, Size
from textual.message import Message
from textual.scroll_view import ScrollView
from textual.strip import Strip

from silo_tui.model import text
from silo_tui.model.fields import Field, word_for
from silo_tui.model.rows import RowList
from silo_tui.sessions.live import Session

FLAGS, UNIT = 2, 5
# width of each editable field, with the space before it counted apart
WIDTHS = {Field.ENABLED: 3, Field.DIVIDER: 4, Field.ACTION: 4, Field.BUFFER_TYPE: 4, Field.BUFFER_SIZE: 7}
FIXED_WIDTH = FLAGS + 1 + UNIT + sum(1 + width for width in WIDTHS.values())
NAME_ROOM = 16
# what goes, in this order, where names would have less room than that; None is the unit
FIRST_TO_GO = (None, Field.BUFFER_TYPE, Field.ACTION, Field.DIVIDER, Field.BUFFER_SIZE)
RIGHT_ALIGNED = (Field.DIVIDER, Field.BUFFER_SIZE)
MAX_STRIPS = 4000


class ElementTable(ScrollView, can_focus=True):
    """Name, unit and options of the shown elements; holds the cursor."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {
        "table--row", "table--cursor", "table--cell", "table--range", "table--marked", "table--off", "table--quiet",
        "table--pending", "table--conflict", "table--live",
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

    def __init__(self, session: Session) -> None:
        super().__init__()
        self.session = session
        self.field = Field.ENABLED
        self._strips: dict[tuple[object, ...], Strip] = {}
        self._styles: dict[str, Style] = {}
        self._masks_of = (-1, -1)
        self._drawn: tuple[int, int] = (-1, -1)

    @property
    def rows(self) -> RowList:
        """What is shown."""
        return self.session.rows

    # ---------------------------------------------------------------------------------------------- geometry

    @property
    def name_width(self) -> int:
        """Cells for names."""
        fields = sum(1 + width for width in self.fields.values())
        return max(8, self.size.width - FLAGS - (1 + UNIT if self.has_unit else 0) - fields)

    @property
    def hidden(self) -> tuple[Field | None, ...]:
        """Columns that are not shown because the screen is narrow: whole ones, since cut numbers would be wrong."""
        room = self.size.width - FIXED_WIDTH
        count = 0
        while room < NAME_ROOM and count < len(FIRST_TO_GO):
            field = FIRST_TO_GO[count]
            room += 1 + (UNIT if field is None else WIDTHS[field])
            count += 1
        return FIRST_TO_GO[:count]

    @property
    def has_unit(self) -> bool:
        """Whether units are shown."""
        return None not in self.hidden

    @property
    def fields(self) -> dict[Field, int]:
        """The fields that are shown, and their widths."""
        hidden = self.hidden
        return {field: width for field, width in WIDTHS.items() if field not in hidden}

    def field_at(self, x: int) -> Field | None:
        """The editable field in a column of the screen."""
        for field, (start, width) in self.field_spans().items():
            if start <= x < start + width:
                return field
        return None

    def field_spans(self) -> dict[Field, tuple[int, int]]:
        """First column and width of each field."""
        spans = {}
        start = FLAGS + self.name_width + (1 + UNIT if self.has_unit else 0)
        for field, width in self.fields.items():
            spans[field] = (start + 1, width)
            start += 1 + width
        return spans

    def cell_region(self) -> Region:
        """Where the cell under the cursor is on the screen."""
        spans = self.field_spans()
        start, width = spans.get(self.field, (self.size.width - 8, 8))  # a hidden one is edited at the end of the line
        top = self.rows.position - self.scroll_offset.y
        return Region(self.region.x + start, self.region.y + top, width, 1)

    def rows_on_screen(self) -> list[int]:
        """The elements that are visible now."""
        top = self.scroll_offset.y
        return [int(row) for row in self.rows.shown[top : top + max(1, self.size.height)]]

    # ---------------------------------------------------------------------------------------------- changing

    def rows_changed(self) -> None:
        """After the rows, their order or their values changed."""
        self.virtual_size = Size(self.size.width, len(self.rows.shown))
        self.show_cursor()
        self.refresh()

    def show_cursor(self) -> None:
        """Scrolls so that the cursor is on the screen, and draws where it was and where it is."""
        height = max(1, self.size.height)
        top, position = round(self.scroll_y), self.rows.position
        wanted = min(max(top, position - height + 1), position)
        wanted = max(0, min(wanted, max(0, len(self.rows.shown) - height)))
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
        """After the row under the cursor changed."""
        self.refresh_line(self.rows.position - self.scroll_offset.y)

    def watch_scroll_y(self, old_value: float, new_value: float) -> None:
        """Other panes follow the scroll."""
        super().watch_scroll_y(old_value, new_value)
        if round(old_value) != round(new_value):
            self.post_message(self.Moved())

    def on_resize(self) -> None:
        """Columns have another width now."""
        self._strips.clear()
        self.virtual_size = Size(self.size.width, len(self.rows.shown))
        self.call_after_refresh(self.show_cursor)

    def notify_style_update(self) -> None:
        """The theme changed."""
        super().notify_style_update()
        self._strips.clear()
        self._styles.clear()

    def on_click(self, event: events.Click) -> None:
        """A click puts the cursor there, on the cursor it edits, in front of a name it marks."""
        position = event.y + self.scroll_offset.y
        if position >= len(self.rows.shown):
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
        """One element."""
        position = y + self.scroll_offset.y
        width = self.size.width
        if position >= len(self.rows.shown):
            return Strip.blank(width, self._style("table--row"))
        self._refresh_masks()
        row = int(self.rows.shown[position])
        is_cursor = position == self.rows.position
        key = (
            row, width, int(self.field) if is_cursor else -1, bool(self.rows.marked[row]), bool(self._range[row]),
            self._values[:, row].tobytes(), self._pending[:, row].tobytes(), self._conflicts[:, row].tobytes(),
        )  # fmt: skip
        strip = self._strips.get(key)
        if strip is None:
            if len(self._strips) > MAX_STRIPS:
                self._strips.clear()
            strip = Strip(list(self._segments(row, is_cursor=is_cursor)), width)
            self._strips[key] = strip
        return strip

    def _refresh_masks(self) -> None:
        anchor = -1 if self.rows.anchor is None else self.rows.position
        if self._masks_of == (self.session.table.version, anchor):
            return
        table = self.session.table
        self._values, self._pending, self._conflicts, self._live = (
            table.values, table.pending, table.conflicts, table.live,
        )  # fmt: skip
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

    def _segments(self, row: int, *, is_cursor: bool) -> Iterator[Segment]:
        values, pending, conflicts = self._values[:, row], self._pending[:, row], self._conflicts[:, row]
        marked = bool(self.rows.marked[row]) or bool(self._range[row])
        base = ["table--row"]
        if not values[Field.ENABLED] and not is_cursor:
            base.append("table--off")
        if bool(self._range[row]):
            base.append("table--range")
        if is_cursor:
            base.append("table--cursor")
        flag, flag_style = (" ", "table--quiet")
        if conflicts.any():
            flag, flag_style = "!", "table--conflict"
        elif pending.any():
            flag, flag_style = "*", "table--pending"
        yield Segment(flag, self._style(*base, flag_style))
        yield Segment(">" if marked else " ", self._style(*base, "table--marked"))
        width = self.name_width
        name = self._fitted(text.shorten_left(self.session.short_name(self.session.table.names[row]), width), width)
        yield Segment(name, self._style(*base, *(["table--marked"] if marked else [])))
        quiet = [] if is_cursor else ["table--quiet"]  # grey on the cursor's line is hard to read in 16 colours
        if self.has_unit:
            yield Segment(" " + self._unit(row), self._style(*base, *quiet))
        for field, cell_width in self.fields.items():
            word = word_for(field, int(values[field]))
            if len(word) > cell_width:
                word = text.compact(float(values[field])) if field in RIGHT_ALIGNED else word[:cell_width]
            word = word.rjust(cell_width) if field in RIGHT_ALIGNED else word.ljust(cell_width)
            styles = list(base)
            if conflicts[field]:
                styles.append("table--conflict")
            elif pending[field]:
                styles.append("table--pending")
            if is_cursor and field is self.field:
                styles.append("table--cell")
            yield Segment(" ", self._style(*base))
            yield from self._cell(word, styles, bool(pending[field]))

    def _cell(self, word: str, styles: list[str], underlined: bool) -> Iterator[Segment]:
        """The word alone is underlined, not the room around it."""
        style = self._style(*styles)
        core = word.strip()
        start = word.find(core) if core else 0
        before, after = word[:start], word[start + len(core) :]
        if before:
            yield Segment(before, style)
        yield Segment(core, style + Style(underline=True) if underlined else style)
        if after:
            yield Segment(after, style)

    def _unit(self, row: int) -> str:
        unit = self.session.table.elements[row].unit
        return self._fitted("" if unit == "-" else unit, UNIT)

    def _fitted(self, words: str, width: int) -> str:
        """Exactly `width` cells; some letters take two."""
        words = text.clean(words)
        return words[:width].ljust(width) if words.isascii() else set_cell_size(words, width)


class TableHead(ScrollView):
    """The heads of the columns, over the table."""

    DEFAULT_CSS = "TableHead { height: 1; width: 1fr; scrollbar-size: 0 0; }"
    COMPONENT_CLASSES: ClassVar[set[str]] = {"head--text", "head--field"}

    def __init__(self, table: ElementTable) -> None:
        super().__init__()
        self._table = table

    def render_line(self, y: int) -> Strip:
        """The one line."""
        plain, chosen = self.get_component_rich_style("head--text"), self.get_component_rich_style("head--field")
        sort = self._table.rows.sort
        mark = {"name": " ↓name", "added": " ↓added"}.get(sort, " name")
        segments = [Segment(" " * (FLAGS - 1) + mark.ljust(self._table.name_width + 1), plain)]
        if self._table.has_unit:
            segments.append(Segment((" ↓unit" if sort == "unit" else " unit").ljust(UNIT + 1), plain))
        for field, width in self._table.fields.items():
            word = ("↓" if sort == field.title else "") + field.title
            word = word.rjust(width) if field in RIGHT_ALIGNED else word.ljust(width)
            segments += [Segment(" ", plain), Segment(word, chosen if field is self._table.field else plain)]
        return Strip(segments).adjust_cell_length(self.size.width, plain)

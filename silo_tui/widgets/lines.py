"""A list of many lines of which each changes often: only lines that are seen are made, and painted if they changed.

Measured with 100 lines at 160x50, all of them new each second: Textual's option list takes three times as long; of
4,000 events, made anew for each one that came, 0.2 s.
"""

from collections.abc import Callable
from typing import ClassVar

from rich.segment import Segment
from rich.text import Text
from textual import events
from textual.geometry import Region, Size
from textual.message import Message
from textual.scroll_view import ScrollView
from textual.strip import Strip

from silo_tui.unforeseen import Guarded

# signs in front of a line, of whatever list: colours alone don't reach everybody
CURSOR, MARKED, ON_MARKED = ">", "+", "»"


class Lines(Guarded, ScrollView, can_focus=True):
    """Lines with a cursor on one of them."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {"lines--line", "lines--cursor"}

    class CursorMoved(Message):
        """The cursor is on another line."""

    class LinePicked(Message):
        """A line was chosen by the mouse."""

    def __init__(self, id: str) -> None:  # noqa: A002  # as Textual calls it
        super().__init__(id=id)
        self.count = 0
        self.highlighted: int | None = None
        self.stays_at_top = False  # whether the first line is seen, whatever comes above that of the cursor
        self._line: Callable[[int], Text] = lambda place: Text()
        self._painted: dict[int, Text] = {}

    def show(self, count: int, line: Callable[[int], Text], highlighted: int | None) -> None:
        """Show so many lines, made by `line` where they are seen, the cursor on one of them.

        The cursor stays on its row of the screen, wherever in the list its line stands now, or the list at its top.
        """
        before, self.highlighted, self._line = self.highlighted, highlighted, line
        if count != self.count:
            self.count, self._painted = count, {}
            self.virtual_size = Size(0, count)
            self.refresh()
        if before is not None and highlighted is not None and highlighted != before and self.size.height:
            moved_by = 0 if self.stays_at_top else highlighted - before
            top = max(0, min(self.scroll_offset.y + moved_by, count - self.size.height))
            self.scroll_to(y=top, animate=False, force=True, immediate=True)
        top, painted = self.scroll_offset.y, self._painted
        self._painted = {}
        for place in range(top, min(top + self.size.height, count)):
            old, new = painted.get(place), line(place)
            self._painted[place] = new
            moved = before != highlighted and place in (before, highlighted)
            if old is None or moved or old != new or old.spans != new.spans:
                self.refresh_line(place)

    def render_line(self, y: int) -> Strip:
        place, width = y + self.scroll_offset.y, self.scrollable_content_region.width
        cursor = place == self.highlighted
        style = self.get_component_rich_style("lines--cursor" if cursor else "lines--line")
        if place >= self.count:
            return Strip.blank(width, style)
        if place not in self._painted:
            self._painted[place] = self._line(place)
        line = self._painted[place].copy()
        if cursor and line.plain[:1] == " ":
            line = Text.assemble(CURSOR, line[1:])
        line.truncate(width, overflow="ellipsis")
        segments = Segment.apply_style(line.render(self.app.console, end=""), style)
        return Strip(segments).crop_extend(0, width, style)

    def move(self, place: int) -> None:
        """Put the cursor on a line, the nearest that there is."""
        if not self.count:
            return
        before, self.highlighted = self.highlighted, max(0, min(place, self.count - 1))
        if self.highlighted == before:
            return
        for each in (before, self.highlighted):
            if each is not None:
                self.refresh_line(each)
        region = Region(0, self.highlighted, 1, 1)
        self.scroll_to_region(region, animate=False, force=True, immediate=True)
        self.post_message(self.CursorMoved())

    @property
    def page_rows(self) -> int:
        """How many lines a page is."""
        return max(1, self.size.height - 1)

    def on_click(self, event: events.Click) -> None:
        """Move the cursor to a line; choose the one it is on."""
        place = int(event.y) + self.scroll_offset.y
        if place < self.count:
            if place == self.highlighted:
                self.post_message(self.LinePicked())
            else:
                self.move(place)

"""A list of many lines of which each changes often: only lines that read differently are painted.

Measured with 100 lines at 160x50, all of them new each second: Textual's option list takes three times as long.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from rich.segment import Segment
from rich.text import Text
from textual import events
from textual.geometry import Region, Size
from textual.message import Message
from textual.scroll_view import ScrollView
from textual.strip import Strip

from silo_tui.unforeseen import Guarded


class Lines(Guarded, ScrollView, can_focus=True):
    """Lines with a cursor on one of them."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {"lines--line", "lines--cursor"}

    @dataclass
    class Moved(Message):
        """The cursor is on another line."""

        place: int

    @dataclass
    class Picked(Message):
        """A line was chosen, by Enter or a second click."""

        place: int

    def __init__(self, id: str) -> None:  # noqa: A002  # as Textual calls it
        super().__init__(id=id)
        self._lines: list[Text] = []
        self.highlighted: int | None = None

    def show(self, lines: Sequence[Text], highlighted: int | None) -> None:
        """Show these lines, the cursor on one of them; paint what reads differently."""
        old, before = self._lines, self.highlighted
        self._lines, self.highlighted = list(lines), highlighted
        if len(old) != len(self._lines):
            self.virtual_size = Size(0, len(self._lines))
            self.refresh()
            return
        top, rows = self.scroll_offset.y, self.size.height
        for place in range(top, min(top + rows, len(self._lines))):
            moved = before != highlighted and place in (before, highlighted)
            if moved or old[place] != self._lines[place] or old[place].spans != self._lines[place].spans:
                self.refresh_lines(place - top, 1)

    def render_line(self, y: int) -> Strip:
        """Return a line of the screen."""
        place, width = y + self.scroll_offset.y, self.size.width
        cursor = place == self.highlighted
        style = self.get_component_rich_style("lines--cursor" if cursor else "lines--line")
        if place >= len(self._lines):
            return Strip.blank(width, style)
        segments = Segment.apply_style(self._lines[place].render(self.app.console, end=""), style)
        return Strip(segments).crop_extend(0, width, style)

    def move(self, place: int) -> None:
        """Put the cursor on a line, the nearest that there is."""
        if not self._lines:
            return
        before, self.highlighted = self.highlighted, max(0, min(place, len(self._lines) - 1))
        if self.highlighted == before:
            return
        top = self.scroll_offset.y
        for each in (before, self.highlighted):
            if each is not None:
                self.refresh_lines(each - top, 1)
        region = Region(0, self.highlighted, 1, 1)
        self.scroll_to_region(region, animate=False, force=True, immediate=True)
        self.post_message(self.Moved(self.highlighted))

    def step(self, lines: int) -> None:
        """Move the cursor by so many lines."""
        self.move((self.highlighted or 0) + lines)

    def page(self, pages: int) -> None:
        """Move the cursor by so many pages."""
        self.step(pages * max(1, self.size.height - 1))

    def pick(self) -> None:
        """Choose the line under the cursor."""
        if self.highlighted is not None:
            self.post_message(self.Picked(self.highlighted))

    def on_click(self, event: events.Click) -> None:
        """Move the cursor to a line; choose the one it is on."""
        place = int(event.y) + self.scroll_offset.y
        if place < len(self._lines):
            if place == self.highlighted:
                self.pick()
            else:
                self.move(place)

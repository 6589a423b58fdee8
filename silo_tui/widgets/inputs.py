"""Lines to type in: the filter, the command line, and the editor that lies over a cell."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from textual.binding import Binding
from textual.geometry import Region
from textual.message import Message
from textual.suggester import Suggester
from textual.widgets import Input

from silo_tui.model.fields import Field

Keys = list[Binding | tuple[str, str] | tuple[str, str, str]]


class LineSuggester(Suggester):
    """Shows the first completion behind the cursor."""

    def __init__(self, complete: Callable[[str], list[str]]) -> None:
        super().__init__(use_cache=False, case_sensitive=True)
        self._complete = complete

    async def get_suggestion(self, value: str) -> str | None:
        """The first one."""
        found = self._complete(value) if value else []
        return found[0] if found else None


class Line(Input):
    """A line that is shown only while somebody types in it."""

    DEFAULT_CSS = "Line { display: none; height: 1; border: none; padding: 0 1; }"
    BINDINGS: ClassVar[Keys] = [
        Binding("escape", "leave", show=False, priority=True),
        Binding("tab", "complete", show=False, priority=True),
    ]

    @dataclass
    class Left(Message):
        """Esc: back to where one was."""

        line: "Line"

    def __init__(self, complete: Callable[[str], list[str]], placeholder: str, id: str) -> None:  # noqa: A002 - Textual's word
        super().__init__(
            placeholder=placeholder, id=id, compact=True, suggester=LineSuggester(complete), select_on_focus=False
        )
        self._complete_line = complete
        self._turn: list[str] = []

    def open(self, value: str = "") -> None:
        """Shows the line and takes the keys."""
        self.value = value
        self.cursor_position = len(value)
        self.display = True
        self.focus()

    def shut(self) -> None:
        """Hides the line."""
        self.display = False

    def action_complete(self) -> None:
        """Takes the next completion; Tab again takes the one after."""
        if not self._turn or self.value not in self._turn:
            self._turn = self._complete_line(self.value)
            if not self._turn:
                return
            self.value = self._turn[0]
        else:
            self.value = self._turn[(self._turn.index(self.value) + 1) % len(self._turn)]
        self.cursor_position = len(self.value)

    def action_leave(self) -> None:
        """Esc."""
        self.post_message(self.Left(self))


class CellEditor(Input):
    """Lies over a cell while its number is edited in place."""

    DEFAULT_CSS = """
    CellEditor { display: none; layer: editor; height: 1; border: none; padding: 0; }
    """
    BINDINGS: ClassVar[Keys] = [Binding("escape", "leave", show=False, priority=True)]

    @dataclass
    class Left(Message):
        """Esc: nothing is changed."""

    def __init__(self) -> None:
        super().__init__(compact=True, id="cell-editor", select_on_focus=True)
        self.field = Field.DIVIDER

    def open(self, field: Field, region: Region, value: str, *, select: bool) -> None:
        """Appears over a cell of the screen."""
        self.field = field
        self.styles.width = max(region.width + 2, 8)
        right = region.x + region.width
        self.styles.offset = (max(0, right - max(region.width + 2, 8)), region.y)
        self.select_on_focus = select
        self.value = value
        self.cursor_position = len(value)
        self.display = True
        self.focus()

    def shut(self) -> None:
        """Goes away."""
        self.display = False

    def action_leave(self) -> None:
        """Esc."""
        self.post_message(self.Left())

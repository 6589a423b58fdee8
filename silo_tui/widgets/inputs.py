"""Lines to type in: the filter, the command line, and the editor that lies over a cell."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from rich.cells import cell_len
from rich.segment import Segment
from textual import events
from textual.binding import Binding
from textual.geometry import Region
from textual.message import Message
from textual.strip import Strip
from textual.suggester import Suggester
from textual.widget import Widget
from textual.widgets import Input

from silo.core.quantities.writing import and_more
from silo_tui.model.table.fields import Field
from silo_tui.unforeseen import Guarded

# what Input binds keys to: backspace, arrows and the like
EDITING = {
    key: binding.action for binding in Input.BINDINGS if isinstance(binding, Binding) for key in binding.key.split(",")
}


class LineSuggester(Suggester):
    """Shows the first completion behind the cursor."""

    def __init__(self, complete: Callable[[str], list[str]]) -> None:
        super().__init__(use_cache=False, case_sensitive=True)
        self._complete = complete

    async def get_suggestion(self, value: str) -> str | None:
        """Return the first completion."""
        found = self._complete(value) if value else []
        return next((one for one in found if one.startswith(value)), None)


class Suggesting(Input):
    """A line behind which stands, in brackets and with the key that takes it, what it may become.

    Colours alone would not tell that from what is typed: not all terminals have them.
    """

    def render_line(self, y: int) -> Strip:
        strip, ghost = super().render_line(y), self._suggestion[len(self.value) :]
        if not (ghost and self.value and self._suggestion.startswith(self.value) and self.has_focus and y == 0):
            return strip
        style, cursor = (self.get_component_rich_style(f"input--{each}") for each in ("suggestion", "cursor"))
        is_here = self.cursor_at_end and self._cursor_visible
        typed = strip.crop(0, max(0, cell_len(self.value) - self.scroll_offset.x))
        behind = Strip([Segment("[", cursor if is_here else style), Segment(f"{ghost}] Tab", style)])
        width = strip.cell_length
        return Strip([*typed, *behind.apply_style(self.rich_style)]).crop(0, width).extend_cell_length(width)


class NamingLine(Suggesting):
    """A field in which signals are named: what a name may become stands behind it, and Tab or → takes that.

    Where nothing does, Tab goes to the next field.
    """

    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = [
        Binding("tab", "take", "Take it, or next field", show=False),
    ]

    def __init__(self, complete: Callable[[str], list[str]], value: str, **options: Any) -> None:
        self._make_whole = complete
        super().__init__(value, compact=True, suggester=LineSuggester(complete), **options)

    def action_take(self) -> None:
        """Take the name that stands behind the cursor, or go to the next field."""
        found = self._make_whole(self.value) if self.cursor_at_end and self.selection.is_empty else []
        if found:
            self.value = found[0]
            self.cursor_position = len(self.value)
        else:
            self.screen.focus_next()


def tell_apart(line: Input) -> None:
    """Put what stands in an empty line in brackets where there are not many colours: they alone tell it apart."""
    if line.app.no_color or line.app.current_theme.ansi:
        line.placeholder = f"({line.placeholder})" if line.placeholder else ""


class Fleeting(Guarded, Suggesting):
    """An input that is there only while somebody types in it.

    All its keys are taken as keys and not as bindings, and what was typed behind Enter, Esc or Tab is handed on: a slow
    link brings several keys at once, and a binding would act before or after keys that were pressed after or before it.
    """

    @dataclass
    class Entered(Message):
        """Enter, and the value was taken."""

        line: "Fleeting"
        value: str

    @dataclass
    class Left(Message):
        """Esc, or the focus went elsewhere."""

        line: "Fleeting"

    def __init__(self, id: str, *, check: Callable[[str], bool] = lambda value: True, **options: Any) -> None:  # noqa: A002
        super().__init__(id=id, compact=True, **options)
        self._check = check
        self._before: Widget | None = None

    def begin(self, value: str) -> None:
        """Show the line and takes the keys."""
        self.value = value
        self.cursor_position = len(value)
        self.display = True
        self._before = self.screen.focused
        self.screen.set_focus(self)  # at once: `focus()` lets keys pass that come with this one

    def complete(self) -> None:
        """Do what Tab is for."""

    async def _on_key(self, event: events.Key) -> None:
        if not self.display:
            self.app.post_message(events.Key(event.key, event.character))
        elif event.key == "enter":
            if self._check(self.value):
                self._end(self.Entered(self, self.value))
        elif event.key == "escape":
            self._end(self.Left(self))
        elif event.key == "tab":
            self.complete()
        elif (action := EDITING.get(event.key)) is not None:
            await self.run_action(action)
        else:
            return
        event.stop()
        event.prevent_default()

    def _end(self, message: Message) -> None:
        self.display = False
        self.screen.set_focus(self._before)
        self.post_message(message)

    def _on_blur(self, event: events.Blur) -> None:
        if self.display:
            self.display = False
            self.post_message(self.Left(self))


class Line(Fleeting):
    """A line at the bottom: filter or command."""

    @dataclass
    class Completed(Message):
        """Tab: whole lines that it may become, by the first of which it is completed."""

        found: list[str]

        @property
        def words(self) -> str:
            """What they end with, where there are several; that there are none."""
            ends = [one.rpartition(" ")[2] for one in self.found]
            return f"Tab again: {and_more(ends[1:], 6)}" if len(ends) > 1 else "" if ends else "nothing completes it"

    @dataclass
    class Touched(Message):
        """The words from before, all of them chosen, are so no more: something was typed, or added to."""

    def __init__(self, complete: Callable[[str], list[str]], placeholder: str, id: str) -> None:  # noqa: A002
        super().__init__(id, placeholder=placeholder, suggester=LineSuggester(complete), select_on_focus=False)
        self._over = False  # whether the first letter takes the place of what stands there
        self._complete_line = complete
        self._turn: list[str] = []
        self._inside: list[str] = []  # what is in the folder that Tab took last

    def on_mount(self) -> None:
        tell_apart(self)

    def begin_over(self, old: str) -> str:
        """Begin over what was typed last: the first letter takes its place. Return what the keys do."""
        self._over = False
        self.begin(old)
        self.select_all()
        self._over = bool(old)
        return "Type anew, → adds to it  " if old else ""

    def watch_selection(self) -> None:
        """Tell the first change of what `begin_over` began with."""
        if self._over:
            self._over = False
            self.post_message(self.Touched())

    def complete(self) -> None:
        """Take the next completion; Tab again takes the one after, or what is in the folder that was taken."""
        if not self._turn or self.value not in self._turn or self._inside:
            self._turn, at = self._complete_line(self.value), 0
        else:
            at = (self._turn.index(self.value) + 1) % len(self._turn)
        if self._turn:
            self.value = self._turn[at]
            self.cursor_position = len(self.value)
        self._inside = self._complete_line(self.value) if self.value.endswith("/") else []
        found = [self.value, *self._inside] if self._inside else self._turn[at:] + self._turn[:at]
        # behind the change of the value, which is told first
        self.call_later(self.post_message, self.Completed(found))


class CellEditor(Fleeting):
    """Lies over a cell while its value is edited in place; stays open until the value can be taken."""

    def __init__(self, check: Callable[[str], bool]) -> None:
        super().__init__("cell-editor", check=check, select_on_focus=True)
        self.field = Field.DIVIDER

    def open(self, field: Field, value: str, *, select: bool) -> None:
        """Appear, over what `lie_over` says."""
        self.field = field
        self.select_on_focus = select
        self.begin(value)

    def lie_over(self, region: Region) -> None:
        """Lie over a cell of the screen."""
        self.styles.width = max(region.width + 1, 5)  # with room for the cursor; the blank before it stays
        self.styles.offset = (region.x, region.y)

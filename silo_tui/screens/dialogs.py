"""Dialogs: a question with choices (the harmless one first), and a line to type."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Vertical, VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Input, OptionList, Static
from textual.widgets.option_list import Option

from silo_tui.model.table import PendingChange

MAX_LINES = 400
BORDER_AND_TITLE_ROWS = 5


@dataclass(frozen=True)
class Choice:
    """One answer; `key` picks it at once."""

    value: str
    label: str
    key: str = ""


class ListDialog(ModalScreen[str | None]):
    """A list to choose from, below or above a body that scrolls; answers None on Esc."""

    KEYS_HERE = "Enter Chooses  j k Move  PgDn PgUp Scroll  Esc Back"

    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = [
        Binding("escape,q", "leave", "Back", show=False),
        Binding("pagedown,ctrl+d", "scroll(1)", show=False),
        Binding("pageup,ctrl+u", "scroll(-1)", show=False),
        Binding("j", "next", show=False),
        Binding("k", "previous", show=False),
    ]

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Answer with the choice."""
        self.dismiss(event.option.id)

    def action_leave(self) -> None:
        """Leave; nothing is done."""
        self.dismiss(None)

    def action_scroll(self, pages: int) -> None:
        """Move a long body."""
        body = self.query_one(".dialog-body", VerticalScroll)
        body.scroll_relative(y=pages * max(1, body.size.height - 1), animate=False)

    def action_next(self) -> None:
        """Go to the next choice."""
        self.query_one(OptionList).action_cursor_down()

    def action_previous(self) -> None:
        """Go to the previous choice."""
        self.query_one(OptionList).action_cursor_up()


class Question(ListDialog):
    """Asks; answers with the value of a choice. The first choice has the focus."""

    def __init__(self, title: str, body: Text | str, choices: Sequence[Choice]) -> None:
        super().__init__()
        self._title = title
        self._body = body
        self._choices = list(choices)

    def compose(self) -> ComposeResult:
        """Yield title, body, choices."""
        with Vertical(classes="dialog"):
            yield Static(self._title, classes="dialog-title", markup=False)
            with VerticalScroll(classes="dialog-body", can_focus=False):
                yield Static(self._body, markup=False)
            yield OptionList(*(Option(self._line(choice), id=choice.value) for choice in self._choices))

    def _line(self, choice: Choice) -> Text:
        line = Text(f" {choice.label}")
        if choice.key:
            line.append(f"  ({choice.key})", style="dim")
        return line

    def on_mount(self) -> None:
        """Give the focus to the first choice."""
        self.query_one(OptionList).focus()
        self.query_one(OptionList).highlighted = 0

    def on_resize(self, event: events.Resize) -> None:
        """Let a long body scroll: the choices are always on the screen."""
        room = event.size.height * 9 // 10 - len(self._choices) - BORDER_AND_TITLE_ROWS
        self.query_one(".dialog-body").styles.max_height = max(3, room)

    def on_key(self, event: events.Key) -> None:
        """Take a choice by its key; the screen below must not get it too."""
        for choice in self._choices:
            if choice.key and event.character == choice.key:
                event.stop()
                event.prevent_default()
                self.dismiss(choice.value)


class Prompt(ModalScreen[str | None]):
    """One line to type; None on Esc."""

    KEYS_HERE = "Enter Takes it  Esc Back"

    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = [
        Binding("escape", "leave", "Back", show=False)
    ]

    def __init__(self, title: str, body: str, value: str = "", placeholder: str = "") -> None:
        super().__init__()
        self._title, self._body, self._value, self._placeholder = title, body, value, placeholder

    def compose(self) -> ComposeResult:
        """Yield title, body, input."""
        with Vertical(classes="dialog"):
            yield Static(self._title, classes="dialog-title", markup=False)
            yield Static(self._body, classes="dialog-body", markup=False)
            yield Input(self._value, placeholder=self._placeholder, compact=True)

    def on_mount(self) -> None:
        """Give the focus to the line."""
        self.query_one(Input).focus()

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Answer with the line."""
        self.dismiss(event.value.strip())

    def action_leave(self) -> None:
        """Leave; nothing is done."""
        self.dismiss(None)


def diff_text(changes: Sequence[PendingChange], width: int = 64) -> Text:
    """Return pending edits as old → new, an element a paragraph."""
    lines = Text()
    previous = ""
    for change in changes[:MAX_LINES]:
        if change.name != previous:
            lines.append(f"{change.name}\n", style="bold")
            previous = change.name
        lines.append(f"  {change.field:<12} {change.old} → {change.new}")
        if change.theirs is not None:
            lines.append(f"   ! theirs now: {change.theirs}")
        lines.append("\n")
    if len(changes) > MAX_LINES:
        lines.append(f"and {len(changes) - MAX_LINES} more\n", style="dim")
    return lines

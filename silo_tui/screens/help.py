"""Help, made from the list of commands; what the screen below can do comes first."""

from collections.abc import Iterable
from typing import ClassVar

from rich.console import Group
from rich.table import Table as Grid
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Static

from silo.settings.words import help_rows
from silo_tui.actions import COMMANDS, FILE_SCOPES, commands_for, commands_like

NOTES = (
    ("Signs", (
        ("*", "pending: prepared here, not applied yet (underlined)"), ("!", "conflict: somebody else changed it too"),
        (">", "marked: edits and the monitor are about all that is marked"),
    )),
    ("Filter", (
        ("torque LF", "both words in the name"), ("/log/*/q", "globs"), ("-word", "not"),
        ("unit:Nm on:no", "unit, logging"), ("div>1 size>=1000", "numbers"),
        ("act:publish buf:loop", "what is done, which buffer"), ("dirty marked conflict live", "states"),
    )),
)  # fmt: skip

FILE_NOTES = (
    ("Signs", (
        (">", "marked: the plots are of all that is marked"), ("= 1.23", "the value that held at the cursor"),
        ("min max mean", "of the samples in the window"),
    )),
    ("Filter", (
        ("torque LF", "both words in the name"), ("/log/*/q", "globs"), ("-word", "not"), ("unit:Nm", "unit"),
        ("div>1 size>=1000", "divider, samples"), ("buf:loop kind:vector type:f4", "buffer, kind, type"),
    )),
)  # fmt: skip


class HelpScreen(ModalScreen[None]):
    """Scrolls; Esc, q or ? leave."""

    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = [
        Binding("escape,q,question_mark", "dismiss", "Back", show=False),
        Binding("j,down", "move(1)", show=False),
        Binding("k,up", "move(-1)", show=False),
        Binding("pagedown,ctrl+d,space", "move(15)", show=False),
        Binding("pageup,ctrl+u", "move(-15)", show=False),
    ]

    def __init__(self, scope: str) -> None:
        super().__init__()
        self._scope = scope

    def compose(self) -> ComposeResult:
        """Yield one long page."""
        with VerticalScroll(classes="dialog wide", can_focus=False):
            yield Static("Keys  (j k scroll, Esc leaves)", classes="dialog-title")
            yield Static(self._page())

    def action_move(self, lines: int) -> None:
        """Scroll."""
        self.query_one(VerticalScroll).scroll_relative(y=lines, animate=False)

    def _page(self) -> Group:
        here = {command.id for command in commands_for(self._scope)}
        commands = commands_like(self._scope)
        groups = list(dict.fromkeys(command.group for command in commands))
        groups.sort(key=lambda group: not any(command.group == group and command.id in here for command in commands))
        parts: list[Text | Grid] = []
        for group in groups:
            lines = [(command.key_text, command.help) for command in commands if command.group == group]
            parts += [Text(group, style="underline"), _grid(lines, 13), Text("")]
        notes_here = FILE_NOTES if self._scope in FILE_SCOPES else (*NOTES, ("Commands", _typed_lines()))
        for title, notes in notes_here:
            parts += [Text(title, style="underline"), _grid(notes, 28), Text("")]
        return Group(*parts)


def _typed_lines() -> list[tuple[str, str]]:
    typed = sorted((command.typed for command in COMMANDS if command.typed is not None), key=lambda each: each.place)
    lines = []
    for each in typed:
        lines += [(each.usage, each.help)] if each.usage else []
        if each.completes == "settings":
            lines += [(f"  {example}", meaning) for example, meaning in help_rows()]
    return lines


def _grid(lines: Iterable[tuple[str, str]], width: int) -> Grid:
    grid = Grid.grid(padding=(0, 1))
    grid.add_column(min_width=width)
    grid.add_column()
    for left, right in lines:
        grid.add_row(Text(f" {left}", style="bold"), Text(right))
    return grid

"""A line that is chosen or not, told by `[x]` and not by colour."""

from typing import ClassVar

from rich.text import Text
from textual.app import RenderResult
from textual.binding import Binding
from textual.reactive import reactive
from textual.widget import Widget

from silo_tui.unforeseen import Guarded


class CheckLine(Guarded, Widget, can_focus=True):
    """`[x] label`; space, x or a click turn it over. A `>` in front shows the focus, also without colours."""

    DEFAULT_CSS = """
    CheckLine { height: 1; }
    CheckLine:focus { text-style: bold; background: $boost; }
    """
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = [
        Binding("space,x", "turn", "Turn", show=False)
    ]
    value: reactive[bool] = reactive(False)

    def __init__(self, label: str, value: bool, id: str) -> None:  # noqa: A002 - Textual's word
        super().__init__(id=id)
        self._label = label
        self.set_reactive(CheckLine.value, value)

    def render(self) -> RenderResult:
        """Return the line."""
        return Text(f"{'>' if self.has_focus else ' '} [{'x' if self.value else ' '}] {self._label}")

    def action_turn(self) -> None:
        """Turn it over."""
        self.value = not self.value

    def on_click(self) -> None:
        """Turn it over."""
        self.action_turn()

"""The list of orders: a letter orders and closes, the letter of the present order turns it round."""

from collections.abc import Sequence
from typing import Any

from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.widgets import Static

from silo_tui.modal import Dialog
from silo_tui.model.lists.ordering import Order
from silo_tui.model.table.columns import TableOrder

COLUMN = 32


class OrderDialog(Dialog[str | None]):
    """Answers with the order whose letter was pressed; None on any other key."""

    def __init__(self, orders: Sequence[Order[Any] | TableOrder], now: str, arrow: str) -> None:
        super().__init__()
        self._orders, self._now, self._arrow = orders, now, arrow

    def compose(self) -> ComposeResult:
        """Yield the letters in two columns."""
        with Vertical(classes="dialog"):
            yield Static("Order by", classes="dialog-title", markup=False)
            yield Static(self._lines(), id="orders")

    def _lines(self) -> Text:
        lines = Text()
        half = -(-len(self._orders) // 2)
        for left in range(half):
            for order in self._orders[left::half][:2]:
                words = (order.words or order.name) + (f"  {self._arrow}" if order.name == self._now else "")
                lines.append(order.letter, style="bold")
                lines.append(f" {words:<{COLUMN - 2}}")
            lines.append("\n")
        lines.append("\nthe same letter again: the other way round")
        return lines

    def on_key(self, event: events.Key) -> None:
        """Order, or leave."""
        event.stop()
        event.prevent_default()
        self.dismiss(next((order.name for order in self._orders if order.letter == event.character), None))

"""What stands over a screen while something that was asked for is on its way: it owns the keys until that is there.

Without it, what is typed into a dialog that is slow to come would edit the table.
"""

import time
from typing import Any, cast

from textual import events
from textual.app import ComposeResult
from textual.widgets import Static

from silo_tui.context import Held, SiloScreen
from silo_tui.gate import LETS_GO, Gate
from silo_tui.model.words import text

TELLS_AFTER_S = 0.3


class Holding(Held):
    """Says after a moment for what it waits; what is typed meanwhile is for the dialog that comes."""

    CSS = "Holding { background: $background 0%; align: left bottom; } Holding #waiting { display: none; height: 1; \
width: 1fr; padding: 0 1; margin-bottom: 1; background: $panel; }"

    KEYS_HERE = "Esc Lets it go on"

    def __init__(self, what: str) -> None:
        super().__init__()
        self._what = what
        self._began = time.monotonic()
        self.ended = False
        self._there = False
        self._answered = False  # whether a dialog was there: what is typed after it is for what follows

    @property
    def waits(self) -> bool:  # type: ignore[override]
        """Whether what was asked for is still on its way."""
        return not self.ended

    def compose(self) -> ComposeResult:
        """Yield the line."""
        yield Static("", id="waiting", markup=False)

    def on_mount(self) -> None:
        """Begin to count the seconds; go, where what was asked for came sooner than this."""
        self._there = True
        self.set_interval(0.1, self._tell)
        if self.ended:
            self.call_later(self.end)

    def _tell(self) -> None:
        waited = time.monotonic() - self._began
        if waited >= TELLS_AFTER_S and self.is_active:
            line = self.query_one("#waiting", Static)
            line.display = True
            line.update(f"waiting for {self._what} {text.span(round(waited, 1))}   Esc lets it go on")

    def on_screen_suspend(self) -> None:
        """Make room for the dialog that came."""
        for line in self.query("#waiting"):
            line.display = False
        self._answered = True
        self._tell_keys()
        self._gate.moved()

    def _tell_keys(self) -> None:
        for screen in self.app.screen_stack:
            if isinstance(screen, SiloScreen):
                screen.show_keys_above()

    def on_screen_resume(self) -> None:
        """Wait for the next step."""
        self._tell_keys()
        self._began = time.monotonic()
        if self.ended:
            self.end()

    def end(self) -> None:
        """Go, at once or as soon as what lies above is gone."""
        if not self.ended and not self._answered:
            self._gate.drop()
        self.ended = True
        if self._there and self.is_active:  # one that is still being made can't be taken away
            self.dismiss()
        self._gate.moved()

    @property
    def _gate(self) -> Gate:
        return cast(Gate, cast(Any, self.app).gate)

    def on_key(self, event: events.Key) -> None:
        """Keep the key from the screen below."""
        event.stop()
        event.prevent_default()
        if event.key in LETS_GO:
            self.ended = True
            self.dismiss()
            self._gate.moved()
        elif event.key == "ctrl+q":
            cast(Any, self.app).context.left()
            self.app.exit()

"""What stands over a screen while something that was asked for is on its way: it owns the keys until that is there.

Without it, what is typed into a dialog that is slow to come would edit the table.
"""

import time
from typing import Any, cast

from textual import events
from textual.app import ComposeResult
from textual.widgets import Static

from silo_tui.context import Held, SiloScreen
from silo_tui.model import text
from silo_tui.screens.dialogs import Prompt

TELLS_AFTER_S = 0.3


class Holding(Held):
    """Takes every key; says after a moment for what it waits. Keys typed before a `Prompt` is there go into it."""

    CSS = "Holding { background: $background 0%; align: left bottom; } Holding #waiting { display: none; height: 1; \
width: 1fr; padding: 0 1; margin-bottom: 1; background: $panel; }"

    KEYS_HERE = "Esc Lets it go on"

    def __init__(self, what: str) -> None:
        super().__init__()
        self._what = what
        self._began = time.monotonic()
        self._keys: list[events.Key] = []
        self.ended = False
        self._there = False
        self._answered = False  # whether a dialog was there: what is typed after it is for what follows

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
            line.update(f"waiting for {self._what} {text.span(float(f'{waited:.1f}'))}   Esc lets it go on")

    def on_screen_suspend(self) -> None:
        """Hand over what was typed, where the dialog that came is a line to type in; an answer must not be guessed."""
        for line in self.query("#waiting"):
            line.display = False
        keys, self._keys, self._answered = self._keys, [], True
        if isinstance(self.app.screen, Prompt):
            self.app.screen.take_early(keys)
        self._tell_keys()

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
        self.ended = True
        if self._there and self.is_active:  # one that is still being made can't be taken away
            self.dismiss()
            for event in self._keys if self._answered else ():
                self.app.post_message(events.Key(event.key, event.character))

    def on_key(self, event: events.Key) -> None:
        """Keep the key from the screen below."""
        event.stop()
        event.prevent_default()
        if event.key == "escape":
            self.ended = True
            self.dismiss()
        elif event.key == "ctrl+q":
            cast(Any, self.app).context.left()
            self.app.exit()
        else:
            self._keys.append(event)

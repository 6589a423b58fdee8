"""The tour: six steps on the logger that is open, each a line that goes on when what it asks for was done."""

from collections.abc import Callable
from typing import Any

from silo_tui.actions import key_of

Step = tuple[str, Callable[[Any], bool]]
STEPS: tuple[Step, ...] = (
    ("{filter}, then type torque, then Enter: only names with that word are shown",
     lambda screen: screen.scope == "table" and bool(screen.session.rows.filter.text) and not screen.is_typing),
    ("{mark} marks the element and moves on: mark two (↑ ↓ move, again unmarks)",
     lambda screen: screen.scope == "table" and screen.session.rows.marked_count > 1),
    ("{monitor} plots what is marked", lambda screen: screen.scope == "monitor"),
    ("{pause} holds the picture, ← → look into it", lambda screen: screen.scope == "monitor" and screen.window.paused),
    ("{go_home} goes back to the table from anywhere; {back} goes one step back",
     lambda screen: screen.scope == "table"),
    ("{edit_divider}, then 5, then Enter: an edit that waits; {apply} would apply it, {undo} takes it back",
     lambda screen: screen.scope == "table" and screen.session.table.pending_count[0] > 0),
)  # fmt: skip
END = "that was the tour: {help} shows all keys, {undo} takes the edit back, {menu_go} goes anywhere"


class Tour:
    """Where somebody is in it."""

    def __init__(self) -> None:
        self._at = 0

    @property
    def over(self) -> bool:
        """Whether all steps were done."""
        return self._at >= len(STEPS)

    def follow(self, screen: Any) -> None:
        """Go on where what the step asks for was done on a screen."""
        while not self.over and STEPS[self._at][1](screen):
            self._at += 1

    @property
    def words(self) -> str:
        """The present step."""
        step = END if self.over else f"{self._at + 1} of {len(STEPS)} (:tour ends it): {STEPS[self._at][0]}"
        return step.format_map(_Keys())


class _Keys(dict[str, str]):
    def __missing__(self, command: str) -> str:
        return key_of(command)

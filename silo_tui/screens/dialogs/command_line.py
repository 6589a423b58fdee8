"""The `:` line over a screen that has none of its own: plots are named and kept where they are seen."""

from collections.abc import Callable

from textual.app import ComposeResult

from silo_tui.modal import Dialog
from silo_tui.widgets.inputs import Fleeting, Line


class CommandLine(Dialog[str | None]):
    """Answers with the line that was entered; None on Esc."""

    KEYS_HERE = "Enter does it  Tab completes  Esc leaves"
    AUTO_FOCUS = ""

    def __init__(self, complete: Callable[[str], list[str]], words: str, begun: str = "") -> None:
        """`words` are some of those that may be typed, `begun` is typed already."""
        super().__init__()
        self._begun = begun
        self._complete, self._words = complete, words

    def compose(self) -> ComposeResult:
        """Yield the line, above the keys."""
        yield Line(self._complete, self._words, "command-over")

    def on_mount(self) -> None:
        """Take the keys."""
        self.query_one(Line).begin(self._begun)

    def on_fleeting_entered(self, event: Fleeting.Entered) -> None:
        """Answer with the line."""
        self.dismiss(event.value)

    def on_fleeting_left(self, event: Fleeting.Left) -> None:
        """Leave; nothing is done."""
        if self.is_current:
            self.dismiss(None)

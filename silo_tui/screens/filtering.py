"""What screens of a list share whose filter is typed in a line below it."""

from abc import abstractmethod

from textual.widget import Widget

from silo_tui.context import SiloScreen
from silo_tui.widgets.bars import KeyBar
from silo_tui.widgets.inputs import Fleeting, Line

FILTER_KEYS = "Enter keeps the filter  Esc clears it"


class FilteredScreen(SiloScreen):
    """A list, and the words that are asked for in it; its only line to type in is that of the filter."""

    _asked = ""

    @property
    @abstractmethod
    def _list(self) -> Widget:
        """What is filtered."""

    @abstractmethod
    def filter_changed(self) -> None:
        """Show what passes now."""

    def begin_filter(self) -> None:
        """Let the words be typed."""
        self.query_one(KeyBar).show_instead(FILTER_KEYS)
        self.query_one(Line).begin(self._asked)

    def on_input_changed(self) -> None:
        """Filter while it is typed."""
        line = self.query_one(Line)
        if line.display:
            self._filter_by(line.value)

    def on_fleeting_entered(self, event: Fleeting.Entered) -> None:
        """Keep the filter."""
        self._back_to_list(event.value)

    def on_fleeting_left(self, event: Fleeting.Left) -> None:
        """Clear the filter."""
        self._back_to_list("")

    def _filter_by(self, words: str) -> None:
        self._asked = words.strip()
        self.filter_changed()

    def _back_to_list(self, words: str) -> None:
        self.query_one(KeyBar).show_instead("")
        self._list.focus()
        self._filter_by(words)

"""What to look for in the plots: a letter picks it, `*` looks in all signals that are plotted."""

from textual.widgets import Static

from silo_tui.model.samples.find import WORDS, What
from silo_tui.screens.dialogs.questions import Choice, Question

EVERYWHERE = "*"


class FindDialog(Question):
    """Answers with what is looked for."""

    def __init__(self, name: str, signals: int) -> None:
        choices = [Choice(what.value, WORDS[what], what.value) for what in What]
        if signals > 1:
            words = f"in all {signals} that are plotted, or in the chosen one alone"
            choices.append(Choice(EVERYWHERE, words, EVERYWHERE))
        self._where = [f"Find in {name}", f"Find in all {signals} signals that are plotted"]
        super().__init__(self._where[0], "", choices)
        self.everywhere = False

    def pick(self, value: str) -> None:
        """Answer, or look elsewhere."""
        if value != EVERYWHERE:
            self.dismiss(value)
            return
        self.everywhere = not self.everywhere
        self.query_one(".dialog-title", Static).update(self._where[self.everywhere])

"""The table under the plots while there are two cursors: what lies between them, a signal a line."""

import math
from collections.abc import Sequence

from rich.text import Text
from textual.widgets import Static

from silo.core.quantities.writing import many
from silo.expressions.span import Between
from silo_tui.actions import key_of
from silo_tui.model.words import text
from silo_tui.model.words.names import fitted_among
from silo_tui.unforeseen import Guarded

MOST_LINES = 8
_TITLES = ("at A", "B-A", "slope/s", "mean", "std", "rms", "min", "max")


class BetweenTable(Guarded, Static):
    """Hidden without cursor B."""

    def __init__(self) -> None:
        super().__init__()
        self.partly = ""  # where not all of it is here yet

    def show(self, times: str, facts: Sequence[tuple[str, str, Between]], partly: str = "") -> None:
        """Show the times of both cursors, and of each signal its letter, name and facts; `partly`: of what they are."""
        column = 8 if self.app.size.width < 100 else 10
        name_width = min(40, max(10, self.app.size.width - 2 - column * len(_TITLES)))
        lines = Text(no_wrap=True, overflow="ellipsis")
        lines.append(f" {times}\n", style="bold")
        lines.append(" " + "A to B".ljust(name_width) + "".join(f"{title:>{column}}" for title in _TITLES))
        for letter, name, found in facts[:MOST_LINES]:
            head = f"{letter} " if letter else ""
            fitted = fitted_among(name, tuple(name for _, name, _ in facts), name_width - len(head))
            lines.append(f"\n {head + fitted:<{name_width}}")
            lines.append("".join(f"{word:>{column}}" for word in words_of(found, column)))
        if len(facts) > MOST_LINES:
            isolates, removes = f"{key_of('isolate_plot')} isolates one", f"{key_of('drop_plot')} takes one away"
            lines.append(f"\n {many(len(facts) - MOST_LINES, 'more signal')}: {isolates}, {removes}")
        if partly:
            lacks = any(math.isnan(found.mean) and math.isfinite(found.smallest) for *_, found in facts)
            lines.append(f"\n {partly}{'; mean, std and rms need all samples' if lacks else ''}")
        self.update(lines)
        self.display, self.partly = True, partly

    def hide(self) -> None:
        """Take it off the screen."""
        self.display, self.partly = False, ""


def words_of(found: Between, column: int) -> list[str]:
    """Return the numbers of a line; what no number is said of stays empty."""
    values = (
        found.at_a, found.difference, found.slope, found.mean, found.std, found.rms, found.smallest, found.largest
    )  # fmt: skip
    digits = text.digits_for((found.at_a, found.smallest, found.largest), column - 1)
    words = ["" if math.isnan(value) else digits.write(value, column - 1) for value in values]
    if math.isfinite(found.slope):  # in another unit
        words[2] = text.row(found.slope, width=column - 1)[0]
    if not any(words):
        words[0] = f"{found.samples} rows"
    return words

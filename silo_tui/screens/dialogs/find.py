"""What to look for in the plots: a letter picks it, `*` looks in all signals that are plotted; a condition is typed."""

from collections.abc import Awaitable, Callable
from typing import ClassVar

from textual.widgets import Static

from silo.conditions.requests import TriggerTried
from silo.expressions.binding import bind
from silo.judging.checks import table_catalogue
from silo_tui.model.lists.conditions import tried_lines
from silo_tui.model.samples.find import WORDS, Search, What
from silo_tui.model.table import derived
from silo_tui.screens.dialogs.form import CONDITION, Form
from silo_tui.screens.dialogs.questions import Choice, Question
from silo_tui.sessions.live import Session

EVERYWHERE, MOMENT = "*", "a"


class FindDialog(Question):
    """Answers with what is looked for."""

    def __init__(self, name: str, signals: int) -> None:
        choices = [Choice(what.value, WORDS[what], what.value) for what in What]
        choices.append(Choice(MOMENT, "a moment by its time", MOMENT))
        if signals > 1:
            words = f"in all {signals} that are plotted, or in the chosen one alone"
            choices.append(Choice(EVERYWHERE, words, EVERYWHERE))
        self._where = [f"Find a moment in {each}, by its letter" for each in (name, f"all {signals} signals")]
        super().__init__(self._where[0], "", choices)
        self.everywhere = False

    def pick(self, value: str) -> None:
        if value != EVERYWHERE:
            self.dismiss(value)
            return
        self.everywhere = not self.everywhere
        self.query_one(".dialog-title", Static).update(self._where[self.everywhere])


SIGNS = ("<", ">", "==", "!=")
HINTS = {"when": "e.g. abs({0}) > 20 and {1} < 0.1"}


class ConditionDialog(Form[Search]):
    """Answers with the search for where a condition turns true."""

    KEYS_HERE = "Enter Finds it  Esc Back"
    NAMING = ("when",)
    EXPRESSION = "when"
    AFTER_S = 0.5
    NEEDED: ClassVar = {"when": CONDITION}

    def __init__(
        self, session: Session, begun: str, chosen: str, turns_true: Callable[[str], Awaitable[TriggerTried]]
    ) -> None:
        """`chosen` is what a condition that begins with its sign is of: `> 20`."""
        super().__init__(
            "Find where a condition turns true", (("when",),), {"when": begun}, HINTS, start="when", table=session.table
        )
        self._session, self._chosen, self._turns_true = session, chosen.lstrip("/"), turns_true

    def on_mount(self) -> None:
        """Begin with what was looked for last, which the first letter takes the place of."""
        self.field("when").select_all()

    def made(self) -> Search:
        """Return the search; its signals are there. Raises ExpressionError with the place."""
        typed, table = self.fields["when"], self._session.table
        if typed.startswith(SIGNS):
            typed = f"{self._chosen} {typed}"
        bind(typed, table_catalogue(table.elements[: table.own], table.prefix, derived.present(table))).condition()
        return Search(What.CONDITION, condition=typed)

    async def look(self) -> str:
        if not self.fields["when"]:
            return f"{CONDITION}; > 20 alone is of {self._chosen}"
        tried = await self._turns_true(self.made().condition)
        return "\n".join(tried_lines(tried, self.told_width, "turned true"))

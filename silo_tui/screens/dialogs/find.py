"""What to look for in the plots, typed in words: a value, the highest, a hole, a moment, a condition, a signal."""

import re
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import ClassVar

from textual.app import ComposeResult
from textual.widgets import Static

from silo.conditions.requests import TriggerTried
from silo.expressions.binding import bind
from silo.judging.checks import table_catalogue
from silo_tui.model.lists.conditions import tried_lines
from silo_tui.model.plots.panels import LETTERS
from silo_tui.model.samples.find import Search, What, parse_find
from silo_tui.model.table import derived
from silo_tui.screens.dialogs.form import Form
from silo_tui.sessions.live import Session

LINE = "find"
LETTER = re.compile(r"(?<![\w/.])(?<!\d )[a-z](?![\w/(.])")  # of a plot: no part of a name, nor a unit
SIGNS = ("<", ">", "==", "!=")
HINTS = {LINE: "e.g. {} or a word from below"}
WAYS = (
    ("> 5   < 5   5", "where it rises above, falls below, crosses it"),
    ("last above 5", "the last moment above; last below, first above"),
    ("highest  lowest  peak", "the ends, the top of each swing"),
    ("edge  change  nan", "a step, another value, no number"),
    ("outside  hole", "outside its limits, no samples"),
    ("trigger  marker", "where one fired, where one was set"),
    ("-3s  at 12.5  13:07:32", "that moment"),
    ("torque > 5 and b < 2", "turns true, of signals or letters of plots"),
    ("torque", "the plot of that signal"),
)


class FindDialog(Form[Search]):
    """Answers with what is looked for: what may be typed stands below the line."""

    KEYS_HERE = "Enter Finds it  Esc Back"
    NAMING = (LINE,)
    EXPRESSION = LINE
    AFTER_S = 0.5
    NEEDED: ClassVar = {LINE: "type what to look for, as below"}

    def __init__(
        self,
        session: Session,
        begun: str,
        chosen: str,
        plots: Sequence[str],
        level: str,
        turns_true: Callable[[str], Awaitable[TriggerTried]],
        counted: Callable[[Search], Awaitable[str]],
        moment: Callable[[str], object],
    ) -> None:
        """`chosen` is what a condition that begins with its sign is of, `level` a value of it; `plots` all that are."""
        hints = {LINE: HINTS[LINE].format(f"> {level or 5}")}
        super().__init__(f"Find in {chosen}", ((LINE,),), {LINE: begun}, hints, start=LINE, table=session.table)
        self._session, self._chosen, self._plots = session, chosen.lstrip("/"), plots
        self._letters = dict(zip(LETTERS, plots, strict=False)) if len(plots) > 1 else {}
        self._turns_true, self._counted, self._moment = turns_true, counted, moment

    def below(self) -> ComposeResult:
        """Yield what may be typed."""
        more = (("* highest", f"in all {len(self._plots)} signals that are plotted"),) if self._letters else ()
        yield Static("\n".join(f"{typed:<23} {does}" for typed, does in (*WAYS, *more)), classes="quiet", markup=False)

    def on_mount(self) -> None:
        """Begin with what was looked for last, which the first letter takes the place of."""
        self.field(LINE).select_all()

    def made(self) -> Search:
        """Return the search; the signals of a condition are there. Raises ExpressionError with the place."""
        found, table = parse_find(self.fields[LINE]), self._session.table
        if found.what in (What.CONDITION, What.SIGNAL):
            found = replace(found, condition=LETTER.sub(self._named, found.condition))
        if found.what is What.CONDITION:
            if found.condition.startswith(SIGNS):
                found = replace(found, condition=f"{self._chosen} {found.condition}")
            known = table_catalogue(table.elements[: table.own], table.prefix, derived.present(table))
            bind(found.condition, known).condition()
        elif found.what is What.MOMENT:
            self._moment(found.condition)
        elif found.what is What.SIGNAL:
            self._session.named([found.condition], scalars=True)
        return found

    def _named(self, letter: re.Match[str]) -> str:
        """Return what is plotted by a letter, unless a signal is called so."""
        with suppress(ValueError):
            self._session.named([letter[0]], scalars=True)
            return letter[0]
        return self._letters.get(letter[0], letter[0]).lstrip("/")

    async def look(self) -> str:
        if not self.fields[LINE]:
            return ""
        made = self.made()
        if made.what is not What.CONDITION:
            return await self._counted(made)
        tried = await self._turns_true(made.condition)
        return "\n".join(tried_lines(tried, self.told_width, "turned true"))

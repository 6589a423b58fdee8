# ruff: noqa: D102 - what a command does stands in actions.py, once
"""What the screens of triggers and of alarms share: a head, a list that keeps its line, a line of words, keys."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.widgets import OptionList, Static
from textual.widgets.option_list import Option

from silo_tui.context import SiloScreen
from silo_tui.sessions.live import Session
from silo_tui.widgets.bars import Banner, KeyBar, StatusBar

if TYPE_CHECKING:
    from silo.ipc.client import Client


class ConditionsScreen(SiloScreen):
    """A list of how conditions stand, asked for anew each second while it is shown."""

    empty = ""

    def __init__(self, session: Session) -> None:
        super().__init__()
        self.session = session
        self._bar, self._banner = StatusBar(session, read_only=False), Banner(session)
        self._drawn: list[tuple[str, str]] = []
        self._said = ""

    def compose(self) -> ComposeResult:
        """Yield status, banner, head, list, line of words, keys."""
        yield self._bar
        yield self._banner
        yield Static("", id="conditions-head", markup=False)
        yield OptionList(id="conditions-list", markup=False)
        yield Static("", id="conditions-said", markup=False)
        yield KeyBar(self.scope)

    def on_mount(self) -> None:
        """Show what is known, and ask."""
        self._banner.update()
        self.query_one(OptionList).focus()
        self.show()
        self.ask()

    def on_resize(self, event: events.Resize) -> None:
        """Draw the lines for another width."""
        self._drawn = []
        self.call_after_refresh(self.show)

    def ask(self) -> None:
        """Ask how they stand."""
        self.run_worker(self._ask(), group="conditions", exclusive=True)

    async def _ask(self) -> None:
        if self.session.connected:
            await self.context.quietly(self.session.refresh_conditions())
        self.show()

    async def carry_out(self, job: "Callable[[Client], str]") -> None:
        """Ask for something, and say what came of it: last, as keys are for what comes of it until then.

        The screen may be left meanwhile, so what came of it is told where one is.
        """
        said = await self.context.link.call(job)
        try:
            await self.session.refresh_conditions()
        finally:
            self.context.say(said)

    # ------------------------------------------------------------------------------------------------- to be drawn

    @abstractmethod
    def head(self, width: int) -> str:
        """Return the head of the list."""

    @abstractmethod
    def rows(self, width: int) -> Sequence[tuple[str, Text]]:
        """Return the lines, each with what tells it from others."""

    @abstractmethod
    def words(self) -> str:
        """Return what is to be said of the line under the cursor, or of all."""

    def show(self) -> None:
        """Draw the lines; the cursor stays on what it was on."""
        if not self.is_there:
            return  # it is being made, or goes
        width = self.size.width
        lines, known = self.query_one(OptionList), self.chosen_id
        rows = self.rows(width)
        drawn = [(key, line.plain) for key, line in rows]
        if drawn != self._drawn:
            self._drawn = drawn
            lines.clear_options()
            lines.add_options([Option(line, id=key) for key, line in rows])
            places = [place for place, (key, _) in enumerate(rows) if key == known]
            lines.highlighted = places[0] if places else (0 if rows else None)
        self.query_one("#conditions-head", Static).update(Text(self.head(width) if rows else "", no_wrap=True))
        self._show_words()
        self._bar.update()

    def _show_words(self) -> None:
        words = self._said or (self.words() if self._drawn else self.empty)
        self.query_one("#conditions-said", Static).update(Text(f" {words}"))

    @property
    def chosen_id(self) -> str:
        """What the line under the cursor is of, empty where there is none."""
        place = self.query_one(OptionList).highlighted
        return self._drawn[place][0] if place is not None and place < len(self._drawn) else ""

    # ---------------------------------------------------------------------------------------- what the app tells it

    def say(self, words: str) -> None:
        """Show the result of something until the next key."""
        self._said = words
        self._show_words()

    def on_option_list_option_highlighted(self, event: OptionList.OptionHighlighted) -> None:
        """Tell of another line."""
        self._show_words()

    def on_key(self, event: events.Key) -> None:
        """Let what was said go."""
        self._said = ""

    def status_changed(self) -> None:
        self._banner.update()
        self.show()

    def second_passed(self) -> None:
        self._banner.update()
        self.ask()

    def command_condition_down(self) -> None:
        self._said = ""
        self.query_one(OptionList).action_cursor_down()

    def command_condition_up(self) -> None:
        self._said = ""
        self.query_one(OptionList).action_cursor_up()

    def command_condition_top(self) -> None:
        self.query_one(OptionList).action_first()

    def command_condition_bottom(self) -> None:
        self.query_one(OptionList).action_last()

    def command_back(self) -> None:
        self.context.leave_screen()

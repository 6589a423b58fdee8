# ruff: noqa: D102 - what a command does stands in actions.py, once
"""What the screens of triggers and of alarms share: a list that keeps its line, filter, order, marks, words, keys."""

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.widgets import OptionList, Static
from textual.widgets.option_list import Option

from silo_tui.context import Later
from silo_tui.model.lists import Marks, Order, arranged, passes
from silo_tui.screens.filtering import FilteredScreen
from silo_tui.screens.order import OrderDialog
from silo_tui.sessions.live import Session
from silo_tui.sessions.live_source import LiveSource
from silo_tui.widgets.bars import Banner, KeyBar, StatusBar
from silo_tui.widgets.inputs import Line

MOST_PLOTS = 6

Status = TypeVar("Status")

if TYPE_CHECKING:
    from silo.client.client import Client


class ConditionsScreen(FilteredScreen, Generic[Status]):
    """A list of how conditions stand, asked for anew each second while it is shown."""

    aside = True
    empty = ""
    orders: ClassVar[Sequence[Order[Any]]]

    def __init__(self, session: Session) -> None:
        super().__init__()
        self.session = session
        self.marks = Marks()
        self._bar, self._banner = StatusBar(session, read_only=False), Banner(session)
        self._drawn: list[tuple[str, str]] = []
        self._said = ""
        self._asked = ""  # the filter
        self._order, self._turned = self.orders[0], False

    def compose(self) -> ComposeResult:
        """Yield status, banner, head, list, line of words, line of the filter, keys."""
        yield self._bar
        yield self._banner
        yield Static("", id="conditions-head", markup=False)
        yield OptionList(id="conditions-list", markup=False)
        yield Static("", id="conditions-said", markup=False)
        yield Line(lambda typed: [], "words of a line, a|b either, -not", "conditions-filter")
        yield KeyBar(self.scope)

    def on_mount(self) -> None:
        """Show what is known, and ask."""
        self._banner.update()
        self._list.focus()
        self.show()
        self.ask()

    def on_resize(self, event: events.Resize) -> None:
        """Draw the lines for another width."""
        self._drawn = []
        self.call_after_refresh(self.show)

    def ask(self) -> None:
        """Ask how they stand."""
        self.run_worker(Later(self._ask), group="conditions", exclusive=True)

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
            self.show()
            self.marks.settle()
            self.context.say(said)

    # ------------------------------------------------------------------------------------------------- to be drawn

    @abstractmethod
    def head(self, width: int) -> str:
        """Return the head of the list."""

    @property
    @abstractmethod
    def all(self) -> Sequence[Status]:
        """What there is, in the order in which it is told."""

    @abstractmethod
    def key_of(self, one: Status) -> str:
        """Return what tells a line from others."""

    @abstractmethod
    def row_of(self, one: Status, width: int) -> Text:
        """Return a line."""

    @abstractmethod
    def signals_of(self, one: Status) -> Sequence[str]:
        """Return the elements that a line is about."""

    @abstractmethod
    def words(self) -> str:
        """Return what is to be said of the line under the cursor, or of all."""

    def show(self) -> None:
        """Draw the lines; the cursor stays on what it was on."""
        if not self.is_there:
            return  # it is being made, or goes
        width, found = self.size.width, self.all
        lines, known, place = self._list, self.chosen_id, self._list.highlighted
        self.marks.keep(map(self.key_of, found))
        rows = [
            (self.key_of(one), self.row_of(one, width)) for one in arranged(found, self._order, turned=self._turned)
        ]
        rows = [(key, self._marked(line, key)) for key, line in rows if passes(line.plain, self._asked)]
        drawn = [(key, line.plain) for key, line in rows]
        if drawn != self._drawn:
            self._drawn = drawn
            lines.clear_options()
            lines.add_options([Option(line, id=key) for key, line in rows])
            lines.highlighted = self.marks.follow(known, self.shown_keys, place)
        self.query_one("#conditions-head", Static).update(Text(self.head(width) if rows else "", no_wrap=True))
        self._show_words()
        self._bar.update()

    def _marked(self, line: Text, key: str) -> Text:
        """Return a line with its mark, in the gap before the second column."""
        if key not in self.marks.keys:
            return line
        gap = self.mark_column
        return Text.assemble(line[:gap], (">", "bold"), line[gap + 1 :], no_wrap=True, overflow="ellipsis")

    mark_column = 1

    def _show_words(self) -> None:
        parts = [f"{len(self.marks.keys)} marked"] if self.marks.keys else []
        parts += [f"/{self._asked}: {len(self._drawn)} of {len(self.all)}"] if self._asked else []
        parts += [f"by {self._order.name}"] if self._order is not self.orders[0] or self._turned else []
        fetching = " │ ".join(one.words for one in self.session.fetches.values())
        parts.append(self._said or fetching or (self.words() if self.all else self.empty))
        for line in self.query("#conditions-said").results(Static):  # none of a screen that is gone
            line.update(Text(f" {' │ '.join(filter(None, parts))}"))

    @property
    def _list(self) -> OptionList:
        return self.query_one("#conditions-list", OptionList)

    @property
    def chosen_id(self) -> str:
        """What the line under the cursor is of, empty where there is none."""
        place = self._list.highlighted
        return self._drawn[place][0] if place is not None and place < len(self._drawn) else ""

    @property
    def chosen(self) -> Status | None:
        """What the line under the cursor is of."""
        return next((one for one in self.all if self.key_of(one) == self.chosen_id), None)

    @property
    def shown_keys(self) -> list[str]:
        """What passes the filter, in order."""
        return [key for key, _ in self._drawn]

    @property
    def targets(self) -> list[Status]:
        """What a key is about; where that is nothing, why is said."""
        by_key = {self.key_of(one): one for one in self.all}
        found = [by_key[key] for key in self.marks.meant(self.shown_keys, self.chosen_id) if key in by_key]
        if not found and (why := self.marks.why_none(self.shown_keys, self.chosen_id, self.named)):
            self.say(why)
        return found

    def named(self, key: str) -> str:
        """Return a line by the name that it is known by."""
        return self.session.short_name(key).lstrip("/")

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

    # ---------------------------------------------------------------------------------------------------- commands

    def command_condition_down(self) -> None:
        self._said = ""
        self._list.action_cursor_down()

    def command_condition_up(self) -> None:
        self._said = ""
        self._list.action_cursor_up()

    def command_condition_top(self) -> None:
        self._list.action_first()

    def command_condition_bottom(self) -> None:
        self._list.action_last()

    def command_conditions_down(self) -> None:
        self._list.action_page_down()  # type: ignore[no-untyped-call]  # textual's

    def command_conditions_up(self) -> None:
        self._list.action_page_up()  # type: ignore[no-untyped-call]  # textual's

    def command_read_conditions(self) -> None:
        self.say("read again")
        self.ask()

    def command_mark_condition(self) -> None:
        if self.chosen_id:
            self.marks.toggle(self.chosen_id)
            self._list.action_cursor_down()
            self.show()

    def command_mark_conditions(self) -> None:
        self.marks.toggle_all(self.shown_keys)
        self.show()

    def command_range_of_conditions(self) -> None:
        if self.chosen_id:
            self.say(self.marks.range_to(self.chosen_id, self.shown_keys))
            self.show()

    def command_order_conditions(self) -> None:
        letters = {order.name: order.letter for order in self.orders}
        words = {order.name: order.words for order in self.orders}
        arrow = "↓" if self._order.backwards != self._turned else "↑"
        self.app.push_screen(OrderDialog(list(letters), self._order.name, arrow, letters, words), self._by)

    def _by(self, name: str | None) -> None:
        if name is not None:
            self._turned = not self._turned if name == self._order.name else False
            self._order = next(order for order in self.orders if order.name == name)
            self.show()

    def command_plot_conditions(self) -> None:
        from silo_tui.screens.monitor import MonitorScreen

        source = LiveSource(self.session)
        targets = self.targets
        found = dict.fromkeys(name for one in targets for name in self.signals_of(one))
        names = [name for name in found if source.element(name) is not None][:MOST_PLOTS]
        if names:
            self.app.push_screen(MonitorScreen(self.session, source, names))
        elif targets:
            self.say("nothing of it can be plotted: it is no signal of the table")

    # ------------------------------------------------------------------------------------------------- the filter

    def command_filter_conditions(self) -> None:
        self.begin_filter()

    def filter_changed(self) -> None:
        """Show those that pass now."""
        self._said = ""
        self.show()
        self.marks.settle()

    def command_back(self) -> None:
        """Leave the filter, then the marks, then the screen."""
        if self._asked:
            self._filter_by("")
        elif self.marks.clear():
            self.show()
        else:
            self.context.leave_screen()

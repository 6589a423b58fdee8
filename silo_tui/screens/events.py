# ruff: noqa: D102 - what a command does stands in actions.py, once
"""What happened: the event log of a logger, or of a file, newest first; Enter goes there in the plots."""

import asyncio
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual import events as textual_events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.widgets import OptionList, Static
from textual.widgets.option_list import Option

from silo.core.elements import LoggedEvent
from silo.core.quantities.writing import many
from silo.errors import SiloError
from silo.files.atomic import atomic_file
from silo_tui.actions import bindings_for
from silo_tui.context import Later
from silo_tui.model.happened import ORDERS, csv_text, letter, line, matches, words
from silo_tui.model.lists import arranged
from silo_tui.model.paths import typed_file
from silo_tui.screens.dialogs import Prompt
from silo_tui.screens.filtering import FilteredScreen
from silo_tui.screens.order import OrderDialog
from silo_tui.screens.searching import Searching
from silo_tui.sessions.live import Session
from silo_tui.sessions.recorded import FileSession
from silo_tui.widgets.bars import Banner, KeyBar, StatusBar
from silo_tui.widgets.inputs import Line
from silo_tui.widgets.recorded import FileBanner, FileBar

HEAD = "  time                tick   what"


class EventsScreen(FilteredScreen):
    """A list of lines that follows the newest one until one moves in it."""

    scope = "events"
    aside = True
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("events")

    def __init__(self, session: Session) -> None:
        super().__init__()
        self.session = session
        self._asked = ""
        self._following = True
        self._shown: list[LoggedEvent] = []
        self._all: Sequence[LoggedEvent] = ()
        self._said = ""
        self._order, self._turned = ORDERS[0], False
        self._bar, self._banner = self.bars()

    def bars(self) -> tuple[StatusBar, Banner]:
        """Return the lines above."""
        return StatusBar(self.session, read_only=False), Banner(self.session)

    def compose(self) -> ComposeResult:
        """Yield status, banner, head, lines, message, the line of the filter, keys."""
        yield self._bar
        yield self._banner
        yield Static(Text(f"{HEAD}", no_wrap=True), id="events-head", markup=False)
        yield OptionList(id="events-list", markup=False)
        yield Static("", id="events-said", markup=False)
        yield Line(lambda typed: [], "-E without edits, M marks alone, other words", "events-filter")
        yield KeyBar(self.scope)

    def on_mount(self) -> None:
        """Show what is here."""
        self._banner.update()
        self._list.focus()
        self._show()

    def on_resize(self, event: textual_events.Resize) -> None:
        """Fit the lines to the width."""
        self._show()

    @property
    def _list(self) -> OptionList:
        return self.query_one(OptionList)

    def say(self, words: str) -> None:
        """Show the result of something."""
        self._said = words
        self._tell()

    def status_changed(self) -> None:
        """Follow state and link, and take in what happened since."""
        self.second_passed()
        if self.session.happened is not self._all:
            self._show()

    def second_passed(self) -> None:
        """Paint the times again."""
        self._bar.update()
        self._banner.update()

    def _show(self) -> None:
        if not self.is_there:
            return
        lines, width = self._list, self.size.width
        kept = self._event
        self._all = self.session.happened
        passing = (event for event in self._all if matches(event, self._asked, self._told(event)))
        self._shown = arranged(passing, self._order, turned=self._turned)
        lines.clear_options()
        lines.add_options(Option(self._line(event, width)) for event in self._shown)
        if self._shown:
            known = not self._following and kept is not None and kept in self._shown
            lines.highlighted = self._shown.index(kept) if known and kept is not None else 0
        self._tell()

    def _line(self, event: LoggedEvent, width: int) -> Text:
        told = line(event, self._told(event), width - 2, self.session.status.logger)
        shown = Text(told, no_wrap=True, overflow="ellipsis")
        if letter(event) in "MTX":
            shown.stylize("bold")
        return shown

    def _told(self, event: LoggedEvent) -> str:
        return words(event, self.session.table.shown)

    def _tell(self) -> None:
        if not self.is_there:
            return
        count = many(len(self._all), "event")
        parts = [f"{count}, {'follows' if self._following else 'g follows'}" if self._all else "nothing happened yet"]
        if self._order is not ORDERS[0] or self._turned:
            parts.append(f"by {self._order.name}{', turned round' if self._turned else ''}")
        if self._asked:
            parts.append(f"/{self._asked}: {len(self._shown)} of {len(self._all)}")
        if self._said:
            parts.append(self._said)
        self.query_one("#events-said", Static).update(Text(" " + " │ ".join(parts), no_wrap=True, overflow="ellipsis"))

    @property
    def _event(self) -> LoggedEvent | None:
        at = self._list.highlighted
        return self._shown[at] if at is not None and at < len(self._shown) else None

    # --------------------------------------------------------------------------------------------------- commands

    def command_next_line(self) -> None:
        self._moved()
        self._list.action_cursor_down()

    def command_previous_line(self) -> None:
        self._moved()
        self._list.action_cursor_up()

    def command_lines_down(self) -> None:
        self._moved()
        self._list.action_page_down()  # type: ignore[no-untyped-call]  # textual's

    def command_lines_up(self) -> None:
        self._moved()
        self._list.action_page_up()  # type: ignore[no-untyped-call]  # textual's

    def command_oldest_line(self) -> None:
        self._moved()
        self._list.action_last()

    def _moved(self) -> None:
        self._following, self._said = False, ""
        self._tell()

    def command_follow_events(self) -> None:
        self._following, self._said = True, ""
        self._show()

    def command_order_events(self) -> None:
        letters = {order.name: order.letter for order in ORDERS}
        named = {order.name: order.words for order in ORDERS}
        arrow = "↓" if self._order.backwards != self._turned else "↑"
        self.app.push_screen(OrderDialog(list(letters), self._order.name, arrow, letters, named), self._by)

    def _by(self, name: str | None) -> None:
        if name is not None:
            self._turned = not self._turned if name == self._order.name else False
            self._order = next(order for order in ORDERS if order.name == name)
            self._said = ""
            self._show()

    def command_read_events(self) -> None:
        self.run_worker(Later(self._read_again), group="events", exclusive=True)

    async def _read_again(self) -> None:
        await self.context.quietly(self.session.learn_events())
        self._show()
        self.say("read again")

    def command_write_events(self) -> None:
        if not self._shown:
            self.say("nothing to write: no event is shown")
            return
        body = f"{many(len(self._shown), 'event')} as {'filtered' if self._asked else 'shown'}, to a CSV file."
        self.app.push_screen(Prompt("Write the events to a file on this machine", body, "events.csv"), self._write)

    def _write(self, given: str | None) -> None:
        if given:
            self.run_worker(Later(self._written, given, list(self._shown)))

    async def _written(self, given: str, shown: Sequence[LoggedEvent]) -> None:
        try:
            path = typed_file("the file of events", given, ".csv")
            await asyncio.to_thread(_write_csv, path, shown)
        except (SiloError, OSError) as error:
            self.context.fail(str(error))
        else:
            self.context.say(f"{many(len(shown), 'event')} written: {path.absolute()}")

    def command_filter_events(self) -> None:
        self.begin_filter()

    def filter_changed(self) -> None:
        """Show those that pass now."""
        self._show()

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Go where a click points."""
        self.command_go_to_event()

    def command_go_to_event(self) -> None:
        event = self._event
        if event is None:
            return
        if not event.at_ns or event.tick < 0:
            self.say("this happened before the first tick: no place in the plots")
            return
        stack = [each for each in self.app.screen_stack if isinstance(each, Searching)]
        plots = next((each for each in reversed(stack) if each.session is self.session), None)
        if plots is None:
            self.say("no plots are open: m in the table plots what is marked, then E and Enter")
            return
        while self.app.screen is not plots:
            self.app.pop_screen()
        plots.call_after_refresh(plots.jump_to_event, event)

    def command_back(self) -> None:
        """Clear the filter, then leave."""
        if self._asked:
            self._asked = ""
            self._show()
        else:
            self.context.leave_screen()


def _write_csv(path: Path, shown: Sequence[LoggedEvent]) -> None:
    with atomic_file(path) as file:
        file.write(csv_text(shown).encode("utf-8", "backslashreplace"))


class FileEventsScreen(EventsScreen, inherit_bindings=False):
    """The same of a file."""

    session: FileSession
    scope = "file_events"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("file_events")

    def bars(self) -> tuple[StatusBar, Banner]:
        """Return facts of the file, and what is wrong with it."""
        return FileBar(self.session), FileBanner(self.session)

# ruff: noqa: D102 - what a command does stands in actions.py, once
"""What happened: the event log of a logger, or of a file, newest first; Enter goes there in the plots."""

from collections.abc import Sequence
from typing import ClassVar

from rich.text import Text
from textual import events as textual_events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.widgets import OptionList, Static
from textual.widgets.option_list import Option

from silo.model import LoggedEvent
from silo_tui.actions import bindings_for
from silo_tui.context import SiloScreen
from silo_tui.model import text
from silo_tui.model.happened import letter, line, matches
from silo_tui.screens.searching import Searching
from silo_tui.sessions.live import Session
from silo_tui.widgets.bars import KeyBar
from silo_tui.widgets.inputs import Fleeting, Line

HEAD = "  time                tick   what"
FILTER_KEYS = "Enter keeps it  Esc shows all again"


class EventsScreen(SiloScreen):
    """A list of lines that follows the newest one until one moves in it."""

    scope = "events"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("events")

    def __init__(self, session: Session) -> None:
        super().__init__()
        self.session = session
        self._asked = ""
        self._following = True
        self._shown: list[LoggedEvent] = []
        self._all: Sequence[LoggedEvent] = ()
        self._said = ""

    def compose(self) -> ComposeResult:
        """Yield head, lines, message, the line of the filter, keys."""
        yield Static(Text(f"{HEAD}", no_wrap=True), id="events-head", markup=False)
        yield OptionList(id="events-list", markup=False)
        yield Static("", id="events-said", markup=False)
        yield Line(lambda typed: [], "-E without edits, M marks alone, other words", "events-filter")
        yield KeyBar(self.scope)

    def on_mount(self) -> None:
        """Show what is here."""
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
        """Take in what happened since."""
        if self.session.happened is not self._all:
            self._show()

    def _show(self) -> None:
        lines, width = self._list, self.size.width
        kept = self._event
        self._all = self.session.happened
        self._shown = [event for event in reversed(self._all) if matches(event, self._asked)]
        lines.clear_options()
        lines.add_options(Option(self._line(event, width)) for event in self._shown)
        if self._shown:
            known = not self._following and kept is not None and kept in self._shown
            lines.highlighted = self._shown.index(kept) if known and kept is not None else 0
        self._tell()

    def _line(self, event: LoggedEvent, width: int) -> Text:
        shown = Text(line(event, width - 2, self.session.status.logger), no_wrap=True, overflow="ellipsis")
        if letter(event) in "MTX":
            shown.stylize("bold")
        return shown

    def _tell(self) -> None:
        count = text.plural(len(self._all), "event")
        words = [f"{count}, {'follows' if self._following else 'g follows'}" if self._all else "nothing happened yet"]
        if self._asked:
            words.append(f"/{self._asked}: {len(self._shown)} of {len(self._all)}")
        if self._said:
            words.append(self._said)
        self.query_one("#events-said", Static).update(Text(" " + " │ ".join(words), no_wrap=True, overflow="ellipsis"))

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

    def command_filter_events(self) -> None:
        self.query_one(KeyBar).show_instead(FILTER_KEYS)
        self.query_one(Line).begin(self._asked)

    def on_input_changed(self) -> None:
        """Filter while one types."""
        filter_line = self.query_one(Line)
        if filter_line.display:
            self._asked = filter_line.value.strip()
            self._show()

    def on_fleeting_entered(self, event: Fleeting.Entered) -> None:
        """Keep the filter."""
        self._asked = event.value.strip()
        self._ended()

    def on_fleeting_left(self, event: Fleeting.Left) -> None:
        """Show all again."""
        self._asked = ""
        self._ended()

    def _ended(self) -> None:
        self.update_keys()
        self._list.focus()
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
        plots = next((each for each in reversed(self.app.screen_stack) if isinstance(each, Searching)), None)
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


class FileEventsScreen(EventsScreen, inherit_bindings=False):
    """The same of a file."""

    scope = "file_events"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("file_events")

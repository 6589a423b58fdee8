"""Which logger? Shown when there are several, and while there is none: then it says what to start."""

from collections.abc import Callable, Sequence
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Vertical
from textual.widgets import OptionList, Static
from textual.widgets.option_list import Option

from silo_tui.actions import bindings_for
from silo_tui.context import SiloScreen
from silo_tui.sessions.finder import FoundLogger
from silo_tui.widgets.bars import KeyBar

WAITING = """No logger is running for this user on this computer; looking again every second.

Start one:
    silo demo          a simulated legged robot
    silo host          this computer: load, memory, temperatures
    your own program   log.serve()

or press D for the demo. q quits."""


class LoggersScreen(SiloScreen):
    """A list, or what to do when it would be empty."""

    scope = "loggers"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("loggers")

    def __init__(self, choose: Callable[[FoundLogger], None], wanted: str = "") -> None:
        super().__init__()
        self._choose = choose
        self._wanted = wanted
        self._lines: tuple[FoundLogger, ...] | None = None

    def compose(self) -> ComposeResult:
        """Yield title, list, advice, keys."""
        yield Static("silo", id="loggers-title")
        with Vertical(id="loggers-body"):
            yield OptionList(id="loggers-list")
            yield Static("Looking for loggers …", id="loggers-advice", markup=False)
        yield KeyBar("loggers")

    def show(self, lines: Sequence[FoundLogger], forbidden: Sequence[str], problem: str = "") -> None:
        """Show what was found."""
        options = self.query_one(OptionList)
        if tuple(lines) != self._lines:
            kept = options.highlighted or 0
            options.clear_options()
            width = max((len(line.name) for line in lines), default=0)
            for line in lines:
                gone = "  (dead)" if line.dead else ""
                words = Text(f" {line.name:<{width}}  {line.where}{gone}")
                options.add_option(Option(words, id=line.key))
            self._lines = tuple(lines)
            if lines:
                options.highlighted = min(kept, len(lines) - 1)
                options.focus()
        options.display = bool(lines)
        advice = "" if lines else WAITING
        if len(lines) > 1 and self._wanted and all(line.is_meant_by(self._wanted) for line in lines):
            last = lines[-1]
            one = f"{last.name}.{last.pid}" if last.pid else last.where
            advice = f"{len(lines)} loggers are called {self._wanted!r}; choose one, or name it: {one}"
        elif self._wanted and any(line.is_meant_by(self._wanted) for line in lines):
            advice = ""  # it is there; why it isn't open is told below
        elif lines and self._wanted:
            advice = f"There is no logger called {self._wanted!r}; these run:"
        elif self._wanted and not lines:
            no_file = ", and there is no file of that path" if "/" in self._wanted else ""
            advice = f"Waiting for the logger {self._wanted!r}: it doesn't run{no_file}.\n\n{WAITING}"
        notes = [note for note in (problem, *forbidden) if note]
        self.query_one("#loggers-advice", Static).update("\n\n".join([advice, *notes]).strip())

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """Open it."""
        for line in self._lines or ():
            if line.key == event.option.id:
                self._choose(line)

    def command_next_logger(self) -> None:
        """Move the cursor down."""
        self.query_one(OptionList).action_cursor_down()

    def command_previous_logger(self) -> None:
        """Move the cursor up."""
        self.query_one(OptionList).action_cursor_up()

    def command_first_logger(self) -> None:
        """Move the cursor to the first line."""
        self.query_one(OptionList).action_first()

    def command_last_logger(self) -> None:
        """Move the cursor to the last line."""
        self.query_one(OptionList).action_last()

    def command_loggers_down(self) -> None:
        """Move the cursor a page down."""
        self.query_one(OptionList).action_page_down()  # type: ignore[no-untyped-call]  # textual's

    def command_loggers_up(self) -> None:
        """Move the cursor a page up."""
        self.query_one(OptionList).action_page_up()  # type: ignore[no-untyped-call]  # textual's

    def command_open_logger(self) -> None:
        """Choose with Enter where the list has no focus."""
        self.query_one(OptionList).action_select()

    def command_back(self) -> None:
        """Go back to the logger that is open, if one is."""
        self.context.back_to_table()

# ruff: noqa: D102 - what a command does stands in actions.py, once
"""All loggers that can be reached: how each stands, the worst first; one is opened, many are commanded at once.

Shown when there are several, and while there is none: then it says what to start.
"""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Vertical
from textual.widgets import Static

from silo.fleet.member import Member
from silo.net.found import LoggerAddress
from silo_tui.actions import bindings_for
from silo_tui.model import fleet
from silo_tui.model.lists import Marks, arranged, passes
from silo_tui.screens.filtering import FilteredScreen
from silo_tui.screens.order import OrderDialog
from silo_tui.sessions.finder import FoundLogger
from silo_tui.widgets.bars import KeyBar, color
from silo_tui.widgets.inputs import Fleeting
from silo_tui.widgets.inputs import Line as TypedLine
from silo_tui.widgets.lines import Lines

WAITING = """No logger is running for this user on this computer; looking again every second.

Start one:
    silo demo          a simulated legged robot
    silo host          this computer: load, memory, temperatures
    your own program   log.serve()

or press D for the demo. q quits."""


STARTING = "The demo is starting: a simulated legged robot, which opens here by itself."


class LoggersScreen(FilteredScreen):
    """A list, or what to do when it would be empty."""

    scope = "loggers"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("loggers")

    def __init__(
        self,
        choose: Callable[[FoundLogger], None],
        wanted: str = "",
        command: Callable[[str, Sequence[fleet.LoggerLine]], None] | None = None,
    ) -> None:
        """`choose` opens a logger, `command` asks about many: "start_stop", "restart", "save" or "load" them."""
        super().__init__()
        self._choose, self._wanted, self._command = choose, wanted, command
        self._found: tuple[FoundLogger, ...] = ()
        self._lines: list[fleet.LoggerLine] = []
        self._drawn: list[tuple[str, str]] = []
        self.marks = Marks()
        self.answers: dict[str, str] = {}  # by key, of the last command for many
        self._asked = self._said = self._notes = ""
        self._order, self._turned = fleet.ORDERS[0], False
        self._width = 0  # for which the lines are drawn

    def compose(self) -> ComposeResult:
        """Yield title, head, list, advice, line of words, line of the filter, keys."""
        yield Static("silo", id="loggers-title", markup=False)
        yield Static("", id="loggers-head", markup=False)
        with Vertical(id="loggers-body"):
            yield Lines("loggers-list")
            yield Static("Looking for loggers …", id="loggers-advice", markup=False)
        yield Static("", id="loggers-said", markup=False)
        yield TypedLine(lambda typed: [], "words of a line, a|b either, -not", "loggers-filter")
        yield KeyBar("loggers", read_only=self.context.read_only)

    def on_resize(self, event: events.Resize) -> None:
        """Draw the lines for another width."""
        self._width = 0
        self.call_after_refresh(self.draw)

    def show(
        self, found: Sequence[FoundLogger], forbidden: Sequence[str], problem: str = "", *, starting: bool = False
    ) -> None:
        """Show what was found; `starting`: the demo is on its way."""
        self._found = tuple(found)
        advice = STARTING if starting else "" if found else WAITING
        if len(found) > 1 and self._wanted and all(one.is_meant_by(self._wanted) for one in found):
            last = found[-1]
            one = f"{last.name}.{last.pid}" if last.pid else last.where
            advice = f"{len(found)} loggers are called {self._wanted!r}; choose one, or name it: {one}"
        elif self._wanted and any(one.is_meant_by(self._wanted) for one in found):
            advice = ""  # it is there; why it isn't open is told below
        elif found and self._wanted:
            advice = f"There is no logger called {self._wanted!r}; these run:"
        elif self._wanted and not found:
            no_file = (
                ", and there is no file of that path" if "/" in self._wanted and not Path(self._wanted).exists() else ""
            )
            advice = f"Waiting for the logger {self._wanted!r}: it doesn't run{no_file}.\n\n{WAITING}"
        notes = [note for note in (problem, *forbidden) if note]
        self._notes = "\n\n".join([advice, *notes]).strip() if not found else "\n".join(filter(None, [advice, *notes]))
        self.draw()

    def draw(self) -> None:
        """Draw the lines; the cursor stays on what it was on."""
        if not self.is_there:
            return
        now_s, now_ns, width = time.monotonic(), time.time_ns(), self.size.width
        self._lines = [self._line_of(one) for one in self._found]
        self.marks.keep(one.key for one in self._lines)
        names = fleet.name_width(self._lines, width)
        rows = [
            (one, fleet.row(one, names, width, now_s, now_ns))
            for one in arranged(self._lines, self._order, turned=self._turned)
        ]
        rows = [(one, row) for one, row in rows if passes(row, self._asked)]
        options, known = self._list, self.chosen_key
        drawn = [(one.key, row + (">" if one.key in self.marks.keys else "")) for one, row in rows]
        if drawn != self._drawn or width != self._width:
            self._drawn, self._width = drawn, width
            at = self.marks.follow(known, self.shown_keys, options.highlighted)
            options.show([self._styled(one, row) for one, row in rows], at)
        options.display = bool(self._lines)
        if self._lines and not isinstance(self.focused, Fleeting):
            options.focus()
        head = self.query_one("#loggers-head", Static)
        head.display = bool(self._lines)
        head.update(Text(fleet.head(names, width), no_wrap=True))
        advice = self.query_one("#loggers-advice", Static)
        notes = "\n".join(filter(None, [self._notes, *fleet.down(self._lines, now_s, now_ns)]))
        advice.update(notes)
        advice.display = bool(notes) or not self._lines
        advice.styles.max_height = "50%" if self._lines else "100%"
        marked = f"{len(self.marks.keys)} marked" if self.marks.keys else ""
        title = f"silo  {fleet.total(self._lines)}" if self._lines else "silo"
        self.query_one("#loggers-title", Static).update(f"{title:<{max(0, width - 3 - len(marked))}}{marked}")
        self._show_words()

    def _line_of(self, one: FoundLogger) -> fleet.LoggerLine:
        member = one.member or Member(LoggerAddress(one.name, one.pid, one.key, one.user, host=one.host, dead=one.dead))
        return fleet.LoggerLine(one.key, one.address, one.where, member, self.answers.get(one.key, ""))

    def _styled(self, one: fleet.LoggerLine, row: str) -> Text:
        variables, member = self.app.theme_variables, one.member
        line = Text(row, no_wrap=True, overflow="ellipsis")
        if not member.here:
            line.stylize("dim")
        name = "error" if member.stands in fleet.BAD else "warning" if member.stands in fleet.CAUTION else ""
        if not name and member.running:
            name = "success"
        begin = row.find(fleet.STATES.get(member.word, member.word))
        if name and begin >= 0:
            line.stylize(f"bold {color(variables, name)}", begin, begin + fleet.STATE_WIDTH)
        if name and member.sign and not one.answer and (at := row.find(f" {member.sign}", begin)) >= 0:
            line.stylize(f"bold {color(variables, name)}", at, at + 6)
        if one.key in self.marks.keys:
            line = Text.assemble((" >", "bold"), line[2:], no_wrap=True, overflow="ellipsis")
        return line

    def _show_words(self) -> None:
        parts = [f"/{self._asked}: {len(self._drawn)} of {len(self._lines)}"] if self._asked else []
        parts += [f"by {self._order.name}"] if self._order is not fleet.ORDERS[0] or self._turned else []
        one = self.chosen
        parts.append(self._said or (fleet.details(one) if one is not None else ""))
        for line in self.query("#loggers-said").results(Static):
            line.update(Text(f" {' │ '.join(filter(None, parts))}"))

    @property
    def found(self) -> Sequence[FoundLogger]:
        """All loggers of the list."""
        return self._found

    @property
    def _list(self) -> Lines:
        return self.query_one("#loggers-list", Lines)

    @property
    def chosen_key(self) -> str:
        """What the line under the cursor is of; empty where there is none."""
        place = self._list.highlighted
        return self._drawn[place][0] if place is not None and place < len(self._drawn) else ""

    @property
    def chosen(self) -> fleet.LoggerLine | None:
        """The logger under the cursor."""
        return next((one for one in self._lines if one.key == self.chosen_key), None)

    @property
    def targets(self) -> list[fleet.LoggerLine]:
        """Which loggers a key is about."""
        by_key = {one.key: one for one in self._lines}
        return [by_key[key] for key in self.marks.meant(self.shown_keys, self.chosen_key) if key in by_key]

    @property
    def shown_keys(self) -> list[str]:
        """What passes the filter, in order."""
        return [key for key, _ in self._drawn]

    # --------------------------------------------------------------------------------------- what the app tells it

    def say(self, words: str) -> None:
        """Show the result of something until the next key."""
        self._said = words
        self._show_words()

    def on_key(self, event: events.Key) -> None:
        """Let what was said go."""
        self._said = ""

    def on_lines_moved(self, event: Lines.Moved) -> None:
        """Tell of another line."""
        self._show_words()

    def on_lines_picked(self, event: Lines.Picked) -> None:
        """Open it."""
        for one in self._found:
            if one.key == self.chosen_key:
                if one.is_there:
                    self._choose(one)
                else:
                    self.say(f"{one.address} is not there any more; r looks again")

    # ------------------------------------------------------------------------------------------------------ moving

    def command_next_logger(self) -> None:
        self._list.step(1)

    def command_previous_logger(self) -> None:
        self._list.step(-1)

    def command_first_logger(self) -> None:
        self._list.move(0)

    def command_last_logger(self) -> None:
        self._list.move(len(self._drawn) - 1)

    def command_loggers_down(self) -> None:
        self._list.page(1)

    def command_loggers_up(self) -> None:
        self._list.page(-1)

    def command_open_logger(self) -> None:
        """Choose with Enter where the list has no focus."""
        self._list.pick()

    # ------------------------------------------------------------------------------------------ marks, order, filter

    def command_mark_logger(self) -> None:
        if self.chosen_key:
            self.marks.toggle(self.chosen_key)
            self.draw()
            self._list.step(1)

    def command_mark_loggers(self) -> None:
        self.marks.toggle_all(self.shown_keys)
        self.draw()

    def command_range_of_loggers(self) -> None:
        if self.chosen_key:
            self.say(self.marks.range_to(self.chosen_key, self.shown_keys))
            self.draw()

    def command_order_loggers(self) -> None:
        letters = {order.name: order.letter for order in fleet.ORDERS}
        words = {order.name: order.words for order in fleet.ORDERS}
        arrow = "↓" if self._order.backwards != self._turned else "↑"
        self.app.push_screen(OrderDialog(list(letters), self._order.name, arrow, letters, words), self._by)

    def _by(self, name: str | None) -> None:
        if name is not None:
            self._turned = not self._turned if name == self._order.name else False
            self._order = next(order for order in fleet.ORDERS if order.name == name)
            self.draw()

    def command_filter_loggers(self) -> None:
        self.begin_filter()

    def filter_changed(self) -> None:
        """Show those that pass now."""
        self._said = ""
        self.draw()
        self.marks.settle()

    def command_back(self) -> None:
        """Leave the filter, then the answers, the marks, the list for the logger that is open, if one is."""
        if self._asked:
            self._filter_by("")
        elif self.answers:
            self.answers = {}
            self.draw()
        elif self.marks.clear():
            self.draw()
        else:
            self.context.back_to_table()

    # ------------------------------------------------------------------------------------------------- many at once

    def _many(self, what: str) -> None:
        targets = self.targets
        if not targets:
            names = {one.key: one.address for one in self._lines}
            why = self.marks.why_none(self.shown_keys, self.chosen_key, lambda key: names.get(key, "what was there"))
            none = "the filter leaves out any logger: Esc ends it; nothing was asked" if self._asked else ""
            self.say(why or none or "no logger is here")
        elif self._command is not None:
            self._command(what, targets)

    def command_start_stop_loggers(self) -> None:
        self._many("start_stop")

    def command_restart_loggers(self) -> None:
        self._many("restart")

    def command_save_loggers(self) -> None:
        self._many("save")

    def command_load_into_loggers(self) -> None:
        self._many("load")

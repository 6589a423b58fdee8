"""All loggers that can be reached: how each stands, the worst first; one is opened, many are commanded at once.

Shown when there are several, and while there is none: then it says what to start.
"""

import asyncio
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from msgspec.structs import replace
from rich.text import Text
from textual.app import ComposeResult
from textual.widgets import Static

from silo.core.quantities.writing import and_more
from silo.errors import SiloError
from silo.files.naming import find_logs
from silo.rpc.published import Summary
from silo_tui.actions import BY_ID, Command, key_of
from silo_tui.modal import run_aside
from silo_tui.model.lists import fleet
from silo_tui.model.lists.fleet import FoundLogger
from silo_tui.screens.lists.list_screen import ListScreen
from silo_tui.theme import bold
from silo_tui.widgets.messages import ListLine

WAITING = """No logger is running for this user on this computer; looking again every second.

Press {demo} for the demo, a simulated legged robot, or start one:
    silo demo          the same in a terminal of its own
    silo host          this computer: load, memory, temperatures
    your own program   with a line of Python, before its loop:

import silo; log = silo.Logger("arm", frequency=500); log.serve()

{saved}{quit} quits."""
# where one looks for what was saved, and its name; the second is that of the demo
FOLDERS = {".": "this folder", "silo-logs": "./silo-logs"}


STARTING = "The demo is starting: a simulated legged robot, which opens here by itself."
OTHERS = "What is listed is another one."


class LoggersScreen(ListScreen[FoundLogger]):
    """A list, or what to do when it would be empty."""

    scope = "loggers"
    orders = fleet.ORDERS
    _notes = "Looking for loggers …"

    def __init__(
        self,
        choose: Callable[[FoundLogger], None],
        wanted: str = "",
        command: Callable[[str, Sequence[FoundLogger]], None] | None = None,
    ) -> None:
        """`choose` opens a logger, `command` asks about many: "start_stop", "restart", "save" or "load" them."""
        super().__init__()
        self._choose, self._wanted, self._command = choose, wanted, command
        self.found: tuple[FoundLogger, ...] = ()
        self._all: list[FoundLogger] = []
        self.answers: dict[str, str] = {}  # by key, of the last command for many
        self._starting = False
        self._saved = ""  # what was saved here, and the key that lists it; empty until it was looked for

    def on_mount(self) -> None:
        run_aside(self, "saved", self._look_for_saved)

    def above(self) -> ComposeResult:
        yield Static("silo", id="loggers-title", markup=False)

    def take(
        self, found: Sequence[FoundLogger], forbidden: Sequence[str], problem: str = "", *, starting: bool = False
    ) -> None:
        """Show what was found; `starting`: the demo is on its way."""
        self.found, self._starting = tuple(found), starting
        saved = "" if found or starting else self._saved
        waiting = WAITING.format(demo=key_of("demo"), quit=key_of("quit"), saved=saved)
        advice = f"{STARTING} {OTHERS}" if starting and found else STARTING if starting else "" if found else waiting
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
            advice = f"Waiting for the logger {self._wanted!r}: it doesn't run{no_file}.\n\n{waiting}"
        # what went wrong stands above what one could do
        self._notes = ("\n" if found else "\n\n").join(filter(None, [problem, advice, *forbidden]))
        self.show()

    async def _look_for_saved(self) -> None:
        """Look in a thread, as 5,000 logs take 0.2 s; what is told of loggers, every second, has it then."""
        for folder, where in FOLDERS.items():
            with suppress(SiloError, OSError):
                names = [path.name for path in (await asyncio.to_thread(find_logs, ".", folder))[::-1]]
                self._saved = f"Saved in {where}: {and_more(names, 2)}; {key_of('runs', last=True)} lists them.\n\n"
                return

    def show(self) -> None:
        self._all = [replace(one, answer=self.answers.get(one.key, "")) for one in self.found]
        super().show()
        if self.is_there:
            title = f"silo  {fleet.total(self._all)}" if self._all else "silo"
            self.query_one("#loggers-title", Static).update(title)

    @property
    def all(self) -> Sequence[FoundLogger]:
        return self._all

    def label_now(self, command: Command) -> str:
        """Return it; all of the menu of edits is about loggers, and what is asked of many about those that can be."""
        nobody = self.chosen is None if command.id == "menu_edit" else command.does == "many" and self._why_none()
        return "" if nobody else super().label_now(command)

    def why_not_now(self, command_id: str) -> str:
        why = super().why_not_now(command_id)
        return why or (self._why_none() if BY_ID[command_id].does == "many" else "")

    def _why_none(self) -> str:
        """Why none of those that are marked, or the one under the cursor, can be asked."""
        meant = set(self.marks.meant(self.shown_keys, self.chosen_key))
        targets = [one for one in self.shown if one.key in meant]
        return fleet.why_none(targets, key_of("look_again")) if targets else ""

    def key_of(self, one: FoundLogger) -> str:
        return one.key

    def stands_by(self, one: FoundLogger) -> str:
        """Return its key, and whether it is there: one that is lost comes up."""
        return f"{one.key} {one.member.here}"

    @property
    def _open_key(self) -> str:
        """The key of the logger that is open; empty where none is."""
        session = self.context.logger_session
        return session.link.logger_key if session is not None and session.link is not None else ""

    def follow(self, known: str, place: int | None) -> int | None:
        """Return it; the list begins with the logger that is open, and on none of others while one's own starts."""
        if place is None and self._starting:
            return None
        begins = place is None and self._open_key in self.shown_keys
        return self.shown_keys.index(self._open_key) if begins else super().follow(known, place)

    def prepare(self, found: Sequence[FoundLogger], width: int) -> None:
        self._names = fleet.name_width(found, width)
        self._addresses = tuple(one.address for one in found)
        self._now = time.monotonic(), time.time_ns()

    def head(self, width: int) -> str:
        return fleet.head(self._names, width)

    def advice(self) -> str:
        return "\n".join(filter(None, [self._notes, *fleet.down(self._all, *self._now), super().advice()]))

    def about(self, one: FoundLogger) -> str:
        """Return it; of the logger that is open why it died in full, which all are told in short."""
        words, session = fleet.details(one), self.context.logger_session
        short = Summary.of(session.status).reason if session is not None else ""
        words = words.replace(short, session.status.reason) if session is not None and short else words
        above = " ".join(self._notes.split())  # nothing is told twice
        between = ListLine.BETWEEN
        return between.join(part for part in words.split(between) if part not in above)

    def named(self, key: str) -> str:
        return next((one.address for one in self._all if one.key == key), "what was there")

    def told(self, one: FoundLogger) -> str:
        return fleet.told(one)

    def row_of(self, one: FoundLogger, width: int) -> Text:
        variables, member = self.app.theme_variables, one.member
        row = fleet.row(one, self._names, width, *self._now, self._addresses, is_open=one.key == self._open_key)
        line = Text(row)
        if not member.here:
            line.stylize("dim")
        name = fleet.ROLE.get(member.stands, "success" if member.running else "")
        begin = row.find(fleet.STATES.get(member.word, member.word))
        if name and begin >= 0:
            line.stylize(bold(variables, name), begin, begin + fleet.STATE_WIDTH)
        if name and member.sign and not one.answer and (at := row.find(f" {member.sign}", begin)) >= 0:
            line.stylize(bold(variables, name), at, at + 6)
        return line

    def command_open_logger(self) -> None:
        for one in self.found:
            if one.key == self.chosen_key:
                if one.member.here:
                    self._choose(one)
                else:
                    self.say(
                        f"{one.address} is not there any more; {key_of('look_again')} looks again, {key_of('runs')} "
                        "lists the runs of a folder"
                    )

    enter = command_open_logger

    def forget(self) -> bool:
        if self.answers:
            self.answers = {}
            return True
        return super().forget()

    def leave(self) -> None:
        """Leave the list for the logger that is open, if one is."""
        self.context.back_to_table()

    # ------------------------------------------------------------------------------------------------- many at once

    def command_many(self, what: str) -> None:
        none = "the filter leaves out any logger: Esc ends it; nothing was asked" if self.asked else "no logger is here"
        targets = self.targets(none)
        if targets and self._command is not None:
            self._command(what, targets)

"""What happened: the event log of a logger, or of a file, newest first; Enter goes there in the plots."""

import asyncio
import math
import re
import time
from collections.abc import Sequence

from rich.text import Text

from silo.core.elements import BufferType, LoggedEvent
from silo.core.quantities.writing import many
from silo.recordings.requests import SavedRecording
from silo_tui.actions import Command, key_of
from silo_tui.modal import run_alone, run_aside
from silo_tui.model.lists import happened as rows
from silo_tui.model.lists.conditions import MOST_PLOTS, named_in
from silo_tui.model.lists.ordering import arranged
from silo_tui.model.table.fields import Field
from silo_tui.model.words.paths import typed_file
from silo_tui.screens.dialogs.exporting import write_whole
from silo_tui.screens.dialogs.questions import Prompt, ask_line
from silo_tui.screens.lists.list_screen import LoggerList
from silo_tui.screens.plots.monitor import MonitorScreen
from silo_tui.sessions.live import LiveSource, Session
from silo_tui.widgets.lines import Lines

HELD_S = 5.0  # so often it is asked what the buffers hold
GONE = "×"  # of whose moment no rows are held


class EventsScreen(LoggerList[LoggedEvent]):
    """A list of lines that shows the newest ones until one moves in it."""

    scope = "events"
    orders = rows.ORDERS
    filter_hint = "-E without edits, M marks alone, other words"

    def __init__(self, session: Session) -> None:
        super().__init__(session)
        self.scope = "events" if session.at_s is None else "file_events"
        self._following = True
        self._known: Sequence[LoggedEvent] = ()
        self._all: Sequence[LoggedEvent] = ()  # in the order of time
        self._folded: Sequence[LoggedEvent] = ()
        self._long: tuple[str, ...] = ()
        self._run = ""  # the present one
        self._asked_s = 0.0  # when it was asked what the buffers hold
        self._buffers_s: dict[str, float] = {}  # how long they hold what an event is about, known since then
        self._saved: Sequence[SavedRecording] = ()
        self._files = -1  # events of files, when it was asked what is saved

    def begin(self) -> None:
        """Ask what the buffers still hold."""
        self._ask_held()

    def second_passed(self) -> None:
        super().second_passed()
        if time.monotonic() - self._asked_s >= HELD_S:
            self._ask_held()

    def _ask_held(self) -> None:
        self._asked_s = time.monotonic()
        self._buffers_s = {}
        if self.session.at_s is None and self.session.fresh:
            run_alone(self, "held", self._read_held)

    async def _read_held(self) -> None:
        await self.context.quietly(self.session.refresh_status())
        files = sum(one.kind in rows.WRITTEN for one in self._known)
        if files != self._files:
            self._files = files
            await self.context.quietly(self._read_saved())
        self.show()

    async def _read_saved(self) -> None:
        found, own = (await self.session.recordings()).recordings, self.session.status.logger
        self._saved = [one for one in found if one.logger == own or one.why.startswith(rows.RECORDED)]

    def _is_gone(self, one: LoggedEvent) -> bool:
        """Whether the rows of its moment are surely held no more: of another run, or older than all in the buffers of
        what a plot of it would show, or in any where that is nothing.

        What a plot below holds beside them is there.
        """
        session = self.session
        if session.at_s is not None or not session.fresh or not one.at_ns or one.tick < 0:
            return False
        if one.run and one.run != self._run:
            return True
        # what a buffer loses it loses while the list is read, whatever was asked last
        status, held_s = session.status, self._holds_s(one)
        oldest_ns = status.last_tick_ns - round(status.held_s * 1e9)
        if held_s < math.inf:
            oldest_ns = max(oldest_ns, LiveSource(session).end_ns - round(held_s * 1e9))
        plots = self._plots_below
        if plots is not None and plots.window.paused:
            oldest_ns = min(oldest_ns, plots.held_ns[0])
        return bool(status.last_tick_ns) and one.at_ns < oldest_ns

    def _holds_s(self, one: LoggedEvent) -> float:
        """Return how long the buffers hold one of the signals that show an event; without end for none."""
        about = one.text.split(" ", 1)[0] if one.kind in rows.LIMITS else one.text
        if about not in self._buffers_s:
            names = self._names_in(about) or self._plotted or self._chosen_names()[:MOST_PLOTS]
            self._buffers_s[about] = max(map(self._buffer_s, names), default=math.inf)
        return self._buffers_s[about]

    def _buffer_s(self, name: str) -> float:
        """Return how long the buffer of an element is, of what is derived the shortest that it is computed from."""
        table, rate_hz = self.session.table, self.session.rate_hz
        if (row := table.row(name)) is None:  # plots below may be of elements that a new program doesn't have
            return math.inf
        if expression := table.elements[row].expression:
            sources = named_in(expression, table.elements, table.prefix)
            return min(map(self._buffer_s, sources), default=math.inf)
        options = table.server[:, row]
        loops = options[Field.BUFFER] == BufferType.LOOPING and rate_hz > 0
        return float(options[Field.SIZE] * options[Field.DIVIDER]) / rate_hz if loops else math.inf

    @property
    def _plots_below(self) -> MonitorScreen | None:
        """The plots of the logger that stand below."""
        stack = [each for each in self.app.screen_stack if isinstance(each, MonitorScreen)]
        return next((each for each in reversed(stack) if each.session is self.session), None)

    @property
    def _plotted(self) -> list[str]:
        """The elements that the plots below show."""
        return [each.element.name for each in self._plots_below.stack.plots] if self._plots_below is not None else []

    def label_now(self, command: Command) -> str:
        """Return it; nowhere to go to where the rows are gone."""
        gone = command.id == "go_to_event" and (one := self.chosen) is not None and self._is_gone(one)
        return "" if gone else super().label_now(command)

    def status_changed(self) -> None:
        """Follow state and link, and take in what happened since."""
        self.show_bars()
        if self.session.happened is not self._known:
            self.show()

    @property
    def all(self) -> Sequence[LoggedEvent]:
        return self._all if self.asked else self._folded  # who looks for one finds each

    def show(self) -> None:
        self._known = self.session.happened
        self._all = rows.in_time(self._known)
        self._folded = rows.folded(self._all)
        self._run = next((one.run for one in rows.of_last_run(self._known)), "")
        self._long = rows.long_words(self._all, self.session.told)
        super().show()

    def key_of(self, one: LoggedEvent) -> str:
        return f"{one.run} {one.number} {'folded' if one.times > 1 else f'{one.time_ns} {one.kind} {one.text}'}"

    def stands_by(self, one: LoggedEvent) -> str:
        """Return what it is known by, and when it was: a line of several goes up as another one comes."""
        return f"{self.key_of(one)} {one.at_ns} {one.clock_ns}"

    def row_of(self, one: LoggedEvent, width: int) -> Text:
        shown = Text(rows.line(one, self.told(one), width - 2, self.session.status.logger, self._long))
        if rows.letter(one) in "MTX":
            shown.stylize("bold")
        if self._is_gone(one):
            shown = Text.assemble(shown[:1], GONE, shown[2:])
            shown.stylize("dim")
        return shown

    def passes(self, one: LoggedEvent) -> bool:
        return rows.matches(one, self.asked, self.told(one))

    def told(self, one: LoggedEvent) -> str:
        return rows.words(one, self.session.told)

    def head(self, width: int) -> str:
        signs = f"   {GONE} no longer in memory" if any(map(self._is_gone, self.shown)) else ""
        begin = f"  time                tick what it was{signs}"
        return f"{begin:<{width - 5}}who" if any(map(self._who, self.shown)) else begin

    def _who(self, one: LoggedEvent) -> str:
        return rows.who_did(one, self.session.status.logger)

    def going_on(self) -> Sequence[str]:
        count = many(len(self._all), "event")
        if len(self._folded) < len(self._all) and not self.asked:
            count += f" in {many(len(self._folded), 'line')} ({key_of('list_filter')} shows each)"
        follows = ", follows" if self._following else f", {key_of('list_top')} follows"
        follows *= self.session.at_s is None  # nothing comes to a file
        one = self.chosen
        kind = rows.NAMES.get(rows.letter(one), "") if one is not None else ""
        told = "" if one is None else self.told(one)  # whole: its line may have no room for it
        told = f"{rows.letter(one)} {kind}: {told}" if one is not None and kind else told
        told += f", by {who}" if one is not None and (who := self._who(one)) else ""
        if one is not None and self._is_gone(one):
            told = f"{told} │ {GONE} {rows.gone_words(one, self._known, self._saved)}"
        return [told, f"{count}{follows}" if self.all else "nothing happened yet"]

    def follow(self, known: str, place: int | None) -> int | None:
        """Stay with its event, above which others come; from the end of the screen go to the newest."""
        at = super().follow(known, place)
        self.lines.stays_at_top = self._following
        return 0 if self._following and at is not None and at >= self.lines.size.height > 0 else at

    # --------------------------------------------------------------------------------------------------- commands

    def move(self, place: int) -> None:
        self._following = False
        super().move(place)

    def on_lines_cursor_moved(self, event: Lines.CursorMoved) -> None:
        """Follow no longer where the mouse chose an older line."""
        self._following = self._following and not self.lines.highlighted
        super().on_lines_cursor_moved(event)

    def command_list_top(self) -> None:
        super().command_list_top()
        self._following = True
        self.show()

    def command_step_event(self, step: int) -> None:
        self.command_list_step(-step)

    def command_list_read(self) -> None:
        run_alone(self, "events", self._read_again)

    async def _read_again(self) -> None:
        await self.context.quietly(self.session.learn_events())
        self.show()
        self.say("read again")

    def command_write_events(self) -> None:
        if not self.shown:
            self.say("nothing to write: no event is shown")
            return
        each = arranged([*filter(self.passes, self._all)], self._order, turned=self._turned)  # of one line, too
        body = f"{many(len(each), 'event')} as {'filtered' if self.asked else 'shown'}, to a CSV file."
        prompt = Prompt("Write the events to a file on this machine", body, "events.csv", label="file")
        ask_line(self, prompt, lambda given: run_aside(self, "writing", self._written, given, each))

    async def _written(self, given: str, shown: Sequence[LoggedEvent]) -> None:
        with self.context.telling():
            path = typed_file("the file of events", given, ".csv")
            await asyncio.to_thread(lambda: write_whole(path, rows.csv_text(shown).encode("utf-8", "backslashreplace")))
            self.context.say(f"{many(len(shown), 'event')} written: {path.absolute()}")

    def command_go_to_event(self) -> None:
        event = self.here()
        if event is None:
            return
        if not event.at_ns or event.tick < 0:
            self.say("this happened before the first tick: no place in the plots")
            return
        if self._is_gone(event):
            gone = rows.gone_words(event, self._known, self._saved)
            self.say(f"no plot has it: {gone}; {key_of('recordings')} lists what is saved")
            return
        named, plots = self._named(event), self._plots_below
        if plots is not None and named and not {*self._plotted} & {*named}:
            plots = None  # that of another signal would be taken for the one that this is about
        if plots is not None:
            while self.app.screen is not plots:
                self.app.pop_screen()
        elif names := (named or self._chosen_names())[:MOST_PLOTS]:
            plots = MonitorScreen(self.session, names)
            plots.came_at_moment = True
            self.app.push_screen(plots)
        else:
            self.say("no plots are open, and this is about no signal that has samples")
            return
        plots.call_after_refresh(plots.search.jump_to_event, event)

    enter = command_go_to_event

    def _named(self, event: LoggedEvent) -> list[str]:
        """Return the elements that it or its trigger names."""
        return self._names_in(event.text)

    def _names_in(self, told: str) -> list[str]:
        session, words_of_it = self.session, re.split(r"[\s,;'\"()]+", told)
        table, named = session.table, [one.options.when for one in session.triggers if one.options.name in words_of_it]
        named += [word for word in words_of_it if word.startswith("/")]
        found = [name for each in named for name in named_in(each, table.elements, table.prefix)]
        return list(dict.fromkeys(found))

    def _chosen_names(self) -> list[str]:
        """Return the elements that are marked in the table, or under the cursor there."""
        return [self.session.table.names[row] for row in self.session.rows.targets()]

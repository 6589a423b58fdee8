# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The monitor: stacked plots of some elements, live or standing still, with a cursor that reads values.

What it shows comes from a `PlotSource`, so that a recording can stand in for a live logger.
"""

import asyncio
from collections.abc import Sequence
from functools import cached_property
from typing import ClassVar

from textual import events as textual_events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.message import Message
from textual.timer import Timer

from silo.core.elements import TriggerOptions
from silo.core.quantities.writing import many
from silo.errors import SiloError
from silo.rpc.frames import Frame
from silo_tui.actions import bindings_for
from silo_tui.modal import run_alone, run_aside
from silo_tui.model import text
from silo_tui.model.columns import ColumnStore
from silo_tui.model.command_line import BY_KEY, Spelled
from silo_tui.model.find import Search, What, places_of
from silo_tui.model.overlay import SIGN
from silo_tui.model.plots import SECOND_NS, PlotWindow, plots_of
from silo_tui.model.scope import Scope, fitting_span, halfway
from silo_tui.model.source import PlotSource
from silo_tui.screens.finding import value_words
from silo_tui.screens.pausing import Pausing
from silo_tui.screens.standing import value_here
from silo_tui.sessions.link import ViewRequest
from silo_tui.sessions.live import Session
from silo_tui.sessions.pause import Pause
from silo_tui.widgets.bars import Banner, KeyBar, MonitorLine, StatusBar, left_a_file
from silo_tui.widgets.between import BetweenTable
from silo_tui.widgets.plot_stack import PlotStack

DEBOUNCE_S = 0.1


class MonitorScreen(Pausing):
    """Plots of the elements that were marked when it was opened."""

    class OpenLeft(Message):
        """The file that a dead robot left is to be opened, with plots of these elements."""

        def __init__(self, names: Sequence[str]) -> None:
            super().__init__()
            self.names = names

    scope = "monitor"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("monitor")

    def __init__(self, session: Session, source: PlotSource, names: Sequence[str], chosen: str = "") -> None:
        super().__init__()
        self.session = session
        self.source = source
        self._waiting: list[str] = []  # elements that are off, left out until they are on
        if any(source.is_live(name) for name in names):
            self._waiting = [name for name in names if not source.is_live(name)]
        shown = [name for name in names if name not in set(self._waiting)]
        elements = [element for name in shown if (element := source.element(name)) is not None]
        self.window = PlotWindow()
        self.stack = PlotStack(plots_of(elements), self.window, source)
        self.stack.ended = session.dead
        places = [place for place, plotted in enumerate(self.stack.plots) if plotted.element.name == chosen]
        self.stack.chosen = places[0] if places else 0
        self.stack.prefix = session.status.prefix.rstrip("/")
        self._said = ""
        self._asked = self.stack.store  # where the live columns should go
        self._mending = False
        self._happened = session.happened
        self._timer: Timer | None = None
        self._live = source
        self.between = BetweenTable()
        self.pause = Pause(session, source, self._more_is_here)

    def compose(self) -> ComposeResult:
        """Yield status, banner, plots, line of facts, keys."""
        yield self.status_bar
        yield self.banner
        yield self.stack
        yield self.between
        yield self.line
        yield KeyBar(self.scope)

    @cached_property
    def _bars(self) -> tuple[StatusBar, Banner, MonitorLine]:
        return self.bars()  # a key may come before they are on the screen

    @property
    def status_bar(self) -> StatusBar:
        """The line on top."""
        return self._bars[0]

    @property
    def banner(self) -> Banner:
        """What is the matter, below it."""
        return self._bars[1]

    @property
    def line(self) -> MonitorLine:
        """Facts, below the plots."""
        return self._bars[2]

    def bars(self) -> tuple[StatusBar, Banner, MonitorLine]:
        """Return the lines around the plots."""
        line = MonitorLine(self.window, self._words, self._state)
        return StatusBar(self.session, read_only=False), Banner(self.session), line

    def on_mount(self) -> None:
        """Show at once; history fills the plots."""
        self.banner.update()
        if not self.source.live and not self.window.paused:
            self.window.paused_end_ns = self.source.end_ns

    def on_unmount(self) -> None:
        """Let go of what is held."""
        self.let_go()  # Textual calls the handlers of all classes

    def let_go(self) -> None:
        """Let go of what is held."""
        self.pause.release()

    def on_resize(self, event: textual_events.Resize) -> None:
        """Show other columns for another width."""
        self.call_after_refresh(self._sized)

    def _sized(self) -> None:
        self.stack.choose(self.stack.chosen)
        self.fill_soon()

    # ---------------------------------------------------------------------------------------------------- data

    def fill_soon(self) -> None:
        """Request view and history anew, when what is wanted has settled."""
        if self._timer is not None:
            self._timer.stop()
        self._timer = self.set_timer(DEBOUNCE_S, self.request_view)

    def request_view(self) -> None:
        """Say what is on the screen and fetches its past."""
        if self.context.upper_screen is not self:
            return
        plots = [plotted for plotted in self.stack.on_screen() if self.source.is_live(plotted.element.name)]
        names = [plotted.name for plotted in plots if plotted.numeric]
        columns = self.stack.columns
        store = ColumnStore(names, columns, self.window.column_ns(columns))
        if self.window.paused:
            self.session.columns = ColumnStore((), 1, 1)
            if self.pause.source is not None:
                run_alone(self, "look", self._look)
        else:
            store.adopt(self.stack.store)
            elements = dict.fromkeys(plotted.element.name for plotted in self.stack.on_screen())
            self.session.columns = self._asked = store
            self.session.watch(ViewRequest(tuple(elements), tuple(names), store.column_ns))
        run_alone(self, "history", self._fill, store, names)

    async def _fill(self, store: ColumnStore, names: list[str]) -> None:
        start, end = self._shown_ns
        if self.pause.source is not None:  # at once what is here
            store.advance_to(end // store.column_ns + 1)
            store.take(self.pause.source.columns(names, start, end, store.column_ns))
            self.stack.store = store
            self.stack.redraw()
        try:
            past = await self.source.history(names, start, end, store.column_ns)
            store.advance_to(end // store.column_ns + 1)
            store.take(past)
        except SiloError as error:
            self.say(f"no history: {error}")
        self._mending = False
        if store is not self._asked and not self.window.paused:
            return  # another one was asked for meanwhile
        await self._fill_ghost(store)
        self.stack.store = store
        await self._fill_texts(end)
        self._show_moment()

    async def _fill_ghost(self, store: ColumnStore) -> None:
        """Read what a saved run had in this window, and in the next one: the live one goes on."""
        overlay, began_ns = self.session.overlay, self.session.status.started_ns
        if overlay is None or not began_ns or not store.names:
            self.stack.ghost = None
            return
        first = store.end - self.stack.columns
        self.stack.ghost = await asyncio.to_thread(
            overlay.columns, store.names, first, 2 * self.stack.columns, store.column_ns, began_ns
        )

    async def _fill_texts(self, end_ns: int) -> None:
        """Read since when which text held."""
        for plotted in self.stack.on_screen():
            if plotted.numeric:
                continue
            try:
                time_ns, values = await self.source.samples(plotted.name, end_ns - 2 * self.window.span_ns, end_ns)
            except SiloError:
                continue  # a live one that gives no samples now: its newest text stands there
            changes = await asyncio.to_thread(places_of, Search(What.CHANGE), time_ns, values, 1)
            begins = [0, *changes.tolist()] if len(values) else []
            self.stack.events[plotted.name] = [
                (int(time_ns[at]), value_words(plotted.entry, values[at : at + 1])) for at in begins
            ]

    # ------------------------------------------------------------------------------------ what the app tells us

    def live_changed(self, frame: Frame) -> None:
        """Show new columns and values."""
        self.status_bar.update()
        if not self.window.paused:  # else what is shown is of what stands still
            self.stack.readings = self.session.live.readings
            self.stack.bounds = self.session.bounds
            self._take_texts(frame)
            if self.session.running and not self.stack.store.empty:
                self.stack.store.advance_to(frame.time_ns // self.stack.store.column_ns + 1)
            self.stack.advance()
            if self.stack.ghost is not None and self.stack.ghost.end < self.stack.store.end:
                run_alone(self, "ghost", self._fill_ghost, self.stack.store)
            if self.session.columns is self._asked and self._asked.gapped and not self._mending:
                self._mending = True  # frames got lost on their way: the logger still has what was in them
                run_aside(self, "history", self._fill, self._asked, list(self._asked.names))

    def _take_texts(self, frame: Frame) -> None:
        """Note texts that changed."""
        for plotted in self.stack.plots:
            reading = None if plotted.numeric else self.stack.readings.get(plotted.element.name)
            if reading is None or plotted.position not in reading.texts:
                continue
            events, word = self.stack.events.setdefault(plotted.name, []), reading.texts[plotted.position]
            if not events or events[-1][1] != word:
                events.append((frame.time_ns, word))

    def action_command(self, command_id: str, typed: Spelled = BY_KEY) -> None:
        """Do what a key asks for; of a dead robot that left a file, Enter opens that, with the same plots."""
        if command_id == "detail" and left_a_file(self.session):
            names = list(dict.fromkeys(plotted.element.name for plotted in self.stack.plots))
            self.post_message(self.OpenLeft(names))
            return
        super().action_command(command_id, typed)

    def status_changed(self) -> None:
        """Follow a change of state or link."""
        self.status_bar.update()
        self.banner.update()
        self.line.refresh()  # it says whether they are live
        if (self.stack.fresh, self.stack.ended) != (self.session.fresh, self.session.dead):
            self.stack.fresh, self.stack.ended = self.session.fresh, self.session.dead
            self.stack.redraw()
        if self.session.happened is not self._happened:  # its letter stands on the axis, also while nothing moves
            self._happened = self.session.happened
            self.stack.redraw()
        if not self.window.paused and self.session.columns is not self._asked:
            self.fill_soon()  # it was started again

    def table_changed(self) -> None:
        """Follow somebody who enabled what is plotted."""
        elements = dict.fromkeys(plotted.element.name for plotted in self.stack.plots)
        published = [name for name in self._waiting if self.source.is_live(name)]
        self._waiting = [name for name in self._waiting if name not in published]
        elements.update(dict.fromkeys(published))
        found = [element for name in elements if (element := self.source.element(name)) is not None]
        wanted = {plotted.name for plotted in self.stack.plots}
        plots = [each for each in plots_of(found) if each.name in wanted or each.element.name in published]
        if plots != self.stack.plots:
            self.stack.keep(plots)
            self.fill_soon()

    def second_passed(self) -> None:
        """Paint the times again."""
        self.status_bar.mode = self.pause.head
        self.status_bar.update()
        self.banner.update()

    def say(self, words: str) -> None:
        """Show the result of something."""
        self._said = words
        self.line.refresh()

    def _words(self) -> Sequence[str]:
        """Return what the line tells, the newest last: that is read whole."""
        words = [self.pause.text] if self.pause.text else []
        if self.window.paused and self.window.at_ns is not None:
            words.append(f"A {self.moment_words(self.window.at_ns)}")
        elif self.window.cursor is not None:
            back = self.window.cursor * self.stack.store.column_ns / 1e9
            words.append(f"cursor at -{text.span(back)}" if back else "cursor at 0 s")
        total, fitting = len(self.stack.panels), self.stack.fitting
        if total > fitting:
            words.append(f"plots {self.stack.first + 1}-{min(total, self.stack.first + fitting)} of {total}")
        if self.session.overlay is not None:
            words.append(f"{SIGN} {self.session.overlay.name}{self._ghost_words()}")
        ended = self.session.dead and not self.window.paused  # the line says DEAD: nothing comes any more
        if missing := "" if ended else self.stack.missing():
            words.append(missing)
        if self._waiting and not self._said:
            words.append(f"{many(len(self._waiting), 'element')} off")
        if self._said:
            words.append(self._said)
        return words

    def _ghost_words(self) -> str:
        """Where the saved run is, if it isn't on the screen."""
        ghost, overlay = self.stack.ghost, self.session.overlay
        if ghost is None or overlay is None or any(self.stack.has_ghost(panel) for panel in self.stack.panels):
            return ""
        return f": {overlay.extent}"

    # --------------------------------------------------------------------------------------------------- commands

    def _choose(self, index: int) -> None:
        if self.stack.choose(index):
            self.fill_soon()
        self.line.refresh()

    def command_plot_down(self) -> None:
        self._choose(self.stack.chosen + 1)

    def command_plot_up(self) -> None:
        self._choose(self.stack.chosen - 1)

    def command_plot_top(self) -> None:
        self._choose(0)

    def command_plot_bottom(self) -> None:
        self._choose(len(self.stack.plots) - 1)

    def _state(self) -> str:
        if self.pause.source is not None or not self._live.live:
            return "PAUSED"
        if self.window.paused_end_ns is None:
            return "DEAD" if self.session.dead else "live" if self.session.connected else "no link"
        return f"-{text.span(max(0, self.source.end_ns - self.window.paused_end_ns) / SECOND_NS)}, End: now"

    def on_plot_stack_pointed(self, event: PlotStack.Pointed) -> None:
        """Choose the plot that was clicked, and put the cursor there."""
        self._choose(event.index)
        if event.column is not None:
            self._point_at(event.column)
        self.line.refresh()
        self.update_keys()

    def on_plot_stack_wheeled(self, event: PlotStack.Wheeled) -> None:
        """Do what the keys for it do."""
        names = ("closer", "wider") if event.zooms else ("plot_up", "plot_down")
        self.action_command(names[event.step > 0])

    def command_catch(self) -> None:
        """Let crossings of the chosen signal stand still: at the level of the cursor, else halfway."""
        from silo_tui.screens.scope import ScopeScreen

        chosen, panel = self.stack.chosen_plot, self.stack.panels[self.stack.chosen_panel]
        if not chosen.numeric or not self._live.is_live(chosen.element.name):
            self.say("the scope needs a signal of numbers that is on")
            return
        low, high = self.stack.span_of(chosen)
        at_cursor = (
            value_here(chosen, self.stack.readings) if self.window.paused and self.window.cursor is not None else ""
        )
        level = float(at_cursor) if at_cursor else halfway(low, high)
        plots = [chosen, *(each for each in panel if each != chosen and each.numeric)]
        settings = Scope(level, span_s=fitting_span(self._live.period_ns(chosen.element.name)))
        self.app.push_screen(ScopeScreen(self.session, self._live, plots, settings))

    def command_plot_trigger(self) -> None:
        if not self.stack.plots or not self.stack.chosen_plot.numeric:
            self.say("a trigger needs a signal of numbers")
            return
        self.context.run_flow(self._ask_trigger())

    async def _ask_trigger(self) -> None:
        from silo_tui.screens.trigger_editor import ask_trigger

        name = self._short(self.stack.chosen_plot.name).lstrip("/")
        level = value_here(self.stack.chosen_plot, await self._readings_here()) or "0"
        made = TriggerOptions(name.rpartition("/")[2], f"{name} > {level}", 1.0, 1.0)
        await ask_trigger(self.context, made)

    def command_zero(self) -> None:
        run_aside(self, "zero", self._zero)

    async def _zero(self) -> None:
        try:
            await self.session.survey((), (), reset=True)
        except SiloError as error:
            self.say(str(error))
            return
        self.say("statistics of the table from now on")

    def mode_keys(self) -> Sequence[tuple[str, str]]:
        """Return what a pause or a cursor asks for."""
        live = self._live.live  # what is held stands still, of a logger that goes on
        paused = (("pause", "Go on"),) if self.window.paused and live else ()
        back = "No cursor" if self.window.cursor is not None else "Live" if self.window.paused and live else ""
        return (*paused, ("cursor_left", "Cursor"), ("back", back)) if back else paused

    def command_back(self) -> None:
        """Leave cursor B, then the cursor, then the pause, then the screen."""
        if self.window.other_ns is not None:
            self.command_cursor_b()
        elif self.window.cursor is not None:
            self.window.cursor = self._at_ns = None
            self.stack.redraw()
            self.line.refresh()
        elif self.window.paused and self.pause.possible:
            self._go_on()
        else:
            self.context.leave_screen()

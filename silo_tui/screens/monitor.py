# ruff: noqa: D102 - what a command does stands in actions.py, once
"""The monitor: stacked plots of some elements, live or standing still, with cursors that read values.

They stand still because of a pause, because one looks back, or because they are of a file: then the window goes over
all that is held and cursor A is a moment of it. What is shown comes from a `PlotSource`, live or a recording.
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
from silo.expressions.span import Between
from silo.rpc.frames import Frame
from silo_tui.actions import bindings_for
from silo_tui.context import SiloScreen
from silo_tui.modal import run_alone, run_aside
from silo_tui.model import text
from silo_tui.model.columns import ColumnStore
from silo_tui.model.command_line import BY_KEY, Spelled
from silo_tui.model.find import Search, What, places_of
from silo_tui.model.overlay import SIGN
from silo_tui.model.plots import Plotted, plots_of
from silo_tui.model.scope import Scope, fitting_span, halfway
from silo_tui.model.source import PlotSource
from silo_tui.model.window import SECOND_NS, PlotWindow
from silo_tui.screens.arranging import Arranger
from silo_tui.screens.exporting import ask_export
from silo_tui.screens.finding import value_words
from silo_tui.screens.pausing import Holder
from silo_tui.screens.searching import Finder, value_here
from silo_tui.sessions.link import ViewRequest
from silo_tui.sessions.live import Session
from silo_tui.sessions.pause import Pause
from silo_tui.sessions.recorded import FileSession, clock
from silo_tui.widgets.bars import Banner, KeyBar, MonitorLine, StatusBar, left_a_file
from silo_tui.widgets.between import BetweenTable
from silo_tui.widgets.plot_stack import PlotStack
from silo_tui.widgets.recorded import RecordedStack

DEBOUNCE_S = 0.1
FAR = 10


class MonitorScreen(SiloScreen):
    """Plots of the elements that were marked when it was opened."""

    class OpenLeft(Message):
        """The file that a dead robot left is to be opened, with plots of these elements."""

        def __init__(self, names: Sequence[str]) -> None:
            super().__init__()
            self.names = names

    scope = "monitor"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("monitor")
    PARTS = (Finder, Holder, Arranger)

    def __init__(self, session: Session, source: PlotSource, names: Sequence[str], chosen: str = "") -> None:
        super().__init__()
        self.session = session
        self.file = session if isinstance(session, FileSession) else None
        self.source = source
        self._waiting: list[str] = []  # elements that are off, left out until they are on
        if any(source.is_live(name) for name in names):
            self._waiting = [name for name in names if not source.is_live(name)]
        shown = [name for name in names if name not in set(self._waiting)]
        elements = [element for name in shown if (element := source.element(name)) is not None]
        self.window = PlotWindow() if self.file is None else self.file.window_of(names)
        self.stack = self.new_stack(plots_of(elements))
        self.stack.ended = session.dead
        places = [place for place, plotted in enumerate(self.stack.plots) if plotted.element.name == chosen]
        self.stack.chosen = places[0] if places else 0
        self._said = ""
        self._asked = self.stack.store  # where the live columns should go
        self._mending = False
        self._happened = session.happened
        self._timer: Timer | None = None
        self.live_source = source  # what it shows when nothing is held
        self.between = BetweenTable()
        self.pause = Pause(session, source, self.more_is_here)
        self.parts = self.finder, self.holder, self.arranger = Finder(self), Holder(self), Arranger(self)

    def new_stack(self, plots: list[Plotted]) -> PlotStack:
        """Return the widget that draws these."""
        if self.file is not None:
            return RecordedStack(self.file, plots, self.window)
        stack = PlotStack(plots, self.window, self.source)
        stack.prefix = self.session.status.prefix.rstrip("/")
        return stack

    def compose(self) -> ComposeResult:
        """Yield status, banner, plots, line of facts, keys."""
        yield self.status_bar
        yield self.banner
        yield self.stack
        yield self.between
        yield self.line
        yield KeyBar(self.scope)

    @cached_property
    def status_bar(self) -> StatusBar:
        """The line on top."""
        return StatusBar(self.session, read_only=False)

    @cached_property
    def banner(self) -> Banner:
        """What is the matter, below it."""
        return Banner(self.session)

    @cached_property
    def line(self) -> MonitorLine:
        """Facts, below the plots."""
        return MonitorLine(self.window, self._words, self._state if self.file is None else None)

    def on_mount(self) -> None:
        """Show at once; history fills the plots."""
        self.banner.update()

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
                run_alone(self, "look", self.holder.look)
        else:
            store.adopt(self.stack.store)
            elements = dict.fromkeys(plotted.element.name for plotted in self.stack.on_screen())
            self.session.columns = self._asked = store
            self.session.watch(ViewRequest(tuple(elements), tuple(names), store.column_ns))
        run_alone(self, "history", self._fill, store, names)

    async def _fill(self, store: ColumnStore, names: list[str]) -> None:
        start, end = self.shown_ns
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
        self.moved(elsewhere=False)

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
        if self.file is not None:
            clock = f" ({self.file.clock})" if self.file.clock and self.size.width >= 100 else ""
            words.append(f"cursor at {self.file.seconds:.9g} s{clock}")
        elif self.window.paused and self.window.at_ns is not None:
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
        if missing := "" if ended or self.file is not None else self.stack.missing():
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

    # ------------------------------------------------------------------------------------------------- the window

    @property
    def held_ns(self) -> tuple[int, int]:
        """The oldest and the newest moment that one can look at."""
        return self.pause.held_ns(self.stack.plots)

    @property
    def end_ns(self) -> int:
        """The moment at the right edge of the window."""
        end = self.window.paused_end_ns
        return self.source.end_ns if end is None else end

    @property
    def now_ns(self) -> int:
        """Where one looks: cursor A, or the right edge of the window."""
        return self.end_ns if self.window.at_ns is None else self.window.at_ns

    @property
    def shown_ns(self) -> tuple[int, int]:
        """What stretch of time is on the screen."""
        return self.end_ns - self.window.span_ns, self.end_ns

    @property
    def _looking_back(self) -> bool:
        """Whether older rows of a logger that goes on are on the screen, which may be overwritten any moment."""
        return self.window.paused and self.pause.possible and self.pause.source is None

    def moment_words(self, time_ns: int) -> str:
        """Return a moment: how long before the newest one, or after the start of a file, and by the clock."""
        from_zero = (time_ns - self._zero_ns) / SECOND_NS
        return f"{from_zero + 0.0:.{self._decimals}f} s{clock(time_ns)}"

    @property
    def _zero_ns(self) -> int:
        return self.held_ns[1 if self.file is None else 0]

    @property
    def _decimals(self) -> int:
        """Of seconds, so that samples can be told apart."""
        periods = [self.source.period_ns(plotted.element.name) for plotted in self.stack.plots]
        return next((some for some in range(3, 9) if min(periods, default=SECOND_NS) * 10**some >= SECOND_NS), 9)

    def stand_still(self) -> None:
        """Let the window stand where it is; the cursor is a moment from now on."""
        if self.window.paused:
            return
        store = self.stack.store
        self.window.paused_end_ns = store.end * store.column_ns - 1 if not store.empty else self.source.end_ns
        if self.window.cursor is not None:
            self.window.at_ns = (store.end - self.window.cursor) * store.column_ns - 1

    def moved(self, elsewhere: bool = True) -> None:
        """Show the cursor's column in the window that is on the screen, and what an `elsewhere` window shows."""
        if self.window.paused:
            self.window.place_cursor(self.stack.store.end, self.stack.store.column_ns, self.stack.columns)
        self._read_moment()
        self.stack.redraw()
        self.line.refresh()
        self.show_between()
        if elsewhere:
            self.request_view()

    def _read_moment(self) -> None:
        """Read the values of what stands still: those at the cursor, or at the right end."""
        if self.file is not None:
            self.file.time_ns = self.now_ns if self.window.at_ns is not None else self.file.time_ns
            self.file.read(list(dict.fromkeys(plotted.element.name for plotted in self.stack.on_screen())))
            self.stack.readings, self.stack.bounds = self.file.live.readings, self.file.bounds
        elif self.window.paused:
            run_alone(self, "moment", self.holder.read)

    def _go_to(self, time_ns: int) -> None:
        """Move the cursor to a moment; the window follows when it leaves it."""
        self.moved(self.window.go_to(time_ns, self.held_ns, self.stack.columns))

    async def jump_to(self, time_ns: int) -> bool:
        """Move the cursor to a moment, and the window so that the moment is in its middle if it was not in it.

        Where it is held nowhere any more that is said, and nothing moves.
        """
        if not await self.pause.bring(time_ns, self.window.span_ns):
            oldest = self.moment_words(self.held_ns[0])
            self.say(f"{self.moment_words(time_ns)}: gone, oldest held {oldest}")
            return False
        self.moved(self.window.jump_to(time_ns, self.held_ns, self.stack.columns))
        return True

    def show_moment_of(self, time_ns: int) -> None:
        """Stand still at a moment: it has the cursor, in the middle of the window."""
        self.holder.pause_here()
        run_alone(self, "find", self.jump_to, time_ns)

    def command_closer(self) -> None:
        self._zoom(closer=True)

    def command_wider(self) -> None:
        self._zoom(closer=False)

    def _zoom(self, *, closer: bool) -> None:
        """Zoom around the cursor while the picture stands still, or around its middle; live at its right end."""
        if not self.window.paused:
            done = self.window.zoom(closer=closer)
        elif done := self.window.zoom_still(self.held_ns, self.stack.columns, closer=closer):
            self.moved(elsewhere=False)
        if done:
            self._said = ""
            self.request_view()
        else:
            whole = "longest span" if self.file is None else "whole file"
            self.say(f"that is the {'shortest span' if closer else whole}")

    def command_cursor_left(self) -> None:
        self._move_cursor(-1)

    def command_cursor_right(self) -> None:
        self._move_cursor(1)

    def command_cursor_far_left(self) -> None:
        self._move_cursor(-FAR)

    def command_cursor_far_right(self) -> None:
        self._move_cursor(FAR)

    def _move_cursor(self, cells: int) -> None:
        if not self.window.paused:
            self.window.move_cursor(cells, self.stack.columns)
            self.stack.redraw()
            self.line.refresh()
            return
        self._said = ""
        at_ns = self.window.at_ns
        if self.window.cursor is None or at_ns is None:  # it is elsewhere: take it here
            self._go_to(self.end_ns - self.window.span_ns // 2)
        else:
            self._go_to(at_ns + 2 * cells * self.window.column_ns(self.stack.columns))

    def command_earlier(self) -> None:
        self._pan(-1)

    def command_later(self) -> None:
        self._pan(1)

    def _pan(self, direction: int) -> None:
        """Pan by half a window; the cursor stays where it is in the picture."""
        span_ns, (oldest_ns, newest_ns) = self.window.span_ns, self.held_ns
        if not self.window.paused:
            if direction > 0:
                self.say("that is now")
                return
            if oldest_ns + span_ns >= newest_ns - self.window.column_ns(self.stack.columns):
                self.say("that is the oldest that is held")
                return
            self.stand_still()
        if self._looking_back and self.end_ns + direction * span_ns // 2 >= newest_ns:
            self.holder.go_on()
            return
        moved = self.window.pan(direction, (oldest_ns, newest_ns), self.stack.columns)
        self.moved()
        self.say("" if moved else f"that is {self._edge(direction)}")

    def _edge(self, direction: int) -> str:
        if self.file is not None:
            return f"the {'end' if direction > 0 else 'beginning'} of the file"
        return "where it was paused" if direction > 0 else "the oldest that is held"

    def command_oldest(self) -> None:
        self.stand_still()
        self._go_to(self.held_ns[0])

    def command_newest(self) -> None:
        if self._looking_back:
            self.holder.go_on()
        elif self.window.paused:
            self._go_to(self.held_ns[1])

    def command_all_held(self) -> None:
        held = self.held_ns
        self.window.fit(held)
        if self.window.paused:
            self.window.show(held[1], held, self.stack.columns)
            self.moved(elsewhere=False)
        self.request_view()
        self.say("")

    # ------------------------------------------------------------------------------------------------ two cursors

    def command_cursor_b(self) -> None:
        self.holder.pause_here()
        if self.window.other_ns is not None:
            self.window.other_ns = None
            self.say("cursor B is lifted")
        else:
            if self.window.at_ns is None:
                self.window.at_ns = self.end_ns - self.window.span_ns // 2
            self.window.other_ns = self.window.at_ns
            self.say("B set, ←→ moves A")
        self.moved(elsewhere=False)
        self.call_after_refresh(self._sized)

    def show_between(self) -> None:
        """Show what lies between the cursors; hide it without B."""
        a_ns, b_ns = self.window.at_ns, self.window.other_ns
        if not self.window.paused or a_ns is None or b_ns is None:
            self.between.hide()
        else:
            run_alone(self, "between", self._compute_between, a_ns, b_ns)

    async def _compute_between(self, a_ns: int, b_ns: int) -> None:
        await self.pause.settled()
        names = list(dict.fromkeys(plotted.name for plotted in self.stack.plots))
        try:
            found, partly = await self.pause.held.measure(names, a_ns, b_ns)
        except SiloError as error:
            self.say(f"nothing between the cursors: {error}")
            return
        short = self.session.short_name
        facts = [
            (self.stack.letter(plotted), short(plotted.name), found.get(plotted.name, Between()))
            for plotted in self.stack.plots
        ]
        seconds = (b_ns - a_ns) / SECOND_NS
        times = f"A {self.moment_words(a_ns)}   B {self.moment_words(b_ns)}   B-A {seconds:.6g} s"
        hertz = f"  {abs(1 / seconds):.4g} Hz" if seconds else ""
        times += hertz if len(times + hertz) + 2 <= self.size.width else ""
        self.between.show(times, facts, partly)

    def command_export_plots(self) -> None:
        self.holder.pause_here()
        ask_export(self, self.source, self.stack.panels, self.shown_ns, self._zero_ns)

    def take_back(self) -> None:
        """Show what the pause holds by now, or what comes: another screen used it meanwhile."""
        self.pause.tell(self.more_is_here)
        self.source = self.stack.source = self.pause.source or self.live_source
        if self.is_mounted:
            self.more_is_here()
            self.moved()

    def more_is_here(self) -> None:
        """Tell how much is held by now."""
        self.status_bar.mode = self.pause.head
        self.status_bar.update()
        self.line.refresh()

    @property
    def pinned_plots(self) -> Sequence[Plotted]:
        """What a pause holds."""
        return self.stack.plots

    # --------------------------------------------------------------------------------------------------- commands

    def _choose(self, index: int) -> None:
        if self.stack.choose(index):
            self.fill_soon()
        if self.file is not None:
            self._read_moment()
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
        if self.pause.source is not None or not self.live_source.live:
            return "PAUSED"
        if self.window.paused_end_ns is None:
            return "DEAD" if self.session.dead else "live" if self.session.connected else "no link"
        return f"-{text.span(max(0, self.source.end_ns - self.window.paused_end_ns) / SECOND_NS)}, End: now"

    def on_plot_stack_pointed(self, event: PlotStack.Pointed) -> None:
        """Choose the plot that was clicked, and put the cursor there."""
        self._choose(event.index)
        store = self.stack.store
        if event.column is not None and self.window.paused and not store.empty:
            self._go_to((store.end - event.column) * store.column_ns - 1)
        elif event.column is not None:
            self.window.cursor = event.column
            self.stack.redraw()
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
        if not chosen.numeric or not self.live_source.is_live(chosen.element.name):
            self.say("the scope needs a signal of numbers that is on")
            return
        low, high = self.stack.span_of(chosen)
        at_cursor = (
            value_here(chosen, self.stack.readings) if self.window.paused and self.window.cursor is not None else ""
        )
        level = float(at_cursor) if at_cursor else halfway(low, high)
        plots = [chosen, *(each for each in panel if each != chosen and each.numeric)]
        settings = Scope(level, span_s=fitting_span(self.live_source.period_ns(chosen.element.name)))
        self.app.push_screen(ScopeScreen(self.session, self.live_source, plots, settings))

    def command_plot_trigger(self) -> None:
        if not self.stack.plots or not self.stack.chosen_plot.numeric:
            self.say("a trigger needs a signal of numbers")
            return
        self.context.run_flow(self._ask_trigger())

    async def _ask_trigger(self) -> None:
        from silo_tui.screens.trigger_editor import ask_trigger

        name = self.session.short_name(self.stack.chosen_plot.name).lstrip("/")
        level = value_here(self.stack.chosen_plot, await self.holder.readings_here()) or "0"
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
        live = self.live_source.live  # what is held stands still, of a logger that goes on
        paused = (("pause", "Go on"),) if self.window.paused and live else ()
        back = "No cursor" if self.window.cursor is not None else "Live" if self.window.paused and live else ""
        return (*paused, ("cursor_left", "Cursor"), ("back", back)) if back else paused

    def command_back(self) -> None:
        """Leave cursor B, then the cursor, then the pause, then the screen."""
        if self.file is not None:
            self.context.leave_screen()
        elif self.window.other_ns is not None:
            self.command_cursor_b()
        elif self.window.cursor is not None:
            self.window.cursor = self.window.at_ns = None
            self.stack.redraw()
            self.line.refresh()
        elif self.window.paused and self.pause.possible:
            self.holder.go_on()
        else:
            self.context.leave_screen()


class FileMonitorScreen(MonitorScreen, inherit_bindings=False):
    """The same on a file: cursor A is a moment of it, whatever the zoom."""

    scope = "file_monitor"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("file_monitor")

    def __init__(self, session: FileSession, names: Sequence[str]) -> None:
        super().__init__(session, session.source, names)

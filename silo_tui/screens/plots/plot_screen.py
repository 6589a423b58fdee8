"""Stacked plots of some elements, live or standing still, with cursors that read values.

They stand still because of a pause, because one looks back, or because they are of a file: then the window goes over
all that is held and cursor A is a moment of it. What is shown comes from a `PlotSource`, live or a recording.
"""

import asyncio
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

from textual.app import ComposeResult

from silo.core.arrays.columns import ColumnStore
from silo.core.quantities.writing import EPOCH_FROM_NS, duration_text, many, wall_clock
from silo.errors import SiloError
from silo.expressions.span import Between
from silo.rpc.frames import Frame
from silo_tui.actions import key_of
from silo_tui.context import SiloScreen
from silo_tui.modal import run_alone, run_aside
from silo_tui.model.drawing.plots import Plotted, plots_of
from silo_tui.model.drawing.window import SECOND_NS, SPANS_S, PlotWindow
from silo_tui.model.plots.overlay import SIGN
from silo_tui.model.plots.time_axis import moment_of
from silo_tui.model.samples.find import Search, What, places_of
from silo_tui.model.samples.live import Reading, value_words
from silo_tui.model.samples.recorded import SHORT_SPANS_S
from silo_tui.model.samples.searching import reading_of
from silo_tui.model.words import text
from silo_tui.sessions.held import Pause
from silo_tui.sessions.link import ViewRequest
from silo_tui.sessions.live import Session
from silo_tui.sessions.recorded import FileSession
from silo_tui.widgets.bars import KeyBar
from silo_tui.widgets.between import BetweenTable
from silo_tui.widgets.messages import MonitorLine
from silo_tui.widgets.plot_stack import PlotStack, RecordedStack

DEBOUNCE_S = 0.1
CLOCKED = 100  # cells in which two moments have their times by the clock, too


class PlotScreen(SiloScreen):
    """Plots of some elements: what is shown of them, and where one looks."""

    def __init__(self, session: Session, names: Sequence[str], chosen: str = "") -> None:
        super().__init__()
        self.session, source = session, session.source
        self.file = session if isinstance(session, FileSession) else None
        self.scope = f"file_{self.scope}" if self.file is not None else self.scope
        self.source = source  # what is held, while something is
        self._loading = True  # until the first values stand there
        self._waiting: list[str] = []  # elements that are off, left out until they are on
        if any(source.is_live(name) for name in names):
            self._waiting = [name for name in names if not source.is_live(name)]
        shown = [name for name in names if name not in self._waiting]
        elements = [element for name in shown if (element := source.element(name)) is not None]
        self.window = PlotWindow() if self.file is None else self.file.window_of(names)
        self.stack = self.new_stack(plots_of(elements))
        self.stack.ended = session.dead
        self.stack.chosen = next((at for at, each in enumerate(self.stack.plots) if each.element.name == chosen), 0)
        self._asked = self.stack.store  # where the live columns should go
        self.paused_alone = True  # not by a key that took the cursor there too
        self._mending = False
        self._happened = session.happened
        self.between = BetweenTable()
        self.pause = Pause(session, self.more_is_here)

    def new_stack(self, plots: list[Plotted]) -> PlotStack:
        """Return the widget that draws these."""
        if self.file is not None:
            return RecordedStack(self.file, plots, self.window)
        stack = PlotStack(plots, self.window, self.source)
        stack.prefix = self.session.status.prefix.rstrip("/")
        return stack

    def compose(self) -> ComposeResult:
        yield from self.bars()
        yield self.stack
        yield self.between
        yield self.line
        yield KeyBar()

    @cached_property
    def line(self) -> MonitorLine:
        """Facts, below the plots."""
        return MonitorLine(self.window, self._words, self._state if self.file is None else None)

    def on_unmount(self) -> None:
        self.let_go()  # Textual calls the handlers of all classes

    def let_go(self) -> None:
        """Let go of what is held."""
        self.pause.release()

    def on_plot_stack_resized(self) -> None:
        """Show other columns for another width; keep the chosen plot on the screen, whatever takes room below."""
        self.stack.choose(self.stack.chosen)
        self.fill_soon()

    # ---------------------------------------------------------------------------------------------------- data

    def fill_soon(self) -> None:
        """Request view and history anew, when what is wanted has settled."""
        self.once_settled("view", DEBOUNCE_S, self.request_view)

    def request_view(self) -> None:
        if self.context.upper_screen is not self:
            return
        store = self._empty()
        if self.window.paused:
            self.session.columns = ColumnStore((), 1, 1)
            if self.pause.source is not None:
                run_alone(self, "look", self._look)
        else:
            store.adopt(self.stack.store)
            elements = dict.fromkeys(plotted.element.name for plotted in self.stack.on_screen())
            self.session.columns = self._asked = store
            self.session.watch(ViewRequest(tuple(elements), store.names, store.column_ns))
        run_alone(self, "history", self._fill, store)

    def _empty(self) -> ColumnStore:
        """Return columns to be filled, of what is on the screen."""
        plots = [plotted for plotted in self.stack.on_screen() if self.source.is_live(plotted.element.name)]
        columns = self.stack.columns
        names = [plotted.name for plotted in plots if plotted.numeric]
        return ColumnStore(names, columns, self.window.column_ns(columns))

    async def _fill(self, store: ColumnStore) -> None:
        start, end = self.shown_ns
        self._show_held(store)
        with self.context.telling("no history", self.say):
            past = await self.source.history(store.names, start, end, store.column_ns)
            store.advance_to(end // store.column_ns + 1)
            store.take(past)
        self._show_held(store)  # more may be here than when that was asked for
        self._mending = False
        if store is not self._asked and not self.window.paused:
            return  # another one was asked for meanwhile
        await self._fill_ghost(store)
        self.stack.store, self._loading = store, False
        self.moved(elsewhere=False)
        await self._fill_texts(end)
        self.stack.redraw()

    def _show_held(self, store: ColumnStore) -> None:
        """Show what is here of the picture that is held."""
        if self.pause.source is not None:
            start, end = self.shown_ns
            store.advance_to(end // store.column_ns + 1)
            store.take(self.pause.source.columns(store.names, start, end, store.column_ns))
            self.stack.store = store
            self.stack.redraw()

    async def _fill_ghost(self, store: ColumnStore) -> None:
        """Read what a saved run had in this window, and in the next one: the live one goes on."""
        overlay, began_ns = self.session.overlay, self.session.status.run_began_ns
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

    @property
    def subject(self) -> str:
        return self.session.short_name(self.stack.chosen_plot.name) if self.stack.plots else ""

    # ------------------------------------------------------------------------------------ what the app tells us

    def live_changed(self, frame: Frame) -> None:
        super().live_changed(frame)
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
                run_aside(self, "history", self._fill, self._asked)

    def _take_texts(self, frame: Frame) -> None:
        """Note texts that changed."""
        for plotted in self.stack.plots:
            reading = None if plotted.numeric else self.stack.readings.get(plotted.element.name)
            if reading is None or plotted.position not in reading.texts:
                continue
            events, word = self.stack.events.setdefault(plotted.name, []), reading.texts[plotted.position]
            if not events or events[-1][1] != word:
                events.append((frame.time_ns, word))

    def status_changed(self) -> None:
        super().status_changed()
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
        self.status_bar.mode = self.pause.head
        super().second_passed()
        self.line.refresh()  # what it tells of holes is of the columns of now

    def _words(self) -> Sequence[str]:
        """Return what the line tells, the newest last: that is read whole."""
        words = [each for each in (self._held_words, self.pause.text, self.cursor_words()) if each]
        total, fitting = len(self.stack.panels), self.stack.fitting
        if total > fitting:
            last = min(total, self.stack.first + fitting)
            way = f"{key_of('plot_down')} next" if last < total else f"{key_of('plot_up')} before"
            elements = len({plotted.element.name for plotted in self.stack.plots})
            opened = ", vectors by entry" if len(self.stack.plots) > elements else ""
            of = f", of {many(elements, 'element')}{opened}" if elements != total else ""  # which were marked, or named
            words.append(f"plots {self.stack.first + 1}-{last} of {total}{of} ({way})")
        if self.session.overlay is not None:
            words.append(f"{SIGN} {self.session.overlay.name}{self._ghost_words()}")
        ended = self.session.dead and not self.window.paused  # the line says DEAD: nothing comes any more
        if missing := self.stack.missing(before=not ended and self.file is None):
            words.append(missing)
        if self._loading and self.stack.plots and self.stack.display:
            words.append("loading …")
        if self._waiting and not self.line.said:
            words.append(f"{many(len(self._waiting), 'element')} off")
        return words

    @property
    def _held_words(self) -> str:
        """How much of what goes on can be looked at, and where the rest may be; a pause, or a file, tells it itself."""
        if not self.stack.plots or not self.pause.possible or self.pause.source is not None:
            return ""
        begin_ns, end_ns = self.held_ns
        older = f" (older: {key_of('recordings')}, if recorded)" if self.pause.why_no_more(self.stack.plots) else ""
        return f"{text.span((end_ns - begin_ns) / SECOND_NS, 2)} held{older}"

    def cursor_words(self) -> str:
        """Where in time cursor A is; empty where there is none."""
        if self.file is not None:
            clock = f" ({self.file.clock})" if self.file.clock and self.size.width >= 100 else ""
            return f"cursor at {self.file.seconds:.{self._decimals}f} s{clock}"
        if self.window.paused and self.window.at_ns is not None:
            return f"A {self.moment_words(self.window.at_ns)}"
        if self.window.cursor is None:
            return ""
        back = self.window.cursor * self.stack.store.column_ns / 1e9
        return f"cursor at -{text.span(back)}" if back else "cursor at 0 s"

    def _ghost_words(self) -> str:
        """Where the saved run is, if it isn't on the screen."""
        ghost, overlay = self.stack.ghost, self.session.overlay
        if ghost is None or overlay is None or any(self.stack.ghosts_of(panel) for panel in self.stack.panels):
            return ""
        extent = overlay.extent([plotted.element.name for plotted in self.stack.plots])
        here = duration_text((self.end_ns - self.session.status.run_began_ns) / SECOND_NS)
        return f": {extent}, here is {here}"

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
        clock = f"  {wall_clock(time_ns, 3)}" if time_ns >= EPOCH_FROM_NS else ""
        return f"{from_zero + 0.0:.{self._decimals}f} s{clock}"

    def moment_typed(self, words: str) -> int:
        """Return the moment that is typed, as the times on the screen are. Raises ValueError."""
        return moment_of(words, self._zero_ns, self.held_ns[1], self.now_ns)

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
        store, self.paused_alone = self.stack.store, False
        self.window.paused_end_ns = store.end * store.column_ns - 1 if not store.empty else self.source.end_ns
        if self.window.cursor is not None:
            self.window.at_ns = (store.end - self.window.cursor) * store.column_ns - 1

    def moved(self, elsewhere: bool = True) -> None:
        """Show the cursor's column in the window that is on the screen, and what an `elsewhere` window shows."""
        self.stack.place_cursor()
        self._read_moment()
        self.stack.redraw()
        self.line.refresh()
        self.show_between()
        self.update_keys()
        if elsewhere:
            self.request_view()

    def _read_moment(self) -> None:
        """Read the values of what stands still: those at the cursor, or at the right end."""
        if self.file is not None:
            self.file.time_ns = self.now_ns if self.window.at_ns is not None else self.file.time_ns
            self.file.read(list(dict.fromkeys(plotted.element.name for plotted in self.stack.on_screen())))
            self.stack.readings, self.stack.bounds = self.file.live.readings, self.file.bounds
        elif self.window.paused:
            run_alone(self, "moment", self._read_paused)

    def _go_to(self, time_ns: int) -> None:
        """Move the cursor to a moment; the window follows when it leaves it."""
        self.moved(self.window.go_to(time_ns, self.held_ns, self.stack.columns))

    def gone_words(self, what: str) -> str:
        """Return that a moment is overwritten, or not in a file, and from when to when there are any."""
        first, last = map(self.moment_words, self.held_ns)
        if self.size.width < CLOCKED:
            first, last = (each.partition("  ")[0] for each in (first, last))
        if self.file is not None:
            return f"{what}: not in this file, which goes from {first} to {last}"
        return f"{what}: overwritten, these plots hold from {first} to {last}"

    async def jump_to(self, time_ns: int, let_go: Callable[[], None] = lambda: None) -> bool:
        """Move the cursor to a moment, and the window so that the moment is in its middle if it was not in it.

        Where it is held nowhere any more that is said, and nothing moves, or goes on as before if it paused for this.
        """
        if not await self.pause.bring(time_ns, self.window.span_ns):
            told = self.gone_words(self.moment_words(time_ns))
            let_go()
            self.say(told)
            return False
        if not self.window.paused:  # somebody let it go on meanwhile
            return False
        self.moved(self.window.jump_to(time_ns, self.held_ns, self.stack.columns))
        return True

    def show_moment_of(self, time_ns: int) -> None:
        """Stand still at a moment: it has the cursor, in the middle of the window."""
        run_alone(self, "find", self.jump_to, time_ns, self.pause_for_now())

    def show_between(self) -> None:
        """Show what lies between the cursors; hide it without B, and where no time is drawn."""
        a_ns, b_ns = self.window.at_ns, self.window.other_ns
        if not (self.window.paused and self.stack.display) or a_ns is None or b_ns is None:
            self.workers.cancel_group(self, "between")  # what is measured still would come to stand there
            self.between.hide()
        else:
            run_alone(self, "between", self._compute_between, a_ns, b_ns)

    async def _compute_between(self, a_ns: int, b_ns: int) -> None:
        await self.pause.settled()
        names = list(dict.fromkeys(plotted.name for plotted in self.stack.plots))
        with self.context.telling("nothing between the cursors", self.say):
            found, partly = await self.pause.held.measure(names, a_ns, b_ns)
            short = self.session.short_name
            facts = [
                (self.stack.letter(plotted), short(plotted.name), found.get(plotted.name, Between()))
                for plotted in self.stack.plots
            ]
            seconds = (b_ns - a_ns) / SECOND_NS
            hertz = f"  {text.short(abs(1 / seconds))} Hz" if seconds else ""
            a, b = self.moment_words(a_ns), self.moment_words(b_ns)
            times = f"B-A {text.short(seconds, 6)} s{hertz}   A {a}   B {b}"
            if len(times) >= self.size.width:  # the clock that A shows is in the line below
                times = f"B-A {text.short(seconds, 6)} s{hertz}   A {a.partition('  ')[0]}   B {b.partition('  ')[0]}"
            self.between.show(times, facts, partly)

    def take_back(self) -> None:
        """Show what the pause holds by now, or what comes: another screen used it meanwhile."""
        self.pause.changed = self.more_is_here
        self.source = self.stack.source = self.pause.source or self.session.source
        if self.is_mounted:
            self.more_is_here()
            self.moved()

    def more_is_here(self) -> None:
        """Tell how much is held by now."""
        self.status_bar.mode = self.pause.head
        self.status_bar.update()
        self.line.refresh()
        if self.between.partly:
            self.show_between()

    @property
    def pinned_plots(self) -> Sequence[Plotted]:
        """What a pause holds."""
        return self.stack.plots

    def _choose(self, index: int) -> None:
        if self.stack.choose(index):
            self.fill_soon()
        if self.file is not None:
            self._read_moment()
        self.line.refresh()

    def _state(self) -> str:
        if self.pause.source is not None or not self.session.source.live:
            return "PAUSED"
        if self.window.paused_end_ns is None:
            return "DEAD" if self.session.dead else "live" if self.session.connected else "no link"
        return f"-{text.span(max(0, self.source.end_ns - self.window.paused_end_ns) / SECOND_NS)}, End: now"

    # ---------------------------------------------------------------------------------------------------- held

    def pause_here(self) -> None:
        """Hold the rows before they are looked through: a logger that goes on overwrites them."""
        if self.pause.possible and self.pause.source is None:
            self.hold()

    def pause_for_now(self) -> Callable[[], None]:
        """Hold the rows while something is asked; return what lets go of them, where nothing held them before."""
        if not self.pause.possible or self.pause.source is not None:
            return lambda: None
        window = self.window
        ran, cursor, spans = not window.paused, window.cursor, window.spans
        self.hold()

        def let_go() -> None:
            if ran:
                self.go_on()
                window.cursor = cursor
            else:
                self._release()
                window.spans = spans

        return let_go

    def _release(self) -> None:
        """Let go of what is held, and look on at what was looked at."""
        self.pause.release()
        self.source = self.stack.source = self.session.source
        self.more_is_here()
        self.request_view()

    def hold(self) -> None:
        """Hold what is on the screen, with as much before it."""
        newest_ns = self.session.source.end_ns if self.window.paused else 0  # looking back, time goes on
        self.stand_still()
        store, span_ns = self.stack.store, self.window.span_ns
        held = self.pause.hold(self.pinned_plots, self.end_ns, span_ns, store, newest_ns)
        self.source = self.stack.source = held
        self.window.spans = (*SHORT_SPANS_S, *SPANS_S)
        run_alone(self.screen, "pause", held.fill, store.column_ns, span_ns)
        self.more_is_here()
        self.request_view()

    def go_on(self) -> None:
        """Show what comes again."""
        self.window.go_on()
        self.line.say("")  # it was of what stood still
        self.show_between()
        self._release()

    async def _look(self) -> None:
        """Pin and fetch what is on the screen; where its rows are gone by now, show the oldest that there are."""
        window, columns = self.window, self.stack.columns
        start_ns, end_ns = self.shown_ns
        if (source := self.pause.source) is not None:
            await source.look(start_ns, end_ns, window.column_ns(columns))
        if source is None or source is not self.pause.source:
            return
        oldest_ns = self.held_ns[0]
        if window.at_ns is not None and window.at_ns < oldest_ns:
            window.at_ns = oldest_ns
        half_empty = start_ns + window.column_ns(columns) < oldest_ns and end_ns - oldest_ns < window.span_ns // 2
        if half_empty:  # a window wider than all that is held stays where it is
            window.show(end_ns, self.held_ns, columns)
            if window.paused_end_ns != end_ns:
                self.moved()
                return
        self._show_held(self._empty())
        self._read_moment()

    async def _read_paused(self) -> None:
        readings = await self.readings_here()
        if self.window.paused:
            self.stack.readings = readings
            self.stack.bounds = self.session.bounds
            self.stack.redraw()

    async def readings_here(self) -> Mapping[str, Reading]:
        """Return what held at the cursor, or at the right end of the window; nothing of what can't be had."""
        if not self.window.paused or self.file is not None:
            return self.session.live.readings
        await self.pause.settled()
        at_ns = self.now_ns if self.window.cursor is not None else self.end_ns
        plots = (*self.stack.on_screen(), *self.stack.plots[self.stack.chosen : self.stack.chosen + 1])
        shown = {plotted.element.name: plotted.element for plotted in plots}
        try:
            if self.pause.source is not None:
                return await self.pause.source.readings(list(shown), at_ns)
            live = self.session.source
            return {
                name: await reading_of(live.samples, live.period_ns(name), element, at_ns)
                for name, element in shown.items()
            }
        except SiloError:
            return {}

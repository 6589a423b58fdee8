# ruff: noqa: D102 - what a command does stands in actions.py, once
"""Plots that stand still, because of a pause, because one looks back, or because they are of a file.

The window goes over all that is held, cursor A is a moment of it, B another one, and moments can be found.
"""

import asyncio
from collections.abc import Mapping
from datetime import datetime

import numpy as np

from silo.errors import SiloError
from silo.expressions.span import Between
from silo_tui.context import SiloScreen
from silo_tui.modal import run_alone, run_aside
from silo_tui.model.live import Reading
from silo_tui.model.plots import SECOND_NS, Plotted, PlotWindow
from silo_tui.model.source import HeldRows, PlotSource
from silo_tui.screens.exporting import ask_export
from silo_tui.screens.finding import SearchResult
from silo_tui.sessions.live import Session
from silo_tui.sessions.pause import Pause
from silo_tui.widgets.bars import MonitorLine
from silo_tui.widgets.between import BetweenTable
from silo_tui.widgets.plot_stack import PlotStack

FAR = 10
STEP_PERIODS = 64  # as far as the next sample is looked for at first
EPOCH_FROM_NS = 946_684_800_000_000_000  # 2000: a smaller time stamp is none of the system's clock


def value_here(plotted: Plotted, readings: Mapping[str, Reading]) -> str:
    """Return the value of a signal as it is typed; empty where there is none."""
    reading = readings.get(plotted.element.name)
    if reading is None or plotted.position >= len(reading.newest) or np.isnan(reading.newest[plotted.position]):
        return ""
    return f"{reading.newest[plotted.position]:.6g}"


class StandingStill(SiloScreen):
    """What the monitors of a logger and of a file have in common while nothing moves."""

    session: Session
    source: PlotSource
    window: PlotWindow
    stack: PlotStack
    between: BetweenTable
    pause: Pause

    def __init__(self) -> None:
        super().__init__()
        self._said = ""
        self._found: SearchResult | None = None
        self._stepping = asyncio.Lock()  # two keys at once are two samples

    @property
    def line(self) -> MonitorLine:
        """Facts, below the plots."""
        raise NotImplementedError

    def command_pause(self) -> None:
        raise NotImplementedError

    def _go_on(self) -> None:
        raise NotImplementedError

    @property
    def _held_ns(self) -> tuple[int, int]:
        raise NotImplementedError

    @property
    def held(self) -> HeldRows:
        """All that is held of what is plotted, while it stands still."""
        raise NotImplementedError

    async def bring(self, time_ns: int) -> bool:
        """Have a moment where it can be looked at; False where it is held nowhere any more."""
        raise NotImplementedError

    def _sized(self) -> None:
        raise NotImplementedError

    def _stand_still(self) -> None:
        """Let the window stand where it is; the cursor is a moment from now on."""
        if self.window.paused:
            return
        store = self.stack.store
        self.window.paused_end_ns = store.end * store.column_ns - 1 if not store.empty else self.source.end_ns
        if self.window.cursor is not None:
            self._at_ns = (store.end - self.window.cursor) * store.column_ns - 1

    # ----------------------------------------------------------------------------- the window while it stands still

    @property
    def _at_ns(self) -> int | None:
        """The moment of cursor A while the picture stands still."""
        return self.window.at_ns

    @_at_ns.setter
    def _at_ns(self, time_ns: int | None) -> None:
        self.window.at_ns = time_ns

    @property
    def _oldest_ns(self) -> int:
        """How far back one can look."""
        return self._held_ns[0]

    @property
    def _newest_ns(self) -> int:
        """How far on one can look."""
        return self._held_ns[1]

    @property
    def _shown_ns(self) -> tuple[int, int]:
        """What stretch of time is on the screen."""
        return self._end_ns - self.window.span_ns, self._end_ns

    @property
    def _looking_back(self) -> bool:
        """Whether older rows of a logger that goes on are on the screen, which may be overwritten any moment."""
        return self.window.paused and self.pause.possible and self.pause.source is None

    @property
    def _column_ns(self) -> int:
        return self.window.column_ns(self.stack.columns)

    @property
    def _end_ns(self) -> int:
        end = self.window.paused_end_ns
        return self.source.end_ns if end is None else end

    def moment_words(self, time_ns: int) -> str:
        """Return a moment: how long before the newest one, and by the clock."""
        back = (time_ns - self._newest_ns) / SECOND_NS
        return f"{back + 0.0:.{self._decimals}f} s{self._clock(time_ns)}"

    @property
    def _decimals(self) -> int:
        """Of seconds, so that samples can be told apart."""
        periods = [self.source.period_ns(plotted.element.name) for plotted in self.stack.plots]
        return next((some for some in range(3, 9) if min(periods, default=SECOND_NS) * 10**some >= SECOND_NS), 9)

    def _clock(self, time_ns: int) -> str:
        if time_ns < EPOCH_FROM_NS:
            return ""
        return f"  {datetime.fromtimestamp(time_ns // 1000 / 1e6):%H:%M:%S.%f}"[:-3]

    def _show(self, end_ns: int) -> None:
        """Put the right edge of the window there, as far as there is something to see."""
        self.window.paused_end_ns = self._edge_at(end_ns)
        self._show_moment()
        self.request_view()

    def _edge_at(self, end_ns: int) -> int:
        """Return where the right edge of the window is that is wanted there: where something is to be seen."""
        span_ns = self.window.span_ns - self._column_ns
        return min(self._newest_ns, max(end_ns, self._oldest_ns + span_ns))

    def _show_moment(self) -> None:
        """Show the cursor's column in the window that is on the screen."""
        if self.window.paused:
            store, at_ns = self.stack.store, self._at_ns
            cursor = -1 if at_ns is None else store.end - 1 - at_ns // store.column_ns
            self.window.cursor = cursor if 0 <= cursor < self.stack.columns else None
        self._moment_shown()
        self.stack.redraw()
        self.line.refresh()
        self._show_between()

    def _moment_shown(self) -> None:
        """Follow the cursor."""

    def _go_to(self, time_ns: int) -> None:
        """Move the cursor to a moment; the window follows when it leaves it."""
        self._at_ns = time_ns = max(self._oldest_ns, min(time_ns, self._newest_ns))
        end, span, column_ns = self._end_ns, self.window.span_ns, self._column_ns
        # in whole columns: where the window begins and ends is between two of them
        if time_ns // column_ns > end // column_ns:
            self._show(max(end + span // 4, time_ns))
        elif time_ns // column_ns <= end // column_ns - self.stack.columns:
            self._show(min(end - span // 4, time_ns + span - column_ns))
        else:
            self._show_moment()

    async def _jump_to(self, time_ns: int) -> bool:
        """Move the cursor to a moment, and the window so that the moment is in its middle if it was not in it.

        Where it is held nowhere any more that is said, and nothing moves.
        """
        if not await self.bring(time_ns):
            self.say(self.gone_words(time_ns))
            return False
        if not self._end_ns - self.window.span_ns < time_ns <= self._end_ns:
            self._show(time_ns + self.window.span_ns // 2)
        self._go_to(time_ns)
        return True

    def gone_words(self, time_ns: int) -> str:
        """Return what to say of a moment that is held no more: how far back one can look."""
        asked, oldest = self.moment_words(time_ns), self.moment_words(self._oldest_ns)
        return f"{asked}: gone, oldest held {oldest}"

    def show_moment_of(self, time_ns: int) -> None:
        """Stand still at a moment: it has the cursor, in the middle of the window."""
        self._pause_here()
        run_alone(self, "find", self._jump_to, time_ns)

    def command_closer(self) -> None:
        self._zoom(closer=True)

    def command_wider(self) -> None:
        self._zoom(closer=False)

    def _zoom(self, *, closer: bool) -> None:
        """Zoom around the cursor while the picture stands still, or around its middle; live at its right end."""
        before, end = self.window.span_ns, self._end_ns
        if not self.window.zoom(closer=closer):
            self.say("that is the shortest span" if closer else self._longest())
            return
        self._said = ""
        if not self.window.paused:
            self.request_view()
            return
        seen, at_ns = self.window.cursor is not None, self._at_ns
        fixed = at_ns if seen and at_ns is not None else end - before // 2
        self._show(fixed + round((end - fixed) * self.window.span_ns / before))

    def _longest(self) -> str:
        return "that is the longest span"

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
        at_ns = self._at_ns
        if self.window.cursor is None or at_ns is None:  # it is elsewhere: take it here
            self._go_to(self._end_ns - self.window.span_ns // 2)
        else:
            self._go_to(at_ns + 2 * cells * self._column_ns)

    def _point_at(self, column: int) -> None:
        """Put the cursor into a column, counted from the right edge."""
        store = self.stack.store
        if self.window.paused and not store.empty:
            self._go_to((store.end - column) * store.column_ns - 1)
        else:
            self.window.cursor = column
            self.stack.redraw()

    def command_earlier(self) -> None:
        self._pan(-1)

    def command_later(self) -> None:
        self._pan(1)

    def _pan(self, direction: int) -> None:
        """Pan by half a window; the cursor stays where it is in the picture."""
        if not self.window.paused:
            if direction > 0:
                self.say("that is now")
                return
            if self._oldest_ns + self.window.span_ns >= self._newest_ns - self._column_ns:
                self.say("that is the oldest that is held")
                return
            self._stand_still()
        end, seen = self._end_ns, self.window.cursor is not None
        if self._looking_back and end + direction * self.window.span_ns // 2 >= self._newest_ns:
            self._go_on()
            return
        self._show(end + direction * self.window.span_ns // 2)
        moved = self._end_ns - end
        self._said = "" if moved else self._edge(direction)
        if seen and self._at_ns is not None:
            self._at_ns = max(self._oldest_ns, min(self._at_ns + moved, self._newest_ns))
        self.line.refresh()

    def _edge(self, direction: int) -> str:
        return "that is where it was paused" if direction > 0 else "that is the oldest that is held"

    def command_oldest(self) -> None:
        self._stand_still()
        self._go_to(self._oldest_ns)

    def command_newest(self) -> None:
        if self._looking_back:
            self._go_on()
        elif self.window.paused:
            self._go_to(self._newest_ns)

    def command_all_held(self) -> None:
        wanted = (self._newest_ns - self._oldest_ns) / SECOND_NS
        self.window.span_s = next((span for span in self.window.spans if span >= wanted), self.window.spans[-1])
        if self.window.paused:
            self._show(self._newest_ns)
        else:
            self.request_view()
        self._said = ""
        self.line.refresh()

    def command_next_sample(self) -> None:
        self._step(1)

    def command_previous_sample(self) -> None:
        self._step(-1)

    def _step(self, step: int) -> None:
        self._pause_here()
        run_aside(self, "find", self._step_by, step)

    async def _step_by(self, step: int) -> None:
        await self.pause.settled()
        async with self._stepping:
            try:
                found = await self._sample_beside(self._now_ns, step)
            except SiloError as error:
                self.say(str(error))
                return
            if found is None:
                name = self._short(self.stack.chosen_plot.name)
                self.say(f"that is the {'last' if step > 0 else 'first'} sample held of {name}")
            elif await self._jump_to(found):
                self._said = ""

    async def _sample_beside(self, now_ns: int, step: int) -> int | None:
        """Return the time of the next (1) or last (-1) sample of the chosen signal; None where none is held."""
        plotted, oldest, newest = self.stack.chosen_plot, self._oldest_ns, self._newest_ns
        reach = STEP_PERIODS * max(1, self.source.period_ns(plotted.element.name))
        while True:  # mostly it is near; where there is a hole it is looked for farther
            begin, end = (now_ns + 1, now_ns + reach) if step > 0 else (now_ns - reach, now_ns - 1)
            time_ns, _ = await self.source.samples(plotted.name, max(begin, oldest), min(end, newest))
            if len(time_ns):
                return int(time_ns[0 if step > 0 else -1])
            if begin <= oldest if step < 0 else end >= newest:
                return None
            reach *= 8

    # ------------------------------------------------------------------------------------------------ two cursors

    def command_cursor_b(self) -> None:
        self._pause_here()
        if self.window.other_ns is not None:
            self.window.other_ns = None
            self.say("cursor B is lifted")
        else:
            if self._at_ns is None:
                self._at_ns = self._end_ns - self.window.span_ns // 2
            self.window.other_ns = self._at_ns
            self.say("B set, ←→ moves A")
        self._show_moment()
        self.call_after_refresh(self._sized)

    def _show_between(self) -> None:
        """Show what lies between the cursors; hide it without B."""
        a_ns, b_ns = self._at_ns, self.window.other_ns
        if not self.window.paused or a_ns is None or b_ns is None:
            self.between.hide()
        else:
            run_alone(self, "between", self._compute_between, a_ns, b_ns)

    async def _compute_between(self, a_ns: int, b_ns: int) -> None:
        await self.pause.settled()
        names = list(dict.fromkeys(plotted.name for plotted in self.stack.plots))
        try:
            found, partly = await self.held.measure(names, a_ns, b_ns)
        except SiloError as error:
            self.say(f"nothing between the cursors: {error}")
            return
        facts = [
            (self.stack.letter(plotted), self._short(plotted.name), found.get(plotted.name, Between()))
            for plotted in self.stack.plots
        ]
        seconds = (b_ns - a_ns) / SECOND_NS
        times = f"A {self.moment_words(a_ns)}   B {self.moment_words(b_ns)}   B-A {seconds:.6g} s"
        hertz = f"  {abs(1 / seconds):.4g} Hz" if seconds else ""
        times += hertz if len(times + hertz) + 2 <= self.size.width else ""
        self.between.show(times, facts, partly)

    def command_export_plots(self) -> None:
        self._pause_here()
        zero_ns = self._newest_ns if self.pause.possible else self._oldest_ns
        ask_export(self, self.source, self.stack.panels, self._shown_ns, zero_ns)

    @property
    def _now_ns(self) -> int:
        """Where one looks: cursor A, or the right edge of the window."""
        return self._end_ns if self._at_ns is None else self._at_ns

    def _pause_here(self) -> None:
        """Hold the rows before they are looked through: a logger that goes on overwrites them."""
        if self.pause.possible and self.pause.source is None:
            self.command_pause()

    def _short(self, name: str) -> str:
        return self.session.short_name(name)

    async def _readings_here(self) -> dict[str, Reading]:
        """Return what held at the cursor, or at the right end of the window."""
        raise NotImplementedError

"""One large plot: signals over time as in the monitor, one against another, their spectrum, a histogram.

Over time it is the monitor with one plot, with the same keys, pause and window. Reading and computing happen in a
worker when asked, never while keys are waiting.
"""

import asyncio
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from textual import events
from textual.app import ComposeResult
from textual.widgets import Static

from silo.analysis.compute.spectra import (
    MOST_PEAKS,
    GaplessStretch,
    Peak,
    Spectrum,
    longest_piece,
    peaks_of,
    spectrum_of,
)
from silo.core.arrays.columns import MAX_COLUMNS, Floats
from silo.core.arrays.values import as_floats
from silo.core.quantities.writing import duration, many
from silo.core.units import product, quotient
from silo.errors import SiloError
from silo.rpc.frames import Frame
from silo_tui.actions import Command, key_of, key_text
from silo_tui.modal import ask, run_alone
from silo_tui.model.drawing import big_plot
from silo_tui.model.drawing.big_plot import BigPlot, histogram_of, pair_of
from silo_tui.model.drawing.plots import Plotted
from silo_tui.model.drawing.window import SECOND_NS
from silo_tui.model.plots.panels import LETTERS, MAX_SERIES
from silo_tui.model.samples.source import Samples
from silo_tui.model.words import text
from silo_tui.model.words.names import fitted_among
from silo_tui.screens.dialogs.questions import Choice, Question
from silo_tui.screens.plots.monitor import MonitorScreen, added_words
from silo_tui.widgets.bars import KeyBar
from silo_tui.widgets.detail_plot import DetailPlot

MODES = ("time", "x-y", "spectrum", "histogram")
CURSOR_MODES = ("time", "spectrum")
LEVELS = ("linear", "log", "dB")
DEBOUNCE_S = 0.15
LIVE_S = 1.0  # so often what goes on is drawn again, or
LIVE_SHARE = 0.25  # as often as that takes such a share of the time
FEW_PEAKS = 6  # as many as two lines of 80 cells hold
PEAKS_KNOWN = 64  # of which those are told that are drawn
LEAST_LINES = 8  # of a spectrum that is looked at from near
WHOLE = 0.95  # of the window, from which on a spectrum is of the time that it shows
OF_SPECTRA = {"find": "Find peak"}


@dataclass(frozen=True)
class Analysed:
    """A plot, and what is said of it."""

    plot: BigPlot | None = None
    notes: Sequence[str] = ()
    kind: str = ""  # what stands in the title
    peaks: Sequence[Peak] = ()
    top_hz: float = 0.0
    spectrum: Spectrum | None = None  # of the first signal: a cursor reads it
    seconds: float = math.inf  # that this is of


NOTHING = Analysed()


class DetailScreen(MonitorScreen):
    """A plot of up to eight of some signals: the first `count` of `plots` are those of the panel that was chosen.

    The monitor below it lends its window and its pause, and gets them back as they are then.
    """

    scope = "detail"

    def __init__(self, monitor: MonitorScreen, mode: str) -> None:
        super().__init__(monitor.session, [])
        plots, count = monitor.stack.for_detail()
        self.below = monitor
        self.plots = list(plots)
        self.count = min(count, MAX_SERIES)
        self.mode = self._entered_as = mode
        self.level = LEVELS[0]
        self._found = NOTHING
        self._peak: int | None = None  # of those found
        self._spectrum_of: Plotted | None = None  # whose peaks those are
        self._due_s = 0.0  # when what goes on is drawn again
        self._cursor_hz: float | None = None  # where the cursor stands in spectra; None: by its cell
        self._halved = 0  # how often the upper half of the frequencies was left out
        self.window, self.pause = monitor.window, monitor.pause
        self.stack = stack = self.new_stack(plots[:1])
        stack.show_panels([tuple(self.plots[: self.count])])
        stack.fresh, stack.ended = monitor.stack.fresh, monitor.stack.ended
        stack.readings, stack.bounds, stack.events = monitor.stack.readings, monitor.stack.bounds, monitor.stack.events
        self._asked = stack.store
        self.plot = DetailPlot()
        self.plot.display, stack.display = mode != MODES[0], mode == MODES[0]
        self._turned = 0  # which of the signals stands first now
        self.take_back()

    def compose(self) -> ComposeResult:
        yield from self.bars()
        yield Static("", id="detail-title", markup=False)
        yield self.stack
        yield self.plot
        yield self.between
        yield self.line
        yield KeyBar()

    def on_mount(self) -> None:
        """Compute what is asked for at once: nothing else may come that would ask for it."""
        if self.mode != MODES[0]:
            self.call_after_refresh(self.request_view)

    def let_go(self) -> None:
        """Leave what is held to the monitor."""

    @property
    def pinned_plots(self) -> Sequence[Plotted]:
        """What a pause holds: all that the monitor has."""
        return self.below.stack.plots

    def request_view(self) -> None:
        """Show what is wanted over time; the other views are computed when that has settled."""
        self._title()
        if self.mode == MODES[0]:
            super().request_view()
        elif self.context.upper_screen is self:
            self.draw_soon()

    def draw_soon(self) -> None:
        """Draw when what is wanted has settled."""
        self.once_settled("view", DEBOUNCE_S, self._begin)

    def live_changed(self, frame: Frame) -> None:
        """Show what comes: of other views than that over time all is computed anew, now and then."""
        super().live_changed(frame)
        if self.mode != MODES[0] and not self.window.paused and time.monotonic() >= self._due_s:
            self._due_s = math.inf  # until it is drawn
            self._begin()

    def more_is_here(self) -> None:
        super().more_is_here()
        self._title()

    def _title(self) -> None:
        shown = self._shown_plots
        level = f" {self.level}" if self.mode == "spectrum" else ""
        parts = [f"{self.mode.upper()}{level}", *([self._found.kind] if self._found.kind else []), self._place()]
        if self.mode == MODES[0]:
            shown = []  # each curve has its name
        room = self.size.width - len("  ".join(parts)) - 6
        names = tuple(self.session.short_name(plotted.name) for plotted in shown)
        units = list(map(_unit, shown))
        letters = ("x ", "y ") if self.mode == "x-y" else tuple(map(self._letter, range(len(shown))))
        begins = [("  " if place else "") + letters[place] for place in range(len(shown))]
        if len("".join((*begins, *names, *units))) > room:
            width = (room - len("".join((*begins, *units)))) // len(shown)
            names = tuple(fitted_among(name, names, width) for name in names)
        parts.insert(0, "".join("".join(each) for each in zip(begins, names, units, strict=True)))
        for title in self.query("#detail-title").results(Static):  # none while the screen goes
            title.update("  ".join(filter(None, parts)))

    @property
    def _shown_plots(self) -> Sequence[Plotted]:
        """Those that a view of other than time is of."""
        return self.plots[: self.count if self.mode == "spectrum" else 2 if self.mode == "x-y" else 1]

    def _letter(self, place: int) -> str:
        return f"{LETTERS[place]} " if self.count > 1 else ""

    def _place(self) -> str:
        if self._found.seconds < WHOLE * self.window.span_s:
            return duration(self._found.seconds)
        if self.file is not None:
            begin_ns, end_ns = self.source.begin_ns, self.source.end_ns
            begin = max(0.0, (self.end_ns - begin_ns) / SECOND_NS - self.window.span_s)
            end = min((end_ns - begin_ns) / SECOND_NS, begin + self.window.span_s)
            ends = text.row(begin, end)
            return f"{' … '.join(ends)} s ({text.span(self.window.span_s)})"
        return text.span(self.window.span_s)  # how far back it ends is told below, as time goes on

    def _begin(self) -> None:
        run_alone(self, "draw", self._draw)

    async def _draw(self) -> None:
        begun_s = time.monotonic()
        try:
            await self._drawn()
        finally:
            now_s = time.monotonic()
            self._due_s = now_s + max(LIVE_S, (now_s - begun_s) / LIVE_SHARE)

    async def _drawn(self) -> None:
        ways = {"spectrum": self._spectrum, "x-y": self._pair, "histogram": self._histogram}
        if self.mode not in ways:
            return
        await self.pause.settled()
        try:
            found = await ways[self.mode]()
        except SiloError as error:
            self.plot.say(f"No data: {error}")
            return
        except ValueError as short:
            if self.mode == "spectrum" and self._found.plot is not None and self.plots[0] == self._spectrum_of:
                self.plot.show(self._found.plot, [f"as it was: {short}", *self._found.notes])
                return
            longer = f"; {key_of('wider')} takes more seconds" if self.mode == "spectrum" else ""
            self.plot.say(f"{self.mode} of {self._label(self.plots[0])}: {short}{longer}")
            return
        told = self._peak_words()
        self._found = found
        if told and self.line.said == told:  # it is told of the spectrum that stands there
            self._say_peak()
        if (hz := self._cursor_hz) is not None:  # it stays on its frequency, where that is drawn still
            cell = big_plot.cell_of(hz, self._found.top_hz, self.plot.plot_size[0])
            self.plot.cursor = cell if hz <= self._found.top_hz else None
        self.plot.show(found.plot, [*self._at_cursor(), *found.notes])
        self._title()
        self.update_keys()

    async def _samples(self, plotted: Plotted) -> Samples:
        """Raw samples; where there are none, the middle of columns of one sample each."""
        start_ns, end_ns = self.shown_ns
        try:
            return await self.source.samples(plotted.name, start_ns, end_ns)
        except SiloError:
            period = self.source.period_ns(plotted.element.name)
            column_ns = max(period, math.ceil(self.window.span_ns / (MAX_COLUMNS - 2)))
            past = await self.source.history([plotted.name], start_ns, end_ns, column_ns)
            middle = past.low[0] / 2 + past.high[0] / 2 + past.bases.get(0, 0)
            times = (past.first + np.arange(len(middle), dtype=np.int64)) * column_ns
            return times[~np.isnan(middle)], middle[~np.isnan(middle)]

    async def _spectrum(self) -> Analysed:
        spectra: list[Spectrum] = []
        pieces: list[GaplessStretch] = []
        plots = [plotted for plotted in self.plots[: self.count] if plotted.numeric]
        for plotted in plots:
            piece = longest_piece(*await self._samples(plotted))
            pieces.append(piece)
            spectra.append(await asyncio.to_thread(spectrum_of, piece))
        top_hz, step_hz = max(each.top_hz for each in spectra), spectra[0].step_hz
        while self._halved and top_hz / 2**self._halved < LEAST_LINES * step_hz:  # of a time that is shorter by now
            self._halved -= 1
        top_hz /= 2**self._halved
        known = self._found.peaks if plots[0] == self._spectrum_of else ()  # what is told stands still
        self._spectrum_of = plots[0]
        peaks = [peak for peak in peaks_of(spectra[0], PEAKS_KNOWN, known) if peak.frequency_hz <= top_hz]
        peaks = peaks[: MOST_PEAKS if self.plot.beside else FEW_PEAKS]
        unit = plots[0].element.unit
        drawn = big_plot.of_spectra(spectra, peaks, self.level, self.plot.plot_size, self._peak, top_hz)
        first, step = pieces[0], spectra[0].step_hz
        words = [
            f"{number}  {_hz_words(peak, step)} Hz  " + big_plot.level_words(peak.amplitude, self.level, unit)
            for number, peak in enumerate(peaks, 1)
        ]
        whose = self._letter(self.plots.index(plots[0]))  # nothing where it is the only one
        line = int(spectra[0].amplitudes.argmax())
        highest = Peak((line + 1) * step, float(spectra[0].amplitudes[line]))  # of a drift too, which is no peak
        top = f"{_hz_words(highest, step)} Hz  {big_plot.level_words(highest.amplitude, self.level, unit)}"
        notes = [f"{whose}peak {words[0]}", *words[1:]] if words else [f"{whose}no peak stands out", f"highest {top}"]
        rate = 1 / first.period_s
        finer = f", finer of more seconds: {key_of('mode_time') or key_of('mode')}, {key_of('wider')}"
        blurred = any(_is_blurred(peak, step) for peak in (highest, *peaks))
        notes.append(f"resolution {text.compact(step)} Hz{finer if blurred else ''}")
        notes.append(f"{duration(first.seconds)} of {text.short(rate)} Hz, jitter {text.span(first.jitter_s, 2)}")
        if first.left_out:
            notes.append(first.left_out)
        notes.append(f"0 dB = 1 {unit}" if self.level == "dB" else f"unit {unit}")
        kind = f"Hann {many(len(first.values), 'sample')}"
        return Analysed(drawn, notes, kind, peaks, top_hz, spectra[0], first.seconds)

    async def _pair(self) -> Analysed:
        if len(self.plots) < 2:
            raise ValueError(f"it needs two plots: {key_of('add_plot')} plots another")
        x, y = self.plots[0], self.plots[1]
        of_x, of_y = await self._samples(x), await self._samples(y)
        found = await asyncio.to_thread(pair_of, *of_x, *of_y)
        if len(found.x) < 2:
            raise ValueError(f"{len(found.x)} held, 2 needed of both at the same time")
        drawn = big_plot.of_pair(found, self.plot.plot_size)
        units = [plotted.element.unit for plotted in (x, y)]
        notes = [f"x  {self._label(x)}", f"y  {self._label(y)} over x"]
        if math.isnan(found.correlation):
            notes.append("r: one of them is constant")
        else:
            slope = f"slope {text.compact(found.slope)} {quotient(*units[::-1]).removeprefix('-')}".rstrip()
            notes.append(f"r = {found.correlation:.3f}  {slope}")
        is_work = sorted(units) == ["Nm", "rad"] or sorted(units) == ["N", "m"]
        unit = "J (hysteresis)" if is_work else product(*units).removeprefix("-")
        notes.append(f"loop area {text.compact(found.area)} {unit}".rstrip())
        both_ns = min(of_x[0][-1], of_y[0][-1]) - max(of_x[0][0], of_y[0][0])  # less than is shown, where less is held
        count = many(len(found.x), "sample")
        notes.append(f"newest ●  older • ∙ ·   {count} in {text.span(both_ns / SECOND_NS)}")
        return Analysed(drawn, notes)

    async def _histogram(self) -> Analysed:
        _, values = await self._samples(self.plots[0])
        floats = as_floats(values)
        finite = floats[np.isfinite(floats)]
        if not len(finite):
            raise ValueError(f"{len(floats)} held, none is a finite number")
        drawn = big_plot.of_histogram(histogram_of(finite, self.plot.plot_size[0]), self.plot.plot_size)
        return Analysed(drawn, _histogram_notes(floats, finite))

    def _label(self, plotted: Plotted) -> str:
        return self.session.short_name(plotted.name) + _unit(plotted)

    def cursor_words(self) -> str:
        """Where in time the cursor is: views without a time axis have none there."""
        return super().cursor_words() if self.mode == MODES[0] else ""

    # --------------------------------------------------------------------------------------------------- commands

    def add(self, new: Sequence[Plotted]) -> None:
        """Plot these in the monitor; here they come next."""
        stack = self.below.stack
        stack.keep([*stack.plots, *new])
        come = [each for each in new if each.numeric]
        self.plots[self.count : self.count] = come
        self.request_view()
        ways = {"detail_down": "shows it", "mode_xy": "is X-Y"} if come and self.count == 1 else {}
        ways["back"] = "leads to the plots"
        added = added_words([self.session.short_name(each.name) for each in new])
        self.say(f"{added}: " + ", ".join(f"{key_of(each)} {words}" for each, words in ways.items() if key_of(each)))

    def command_mode(self) -> None:
        self.show_as(MODES[(MODES.index(self.mode) + 1) % len(MODES)])

    def on_key(self, event: events.Key) -> None:
        """Say of the key that led here that it leads no further."""
        if key_text(event.key) == key_of("detail"):
            self.say(f"this is the large plot already: {key_of('back')} leaves it")
            event.prevent_default()  # nor that it has no use here

    def mode_keys(self) -> Sequence[tuple[str, str]]:
        """Return what a pause or a cursor asks for."""
        found = [each for each in super().mode_keys() if self.mode in CURSOR_MODES or each[0] != "cursor_left"]
        if self.mode != MODES[0] and len(self.plots) > len(self._shown_plots):
            found.append(("detail_down", f"Next of {len(self.plots)}"))
        return found

    def why_not_now(self, command_id: str) -> str:
        """Return why axes can't be swapped: only two signals over each other have two."""
        swaps_none = command_id == "detail_swap" and self.mode != "x-y"
        return "x-y only" if swaps_none else super().why_not_now(command_id)

    @property
    def plots_of_detail(self) -> Sequence[Plotted]:
        return self.plots

    def label_now(self, command: Command) -> str:
        label = "" if command.id == "cursor_left" and self.mode not in CURSOR_MODES else super().label_now(command)
        return OF_SPECTRA.get(command.id, label) if label and self.mode == "spectrum" else label

    def value_now(self, command_id: str) -> str:
        return {"level": self.level, "mode": self.mode}.get(command_id, super().value_now(command_id))

    def show_as(self, mode: str) -> None:
        self.mode = mode
        self.line.say("")
        self._found = NOTHING
        self._peak = self.plot.cursor = self._cursor_hz = None
        over_time = self.mode == MODES[0]
        self.stack.display, self.plot.display = over_time, not over_time
        self.show_between()
        self.call_after_refresh(self.request_view)

    def command_level(self) -> None:
        if self.mode == "spectrum":
            self.level = LEVELS[(LEVELS.index(self.level) + 1) % len(LEVELS)]
            self.line.say("")
            self.request_view()
        elif self.mode == MODES[0]:
            self.command_log_axis()
        else:
            self.say(f"{key_of('level')} is for signals over time and for spectra: {key_of('mode')} leads there")

    def command_find(self) -> None:
        """Find in what is drawn: moments over time, peaks in a spectrum."""
        if self.mode == MODES[0]:
            self.search.command_find()
        elif not self._found.peaks:
            self._go_to_peak(1)  # says why there is none
        else:
            words = ["highest peak", *(f"peak {number}" for number in range(2, len(self._found.peaks) + 1))]
            choices = [
                Choice(str(at), f"{word}, {self._hz(peak)} Hz", "h" if at == 0 else str(at + 1))
                for at, (word, peak) in enumerate(zip(words, self._found.peaks, strict=True))
            ]
            ask(self, Question("Find in the spectrum", "", choices), self._peak_chosen)

    def _peak_chosen(self, answer: str) -> None:
        if int(answer) < len(self._found.peaks):
            self._peak = int(answer)
            self._tell_peak()

    def command_find_on(self, step: int) -> None:
        if self.mode == MODES[0]:
            self.search.command_find_on(step)
        else:
            self._go_to_peak(step)

    def _go_to_peak(self, step: int) -> None:
        if not self._found.peaks:
            ways = f"{key_of('cursor_left')} read any frequency"
            self.say(
                f"no peak stands out; {ways}" if self.mode == "spectrum" else "peaks are in spectra: Tab leads there"
            )
            return
        before = self._peak if self._peak is not None else (-1 if step > 0 else len(self._found.peaks))
        self._peak = (before + step) % len(self._found.peaks)
        self._tell_peak()

    def _tell_peak(self) -> None:
        self._say_peak()
        self.draw_soon()

    def _say_peak(self) -> None:
        if words := self._peak_words():
            self._cursor_hz = hz = self._found.peaks[self._peak or 0].frequency_hz
            self.plot.cursor = big_plot.cell_of(hz, self._found.top_hz, self.plot.plot_size[0])
        self.say(words)

    def _peak_words(self) -> str:
        """Return what is said of the peak that one went to; empty without one, or where it is none any more."""
        if self._peak is None or self._peak >= len(self._found.peaks):
            return ""
        peak = self._found.peaks[self._peak]
        level = big_plot.level_words(peak.amplitude, self.level, self.plots[0].element.unit)
        return f"{self._letter(0)}peak {self._peak + 1}: {self._hz(peak)} Hz, {level}"

    def command_zoom(self, closer: bool) -> None:
        """Zoom over time; in a spectrum its frequencies, of which the lower half is looked at."""
        if self.mode != "spectrum" or self._found.spectrum is None:
            super().command_zoom(closer)
        elif not closer and not self._halved:
            self.say("that is the whole spectrum")
        elif closer and self._found.top_hz / 2 < LEAST_LINES * self._found.spectrum.step_hz:
            self.say(
                f"its lines are {text.compact(self._found.spectrum.step_hz)} Hz apart: a longer time has finer ones"
            )
        else:
            self._look_at(self._halved + (1 if closer else -1))

    def command_all_held(self) -> None:
        if self.mode == "spectrum":
            self._look_at(0)
        super().command_all_held()

    def _look_at(self, halved: int) -> None:
        self._halved, self._peak, self.plot.cursor = halved, None, None
        self.line.say("")
        self.request_view()

    def command_move_cursor(self, cells: int) -> None:
        if self.mode == MODES[0]:
            super().command_move_cursor(cells)
        elif self.mode == "spectrum":
            width, before = self.plot.plot_size[0], self.plot.cursor
            if before is None and self._found.peaks:
                self._put_cursor(big_plot.cell_of(self._found.peaks[0].frequency_hz, self._found.top_hz, width))
            else:
                self._put_cursor(width // 2 if before is None else max(0, min(width - 1, before + cells)))
        else:
            self.say(f"the cursor is over time and in spectra: {key_of('mode')} leads there")

    def on_detail_plot_cell_pointed(self, event: DetailPlot.CellPointed) -> None:
        if self.mode == "spectrum":
            self._put_cursor(event.cell)

    def _put_cursor(self, cell: int) -> None:
        self.plot.cursor, self._cursor_hz = cell, None
        self._tell_cursor()

    def _tell_cursor(self) -> None:
        """Tell of the cursor beside the plot, where it follows what comes, and nowhere else."""
        self.line.say("")
        if self.plot.plot is not None:
            self.plot.show(self.plot.plot, [*self._at_cursor(), *self._found.notes])

    def _read_at_cursor(self) -> Peak | None:
        """What a cursor in the spectrum reads; None where none is, or it is still being read."""
        if self.plot.cursor is None or self._found.spectrum is None:
            return None
        found, spectrum, width = self._found, self._found.spectrum, self.plot.plot_size[0]
        if self._cursor_hz is None:
            cell = min(self.plot.cursor, width - 1)
            self._cursor_hz = big_plot.line_in(spectrum, found.peaks, cell, found.top_hz, width).frequency_hz
        return big_plot.line_at(spectrum, found.peaks, self._cursor_hz)

    def _at_cursor(self) -> list[str]:
        """Where the cursor is in the spectrum."""
        if (read := self._read_at_cursor()) is None:
            return []
        level = big_plot.level_words(read.amplitude, self.level, self.plots[0].element.unit)
        return [f"A {self._hz(read)} Hz, {level}"]

    def _hz(self, peak: Peak) -> str:
        return _hz_words(peak, self._found.spectrum.step_hz if self._found.spectrum is not None else 1.0)

    def command_detail_swap(self) -> None:
        if len(self.plots) > 1:
            self.plots[0], self.plots[1] = self.plots[1], self.plots[0]
            self.stack.show_panels([tuple(self.plots[: self.count])])
        self.request_view()

    def command_turn_to_end(self, last: bool) -> None:
        self.command_turn_to((len(self.plots) - 1 if last else 0) - self._turned)

    def command_turn_to(self, step: int) -> None:
        """Show another one of the signals, alone; the others come behind it."""
        if len(self.plots) < 2:
            self.say(f"this is the only signal: {key_of('add_plot')} plots another")
            return
        self._turned = (self._turned + step) % len(self.plots)
        step %= len(self.plots)
        self.plots = self.plots[step:] + self.plots[:step]
        self.line.say("")
        self.count, self._peak = 1, None
        self.stack.show_panels([tuple(self.plots[:1])])
        self.request_view()

    def command_detail_refresh(self) -> None:
        if not self.session.connected:
            self.context.try_link()
        self.request_view()

    def way_back(self) -> tuple[str, Callable[[], None]]:
        """Return what Esc leaves: cursor B, the cursor, a view chosen here, the screen; the monitor keeps the pause."""
        if self.mode != MODES[0] and self.plot.cursor is not None:
            return "No cursor", self._lift_own_cursor
        with_cursor = self.window.other_ns is not None or self.window.cursor is not None
        if self.file is None and self.mode == MODES[0] and with_cursor:
            self.paused_alone = True  # the pause stays with the monitor
            return super().way_back()
        if self.mode != self._entered_as:
            return f"No {self.mode}" if self.mode != MODES[0] else "Back", self._as_entered
        return "", self._leave

    def _as_entered(self) -> None:
        self.show_as(self._entered_as)

    def _lift_own_cursor(self) -> None:
        self.plot.cursor = self._cursor_hz = None
        self._tell_cursor()

    def _leave(self) -> None:
        self.context.leave_screen()
        if self.below in self.app.screen_stack:
            self.below.take_back()


def open_large(monitor: MonitorScreen, mode: str) -> None:
    """Show the chosen plot alone, in one of `MODES`; say so where nothing of it can be drawn."""
    if not monitor.stack.plots:
        return
    if not monitor.stack.for_detail()[0]:
        texts = f"{many(len(monitor.stack.plots), 'text')}: nothing to draw"
        monitor.say(texts if monitor.file is not None else "nothing that is on to plot")
    else:
        monitor.app.push_screen(DetailScreen(monitor, mode))


def _unit(plotted: Plotted) -> str:
    return "" if plotted.element.unit == "-" else f" [{plotted.element.unit}]"


def _decimals(step: float) -> int:
    """How many decimals tell lines of a spectrum apart."""
    step *= 1.5  # a whole number of seconds, or a sample less, has as many
    return max(0, min(6, -math.floor(math.log10(step)))) if step > 0 else 3


def _hz_words(peak: Peak, step_hz: float) -> str:
    """Return where it is, to the digits of the resolution, and how far off where few of its periods are there."""
    blur = f" ±{text.short(step_hz / 2, 2)}" if _is_blurred(peak, step_hz) else ""
    return f"{peak.frequency_hz:.{_decimals(step_hz)}f}{blur}"


def _is_blurred(peak: Peak, step_hz: float) -> bool:
    """Whether so few periods of it are there that it lies anywhere around its line."""
    return peak.frequency_hz < 4 * step_hz


def _histogram_notes(floats: Floats, finite: Floats) -> list[str]:
    low, middle, high = (float(each) for each in np.percentile(finite, (1, 50, 99)))
    size = float(np.abs(finite).max()) or 1.0
    mean, std = float((finite / size).mean()) * size, float((finite / size).std()) * size
    least, most = float(finite.min()), float(finite.max())
    digits = text.digits_for((least, most), 12)
    words = [digits.write(value) for value in (mean, std, least, low, middle, high, most)]
    titles = ("mean", "std", "min", "1 %", "median", "99 %", "max")
    notes = [f"{title} {word}" for title, word in zip(titles, words, strict=True)]
    notes.insert(0, f"{text.count(len(finite))} samples")
    names = ((np.isnan(floats), "nan"), (floats == np.inf, "inf"), (floats == -np.inf, "-inf"))
    return notes + [f"{int(here.sum())} {name} left out" for here, name in names if here.any()]

# ruff: noqa: D102 - what a command does stands in actions.py, once
"""One large plot: signals over time, one against another, their spectrum, a histogram.

Reading and computing happen in a worker when asked, never while keys are waiting.
"""

import asyncio
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from textual import events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.timer import Timer
from textual.widgets import Static

from silo.amounts import duration
from silo.errors import SiloError
from silo.values import as_floats
from silo_tui.actions import bindings_for
from silo_tui.context import SiloScreen
from silo_tui.model import big_plot, text
from silo_tui.model.big_plot import BigPlot
from silo_tui.model.columns import ColumnStore, Floats
from silo_tui.model.panels import LETTERS, sides
from silo_tui.model.plots import MAX_COLUMNS, SECOND_NS, SPANS_S, Plotted, PlotWindow
from silo_tui.model.recorded import SHORT_SPANS_S
from silo_tui.model.source import PlotSource, Samples
from silo_tui.model.spectra import (
    MOST_PEAKS,
    Peak,
    Piece,
    Spectrum,
    histogram_of,
    longest_piece,
    pair_of,
    peaks_of,
    spectrum_of,
)
from silo_tui.screens.exporting import ask_export
from silo_tui.sessions.live import Session
from silo_tui.widgets.bars import KeyBar
from silo_tui.widgets.detail_plot import DetailPlot

MODES = ("time", "x-y", "spectrum", "histogram")
LEVELS = ("linear", "log", "dB")
MAX_SERIES = 8
DEBOUNCE_S = 0.15
FAR = 10
FEW_PEAKS = 6  # as many as two lines of 80 cells hold


@dataclass(frozen=True)
class Analysed:
    """A plot, and what is said of it."""

    plot: BigPlot
    notes: Sequence[str]
    kind: str = ""  # what stands in the title
    peaks: Sequence[Peak] = ()
    top_hz: float = 0.0


class DetailScreen(SiloScreen):
    """A plot of up to eight entries: the first `count` of `plots` are those of the panel that was chosen."""

    scope = "detail"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("detail")

    def __init__(
        self,
        session: Session,
        source: PlotSource,
        plots: Sequence[Plotted],
        end_ns: int,
        span_s: float,
        count: int = 1,
    ) -> None:
        super().__init__()
        self.session = session
        self.source = source
        self.plots = list(plots[:MAX_SERIES])
        self.count = min(count, MAX_SERIES)
        self.end_ns = end_ns
        self.span_s = span_s
        self.mode = MODES[0]
        self.level = LEVELS[0]
        self._said = ""
        self._kind = ""
        self._peaks: Sequence[Peak] = ()
        self._peak: int | None = None
        self._top_hz = 0.0
        self._timer: Timer | None = None
        self._turned = 0  # which of the signals stands first now

    def compose(self) -> ComposeResult:
        """Yield title, plot, keys."""
        yield Static("", id="detail-title", markup=False)
        self.plot = DetailPlot()
        yield self.plot
        yield KeyBar(self.scope)

    def on_resize(self, event: events.Resize) -> None:
        """Draw anew."""
        self.draw_soon()

    def draw_soon(self) -> None:
        """Draw when what is wanted has settled."""
        self._title()
        if self._timer is not None:
            self._timer.stop()
        self._timer = self.set_timer(DEBOUNCE_S, self._begin)

    def say(self, words: str) -> None:
        """Show the result of something."""
        self._said = words
        self._title()

    def _title(self) -> None:
        shown = self.plots[: self.count if self.mode in {"time", "spectrum"} else 2 if self.mode == "x-y" else 1]
        names = "  ".join(f"{self._letter(place)}{self._label(plotted)}" for place, plotted in enumerate(shown))
        level = f" {self.level}" if self.mode == "spectrum" else ""
        name = self.session.name if self.size.width >= 100 else text.shorten_left(self.session.name, 12)
        parts = [f"silo {name}", f"{self.mode.upper()}{level}", *([self._kind] if self._kind else [])]
        parts += [self._place(), *([self._said] if self._said else [])]
        room = self.size.width - len("  ".join(parts)) - 6
        parts.insert(1, text.shorten_left(names, max(12, room)))
        while self._said and len(parts) > 1 and len("  ".join(parts)) > self.size.width:
            parts.pop(0)  # what was said last is read whole
        for title in self.query("#detail-title").results(Static):  # none while the screen goes
            title.update("  ".join(parts))

    def _letter(self, place: int) -> str:
        return f"{LETTERS[place]} " if self.count > 1 or self.mode == "x-y" else ""

    def _place(self) -> str:
        back = (self.source.end_ns - self.end_ns) / SECOND_NS
        paused = "" if self.source.live else "PAUSED  "  # the monitor holds it
        return paused + text.span(self.span_s) + (f"  ends {text.span(back)} before the newest" if back > 0.5 else "")

    @property
    def zero_ns(self) -> int:
        """The moment that the axis calls 0: in a pause the newest one, as in the plots."""
        back_ns = self.source.end_ns - self.end_ns
        return self.end_ns if self.source.live or abs(back_ns) < self._span_ns // 100 else self.source.end_ns

    def _begin(self) -> None:
        self.run_worker(self._draw(), group="draw", exclusive=True)

    async def _draw(self) -> None:
        ways = {"time": self._time, "spectrum": self._spectrum, "x-y": self._pair, "histogram": self._histogram}
        try:
            found = await ways[self.mode]()
        except SiloError as error:
            self.plot.say(f"No data: {error}")
            return
        except ValueError as short:
            self.plot.say(f"{self.mode} of {self._label(self.plots[0])}: {short}")
            return
        self._kind, self._peaks, self._top_hz = found.kind, found.peaks, found.top_hz
        self.plot.show(found.plot, [*found.notes, *self._at_cursor()])
        self._title()

    @property
    def _span_ns(self) -> int:
        return round(self.span_s * SECOND_NS)

    async def _time(self) -> Analysed:
        plots = [plotted for plotted in self.plots[: self.count] if plotted.numeric]
        self.plot.two_sided = any(sides(tuple(plots)))
        width, _ = self.plot.plot_size
        names = [plotted.name for plotted in plots]
        store = ColumnStore(names, 2 * width, max(1, math.ceil(self._span_ns / (2 * width))))
        past = await self.source.history(names, self.end_ns - self._span_ns, self.end_ns, store.column_ns)
        store.advance_to(self.end_ns // store.column_ns + 1)
        store.take(past)
        if np.isnan(store.low).all() and not store.marks.any():
            raise ValueError("no sample in this window")
        window = PlotWindow(self.span_s)
        below = [self._time_word(share) for share in (0, 0.25, 0.5, 0.75, 1)]
        drawn = big_plot.over_time(store, window, plots, self.plot.plot_size, self.source.period_ns, below)
        notes = []
        for place, plotted in enumerate(plots):
            finite = store.low[place][np.isfinite(store.low[place])], store.high[place][np.isfinite(store.high[place])]
            ends = text.told_apart(float(finite[0].min()), float(finite[1].max())) if len(finite[0]) else ("-", "-")
            base = f" from {store.base(place)}" if store.base(place) else ""
            notes.append(f"{self._letter(place)}{self._label(plotted)}  min {ends[0]}  max {ends[1]}{base}")
        return Analysed(drawn, notes)

    def _time_word(self, share: float) -> str:
        at_ns = self.end_ns - round(self._span_ns * (1 - share))
        decimals = max(0, min(9, 2 - math.floor(math.log10(self.span_s / 4))))
        return f"{(at_ns - self.zero_ns) / SECOND_NS + 0.0:.{decimals}f} s"

    async def _samples(self, plotted: Plotted) -> Samples:
        """Raw samples; where there are none, the middle of columns of one sample each."""
        start_ns = self.end_ns - self._span_ns
        try:
            return await self.source.samples(plotted.name, start_ns, self.end_ns)
        except SiloError:
            period = self.source.period_ns(plotted.element.name)
            column_ns = max(period, math.ceil(self._span_ns / (MAX_COLUMNS - 2)))
            past = await self.source.history([plotted.name], start_ns, self.end_ns, column_ns)
            middle = past.low[0] / 2 + past.high[0] / 2 + past.bases.get(0, 0)
            times = (past.first + np.arange(len(middle), dtype=np.int64)) * column_ns
            return times[~np.isnan(middle)], middle[~np.isnan(middle)]

    async def _spectrum(self) -> Analysed:
        spectra: list[Spectrum] = []
        pieces: list[Piece] = []
        plots = [plotted for plotted in self.plots[: self.count] if plotted.numeric]
        for plotted in plots:
            piece = longest_piece(*await self._samples(plotted))
            pieces.append(piece)
            spectra.append(await asyncio.to_thread(spectrum_of, piece))
        unit, peaks = plots[0].element.unit, peaks_of(spectra[0], MOST_PEAKS if self.plot.beside else FEW_PEAKS)
        drawn = big_plot.of_spectra(spectra, peaks, self.level, self.plot.plot_size, self._peak)
        first, step = pieces[0], spectra[0].step_hz
        words = [
            f"{number}  {peak.frequency_hz:.{_decimals(step)}f} Hz  "
            + big_plot.level_words(peak.amplitude, self.level, unit)
            for number, peak in enumerate(peaks, 1)
        ]
        notes = [f"peak {words[0]}", *words[1:]] if words else ["no peak stands out"]
        rate = 1 / first.period_s
        notes.append(f"{text.compact(step)} Hz a line")
        notes.append(f"{duration(first.seconds)} of {rate:.4g} Hz, jitter {text.span(float(f'{first.jitter_s:.2g}'))}")
        if len(first.values) < first.held:
            notes.append(f"longest whole piece: {len(first.values)} of {first.held} samples")
        notes.append(f"0 dB = 1 {unit}" if self.level == "dB" else f"unit {unit}")
        top_hz = max(len(each.amplitudes) * each.step_hz for each in spectra)
        return Analysed(drawn, notes, f"Hann {len(first.values)} of {first.held}", peaks, top_hz)

    async def _pair(self) -> Analysed:
        if len(self.plots) < 2:
            raise ValueError("it needs two plots: mark two elements")
        x, y = self.plots[0], self.plots[1]
        found = await asyncio.to_thread(pair_of, *await self._samples(x), *await self._samples(y))
        if len(found.x) < 2:
            raise ValueError(f"{len(found.x)} held, 2 needed of both at the same time")
        drawn = big_plot.of_pair(found, self.plot.plot_size)
        units = [plotted.element.unit for plotted in (x, y)]
        notes = [f"x  a {self._label(x)}", f"y  b {self._label(y)} over x"]
        if math.isnan(found.correlation):
            notes.append("r: one of them is constant")
        else:
            per = "" if units == ["-", "-"] else f" {units[1]}/{units[0]}"
            notes.append(f"r = {found.correlation:.3f}  slope {text.compact(found.slope)}{per}")
        work = " J (hysteresis)" if sorted(units) == ["Nm", "rad"] or sorted(units) == ["N", "m"] else ""
        notes.append(f"loop area {text.compact(found.area)}{work}")
        notes.append(f"newest ●  older • ∙ ·   {len(found.x)} samples in {text.span(self.span_s)}")
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
        unit = "" if plotted.element.unit == "-" else f" [{plotted.element.unit}]"
        return self.session.short_name(plotted.name) + unit

    # --------------------------------------------------------------------------------------------------- commands

    def command_mode(self) -> None:
        self.mode = MODES[(MODES.index(self.mode) + 1) % len(MODES)]
        self._said = self._kind = ""
        self._peak = self.plot.cursor = None
        self.plot.two_sided = False
        self._peaks = ()
        self.draw_soon()

    def command_level(self) -> None:
        if self.mode != "spectrum":
            self.say("Y is for spectra: Tab leads there")
            return
        self.level = LEVELS[(LEVELS.index(self.level) + 1) % len(LEVELS)]
        self._said = ""
        self.draw_soon()

    def command_next_peak(self) -> None:
        self._go_to_peak(1)

    def command_previous_peak(self) -> None:
        self._go_to_peak(-1)

    def _go_to_peak(self, step: int) -> None:
        if not self._peaks:
            self.say("no peaks" if self.mode == "spectrum" else "peaks are in spectra: Tab leads there")
            return
        before = self._peak if self._peak is not None else (-1 if step > 0 else len(self._peaks))
        self._peak = (before + step) % len(self._peaks)
        peak = self._peaks[self._peak]
        level = big_plot.level_words(peak.amplitude, self.level, self.plots[0].element.unit)
        self._said = f"peak {self._peak + 1}: {peak.frequency_hz:.6g} Hz, {level}"
        self.draw_soon()

    def command_detail_cursor_left(self) -> None:
        self._move_cursor(-1)

    def command_detail_cursor_right(self) -> None:
        self._move_cursor(1)

    def command_detail_cursor_far_left(self) -> None:
        self._move_cursor(-FAR)

    def command_detail_cursor_far_right(self) -> None:
        self._move_cursor(FAR)

    def _move_cursor(self, cells: int) -> None:
        if self.mode not in {"time", "spectrum"}:
            return
        width = self.plot.plot_size[0]
        before = self.plot.cursor
        self.plot.cursor = width // 2 if before is None else max(0, min(width - 1, before + cells))
        self._said = " ".join(self._at_cursor())
        self._title()
        self.plot.refresh()

    def _at_cursor(self) -> list[str]:
        """Where the cursor is."""
        if self.plot.cursor is None:
            return []
        share = (self.plot.cursor + 0.5) / self.plot.plot_size[0]
        return [f"A {share * self._top_hz:.5g} Hz" if self.mode == "spectrum" else f"A {self._time_word(share)}"]

    def command_detail_closer(self) -> None:
        self._zoom(-1)

    def command_detail_wider(self) -> None:
        self._zoom(1)

    def _zoom(self, step: int) -> None:
        spans = SPANS_S if self.source.live else (*SHORT_SPANS_S, *SPANS_S)  # as the plots it was opened from
        nearest = min(range(len(spans)), key=lambda at: abs(spans[at] - self.span_s))
        self.span_s = spans[max(0, min(len(spans) - 1, nearest + step))]
        self.draw_soon()

    def command_detail_earlier(self) -> None:
        self.end_ns -= round(self.span_s * SECOND_NS) // 4
        self.draw_soon()

    def command_detail_later(self) -> None:
        self.end_ns = min(self.source.end_ns, self.end_ns + round(self.span_s * SECOND_NS) // 4)
        self.draw_soon()

    def command_export_plots(self) -> None:
        shown = (self.end_ns - self._span_ns, self.end_ns)
        ask_export(self, self.source, [tuple(self.plots[: self.count])], shown, self.zero_ns)

    def command_detail_swap(self) -> None:
        if len(self.plots) > 1:
            self.plots[0], self.plots[1] = self.plots[1], self.plots[0]
        self.draw_soon()

    def command_detail_down(self) -> None:
        self._turn_to(1)

    def command_detail_up(self) -> None:
        self._turn_to(-1)

    def command_detail_top(self) -> None:
        self._turn_to(-self._turned)

    def command_detail_bottom(self) -> None:
        self._turn_to(len(self.plots) - 1 - self._turned)

    def _turn_to(self, step: int) -> None:
        """Show another one of the signals, alone; the others come behind it."""
        if len(self.plots) < 2:
            self.say("this is the only signal: mark several, then m and Enter")
            return
        self._turned = (self._turned + step) % len(self.plots)
        step %= len(self.plots)
        self.plots = self.plots[step:] + self.plots[:step]
        self.count, self._said, self._peak = 1, "", None
        self.draw_soon()

    def command_detail_oldest(self) -> None:
        self._show_held(self.source.begin_ns + self._span_ns)

    def command_detail_newest(self) -> None:
        self.end_ns = self.source.end_ns
        self.draw_soon()

    def command_detail_all(self) -> None:
        held_s = (self.source.end_ns - self.source.begin_ns) / SECOND_NS
        if self.source.begin_ns:
            self.span_s = next((span for span in SPANS_S if span >= held_s), SPANS_S[-1])
        self._show_held(self.source.end_ns)

    def _show_held(self, end_ns: int) -> None:
        """Let the window end there; live nobody knows what is held, as it goes at any moment."""
        if not self.source.begin_ns:
            self.say("live, older rows go at any moment: Esc, space holds them, then Enter again")
            return
        self.end_ns = min(end_ns, self.source.end_ns)
        self.draw_soon()

    def command_detail_refresh(self) -> None:
        self.end_ns = self.source.end_ns
        self.draw_soon()

    def command_back(self) -> None:
        self.context.leave_screen()


def _decimals(step: float) -> int:
    """How many decimals tell lines of a spectrum apart."""
    return max(0, min(6, -math.floor(math.log10(step)))) if step > 0 else 3


def _histogram_notes(floats: Floats, finite: Floats) -> list[str]:
    low, middle, high = (float(each) for each in np.percentile(finite, (1, 50, 99)))
    size = float(np.abs(finite).max()) or 1.0
    mean, std = float((finite / size).mean()) * size, float((finite / size).std()) * size
    notes = [
        f"{text.count(len(finite))} samples",
        f"mean {text.compact(mean)}",
        f"std {text.compact(std)}",
        f"min {text.compact(float(finite.min()))}",
        f"1 % {text.compact(low)}",
        f"median {text.compact(middle)}",
        f"99 % {text.compact(high)}",
        f"max {text.compact(float(finite.max()))}",
    ]
    names = ((np.isnan(floats), "nan"), (floats == np.inf, "inf"), (floats == -np.inf, "-inf"))
    return notes + [f"{int(here.sum())} {name} left out" for here, name in names if here.any()]

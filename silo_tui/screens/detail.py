# ruff: noqa: D102 - what a command does stands in actions.py, once
"""One large plot with axes, drawn by plotext: several series over time, one against another, or their spectrum.

plotext needs 140 ms and more a frame, so it draws in a thread, when asked, and never while keys are waiting.
"""

import asyncio
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from rich.text import Text
from textual import events
from textual.app import ComposeResult
from textual.binding import Binding
from textual.timer import Timer
from textual.widgets import Static

from silo.columns import HistoryColumns
from silo.errors import SiloError
from silo_tui.actions import bindings_for
from silo_tui.context import SiloScreen
from silo_tui.model import text
from silo_tui.model.columns import Floats
from silo_tui.model.plots import MAX_COLUMNS, SECOND_NS, SPANS_S, Plotted
from silo_tui.model.source import PlotSource
from silo_tui.sessions.live import Session
from silo_tui.widgets.bars import KeyBar

if TYPE_CHECKING:
    from silo.analysis.plotting import Chart

MODES = ("time", "x-y", "spectrum")
MAX_SERIES = 6
DEBOUNCE_S = 0.15


class DetailScreen(SiloScreen):
    """A plot of up to six entries; the first is the one that was chosen."""

    scope = "detail"
    BINDINGS: ClassVar[list[Binding | tuple[str, str] | tuple[str, str, str]]] = bindings_for("detail")

    def __init__(
        self, session: Session, source: PlotSource, plots: Sequence[Plotted], end_ns: int, span_s: float
    ) -> None:
        super().__init__()
        self.session = session
        self.source = source
        self.plots = list(plots[:MAX_SERIES])
        self.end_ns = end_ns
        self.span_s = span_s
        self.mode = MODES[0]
        self._said = "" if len(plots) <= MAX_SERIES else f"the first {MAX_SERIES} of {len(plots)}"
        self._timer: Timer | None = None

    def compose(self) -> ComposeResult:
        """Yield title, plot, keys."""
        yield Static("", id="detail-title", markup=False)
        yield Static("drawing …", id="detail-plot", markup=False)
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
        parts = [f"silo {self.session.name}", self.mode, self._place()]
        if self._said:
            parts.append(self._said)
        self.query_one("#detail-title", Static).update("  ".join(parts))

    def _place(self) -> str:
        back = (self.source.end_ns - self.end_ns) / SECOND_NS
        return text.span(self.span_s) + (f"  ends {text.span(back)} before the newest" if back > 0.5 else "")

    @property
    def zero_ns(self) -> int:
        """The moment that the axis calls 0."""
        return self.end_ns

    def _begin(self) -> None:
        self.run_worker(self._draw(), group="draw", exclusive=True)

    async def _draw(self) -> None:
        from silo.analysis.plotting import draw_text

        plot = self.query_one("#detail-plot", Static)
        size = plot.size
        span_ns = round(self.span_s * SECOND_NS)
        column_ns = self._column_ns(size.width, span_ns)
        names = [plotted.name for plotted in self.plots]
        try:
            past = await self.source.history(names, self.end_ns - span_ns, self.end_ns, column_ns)
        except SiloError as error:
            plot.update(f"No data: {error}")
            return
        chart = self._chart(past)
        if chart is None:
            plot.update("There is no data in this window.")
            return
        color = not self.app.no_color
        drawn = await asyncio.to_thread(draw_text, chart, size.width, size.height, color=color)
        plot.update(Text.from_ansi(drawn, no_wrap=True))

    def _column_ns(self, width: int, span_ns: int) -> int:
        """Return two columns per cell over time; one per sample where phases and frequencies matter."""
        period = max(self.source.period_ns(plotted.element.name) for plotted in self.plots)
        columns = 2 * max(10, width) if self.mode == "time" else MAX_COLUMNS
        return max(math.ceil(span_ns / columns), period if self.mode != "time" else 1)

    def _chart(self, past: HistoryColumns) -> "Chart | None":
        from silo.analysis.plotting import Chart, Curve

        count = past.low.shape[1]
        if not count or np.isnan(past.low).all():
            return None
        bases = [past.bases.get(row, 0) for row in range(len(self.plots))]
        seconds = ((past.first + np.arange(count)) * past.column_ns - self.zero_ns) / SECOND_NS
        units = list(dict.fromkeys(plotted.element.unit for plotted in self.plots))
        labels = [
            self._label(plotted) + (f" - {base}" if base else "")
            for plotted, base in zip(self.plots, bases, strict=True)
        ]
        if self.mode == "x-y" and len(self.plots) > 1:
            x, y = (_middle(past, row) for row in (0, 1))
            good = ~(np.isnan(x) | np.isnan(y))
            return Chart([Curve(f"{labels[1]} over {labels[0]}", x[good], y[good])], "", labels[0], labels[1])
        if self.mode == "spectrum":
            curves = [Curve(label, *_spectrum(_middle(past, row), past.column_ns)) for row, label in enumerate(labels)]
            return Chart(curves, "", "frequency [Hz]", "amplitude")
        curves = []
        for row, plotted in enumerate(self.plots):
            x, y = _outline(seconds, past.low[row], past.high[row])
            curves.append(Curve(labels[row], x, y, len(units) == 2 and plotted.element.unit == units[1]))
        ticks = self.plots[0].entry.labels if len(self.plots) == 1 else None
        right = units[1] if len(units) == 2 else ""
        return Chart(curves, "", "time [s]", units[0] if len(units) <= 2 else "", right, ticks or {})

    def _label(self, plotted: Plotted) -> str:
        unit = "" if plotted.element.unit == "-" else f" [{plotted.element.unit}]"
        return self.session.short_name(plotted.name) + unit

    # --------------------------------------------------------------------------------------------------- commands

    def command_mode(self) -> None:
        self.mode = MODES[(MODES.index(self.mode) + 1) % len(MODES)]
        self._said = "x-y needs two plots: mark two elements" if self.mode == "x-y" and len(self.plots) < 2 else ""
        self.draw_soon()

    def command_detail_closer(self) -> None:
        self._zoom(-1)

    def command_detail_wider(self) -> None:
        self._zoom(1)

    def _zoom(self, step: int) -> None:
        self.span_s = SPANS_S[max(0, min(len(SPANS_S) - 1, SPANS_S.index(self.span_s) + step))]
        self.draw_soon()

    def command_detail_left(self) -> None:
        self.end_ns -= round(self.span_s * SECOND_NS) // 4
        self.draw_soon()

    def command_detail_right(self) -> None:
        self.end_ns = min(self.source.end_ns, self.end_ns + round(self.span_s * SECOND_NS) // 4)
        self.draw_soon()

    def command_detail_swap(self) -> None:
        if len(self.plots) > 1:
            self.plots[0], self.plots[1] = self.plots[1], self.plots[0]
        self.draw_soon()

    def command_detail_refresh(self) -> None:
        self.end_ns = self.source.end_ns
        self.draw_soon()

    def command_back(self) -> None:
        self.context.leave_screen()


def _middle(past: HistoryColumns, row: int) -> Floats:
    middle: Floats = past.low[row] / 2 + past.high[row] / 2
    return middle


def _outline(seconds: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Return minimum and maximum of each column in turn, so that spikes show; empty columns are left out."""
    good = ~np.isnan(low)
    pairs: Floats = np.column_stack([low[good], high[good]])
    return np.repeat(seconds[good], 2), pairs.reshape(-1)


def _spectrum(values: Floats, column_ns: int) -> tuple[Floats, Floats]:
    """Return frequencies and single-sided amplitudes, by a Hann window; lines bridge gaps."""
    good = np.isfinite(values)
    if good.sum() < 8:
        return np.zeros(0), np.zeros(0)
    first, last = np.flatnonzero(good)[[0, -1]]
    values, good = values[first : last + 1], good[first : last + 1]
    values = np.interp(np.arange(len(values)), np.flatnonzero(good), values[good])
    hann = np.hanning(len(values))
    amplitudes = 2 * np.abs(np.fft.rfft((values - values.mean()) * hann)) / hann.sum()
    frequencies: Floats = np.asarray(np.fft.rfftfreq(len(values), column_ns / SECOND_NS), np.float64)
    return frequencies[1:], np.asarray(amplitudes[1:], np.float64)

"""Charts of signals: as text for a terminal (plotext), or as a PNG file (matplotlib, an extra; no display needed).

A `Chart` is plain data; who makes one needs to know nothing of either library. Both are imported when they are used:
they cost 70 and 400 ms.
"""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.analysis.plots.limit_lines import DrawnBound
from silo.core.arrays.columns import bins_at, reduce
from silo.files.optional_packages import need, whole_file
from silo.printing import printable

Floats = NDArray[np.float64]

MIN_WIDTH = 30
MIN_HEIGHT = 8
LEAST_DRAWN = 6  # rows: frame, ticks, labels, and two of curves
MOST_EVENTS = 50  # lines of a plot
_COLORS = (("blue+", 94), ("orange", 33), ("green+", 92), ("magenta+", 95), ("cyan+", 96), ("red+", 91))
# without colours curves must differ by shape; one alone is drawn finer
_SHAPES = "•×+o#*%@"
_FINE = "braille"
# of points that can't be thinned out by column, as in an x-y plot
_MAX_POINTS = 4000
_FLAT = 1e-12
# beyond, differences overflow; below, they vanish
_HUGE, _TINY = 1e300, 1e-300
_SMALL = 1e-280
_SIDES = (("left", False), ("right", True))


@dataclass(frozen=True)
class Curve:
    """One line: `x` and `y` of shape `(m,)`; NaN in either is a gap. `right` puts it on the axis on the right."""

    label: str
    x: Floats
    y: Floats
    right: bool = False


@dataclass(frozen=True)
class Chart:
    """What one plot shows. The ticks name values (of enumerations) on the left and the right axis, and on x.

    `events` are thin lines across the plot: where on x, and what happened there. `levels` are limits: lines along it.
    `right_span` is where the axis on the right goes from and to, if not to the curves' ends.
    """

    curves: Sequence[Curve]
    title: str = ""
    x_label: str = ""
    left_label: str = ""
    right_label: str = ""
    left_ticks: Mapping[int, str] = field(default_factory=dict)
    right_ticks: Mapping[int, str] = field(default_factory=dict)
    events: Sequence[tuple[float, str]] = ()
    levels: Sequence[DrawnBound] = ()
    x_ticks: Mapping[float, str] = field(default_factory=dict)
    right_span: tuple[float, float] | None = None


def draw_text(chart: Chart, width: int = 80, height: int = 24, *, color: bool = True) -> str:
    """The chart as lines of at most `width` columns, `height` rows with the legend, no line feed at the end.

    Without `color` there are no escape sequences, and several curves differ by their marks. A size below
    `MIN_WIDTH` x `MIN_HEIGHT` is taken as that.
    """
    chart = _printable(chart)
    width, height = max(width, MIN_WIDTH), max(height, MIN_HEIGHT)
    marks = [
        _FINE if color or len(chart.curves) == 1 else _SHAPES[at % len(_SHAPES)] for at in range(len(chart.curves))
    ]
    # a legend of more than half the height leaves no plot, nor does one that takes the rows of frame, axis and curves
    legend = [*_legend(chart, marks, width, color), *_level_legend(chart, width, color), *_event_legend(chart, width)]
    room = max(1, min(height // 2, height - LEAST_DRAWN))
    if len(legend) > room:
        legend = [*legend[: room - 1], f"   ... and {len(legend) - room + 1} more"]
    return "\n".join([_draw(chart, marks, width, height - len(legend), color), *legend])


def _printable(chart: Chart) -> Chart:
    """Return a chart of whose words none can be taken for one of the escape sequences that it is drawn with."""
    return replace(
        chart,
        curves=[replace(curve, label=printable(curve.label)) for curve in chart.curves],
        title=printable(chart.title),
        x_label=printable(chart.x_label),
        left_label=printable(chart.left_label),
        right_label=printable(chart.right_label),
        events=[(at, printable(words)) for at, words in chart.events],
        levels=[replace(level, words=printable(level.words)) for level in chart.levels],
    )


def draw_png(
    chart: Chart | Sequence[Chart], path: str | os.PathLike[str], width: int = 1200, height: int = 700
) -> None:
    """The chart, or several below each other, as a PNG file of `width` x `height` pixels.

    Raises `SiloError` without matplotlib.
    """
    figures, agg = (need(f"matplotlib.{one}", "plot", "PNG files") for one in ("figure", "backends.backend_agg"))
    figure = figures.Figure(figsize=(width / 100, height / 100), dpi=100, layout="constrained")
    canvas = agg.FigureCanvasAgg(figure)
    charts = [chart] if isinstance(chart, Chart) else list(chart)
    for place, one in enumerate(charts, 1):
        draw_axes(one, figure.add_subplot(len(charts), 1, place))
    figure.legend(loc="outside lower center", ncols=3)
    with whole_file(Path(path)) as file:
        canvas.print_png(file)


def draw_axes(chart: Chart, left: Any) -> None:
    """Draw the chart on axes of matplotlib; what belongs on the right gets axes of its own there."""
    right = left.twinx() if any(curve.right for curve in chart.curves) else None
    for index, curve in enumerate(chart.curves):
        axes = right if curve.right and right is not None else left
        # a stroke of its own for the right axis: colours start again in each
        axes.plot(curve.x, curve.y, label=curve.label, color=f"C{index}", linestyle="--" if curve.right else "-")
    left.set(title=chart.title, xlabel=chart.x_label, ylabel=chart.left_label)
    left.grid(visible=True, alpha=0.3)
    for at, words in chart.events[:MOST_EVENTS]:
        left.axvline(at, color="0.5", linewidth=0.8, linestyle=":")
        place = {"rotation": 90, "fontsize": 7, "color": "0.4", "va": "top", "ha": "right"}
        left.text(at, 0.99, shorten(words, 40), transform=left.get_xaxis_transform(), **place)
    for level in chart.levels:
        if level.inside:
            axes = right if level.right and right is not None else left
            axes.axhline(level.value, color="tab:red" if level.red else "goldenrod", linewidth=1.0, linestyle="-.")
            place = {"fontsize": 7, "color": "0.4", "va": "bottom", "ha": "right" if level.right else "left"}
            at = 0.99 if level.right else 0.01
            axes.text(
                at, level.value, f"{level.words} {level.value:.6g}", transform=axes.get_yaxis_transform(), **place
            )
    if chart.x_ticks:
        left.set_xticks(list(chart.x_ticks), list(chart.x_ticks.values()))
    _name_ticks(left, chart.left_ticks)
    if right is not None:
        right.set_ylabel(chart.right_label)
        if chart.right_span is not None:
            right.set_ylim(*chart.right_span)
        _name_ticks(right, chart.right_ticks)


def thin_out(x: Floats, y: Floats, columns: int) -> tuple[Floats, Floats]:
    """Minimum and maximum of each of `columns` spans of a rising `x`, so that a spike of one sample still shows.

    Gaps (NaN) stay gaps. What has few points, or an `x` that doesn't rise (x-y plots), stays as it is, but for a limit
    on the number of points.
    """
    finite = np.isfinite(x)
    x, y = x[finite], np.where(np.isfinite(y), y, np.nan)[finite]
    if len(x) <= 2 * columns:
        return x, y
    if np.any(np.diff(x) < 0):
        step = -(-len(x) // _MAX_POINTS)
        return x[::step], y[::step]
    starts = np.unique(np.searchsorted(x, np.linspace(x[0], x[-1], columns + 1)[:-1], side="left"))
    found = reduce(y, bins_at(starts))
    ends = np.append(starts[1:], len(x)) - 1
    return np.column_stack([x[starts], x[ends]]).reshape(-1), np.column_stack([found.low, found.high]).reshape(-1)


def nice_ticks(low: float, high: float, count: int) -> list[float]:
    """About `count` round numbers from `low` to `high`: 1, 2 or 5 times a power of ten apart."""
    rough = (high - low) / max(count, 1)
    if not math.isfinite(rough) or rough < _TINY:
        return []
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * factor for factor in (1, 2, 5, 10) if power * factor >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    ticks = [number * step for number in range(first, last + 1)]
    # far from zero, neighbouring ticks may be one and the same number
    return ticks if len(set(ticks)) == len(ticks) else []


def _draw(chart: Chart, marks: Sequence[str], width: int, height: int, color: bool) -> str:
    import plotext

    plotext.terminal.limit(False, False)
    figure = plotext.figure
    figure.clear()
    figure.plot_size(width, height)
    figure.theme("simple")
    limits: dict[object, list[float]] = {}
    powers = {side: _power([curve.y for curve in chart.curves if curve.right is right]) for side, right in _SIDES}
    for index, (curve, mark) in enumerate(zip(chart.curves, marks, strict=True)):
        side = "right" if curve.right else "left"
        values = np.where(np.isfinite(curve.y), np.clip(curve.y, -_HUGE, _HUGE), np.nan)
        x, y = thin_out(curve.x, _enlarged(values, powers[side]), 2 * width)
        x, y, connected = _segments(x, y)
        pixel = _COLORS[index % len(_COLORS)][0] if color else None
        signal = figure.signal(x.tolist(), y.tolist(), marker=plotext.marker(mark, pixel=pixel), yside=side)
        signal.lines(True)
        for gap in np.flatnonzero(~connected).tolist():
            signal.line(gap, False)
        figure.draw(signal)
        if len(x):
            limits.setdefault("x", []).extend((float(x.min()), float(x.max())))
            limits.setdefault(side, []).extend((float(y.min()), float(y.max())))
    if chart.right_span is not None:
        limits.setdefault("right", []).extend(chart.right_span)
    _draw_levels(figure, chart, limits, powers, color=color)
    _draw_events(figure, chart, limits)
    _set_ruler(figure.ruler(axis="x"), limits.get("x"), width // 12, chart.x_ticks)
    _set_ruler(figure.ruler(axis="y", side="left"), limits.get("left"), height // 4, chart.left_ticks, powers["left"])
    right = figure.ruler(axis="y", side="right")
    _set_ruler(right, limits.get("right"), height // 4, chart.right_ticks, powers["right"])
    if chart.title:
        figure.title(shorten(chart.title, width))
    third = width // 3 - 1
    labels = ((chart.x_label, "x", "lower"), (chart.left_label, "y", "left"), (chart.right_label, "y", "right"))
    for text, axis, side in labels:
        if text:
            figure.label(shorten(text, third), axis=axis, side=side)
    text = figure.build().string(colorless=not color)
    return "\n".join(line.rstrip() for line in str(text).rstrip("\n").split("\n"))


def _draw_levels(
    figure: Any, chart: Chart, limits: dict[object, list[float]], powers: Mapping[str, int], *, color: bool
) -> None:
    """A line for each limit, as long as the curves; the axis reaches to it."""
    import plotext

    for level in chart.levels:
        side = "right" if level.right else "left"
        if not level.inside or side not in limits:
            continue
        value = float(_enlarged(np.array([level.value]), powers[side])[0])
        pixel = ("red" if level.red else "orange") if color else None
        mark = "─" if level.red else "╌"
        ends = [min(limits["x"]), max(limits["x"])]
        line = figure.signal(ends, [value, value], marker=plotext.marker(mark, pixel=pixel), yside=side)
        line.lines(True)
        figure.draw(line)
        limits[side].append(value)


def _level_legend(chart: Chart, width: int, color: bool) -> list[str]:
    """What the lines along the plot are, and which limits lie farther away than it shows."""
    lines = []
    two_sides = len({curve.right for curve in chart.curves}) == 2
    for level in chart.levels:
        mark = ("─" if level.red else "╌") if level.inside else " "
        stroke = f"\x1b[{31 if level.red else 33}m{mark * 2}\x1b[0m" if color and level.inside else mark * 2
        side = (" (right)" if level.right else " (left)") if two_sides else ""
        beyond = "" if level.inside else "  beyond this plot"
        lines.append(f"{stroke} {shorten_end(f'{level.words} {level.value:.6g}{side}{beyond}', width - 3)}")
    return lines


def _draw_events(figure: Any, chart: Chart, limits: Mapping[object, Sequence[float]]) -> None:
    import plotext

    side = "left" if "left" in limits else "right"
    if side not in limits:
        return
    ends = [min(limits[side]), max(limits[side])]
    if ends[0] == ends[1]:
        return  # of a flat curve the axis has no height of its own
    for at, _ in chart.events[:MOST_EVENTS]:
        line = figure.signal([at, at], ends, marker=plotext.marker("│", pixel=None), yside=side)
        line.lines(True)
        figure.draw(line)


def _event_legend(chart: Chart, width: int) -> list[str]:
    lines = [shorten_end(f"│  {at:.6g}  {words}", width) for at, words in chart.events[:MOST_EVENTS]]
    more = len(chart.events) - MOST_EVENTS
    return [*lines, f"   and {more} more events"] if more > 0 else lines


def shorten_end(text: str, width: int) -> str:
    """The text in at most `width` characters; of a long one the beginning is kept."""
    return text if len(text) <= width else f"{text[: max(width - 1, 0)]}…"


def _power(values: Sequence[Floats]) -> int:
    """By which power of ten numbers are drawn larger: those next to the smallest that there are have no steps."""
    size = max((float(np.abs(each[np.isfinite(each)]).max(initial=0.0)) for each in values), default=0.0)
    return -math.floor(math.log10(size)) if 0 < size < _SMALL else 0


def _enlarged(values: Floats, power: int) -> Floats:
    # in two steps: 1e324 is too much for a float
    return values * 10.0 ** (power // 2) * 10.0 ** (power - power // 2) if power else values


def _set_ruler(
    ruler: Any,
    values: Sequence[float] | None,
    count: int,
    names: Mapping[int, str] | Mapping[float, str] | None = None,
    power: int = 0,
) -> None:
    if not values:
        return
    low, high = min(values), max(values)
    if names:
        shown = {number: name for number, name in sorted(names.items()) if low <= number <= high}
        ruler.ticks(list(shown), [_on_one_line(name) for name in shown.values()])
        return
    if high - low <= max(_FLAT * max(abs(low), abs(high)), _TINY):
        # a flat line runs through the middle; rounding errors are not blown up to the height of the screen
        room = abs(low) * 0.1 if abs(low) > _TINY else 1.0
        low, high = low - room, high + room
    ticks = nice_ticks(low, high, max(count, 2)) or [low, high]
    ruler.lim(low, high)
    texts = tick_texts(ticks)
    ruler.ticks(ticks, [f"{word}e-{power}" if float(word) else "0" for word in texts] if power else texts)


def _on_one_line(name: str) -> str:
    """The name of a value as plotext can show it: it fails on empty labels and on line feeds."""
    visible = name.strip() and "".join(letter if letter.isprintable() else "\ufffd" for letter in name)
    return shorten(visible or "''", 14)


def tick_texts(ticks: Sequence[float]) -> list[str]:
    """The numbers in as few digits as tell them apart."""
    size = max(abs(tick) for tick in ticks)
    step = min((b - a for a, b in pairwise(ticks)), default=size or 1.0)
    if size >= 1e6 or (0 < size < 1e-3):
        digits = max(0, _exponent(size) - _exponent(step)) if step else 3
        return [f"{tick:.{digits}e}" if tick else "0" for tick in ticks]
    digits = max(0, -_exponent(step)) if step else 3
    return [f"{tick:.{digits}f}" for tick in ticks]


def _exponent(number: float) -> int:
    return math.floor(math.log10(number) + 1e-9)


def _segments(x: Floats, y: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """The finite points, and which of them is joined to the one before."""
    good = np.isfinite(x) & np.isfinite(y)
    return x[good], y[good], np.concatenate([[False], good[:-1]])[good]


def _legend(chart: Chart, marks: Sequence[str], width: int, color: bool) -> list[str]:
    lines = []
    two_sides = len({curve.right for curve in chart.curves}) == 2
    for index, (curve, mark) in enumerate(zip(chart.curves, marks, strict=True)):
        stroke = "──" if mark == _FINE else mark * 2
        if color:
            stroke = f"\x1b[{_COLORS[index % len(_COLORS)][1]}m{stroke}\x1b[0m"
        side = (" (right)" if curve.right else " (left)") if two_sides else ""
        good = curve.y[np.isfinite(curve.y)]
        span = f"  {good.min() + 0.0:.6g} ... {good.max() + 0.0:.6g}" if len(good) else "  no finite value"
        span += "".join(
            f"  {count} {name}"
            for name, count in (
                ("nan", int(np.isnan(curve.y).sum())),
                ("inf", int((curve.y == np.inf).sum())),
                ("-inf", int((curve.y == -np.inf).sum())),
            )
            if count
        )
        # where there is no room for a name and the range, the name is worth more
        if width - 3 - len(side) - len(span) < 8:
            span = ""
        label = shorten(curve.label, width - 3 - len(side) - len(span))
        lines.append(f"{stroke} {label}{side}{span}")
    return lines


def shorten(text: str, width: int) -> str:
    """The text in at most `width` characters; of a long one the end is kept, where names differ."""
    return text if len(text) <= width else "…" + text[len(text) - max(width - 1, 0) :]


def _name_ticks(axes: Any, names: Mapping[int, str]) -> None:
    if names:
        axes.set_yticks(list(names), list(names.values()))

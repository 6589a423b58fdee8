"""From what the user asked for to a chart: which signals, on which axis, over what.

Used by `silo plot`; pure, draws nothing.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from silo.analysis.compute.calculus import Floats, derivative
from silo.analysis.compute.samples import Samples
from silo.analysis.compute.spectra import lines_of, longest_piece
from silo.analysis.plots.curves import as_numbers, pick, window
from silo.analysis.plots.drawing import Chart, Curve
from silo.analysis.plots.events import events_of
from silo.analysis.plots.limit_lines import DrawnBound, limit_levels, placed
from silo.core.arrays.values import numbers
from silo.core.recording import Recording
from silo.errors import ElementError

MOST_CURVES = 20


@dataclass(frozen=True)
class ChartSpec:
    """A plot as asked for: patterns of signals for the left and the right axis, and for x (time if None).

    `transform` is empty, `derivative` or `spectrum`; `start` and `stop` are seconds from the start of the log.
    """

    patterns: Sequence[str]
    right: Sequence[str] = ()
    x: str | None = None
    transform: str = ""
    start: float | None = None
    stop: float | None = None
    most: int = MOST_CURVES


def make_chart(recording: Recording, spec: ChartSpec, title: str = "") -> tuple[Chart, int]:
    """The chart, and how many matching signals it leaves out because there are more than `spec.most`.

    Raises `ElementError` for a pattern without a signal, and for a window without a sample.
    """
    zero = int(recording.time_ns[0]) if len(recording.time_ns) else 0
    low = -np.inf if spec.start is None else zero + spec.start * 1e9
    high = np.inf if spec.stop is None else zero + spec.stop * 1e9
    right = pick(recording, spec.right) if spec.right else []
    right_names = {signal.name for signal in right}
    left = [signal for signal in pick(recording, spec.patterns) if signal.name not in right_names]
    if not spec.right:
        left, right = _by_unit(left)
    chosen = [*left, *right]
    shown = [window(signal, low, high) for signal in chosen[: spec.most]]
    if not any(len(signal.values) for signal in shown):
        span = f"{(recording.time_ns.max() - zero) / 1e9:.6g}" if len(recording.time_ns) else "0"
        raise ElementError(f"there is no sample to plot in that window; the log goes from 0 to {span} s")
    is_right = {signal.name for signal in right}
    over = None if spec.x is None else _one(recording, spec.x)
    curves = [_curve(signal, spec.transform, over, zero, signal.name in is_right) for signal in shown]
    times = spec.x is None and spec.transform != "spectrum"
    at_left, at_right = ([s for s in shown if (s.name in is_right) is right] for right in (False, True))
    chart = replace(
        _chart(curves, at_left, at_right, title, spec.transform, over),
        events=_events(recording, curves, zero) if times else (),
        levels=_levels(recording, shown, curves, is_right) if not spec.transform else (),
    )
    return chart, max(0, len(chosen) - len(shown))


def _levels(
    recording: Recording, shown: Sequence[Samples], curves: Sequence[Curve], right: Collection[str]
) -> list[DrawnBound]:
    """Limits of what is shown, with where they lie; none where a curve counts from somewhere else than 0."""
    names = [signal.name for signal, curve in zip(shown, curves, strict=True) if " - " not in curve.label]
    return placed(limit_levels(recording, names, right), [(curve.right, curve.y) for curve in curves])


def _events(recording: Recording, curves: Sequence[Curve], zero: int) -> list[tuple[float, str]]:
    """When what happened, between the ends of the curves."""
    ends = [end for curve in curves for end in (curve.x.min(initial=np.inf), curve.x.max(initial=-np.inf))]
    low, high = min(ends, default=0.0), max(ends, default=0.0)
    return [(event.seconds, event.words) for event in events_of(recording, zero) if low <= event.seconds <= high]


def chart_of(signals: Sequence[Samples], title: str = "") -> Chart:
    """The chart of scalars, each over the seconds since the start of its own log; two units have two axes."""
    left, right = _by_unit(list(signals))
    is_right = {id(signal) for signal in right}
    return _chart([_curve(one, "", None, one.start_ns, id(one) in is_right) for one in signals], left, right, title)


def _chart(
    curves: Sequence[Curve],
    left: Sequence[Samples],
    right: Sequence[Samples],
    title: str,
    transform: str = "",
    over: Samples | None = None,
) -> Chart:
    return Chart(
        curves,
        title=title,
        x_label=_x_label(transform, over),
        left_label=_label(left, transform),
        right_label=_label(right, transform),
        left_ticks=_names(left, transform),
        right_ticks=_names(right, transform),
    )


def _by_unit(signals: list[Samples]) -> tuple[list[Samples], list[Samples]]:
    """Two units, two axes; with more than two nothing is gained."""
    units = list(dict.fromkeys(signal.unit for signal in signals))
    if len(units) != 2:
        return signals, []
    return [s for s in signals if s.unit == units[0]], [s for s in signals if s.unit == units[1]]


def _one(recording: Recording, pattern: str) -> Samples:
    found = pick(recording, [pattern])
    if len(found) != 1:
        names = ", ".join(signal.name for signal in found[:3])
        raise ElementError(f"'{pattern}' must be one signal for the x axis, but matches {len(found)}: {names} ...")
    return found[0]


def _curve(signal: Samples, transform: str, over: Samples | None, zero: int, right: bool) -> Curve:
    times = (signal.time_ns - zero) / 1e9
    values, _ = as_numbers(signal)
    unit = "" if signal.unit in ("", "-") else f" [{signal.unit}]"
    exact = numbers(signal.values)
    if exact.base and signal.values.dtype.kind in "iu" and not transform:
        # a float can't tell neighbours beyond 2^53 apart: their distance to one of them is exact
        start = exact.base + int(exact.offsets.min())
        values, unit = exact.offsets - (start - exact.base), f"{unit} - {start}"
    if transform == "spectrum":
        piece = longest_piece(signal.time_ns, values, most=None)
        left_out = f" ({piece.left_out})" if piece.left_out else ""
        return Curve(f"{signal.name}{unit}{left_out}", *lines_of(piece), right)
    if transform == "derivative":
        return Curve(f"{signal.name}{unit}", times, derivative(times, values), right)
    if over is not None:
        return Curve(f"{signal.name}{unit}", _held(over, signal), values, right)
    return Curve(f"{signal.name}{unit}", times, values, right)


def _held(over: Samples, signal: Samples) -> Floats:
    """The value of `over` that held at each sample of the signal; NaN before its first and beyond its last."""
    values, _ = as_numbers(over)
    where = over._places(signal.time_ns)
    held = np.full(len(where), np.nan)
    known = over._holding(signal.time_ns) if len(over) else where >= 0
    held[known] = values[where[known]]
    return held


def _x_label(transform: str, over: Samples | None) -> str:
    if transform == "spectrum":
        return "frequency [Hz]"
    if over is not None:
        return over.name if over.unit in ("", "-") else f"{over.name} [{over.unit}]"
    return "time [s]"


def _label(signals: Sequence[Samples], transform: str) -> str:
    if not signals:
        return ""
    units = {signal.unit for signal in signals if signal.unit not in ("", "-")}
    unit = units.pop() if len(units) == 1 else ""
    if transform == "derivative":
        return f"{unit}/s" if unit else "1/s"
    return unit


def _names(signals: Sequence[Samples], transform: str) -> Mapping[int, str]:
    """Names of values on the axis, if all its signals have the same."""
    if transform or not signals:
        return {}
    names = [dict(as_numbers(signal)[1]) for signal in signals]
    return names[0] if all(each == names[0] for each in names) else {}

"""Plots of signals for whoever asks in Python: on a screen by matplotlib, as a PNG file, or as text in a terminal."""

import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from silo.analysis.compute.samples import Samples
from silo.analysis.plots.charts import MOST_CURVES, chart_of
from silo.analysis.plots.drawing import Chart, draw_axes, draw_png, draw_text
from silo.core.arguments import shown
from silo.errors import ElementError
from silo.files.optional_packages import need


def signal_chart(signals: Sequence[Samples], title: str = "") -> Chart:
    """Return the chart of signals, each over the time since the start of its own log."""
    found: list[Samples] = []
    for signal in signals:
        if not isinstance(signal, Samples):
            raise ElementError(f"plot takes signals, got {shown(signal)}; write log['/log/x'].plot(log['/log/y'])")
        found += [signal.component(place) for place in range(len(signal.components))] or [signal]
    if not any(map(len, found)):
        raise ElementError(f"there is nothing to plot: {', '.join(f'{one.name!r} {one._span}' for one in signals)}")
    return chart_of(found[:MOST_CURVES], title)


def show(chart: Chart, ax: Any, path: str | os.PathLike[str] | None, terminal: bool | None) -> Any:
    """Draw a chart where it was asked for. Returns the axes, the path, or None for text."""
    if path is not None:
        file = Path(path)
        draw_png(chart, file)
        return file
    if ax is None and (terminal or (terminal is None and not _has_screen())):
        size = shutil.get_terminal_size((80, 24))
        color = sys.stdout.isatty() and "NO_COLOR" not in os.environ
        print(draw_text(chart, size.columns, min(size.lines, 30) - 1, color=color))
        return None
    if ax is None:
        ax = need("matplotlib.pyplot", "plot", "plots on a screen").figure(layout="constrained").add_subplot()
    elif not hasattr(ax, "plot"):
        raise ElementError(f"ax must be axes of matplotlib, got {shown(ax)}; write figure, ax = plt.subplots()")
    draw_axes(chart, ax)
    ax.legend(loc="best")
    return ax


def _has_screen() -> bool:
    """Whether matplotlib is there, and something that shows its plots: a notebook, or a window system."""
    try:
        import matplotlib as mpl
    except ImportError:
        return False
    if "IPython" in sys.modules and "inline" in str(mpl.get_backend()):
        return True
    chosen = os.environ.get("MPLBACKEND") or ("matplotlib.pyplot" in sys.modules and mpl.get_backend())
    return bool(chosen or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))

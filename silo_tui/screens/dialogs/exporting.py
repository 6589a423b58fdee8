"""Plots that stand still as a file: CSV of all samples that are shown, PNG by matplotlib, else SVG of the screen."""

import asyncio
import csv
import io
import itertools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from textual.app import App

from silo.core.arrays.values import as_floats, text_of
from silo.core.quantities.writing import many
from silo.errors import SiloError
from silo.files.atomic import atomic_file
from silo_tui.context import SiloScreen
from silo_tui.modal import run_aside
from silo_tui.model.drawing.plots import Plotted
from silo_tui.model.drawing.window import SECOND_NS
from silo_tui.model.plots.panels import Panel, has_curves, sides
from silo_tui.model.samples.source import PlotSource, Samples
from silo_tui.model.words.paths import typed_path
from silo_tui.screens.dialogs.questions import Prompt, ask_line

FORMATS = (".csv", ".png", ".svg")


def ask_export(
    screen: SiloScreen,
    source: PlotSource,
    panels: Sequence[Panel],
    shown_ns: tuple[int, int],
    zero_ns: int,
    *,
    between: bool = False,
) -> None:
    """Ask for a path and write what is shown there, or lies `between` two cursors; what came of it is said."""

    def write(given: str) -> None:  # after the prompt is gone: it is no part of the picture
        screen.call_after_refresh(lambda: run_aside(screen, "writing", _export_to, given))

    def path_of(given: str) -> Path:
        return _new(typed_path("the file of the plots", given))

    async def _export_to(given: str) -> None:
        with screen.context.telling():
            screen.say(await export(screen.app, source, panels, shown_ns, zero_ns, path_of(given)))

    what = "What lies between A and B" if between else "What is shown"
    body = f"{what}: .csv has all samples, .png is drawn by matplotlib, .svg is the screen."
    title, begin = "Write the plots to a file on this machine", str(free_name(Path("plots.csv")))
    ask_line(screen, Prompt(title, body, begin, check=path_of, label="file"), write)


def csv_text(plots: Sequence[Plotted], found: Sequence[Samples]) -> str:
    """Return a line per time stamp of any signal, a column per signal: empty where it has no sample then."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    units = [plotted.element.unit for plotted in plots]
    names = [plotted.name + (f" [{unit}]" if unit != "-" else "") for plotted, unit in zip(plots, units, strict=True)]
    writer.writerow(["time_ns", *names])
    stamps = np.unique(np.concatenate([time_ns for time_ns, _ in found])) if found else np.zeros(0, np.int64)
    columns: list[list[str]] = []
    for time_ns, values in found:
        column = [""] * len(stamps)
        for at, value in zip(np.searchsorted(stamps, time_ns).tolist(), values, strict=True):
            column[at] = _word(value)
        columns.append(column)
    for row, stamp in enumerate(stamps.tolist()):
        writer.writerow([stamp, *(column[row] for column in columns)])
    return out.getvalue()


def _word(value: object) -> str:
    """All digits of a number."""
    return text_of(value) if isinstance(value, bytes | np.str_ | np.timedelta64) else str(value)


def draw_png(panels: Sequence[Panel], found: dict[str, Samples], zero_ns: int, path: Path) -> None:
    """Draw the panels one below the other. Raises ImportError without matplotlib, OSError, SiloError."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 1 + 2.2 * len(panels)), dpi=100, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, panel in zip(rows, panels, strict=True):
        right = axes.twinx() if has_curves(panel) and any(sides(panel)) else None
        for place, plotted in enumerate(panel):
            time_ns, values = found[plotted.name]
            seconds = (time_ns - zero_ns) / SECOND_NS
            label = plotted.name + (f" [{plotted.element.unit}]" if plotted.element.unit != "-" else "")
            if not plotted.numeric:
                words = [text_of(value) for value in values]
                known = list(dict.fromkeys(words))
                axes.step(seconds, [known.index(word) for word in words], where="post", label=label)
                axes.set_yticks(range(len(known)), known)
                continue
            on = right if right is not None and sides(panel)[place] else axes
            way = {} if has_curves(panel) else {"drawstyle": "steps-post"}
            on.plot(seconds, as_floats(values), label=label, color=f"C{place}", **way)
            if plotted.entry.labels:
                axes.set_yticks(list(plotted.entry.labels), list(plotted.entry.labels.values()))
        axes.grid(visible=True, alpha=0.3)
        lines = [line for each in (axes, right) if each is not None for line in each.get_lines()]
        axes.legend(lines, [str(line.get_label()) for line in lines], loc="upper right")
    rows[-1].set_xlabel("time [s]")
    picture = io.BytesIO()
    canvas.print_png(picture)
    write_whole(path, picture.getvalue())


def free_name(wanted: Path) -> Path:
    """Return a name that no file has yet: `plots.csv`, then `plots-2.csv`, `plots-3.csv` ..."""
    names = (wanted.with_stem(f"{wanted.stem}-{number}") for number in itertools.count(2))
    return wanted if not wanted.exists() else next(name for name in names if not name.exists())


def write_whole(path: Path, data: bytes) -> None:
    """Write a file whole or not at all."""
    with atomic_file(path) as file:
        file.write(data)


def _new(path: Path) -> Path:
    """Return the path of a file that can be written and isn't there yet; SiloError of any other."""
    if path.suffix not in FORMATS:
        raise SiloError(f"'{path}' ends in none of {', '.join(FORMATS)}; nothing was written")
    if path.exists():
        raise SiloError(f"'{path}' exists: choose another name; nothing was written")
    return path


async def export(
    app: App[Any], source: PlotSource, panels: Sequence[Panel], shown_ns: tuple[int, int], zero_ns: int, path: Path
) -> str:
    """Write what is shown, in the format that the path ends in; return what to say. Raises SiloError, OSError."""
    path = _new(path).absolute()  # it is told where that is
    plots = [plotted for panel in panels for plotted in panel]
    if path.suffix == ".svg":
        write_whole(path, picture(app).encode())
        return f"the screen is in {path}"
    found = [await source.samples(plotted.name, *shown_ns) for plotted in plots]
    count = sum(len(time_ns) for time_ns, _ in found)
    if not count:
        raise SiloError("no samples in what is shown; nothing was written")
    if path.suffix == ".csv":
        text = await asyncio.to_thread(csv_text, plots, found)
        await asyncio.to_thread(write_whole, path, text.encode())
    else:
        by_name = {plotted.name: samples for plotted, samples in zip(plots, found, strict=True)}
        try:
            await asyncio.to_thread(draw_png, panels, by_name, zero_ns, path)
        except ImportError:
            path = path.with_suffix(".svg")
            write_whole(path, picture(app).encode())
            return f"PNG needs matplotlib, which isn't installed here: the screen is in {path} instead"
    return f"{many(count, 'sample')} of {many(len(plots), 'signal')} {'is' if count == 1 else 'are'} in {path}"


def picture(app: App[Any]) -> str:
    """Return the screen as SVG. Blanks between braille dots become blank braille, which is as wide as they are."""

    def widen(match: re.Match[str]) -> str:
        has_dots = any("\u2800" < char <= "\u28ff" for char in match[0])
        return match[0].replace("&#160;", "\u2800") if has_dots else match[0]

    return re.sub(r">[^<>]+</text>", widen, app.export_screenshot(title="silo-tui"))

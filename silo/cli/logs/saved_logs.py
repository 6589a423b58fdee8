"""Commands on saved logs: `silo convert`, `silo plot`, `silo stats`, `silo diff`, `silo compare`,
and what `silo info FILE` prints.

`silo.cli` adds them to the group `silo`. A log is given as a path, the start of a file name (the newest is taken), or
a run number.
"""

import math
import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click
from click.shell_completion import CompletionItem

from silo.cli.codes import EXIT_BLIND, EXIT_FOUND
from silo.cli.common import LogWord, TypedPath, find_saved, progress, show, show_json, show_rows, together
from silo.core.names import is_glob
from silo.core.quantities.writing import and_more, count, many
from silo.errors import ElementError, SiloError
from silo.files.formats import readable, writable
from silo.printing import drawing

if TYPE_CHECKING:
    # NumPy takes 150 ms, which commands without a log don't have to wait
    from silo.analysis.compute.samples import Samples
    from silo.analysis.plots.drawing import Chart
    from silo.core.recording import Recording


MOST_CHECKED_BYTES = 10**9  # by a look at a file; a larger one is read whole by `silo verify` alone


def print_file_info(which: str | Path, as_json: bool) -> None:
    """Print what is in a log: elements with unit, type, samples, rate, span, lost. Raises `SiloError`."""
    from silo.analysis.reports import format_report, report
    from silo.files.saving import size_of

    path = find_saved(which)
    size_bytes = size_of(path)
    facts = report(_read(path, check=size_bytes <= MOST_CHECKED_BYTES), str(path), size_bytes)
    show(facts, as_json, lambda: format_report(facts, _columns()))


def _complete_file(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    return [CompletionItem(incomplete, type="file")]


def _complete_signal(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    from silo.analysis.lookup import entry_names
    from silo.core.names import begun

    try:
        recording = _read(find_saved(ctx.params.get("file") or ""))
    except SiloError:
        return []
    names = [name for each in entry_names(recording.elements) for name in each]
    return [CompletionItem(name) for name in begun(names, incomplete)[:200]]


_CONVERT_HELP = f"""Convert a log to another format, chosen by the ending of OUT.

    OUT may end in {writable()}; without an ending it is a bag folder. IN may be {readable()},
    of silo or of others; where each topic of a bag has times of its own, --rate gives all the same.

    \b
    Examples:
      silo convert run.silo run.parquet
      silo convert 17 walk.rosbag2         (run number 17 of this folder)
      silo convert run.mcap run.silo
      silo convert --rate 100 rosbag2_2026_11_22 drive.csv
      silo convert runs/ data/ --to lerobot --fps 30 --state 'joints/q*' \\
          --action 'cmd/*' --task 'pick the cup'

    --to lerobot makes a data set for training (LeRobot v3.0, without cameras) of several runs: an episode of each;
    --to episodes a NumPy file of each. A folder, or a glob in quotes, means all runs there, and no captures; the shell
    makes names of a glob without, captures too, and moments that are in two episodes are told.
    """


window_options = together(
    click.option("--from", "start", type=float, help="Begin of the window, s from the start of the log."),
    click.option("--to", "stop", type=float, help="End of the window, s."),
)
whole_option = click.option(
    "--whole", is_flag=True, help="All parts beside it as one: of a run that was cut, of a recording."
)
size_options = together(
    click.option("--width", type=click.IntRange(30, 1000), help="Columns; that of the terminal if not given."),
    click.option("--height", type=click.IntRange(8, 1000), help="Rows; those of the terminal if not given."),
)


def _ending_says(_ctx: click.Context | None, _param: click.Parameter | None, value: str | None) -> None:
    if value is not None:
        way = "OUT, a folder without an ending, is a bag" if "bag" in value else f"OUT.{value}"
        raise click.UsageError(f"the ending of OUT says the format: silo convert IN {way}")


class _DataSetKind(click.Choice[str]):
    """What `--to` makes; a format of logs is told of."""

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        if value not in self.choices:
            _ending_says(ctx, param, value)
        return super().convert(value, param, ctx)


SPARSE = 0.25  # of the cells of a table, below which it is told that most are empty
_of_data_sets = together(
    click.option("--fps", type=click.IntRange(min=1), help="Frames per second of a data set."),
    click.option("--robot", metavar="WORD", default="", help="The type of robot."),
    click.option("--task", metavar="WORDS", default="", help="What was done; as the runs say, if it isn't named."),
    click.option("--episodes", type=click.Choice(["runs", "episodes", "captures"]),
                 help="What an episode is: each IN (runs), or each marked in them."),
    click.option("--how", type=click.Choice(["last", "mean"]), help="Of faster signals; last if not given."),
    click.option("--where", metavar="EXPR", default="", help="Only runs for which it is true at their end."),
    click.option("--state", metavar="PATTERN", multiple=True,
                 help="Signals that are observation.state; several times for several."),
    click.option("--action", metavar="PATTERN", multiple=True, help="Signals that are action."),
    click.option("--also", metavar="PATTERN", multiple=True, help="Signals that are features of their own."),
    click.option("--window", metavar="PATTERN", multiple=True,
                 help="Likewise, with all samples since the frame before."),
)  # fmt: skip


def _every(source: str, *, captures: bool) -> list[Path]:
    """The logs that one IN of a data set means: of a folder or a glob all runs, and how many they are is told."""
    from silo.files.naming import find_logs

    if not (Path(source).is_dir() or is_glob(source)):
        return [find_saved(source)]
    found = find_logs(source, tell=lambda text: click.echo(text, err=True), captures=captures)
    if found != [Path(source)]:
        click.echo(f"{source}: {many(len(found), 'log')}", err=True)
    return found


def _make_data_set(sources: tuple[str, ...], target: Path, force: bool, options: dict[str, Any]) -> None:
    """Write a data set, check what was written, and say what was left out."""
    from silo.datasets.check import check_lerobot
    from silo.datasets.lerobot import write_lerobot

    if not options["fps"] or not options["state"]:
        raise click.UsageError("a data set needs --fps and at least one --state: --fps 30 --state 'joints/*'")
    options["how"], options["episodes"] = options["how"] or "last", options["episodes"] or "runs"
    runs = [run for source in sources for run in _every(source, captures=options["episodes"] == "captures")]
    with progress(f"{target}") as tell:
        made = write_lerobot(runs, target, force=force, progress=tell, **options)
    for name, why in made.left_out:
        click.echo(f"left out: {name}: {why}", err=True)
    for name, why in (*made.short, *made.held, *made.not_finite, *made.again):
        click.echo(f"warning: {name}: {why}", err=True)
    if made.lost:
        click.echo(
            f"warning: {count(made.lost)} samples of these runs are lost; column silo/lost says of which", err=True
        )
    if made.no_task and options["to"] == "lerobot":
        click.echo(
            f"warning: {many(len(made.no_task), 'episode')} without a task ({and_more(made.no_task, 3)}): name it with "
            "--task, or have the program say it: about={'task': 'pick the cup'}",
            err=True,
        )
    problems = check_lerobot(target) if options["to"] == "lerobot" else []
    if problems:
        raise SiloError(f"'{target}' was written, but {problems[0]}; please report that")
    click.echo(f"{target}  {made.episodes} episodes, {made.frames} frames at {options['fps']}/s")


@click.command("convert", help=_CONVERT_HELP)
@click.argument("sources", type=LogWord(), metavar="IN...", nargs=-1, required=True, shell_complete=_complete_file)
@click.argument("target", metavar="OUT", type=TypedPath(path_type=Path))
@click.option("-f", "--force", is_flag=True, help="Replace OUT if it exists.")
@click.option("--to", "kind", type=_DataSetKind(["lerobot", "episodes"]),
              help="Make a data set of all IN, in the folder OUT.")  # fmt: skip
@_of_data_sets
@click.option("--rate", type=click.FloatRange(min=0, min_open=True), metavar="HZ", help="All signals at this rate.")
@whole_option
@click.option("-t", "--type", "--format", hidden=True, is_eager=True, expose_value=False, callback=_ending_says)
def convert_command(
    sources: tuple[str, ...],
    target: Path,
    force: bool,
    rate: float | None,
    whole: bool,
    kind: str | None,
    **options: Any,
) -> None:
    """Convert a log; the help is `_CONVERT_HELP`."""
    if kind is not None:
        if rate is not None:
            raise click.UsageError("a data set has frames: write --fps instead of --rate")
        if whole:
            raise click.UsageError("a data set takes what each IN holds: leave out --whole")
        _make_data_set(sources, target, force, options | {"to": kind})
        return
    from silo.files.convert import convert
    from silo.files.saving import size_of

    given = next((f"--{name}" for name, value in options.items() if value), "")
    if given or len(sources) > 1:
        what = given or f"more than one IN ({len(sources)})"
        raise click.UsageError(f"{what} is for data sets: add --to lerobot or --to episodes")
    path = find_saved(sources[0])

    def change(read: "Recording") -> "Recording":
        read = _whole(path, read, check=True) if whole else read
        return read if rate is None else _at_rate(read, rate)

    with progress(f"{target.name}") as tell:
        recording = convert(path, target, tell, force, change)
    _warn(path, recording)
    held = f"{many(recording.entry_count, 'signal')}, {many(len(recording.time_ns), 'tick')}"
    click.echo(f"{target}  {size_of(target)} bytes, {held}")
    cells = recording.entry_count * len(recording.time_ns)
    filled = sum(len(entry.values) for element in recording.elements for entry in element.entries)
    if target.suffix == ".csv" and filled < SPARSE * cells:
        note = f"note: a value stands in {filled / cells:.1%} of its cells, as most are held for a part of the time"
        click.echo(f"{note}; .parquet is smaller", err=True)


@click.command("stats")
@click.argument("file", type=LogWord(), shell_complete=_complete_file)
@click.argument("patterns", metavar="[PATTERN]...", nargs=-1, shell_complete=_complete_signal)
@window_options
@whole_option
@click.option("--json", "as_json", is_flag=True, help="One JSON array, for machines.")
def stats_command(
    file: str, patterns: tuple[str, ...], start: float | None, stop: float | None, whole: bool, as_json: bool
) -> None:
    """Show minimum, maximum, mean, standard deviation and rms of signals.

    \b
    Examples:
      silo stats run.silo
      silo stats run.silo 'LF/*/torque' --from 2 --to 5
    """
    from silo.analysis.plots.curves import pick, pick_all
    from silo.analysis.reports import format_statistics, statistics

    path = find_saved(file)
    recording = _read(path, whole, check=not patterns)
    signals = pick(recording, patterns) if patterns else pick_all(recording)
    # one after the other: a window copies the signal
    rows = [statistics(signal) for signal in _windowed(recording, signals, start, stop)]
    show(rows, as_json, lambda: format_statistics(rows, _columns()))
    if rows and not any(row.samples for row in rows) and (start, stop) != (None, None):
        lasts_s = (int(recording.time_ns[-1]) - int(recording.time_ns[0])) / 1e9 if len(recording.time_ns) else 0.0
        click.echo(f"warning: no sample from {start or 0:g} s on, the log lasts {lasts_s:g} s", err=True)
    _warn(path, recording)


_meeting_options = together(
    click.option("--tolerance", type=float, default=0.0, help="Numbers may differ by this much."),
    click.option("--by", type=click.Choice(["start", "stamps"]), default="start",
                 help="What is the same moment in both: their starts, or (of two files of one run) the time stamps."),
    whole_option,
)  # fmt: skip


@click.command("diff")
@click.argument("first", type=LogWord(), metavar="A", shell_complete=_complete_file)
@click.argument("second", type=LogWord(), metavar="B", shell_complete=_complete_file)
@_meeting_options
@click.option("--json", "as_json", is_flag=True, help="One JSON array, for machines.")
def diff_command(
    first: str, second: str, tolerance: float, by: Literal["start", "stamps"], whole: bool, as_json: bool
) -> None:
    """Show how two logs differ: elements, units, dividers, and values at the time that both have.

    The same values differ as for silo.compare. The formats may differ. Exit code 0 if the logs are equal, 4 if they
    differ, 1 if one can't be read.

    \b
    Examples:
      silo diff run.silo run.mcap
      silo diff 16 17 --tolerance 1e-6
    """
    from silo.analysis.compare import differences

    paths = [find_saved(one) for one in (first, second)]
    a, b = (_read(path, whole) for path in paths)
    found = differences(a, b, tolerance, by)
    equal = not any(one.differs for one in found)
    if as_json:
        show_json(found)
    elif found:
        width = min(max(len(difference.name) for difference in found), max(20, _columns() // 2))
        for difference in found:
            click.echo(f"{difference.name:{width}}  {difference.what}")
    if equal and not as_json:
        partly = " over the time that both have" if found else ""
        click.echo(f"equal{partly}: {many(a.entry_count, 'signal')}, {many(len(a.time_ns), 'tick')}")
    for path, recording in zip(paths, (a, b), strict=True):
        _warn(path, recording)
    _end(not equal)


@click.command("compare")
@click.argument("first", type=LogWord(), metavar="A", shell_complete=_complete_file)
@click.argument("words", metavar="[B] [PATTERN]", nargs=-1, shell_complete=_complete_file)
@_meeting_options
@click.option("--event", help="An expression: where it first holds is the same moment in both.")
@click.option("--signal", default="", help="A signal by whose course they are laid on each other.")
@click.option("--episode", default="", metavar="NAME|NUMBER", help="Compare this episode of both.")
@click.option("--png", type=TypedPath(path_type=Path, dir_okay=False), help="Draw the most different signal.")
@click.option("--json", "as_json", is_flag=True, help="One JSON array, for machines.")
def compare_command(
    first: str,
    words: tuple[str, ...],
    tolerance: float,
    by: Literal["start", "stamps"],
    whole: bool,
    event: str | None,
    signal: str,
    episode: str,
    png: Path | None,
    as_json: bool,
) -> None:
    """Show in numbers how the signals of two runs differ, the most different first, as silo.compare does.

    A..B are the runs of a folder from A to B: each is compared with A, the most different run first. PATTERN are the
    elements, all by default. Exit code 0 if no signal differs, 4 if one does, 5 if none can be compared, 1 if a log
    can't be read.

    \b
    Examples:
      silo compare 16 17 'joints/*'
      silo compare good.silo bad.mcap --event 'state/mode == TROT' --png worst.png
      silo compare 16..40 --episode pick
    """
    from silo.analysis.compare import compare
    from silo.analysis.log import Log

    options: dict[str, Any] = {"signal": signal, "tolerance": tolerance, "by": by, "episode": episode}
    options["event"] = None if event is None else lambda log: log.eval(event)
    if ".." in first and not Path(first).exists():
        if whole:
            raise click.UsageError("the runs A..B are compared file by file: leave out --whole")
        _compare_many(first, words, options, png, as_json)
        return
    if not 1 <= len(words) <= 2:
        raise click.UsageError("name two runs, silo compare A B [PATTERN], or many: silo compare A..B [PATTERN]")
    paths = [find_saved(one) for one in (first, words[0])]
    recordings = [_read(path, whole) for path in paths]
    a, b = map(Log, recordings)
    found = compare(a, b, *words[1:], **options)
    show([row.facts for row in found.rows], as_json, lambda: str(found))
    for path, recording in zip(paths, recordings, strict=True):
        _warn(path, recording)
    if png is not None and found.rows:
        click.echo(found.plot(path=png), err=as_json)
    _end(bool(found), found.blind)


def _compare_many(
    words: str, pattern: tuple[str, ...], options: dict[str, Any], png: Path | None, as_json: bool
) -> None:
    """Compare the runs A..B of a folder with A."""
    from silo.analysis.compare import HEADS
    from silo.run_index.runs import runs

    begin, end = (find_saved(word) for word in words.split("..", 1))
    if begin.absolute().parent != end.absolute().parent or len(pattern) > 1:
        raise click.UsageError("A..B are runs of one folder; behind them stands one PATTERN at most")
    every = runs(begin.absolute().parent)
    places = [place for place, run in enumerate(every) if run.has(begin) or run.has(end)]
    found = every[places[0] : places[-1] + 1].compare(*pattern, **options)
    none = [""] * 5
    rows = [(run.facts.path, str(len(one)), *(one.rows[0].cells[:5] if one.rows else none)) for run, one in found]
    facts = [{"run": run.facts.path, "differ": [row.facts for row in one.rows]} for run, one in found]
    show(facts, as_json, lambda: show_rows([("run", "differ", *HEADS[:5]), *rows], right=(1, 4, 5, 6)))
    if png is not None and found[0][1].rows:
        worst = found[0][1].rows[0]
        others = [row.b for _, one in found for row in one.rows if row.name == worst.name]
        click.echo(worst.a.plot(*others, path=png, title=worst.name), err=as_json)
    _end(any(one for _, one in found), any(one.blind for _, one in found))


@click.command("plot")
@click.argument("file", type=LogWord(), shell_complete=_complete_file)
@click.argument("patterns", metavar="PATTERN...", nargs=-1, required=True, shell_complete=_complete_signal)
@click.option("-r", "--right", multiple=True, metavar="PATTERN", help="Draw this on the right axis (may be repeated).")
@click.option("-x", "--x", "x_pattern", metavar="PATTERN", help="Draw over this signal instead of time (x-y plot).")
@click.option("-d", "--derivative", is_flag=True, help="Draw the change per second.")
@click.option("-s", "--spectrum", is_flag=True, help="Draw the amplitude over the frequency.")
@window_options
@whole_option
@click.option("--png", type=TypedPath(path_type=Path, dir_okay=False), help="Write a picture instead (matplotlib).")
@size_options
def plot_command(
    file: str,
    patterns: tuple[str, ...],
    right: tuple[str, ...],
    x_pattern: str | None,
    derivative: bool,
    spectrum: bool,
    start: float | None,
    stop: float | None,
    whole: bool,
    png: Path | None,
    width: int | None,
    height: int | None,
) -> None:
    """Plot signals in the terminal, or into a PNG file.

    A PATTERN is a name, a glob, a part of a name, or an expression. Signals of a second unit go to the right axis by
    themselves. Limits that the file keeps are drawn: red, and yellow (dashed).

    \b
    Examples:
      silo plot run.silo LF/joint000/torque LF/joint000/position
      silo plot run.silo '*/torque' --from 2 --to 3.5
      silo plot run.silo base/position_y -x base/position_x
      silo plot run.silo 'joints/tau * joints/qd' 'norm(imu/acc)'
      silo plot run.silo imu/accel --spectrum --png accel.png
    """
    from silo.analysis.plots.charts import ChartSpec, make_chart

    if derivative and spectrum:
        raise click.UsageError("choose one of --derivative and --spectrum")
    if x_pattern and (derivative or spectrum):
        raise click.UsageError("--x draws values over values: leave out --derivative and --spectrum")
    path = find_saved(file)
    recording = _read(path, whole)
    transform = "derivative" if derivative else "spectrum" if spectrum else ""
    spec = ChartSpec(patterns, right, x_pattern, transform, start, stop)
    chart, left_out = make_chart(recording, spec, title=path.name)
    draw([chart], png, width, height, 2)
    if left_out:
        click.echo(
            f"not drawn: {many(left_out, 'more signal')} of these patterns, behind the first {spec.most}", err=True
        )
    _warn(path, recording)


def _at_rate(recording: "Recording", rate: float) -> "Recording":
    import numpy as np

    from silo.analysis.compute.spectra import stills, told_stills
    from silo.analysis.log import Log

    made = Log(recording).resample(rate).recording
    stamps = np.sort(recording.time_ns)
    if len(at := stills(stamps)):
        held = int(np.diff(np.searchsorted(np.sort(made.time_ns), np.stack([stamps[at] + 1, stamps[at + 1]], 1))).sum())
        told = told_stills(stamps, at, int(recording.time_ns[0]))
        click.echo(f"warning: {count(held)} of {count(len(made.time_ns))} ticks {told}", err=True)
    return made


def _read(path: Path, whole: bool = False, *, check: bool = False) -> "Recording":
    from silo.core.recording import keep_quiet
    from silo.files.added import added_formats
    from silo.files.formats import read_recording

    recording = read_recording(path, added_formats, check=check)
    recording = _whole(path, recording, check=check) if whole else recording
    keep_quiet(recording)  # `_warn` comes last
    return recording


def _whole(path: Path, recording: "Recording", *, check: bool) -> "Recording":
    from silo.analysis.opening import whole_run

    return whole_run(path, recording, check=check)


def _windowed(
    recording: "Recording", signals: "Sequence[Samples]", start: float | None, stop: float | None
) -> "Iterator[Samples]":
    from silo.analysis.plots.curves import window

    if start is None and stop is None:
        yield from signals
        return
    if start is not None and stop is not None and start >= stop:
        raise ElementError(f"--from {start:g} must be before --to {stop:g}")
    zero = int(recording.time_ns[0]) if len(recording.time_ns) else 0
    low = -math.inf if start is None else zero + start * 1e9
    high = math.inf if stop is None else zero + stop * 1e9
    for signal in signals:
        yield window(signal, low, high)


def _warn(path: Path, recording: "Recording") -> None:
    from silo.analysis.opening import alone_of

    for warning in filter(None, (*recording.warnings, alone_of(path, recording))):
        click.echo(f"warning: {warning}", err=True)


def _end(differs: bool, blind: bool = False) -> None:
    """End with the code for what was found."""
    if code := EXIT_FOUND if differs else EXIT_BLIND if blind else 0:
        raise SystemExit(code)


def _columns() -> int:
    return shutil.get_terminal_size((100, 24)).columns


def draw(charts: "Sequence[Chart]", png: Path | None, width: int | None, height: int | None, besides: int) -> None:
    """Draw charts to a picture, or print them, on a terminal that knows them in colours; `besides` lines are to fit."""
    from silo.analysis.plots.drawing import draw_png, draw_text

    if png is not None:
        draw_png(charts, png)
        click.echo(str(png))
        return
    size = shutil.get_terminal_size((80, 24))
    rows = (height or size.lines - besides) // len(charts)
    terminal = sys.stdout is not None and sys.stdout.isatty()  # None where the shell closed it
    color = terminal and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    for chart in charts:
        click.echo(draw_text(chart, width or size.columns, rows, color=color), file=drawing(sys.stdout))

"""`silo bode` and `silo step`: how one signal of a log answers to another."""

import contextlib
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from silo.cli.common import LogWord, TypedPath, find_saved, show_json, together
from silo.cli.logs.saved_logs import (
    _complete_file,
    _complete_signal,
    _read,
    _warn,
    draw,
    size_options,
    whole_option,
    window_options,
)

if TYPE_CHECKING:
    from silo.analysis.log import Log
    from silo.analysis.plots.drawing import Chart


_words = together(
    click.argument("file", type=LogWord(), shell_complete=_complete_file),
    click.argument("given", metavar="IN", shell_complete=_complete_signal),
    click.argument("output", metavar="OUT", shell_complete=_complete_signal),
    window_options,
    whole_option,
    click.option("--png", type=TypedPath(path_type=Path, dir_okay=False), help="Write a picture (matplotlib)."),
    size_options,
    click.option("--json", "as_json", is_flag=True, help="One JSON object, for machines."),
)


@click.command("bode")
@_words
@click.option("--segment", type=float, metavar="S", help="How long a window is; a third of it all if not given.")
def bode(
    file: str,
    given: str,
    output: str,
    start: float | None,
    stop: float | None,
    whole: bool,
    segment: float | None,
    **shown: Any,
) -> None:
    """Draw the transfer function from one signal to another: magnitude, phase, coherence.

    Without a window it is that of the last excitation of IN that has a band (`silo excite`), which is told, else of the
    whole log. A step alone is refused: it has none. A coherence well below 1 says that noise, or something else than
    IN, moves OUT.

    \b
    Examples:
      silo bode run.silo tau_offset joints/q_3
      silo bode run.silo command speed --from 2 --to 30 --png speed.png
    """
    from silo.analysis.plots.responses import bode_charts
    from silo.analysis.responses import excitation_words

    log, title = _opened(file, given, output, whole)
    with _of_which_alone():
        found = log.bode(given, output, start, stop, segment_s=segment)
    of = excitation_words(log, given, start, stop)
    _show(found, bode_charts(found, title), [f"of {of}"] if of else [], of=of, **shown)
    _warn(Path(log.path), log.recording)


@click.command("step")
@_words
def step(
    file: str, given: str, output: str, start: float | None, stop: float | None, whole: bool, **shown: Any
) -> None:
    """Draw how one signal answers to the largest step of another, with rise time and overshoot.

    Without a window it is that of the last step by which IN was excited (`silo excite`), else of the whole log.

    \b
    Examples:
      silo step run.silo tau_offset joints/q_3
      silo step run.silo command speed --from 2 --to 5 --json
    """
    from silo.analysis.plots.responses import step_chart, step_words
    from silo.analysis.responses import excitation_words

    log, title = _opened(file, given, output, whole)
    with _of_which_alone():
        found = log.step(given, output, start, stop)
    unit = log[output].unit
    of = excitation_words(log, given, start, stop, step=True)
    words = [*step_words(found, log[given].unit, unit), *([f"of {of}"] if of else [])]
    _show(found, [step_chart(found, "" if unit == "-" else unit, title)], words, of=of, **shown)
    _warn(Path(log.path), log.recording)


@contextlib.contextmanager
def _of_which_alone() -> Iterator[None]:
    """Have no warning of which excitation it is: that is said below, always."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "of .* excitations of")
        yield


def _opened(file: str, given: str, output: str, whole: bool) -> "tuple[Log, str]":
    from silo.analysis.log import Log

    path = find_saved(file)
    return Log(_read(path, whole), str(path)), f"{path.name}: {given} to {output}"


def _show(
    found: NamedTuple,
    charts: "Sequence[Chart]",
    words: Sequence[str] = (),
    *,
    of: str,
    png: Path | None,
    width: int | None,
    height: int | None,
    as_json: bool,
) -> None:
    if as_json:
        facts = {**found._asdict(), **({"excitation": of} if of else {})}.items()
        show_json({name: value.tolist() if hasattr(value, "tolist") else value for name, value in facts})
        return
    draw(charts, png, width, height, 4)
    for line in words:
        click.echo(line)

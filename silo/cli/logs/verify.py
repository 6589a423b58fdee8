"""`silo verify FOLDER`: whether all that was to be kept is there, once."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from silo.cli.codes import EXIT_FOUND
from silo.cli.common import TypedPath, json_option, show, show_rows
from silo.core.quantities.writing import count, many
from silo.printing import printable

if TYPE_CHECKING:
    from silo.verify.verdicts import RunCovered, Verified


@click.command()
@click.argument("folder", type=TypedPath(exists=True, file_okay=False, path_type=Path), default=".")
@json_option
def verify(folder: Path, as_json: bool) -> int:
    """Hold the recordings, captures, saved logs and the event log of a log folder against one another.

    Named is every tick that was to be recorded or captured and is in no file, what growing buffers had no room for,
    what stands twice, totals that disagree, files that can't be read, and those that were written here and are gone.
    What the event log tells to be lost stands apart, and so do ticks that nobody asked to keep: what buffers overwrote
    before a save, what the budget of a recording deleted, and what came while somebody had stopped a recording. A
    buffer of fewer seconds than others keeps the newest; that it is so is said. What was saved to other folders, as
    the event log tells, is read there. Nothing is changed.

    \b
    Examples:
      silo verify logs
      silo verify logs --json | jq .problems

    \b
    Exit codes:
      0  whole, or what is missing was told        4  something is missing, twice, damaged, or disagrees
    """
    from silo.verify.folder import verify as held_against

    found = held_against(folder)
    show(found, as_json, lambda: _show(found))
    return EXIT_FOUND if found.problems else 0


def _show(found: "Verified") -> None:
    heads = ["logger", "run", "ticks", "recorded", "saved", "captured", "in memory"]
    show_rows([heads, *map(_row, found.runs)], right=(2, 3, 4, 5, 6))
    told = [f"told: {one.text}; {one.told}" for one in found.told]
    told += [f"{one.kind}: {one.text}" for one in (*found.problems, *found.not_kept)]
    for line in (*told, *(one.text for one in found.newest)):
        click.echo(printable(line))
    runs = f"{many(len(found.runs), 'run')}"
    before = f", {len(found.told)} told before" if found.told else ""
    less = len({one.run for one in found.not_kept})
    parts = f"all is there that was to be kept, of {less} not all ticks were" if less else "whole"
    if any(one.kind == "missing" for one in found.told):
        parts = "not whole"
    click.echo(f"{len(found.problems)} problems in {runs}{before}" if found.problems else f"{runs}: {parts}{before}")


def _row(run: "RunCovered") -> list[str]:
    counts = (run.ticks, run.recorded, run.saved, run.captured, run.in_memory)
    return [run.logger, run.run, *(count(one) if one else "-" for one in counts)]

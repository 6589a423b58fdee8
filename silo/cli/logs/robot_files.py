"""`silo files`: the recordings in a logger's folder on the robot: listed, fetched to this machine, deleted."""

from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.shell_completion import CompletionItem

from silo.cli.common import TypedPath, answer_of, ask_first, complete_logger, connect, items, progress, show_rows
from silo.cli.verbs import Verbs, verb
from silo.core.quantities.writing import many, size_text, wall_clock
from silo.errors import RefusedError

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo.recordings.requests import Recordings, SavedRecording

MOST_LOOKS = 60  # each looks into as many files as fit into a second


@click.group("files", cls=Verbs)
def files() -> None:
    """List, fetch and delete the recordings in the folder of a logger, on the robot.

    A NAME is that of a file or bag as `silo files ls` shows it, or its beginning before the ending, or a run number.

    \b
    Examples:
      silo files ls demo
      silo files fetch demo 17 -o logs
      silo files rm demo first_walk
    """


def _complete_name(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
    from silo.recordings.requests import RecordingRequests

    if (reply := answer_of(lambda: ctx.params.get("logger"), RecordingRequests.recordings, most=200)) is None:
        return []
    names = [file.name for one in reply.recordings for file in one.files if not one.unfinished]
    return items(names, incomplete)


def _show_list(found: "Recordings") -> None:
    rows = [_row(one) for one in reversed(found.recordings)]
    if rows:
        show_rows([("NAME", "TYPES", "BEGUN", "SPAN", "SIZE", "WHY"), *rows], right=(3, 4))
    left = f", the newest {len(rows)} of {found.count}" if found.count > len(rows) else ""
    free = f", {found.free_bytes / 1e9:.1f} GB free" if found.disk_bytes else ""
    nothing = "" if rows else "; `silo save` makes one"
    click.echo(f"{found.folder}: {many(len(rows), 'recording')}{left}{free}{nothing}")


@verb(files, "ls", shown=_show_list)
@click.option("-n", "--most", type=click.IntRange(1, 10_000), default=1000, show_default=True, help="Only the newest.")
def ls(client: "Client", most: int) -> "Recordings":
    """List the recordings in the logger's folder, the newest last.

    \b
    Examples:
      silo files ls demo
      silo files ls demo --json | jq '.recordings[0].why'
    """
    for _ in range(MOST_LOOKS):
        found = client.recordings(most)
        if not any(one.unread for one in found.recordings):
            break
    return found


@files.command()
@click.argument("logger", shell_complete=complete_logger)
@click.argument("names", metavar="NAME...", nargs=-1, required=True, shell_complete=_complete_name)
@click.option("-o", "--folder", type=TypedPath(path_type=Path), default=Path(), help="Where to; here if not given.")
@click.option("-f", "--force", is_flag=True, help="Replace files that are there already.")
@click.option(
    "--patience", type=click.FloatRange(0, 1e6), default=30.0, show_default=True, help="s to wait for a link."
)
def fetch(logger: str, names: tuple[str, ...], folder: Path, force: bool, patience: float) -> None:
    """Copy recordings to this machine; the same command goes on with one that was cut off.

    \b
    Examples:
      silo files fetch demo 17
      silo files fetch demo demo_20260102_13-07-27_00007.silo -o logs
    """
    from silo.files.saving import size_of

    with connect(logger) as client:
        for name in _meant(client, names):
            with progress(name) as tell:
                path = client.fetch(name, folder, tell, replace=force, patience_s=patience)
            click.echo(f"{path}  {size_text(size_of(path))}")


@files.command()
@click.argument("logger", shell_complete=complete_logger)
@click.argument("names", metavar="NAME...", nargs=-1, required=True, shell_complete=_complete_name)
@click.option("-y", "--yes", is_flag=True, help="Don't ask.")
def rm(logger: str, names: tuple[str, ...], yes: bool) -> None:
    """Delete recordings that this logger wrote.

    \b
    Example:
      silo files rm demo demo_20260102_13-07-27_00007.silo
    """
    with connect(logger) as client:
        meant = _meant(client, names)
        if not yes:
            question = f"delete {', '.join(meant)} on {client.found.label} for good?"
            ask_first(question, f"{question} Say --yes to delete without being asked; nothing was deleted")
        for name in meant:
            click.echo(client.delete_recording(name))


def _meant(client: "Client", names: tuple[str, ...]) -> list[str]:
    """Return the names of files and bags that are meant. Raises RefusedError for one that means none."""
    listed = client.recordings(10_000).recordings
    found: list[str] = []
    for name in names:
        meant = [file.name for one in listed for file in one.files if name in (file.name, one.stem)]
        if not meant and name.isdecimal():
            run = f"_{int(name):05d}"
            meant = [file.name for one in listed for file in one.files if one.stem.endswith(run)]
        if not meant:
            raise RefusedError(
                f"no recording is called '{name}' in the folder of {client.found.label}: see `silo files ls`"
            )
        found += meant
    return list(dict.fromkeys(found))


def _row(one: "SavedRecording") -> tuple[str, ...]:
    types = ", ".join(file.type.name.lower() for file in one.files)
    begun = one.begun_ns or min(file.changed_ns for file in one.files)
    when = wall_clock(begun, date=True)
    if one.unfinished:
        return one.stem, "part", when, "-", size_text(one.size_bytes), "being written, or its writer died"
    why = "not looked into yet" if one.unread else one.why or "-"
    return one.stem, types, when, f"{one.span_s:.1f} s" if one.span_s else "-", size_text(one.size_bytes), why

"""`silo recover`: what programs that died without saving left in shared memory."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from silo.cli.common import file_types, json_option, many, show_json, types_option
from silo.errors import SaveError, SiloError
from silo.model import FileType

if TYPE_CHECKING:
    from silo.helper.recovery import StaleSegment


@click.command()
@click.argument("segments", nargs=-1, type=click.Path(path_type=Path), metavar="[SEGMENT]...")
@click.option("-l", "--list", "only_list", is_flag=True, help="Only show what can be recovered.")
@click.option("--folder", type=click.Path(path_type=Path, file_okay=False), help="Instead of the logger's own folder.")
@click.option(
    "--look-in",
    type=click.Path(path_type=Path, file_okay=False, exists=True),
    default=Path(),
    help="Log folder of loggers with storage='disk'; this folder if not given.",
)
@types_option
@json_option
def recover(
    segments: tuple[Path, ...],
    only_list: bool,
    folder: Path | None,
    look_in: Path,
    types: tuple[str, ...],
    as_json: bool,
) -> None:
    """Save what programs left behind that died without saving, and free its memory.

    The helper process of a logger does this by itself; this command is for when that died, too.

    \b
    Examples:
      silo recover --list
      silo recover --folder /tmp/logs -t silo -t csv
    """
    from silo.helper.recovery import find_stale

    stale = find_stale(look_in)
    if only_list:
        _show(stale, as_json)
        return
    chosen = file_types(types)
    # a file that isn't readable as a segment is listed, and only touched when it is named
    paths = segments or tuple(one.path for one in stale if one.schema is not None)
    _recover(paths, folder, chosen, as_json)


def _show(stale: "Sequence[StaleSegment]", as_json: bool) -> None:
    if as_json:
        show_json([{"path": str(one.path), "ticks": one.ticks, "reason": one.reason} for one in stale])
        return
    for one in stale:
        logger = f"logger '{one.schema.logger}', {many(one.ticks, 'tick')}: " if one.schema else ""
        click.echo(f"{one.path}  {logger}{one.reason}")
    if not stale:
        click.echo("nothing to recover")


def _recover(paths: Sequence[Path], folder: Path | None, types: Sequence[FileType], as_json: bool) -> None:
    """Each segment by itself: one that fails doesn't keep the others. Raises SaveError at the end if any did."""
    from silo.helper.recovery import recover as recover_segment

    files, failed = [], 0
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    for path in paths:
        try:
            saved = recover_segment(path, folder, types)
        except SiloError as error:
            text = str(error)
            click.echo(text if text.startswith(str(path)) else f"{path}: {text}", err=True)
            failed += 1
            continue
        files += saved
        if not as_json:
            click.echo(f"{path}: {'saved' if saved else 'held no tick; its memory was freed'}")
            for file in saved:
                click.echo(f"  {file.path}  {file.size_bytes / 1e6:.1f} MB")
    if as_json:
        show_json(files)
    elif not paths:
        click.echo("nothing to recover")
    if failed:
        raise SaveError(f"{failed} of {many(len(paths), 'segment')} could not be recovered; they stay as they are")

"""`silo recover`: what programs that died without saving left in shared memory."""

from pathlib import Path

import click

from silo.cli.common import json_option, many, show_json
from silo.model import FileType


@click.command()
@click.argument("segments", nargs=-1, type=click.Path(path_type=Path), metavar="[SEGMENT]...")
@click.option("-l", "--list", "only_list", is_flag=True, help="Only show what can be recovered.")
@click.option("--folder", type=click.Path(path_type=Path, file_okay=False), help="Instead of the logger's own folder.")
@click.option(
    "-t",
    "--type",
    "types",
    multiple=True,
    type=click.Choice([one.name.lower() for one in FileType]),
    default=["silo"],
    show_default=True,
    help="What to write; may be repeated.",
)
@json_option
def recover(
    segments: tuple[Path, ...], only_list: bool, folder: Path | None, types: tuple[str, ...], as_json: bool
) -> None:
    """Save what programs left behind that died without saving, and free its memory.

    The helper process of a logger does this by itself; this command is for when that died, too.

    \b
    Examples:
      silo recover --list
      silo recover --folder /tmp/logs -t silo -t csv
    """
    from silo.server.recovery import find_stale
    from silo.server.recovery import recover as recover_segment

    chosen = [FileType[one.upper()] for one in dict.fromkeys(types)]
    stale = [one for one in find_stale() if not segments or Path(one.path) in segments]
    if only_list or not stale:
        if as_json:
            show_json([{"path": str(one.path), "ticks": one.ticks, "reason": one.reason} for one in stale])
            return
        for one in stale:
            click.echo(f"{one.path}  logger '{one.schema.logger}', {many(one.ticks, 'tick')}: {one.reason}")
        if not stale:
            click.echo("nothing to recover")
        return
    files = []
    for one in stale:
        saved = recover_segment(one.path, folder, chosen)
        files += saved
        if not as_json:
            click.echo(f"logger '{one.schema.logger}', {many(one.ticks, 'tick')}:")
            for file in saved:
                click.echo(f"  {file.path}  {file.size_bytes / 1e6:.1f} MB")
    if as_json:
        show_json(files)

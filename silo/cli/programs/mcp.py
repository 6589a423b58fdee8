"""`silo mcp`: logs for agents, over standard input and output."""

from pathlib import Path

import click

from silo.cli.common import TypedPath
from silo.errors import LogNotFoundError


@click.command("mcp")
@click.argument("folders", metavar="[FOLDER]...", nargs=-1, type=TypedPath(path_type=Path))
def mcp(folders: tuple[Path, ...]) -> None:
    """Show the runs below folders to an agent, by the Model Context Protocol, until it ends. Read-only.

    An agent starts it: give its configuration the command `silo` with the arguments `mcp` and the folders. It lists
    runs, tells what is in one, computes statistics and expressions, draws pictures, and reads what runs now. It can't
    change anything and reaches no other file.

    \b
    Examples:
      silo mcp logs
      claude mcp add silo -- silo mcp ~/logs
    """
    from silo.bridges.agents import Shelf, server

    for folder in folders:
        if not folder.is_dir():
            raise LogNotFoundError(f"there is no folder '{folder}'")
    server(Shelf(folders or (Path(),))).run()

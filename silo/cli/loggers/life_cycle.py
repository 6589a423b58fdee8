"""`silo start`, `stop`, `restart`, `save`."""

from typing import TYPE_CHECKING

import click

from silo.cli.bulk import carry_out, everyone_option, many_meant
from silo.cli.common import (
    connect,
    json_option,
    logger_argument,
    naming_ways_out,
    progress,
    show,
    types_option,
    unsaved,
    unsaved_options,
)
from silo.core.quantities.writing import many, size_text

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo.core.elements import Status


@click.command()
@logger_argument
@unsaved_options
@everyone_option
def start(logger: str | None, save_first: bool, discard: bool, everyone: bool) -> None:
    """Start logging; the buffers are cleared, which is refused while they hold what is in no file.

    \b
    Examples:
      silo start demo
      silo start demo --save
      silo start 'robot*/anymal' --all       (one answer per logger)
    """
    chosen = unsaved(save_first=save_first, discard=discard)
    if (found := many_meant("start", logger, everyone=everyone)) is not None:
        from silo.client.bulk import starting

        carry_out("start", found, lambda client: starting(client, chosen))
        return
    with connect(logger) as client, naming_ways_out("start", client):
        _say_state(client, client.start(chosen, click.echo))


@click.command()
@logger_argument
@everyone_option
def stop(logger: str | None, everyone: bool) -> None:
    """Stop logging; the data stays and can be saved. Stopping a stopped logger succeeds.

    A glob is for many: it names them and asks, or takes --all. Each gives an answer of its own, and the exit code is 1
    if one of them didn't.

    \b
    Examples:
      silo stop demo
      silo stop 'robot*/anymal' --all
      silo stop --all                        (every logger)
    """
    if (found := many_meant("stop", logger, everyone=everyone)) is not None:
        from silo.client.bulk import stopping

        carry_out("stop", found, stopping)
        return
    with connect(logger) as client:
        _say_state(client, client.stop())


@click.command()
@logger_argument
@unsaved_options
@everyone_option
def restart(logger: str | None, save_first: bool, discard: bool, everyone: bool) -> None:
    """Stop, and start with empty buffers, which is refused while they hold what is in no file.

    \b
    Examples:
      silo restart demo
      silo restart demo --discard
    """
    chosen = unsaved(save_first=save_first, discard=discard)
    if (found := many_meant("restart", logger, everyone=everyone)) is not None:
        from silo.client.bulk import restarting

        carry_out("restart", found, lambda client: restarting(client, chosen))
        return
    with connect(logger) as client, naming_ways_out("restart", client):
        _say_state(client, client.restart(chosen, click.echo))


def _say_state(client: "Client", status: "Status") -> None:
    unsaved = status.state.value == "stopped" and status.run_ticks and not status.saved
    hint = f", not saved (`silo save {client.found.label}`)" if unsaved else ""
    click.echo(f"{status.logger}: {status.state.value}, {many(status.run_ticks, 'tick')}{hint}")


@click.command()
@logger_argument
@types_option
@click.option("-n", "--name", default="", help="File name without ending, instead of LOGGER_DATE_NUMBER.")
@click.option("--timeout", type=click.FloatRange(min=1), default=600.0, show_default=True, help="Wait so long, s.")
@everyone_option
@json_option
def save(logger: str | None, types: tuple[str, ...], name: str, timeout: float, everyone: bool, as_json: bool) -> None:
    """Save what the buffers hold to files in the logger's folder, while it goes on logging.

    \b
    Examples:
      silo save demo
      silo save demo -t silo -t bag --name first_walk
      silo save 'robot*/anymal' --all
    """
    from silo.files.formats import file_types

    chosen = file_types(types)
    if (found := many_meant("save", logger, everyone=everyone)) is not None:
        from silo.client.bulk import saving

        carry_out("save", found, lambda client: saving(client, chosen, name, timeout), as_json=as_json)
        return
    with connect(logger) as client, progress("saving") as tell:
        files = client.wait_saved(client.save(chosen, name), timeout, tell)
    show(files, as_json, lambda: "\n".join(f"{file.path}  {size_text(file.size_bytes)}" for file in files) or None)

"""`silo control`: who has control of a logger, and taking, releasing and handing it over."""

import time

import click

from silo.cli.common import complete_logger, connect, json_option, logger_argument, show_json
from silo.core.quantities import duration, read_seconds
from silo.net.access.senders import name_of


@click.group()
def control() -> None:
    """Let one operator at a time change a logger: take control, hand it over, release it.

    While somebody has control, others look. It ends by itself: 15 s after a silo-tui that has it is gone, taken here
    after the time that you say.

    \b
    Examples:
      silo control show                      (who is connected, and who has control)
      silo control take robot3/anymal --for 30min
      silo control give robot3/anymal bob
      silo control release robot3/anymal
    """


@control.command("take")
@logger_argument
@click.option("--for", "lasting", default="10min", show_default=True, metavar="TIME", help="How long: 30s, 10min, 2h.")
@click.option("--force", is_flag=True, help="From whoever has it; everybody is told.")
def take(logger: str | None, lasting: str, force: bool) -> None:
    """Take control: from now on nobody else changes anything.

    \b
    Example:
      silo control take anymal --for 30min
    """
    lease_s = read_seconds("--for", lasting)
    with connect(logger) as client:
        click.echo(client.take_control(force=force, lease_s=lease_s))


@control.command("release")
@logger_argument
def release(logger: str | None) -> None:
    """Give control up.

    \b
    Example:
      silo control release anymal
    """
    with connect(logger) as client:
        click.echo(client.release_control())


@control.command("give")
@click.argument("words", nargs=-1, required=True, metavar="[LOGGER] USER", shell_complete=complete_logger)
def give(words: tuple[str, ...]) -> None:
    """Hand control over to an operator who is connected.

    \b
    Example:
      silo control give anymal bob
    """
    if len(words) > 2:
        raise click.UsageError("one logger and one user: silo control give anymal bob")
    with connect(words[0] if len(words) == 2 else None) as client:
        click.echo(client.hand_over(words[-1]))


@control.command("show")
@logger_argument
@json_option
def show(logger: str | None, as_json: bool) -> None:
    """Show who has control, and who is connected.

    \b
    Example:
      silo control show anymal --json
    """
    with connect(logger) as client:
        me = client.found.label
        status = client.status()
    now_s = time.time()
    if as_json:
        show_json({"control": status.control, "one_operator": status.one_operator, "clients": status.clients})
        return
    if status.control is not None:
        since, left = now_s - status.control.since_ns / 1e9, status.control.until_ns / 1e9 - now_s
        click.echo(f"{status.control.who} has control since {duration(since)}, for {duration(max(0.0, left))} more")
    else:
        need = "changes need it: `silo control take`" if status.one_operator else "every operator may change it"
        click.echo(f"nobody has control of {me}; {need}")
    for each in status.clients:
        may = f"as {name_of(each.identity)}, may change it" if each.identity else "looks"
        click.echo(f"  {each.who}  ({may})")

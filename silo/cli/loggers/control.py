"""`silo control`: who has control of a logger, and taking, releasing and handing it over."""

import time
from typing import TYPE_CHECKING

import click

from silo.cli.verbs import Verbs, verb
from silo.core.quantities.reading import read_seconds
from silo.core.quantities.writing import duration, since_text
from silo.net.access.senders import name_of

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo.core.elements import Status


@click.group(cls=Verbs)
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


@verb(control, "take")
@click.option("--for", "lasting", default="10min", show_default=True, metavar="TIME", help="How long: 30s, 10min, 2h.")
@click.option("--force", is_flag=True, help="From whoever has it; everybody is told.")
def take(client: "Client", lasting: str, force: bool) -> str:
    """Take control: from now on no other user changes anything; programs of one user share it.

    \b
    Example:
      silo control take anymal --for 30min
    """
    return client.take_control(force=force, lease_s=read_seconds("--for", lasting))


@verb(control, "release")
def release(client: "Client") -> str:
    """Give control up.

    \b
    Example:
      silo control release anymal
    """
    return client.release_control()


@verb(control, "give", "USER")
def give(client: "Client", user: str) -> str:
    """Hand control over to an operator who is connected.

    \b
    Example:
      silo control give anymal bob
    """
    return client.give_control(user)


def _facts(found: "tuple[str, Status]") -> dict[str, object]:
    _, status = found
    return {"control": status.control, "one_operator": status.one_operator, "clients": status.clients}


def _show(found: "tuple[str, Status]") -> None:
    logger, status = found
    if status.control is not None:
        since, left = since_text(status.control.since_ns), status.control.until_ns / 1e9 - time.time()
        click.echo(f"{status.control.who} has control since {since}, for {duration(max(0.0, left))} more")
    else:
        take = f"changes need it: `silo control take {logger}`"
        need = take if status.one_operator else "every operator may change it"
        click.echo(f"nobody has control of {logger}; {need}")
    for each in status.clients:
        may = f"as {name_of(each.identity)}, may change it" if each.identity else "looks"
        click.echo(f"  {each.who}  ({may})")


@verb(control, "show", shown=_show, json=_facts)
def show(client: "Client") -> "tuple[str, Status]":
    """Show who has control, and who is connected.

    \b
    Example:
      silo control show anymal --json
    """
    return client.found.label, client.status()

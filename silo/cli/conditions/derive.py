"""`silo derive`: signals that are computed from others wherever rows are read."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from silo.cli.verbs import Listing, LoggerFirst, verb

if TYPE_CHECKING:
    from silo.client.client import Client
    from silo.core.elements import ElementInfo


@click.group(cls=LoggerFirst, usual="add")
def derive() -> None:
    """Derive signals from others: watched, plotted, saved, judged as elements are, at no cost for the control loop.

    Also while the logger runs. EXPRESSION is that of triggers and limits; a division has blanks on both sides.

    \b
    Examples:
      silo derive demo power 'joints/tau * joints/qd' --unit W
      silo derive rms 'sqrt(mean(imu/acc_z * imu/acc_z, 100ms))'
      silo derive ls
      silo derive rm demo power
    """


@verb(derive, "add", "NAME EXPRESSION", short="Derive a signal; the word `add` may be left out.")
@click.option("--unit", default="", metavar="UNIT", help="Instead of the one that follows from its signals.")
def add(client: "Client", name: str, expression: str, unit: str) -> str:
    """Derive a signal, or give the one of its name another expression.

    `silo script save` writes it to the logger's script.

    \b
    Example:
      silo derive demo power 'joints/tau * joints/qd' --unit W
    """
    return client.derive(name, expression, unit)


def _facts(found: "Sequence[ElementInfo]") -> list[dict[str, Any]]:
    return [
        {"name": one.name, "expression": one.expression, "unit": one.unit, "values": len(one.entries),
         "computed": one.options.enabled} for one in found
    ]  # fmt: skip


DERIVED = Listing[Any](
    ("NAME", "VALUES", "UNIT", "COMPUTED"),
    lambda one: (one.name, str(len(one.entries)), "" if one.unit == "-" else one.unit, one.description),
    "no derived signals; `silo derive NAME 'EXPRESSION'` makes one",
    right=(1,),
)


@verb(derive, "ls", short="List the derived signals.", shown=DERIVED, json=_facts)
def ls(client: "Client") -> "Sequence[ElementInfo]":
    """List the derived signals, and why one can't be computed.

    \b
    Example:
      silo derive ls demo
    """
    return client.table().derived


@verb(derive, "rm", "NAME", short="Forget a derived signal.")
def rm(client: "Client", name: str) -> str:
    """Forget a derived signal on which nothing stands: no other one, no limits, no trigger.

    \b
    Example:
      silo derive rm demo power
    """
    return client._remove_derived(name)

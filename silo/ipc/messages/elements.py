"""The element table, and edits of it."""

from silo.ipc.messages.base import Ask, Reply, RobotRequest
from silo.model import Edit, Extras, Table


class TableReply(Reply, frozen=True):
    """Carries a `Table`."""

    table: Table


class EditsApplied(Reply, frozen=True):
    """`changed` counts elements; `unknown` are names of a script that the table doesn't have.

    `warnings` are `file:line: reason` of keys of the script that silo doesn't know.
    """

    revision: int
    changed: int
    unknown: list[str] = []
    warnings: list[str] = []


class GetTable(Ask[TableReply], frozen=True):
    """Which elements are there, with which options?"""


class ApplyEdits(RobotRequest[EditsApplied], frozen=True):
    """All or nothing, and only while stopped. `revision` is the table's that the edits are based on (-1: any)."""

    revision: int
    edits: list[Edit]
    extras: Extras | None = None  # derived signals, limits and triggers of a script, None: they stay

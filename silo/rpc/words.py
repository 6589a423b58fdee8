"""What callers of a client write, and what it stands for: names of elements."""

from silo.core.arguments import shown
from silo.core.elements import State, Status, Table
from silo.core.names import Names
from silo.core.quantities.writing import many
from silo.errors import ConnectionLostError, ElementError


def full_name(name: str, status: Status, table: Table) -> str:
    """The full name of an element, by the rule of `silo.core.names`. Raises ElementError with the nearest one."""
    names = Names((info.name for info in (*table.elements, *table.derived)), status.prefix)
    found = names.find(name, namespaces=False)
    if len(found) > 1:
        raise ElementError(names.several(name, found))
    if not found:
        hint = names.hint(name, f"it has {many(len(table.elements), 'element')}, see client.table()")
        raise ElementError(f"logger '{status.logger}' has no element {shown(name)}{hint}")
    whole = names.name(found[0])
    if found[0][0] >= len(table.elements):
        raise ElementError(f"'{whole}' is derived, which has no topic: client.stream(['{whole}']) brings it")
    return whole


def why_silent(name: str, label: str, status: Status, table: Table) -> str:
    """Why no sample of an element of the logger that `label` means comes and none will; empty where one may.

    Raises ConnectionLostError where the robot program is dead.
    """
    if status.state is State.DEAD:
        raise ConnectionLostError(status.reason)
    info = next((one for one in table.elements if one.name == name), None)
    if info is None:
        return f"logger '{status.logger}' has no element '{name}' any more"
    if not info.options.enabled or not info.options.action.publishes:
        off = "is off" if not info.options.enabled else "is saved but not published"
        return (
            f"'{name}' {off}, so nothing comes: `silo set {label} {name} on action=both --cut` has it come, also while "
            "the logger runs"
        )
    return ""

"""Refusals that both the helper process and the robot program give: what can be told early is, with the same words."""

from silo.ipc.messages import ApplyEdits, Refused, RefusedWhy


def refused_running() -> Refused:
    """Return the answer to an edit of a logger that runs."""
    return Refused(RefusedWhy.RUNNING, "the logger is running: stop it, then apply; nothing was changed")


def refused_conflict(request: ApplyEdits, revision: int) -> Refused | None:
    """Return the answer to edits that are based on another revision than the table's; None where they aren't."""
    if request.revision in (-1, revision):
        return None
    return Refused(
        RefusedWhy.CONFLICT,
        f"somebody changed the table meanwhile (it is at revision {revision}, the edits are based on "
        f"{request.revision}): read it again; nothing was changed",
    )

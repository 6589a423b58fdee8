"""Refusals that both the helper process and the robot program give: what can be told early is, with the same words."""

from silo.core.elements import Problem
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.settings.options import refusal
from silo.state.requests import ApplyEdits


def refused_running() -> RequestRefusedError:
    """Return what is raised for an edit of a logger that runs."""
    return RequestRefusedError(RefusedWhy.RUNNING, "the logger is running: stop it, then apply; nothing was changed")


def check_revision(request: ApplyEdits, revision: int) -> None:
    """Raise RequestRefusedError for edits that are based on another revision than the table's."""
    if request.revision not in (-1, revision):
        raise RequestRefusedError(
            RefusedWhy.CONFLICT,
            f"somebody changed the table meanwhile (it is at revision {revision}, the edits are based on "
            f"{request.revision}): read it again; nothing was changed",
        )


def check_none(problems: list[Problem]) -> None:
    """Raise RequestRefusedError with what is wrong, if something is."""
    if problems:
        raise RequestRefusedError(RefusedWhy.INVALID, refusal(problems), problems)

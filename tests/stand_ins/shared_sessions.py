"""What sessions to networks this process shares."""

from silo.net import sessions


def open_configurations() -> dict[str, int]:
    """The configurations to which sessions are open, with how many use each."""
    return {path: shared.users for path, shared in sessions._shared.items() if shared.session is not None}

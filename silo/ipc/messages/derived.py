"""Signals that are computed from others."""

from silo.ipc.messages.base import Done, RobotRequest
from silo.model import Derived


class SetDerived(RobotRequest[Done], frozen=True):
    """Derive a signal from others, or give one of that name another expression; also while the logger runs.

    The name is whole, or without the logger's prefix.
    """

    derived: Derived


class RemoveDerived(RobotRequest[Done], frozen=True):
    """Forget a derived signal on which nothing stands."""

    name: str

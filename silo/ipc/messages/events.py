"""The event log, and marks in it."""

from typing import ClassVar

from silo.model import LoggedEvent
from silo.rpc.declaring import Ask, Do, Reply


class Events(Reply, frozen=True):
    """Lines of the event log, oldest first. `missed` counts those asked for that are older and not among them."""

    events: list[LoggedEvent]
    missed: int = 0


class Marked(Reply, frozen=True):
    """The mark as it stands in the event log."""

    event: LoggedEvent


class GetEvents(Ask[Events], frozen=True):
    """What happened after line `since` of the event log? The newest `limit` of it."""

    since: int = 0
    limit: int = 1000


class AddMark(Do[Marked], frozen=True):
    """Mark a tick of the present run with some words; -1 is the newest.

    With a time stamp `at_ns`, the newest tick up to it.
    """

    timeout_s: ClassVar[float] = 2.0
    needs_control: ClassVar[bool] = False

    text: str
    tick: int = -1
    at_ns: int = 0

"""Which events of a logger a client has handed out, over all its sessions: each once.

Of what was told without a link it is the newest 256; `client.events()` has all.
"""

from collections import deque
from collections.abc import Callable

from silo.core.elements import LoggedEvent
from silo.rpc.published import Event
from silo.state.requests import HelloReply

MOST = 256  # that are fetched, and that are remembered


class HeardEvents:
    """Tells what is news. Events are published to who is there: what came while no link was is in the event log."""

    def __init__(self) -> None:
        self._folder = ""
        self._number = -1  # of the newest line of the event log that was handed out, or was there at the first hello
        self._newest: deque[tuple[int, str, str]] = deque(maxlen=MOST)  # a line may be numbered on after it was told

    def missed(self, hello: HelloReply, read: Callable[[int, int], list[LoggedEvent]]) -> list[Event]:
        """Return what was told between two sessions of one logger, oldest first, the newest `MOST` of it.

        Args:
            hello: what its helper process said in the new session; one of an older silo says no number.
            read: returns so many of the lines after a number; called when the session is told what happens.
        """
        newest, folder = hello.newest_event, hello.status.folder
        goes_on = folder == self._folder and 0 <= self._number <= newest
        lines = read(self._number, MOST) if goes_on else []
        self._number, self._folder = newest, folder
        name = hello.status.logger
        return [Event.of(line, by=line.who if line.who != name else "") for line in lines]

    def is_new(self, event: Event) -> bool:
        """Whether an event was not handed out yet; from now on it was."""
        one = (event.time_ns, event.kind, event.text)
        if one in self._newest:
            return False
        if event.logged:
            self._newest.append(one)
            self._number = max(self._number, event.logged)
        return True

"""Requests whose answers nobody waits for one by one: many at a time, and none holds up the others."""

import time
from collections import deque
from collections.abc import Hashable
from typing import Any, Generic, TypeVar

import zenoh

from silo.errors import ConnectionLostError
from silo.fleet.exchange import encoded, key_of, payload_of
from silo.net.keys import Root
from silo.net.sessions import SessionLease
from silo.rpc.clocks import UNKNOWN, TheirClock
from silo.rpc.declaring import Do, Request

AT_ONCE = 256  # a window of 64 cost a fleet of 100 a second round trip
POLL_S = 0.002

Tag = TypeVar("Tag", bound=Hashable)


class Pending:
    """A request whose answer nobody waits for: it is looked at when it has come."""

    def __init__(
        self, mine: SessionLease, root: Root, request: Request[Any], timeout_s: float, clock: TheirClock = UNKNOWN
    ) -> None:
        timeout_s += mine.slack_s
        # not a ring: it loses what it holds when the query ends
        self._key = key_of(request, root, mine.user)
        self._replies = mine.session.get(
            self._key,
            zenoh.handlers.FifoChannel(4),
            payload=encoded(request, clock.after(timeout_s)),
            timeout=timeout_s,
            attachment=mine.proof if request.key == Do.key else None,
        )

    def poll(self) -> tuple[bool, bytes | None]:
        """Return whether it has come to its end, and with what."""
        try:
            while (reply := self._replies.try_recv()) is not None:
                if reply.err is not None:  # its time is up
                    return True, None
                if (payload := payload_of(reply, self._key)) is not None:
                    return True, payload
        except zenoh.ZError:
            return True, None
        return False, None


class Asking(Generic[Tag]):
    """Requests to many loggers over one session, so many of them under way that a round trip serves them all."""

    def __init__(self, mine: SessionLease, timeout_s: float, at_once: int = AT_ONCE) -> None:
        self._mine, self._timeout_s, self._at_once = mine, timeout_s, at_once
        self._waiting: deque[tuple[Tag, Root, Request[Any]]] = deque()
        self._under_way: dict[Tag, Pending] = {}

    def add(self, tag: Tag, root: Root, request: Request[Any]) -> None:
        """Ask a logger as soon as it is its turn."""
        self._waiting.append((tag, root, request))
        self._send()

    def _send(self) -> None:
        while self._waiting and len(self._under_way) < self._at_once:
            tag, root, request = self._waiting.popleft()
            self._under_way[tag] = Pending(self._mine, root, request, self._timeout_s)

    @property
    def count(self) -> int:
        """How many have no answer yet."""
        return len(self._waiting) + len(self._under_way)

    def poll(self) -> list[tuple[Tag, bytes | None]]:
        """Return what has come since: None for who gave no answer. Raises ConnectionLostError."""
        found = []
        try:
            for tag, pending in list(self._under_way.items()):
                done, payload = pending.poll()
                if done:
                    del self._under_way[tag]
                    found.append((tag, payload))
            self._send()
        except zenoh.ZError as error:
            raise ConnectionLostError(f"the session ended while loggers were asked: {error}") from error
        return found

    def wait(self) -> dict[Tag, bytes | None]:
        """Return all answers, as soon as the last one came or was given up. Raises ConnectionLostError."""
        found: dict[Tag, bytes | None] = {}
        while self.count:
            found.update(self.poll())
            if self.count:
                time.sleep(POLL_S)
        return found

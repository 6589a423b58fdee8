"""Requests whose answers nobody waits for one by one: many at a time, and none holds up the others."""

import time
from collections import deque
from itertools import chain, repeat
from typing import Any

import zenoh

from silo.errors import ConnectionLostError
from silo.fleet.exchange import AGAIN_S, encoded, key_of, payload_of
from silo.net.keys import Root
from silo.net.sessions import SessionLease
from silo.rpc.clocks import UNKNOWN, TheirClock
from silo.rpc.declaring import Do, Request

AT_ONCE = 256  # a window of 64 cost a fleet of 100 a second round trip
POLL_S = 0.002


class Pending:
    """A request whose answer nobody waits for: it is looked at when it has come.

    One that only reads and ends without an answer is asked again a few times, a `patient` one until its time is up.
    Raises ConnectionLostError where the session has ended.
    """

    def __init__(
        self,
        mine: SessionLease,
        root: Root,
        request: Request[Any],
        timeout_s: float,
        clock: TheirClock = UNKNOWN,
        *,
        patient: bool = False,
    ) -> None:
        timeout_s += mine.slack_s
        self._session = mine.session
        self._key = key_of(request, root, mine.user)
        self._payload = encoded(request, clock.after(timeout_s))
        self._proof = mine.proof if request.key == Do.key else None
        self._pauses_s = iter(AGAIN_S if request.key != Do.key else ())
        if patient and request.key != Do.key:
            self._pauses_s = chain(self._pauses_s, repeat(AGAIN_S[-1]))
        self._until_s = time.monotonic() + timeout_s
        self._again_s: float | None = None  # when it is asked again
        try:
            self._ask()
        except zenoh.ZError as error:
            raise ConnectionLostError(f"the session ended before anything was asked: {error}") from error

    def _ask(self) -> None:
        # not a ring: it loses what it holds when the query ends
        self._replies = self._session.get(
            self._key, zenoh.handlers.FifoChannel(4), payload=self._payload, attachment=self._proof,
            timeout=max(0.01, self._until_s - time.monotonic()),
        )  # fmt: skip
        self._again_s = None

    def poll(self) -> tuple[bool, bytes | None]:
        """Return whether it has come to its end, and with what."""
        try:
            if self._again_s is not None:
                if time.monotonic() < self._again_s:
                    return False, None
                self._ask()
            while (reply := self._replies.try_recv()) is not None:
                if reply.err is not None:  # its time is up
                    return True, None
                if (payload := payload_of(reply, self._key)) is not None:
                    return True, payload
        except zenoh.ZError:  # no more will come
            pause_s = next(self._pauses_s, None)
            if pause_s is None or time.monotonic() + pause_s > self._until_s:
                return True, None
            self._again_s = time.monotonic() + pause_s
        return False, None


class Asking:
    """Requests to loggers by their keys, so many under way over one session that a round trip serves them all."""

    def __init__(self, mine: SessionLease, timeout_s: float, *, patient: bool = False) -> None:
        """Who is `patient` asks those again that have no answer at once, until their time is up."""
        self._mine, self._timeout_s, self._patient = mine, timeout_s, patient
        self._waiting: deque[tuple[str, Root, Request[Any]]] = deque()
        self._under_way: dict[str, Pending] = {}

    def add(self, key: str, root: Root, request: Request[Any]) -> None:
        """Ask a logger as soon as it is its turn."""
        self._waiting.append((key, root, request))
        self._send()

    def _send(self) -> None:
        while self._waiting and len(self._under_way) < AT_ONCE:
            key, root, request = self._waiting.popleft()
            self._under_way[key] = Pending(self._mine, root, request, self._timeout_s, patient=self._patient)

    @property
    def count(self) -> int:
        """How many have no answer yet."""
        return len(self._waiting) + len(self._under_way)

    def poll(self) -> list[tuple[str, bytes | None]]:
        """Return what has come since: None for who gave no answer. Raises ConnectionLostError."""
        found = []
        for key, pending in list(self._under_way.items()):
            done, payload = pending.poll()
            if done:
                del self._under_way[key]
                found.append((key, payload))
        self._send()
        return found

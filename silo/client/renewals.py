"""Views, streams and pins: what the helper process forgets when nobody renews its lease."""

import contextlib
import itertools
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

import msgspec

from silo.client.connection import Connection
from silo.control.requests import TakeControl
from silo.errors import ConnectionLostError
from silo.fleet.exchange import decode_reply
from silo.fleet.many import Pending
from silo.history.requests import ClosePin, CloseStream, KeepPin, OpenStream, StreamOpened
from silo.live.requests import CloseView, OpenView, ViewOpened
from silo.rpc.declaring import Done, Request
from silo.rpc.refusals import Refused, RefusedWhy

if TYPE_CHECKING:
    from silo.history.arrays import Pin, Stream
    from silo.live.view import View


RENEW_S = 2.0  # a third of a view's lease
GONE = (RefusedWhy.NOT_FOUND, RefusedWhy.CONTROL, RefusedWhy.FORBIDDEN)  # it is no more, or somebody else has it


class ControlLease:
    """Control that a client renews until it gives it up, or somebody takes it."""

    refused = ""

    def __init__(self, request: TakeControl, on_lost: Callable[[str], None] | None) -> None:
        self.request, self._on_lost = request, on_lost

    def refuse(self, why: str) -> None:
        """Somebody else has it."""
        self.refused = why
        if self._on_lost is not None:
            self._on_lost(why)


Leased: TypeAlias = "View | Stream | Pin | ControlLease"


class Renewals:
    """Renews them while the connection is up, and opens them anew with another helper process."""

    def __init__(self, connection: Connection, name: Callable[[], str]) -> None:
        self._connection = connection
        self._name = name
        self._lock = threading.Lock()
        self._due_s: dict[Leased, float] = {}
        self._renewals: dict[Leased, Pending] = {}
        self._session = 1
        self.numbers = itertools.count(1)  # of views and streams

    def add(self, view: Leased) -> None:
        """Keep up a lease that was just given."""
        with self._lock:
            self._due_s[view] = time.monotonic() + RENEW_S

    def drop(self, leased: Leased) -> bool:
        """Renew a lease no more, and leave it to others to say so; whether it was kept up until now."""
        with self._lock:
            self._renewals.pop(leased, None)
            return self._due_s.pop(leased, None) is not None

    def forget(self, view: "View | Stream | Pin") -> None:
        """Let a lease end, and say so to the helper process."""
        self._connection.forget(view)
        if self.drop(view) and self._connection.connected:
            # nobody waits for the answer: if it gets lost, or the link just now, the lease ends the view
            with contextlib.suppress(ConnectionLostError):
                self._connection.ask_later(self._signed(self._closing(view)), 1.0)

    def _closing(self, leased: "View | Stream | Pin") -> Request[Done]:
        request = leased.request
        if isinstance(request, OpenView):
            return CloseView(view=request.view, proof=request.proof)
        if isinstance(request, OpenStream):
            return CloseStream(stream=request.stream, proof=request.proof)
        return ClosePin(pin=request.pin, proof=request.proof)

    def _signed(self, request: Request[Any]) -> Request[Any]:
        return msgspec.structs.replace(request, client=self._name())

    def renew_soon(self, view: Leased) -> None:
        """Renew a lease in the next round."""
        with self._lock:
            if view in self._due_s:
                self._due_s[view] = 0.0

    def renew(self) -> None:
        """Renew leases, and open views anew in a new session. Called by the connection's thread; never waits."""
        now_s = time.monotonic()
        with self._lock:
            if self._session != self._connection.sessions:
                self._session = self._connection.sessions
                self._renewals.clear()
                self._due_s = dict.fromkeys(self._due_s, 0.0)
            due = [view for view, at_s in self._due_s.items() if now_s >= at_s and view not in self._renewals]
            waiting = list(self._renewals.items())
        for view, pending in waiting:
            done, payload = pending.poll()
            if done:
                with self._lock:
                    self._renewals.pop(view, None)
                self._take_renewal(view, payload)
        for view in due:
            request = view.request
            pending = self._connection.ask_later(self._signed(request), request.timeout_s)
            with self._lock:
                if view in self._due_s:
                    self._renewals[view] = pending
                    self._due_s[view] = now_s + RENEW_S

    def _take_renewal(self, view: Leased, payload: bytes | None) -> None:
        if payload is None:
            self.renew_soon(view)
            return
        reply = decode_reply(payload, "the helper process")
        if isinstance(reply, ViewOpened | StreamOpened):
            accept: Callable[[ViewOpened | StreamOpened], None] | None = getattr(view, "accept", None)
            if accept is not None:
                accept(reply)
        elif isinstance(reply, Refused) and not isinstance(view.request, TakeControl | KeepPin):
            view.refuse(reply.text)  # asked for again and again: what it shows may be there again
        elif isinstance(reply, Refused) and reply.why in GONE:
            view.refuse(reply.text)
            self.drop(view)

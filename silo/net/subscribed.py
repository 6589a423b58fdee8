"""The client's end of what it subscribes to: a subscription of the present session, which others follow."""

import threading
from collections.abc import Callable
from typing import Any

import zenoh

from silo.net.keys import ClientId, Root
from silo.net.session import undeclare
from silo.rpc.leases import Closing


class Subscribed(Closing):
    """What is sent to this client until it is closed. A child subscribes in `attach`; `_changed` guards all of it."""

    attach: Callable[[zenoh.Session, Root, ClientId], None]

    def __init__(self, on_close: Callable[[Any], None]) -> None:
        self._on_close = on_close
        self._changed = threading.Condition()
        self._subscriber: zenoh.Subscriber[Any] | None = None
        self._closed = False

    def detach(self) -> None:
        """End the subscription; the session may be closed, or go on for others."""
        with self._changed:
            subscriber, self._subscriber = self._subscriber, None
            self._forget()
        undeclare(subscriber)

    def _forget(self) -> None:
        """Let go of what another helper process numbers anew."""

    def close(self) -> None:
        """End it; closing twice is fine."""
        with self._changed:
            subscriber, self._subscriber = self._subscriber, None
            self._closed = True
            self._changed.notify_all()
        undeclare(subscriber)
        self._on_close(self)

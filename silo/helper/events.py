"""Telling every client what happened. Any thread of the helper may tell; nobody waits for a slow client."""

import threading
import time
from collections.abc import Sequence

import msgspec
import zenoh

from silo.helper.mirror import Mirror
from silo.ipc.keys import Root
from silo.ipc.published import Event, EventKind
from silo.model import SavedFile

MAX_BY = 120

_encoder = msgspec.msgpack.Encoder()


def plain(text: str, limit: int = MAX_BY) -> str:
    """Return a client's words, safe to show on a terminal: no control characters, not too long."""
    return "".join(character for character in text[:limit] if character.isprintable())


class Events:
    """Numbers events and publishes them."""

    def __init__(self, session: zenoh.Session, root: Root, mirror: Mirror) -> None:
        self._publisher = session.declare_publisher(
            root.key("event"), congestion_control=zenoh.CongestionControl.DROP, priority=zenoh.Priority.INTERACTIVE_HIGH
        )
        self._mirror = mirror
        self._lock = threading.Lock()
        self._number = 0

    def publish(
        self,
        kind: EventKind,
        text: str,
        *,
        by: str = "",
        job: int = 0,
        progress: float = 0.0,
        files: Sequence[SavedFile] = (),
    ) -> None:
        """Publish an event with the present status."""
        status = self._mirror.status()
        with self._lock:
            self._number += 1
            event = Event(self._number, time.time_ns(), kind, text, plain(by), status, job, progress, list(files))
            self._publisher.put(_encoder.encode(event))

"""The client's end of a topic: every sample of a published element, in batches of arrays."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import zenoh
from numpy.typing import NDArray

from silo.errors import ConnectionLostError
from silo.ipc.keys import Root, unescape


@dataclass(frozen=True)
class Batch:
    """Samples, oldest first: `time_ns` int64 of shape `(n,)`, `values` of shape `(n, *shape of the element)`.

    `first` is the number of the first sample since start: a gap to the batch before is a loss, a smaller number a new
    start. Elements of several types give a structured array, its fields called like the entries' suffixes.
    """

    first: int
    time_ns: NDArray[np.int64]
    values: NDArray[Any]


class Topic:
    """A subscription. `read()` never waits; `missed` counts samples that were published and did not arrive."""

    def __init__(self, element: str, on_close: Callable[["Topic"], None]) -> None:
        self.element = element
        self.missed = 0
        self._on_close = on_close
        self._lock = threading.Lock()
        self._subscriber: zenoh.Subscriber[zenoh.Handler[zenoh.Sample]] | None = None
        self._next = -1

    def attach(self, session: zenoh.Session, root: Root, client_id: str) -> None:
        """Subscribe in a session; the one before is closed already."""
        # 26 s of batches, should the reader pause
        subscriber = session.declare_subscriber(root.topic(self.element), zenoh.handlers.RingChannel(512))
        with self._lock:
            self._subscriber = subscriber
            self._next = -1

    def detach(self) -> None:
        """The session is about to be closed."""
        with self._lock:
            self._subscriber = None

    def read(self) -> list[Batch]:
        """Return the batches that came since the last call."""
        batches: list[Batch] = []
        with self._lock:
            while self._subscriber is not None and (sample := self._subscriber.try_recv()) is not None:
                batch = decode_batch(sample)
                if 0 <= self._next < batch.first:
                    self.missed += batch.first - self._next
                self._next = batch.first + len(batch.time_ns)
                batches.append(batch)
        return batches

    def close(self) -> None:
        """End the subscription; closing twice is fine."""
        with self._lock:
            subscriber, self._subscriber = self._subscriber, None
        if subscriber is not None:
            subscriber.undeclare()  # type: ignore[no-untyped-call]  # zenoh's stub leaves the return type out
        self._on_close(self)

    def __enter__(self) -> "Topic":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def decode_batch(sample: zenoh.Sample) -> Batch:
    """Return the arrays of a sample. Raises ConnectionLostError for an encoding that isn't silo's."""
    payload = sample.payload.to_bytes()
    try:
        dtype, shape = _layout(str(sample.encoding))
    except (TypeError, ValueError) as error:
        raise ConnectionLostError(f"this topic has the encoding '{sample.encoding}', which makes no sense") from error
    count = len(payload) // (8 + dtype.itemsize * int(np.prod(shape)))
    values = np.frombuffer(payload, dtype, offset=8 * count).reshape(count, *shape)
    attached = sample.attachment
    first = int.from_bytes(attached.to_bytes(), "little") if attached is not None else 0
    return Batch(first, np.frombuffer(payload, "<i8", count), values)


def _layout(encoding: str) -> tuple[np.dtype[Any], tuple[int, ...]]:
    """Read type and shape of a value from `silo/samples;dtype=<f8;shape=3` or `silo/samples;fields=_x:<f8,_n:<i4`."""
    kind, *parts = encoding.split(";")
    facts = dict(part.split("=", 1) for part in parts if "=" in part)
    if kind != "silo/samples" or not facts.keys() & {"dtype", "fields"}:
        raise ConnectionLostError(f"this topic has the encoding '{encoding}', which this version of silo doesn't know")
    if "dtype" in facts:
        shape = tuple(int(size) for size in facts.get("shape", "").split(",") if size)
        return np.dtype(facts["dtype"]), shape
    fields = [field.split(":", 1) for field in facts["fields"].split(",")]
    return np.dtype([(unescape(suffix) or f"f{place}", kind) for place, (suffix, kind) in enumerate(fields)]), ()

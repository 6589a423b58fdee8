"""The client's end of a topic: every sample of a published element, in batches of arrays."""

import asyncio
import functools
import math
import time
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import zenoh
from numpy.typing import NDArray

from silo.core.arguments import real
from silo.core.calls import told_class, told_names
from silo.errors import ConnectionLostError, ElementError
from silo.net.keys import ClientId, Root, unescape
from silo.net.subscribed import Subscribed
from silo.rpc.foreign import NOT_UNDERSTOOD, Foreign
from silo.rpc.published import ATTACHED

POLL_S = 0.01  # batches come 20 times per second
SILENCE_S = 2.0  # after which an iteration asks why nothing comes
LONGEST_S = 1e6


@dataclass(frozen=True)
class Batch:
    """Samples, oldest first: `time_ns` int64 of shape `(n,)`, `values` of shape `(n, *shape of the element)`.

    `first` is the number of the first sample since start: a gap to the batch before is a loss, a smaller number a new
    start. Elements of several types give a structured array, its fields called like the entries' suffixes.
    """

    first: int
    time_ns: NDArray[np.int64]
    values: NDArray[Any]

    def __len__(self) -> int:
        return len(self.time_ns)


_READ = "for batch in topic: batch.values[-1]; topic.read(timeout_s=1) has the batches that are there"
_OTHER_NAMES = dict.fromkeys(
    ("value", "values", "newest", "latest", "last", "get", "receive", "next", "subscribe", "callback"), _READ
)


@told_names("a topic", _OTHER_NAMES)
@told_class("topic", shared=Subscribed)
class Topic(Subscribed):
    """A subscription. `read()` doesn't wait unless told to; `missed` counts samples that did not arrive.

    `for batch in topic:` and `async for batch in topic:` go on until the topic or its client is closed.
    """

    def __init__(
        self, element: str, on_close: Callable[["Topic"], None], why_silent: Callable[[], str] = lambda: ""
    ) -> None:
        """Made by `Client.topic`.

        Args:
            element: the full name.
            on_close: called when it is closed.
            why_silent: tells, when nothing comes for long, why nothing ever will; empty where something may.
        """
        super().__init__(on_close)
        self.element = element
        self.missed = 0
        self._why_silent, self._heard_s = why_silent, time.monotonic()
        self._next = -1
        self._foreign = Foreign("a batch")

    def attach(self, session: zenoh.Session, root: Root, client: ClientId) -> None:
        """Subscribe in a session; the one before is closed already.

        Args:
            session: the new one.
            root: whose keys.
            client: who subscribes.
        """
        # 26 s of batches, should the reader pause
        subscriber = session.declare_subscriber(root.topic(self.element), zenoh.handlers.RingChannel(512))
        with self._changed:
            self._subscriber = subscriber

    def __repr__(self) -> str:
        state = "closed" if self._closed else "open"
        return f"<Topic {self.element}: {state}{f', {self.missed} missed' if self.missed else ''}>"

    def __iter__(self) -> Iterator[Batch]:
        """Yield batches as they come, until this or the client is closed.

        Raises ElementError for an element that isn't published, ConnectionLostError when nobody answers any more.
        """
        self._heard_s = time.monotonic()
        while not self._closed:
            batches = self.read()
            yield from batches
            if not batches:
                time.sleep(POLL_S)

    async def __aiter__(self) -> AsyncIterator[Batch]:
        """Yield batches as they come, for asyncio; ends and raises like the plain iteration."""
        self._heard_s = time.monotonic()
        while not self._closed:
            batches = await self.read_async(0.0)
            for batch in batches:
                yield batch
            if not batches:
                await asyncio.sleep(POLL_S)

    def _late(self, heard_s: float) -> bool:
        return time.monotonic() - heard_s > SILENCE_S

    def _heard(self, came: bool, heard_s: float) -> float:
        """When something came last, or was asked for. Raises where nothing will come."""
        if not came and not self._late(heard_s):
            return heard_s
        why = "" if came or self._closed else self._why_silent()
        if why:
            raise ElementError(why)
        return time.monotonic()

    def read(self, timeout_s: float = 0.0) -> list[Batch]:
        """Return the batches that came since the last call.

        Args:
            timeout_s: how long to wait for the first, s.

        Returns:
            Empty where nothing came in that time.

        Raises:
            ElementError: nothing came for a while, and none will: the element isn't published, or is off or gone.
            ConnectionLostError: nothing came for a while, and nobody answers.
        """
        until_s = time.monotonic() + real("timeout_s", timeout_s, 0, LONGEST_S, "s")
        while not (batches := self._take()) and not self._closed and time.monotonic() < until_s:
            time.sleep(POLL_S)
        self._heard_s = self._heard(bool(batches), self._heard_s)
        return batches

    async def read_async(self, timeout_s: float = 1.0) -> list[Batch]:
        """Return like `read`, for asyncio: other tasks go on meanwhile.

        Args:
            timeout_s: how long to wait for the first, s.
        """
        until_s = time.monotonic() + real("timeout_s", timeout_s, 0, LONGEST_S, "s")
        while not (batches := self._take()) and not self._closed and time.monotonic() < until_s:
            await asyncio.sleep(POLL_S)
        if batches or not self._late(self._heard_s):
            self._heard_s = time.monotonic() if batches else self._heard_s
        else:  # the question why may take as long as an answer does
            self._heard_s = await asyncio.to_thread(self._heard, False, self._heard_s)
        return batches

    def _take(self) -> list[Batch]:
        batches: list[Batch] = []
        with self._changed:
            while self._subscriber is not None and (sample := self._subscriber.try_recv()) is not None:
                batch = self._foreign.read(str(sample.key_expr), functools.partial(decode_batch, sample))
                if batch is None:
                    continue
                if self._next >= 0:  # a smaller number is of a new start, which has a first one
                    self.missed += batch.first - (self._next if batch.first >= self._next else 0)
                self._next = batch.first + len(batch.time_ns)
                batches.append(batch)
        return batches


def decode_batch(sample: zenoh.Sample) -> Batch:
    """Return the arrays of a sample. Raises ConnectionLostError for an encoding that isn't silo's."""
    payload = sample.payload.to_bytes()
    attached = sample.attachment
    return batch_of(payload, str(sample.encoding), attached.to_bytes() if attached is not None else b"")


def batch_of(payload: bytes, encoding: str, attached: bytes) -> Batch:
    """Return the arrays of bytes in an encoding; `attached` is the number of the first sample, and an encoding that is
    too long for Zenoh.

    Raises ConnectionLostError for what isn't silo's, or makes no sense.
    """
    number = attached
    try:
        if encoding == ATTACHED:
            number, encoding = attached[:8], attached[8:].decode()
        dtype, shape = _layout(encoding)
        size = 8 + dtype.itemsize * math.prod(shape)
        count, over = divmod(len(payload), size)
        if over or dtype.hasobject or min(shape, default=0) < 0 or len(number) > 8:
            raise ValueError(f"{len(payload)} bytes are no samples of {size}")
        values = np.frombuffer(payload, dtype, offset=8 * count).reshape(count, *shape)
    except NOT_UNDERSTOOD as error:
        raise ConnectionLostError(
            f"this topic has the encoding '{encoding[:200]}', which makes no sense: {error}"
        ) from error
    return Batch(int.from_bytes(number, "little"), np.frombuffer(payload, "<i8", count), values)


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

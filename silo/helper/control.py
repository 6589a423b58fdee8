"""The control threads: one for requests that read, one for those that change something, one for slow reading.

Three, so that a robot process that doesn't answer holds up no status, and a history of a gigabyte no view.
"""

import functools
import logging
import queue
import threading
import time
from collections.abc import Callable
from typing import Any

import msgspec
import zenoh

from silo.helper.answers import Answers
from silo.helper.door import Door, attachment_of
from silo.helper.events import plain
from silo.helper.operators import Operators
from silo.helper.requests import decode_ask, decode_do
from silo.ipc.keys import Root
from silo.ipc.messages import AnyDo, Hello, Refused, RefusedWhy, Request, SlowAsk

MAX_WAITING = 64
# Slow requests wait for their turn: their answers, of which one of 64 names takes 4.5 MB, are made one after the other.
# Here are only their questions, at most so many and of so many bytes.
MAX_SLOW = 256
MAX_SLOW_BYTES = 4 * 2**20

log = logging.getLogger("silo.helper")
_encoder = msgspec.msgpack.Encoder()

Slow = tuple[zenoh.Query, SlowAsk[Any], int, float]  # with its bytes, and until when its client waits


class Control:
    """Owns the control threads."""

    def __init__(
        self,
        session: zenoh.Session,
        root: Root,
        answers: Answers,
        door: Door,
        operators: Operators,
        know: Callable[[str, str, str], None],
    ) -> None:
        """`know` takes the id of a client, who it is in words, and its identity."""
        self._root = root
        self._door, self._operators, self._know = door, operators, know
        self._answers = answers
        # when more wait, the oldest are dropped, and their clients get an empty answer at once
        self._asked = session.declare_queryable(root.key("ask"), zenoh.handlers.RingChannel(MAX_WAITING))
        self._to_do = [session.declare_queryable(key, zenoh.handlers.RingChannel(MAX_WAITING)) for key in door.keys]
        self._doing = threading.Lock()  # one change after the other, whichever way they come
        self._slow: queue.Queue[Slow | None] = queue.Queue()
        self._slow_bytes = 0
        self._counting = threading.Lock()
        self._ending = False
        self._threads = [
            threading.Thread(target=self._serve, args=(self._asked.handler, self._ask), name="ask"),
            *(
                threading.Thread(target=self._serve, args=(one.handler, functools.partial(self._do, key)), name="do")
                for one, key in zip(self._to_do, door.keys, strict=True)
            ),
            threading.Thread(target=self._read_slowly, name="slow"),
        ]

    def start(self) -> None:
        """Start the threads."""
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End the threads and wait for them."""
        self._ending = True
        self._slow.put(None)
        for queryable in (self._asked, *self._to_do):
            # ends the recv() of its thread
            queryable.undeclare()  # type: ignore[no-untyped-call]  # zenoh's stub leaves the return type out
        for thread in self._threads:
            thread.join()

    def _serve(self, handler: zenoh.Handler[zenoh.Query], answer: Callable[[zenoh.Query], None]) -> None:
        while (query := self._next(handler)) is not None:
            try:
                answer(query)
            except Exception:
                log.exception("a request failed")  # its client gets an empty answer, and the thread goes on
            del query  # a query that isn't dropped costs its client the whole timeout

    def _next(self, handler: zenoh.Handler[zenoh.Query]) -> zenoh.Query | None:
        try:
            return handler.recv()
        except zenoh.ZError:
            if not self._ending:
                log.exception("no more requests come in")
            return None

    def _ask(self, query: zenoh.Query) -> None:
        payload = _payload(query)
        request = decode_ask(payload)
        if not isinstance(request, SlowAsk):
            self._reply(query, "ask", lambda: self._answer(request))
            return
        busy = self._too_busy(len(payload))
        if busy is not None:
            self._reply(query, "ask", lambda: _encoder.encode(busy))
            return
        with self._counting:
            self._slow_bytes += len(payload)
        self._slow.put((query, request, len(payload), time.monotonic() + request.timeout_s))

    def _too_busy(self, size: int) -> Refused | None:
        """Why a slow request can't wait for its turn; alone it always can."""
        waiting = self._slow.qsize()
        if waiting < MAX_SLOW and (not self._slow_bytes or self._slow_bytes + size <= MAX_SLOW_BYTES):
            return None
        text = f"{waiting} requests for histories and scripts are waiting already; try again in a moment"
        return Refused(RefusedWhy.FAILED, text)

    def _do(self, declared: str, query: zenoh.Query) -> None:
        payload, key = _payload(query), str(query.key_expr)
        # what has wildcards is refused, under a key that fits
        own = key if "*" not in key else declared.replace("*", "nobody")
        with self._doing:
            self._reply(query, own, lambda: self._answer(self._signed(decode_do(payload), key, attachment_of(query))))

    def _signed(self, request: AnyDo | Hello | Refused, key: str, attachment: bytes) -> Request[Any] | Refused:
        """Return a request with its sender as the door knows it; refused, where that one may not change this now."""
        if isinstance(request, Refused):
            return request
        sender = self._door.sender(key, attachment, plain(request.client))
        if isinstance(sender, Refused):
            return sender
        if isinstance(request, Hello):
            if request.id:
                self._know(plain(request.id), sender.words, sender.identity)
            return msgspec.structs.replace(request, id="")
        self._operators.asking = sender
        return self._operators.refused(request, sender) or msgspec.structs.replace(request, client=sender.words)

    def _answer(self, request: Request[Any] | Refused) -> bytes:
        return _encoder.encode(request) if isinstance(request, Refused) else self._answers.answer(request)

    def _read_slowly(self) -> None:
        while self._read_one(self._slow.get()):
            pass

    def _read_one(self, slow: Slow | None) -> bool:
        if slow is None:
            return False
        query, request, size, until_s = slow
        if time.monotonic() < until_s:
            self._reply(query, "ask", lambda: self._answer(request))
        else:
            # its client has given up, and the next one needs the time
            query.drop()  # type: ignore[no-untyped-call]  # zenoh's stub leaves the return type out
        with self._counting:
            self._slow_bytes -= size
        return True

    def _reply(self, query: zenoh.Query, key: str, answer: Callable[[], bytes]) -> None:
        """Answer whatever happens: a request that breaks something is refused and logged, the thread goes on.

        `key` is the end of one of ours, or the whole of that which was asked.
        """
        try:
            body = answer()
        except Exception as error:
            log.exception("a request failed")
            body = _encoder.encode(Refused(RefusedWhy.FAILED, f"{type(error).__name__}: {error}"))
        try:
            with query:
                query.reply(key if "/" in key else self._root.key(key), body)
        except zenoh.ZError as error:
            # the client is gone, or asked for another key than ours
            log.debug("no reply could be sent: %s", error)


def _payload(query: zenoh.Query) -> bytes:
    payload = query.payload
    return payload.to_bytes() if payload is not None else b""

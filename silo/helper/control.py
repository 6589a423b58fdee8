"""The control threads: one for requests that read, one for those that change something, one for slow reading.

Three, so that a robot process that doesn't answer holds up no status, and a history of a gigabyte no view.
"""

import logging
import queue
import threading
from collections.abc import Callable
from typing import Any

import msgspec
import zenoh

from silo.helper.answers import Answers
from silo.helper.history import answer_bytes
from silo.helper.requests import decode_ask, decode_do
from silo.helper.samples import check_samples
from silo.ipc.keys import Root
from silo.ipc.messages import GetHistory, GetSamples, Refused, RefusedWhy, Request, SlowAsk

MAX_WAITING = 64
MAX_SLOW = 16
MAX_SLOW_BYTES = 16 * 2**20  # of the answers of those that wait; one history of 64 names takes at most 4.5 MB

log = logging.getLogger("silo.helper")
_encoder = msgspec.msgpack.Encoder()

Slow = tuple[zenoh.Query, Request[Any], int]  # with the bytes of its answer


class Control:
    """Owns the control threads."""

    def __init__(self, session: zenoh.Session, root: Root, answers: Answers) -> None:
        self._root = root
        self._answers = answers
        # when more wait, the oldest are dropped, and their clients get an empty answer at once
        self._asked = session.declare_queryable(root.key("ask"), zenoh.handlers.RingChannel(MAX_WAITING))
        self._to_do = session.declare_queryable(root.key("do"), zenoh.handlers.RingChannel(MAX_WAITING))
        self._slow: queue.Queue[Slow | None] = queue.Queue()
        self._slow_bytes = 0
        self._counting = threading.Lock()
        self._ending = False
        self._threads = [
            threading.Thread(target=self._serve, args=(self._asked.handler, self._ask), name="ask"),
            threading.Thread(target=self._serve, args=(self._to_do.handler, self._do), name="do"),
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
        for queryable in (self._asked, self._to_do):
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
        request = decode_ask(_payload(query))
        if not isinstance(request, SlowAsk):
            self._reply(query, "ask", lambda: self._answer(request))
            return
        size = answer_bytes(request) if isinstance(request, GetHistory) else 0
        size = request.reply_bytes if isinstance(request, GetSamples) and not check_samples(request) else size
        busy = self._too_busy(size)
        if busy is not None:
            self._reply(query, "ask", lambda: _encoder.encode(busy))
            return
        with self._counting:
            self._slow_bytes += size
        self._slow.put((query, request, size))

    def _too_busy(self, size: int) -> Refused | None:
        """Why a slow request can't wait for its turn; alone it always can."""
        if self._slow.qsize() >= MAX_SLOW:
            text = f"{MAX_SLOW} such requests are waiting already; try again in a moment"
        elif self._slow_bytes and self._slow_bytes + size > MAX_SLOW_BYTES:
            text = (
                f"histories of {self._slow_bytes / 1e6:.1f} MB are being read already, with this one of "
                f"{size / 1e6:.1f} MB more than {MAX_SLOW_BYTES / 1e6:.1f} MB; try again in a moment, or ask for "
                "fewer names or wider columns"
            )
        else:
            return None
        return Refused(RefusedWhy.FAILED, text)

    def _do(self, query: zenoh.Query) -> None:
        request = decode_do(_payload(query))
        self._reply(query, "do", lambda: self._answer(request))

    def _answer(self, request: Request[Any] | Refused) -> bytes:
        return _encoder.encode(request) if isinstance(request, Refused) else self._answers.answer(request)

    def _read_slowly(self) -> None:
        while self._read_one(self._slow.get()):
            pass

    def _read_one(self, slow: Slow | None) -> bool:
        if slow is None:
            return False
        query, request, size = slow
        self._reply(query, "ask", lambda: self._answer(request))
        with self._counting:
            self._slow_bytes -= size
        return True

    def _reply(self, query: zenoh.Query, key: str, answer: Callable[[], bytes]) -> None:
        """Answer whatever happens: a request that breaks something is refused and logged, the thread goes on."""
        try:
            body = answer()
        except Exception as error:
            log.exception("a request failed")
            body = _encoder.encode(Refused(RefusedWhy.FAILED, f"{type(error).__name__}: {error}"))
        try:
            with query:
                query.reply(self._root.key(key), body)
        except zenoh.ZError as error:
            # the client is gone, or asked for another key than ours
            log.debug("no reply could be sent: %s", error)


def _payload(query: zenoh.Query) -> bytes:
    payload = query.payload
    return payload.to_bytes() if payload is not None else b""

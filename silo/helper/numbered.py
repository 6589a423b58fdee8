"""Changes that their clients numbered: each is done once, however often it is asked for.

An answer may be lost on its way, as when a helper process was replaced just before. What the robot program did for the
helper process before this one it told this one with its first message.
"""

import os
import threading
from collections.abc import Mapping

import zenoh

from silo.decoding import msgpack_decoder
from silo.helper.lanes import Waiting
from silo.requests import AnyReply
from silo.rpc.declaring import Do, Reply, RobotRequest
from silo.rpc.last_answers import LastAnswers
from silo.rpc.refusals import RefusedWhy, RequestRefusedError

_decoder = msgpack_decoder(AnyReply)


class NumberedRequests:
    """Those that are being done, and the last that were. For any thread."""

    def __init__(self, done_before: Mapping[str, bytes]) -> None:
        self._done_before = done_before
        self._lock = threading.Lock()
        self._last = LastAnswers()
        self._also: dict[str, list[zenoh.Query]] = {}  # who asked again while it is being done

    def take(self, one: Waiting) -> bytes | None:
        """Return None for one that is to be done, for another its answer; empty: who asks is told with the others."""
        if not (number := number_of(one)):
            return None
        with self._lock:
            if number in self._also:
                self._also[number].append(one.query)
                return b""
            known = self._last.find(_asker(one), number)
            if known is None:
                self._also[number] = []
            return known

    def done_before(self, one: Waiting) -> Reply | None:
        """Return what the robot program answered when the helper process before this one had it do this.

        Raises RequestRefusedError where nobody knows any more what became of it.
        """
        request = one.request
        assert isinstance(request, Do)
        if isinstance(request, RobotRequest):
            answer = self._done_before.get(number_of(one))
            return None if answer is None else _decoder.decode(answer)
        if request.asked_pid not in (0, os.getpid()):
            text = "the helper process that was asked first has ended; look whether it was done before trying again"
            raise RequestRefusedError(RefusedWhy.FAILED, text)
        return None

    def end(self, one: Waiting, answer: bytes) -> list[zenoh.Query]:
        """Keep an answer; return who asked again meanwhile."""
        if not (number := number_of(one)):
            return []
        with self._lock:
            self._last.keep(_asker(one), number, answer)
            return self._also.pop(number, [])


def number_of(one: Waiting) -> str:
    """Return what tells a numbered change from those of all senders; empty for what has no number."""
    number = one.request.number if isinstance(one.request, Do) else ""
    return f"{_asker(one)} {number}" if number else ""


def _asker(one: Waiting) -> str:
    return f"{one.key} {one.request.client}"

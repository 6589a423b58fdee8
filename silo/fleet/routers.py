"""What `silo router` refused, told to who looks at the robots behind it: logins with a wrong user or password.

Zenoh tells of them in the log of the router alone, and no robot learns of them. So the router answers and publishes as
a logger does, under a name that no logger can have: everybody who may look at robots may look at this, by the same
rules. It has no token: clients before this one see nothing of it.
"""

import os
import socket
import time
from collections.abc import Callable
from typing import Any

import msgspec
import zenoh

from silo.core.elements import State
from silo.errors import SiloError
from silo.fleet.exchange import decode_reply, encoded
from silo.net import keys
from silo.net.sessions import SessionLease
from silo.rpc.published import MOST_REASON, Summary
from silo.state.requests import GetSummary, SummaryReply

NAME = "_router"
AGAIN_S = 10.0
MOST = 16  # routers behind one way

Refusals = Callable[[], tuple[int, str]]  # how many there were within the last hour, and the last of them in words


class RouterTold(msgspec.Struct, frozen=True):
    """What a router tells: how many logins it refused within the last hour, and the last of them."""

    host: str
    denied: int
    last: str

    @property
    def words(self) -> str:
        """Return `router desk9: 14 logins refused within the last hour, the last: ... by somebody at 10.0.0.3`."""
        logins = "1 login" if self.denied == 1 else f"{self.denied} logins"
        last = f", the last: {self.last}" if self.last else ""
        return f"router {self.host}: {logins} refused within the last hour{last}"


def told_of(root: keys.Root, summary: Summary) -> RouterTold | None:
    """Return what a summary says of a router; None for that of a logger."""
    return RouterTold(root.host, summary.denied, summary.reason) if root.logger == NAME else None


class RouterFeed:
    """Answers what has been refused, and publishes it when it is more; used by the router's main thread."""

    def __init__(self, session: zenoh.Session, refusals: Refusals) -> None:
        self._refusals = refusals
        root = keys.Root(socket.gethostname(), NAME, os.urandom(5).hex())
        self._key = root.key("ask")  # also in answers to questions with wildcards
        self._questions = session.declare_queryable(self._key, self._answer)
        self._publisher = session.declare_publisher(
            root.key("summary"), congestion_control=zenoh.CongestionControl.DROP
        )
        self._told: tuple[int, str] = (0, "")
        self._told_s = 0.0

    def _now(self) -> Summary:
        count, last = self._refusals()
        return Summary(state=State.RUNNING, denied=count, reason=last[:MOST_REASON])

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            query.reply(self._key, msgspec.msgpack.encode(SummaryReply(self._now())))

    def send(self) -> None:
        """Publish what is new, and from time to time what isn't."""
        found, now_s = self._refusals(), time.monotonic()
        if found != self._told or now_s - self._told_s >= AGAIN_S:
            self._told, self._told_s = found, now_s
            self._publisher.put(msgspec.msgpack.encode(self._now()))


class AskedRouters:
    """A question to all routers of ours behind a session, whose answers are looked at when they have come."""

    def __init__(self, mine: SessionLease, timeout_s: float) -> None:
        self._replies: Any = mine.session.get(
            f"silo/*/{NAME}/ask", zenoh.handlers.FifoChannel(MOST), payload=encoded(GetSummary()),
            timeout=timeout_s + mine.slack_s,
        )  # fmt: skip
        self.done = False

    def poll(self) -> dict[keys.Root, RouterTold]:
        """Return who answered since."""
        found: dict[keys.Root, RouterTold] = {}
        try:
            while not self.done and (reply := self._replies.try_recv()) is not None:
                if reply.ok is not None and (root := keys.robot_of(str(reply.ok.key_expr))) is not None:
                    told = _told_by(root, reply.ok.payload.to_bytes())
                    found |= {root: told} if told is not None else {}
        except zenoh.ZError:  # as the channel says that no more will come
            self.done = True
        return found


def _told_by(root: keys.Root, payload: bytes) -> RouterTold | None:
    try:
        reply = decode_reply(payload, f"router {root.host}", GetSummary)
    except SiloError:
        return None  # of a silo that says it otherwise
    return told_of(root, reply.summary) if isinstance(reply, SummaryReply) else None

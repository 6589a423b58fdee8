"""Feeds: what clients are sent again and again, views and streams. Leased, and fed by the publisher thread alone.

A feed that can't be fed ends; its client is told when it renews it, and all others go on.
"""

import abc
import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, TypeVar

import zenoh

from silo.errors import SegmentError
from silo.history.requests import OpenStream
from silo.live.requests import OpenView
from silo.net import keys
from silo.net.session import matching, undeclare
from silo.rpc.leases import Leases
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.segment.reader import SegmentReader
from silo.state.replica import LoggerSnapshot

LEASE_S = 6.0

log = logging.getLogger("silo.helper")


@dataclass(frozen=True)
class Round:
    """What all feeds are made of in one round of the publisher."""

    logger: LoggerSnapshot
    reader: SegmentReader | None  # with the derived signals
    now_s: float
    measured_hz: float = 0.0
    idle_s: float = 0.0


RequestT = TypeVar("RequestT", OpenView, OpenStream)


class Feed(abc.ABC, Generic[RequestT]):
    """What one client is sent. `prepare` and `frame` are for the publisher thread alone."""

    def __init__(self, request: RequestT, publisher: zenoh.Publisher, period_s: float, now_s: float) -> None:
        self.request: RequestT = request
        self.publisher, self.period_s = publisher, period_s
        self.due_s = now_s

    def is_due(self, this: Round) -> bool:
        """Whether it is to be looked at in this round."""
        return this.now_s >= self.due_s

    def prepare(self, this: Round) -> None:
        """Take in another table or run, whether or not anybody subscribes."""

    @abc.abstractmethod
    def frame(self, this: Round) -> tuple[bytes | None, bool]:
        """Return what is to be sent now, None for nothing; and whether there is more."""


FeedT = TypeVar("FeedT", bound=Feed[Any])


class Feeds(abc.ABC, Generic[RequestT, FeedT]):
    """All feeds of a kind, of all clients. Opened and closed by any thread."""

    kind: ClassVar[str]  # as in keys and words
    most: ClassVar[int]
    most_of_client: ClassVar[int]

    def __init__(self, session: zenoh.Session, root: keys.Root, knows: Callable[[str], bool] | None = None) -> None:
        """`knows` tells of the id of a client whether it may change something."""
        self._session, self._root = session, root
        self._feeds: Leases[str, FeedT] = Leases(self.most, self.most_of_client, knows=knows)
        self._failed: dict[str, tuple[RequestT, str]] = {}  # that could not be fed, until they are closed
        # to be undeclared by the thread that uses them: zenoh raises RuntimeError when two use one at the same time
        self._closed: list[zenoh.Publisher] = []

    @abc.abstractmethod
    def _is_same(self, old: RequestT, new: RequestT) -> bool:
        """Return whether a request only renews another."""

    @abc.abstractmethod
    def _check(self, request: RequestT, others: list[FeedT]) -> None:
        """Raise RequestRefusedError where there can't be such a feed beside these."""

    @abc.abstractmethod
    def _made(self, request: RequestT, publisher: zenoh.Publisher) -> FeedT:
        """Return a new feed."""

    def renewed(self, name: str, request: RequestT) -> FeedT:
        """Return the feed of this name after renewing it, or a new one in its place. Raises RequestRefusedError."""
        keys.check_own(self.kind, name, request.proof)
        with self._feeds:
            old = self._feeds.get(name)
            if old is not None and self._is_same(old.request, request):
                self._feeds.renew(name, LEASE_S)
                return old
            request_failed, why = self._failed.get(name, (None, ""))
            if request_failed is not None and self._is_same(request_failed, request):
                raise RequestRefusedError(RefusedWhy.FAILED, why)
            self._failed.pop(name, None)
            owner = keys.client_of_view(name)
            self._check_room(name, owner)
            self._check(request, [one.value for one in self._feeds.all(but=name)])
            made = self._made(request, old.publisher if old is not None else self._declare(name))
            self._feeds.set(name, made, LEASE_S, owner)
        return made

    def _check_room(self, name: str, owner: str) -> None:
        full = self._feeds.full(name, owner)
        if full is None:
            return
        count, own = full
        held = f"this client has {count} {self.kind}s open already" if own else f"{count} {self.kind}s are open already"
        raise self._cant_open(f"{held}; close others first", RefusedWhy.FAILED)

    def _cant_open(self, problem: str, why: RefusedWhy = RefusedWhy.INVALID) -> RequestRefusedError:
        return RequestRefusedError(why, f"the {self.kind} can't be opened: {problem}")

    def _declare(self, name: str) -> zenoh.Publisher:
        key = self._root.key(self.kind, name)
        return self._session.declare_publisher(key, congestion_control=zenoh.CongestionControl.DROP)

    def close_for(self, name: str, proof: str) -> str:
        """End a feed of who asks; one that isn't open is fine. Raises RequestRefusedError for that of another one."""
        keys.check_own(self.kind, name, proof)
        self.close(name)
        return f"the {self.kind} is closed"

    def close(self, name: str) -> None:
        """End a feed; one that isn't open is fine."""
        with self._feeds:
            closed = self._feeds.drop(name)
            self._failed.pop(name, None)
            if closed is not None:
                self._closed.append(closed.publisher)

    def close_all_of(self, client: str) -> None:
        """End the feeds of a client that is gone."""
        with self._feeds:
            self._closed += [one.value.publisher for one in self._feeds.drop_of(client)]
            self._failed = {name: one for name, one in self._failed.items() if keys.client_of_view(name) != client}

    # ------------------------------------------------------------------------------------- by the publisher thread

    def send(self, this: Round, due_s: float) -> float:
        """Send what is due; returns when to come again, `due_s` at the latest."""
        self._undeclare_closed()
        for one in self._feeds.all():
            feed = one.value
            if feed.is_due(this):
                more = self._send(one.key, feed, this)
                later_s = max(feed.due_s + feed.period_s, this.now_s + feed.period_s / 2)
                feed.due_s = this.now_s if more else later_s
            due_s = min(due_s, feed.due_s)
        return due_s

    def _send(self, name: str, feed: FeedT, this: Round) -> bool:
        try:
            feed.prepare(this)
            if not matching(feed.publisher):
                return False  # its client subscribes before it asks: it is gone, or not here yet
            frame, more = feed.frame(this)
            if frame is not None and self._feeds.get(name) is feed:
                feed.publisher.put(frame)
        except (zenoh.ZError, SegmentError):
            raise
        except Exception as error:
            log.exception("%s %s failed", self.kind, name)
            self._fail(name, feed, error)
            return False
        return more

    def _fail(self, name: str, feed: FeedT, error: Exception) -> None:
        text = (
            f"the {self.kind} can't be fed any more: {type(error).__name__}: {error}; the helper process has logged "
            f"where; other {self.kind}s go on, open one of other elements"
        )
        with self._feeds:
            self.close(name)
            while len(self._failed) >= self.most:
                self._failed.pop(next(iter(self._failed)))
            self._failed[name] = (feed.request, text)

    def _undeclare_closed(self) -> None:
        with self._feeds:
            closed = [*self._closed, *(one.value.publisher for one in self._feeds.expire())]
            self._closed = []
        undeclare(*closed)

    def stop(self) -> None:
        """End all feeds."""
        for one in self._feeds.all():
            self.close(one.key)
        self._undeclare_closed()

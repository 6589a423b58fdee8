"""A node in the graph of `rmw_zenoh`: its topics, its services, and the session that carries them.

The session is a client of the router, since a stock router forwards nothing between peers. What no other node
subscribes to is not read from the logger: the router tells whether somebody does.
"""

import contextlib
import json
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import zenoh

from silo.bridges.feed import Feed, Listener
from silo.bridges.ros2.names import TRIGGER, TRIGGER_HASH, Attachment, Distribution, EntityKind, Node, gid_of
from silo.bridges.ros2.standard import Outlet, outlets_of
from silo.bridges.services import trigger_response
from silo.errors import ConnectionLostError, SiloError
from silo.ipc.samples import Samples
from silo.model import ElementInfo

OPEN_MS = 3000


@contextlib.contextmanager
def joined(router: str) -> Iterator[zenoh.Session]:
    """Open a session as a client of a router, `tcp/localhost:7447`. Raises ConnectionLostError where there is none."""
    config = zenoh.Config()
    try:
        for key, value in {
            "mode": "client",
            "connect/endpoints": [router],
            "connect/timeout_ms": OPEN_MS,
            "scouting/multicast/enabled": False,
            "scouting/gossip/enabled": False,
            "transport/shared_memory/enabled": False,
        }.items():
            config.insert_json5(key, json.dumps(value))
        session = zenoh.open(config)
    except zenoh.ZError as error:
        raise ConnectionLostError(
            f"no Zenoh router answers at {router}: start one with `ros2 run rmw_zenoh_cpp rmw_zenohd`, or say where "
            f"it is with --router ({str(error).splitlines()[0]})"
        ) from error
    try:
        yield session
    finally:
        session.close()  # type: ignore[no-untyped-call]  # zenoh's stub leaves the return type out


@dataclass
class Topic:
    """A topic that the graph sees."""

    outlet: Outlet
    gid: bytes
    publisher: zenoh.Publisher
    token: zenoh.LivelinessToken
    listener: "zenoh.MatchingListener[None] | None" = None
    sequence: int = 0
    is_watched: bool = False

    def publish(self, time_ns: int, message: bytes) -> None:
        """Send a message with its number and time."""
        self.sequence += 1
        self.publisher.put(message, attachment=Attachment(self.sequence, time_ns, self.gid).encoded())


class Graph:
    """A logger's topics in the graph, as they come and go. Its feed's thread does all; others only say who watches."""

    def __init__(
        self,
        session: zenoh.Session,
        node: Node,
        distribution: Distribution,
        make_feed: Callable[[Listener], Feed],
        tell: Callable[[str], None],
    ) -> None:
        self._session, self._node, self._distribution = session, node, distribution
        self._prefix = node.name
        self._tell = tell
        self._numbers: dict[tuple[str, str], int] = {}  # of a topic and its type: it keeps its number
        self._topics: dict[tuple[str, str], Topic] = {}
        self._watching = threading.Lock()
        self._tokens = [session.liveliness().declare_token(node.token)]
        self._queryables: list[zenoh.Queryable[None]] = []
        self._feed = make_feed(Listener(self._renew, self._deliver, tell))

    @contextlib.contextmanager
    def serving(self, services: Mapping[str, Callable[[], str]]) -> Iterator[None]:
        """Be there, with services by name that do something and say what."""
        for name, call in services.items():
            self._offer(name, call)
        self._feed.start()
        try:
            yield
        finally:
            self._feed.close()

    # ------------------------------------------------------------------------------------------------------- topics

    def _renew(self, _label: str, elements: Sequence[ElementInfo]) -> None:
        outlets, left_out = outlets_of(elements, self._prefix)
        for why in left_out.values():
            self._tell(why)
        wanted = {(outlet.topic, outlet.type.type_hash): outlet for outlet in outlets}
        for key in [key for key in self._topics if key not in wanted]:
            topic = self._topics.pop(key)
            topic.token.undeclare()  # type: ignore[no-untyped-call]
            topic.publisher.undeclare()  # type: ignore[no-untyped-call]
        for key, outlet in wanted.items():
            if key in self._topics:
                self._topics[key].outlet = outlet
            else:
                self._topics[key] = self._declare(outlet, self._number(key))
        self._wish()

    def _number(self, key: tuple[str, str]) -> int:
        return self._numbers.setdefault(key, len(self._numbers) + len(self._tokens) + 1)

    def _declare(self, outlet: Outlet, number: int) -> Topic:
        shown = self._distribution.hash_of(outlet.type.type_hash)
        token = self._node.entity_token(number, EntityKind.PUBLISHER, outlet.topic, outlet.type.name, shown)
        publisher = self._session.declare_publisher(
            self._node.key(outlet.topic, outlet.type.name, shown),
            congestion_control=zenoh.CongestionControl.DROP,  # who is slow loses messages and holds up nobody
        )
        topic = Topic(outlet, gid_of(token), publisher, self._session.liveliness().declare_token(token))

        def watch(status: zenoh.MatchingStatus) -> None:
            with self._watching:
                topic.is_watched = status.matching
            self._wish()

        topic.listener = publisher.declare_matching_listener(watch)
        with self._watching:  # asked and noted at once: a change meanwhile is noted after it
            status: Any = publisher.matching_status  # zenoh's stub says bool
            topic.is_watched = bool(getattr(status, "matching", status))
        return topic

    def _wish(self) -> None:
        with self._watching:  # the last to ask has seen all
            topics = list(self._topics.values())
            self._feed.wish(frozenset(name for one in topics if one.is_watched for name in one.outlet.elements))

    def _deliver(self, batch: Mapping[str, Samples], taken: Callable[[], None]) -> None:
        try:
            for topic in list(self._topics.values()):
                if topic.is_watched and all(name in batch for name in topic.outlet.elements):
                    times, messages = topic.outlet.encode([batch[name] for name in topic.outlet.elements])
                    for time_ns, message in zip(times.tolist(), messages, strict=True):
                        topic.publish(time_ns, message)
            for name, samples in batch.items():
                if samples.missed:
                    self._tell(f"{samples.missed} samples of {name} were lost on the way to the bridge")
        finally:
            taken()

    # ----------------------------------------------------------------------------------------------------- services

    def _offer(self, name: str, call: Callable[[], str]) -> None:
        shown = self._distribution.hash_of(TRIGGER_HASH)
        key = self._node.key(name, TRIGGER, shown)
        number = len(self._tokens)
        self._queryables.append(
            self._session.declare_queryable(key, lambda query: self._answer(key, name, call, query), complete=True)
        )
        token = self._node.entity_token(number, EntityKind.SERVICE, name, TRIGGER, shown)
        self._tokens.append(self._session.liveliness().declare_token(token))

    def _answer(self, key: str, name: str, call: Callable[[], str], query: zenoh.Query) -> None:
        """A service of type Trigger was called."""
        try:
            asked = Attachment.decoded(query.attachment.to_bytes() if query.attachment is not None else b"")
        except ValueError as error:
            query.reply_err(f"silo: {error}".encode())
            return
        try:
            text, success = call(), True
        except SiloError as error:
            text, success = str(error), False
        self._tell(f"{name}, called from the ROS graph: {text}")
        answer = Attachment(asked.sequence, time.time_ns(), asked.gid).encoded()
        query.reply(key, trigger_response(text, success=success), attachment=answer)

"""A node in the graph of `rmw_zenoh`: its topics, its services, and the session that carries them.

The session is a client of the router, since a stock router forwards nothing between peers. What no other node
subscribes to is not read from the logger: the router tells whether somebody does.
"""

import contextlib
import functools
import itertools
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import zenoh

from silo.bridges.feed import Listener, LoggerFollower
from silo.bridges.ros2.names import TRIGGER, TRIGGER_HASH, Attachment, Distribution, EntityKind, Node, gid_of
from silo.bridges.ros2.pairing import Pairing
from silo.bridges.ros2.parameters import EVENT, EVENT_HASH, EVENTS, NodeParameters
from silo.bridges.ros2.standard import Outlet, outlets_of
from silo.bridges.services import Audit, Call, Tune, trigger_response
from silo.core.elements import ElementInfo
from silo.core.quantities.writing import many
from silo.core.tuning.parameters import ParameterInfo
from silo.errors import ConnectionLostError
from silo.history.arrays import SampleArrays
from silo.net.configuration import FORCED, insert, reason_of
from silo.net.lingering import releasing
from silo.net.session import close, matching, opened, undeclare

OPEN_MS = 3000
CALLER = "somebody in the ROS graph"  # which has no names to prove
MOST_CALLS = 16  # of a service that wait
LOOK_S = 0.1  # how often it is asked who subscribes, and whether a service was called


@contextlib.contextmanager
def joined(router: str) -> Iterator[zenoh.Session]:
    """Open a session as a client of a router, `tcp/localhost:7447`. Raises ConnectionLostError where there is none."""
    config = zenoh.Config()
    try:
        insert(config, {"mode": "client", "connect": {"endpoints": [router], "timeout_ms": OPEN_MS}, **FORCED})
        session = opened(config)
        releasing.begin(session)
    except zenoh.ZError as error:
        raise ConnectionLostError(
            f"no Zenoh router answers at {router}: start one with `ros2 run rmw_zenoh_cpp rmw_zenohd`, or say where "
            f"it is with --router ({reason_of(error)})"
        ) from error
    try:
        yield session
    finally:
        close(session)


@dataclass
class Publication:
    """A topic that the graph sees."""

    gid: bytes
    publisher: zenoh.Publisher
    token: zenoh.LivelinessToken
    sequence: int = 0

    def publish(self, time_ns: int, message: bytes) -> None:
        """Send a message with its number and time."""
        self.sequence += 1
        self.publisher.put(message, attachment=Attachment(self.sequence, time_ns, self.gid).encoded())


@dataclass(kw_only=True)
class GraphTopic(Publication):
    """A topic of samples."""

    outlet: Outlet
    is_watched: bool = False
    pairing: Pairing | None = None  # of several elements

    def messages(self, batch: Mapping[str, SampleArrays]) -> Iterator[tuple[int, bytes]]:
        """Yield the messages of samples with their times; what waits for others comes with a later batch."""
        names = self.outlet.elements
        if not self.is_watched:
            self.pairing = None
            return
        if len(names) == 1:
            samples = [batch[name] for name in names if name in batch]
        else:
            if self.pairing is None or self.pairing.names != tuple(names):
                self.pairing = Pairing(names)
            samples = self.pairing.take(batch)
        if samples:
            times, messages = self.outlet.encode(samples)
            yield from zip(times.tolist(), messages, strict=True)


@dataclass(frozen=True)
class Service:
    """What others may call: a request, in CDR, is answered; ValueError tells that it is none."""

    key: str
    name: str
    answer: Callable[[bytes], bytes]
    queryable: "zenoh.Queryable[zenoh.handlers.Handler[zenoh.Query]]"


class Graph:
    """A logger's topics as they come and go: the feed's thread publishes, another one looks who is there."""

    def __init__(
        self,
        session: zenoh.Session,
        node: Node,
        distribution: Distribution,
        make_feed: Callable[[Listener], LoggerFollower],
        tell: Callable[[str], None],
        tune: Tune | None = None,
    ) -> None:
        """Be a node of this session; `tune` sets parameters, without it they are read-only."""
        self._session, self._node, self._distribution = session, node, distribution
        self._prefix = node.name
        self._tell, self._audit = tell, Audit(tell)
        self._numbers: dict[tuple[str, str], int] = {}  # of a topic and its type: it keeps its number
        self._unused = itertools.count(1)
        self._topics: dict[tuple[str, str], GraphTopic] = {}
        self._ended = threading.Event()
        self._tokens = [session.liveliness().declare_token(node.token)]
        self._services: list[Service] = []
        self._calls: list[threading.Thread] = []
        self._parameters = NodeParameters(f"/{node.name}", tune, CALLER, self._audit)
        self._events: Publication | None = None  # of parameters, once there are any
        self._feed = make_feed(Listener(self._renew, self._deliver, tell, self._turn))

    @contextlib.contextmanager
    def serving(self, services: Mapping[str, Call]) -> Iterator[None]:
        """Be there, with services by name that do something and say what."""
        for name, call in services.items():
            self._offer(name, TRIGGER, TRIGGER_HASH, functools.partial(self._trigger, name, call))
        looking = threading.Thread(target=self._look, name="graph", daemon=True)
        self._feed.start()
        looking.start()
        try:
            yield
        finally:
            self._ended.set()
            looking.join()
            for one in self._calls:
                one.join()
            self._feed.close()

    # ------------------------------------------------------------------------------------------------------- topics

    def _renew(self, _label: str, elements: Sequence[ElementInfo]) -> None:
        outlets, left_out = outlets_of(elements, self._prefix)
        for why in left_out.values():
            self._tell(why)
        wanted = {(outlet.topic, outlet.type.type_hash): outlet for outlet in outlets}
        for key in [key for key in self._topics if key not in wanted]:
            topic = self._topics.pop(key)
            undeclare(topic.token, topic.publisher)
        for key, outlet in wanted.items():
            if key in self._topics:
                self._topics[key].outlet = outlet
            else:
                type_ = outlet.type
                self._topics[key] = GraphTopic(
                    *self._publisher(self._number(key), outlet.topic, type_.name, type_.type_hash), outlet=outlet
                )

    def _number(self, key: tuple[str, str]) -> int:
        if key not in self._numbers:
            self._numbers[key] = next(self._unused)
        return self._numbers[key]

    def _publisher(
        self, number: int, topic: str, type_name: str, type_hash: str
    ) -> tuple[bytes, zenoh.Publisher, zenoh.LivelinessToken]:
        shown = self._distribution.hash_of(type_hash)
        token = self._node.entity_token(number, EntityKind.PUBLISHER, topic, type_name, shown)
        publisher = self._session.declare_publisher(
            self._node.key(topic, type_name, shown),
            congestion_control=zenoh.CongestionControl.DROP,  # who is slow loses messages and holds up nobody
        )
        return gid_of(token), publisher, self._session.liveliness().declare_token(token)

    def _turn(self, known: Sequence[ParameterInfo]) -> None:
        """Parameters are something else now; the first time that there are any, the node gets its services for them."""
        if not known and self._events is None:
            return
        if self._events is None:
            self._events = Publication(*self._publisher(next(self._unused), EVENTS, EVENT, EVENT_HASH))
            for name, (type_name, type_hash, answer) in self._parameters.services().items():
                self._offer(name, type_name, type_hash, answer)
        message = self._parameters.turn(known)
        if message is not None:
            self._events.publish(time.time_ns(), message)

    def _look(self) -> None:
        """See who subscribes and who calls, until it ends.

        Not by callbacks of Zenoh: each would be a thread, of hundreds of topics, and one that comes while Python ends
        aborts the process.
        """
        while not self._ended.wait(LOOK_S):
            self._audit.watch()
            for topic in list(self._topics.values()):
                with contextlib.suppress(zenoh.ZError):  # it was taken back just now
                    topic.is_watched = matching(topic.publisher)
            watched = [topic for topic in list(self._topics.values()) if topic.is_watched]
            self._feed.wish(frozenset(name for topic in watched for name in topic.outlet.elements))
            for service in self._services:
                while (query := service.queryable.try_recv()) is not None:
                    self._calls = [one for one in self._calls if one.is_alive()]
                    self._calls.append(threading.Thread(target=self._answer, args=(service, query), name=service.name))
                    self._calls[-1].start()

    def _deliver(self, batch: Mapping[str, SampleArrays], taken: Callable[[], None]) -> None:
        try:
            for topic in list(self._topics.values()):
                for time_ns, message in topic.messages(batch):
                    topic.publish(time_ns, message)
                if topic.pairing is not None and topic.pairing.unpaired:
                    self._tell(
                        f"{many(topic.pairing.unpaired, 'tick')} of {topic.outlet.topic} left out: not all had them"
                    )
                    topic.pairing.unpaired = 0
            for name, samples in batch.items():
                if samples.missed:
                    self._tell(f"{many(samples.missed, 'sample')} of {name} lost on the way to the bridge")
        finally:
            taken()

    # ----------------------------------------------------------------------------------------------------- services

    def _offer(self, name: str, type_name: str, type_hash: str, answer: Callable[[bytes], bytes]) -> None:
        shown = self._distribution.hash_of(type_hash)
        key = self._node.key(name, type_name, shown)
        queryable = self._session.declare_queryable(key, zenoh.handlers.FifoChannel(MOST_CALLS), complete=True)
        self._services.append(Service(key, name, answer, queryable))
        token = self._node.entity_token(next(self._unused), EntityKind.SERVICE, name, type_name, shown)
        self._tokens.append(self._session.liveliness().declare_token(token))

    def _answer(self, service: Service, query: zenoh.Query) -> None:
        try:
            asked = Attachment.decoded(query.attachment.to_bytes() if query.attachment is not None else b"")
            answer = service.answer(query.payload.to_bytes() if query.payload is not None else b"")
        except ValueError as error:
            query.reply_err(f"silo: {error}".encode())
            return
        attachment = Attachment(asked.sequence, time.time_ns(), asked.gid).encoded()
        query.reply(service.key, answer, attachment=attachment)

    def _trigger(self, name: str, call: Call, _request: bytes) -> bytes:
        text, success = self._audit.called(name, call, CALLER)
        return trigger_response(text, success=success)

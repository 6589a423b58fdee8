"""The server: topics of one logger for many viewers, none of which can hold up another one or the robot."""

import asyncio
import contextlib
import json
import logging
import os
import signal
import socket
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.protocol import State

from silo.bridges.feed import Listener, LoggerFollower
from silo.bridges.foxglove import guard, protocol
from silo.bridges.foxglove.protocol import Frames, Offer, ServiceCall, StatusLevel, status, text_frame
from silo.bridges.listening import LOOPBACK
from silo.bridges.messages import LiveTopic, live_topics
from silo.bridges.services import Audit, Call, Connect, Tune
from silo.core.names import grouped
from silo.core.quantities.writing import many
from silo.core.tuning.parameters import ParameterInfo
from silo.errors import SiloError
from silo.history.arrays import SampleArrays

MOST_VIEWERS = 16
QUEUE_BYTES = 8 << 20  # that a viewer may be behind before frames of data are dropped
MOST_REQUEST_BYTES = 4 << 20  # a viewer subscribes to 65,535 topics in 2 MB
ROOM_S = 0.05
WATCH_S = 1.0
ALIVE_S = 20.0  # a viewer that doesn't answer within this is let go

log = logging.getLogger("silo.foxglove")


@dataclass(frozen=True)
class Terms:
    """Where the server listens, and to whom. `services` by name do something and say what, `tune` sets
    parameters; None: read-only.
    """

    name: str
    bind: str = "127.0.0.1"
    token: str = ""
    origins: tuple[str, ...] = ()
    services: Mapping[str, Call] | None = None
    tune: Tune | None = None

    @property
    def on_loopback(self) -> bool:
        """Whether other computers can't reach it."""
        return self.bind in LOOPBACK


@dataclass(eq=False)
class Viewer:
    """What the kernel doesn't take waits in memory, at most `QUEUE_BYTES` of data, and holds up nobody.

    Frames go to the transport as they are: the frames of all samples of a topic are one piece of memory, and a server
    has no state beyond them where nothing is compressed.
    """

    connection: ServerConnection
    subscriptions: dict[int, int] = field(default_factory=dict)  # channel by subscription
    channels: set[int] = field(default_factory=set)  # of them: each once, or who doesn't read would cost all others
    parameters: set[str] = field(default_factory=set)  # of which it wants to hear
    dropped: int = 0
    _told_dropped: int = 0

    def write(self, frames: bytes) -> None:
        """Send frames, whatever waits already, unless it goes: behind its good-bye nothing can be written any more."""
        if self.connection.state is State.OPEN and not self.connection.transport.is_closing():
            self.connection.transport.write(frames)

    def subscribe(self, number: int, channel: int) -> None:
        self.subscriptions[number] = channel
        self.channels.add(channel)

    def unsubscribe(self, *numbers: int) -> None:
        self.channels -= {self.subscriptions.pop(number) for number in numbers if number in self.subscriptions}

    async def has_room(self) -> None:
        """Wait until it has taken answers, where it asks and doesn't read: what it asks next waits in the kernel."""
        while self.connection.transport.get_write_buffer_size() > 2 * QUEUE_BYTES:
            await asyncio.sleep(ROOM_S)

    def tell(self, level: StatusLevel, text: str) -> None:
        """Show something among the viewer's problems."""
        self.write(text_frame(status(level, text)))

    def send(self, frames: Frames, subscription: int) -> None:
        """Send messages of a topic; where too much waits they are dropped and counted."""
        if self.connection.transport.get_write_buffer_size() > QUEUE_BYTES:
            self.dropped += frames.count
            return
        if self.dropped > self._told_dropped:
            lost = self.dropped - self._told_dropped
            self._told_dropped = self.dropped
            self.tell(StatusLevel.WARNING, f"{lost} messages were dropped: this viewer, or the link to it, is too slow")
        self.write(frames.for_subscription(subscription))


class ViewerServer:
    """Serves until `close`. All but `close` runs in the event loop."""

    def __init__(
        self, terms: Terms, make_feed: Callable[[Listener], LoggerFollower], tell: Callable[[str], None]
    ) -> None:
        self._terms = terms
        self._tell, self._audit = tell, Audit(tell)
        self._viewers: set[Viewer] = set()
        self._offers: dict[int, Offer] = {}
        self._of_element: dict[str, list[Offer]] = {}
        self._numbers: dict[tuple[str, str], int] = {}  # of a topic and its type: it keeps its number
        self._parameters: dict[str, ParameterInfo] = {}
        self._label = ""
        self._newest_ns = 0
        self._loop = asyncio.get_running_loop()
        renew, *calls = [self._soon(one) for one in (self._renew, self._deliver, self._told, self._turn)]
        # in the feed's thread: with a picture it takes seconds, which no viewer waits for
        self._feed = make_feed(Listener(lambda label, elements: renew(label, *live_topics(elements)), *calls))

    def _soon(self, call: Callable[..., None]) -> Callable[..., None]:
        def later(*arguments: Any) -> None:
            with contextlib.suppress(RuntimeError):  # the loop ended: nobody is there to be told
                self._loop.call_soon_threadsafe(call, *arguments)

        return later

    async def serve(self, listening: socket.socket, ended: asyncio.Event) -> None:
        """Serve viewers on a socket that is bound already, until `ended`."""
        self._feed.start()
        watching = asyncio.create_task(self._watch())
        try:
            async with serve(
                self._meet, sock=listening, process_request=self._admit, compression=None,
                subprotocols=[*protocol.SUBPROTOCOLS], max_size=MOST_REQUEST_BYTES, server_header=None,
                ping_interval=ALIVE_S, ping_timeout=ALIVE_S, close_timeout=1.0, logger=log,
            ):  # fmt: skip
                await ended.wait()
        finally:
            watching.cancel()
            await asyncio.to_thread(self._feed.close)

    async def _watch(self) -> None:
        while True:
            await asyncio.sleep(WATCH_S)
            self._audit.watch()

    # ------------------------------------------------------------------------------------------------------- viewers

    def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        hosts, pages = request.headers.get_all("Host"), request.headers.get_all("Origin")
        if len(hosts) != 1 or len(pages) > 1:
            return connection.respond(400, "silo: a request has one Host, and one Origin at most\n")
        why = guard.refusal(
            request.path, hosts[0], pages[0] if pages else None, self._terms.token, self._terms.origins,
            on_loopback=self._terms.on_loopback,
        )  # fmt: skip
        if why:
            return connection.respond(403, f"silo: {why}\n")
        if len(self._viewers) >= MOST_VIEWERS:
            return connection.respond(503, f"silo: {MOST_VIEWERS} viewers are connected already; close one\n")
        return None

    async def _meet(self, connection: ServerConnection) -> None:
        if connection.subprotocol is None:
            await connection.close(1002, f"silo speaks {' and '.join(protocol.SUBPROTOCOLS)}")
            return
        viewer = Viewer(connection)
        self._viewers.add(viewer)
        services = self._terms.services or {}
        try:
            await connection.send(
                protocol.server_info(self._label or self._terms.name, f"{id(self):x}", control=bool(services))
            )
            for text in protocol.advertisements(self._offers.values()):
                await connection.send(text)
            if services:
                await connection.send(protocol.services(list(services)))
            async for message in connection:
                await viewer.has_room()
                await self._take(viewer, message)
        except ConnectionClosed:
            pass  # it went; what it looked at is asked for no more
        finally:
            self._viewers.discard(viewer)
            self._wish()

    async def _take(self, viewer: Viewer, message: str | bytes) -> None:
        try:
            if isinstance(message, bytes):
                await self._call(viewer, protocol.service_call(message))
            elif (request := json.loads(message))["op"] == "setParameters":
                await self._tune(viewer, request)
            else:
                self._obey(viewer, request)
        except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError) as error:
            viewer.tell(StatusLevel.ERROR, f"silo doesn't understand this request ({type(error).__name__}: {error})")

    def _obey(self, viewer: Viewer, request: Mapping[str, Any]) -> None:
        operation = request["op"]
        if operation == "subscribe":
            for one in request["subscriptions"]:
                self._subscribe(viewer, int(one["id"]), int(one["channelId"]))
        elif operation == "unsubscribe":
            viewer.unsubscribe(*map(int, request["subscriptionIds"]))
        elif operation in ("getParameters", "subscribeParameterUpdates", "unsubscribeParameterUpdates"):
            names = list(dict.fromkeys(map(str, request["parameterNames"]))) or list(self._parameters)
            if operation == "unsubscribeParameterUpdates":
                viewer.parameters -= set(names)
                return
            if operation == "subscribeParameterUpdates":
                wanted = viewer.parameters.union(names)
                if len(wanted) > protocol.MOST_PARAMETERS:
                    raise ValueError(f"{protocol.MOST_PARAMETERS} parameters are the most")
                viewer.parameters = wanted
            self._show(viewer, names, request.get("id"))
            return
        else:
            viewer.tell(
                StatusLevel.WARNING, f"silo has no '{operation}': topics can be looked at, values can't be sent"
            )
            return
        self._wish()

    def _subscribe(self, viewer: Viewer, number: int, channel: int) -> None:
        if channel not in self._offers:
            viewer.tell(StatusLevel.ERROR, f"channel {channel} is not offered (any more)")
        elif not 0 <= number < 1 << 32:
            viewer.tell(StatusLevel.ERROR, f"subscription {number} is no unsigned number of 32 bits")
        elif number in viewer.subscriptions:
            viewer.tell(StatusLevel.ERROR, f"subscription {number} is in use")
        elif channel in viewer.channels:
            viewer.tell(StatusLevel.ERROR, f"subscription {number}: channel {channel} is subscribed to already")
        else:
            viewer.subscribe(number, channel)

    async def _call(self, viewer: Viewer, call: ServiceCall) -> None:
        names = list(self._terms.services or {})
        if not self._terms.services or not 1 <= call.service <= len(names):
            viewer.write(protocol.text_frame(protocol.service_failure(call, "no such service: this is read-only")))
            return
        name = names[call.service - 1]
        caller = f"a Foxglove viewer at {viewer.connection.remote_address[0]}"
        text, success = await asyncio.to_thread(self._audit.called, name, self._terms.services[name], caller)
        viewer.write(protocol.binary_frame(protocol.service_response(call, success=success, message=text)))

    async def _tune(self, viewer: Viewer, request: Mapping[str, Any]) -> None:
        """Set parameters, all or none; whoever asked by a name is told what they are then."""
        values, where = protocol.wanted_parameters(request), str(viewer.connection.remote_address[0])
        caller = f"a Foxglove viewer at {where}"
        level = StatusLevel.ERROR
        try:
            if self._terms.tune is None:
                text = "parameters can't be set: this is read-only (`silo foxglove --control`)"
            else:
                text, known = await asyncio.to_thread(self._terms.tune, values, caller, where not in LOOPBACK)
                level = StatusLevel.INFO
                self._turn(known)
        except SiloError as error:
            text = str(error)
        self._audit.note(", ".join(values), "set", caller, text, done=level is StatusLevel.INFO)
        if level is StatusLevel.ERROR:
            viewer.tell(level, text)
        if "id" in request:
            self._show(viewer, values, request["id"])

    def _show(self, viewer: Viewer, names: Iterable[str], request: str | None = None) -> None:
        known = [self._parameters[name] for name in names if name in self._parameters]
        viewer.write(protocol.text_frame(protocol.parameter_values(known, request)))

    # ------------------------------------------------------------------------------------------------ from the logger

    def _turn(self, known: Sequence[ParameterInfo]) -> None:
        """Tell who wants to know which parameters are something else now."""
        before, self._parameters = self._parameters, {info.name: info for info in known}
        changed = {name for name, info in self._parameters.items() if before.get(name) != info}
        for viewer in self._viewers:
            if names := changed & viewer.parameters:
                self._show(viewer, sorted(names))

    def _wish(self) -> None:
        channels = {channel for viewer in self._viewers for channel in viewer.channels}
        self._feed.wish(frozenset(self._offers[one].topic.element for one in channels if one in self._offers))

    def _renew(self, label: str, topics: Sequence[LiveTopic], left_out: Mapping[str, str]) -> None:
        """The element table changed: offer what is on now. What is offered already keeps its number."""
        for why in left_out.values():
            self._tell(why)
        before, self._label = self._offers, label
        offers = [
            Offer(
                self._numbers.setdefault((topic.channel.topic, topic.channel.type.text), len(self._numbers) + 1), topic
            )
            for topic in topics
        ]
        self._offers = {offer.id: offer for offer in offers}
        self._of_element = grouped((offer.topic.element, offer) for offer in offers)
        gone = [number for number in before if number not in self._offers]
        new = [offer for number, offer in self._offers.items() if number not in before]
        for viewer in self._viewers:
            if gone:
                viewer.write(protocol.text_frame(protocol.unadvertisement(gone)))
                lost = set(gone)
                viewer.unsubscribe(*(number for number, channel in [*viewer.subscriptions.items()] if channel in lost))
            for text in protocol.advertisements(new):
                viewer.write(protocol.text_frame(text))
        self._wish()

    def _deliver(self, batch: Mapping[str, SampleArrays], taken: Callable[[], None]) -> None:
        try:
            wanted = grouped(
                (channel, (viewer, number))
                for viewer in self._viewers
                for number, channel in viewer.subscriptions.items()
            )
            for name, samples in batch.items():
                self._newest_ns = max(self._newest_ns, int(samples.time_ns[-1]))
                for offer in self._of_element.get(name, ()):
                    self._send(offer, samples, wanted.get(offer.id, ()))
            frame = protocol.time_frame(self._newest_ns)
            for viewer in self._viewers:
                if viewer.subscriptions:
                    viewer.write(frame)
        finally:
            taken()

    def _send(self, offer: Offer, samples: SampleArrays, viewers: Sequence[tuple[Viewer, int]]) -> None:
        if not viewers:
            return
        frames = Frames(offer.topic, samples)
        for viewer, number in viewers:
            viewer.send(frames, number)
            if samples.missed:
                topic = offer.topic.channel.topic
                viewer.tell(
                    StatusLevel.WARNING, f"{many(samples.missed, 'sample')} of {topic} lost on the way to the bridge"
                )

    def _told(self, text: str) -> None:
        self._tell(text)
        for viewer in self._viewers:
            viewer.tell(StatusLevel.WARNING, text)


def run(
    terms: Terms, connect: Connect, listening: socket.socket, tell: Callable[[str], None], ends_with: int | None = None
) -> None:
    """Serve on a socket until Ctrl-C or SIGTERM, or until `ends_with`, a descriptor, is at its end."""

    async def serve_it() -> None:
        ended = asyncio.Event()
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, ended.set)
        if ends_with is not None:
            loop.add_reader(ends_with, lambda: None if os.read(ends_with, 1) else ended.set())
        with contextlib.closing(listening):
            await ViewerServer(terms, lambda listener: LoggerFollower(connect, listener), tell).serve(listening, ended)

    asyncio.run(serve_it())

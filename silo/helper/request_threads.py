"""The control threads: they take requests in, answer what only reads at once, and have the rest wait for its turn.

What changes something, or reads gigabytes, is done in lanes (`silo.helper.lanes`), so that a robot process that
doesn't answer holds up no status, a recorder no mark, and a history no view.
"""

import contextlib
import functools
import logging
import math
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import msgspec
import zenoh

from silo.conditions.judge import Judge
from silo.conditions.server import ConditionServer
from silo.control.authentication import Authentication, attachment_of
from silo.control.denials import Denials
from silo.control.server import ControlLock, ControlServer
from silo.helper.lanes import Lanes, Waiting, is_late
from silo.helper.numbered import NumberedRequests, number_of
from silo.helper.robot_link import RobotLink, ending
from silo.helper.saver import Saver
from silo.history.server import HistoryServer
from silo.live.publisher import Publisher
from silo.live.server import LiveServer
from silo.live.statistics import Surveyor
from silo.net.keys import Root, may_use
from silo.net.session import undeclare
from silo.parameters.server import ParameterServer
from silo.recorder.server import EndlessRecordings, RecorderServer
from silo.recordings.folder import RecordingFolder
from silo.recordings.server import RecordingServer
from silo.requests import decode_ask, decode_do
from silo.rpc.clocks import clock_s
from silo.rpc.declaring import Do, Done, GoesOn, Lane, Reply, Request, SlowAsk, reply_type, spoken
from silo.rpc.published import EventKind
from silo.rpc.refusals import Refused, RefusedWhy, RequestRefusedError, answered
from silo.rpc.serving import NOBODY, Answer, Dispatch, Turn
from silo.scripts.server import ScriptServer
from silo.state.events import EventNotifier, plain
from silo.state.replica import Replica
from silo.state.requests import Hello, StatusReply
from silo.state.robot_program import RobotProgram
from silo.state.server import Outside, StateServer

MAX_WAITING = 64
SHORT_BYTES = 16 * 1024  # that are read at once
MAX_LONG = 16  # longer ones that wait
LONG_TURN = 8  # every eighth time a longer one comes first

MOST_REFUSED_BYTES = 64 * 1024  # of a change that is refused: larger ones are told without what they were

log = logging.getLogger("silo.helper")


class Servers(Dispatch):
    """Has each request done by the server of its feature, with what that needs of this process, or by the robot."""

    def __init__(
        self,
        replica: Replica,
        events: EventNotifier,
        publisher: Publisher,
        saver: Saver,
        robot: RobotLink,
        judge: Judge,
        recording: EndlessRecordings,
        control_lock: ControlLock,
    ) -> None:
        self._events, surveyor = events, Surveyor(replica)
        self.stop, self.number = surveyor.stop, robot.number  # an event tells by the number how a request ended
        program = RobotProgram(replica, robot.ask)
        outside = Outside(publisher.name_client, publisher.summary.now, control_lock.closed)
        servers = (
            StateServer(replica, events, program, outside),
            ScriptServer(replica, events, program),
            ControlServer(control_lock),
            ConditionServer(judge, replica, events, program),
            HistoryServer(replica, publisher.pins, publisher.streams.open, publisher.streams.close_for),
            LiveServer(publisher, surveyor),
            RecordingServer(RecordingFolder(), saver.save, replica, events),
            RecorderServer(recording, program),
            ParameterServer(program),
        )
        super().__init__(servers, program.reply)
        self._replica, self._catch_up = replica, robot.catch_up

    def reply(self, request: Request[Any], turn: Turn = NOBODY) -> Answer:
        """Do a request as `Dispatch` does, of the logger as its program made it before the client asked."""
        self._catch_up()
        return super().reply(request, turn)

    def after(self, request: Request[Any], reply: Reply) -> Reply:
        """Return what its client is told of a request that the robot program did before this process was there."""
        if isinstance(reply, Done) and reply_type(type(request)) is StatusReply:
            return StatusReply(self._replica.status(), reply.text)
        return reply

    def tell_end(self, job: int, request: Request[Any], reply: Answer, by: str) -> None:
        """Tell all how a request ended whose client was told that it goes on."""
        if not isinstance(reply, bytes | GoesOn):
            self._events.publish(EventKind.ENDED, ending(request, reply), by=by, job=job)


class ShortFirst:
    """Queries as they come, those with little to read before others: who asks for much must not keep the others out.

    Of many that are long the newest wait, as in the channel that they come from. For one thread.
    """

    def __init__(self, handler: zenoh.Handler[zenoh.Query]) -> None:
        self._handler = handler
        self._short: deque[zenoh.Query] = deque()
        self._long: deque[zenoh.Query] = deque()
        self._turn = 0

    def recv(self) -> zenoh.Query:
        """Wait for a query and return it. Raises ZError where no more come."""
        if not self._short and not self._long:
            self._put(self._handler.recv())
        while (more := self._handler.try_recv()) is not None:
            self._put(more)
        self._turn += 1
        first, then = (self._long, self._short) if self._turn % LONG_TURN == 0 else (self._short, self._long)
        return (first or then).popleft()

    def _put(self, query: zenoh.Query) -> None:
        is_long = query.payload is not None and len(query.payload) > SHORT_BYTES
        waiting, most = (self._long, MAX_LONG) if is_long else (self._short, MAX_WAITING)
        waiting.append(query)
        if len(waiting) > most:
            waiting.popleft().drop()  # type: ignore[no-untyped-call]  # zenoh's stub leaves the return type out


class RequestThreads:
    """Owns the control threads."""

    def __init__(
        self,
        session: zenoh.Session,
        root: Root,
        servers: Servers,
        authentication: Authentication,
        control_lock: ControlLock,
        know: Callable[[str, str, str], None],
        denials: Denials,
        done_before: Mapping[str, bytes],
    ) -> None:
        """`know` takes the id of a client, who it is in words, and its identity; `done_before` is of `RobotState`."""
        self._root, self._denials = root, denials
        self._authentication, self._control_lock, self._know = authentication, control_lock, know
        self._servers, self._numbered = servers, NumberedRequests(done_before)
        # when more wait, the oldest are dropped, and their clients get an empty answer at once; "ask" comes last: who
        # is answered there, and not on the others, takes it that rules keep it from changing anything
        self._to_do = [
            session.declare_queryable(key, zenoh.handlers.RingChannel(MAX_WAITING)) for key in authentication.keys
        ]
        self._asked = session.declare_queryable(root.key("ask"), zenoh.handlers.RingChannel(MAX_WAITING))
        self._lanes = Lanes(self._do_one, self._tell_late)
        self._ending = False
        self._threads = [
            threading.Thread(target=self._serve, args=(ShortFirst(self._asked.handler).recv, self._ask), name="ask"),
            *(
                threading.Thread(
                    target=self._serve, args=(one.handler.recv, functools.partial(self._take, key)), name="do"
                )
                for one, key in zip(self._to_do, authentication.keys, strict=True)
            ),
        ]

    def start(self) -> None:
        """Start the threads."""
        self._lanes.start()
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End the threads and wait for them."""
        self._ending = True
        undeclare(self._asked, *self._to_do)  # ends the recv() of their threads
        for thread in self._threads:
            thread.join()
        self._lanes.stop()

    def _serve(self, recv: Callable[[], zenoh.Query], answer: Callable[[zenoh.Query], None]) -> None:
        while (query := self._next(recv)) is not None:
            try:
                answer(query)
            except Exception:
                log.exception("a request failed")  # its client gets an empty answer, and the thread goes on
            del query  # a query that isn't dropped costs its client the whole timeout

    def _next(self, recv: Callable[[], zenoh.Query]) -> zenoh.Query | None:
        try:
            return recv()
        except zenoh.ZError:
            if not self._ending:
                log.exception("no more requests come in")
            return None

    def _ask(self, query: zenoh.Query) -> None:
        payload, key = _payload(query), self._root.key("ask")
        request = self._decoded(query, key, lambda: decode_ask(payload))
        if isinstance(request, SlowAsk):
            self._wait(query, request, key, len(payload))
        elif request is not None:
            self._reply(query, key, answered(lambda: self._servers.reply(request)))

    def _take(self, declared: str, query: zenoh.Query) -> None:
        """Take in what may change something; whether its sender may is looked at when its turn comes."""
        payload, key = _payload(query), str(query.key_expr)
        if self._authentication.refuses(key):
            self._refuse(query, key, payload)
            return
        # what has wildcards is refused, under a key that fits
        own = key if "*" not in key else declared.replace("*", "nobody")
        request = self._decoded(query, own, lambda: decode_do(payload))
        if request is not None:
            self._wait(query, request, own, len(payload))

    def _decoded(self, query: zenoh.Query, key: str, decode: Callable[[], Request[Any]]) -> Request[Any] | None:
        """Return a request; None for what is none, whose sender is told so."""
        found = answered(decode)
        if isinstance(found, Request):
            return found
        self._reply(query, key, found)
        return None

    def _refuse(self, query: zenoh.Query, key: str, payload: bytes) -> None:
        """Tell who may not change anything why, at once: it waits for no lane, and fills none."""
        request: Request[Any] | None = None
        if len(payload) <= MOST_REFUSED_BYTES:
            with contextlib.suppress(RequestRefusedError):
                request = decode_do(payload)
        who = plain(request.client) if request is not None else ""

        def answer() -> Answer:
            with self._denying(request, self._authentication.name_of(key, who)):
                self._authentication.sender(key, b"", who)
            raise AssertionError(key)  # it is a key of those who are refused

        self._reply(query, key, answered(answer))

    @contextlib.contextmanager
    def _denying(self, request: Request[Any] | None, who: str) -> Iterator[None]:
        """Note a change that was not allowed; who only says hello is known by name."""
        try:
            yield
        except RequestRefusedError as refused:
            if isinstance(request, Do) and refused.why in (RefusedWhy.FORBIDDEN, RefusedWhy.CONTROL):
                why = "without control" if refused.why is RefusedWhy.CONTROL else "no role for it"
                self._denials.note(f"change denied: {spoken(request)} ({why})", plain(who))
            elif isinstance(request, Hello) and refused.why is RefusedWhy.FORBIDDEN:
                self._meet(request, who)
            raise

    def _meet(self, hello: Hello, who: str, identity: str = "") -> None:
        if hello.id and may_use(hello.id, hello.proof):
            self._know(plain(hello.id), who, identity)

    def _wait(self, query: zenoh.Query, request: Request[Any], key: str, size_bytes: int) -> None:
        one, lane = Waiting(query, request, key, size_bytes, _until_s(request)), request.lane
        if (known := self._numbered.take(one)) is not None:
            if known:
                self._reply(query, key, known)
        elif (isinstance(request, Do) and is_late(one.until_s, clock_s())) or not one.until_s > clock_s():
            self._tell_late(one, lane, False)
        elif waiting := self._lanes.put(lane, one):
            text = f"{waiting} requests wait for {lane.value} already; try again in a moment; nothing was changed"
            self._end(one, Refused(RefusedWhy.FAILED, text))

    # ------------------------------------------------------------------------------------------- in a lane's thread

    def _do_one(self, one: Waiting) -> None:
        reply = answered(lambda: self._answer(one))
        if isinstance(one.request, SlowAsk) or one.claim():
            self._end(one, reply)
        elif isinstance(one.request, Do):
            self._servers.tell_end(one.job, one.request, reply, one.by)

    def _answer(self, one: Waiting) -> Answer:
        request, key = one.request, str(one.query.key_expr)
        if isinstance(request, SlowAsk):
            return self._servers.reply(request)
        who = plain(request.client)
        with self._denying(request, self._authentication.name_of(key, who)):
            sender = self._authentication.sender(key, attachment_of(one.query), who)
        if isinstance(request, Hello):
            self._meet(request, sender.words, sender.identity)
            return self._servers.reply(msgspec.structs.replace(request, id=""))
        one.by = sender.words
        with self._denying(request, sender.words):
            self._control_lock.check(request, sender)
        if (done := self._numbered.done_before(one)) is not None:
            return self._servers.after(request, done)
        turn = Turn(sender, one.until_s, number_of(one))
        return self._servers.reply(msgspec.structs.replace(request, client=sender.words), turn)

    def _tell_late(self, one: Waiting, lane: Lane, begun: bool) -> None:
        """Refuse what was not begun in time, and say of what was that it goes on; then nobody else answers."""
        if not isinstance(one.request, Do):
            if not begun:
                one.query.drop()  # type: ignore[no-untyped-call]  # zenoh's stub leaves the return type out
            return
        if not begun:
            text = f"its turn did not come in time: it waited for {lane.value}; nothing was changed; try again"
            self._end(one, Refused(RefusedWhy.LATE, text))
            return
        one.job = self._servers.number()
        if one.claim():
            name = spoken(one.request)
            told = GoesOn(one.job, f"{name} goes on: it waits for {lane.value}; an event tells how it ends")
            self._end(one, told)

    def _end(self, one: Waiting, reply: Answer) -> None:
        """Answer whoever asked for it."""
        body = _encoded(answered(lambda: _encoded(reply)))
        for query in self._numbered.end(one, body):
            self._reply(query, one.key, body)
        self._reply(one.query, one.key, body)

    def _reply(self, query: zenoh.Query, key: str, reply: Answer) -> None:
        """Answer under one of our keys, whatever happens: what breaks something is refused and logged."""
        body = _encoded(answered(lambda: _encoded(reply)))
        try:
            with query:
                query.reply(key, body)
        except zenoh.ZError as error:
            # the client is gone, or asked for another key than ours
            log.debug("no reply could be sent: %s", error)


def _encoded(reply: Answer) -> bytes:
    return reply if isinstance(reply, bytes) else msgspec.msgpack.encode(reply)


def _until_s(request: Request[Any]) -> float:
    """Return when the client of a request gives up."""
    return math.inf if isinstance(request, Hello) else request.until_s or clock_s() + request.timeout_s


def _payload(query: zenoh.Query) -> bytes:
    payload = query.payload
    return payload.to_bytes() if payload is not None else b""

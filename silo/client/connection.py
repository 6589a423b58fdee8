"""The connection of a client to one logger, watched by one thread that makes it anew when it is lost.

Its Zenoh session is its own on this computer, and that of its configuration over a network. It asks under the keys of
that one logger alone.

The thread notices that a helper process has gone (at once if it died, after two seconds if it is frozen), looks for it
or for a new logger of the same name, and connects again; views and topics go on by themselves. It leaves when the main
thread is gone, so that a program that forgets `close()` still ends.
"""

import contextlib
import functools
import itertools
import logging
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import zenoh
from msgspec.structs import replace

from silo.client.heard import HeardEvents
from silo.core.elements import LoggedEvent, State
from silo.core.runtime import process_start
from silo.decoding import msgpack_decoder
from silo.errors import ConnectionLostError, RefusedError, SiloError, VersionError
from silo.fleet.exchange import NoAnswerError, exchange, introduce, root_at
from silo.fleet.many import Pending
from silo.fleet.near import near_loggers, seen_now
from silo.fleet.resolving import namesakes
from silo.net import keys
from silo.net.found import LoggerAddress
from silo.net.session import check_unforked, owner_is_gone, undeclare
from silo.net.sessions import SessionLease, borrow, give_back
from silo.net.subscribed import Subscribed
from silo.rpc.clocks import TheirClock
from silo.rpc.declaring import Do, Request, request_of
from silo.rpc.foreign import Foreign
from silo.rpc.published import Event
from silo.rpc.refusals import checked
from silo.state.requests import EventRequests, Hello, HelloReply
from silo.version import VERSION

if TYPE_CHECKING:
    from silo.requests import AnyReply

POLL_S = 0.05
RETRY_S = 0.2
HELLO_TIMEOUT_S = 1.0
DEAD_SCAN_S = 0.5
TWIN_SCAN_S = 2.0  # so often is looked who is there beside a robot that lives
HELPER_BACK_S = 3.0  # elsewhere nobody sees whether a program lives: its next helper process is there by then
TOKEN_POLL_S = 0.001
GONE_S = 0.3  # another user's logger is seen nowhere while its next helper process begins to listen
LOOK_S = 1.0
LEFT_S = 10.0  # a helper process that is there may be kept from answering; a query ends at once where its link has gone
REACH_S = 2.0  # its thread looks for the way again and again, and is to end soon

log = logging.getLogger("silo.client")
_event_decoder = msgpack_decoder(Event)


class LoggerEndedError(ConnectionLostError):
    """It was there when it was looked for, and ended before it was connected to."""


class Connection:
    """A watched session to one logger."""

    def __init__(self, found: LoggerAddress, timeout_s: float, who: str, *, read_only: bool = False) -> None:
        """Connects. Raises ConnectionLostError, VersionError."""
        self.found = found
        self._who, self._read_only = who, read_only
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._attached: set[Subscribed] = set()
        # called in its thread: for every event; with False when the link is lost, with True when it is there again
        self.event_callbacks: list[Callable[[Event], None]] = []
        self.link_callbacks: list[Callable[[bool], None]] = []
        self._borrowed: SessionLease | None = None
        self._dead = False
        self._lost_s = 0.0
        self._retry_s = 0.0
        self._looked_s = time.monotonic()
        self._asked: Pending | None = None  # whether the helper process is there still
        self._clock = TheirClock()
        self.helper_pid = 0  # as it told last
        self._problem = ""  # why the helper process that is there now can't be asked
        self.sessions = 0  # counts up with every session: views must be opened anew
        self._foreign = Foreign("an event")
        self._heard = HeardEvents()
        self._missed: list[Event] = []  # while no link was there
        self._known: set[str] = set()  # who was there while ours lived: other robots, whatever their names
        until_s = time.monotonic() + timeout_s
        while not self._opened(found, timeout_s, until_s):  # it died meanwhile: its program starts the next one
            time.sleep(POLL_S)
        self._known = self._twins()

    def watch(self, on_round: Callable[[], None]) -> None:
        """Begin to watch the link, in a thread that calls `on_round` 20 times a second: it may need the connection."""
        self._thread = threading.Thread(target=self._watch, args=(on_round,), name="silo-client")
        self._thread.start()

    # -------------------------------------------------------------------------------------------- one session

    def _opened(self, found: LoggerAddress, timeout_s: float, until_s: float) -> bool:
        """Return whether it is open; where not it may be by now: its helper process was being replaced."""
        try:
            self._open(seen_now(found) if found.socket else found, timeout_s)
        except ConnectionLostError as error:
            silent, is_there = isinstance(error, NoAnswerError), _is_there(found)
            given_up = not silent or time.monotonic() >= until_s or _program_is_gone(found)
            if isinstance(error, VersionError) or (is_there and given_up) or (found.config and not silent):
                raise
            if not is_there and not _comes_back(found, until_s):
                raise LoggerEndedError(f"{self.label_of(found)} ended just now; nothing was asked") from error
            log.debug("not yet: %s", error)
            return False
        return True

    def _open(self, found: LoggerAddress, timeout_s: float) -> None:
        borrowed = borrow(found.socket, found.config, max(REACH_S, timeout_s), timeout_s)
        session = borrowed.session
        declared: list[Any] = []
        attached: list[Subscribed] = []
        try:
            root = root_at(borrowed, found, timeout_s)
            # an id of its own: the end of the session before may reach the helper late, and ends the views of its id
            mine = keys.ClientId.drawn()
            question = Hello(version=VERSION, client=self._who, id=mine.id, proof=mine.proof)
            label = self.label_of(found)
            try:
                reply = checked(question, exchange(borrowed, root, question, timeout_s, label))
            except RefusedError as refused:  # who connects waits for a logger, and has asked it for nothing yet
                raise ConnectionLostError(f"{label} can't say who it is: {refused}") from refused
            introduce(borrowed, root, question, timeout_s, may_change=not self._read_only)
            self._learn(reply)
            dead = reply.status.state is State.DEAD
            events = session.declare_subscriber(root.key("event"), zenoh.handlers.RingChannel(256))
            declared.append(events)
            # with history, as the end of a token that was there before goes untold without; it answers when it knows
            # what was subscribed before
            alive = session.liveliness().declare_subscriber(
                root.key("alive"), zenoh.handlers.RingChannel(16), history=True
            )
            declared.append(alive)
            declared.append(session.liveliness().declare_token(root.key("client", mine.id)))
            with self._lock:
                attached = list(self._attached)
            for one in attached:
                one.attach(session, root, mine)
            _wait_for_token(alive, HELLO_TIMEOUT_S + borrowed.slack_s)

            def read(since: int, limit: int) -> list[LoggedEvent]:
                request = request_of(EventRequests._get_events, since, limit)
                lines: list[LoggedEvent] = checked(request, exchange(borrowed, root, request, timeout_s, label)).events
                return lines

            missed = self._heard.missed(reply, read)
        except BaseException:
            for one in attached:
                one.detach()
            undeclare(*declared)
            give_back(borrowed)
            raise
        with self._lock:
            self.found = replace(found, host=root.host, id=root.id)
            self.root = root
            self._dead = dead
            self._program_start = _program_start(found, reply.status.helper_pid)
            self._alive, self._events, self._declared = alive, events, declared
            self.mine = mine
            self._missed += missed
            self._borrowed = borrowed
            self._problem = ""
            self.sessions += 1

    def _lose(self, *, tell: bool = True) -> None:
        with self._lock:
            borrowed, self._borrowed = self._borrowed, None
            attached = list(self._attached)
        self._lost_s, self._retry_s = time.monotonic(), 0.0
        self._asked = None
        for one in attached:
            one.detach()
        if borrowed is not None:
            if tell:
                self._call_back(self.link_callbacks, False)
            if borrowed.config:
                undeclare(*self._declared)  # others may go on with it
            give_back(borrowed)  # takes 2.5 s if it is closed and the other side is frozen

    @staticmethod
    def label_of(found: LoggerAddress) -> str:
        """Return how to speak of a logger."""
        return f"logger '{found.host}/{found.name}'" if found.config else f"logger '{found.name}'"

    # --------------------------------------------------------------------------------------------- for the client

    @property
    def connected(self) -> bool:
        """Whether the helper process is there."""
        return self._borrowed is not None

    def borrowed(self) -> SessionLease:
        """Return what requests go through. Raises ConnectionLostError while there is none, and once this was closed."""
        check_unforked()
        borrowed, who = self._borrowed, self.label_of(self.found)
        if self.closed:
            address = f"{self.found.host}/{self.found.name}" if self.found.config else self.found.name
            raise ConnectionLostError(f"this client of {who} is closed; silo.connect('{address}') makes another one")
        if borrowed is None and self._problem:
            raise VersionError(self._problem)
        if borrowed is None:
            raise ConnectionLostError(
                f"no connection to {who} since {time.monotonic() - self._lost_s:.0f} s: its helper process is gone or "
                "frozen; connecting again by itself"
            )
        return borrowed

    @property
    def closed(self) -> bool:
        """Whether this side ended it."""
        return self._stop.is_set()

    @property
    def user(self) -> str:
        """The name under which changes go out; empty on this computer."""
        user = self.borrowed().user
        return "" if user == keys.LOCAL_SENDER else user

    @property
    def identity(self) -> str:
        """By which the logger tells this user from others; empty while there is no session."""
        borrowed = self._borrowed
        return borrowed.identity if borrowed is not None else ""

    def exchange(
        self, request: Request[Any], timeout_s: float, *, as_change: bool = False, refused: bool = False
    ) -> "AnyReply":
        """Ask and wait; what only reads is asked again where the link was lost. Raises ConnectionLostError."""
        until_s = time.monotonic() + timeout_s
        while True:
            mine, root, label = self.borrowed(), self.root, self.label_of(self.found)
            ask = functools.partial(exchange, mine, root, who=label, timeout_s=max(POLL_S, until_s - time.monotonic()))
            try:
                if request.key == Do.key and not self._clock.is_fresh:
                    self._learn(ask(Hello(version=VERSION, client=self._who)))
                return self._learn(ask(request, as_change=as_change, refused=refused, clock=self._clock))
            except ConnectionLostError as error:
                changes = as_change or refused or request.key == Do.key
                lost = isinstance(error, NoAnswerError) or self._borrowed is not mine
                if changes or not lost or not self._is_there_again(until_s):
                    raise

    def _is_there_again(self, until_s: float) -> bool:
        """Wait for a session to the helper process of this computer that is seen to live; False where none comes."""
        if self._thread is threading.current_thread():  # it opens the next one
            return False
        while self.found.socket and not owner_is_gone(Path(self.found.socket)) and time.monotonic() < until_s:
            time.sleep(POLL_S)
            if self._borrowed is not None or self.closed:
                return not self.closed
        return False

    def is_back(self, until_s: float) -> bool:
        """Wait for a helper process of this logger, also the next one; False where none comes until then."""
        time.sleep(POLL_S)  # before a session is tried again that is seen to be gone only then
        while time.monotonic() < until_s and not self.closed and self._thread is not threading.current_thread():
            if self._borrowed is not None:
                return True
            if self.found.socket and owner_is_gone(Path(self.found.socket)) and not self._program_lives():
                return False
            time.sleep(POLL_S)
        return False

    def ask_later(self, request: Request[Any], timeout_s: float) -> Pending:
        """Ask, and look for the answer when there is time. Raises ConnectionLostError."""
        # while a client closes, its thread still asks: it is that thread that lets the session go
        return Pending(self._borrowed or self.borrowed(), self.root, request, timeout_s, self._clock)

    def _learn(self, reply: "AnyReply") -> "AnyReply":
        """Return a reply; of a hello the clock of the helper process is taken in."""
        if isinstance(reply, HelloReply):
            self._clock.learn(reply.clock_s)
            self.helper_pid = reply.status.helper_pid
        return reply

    def attach(self, one: Subscribed) -> None:
        """Subscribe something now and in every later session."""
        mine = self.borrowed()
        try:
            one.attach(mine.session, self.root, self.mine)
        except zenoh.ZError as error:
            raise ConnectionLostError(f"lost the connection to {self.label_of(self.found)}: {error}") from error
        with self._lock:
            if self._borrowed is mine:
                self._attached.add(one)
                return
        one.detach()
        self.attach(one)  # in the session that came meanwhile

    def forget(self, one: object) -> None:
        """The thing was closed, attached or not."""
        with self._lock:
            self._attached -= {one}

    def try_now(self) -> None:
        """Look for the helper process in the next round, where it is gone; nothing waits."""
        self._retry_s = 0.0

    def close(self) -> None:
        """End the thread and the session; closing twice is fine."""
        self._stop.set()
        if self._thread is not threading.current_thread():
            self._thread.join()

    # ------------------------------------------------------------------------------------------------- the thread

    def _watch(self, on_round: Callable[[], None]) -> None:
        main = threading.main_thread()
        scanned_s, gone = 0.0, False
        while not self._stop.wait(POLL_S) and main.is_alive():
            if self._borrowed is None:
                self._try_again()
                continue
            last_look = gone  # Zenoh sends by priority: the end of a token may overtake what was told before it
            gone = last_look or self._is_gone() or self._has_left()
            self._hand_out_events()
            if last_look:
                gone = False
                self._lose()
            if gone or last_look:
                continue
            if time.monotonic() - scanned_s > (DEAD_SCAN_S if self._dead else TWIN_SCAN_S):
                scanned_s = time.monotonic()
                if self._dead:
                    if others := self._namesakes():  # its program was started again
                        self._lose()
                        self.found = others[0]
                elif self._program_start:
                    twins = self._twins()
                    self._known |= twins if self._program_lives() else set()  # asked last: they were there beside it
            _call(lambda _: on_round(), True)
        self._lose(tell=False)

    def _is_gone(self) -> bool:
        gone = False
        try:
            while (sample := self._alive.try_recv()) is not None:
                # a PUT after it is of another helper process, to which Zenoh connected by itself: it knows no view of
                # ours
                gone = gone or sample.kind == zenoh.SampleKind.DELETE
        except zenoh.ZError:  # somebody closed the session
            return True
        return gone

    def _has_left(self) -> bool:
        """Whether the helper process ended although Zenoh told nothing: it may end while its token is being told.

        One whose socket somebody deleted still answers, and tells so.
        """
        if self._asked is not None:
            ended, answer = self._asked.poll()
            self._asked = None if ended else self._asked
            return ended and answer is None
        if time.monotonic() - self._looked_s < LOOK_S:
            return False
        self._looked_s = time.monotonic()
        if self.found.socket and owner_is_gone(Path(self.found.socket)):
            self._asked = self.ask_later(Hello(version=VERSION, client=self._who), LEFT_S)
        return False

    def _hand_out_events(self) -> None:
        missed, self._missed = self._missed, []
        told = (self._event_of(sample) for sample in iter(self._next_event, None))
        for event in itertools.chain(missed, told):
            if event is None or not self._heard.is_new(event):
                continue
            if event.status is not None:
                self._dead = event.status.state is State.DEAD
            self._call_back(self.event_callbacks, event)

    def _next_event(self) -> zenoh.Sample | None:
        with contextlib.suppress(zenoh.ZError):  # of a session that is closed: `_is_gone` tells
            return self._events.try_recv()
        return None

    def _event_of(self, sample: zenoh.Sample) -> Event | None:
        try:
            return self._foreign.read(str(sample.key_expr), lambda: _event_decoder.decode(sample.payload.to_bytes()))
        except ConnectionLostError as many:
            log.warning("%s", many)  # requests go on
            return None

    def _call_back(self, callbacks: list[Callable[[Any], None]], value: Event | bool) -> None:
        for callback in list(callbacks):
            _call(callback, value)

    def _try_again(self) -> None:
        if time.monotonic() < self._retry_s:
            return
        for found in self._candidates():
            try:
                self._open(found, HELLO_TIMEOUT_S)
            except SiloError as error:
                self._problem = str(error) if isinstance(error, VersionError) else ""
                log.debug("not yet: %s", error)
                continue
            self._known.add(_mark(self.found))
            self._call_back(self.link_callbacks, True)
            return
        self._retry_s = time.monotonic() + RETRY_S

    def _candidates(self) -> list[LoggerAddress]:
        """Return the same helper process or its successor first, then other loggers of the name, the newest first."""
        if self.found.config:
            is_late = time.monotonic() - self._lost_s > HELPER_BACK_S
            return [self.found, *(self._namesakes() if is_late else [])]
        path = Path(self.found.socket)
        if path.exists() and not owner_is_gone(path):
            return [seen_now(self.found)]
        return self._namesakes()

    def _namesakes(self) -> list[LoggerAddress]:
        """Return loggers of the same name on the same computer that may be ours, started again.

        Those that were there while ours lived are other robots, and so are those of another computer that calls itself
        the same. While our program lives and its helper process alone is gone, it starts another one by itself: only a
        logger of the same program may follow.
        """
        mine = self.found
        try:
            loggers = namesakes(mine, HELLO_TIMEOUT_S)
        except SiloError as error:
            log.debug("can't look for loggers: %s", error)
            return []
        others = [found for found in loggers if found.follows(mine) and _mark(found) not in self._known]
        if self._program_lives():
            others = [found for found in others if found.pid == mine.pid]
        return sorted(others, key=_age, reverse=True)

    def _twins(self) -> set[str]:
        """Return who is there of the same name, ours among them."""
        try:
            return {_mark(self.found), *(_mark(one) for one in namesakes(self.found, HELLO_TIMEOUT_S))}
        except SiloError as error:
            log.debug("can't look for loggers: %s", error)
            return {_mark(self.found)}

    def _program_lives(self) -> bool:
        """Whether the robot program is known to live, whatever its helper process does."""
        return bool(self._program_start) and process_start(self.found.pid) == self._program_start


def _wait_for_token(alive: "zenoh.Subscriber[zenoh.Handler[zenoh.Sample]]", timeout_s: float) -> None:
    """Wait until the token of a helper process is known: the end of one that isn't is never told.

    Raises ConnectionLostError where it has ended already; rules that hide tokens are no reason not to connect.
    """
    until_s = time.monotonic() + timeout_s
    while time.monotonic() < until_s:
        sample = alive.try_recv()
        if sample is not None and sample.kind == zenoh.SampleKind.DELETE:
            raise NoAnswerError("the helper process ended just now; try again")
        if sample is not None:
            return
        time.sleep(TOKEN_POLL_S)


def _seen(found: LoggerAddress) -> list[LoggerAddress]:
    """Return who may be a logger, or what came in its place; empty where there is no way to them any more."""
    with contextlib.suppress(SiloError):
        return namesakes(found, HELLO_TIMEOUT_S)
    return []


def _program_is_gone(found: LoggerAddress) -> bool:
    return bool(found.socket) and process_start(found.pid) == 0


def _is_there(found: LoggerAddress) -> bool:
    return any(one.key == found.key for one in _seen(found))


def _comes_back(found: LoggerAddress, until_s: float) -> bool:
    """Wait for a logger that is gone; False where it was ended, as far as is seen from here."""
    gone_s = time.monotonic()
    while time.monotonic() < until_s:
        seen = _seen(found)
        if any(one.key == found.key for one in seen):
            return True
        if found.config:
            is_over = any(one.follows(found) for one in seen)
        else:
            near = near_loggers()
            is_between = any((one.name, one.pid) == (found.name, found.pid) for one in (*near.down, *near.left))
            is_over = not is_between and (time.monotonic() - gone_s > GONE_S or _program_is_gone(found))
        if is_over:
            return False
        time.sleep(POLL_S)
    return False


def _program_start(found: LoggerAddress, helper_pid: int) -> int:
    """Return when the robot program began; 0 where it isn't seen from here: elsewhere, dead, in another container."""
    try:
        command = Path(f"/proc/{helper_pid}/cmdline").read_bytes()  # of another process, if they count theirs otherwise
    except OSError:
        return 0
    return process_start(found.pid) if found.socket and b"silo.helper" in command else 0


def _mark(found: LoggerAddress) -> str:
    """Return what tells a logger from others of its name."""
    return found.socket or str(found.root)


def _call(callback: Callable[[Any], None], value: Event | bool) -> None:
    try:
        callback(value)
    except Exception:
        log.exception("a callback failed")


def _age(found: LoggerAddress) -> float:
    """Return when the socket was made; 0 if it is gone."""
    try:
        return Path(found.socket).stat().st_ctime
    except OSError:
        return 0.0

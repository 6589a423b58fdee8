"""The connection of a client: one Zenoh session, watched by one thread that opens another when it is lost.

The thread notices that a helper process has gone (at once if it died, after two seconds if it is frozen), looks for it
or for a new logger of the same name, and connects again; views and topics go on by themselves. It leaves when the main
thread is gone, so that a program that forgets `close()` still ends.
"""

import logging
import secrets
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import msgspec
import zenoh

from silo.errors import ConnectionLostError, SiloError, VersionError
from silo.ipc import keys
from silo.ipc.discovery import Found, discover
from silo.ipc.exchange import encoded, exchange, key_of
from silo.ipc.messages import AnyReply, Hello, HelloReply, Request
from silo.ipc.published import Event
from silo.ipc.session import close, open_client, owner_is_gone
from silo.model import State
from silo.version import VERSION

POLL_S = 0.05
RETRY_S = 0.2
HELLO_TIMEOUT_S = 1.0
DEAD_SCAN_S = 0.5
LOOK_S = 1.0

log = logging.getLogger("silo.client")
_event_decoder = msgspec.msgpack.Decoder(Event)


class Attachable(Protocol):
    """What lives on across sessions: views and topics."""

    def attach(self, session: zenoh.Session, root: keys.Root, client_id: str) -> None:
        """Subscribe in a new session."""

    def detach(self) -> None:
        """The session is about to be closed."""


class Pending:
    """A request whose answer nobody waits for: it is looked at when it has come."""

    def __init__(self, session: zenoh.Session, key: str, request: Request[Any], timeout_s: float) -> None:
        # not a ring: it loses what it holds when the query ends
        self._replies = session.get(key, zenoh.handlers.FifoChannel(4), payload=encoded(request), timeout=timeout_s)

    def poll(self) -> tuple[bool, bytes | None]:
        """Return whether it has come to its end, and with what."""
        try:
            reply = self._replies.try_recv()
        except zenoh.ZError:
            return True, None
        if reply is None:
            return False, None
        return True, reply.ok.payload.to_bytes() if reply.ok is not None else None


class Connection:
    """A watched session to one logger."""

    def __init__(self, found: Found, timeout_s: float, who: str, on_round: Callable[[], None]) -> None:
        """Connects. Raises ConnectionLostError, VersionError. `on_round` is called 20 times a second after `watch`."""
        self.found = found
        self._who = who
        self._on_round = on_round
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._attached: set[Attachable] = set()
        self._event_callbacks: list[Callable[[Event], None]] = []
        self._link_callbacks: list[Callable[[bool], None]] = []
        self._session: zenoh.Session | None = None
        self._dead = False
        self._lost_s = 0.0
        self._retry_s = 0.0
        self._problem = ""  # why the helper process that is there now can't be asked
        self.sessions = 0  # counts up with every session: views must be opened anew
        self._known: set[str] = set()
        self._open(found, timeout_s)
        self._known = {other.socket for other in self._namesakes()} | {found.socket}
        self._thread = threading.Thread(target=self._watch, name="silo-client")

    def watch(self) -> None:
        """Begin to watch the link, in a thread: what it calls may need the connection, which its owner has by now."""
        self._thread.start()

    # -------------------------------------------------------------------------------------------- one session

    def _open(self, found: Found, timeout_s: float) -> None:
        session = open_client(Path(found.socket) if found.socket else None, found.config or None)
        try:
            root = keys.Root(found.host, found.name) if found.host else None
            question = Hello(version=VERSION, client=self._who)
            reply, root = exchange(session, key_of(question, root), question, timeout_s, self.label_of(found))
            self._dead = _state_of(reply) is State.DEAD
            alive = session.liveliness().declare_subscriber(
                root.key("alive"),
                zenoh.handlers.RingChannel(16),
                history=True,  # without it, the end of a token that was there before goes untold
            )
            events = session.declare_subscriber(root.key("event"), zenoh.handlers.RingChannel(256))
            # an id of its own: the end of the session before may reach the helper late, and ends the views of its id
            client_id = secrets.token_hex(8)
            token = session.liveliness().declare_token(root.key("client", client_id))
            with self._lock:
                attached = list(self._attached)
            for one in attached:
                one.attach(session, root, client_id)
        except BaseException:
            close(session)
            raise
        with self._lock:
            self.found, self.root = found, root
            self._alive, self._events, self._token = alive, events, token
            self.client_id = client_id
            self._session = session
            self._problem = ""
            self.sessions += 1

    def _lose(self, *, tell: bool = True) -> None:
        """Let the session go and say so."""
        with self._lock:
            session, self._session = self._session, None
            attached = list(self._attached)
        self._lost_s, self._retry_s = time.monotonic(), 0.0
        for one in attached:
            one.detach()
        if session is not None:
            if tell:
                self._call_back(self._link_callbacks, False)
            close(session)  # takes 2.5 s if the other side is frozen

    @staticmethod
    def label_of(found: Found) -> str:
        """Return how to speak of a logger."""
        return f"logger '{found.name}'"

    # --------------------------------------------------------------------------------------------- for the client

    @property
    def connected(self) -> bool:
        """Whether the helper process is there."""
        return self._session is not None

    def session(self) -> zenoh.Session:
        """Return the present session. Raises ConnectionLostError while there is none."""
        session = self._session
        if session is None and self._problem:
            raise VersionError(self._problem)
        if session is None:
            raise ConnectionLostError(
                f"no connection to {self.label_of(self.found)} since {time.monotonic() - self._lost_s:.0f} s: its "
                "helper process is gone or frozen; connecting again by itself"
            )
        return session

    def exchange(self, request: Request[Any], timeout_s: float, *, key: str = "") -> AnyReply:
        """Ask and wait. Raises ConnectionLostError."""
        session = self.session()
        target = self.root.key(key) if key else key_of(request, self.root)
        return exchange(session, target, request, timeout_s, self.label_of(self.found))[0]

    def attach(self, one: Attachable) -> None:
        """Subscribe something now and in every later session."""
        one.attach(self.session(), self.root, self.client_id)
        with self._lock:
            self._attached.add(one)

    def forget(self, one: Attachable) -> None:
        """The thing was closed."""
        with self._lock:
            self._attached.discard(one)

    def on_event(self, callback: Callable[[Event], None]) -> None:
        """Call back for every event, in the thread of the connection."""
        self._event_callbacks.append(callback)

    def on_link(self, callback: Callable[[bool], None]) -> None:
        """Call back with False when the connection is lost, with True when it is there again."""
        self._link_callbacks.append(callback)

    def close(self) -> None:
        """End the thread and the session; closing twice is fine."""
        self._stop.set()
        if self._thread is not threading.current_thread():
            self._thread.join()

    # ------------------------------------------------------------------------------------------------- the thread

    def _watch(self) -> None:
        main = threading.main_thread()
        scanned_s = 0.0
        looked_s = time.monotonic()
        while not self._stop.wait(POLL_S) and main.is_alive():
            if self._session is None:
                self._try_again()
                continue
            self._hand_out_events()
            gone = self._is_gone()
            if not gone and time.monotonic() - looked_s > LOOK_S:
                looked_s = time.monotonic()
                gone = self._has_left()
            if gone:
                self._lose()
                continue
            if self._dead and time.monotonic() - scanned_s > DEAD_SCAN_S:
                scanned_s = time.monotonic()
                self._look_for_successor()
            _call(lambda _: self._on_round(), True)
        self._lose(tell=False)

    def _is_gone(self) -> bool:
        gone = False
        while (sample := self._alive.try_recv()) is not None:
            # a PUT after it is of another helper process, to which Zenoh connected by itself: it knows no view of ours
            gone = gone or sample.kind == zenoh.SampleKind.DELETE
        return gone

    def _has_left(self) -> bool:
        """Whether the helper process ended although Zenoh told nothing: it may end while its token is being told."""
        return bool(self.found.socket) and owner_is_gone(Path(self.found.socket))

    def _hand_out_events(self) -> None:
        while (sample := self._events.try_recv()) is not None:
            try:
                event = _event_decoder.decode(sample.payload.to_bytes())
            except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError):
                log.exception("an event that this version of silo doesn't know")
                continue
            if event.status is not None:
                self._dead = event.status.state is State.DEAD
            self._call_back(self._event_callbacks, event)

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
            self._known.add(found.socket)
            self._call_back(self._link_callbacks, True)
            return
        self._retry_s = time.monotonic() + RETRY_S

    def _candidates(self) -> list[Found]:
        """Return the same helper process or its successor first, then other loggers of the name, the newest first."""
        if self.found.config:
            return [self.found]
        path = Path(self.found.socket)
        if path.exists() and not owner_is_gone(path):
            return [self.found]
        return self._namesakes()

    def _namesakes(self) -> list[Found]:
        """Return loggers of the same name that were started after we connected.

        Those that were there are other robots.
        """
        try:
            loggers = discover().loggers
        except SiloError as error:
            log.debug("can't look for loggers: %s", error)
            return []
        mine = self.found
        others = [found for found in loggers if (found.name, found.user) == (mine.name, mine.user)]
        return sorted((found for found in others if found.socket not in self._known), key=_age, reverse=True)

    def _look_for_successor(self) -> None:
        """The robot program is dead: when it is started again, go over to the new one."""
        if self.found.config:
            return
        others = self._namesakes()
        if others:
            self._lose()
            self.found = others[0]


def _call(callback: Callable[[Any], None], value: Event | bool) -> None:
    try:
        callback(value)
    except Exception:
        log.exception("a callback failed")


def _state_of(reply: AnyReply) -> State:
    if not isinstance(reply, HelloReply):
        raise ConnectionLostError(f"the helper process answered Hello with {type(reply).__name__}")
    return reply.status.state


def _age(found: Found) -> float:
    """Return when the socket was made; 0 if it is gone."""
    try:
        return Path(found.socket).stat().st_ctime
    except OSError:
        return 0.0

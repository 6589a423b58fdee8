"""Sessions of clients: one for each configuration, shared by all that talk through it; one for each local socket.

The desk has one link to its router, whatever the number of robots behind it. A shared session connects again by itself
and is closed when the last of its users gives it back.
"""

import os
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec
import zenoh

from silo.core.runtime import user_name
from silo.net import keys
from silo.net.access.probing import REACH_S, reach
from silo.net.access.senders import group_identity, local_identity
from silo.net.configuration import find_file, from_file, said_of, user_of
from silo.net.session import Beside, check_unforked, close, open_client

WAITED_TRIPS = 4  # of an answer, beyond the time that it may take where there is no way


class _Shared(msgspec.Struct):
    lock: threading.Lock = msgspec.field(default_factory=threading.Lock)
    session: zenoh.Session | None = None
    rtt_s: float = 0.0
    users: int = 0
    looking: threading.Lock = msgspec.field(default_factory=threading.Lock)
    followed: dict[object, Mapping[str, keys.Root]] = msgspec.field(default_factory=dict)


class SessionLease(msgspec.Struct, frozen=True):
    """A session to talk through, and the round trip time of its link in s, 0 on this computer.

    Changes go out under the name `user`; with `proof` where a group shares the socket. `looking` is held while somebody
    asks who is there, or begins to follow that; `followed` has whom those see who follow it.
    """

    session: zenoh.Session
    config: str
    rtt_s: float = 0.0
    user: str = keys.LOCAL_SENDER
    proof: bytes | None = None
    identity: str = ""  # by which a logger tells operators apart
    looking: threading.Lock = msgspec.field(default_factory=threading.Lock)
    followed: dict[object, Mapping[str, keys.Root]] = msgspec.field(default_factory=dict)

    @property
    def slack_s(self) -> float:
        """How much longer than on this computer an answer may take."""
        return WAITED_TRIPS * self.rtt_s


_shared: dict[str, _Shared] = {}
_guard = threading.Lock()


def borrow(socket_path: str, config: str, reach_s: float = REACH_S, open_s: float = 0.0) -> SessionLease:
    """Return a session to a local socket, or one to what a configuration names: that which is open, or a new one.

    `reach_s` is how long an address may stay silent, `open_s` how long a helper process that is there is waited for.
    Raises ConnectionLostError, with the layer that fails where it is a network.
    """
    check_unforked()  # else it may wait for a lock that a thread of its parent held
    if socket_path:
        local = Path(socket_path)
        session, (proof, identity) = open_client(local, open_s=open_s), _shown(local)
        return SessionLease(session, "", proof=proof, identity=identity)
    path = find_file(config)
    with _guard:
        shared = _shared.setdefault(path, _Shared())
        shared.users += 1
    try:
        with shared.lock:
            if shared.session is None:
                reached = reach(path, reach_s)
                shared.session = open_client(None, path, reached)
                shared.rtt_s = reached.rtt_s
            user = user_at(path)
            return SessionLease(
                shared.session, path, shared.rtt_s, user,
                identity=user, looking=shared.looking, followed=shared.followed,
            )  # fmt: skip
    except BaseException:
        _leave(path)
        raise


def user_at(path: str) -> str:
    """Return under which name a configuration has changes sent: its own, or that of its certificate, else that of who
    runs this program.
    """
    certified = said_of(path).get("user")  # a certificate says it to Zenoh alone
    return user_of(from_file(path)) or (certified if isinstance(certified, str) else "") or user_name(os.getuid())


def _shown(path: Path) -> tuple[bytes | None, str]:
    """Return what tells the robot's own user from a group that shares its socket (None where none does), and the
    identity of this user there.
    """
    name = user_name(os.getuid())
    for file, identity in ((Beside.OWN.of(path), local_identity(name)), (Beside.GROUP.of(path), group_identity(name))):
        with suppress(FileNotFoundError, PermissionError):  # its helper process may end meanwhile
            return file.read_bytes(), identity
    return None, local_identity(name)


def give_back(borrowed: SessionLease) -> None:
    """Close a session, if nobody else uses it; takes up to 2.5 s if the other side is frozen."""
    if borrowed.config:
        _leave(borrowed.config)
    else:
        close(borrowed.session)


def _leave(path: str) -> None:
    with _guard:
        shared = _shared[path]
        shared.users -= 1
        if shared.users:
            return
        del _shared[path]
    with shared.lock:
        if shared.session is not None:
            close(shared.session)


@contextmanager
def borrowed(socket_path: str, config: str, reach_s: float = REACH_S) -> Iterator[SessionLease]:
    """Borrow a session for a moment. Raises ConnectionLostError."""
    mine = borrow(socket_path, config, reach_s)
    try:
        yield mine
    finally:
        give_back(mine)

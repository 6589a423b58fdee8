"""Opening Zenoh sessions: what a helper process listens on, how a client connects. Nothing else configures Zenoh
but the bridge to ROS 2, which joins the network of another program (`silo.bridges.ros2.graph`).

Without a configuration file there is no network: one Unix socket per logger in a folder that only its user may enter.
The default `zenoh.Config()` listens on all interfaces and scouts by multicast; it is never used as it stands.
"""

import contextlib
import enum
import fcntl
import json
import logging
import os
import socket
import time
from pathlib import Path
from typing import Any

import zenoh

from silo.core.runtime import closing_file, is_at, write_private
from silo.errors import ConnectionLostError, reason
from silo.net.access.probing import Reached, explain
from silo.net.configuration import (
    FORCED,
    LINK,
    PATHS,
    SLOW_ACCEPT,
    find_file,
    from_file,
    insert,
    listened,
    reason_of,
    scaled,
    written,
)
from silo.net.found import LoggerAddress
from silo.net.keys import Root
from silo.net.lingering import descriptors, releasing

SOCKET_SUFFIX = ".sock"
MAX_SOCKET_PATH = 107  # bytes; the kernel's limit is 108 with the closing NUL
MAX_MESSAGE_BYTES = 8 * 2**20  # about 60,000 edits; a larger message is dropped before it is put together
OPEN_TRIES = 5
AGAIN_S = 0.05  # between two tries of a client

_opened_in = [0]  # the process that has opened a session

log = logging.getLogger("silo.client")


# µs, in a client: as long as the lease. A request of 8 MB takes more than the queue holds, and where the robot's
# processors were busy for 0.2 s the connection was closed in the midst of it.
_CLIENT_WAIT: dict[str, Any] = {
    "transport": {"link": {"tx": {"queue": {"congestion_control": {"block": {"wait_before_close": 2_000_000}}}}}}
}


def opened(settings: zenoh.Config) -> zenoh.Session:
    """Open a session; the one place that does so. Raises ZError, ConnectionLostError as `check_unforked` does."""
    check_unforked()
    _opened_in[0] = os.getpid()
    return zenoh.open(settings)


def check_unforked() -> None:
    """Raise ConnectionLostError in a process that was forked from one that had opened a session by then.

    None of Zenoh's threads are in it: whatever is asked there waits for ever, and a session that is opened there
    takes the news of its parent's, which hears nothing from then on.
    """
    if _opened_in[0] not in (0, os.getpid()):
        raise ConnectionLostError(
            f"process {os.getpid()} was forked from process {_opened_in[0]}, which had connected to a logger, and "
            "no connection works in such a child: start it by multiprocessing.get_context('spawn'), or fork before the "
            "first silo.connect(); nothing was asked"
        )


def socket_path(folder: Path, logger: str, pid: int, copy: int = 0) -> Path:
    """Return where logger `logger` of process `pid` listens; `copy` tells loggers of one name in one process apart.

    Raises ConnectionLostError for a path that is too long for a socket.
    """
    path = folder / f"{logger}.{pid}{f'-{copy}' if copy else ''}{SOCKET_SUFFIX}"
    if len(os.fsencode(path)) > MAX_SOCKET_PATH:
        raise ConnectionLostError(
            f"{path}: {len(os.fsencode(path))} bytes are too long for a socket (at most {MAX_SOCKET_PATH}); "
            "shorten the logger's name or set SILO_RUNTIME_DIR to a shorter path"
        )
    return path


def owner_is_gone(path: Path) -> bool:
    """Return whether the process that listened on a socket has ended; while it listens, Zenoh locks `<socket>.lock`."""
    try:
        descriptor = os.open(f"{path}.lock", os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
    except FileNotFoundError:
        return not path.exists()
    except OSError:
        return False
    with closing_file(descriptor), contextlib.suppress(BlockingIOError):
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return True
    return False


class Beside(str, enum.Enum):
    """What may lie beside a socket, by its ending."""

    LOCK = ".lock"  # of Zenoh, while somebody listens
    DEAD = ".dead"  # the robot program is dead: only its helper still answers
    SECRET = ".secret"  # `user:password` for local clients of a logger that asks remote ones for a password
    USERS = ".users"  # and passwords, of remote ones too
    OWN = ".own"  # what the robot's own user shows with its changes, where a group shares the socket
    GROUP = ".group"  # what members of the group show with theirs
    KEY = ".key"  # where the logger's keys begin: its host, the id that it drew, its name

    def of(self, socket: Path) -> Path:
        """Return where it lies."""
        return Path(f"{socket}{self.value}")


def sweep(folder: Path) -> list[Path]:
    """Remove the sockets of processes that ended, and what belongs to them, from a folder of this user.

    Returns the sockets. What this takes from a process that starts just now, `open_server` makes again.
    """
    ends = [f"{SOCKET_SUFFIX}{end}" for end in ("", *(one.value for one in Beside))]
    names = {path.name.removesuffix(end) for path in folder.iterdir() for end in ends if path.name.endswith(end)}
    return [path for name in sorted(names) if _removed_if_dead(path := folder / f"{name}{SOCKET_SUFFIX}")]


def _removed_if_dead(path: Path) -> bool:
    lock = Beside.LOCK.of(path)
    try:
        descriptor = os.open(lock, os.O_RDONLY | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
    except OSError:
        return False
    with closing_file(descriptor), contextlib.suppress(BlockingIOError):
        # held while the files go: a process that starts meanwhile is refused the lock, and tries again
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if is_at(descriptor, lock):
            lives = _listens(path)  # it lost its lock
            for one in [lock] if lives else [path, *(each.of(path) for each in reversed(Beside))]:  # the lock last
                one.unlink(missing_ok=True)
            return not lives
    return False


def _listens(path: Path) -> bool:
    """Whether somebody listens on a socket that lost its lock; True where that can't be told."""
    with socket.socket(socket.AF_UNIX) as client:
        client.setblocking(False)
        try:
            client.connect(str(path))
        except (ConnectionRefusedError, FileNotFoundError):
            return False
        except OSError:
            return True
    return True


def open_server(
    folder: Path, logger: str, pid: int, config: str | None = None, root: Root | None = None, *, grouped: bool = False
) -> tuple[zenoh.Session, Path]:
    """Return a session that listens on a Unix socket in `folder`, and on what the file `config` adds to it.

    `root` is left beside the socket, so that who finds it knows the keys; where a group shares it, also by what the
    robot's own user is told from its members.

    Raises ConnectionLostError with the reason. A client that sweeps at this very moment holds the lock for some
    microseconds, or takes away what was just made: hence several tries.
    """
    from silo.net.knocking import Door  # clients don't load it

    sweep(folder)
    error: Exception | None = None
    for attempt in range(OPEN_TRIES):
        copy = 0
        path = socket_path(folder, logger, pid)
        while path.exists() and not owner_is_gone(path):
            copy += 1
            path = socket_path(folder, logger, pid, copy)
        _removed_if_dead(path)
        settings = _server_config(path, config)
        old_mask = os.umask(0o077)
        try:
            if root is not None:
                Beside.KEY.of(path).write_text(str(root))
            if grouped:
                for file in (Beside.OWN.of(path), Beside.GROUP.of(path)):
                    write_private(file, os.urandom(16).hex())
            session = opened(settings)
            if config is not None:
                releasing.begin(session, Door(session))
            if _is_whole(path, settings, root, grouped=grouped):
                return session, path
            close(session)
        except zenoh.ZError as failure:
            error = failure
            time.sleep(0.02 * (attempt + 1))
        finally:
            os.umask(old_mask)
    raise ConnectionLostError(_why_not_listening(path, config, reason_of(error)))


def _why_not_listening(path: Path, config: str | None, reason: str) -> str:
    if config is not None and "Address already in use" in reason:
        endpoints = ", ".join(listened(from_file(config)))
        return (
            f"can't listen on {endpoints}: another program has that port, or another logger that is served by the same "
            f"{config}: give each a port (`silo remote init --port`), or let all of them connect to one `silo router`"
        )
    return f"can't listen on {path}: {reason}{_hint(config)}"


def _is_whole(path: Path, settings: zenoh.Config, root: Root | None, *, grouped: bool) -> bool:
    """Whether a server's files are there, and locked by this process; a sweep beside its start may have taken some.

    Zenoh may have locked a file that a sweep had just removed: the one that lies there is the next sweep's then, which
    takes the socket away as soon as it goes on.
    """
    passwords = json.loads(settings.get_json("transport/auth/usrpwd/dictionary_file"))
    needed = [path, Beside.LOCK.of(path), *([Beside.SECRET.of(path), Beside.USERS.of(path)] if passwords else [])]
    needed += [Beside.KEY.of(path)] if root is not None else []
    needed += [Beside.OWN.of(path), Beside.GROUP.of(path)] if grouped else []
    return all(file.exists() for file in needed) and _has_open(Beside.LOCK.of(path)) and not owner_is_gone(path)


def _has_open(path: Path) -> bool:
    for descriptor in descriptors():
        with contextlib.suppress(OSError):  # closed meanwhile
            if is_at(descriptor, path):
                return True
    return False


def _server_config(path: Path, config: str | None) -> zenoh.Config:
    from silo.net.access.admission import hold_directions, let_local_in  # clients don't load it

    settings = zenoh.Config() if config is None else from_file(config)
    endpoints = [f"unixsock-stream/{path}"]
    if config is None:
        let_local_in(settings, "")
        insert(settings, LINK)
    else:
        given = written(config)
        endpoints += listened(settings)
        hold_directions(settings)
        let_local_in(settings, config)
        insert(settings, LINK, given)
        insert(settings, SLOW_ACCEPT, given)
    settings.insert_json5("mode", '"peer"')
    insert(settings, FORCED)
    settings.insert_json5("transport/link/rx/max_message_size", str(MAX_MESSAGE_BYTES))
    settings.insert_json5("listen/endpoints", json.dumps(endpoints))
    _let_local_clients_in(settings, path)
    return settings


def _let_local_clients_in(settings: zenoh.Config, path: Path) -> None:
    """Zenoh asks on the Unix socket for passwords too: who may read the folder finds one there, as user `local`."""
    users = json.loads(settings.get_json("transport/auth/usrpwd/dictionary_file"))
    if not users and not json.loads(settings.get_json("transport/auth/usrpwd/user")):
        return  # else it asks for one, too: who connects to a router with a password wants one of everybody
    try:
        lines = Path(users).read_text().rstrip("\n") + "\n" if users else ""
    except OSError as error:
        raise ConnectionLostError(f"{users}: can't read the users and passwords: {reason(error)}") from error
    secret = f"local:{os.urandom(16).hex()}\n"
    for file, text in ((Beside.USERS.of(path), f"{lines}{secret}"), (Beside.SECRET.of(path), secret)):
        write_private(file, text)
    settings.insert_json5("transport/auth/usrpwd/dictionary_file", json.dumps(str(Beside.USERS.of(path))))


def open_router(config: str) -> tuple[zenoh.Session, list[str]]:
    """Return a session in router mode by the file `config`, and what it listens on. Raises ConnectionLostError.

    Where it lets in whoever comes, it lets nobody change anything; `router_admission` has the words for that.
    """
    from silo.net.access.admission import hold_directions, keep_changes_out, router_admission
    from silo.net.knocking import Door

    settings, given = from_file(config), written(config)
    endpoints = listened(settings)
    if not endpoints:
        raise ConnectionLostError(
            f'{config}: names nothing to listen on; add listen: {{ endpoints: ["tls/0.0.0.0:7447"] }}'
        )
    insert(settings, LINK, given)
    insert(settings, SLOW_ACCEPT, given)
    insert(settings, FORCED)
    hold_directions(settings)
    if not router_admission(settings, endpoints, config).changes:
        keep_changes_out(settings)
    for key, value in {"mode": "router", "listen/endpoints": endpoints, "scouting/delay": 0}.items():
        settings.insert_json5(key, json.dumps(value))
    try:
        session = opened(settings)
    except zenoh.ZError as error:
        raise ConnectionLostError(f"can't listen on {', '.join(endpoints)}: {reason_of(error)}") from error
    releasing.begin(session, Door(session))
    return session, endpoints


def open_client(
    path: Path | None, config: str | None = None, reached: Reached | None = None, *, open_s: float = 0.0
) -> zenoh.Session:
    """Return a session that is connected to one logger by its socket, or to what the file `config` names.

    `reached` is what is known of the way there, `open_s` how long a starved helper process of this computer is waited
    for, at least. Raises ConnectionLostError where nobody listens, with PermissionError's words.
    """
    settings = zenoh.Config() if config is None else from_file(config)
    given = written(config) if config is not None else {}
    insert(settings, {"connect": {"timeout_ms": 0, "exit_on_failure": True}, **LINK}, given)
    if reached is not None:
        insert(settings, scaled(reached.rtt_s) if reached.rtt_s else SLOW_ACCEPT, given)
    insert(settings, FORCED)
    settings.insert_json5("mode", '"client"')
    insert(settings, _CLIENT_WAIT, given)
    if path is not None:
        if not path.exists():
            raise ConnectionLostError(f"{path}: nobody listens there any more")
        if not os.access(path, os.W_OK):
            raise ConnectionLostError(f"{path}: user {os.getuid()} may not write to this socket")
        insert(settings, leading_to(path))
        if open_s * 1000 > LINK["transport"]["unicast"]["open_timeout"]:
            settings.insert_json5("transport/unicast/open_timeout", str(round(open_s * 1000)))
    settings.insert_json5("listen/endpoints", "[]")
    begun_s = time.monotonic()
    until_s = begun_s + open_s
    try:
        while True:
            try:
                session = opened(settings)
                break
            except zenoh.ZError:  # one that is starved may close the link itself, too
                if path is None or not path.exists() or time.monotonic() >= until_s:
                    raise
                time.sleep(AGAIN_S)
    except zenoh.ZError as error:
        if path is not None and config is None:
            # Zenoh's words here are only "unable to connect"
            text = f"{path}: its helper process doesn't answer: it is frozen, overloaded or ending; try again"
            raise ConnectionLostError(text) from error
        if config is not None and reached is not None:
            patience_s = json.loads(settings.get_json("transport/unicast/open_timeout")) / 1000
            silent = time.monotonic() - begun_s >= patience_s  # who refuses does so at once
            raise explain(config, reached, error, patience_s if silent else 0.0) from error
        where = str(path) if path is not None else f"what {config} names"
        raise ConnectionLostError(f"can't connect to {where}: {reason_of(error)}{_hint(config)}") from error
    if config is not None:
        releasing.begin(session)
    return session


def leading_to(socket: Path) -> dict[str, Any]:
    """Return what a client sets for a local socket, with the password where one is asked for."""
    found: dict[str, Any] = {"connect": {"endpoints": [f"unixsock-stream/{socket}"]}}
    with contextlib.suppress(FileNotFoundError):  # none is asked for, or its helper process ends
        user, password = Beside.SECRET.of(socket).read_text().strip().split(":", 1)
        found["transport"] = {"auth": {"usrpwd": {"user": user, "password": password}}}
    return found


def zenoh_settings(found: LoggerAddress) -> dict[str, Any]:
    """Return a configuration of Zenoh by which a program in any language reaches this logger, ready for JSON.

    Raises ConnectionLostError for a remote whose file is gone.
    """
    scouting = FORCED["scouting"]
    if found.config:
        file = find_file(found.config)
        given = written(file)
        absolute = from_file(file)
        for key in PATHS:
            _make_absolute(given, key.split("/"), json.loads(absolute.get_json(key)))
        return {**given, "mode": "client", "scouting": scouting}
    return {"mode": "client", **leading_to(Path(found.socket)), "scouting": scouting}


def _make_absolute(settings: dict[str, Any], names: list[str], path: str | None) -> None:
    """Put a path where the file has one; None where it has none."""
    *above, last = names
    for name in above:
        settings = settings.get(name, {})
    if path:
        settings[last] = path


def forget(path: Path) -> None:
    """Remove what a closed server session leaves beside its socket."""
    for one in Beside:
        if one is not Beside.LOCK:
            one.of(path).unlink(missing_ok=True)


def close(session: zenoh.Session) -> None:
    """Close a session; takes up to 2.5 s if the other side of a Unix socket is frozen."""
    releasing.end(session)
    session.close()  # type: ignore[no-untyped-call]  # zenoh's stub leaves the return type out


def undeclare(*declared: Any) -> None:
    """End subscriptions, publishers and tokens; fine where their session has ended before."""
    for one in declared:
        if one is not None:
            try:
                one.undeclare()
            except zenoh.ZError as error:
                log.debug("the session ended before it: %s", error)


def matching(publisher: zenoh.Publisher) -> bool:
    """Return whether anybody subscribes."""
    status = publisher.matching_status
    # the stub says bool, but it is an object with a flag, and always true
    return bool(getattr(status, "matching", status))


def _hint(config: str | None) -> str:
    if config is None:
        return ""
    return (
        f"; check addresses, user name, password and certificates in {config} "
        "(the other side does not say which of them it refused)"
    )

"""Links to peers that have vanished are closed without a wait: else 13 of them stop a router for everybody.

Zenoh has the kernel wait for 10 s in close() until a peer has taken what was sent to it, and closes in one of the few
threads that move all its messages. Of 30 robots behind a link that had gone down, four were closed every 10 s, and in
between nobody heard of the 28 others. The kernel sends what is left after close() by itself, without a wait, too.

There is no setting for that, so it is turned off at the sockets, soon after they are made and before a session closes.
"""

import logging
import os
import resource
import socket
import stat
import struct
import threading
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Protocol

import zenoh

from silo.core.runtime import closing_file

PERIOD_S = 0.5  # a link that vanishes sooner after it was made has nothing to wait for
DOOR_S = 0.1  # between two looks at a door
_ZENOHS, _OFF = struct.pack("ii", 1, 10), struct.pack("ii", 0, 0)


log = logging.getLogger("silo.helper")

Mark = tuple[int, int]  # a descriptor and its inode: a number is given again


class Entrance(Protocol):
    """Where others come in: `silo.net.knocking.Door`."""

    def look(self, there: set[Mark]) -> None:
        """Shut it while too many wait; `there` are the sockets of this process."""

    def close(self) -> None:
        """Look no more."""


def descriptors() -> Iterable[int]:
    """Return the numbers of open files of this process, or, where there is none left to look with, all that may be."""
    try:
        return [int(path.name) for path in Path("/proc/self/fd").iterdir()]
    except OSError:
        return range(resource.getrlimit(resource.RLIMIT_NOFILE)[0])


def inode_of_socket(descriptor: int) -> int:
    """Return the inode of a socket, 0 for what is none, or was closed meanwhile."""
    with suppress(OSError):
        found = os.fstat(descriptor)
        return found.st_ino if stat.S_ISSOCK(found.st_mode) else 0
    return 0


def sockets() -> set[Mark]:
    """Return the sockets of this process."""
    return {(number, inode) for number in descriptors() if (inode := inode_of_socket(number))}


def release_links(there: set[Mark], known: set[Mark] | None = None) -> set[Mark]:
    """Have links of this process, of all that are there, close without a wait; returns what is to be `known` next."""
    return {one for one in there if (known is not None and one in known) or _release(one[0])}


def _release(descriptor: int) -> bool:
    """Whether it could be looked at."""
    with suppress(OSError), closing_file(os.dup(descriptor)) as copy:  # Zenoh may close its own at any time
        link = socket.socket(fileno=copy)
        try:
            # a program's own links are left as they are
            if link.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, len(_ZENOHS)) == _ZENOHS:
                link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _OFF)
        finally:
            link.detach()
        return True
    return False


class Releasing:
    """A thread that does so while a session over a network is open."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._sessions: dict[int, Entrance | None] = {}
        self._ended = threading.Event()
        self._failed = False

    def begin(self, session: zenoh.Session, door: Entrance | None = None) -> None:
        """A session was opened; where others come in by it, its door is watched."""
        with self._lock:
            self._sessions[id(session)] = door
            if len(self._sessions) == 1:
                self._ended = threading.Event()
                # a daemon: it ends with the process, too
                threading.Thread(target=self._run, args=(self._ended,), name="silo-links", daemon=True).start()

    def end(self, session: zenoh.Session) -> None:
        """A session is about to be closed."""
        with self._lock:
            if id(session) not in self._sessions:
                return
            door = self._sessions.pop(id(session))
            if door is not None:
                door.close()
            if not self._sessions:
                self._ended.set()
        release_links(sockets())

    def _run(self, ended: threading.Event) -> None:
        known: set[Mark] = set()
        while not ended.wait(DOOR_S if any(self._sessions.values()) else PERIOD_S):
            known = self._looked(known)

    def _looked(self, known: set[Mark]) -> set[Mark]:
        try:
            there = sockets()
            known = release_links(there, known)
            with self._lock:
                for door in filter(None, self._sessions.values()):
                    door.look(there)
        except Exception:  # whatever it is, the next look comes
            if not self._failed:
                log.exception("the links of this process can't be looked at now")
            self._failed = True
        return known


releasing = Releasing()

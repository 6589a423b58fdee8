"""Links to peers that have vanished are closed without a wait: else 13 of them stop a router for everybody.

Zenoh has the kernel wait for 10 s in close() until a peer has taken what was sent to it, and closes in one of the few
threads that move all its messages. Of 30 robots behind a link that had gone down, four were closed every 10 s, and in
between nobody heard of the 28 others. The kernel sends what is left after close() by itself, without a wait, too.

There is no setting for that, so it is turned off at the sockets, soon after they are made and before a session closes.
"""

import os
import socket
import stat
import struct
import threading
from contextlib import suppress
from pathlib import Path

PERIOD_S = 0.5  # a link that vanishes sooner after it was made has nothing to wait for
_ZENOHS, _OFF = struct.pack("ii", 1, 10), struct.pack("ii", 0, 0)


def release_links(known: "set[tuple[int, int]] | None" = None) -> set[tuple[int, int]]:
    """Have the links of this process close without a wait; returns the sockets that there are, to be `known` next."""
    seen = set()
    for name in [path.name for path in Path("/proc/self/fd").iterdir()]:
        with suppress(OSError):  # closed meanwhile
            found = os.fstat(int(name))
            if not stat.S_ISSOCK(found.st_mode):
                continue
            mark = (int(name), found.st_ino)
            seen.add(mark)
            if known is None or mark not in known:
                _release(int(name))
    return seen


def _release(descriptor: int) -> None:
    copy = os.dup(descriptor)  # Zenoh may close its own at any time
    try:
        link = socket.socket(fileno=copy)
    except OSError:
        os.close(copy)
        return
    with link:
        # a program's own links are left as they are
        if link.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, len(_ZENOHS)) == _ZENOHS:
            link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _OFF)


class Releasing:
    """A thread that does so while a session over a network is open."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._sessions: set[int] = set()
        self._ended = threading.Event()

    def begin(self, session: object) -> None:
        """A session was opened."""
        with self._lock:
            self._sessions.add(id(session))
            if len(self._sessions) == 1:
                self._ended = threading.Event()
                # a daemon: it calls nothing but the kernel
                threading.Thread(target=self._run, args=(self._ended,), name="silo-links", daemon=True).start()

    def end(self, session: object) -> None:
        """A session is about to be closed."""
        with self._lock:
            if id(session) not in self._sessions:
                return
            self._sessions.discard(id(session))
            if not self._sessions:
                self._ended.set()
        release_links()

    @staticmethod
    def _run(ended: threading.Event) -> None:
        known: set[tuple[int, int]] = set()
        while not ended.wait(PERIOD_S):
            known = release_links(known)


releasing = Releasing()

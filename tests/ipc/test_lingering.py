"""Links are closed without waiting for a peer that has vanished."""

import contextlib
import socket
import struct
import threading

from silo.net.lingering import Releasing, release_links, sockets
from tests.waiting import DEADLINE_S

WAITS = struct.pack("ii", 1, 10)


def waits(link: socket.socket) -> bool:
    return struct.unpack("ii", link.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER, 8))[0] != 0


def test_links_of_this_process_are_closed_without_a_wait_and_go_on() -> None:
    with contextlib.ExitStack() as stack:
        listens = stack.enter_context(socket.create_server(("127.0.0.1", 0)))
        ours = stack.enter_context(socket.create_connection(listens.getsockname()))
        theirs = stack.enter_context(listens.accept()[0])
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, WAITS)
        known = release_links(sockets())
        assert not waits(ours)
        ours.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, WAITS)
        assert release_links(sockets(), known) == known  # one that is known isn't looked at again
        assert waits(ours)
        release_links(sockets())
        ours.sendall(b"the last word")
        ours.close()
        assert theirs.recv(100) == b"the last word"


def test_a_door_that_can_not_be_looked_at_is_told_once_and_looked_at_again(caplog) -> None:
    looks = threading.Semaphore(0)

    class Stuck:
        def look(self, there: set[tuple[int, int]]) -> None:
            looks.release()
            raise OSError("no such link")

        def close(self) -> None:
            pass

    releasing, session = Releasing(), object()
    releasing.begin(session, Stuck())
    for _ in range(3):
        assert looks.acquire(timeout=DEADLINE_S)
    releasing.end(session)
    assert [one.message for one in caplog.records] == ["the links of this process can't be looked at now"]

"""Connections over a network that nobody has let in yet: so many at once, and no more, whoever makes them.

Zenoh takes each one, gives it 10 s to show who it is, and then closes ten in a second: 1500 that said nothing took all
descriptors of a helper process, which could open no file any more. While too many wait, the kernel takes no further
ones: it drops their packets, and clients try again by themselves, as after any loss. Those that are let in are not
concerned.
"""

import contextlib
import ctypes
import ipaddress
import os
import resource
import socket
import struct
import time
from collections.abc import Iterator

import msgspec
import zenoh

from silo.net.lingering import Mark, inode_of_socket

MOST = 1000  # at once; an eighth of all descriptors where that is less
MOST_SILENT = 128  # of these that said nothing so far: each costs Zenoh's door 0.1 s when it ends
BACKLOG = 16  # that the kernel has ready: it is taken nevertheless
SILENT_S = 2.0  # who said nothing until then while too many wait is ended
_BYTES_RECEIVED = 128  # where it stands in what the kernel tells of a connection (tcp_info)
_ATTACH_FILTER, _DETACH_FILTER = 26, 27
_NOTHING = ctypes.create_string_buffer(struct.pack("HBBI", 6, 0, 0, 0))  # a filter of packets: of each, no byte

Address = tuple[str, int]


def raise_descriptors() -> None:
    """Have this process open as many files as the system lets it: a session of Zenoh may get many connections."""
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    with contextlib.suppress(OSError, ValueError):  # a system that says no has others to tell
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


class _Knocking(msgspec.Struct):
    port: int  # which it came to
    address: Address
    since_s: float
    spoke: bool = False
    ended: bool = False


class Door:
    """Of a session that listens, in a process of silo's own. For one thread."""

    def __init__(self, session: zenoh.Session) -> None:
        self.is_shut = False
        self._session = session
        self._known: set[Mark] = set()
        self._listening: dict[Mark, int] = {}  # their ports
        self._waiting: dict[Mark, _Knocking] = {}
        # a socket is looked at by a number that is there already: there may be none left for another one
        self._nothing = os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)
        self._hand = os.dup(self._nothing)

    def close(self) -> None:
        """Close what it looks with."""
        os.close(self._hand)
        os.close(self._nothing)

    def look(self, there: set[Mark]) -> None:
        """Shut it while too many wait that were not let in; `there` are the sockets of this process."""
        for mark in there - self._known:
            with self._held(mark) as link:
                self._note(mark, link)
        self._known = there
        self._listening = {mark: port for mark, port in self._listening.items() if mark in there}
        ports = self._listening.values()
        self._waiting = {mark: one for mark, one in self._waiting.items() if mark in there and one.port in ports}
        most = min(MOST, resource.getrlimit(resource.RLIMIT_NOFILE)[0] // 8)
        if len(self._waiting) > min(most, MOST_SILENT):
            let_in = {_address(link.dst) for link in self._session.info.links()}
            self._waiting = {mark: one for mark, one in self._waiting.items() if one.address not in let_in}
            self._listen_to_them()
        self._shut(len(self._waiting) > most or sum(not one.spoke for one in self._waiting.values()) > MOST_SILENT)

    def _note(self, mark: Mark, link: socket.socket | None) -> None:
        if link is None or link.family not in (socket.AF_INET, socket.AF_INET6) or link.type != socket.SOCK_STREAM:
            return
        port = link.getsockname()[1]
        if link.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
            self._listening[mark] = port
            link.listen(BACKLOG)
            _take_no_more(link, self.is_shut)
            return
        address = ("", 0)
        with contextlib.suppress(OSError):  # it has ended, and stays until Zenoh closes it
            address = _plain(*link.getpeername()[:2])
        self._waiting[mark] = _Knocking(port, address, time.monotonic())

    def _shut(self, shut: bool) -> None:
        if shut == self.is_shut:
            return
        self.is_shut = shut
        for mark in self._listening:
            with self._held(mark) as link:
                if link is not None:
                    _take_no_more(link, shut)

    def _listen_to_them(self) -> None:
        """Find out who said something, and end those who had time for it."""
        before_s = time.monotonic() - SILENT_S
        for mark, one in self._waiting.items():
            if one.spoke or one.ended:
                continue
            with self._held(mark) as link, contextlib.suppress(OSError, struct.error):
                one.spoke = link is not None and not _is_silent(link)
                if link is not None and not one.spoke and one.since_s <= before_s:
                    one.ended = True
                    link.shutdown(socket.SHUT_RDWR)  # Zenoh sees its end, and closes it

    @contextlib.contextmanager
    def _held(self, mark: Mark) -> Iterator[socket.socket | None]:
        """Hold a socket while it is looked at, None for one that Zenoh closed."""
        number, inode = mark
        link = None
        try:
            with contextlib.suppress(OSError):
                os.dup2(number, self._hand, inheritable=False)
                if inode_of_socket(self._hand) == inode:
                    link = socket.socket(fileno=self._hand)
            yield link
        finally:
            if link is not None:
                link.detach()
            os.dup2(self._nothing, self._hand, inheritable=False)


def _take_no_more(listening: socket.socket, shut: bool) -> None:
    with contextlib.suppress(OSError):  # there is none to take off, or it is a kernel without filters
        if shut:
            program = struct.pack("HP", 1, ctypes.addressof(_NOTHING))
            listening.setsockopt(socket.SOL_SOCKET, _ATTACH_FILTER, program)
        else:
            listening.setsockopt(socket.SOL_SOCKET, _DETACH_FILTER, 0)


def _is_silent(link: socket.socket) -> bool:
    told = link.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 256)
    return bool(struct.unpack_from("Q", told, _BYTES_RECEIVED)[0] == 0)


def _address(locator: str) -> Address:
    """The address in `tls/[::1]:7447`."""
    host, _, port = locator.partition("/")[2].partition("?")[0].partition("#")[0].rpartition(":")
    return _plain(host, int(port)) if port.isdecimal() else ("", 0)


def _plain(host: str, port: int) -> Address:
    with contextlib.suppress(ValueError):
        address = ipaddress.ip_address(host.strip("[]").partition("%")[0])
        mapped = address.ipv4_mapped if isinstance(address, ipaddress.IPv6Address) else None
        return str(mapped or address), port
    return host, port

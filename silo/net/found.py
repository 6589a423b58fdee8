"""A logger that was found, and the words for it: `anymal`, `anymal.4711`, `robot3/anymal`, `robot3~3fa977b2e0/anymal`.

The first two may fit several loggers, the third two robots of one cloned image; the last fits one. As URLs:
`silo://robot3/anymal/log/joints/q` is one element of one logger, wherever it is asked for; without a host
(`silo:///anymal/log/joints/q`) the name alone decides, as everywhere.
"""

import re
from collections.abc import Iterable
from fnmatch import fnmatchcase
from typing import NamedTuple

import msgspec

from silo.errors import ConnectionLostError
from silo.net.keys import Root

# a host, perhaps with the id that a logger has drawn, and a logger, perhaps with a process id
ADDRESS = re.compile(r"(?:[A-Za-z0-9][A-Za-z0-9_.-]*(?:~[0-9a-f]+)?/)?[A-Za-z0-9][A-Za-z0-9_.-]*")
SCHEME = "silo://"


class LoggerAddress(msgspec.Struct, frozen=True):
    """A logger that listens. `pid` is the robot program's; `socket` is empty for one that is reached by `config`."""

    name: str
    pid: int
    socket: str
    user: str
    config: str = ""
    host: str = ""
    dead: bool = False  # the robot program is gone, its helper still tells what became of the data
    since: float = 0.0  # when it began to listen, or died; seconds since 1970
    id: str = ""  # drawn by the logger; empty where it isn't known yet
    copy: int = 0  # tells loggers of one name in one process apart

    @classmethod
    def behind(cls, config: str, root: Root) -> "LoggerAddress":
        """Return a logger that a configuration reaches."""
        return cls(root.logger, 0, "", "", config, root.host, id=root.id)

    @property
    def label(self) -> str:
        """What means this logger among those of its host: `anymal.4711`; of another host, its whole address."""
        if self.pid:
            return f"{self.name}.{self.pid}{f'-{self.copy}' if self.copy else ''}"
        return self.root.address if self.root is not None and self.config else self.name

    @property
    def root(self) -> Root | None:
        """Where its keys begin; None where that must be asked for."""
        return Root(self.host, self.name, self.id) if self.host else None

    @property
    def key(self) -> str:
        """What tells it from all others."""
        return self.socket or str(self.root or self.label)

    @property
    def machine(self) -> str:
        """The part of the id that is of the computer: what starts there again may be the same robot."""
        return self.id[:MACHINE_DIGITS]

    @property
    def addresses(self) -> tuple[str, ...]:
        """Return every word that means this logger, the shortest first; of these the last means no other."""
        mine = [self.name, *([self.label] if self.pid else [])]
        if self.host:
            mine += [f"{self.host}/{name}" for name in mine]
        if self.root is not None and self.id:
            mine.append(self.root.address)
        return tuple(mine)

    def follows(self, other: "LoggerAddress") -> bool:
        """Return whether this may be the same robot, started again."""
        if self.socket or other.socket:
            return bool(self.socket and other.socket) and (self.name, self.user) == (other.name, other.user)
        return (self.name, self.host, self.machine) == (other.name, other.host, other.machine)

    def is_meant_by(self, wanted: str) -> bool:
        """Return whether a word that somebody typed fits this logger; an empty one fits all."""
        return not wanted or wanted in self.addresses

    def matches(self, pattern: str) -> bool:
        """Return whether a glob, a name or an address means it, where many may be meant; an empty one means all."""
        return self.is_meant_by(pattern) or any(fnmatchcase(address, pattern) for address in self.addresses)


MACHINE_DIGITS = 4


def told_apart(found: Iterable[LoggerAddress]) -> list[str]:
    """Return for each logger the shortest address that fits no other of them: a process id before an id."""
    all_found = list(found)
    taken = [set(one.addresses) for one in all_found]

    def of(place: int) -> str:
        one = all_found[place]
        others = set().union(*(names for at, names in enumerate(taken) if at != place))
        # the bare name last of all: who reads a list of addresses wants to see what differs
        mine = [address for address in one.addresses if address != one.name]
        here = [one.label] if one.pid else []
        return next((address for address in (*here, *mine, one.name) if address not in others), one.label)

    return [of(place) for place in range(len(all_found))]


class Address(NamedTuple):
    """What a URL names: a logger (`robot3/anymal`), and an element of it, empty for none."""

    logger: str
    element: str = ""


def is_url(text: str) -> bool:
    """Return whether this is meant as a URL of ours."""
    return text.startswith(SCHEME)


def parse_url(text: str) -> Address:
    """Return what a URL names; its element has a leading slash.

    Raises ConnectionLostError for one that names no logger.
    """
    host, _, path = text.removeprefix(SCHEME).partition("/")
    name, _, element = path.partition("/")
    logger = f"{host}/{name}" if host else name
    if not is_url(text) or not ADDRESS.fullmatch(logger):
        raise ConnectionLostError(
            f"{text}: is no address of a logger: write {SCHEME}HOST/LOGGER or {SCHEME}HOST/LOGGER/ELEMENT, "
            f"like {SCHEME}robot3/anymal/log/joints/q ({SCHEME}/anymal/... without a host); nothing was asked"
        )
    return Address(logger, f"/{element}" if element else "")


def logger_of(text: str) -> str:
    """Return the logger that a word means, a URL or an address.

    Raises ConnectionLostError for a URL that names an element: the whole logger would be more than it says.
    """
    if not is_url(text):
        return text
    address = parse_url(text)
    if address.element:
        raise ConnectionLostError(
            f"{text}: names an element, and this is for a whole logger: {SCHEME}{address.logger}; nothing was asked"
        )
    return address.logger


def url_of(address: str, element: str = "") -> str:
    """Return the URL of a logger's address (`robot3/anymal`, `anymal`), or of one of its elements."""
    logger = address if "/" in address else f"/{address}"
    return f"{SCHEME}{logger}{'/' if element else ''}{element.strip('/')}"

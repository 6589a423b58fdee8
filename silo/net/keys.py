"""The keys under which a logger is reached: all begin with `silo/<host>~<id>/<logger>`.

The id is drawn by the logger and outlives its helper processes: two robots of one host name have keys of their own.

ask              queries that read
do/<user>        queries that change something, by users of a network: rules admit each to its own key
do/@local        the same by the logger's Unix socket (no wildcard of a rule fits a part that begins with `@`)
event            events
summary          the logger in short
alive            liveliness token of the helper process
client/<id>      liveliness token of a client; its views are called `<id>-<number>`, see `ClientId`
view/<id>        frames of a view
stream/<id>      raw rows of a stream, its id as that of a view
topic/<element>  samples of a published element
"""

import os
import re
from typing import NamedTuple
from urllib.parse import unquote

from silo.rpc.refusals import RefusedWhy, RequestRefusedError

# Zenoh reserves these, a leading `@` hides a key from wildcards, and `%` is our own escape
_RESERVED = re.compile(r"[%*$?#@\x00-\x20\x7f]")
VIEW_ID = re.compile(r"[A-Za-z0-9]{1,32}-[0-9]{1,9}")

ANY_ALIVE = "silo/*/*/alive"
ANY_DO = "silo/*/*/do/*"
LOCAL_SENDER = "@local"  # in place of a user, by the Unix socket
ANY_SUMMARY = "silo/*/*/summary"
LONGEST_HOST, LONGEST_LOGGER = 64, 40  # letters: those of Linux, and those that a logger takes
_DRAWN = re.compile(r"[0-9a-f]{0,32}")


class Root(NamedTuple):
    """Whose keys these are. `id` is empty for those of a silo before 0.2."""

    host: str
    logger: str
    id: str = ""

    def __str__(self) -> str:
        host = escape(self.host).replace("~", "%7E")
        return f"silo/{host}{'~' if self.id else ''}{self.id}/{escape(self.logger)}"

    @property
    def address(self) -> str:
        """What to type that means this logger and no other: `robot3~3fa977b2e0/anymal`."""
        return f"{self.host}{'~' if self.id else ''}{self.id}/{self.logger}"

    def key(self, *parts: str) -> str:
        """Return a key of this logger: `root.key("view", "x1-2")`."""
        return "/".join((str(self), *parts))

    def do(self, user: str) -> str:
        """Return where a user's changes go: `LOCAL_SENDER`, or a name that is escaped."""
        return self.key("do", user if user == LOCAL_SENDER else user_part(user))

    def topic(self, element: str) -> str:
        """Return where the samples of an element are published."""
        return f"{self}/topic/{escape(element.strip('/'))}"


def host_part(host: str) -> str:
    """Return the part of a key that fits the loggers of a host, whatever ids they drew; all hosts for `*`."""
    return host if host == "*" else f"{host}~$*"


def escape(name: str) -> str:
    """Return a name as part of a key; slashes stay, reserved characters become `%XX`, empty chunks `%`."""
    escaped = _RESERVED.sub(lambda found: f"%{ord(found[0]):02X}", name)
    return "/".join(chunk or "%" for chunk in escaped.split("/"))


def unescape(key: str) -> str:
    """Return the name that `escape` made this of."""
    return "/".join("" if chunk == "%" else unquote(chunk) for chunk in key.split("/"))


def user_part(user: str) -> str:
    """Return a user's name as the last part of a key; without slashes, as it is one part."""
    return escape(user).replace("/", "%2F")


def root_of(key: str) -> Root:
    """Return the logger that a key belongs to. Raises ValueError for a key that isn't silo's."""
    chunks = key.split("/", 3)
    if len(chunks) < 3 or chunks[0] != "silo":
        raise ValueError(f"{key!r} is not a key of silo")
    host, _, drawn = chunks[1].partition("~")
    return Root(unescape(host), unescape(chunks[2]), drawn)


def robot_of(key: str) -> Root | None:
    """Return the logger whose liveliness token or summary this is; None for a key that no robot of ours has.

    Whoever may offer a key writes into the lists of all desks: control characters would garble their terminals.
    """
    root = root_of(key)
    fits = 0 < len(root.host) <= LONGEST_HOST and 0 < len(root.logger) <= LONGEST_LOGGER
    words = root.host + root.logger
    return root if fits and words.isprintable() and _DRAWN.fullmatch(root.id) else None


class ClientId(NamedTuple):
    """The id of a client, which everybody sees, and what proves that it is its own, which nobody else is told.

    Nobody else can open, replace or close what is called after it.
    """

    id: str
    proof: str

    @classmethod
    def drawn(cls) -> "ClientId":
        """Return a new one."""
        proof = os.urandom(16).hex()
        return cls(_proven(proof), proof)


def _proven(proof: str) -> str:
    import hashlib  # loads OpenSSL: 3 ms that only who shares a socket needs

    return "z" + hashlib.sha256(proof.encode("utf-8", "replace")).hexdigest()[:24]


_PROVEN = re.compile(r"z[0-9a-f]{24}")


def may_use(client: str, proof: str) -> bool:
    """Return whether who shows this may use what is called after a client; ids of other kinds prove nothing."""
    return _PROVEN.fullmatch(client) is None or client == _proven(proof)


def check_own(kind: str, name: str, proof: str) -> None:
    """Raise RequestRefusedError where a view, a stream or a pin of this name isn't that of who shows this."""
    if not may_use(client_of_view(name), proof):
        text = f"the {kind} '{name[:50]}' is another client's; nothing was changed"
        raise RequestRefusedError(RefusedWhy.FORBIDDEN, text)


def client_of_view(view: str) -> str:
    """Return the id of the client that made a view id."""
    return view.rsplit("-", 1)[0]

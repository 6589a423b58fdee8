"""Who sends a change, by the key it comes under and by what it shows: a sender with words for it; others are refused.

Keys with wildcards are refused: who means one robot never reaches another.
"""

from pathlib import Path

import zenoh

from silo.net import keys
from silo.net.access import senders
from silo.net.access.admission import NO_NETWORK, Admission, admission_of, direction_words, hold_directions
from silo.net.configuration import from_file
from silo.net.keys import Root
from silo.net.session import Beside
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.rpc.serving import Sender

REFUSED = "refused"


class Authentication:
    """Knows who may come in."""

    def __init__(self, root: Root, admission: Admission = NO_NETWORK) -> None:
        self._root = root
        self.admission = admission
        self._network = False
        self.old_rules = ""  # what is to be said of rules that an older silo made
        self._own = self._groups = b""
        self._group, self._group_may_change = "", True

    @classmethod
    def of(cls, root: Root, config: str | None) -> "Authentication":
        """Return who may come in to a logger that is served by a configuration; for None, by its Unix socket alone."""
        if config is None:
            return cls(root)
        settings = from_file(config)
        authentication = cls(root, admission_of(settings, config))
        authentication._network = authentication.admission != NO_NETWORK
        old = hold_directions(settings)
        authentication.old_rules = direction_words(config, old) if old else ""
        return authentication

    def share(self, path: Path, group: str, *, may_change: bool) -> None:
        """Let members of a group come by the Unix socket: they show another word than the robot's own user."""
        self._own, self._groups = Beside.OWN.of(path).read_bytes(), Beside.GROUP.of(path).read_bytes()
        self._group, self._group_may_change = group, may_change

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys under which changes are taken, or refused in words."""
        network: tuple[str, ...] = (self._root.key("do", "*"),) if self.admission.changes else ()
        if self._network:
            network += (self._root.key(REFUSED, "*"),)
        # clients of protocol 1 send to the last: they are told so, and nothing is done for them
        return (self._root.do(keys.LOCAL_SENDER), *network, self._root.key("do"))

    @property
    def closed(self) -> str:
        """What clients of a network are told where no changes are taken from it; empty where they are."""
        why = self.admission.why_now
        return senders.closed_words(self._root.address, why) if why else ""

    def refuses(self, key: str) -> bool:
        """Return whether this is a key of those whom rules keep from changing anything."""
        return not any(sign in key for sign in "*$") and key.startswith(self._root.key(REFUSED, ""))

    def sender(self, key: str, attachment: bytes, client: str) -> Sender:
        """Return who sent a request under a key; `client` is what it says of itself. Raises RequestRefusedError.

        Under `refused/<user>` come those whom rules keep from changing anything: to be told so.
        """
        if self.refuses(key):
            name = keys.unescape(key.removeprefix(self._root.key(REFUSED, "")))
            text = self.closed or senders.viewer_words(name, self._root.address)
            raise RequestRefusedError(RefusedWhy.FORBIDDEN, text)
        begin = self._root.key("do", "")
        user = key.removeprefix(begin)
        if not key.startswith(begin) or not user or any(sign in user for sign in "*$/"):
            text = f"a change must name the one logger that is meant and its sender, got '{key}'; nothing was changed"
            raise RequestRefusedError(RefusedWhy.INVALID, text)
        if user != keys.LOCAL_SENDER:
            if closed := self.closed:
                raise RequestRefusedError(RefusedWhy.FORBIDDEN, closed)
            name = keys.unescape(user)
            return Sender(name, senders.network_words(name, client, proven=self.admission.proven))
        return self._local(attachment, client)

    def name_of(self, key: str, client: str) -> str:
        """Return who asks under a key, in words, whether or not it is let in."""
        user = key.rsplit("/", 1)[-1]
        if user == keys.LOCAL_SENDER or "*" in key:
            return senders.group_words(self._group, client) if self._group else senders.bracketed(client)
        return senders.network_words(keys.unescape(user), client, proven=self.admission.proven)

    def _local(self, attachment: bytes, client: str) -> Sender:
        claim = senders.claim_of(client)
        if not self._group or attachment == self._own:
            return Sender(senders.local_identity(claim.user), senders.bracketed(client))
        if attachment != self._groups:
            text = "it comes neither from the robot's user nor from the group that shares its socket"
            raise RequestRefusedError(RefusedWhy.FORBIDDEN, f"{text}; nothing was changed")
        if not self._group_may_change:
            raise RequestRefusedError(RefusedWhy.FORBIDDEN, senders.group_viewer_words(self._group, self._root.logger))
        return Sender(senders.group_identity(claim.user), senders.group_words(self._group, client))


def attachment_of(query: zenoh.Query) -> bytes:
    """Return what a request shows beside its words."""
    return query.attachment.to_bytes() if query.attachment is not None else b""

"""Finding the loggers of this computer, or those that a configuration reaches, and connecting to them.

Zenoh is loaded when the first look around is made, in a thread.
"""

from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from silo.ipc import found
    from silo.ipc.client import Client

LOOK_TIMEOUT_S = 1.0


@dataclass(frozen=True)
class FoundLogger:
    """A logger that answers on this computer."""

    name: str
    pid: int
    user: str
    key: str  # tells loggers apart, also two of one name
    dead: bool = False  # the robot program is gone, its helper still answers
    host: str = ""  # where it runs, as far as that is known
    addresses: tuple[str, ...] = ()  # all words that mean it
    alike: bool = False  # another one that was found has its name, on a computer of the same name

    @property
    def where(self) -> str:
        """Whom it belongs to: a process and its user on this computer, the address elsewhere."""
        return f"pid {self.pid}  {self.user}" if self.pid else self.addresses[-1] if self.addresses else self.host

    def is_meant_by(self, wanted: str) -> bool:
        """Return whether a name or an address, or nothing, means it."""
        return not wanted or wanted in {self.name, f"{self.name}.{self.pid}", *self.addresses}


@dataclass(frozen=True)
class Found:
    """What a look around gave; `advice` has a sentence per logger that we may not talk to."""

    loggers: tuple[FoundLogger, ...]
    advice: tuple[str, ...] = ()


class ClientFinder:
    """Finds loggers and connects to them. Calls block and are made in a thread."""

    def __init__(self, config: str = "", *, read_only: bool = False) -> None:
        self._config, self._read_only = config, read_only
        self._seen: dict[str, found.Found] = {}
        self._own_name = ""
        self._held = ExitStack()  # the sessions of the look before, so that the next is quick

    @property
    def own_name(self) -> str:
        """How events speak of us; empty before the first look."""
        return self._own_name

    def find(self) -> Found:
        """Return the loggers that run now, and advice for those that are closed to us."""
        from silo.ipc.discovery import discover, down_text
        from silo.ipc.exchange import client_name

        self._own_name = client_name()
        held = ExitStack()
        try:
            there = discover(LOOK_TIMEOUT_S, self._config, held)
        finally:
            self._held.close()
            self._held = held
        loggers = []
        for each in there.loggers:
            key = each.socket or str(each.root)
            self._seen[key] = each
            alike = sum((one.host, one.name) == (each.host, each.name) for one in there.loggers) > 1
            user = each.user or each.host
            loggers.append(FoundLogger(each.name, each.pid, user, key, each.dead, each.host, each.addresses, alike))
        advice = [
            f"{folder.owner} runs {', '.join(folder.loggers) or 'a logger'}, closed to you: {folder.advice}"
            for folder in there.forbidden
        ] + [down_text(each) for each in there.down]
        advice += [f"remote '{remote}': {why}" for remote, why in there.unreachable.items()]
        return Found(tuple(loggers), tuple(advice))

    def close(self) -> None:
        """Close the sessions to remotes."""
        self._held.close()

    def connect(self, logger: FoundLogger) -> "Client":
        """Connect to a logger that was found. ConnectionLostError says what to do when it doesn't answer."""
        from silo.ipc.client import Client

        return Client.connect(self._seen[logger.key], read_only=self._read_only)

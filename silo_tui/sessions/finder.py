"""Finding the loggers of this computer, or those that a configuration reaches, and connecting to them.

Zenoh is loaded when the first look around is made, in a thread.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from silo.ipc import discovery
    from silo.ipc.client import Client

LOOK_TIMEOUT_S = 1.0


@dataclass(frozen=True)
class FoundLogger:
    """A logger that answers on this computer."""

    name: str
    pid: int
    user: str
    key: str  # tells loggers apart, also two of one name


@dataclass(frozen=True)
class Found:
    """What a look around gave; `advice` has a sentence per logger that we may not talk to."""

    loggers: tuple[FoundLogger, ...]
    advice: tuple[str, ...] = ()


class ClientFinder:
    """Finds loggers and connects to them. Calls block and are made in a thread."""

    def __init__(self, config: str = "") -> None:
        self._config = config
        self._seen: dict[str, discovery.Found] = {}
        self._own_name = ""

    @property
    def own_name(self) -> str:
        """How events speak of us; empty before the first look."""
        return self._own_name

    def find(self) -> Found:
        """Return the loggers that run now, and advice for those that are closed to us."""
        from silo.ipc.discovery import discover
        from silo.ipc.exchange import client_name

        self._own_name = client_name()
        found = discover(LOOK_TIMEOUT_S, self._config)
        loggers = []
        for each in found.loggers:
            key = each.socket or f"{each.host}/{each.name}"
            self._seen[key] = each
            loggers.append(FoundLogger(each.name, each.pid, each.user or each.host, key))
        advice = [
            f"{folder.owner} runs {', '.join(folder.loggers) or 'a logger'}, closed to you: {folder.advice}"
            for folder in found.forbidden
        ]
        return Found(tuple(loggers), tuple(advice))

    def connect(self, logger: FoundLogger) -> "Client":
        """Connect to a logger that was found. ConnectionLostError says what to do when it doesn't answer."""
        from silo.ipc.client import Client

        return Client.connect(self._seen[logger.key])

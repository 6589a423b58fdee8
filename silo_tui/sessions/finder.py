"""How the app finds loggers and connects to them; the real one stands in `connect.py`, tests bring their own."""

from dataclasses import dataclass
from typing import Protocol

from silo_tui.sessions.link import ClientLike


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


class Finder(Protocol):
    """Looks for loggers. Calls block and are made in a thread."""

    @property
    def own_name(self) -> str:
        """How events speak of us; empty before the first connection."""

    def find(self) -> Found:
        """The loggers that run now."""

    def connect(self, logger: FoundLogger) -> ClientLike:
        """A connection to one of them; ConnectionLostError says what to do when it doesn't answer."""

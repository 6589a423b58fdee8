"""A logger of a fleet, as far as it is known."""

from dataclasses import dataclass

from silo.ipc.found import Found
from silo.ipc.published import Summary
from silo.model import State


@dataclass(frozen=True)
class Member:
    """A logger of the fleet. `here`: its helper process lives, and the link to it.

    `summary` is the newest, from before it was lost as well; None where it gave none, and `problem` says why.
    `seen_s` is when it gave its last sign of life, `since_s` since when it is here or not (of `time.monotonic`).
    """

    found: Found
    summary: Summary | None = None
    here: bool = True
    problem: str = ""
    seen_s: float = 0.0
    since_s: float = 0.0

    @property
    def key(self) -> str:
        """What tells it from all others."""
        return self.found.socket or str(self.found.root)

    @property
    def state(self) -> State | None:
        """The state that it told last."""
        return self.summary.state if self.summary is not None else None

    @property
    def closed(self) -> bool:
        """Whether its program closed it: that it is gone is as it should be."""
        return self.summary is not None and self.summary.closed

    @property
    def lost(self) -> bool:
        """Whether it went without a word: killed, or the link is cut."""
        return not self.here and not self.closed and self.state is not State.DEAD

"""What a picture that stands still is fetched from: pins in a helper process, and the buffers behind them."""

from collections.abc import Mapping, Sequence
from typing import Protocol

from silo.expressions.search import FoundMoments, Looking
from silo.expressions.span import Between
from silo_tui.model.samples.pinned import PinReader


class PinHandle(PinReader, Protocol):
    """A pin that is open in a helper process."""

    @property
    def run(self) -> str:
        """Whose rows it has; empty where it has none."""

    @property
    def begin_ns(self) -> int:
        """The oldest time stamp in it."""

    @property
    def end_ns(self) -> int:
        """The newest one."""

    @property
    def oldest_ns(self) -> int:
        """The oldest one that the buffers had; 0 where that isn't known."""

    @property
    def text(self) -> str:
        """What could not be had, and why."""

    @property
    def refused(self) -> str:
        """Why it is no more; empty while it is."""

    def close(self) -> None:
        """Let go of it."""


class Buffers(Protocol):
    """The buffers of a logger; what can't be had of them raises a SiloError."""

    @property
    def reachable(self) -> bool:
        """Whether somebody answers."""

    async def pin(self, names: Sequence[str], start_ns: int, end_ns: int) -> PinHandle:
        """Pin what they hold from one time to another."""

    async def find(
        self, looking: Mapping[str, Looking], around_ns: int, most: int, end_ns: int, pins: Sequence[PinHandle]
    ) -> dict[str, FoundMoments]:
        """Look for moments in them and in these pins, all of one run."""

    async def measure(
        self, names: Sequence[str], a_ns: int, b_ns: int, pins: Sequence[PinHandle], run: str
    ) -> dict[str, Between]:
        """Measure entries between two moments in them and in these pins, all of that run."""

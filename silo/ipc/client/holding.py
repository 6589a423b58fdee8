"""Control as a lease: what is renewed like a view."""

from collections.abc import Callable

from silo.ipc.messages import TakeControl


class Held:
    """Control that a client renews until it gives it up, or somebody takes it."""

    refused = ""

    def __init__(self, renewal: TakeControl, on_lost: Callable[[str], None] | None) -> None:
        self.renewal, self._on_lost = renewal, on_lost

    def refuse(self, why: str) -> None:
        """Somebody else has it."""
        self.refused = why
        if self._on_lost is not None:
            self._on_lost(why)

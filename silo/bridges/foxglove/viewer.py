"""One viewer that is connected: its subscriptions, and how much is under way to it."""

from dataclasses import dataclass, field

from websockets.asyncio.server import ServerConnection
from websockets.protocol import State

from silo.bridges.foxglove.protocol import Frames, StatusLevel, status, text_frame

QUEUE_BYTES = 8 << 20  # that a viewer may be behind before frames of data are dropped


@dataclass(eq=False)
class Viewer:
    """What the kernel doesn't take waits in memory, at most `QUEUE_BYTES` of data, and holds up nobody.

    Frames go to the transport as they are: the frames of all samples of a topic are one piece of memory, and a server
    has no state beyond them where nothing is compressed.
    """

    connection: ServerConnection
    subscriptions: dict[int, int] = field(default_factory=dict)  # channel by subscription
    parameters: set[str] = field(default_factory=set)  # of which it wants to hear
    dropped: int = 0
    _told_dropped: int = 0

    def write(self, frames: bytes) -> None:
        """Send frames, whatever waits already, unless it goes: behind its good-bye nothing can be written any more."""
        if self.connection.state is State.OPEN and not self.connection.transport.is_closing():
            self.connection.transport.write(frames)

    def tell(self, level: StatusLevel, text: str) -> None:
        """Show something among the viewer's problems."""
        self.write(text_frame(status(level, text)))

    def send(self, frames: Frames, subscription: int) -> None:
        """Send messages of a topic; where too much waits they are dropped and counted."""
        if self.connection.transport.get_write_buffer_size() > QUEUE_BYTES:
            self.dropped += frames.count
            return
        if self.dropped > self._told_dropped:
            lost = self.dropped - self._told_dropped
            self._told_dropped = self.dropped
            self.tell(StatusLevel.WARNING, f"{lost} messages were dropped: this viewer, or the link to it, is too slow")
        self.write(frames.for_subscription(subscription))

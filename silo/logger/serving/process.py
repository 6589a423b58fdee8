"""One helper process from the robot program's side: started, asked whether it is ready, ended."""

import select
import socket
import time
from collections.abc import Sequence
from pathlib import Path

from silo.core.child import ENDING_S, ChildProcess
from silo.errors import ConnectionLostError
from silo.link.channel import LinkChannel, LinkReply
from silo.rpc.declaring import Done
from silo.rpc.refusals import Refused
from silo.state.handover import handover_pair

READY_TIMEOUT_S = 15.0  # without a sign of life; a start takes 0.7 s of processor time, which may be long in coming
LONGEST_START_S = 300.0  # a computer that takes this long for it serves nobody
_PROCESS_CLOCK = 2  # of another process, see clock_getcpuclockid(3)
HELPER_ENVIRONMENT = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "PYTHONMALLOC": "malloc",  # gives freed memory back, see silo/recordings/heap.py
}


class HelperProcess(ChildProcess):
    """A helper process: `link` carries messages, `runs` hands runs over."""

    def __init__(self, arguments: Sequence[str]) -> None:
        """Start it; it waits for the first message on the link. Raises OSError."""
        self.link, theirs = socket.socketpair()
        self.runs, their_runs = handover_pair()
        self.channel = LinkChannel(self.link)
        descriptors = [theirs.fileno(), their_runs.fileno()]
        channels: list[str | int] = ["--fd", descriptors[0], "--runs-fd", descriptors[1]]
        try:
            super().__init__("silo.helper", [*channels, *arguments], descriptors, environment=HELPER_ENVIRONMENT)
        except BaseException:
            self.let_go()
            raise
        finally:
            theirs.close()
            their_runs.close()

    def wait_until_ready(self) -> str:
        """Return the path of its socket once clients can come. Raises ConnectionLostError with its reason."""
        began_s = time.monotonic()
        message = self.channel.receive() if self._answers() else None
        reply = message.reply if isinstance(message, LinkReply) and message.number == 0 else None
        if isinstance(reply, Done):
            return reply.text
        self.kill()
        if isinstance(reply, Refused):
            raise ConnectionLostError(reply.text)
        raise ConnectionLostError(f"no answer within {time.monotonic() - began_s:.0f} s; see its output above")

    def _answers(self) -> bool:
        """Wait until there is something to read, as long as it works at it; a busy computer lets it work slowly."""
        began_s = quiet_s = time.monotonic()
        used = self._used()
        while time.monotonic() < min(quiet_s + READY_TIMEOUT_S, began_s + LONGEST_START_S):
            if select.select([self.link], [], [], min(1.0, READY_TIMEOUT_S / 4))[0]:
                return True
            if (now := self._used()) > used:
                used, quiet_s = now, time.monotonic()  # it works
        return False

    def _used(self) -> int:
        """Return the processor time that it had until now, in ticks of the kernel."""
        fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
        return int(fields[11]) + int(fields[12])

    def worked_ns(self) -> int:
        """Processor time that it and its threads had until now; stands still in one that is frozen, or gone."""
        try:
            return time.clock_gettime_ns((~self.pid << 3) | _PROCESS_CLOCK)
        except OSError:
            return 0

    def let_go(self) -> None:
        """Close both channels, by which it learns that the robot program is done with it."""
        self.link.close()
        self.runs.close()

    def end(self, timeout_s: float = ENDING_S) -> int:
        """Let one that ended, or is about to, do so; kill it if it doesn't. Return its exit code."""
        self.let_go()
        return super().end(timeout_s)

    def kill(self) -> int:
        """End it at once, if it hasn't; return its exit code."""
        self.let_go()
        return super().kill()

    def wait(self) -> int:
        """Wait until it ended by itself; kill it if it takes too long. Return its exit code, then 0."""
        code = self.wait_within(READY_TIMEOUT_S)
        if code is not None:
            return code
        self.kill()
        return 0

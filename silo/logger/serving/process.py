"""One helper process from the robot program's side: started, asked whether it is ready, waited for, ended.

And what tells of it: the id under which it is served, and the mark that it is down. Bridges to other people's viewers
that end with the logger are processes, too, never a thread of the robot's.
"""

import contextlib
import hashlib
import logging
import math
import os
import secrets
import socket
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from silo.bridges.listening import bound, check_installed
from silo.core.child import ENDING_S, NONE, PIPE, ChildProcess
from silo.core.runtime import down_mark, open_unfinished, unopened
from silo.errors import ConnectionLostError, SegmentError, SiloError
from silo.link.channel import READY, LinkChannel, LinkMessage, LinkReply
from silo.polling import readable
from silo.rpc.declaring import Done
from silo.rpc.refusals import Refused
from silo.state.handover import handover_pair

READY_TIMEOUT_S = 15.0  # without a sign of life; a start takes 0.7 s of processor time, which may be long in coming
LONGEST_START_S = 300.0  # a computer that takes this long for it serves nobody
TICK_NS = 10**7  # of processor time: one that wakes up now and then, and no more, does not work
ROUND_S = 1.0
LONG_LIFE_S = 60.0  # a process that lived longer was a good one: the next is started at once
RESPAWN_DELAYS_S = (0.0, 0.0, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0)  # before each try; the last one for ever after
FROZEN_ROUNDS = 5  # without an answer, nor any processor time
DEAF_ROUNDS = 60  # without an answer, though it works
_NETWORK = Path("/sys/class/net")
_PROCESS_CLOCK = 2  # of another process, see clock_getcpuclockid(3)
HELPER_ENVIRONMENT = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "PYTHONMALLOC": "malloc",  # gives freed memory back, see silo/recordings/heap.py
}

log = logging.getLogger("silo")


class HelperProcess(ChildProcess):
    """A helper process: `link` carries messages, `runs` hands runs over."""

    def __init__(self, arguments: Sequence[str], changes: int) -> None:
        """Start it; it waits for the first message on the link. Raises OSError.

        `changes` is the descriptor of the `ChangeCount` that it looks at.
        """
        self.link, theirs = socket.socketpair()
        self.runs, their_runs = handover_pair()
        self.channel = LinkChannel(self.link)
        self.early: list[LinkMessage] = []
        descriptors = [theirs.fileno(), their_runs.fileno(), changes]
        channels: list[str | int] = ["--fd", descriptors[0], "--runs-fd", descriptors[1], "--changes-fd", changes]
        try:
            # it speaks by standard error: who reads what the program prints needn't wait for its end
            super().__init__(
                "silo.helper", [*channels, *arguments], descriptors, environment=HELPER_ENVIRONMENT, stdout=NONE
            )
        except BaseException:
            self.let_go()
            raise
        finally:
            theirs.close()
            their_runs.close()

    def wait_until_ready(self, is_wanted: Callable[[], bool]) -> str:
        """Return the path of its socket once clients can come. Raises ConnectionLostError with its reason.

        What it tells before that, as one that goes on with captures of its predecessor may, is kept in `early`. Where
        it is wanted no more it has a little time left, as any that ends.
        """
        began_s = time.monotonic()
        gone, refused = False, ""
        while not gone and not refused and self._answers(is_wanted):
            message = self.channel.receive()
            if not isinstance(message, LinkReply) or message.number != READY:
                gone = message is None
                self.early += [message] if message is not None else []
            elif isinstance(message.reply, Done):
                return message.reply.text
            else:
                refused = message.reply.text if isinstance(message.reply, Refused) else "it answered something else"
        code = self.end() if gone else self.kill()
        if gone:
            refused = f"it ended at once (exit code {code}); see its output above"
        raise ConnectionLostError(
            refused or f"no answer within {time.monotonic() - began_s:.0f} s; see its output above"
        )

    def _answers(self, is_wanted: Callable[[], bool]) -> bool:
        """Wait until there is something to read, as long as it works at it; a busy computer lets it work slowly."""
        began_s, wanted_s = time.monotonic(), math.inf
        quiet_s = began_s
        used = self.worked_ns() // TICK_NS
        while time.monotonic() < min(quiet_s + READY_TIMEOUT_S, began_s + LONGEST_START_S, wanted_s + ENDING_S):
            wanted_s = math.inf if is_wanted() else min(wanted_s, time.monotonic())
            if readable(self.link.fileno(), timeout_s=min(1.0, READY_TIMEOUT_S / 4)):
                return True
            if (now := self.worked_ns() // TICK_NS) > used:
                used, quiet_s = now, time.monotonic()  # it works
        return False

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

    def wait_out(self, hear: Callable[[LinkMessage], None]) -> int:
        """Hear what it says until it ended by itself; kill it if it is quiet for too long. Returns its code, then 0.

        Raises ConnectionLostError for what is no message.
        """
        while readable(self.link.fileno(), timeout_s=READY_TIMEOUT_S):
            if (message := self.channel.receive()) is None:
                return self.end(READY_TIMEOUT_S)
            hear(message)
        self.kill()
        return 0


class Patience:
    """How long to wait for a helper process: as long as that shows signs of life. To be asked once a second of a wait.

    It answers a beat of the link, which its main thread does at once; or it works, as one that gets little processor
    time does. A frozen one (SIGSTOP, a debugger, memory that is swapped out) does neither. Seconds in which this
    program stood still itself count as one.
    """

    def __init__(self, beats: Callable[[], int], worked_ns: Callable[[], int]) -> None:
        self._signs = beats, worked_ns
        self._beats, self._worked_ns = beats(), worked_ns()
        self._deaf = self._quiet = 0

    def is_over(self) -> bool:
        """Whether there was no sign of life for so many rounds."""
        beats, worked_ns = (sign() for sign in self._signs)
        self._deaf = 0 if beats != self._beats else self._deaf + 1
        self._quiet = 0 if (beats, worked_ns) != (self._beats, self._worked_ns) else self._quiet + 1
        self._beats, self._worked_ns = beats, worked_ns
        return self._quiet >= FROZEN_ROUNDS or self._deaf >= DEAF_ROUNDS


class DownMark:
    """A file in the runtime folder while the helper process is down, so that `silo ls` can tell.

    It counts as long as this process has it open. By the link thread only.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._file = unopened()

    def set(self) -> None:
        """Say that the helper process is down, since now unless that was said before."""
        if not self._file.closed:
            return
        try:
            open_unfinished(down_mark(self._name, os.getpid()), self._file)
        except (OSError, SegmentError) as error:
            log.debug("%s: it can't be told that the helper process is down: %s", self._name, error)

    def clear(self) -> None:
        """It is there again, or wanted no more."""
        if self._file.closed:
            return
        with contextlib.suppress(OSError, SegmentError):
            down_mark(self._name, os.getpid()).unlink(missing_ok=True)
        self.let_go()

    def let_go(self) -> None:
        """Have it open no more: alone in a forked child, as what is said stays its parent's."""
        self._file.close()


def drawn_id() -> str:
    """Return an id for a logger of this computer: ten hexadecimal digits, other ones at each call.

    It tells the logger from another of its name on a computer that calls itself the same. Robots of one cloned image
    share host name and machine id, but not the addresses that their network cards were made with; a computer without
    such a card is told by its boot.
    """
    return machine_digits() + secrets.token_hex(3)


def machine_digits() -> str:
    """Return four digits that stay while this computer does."""
    cards = sorted(filter(None, map(_made_with, _NETWORK.glob("*"))))
    facts = [_text(Path("/etc/machine-id")), *cards] if cards else [_text(Path("/proc/sys/kernel/random/boot_id"))]
    return hashlib.sha256("\n".join(facts).encode()).hexdigest()[:4]


def _made_with(card: Path) -> str:
    """Return the address that a card was made with; empty for one that drew or was given its own."""
    return _text(card / "address") if _text(card / "addr_assign_type") == "0" and (card / "device").exists() else ""


def _text(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:
        return ""


class Tries:
    """How long is waited before each try to start a process that dies, or doesn't start, again and again."""

    def __init__(self) -> None:
        """The first is made now, and isn't waited for."""
        self.count, self._began_s = 0, time.monotonic()

    @property
    def delay_s(self) -> float:
        """How long is waited before the next one."""
        return RESPAWN_DELAYS_S[min(self.count, len(RESPAWN_DELAYS_S) - 1)]

    def begin(self) -> None:
        """Count one that is made now."""
        self.count, self._began_s = self.count + 1, time.monotonic()

    def died(self) -> None:
        """Take in the end of what was started: after a long life the count begins anew."""
        if time.monotonic() - self._began_s > LONG_LIFE_S:
            self.count = 0


class FoxgloveProcess(ChildProcess):
    """Serves a logger to Foxglove, Lichtblick and PlotJuggler on a port of this computer, for reading alone."""

    def __init__(self, logger: str, port: int) -> None:
        """Start it; it listens on a port of 127.0.0.1 (0: one that is free), and waits for `begin`.

        Raises SiloError where the port is taken, or `websockets` is missing, OSError.
        """
        check_installed("websockets", "foxglove")
        with bound("127.0.0.1", port) as listening:
            self.port: int = listening.getsockname()[1]
            arguments: list[str | int] = ["--fd", listening.fileno(), "--logger", f"{logger}.{os.getpid()}"]
            # standard input is a pipe that ends with this process, whatever ends it
            super().__init__("silo.bridges.foxglove", arguments, [listening.fileno()], stdin=PIPE)

    def begin(self) -> None:
        """Let it connect to the logger, which can be reached now."""
        with contextlib.suppress(BrokenPipeError):  # it ended; what it said stands in the program's standard error
            self.stdin.write(b"\n")
            self.stdin.flush()

    def let_go(self) -> None:
        """Close the pipe, by whose end it learns that the robot program is done with it."""
        with contextlib.suppress(BrokenPipeError):
            self.stdin.close()

    def close(self) -> int:
        """End it and return its exit code; closing twice is fine."""
        self.let_go()
        return self.end()


class FoxgloveBridge:
    """Foxglove's bridge of a logger: a process, and when that dies another at the same port."""

    def __init__(self, logger: str, port: int) -> None:
        """Start it; raises as `FoxgloveProcess`."""
        self._logger, self._tries = logger, Tries()
        self.due_s: float | None = None  # when the next process is to be started; None while there is one
        self.process = FoxgloveProcess(logger, port)
        self.port = self.process.port

    @property
    def end(self) -> int | None:
        """The descriptor that is readable once the process has ended; None while there is none."""
        return self.process.stdin.fileno() if self.due_s is None else None

    def died(self) -> None:
        """Take in that it did."""
        code = self.process.close()
        log.warning(
            "%s: the process that serves Foxglove died (exit code %s), starting a new one; logging goes on",
            self._logger,
            code,
        )
        self._tries.died()
        self.due_s = time.monotonic() + self._tries.delay_s

    def look(self) -> None:
        """Start the next process where that is due."""
        if self.due_s is None or time.monotonic() < self.due_s:
            return
        self._tries.begin()
        try:
            self.process = FoxgloveProcess(self._logger, self.port)
        except (SiloError, OSError) as failure:
            log.error(  # noqa: TRY400  # the words say it all
                "%s: Foxglove isn't served: %s; logging goes on; it is tried again in %g s",
                self._logger,
                failure,
                self._tries.delay_s,
            )
            self.due_s = time.monotonic() + self._tries.delay_s
        else:
            self.due_s = None
            self.process.begin()

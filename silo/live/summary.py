"""The logger in a few hundred bytes, for those who look at many: published when it says something new.

Nothing is made while nobody subscribes. A thread of its own looks how full the disk is: a network drive that hangs must
hold up neither views nor answers.
"""

import contextlib
import threading
from pathlib import Path

import msgspec
import zenoh

from silo.core.elements import State
from silo.core.runtime import disk_room
from silo.core.stalls import is_stalled
from silo.live.topics import matching
from silo.net.keys import Root
from silo.rpc.published import Summary
from silo.state.replica import Replica

PERIOD_S = 1.0
AGAIN_S = 10.0
DISK_PERIOD_S = 5.0
STEADY_SHARE = 0.01  # a rate that differs by less, and a disk by less of its size, is nothing new


class SummaryFeed:
    """Publishes what the status says in short. Used by the publisher thread alone, but for `die` and `close`."""

    def __init__(self, session: zenoh.Session, root: Root, replica: Replica) -> None:
        self._replica = replica
        self._publisher = session.declare_publisher(
            root.key("summary"), congestion_control=zenoh.CongestionControl.DROP
        )
        self._lock = threading.Lock()  # of the publisher: Zenoh raises when two use one at the same time
        self._told: Summary | None = None
        self._told_s = self._looked_s = 0.0
        self._heard = False
        self._died = self._closed = False

    def send(self, now_s: float) -> None:
        """Publish what is new, and from time to time what isn't; what a new state is, at once."""
        told = self._told
        changed = told is None or told.state is not self._state
        if not changed and now_s - self._looked_s < PERIOD_S:
            return
        self._looked_s = now_s
        with self._lock:
            heard, before = matching(self._publisher), self._heard
            self._heard = heard
            if not heard or self._closed:
                return
            found = self.now()
            news = told is None or not before or differs(told, found)
            if news or now_s - self._told_s >= AGAIN_S:
                self._told, self._told_s = found, now_s
                self._publisher.put(msgspec.msgpack.encode(found))

    @property
    def _state(self) -> State:
        return State.DEAD if self._died else self._replica.now.state

    def now(self) -> Summary:
        """Return what there is to say."""
        found = Summary.of(self._replica.status())
        return msgspec.structs.replace(found, state=State.DEAD) if self._died else found

    def die(self) -> None:
        """Say from now on that the robot program is dead, also while its captures are written and its log is saved."""
        self._died = True

    def close(self) -> None:
        """Say that the program has closed its logger, as the last word."""
        with self._lock:
            self._closed = True
            if matching(self._publisher):
                self._publisher.put(msgspec.msgpack.encode(msgspec.structs.replace(self.now(), closed=True)))


def differs(told: Summary, found: Summary) -> bool:
    """Return whether a summary says something that one would want to see at once."""
    steady = abs(found.measured_hz - told.measured_hz) <= STEADY_SHARE * told.measured_hz
    full = abs(found.disk_free_bytes - told.disk_free_bytes) <= STEADY_SHARE * found.disk_bytes
    stalls = is_stalled(found.idle_s, found.frequency_hz) is not is_stalled(told.idle_s, told.frequency_hz)
    same = msgspec.structs.replace(
        found,
        ticks=told.ticks,
        idle_s=found.idle_s if stalls else told.idle_s,
        measured_hz=told.measured_hz if steady else found.measured_hz,
        disk_free_bytes=told.disk_free_bytes if full else found.disk_free_bytes,
    )
    return same != told


class DiskWatch:
    """Owns the thread that looks how full the disk is to which the logger's files go."""

    def __init__(self, replica: Replica) -> None:
        self._replica = replica
        self._ended = threading.Event()
        # a daemon: it may hang in the kernel for minutes, and it calls nothing but the kernel
        self._thread = threading.Thread(target=self._run, name="disk", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread, without waiting for a disk."""
        self._ended.set()

    def _run(self) -> None:
        while True:
            self._replica.disk = room_of(Path(self._replica.now.robot.folder))
            if self._ended.wait(DISK_PERIOD_S):
                return


def room_of(folder: Path) -> tuple[int, int]:
    """Return how many bytes are free where a folder is, or will be, and how many there are; 0 where nobody tells."""
    with contextlib.suppress(OSError):
        return disk_room(next(place for place in (folder, *folder.parents) if place.exists()))
    return 0, 0

"""Changes and slow readings that wait for their turn: a thread for each thing that they wait for.

So nobody's recorder, disk or stopped robot program holds up a mark. What is not begun in time is refused in words while
its client still listens, and never done after that; of what was begun and takes longer, an event tells the end.
"""

import logging
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import zenoh

from silo.rpc.clocks import clock_s
from silo.rpc.declaring import Lane, Request

# What its client is told must come before it gives up: on two busy processors an answer took up to 0.1 s to get there.
TOLD_S = 0.25  # that it goes on
BEGUN_S = 0.5  # what is begun has some time left

log = logging.getLogger("silo.helper")


@dataclass(frozen=True)
class LaneLimit:
    """How much may wait in a lane; alone anything may."""

    count: int = 64
    size_bytes: int = 16 * 2**20


# The answers of slow readings, of which one of 64 names takes 4.5 MB, are made one after the other: here are only their
# questions.
LIMITS = {lane: LaneLimit() for lane in Lane} | {Lane.SLOW: LaneLimit(256, 4 * 2**20)}


@dataclass(eq=False)
class Waiting:
    """A request that was taken in, and who waits for it until when. Exactly one thread may `claim` its answer."""

    query: zenoh.Query
    request: Request[Any]
    key: str
    size_bytes: int
    until_s: float
    by: str = ""  # its sender in words, once that one was let in
    job: int = 0  # under which an event tells the end, where its client was told that it goes on
    _free: threading.Lock = field(default_factory=threading.Lock)

    def claim(self) -> bool:
        """Return True to the first who asks: that one answers."""
        return self._free.acquire(blocking=False)


class Lanes:
    """Owns the threads."""

    def __init__(self, do: Callable[[Waiting], None], late: Callable[[Waiting, Lane, bool], None]) -> None:
        """`do` does one; `late` is told of one whose time is over, with its lane, and whether it was begun."""
        self._do, self._late = do, late
        self._changed = threading.Condition()
        self._waiting: dict[Lane, deque[Waiting]] = {lane: deque() for lane in Lane}
        self._running: dict[Lane, Waiting] = {}
        self._told: set[Waiting] = set()  # that run and are over their time
        self._ending = False
        self._threads = [
            threading.Thread(target=self._work, args=(lane,), name=f"lane {lane.name.lower()}") for lane in Lane
        ]
        self._threads.append(threading.Thread(target=self._watch, name="lanes late"))

    def start(self) -> None:
        """Start the threads."""
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """End the threads after what they are at; what waits is dropped, and its clients are told by Zenoh."""
        with self._changed:
            self._ending = True
            for waiting in self._waiting.values():
                waiting.clear()
            self._changed.notify_all()
        for thread in self._threads:
            thread.join()

    def put(self, lane: Lane, one: Waiting) -> int:
        """Have it done when its turn comes, and return 0; how many wait already where there is no room."""
        limit = LIMITS[lane]
        with self._changed:
            waiting = self._waiting[lane]
            size_bytes = sum(other.size_bytes for other in waiting)
            if waiting and (len(waiting) >= limit.count or size_bytes + one.size_bytes > limit.size_bytes):
                return len(waiting)
            waiting.append(one)
            self._changed.notify_all()
        return 0

    def _work(self, lane: Lane) -> None:
        while self._one(lane):
            pass

    def _one(self, lane: Lane) -> bool:
        """Do the next one; no name for it outlives this: a query that isn't dropped costs its client the whole time."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting[lane] or self._ending)
            if self._ending:
                return False
            one = self._running[lane] = self._waiting[lane].popleft()
            self._changed.notify_all()
        try:
            self._do(one)
        except Exception:
            log.exception("a request failed")
        finally:
            with self._changed:
                del self._running[lane]
                self._told.discard(one)
        return True

    def _watch(self) -> None:
        """Tell those whose time is over."""
        while True:
            with self._changed:
                overdue = self._overdue()
                if self._ending:
                    return
                if not overdue:
                    self._changed.wait(self._next_s())
                    continue
            while overdue:  # no name for one outlives this, as in `_one`
                self._tell(*overdue.pop(0))

    def _tell(self, one: Waiting, lane: Lane, begun: bool) -> None:
        try:
            self._late(one, lane, begun)
        except Exception:
            log.exception("a late request was not told so")

    def _overdue(self) -> list[tuple[Waiting, Lane, bool]]:
        now_s, found = clock_s(), []
        for lane, waiting in self._waiting.items():
            late = [one for one in waiting if is_late(one.until_s, now_s)]
            for one in late:
                waiting.remove(one)
                found.append((one, lane, False))
        for lane, one in self._running.items():
            if one not in self._told and not one.until_s - TOLD_S > now_s:
                self._told.add(one)
                found.append((one, lane, True))
        return found

    def _next_s(self) -> float | None:
        """Return when somebody's time is over next; None where nobody waits."""
        known = [one.until_s - BEGUN_S for waiting in self._waiting.values() for one in waiting]
        known += [one.until_s - TOLD_S for one in self._running.values() if one not in self._told]
        return min(max(0.0, min(known) - clock_s()), threading.TIMEOUT_MAX) if known else None


def is_late(until_s: float, now_s: float) -> bool:
    """Return whether it is too late to begin something for a client that waits so long; so it is for NaN."""
    return not until_s - BEGUN_S > now_s

"""The publisher thread: views, topics, the measured frequency, lost samples. It never waits for a client.

Idle, it wakes ten times a second for some microseconds. Busy, it rests at least as long as it worked, so that no
number of clients makes it take more than half a core.
"""

import contextlib
import logging
import threading
import time
from collections import OrderedDict, deque
from pathlib import Path

import msgspec
import zenoh

from silo.core.elements import Present, State, is_stalled
from silo.core.runtime import disk_room
from silo.errors import SegmentError
from silo.history.pins import Pins
from silo.live.feeds import Round
from silo.live.requests import OpenView, ViewOpened
from silo.live.streams import Streams
from silo.live.topics import Topics
from silo.live.views import Views
from silo.net import keys
from silo.net.keys import Root
from silo.net.session import matching
from silo.rpc.published import EventKind, Summary
from silo.segment.reader import SegmentReader
from silo.segment.reasons import LOST_ADVICE, lost_text
from silo.segment.rows import lost_samples
from silo.state.events import EventNotifier
from silo.state.held_runs import HeldRuns
from silo.state.replica import Replica
from silo.state.run_follower import RunFollower

PERIOD_S = 1.0
AGAIN_S = 10.0
DISK_PERIOD_S = 5.0
STEADY_SHARE = 0.01  # a rate that differs by less, and a disk by less of its size, is nothing new

IDLE_S = 0.1
TOPIC_PERIOD_S = 0.05
HZ_WINDOW_S = 2.0
LOST_PERIOD_S = 2.0
MAX_CLIENTS = 1_000
MOST_BEHIND_BYTES = 256 * 2**20  # of runs that stay in memory until they are sent

log = logging.getLogger("silo.helper")


class SummaryFeed:
    """Publishes what the status says in short, for those who look at many loggers: when it says something new.

    Nothing is made while nobody subscribes. Used by the publisher thread alone, but for `die` and `close`.
    """

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
        changed = told is None or told.state is not (State.DEAD if self._died else self._replica.now.state)
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
    """Owns the thread that looks how full the disk is: a network drive that hangs holds up no view and no answer."""

    def __init__(self, replica: Replica) -> None:
        self._replica = replica
        self._ended = threading.Event()
        # a daemon: it may hang in the kernel for minutes, and it calls nothing but the kernel
        self._thread = threading.Thread(target=self._run, name="disk", daemon=True)
        self.start, self.stop = self._thread.start, self._ended.set  # nobody waits for a disk

    def _run(self) -> None:
        while True:
            self._replica.disk = room_of(Path(self._replica.now.robot.folder))
            if self._ended.wait(DISK_PERIOD_S):
                return


def room_of(folder: Path) -> tuple[int, int]:
    """Return how many bytes are free where a folder is, or will be, and how many there are; 0 where nobody tells."""
    with contextlib.suppress(OSError):
        return disk_room(folder)
    return 0, 0


class Publisher:
    """Owns the publisher thread. The other methods may be called by any thread."""

    def __init__(
        self, session: zenoh.Session, root: keys.Root, replica: Replica, events: EventNotifier, held: HeldRuns
    ) -> None:
        self._replica = replica
        self._events = events
        self._held, self._reading = held, set[str]()  # runs that streams and topics are at
        self._topics = Topics(session, root, held.between)
        self.views = Views(session, root, replica, self._is_known)
        self.streams = Streams(session, root, replica, self._watched_between, self._is_known)
        self.pins = Pins(knows=self._is_known)
        self._clients: set[str] = set()
        self._came: dict[str, bool] = {}  # by id, clients that are there, or went, since they were looked at
        self._names: OrderedDict[str, Present] = OrderedDict()  # by their ids, as each hello tells
        self.summary = SummaryFeed(session, root, replica)
        self._disk = DiskWatch(replica)
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._ending = False
        self._present = RunFollower(replica)
        self._derived = RunFollower(replica, derived=True)  # the same run, where anything is derived
        self._told = ""
        self._ticks: deque[tuple[float, int]] = deque()
        self._idle_s = 0.0  # since the last tick
        self._lost_seen, self._lost_due_s = 0, 0.0
        self._topics_due_s = 0.0
        self._thread = threading.Thread(target=self._run, name="publisher")
        # not a ring: where hundreds go at once, as behind a link that is cut, some would stay for good
        self._presence = session.liveliness().declare_subscriber(root.key("client", "*"), self._note, history=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()
        self._disk.start()

    def stop(self) -> None:
        """End the thread and wait for it."""
        self._disk.stop()
        self._ending = True
        self._wake.set()
        self._thread.join()

    @property
    def clients(self) -> int:
        """Clients that are there, by their liveliness tokens."""
        return len(self._clients)

    def needs(self, run: str) -> bool:
        """Whether a stream or topic is at a run, or one before it; not of what is too much memory, the oldest first."""
        if not any(run in self._held.since(one) for one in self._now_read()):
            return False
        return self._held.size_bytes(self._held.since(run)[:-1]) <= MOST_BEHIND_BYTES

    def _watched_between(self, run: str, present: SegmentReader) -> SegmentReader:
        found = self._held.between(run, present)
        return present if found is present else self._replica.watching(found)

    def name_client(self, client: str, name: str, identity: str = "") -> None:
        """Remember who a client is, before it comes: what it says of itself, or with an identity what is known."""
        with self._lock:
            known = self._names.get(client)
            if known is None or identity or not known.identity:
                since_ns = known.since_ns if known is not None else time.time_ns()
                self._names[client] = Present(name, since_ns, identity)
            while len(self._names) > MAX_CLIENTS:  # whoever only looks may say as many as it likes
                gone = next((one for one, name in self._names.items() if not name.identity), next(iter(self._names)))
                del self._names[gone]
        self._name_clients()

    def _is_known(self, client: str) -> bool:
        """Whether somebody who may change something said that this is its id."""
        found = self._names.get(client)
        return found is not None and bool(found.identity)

    def _name_clients(self) -> None:
        with self._lock:
            self._replica.clients = tuple(name for client, name in self._names.items() if client in self._clients)

    def open_view(self, request: OpenView) -> ViewOpened:
        """Open, replace or renew a view."""
        opened = self.views.open(request)
        self._wake.set()  # one is seen at once
        return opened

    # -------------------------------------------------------------------------------------------------- the thread

    def _run(self) -> None:
        while not self._ending:
            began_s = time.monotonic()
            try:
                due_s = self._round(began_s)
            except SegmentError as error:
                # replaced while we read it, and the next round sees by what; or somebody cut it short
                if str(error) != self._told:
                    self._told = str(error)
                    log.warning("publishing failed, trying again: %s", error)
                due_s = self._begin_anew(began_s)
            except zenoh.ZError:
                log.exception("publishing failed, trying again")  # the session closes: the next round sees why
                due_s = self._begin_anew(began_s)
            except Exception:
                # whatever it is, the views and topics of all others go on
                log.exception("publishing failed for a reason that silo doesn't know, trying again")
                due_s = self._begin_anew(began_s)
            busy_s = time.monotonic() - began_s
            self._wake.wait(max(due_s - time.monotonic(), busy_s, 0.001))
            self._wake.clear()
        self.views.stop()
        self.streams.stop()

    def _begin_anew(self, now_s: float) -> float:
        """Open the run anew in the next round; return when that is."""
        self._present.forget()
        self._derived.forget()
        return now_s + 1.0

    def _round(self, now_s: float) -> float:
        """Do what is due and say when to come again."""
        self.pins.expire()
        self._follow_run(now_s)
        reading = self._now_read()
        if reading != self._reading:
            self._reading = reading
            self._held.changed()
        self._follow_clients()
        self._measure(now_s)
        self.summary.send(now_s)
        due_s = now_s + IDLE_S
        if self._topics.wanted():
            if now_s >= self._topics_due_s:
                self._topics_due_s = now_s + TOPIC_PERIOD_S
                if self._topics.publish(now_s):
                    self._topics_due_s = now_s
            due_s = min(due_s, self._topics_due_s)
        else:
            self._topics.publish(now_s)
        reader = self._derived.reader or self._present.reader  # without derived signals there is one of all
        this = Round(self._replica.now, reader, now_s, self._replica.measured_hz, self._idle_s)
        return min(self.streams.send(this, due_s), self.views.send(this, due_s))

    def _follow_run(self, now_s: float) -> None:
        if self._present.look():
            reader = self._present.reader
            self._topics.adopt(reader, now_s)
            self._ticks.clear()
            self._lost_seen = lost_samples(reader) if reader is not None else 0
        if self._replica.now.table.derived:
            self._derived.look()
        else:
            self._derived.forget()

    def _now_read(self) -> set[str]:
        return {self._topics.reading, *self.streams.reading} - {""}

    def _note(self, sample: zenoh.Sample) -> None:
        """A client came or went; in a thread of Zenoh."""
        with self._lock:
            self._came[str(sample.key_expr).rsplit("/", 1)[1]] = sample.kind == zenoh.SampleKind.PUT

    def _follow_clients(self) -> None:
        before = set(self._clients)
        with self._lock:
            came, self._came = self._came, {}
        for client, is_there in came.items():
            if is_there:
                if len(self._clients) < MAX_CLIENTS:
                    self._clients.add(client)
                continue
            self._clients.discard(client)
            self.streams.close_all_of(client)
            self.views.close_all_of(client)
            with self._lock:
                self._names.pop(client, None)
        if before != self._clients:
            self._name_clients()

    def _measure(self, now_s: float) -> None:
        reader = self._present.reader
        if reader is None or self._replica.now.state is not State.RUNNING:
            self._ticks.clear()
            self._replica.measured_hz = 0.0
            self._idle_s = 0.0
            if reader is not None:
                self._tell_lost(reader)  # the last of a run that ended
            return
        self._idle_s = self._replica.idle_s(reader.ticks)
        if reader.ticks:  # before the first one there is no pace
            self._ticks.append((now_s, reader.ticks))
        while len(self._ticks) > 2 and now_s - self._ticks[0][0] > HZ_WINDOW_S:
            self._ticks.popleft()
        span_s = now_s - self._ticks[0][0] if self._ticks else 0.0
        if span_s >= HZ_WINDOW_S / 2:  # over less, as a loop begins, it is anything
            self._replica.measured_hz = (self._ticks[-1][1] - self._ticks[0][1]) / span_s
        if now_s >= self._lost_due_s:
            self._lost_due_s = now_s + LOST_PERIOD_S
            self._tell_lost(reader)

    def _tell_lost(self, reader: SegmentReader) -> None:
        lost = lost_samples(reader)
        if lost > self._lost_seen:
            more, self._lost_seen = lost - self._lost_seen, lost
            self._events.publish(EventKind.LOST, f"{lost_text(more, reader.lost_whys())}: {LOST_ADVICE}")

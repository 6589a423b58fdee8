"""Streams: all samples of some names as raw rows, for clients that want every one of them.

Nothing is kept for a client: rows are sent once, and what it doesn't take in time is dropped on the way. Its rows are
numbered, so that it counts what it missed. `Streams` is driven by the publisher thread; opened and closed by any.
"""

import logging
import threading
import time

import msgspec
import zenoh

from silo.collecting.segment_reader import SegmentReader
from silo.errors import SegmentError
from silo.helper.mirror import LoggerSnapshot, Mirror
from silo.helper.picking import Group, pick, unknown_name
from silo.helper.samples import MAX_NAMES, unknown
from silo.helper.topics import matching
from silo.ipc import keys
from silo.ipc.messages import OpenStream, Refused, RefusedWhy, StreamOpened
from silo.ipc.sampled import SampledRows, StreamFrame

LEASE_S = 6.0
MIN_PERIOD_S, MAX_PERIOD_S = 0.01, 10.0
MAX_STREAMS = 32
MAX_STREAMS_PER_CLIENT = 8
MAX_FRAME_BYTES = 2**20  # the rest follows at once

log = logging.getLogger("silo.helper")
_encoder = msgspec.msgpack.Encoder()


class Stream:
    """A stream that is open. `adopt` and `frame` are for one thread alone."""

    def __init__(self, request: OpenStream, publisher: zenoh.Publisher, now_s: float) -> None:
        self.request = request
        self.publisher = publisher
        self.expires_s = now_s + LEASE_S
        self.due_s = now_s
        self.opened = StreamOpened(request.stream, -1, [], {})  # how to read the present frames
        self._table = -1  # the generation of the table that was adopted last
        self._run: str | None = None
        self._reader: SegmentReader | None = None
        self._groups: tuple[Group, ...] = ()
        self._cursors: dict[tuple[int | str, int], int] = {}
        self._derived: dict[int, str] = {}  # rings of derived signals have no lasting numbers: their names

    def adopt(self, now: LoggerSnapshot, reader: SegmentReader | None) -> None:
        """Go over to another table or segment: a stream begins with what comes, and a new run with its first row."""
        if self._table == now.generation and self._reader is reader:
            return
        run = reader.schema.run if reader is not None else ""
        known = [name for name in self.request.names if now.element(name) is not None or name in now.entry_places]
        picked = pick(known, now, reader.schema if reader is not None else None)
        elements = reader.schema.elements if reader is not None and now.table.derived else ()
        self._derived = {element.ring: element.info.name for element in elements if element.info.expression}
        begun = self._run is not None  # of a logger that starts later nothing is left out
        # a reader may be older than the table, and lack a derived signal for a moment
        before = self._cursors if run == self._run else {}
        self._cursors = {**before}
        for group in picked.groups:
            from_now = reader is not None and (run == self._run or not begun)
            key = self._key(group)
            self._cursors[key] = before.get(key, reader.head(group.ring) if from_now and reader is not None else 0)
        gone = dict.fromkeys(set(self.request.names).difference(known), "it is no longer in the table")
        missing = {**picked.missing, **gone}
        if (picked.names, missing) != (self.opened.names, self.opened.missing) or self.opened.generation < 0:
            # else frames are read as before, and their client needs no other words to read them by
            self.opened = StreamOpened(self.request.stream, self.opened.generation + 1, picked.names, missing)
        self._table, self._run, self._reader, self._groups = now.generation, run, reader, picked.groups

    def _key(self, group: Group) -> tuple[int | str, int]:
        return self._derived.get(group.ring, group.ring), group.after

    def frame(self) -> tuple[bytes | None, bool]:
        """Return what came since the last one, encoded, None for nothing; and whether there is more."""
        reader = self._reader
        if reader is None or not self._groups:
            return None, False
        found: list[SampledRows] = []
        more = False
        room = MAX_FRAME_BYTES // len(self._groups)
        for number, group in enumerate(self._groups):
            key = self._key(group)
            begin = self._cursors.get(key, 0)
            if group.after >= 0:
                begin = max(begin, reader.head(group.after))
            most = max(1, room // group.row_bytes)
            rows = reader.rows(group.ring, begin, most, group.words)
            self._cursors[key] = max(begin, rows.first + len(rows))
            if len(rows):
                found.append(SampledRows(number, rows.first, len(rows), rows.words.tobytes()))
                more = more or len(rows) == most
        if not found:
            return None, False
        return _encoder.encode(StreamFrame(self.opened.generation, reader.schema.run, found)), more


class Streams:
    """All streams of all clients."""

    def __init__(self, session: zenoh.Session, root: keys.Root, mirror: Mirror) -> None:
        self._session = session
        self._root = root
        self._mirror = mirror
        self._streams: dict[str, Stream] = {}
        self._failed: dict[str, tuple[OpenStream, str]] = {}  # streams that could not be fed, until they are closed
        self._closed: list[zenoh.Publisher] = []  # to be undeclared by the thread that uses them
        self._lock = threading.Lock()

    def open(self, request: OpenStream) -> StreamOpened | Refused:
        """Open, replace or renew a stream."""
        now = self._mirror.now
        refused = _check(request)
        if refused is not None:
            return refused
        now_s = time.monotonic()
        with self._lock:
            old = self._streams.get(request.stream)
            if old is not None and _same(old.request, request):
                # whatever the table has lost since: `Stream.adopt` goes on with what is there
                old.expires_s = now_s + LEASE_S
                return old.opened  # of the present generation from the next frame on, which makes clients ask again
            failed = self._failed.get(request.stream)
            if failed is not None and _same(failed[0], request):
                return Refused(RefusedWhy.FAILED, failed[1])
            self._failed.pop(request.stream, None)
            name = None if request.again else unknown_name(request.names, now)
            if name is not None:
                return unknown(name)
            others = [stream for name, stream in self._streams.items() if name != request.stream]
            refused = _too_many(request, others)
            if refused is not None:
                return refused
            publisher = old.publisher if old else self._declare(request.stream)
            made = Stream(request, publisher, now_s)
            made.adopt(now, self._mirror.open_watcher())  # from here on nothing is left out
            self._streams[request.stream] = made
        return made.opened

    def _declare(self, stream: str) -> zenoh.Publisher:
        return self._session.declare_publisher(
            self._root.key("stream", stream), congestion_control=zenoh.CongestionControl.DROP
        )

    def close(self, stream: str) -> None:
        """End a stream; one that isn't open is fine."""
        with self._lock:
            closed = self._streams.pop(stream, None)
            self._failed.pop(stream, None)
            if closed is not None:
                self._closed.append(closed.publisher)

    def close_all_of(self, client: str) -> None:
        """End the streams of a client that is gone."""
        with self._lock:
            ended = [name for name in (*self._streams, *self._failed) if keys.client_of_view(name) == client]
        for name in ended:
            self.close(name)

    # ------------------------------------------------------------------------------------- by the publisher thread

    def send(self, reader: SegmentReader | None, now_s: float, due_s: float) -> float:
        """Send what is due; returns when to come again, `due_s` at the latest."""
        self._undeclare_closed()
        with self._lock:
            streams = list(self._streams.items())
        for name, stream in streams:
            if now_s >= stream.expires_s:
                self.close(name)
                continue
            if now_s >= stream.due_s:
                more = self._send(name, stream, reader)
                stream.due_s = now_s if more else max(stream.due_s, now_s - stream.request.period_s)
                stream.due_s += 0.0 if more else stream.request.period_s
            due_s = min(due_s, stream.due_s)
        return due_s

    def _send(self, name: str, stream: Stream, reader: SegmentReader | None) -> bool:
        try:
            stream.adopt(self._mirror.now, reader)
            if not matching(stream.publisher):
                return False  # its client subscribes before it asks: it is gone, or not here yet
            frame, more = stream.frame()
            if frame is not None:
                stream.publisher.put(frame)
        except (zenoh.ZError, SegmentError):
            raise
        except Exception as error:
            log.exception("stream %s failed", name)  # all others go on
            self._fail(name, stream, error)
            return False
        return more

    def _fail(self, name: str, stream: Stream, error: Exception) -> None:
        """End a stream that can't be fed; its client is told when it renews it."""
        text = (
            f"the stream can't be fed any more: {type(error).__name__}: {error}; the helper process has logged where; "
            "other streams go on, open one of other elements"
        )
        self.close(name)
        with self._lock:
            while len(self._failed) >= MAX_STREAMS:
                self._failed.pop(next(iter(self._failed)))
            self._failed[name] = (stream.request, text)

    def _undeclare_closed(self) -> None:
        with self._lock:
            closed, self._closed = self._closed, []
        for publisher in closed:
            publisher.undeclare()  # type: ignore[no-untyped-call]  # zenoh's stub leaves the return type out

    def stop(self) -> None:
        """End all streams."""
        for name in list(self._streams):
            self.close(name)
        self._undeclare_closed()


def _same(old: OpenStream, new: OpenStream) -> bool:
    return (old.names, old.period_s) == (new.names, new.period_s)


def _check(request: OpenStream) -> Refused | None:
    problem = None
    if not keys.VIEW_ID.fullmatch(request.stream):
        problem = "its id must be `<client id>-<number>`, the client id of letters and digits"
    elif not request.names or len(request.names) > MAX_NAMES:
        problem = f"name 1 to {MAX_NAMES} elements or entries, got {len(request.names)}"
    elif not MIN_PERIOD_S <= request.period_s <= MAX_PERIOD_S:  # also false for NaN
        problem = f"period_s must be {MIN_PERIOD_S} to {MAX_PERIOD_S}, got {request.period_s}"
    return Refused(RefusedWhy.INVALID, f"the stream can't be opened: {problem}") if problem else None


def _too_many(request: OpenStream, others: list[Stream]) -> Refused | None:
    client = keys.client_of_view(request.stream)
    own = sum(keys.client_of_view(stream.request.stream) == client for stream in others)
    problem = None
    if len(others) >= MAX_STREAMS:
        problem = f"{MAX_STREAMS} streams are open already"
    elif own >= MAX_STREAMS_PER_CLIENT:
        problem = f"this client has {MAX_STREAMS_PER_CLIENT} streams open already"
    return Refused(RefusedWhy.FAILED, f"the stream can't be opened: {problem}; close others first") if problem else None

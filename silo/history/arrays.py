"""Raw samples on the client's side: rows picked apart into arrays, streams of them, and pins."""

import contextlib
import functools
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import msgspec
import numpy as np
import zenoh
from numpy.typing import NDArray

from silo.core.calls import told_class
from silo.decoding import msgpack_decoder
from silo.errors import ConnectionLostError, RefusedError
from silo.history.requests import (
    KeepPin,
    OpenStream,
    PinOpened,
    SampledName,
    SampledRows,
    SampleRows,
    StreamFrame,
    StreamLayout,
    StreamOpened,
)
from silo.net.keys import ClientId, Root
from silo.net.subscribed import Subscribed
from silo.rpc.foreign import Foreign, understood
from silo.rpc.leases import Closing
from silo.segment.picking import Packer, shaped

STAMP_BYTES = 16
MAX_LAYOUTS = 8
MAX_BACKLOG_BYTES = 64 * 2**20  # of frames of at most 1 MB: 3 s of the largest, minutes of small ones
FRAME_BYTES = 256  # what one takes beside its data

_decoder = msgpack_decoder(StreamFrame)

Layouts: TypeAlias = "dict[int, list[Unpacker]]"  # the newest few of a session, by generation


@dataclass(frozen=True)
class SampleArrays:
    """Samples of one element or entry, oldest first: `ticks` and `time_ns` int64 of shape `(n,)`, `values` beside them.

    `values` has the element's own type and shape `(n, *shape of the element)`; elements of several types give a
    structured array, its fields called like the entries' suffixes. Between two samples of an element lie `divider`
    ticks: where there are more, what is between is lost or overwritten. `missed` counts those of a stream that were
    lost directly before the first one here. `why` says why there are none, empty where that isn't known.
    """

    ticks: NDArray[np.int64]
    time_ns: NDArray[np.int64]
    values: NDArray[Any]
    divider: int = 1
    missed: int = 0
    why: str = ""

    def __len__(self) -> int:
        return len(self.ticks)


NO_SAMPLES = SampleArrays(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))


class Unpacker:
    """Makes arrays of the rows of a name. How they are read is found out once: a picture has a million entries."""

    def __init__(self, name: SampledName) -> None:
        self.name = name

    def of(self, rows: SampledRows, missed: int = 0) -> SampleArrays:
        """Return what rows have of it, in arrays of its own. Raises ConnectionLostError for what makes no sense."""
        with understood(f"rows of {self.name.name}", "the helper process"):
            _check_rows(rows)
            return self._of(rows, missed)

    def _of(self, rows: SampledRows, missed: int) -> SampleArrays:
        name, (packer, end) = self.name, self._packing
        words = len(rows.data) // 8 // rows.count if rows.count else 0
        if rows.count and (words * 8 * rows.count != len(rows.data) or end > 8 * words):
            raise ConnectionLostError(f"the helper process sends rows of {name.name} that make no sense")
        found = np.frombuffer(rows.data, "<i8").reshape(rows.count, words) if rows.count else np.zeros((0, 2), np.int64)
        values = shaped(packer.of(found), name.shape, parts=name.is_complex)
        return SampleArrays(found[:, 0].copy(), found[:, 1].copy(), values, name.divider, missed)

    @functools.cached_property
    def _packing(self) -> tuple[Packer, int]:
        """What packs a row of its entries, and where they end."""
        entries = self.name.entries
        if any(entry.offset < STAMP_BYTES or np.dtype(entry.dtype).hasobject for entry in entries):
            raise ValueError("an entry lies where none can be")
        fields = [entry.suffix or f"f{at}" for at, entry in enumerate(entries)]
        ends = [entry.offset + np.dtype(entry.dtype).itemsize for entry in entries]
        return Packer(entries, fields), max([STAMP_BYTES, *ends])


def joined(parts: Sequence[SampleArrays]) -> SampleArrays:
    """Return several stretches of a name as one."""
    if len(parts) == 1:
        return parts[0]
    ticks, time_ns, values = (
        np.concatenate([getattr(part, what) for part in parts]) for what in ("ticks", "time_ns", "values")
    )
    return SampleArrays(ticks, time_ns, values, parts[0].divider, parts[0].missed)


def taken(samples: SampleArrays, which: slice | NDArray[np.intp]) -> SampleArrays:
    """Return some of these samples, by where they are."""
    return replace(samples, ticks=samples.ticks[which], time_ns=samples.time_ns[which], values=samples.values[which])


def after(samples: SampleArrays, tick: int) -> SampleArrays:
    """Return those that came later than a tick."""
    return taken(samples, slice(int(np.searchsorted(samples.ticks, tick, side="right")), None))


class Gathering:
    """The replies to one wish for samples, until all of it is there."""

    def __init__(self, names: Sequence[str]) -> None:
        self._wished = tuple(names)
        self._names: list[SampledName] = []
        self._missing: dict[str, str] = {}
        self._rows: dict[int, list[SampledRows]] = {}
        self._wanted: list[tuple[int, int]] = []
        self._left: list[tuple[int, int]] = []

    @property
    def share(self) -> float:
        """How much of it has come, 0 ... 1, by rows."""
        wanted = sum(end - begin for begin, end in self._wanted)
        left = sum(end - row for row, end in self._left)
        return 1.0 - left / wanted if wanted else 1.0

    def take(self, reply: SampleRows) -> None:
        """Take a reply over."""
        firsts = {rows.group: rows.first for rows in reply.rows}
        self._wanted = self._wanted or [(firsts.get(group, row), end) for group, (row, end) in enumerate(reply.resume)]
        self._left = reply.resume
        self._names = self._names or reply.names
        self._missing.update(reply.missing)
        for rows in reply.rows:
            self._rows.setdefault(rows.group, []).append(rows)

    def samples(self) -> dict[str, SampleArrays]:
        """Return what has come, by name. Raises ConnectionLostError for what makes no sense."""
        with understood("samples", "the helper process"):
            return self._samples()

    def _samples(self) -> dict[str, SampleArrays]:
        found: dict[str, list[SampleArrays]] = {name: [] for name in self._wished}
        for name in self._names:
            rows = self._rows.get(name.group) or [SampledRows(name.group, 0, 0, b"")]
            found[name.name] += map(Unpacker(name).of, rows)
        return {
            name: joined(some)
            if (some := [one for one in parts if len(one)])
            else replace(parts[0] if parts else NO_SAMPLES, why=self._missing.get(name, ""))
            for name, parts in found.items()
        }


class StreamBatch(Mapping[str, SampleArrays]):
    """What came of a stream at once, by name. Arrays are made of a name when it is looked at."""

    def __init__(self, run: str, parts: dict[str, list[tuple[Unpacker, SampledRows, int]]]) -> None:
        self.run = run  # changes with a new start, from which on ticks are counted anew
        self._parts = parts
        self._made: dict[str, SampleArrays] = {}

    def __getitem__(self, name: str) -> SampleArrays:
        if name not in self._made:
            parts = [unpacker.of(rows, missed) for unpacker, rows, missed in self._parts[name]]
            with understood(f"rows of {name}", "the helper process"):
                self._made[name] = joined(parts)
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._parts)

    def __len__(self) -> int:
        return len(self._parts)


@told_class("stream", shared=Subscribed)
class Stream(Subscribed):
    """All samples of some elements or entries as they come. May be used by any thread; iterate over it, or `read()`.

    `missed` counts rows that did not arrive: they were overwritten before they were sent, or this reader was slow.
    """

    def __init__(
        self, request: OpenStream, number: int, renew: Callable[[], None], on_close: Callable[["Stream"], None]
    ) -> None:
        super().__init__(on_close)
        self._request = request
        self.missed = 0
        self.missing: dict[str, str] = {}  # why names have no samples
        self._place = number
        self._renew = renew
        self._opened: Layouts = {}  # of the present session
        self._frames: deque[tuple[Layouts, bytes]] = deque()  # each with what tells how it is read
        self._backlog_bytes = 0
        self._unread: tuple[Layouts, StreamFrame] | None = None  # the one before those
        self._expected: dict[tuple[str, str, int], int] = {}  # by run, name and which of its groups
        self._dropped: dict[tuple[str, int], int] = {}  # rows before the next ones that are read, by name and group
        self._from_first: set[str] = set()  # names of which nothing has come of the run, which began meanwhile
        self._earlier, self._came = -1, 0  # rows that were to come in runs before this one, and of this one did
        self._refused = ""
        self._foreign = Foreign("a frame")

    def attach(self, session: zenoh.Session, root: Root, client: ClientId) -> None:
        """Subscribe in a session; the one before is closed already."""
        name = f"{client.id}-{self._place}"
        subscriber = session.declare_subscriber(root.key("stream", name), self._take)
        with self._changed:
            self._request = msgspec.structs.replace(self._request, stream=name, proof=client.proof)
            self._subscriber = subscriber
            self._opened = {}

    @property
    def request(self) -> OpenStream:
        """What opens it, and has it go on with the row after the last one that was read."""
        expected, rows = self._expected, dict[str, list[int]]()
        for (_, name, place), row in sorted(expected.items()):
            known = rows.setdefault(name, [])
            known += [*[-1] * (place - len(known)), row]  # of a buffer that was full nothing came
        run = next((run for run, *_ in expected), self._request.run)
        return msgspec.structs.replace(self._request, run=run, rows=rows, known=max(self._opened, default=-1))

    def accept(self, opened: StreamOpened) -> None:
        """How to read the frames from now on."""
        with self._changed:
            for one in (*opened.earlier, StreamLayout(opened.generation, opened.names)):
                known = self._opened.get(one.generation)
                if known is None or [unpacker.name for unpacker in known] != one.names:
                    self._opened[one.generation] = list(map(Unpacker, one.names))
            for old in sorted(self._opened)[:-MAX_LAYOUTS]:
                del self._opened[old]
            self.missing, self._refused = opened.missing, ""
            if not self._frames and self._unread is None:  # else some of it is here, and to be read yet
                self.missed += opened.missed
            run = self._request.run or opened.run  # of which it began with what comes
            self._request = msgspec.structs.replace(self._request, again=True, run=run)
            self._changed.notify_all()

    def refuse(self, text: str) -> None:
        """The helper process would not renew the stream."""
        with self._changed:
            self._refused = text
            self._changed.notify_all()

    def _take(self, sample: zenoh.Sample) -> None:
        data = sample.payload.to_bytes()
        with self._changed:
            self._frames.append((self._opened, data))
            self._backlog_bytes += len(data) + FRAME_BYTES
            while self._backlog_bytes > MAX_BACKLOG_BYTES:
                self._drop_oldest()
            self._changed.notify_all()

    def _drop_oldest(self) -> None:
        """Let go of a frame that nobody came to read: its rows are counted, as their run may have no more."""
        layouts, data = self._oldest()
        if self._unread is not None:  # one before it waits to be understood, and shows then what is missing
            return
        with contextlib.suppress(ConnectionLostError):
            frame = self._foreign.read(f"stream {self._request.stream}", functools.partial(_decoded, data))
            if frame is not None and frame.generation in layouts:
                self._batch(frame, layouts[frame.generation], dropped=True)

    def _oldest(self) -> tuple[Layouts, bytes]:
        layouts, data = self._frames.popleft()
        self._backlog_bytes -= len(data) + FRAME_BYTES
        return layouts, data

    def read(self, timeout_s: float | None = None) -> StreamBatch | None:
        """Return the next batch; waits for it, None where none came in time or the stream was closed.

        Raises RefusedError where the helper process ended the stream, ConnectionLostError for frames that can't be
        understood.
        """
        deadline_s = None if timeout_s is None else time.monotonic() + timeout_s
        with self._changed:
            while not self._closed:
                if self._refused:
                    raise RefusedError(self._refused)
                batch = self._next()
                if batch is not None:
                    return batch
                left_s = None if deadline_s is None else deadline_s - time.monotonic()
                if left_s is not None and left_s <= 0:
                    return None
                self._changed.wait(left_s)
        return None

    def _next(self) -> StreamBatch | None:
        while self._unread is not None or self._frames:
            if self._unread is None:
                layouts, data = self._oldest()
                decode = functools.partial(_decoded, data)
                if (read := self._foreign.read(f"stream {self._request.stream}", decode)) is None:
                    continue
                self._unread = layouts, read
            layouts, frame = self._unread
            if layouts is self._opened and frame.generation > max(layouts, default=-1):
                if layouts:
                    self._renew()  # after an edit or a start: how to read it comes
                return None
            self._unread = None
            names = layouts.get(frame.generation)  # of a session that is over, or long ago, nobody tells any more
            if names is not None and (batch := self._batch(frame, names)):
                return batch
        return None

    def _batch(self, frame: StreamFrame, layout: list[Unpacker], *, dropped: bool = False) -> StreamBatch:
        by_group = {rows.group: rows for rows in frame.rows}
        parts: dict[str, list[tuple[Unpacker, SampledRows, int]]] = {}
        # counted by name: another generation numbers groups anew
        expected = {key: row for key, row in self._expected.items() if key[0] == frame.run}
        if self._expected and not expected:  # another run is sent from its first row on
            self._from_first = {name for _, name, place in self._expected if not place}
            if self._earlier >= 0:
                self.missed += max(0, frame.earlier - self._earlier - self._came)
        if frame.earlier != self._earlier:
            self._earlier, self._came = frame.earlier, 0
        missed: dict[int, int] = {}
        new: dict[int, int] = {}
        places: Counter[str] = Counter()
        for unpacker in layout:
            name = unpacker.name
            key = (frame.run, name.name, places[name.name])
            places[name.name] += 1
            some = by_group.get(name.group)
            if some is None:
                continue
            row = expected.get(key, 0 if name.name in self._from_first and not key[2] else some.first)
            gap = max(0, some.first - row)
            new[name.group] = max(new.get(name.group, 0), some.first + some.count - row)
            some = _without(some, row - some.first)
            gap += some.count if dropped else 0
            missed[name.group] = max(missed.get(name.group, 0), gap)
            expected[key] = some.first + some.count
            self._from_first.discard(name.name)
            more = self._dropped.pop(key[1:], 0) + gap
            if dropped or not some.count:
                self._dropped[key[1:]] = more
                continue
            parts.setdefault(name.name, []).append((unpacker, some, more))
        self._expected = expected
        self.missed += sum(missed.values())
        self._came += sum(new.values())
        return StreamBatch(frame.run, parts)

    def __iter__(self) -> Iterator[StreamBatch]:
        while (batch := self.read()) is not None:
            yield batch


def _without(rows: SampledRows, count: int) -> SampledRows:
    """Return rows without the first ones, which came before: a stream goes on where its reader is."""
    if count <= 0:
        return rows
    count = min(count, rows.count)
    data = rows.data[len(rows.data) // rows.count * count :] if rows.count else b""
    return SampledRows(rows.group, rows.first + count, rows.count - count, data)


def _decoded(data: bytes) -> StreamFrame:
    frame: StreamFrame = _decoder.decode(data)
    for rows in frame.rows:
        _check_rows(rows)
    return frame


def _check_rows(rows: SampledRows) -> None:
    """Raise ValueError for rows that can't be reckoned with."""
    if not (0 <= rows.first < 2**62 and 0 <= rows.count <= len(rows.data) // STAMP_BYTES):
        raise ValueError(f"{rows.count} rows from {rows.first} on in {len(rows.data)} bytes")


@told_class("pin")
class Pin(Closing):
    """What a helper process holds for this client: `client.samples(..., pin=pin)` and `client.history` read it.

    It is held until it is closed, over a link that is cut for less than 30 s, and over a new start of the logger.
    """

    def __init__(
        self, names: Sequence[str], opened: PinOpened, renewal: KeepPin, on_close: Callable[["Pin"], None]
    ) -> None:
        self.names = tuple(names)
        self.opened = opened
        self.request = renewal  # what renews its lease
        self.refused = ""  # why it is no more
        self._on_close = on_close

    @property
    def id(self) -> str:
        """Its name in requests."""
        return self.opened.pin

    def refuse(self, text: str) -> None:
        """It is no more."""
        self.refused = text

    def close(self) -> None:
        """Let the helper process forget it; closing twice is fine."""
        self._on_close(self)

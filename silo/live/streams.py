"""Streams: all samples of some names as raw rows, for clients that want every one of them.

Nothing is kept for a client: rows are sent once, and what it doesn't take in time is dropped on the way. Its rows are
numbered, so that it counts what it missed. `Streams` is driven by the publisher thread; opened and closed by any.
"""

import math
import time
from collections import Counter
from collections.abc import Callable, Sequence

import msgspec
import zenoh

from silo.errors import SegmentError
from silo.history.picking import RingGroup, RowSelection, check_known, pick
from silo.history.requests import OpenStream, SampledRows, StreamFrame, StreamLayout, StreamOpened
from silo.history.samples import MAX_NAMES
from silo.live.feeds import Feed, Feeds, Round
from silo.net import keys
from silo.segment.reader import SegmentReader
from silo.state.replica import LoggerSnapshot, Replica
from silo.state.run_follower import Between, is_next, is_over

MIN_PERIOD_S, MAX_PERIOD_S = 0.01, 10.0
MAX_FRAME_BYTES = 2**20  # the rest follows at once
MOST_EARLIER = 7  # words by which frames are read that are on their way: a client keeps one more
BEHIND_BYTES = 8 * MAX_FRAME_BYTES  # so much of what came while a client was away is sent, the newest


class ServedStream(Feed[OpenStream]):
    """A stream that is open."""

    def __init__(self, request: OpenStream, publisher: zenoh.Publisher, now_s: float, between: Between) -> None:
        super().__init__(request, publisher, request.period_s, now_s)
        self._between = between
        self._following: SegmentReader | None = None  # behind the run that is read
        self.opened = StreamOpened(request.stream, -1, [], {})  # how to read the present frames
        self._layouts: tuple[StreamLayout, ...] = ()  # and those before them, which are on their way
        self._table = -1  # the generation of the table that was adopted last
        self._run: str | None = None
        self._reader: SegmentReader | None = None
        self._groups: tuple[RingGroup, ...] = ()
        self._cursors: dict[tuple[int | str, int], int] = {}
        self._earlier_rows = self._rows_of_run = 0  # that were to be sent, of the runs before this one, and of this one
        self._next_s = math.inf  # since when another run is the present one
        self._missed = 0  # by who had it open before, and was not told of it yet
        self._derived: dict[int, str] = {}  # rings of derived signals have no lasting numbers: their names

    @property
    def run(self) -> str:
        """The run that is read; empty for none."""
        return self._run or ""

    def is_due(self, this: Round) -> bool:
        """Also as soon as another run began: the memory of this one stays until it is sent."""
        return super().is_due(this) or (this.reader is not None and self.run not in ("", this.reader.schema.run))

    def prepare(self, this: Round) -> None:
        """Go over to the present table and run; a run that another one came behind is read to its end first."""
        if this.reader is None or self._reader is None or this.reader.schema.run == self._run:
            self.adopt(this.logger, this.reader)

    def adopt(self, now: LoggerSnapshot, reader: SegmentReader | None) -> None:
        """Go over to another table or segment: a stream begins with what comes, and a new run with its first row."""
        if self._table == now.generation and self._reader is reader:
            return
        run = reader.schema.run if reader is not None else ""
        names = self.request.names
        known = [name for name, found in zip(names, now.found_all(names), strict=True) if found is not None]
        picked = pick(known, now, reader.schema if reader is not None else None)
        elements = reader.schema.elements if reader is not None and now.table.derived else ()
        self._derived = {element.ring: element.info.name for element in elements if element.info.expression}
        begun = self._run is not None  # of a logger that starts later nothing is left out
        # a reader may be older than the table, and lack a derived signal for a moment
        before = self._cursors if run == self._run else {}
        self._cursors = {**before}
        for number, group in enumerate(picked.groups):
            key = self._key(group)
            if key in before or reader is None or (begun and run != self._run):
                self._cursors[key] = before.get(key, 0)
            else:
                behind = 0 if begun else BEHIND_BYTES // picked.row_bytes
                head = reader.head(group.ring)
                self._cursors[key] = max(min(self._asked_from(picked, number, run, head), head), head - behind, 0)
        gone = dict.fromkeys(set(self.request.names).difference(known), "it is no longer in the table")
        missing = {**picked.missing, **gone}
        if (picked.names, missing) != (self.opened.names, self.opened.missing) or self.opened.generation < 0:
            # else frames are read as before, and their client needs no other words to read them by
            number = self.opened.generation + 1
            layout = StreamLayout(self.opened.generation, self.opened.names)
            self._layouts = (*self._layouts, layout)[-MOST_EARLIER:]
            self.opened = StreamOpened(self.request.stream, number, picked.names, missing, run or "-")
        if run != self._run:
            self._earlier_rows, self._rows_of_run = self._earlier_rows + self._rows_of_run, 0
        self._next_s, self._following = math.inf, None
        self._table, self._run, self._reader, self._groups = now.generation, run, reader, picked.groups

    def _asked_from(self, picked: RowSelection, number: int, run: str, head: int) -> int:
        """Return the row of a group that its client asks for: of another run than it knows the first."""
        request = self.request
        if not request.run or request.run != run:
            return 0 if request.run else head
        places: Counter[str] = Counter()
        since = []
        for name in picked.names:
            if name.group == number:
                asked = request.rows.get(name.name, [])[places[name.name] : places[name.name] + 1]
                since.append(asked[0] if asked and asked[0] >= 0 else head)
            places[name.name] += 1
        return min(since)

    def told(self, known: int) -> StreamOpened:
        """Return how frames are read, for a client that can read those of generations up to `known`, -1 for none."""
        earlier = [one for one in self._layouts if 0 <= known < one.generation]
        missed, self._missed = self._missed, 0
        return msgspec.structs.replace(self.opened, earlier=earlier, missed=missed)

    def count_missed(self, over: Sequence[tuple[str, int]]) -> None:
        """Count the rows of runs that are over, with their ticks, behind the one that the client knew."""
        runs = [run for run, _ in over]
        if self.request.run in runs and self.request.run != self.run:
            ticks = [count for run, count in over[runs.index(self.request.run) + 1 :] if run != self.run]
            dividers = {name.group: name.divider for name in self.opened.names if self._groups[name.group].after < 0}
            self._missed = sum(-(-count // divider) for count in ticks for divider in dividers.values())

    def _key(self, group: RingGroup) -> tuple[int | str, int]:
        return self._derived.get(group.ring, group.ring), group.after

    def frame(self, this: Round) -> tuple[bytes | None, bool]:
        """Return what came since the last one, encoded: of one run."""
        if this.reader is not None and self._reader is not None and self._reader is not this.reader:
            if self._following is None or not is_next(self._reader, self._following):
                self._following = self._between(self.run, this.reader)
            frame, more = self._rest(self._reader, self._following, this.now_s)
            if frame is not None or not more:
                return frame, more
            between = self._following.schema.run != this.reader.schema.run
            self.adopt(this.logger, self._following if between else this.reader)
            if between:
                return None, True
        return self._rows()

    def _rest(self, before: SegmentReader, following: SegmentReader, now_s: float) -> tuple[bytes | None, bool]:
        """Return what is left of a run; no frame and more to come once that is all."""
        self._next_s = min(self._next_s, now_s)
        try:
            over = is_over(before, following, now_s - self._next_s)
            frame, more = self._rows()
        except SegmentError:
            return None, True  # its files were cut short: the next run goes on
        return frame, more or over

    def _rows(self) -> tuple[bytes | None, bool]:
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
            self._cursors[key] = end = max(begin, rows.first + len(rows))
            self._rows_of_run += end - begin
            if len(rows):
                found.append(SampledRows(number, rows.first, len(rows), rows.words.tobytes()))
                more = more or len(rows) == most
        if not found:
            return None, False
        frame = StreamFrame(self.opened.generation, reader.schema.run, found, self._earlier_rows)
        return msgspec.msgpack.encode(frame), more


class Streams(Feeds[OpenStream, ServedStream]):
    """All streams of all clients."""

    kind, most, most_of_client = "stream", 32, 8

    def __init__(
        self,
        session: zenoh.Session,
        root: keys.Root,
        replica: Replica,
        between: Between,
        knows: Callable[[str], bool] | None = None,
    ) -> None:
        super().__init__(session, root, knows)
        self._replica, self._between = replica, between

    @property
    def reading(self) -> set[str]:
        """The runs that are read."""
        return {one.value.run for one in self._feeds.all()}

    def open(self, request: OpenStream) -> StreamOpened:
        """Open, replace or renew a stream."""
        problem = _problem(request)
        if problem:
            raise self._cant_open(problem)
        # of the present generation from the next frame on, which makes clients ask again
        return self.renewed(request.stream, request).told(request.known)

    def _is_same(self, old: OpenStream, new: OpenStream) -> bool:
        # whatever the table has lost since: `ServedStream.adopt` goes on with what is there
        return (old.names, old.period_s) == (new.names, new.period_s)

    def _check(self, request: OpenStream, _: list[ServedStream]) -> None:
        if not request.again:
            check_known(request.names, self._replica.now)

    def _made(self, request: OpenStream, publisher: zenoh.Publisher) -> ServedStream:
        made = ServedStream(request, publisher, time.monotonic(), self._between)
        made.adopt(self._replica.now, self._replica.open_watcher())  # from here on nothing is left out
        made.count_missed([*self._replica.over])
        return made


def _problem(request: OpenStream) -> str:
    if not keys.VIEW_ID.fullmatch(request.stream):
        return "its id must be `<client id>-<number>`, the client id of letters and digits"
    if not request.names or len(request.names) > MAX_NAMES:
        return f"name 1 to {MAX_NAMES} elements or entries, got {len(request.names)}"
    if not MIN_PERIOD_S <= request.period_s <= MAX_PERIOD_S:  # also false for NaN
        return f"period_s must be {MIN_PERIOD_S} to {MAX_PERIOD_S}, got {request.period_s}"
    return ""

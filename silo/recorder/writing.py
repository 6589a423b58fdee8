"""The writing thread of a recorder: takes rows from a queue of bounded size, and makes parts of them.

Beside the thread that reads, so that a disk that takes its time (a sync of a gigabyte) costs no row as long as there is
room: first in the queue, then in the rings.
"""

import contextlib
import itertools
import logging
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import ParamSpec

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.core.conditions import Conditions
from silo.core.elements import LoggedEvent, RecorderState
from silo.core.quantities.writing import and_more, duration, size_text
from silo.core.recording import RecordedElement
from silo.core.runtime import disk_room, is_at, nearest, sync
from silo.errors import SaveError, SiloError, reason
from silo.files.atomic import check_room, open_part
from silo.files.bags.message_groups import group_samples
from silo.files.bags.metadata import pack_facts
from silo.files.bags.writer import MAX_STAMP_NS, metadata_yaml, write_windows
from silo.files.manifest import ClosedPart, Ledger, RunEntry, part_path
from silo.files.mcap.writer import McapWriter, Write
from silo.files.naming import log_path, next_run_number
from silo.files.parts.events import event_messages
from silo.files.parts.metadata import EVENTS_RING, LOST_METADATA, PART_ATTACHMENT, TOTALS_METADATA
from silo.journal.folders import RECORDINGS, remember_folder
from silo.recorder.event_tail import EventTail
from silo.recorder.layout import ChannelLayout
from silo.recorder.orders import News, Progress, RecordOrder, Report
from silo.recorder.ring_cursor import TOO_SLOW, Drained, Loss
from silo.recovery.parts import finished_part
from silo.segment.layout import RingSchema
from silo.segment.rows import Rows

SYNC_S, SYNC_BYTES = 5.0, 64 << 20  # how often what was written is put on the disk: a power cut loses no more
_NAMES_TOLD = 20

P = ParamSpec("P")

QUEUE_BYTES = 64 << 20
MOST_INDEX_BYTES = 16 << 20  # of a part, in memory: then the next one begins
MOST_HOLE_ROWS = 100_000  # a part holds no larger ones, which whoever reads it would have to fill
MESSAGE_BYTES = 80  # what a sample takes at most of the disk beside its value, for a look ahead
BAD_STAMP = (
    "their time stamps are before 1970 or after 2038, and a file of ROS 2 counts seconds in 31 bits: see to the clock "
    "of the logger"
)
DELETED = "the part that had them was deleted, or its folder, before it was finished"

log = logging.getLogger("silo.recorder")

_NO_END = 2**62  # a tick that never comes
_OF_RECORDERS = ("recording", "recording failed")  # kinds of news for which alone no part is begun


class OpenPart:
    """A part that is open. Every method may raise OSError of the disk."""

    def __init__(
        self,
        folder: Path,
        recorder: str,
        layout: ChannelLayout,
        begin: Mapping[int, int],
        since: Mapping[int, int],
        write: Write | None,
    ) -> None:
        """Make the file, locked as long as it is open; it begins with rows of a run that is recorded `since` some."""
        run_number = next_run_number(folder, recorder)
        self.final = log_path(folder, recorder, run_number, datetime.now().astimezone(), ".mcap")
        self.path = part_path(folder, self.final.name)
        self.layout, self.begin = layout, begin
        self.begun_s = time.monotonic()
        self._file = open_part(self.path)
        status = os.fstat(self._file.fileno())
        self.inode, self.device = status.st_ino, status.st_dev
        self._mcap = McapWriter(self._file, *layout.definitions, write=write)
        self._mcap.attach(PART_ATTACHMENT, "application/zstd", pack_facts(layout.facts(recorder, begin, since)))
        self._rows: dict[int, int] = dict.fromkeys(layout.rings, 0)
        self._span: tuple[int, int] | None = None
        self._synced_s, self._synced_bytes = self.begun_s, 0
        self.lost = self._events = 0

    @property
    def size_bytes(self) -> int:
        """Bytes written."""
        return self._mcap.size_bytes

    @property
    def is_there(self) -> bool:
        """Whether its file still has its name: somebody may have deleted it, or its folder."""
        return is_at(self._file.fileno(), self.path)

    @property
    def index_bytes(self) -> int:
        """Bytes of its index, which is in memory until it is finished."""
        return self._mcap.index_bytes

    @property
    def rows(self) -> dict[int, int]:
        """Rows written, by ring."""
        return dict(self._rows)

    @property
    def samples(self) -> int:
        """Samples written."""
        return sum(rows * len(self.layout.ring_channels[ring]) for ring, rows in self._rows.items())

    def add(self, rows: Rows, elements: list[RecordedElement]) -> None:
        """Write rows of a ring, as samples of these elements, as chunks; all their stamps fit: `stamps_fit`."""
        ring = rows.ring.ring
        times = rows.time_ns
        first, last = int(times.min()), int(times.max())
        groups = group_samples(elements, self.layout.ring_channels[ring], rows.first)
        write_windows(self._mcap, np.ascontiguousarray(times), groups)
        self._rows[ring] += len(rows)
        self._stretch(first, last)

    def add_events(self, events: Sequence[LoggedEvent]) -> None:
        """Write what happened as a chunk of its own."""
        stamped = [_held(event) for event in events]
        layout = self.layout
        records, index, span = event_messages(
            layout.events_channel, stamped, layout.schema.logger, self._mcap.definitions_size
        )
        self._mcap.add_chunk(memoryview(records), *span, index)
        self._events += len(events)
        self._stretch(*span)

    def _stretch(self, first: int, last: int) -> None:
        self._span = (min(first, self._span[0]), max(last, self._span[1])) if self._span else (first, last)

    def note_gone(self, text: str) -> None:
        """Write in place that a run before this one is not whole, where nobody can count what is missing."""
        self._mcap.add_metadata(LOST_METADATA, {"why": text})

    def note_lost(self, ring: int, begin: int, end: int, why: str) -> None:
        """Write in place which rows are missing."""
        names = [element.info.name for element in self.layout.elements if element.watch_ring == ring]
        divider = self.layout.rings[ring].divider
        self._mcap.add_metadata(
            LOST_METADATA,
            {
                "first_tick": str(begin * divider),
                "last_tick": str((end - 1) * divider),
                "samples_of_each": str(end - begin),
                "elements": and_more(names, _NAMES_TOLD),
                "why": why,
            },
        )
        self.lost += (end - begin) * len(names)

    def sync_if_due(self) -> None:
        """Put what was written on the disk, now and then: the end then takes no long time either."""
        due = time.monotonic() - self._synced_s >= SYNC_S and self.size_bytes > self._synced_bytes
        if due or self.size_bytes - self._synced_bytes >= SYNC_BYTES:
            os.fdatasync(self._file.fileno())
            self._synced_s, self._synced_bytes = time.monotonic(), self.size_bytes

    def finish(self) -> int:
        """Write index and summary, sync, and give it its name; returns its size, 0 if it was empty and is removed."""
        with self._file:
            if self._span is None:
                self.path.unlink(missing_ok=True)
                return 0
            self._mcap.add_metadata(TOTALS_METADATA, {"samples": str(self.samples), "lost": str(self.lost)})
            counts = {
                number: self._rows[ring] for ring, channels in self.layout.ring_channels.items() for number in channels
            } | {self.layout.events_channel: self._events}
            text = metadata_yaml(self.layout.template, self.layout.topics, counts, self.final.name, self._span)
            self._mcap.add_metadata("rosbag2", {"serialized_metadata": text})
            self._mcap.finish(counts, *self._span)
            self._file.truncate(self._mcap.size_bytes)  # what a full disk left of a chunk
            os.fsync(self._file.fileno())
            self.path.rename(self.final)
        with contextlib.suppress(OSError):  # some network file systems refuse that
            sync(self.final.parent)
        return self._mcap.size_bytes

    def leave(self) -> None:
        """Let go of a part that can't be finished: it is closed later."""
        self._file.close()


def _held(event: LoggedEvent) -> LoggedEvent:
    """The event at a time that a file can hold."""
    if 0 <= event.at_ns < MAX_STAMP_NS:
        return event
    return msgspec.structs.replace(event, stamp_ns=min(max(event.at_ns, 1), MAX_STAMP_NS - 1))


def stamps_fit(rows: Rows) -> NDArray[np.bool_]:
    """Which rows have time stamps that the format can hold."""
    times = rows.time_ns
    return (times >= 0) & (times < MAX_STAMP_NS)


@dataclass(frozen=True)
class RecorderDisk:
    """The disk as the writer sees it; tests put a slow or a full one in its place."""

    room: Callable[[Path], tuple[int, int]] = disk_room
    write: Write | None = None


class Writing:
    """Owns the writing thread. `put`, `room_bytes` and `end` are for one other thread."""

    def __init__(self, order: RecordOrder, ledger: Ledger, disk: RecorderDisk) -> None:
        self._order, self._ledger, self._disk = order, ledger, disk
        self.totals = Progress(RecorderState.WAITING)
        self.news: deque[News] = deque()  # for the other thread, which takes them
        self.end_news = News(Report)  # of where it failed, or ended
        self._folder = Path(order.folder)
        self._layout: ChannelLayout | None = None
        self._next_rows: dict[int, int] = {}
        self._happening: EventTail | None = None
        self._part: OpenPart | None = None
        self._device: int | None = None  # the disk of the newest part
        self._waiting: list[LoggedEvent] = []  # for a part in which to stand
        self._gone = ""  # likewise
        self._why_lost = ""
        self._holes: dict[int, Loss] = {}  # by ring, rows that are missing, and no row behind them is in the part yet
        self._bad: dict[int, Loss] = {}  # by ring, rows that can't be written, as long as they follow one another
        self._queue: deque[tuple[Callable[[], None], int]] = deque()  # what to do, and bytes of rows in it
        self._queued_bytes = 0
        self._changed = threading.Condition()
        self._ending = False
        self.over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="writing")
        self.start, self.join = self._thread.start, self._thread.join

    @property
    def room_bytes(self) -> int:
        """How much may be put now."""
        return max(0, QUEUE_BYTES - self._queued_bytes)

    @property
    def is_idle(self) -> bool:
        """Whether all that was put is written."""
        return not self._queue

    def put(self, work: Callable[P, None], *args: P.args, **kwargs: P.kwargs) -> None:
        """Have the thread do something, one of the methods below, after all that was put before."""
        size_bytes = sum(one.size_bytes for one in args if isinstance(one, Drained))
        with self._changed:
            self._queue.append((partial(work, *args, **kwargs), size_bytes))
            self._queued_bytes += size_bytes
            self._changed.notify()

    def end(self) -> None:
        """Write what is left, finish the part, and end; returns at once."""
        with self._changed:
            self._ending = True
            self._changed.notify()

    # -------------------------------------------------------------------------------------------------- the thread

    def _run(self) -> None:
        try:
            while self._next():
                work, size_bytes = self._queue[0]
                work()
                with self._changed:  # only now: rows that are being written take memory as well
                    self._queue.popleft()
                    self._queued_bytes -= size_bytes
            self.end_run()
            self._note_end()
        except OSError as error:  # a SaveError, too
            self._fail(str(error) if isinstance(error, SiloError) else f"the disk refused: {reason(error)}")
        except SiloError as error:
            self._fail(str(error))
        except Exception as error:
            log.exception("the recorder failed")
            self._fail(f"{type(error).__name__}: {error}")
        finally:
            self.over.set()

    def _next(self) -> bool:
        """Wait for something to do; False at the end."""
        with self._changed:
            while not self._queue and not self._ending:
                self._changed.wait()
            return bool(self._queue)

    def begin_run(
        self, layout: ChannelLayout, begin: Mapping[int, int], happening: EventTail, gone: str = "",
        missed: Sequence[RunEntry] = (),
    ) -> None:  # fmt: skip
        """Take in that what follows is of another run: the rows with which its rings begin, what happens in it.

        `gone` tells of the runs before it that are not whole, `missed` are those of them that nobody handed over.
        """
        self.end_run()
        self._layout, self._next_rows, self._happening = layout, dict(begin), happening
        self._make_room(0)
        self._gone = "; ".join(filter(None, [self._gone, gone]))
        self._ledger.written.runs += missed
        self._ledger.begin_run(_entry(layout, begin))
        self.totals.state = RecorderState.RECORDING

    def change_conditions(self, conditions: Conditions) -> None:
        """Write from here on with these limits and triggers: a part has one set of them."""
        self._finish_part("limits or triggers changed")
        self._layout = self._present_layout.with_conditions(conditions)
        self._ledger.begin_run(_entry(self._layout, self._next_rows))

    def add_signals(self, layout: ChannelLayout, begin: Mapping[int, int]) -> None:
        """Write from here on what was derived since, too, which begins with these rows: a part has one layout."""
        self._finish_part("signals were derived")
        self._layout = replace(layout, as_bytes=self._present_layout.as_bytes)
        self._next_rows = {**begin, **self._next_rows}
        self._ledger.begin_run(_entry(self._layout, self._next_rows))

    def look_for_events(self) -> None:
        """Take in what happened, also where no rows come."""
        if self._happening is not None:
            self._take_events(self._happening.read())
            self._take_changes()

    def settle(self, closed: Sequence[ClosedPart]) -> None:
        """Take in parts that predecessors left, and that were closed."""
        self._ledger.settle(closed, finished_part, self._part.final.name if self._part is not None else "")
        self._count()

    def write(self, drained: Drained) -> None:
        """Write rows, after what is missing before them."""
        self._see_to_folder()
        self._make_room(self._estimate(drained))
        for loss in drained.losses:
            self._note_lost(loss)
        for rows in drained.rows:
            for stretch, fits in _stretches(rows):
                self._write_rows(stretch) if fits else self._take_bad(stretch)
        if self._part is not None:
            self._part.sync_if_due()
            self._count()
            if why := why_full(self._order, self._part, time.monotonic(), up_to_date=drained.complete):
                self._finish_part(why)

    def _write_rows(self, rows: Rows) -> None:
        self._note_bad(rows.ring.ring)
        layout = self._present_layout
        elements = layout.samples(rows)
        misfits = layout.misfits(rows, elements)
        if misfits:
            self._finish_part("longer bytes than before came")
            layout = self._layout = replace(layout, as_bytes=layout.as_bytes | misfits)
            elements = layout.samples(rows)
        part = self._open_part()
        # before the rows: whatever ends the part, none is there without
        self._take_changes((rows.first + len(rows) - 1) * rows.ring.divider + 1)
        part.add(rows, elements)
        self._next_rows[rows.ring.ring] = rows.first + len(rows)
        self._holes.pop(rows.ring.ring, None)

    def _take_bad(self, rows: Rows) -> None:
        """Leave out rows that no file can hold. Told once they end, or the run does: a wrong clock may stay wrong."""
        ring, first, end = rows.ring.ring, rows.first, rows.first + len(rows)
        if ring not in self._bad:
            self._bad[ring] = Loss(ring, first, end, BAD_STAMP)
        else:
            self._bad[ring] = replace(self._bad[ring], end=end)

    def _note_bad(self, *rings: int) -> None:
        for ring in rings or list(self._bad):
            loss = self._bad.pop(ring, None)
            if loss is not None:
                self._note_lost(loss)

    def _estimate(self, drained: Drained) -> int:
        channels = {ring: len(numbers) for ring, numbers in self._present_layout.ring_channels.items()}
        messages = sum(len(rows) * channels[rows.ring.ring] for rows in drained.rows)
        return drained.size_bytes + MESSAGE_BYTES * messages // 2

    @property
    def _present_layout(self) -> ChannelLayout:
        assert self._layout is not None, "rows come after their run"
        return self._layout

    def _see_to_folder(self) -> None:
        """Go on with another part, in the folder made anew, where somebody deleted the one that is open.

        Raises SaveError where that would be on another disk, OSError.
        """
        part = self._part
        if self._folder.exists() and (part is None or part.is_there):
            self._ledger.take_again()  # somebody else may have made it anew
            return
        if self._device not in (
            None,
            nearest(self._folder).stat().st_dev,
        ):  # a mount that went: beneath it is somebody else's disk
            raise SaveError(
                f"{self._folder} was on another disk, which is not there any more: mount it, and record again"
            )
        self._folder.mkdir(parents=True, exist_ok=True)
        self._ledger.take_again()
        if part is None:
            return
        self._part = None
        part.leave()
        self._ledger.end(part.final.name, 0, part.layout.schema.run, {**part.begin}, {}, 0)
        losses = [Loss(ring, part.begin.get(ring, 0), self._next_rows[ring], DELETED) for ring in part.layout.rings]
        self._next_rows |= {loss.ring: loss.begin for loss in losses}
        for loss in losses:
            if loss.end > loss.begin:
                self._note_lost(loss)

    def _make_room(self, coming_bytes: int) -> None:
        """Keep to the budget, and to what is left free of the disk. Raises NearlyFullError."""
        open_bytes = self._part.size_bytes if self._part is not None else 0
        deleted = self._ledger.trim(self._order.keep_bytes, open_bytes + coming_bytes)
        if deleted:
            log.info("deleted %s to keep to the budget", ", ".join(deleted))
            if earlier := [name for name in deleted if name in self._ledger.written.earlier]:
                what = f"deleted {', '.join(earlier)} of an earlier recording '{self._ledger.name}'"
                self.news.append(News(Report, told=f"{what}, to keep {size_text(self._order.keep_bytes)}"))
        advice = (
            "the recording ended there, and all its parts are finished; make room, or keep less (--keep), and start it "
            "again"
        )
        check_room(self._folder, coming_bytes, self._disk.room, advice)

    def _open_part(self) -> OpenPart:
        if self._part is None:
            told, begin = self._told_at_begin()
            layout = self._present_layout
            entry = self._ledger.written.entry(layout.schema.run)
            since = entry.begin if entry is not None else begin
            # rows that are missing are told where others come behind them: in the part before nobody sees that they are
            begin |= {ring: hole.begin for ring, hole in self._holes.items()}
            part = OpenPart(self._folder, self._order.name, layout, begin, since, self._disk.write)
            self._part, self._device = part, part.device
            for hole in self._holes.values():
                part.note_lost(hole.ring, hole.begin, hole.end, hole.why)
            with contextlib.suppress(OSError, RuntimeError):  # then `silo recover` must be told the folder
                remember_folder(self._folder, RECORDINGS)
            self._ledger.begin(part.final.name, part.inode, part.layout.schema.run)
            self.totals.part = str(part.path)
            if self._gone:
                part.note_gone(self._gone)
                self._gone = ""
            self._add_told(told)
            self._take_events(())
        return self._part

    def _told_at_begin(self) -> tuple[tuple[LoggedEvent, ...], dict[int, int]]:
        """What the parameters are with which a part begins, and its rows."""
        happening = self._happening
        told = happening.parameters_at(self._next_tick) if happening is not None else ()
        # what is told of parameters has the number of the line before: the next line is still to come
        return told, {**self._next_rows, **({EVENTS_RING: self._line_before} if told else {})}

    @property
    def _next_tick(self) -> int:
        """The first tick of which a row is still to come, those left out that are full."""
        rings = self._next_of(self._present_layout)
        ticks = [row * ring.divider for ring, row in rings if not ring.is_full_at(row)]
        return min(ticks, default=max((row * ring.divider for ring, row in rings), default=0))

    def _next_of(self, layout: ChannelLayout) -> list[tuple[RingSchema, int]]:
        """The rings that are read, each with its next row."""
        return [(ring, self._next_rows.get(number, 0)) for number, ring in layout.rings.items()]

    @property
    def _line_before(self) -> int:
        return max(0, self._next_rows.get(EVENTS_RING, 0) - 1)

    def _take_changes(self, until: int = 0) -> None:
        """Write what parameters became at ticks of the part that is open, whose rows go to tick `until` at least.

        What became of them at later ticks is for the next part.
        """
        if self._part is not None and self._happening is not None:
            ends = [(row - 1) * ring.divider + 1 for ring, row in self._next_of(self._part.layout)]
            self._add_told(self._happening.changes_until(max([until, *ends]), self._next_tick))

    def _add_told(self, told: Sequence[LoggedEvent]) -> None:
        if self._part is not None and told:
            self._part.add_events([msgspec.structs.replace(one, number=self._line_before) for one in told])

    def _take_events(self, events: tuple[LoggedEvent, ...]) -> None:
        """Write what happened, if there is a part; where there is none it waits for the next rows, or the end."""
        if self._present_layout.elements:
            self._waiting += events
        if self._part is not None and self._waiting:
            written, self._waiting = self._waiting, []
            self._part.add_events(written)
            self._next_rows[EVENTS_RING] = written[-1].number + 1
            self._count()

    def end_run(
        self, until: int = 0, end: Mapping[int, int] | None = None, *, over: bool = False, died: bool = False
    ) -> None:
        """Finish what there is of a run; a mark that came after the last row may have a part of its own.

        Its event log is to have event `until`. `end` are the rows up to which it was read; `over`: that is all of it;
        `died`: its program ended without a word.
        """
        happening = self._happening
        with contextlib.ExitStack() as closing:
            if happening is not None:
                closing.callback(self._close_events, happening)
            self._note_bad()
            if happening is not None:
                self._take_events(happening.read_last(until, died=died))
                if happening.parameters.has_more(self._next_tick) or any(
                    event.kind not in _OF_RECORDERS for event in self._waiting
                ):
                    self._open_part()
                self._take_changes(_NO_END)
        self._waiting = []
        self._finish_part()
        self._holes = {}
        if happening is not None:
            run = self._present_layout.schema.run
            self._ledger.end_run(run, {**self._next_rows, **(end or {})}, done=over)
            if over:
                self.news.append(News(Report, done=run))
            self._count()
        self.totals.state = RecorderState.WAITING

    def _close_events(self, happening: EventTail) -> None:
        self._happening = None
        happening.close()

    def _note_lost(self, loss: Loss) -> None:
        layout = self._present_layout
        if loss.end - loss.begin > MOST_HOLE_ROWS:
            self._finish_part("many rows are missing after it")
            self._next_rows[loss.ring] = loss.end
        part = self._open_part()  # one that begins here has the hole before its first row
        if loss.end - loss.begin <= MOST_HOLE_ROWS:
            before = self._holes.get(loss.ring)
            self._holes[loss.ring] = loss if before is None else replace(loss, begin=before.begin)
        self._next_rows[loss.ring] = loss.end
        self._why_lost = loss.why
        part.note_lost(loss.ring, loss.begin, loss.end, loss.why)
        lost = (loss.end - loss.begin) * len(layout.ring_channels[loss.ring])
        divider = layout.rings[loss.ring].divider
        text = f"{lost} samples were lost, of ticks {loss.begin * divider} to {(loss.end - 1) * divider}: {loss.why}"
        if loss.why == TOO_SLOW:
            text += "; record fewer elements, make buffers larger, or record to another disk"
        self.news.append(News(Report, told=text, told_run=layout.schema.run, told_tick=loss.begin * divider))
        self._count()

    def _lost_event(self, part: OpenPart) -> LoggedEvent:
        """That no sample is in a part but a loss: rows tell what is missing between them, and here are none."""
        schema = part.layout.schema
        text = f"{part.lost} samples of this run are in no file: {self._why_lost}"
        number = self._next_rows.get(EVENTS_RING, 1)
        return LoggedEvent("lost", text, time.time_ns(), 0, schema.started_ns, schema.logger, schema.run, number)

    def _finish_part(self, why: str = "") -> None:
        """Finish the part that is open; `why`, where the next one goes on with the run."""
        self._see_to_folder()
        self._take_changes()
        part, self._part = self._part, None
        if part is None:
            return
        try:
            if part.lost and not part.samples:
                part.add_events([self._lost_event(part)])
            size = part.finish()
        except OSError:
            part.leave()
            raise
        run = part.layout.schema.run
        self._ledger.end(part.final.name, size, run, {**self._next_rows}, part.rows, part.samples)
        self.totals.part = ""
        if size:
            told = f"{why and f'a part, it goes on in the next ({why}): '}{part.final}"
            self.news.append(News(Report, finished=told, told_run=run, told_tick=self._last_tick(part.layout)))
        self._count()

    @property
    def open_bytes(self) -> int:
        """Bytes of the part that is being written."""
        return self._part.size_bytes if self._part is not None else 0

    def _count(self) -> None:
        """Compute what there is, of the ledger and the part that is open."""
        part = self._part
        run = self._layout.schema.run if self._layout is not None else ""
        sums = self._ledger.sums(run, part.rows if part is not None else None, self._next_rows)
        self.totals.parts, self.totals.lost, self.totals.written_bytes = sums.parts, sums.lost, sums.size_bytes
        self.totals.samples = sums.samples + (part.samples if part is not None else 0)
        self.totals.size_bytes = self._ledger.size_bytes + self.open_bytes

    def _note_end(self) -> None:
        """Have the last words stand at the last tick that it recorded: others may have come by now, of other runs."""
        if self._layout is not None:
            last = self._last_tick(self._layout)
            self.end_news = News(Report, told_run=self._layout.schema.run, told_tick=last)

    def _last_tick(self, layout: ChannelLayout) -> int:
        return max((ring.divider * (row - 1) for ring, row in self._next_of(layout) if row), default=-1)

    def _fail(self, text: str) -> None:
        """End by itself: what was written is finished, if the disk lets it."""
        try:
            self._finish_part()
        except OSError as error:
            text += f"; the last part can't be finished now ({reason(error)}): `silo recover {self._folder}` does it"
        if self._layout is not None:  # what came after the last row, and still comes, nobody counts
            run = self._layout.schema.run
            ticks = max((row * ring.divider for ring, row in self._next_of(self._layout)), default=0)
            self.end_news = News(Report, told_run=run, told_tick=ticks)
            with contextlib.suppress(OSError):
                self._ledger.end_run(run, {}, done=False, gone=text)
        self.totals.text = text
        self.totals.state = RecorderState.FAILED


def _entry(layout: ChannelLayout, begin: Mapping[int, int]) -> RunEntry:
    schema = layout.schema
    channels = {ring: len(numbers) for ring, numbers in layout.ring_channels.items()}
    dividers = {ring.ring: ring.divider for ring in schema.rings}
    return RunEntry(
        schema.run, schema.number, dict(begin), channels=channels, conditions=schema.conditions, dividers=dividers
    )


def _stretches(rows: Rows) -> Iterator[tuple[Rows, bool]]:
    """Rows as stretches that the format can hold, and those that it can't."""
    fits = stamps_fit(rows)
    if fits.all():
        yield rows, True
        return
    bounds = [0, *(np.flatnonzero(np.diff(fits)) + 1).tolist(), len(rows)]
    for begin, end in itertools.pairwise(bounds):
        yield Rows(rows.ring, rows.first + begin, rows.words[begin:end]), bool(fits[begin])


def why_full(order: RecordOrder, part: OpenPart, now_s: float, *, up_to_date: bool) -> str:
    """Return why a part ends here; empty: it doesn't.

    What is not up to date goes on, to half as much again: another one costs time.
    """
    most_bytes = min((limit for limit in (order.split_bytes, order.keep_bytes // 2) if limit), default=0)
    if most_bytes and part.size_bytes >= most_bytes * (1 if up_to_date else 1.5):
        return f"it has {size_text(part.size_bytes)}"
    if part.index_bytes >= MOST_INDEX_BYTES:
        return f"its index has {size_text(MOST_INDEX_BYTES)}"
    if order.split_s and now_s - part.begun_s >= order.split_s and up_to_date:
        return f"it lasts {duration(order.split_s)}"
    return ""

"""A recorder: reads the rings of one run after the other, and has it written.

`run` is driven by the socket of whoever started it. When that end is gone, it finishes what is there and ends.
"""

import contextlib
import os
import select
import socket
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import msgspec
import numpy as np

from silo.core.conditions import Conditions, Derived
from silo.core.elements import RecorderState
from silo.core.quantities.writing import and_more, many
from silo.errors import SaveError, SegmentError, SiloError, reason
from silo.files.event_log import newest_number
from silo.files.manifest import ClosedPart, Ledger, RunEntry, read_written
from silo.files.parts.metadata import EVENTS_RING
from silo.journal.derived_rows import with_derived_rows
from silo.polling import readable
from silo.recorder.event_tail import EventTail
from silo.recorder.layout import ending, layout_of, more_derived
from silo.recorder.orders import (
    MAX_PACKET_BYTES,
    TEXT_BYTES,
    Finish,
    Follow,
    News,
    RecordOrder,
    Report,
    conditions_of,
    decode_command,
    encode,
    recorded_of,
)
from silo.recorder.ring_cursor import DROPPED, LEAST_PERIOD_S, MOST_PERIOD_S, Drained, RingCursor
from silo.recorder.writing import RecorderDisk, Writing
from silo.recovery.parts import close_parts, fewer_rows, left_rows
from silo.segment.reader import SegmentReader
from silo.segment.rows import Rows

FLUSH_S = 0.5  # a chunk at least as often: what a kill can take
FLUSH_BYTES = 4 << 20
CATCH_UP_S = 60.0  # until then what a predecessor left stays open, as to close it takes from what is to catch up
REPORT_S = 1.0
RELEASE_S = 5.0  # how often memory pages of the rings are let go of, which would count as the recorder's own
PREDECESSOR_S = 60.0  # how long one that ends may take to finish its part
MOST_NEWS = 20
MOST_MISSED = 100  # runs that are missing, counted one by one
OLD_RUN_S = 5.0  # a run that doesn't end although the next one began


class Recorder:
    """One recorder. `run` returns when it has ended."""

    def __init__(
        self, order: RecordOrder, sock: socket.socket, calm_down: Callable[[], object] = lambda: None, parent: int = 0
    ) -> None:
        """`calm_down` is called when it has caught up: from then on others may go first. `parent` started it."""
        self._calm_down, self._parent = calm_down, parent or os.getppid()
        self._order, self._socket = order, sock
        self._runs: deque[SegmentReader] = deque()
        self._drain: RingCursor | None = None
        self._pending = Drained()
        self._flushed_s = self._reported_s = self._released_s = time.monotonic()
        self._told: RecorderState | None = None  # what was reported last
        self._why = ""
        self._until = 0  # the event that the log is to have at the end
        self._died = False  # the program, without a word
        self._told_before: list[str] = []  # of the order that had its ledger
        self._gone = ""  # what is to stand in the next part of runs that are not whole
        self._missed: list[RunEntry] = []  # and in the ledger
        self._left_out: list[str] = []  # derived signals that aren't recorded, as was told
        self._last_number = 0  # of the newest run that was begun with
        self._first = True
        self._closer = ThreadPoolExecutor(1, "closing")
        self._closing: Future[tuple[list[ClosedPart], list[str]]] | None = None
        self._settled = False
        self._begun_s = time.monotonic()
        self._next_since_s = 0.0

    def run(self) -> RecorderState:
        """Record until told to end; returns how it ended."""
        try:
            Path(self._order.folder).mkdir(parents=True, exist_ok=True)
            ledger = self._take_name()
        except (SaveError, OSError) as error:
            text = str(error) if isinstance(error, SaveError) else f"can't record to '{self._order.folder}': "
            text += "" if isinstance(error, SaveError) else f"{reason(error)}; choose another folder"
            self._send(Report(RecorderState.FAILED, text))
            return RecorderState.FAILED
        with contextlib.closing(ledger):
            # who had not begun leaves it to who comes next: the order is listed, and may be done by now
            return RecorderState.ENDED if self._is_left() else self._record(ledger)

    def _take_name(self) -> Ledger:
        """Have the ledger, once the order is over whose it was: `left_recordings` has the rule. Raises SaveError."""
        folder, name, mine = Path(self._order.folder), self._order.name, self._order.order
        while True:
            # first without it: who completes an order needs it, for as long as that takes
            written = read_written(folder, name)
            if written is not None and mine in written.orders:
                raise SaveError(f"another recording '{name}' began in {folder} since, and has its place")
            self._settle_before(written.order if written is not None else "")
            ledger = Ledger(folder, name, PREDECESSOR_S, self._parent)
            if mine not in ledger.written.orders and not self._is_unsettled(ledger.written.order):
                return ledger
            ledger.close()

    def _is_unsettled(self, before: str) -> bool:
        """Whether another order has the ledger, and is not over."""
        mine = self._order.order
        if not before or before == mine or (self._order.resume and not mine):
            return False
        from silo.recorder.left_recordings import listed  # only where there was another order

        return listed(before) is not None

    def _settle_before(self, before: str) -> None:
        if self._is_unsettled(before):
            from silo.recorder.left_recordings import settle_order

            def tell(_order: RecordOrder, text: str) -> None:
                self._told_before.append(f"of the recording before this one: {text}")

            self._told_before += settle_order(before, tell, PREDECESSOR_S)
            # as it could not begin at once it does as one that is replaced: with the tick of its order
            self._order = msgspec.structs.replace(self._order, resume=True)

    def _is_left(self) -> bool:
        """Whether who started it is gone, whatever that said before."""
        poll = select.poll()
        poll.register(self._socket, 0)
        return any(found & select.POLLHUP for _, found in poll.poll(0))

    def _record(self, ledger: Ledger) -> RecorderState:
        self._ledger = ledger
        mine, last = self._order.order, ledger.written.order
        if self._order.resume and (not mine or last in ("", mine)):
            ledger.go_on(*left_rows(ledger))
            ledger.written.order = mine or last
        else:  # or it was killed before it began
            ledger.begin_order(mine)
        self._left = ledger.written.run, ledger.written.next_rows
        self._writing = Writing(self._order, ledger, RecorderDisk())
        for text in self._told_before:
            self._tell_clients(text)
        self._look_for_gone()
        self._last_number = max((entry.number for entry in ledger.written.runs), default=0)
        self._writing.start()
        problem = ""
        try:
            while not self._why and not self._writing.over.is_set():
                self._listen(self._period_s)
                self._read()
                self._close_left()
                self._tell()
            self._drain_last()
        except SiloError as error:
            self._flush()
            problem = str(error)
        self._settle()
        self._writing.end()
        totals = self._writing.totals
        while not self._writing.over.wait(REPORT_S):
            totals.state = RecorderState.FINISHING
            self._send(self._report())
        self._writing.join()
        if totals.state is not RecorderState.FAILED:
            totals.state, totals.text = RecorderState.ENDED, self._why
        if problem:
            totals.state, totals.text = RecorderState.FAILED, problem
            if self._drain is not None:
                self._writing.end_news = News(Report, told_run=self._drain.reader.schema.run)
        if gone := ledger.sums().gone:
            totals.text += f"; the end of {many(gone, 'run')} is in no file"
        while self._writing.news:
            self._send(self._report())
        self._send(self._report())
        return totals.state

    def _look_for_gone(self) -> None:
        """Write down which runs this recorder can't go on with: their memory is gone."""
        if self._order.runs is None:
            return
        for entry in self._ledger.written.runs:
            if not entry.done and entry.run not in self._order.runs:
                entry.done, entry.conditions = True, None
                entry.gone = "its memory was gone before"
                number = f"run {entry.number}" if entry.number else "a run"
                self._tell_gone(f"{number} of the logger is not recorded to its end: {entry.gone}")

    def _tell_gone(self, text: str) -> None:
        self._tell_clients(text)
        self._gone = "; ".join(filter(None, [self._gone, text]))

    def on_term(self, _number: int, _frame: object) -> None:
        """Finish soon: the handler of SIGTERM."""
        self._why = self._why or "ended by SIGTERM"

    # --------------------------------------------------------------------------------------------------- the socket

    def _listen(self, timeout_s: float) -> None:
        """Take in what the one who started this says; waits at most so long."""
        while readable(self._socket.fileno(), timeout_s=timeout_s):
            timeout_s = 0.0
            try:
                body, descriptors, _, _ = socket.recv_fds(self._socket, MAX_PACKET_BYTES, 2)
            except ConnectionResetError:  # it is gone and had not read all: told once, before what it had said
                continue
            except OSError:
                body, descriptors = b"", []
            if not body:
                self._why = self._why or "the helper process is gone"
                return
            command = decode_command(body)
            with contextlib.ExitStack() as closing:
                for descriptor in descriptors:
                    closing.callback(os.close, descriptor)
                if isinstance(command, Finish):
                    self._why, self._until, self._died = command.why, command.events, command.died
                    return
                if isinstance(command, Follow):
                    self._follow(command, descriptors)
                elif descriptors:
                    self._change(conditions_of(descriptors[0]), command.tick)

    def _follow(self, command: Follow, descriptors: list[int]) -> None:
        try:
            reader = SegmentReader(command.segment, descriptors[0] if descriptors else None)
            entry = self._ledger.written.entry(reader.schema.run)
            known = entry.conditions if entry is not None and entry.conditions is not None else reader.schema.conditions
            conditions = conditions_of(descriptors[1]) if len(descriptors) > 1 else known
            begun = entry is not None and entry.conditions is not None
            derived = self._more_derived(known.derived, conditions.derived) if begun else conditions.derived
            run = with_derived_rows(reader, derived)
            run.schema = msgspec.structs.replace(
                run.schema, conditions=msgspec.structs.replace(conditions, derived=derived)
            )
            self._runs.append(run)
        except SegmentError as error:
            self._tell_clients(f"a run can't be recorded: {error}")
        self._next_since_s = time.monotonic()

    def _change(self, conditions: Conditions, tick: int) -> None:
        """Have limits and triggers of the newest run be others from a tick on, and more signals be computed."""
        if self._runs:
            self._runs[-1] = self._computing(self._runs[-1], conditions)
        elif self._drain is not None:
            self._read_some(self._drain, tick)
            while not self._pending.complete and self._writing.room_bytes > self._pending.size_bytes:
                self._read_some(self._drain, tick)
            self._flush(tick)
            drain, before = self._drain, recorded_of(self._drain.reader.schema.conditions)
            run = self._computing(drain.reader, conditions)
            if run is not drain.reader:
                self._drain = drain.going_on(run, layout_of(run.schema, self._order.patterns))
            if self._drain.layout.elements != drain.layout.elements:
                self._writing.put(self._writing.add_signals, self._drain.layout, dict(self._drain.cursors))
            elif recorded_of(run.schema.conditions) != before:
                self._writing.put(self._writing.change_conditions, run.schema.conditions)

    def _computing(self, run: SegmentReader, conditions: Conditions) -> SegmentReader:
        """The run with these limits and triggers, and the signals that were derived since; itself where there are none.

        Those that it was recorded with stay as they are: by their place among all is told which row of a file is whose.
        """
        before = run.schema.conditions.derived
        derived = self._more_derived(before, conditions.derived)
        if derived != before:
            try:
                with contextlib.ExitStack() as undoing:
                    more = with_derived_rows(SegmentReader(run.path, run.fileno()), derived)
                    undoing.callback(more.close)
                    layout_of(more.schema, self._order.patterns)  # which may have too many topics
                    undoing.pop_all()
            except SiloError as error:
                self._tell_clients(f"what is derived now is not recorded in this run: {error}")
                derived = before
            else:
                run.close()
                run = more
        run.schema = msgspec.structs.replace(
            run.schema, conditions=msgspec.structs.replace(conditions, derived=derived)
        )
        return run

    def _more_derived(self, before: tuple[Derived, ...], now: tuple[Derived, ...]) -> tuple[Derived, ...]:
        derived, left_out = more_derived(before, now)
        if left_out and left_out != self._left_out:
            self._left_out = left_out
            self._tell_clients(
                f"{and_more(left_out, 5)}: not recorded in this run, as what it is computed of was derived anew, or "
                "removed, and is recorded as it was"
            )
        return derived

    @property
    def _period_s(self) -> float:
        if self._told is None:  # whoever started it waits for its first words
            return LEAST_PERIOD_S
        return self._drain.period_s if self._drain else MOST_PERIOD_S

    def _tell(self) -> None:
        """Report what is new at once, else each second; with a run that is to come, first whether it is recorded."""
        now_s, state = time.monotonic(), self._writing.totals.state
        begins = self._told is None and state is RecorderState.WAITING and self._order.runs != ()
        if (state is not self._told and not begins) or now_s - self._reported_s >= REPORT_S or self._writing.news:
            self._reported_s, self._told = now_s, state
            self._send(self._report())

    def _report(self) -> Report:
        writing = self._writing
        one = writing.news.popleft() if writing.news else writing.end_news
        if len(writing.news) > MOST_NEWS:  # a disk that is too slow for ever: the sum is told
            now = [writing.news.popleft() for _ in range(len(writing.news))]
            kept = [news for news in now if not {"told", "told_run"} <= {*news.keywords}]  # all but losses
            writing.news.extendleft(kept[::-1])
        totals = writing.totals
        told = {"text": totals.text[:TEXT_BYTES], "written_bytes": totals.written_bytes + writing.open_bytes}
        return one(**{**msgspec.structs.asdict(totals), **told})

    def _tell_clients(self, text: str) -> None:
        self._writing.news.append(News(Report, told=text[:TEXT_BYTES]))

    def _send(self, report: Report) -> None:
        """Whoever doesn't read gets the next one: nothing waits for it, but for the last one."""
        flags = 0 if report.state.over else socket.MSG_DONTWAIT
        with contextlib.suppress(OSError):  # gone: the files tell it all
            self._socket.send(encode(report), flags)

    # ---------------------------------------------------------------------------------------------------- the rings

    def _read(self) -> None:
        if self._drain is None and not self._begin_run():
            return
        assert self._drain is not None
        now_s = time.monotonic()
        self._read_some(self._drain)
        if now_s - self._flushed_s >= FLUSH_S or self._pending.size_bytes >= FLUSH_BYTES:
            self._flush()
        if now_s - self._released_s >= RELEASE_S:
            self._released_s = now_s
            self._drain.reader.release_pages()
        late = bool(self._runs) and now_s - self._next_since_s > OLD_RUN_S
        if self._pending.complete and (late or (self._drain.done() and (self._runs or self._happening.has_ended()))):
            self._end_run()

    def _end_run(self, until: int = 0, *, died: bool = False) -> None:
        drain = self._drain
        assert drain is not None
        self._flush()
        # not by `is_over`: it may have logged more, and ended, since its rows were read
        over = died or bool(self._runs) or drain.done()
        self._writing.put(self._writing.end_run, until, dict(drain.cursors), over=over, died=died)
        drain.reader.close()
        self._drain = None

    def _read_some(self, drain: RingCursor, *until: int) -> None:
        """Read what there is room for, `until` a tick; the rest stays in the rings."""
        room = self._writing.room_bytes - self._pending.size_bytes
        if room <= 0:
            drain.is_held_up = True
            self._pending = Drained(self._pending.rows, self._pending.losses, complete=False)
            return
        found = drain.read(min(room, FLUSH_BYTES * 2), *until)
        if found.losses:
            self._flush()  # what came before the rows that are missing stands before them
        self._pending = Drained(
            [*self._pending.rows, *found.rows], [*self._pending.losses, *found.losses], found.complete
        )
        if found.again:
            self._read_some(drain, *until)

    def _flush(self, *until: int) -> None:
        self._flushed_s = time.monotonic()
        pending, self._pending = self._pending.at(*until) if until else (self._pending, Drained())
        if pending.rows or pending.losses:
            self._writing.put(self._writing.write, joined(pending))
        self._writing.put(self._writing.look_for_events)

    def _close_left(self) -> None:
        """Close what predecessors left, once this recorder has caught up, and has the time."""
        if self._closing is None:
            caught_up = self._pending.complete and self._writing.is_idle and self._drain is not None
            if caught_up or time.monotonic() - self._begun_s > CATCH_UP_S:
                self._calm_down()
                self._closing = self._closer.submit(close_parts, self._ledger.folder)
        elif not self._settled and self._closing.done():
            self._settle()

    def _settle(self) -> None:
        if self._settled:
            return
        self._settled = True
        closed, problems = self._closing.result() if self._closing else close_parts(self._ledger.folder)
        for text in [*(part.text for part in closed), *problems]:
            self._tell_clients(text)
        if lost := fewer_rows(closed, self._order.name, *self._left):
            self._tell_clients(f"the part that a killed recorder left was damaged: {lost} rows of it are lost")
        self._writing.put(self._writing.settle, closed)

    def _begin_run(self) -> bool:
        while self._runs:
            reader = self._runs.popleft()
            schema = reader.schema
            entry = self._ledger.written.entry(schema.run)
            if entry is not None and entry.done:
                self._writing.news.append(News(Report, done=schema.run))
                reader.close()
                continue
            layout = layout_of(schema, self._order.patterns)
            begin = self._begin_of(reader)
            begin = begin and layout.filled(begin, entry.begin if entry is not None else {})
            self._last_number = max(self._last_number, schema.number)
            self._first = False
            self._drain = drain = RingCursor(reader, layout, begin)
            since = begin.get(EVENTS_RING, 0) if begin is not None else newest_number(schema.folder, schema.logger) + 1
            self._announce(drain, since)
            return True
        return False

    def _begin_of(self, reader: SegmentReader) -> dict[int, int] | None:
        """With which rows to begin: None for what comes from now on."""
        schema, order = reader.schema, self._order
        if self._first and not order.resume:
            return {} if order.order and schema.run != order.run else None
        known = self._ledger.rows_of(schema.run)
        if known is not None:
            return dict(known)
        if schema.run == order.run:
            return {ring.ring: ring.rows_before(order.tick) for ring in schema.rings}
        self._look_for_missed(schema.number)
        return {}

    def _look_for_missed(self, number: int) -> None:
        """Write down which runs before this one nobody handed over: their numbers tell that there were some."""
        last = self._last_number
        missed = number - last - 1 if last and number else 0
        if missed > 0:
            first = max(last, number - 1 - MOST_MISSED) + 1
            self._missed += [RunEntry("", one, done=True, gone=DROPPED) for one in range(first, number)]
            runs = f"runs {last + 1} to {number - 1}" if missed > 1 else f"run {last + 1}"
            self._tell_gone(f"{runs} of the logger {'are' if missed > 1 else 'is'} not recorded: {DROPPED}")

    def _announce(self, drain: RingCursor, since: int) -> None:
        """Have a run begin in the files, with events from `since` on; tell what can't be recorded without end."""
        layout = drain.layout
        if not layout.elements:
            self._tell_clients(f"nothing of this run is recorded: no element matches {' '.join(self._order.patterns)}")
        elif names := ending(layout):
            self._tell_clients(
                "set buffer=looping to record without end: elements come to an end when their buffers are full "
                f"({and_more(names, 5)}), those that grow when there is no memory"
            )
        self._happening = EventTail(drain.reader, since)
        begin = {**drain.begun_with, EVENTS_RING: since}
        self._writing.put(self._writing.begin_run, layout, begin, self._happening, self._gone, self._missed)
        self._gone, self._missed = "", []

    def _drain_last(self) -> None:
        """Take what is in the rings now, however long the disk takes."""
        while (self._drain is not None or self._begin_run()) and not self._writing.over.is_set():
            assert self._drain is not None
            self._read_some(self._drain)
            if self._pending.complete:
                last = not self._runs
                self._end_run(self._until if last else 0, died=last and self._died)
            else:
                self._flush()
                self._writing.over.wait(0.01)


def joined(pending: Drained) -> Drained:
    """Rows of a ring that follow one another as one stretch: each makes a chunk.

    Where rows are missing between two stretches of a ring nothing is joined.
    """
    by_ring: dict[int, list[list[Rows]]] = {}
    for rows in pending.rows:
        stretches = by_ring.setdefault(rows.ring.ring, [])
        if stretches and stretches[-1][-1].first + len(stretches[-1][-1]) == rows.first:
            stretches[-1].append(rows)
        else:
            stretches.append([rows])
    found = [_one(stretch) for stretches in by_ring.values() for stretch in stretches]
    return Drained(found, pending.losses, pending.complete)


def _one(stretch: list[Rows]) -> Rows:
    if len(stretch) == 1:
        return stretch[0]
    return Rows(stretch[0].ring, stretch[0].first, np.concatenate([rows.words for rows in stretch]))

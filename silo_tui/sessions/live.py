"""One open logger: its table, its pending edits, its newest values, and what can be asked of it.

Screens read its parts and call its coroutines; it draws nothing and asks nothing. Errors of the logger are raised.
"""

import asyncio
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.conditions.standing import LimitStatus, TriggerStatus
from silo.core.arrays.columns import MAX_COLUMNS, ColumnStore, HistoryColumns, grid_of
from silo.core.conditions import Bounds, TriggerOptions, new_trigger
from silo.core.elements import SLOW_SHARE, ElementInfo, LoggedEvent, SavedFile, State, Status
from silo.core.episodes.words import next_marks
from silo.core.names import Found, Names
from silo.core.quantities.writing import count, many
from silo.core.structs import alike
from silo.errors import RefusedError, SiloError
from silo.live.quantities import SLOW
from silo.recorder.requests import RecorderInfo
from silo.recordings.requests import Recordings
from silo.rpc.frames import Frame
from silo.rpc.published import Event, EventKind
from silo.rpc.refusals import RefusedWhy
from silo.settings.typed import ElementSettings, apply_settings
from silo.state.requests import EditsApplied, Unsaved
from silo_tui.model.drawing.plots import trends
from silo_tui.model.lists.conditions import beyond_all
from silo_tui.model.lists.happened import newest, of_last_run
from silo_tui.model.lists.recorders import WritingPace
from silo_tui.model.samples.live import LiveValues
from silo_tui.model.samples.source import PlotSource, Samples
from silo_tui.model.table.cells import limit_word_shown
from silo_tui.model.table.columns import LIVE_COLUMNS, TableColumn
from silo_tui.model.table.facts import Facts
from silo_tui.model.table.fields import options_of, rows_of
from silo_tui.model.table.rows import RowList
from silo_tui.model.table.state import TableState
from silo_tui.model.words.names import below
from silo_tui.sessions.kept import Had, Lent
from silo_tui.sessions.link import Link, ViewRequest
from silo_tui.sessions.parameters import Knobs
from silo_tui.sessions.recordings import Fetching

if TYPE_CHECKING:
    from silo.analysis.reports import ElementReport
    from silo.conditions.requests import TriggerTried
    from silo_tui.model.plots.overlay import Overlay

AHEAD_NS = 2_000_000_000
QUIET_NS, QUIET_COLUMNS = 60_000_000_000, 60  # for how long a new trigger should not have fired
FIRST_EVENTS = 300  # lines of the event log at first, 30 kB on a thin link
RECORDERS_S = 5.0  # after which it is asked again how those stand that the head tells of
NO_STATUS = Status(
    logger="", host="", user="", pid=0, helper_pid=0, state=State.STOPPED, revision=-1, frequency_hz=0.0,
    measured_hz=0.0, ticks=0, started_ns=0, last_tick_ns=0, lost=0, elements=0, enabled=0, entries=0, max_time_s=0.0,
    prefix="", folder="", script="",
)  # fmt: skip

SLOW_TOLD_S = 15.0  # after the loop was slow rates of elements, measured over ten of their samples, tell of it

_CONDITION_KINDS = {
    EventKind.TRIGGERED, EventKind.CAPTURED, EventKind.BLIND, EventKind.LIMIT, EventKind.LIMIT_ENDED,
    EventKind.CONDITIONS, EventKind.STARTED, EventKind.STOPPED, EventKind.SCRIPT_LOADED,
    EventKind.EDITED,
}  # fmt: skip


class LiveSource:
    """A live logger as a source of plots."""

    live = True
    begin_ns = 0

    def __init__(self, session: "Session") -> None:
        self._session = session

    @property
    def happened(self) -> Sequence[LoggedEvent]:
        """What happened in the newest run."""
        return of_last_run(self._session.happened)

    @property
    def end_ns(self) -> int:
        """The time of the newest frame, or of the last tick."""
        status = self._session.status
        running = self._session.running and self._session.frame_time_ns
        return self._session.frame_time_ns if running else (status.last_tick_ns or self._session.frame_time_ns)

    def element(self, name: str) -> ElementInfo | None:
        """Return the element of that name."""
        row = self._session.table.row(name)
        return self._session.table.elements[row] if row is not None else None

    def period_ns(self, element: str) -> int:
        """Return the time between two samples."""
        row = self._session.table.row(element)
        divider = int(self._session.table.server[1, row]) if row is not None else 1
        return int(1e9 * divider / (self._session.status.frequency_hz or 1.0))

    def is_live(self, element: str) -> bool:
        """Return whether the element is on."""
        row = self._session.table.row(element)
        return row is not None and self._session.table.is_live(row)

    async def history(self, names: Sequence[str], start_ns: int, end_ns: int, column_ns: int) -> HistoryColumns:
        """Return columns straight from the logger's buffers.

        What came after `end_ns` until the logger answers is in it too: frames that a new view brings go on from there.
        """
        if end_ns <= start_ns:
            names = ()
        ahead = min(AHEAD_NS, (MAX_COLUMNS - 2) * column_ns - (end_ns - start_ns))
        asked = end_ns + max(0, ahead) if end_ns >= self.end_ns else end_ns
        past = await self._session.connection.history(names, start_ns, asked, column_ns)
        newest = end_ns if past.until_ns is None else max(end_ns, min(asked, past.until_ns))
        count = max(0, newest // column_ns + 1 - past.first)
        marks = None if past.marks is None else past.marks[:, :count]
        return replace(past, low=past.low[:, :count], high=past.high[:, :count], marks=marks)

    async def samples(self, name: str, start_ns: int, end_ns: int) -> Samples:
        """Return raw samples straight from the logger's buffers."""
        return (await self._session.connection.samples([name], start_ns, end_ns + 1))[name]


class Session:
    """State and commands of one logger. Lives in the event loop."""

    def __init__(self, name: str, columns: Sequence[TableColumn] = LIVE_COLUMNS) -> None:
        self.name = name
        self.address = ""  # shown in place of host and name where another logger has both
        self.link: Link | None = None
        self.source: PlotSource = LiveSource(self)
        self.status = NO_STATUS
        self.may_edit = True
        self.why_not = ""  # in words of `silo.net.access.senders`
        self.identity = ""  # ours, as the logger knows it
        self.own_name = ""  # and as events speak of us
        self.table = TableState()
        self.rows = RowList(self.table, columns)
        self.live = LiveValues()
        self.columns = ColumnStore((), 1, 1)
        self.reading = ""  # how far a file, or a table over a thin link, is read that takes long
        self.measured_hz = 0.0
        self.idle_s = 0.0  # since the last tick, as far as the logger told
        self.ticks = 0
        self.lost_total = 0
        self.frame_time_ns = 0
        self.lost_since: float | None = None  # monotonic, when the link was lost
        self.saves: dict[int, Event] = {}  # the newest event of each save
        self.fetches: dict[str, Fetching] = {}  # what is on its way here, by name
        self.overlay: Overlay | None = None  # a saved run over the plots
        self._said_closed = False  # the program that is connected, since it is
        self.lent = Lent(self)
        self._left: tuple[Status, Had] | None = None  # with the link, until all is read anew
        self.made_trigger = ""  # the one that was made last
        self.near = ""  # the filter of what was near a limit when that was looked at last, and when that was
        self.near_ns = 0
        self.filter_words: dict[str, str] = {}  # what filters of views that were looked at let pass, in words
        self.typed_before: dict[tuple[str, str], dict[str, str]] = {}  # into forms that were left, see `Form`
        self.left_files: list[SavedFile] = []  # of a robot program that died
        self.happened: list[LoggedEvent] = []  # the newest lines of the event log
        self._slow_s = -SLOW_TOLD_S  # monotonic, when the loop was slow last
        self.jitter_s = 0.0  # of the loop, as the newest survey says
        self.triggers: list[TriggerStatus] = []
        self.limits: list[LimitStatus] = []  # worst first
        self.bounds: dict[str, Bounds] = {}  # of each scalar with limits: red low, yellow low, yellow high, red high
        self._recorders_due_s = 0.0  # monotonic
        self.recorders: list[RecorderInfo] = []  # endless recordings, as they were asked for last
        self.paces: dict[str, WritingPace] = {}  # how fast each of them writes
        self.knobs = Knobs()
        self.conditions_due = True  # something happened to them since they were asked for
        self.rows_of: dict[str, ElementReport] = {}  # what a file tells, by element
        self._entry_counts: dict[tuple[str, ...], list[int]] = {}

    # ------------------------------------------------------------------------------------------------ what is

    @property
    def running(self) -> bool:
        """Whether the logger collects."""
        return self.status.state is State.RUNNING

    @property
    def dead(self) -> bool:
        """Whether the robot process is gone (the helper still answers)."""
        return self.status.state is State.DEAD

    @property
    def connected(self) -> bool:
        """Whether somebody answers."""
        return self.link is not None and self.lost_since is None

    @property
    def connection(self) -> Link:
        """The connection to the logger. RefusedError when there is none yet."""
        if self.link is None:
            raise RefusedError(f"not connected to {self.name} yet")
        return self.link

    @property
    def at_s(self) -> float | None:
        """The moment of a file whose values are shown; None of a logger, whose values are the newest."""
        return None

    def facts_words(self, width: int, *, wide: bool) -> list[tuple[int, str, str]]:
        """Return what the bar says of a file, as much of its name as fits; nothing of a logger."""
        return []

    def trouble(self, room: int) -> str:
        """Return what a file lacks, in so many letters."""
        return ""

    def trends(self, rows: Sequence[int], width: int) -> dict[int, str]:
        """Return the newest columns of the first entry of each row, drawn in so many cells."""
        drawn = [row for row in rows if self.table.is_live(row) and self.table.drawn_name(row)]
        names = [self.table.drawn_name(row) for row in drawn]
        return {**dict.fromkeys(rows, " " * width), **dict(zip(drawn, trends(self.columns, names, width), strict=True))}

    @property
    def lost_s(self) -> float | None:
        """For how long there has been no link; None where there is one."""
        return None if self.lost_since is None else time.monotonic() - self.lost_since

    @property
    def closed(self) -> bool:
        """Whether nobody answers because the robot program closed its logger: nothing is wrong."""
        return self.lost_since is not None and self._said_closed

    def try_now(self) -> None:
        """Look for the logger at once, where the link is lost."""
        if self.link is not None:
            self.link.try_now()

    @property
    def fresh(self) -> bool:
        """Whether the values on the screen are of now."""
        return self.connected and not self.dead

    @property
    def loop_slow(self) -> bool:
        """Whether the loop as a whole is slower than it should be."""
        return self.running and 0 < self.measured_hz < SLOW_SHARE * self.status.frequency_hz

    @property
    def rate_hz(self) -> float:
        """How many ticks the loop makes per second: as it was told, or as was measured of one that is slower."""
        return self.measured_hz if self.loop_slow else self.status.frequency_hz

    @property
    def run_seconds(self) -> float:
        """How long the logger has been running, or did run, whatever cuts it had since."""
        end = max(self.frame_time_ns if self.running else 0, self.status.last_tick_ns)
        return max(0.0, (end - self.status.run_began_ns) / 1e9) if self.status.started_ns else 0.0

    def short_name(self, name: str) -> str:
        """Return a name without the prefix that all names share."""
        return below(self.status.prefix.rstrip("/"), name)

    def told(self, words: str) -> str:
        """Return what the robot told as it is shown: signals by their short names, files of its folder by theirs."""
        folder = self.status.folder.rstrip("/")
        return self.table.shown(words.replace(f"{folder}/", "") if folder else words)

    # ------------------------------------------------------------------------------------------------ commands

    async def attach(self, link: Link) -> None:
        """Take a new connection and reads everything once."""
        self.link = link
        await self._read_all()
        self.lost_since = None if link.connected else time.monotonic()

    async def _read_all(self) -> None:
        hello = await self.connection.call(lambda client: client._hello())
        self.may_edit, self.why_not = hello.may_edit, hello.why_not
        self.identity = self.connection.identity
        self.take_status(hello.status)
        await self.reload()
        await self.learn_events()

    async def reload(self) -> None:
        """Read the table again; pending edits are rebased on it."""
        there = self.status.elements

        def tell(share: float) -> None:
            self.reading = f"reading the table: {count(round(share * there))} of {many(there, 'element')}"

        try:
            table = await self.connection.call(lambda client: client.table(tell))
        finally:
            self.reading = ""
        if table.revision != self.table.revision or not len(self.table):
            self.table.load(table)
            self.table.take_beyond(self._beyond())  # limits may have been known before: of whose entries is known now
            self.rows.refresh()
            self._entry_counts.clear()

    async def learn_events(self) -> None:
        """Read what happened since the newest line that is here; nothing where that is refused now."""
        since = self.happened[-1].number if self.happened else 0
        try:
            found = await self.connection.read(lambda client: client.events(since, FIRST_EVENTS))
        except RefusedError:
            return
        known = {one.number for one in self.happened}  # what came meanwhile, or was read by who asked beside us
        more = [one for one in found if one.number not in known]
        self.happened = newest(sorted([*self.happened, *more], key=lambda one: one.number))

    async def turns_true(self, condition: str) -> "TriggerTried":
        """Return when a condition turned true in all that is held. Raises a SiloError where that can't be told."""
        return await self.tried(TriggerOptions("find", condition))

    async def tried(self, trigger: TriggerOptions) -> "TriggerTried":
        """Return what a trigger would have done in all that is held. Raises a SiloError where that can't be told."""
        return await self.connection.read(lambda client: client.try_trigger(trigger))

    async def new_trigger(self, name: str, level: str = "", *, falling: bool = False) -> TriggerOptions:
        """Return a new trigger on a scalar, at a level, or at one beyond all of the last minute: it would not fire."""
        short = self.short_name(name).lstrip("/")
        when = f"{short} {'<' if falling else '>'} {level}" if level else await self._beyond_all(name, short)
        return new_trigger(short.rpartition("/")[2], when)

    async def _beyond_all(self, name: str, short: str) -> str:
        scalar, end_ns = self.table.scalar(name), self.source.end_ns
        if scalar is None or (entry := scalar[1]).dtype[1:2] in "SU":
            return ""
        past = await self.source.history([name], end_ns - QUIET_NS, end_ns, QUIET_NS // QUIET_COLUMNS)
        low, high = (edges[np.isfinite(edges)] + past.bases.get(0, 0) for edges in (past.low, past.high))
        return beyond_all(short, entry, float(low.min()), float(high.max())) if low.size else ""

    async def mark(self, words: str, at_ns: int) -> LoggedEvent:
        """Mark the tick of a moment; of a logger that has no tick yet, the moment is now."""
        return await self.connection.call(lambda client: client.mark(words, at_ns=at_ns or None))

    async def say_of_episode(self, word: str, name: str) -> LoggedEvent:
        """Mark that an episode begins or ends, or how it went. Raises ElementError where there is none."""
        await self.learn_events()  # one that began may be on its way
        marks = next_marks(self.happened, word, name)
        return [await self.mark(text, 0) for text in marks][-1]

    async def refresh_status(self) -> None:
        """Ask for the status."""
        self.take_status(await self.connection.call(lambda client: client.status()))

    async def recordings(self, most: int = 200) -> Recordings:
        """Ask for the newest recordings: 200 are 40 kB, which a thin link carries in 5 s."""
        return await self.connection.read(lambda client: client.recordings(most))

    async def fetch(self, name: str, folder: Path, fetching: Fetching) -> Path:
        """Copy a recording into a folder of this machine; takes as long as it takes."""
        return await self.connection.aside(lambda client: client.fetch(name, folder, fetching.progress))

    async def delete_recording(self, name: str) -> str:
        """Delete a recording; return what was deleted, in words."""
        return await self.connection.call(lambda client: client.delete_recording(name))

    @property
    def recorders_are_due(self) -> bool:
        """Whether something records, of which nobody asked for a while how it stands."""
        return self.connected and self.status.recorders > 0 and time.monotonic() >= self._recorders_due_s

    async def refresh_recorders(self) -> None:
        """Ask how endless recordings stand."""
        self._recorders_due_s = time.monotonic() + RECORDERS_S
        self.recorders = await self.connection.read(lambda client: client.recorders())
        now_s = time.monotonic()
        self.paces = {
            one.name: self.paces[one.name].next(now_s, one.written_bytes)
            if one.name in self.paces
            else WritingPace(now_s, one.written_bytes)
            for one in self.recorders
        }

    async def refresh_conditions(self) -> None:
        """Ask how triggers and limits stand."""
        self.conditions_due = False
        try:
            self.triggers = (await self.connection.read(lambda client: client.triggers())).triggers
            self.limits = (await self.connection.read(lambda client: client.alarms())).limits
            self.table.limits = {one.name: one for one in self.limits}
            self.bounds = {one.name: one.bounds for one in self.limits if any(each is not None for each in one.bounds)}
            self.table.take_beyond(self._beyond())
        except (SiloError, asyncio.CancelledError):
            self.conditions_due = True  # nobody knows: asked again
            raise

    def limits_shown(self) -> list[LimitStatus]:
        """Return how limits stand beside the numbers of the newest picture; of the others as they were judged last."""
        now, found = self.live, []
        for one in self.limits:
            reading, row = now.readings.get(one.name), self.table.row(one.name)
            word = one.word
            if row is not None and reading is not None and reading.time_ns == now.time_ns and len(reading.newest):
                word = limit_word_shown(self.table, row, one, reading)
            found.append(msgspec.structs.replace(one, word=word))
        return found

    def _beyond(self) -> dict[str, str]:
        found: dict[str, str] = {}
        for one in self.limits:  # the worst come first
            if one.is_over:
                scalar = self.table.scalar(one.name)
                found.setdefault(scalar[0].name if scalar is not None else one.name, one.word.value)
        return found

    async def apply(self, *, cut: bool = False) -> EditsApplied:
        """Apply the pending edits as one transaction and return how many elements changed, and what is to be told.

        `cut`: while the logger runs, too; it goes on as changed.

        RefusedError says why not; when somebody else changed the table meanwhile it was read again and the edits are
        rebased, so that the caller can show the conflicts or try again.
        """
        edits, pending, revision = self.table.edits(), self.table.kept(), self.table.revision
        try:
            applied = await self.connection.call(lambda client: client.apply(edits, revision, cut=cut))
        except RefusedError as refused:
            if why(refused) is RefusedWhy.CONFLICT:
                await self.reload()
            raise
        await self.reload()
        self.table.note_applied(pending)
        self.connection.watch_again()
        return applied

    async def start(self, unsaved: Unsaved = Unsaved.REFUSE, *, again: bool = False) -> list[str]:
        """Start the logger, `again`: after a stop; what was read is of the run before. Return what it tells of that."""
        told: list[str] = []
        self.take_status(
            await self.connection.call(lambda client: (client.restart if again else client.start)(unsaved, told.append))
        )
        return told

    async def stop(self) -> None:
        """Stop the logger."""
        self.take_status(await self.connection.call(lambda client: client.stop()))

    async def survey(self, details: Sequence[str], quantities: Sequence[str], *, reset: bool = False) -> None:
        """Measure anew: what filter and order need of all elements, `quantities` of elements and entries `details`."""
        wanted = sorted(self.rows.wanted())
        names, asked = (list(details), list(quantities)) if details and quantities else ([], [])
        found = await self.connection.read(
            lambda client: client._survey(wanted, reset=reset, derived=True, some=names, some_quantities=asked)
        )
        arrays = np.frombuffer(found.values).reshape(len(wanted), -1)
        if found.revision != self.table.revision or arrays.shape[1] != len(self.table):
            return  # of a table that we haven't read yet
        told: dict[str, dict[str, float]] = {}
        if names:
            columns = np.frombuffer(found.some).reshape(len(asked), -1)
            told = {
                name: dict(zip(asked, column, strict=True))
                for name, column in zip(names, columns.T.tolist(), strict=True)
            }
        quantities_of_all = dict(zip(wanted, arrays, strict=True))
        if self.loop_slow:
            self._slow_s = time.monotonic()
        if time.monotonic() - self._slow_s < SLOW_TOLD_S:  # one fact, which the head tells
            bits = np.nan_to_num(quantities_of_all["signs"]).astype(np.int64)
            quantities_of_all["signs"] = (bits & ~SLOW).astype(float)
        self.table.facts = Facts(quantities_of_all, found.since_ns, found.time_ns, told)
        self.jitter_s = found.jitter_s

    async def keep_survey(self) -> None:
        """Have the statistics of `survey` go on, of which nothing is to be told now."""
        with suppress(SiloError):  # a lost link is told by the banner, a refusal by the next survey
            await self.connection.read(lambda client: client._survey(["signs"], self.table.names[:1]))

    def change(self, settings: ElementSettings, named: Sequence[str] = ()) -> int:
        """Edit the targets of the table as typed, all or none, in one undo step; return how many cells changed.

        What is `named` is edited instead: names, their ends, patterns. ValueError says what is out of range, or that
        there is no such element; nothing is changed then.
        """
        values = self.table.values
        rows = np.array([row for row, _ in self.named(named)], np.int64) if named else self.rows.targets()
        if why := self.why_fixed(rows):
            raise ValueError(why)
        rows = rows[~self.table.derived[rows]]
        elements = [(self.table.names[row], options_of(values[:, row])) for row in rows]
        made = apply_settings(settings, elements, self.status.frequency_hz)
        return self.table.edit_all(rows, rows_of(made))

    def named(self, named: Sequence[str], *, scalars: bool = False) -> list[Found]:
        """Return what these mean, in the order as typed: names, their ends, patterns; `scalars` too where asked.

        Raises ValueError for what there isn't.
        """
        table = self.table
        known = Names(table.names, table.prefix, lambda: map(table.entry_names, range(len(table))))
        places: dict[Found, None] = {}
        for name in named:
            if not (found := known.find(name, scalars=scalars)):
                raise ValueError(f"no element is called {name!r}{known.hint(name, '')}")
            places.update(dict.fromkeys(found))
        return list(places)

    def why_fixed(self, rows: NDArray[np.int64] | None = None) -> str:
        """Return why none of the rows, else of the targets, can be edited; empty where some can."""
        rows = self.rows.targets() if rows is None else rows
        if not len(rows) or not self.table.derived[rows].all():
            return ""
        one = self.table.elements[rows[0]]
        others = f" and {len(rows) - 1} more are" if len(rows) > 1 else " is"
        name = self.short_name(one.name)
        return f"{name}{others} derived: divider, buffer and action are those of its signals; edit it to change that"

    def watch(self, request: ViewRequest) -> None:
        """Say what the screen shows from now on."""
        if self.link is not None:
            self.link.watch(request)

    # -------------------------------------------------------------------------------------------- what comes in

    def poll(self) -> Frame | None:
        """Take the newest frame over; None when nothing came."""
        frame = self.link.frame() if self.link is not None else None
        if frame is None:
            return None
        self.frame_time_ns, self.ticks = frame.time_ns, frame.tick
        self.measured_hz, self.lost_total, self.idle_s = frame.measured_hz, frame.lost_total, frame.idle_s
        if frame.column_ns == self.columns.column_ns:  # else it is of the view before
            if frame.since_ns:
                self.columns.live_since_ns = frame.since_ns
            came = grid_of(frame.first, frame.low, frame.high, frame.marks, frame.bases)
            self.columns.merge(frame.plots, came)
        return frame

    def take_values(self, frame: Frame) -> None:
        """Take the values of a frame over, unless it is of a table that we haven't read yet."""
        counts = self._entry_counts.get(frame.elements)
        if counts is None:
            rows = [self.table.row(name) for name in frame.elements]
            counts = [len(self.table.elements[row].entries) if row is not None else 0 for row in rows]
            self._entry_counts = {frame.elements: counts}
        if sum(counts) == len(frame.newest):
            self.live.take(frame, counts)

    def take_status(self, status: Status) -> None:
        """Take a status over."""
        if status.started_ns != self.status.started_ns and self.status is not NO_STATUS:
            self.live.forget()
            self.table.facts = Facts()
            self.columns = ColumnStore(self.columns.names, self.columns.count, self.columns.column_ns)
        self.status = status
        self.table.prefix = status.prefix.rstrip("/")
        self.measured_hz, self.ticks, self.lost_total = status.measured_hz, status.ticks, status.lost
        self.idle_s = status.idle_s

    def _is_of_before(self, status: Status) -> bool:
        """Whether a status that came with news was overtaken by the answer to a start or a stop."""
        theirs, ours = ((one.started_ns, one.state is not State.RUNNING) for one in (status, self.status))
        return theirs < ours

    async def take_event(self, event: Event) -> None:
        """Follow what happened in the logger."""
        self.conditions_due = self.conditions_due or event.kind in _CONDITION_KINDS
        lost = event.logged > (self.happened[-1].number if self.happened else 0) + 1  # news, on their way
        if lost or event.kind is EventKind.PARAMETER:  # of which the line of the log says more
            await self.learn_events()
        self._note(event)
        if event.job:
            self.saves[event.job] = event
        self._said_closed = self._said_closed or event.kind is EventKind.CLOSED
        if event.kind is EventKind.CRASHED:
            self.left_files = event.files
        if event.status is not None and not self._is_of_before(event.status):
            self.take_status(event.status)
        elif event.kind not in {EventKind.SAVING, EventKind.SCRIPT_SAVED, EventKind.SAVE_FAILED}:
            await self.refresh_status()
        control = self.status.control
        given = self.has_control and control is not None and event.by != control.who  # by somebody else
        if event.kind is EventKind.CONTROL and given:
            await self.connection.call(lambda client: client.take_control())  # to renew it from now on
        if event.kind in {EventKind.EDITED, EventKind.SCRIPT_LOADED} or self.status.revision != self.table.revision:
            await self.reload()
        if event.kind in {EventKind.STARTED, EventKind.STOPPED, EventKind.EDITED, EventKind.SCRIPT_LOADED}:
            self.connection.watch_again()

    def tells_no_change(self, event: Event) -> bool:
        """Whether it says what all parameters are at a start: no news, that would hide others."""
        newest = next((one for one in reversed(self.happened) if one.number == event.logged), None)
        return newest is not None and newest.change is not None and newest.change.is_image

    def _note(self, event: Event) -> None:
        known = self.happened[-1].number if self.happened else 0
        if event.logged > known:
            told = alike(LoggedEvent, event, kind=event.kind.value, who=event.by, number=event.logged)
            self.happened = newest([*self.happened, told])

    @property
    def has_control(self) -> bool:
        """Whether we alone may change the logger."""
        return self.status.control is not None and self.status.control.identity == self.identity

    def lose(self) -> None:
        """Note that the link is lost; everything stays as it was."""
        if self.lost_since is None:
            self.lost_since = time.monotonic()
            self._left = self.status, self.lent.had()

    async def regain(self) -> str:
        """Follow a link that is back: read everything again, rebase pending edits.

        Returns what to say: the client goes over to a new robot program of the same name by itself.
        """
        before, had = self._left = self._left or (
            self.status,
            self.lent.had(),
        )  # not what the new one told meanwhile
        self.conditions_due = True
        self.saves.clear()  # another helper process counts from 1 again
        await self._read_all()
        is_new = not before.is_of_program(self.status)
        if is_new:
            self.knobs.forget()
            await self.refresh_conditions()
            self.lent.of_before(had)
        self._left, self.lost_since, self._said_closed = None, None, False
        self.connection.watch_again()
        if not is_new:
            return "the link is back"
        ended = f"before, {before.reason or 'nothing is known of how it ended'}"  # last: it may be long, and was told
        return "; ".join(filter(None, ["started again", self.lent.to_tell(), ended]))

    def close(self) -> None:
        """Let the connection go."""
        for fetching in self.fetches.values():
            fetching.given_up = True
        if self.link is not None:
            self.link.close()


def why(error: RefusedError) -> RefusedWhy | None:
    """Return the reason that a refusal carries, where it carries one."""
    found = getattr(error, "why", None)
    return found if isinstance(found, RefusedWhy) else None

"""The helper's copy of the logger: what the robot process pushed last, and a reader of its segment.

`Replica.now` is replaced as a whole by the main thread and read by all others without a lock. Nothing here talks to
anybody.
"""

import contextlib
import os
import socket
import threading
import time
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec

from silo.core.elements import Control, ElementInfo, LoggerOptions, Present, State, Status, Storage, Table
from silo.core.names import Names
from silo.core.runtime import disk_room, runtime_dir, user_name
from silo.core.structs import alike
from silo.decoding import json_decoder
from silo.errors import SegmentError
from silo.expressions.derived_signals import derived_infos
from silo.journal.derived_rows import DerivedPlan, DerivedReader, derived_plan
from silo.journal.holdings import Holdings, RetainedAlike, kept_alike, segment_holdings
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.segment.layout import SegmentSchema
from silo.segment.reader import SegmentReader
from silo.segment.rows import lost_samples
from silo.state.handover import RobotState, RunOffer
from silo.state.table_parts import EncodedTable

MOST_CLIENTS = 20
MOST_OVER = 10_000  # runs that are over, of which is known how many ticks they had
MOST_SEARCHED = 1000  # names of one request
FAILED_NAMES = 10  # of the status, which goes with every event


@dataclass(frozen=True)
class LoggerSnapshot:
    """The logger at one moment. `generation` changes with every edit, every derived signal and every start.

    `names` are those of the elements in the table, and behind them of its derived signals.
    """

    robot: RobotState
    options: LoggerOptions
    table: Table
    names: Names
    entries: int
    encoded_table: EncodedTable
    generation: int
    died: str = ""  # why, if the robot process is gone

    @property
    def state(self) -> State:
        """The state as clients see it."""
        return State.DEAD if self.died else self.robot.state

    def meant(self, name: str) -> tuple[str, int]:
        """Return the element and the number of the entry, -1 for all of it, that clients mean by a name.

        A name that is both is the element. Raises RequestRefusedError for what there isn't, or is several.
        """
        exact = self.names.exact(name)
        found = self.names.find(name, scalars=True, namespaces=False) if exact is None else [exact]
        if len(found) != 1:
            hint = self.names.hint(name[:200], "they are named like '/log/q' and '/log/q_x'")
            text = f"no element or entry is called '{name[:200]}'{hint}"
            raise RequestRefusedError(RefusedWhy.NOT_FOUND, self.names.several(name, found) if found else text)
        place, number = found[0]
        return self.names.names[place], -1 if number is None else number

    def found(self, name: str) -> tuple[str, int] | None:
        """Return the same, None for what there isn't, or is several."""
        with contextlib.suppress(RequestRefusedError):
            return self.meant(name)
        return None

    def found_all(self, names: Iterable[str]) -> list[tuple[str, int] | None]:
        """Return the same of many. Of names that aren't whole the first are searched for: each takes its time."""
        left, found = MOST_SEARCHED, []
        for name in names:
            is_whole = self.names.has(name)
            left -= not is_whole
            found.append(self.found(name) if is_whole or left >= 0 else None)
        return found

    def entry(self, found: tuple[str, int] | None) -> tuple[str, int] | None:
        """Return the element and the number of the entry that clients mean by what was found, None for what is none."""
        if found is None:
            return None
        of, number = found
        info = self.element(of)
        return (of, max(number, 0)) if number >= 0 or (info is not None and len(info.entries) == 1) else None

    def element(self, name: str) -> ElementInfo | None:
        """Return the element, or derived signal, of that whole name."""
        place, own = self.names.places.get(name), len(self.table.elements)
        if place is None:
            return None
        return self.table.elements[place] if place < own else self.table.derived[place - own]


@dataclass(frozen=True)
class HeldNow:
    """Runs before the present one that are held, and how many may be."""

    runs: int = 0
    size_bytes: int = 0
    most_runs: int = 0
    most_bytes: int = 0


class Replica:
    """What all threads of the helper know of the logger."""

    def __init__(self, first: RobotState, host: str = "") -> None:
        """`first` is the robot's first message; it carries the table. `host` is as which its keys name it."""
        self.host = host or socket.gethostname()
        self.user = user_name(os.getuid())
        self.measured_hz = 0.0
        self.denied: Callable[[], int] = int  # how many logins and changes were denied lately
        self._ticked: tuple[str, int, float] = ("", -1, 0.0)  # a run, its ticks, and when there were so many first
        self.durable: tuple[str, int] = ("", 0)  # a run, and how many of its ticks; set by the journal thread
        self.control: Callable[[], tuple[Control | None, bool]] = lambda: (None, False)
        self.recorders = 0  # that are under way; set by the thread that watches them
        self.alarm: tuple[str, int] = ("", 0)  # the worst limit that is violated, and how many are; set by the judge
        self.disk: tuple[int, int] = (0, 0)  # bytes that are free where files are saved, and all; by their own thread
        self.held = HeldNow()  # set by the main thread
        self.clients: tuple[Present, ...] = ()  # who is connected; set by the publisher
        self._generation = 0
        self._saved: dict[str, int] = {}  # by the paths of segments, how many of their ticks stand in files
        self._lock = threading.Lock()
        self._reader: SegmentReader | None = None  # of the present run, for the status
        self._descriptor = -1  # its file, as it was handed over
        self._kept: list[RetainedAlike] = []  # how its elements are kept
        self._plan: tuple[object, object, DerivedPlan] | None = (
            None  # of which schema and table, and how it is computed
        )
        self._known: set[str] = set()  # paths of all runs that were handed over
        self.segment = ""  # path of the present run's segment, empty before the first start and while it is let go of
        self.run = ""  # its id
        self.over: deque[tuple[str, int]] = deque(maxlen=MOST_OVER)  # runs before it, with how many ticks they had
        self.now = self._made_of(first, None)
        self._follow(first)

    # ------------------------------------------------------------------------------------------ by the main thread

    def take_run(self, offer: RunOffer, descriptor: int) -> None:
        """Take over a run that is about to begin; the descriptor is closed when the next one comes.

        Raises SegmentError for a file that is no segment.
        """
        reader = SegmentReader(offer.segment, descriptor)
        self._known.add(offer.segment)
        self._replace(reader, descriptor, offer.segment)

    def let_go(self) -> None:
        """Free the present run's memory: the robot process needs it for the next one."""
        self._replace(None, -1, "")

    def take(self, robot: RobotState) -> tuple[LoggerSnapshot, LoggerSnapshot]:
        """Take over what the robot pushed; returns what was before and what is now."""
        before = self.now
        self.now = self._made_of(robot, before)
        if robot.segment != before.robot.segment:
            self.measured_hz = 0.0
            self._follow(robot)
        return before, self.now

    def mark_dead(self, why: str) -> None:
        """The robot process is gone; called again when there is more to say of it."""
        self.measured_hz = 0.0
        self.now = replace(self.now, died=why)

    def _made_of(self, robot: RobotState, before: LoggerSnapshot | None) -> LoggerSnapshot:
        table = robot.table or (before.table if before else Table(robot.revision, []))
        if robot.table is not None or before is None or robot.conditions.derived != before.robot.conditions.derived:
            derived = derived_infos(table.elements, _options(robot).prefix, robot.conditions.derived)
            table = Table(robot.revision, table.elements, derived, table.given)
        unchanged = before is not None and table is before.table
        if not unchanged or (before is not None and robot.segment != before.robot.segment):
            self._generation += 1
        if unchanged and before is not None:
            return replace(before, robot=robot, options=_options(robot), generation=self._generation)
        return LoggerSnapshot(
            robot=msgspec.structs.replace(robot, table=None),
            options=_options(robot),
            table=table,
            names=Names.of((*table.elements, *table.derived), _options(robot).prefix),
            entries=sum(len(info.entries) for info in table.elements if info.options.enabled),
            encoded_table=EncodedTable(table),
            generation=self._generation,
        )

    def _follow(self, robot: RobotState) -> None:
        """Open a segment by its path, where the run could not be handed over."""
        if robot.segment and robot.segment not in self._known:
            try:
                self._replace(SegmentReader(robot.segment), -1, robot.segment)
            except SegmentError:
                # restarted or closed since: the robot's next message names another segment
                self._replace(None, -1, "")

    def _replace(self, reader: SegmentReader | None, descriptor: int, segment: str) -> None:
        """Another present run, so that the memory of the last one is freed."""
        if reader is not None:
            table = sharing(self.now.table, reader.schema)
            names = Names.of((*table.elements, *table.derived), self.now.options.prefix)
            self.now = replace(self.now, table=table, names=names)
        self._plan = None
        kept = kept_alike(reader.schema) if reader is not None else []
        with self._lock:
            old, self._reader, self._kept = self._reader, reader, kept
            old_descriptor, self._descriptor = self._descriptor, descriptor
            self.run = reader.schema.run if reader else ""
            self.segment = segment
        if old is not None:
            with contextlib.suppress(SegmentError):
                self.over.append((old.schema.run, old.ticks))
            old.close()
        if old_descriptor >= 0:
            os.close(old_descriptor)
        self._generation += 1
        self.now = replace(self.now, generation=self._generation)

    # --------------------------------------------------------------------------------------------- by any thread

    def open_reader(self) -> SegmentReader | None:
        """Return a reader of the present segment for the calling thread alone; None if nothing was logged yet.

        Raises SegmentError for a segment that is damaged.
        """
        with self._lock:
            if self._reader is None:
                return None
            path, descriptor = self._reader.path, self._reader.descriptor()
        try:
            return SegmentReader(path, descriptor)
        except SegmentError:
            # after a crash nobody writes any more, and what is mapped stays readable
            if not self.now.died:
                raise
            return self._reader
        finally:
            os.close(descriptor)

    def open_watcher(self) -> SegmentReader | None:
        """The same with the present derived signals, computed while rows are read: what clients see of a run."""
        reader = self.open_reader()
        return reader if reader is None else self.watching(reader)

    def watching(self, reader: SegmentReader) -> SegmentReader:
        """Return a reader with the present derived signals, in place of this one. Raises SegmentError."""
        now = self.now
        if not now.table.derived:
            return reader
        try:
            return DerivedReader(reader.path, reader.fileno(), self._planned(reader, now))
        except SegmentError:
            if not now.died:
                raise
            return reader  # what was mapped before stays readable
        finally:
            reader.close()

    def _planned(self, reader: SegmentReader, now: LoggerSnapshot) -> DerivedPlan:
        """How derived signals are computed in this run: of 10,000 elements made once, not for every question."""
        known = self._plan
        if known is not None and known[0] is reader.schema and known[1] is now.table:
            return known[2]
        plan = derived_plan(reader.schema, now.table.elements, now.robot.conditions.derived)
        self._plan = (reader.schema, now.table, plan)
        return plan

    def files_deleted(self) -> bool:
        """Return whether somebody deleted the present segment while the robot process needs it."""
        with self._lock:
            return self._reader is not None and os.fstat(self._reader.fileno()).st_nlink == 0

    def mark_saved(self, segment: str, ticks: int) -> None:
        """Remember how much of a segment stands in a file."""
        with self._lock:
            self._saved[segment] = max(ticks, self._saved.get(segment, 0))

    def is_saved(self) -> bool:
        """Return whether every tick of the present segment stands in a file; not of one that somebody cut short."""
        with self._lock, contextlib.suppress(SegmentError):
            return self._reader is None or self._reader.ticks <= self._saved_ticks(self._reader)
        return False

    def is_saved_of(self, reader: SegmentReader) -> bool:
        """Return whether every tick of a run stands in a file, as far as is known here."""
        with self._lock:
            return reader.ticks <= self._saved_ticks(reader)

    def durable_ticks(self, run: str) -> int:
        """Return how many ticks of a run would survive a power cut now."""
        known, ticks = self.durable
        return ticks if known == run else 0

    def stamp_of(self, tick: int) -> int:
        """Return the time stamp of a tick of the present run; 0 where it isn't held."""
        with self._lock, contextlib.suppress(SegmentError):
            return self._reader.stamp_of(tick) if self._reader is not None else 0
        return 0

    def tick_at(self, at_ns: int) -> int:
        """Return the newest tick with a time stamp up to this one; -1 where none is held."""
        with self._lock, contextlib.suppress(SegmentError):
            if self._reader is not None:
                newest = bisect_right(range(self._reader.ticks), at_ns, key=self._reader.stamp_of) - 1
                return newest if newest >= 0 and self._reader.stamp_of(newest) else -1
        return -1

    def idle_s(self, ticks: int) -> float:
        """Return for how long there have been no more than so many ticks, as far as that was asked; 0 where it stands.

        Whatever clock stamps the ticks.
        """
        now_s = time.monotonic()
        if self.now.state is not State.RUNNING:
            self._ticked = ("", -1, now_s)
            return 0.0
        run, known, since_s = self._ticked
        if (run, known) != (self.run, ticks):
            self._ticked, since_s = (self.run, ticks, now_s), now_s
        return now_s - since_s

    def _saved_ticks(self, reader: SegmentReader) -> int:
        return max(self._saved.get(str(reader.path), 0), reader.saved_ticks)

    def status(self) -> Status:
        """Return the logger at a glance."""
        now = self.now
        robot, options = now.robot, now.options
        control, one_operator = self.control()
        with self._lock:
            # all within: another thread closes the reader of a run that is replaced
            reader, durable, problem = self._reader, self.durable_ticks(self.run), ""
            size_bytes, started_ns = (reader.size_bytes, reader.schema.started_ns) if reader else (0, 0)
            cut = reader.schema.cut if reader else None
            try:
                read = _read(reader, self._kept)
                saved = reader is None or (read.ticks <= self._saved_ticks(reader) and not robot.cut_off)
            except SegmentError as error:  # somebody cut it short
                read, saved, problem = _read(None, []), False, str(error)
        return alike(
            Status,
            robot,
            host=self.host,
            user=self.user,
            helper_pid=os.getpid(),
            program=options.id,
            state=now.state,
            revision=now.table.revision,
            frequency_hz=options.frequency_hz,
            measured_hz=self.measured_hz if now.state is State.RUNNING else 0.0,
            ticks=read.ticks,
            started_ns=started_ns,
            last_tick_ns=read.last_tick_ns,
            lost=read.lost,
            elements=len(now.table.elements),
            enabled=sum(info.options.enabled for info in now.table.elements),
            entries=now.entries,
            max_time_s=options.max_time_s,
            prefix=options.prefix,
            reason="; ".join(filter(None, (now.died or robot.reason, problem))),
            segment_bytes=size_bytes,
            saved=saved,
            held_samples=read.held.samples,
            held_s=read.held.seconds,
            durable_ticks=durable if options.storage is Storage.DISK else -1,
            recorders=self.recorders,
            derived=len(now.table.derived),
            room_bytes=_room(self.segment, size_bytes),
            disk_free_bytes=self.disk[0],
            disk_bytes=self.disk[1],
            alarm=self.alarm[0],
            alarms=self.alarm[1],
            clients=list(self.clients[:MOST_CLIENTS]),
            failed=sum(read.failed.values()),
            control=control,
            one_operator=one_operator,
            denied=self.denied(),
            idle_s=self.idle_s(read.ticks),
            failed_most=dict(sorted(read.failed.items(), key=lambda pair: -pair[1])[:FAILED_NAMES]),
            unheld=dict(sorted(read.unheld.items())[:FAILED_NAMES]),
            held_runs=self.held.runs,
            held_bytes=self.held.size_bytes,
            held_runs_most=self.held.most_runs,
            held_bytes_most=self.held.most_bytes,
            part=cut.part if cut is not None else 0,
        )


def _room(segment: str, present_bytes: int) -> int:
    """Return how many bytes the buffers of the next start may take; 0 where the system doesn't tell."""
    try:
        return disk_room(Path(segment).parent if segment else runtime_dir())[0] + present_bytes
    except (OSError, SegmentError):
        return 0


@dataclass(frozen=True)
class _Read:
    """What the status says of the segment."""

    ticks: int
    last_tick_ns: int
    lost: int
    held: Holdings
    failed: dict[str, int]
    unheld: dict[str, int]


def _read(reader: SegmentReader | None, kept: list[RetainedAlike]) -> _Read:
    """Raises SegmentError for a segment that was cut short."""
    held = _holdings(reader, kept)
    if reader is None:
        return _Read(0, 0, 0, held, {}, {})
    failed, unheld = reader.failure_counts(), reader.unheld()
    return _Read(reader.ticks, reader.last_time_ns, lost_samples(reader), held, failed, unheld)


def _holdings(reader: SegmentReader | None, kept: list[RetainedAlike]) -> Holdings:
    nothing = Holdings(0, 0, 0, 0.0)
    try:
        return segment_holdings(reader, kept) if reader is not None else nothing
    except SegmentError:
        return nothing  # damaged, as a save would say


def sharing(table: Table, schema: SegmentSchema) -> Table:
    """The same table, made of the schema's own rows where these say the same: 7 MB less with 10,000 elements."""
    rows = {element.info.name: element.info for element in schema.elements}
    shared = [row if (row := rows.get(info.name)) == info else info for info in table.elements]
    return Table(table.revision, shared, table.derived, table.given)


def _options(robot: RobotState) -> LoggerOptions:
    return json_decoder(LoggerOptions).decode(robot.options_json)

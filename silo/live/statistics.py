"""Surveys: statistics, rates and signs of all elements of a logger, over every sample that passes.

Nothing is done until a client asks; then one thread reads each new row of each ring once, ten times a second, and adds
it up with NumPy, until nobody has asked for a minute. Each client has statistics of its own, so that a reset of one
doesn't touch those of another. Measured: 10,000 elements at 400 Hz cost 5 % of a core of the helper process.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.columns import Floats
from silo.core.arrays.running import STATISTICS, RunningStatistics, move
from silo.core.elements import BufferType, ElementInfo, State
from silo.errors import SegmentError
from silo.live.newest import NewestValues
from silo.live.quantities import NOT_FINITE, NOT_FINITE_S, QUANTITIES, signs_of
from silo.live.requests import GetSurvey, Survey
from silo.net.keys import may_use
from silo.rpc.leases import Leases
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.segment.layout import EntrySchema
from silo.segment.picking import RowPicker
from silo.segment.reader import SegmentReader
from silo.segment.rows import Rows
from silo.state.replica import Replica
from silo.state.run_follower import RunFollower

log = logging.getLogger(__name__)

PERIOD_S = 0.1
LEASE_S = 60.0
MAX_CLIENTS = 8
MAX_NAMES = 20_000
WINDOW_S = 2.0  # over which rates are measured, or ten periods
STAMPS = 512  # of which the jitter is reckoned
WIDE = frozenset({"i8", "u8"})  # types with numbers that float64 has not
BLOCK_BYTES = 4 * 2**20
_OF_CHANGES = (  # of a tally, by slot
    "newest", "changed_ns", "_change_seen", "bad_ns", "_changes", "_read_s", "_read_to_change_s",
)  # fmt: skip


class _Columns:
    """Makes of the rows of a ring a matrix of float64: a column per entry, then one per vector: its norm.

    Then one per element that has no number, as texts and times, or of which float64 has not each number, as int64: of
    its bytes, which differs where these do.
    """

    def __init__(self, elements: Sequence[tuple[int, tuple[EntrySchema, ...]]]) -> None:
        """`elements` are numbers of elements with their entries in this ring."""
        self.entries: list[tuple[int, int]] = []  # (element, entry) of the first columns
        self.norms: list[int] = []  # elements of the columns after these
        self.starts: list[int] = []  # among the vectors, where the entries of each begin
        self.vectors: list[int] = []  # columns of their entries
        self.others: list[int] = []  # elements of the columns after the norms
        wanted: dict[tuple[int, int], EntrySchema] = {}
        more: dict[tuple[int, int], EntrySchema] = {}
        for number, entries in elements:
            usable = [entry for entry in entries if np.dtype(entry.entry.dtype).kind in "biuf"]
            if len(entries) > 1 and len(usable) == len(entries):
                self.norms.append(number)
                self.starts.append(len(self.vectors))
                self.vectors += range(len(self.entries), len(self.entries) + len(entries))
            for place, entry in enumerate(entries):
                if entry in usable:
                    wanted[number, place] = entry
                    self.entries.append((number, place))
                else:
                    more[number, place] = entry
            if len(usable) < len(entries) or any(np.dtype(each.entry.dtype).str[1:] in WIDE for each in usable):
                self.others.append(number)
        self._picker = RowPicker(wanted | more)
        self.words = self._picker.words  # of rows that are read
        place_of = {number: place for place, number in enumerate(self.others)}
        self._other_of = np.array([place_of.get(number, -1) for number, _ in self._picker.keys], np.intp)

    def __len__(self) -> int:
        return len(self.entries) + len(self.norms) + len(self.others)

    def of(self, rows: Rows) -> Floats:
        found = np.empty((len(rows), len(self)))
        others = np.zeros((len(self.others), len(rows)), np.uint64)
        for columns, values in self._picker.blocks(rows.words):
            number = columns < len(self.entries)
            found[:, columns[number]] = values if number.all() else values[:, number]
            other = self._other_of[columns] >= 0
            if other.any():
                marks = _marks_of(values[:, other], columns[other])
                np.add.at(others, self._other_of[columns[other]], marks.T)
        if self.norms:
            with np.errstate(over="ignore", invalid="ignore"):
                squares = np.square(found[:, self.vectors])
                norms = slice(len(self.entries), len(self.entries) + len(self.norms))
                found[:, norms] = np.sqrt(np.add.reduceat(squares, self.starts, axis=1))
        found[:, len(self) - len(self.others) :] = (others >> np.uint64(11)).T
        return found


def _marks_of(values: NDArray[Any], columns: NDArray[np.intp]) -> NDArray[np.uint64]:
    """Return numbers that differ where the bytes of values do, whatever their type; shape as theirs."""
    values, odd = np.ascontiguousarray(values), 2 * columns.astype(np.uint64) + np.uint64(1)
    marks: NDArray[np.uint64]
    if values.dtype.itemsize == 8:
        marks = values.view(np.uint64) * _weights(8)[0] * odd
    else:
        parts = values.view(np.uint8).reshape(*values.shape, values.dtype.itemsize)
        marks = parts.astype(np.uint64) @ _weights(parts.shape[-1]) * odd
    return marks


@cache
def _weights(size: int) -> NDArray[np.uint64]:
    """Return an odd number for each byte of a type; drawn once, not with each block of rows."""
    weights: NDArray[np.uint64] = np.random.default_rng(0).integers(1, 2**63, size, np.uint64) | np.uint64(1)
    return weights


@dataclass
class _Ring:
    """What is followed of one ring."""

    number: int
    columns: _Columns
    slots: slice
    cursor: int
    last: Floats | None = None
    stamps: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    marks: "deque[tuple[float, int, int]]" = field(default_factory=deque)  # (monotonic s, head, stamp)
    moved_s: float = 0.0
    rate: float = np.nan
    jitter: float = np.nan
    is_whole: bool = False  # whether a whole window was measured: of less nobody is told that it is slow


@dataclass(frozen=True)
class Changes:
    """When which values changed up to now: a run that follows goes on with it, as an edit changes no value."""

    slots: dict[tuple[str, ...], int]  # by name, types and expression: of another signal nothing is known
    arrays: dict[str, NDArray[Any]]


class Tally:
    """All that is followed of one run; `advance` takes in what came since."""

    def __init__(self, reader: SegmentReader, *, whole: bool = False) -> None:
        """Follow from now on, or, where the run is `whole`, from its first tick."""
        self.reader = reader
        elements = reader.schema.elements
        self.numbers = {element.info.name: number for number, element in enumerate(elements)}
        by_ring: dict[int, list[tuple[int, tuple[EntrySchema, ...]]]] = {}
        self._ring_of = np.zeros(len(elements), np.intp)
        for number, element in enumerate(elements):
            by_ring.setdefault(element.watch_ring, []).append((number, element.watch_entries))
            self._ring_of[number] = element.watch_ring
        self.lead = np.full(len(elements), -1, np.intp)
        self.other = np.full(len(elements), -1, np.intp)  # the slots by which it is told exactly when these changed
        self.slot_of: dict[str, int] = {}
        self._rings: list[_Ring] = []
        count = 0
        for ring, members in sorted(by_ring.items()):
            columns = _Columns(members)
            for slot, (number, place) in enumerate(columns.entries, count):
                info = elements[number].info
                self.slot_of[info.name + info.entries[place].suffix] = slot
                if len(info.entries) == 1:
                    self.lead[number] = slot
            for slot, number in enumerate(columns.norms, count + len(columns.entries)):
                self.lead[number] = slot
            for slot, number in enumerate(columns.others, count + len(columns.entries) + len(columns.norms)):
                self.other[number] = slot
            self._rings.append(
                _Ring(ring, columns, slice(count, count + len(columns)), 0 if whole else reader.head(ring))
            )
            count += len(columns)
        self.changing = np.where(self.other >= 0, self.other, self.lead)
        self.count = count
        self.newest = np.full(count, np.nan)
        self.changed_ns = np.zeros(count, np.int64)
        self._change_seen = np.zeros(count, np.bool_)  # else `changed_ns` is when the value was there already
        self.bad_ns = np.full(count, -(2**62), np.int64)  # when the last nan or inf came
        self._changes = np.zeros(count, np.int64)  # among the rows that were read
        self._read_s, self._read_to_change_s = np.zeros(count), np.zeros(count)  # how long these rows took
        self.skipped = 0  # rows that were overwritten before they were read
        self._sizes = NewestValues(reader, elements, [0] * len(elements))
        options = [element.info.options for element in elements]
        self._limits = np.array([max(1, each.size) for each in options], np.int64)
        self._fixed = np.array([each.buffer is BufferType.FIXED for each in options], np.bool_)
        self._own = np.array([element.live_ring >= 0 for element in elements], np.bool_)
        self._periods = np.array([each.divider / reader.schema.frequency_hz for each in options])
        self._may_freeze = np.array(
            [all(one.dtype[1:2] in "iuf" and not one.labels for one in element.info.entries) for element in elements],
            np.bool_,
        )

    def sums(self, *, whole: bool = False) -> RunningStatistics:
        """Return statistics that begin now, or, before anything was taken in, with the `whole` run."""
        sums = RunningStatistics(self.count)
        sums.since_ns = self.reader.stamp_of(0) if whole else self.reader.last_time_ns
        return sums

    def go_on(self, before: "Tally") -> list[tuple[slice, slice]]:
        """Take over what was followed of the same run, as other signals were derived; return slots before and now.

        Where a derived signal was changed or forgotten, all derived ones begin: they may be computed from it.
        """
        if before.reader.schema.run != self.reader.schema.run:
            return []
        derived = {each.name for each in self.reader.schema.conditions.derived}
        if set(before.reader.schema.conditions.derived) <= set(self.reader.schema.conditions.derived):
            derived = set()
        known = {ring.number: ring for ring in before._rings}
        kept = []
        for place, ring in enumerate(self._rings):
            one, infos = known.get(ring.number), self._infos(ring)
            if one is not None and infos == before._infos(one) and not derived & {info.name for info in infos}:
                self._rings[place] = replace(one, columns=ring.columns, slots=ring.slots)
                kept.append((one.slots, ring.slots))
        move(vars(before), vars(self), _OF_CHANGES, kept)
        self.skipped = before.skipped
        return kept

    def changes(self) -> Changes:
        """Return when values changed, for the run that follows."""
        return Changes(self._slots_by_name(), {name: vars(self)[name] for name in _OF_CHANGES})

    def remember(self, before: Changes) -> None:
        """Go on with what is known of runs before this one, before its first row is taken in."""
        both = [(before.slots[key], slot) for key, slot in self._slots_by_name().items() if key in before.slots]
        here, there = np.array(both, np.intp).reshape(-1, 2).T
        move(before.arrays, vars(self), _OF_CHANGES, [(here, there)])

    def _slots_by_name(self) -> dict[tuple[str, ...], int]:
        found: dict[tuple[str, ...], int] = {}
        for number, element in enumerate(self.reader.schema.elements):
            info = element.info
            types = tuple(entry.dtype for entry in info.entries)
            ways = [("", self.lead[number]), ("other", self.other[number])]
            ways += [(each.suffix, self.slot_of.get(info.name + each.suffix, -1)) for each in info.entries]
            found |= {(info.name, info.expression, way, *types): int(slot) for way, slot in ways if slot >= 0}
        return found

    def _infos(self, ring: _Ring) -> list[ElementInfo]:
        elements = self.reader.schema.elements
        return [elements[number].info for number in np.flatnonzero(self._ring_of == ring.number)]

    def _look_back(self, ring: _Ring) -> None:
        """Take in changes of the oldest and the newest rows that are held already, as far as one reads together.

        What froze before anybody asked has changed among the oldest; a full buffer gets no row any more.
        """
        size = self._block(ring)
        rows = self.reader.rows(ring.number, 0, size, ring.columns.words)
        if len(rows) > 1:
            block = ring.columns.of(rows)
            self._count(ring, block[1:] != block[:-1])
        rows = self.reader.rows(ring.number, max(0, ring.cursor - size), size, ring.columns.words)
        rows = replace(rows, words=rows.words[: max(0, ring.cursor - rows.first)])
        if len(rows):
            self._compare(ring, rows, ring.columns.of(rows))

    def _compare(self, ring: _Ring, rows: Rows, block: Floats) -> NDArray[np.bool_]:
        """Take in when values changed last; return where they differ from those before, shape as that of the block."""
        newest, changed_ns, stamps = self.newest[ring.slots], self.changed_ns[ring.slots], rows.time_ns
        if ring.last is None:
            known = (changed_ns > 0) & (changed_ns <= stamps[0])  # by the clock of an earlier run
            ring.last = np.where(known, newest, block[0])
            changed_ns[~known] = stamps[0]
            self._change_seen[ring.slots] &= known
        differs: NDArray[np.bool_] = np.concatenate([ring.last[None], block[:-1]]) != block
        changed = differs.any(axis=0)
        self._change_seen[ring.slots] |= changed
        changed_ns[changed] = stamps[len(block) - 1 - np.argmax(differs[::-1], axis=0)][changed]
        newest[:] = ring.last = block[-1].copy()
        return differs

    def _count(self, ring: _Ring, differs: NDArray[np.bool_]) -> None:
        """Take in how often values differ from those before them, shape `(n, number of slots)`."""
        changed = differs.any(axis=0)
        newest = len(differs) - np.argmax(differs[::-1], axis=0)
        schema, slots = self.reader.schema, ring.slots
        period_s = schema.rings[ring.number].divider / schema.frequency_hz
        self._changes[slots] += differs.sum(axis=0)
        self._read_to_change_s[slots][changed] = (self._read_s[slots] + newest * period_s)[changed]
        self._read_s[slots] += len(differs) * period_s

    def _block(self, ring: _Ring) -> int:
        """Return how many rows are read together."""
        return max(1, BLOCK_BYTES // (8 * (len(ring.columns) + self.reader.schema.rings[ring.number].row_words)))

    def advance(self, now_s: float, all_sums: Sequence[RunningStatistics]) -> None:
        """Take in every row that came since the last time."""
        for sums in all_sums:
            sums.since_ns = sums.since_ns or self.reader.stamp_of(0)  # of a run that had no tick yet
        for ring in self._rings:
            head = self.reader.head(ring.number)
            block = self._block(ring)
            if ring.last is None and ring.cursor and len(ring.columns):
                self._look_back(ring)
            while ring.cursor < head:
                rows = self.reader.rows(ring.number, ring.cursor, block, ring.columns.words)
                if not len(rows):
                    self.skipped += head - ring.cursor
                    ring.cursor = head
                    break
                self.skipped += rows.first - ring.cursor
                ring.cursor = rows.first + len(rows)
                self._take(ring, rows, all_sums)
                ring.moved_s = now_s
            _measure(ring, now_s, self.reader.schema.frequency_hz)

    @property
    def jitter_s(self) -> float:
        """Standard deviation of the time between ticks, 0 where it isn't known: that of the ring with most rows."""
        fastest = max(self._rings, key=lambda ring: ring.cursor, default=None)
        return 0.0 if fastest is None or np.isnan(fastest.jitter) else fastest.jitter

    def _take(self, ring: _Ring, rows: Rows, all_sums: Sequence[RunningStatistics]) -> None:
        stamps = rows.time_ns
        ring.stamps = np.concatenate([ring.stamps, stamps])[-STAMPS:]
        if not len(ring.columns):
            return
        block = ring.columns.of(rows)
        all_finite = bool(np.isfinite(block).all())
        for sums in all_sums:
            sums.add(ring.slots, block, all_finite=all_finite)
        self._count(ring, self._compare(ring, rows, block))
        if not all_finite:
            bad = ~np.isfinite(block)
            last = stamps[len(block) - 1 - np.argmax(bad[::-1], axis=0)]
            self.bad_ns[ring.slots] = np.where(bad.any(axis=0), last, self.bad_ns[ring.slots])

    def quantity(self, name: str, sums: RunningStatistics, *, running: bool) -> tuple[Floats, bool]:
        """Return a quantity: per slot (True), or per element of the run (False)."""
        if name in STATISTICS:
            return sums.of(name), True
        if name in {"least", "most"}:
            return self._of_entries(sums, name), True
        if name == "value":
            return self.newest, True
        if name == "changed":
            return self._changed_s(), True
        if name == "change_seen":
            return np.where(self.changed_ns > 0, self._change_seen, np.nan), True
        if name in {"rate", "share", "jitter"}:
            return self._timing(name, running=running), False
        if name in {"fill", "held"}:
            held = self._sizes.held()
            return (held.astype(float) if name == "held" else np.minimum(1.0, held / self._limits)), False
        return self._signs(running=running), False

    def _of_entries(self, sums: RunningStatistics, name: str) -> Floats:
        """Return per slot the minimum, or maximum; of a norm's slot that of any of its entries."""
        found, together = (sums.of("min"), np.fmin) if name == "least" else (sums.of("max"), np.fmax)
        for ring in self._rings:
            if ring.columns.norms:
                begin = ring.slots.start + len(ring.columns.entries)
                found[begin : begin + len(ring.columns.norms)] = together.reduceat(
                    found[ring.slots][ring.columns.vectors], ring.columns.starts
                )
        return found

    def _changed_s(self) -> Floats:
        age = (self.reader.last_time_ns - self.changed_ns) / 1e9
        return np.where(self.changed_ns > 0, np.maximum(age, 0.0), np.nan)

    def _timing(self, name: str, *, running: bool) -> Floats:
        by_ring = np.full(len(self.reader.schema.rings), np.nan)
        for ring in self._rings:
            if name != "share" or ring.is_whole:
                by_ring[ring.number] = ring.jitter if name == "jitter" else ring.rate
        found = by_ring[self._ring_of]
        if not running:
            return np.full(len(found), np.nan)
        return found * self._periods if name == "share" else found

    def _signs(self, *, running: bool) -> Floats:
        value = np.append(self.newest, 0.0)[self.lead]
        finite = np.isfinite(value) | (np.append(self.changed_ns, 0)[self.lead] == 0)  # nothing came yet
        since_ns = self.reader.last_time_ns - np.append(self.bad_ns, -(2**62))[self.lead]
        finite &= since_ns > NOT_FINITE_S * 1e9
        if not running:
            return np.where(finite, 0, NOT_FINITE).astype(float)
        full = self._fixed & ~self._own & (self._sizes.held() >= self._limits)  # a full one stands still rightly
        share = np.where(full, np.nan, self._timing("share", running=True))
        changed_s = np.where(self.lead >= 0, np.append(self._changed_s(), np.nan)[self.changing], np.nan)
        may_freeze = self._may_freeze & ~full & ~np.isnan(changed_s)
        with np.errstate(divide="ignore", invalid="ignore"):
            pace_s = np.where(self._changes > 0, self._read_to_change_s / self._changes, np.nan)
        pace_s = np.append(pace_s, np.nan)[self.changing]
        return signs_of(finite, changed_s, pace_s, may_freeze, share, self._sizes.lost()).astype(float)


def _measure(ring: _Ring, now_s: float, frequency_hz: float) -> None:
    """Measure rate and jitter of a ring over the last two seconds, or ten of its periods."""
    if not len(ring.stamps):
        return
    ring.marks.append((now_s, ring.cursor, int(ring.stamps[-1])))
    period_s = 1.0 / ring.rate if ring.rate > 0 else 1.0 / frequency_hz
    window_s = max(WINDOW_S, 10 * min(period_s, 60.0))
    while len(ring.marks) > 2 and now_s - ring.marks[1][0] > window_s:
        ring.marks.popleft()
    first_s, first, first_ns = ring.marks[0]
    ring.is_whole = now_s - first_s >= window_s
    rows = ring.cursor - first
    if len(ring.stamps) > 2:
        ring.jitter = float(np.std(np.diff(ring.stamps))) / 1e9
    waited_s = now_s - ring.moved_s
    if rows > 1 and ring.stamps[-1] > first_ns and waited_s < max(2 * period_s, 0.5):
        ring.rate = rows / ((int(ring.stamps[-1]) - first_ns) / 1e9)
    elif rows >= 0 and now_s > first_s and waited_s >= max(2 * period_s, 0.5):
        ring.rate = rows / (now_s - first_s)


def _values(
    tally: Tally,
    sums: RunningStatistics,
    quantities: Sequence[str],
    names: Sequence[str],
    *,
    entries: bool,
    running: bool,
) -> bytes:
    """Return float64 of shape `(quantities, names)`; `entries`: names may be of entries too."""
    values = np.full((len(quantities), len(names)), np.nan)
    numbers = np.array([tally.numbers.get(name, -1) for name in names], np.intp)
    leads = np.append(tally.lead, -1)[numbers]
    slots = np.where(leads >= 0, leads, [tally.slot_of.get(name, -1) for name in names] if entries else -1)
    changing = np.append(tally.changing, -1)[numbers]  # of what is no number it is known, too
    others = np.where(changing >= 0, changing, slots)
    for place, quantity in enumerate(quantities):
        found, per_slot = tally.quantity(quantity, sums, running=running)
        of = others if quantity in {"changed", "change_seen"} else slots
        values[place] = np.append(found, np.nan)[of if per_slot else numbers]
    return values.tobytes()


@dataclass
class _Asker:
    sums: RunningStatistics
    failed: str = ""  # why its statistics begin anew, until it was told


class Surveyor:
    """Answers surveys; follows the rings in a thread of its own while anybody asks."""

    def __init__(self, replica: Replica) -> None:
        self._replica = replica
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._tally: Tally | None = None
        self._run = RunFollower(replica, derived=True)
        self._followed = ""  # the id of the run that was last
        self._changes: Changes | None = None  # of the runs that were followed, as long as anybody asks
        self._askers: Leases[tuple[str, str], _Asker] = Leases(MAX_CLIENTS)
        self._thread: threading.Thread | None = None
        self._stopped = False

    def answer(self, request: GetSurvey) -> Survey:
        """Return what was asked for; the first time the statistics begin."""
        unknown = [name for name in [*request.quantities, *request.some_quantities] if name not in QUANTITIES]
        if unknown or not request.quantities:
            what = f"{unknown[0][:40]!r} is no quantity" if unknown else "no quantity was asked for"
            raise RequestRefusedError(RefusedWhy.INVALID, f"no survey: {what}; there are {', '.join(QUANTITIES)}")
        if max(len(request.quantities), len(request.some_quantities)) > len(QUANTITIES):
            text = f"no survey: there are {len(QUANTITIES)} quantities; name each once"
            raise RequestRefusedError(RefusedWhy.INVALID, text)
        asked = max(len(request.names), len(request.some))
        if asked > MAX_NAMES:
            raise RequestRefusedError(RefusedWhy.INVALID, f"no survey: at most {MAX_NAMES} names, got {asked}")
        if not may_use(request.id, request.proof):
            text = f"no survey: '{request.id[:50]}' is another client's; nothing was changed"
            raise RequestRefusedError(RefusedWhy.FORBIDDEN, text)
        # an id, or, of an older client, its name, which everybody sees: neither can be said as the other
        owner = (request.id, "") if request.id else ("", request.client)
        with self._lock:
            self._begin()
            asker = self._askers.renew(owner, LEASE_S)
            if asker is None and self._askers.full(owner, request.id or request.client):
                text = f"no survey: {MAX_CLIENTS} clients have statistics; close one first"
                raise RequestRefusedError(RefusedWhy.FAILED, text)
            if self._tally is not None and (asker is None or request.reset):
                asker = _Asker(self._tally.sums())
                self._askers.set(owner, asker, LEASE_S, request.id or request.client)
            if asker is not None:
                failed, asker.failed = asker.failed, ""
                if failed:
                    raise RequestRefusedError(RefusedWhy.FAILED, failed)
            return self._survey(request, asker.sums if asker is not None else None)

    def _survey(self, request: GetSurvey, sums: RunningStatistics | None) -> Survey:
        now, tally = self._replica.now, self._tally
        rows = [*now.table.elements, *now.table.derived] if request.derived else now.table.elements
        names = request.names or [info.name for info in rows]
        if tally is None or sums is None:
            values, some = (
                np.full((len(asked), len(of)), np.nan)
                for asked, of in ((request.quantities, names), (request.some_quantities, request.some))
            )
            return Survey(now.table.revision, 0, 0, values.tobytes(), some=some.tobytes())
        running = now.state is State.RUNNING
        return Survey(
            now.table.revision,
            tally.reader.last_time_ns,
            sums.since_ns,
            _values(tally, sums, request.quantities, names, entries=bool(request.names), running=running),
            tally.skipped,
            tally.jitter_s,
            _values(tally, sums, request.some_quantities, request.some, entries=True, running=running),
        )

    def _begin(self) -> None:
        if self._thread is None and not self._stopped:
            self._follow_run()
            self._thread = threading.Thread(target=self._follow, name="silo statistics", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        with self._lock:
            self._stopped, thread = True, self._thread
        self._wake.set()
        if thread is not None:
            thread.join()

    def _follow(self) -> None:
        while not self._wake.wait(PERIOD_S):
            with self._lock:
                try:
                    self._round(time.monotonic())
                except SegmentError:  # it was replaced; the next round opens the new one
                    changes = self._tally.changes() if self._tally is not None else self._changes
                    self._let_go()
                    self._changes = changes
                except Exception as error:
                    log.exception("the statistics failed; they begin anew")
                    self._let_go()
                    for one in self._askers.all():
                        one.value.failed = (
                            f"the statistics failed and begin anew: {type(error).__name__}: {error}; the helper "
                            "process has logged where; values and plots go on"
                        )
                if not self._askers.all():
                    self._thread = None
                    self._let_go()
                    return

    def _round(self, now_s: float) -> None:
        self._askers.expire()
        self._follow_run(asked=True)
        if self._tally is not None:
            self._tally.advance(now_s, [one.value.sums for one in self._askers.all()])

    def _follow_run(self, *, asked: bool = False) -> None:
        """Go over to a new run; its statistics are its own. With other derived signals those of the others go on.

        One that begins when statistics were `asked` for already is followed from its first tick.
        """
        before = self._tally
        if not self._run.look() and before is not None:
            return
        if before is not None:
            self._changes = before.changes()
        reader = self._run.reader
        self._tally = None
        if reader is not None:
            whole = asked and reader.schema.run != self._followed
            self._tally = Tally(reader, whole=whole)
            self._followed = reader.schema.run
            kept = self._tally.go_on(before) if before is not None else []
            if self._changes is not None and not kept:
                self._tally.remember(self._changes)
            for one in self._askers.all():
                sums = one.value.sums
                one.value.sums = sums.moved(self._tally.count, kept) if kept else self._tally.sums(whole=whole)

    def _let_go(self) -> None:
        self._tally = self._changes = None
        self._run.forget()

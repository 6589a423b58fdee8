"""Samples that are held: as columns, as rows, in pins; moments and facts in them. And streams of what comes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from silo.core.arrays.columns import MAX_COLUMNS, MIN_COLUMN_NS, ColumnGrid, Gap, bins_of
from silo.history import requests, search_requests
from silo.history.picking import PinnedRows, RingGroup, RingSource, blocks, first_row
from silo.history.pins import Pins
from silo.history.requests import By, Columns, GetHistory
from silo.history.samples import check_samples, samples
from silo.history.search import check_moments, check_span, find_moments, measure_span
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.rpc.serving import Server
from silo.segment.layout import TIME_RING, ElementSchema, EntrySchema
from silo.segment.picking import RowPicker
from silo.segment.reader import SegmentReader
from silo.state.replica import LoggerSnapshot, Replica

MAX_NAMES = 64
SPARE_ROWS = 64  # of the oldest some may be overwritten while they are read


def check_history(request: GetHistory) -> None:
    """Raise RequestRefusedError for a request that can't be answered."""
    problem = None
    if not request.names or len(request.names) > MAX_NAMES:
        problem = f"ask for 1 to {MAX_NAMES} names, got {len(request.names)}"
    elif not MIN_COLUMN_NS <= request.column_ns < 2**62:
        problem = f"column_ns must be {MIN_COLUMN_NS} or more, got {request.column_ns}"
    elif not -(2**62) < request.start_ns < request.end_ns < 2**62:
        problem = f"the time span {request.start_ns} ... {request.end_ns} ns is empty or out of range"
    elif _count(request) > MAX_COLUMNS:
        problem = f"{_count(request)} columns are too many, at most {MAX_COLUMNS}: ask for wider ones"
    if problem:
        raise RequestRefusedError(RefusedWhy.INVALID, f"no history: {problem}")


def _count(request: GetHistory) -> int:
    return -(-request.end_ns // request.column_ns) - request.start_ns // request.column_ns


def history(
    request: GetHistory, now: LoggerSnapshot, reader: SegmentReader | None, pinned: PinnedRows | None = None
) -> Columns:
    """Return the columns; one without sample says why, be it that the element is off or that its buffer is shorter.

    With `pinned` they are of what is held there.
    """
    source: RingSource | None = pinned or reader
    until_ns = pinned.span_ns()[1] if pinned else reader.last_time_ns if reader else 0
    grid = ColumnGrid(len(request.names), request.start_ns // request.column_ns, _count(request))
    schemas = {element.info.name: element for element in source.schema.elements} if source else {}
    wanted: dict[int, dict[int, EntrySchema]] = {}
    logged: list[tuple[int, ElementSchema]] = []
    for signal, name in enumerate(request.names):
        found = now.entry(now.found(name))
        if found is None:
            raise RequestRefusedError(
                RefusedWhy.NOT_FOUND, f"no entry is called '{name[:200]}'; entries are named like '/log/q_x'"
            )
        element = schemas.get(found[0])
        if element is not None and found[1] < len(element.entries):
            for ring in {element.ring, element.watch_ring}:
                wanted.setdefault(ring, {})[signal] = element.entries_in(ring)[found[1]]
            logged.append((signal, element))
    for ring, signals in wanted.items():
        assert source is not None  # whose rings these are
        picker = RowPicker(signals)
        if pinned is not None and not pinned.holds(ring, picker.words):
            continue
        begin = first_row(source, ring, By.TIME, request.start_ns)
        for rows in blocks(source, RingGroup(ring, -1, picker.words), begin, source.head(ring)):
            bins = bins_of(rows.time_ns, request.column_ns)
            for signal, values in picker.columns(rows):
                grid.add(signal, bins, values)
            if int(rows.time_ns[-1]) >= request.end_ns:
                break
    if reader is not None and pinned is None:
        _say_why_empty(grid, reader, logged, request)
    return Columns(names=list(request.names), column_ns=request.column_ns, until_ns=until_ns, **grid.packed())


def _say_why_empty(
    grid: ColumnGrid, reader: SegmentReader, logged: list[tuple[int, ElementSchema]], request: GetHistory
) -> None:
    ticks = reader.ticks
    if not ticks:
        return
    start = _start_ns(reader) // request.column_ns
    newest = reader.last_time_ns // request.column_ns
    known = {signal for signal, _ in logged}
    for signal in range(len(request.names)):
        grid.add_hole(signal, grid.first, start, Gap.BEFORE)
        if signal not in known:
            grid.add_hole(signal, start, newest + 1, Gap.OFF)
    rings = {ring for _, element in logged for ring in (element.ring, element.watch_ring)}
    ends = {ring: _ends(reader, ring, ticks) for ring in rings}
    for signal, element in logged:
        oldest_ns, newest_ns, overwritten, cut = ends[element.ring]
        resumed = newest + 1
        if element.watch_ring != element.ring:
            resumed = ends[element.watch_ring][0] // request.column_ns
        if overwritten:
            grid.add_hole(signal, start, oldest_ns // request.column_ns, Gap.OVERWRITTEN)
        if cut:
            lost = reader.ring_lost(element.ring) > 0
            hole = Gap.LOST if lost else Gap.OVERWRITTEN if element.live_ring >= 0 else Gap.FULL
            grid.add_hole(signal, newest_ns // request.column_ns + 1, resumed, hole)


def _ends(reader: SegmentReader, ring: int, ticks: int) -> tuple[int, int, bool, bool]:
    """Return times of the oldest and the newest row, and whether rows before and after these are gone."""
    due, head = reader.schema.rings[ring].rows_before(ticks), reader.head(ring)
    oldest, newest = reader.rows(ring, 0, SPARE_ROWS), reader.rows(ring, head - 1, 1)
    if not len(oldest) or not len(newest):  # all of them were overwritten while we looked
        return reader.last_time_ns, reader.last_time_ns, head > 0, False
    return int(oldest.time_ns[0]), int(newest.time_ns[0]), oldest.first > 0, head < due


def _start_ns(reader: SegmentReader) -> int:
    """Return the time of the first tick, reckoned from the rate where its stamp was overwritten."""
    oldest = reader.rows(TIME_RING, 0, SPARE_ROWS)
    if not len(oldest):
        return reader.last_time_ns
    return int(oldest.time_ns[0]) - int(oldest.first * 1e9 / reader.schema.frequency_hz)


@dataclass(frozen=True)
class HistoryServer(Server, does=[requests, search_requests]):
    """Answers what is held, and opens what is sent from now on."""

    replica: Replica
    pins: Pins
    open_or_renew: Callable[[requests.OpenStream], requests.StreamOpened]
    close_for: Callable[[str, str], str]  # by name and proof

    def open_stream(self, request: requests.OpenStream) -> requests.StreamOpened:
        return self.open_or_renew(request)

    def close_stream(self, request: requests.CloseStream) -> str:
        return self.close_for(request.stream, request.proof)

    def open_pin(self, request: requests.OpenPin) -> requests.PinOpened:
        return self.pins.open(request, self.replica.now, self.replica.open_watcher())

    def keep_pin(self, request: requests.KeepPin) -> str:
        self.pins.keep(request.pin, request.proof)
        return "kept"

    def close_pin(self, request: requests.ClosePin) -> str:
        return self.pins.close_for(request.pin, request.proof)

    def get_history(self, request: requests.GetHistory) -> requests.Columns:
        pinned = self.pins.rows(request.pin) if request.pin else None
        check_history(request)
        return history(request, self.replica.now, None if request.pin else self.replica.open_watcher(), pinned)

    def get_samples(self, request: requests.GetSamples) -> requests.SampleRows:
        source = self.pins.rows(request.pin) if request.pin else self.replica.open_watcher()
        check_samples(request)
        return samples(request, self.replica.now, source)

    def find_moments(self, request: search_requests.FindMoments) -> search_requests.MomentsFound:
        check_moments(request)
        pinned = self._pinned(request.pins)
        return find_moments(request, self.replica.now, self.replica.open_watcher(), pinned)

    def measure_span(self, request: search_requests.MeasureSpan) -> search_requests.SpanMeasured:
        check_span(request)
        pinned = self._pinned(request.pins)
        return measure_span(request, self.replica.now, self.replica.open_watcher(), pinned)

    def _pinned(self, pins: Sequence[str]) -> list[PinnedRows]:
        return [found for pin in pins if (found := self.pins.rows(pin)) is not None]

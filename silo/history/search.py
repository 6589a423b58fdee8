"""Looking for moments in all that is held of some signals: rows of pins, and of the buffers before and after them.

In blocks, so that memory stays small however long the buffers are; the answer has a bounded number of moments.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from silo.core.structs import alike
from silo.expressions.search import Finder, Looking
from silo.expressions.span import HELD_PERIODS, Measuring
from silo.history.picking import PinnedRows, RingSource, RowSelection, blocks, bounds, check_known, pick
from silo.history.requests import By
from silo.history.search_requests import FindMoments, FoundIn, MeasureSpan, MomentsFound, SpanFacts, SpanMeasured
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.segment.layout import SegmentSchema
from silo.segment.picking import STAMPS
from silo.segment.reader import SegmentReader
from silo.segment.rows import Rows, Words, placed
from silo.state.replica import LoggerSnapshot

MAX_NAMES = 64
MAX_MOMENTS = 10_000  # of all names together
MAX_PINS = 16
NOTHING_HELD = "nothing of that recording is held"


class SearchedRows:
    """The rows of pins where these have them, else those of the buffers; to be read as a segment is."""

    def __init__(self, reader: SegmentReader | None, pins: Sequence[PinnedRows]) -> None:
        """All pins are of the run of the reader, or of another one where there is none."""
        self._reader = reader
        self._pins = pins

    @property
    def schema(self) -> SegmentSchema:
        """What the rows are of."""
        return self._reader.schema if self._reader is not None else self._pins[0].schema

    def head(self, ring: int) -> int:
        """Return the number of the row after the newest one that is held."""
        return max([0 if self._reader is None else self._reader.head(ring), *(pin.head(ring) for pin in self._pins)])

    def rows(self, ring: int, since: int, limit: int | None = None, words: Words | None = None) -> Rows:
        """Return rows from `since` on, a stretch without a gap, of each the words at these places."""
        following = None
        for pin in self._pins:
            if not pin.holds(ring, STAMPS if words is None else words) or pin.head(ring) <= since:
                continue
            first = pin.first(ring)
            if first <= since:
                return pin.rows(ring, since, limit, words)
            if pin.head(ring) > first and (following is None or first < following.first(ring)):
                following = pin
        if self._reader is not None:
            until = following.first(ring) - since if following is not None else None
            most = min([each for each in (limit, until) if each is not None], default=None)
            rows = self._reader.rows(ring, since, most, words)
            if len(rows) and (following is None or rows.first < following.first(ring)):
                return rows.part(rows.first, following.first(ring)) if following is not None else rows
            if following is None:
                return rows
        if following is not None:
            return following.rows(ring, since, limit, words)
        none = np.zeros((0, len(words) if words is not None else 2), np.uint64)
        return Rows(self.schema.rings[ring], since, none)


def check_moments(request: FindMoments) -> None:
    """Raise RequestRefusedError for a request that can't be answered."""
    problem = None
    if not request.names or len(request.names) > MAX_NAMES:
        problem = f"ask for 1 to {MAX_NAMES} names, got {len(request.names)}"
    elif request.most < 1 or request.most * len(request.names) > MAX_MOMENTS:
        problem = f"most must be 1 to {MAX_MOMENTS // len(request.names)} moments of each name, got {request.most}"
    elif not -(2**62) <= request.start_ns <= request.end_ns <= 2**62:
        problem = f"from {request.start_ns} to {request.end_ns} is out of range, or goes backwards"
    elif not -(2**62) <= request.around_ns <= 2**62:
        problem = f"around_ns {request.around_ns} is out of range"
    elif len(request.bounds) not in (0, len(request.names)):
        problem = f"bounds are of every name or of none, got {len(request.bounds)} for {len(request.names)} names"
    elif len(request.pins) > MAX_PINS:
        problem = f"name at most {MAX_PINS} pins, got {len(request.pins)}"
    elif request.level != request.level or request.direction not in (-1, 0, 1):
        problem = "the level must be a number and the direction -1, 0 or 1"
    if problem:
        raise RequestRefusedError(RefusedWhy.INVALID, f"nothing was looked for: {problem}")


def find_moments(
    request: FindMoments, now: LoggerSnapshot, reader: SegmentReader | None, pins: Sequence[PinnedRows]
) -> MomentsFound:
    """Return what was found of each name, in what `pins` and the buffers hold of one run."""
    run, source, found = _picked(request, now, reader, pins)
    if source is None:
        return MomentsFound(run, [FoundIn(name, why=NOTHING_HELD) for name in request.names])
    frequency_hz = source.schema.frequency_hz
    limits = dict(zip(request.names, request.bounds or [(None, None)] * len(request.names), strict=True))
    finders = {
        one.name: Finder(
            Looking(request.what, request.level, request.direction, limits[one.name],
                    max(1, round(1e9 * one.divider / frequency_hz))),
            request.around_ns, request.most,
        )
        for one in found.names
    }  # fmt: skip
    if any(finder.looking.needs_span for finder in finders.values()):
        for name, _, values in _blocks(found, source, request.start_ns, request.end_ns):
            finders[name].measure(values)
    for name, stamps, values in _blocks(found, source, request.start_ns, request.end_ns):
        finders[name].feed(stamps, values)
    return MomentsFound(run, [_of(name, finders.get(name), found.missing.get(name, "")) for name in request.names])


def check_span(request: MeasureSpan) -> None:
    """Raise RequestRefusedError for a request that can't be answered."""
    problem = None
    if not request.names or len(request.names) > MAX_NAMES:
        problem = f"ask for 1 to {MAX_NAMES} names, got {len(request.names)}"
    elif not all(-(2**62) <= each <= 2**62 for each in (request.a_ns, request.b_ns)):
        problem = f"from {request.a_ns} to {request.b_ns} is out of range"
    elif len(request.pins) > MAX_PINS:
        problem = f"name at most {MAX_PINS} pins, got {len(request.pins)}"
    if problem:
        raise RequestRefusedError(RefusedWhy.INVALID, f"nothing was measured: {problem}")


def measure_span(
    request: MeasureSpan, now: LoggerSnapshot, reader: SegmentReader | None, pins: Sequence[PinnedRows]
) -> SpanMeasured:
    """Return the facts of each name between two moments, in what `pins` and the buffers hold of one run."""
    run, source, found = _picked(request, now, reader, pins)
    if source is None:
        return SpanMeasured(run, [SpanFacts(name, why=NOTHING_HELD) for name in request.names])
    begin_ns, end_ns = min(request.a_ns, request.b_ns), max(request.a_ns, request.b_ns)
    # what held at the earlier one may be some periods older
    longest = max((one.divider for one in found.names), default=1)
    before_ns = round(HELD_PERIODS * 1e9 * longest / source.schema.frequency_hz)
    measured = {one.name: Measuring(request.a_ns, request.b_ns) for one in found.names}
    for name, stamps, values in _blocks(found, source, begin_ns - before_ns, end_ns):
        measured[name].feed(stamps, values)
    return SpanMeasured(
        run,
        [
            alike(SpanFacts, measured[name].found, name=name)
            if name in measured
            else SpanFacts(name, why=found.missing.get(name, ""))
            for name in request.names
        ],
    )


def _picked(
    request: FindMoments | MeasureSpan, now: LoggerSnapshot, reader: SegmentReader | None, pins: Sequence[PinnedRows]
) -> tuple[str, SearchedRows | None, RowSelection]:
    """Return which run it is about, what is held of it (None for nothing), and where the names stand there."""
    check_known(request.names, now)
    run = request.run or (reader.schema.run if reader is not None else "")
    reader = reader if reader is not None and reader.schema.run == run else None
    pins = [pin for pin in pins if pin.schema.run == run]
    if reader is not None:
        # other derived signals have other rings
        pins = [pin for pin in pins if pin.schema.conditions.derived == reader.schema.conditions.derived]
    source = SearchedRows(reader, pins) if reader is not None or pins else None
    return run, source, pick(request.names, now, source.schema if source is not None else None)


def _of(name: str, finder: Finder | None, why: str) -> FoundIn:
    if finder is None:
        return FoundIn(name, why=why)
    found = finder.found
    values = found.values.astype(found.values.dtype.newbyteorder("<"))
    return FoundIn(
        name, found.total, found.before, found.time_ns.astype("<i8").tobytes(), values.tobytes(), values.dtype.str,
        found.begin_ns, found.end_ns,
    )  # fmt: skip


def _blocks(
    found: RowSelection, source: RingSource, start_ns: int, end_ns: int
) -> Iterator[tuple[str, NDArray[np.int64], NDArray[np.generic]]]:
    """Return the samples of each name, block by block, oldest first; what is overwritten meanwhile is left out."""
    for number, group in enumerate(found.groups):
        entries = [(one.name, placed(one.entries[0])) for one in found.names if one.group == number]
        for rows in blocks(source, group, *bounds(source, group, start_ns, end_ns + 1, By.TIME)):
            for name, entry in entries:
                yield name, rows.time_ns, rows.at(entry)

"""History: past samples of some entries in columns, straight from the buffers in shared memory."""

from silo.collecting.schema import ElementSchema, EntrySchema
from silo.collecting.segment_reader import SegmentReader
from silo.columns import MAX_COLUMNS, ColumnGrid, as_floats, bins_of
from silo.helper.mirror import LoggerSnapshot
from silo.helper.views import MIN_COLUMN_NS
from silo.ipc.messages import Columns, GetHistory, Refused, RefusedWhy

MAX_NAMES = 64
BLOCK_BYTES = 4 * 2**20


def check_history(request: GetHistory) -> Refused | None:
    """Why a request can't be answered, None if it can."""
    problem = None
    if not request.names or len(request.names) > MAX_NAMES:
        problem = f"ask for 1 to {MAX_NAMES} names, got {len(request.names)}"
    elif request.column_ns < MIN_COLUMN_NS:
        problem = f"column_ns must be {MIN_COLUMN_NS} or more, got {request.column_ns}"
    elif request.end_ns <= request.start_ns or not -(2**62) < request.start_ns < request.end_ns < 2**62:
        problem = f"the time span {request.start_ns} ... {request.end_ns} ns is empty or out of range"
    elif _count(request) > MAX_COLUMNS:
        problem = f"{_count(request)} columns are too many, at most {MAX_COLUMNS}: ask for wider ones"
    return Refused(RefusedWhy.INVALID, f"no history: {problem}") if problem else None


def _count(request: GetHistory) -> int:
    return -(-request.end_ns // request.column_ns) - request.start_ns // request.column_ns


def history(request: GetHistory, now: LoggerSnapshot, reader: SegmentReader | None) -> Columns | Refused:
    """The columns; NaN where nothing is known, be it that an element is disabled or that its buffer is shorter."""
    grid = ColumnGrid(len(request.names), request.start_ns // request.column_ns, _count(request))
    schemas = {element.info.name: element for element in reader.schema.elements} if reader else {}
    wanted: dict[int, list[tuple[int, EntrySchema]]] = {}
    for signal, name in enumerate(request.names):
        found = now.entry_places.get(name)
        if found is None:
            return Refused(
                RefusedWhy.NOT_FOUND, f"no entry is called '{name[:200]}'; entries are named like '/log/q_x'"
            )
        element = schemas.get(found[0])
        if element is not None and found[1] < len(element.entries):
            _want(wanted, element, signal, found[1])
    if reader is not None:
        for ring, signals in wanted.items():
            _fill(grid, reader, ring, signals, request)
    return Columns(
        list(request.names), grid.first, grid.low.shape[1], request.column_ns, grid.low.tobytes(), grid.high.tobytes()
    )


def _want(wanted: dict[int, list[tuple[int, EntrySchema]]], element: ElementSchema, signal: int, number: int) -> None:
    """The element's own buffer and, where that isn't the one in which all samples pass, that one too."""
    wanted.setdefault(element.ring, []).append((signal, element.entries[number]))
    if element.live_ring >= 0 and element.live_ring != element.ring:
        wanted.setdefault(element.live_ring, []).append((signal, element.live_entries[number]))


def _fill(
    grid: ColumnGrid,
    reader: SegmentReader,
    ring: int,
    signals: list[tuple[int, EntrySchema]],
    request: GetHistory,
) -> None:
    block = max(1, BLOCK_BYTES // (8 * reader.schema.rings[ring].row_words))
    row = _first_row(reader, ring, request.start_ns)
    while True:
        rows = reader.rows(ring, row, block)
        if not len(rows):
            return
        bins = bins_of(rows.time_ns, request.column_ns)
        for signal, entry in signals:
            grid.add(signal, bins, as_floats(rows.column(entry)))
        row = rows.first + len(rows)
        if int(rows.time_ns[-1]) >= request.end_ns or len(rows) < block:
            return


def _first_row(reader: SegmentReader, ring: int, start_ns: int) -> int:
    """The first row at or after `start_ns`, by bisection; rows that are overwritten meanwhile only move it on."""
    oldest = reader.rows(ring, 0, 1).first
    low, high = oldest, reader.head(ring)
    while low < high:
        middle = (low + high) // 2
        found = reader.rows(ring, middle, 1)
        if len(found) and found.first == middle and int(found.time_ns[0]) >= start_ns:
            high = middle
        else:
            low = middle + 1
    return low

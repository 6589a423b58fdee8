"""Raw samples of any enabled element: rows straight from the buffers, as many as a reply may hold."""

from collections.abc import Sequence

import numpy as np

from silo.core.names import grouped
from silo.history.picking import PinnedRows, RingSource, RowSelection, bounds, check_known, first_row, pick
from silo.history.requests import GetSamples, SampledRows, SampleRows
from silo.rpc.refusals import RefusedWhy, RequestRefusedError
from silo.segment.picking import STAMPS
from silo.state.replica import LoggerSnapshot

MAX_NAMES = 10_000
MIN_BYTES, MAX_BYTES = 4096, 4 * 2**20
BLOCK_BYTES = 2**20  # read at a time, so that what is overwritten meanwhile costs little


def check_samples(request: GetSamples) -> None:
    """Raise RequestRefusedError for a request that can't be answered."""
    problem = None
    if not request.names or len(request.names) > MAX_NAMES:
        problem = f"ask for 1 to {MAX_NAMES} names, got {len(request.names)}"
    elif not MIN_BYTES <= request.reply_bytes <= MAX_BYTES:
        problem = f"reply_bytes must be {MIN_BYTES} to {MAX_BYTES}, got {request.reply_bytes}"
    elif not -(2**62) <= request.start <= request.end <= 2**62:
        problem = f"from {request.start} to {request.end} is out of range, or goes backwards"
    elif request.resume and not request.run:
        problem = "who goes on names the run of the reply before"
    elif any(not 0 <= row <= end <= 2**62 for row, end in request.resume):
        problem = "what it goes on with is none of our replies"
    if problem:
        raise RequestRefusedError(RefusedWhy.INVALID, f"no samples: {problem}")


def samples(request: GetSamples, now: LoggerSnapshot, source: RingSource | None) -> SampleRows:
    """Return the rows, or as many as may go into a reply, with what to go on with."""
    check_known(request.names, now)
    run = source.schema.run if source is not None else ""
    if request.resume and request.run != run:
        text = "no samples: the logger was started anew since the reply before; ask from the beginning"
        raise RequestRefusedError(RefusedWhy.CONFLICT, text)
    held = source.holds if isinstance(source, PinnedRows) else None
    found = pick(request.names, now, source.schema if source is not None else None, held)
    if source is None:
        return SampleRows(run, [], [], [], found.missing)
    if request.resume and len(request.resume) != len(found.groups):
        raise RequestRefusedError(
            RefusedWhy.INVALID, "no samples: these are other names than those of the reply before"
        )
    wanted = request.resume or [bounds(source, group, request.start, request.end, request.by) for group in found.groups]
    rows, resume = _read(found, source, wanted, request.reply_bytes)
    if request.resume:
        return SampleRows(run, rows, resume, [], found.missing)
    return SampleRows(run, rows, resume, found.names, {**found.missing, **_empty(found, source, wanted, request)})


def _empty(
    found: RowSelection, source: RingSource, wanted: Sequence[tuple[int, int]], request: GetSamples
) -> dict[str, str]:
    """Why names have no row of what is wanted, that are there."""
    groups = grouped((one.name, one.group) for one in found.names)
    return {
        name: _why_empty([found.groups[group].ring for group in some], source, request)
        for name, some in groups.items()
        if all(wanted[group][0] >= wanted[group][1] for group in some)
    }


def _why_empty(rings: Sequence[int], source: RingSource, request: GetSamples) -> str:
    ends = [
        (rows.first, int(rows.words[0, 0].view(np.int64)), int(last.words[-1, 0].view(np.int64)))
        for ring in rings
        if len(rows := source.rows(ring, 0, 1, STAMPS))
        and len(last := source.rows(ring, source.head(ring) - 1, 1, STAMPS))
    ]
    if not ends:
        return "this pin has none of it" if isinstance(source, PinnedRows) else "nothing was logged of it yet"
    row, oldest, newest = min(ends)[0], min(end[1] for end in ends), max(end[2] for end in ends)
    if isinstance(source, PinnedRows):
        return f"this pin has it from tick {oldest} to {newest}"
    if row > 0 and first_row(source, min(rings), request.by, request.end) <= row:
        return f"it was overwritten: it is kept from tick {oldest} on"
    return f"no sample of it lies there: it is kept from tick {oldest} to {newest}"


def _read(
    found: RowSelection, source: RingSource, wanted: list[tuple[int, int]], room: int
) -> tuple[list[SampledRows], list[tuple[int, int]]]:
    read: list[SampledRows] = []
    resume: list[tuple[int, int]] = []
    for number, (group, (begin, end)) in enumerate(zip(found.groups, wanted, strict=True)):
        blocks: list[bytes] = []
        first, row = begin, begin
        while row < end and (room >= group.row_bytes or not (read or blocks)):
            most = max(1, min(room, BLOCK_BYTES) // group.row_bytes)
            rows = source.rows(group.ring, row, min(most, end - row), group.words)
            if rows.first > row and blocks:
                break  # a stretch has no gap: what is left comes with the next reply
            if not len(rows) and rows.first <= row:
                row = end  # there are no more
                break
            rows = rows.part(rows.first, end)  # what was overwritten meanwhile moved it on
            first = first if blocks else rows.first
            row = rows.first + len(rows)
            if len(rows):
                blocks.append(rows.words.tobytes())
                room -= len(blocks[-1])
        if blocks:
            read.append(SampledRows(number, first, sum(map(len, blocks)) // group.row_bytes, b"".join(blocks)))
        resume.append((min(row, end), end))
    return read, resume

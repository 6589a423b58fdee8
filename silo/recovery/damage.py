"""Whether the rows of a segment are those that its writer committed: each begins with its tick, which is known.

Pages that a file system lost read as zeros and would be taken for values. What a page lost in the midst of a row that
is wider than it can't be seen.
"""

from collections.abc import Iterator

import numpy as np

from silo.segment.reader import SegmentReader
from silo.segment.rows import Rows

BLOCK_BYTES = 4 << 20


def damage(reader: SegmentReader) -> tuple[str, ...]:
    """A line for each ring of a dead writer's segment that holds rows of another tick than theirs; fit to show."""
    return tuple(text for ring in range(len(reader.schema.rings)) if (text := _damage(reader, ring)))


def _damage(reader: SegmentReader, ring: int) -> str:
    divider = reader.schema.rings[ring].divider
    wrong, first, last, count = 0, -1, -1, 0
    for rows in _blocks(reader, ring):
        numbers = np.arange(rows.first, rows.first + len(rows))
        differing = numbers[rows.ticks != numbers * divider]
        if len(differing):
            first = int(differing[0]) * divider if first < 0 else first
            last = int(differing[-1]) * divider
        wrong += len(differing)
        count += len(rows)
    if not wrong:
        return ""
    names = [element.info.name for element in reader.schema.elements if element.ring == ring]
    shown = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
    what = shown if ring else "the time stamps"
    return (
        f"{wrong} of {count} rows of {what} are damaged, the first at tick {first}, the last at {last}: "
        "what stands there in the file is not what was logged"
    )


def _blocks(reader: SegmentReader, ring: int) -> Iterator[Rows]:
    limit = max(1, BLOCK_BYTES // (8 * reader.schema.rings[ring].row_words))
    since = 0
    while len(rows := reader.rows(ring, since, limit)):
        yield rows
        since = rows.first + len(rows)

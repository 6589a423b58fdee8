"""What a segment, or a recording, holds: not the ticks since start, of which looping buffers forget most.

The robot program, its helper and the commands say it with these words. Nothing is copied, so that it may be asked of a
segment of gigabytes while it is written.
"""

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from itertools import accumulate

from silo.core.elements import BufferType, ElementOptions
from silo.core.names import grouped
from silo.core.quantities.writing import duration, many
from silo.core.recording import Recording
from silo.journal.reader import JournalReader
from silo.segment.layout import TIME_RING, SegmentSchema
from silo.segment.reader import SegmentReader
from silo.segment.retention import kept_rows

_SINCE_CUT = "the last applied change"


@dataclass(frozen=True)
class Holdings:
    """`samples` of `elements` together (those that hold any), from the oldest to the newest in `seconds`.

    Most of the elements hold `most_s` or less: of what is kept for good, or seldom sampled, the oldest is far older.

    `ticks` counts those since start, or since the cut where it goes on another run, whether anything of them is still
    held or not. `published` more elements are logged without being saved.
    """

    ticks: int
    elements: int
    samples: int
    seconds: float
    since: str = "start"
    most_s: float = 0.0
    published: int = 0

    @property
    def text(self) -> str:
        """Fit to show: `1 000 samples of 1 element over 9.99 s, of 12 840 ticks since start`."""
        ticks = many(self.ticks, "tick")
        if not self.samples:
            return f"no sample, of {ticks} since {self.since}"
        held = f"{many(self.samples, 'sample')} of {many(self.elements, 'element')}"
        held += f" ({self.published} more only published)" if self.published else ""
        most = (
            f" (most of them {duration(self.most_s)} or less, what their buffers hold)"
            if 0 < 2 * self.most_s < self.seconds
            else ""
        )
        return f"{held} over {duration(self.seconds)}{most}, of {ticks} since {self.since}"


@dataclass(frozen=True)
class RetainedAlike:
    """Elements that are kept alike hold the same samples: `count` of them."""

    ring: int
    options: ElementOptions
    count: int


def kept_alike(schema: SegmentSchema) -> list[RetainedAlike]:
    """The saved elements of a segment, those that hold the same samples as one: few even of 10,000."""
    saved = [(one.ring, one.info.options) for one in schema.elements if one.info.options.action.saves]
    alike = grouped(((ring, how.divider, how.buffer, how.size), how) for ring, how in saved)
    return [RetainedAlike(ring, some[0], len(some)) for (ring, *_), some in alike.items()]


def segment_holdings(reader: SegmentReader | JournalReader, kept: list[RetainedAlike] | None = None) -> Holdings:
    """What a snapshot of this segment, or journal, would hold now. Raises SegmentError where it is damaged.

    `kept` is what `kept_alike` returned for it, where this is asked again and again.
    """
    schema, ticks = reader.schema, reader.ticks
    since = _SINCE_CUT if schema.cut is not None else "start"
    first_tick = max(0, ticks - schema.time_buffer_size) if schema.time_buffer_type is BufferType.LOOPING else 0
    first_tick = max(first_tick, reader.first(TIME_RING))
    alike = kept_alike(schema) if kept is None else kept
    spans = [(_samples(reader, one, ticks, first_tick), one) for one in alike]
    held = [(span, one) for span, one in spans if len(span)]
    if not held:
        return Holdings(ticks, 0, 0, 0.0, since)
    ends = [(span[0] * one.options.divider, span[-1] * one.options.divider, one.count) for span, one in held]
    seconds, most_s = _lengths(ends, lambda tick: _stamp(reader, tick))
    elements, samples = sum(one.count for _, one in held), sum(len(span) * one.count for span, one in held)
    return Holdings(ticks, elements, samples, seconds, since, most_s, published_in(schema))


def published_in(schema: SegmentSchema) -> int:
    """How many elements of a segment are logged without being saved."""
    return sum(not element.info.options.action.saves for element in schema.elements)


def _lengths(ends: list[tuple[int, int, int]], stamp_of: Callable[[int], int]) -> tuple[float, float]:
    """How long that is from the oldest tick to the newest, and at most of more than half of the elements.

    `ends` are oldest tick, newest tick and how many elements have these.
    """
    shortest = sorted(ends, key=lambda each: (each[1] - each[0], each[0]))
    counts = list(accumulate(each[2] for each in shortest))
    most = shortest[bisect_right(counts, counts[-1] / 2)]
    whole = min(each[0] for each in ends), max(each[1] for each in ends)
    seconds, most_s = ((stamp_of(newest) - stamp_of(oldest)) / 1e9 for oldest, newest in (whole, most[:2]))
    return seconds, most_s


def _samples(reader: SegmentReader | JournalReader, kept: RetainedAlike, ticks: int, first_tick: int) -> range:
    """Numbers of the samples that are kept: as in a snapshot, none without its time stamp."""
    divider = kept.options.divider
    begin, end = kept_rows(kept.options, reader.first(kept.ring), min(-(-ticks // divider), reader.head(kept.ring)))
    return range(max(begin, -(-first_tick // divider)), end)


def _stamp(reader: SegmentReader | JournalReader, tick: int) -> int:
    rows = reader.rows(TIME_RING, tick, 1)
    return int(rows.time_ns[0]) if len(rows) else 0


def recording_holdings(recording: Recording) -> Holdings:
    """What a recording holds, as it is written to a file."""
    since = _SINCE_CUT if recording.stretch is not None and recording.stretch.part > 1 else "start"
    held = [element for element in recording.elements if element.count]
    if not held:
        return Holdings(recording.offset, 0, 0, 0.0, since)
    ends = [(each.first, each.first + (each.count - 1) * each.divider, 1) for each in held]
    seconds, most_s = _lengths(ends, lambda tick: int(recording.time_ns[tick]))
    return Holdings(recording.offset, len(held), sum(each.count for each in held), seconds, since, most_s)

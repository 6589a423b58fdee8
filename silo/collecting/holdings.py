"""What a segment, or a recording, holds: not the ticks since start, of which looping buffers forget most.

The robot program, its helper and the commands say it with these words. Nothing is copied, so that it may be asked of a
segment of gigabytes while it is written.
"""

from dataclasses import dataclass

from silo.collecting.keeping import kept_rows
from silo.collecting.schema import TIME_RING, ElementSchema
from silo.collecting.segment_reader import SegmentReader
from silo.model import BufferType
from silo.recording import Recording


@dataclass(frozen=True)
class Holdings:
    """`samples` of `elements` together (those that hold any), from the oldest to the newest in `seconds`.

    `ticks` counts those since start, whether anything of them is still held or not.
    """

    ticks: int
    elements: int
    samples: int
    seconds: float

    @property
    def text(self) -> str:
        """Fit to show: `1000 samples of 1 element over 9.99 s, of 12840 ticks since start`."""
        ticks = _many(self.ticks, "tick")
        if not self.samples:
            return f"no sample, of {ticks} since start"
        held = f"{_many(self.samples, 'sample')} of {_many(self.elements, 'element')}"
        seconds = f"{self.seconds:.3g}" if self.seconds < 1000 else f"{self.seconds:.0f}"
        return f"{held} over {seconds} s, of {ticks} since start"


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'s' if count != 1 else ''}"


def segment_holdings(reader: SegmentReader) -> Holdings:
    """What a snapshot of this segment would hold now. Raises SegmentError where it is damaged."""
    schema = reader.schema
    ticks = reader.ticks
    first_tick = max(0, ticks - schema.time_buffer_size) if schema.time_buffer_type is BufferType.LOOPING else 0
    saved = [element for element in schema.elements if element.info.options.action.saves]
    spans = [_samples(reader, element, ticks, first_tick) for element in saved]
    held = [(span, element.info.options.divider) for span, element in zip(spans, saved, strict=True) if len(span)]
    if not held:
        return Holdings(ticks, 0, 0, 0.0)
    oldest = min(span[0] * divider for span, divider in held)
    newest = max(span[-1] * divider for span, divider in held)
    seconds = (_stamp(reader, newest) - _stamp(reader, oldest)) / 1e9
    return Holdings(ticks, len(held), sum(len(span) for span, _ in held), seconds)


def _samples(reader: SegmentReader, element: ElementSchema, ticks: int, first_tick: int) -> range:
    """Numbers of the samples that are kept: as in a snapshot, none without its time stamp."""
    options = element.info.options
    due = -(-ticks // options.divider)
    begin, end = kept_rows(options, 0, min(due, reader.head(element.ring)))
    return range(max(begin, -(-first_tick // options.divider)), end)


def _stamp(reader: SegmentReader, tick: int) -> int:
    rows = reader.rows(TIME_RING, tick, 1)
    return int(rows.time_ns[0]) if len(rows) else 0


def recording_holdings(recording: Recording) -> Holdings:
    """What a recording holds, as it is written to a file."""
    held = [element for element in recording.elements if element.count]
    if not held:
        return Holdings(recording.offset, 0, 0, 0.0)
    oldest = min(element.first for element in held)
    newest = max(element.first + (element.count - 1) * element.divider for element in held)
    seconds = int(recording.time_ns[newest] - recording.time_ns[oldest]) / 1e9
    return Holdings(recording.offset, len(held), sum(element.count for element in held), seconds)

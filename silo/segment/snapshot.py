"""From rows to a recording, cut at one tick: which samples each buffer holds, and the words for what is missing."""

from collections import defaultdict
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from silo.core.elements import CUT, BufferType, LoggedEvent, Stretch
from silo.core.recording import (
    KEPT_ALIKE,
    NEVER_CHANGED,
    RecordedElement,
    RecordedEntry,
    Recording,
    failures_text,
    stamped,
    unheld_text,
    with_events,
)
from silo.core.structs import alike
from silo.segment.layout import TIME_RING, ElementSchema, SegmentSchema
from silo.segment.reasons import lost_text
from silo.segment.retention import kept_rows
from silo.segment.rows import Rows, RowSource, lost_samples


def snapshot(source: RowSource) -> Recording:
    """All elements that are saved.

    Takes a copy of the rows that are needed; entry values are strided views of it.
    """
    schema = source.schema
    ticks = source.ticks
    saved = [element for element in schema.elements if element.info.options.action.saves]
    due = {element.ring: -(-ticks // element.info.options.divider) for element in saved}
    looping = [ring for ring in due if schema.rings[ring].buffer_type is BufferType.LOOPING]
    # what is being overwritten comes first: a growing buffer of 100 MB takes longer than a looping one has to spare
    longest: dict[int, int] = defaultdict(int)
    for element in schema.elements:
        longest[element.ring] = max(longest[element.ring], element.info.options.size)
    copies = {ring: source.rows(ring, due[ring] - longest[ring]) for ring in looping}
    stamps = _time_stamps(source, ticks)
    first_tick = ticks - len(stamps)
    for ring in due.keys() - copies.keys():
        copies[ring] = source.rows(ring, 0, due[ring])
    elements = [_recorded(source, element, copies[element.ring], due[element.ring], first_tick) for element in saved]
    return alike(
        Recording,
        schema,
        time_ns=stamps,
        offset=ticks,
        elements=[element for element in elements if element.count],
        time_looping=schema.time_buffer_type is BufferType.LOOPING,
        warnings=_warnings(source, elements, ticks),
        events=stamped([*source.marks(), *source.changes()], stamps, ticks),
    )


def in_chain(recording: Recording, schema: SegmentSchema, *, cut_off: bool) -> Recording:
    """The recording of a stretch that says so, by a field and an event: that it goes on another, or is gone on."""
    if schema.cut is None and not cut_off:
        return recording
    return with_events(replace(recording, stretch=Stretch(*schema.stretch)), cut_events(schema))


def cut_events(schema: SegmentSchema) -> list[LoggedEvent]:
    """The event that a run goes on another one, if it does: what changed, and who asked for it."""
    cut = schema.cut
    return [LoggedEvent(CUT, cut.text, schema.started_ns, 0, 0, cut.who, schema.run)] if cut is not None else []


def _time_stamps(source: RowSource, ticks: int) -> NDArray[np.int64]:
    first = 0
    if source.schema.time_buffer_type is BufferType.LOOPING:
        first = max(0, ticks - source.schema.time_buffer_size)
    return np.ascontiguousarray(source.rows(TIME_RING, first).part(first, ticks).time_ns)


def _recorded(source: RowSource, element: ElementSchema, rows: Rows, due: int, first_tick: int) -> RecordedElement:
    info = element.info
    begin, end = kept_rows(info.options, rows.first, min(due, rows.first + len(rows)))
    begin = max(begin, -(-first_tick // info.options.divider))  # no sample without its time stamp
    kept = rows.part(begin, max(begin, end))
    return alike(
        RecordedElement,
        info,
        divider=info.options.divider,
        buffer_type=info.options.buffer,
        first=begin * info.options.divider - first_tick,
        entries=tuple(
            RecordedEntry(info.name + entry.entry.suffix, entry.entry, kept.column(entry)) for entry in element.entries
        ),
        lost=source.ring_lost(element.ring),
        failures=source.failures(element),
    )


def cut_text(name: str, length: int, element: RecordedElement) -> str:
    """That texts of an element were cut to their room, and how long one of them was."""
    dtype = next((one.values.dtype for one in element.entries if one.values.dtype.kind in "SU"), np.dtype("S"))
    room, unit = (dtype.itemsize // 4, "letters") if dtype.kind == "U" else (dtype.itemsize, "bytes")
    cut = f"texts of up to {length} {unit} were cut to {room}"
    return f"{name}: {cut}: give string_bytes={length} or more where it is added"


def _same(element: RecordedElement, ticks: int) -> str:
    """That all samples are the same, bit for bit, in words; empty where they are not, or one alone."""
    if element.count < 2:
        return ""
    bits = [np.ascontiguousarray(entry.values).view(np.uint8).reshape(element.count, -1) for entry in element.entries]
    if not all(bool((one == one[0]).all()) for one in bits):
        return ""
    return NEVER_CHANGED if element.count == -(-ticks // element.divider) else KEPT_ALIKE


def _warnings(source: RowSource, elements: list[RecordedElement], ticks: int) -> tuple[str, ...]:
    warnings = []
    lost = lost_samples(source)
    if lost:
        warnings.append(lost_text(lost, source.lost_whys()))
    failed = [element for element in elements if element.failures.count]
    warnings += [f"{element.name}: {failures_text(element.failures)}" for element in failed]
    cuts = source.cut_texts()
    warnings += [cut_text(element.name, cuts[element.name], element) for element in elements if element.name in cuts]
    unheld = source.unheld()
    warnings += [
        f"{element.name}: {unheld_text(unheld[element.name], _same(element, ticks))}"
        for element in elements
        if element.name in unheld
    ]
    sizes = {element.info.name: element.info.options.size for element in source.schema.elements}
    short = [
        element.name
        for element in elements
        if element.buffer_type is BufferType.LOOPING
        and element.count < min(sizes[element.name], -(-ticks // element.divider))
    ]
    if short:
        warnings.append(f"the oldest samples of {', '.join(short)} were overwritten while the snapshot was taken")
    return tuple(warnings)

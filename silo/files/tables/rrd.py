"""A recording -> Rerun's `.rrd`: a time series per element, texts and what happened as text logs.

Timelines: `time` (s from the first time stamp), `clock` (UTC, where the stamps are of the wall clock), `tick` (of
elements that have no times of their own).
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from silo.core.arrays.values import as_floats
from silo.core.quantities.writing import EPOCH_FROM_NS
from silo.core.recording import Progress, RecordedElement, Recording, silent, stamps_of
from silo.files.optional_packages import need, whole_file
from silo.files.texts import presentable

_ROWS = 1 << 16


def write_rrd(recording: Recording, path: Path, progress: Progress = silent) -> None:
    """Write `Scalars` of every element of numbers, its entries side by side; `TextLog` of texts and of `events`.

    Raises `SaveError`, and `SiloError` without rerun-sdk.
    """
    recording = presentable(recording)
    rerun = need("rerun", "rerun", ".rrd files")
    stream = rerun.RecordingStream(recording.logger or "silo", recording_id=str(recording.started_ns))
    total = max(1, len(recording.elements))
    with whole_file(path) as file:
        # Rerun takes a path: of the file that is to be whole or not at all
        stream.save(f"/proc/self/fd/{file.fileno()}")
        stream.send_recording_name(path.stem)
        for key, value in recording.told_about.items():
            stream.send_property(f"about/{key}", rerun.TextDocument(value))
        for number, warning in enumerate(recording.warnings):
            stream.send_property(f"warnings/{number}", rerun.TextDocument(warning))
        for done, element in enumerate(recording.elements, start=1):
            _write(rerun, stream, recording, element)
            progress(done / total)
        if recording.events:
            stamps = np.array([one.at_ns for one in recording.events], np.int64)
            texts = rerun.TextLog.columns(text=[f"{one.kind}: {one.text}" for one in recording.events])
            stream.send_columns("/events", _times(rerun, recording, stamps), texts)
        stream.flush()
        stream.disconnect()


def _write(rerun: Any, stream: Any, recording: Recording, element: RecordedElement) -> None:
    where = rerun.new_entity_path([part for part in element.name.split("/") if part])
    stamps = stamps_of(recording, element)
    ticks = None
    if element.own_ns is None:
        ticks = element.first + np.arange(element.count) * element.divider + recording.offset - len(recording.time_ns)
    texts = [entry for entry in element.entries if entry.dtype.kind in "SU"]
    numbers = [entry for entry in element.entries if entry.dtype.kind in "biufmM"]
    for begin in range(0, element.count, _ROWS):
        part = slice(begin, begin + _ROWS)
        times = _times(rerun, recording, stamps[part], None if ticks is None else ticks[part])
        if numbers:
            table = np.column_stack([as_floats(entry.values[part]) for entry in numbers])
            columns = rerun.Scalars.columns(scalars=table.ravel()).partition(np.full(len(table), len(numbers)))
            stream.send_columns(where, times, columns)
        for entry in texts:
            words = [value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
                     for value in np.ma.getdata(entry.values[part]).tolist()]  # fmt: skip
            stream.send_columns(where, times, rerun.TextLog.columns(text=words))
    if numbers:
        unit = "" if element.unit in ("", "-") else f" [{element.unit}]"
        names = [f"{entry.name.removeprefix(element.name).lstrip('_') or where}{unit}" for entry in numbers]
        stream.log(where, rerun.SeriesLines(names=names), static=True)


def _times(
    rerun: Any, recording: Recording, stamps: NDArray[np.int64], ticks: NDArray[np.int64] | None = None
) -> list[Any]:
    begin = int(recording.time_ns[0]) if len(recording.time_ns) else 0
    made = [rerun.TimeColumn("time", duration=(stamps - begin).astype("timedelta64[ns]"))]
    if begin >= EPOCH_FROM_NS:
        made.append(rerun.TimeColumn("clock", timestamp=stamps.astype("datetime64[ns]")))
    if ticks is not None:
        made.append(rerun.TimeColumn("tick", sequence=ticks))
    return made

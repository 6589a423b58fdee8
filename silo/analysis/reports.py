"""What is in a log, in numbers: the structs behind `silo info FILE` and `silo stats`, and their tables.

A report is made from a `Recording`, printed as a table that fits the terminal or as JSON.
"""

import math
from collections import Counter
from collections.abc import Sequence
from datetime import datetime, timezone
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from silo.analysis.compute.calculus import Floats
from silo.analysis.plots.events import LogEvent, event_lines, events_of
from silo.analysis.stretches import holes
from silo.core.arrays.values import from_base, text_of
from silo.core.quantities.writing import count, many, size_text
from silo.core.recording import NO_FAILURES, Failures, RecordedElement, Recording, lasted_s, rate_of, stamps_of
from silo.core.structs import alike
from silo.printing import printable, printable_lines

if TYPE_CHECKING:
    from silo.analysis.compute.samples import Samples


class ElementReport(msgspec.Struct, frozen=True):
    """One row of `silo info`: its first and last time in s, rate in Hz (None where it can't be told)."""

    name: str
    unit: str
    type: str
    kind: str
    divider: int
    buffer: str
    samples: int
    start_s: float | None
    end_s: float | None
    rate_hz: float | None
    lost: int
    labels: dict[int, str] = {}
    description: str = ""
    failures: Failures = NO_FAILURES


class LogReport(msgspec.Struct, frozen=True):
    """What `silo info FILE` says. `start_ns` is the first time stamp, 0 for an empty log.

    `started_ns` is the clock on the wall when the run was started, 0 where the file doesn't tell.

    `ticks` are those that were asked for: of a capture without those before, which slow signals have.
    """

    path: str
    size_bytes: int
    logger: str
    start_ns: int
    duration_s: float
    ticks: int
    rate_hz: float | None
    frequency_hz: float | None
    lost: int
    warnings: tuple[str, ...]
    elements: tuple[ElementReport, ...]
    failed: int = 0
    events: tuple[LogEvent, ...] = ()
    about: dict[str, str] = {}
    started_ns: int = 0


class SignalStats(msgspec.Struct, frozen=True):
    """One row of `silo stats`, over all samples but NaN; None for strings, and where there are none or it is none.

    `not_finite` counts NaN and `infinite` ones. The smallest and the largest of integers are integers.
    """

    name: str
    unit: str
    samples: int
    not_finite: int
    minimum: float | None
    maximum: float | None
    mean: float | None
    std: float | None
    rms: float | None
    most_common: tuple[str, ...] = ()
    infinite: int = 0


def report(recording: Recording, path: str, size_bytes: int) -> LogReport:
    """Describe a whole log."""
    times = recording.time_ns
    elements = tuple(_describe(recording, element) for element in recording.elements)
    return alike(
        LogReport,
        recording,
        path=path,
        size_bytes=size_bytes,
        start_ns=int(times[0]) if len(times) else 0,
        duration_s=lasted_s(times),
        ticks=len(times) - recording.early,
        rate_hz=rate_of(times, recording.gaps) or None,
        lost=recording.lost,
        warnings=tuple(recording.warnings),
        elements=elements,
        failed=sum(element.failures.count for element in recording.elements),
        events=tuple(events_of(recording, int(times[0]) if len(times) else 0)),
        about=recording.told_about,
    )


def _describe(recording: Recording, element: RecordedElement) -> ElementReport:
    samples = element.count
    times = stamps_of(recording, element)
    zero = int(recording.time_ns[0]) if len(recording.time_ns) else 0
    labels = element.entries[0].entry.labels if element.entries else None
    return alike(
        ElementReport,
        element,
        type=type_text(element),
        buffer=element.buffer_type.name.lower(),
        samples=samples,
        start_s=float(times.min() - zero) / 1e9 if samples else None,
        end_s=float(times.max() - zero) / 1e9 if samples else None,
        rate_hz=rate_of(times, holes(recording, element)) or None,
        labels=labels or {},
    )


def type_text(element: RecordedElement) -> str:
    """Return the types of an element's entries, and its shape: `float64[3]`."""
    types = list(dict.fromkeys("string" if entry.dtype.kind in "SU" else entry.dtype.name for entry in element.entries))
    shape = f"[{','.join(map(str, element.shape))}]" if element.shape else ""
    return ("/".join(types[:3]) + ("/…" if len(types) > 3 else "") or "-") + shape


def statistics(signal: "Samples") -> SignalStats:
    """Return the minimum, maximum, mean ...

    NaN is left out; of strings and enumerations the most common values too.
    """
    from silo.analysis.plots.curves import as_numbers, is_text  # loads expressions, which `silo info` doesn't need

    values, names = as_numbers(signal)
    text = is_text(signal)
    offsets = from_base(signal.values) if signal.values.dtype.kind in "iu" else values
    common: tuple[str, ...] = ()
    if text:
        texts = Counter(printable(text_of(value)) for value in signal.values.tolist())
        common = tuple(f"'{one}' {times}x" for one, times in texts.most_common(3))
    elif names:
        told = Counter(number for number in signal.values.tolist() if number is not None)
        common = tuple(f"{printable(str(names.get(number, number)))} {times}x" for number, times in told.most_common(3))
    numbers = numbers_of(values)
    plain = SignalStats(signal.name, signal.unit, len(values), 0, None, None, None, None, None, common)
    if text or not len(numbers):
        return msgspec.structs.replace(plain, not_finite=0 if text else len(values))
    least, most, mean, std, rms = (None if math.isnan(one) else one for one in moments(numbers, offsets))
    if is_whole(signal.values):
        least, most = ends(signal.values)
    infinite = int(np.isinf(numbers).sum())
    return msgspec.structs.replace(
        plain, not_finite=len(values) - len(numbers) + infinite, minimum=least, maximum=most, mean=mean, std=std,
        rms=rms, infinite=infinite,
    )  # fmt: skip


def is_whole(values: NDArray[Any]) -> bool:
    """Whether all of them are integers."""
    return values.dtype.kind in "iu" and not np.ma.isMaskedArray(values)


def ends(values: NDArray[Any]) -> tuple[float | None, float | None]:
    """Return the smallest and the largest number, be it infinite; of whole ones to the last digit."""
    if is_whole(values):
        return (int(values.min()), int(values.max())) if len(values) else (None, None)
    if values.dtype.kind != "f":
        return None, None
    numbers = numbers_of(values)
    return (float(numbers.min()), float(numbers.max())) if len(numbers) else (None, None)


def numbers_of(values: Floats) -> Floats:
    """Return those that are numbers, be they infinite: no NaN."""
    kept = ~np.isnan(values)
    return values if kept.all() else values[kept]


def moments(numbers: Floats, offsets: NDArray[Any] | None = None) -> tuple[float, float, float, float, float]:
    """Return the minimum, maximum, mean, standard deviation and RMS of one number at least; NaN for what is none.

    As `Signal.max()` and the others have them: of one that is infinite, so are mean and RMS, and the deviation is NaN.
    `offsets` are the same less what they have in common, of which the deviation is taken, where NaN may be, too.
    """
    spread = numbers if offsets is None else numbers_of(offsets)
    with np.errstate(over="ignore", invalid="ignore"):
        return (
            float(numbers.min()), float(numbers.max()), float(numbers.mean()), float(spread.std()),
            float(np.sqrt(np.mean(numbers**2))),
        )  # fmt: skip


def format_report(facts: LogReport, width: int) -> str:
    """Return the report as text: a few lines on the log, a table of its elements, warnings last."""
    at_ns = facts.started_ns or facts.start_ns
    when = datetime.fromtimestamp(at_ns / 1e9, tz=timezone.utc).astimezone() if at_ns > 0 else None
    begun = "started" if facts.started_ns else "first sample"
    rate = f", {facts.rate_hz:.6g} Hz" if facts.rate_hz else ""
    entries = many(len(facts.elements), "element")
    lines = [
        f"{facts.path}  ({size_text(facts.size_bytes)})",
        f"logger {facts.logger}, {begun} {when:%Y-%m-%d %H:%M:%S %z}" if when else f"logger {facts.logger}",
        f"{entries}, {many(facts.ticks, 'tick')}, {facts.duration_s:.6g} s{rate}, lost {count(facts.lost)}"
        + (f", failed {count(facts.failed)}" if facts.failed else ""),
        *(f"{key}: {text}" for key, text in facts.about.items()),
        "",
    ]
    rows = [
        (
            element.name,
            element.unit,
            element.type,
            count(element.samples),
            "" if element.rate_hz is None else f"{element.rate_hz:.5g}",
            "" if element.start_s is None else f"{element.start_s:.4g} … {element.end_s:.4g}",
            element.buffer,
            count(element.lost) if element.lost else "",
            count(element.failures.count) if element.failures.count else "",
        )
        for element in facts.elements
    ]
    head = ("element", "unit", "type", "samples", "Hz", "span s", "buffer", "lost", "failed")
    lines += table(head, rows, width, "lllrrrlrr")
    lines += event_lines(facts.events)
    lines += [f"warning: {text}" for text in facts.warnings]
    return printable_lines("\n".join(lines))


def format_statistics(rows: Sequence[SignalStats], width: int) -> str:
    """Return the statistics as a table."""
    head = ("signal", "unit", "n", "nan", "inf", "min", "max", "mean", "std", "rms")
    cells = []
    for row in rows:
        numbers = (row.minimum, row.maximum, row.mean, row.std, row.rms)
        texts = ["" if number is None else f"{number:.4g}" for number in numbers]
        counts = (row.not_finite - row.infinite, row.infinite)
        cells.append((row.name, row.unit, count(row.samples), *(count(one) if one else "" for one in counts), *texts))
    lines = table(head, cells, width, "llrrrrrrrr")
    lines += [f"{row.name}: {', '.join(row.most_common)}" for row in rows if row.most_common]
    return "\n".join(lines)


def table(head: Sequence[str], rows: Sequence[Sequence[str]], width: int, align: str) -> list[str]:
    """Return lines; the first column gives way when the rest leaves too little room. Empty columns are dropped."""
    rows = [[printable(cell) for cell in row] for row in rows]
    kept = [k for k in range(len(head)) if k == 0 or any(row[k] not in ("", "-") for row in rows)]
    sizes = {k: max(len(head[k]), *(len(row[k]) for row in rows), 0) if rows else len(head[k]) for k in kept}
    rest = sum(sizes[k] + 2 for k in kept[1:])
    sizes[0] = max(12, min(sizes[0], width - rest))
    lines = []
    for row in (head, *rows):
        cells = []
        for k in kept:
            text = row[k] if len(row[k]) <= sizes[k] else "…" + row[k][len(row[k]) - sizes[k] + 1 :]
            cells.append(text.rjust(sizes[k]) if align[k] == "r" else text.ljust(sizes[k]))
        lines.append("  ".join(cells).rstrip())
    return lines

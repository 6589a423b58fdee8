"""One log that was opened from a file: the same parts as a logger's session, filled from a recording.

It has no link, so that nothing of it can be asked of a robot; `time_ns` is the moment whose values are shown.
"""

import asyncio
import contextlib
import os
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path, PurePath

import numpy as np

from silo.analysis import reports
from silo.analysis.log import Log
from silo.analysis.opening import alone_of, open_log
from silo.conditions.requests import TriggerTried
from silo.core.arrays.columns import coarser
from silo.core.conditions import Bounds
from silo.core.elements import ElementInfo, State, Status, Table
from silo.core.quantities.writing import EPOCH_FROM_NS, many, size_text, wall_clock
from silo.core.recording import Recording
from silo.errors import ElementError, FileFormatError, LogWarning
from silo.judging.checks import bind_limits, scalar_names, table_catalogue
from silo_tui.model.drawing.plots import trend_lines
from silo_tui.model.drawing.window import SECOND_NS, PlotWindow
from silo_tui.model.samples.recorded import WHOLE, RecordingSource
from silo_tui.model.samples.turning import turned_true
from silo_tui.model.table.columns import FILE_COLUMNS
from silo_tui.model.table.facts import Facts
from silo_tui.model.table.file_facts import FileFacts
from silo_tui.model.words import text
from silo_tui.model.words.names import cells, fitted_among
from silo_tui.sessions.live import Session

NAME_ROOM = 16  # cells that the name of a file keeps in the head
SLICE_S = 0.05  # of reading, after which another wish is followed


class FileSession(Session):
    """A log on the screen. Its table never changes."""

    source: RecordingSource

    def __init__(self, log: Log) -> None:
        path = Path(log.path)
        super().__init__(path.name, FILE_COLUMNS)
        recording = log.recording
        self.capture = recording.conditions.capture  # where a trigger fired
        names = list(log)[: len(recording.elements)]  # behind them, derived signals that are not in it
        self.source = RecordingSource(recording, names)
        self._facts = FileFacts(recording, names, self.source.places)
        self._parts = 0 if recording.stretch is None or recording.stretch.part else recording.stretch.parts
        size_bytes = path.stat().st_size if path.is_file() and not self._parts else 0
        self.report = reports.report(recording, log.path, size_bytes)
        self.rows_of = dict(zip(names, self.report.elements, strict=True))
        self.warnings: tuple[str, ...] = tuple(recording.warnings)
        if self.source.clock_jumps:
            self.warnings += (f"its clock was set back {self.source.clock_jumps} times",)
        self.time_ns = self.source.end_ns
        self.happened = list(recording.events)
        self.status = Status(
            logger=recording.logger, host="", user="", pid=0, helper_pid=0, state=State.STOPPED, revision=0,
            frequency_hz=recording.frequency_hz or 0.0, measured_hz=0.0, ticks=len(recording.time_ns),
            started_ns=recording.started_ns, last_tick_ns=self.source.end_ns, lost=self.report.lost,
            elements=len(names), enabled=len(names), entries=recording.entry_count, max_time_s=0.0,
            prefix=recording.prefix, folder=str(path.parent), script="",
        )  # fmt: skip
        self.table.load(Table(0, self.source.elements))
        self.table.prefix = recording.prefix.rstrip("/")
        self.bounds = _bounds_of(recording, self.source.elements)
        self.rows.refresh()

    @property
    def connected(self) -> bool:
        """A file is always there."""
        return True

    @property
    def at_s(self) -> float:
        """The moment whose values are shown."""
        return self.seconds

    def facts_words(self, width: int, *, wide: bool) -> list[tuple[int, str, str]]:
        """Return name, duration, ticks, what was lost; the last facts give way where the name would have no room."""
        report, source = self.report, self.source
        seconds = (source.end_ns - source.begin_ns) / 1e9  # as plots count them, while that is no long number
        span = f"{text.short(seconds)} s" if 100 <= seconds < 1000 else text.span(seconds)
        stamps = "ticks" if source.recording.offset else "stamps"  # of a bag of others each topic has its own
        facts = [many(self._parts, "part")] if self._parts else []
        facts += [span, f"{text.count(report.ticks)} {stamps}"]
        derived = len({one.name for one in source.recording.conditions.derived} & self.rows_of.keys())
        if wide:
            facts.append(many(len(report.elements) - derived, "element") + f" +{derived} derived" * bool(derived))
        facts += [f"{text.short(report.rate_hz)} Hz"] if report.rate_hz and source.recording.offset else []
        facts += [size_text(report.size_bytes)] if wide and report.size_bytes else []
        lost, holes = f"  lost {text.count(report.lost)}", len(source.recording.gaps)
        lost += f", {many(holes, 'hole')}" * bool(holes)
        lost += f", overwritten {text.count(over)}" if (over := source.recording.overwritten) else ""
        silo = "silo " if wide else ""  # on a small screen the file's name is worth more
        room = width - len(silo) - 5 - len(lost)
        stem = PurePath(self.name).stem  # with what numbers it at its end
        while facts and room - sum(2 + len(each) for each in facts) < min(cells(stem), NAME_ROOM):
            facts.pop()
        room -= sum(2 + len(each) for each in facts)
        name = fitted_among(self.name if cells(self.name) <= room else stem, (), room)
        return [
            (0, silo, "bold"), (0, "FILE", "reverse"), (0, "  ".join([f" {name}", *facts]), ""),
            (0, lost, "alarm" if report.lost else ""),
        ]  # fmt: skip

    def trouble(self, room: int) -> str:
        """Return what is missing or damaged in the file."""
        words, rest = "; ".join(text.clean(warning) for warning in self.warnings), " … (all: silo info FILE)"
        return words if len(words) <= room else words[: room - len(rest)].rpartition(" ")[0] + rest

    def trends(self, rows: Sequence[int], width: int) -> dict[int, str]:
        """Return all columns that there are, drawn together until they fit."""
        store, drawn = self.columns, list[str]()
        places = {row: at for row in rows if (at := store.row(self.table.drawn_name(row))) is not None}
        if places and not store.empty:
            of, begins = list(places.values()), np.linspace(0, store.count, 2 * width, endpoint=False).astype(np.intp)
            drawn = trend_lines(*coarser(store.low[of], store.high[of], store.marks[of], begins))
        return {**dict.fromkeys(rows, " " * width), **dict(zip(places, drawn, strict=False))}

    @property
    def seconds(self) -> float:
        """The moment whose values are shown, in seconds from the first time stamp."""
        return (self.time_ns - self.source.begin_ns) / 1e9

    @property
    def clock(self) -> str:
        """That moment by the clock on the wall; empty where the logger had a clock of its own."""
        if self.time_ns < EPOCH_FROM_NS:
            return ""
        return wall_clock(self.time_ns, 3, date=True)

    def window_of(self, names: Sequence[str]) -> PlotWindow:
        """Return the window that shows all there is of these elements, up to their end."""
        begin, end = self.source.extent_ns(names)
        spans = self.source.spans_s
        fitting = (end - begin) / SECOND_NS * WHOLE  # a looping buffer has the end of a long run only
        span = fitting if spans[0] < fitting < 0.7 * spans[-1] else spans[-1]
        return PlotWindow(span, end, at_ns=self.time_ns, spans=tuple(sorted({*spans, span})))

    async def turns_true(self, condition: str) -> TriggerTried:
        """Return when a condition turned true in the file. Raises ExpressionError with the place of a mistake."""
        return await turned_true(self.source.recording, condition)

    def read(self, names: Sequence[str]) -> None:
        """Bring the values of these elements at the moment shown."""
        self.live.readings.update(self.source.readings(names, self.time_ns))
        self.live.time_ns = self.time_ns

    def unmeasured(self, details: Sequence[str], quantities: Sequence[str]) -> bool:
        """Return whether something isn't known yet of what filter and order need, or `quantities` of `details`."""
        facts = self.table.facts
        if facts.time_ns != self.time_ns:
            return bool(self._wanted(quantities))
        missing = [name for name in details if not set(quantities) <= set(facts.details.get(name, ()))]
        return bool(missing and quantities) or not self._wanted(quantities) <= set(facts.quantities)

    def _wanted(self, quantities: Sequence[str]) -> set[str]:
        """Return what is needed of all elements; signs only beside other things, so that nothing is read in vain."""
        rows = self.rows
        return rows.wanted() if rows.filter.measured or rows.live or quantities else set()

    async def measure(self, details: Sequence[str], quantities: Sequence[str], tell: Callable[[int], None]) -> None:
        """Reckon what filter and order need of all elements, and `quantities` of elements and entries `details`.

        It is read in a thread, in slices: cancelled, it ends after one of them. `tell` gets how many elements are done.
        """
        at_ns, old = self.time_ns, self.table.facts
        known = dict(old.quantities) if old.time_ns == at_ns else {}
        wanted = sorted(self._wanted(quantities) - known.keys())
        found = {quantity: np.full(len(self._facts), np.nan) for quantity in wanted}
        done = 0
        while wanted and done < len(self._facts):
            done = await asyncio.to_thread(self._facts.survey, wanted, at_ns, found, done, SLICE_S)
            tell(done)
        told = {name: dict(some) for name, some in old.details.items()} if old.time_ns == at_ns else {}
        for name in details if quantities else ():
            if not set(quantities) <= told.setdefault(name, {}).keys():
                told[name].update(await asyncio.to_thread(self._facts.of, name, quantities, at_ns))
        self.table.facts = Facts({**known, **found}, 0, at_ns, told)


def _bounds_of(recording: Recording, elements: Sequence[ElementInfo]) -> dict[str, Bounds]:
    """Return the limits that the file has, by scalar; those of a signal that isn't in it are none."""
    catalogue = table_catalogue(elements, recording.prefix)
    found: dict[str, Bounds] = {}
    for limits in recording.conditions.limits:
        with contextlib.suppress(ElementError):
            _, (signal, *_) = bind_limits(limits, catalogue)
            found.update(dict.fromkeys(scalar_names(signal, catalogue, limits.name), limits.bounds))
    return found


def open_file(which: str | os.PathLike[str] | int) -> FileSession:
    """Open what `silo.open_log` takes: all of a run that was cut, one part of a recording, which may be of days.

    Raises its errors, and `FileFormatError` for a log without data.
    """
    return opened(lambda: open_log(which))


def opened(read: Callable[[], Log]) -> FileSession:
    """Return a log that is read now. Raises as `open_file`."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)  # the banner shows them
        log = read()
        if not len(log.time_ns) or not len(log):
            what = "time stamps" if len(log) else "signals"
            told = f" ({'; '.join(log.warnings)})" if log.warnings else ""
            raise FileFormatError(f"{log.path}: the log is empty, it holds no {what}{told}")
        session = FileSession(log)
        stretch = log.recording.stretch
        if stretch is not None and (alone := alone_of(Path(log.path), log.recording)):
            opens = f"{stretch.text}, alone: :runs opens all of it as one"
            session.warnings += (opens if alone == stretch.alone else alone,)
    return session

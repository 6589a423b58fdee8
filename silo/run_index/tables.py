"""Runs as tables: what is known of them from the index, and what they measured from their logs, when it is asked for.

| Table | A row is |
|---|---|
| `runs` | a run |
| `signals` | a scalar of a run, in a few numbers |
| `episode_signals` | a scalar of an episode, likewise |
| `events` | something that happened in a run |
| `episodes` | a stretch of a run that the program, or somebody, marked |
| `parameters`, `about` | a parameter as it was at the end of a run; a fact that the program told |
| `samples` | a value of a scalar |
| `wide` | a tick of a run, with a column for each scalar that any run has |

`run` is a run's path below the folder, in each of them; signals are called without the prefix of their logger, so that
one name means the same of every robot. NaN is NULL, as SQL takes it for larger than all numbers. Signals that are
dates and durations are seconds, dates since 1970.
"""

import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

import msgspec

from silo.analysis.compute.exports import log_to_polars
from silo.analysis.log import Log
from silo.core.names import grouped
from silo.core.recording import Recording
from silo.errors import LogWarning
from silo.files.optional_packages import need
from silo.run_index.facts import SignalFacts, events_of
from silo.run_index.index import RunIndex
from silo.run_index.listed import KnownFiles, ListedRun, episodes_of

EXTRA = "query"
_OF_SIGNAL = {
    "signal": "text", "element": "text", "unit": "text", "kind": "text", "samples": "whole",
    "min": "number", "max": "number", "mean": "number", "std": "number", "rms": "number", "last": "number",
}  # fmt: skip
COLUMNS: dict[str, dict[str, str]] = {
    "runs": {
        "run": "text", "name": "text", "kind": "text", "robot": "text", "task": "text", "begun": "time",
        "span_s": "number", "ticks": "whole", "elements": "whole", "frequency_hz": "number", "why": "text",
        "marks": "whole", "limits": "whole", "triggers": "whole", "lost": "whole", "failed": "whole",
        "warnings": "whole", "size_bytes": "whole", "tags": "texts", "notes": "texts", "problem": "text",
    },
    "signals": {"run": "text", **_OF_SIGNAL},
    "events": {
        "run": "text", "t": "number", "tick": "whole", "time": "time", "kind": "text", "text": "text", "who": "text",
    },
    "episodes": {
        "run": "text", "number": "whole", "name": "text", "t": "number", "span_s": "number", "ticks": "whole",
        "verdict": "text", "success": "truth", "why": "text", "whole": "truth", "about": "text",
    },
    "episode_signals": {"run": "text", "number": "whole", **_OF_SIGNAL},
    "parameters": {"run": "text", "name": "text", "value": "number", "text": "text"},
    "about": {"run": "text", "name": "text", "text": "text"},
    "samples": {
        "run": "text", "signal": "text", "t": "number", "time": "time", "value": "number", "text": "text",
    },
    "wide": {"run": "text", "t": "number", "time": "time"},
}  # fmt: skip
T, TIME = "##t", "##time"  # columns that no signal is called like
_SECONDS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "d": 86400.0}  # in one of each; a date without a time is days
_NUMBER = re.compile(r"\d+")
HIVE = ("robot", "date", "run")  # of an archive, by its folders: other readers have a column of each
FACTS = tuple(name for name in COLUMNS if name not in ("samples", "wide"))  # those that no log is read for


class Drawer(Protocol):
    """Where runs are, as tables."""

    def frame(self, table: str) -> Any:
        """Return one of `FACTS` as a polars frame."""

    def read(self, run: str, signals: Sequence[str]) -> Any:
        """Return signals of a run as a polars frame: `T`, `TIME`, a column for each; null where there is no sample.

        Of an enumeration `#NAME` are its numbers, NAME its words.
        """


def typed(columns: Mapping[str, str]) -> dict[str, Any]:
    """Return a schema for polars. Raises SiloError without it."""
    polars = need("polars", EXTRA, "Tables of runs")
    types = {
        "text": polars.String, "number": polars.Float64, "whole": polars.Int64, "texts": polars.List(polars.String),
        "time": polars.Datetime("ns", "UTC"), "truth": polars.Boolean,
    }  # fmt: skip
    return {name: types[kind] for name, kind in columns.items()}


class Folders:
    """The runs of a list."""

    def __init__(self, runs: Sequence[ListedRun], indexes: Sequence[RunIndex | KnownFiles]) -> None:
        """Name each by its path below its folder; where there are several folders, by its whole path."""
        folders = {run.folder for run in runs}
        self.runs = {run.facts.path if len(folders) == 1 else str(run.path): run for run in runs}
        self.indexes = indexes

    def frame(self, table: str) -> Any:
        """Return one of `FACTS`."""
        polars = need("polars", EXTRA, "Tables of runs")
        rows = {
            "runs": self._facts, "signals": self._signals, "events": self._events, "parameters": self._parameters,
            "about": self._about, "episodes": self._episodes, "episode_signals": self._episode_signals,
        }[table]()  # fmt: skip
        return polars.DataFrame(rows, schema=typed(COLUMNS[table]), orient="row")

    def read(self, run: str, signals: Sequence[str]) -> Any:
        """Return signals of a run. Raises SiloError for a log that can't be read."""
        return read_signals(self.runs[run].read(), signals)

    def _signals(self) -> list[tuple[Any, ...]]:
        every = {index.root: index.signals() for index in self.indexes}
        return [
            (name, *_signal(run, one))
            for name, run in self.runs.items()
            for one in run.signals_in(every[run.folder], {})
        ]

    def _episode_signals(self) -> list[tuple[Any, ...]]:
        every = {index.root: (index.signals(), index.signals_of_episodes()) for index in self.indexes}
        return [
            (name, episode.episode.number, *_signal(run, one))
            for name, run in self.runs.items()
            for episode in episodes_of(run)
            for one in episode.signals_in(*every[run.folder])
        ]

    def _events(self) -> list[tuple[Any, ...]]:
        every = {index.root: index.events() for index in self.indexes}
        return [
            (name, one.at_s, one.tick, one.time_ns, one.kind, one.text, one.who)
            for name, run in self.runs.items()
            for one in events_of(run.files or (run.facts,), every[run.folder])
        ]

    def _facts(self) -> list[tuple[Any, ...]]:
        rows = []
        for name, run in self.runs.items():
            facts = run.facts
            rows.append((
                name, run.name, facts.kind, facts.robot, facts.task, facts.begun_ns, facts.span_s, facts.ticks,
                facts.elements, facts.rate_hz, facts.why, facts.marks, facts.limits, facts.triggers, facts.lost,
                facts.failed, facts.warnings, facts.size_bytes, list(run.tags), list(run.notes), facts.problem,
            ))  # fmt: skip
        return rows

    def _episodes(self) -> list[tuple[Any, ...]]:
        return [
            (name, one.number, one.name, one.start_s, one.stop_s - one.start_s, one.last - one.first + 1, one.verdict,
             one.success, one.why, one.whole, msgspec.json.encode(dict(one.about)).decode())
            for name, run in self.runs.items()
            for one in run.facts.episodes
        ]  # fmt: skip

    def _parameters(self) -> list[tuple[Any, ...]]:
        every = {index.root: index.signals() for index in self.indexes}
        rows: list[tuple[Any, ...]] = []
        for name, run in self.runs.items():
            of_elements = grouped((one.element, one.name) for one in run.signals_in(every[run.folder], {}))
            for key, value in run.facts.parameters.items():
                items = value if isinstance(value, tuple | list) else (value,)
                # as the scalars of its element are called, in their order
                names = sorted(of_elements.get(key, ()), key=lambda one: [int(at) for at in _NUMBER.findall(one)])
                if len(names) != len(items):
                    names = [f"{key}_{place}" for place in range(len(items))] if len(items) > 1 else [key]
                for scalar, item in zip(names, items, strict=True):
                    number, text = (None, item) if isinstance(item, str) else (float(item), None)
                    rows.append((name, short(run.facts.prefix, scalar), number, text))
        return rows

    def _about(self) -> list[tuple[str, str, str]]:
        return [(name, *fact) for name, run in self.runs.items() for fact in run.facts.about.items()]


def _signal(run: ListedRun, one: SignalFacts) -> tuple[Any, ...]:
    prefix = run.facts.prefix
    return (short(prefix, one.name), short(prefix, one.element), one.unit, one.kind, one.count, one.least, one.most,
            one.mean, one.std, one.rms, one.last)  # fmt: skip


def short(prefix: str, name: str) -> str:
    """Return a name without the prefix of its logger."""
    return name.removeprefix(f"{prefix.rstrip('/')}/")


def read_signals(recording: Recording, signals: Sequence[str]) -> Any:
    """Return signals of a log, by their names without its prefix, as `Drawer.read` does. Raises SiloError."""
    polars = need("polars", EXTRA, "Tables of runs")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LogWarning)  # how many there are stands in `runs`
        log = Log(recording)
        found = {name: log[_whole(log, name.removeprefix("#"))] for name in signals}
        axis = log.time_ns  # whichever signals are asked for: else how many rows there are would depend on them
        frames = [
            log_to_polars({"_": replace(one, name="_", labels={} if name.startswith("#") else one.labels)}, axis)
            for name, one in found.items()
        ]
        begin_ns = int(axis[0]) if len(axis) else 0
        time = polars.Series(axis).cast(typed(COLUMNS["wide"])["time"])
        made = polars.DataFrame({T: (axis - begin_ns) * 1e-9, TIME: time})
    return made.hstack([_plain(polars, "_", frame).alias(name) for name, frame in zip(found, frames, strict=True)])


def _whole(log: Log, name: str) -> str:
    whole = f"{log.recording.prefix.rstrip('/')}/{name}"
    return whole if whole in log else name


def _plain(polars: Any, name: str, frame: Any) -> Any:
    """A column of numbers or of texts; one of neither, as of complex numbers, is all null."""
    if name not in frame.columns:
        return polars.Series(name, [None] * len(frame), dtype=polars.Float64)
    column = frame[name]
    if column.dtype in (polars.String, polars.Categorical) or isinstance(column.dtype, polars.Enum):
        return column.cast(polars.String)
    if column.dtype.is_temporal():  # as the facts of a signal have them
        return column.to_physical().cast(polars.Float64) * _SECONDS[getattr(column.dtype, "time_unit", "d")]
    if column.dtype == polars.Boolean or column.dtype.is_numeric():
        return column.to_physical().cast(polars.Float64).fill_nan(None)
    return polars.Series(name, [None] * len(frame), dtype=polars.Float64)

"""`silo.runs("logs")`: the runs of folders as a list that can be narrowed, tagged and opened."""

import functools
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from silo.analysis.compute.arithmetic import warn_outside
from silo.core.arguments import path as checked_path
from silo.core.arguments import shown
from silo.core.calls import told, told_names
from silo.core.quantities.writing import and_more, many, size_text
from silo.errors import ElementError
from silo.files.naming import counted_by, in_order, run_of
from silo.run_index import labels
from silo.run_index.facts import SignalFacts
from silo.run_index.index import RunIndex, Told
from silo.run_index.listed import EPOCH, ListedEpisode, ListedRun, episodes_of, listed
from silo.run_index.where import Query, SeveralSignalsError, is_true, said_by

if TYPE_CHECKING:
    from silo.analysis.compare import Comparison
    from silo.run_index.apart import Apart

When = str | float | datetime | None


_OTHER_NAMES = {
    **dict.fromkeys(("latest", "newest", "last"), "it is runs[-1]"),
    **dict.fromkeys(("filter", "query", "select"), "it is runs.where('max(joints/tau_3) > 30'), or runs.sql(...)"),
    **dict.fromkeys(("names", "paths", "files"), "[run.name for run in runs] are the names, .path their files"),
}


@told_names("a list of runs", _OTHER_NAMES)
class RunList(Sequence[ListedRun]):
    """Runs, oldest first. What narrows it returns another one; nothing is read but the index."""

    def __init__(self, runs: Sequence[ListedRun], indexes: Sequence[RunIndex]) -> None:
        """Keep runs, and the indexes that they are from; `silo.runs` makes them."""
        self._runs, self.indexes = list(runs), indexes

    def __len__(self) -> int:
        return len(self._runs)

    @overload
    def __getitem__(self, key: int) -> ListedRun: ...
    @overload
    def __getitem__(self, key: slice) -> "RunList": ...
    def __getitem__(self, key: int | slice) -> "ListedRun | RunList":
        return self._kept(range(len(self))[key]) if isinstance(key, slice) else self._runs[key]

    def __iter__(self) -> Iterator[ListedRun]:
        return iter(self._runs)

    def __repr__(self) -> str:
        return f"<{many(len(self), 'run')}, {size_text(self.size_bytes)}>"

    @property
    def size_bytes(self) -> int:
        """Bytes of their logs; that of several episodes counts once."""
        return sum({run.path: run.facts.size_bytes for run in self._runs}.values())

    def where(self, condition: str) -> "RunList":
        """Return those for which a condition holds: `max(joints/tau_3) > 30 and lost == 0`.

        Args:
            condition: over `min max mean std rms last count` of signals, facts (`span lost limits triggers marks ...`),
                tags and parameters. A run that lacks what is asked for is left out; one in which a name means several
                signals, too, with a `LogWarning`.

        Returns:
            The runs.

        Raises:
            ExpressionError: it can't be understood; the message has the place.
        """
        return self._kept([place for place, value in enumerate(self.values(condition)) if is_true(value)])

    def values(self, expression: str) -> list[float]:
        """Return a number for each run: `runs.values("max(joints/tau_3)")`; NaN where a run lacks it.

        Args:
            expression: as `where` takes it.

        Returns:
            As many numbers as there are runs.

        Raises:
            ExpressionError: it can't be understood.
        """
        known: dict[str, list[str]] = {}
        for index in self.indexes:
            for element, scalars in index.elements().items():
                known[element] = list(dict.fromkeys([*known.get(element, ()), *scalars]))
        parameters = [run.facts.parameters for run in self]
        said = said_by([index.words() for index in self.indexes], parameters)
        tags = {word for run in self for word in run.tags}
        condition = Query(expression, known, {name for some in parameters for name in some}, tags, said)
        found: list[float] = []
        unclear: dict[str, SeveralSignalsError] = {}  # by run, what means several signals there
        for run, of_run in zip(self, self.signals(condition.signals), strict=True):
            try:
                found.append(condition.number(run.facts, run.tags, of_run))
            except SeveralSignalsError as error:  # noqa: PERF203
                found.append(math.nan)
                unclear[run.facts.path] = error
        if unclear:
            first = next(iter(unclear.values()))
            if all(map(math.isnan, found)):
                raise first  # nowhere does it mean one
            warn_outside(f"not known of {and_more(list(unclear), 3)}: there {first.reason}")
        return found

    def find(self, *words: str) -> "RunList":
        """Return those that have all of some words in name, robot, task, reason, tags, notes or what else is told.

        Args:
            *words: in any case.
        """
        asked = [word.lower() for word in words]
        return self._kept([place for place, run in enumerate(self) if all(word in _text(run) for word in asked)])

    def between(self, since: When = None, until: When = None) -> "RunList":
        """Return those that began in a stretch of time.

        Args:
            since: a date or time (`"2026-11-22 14:00"`), a `datetime`, or seconds since 1970; None: from the first on.
            until: likewise, not included; of a date alone the day is included.

        Returns:
            The runs.

        Raises:
            ElementError: it is no time.
        """
        low, high = _ns("since", since, -(2**63), late=False), _ns("until", until, 2**63, late=True)
        return self._kept([place for place, run in enumerate(self) if low <= run.facts.begun_ns < high])

    def episodes(self) -> "RunList":
        """Return the episodes of these runs, as runs: `runs.episodes().where("success and speed > 0.3")`.

        Their names are tasks. Conditions know what was said at their beginning, `success` (no where nobody said so),
        `good`, `bad` and `redo`; signals, limits, triggers and marks are those of the episode, `lost`, parameters and
        tags those of its run. Captures have episodes of their
        runs again, and are left out. `episode` is what is known of each, `open()` gives its part of the log.
        """
        return RunList([one for run in self if run.facts.kind == "run" for one in episodes_of(run)], self.indexes)

    def apart(self, others: "RunList") -> "list[Apart]":
        """Return what tells these from others: each signal by the statistic that differs most, from the index alone.

        `episodes.where("bad").apart(episodes.where("good"))` says what differs in the bad ones.

        Args:
            others: runs, or episodes, of the same folders or of others; those that are among these don't count.

        Returns:
            Of each signal, and of facts such as `span` and `limits`, what differs, the farthest apart first.

        Raises:
            ElementError: there are none of the one or of the other.
        """
        from silo.run_index.apart import what_tells

        mine = {run.key for run in self}
        rest = others._kept([place for place, run in enumerate(others) if run.key not in mine])
        if not len(self) or not len(rest):
            raise ElementError(f"{many(len(self), 'run')} can't be told from {len(rest)}: there must be one of each")
        return what_tells(*([*zip(some, some.signals(), strict=True)] for some in (self, rest)))

    def compare(self, pattern: str = "*", **options: Any) -> "list[tuple[ListedRun, Comparison]]":
        """Compare all other runs with the first one, as `silo.compare` does.

        Args:
            pattern: which elements.
            **options: those of `silo.compare`: `event`, `signal`, `tolerance`, `by`, `episode`.

        Returns:
            Each with what differs, the most different run first.

        Raises:
            ElementError: there is one run at most; or as `silo.compare`.
        """
        from silo.analysis.compare import compare

        if len(self) < 2:
            raise ElementError(f"{many(len(self), 'run')} can't be compared: there must be two or more")
        first = self[0].open()
        found = [(run, compare(first, run.open(), pattern, **options)) for run in self[1:]]
        return sorted(found, key=lambda pair: pair[1].weight, reverse=True)

    def to_pandas(self) -> Any:
        """Return a table with a row per run. Needs pandas."""
        from silo.files.optional_packages import need

        rows = [told_of(run) for run in self]
        return need("pandas", "analysis", "tables of runs").DataFrame(rows)

    def sql(self, statement: str) -> Any:
        """Answer an SQL statement over these runs, by DuckDB. Needs `pip install "silo-logger[query]"`.

        Tables are `runs`, `signals` (a scalar of a run in numbers), `episodes`, `episode_signals`, `events`,
        `parameters`, `about`; `samples` (a value of a scalar a row: run, signal, t, time, value, text) and `wide` (a
        tick a row, a column for each scalar), of which only what is asked for is read. Files, network and extensions
        are out of its reach.

        Args:
            statement: `"select run, max(abs(\"joints/tau_3\")) from wide group by run order by 2 desc"`.

        Returns:
            A polars DataFrame; `.to_pandas()`, `.to_numpy()` and `.write_parquet(...)` are its.

        Raises:
            ElementError: the statement is wrong, or asks for more than fits into memory.
            SiloError: a log can't be read, or DuckDB is missing.
        """
        from silo.run_index.sql import query
        from silo.run_index.tables import Folders

        return query(Folders(self, self.indexes), statement)

    def signals(self, names: Sequence[str] | None = None) -> list[Sequence[SignalFacts]]:
        """Return the facts of scalars, by their whole names, of each of these; of all scalars without names."""
        runs: dict[Path, Mapping[str, list[SignalFacts]]] = {}
        episodes: dict[Path, dict[tuple[str, int], list[SignalFacts]]] = {}
        for index in self.indexes:
            mine = [run for run in self if run.folder == index.root]
            if any(isinstance(run, ListedEpisode) for run in mine):
                episodes[index.root] = index.signals_of_episodes(names)
            if not all(isinstance(run, ListedEpisode) and not run.files for run in mine):
                runs[index.root] = index.signals(names)
        return [run.signals_in(runs.get(run.folder, {}), episodes.get(run.folder, {})) for run in self]

    def by_file(self) -> "RunList":
        """Return the same with each of several files of a run as one by itself."""
        every = [one for run in self for one in run.by_file()]
        return RunList(every, self.indexes)

    def _kept(self, places: Sequence[int]) -> "RunList":
        return RunList([self._runs[place] for place in places], self.indexes)


@told("silo.runs")
def runs(
    *folders: str | os.PathLike[str],
    where: str = "",
    since: When = None,
    until: When = None,
    told: Told = lambda done, total: None,
    rebuild: bool = False,
) -> RunList:
    """Return the runs in folders and below: recordings and captures, oldest first.

    What is known of them stands in an index beside them (`.silo-runs.sqlite`), brought up to date here: a log that is
    new or changed is read once.

    Args:
        *folders: where to look; the current one if none is given.
        where: a condition, as `RunList.where` takes it.
        since: as `RunList.between` takes it.
        until: likewise.
        told: called with how many of how many new logs were read.
        rebuild: make the index anew from the logs.

    Returns:
        The runs.

    Raises:
        SiloError: there is no such folder, or it can't be read.
        ExpressionError: `where` can't be understood.
    """
    indexes = [RunIndex(checked_path("a folder", folder)) for folder in folders or (".",)]
    every: list[ListedRun] = []
    said = functools.cache(labels.read_labels)
    for index in indexes:
        index.refresh(told, anew=rebuild)
        every += listed(index.root, index.runs(), said, index.of_run)
    every = in_order(
        every,
        lambda run: counted_by(run.path),
        lambda run: run_of(run.path),
        lambda run: (run.facts.begun_ns, run.facts.path),
    )
    found = RunList(every, indexes).between(since, until)
    return found.where(where) if where else found


def told_of(run: ListedRun) -> dict[str, Any]:
    """Return a run as a row of plain values, as `silo runs --json` prints it."""
    import msgspec

    facts: dict[str, Any] = msgspec.to_builtins(run.facts)
    whole = {one: getattr(run.facts, one) for one in ("kind", "robot", "task", "span_s", "ticks", "elements", "lost")}
    own = ("path", "offset", "names")  # what the files of a run are told apart by
    return {"path": str(run.path), **{key: value for key, value in facts.items() if key not in own}, **whole,
            "begun": run.begun.isoformat(), "tags": list(run.tags), "notes": list(run.notes)}  # fmt: skip


def _text(run: ListedRun) -> str:
    facts = run.facts
    said = (facts.path, facts.kind, facts.robot, facts.task, facts.why, *run.tags, *run.notes, *facts.about.values())
    return "\n".join(said).lower()


def _ns(argument: str, when: When, none: int, *, late: bool) -> int:
    if when is None:
        return none
    if isinstance(when, int | float) and not isinstance(when, bool):
        return round(when * 1e9)
    days = 1 if late and isinstance(when, str) and len(when.strip()) == len("2026-11-22") else 0
    try:
        found = datetime.fromisoformat(when.strip()) if isinstance(when, str) else when
    except ValueError:
        found = None
    if not isinstance(found, datetime):
        raise ElementError(f"{argument} must be a date or time, got {shown(when)}; write '2026-11-22 14:00'")
    return (found.astimezone(timezone.utc) + timedelta(days) - EPOCH) // timedelta(microseconds=1) * 1000

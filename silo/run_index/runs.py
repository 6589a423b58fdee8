"""`silo.runs("logs")`: the runs of folders as a list that can be narrowed, tagged and opened."""

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta, timezone
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from silo.analysis.opening import open_log
from silo.core.arguments import path as checked_path
from silo.core.arguments import shown
from silo.core.calls import told
from silo.core.quantities.writing import many, size_text
from silo.errors import ElementError
from silo.run_index import labels
from silo.run_index.facts import RunFacts, SignalFacts
from silo.run_index.index import RunIndex, Told
from silo.run_index.where import Query

if TYPE_CHECKING:
    from silo.analysis.log import Log

When = str | float | datetime | None
EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)


@dataclass(frozen=True, eq=False, repr=False)
class ListedRun:
    """One run of a list: its facts, what people say of it, and the way to its log."""

    facts: RunFacts
    folder: Path
    _labels: dict[str, labels.Labels] = field(default_factory=dict)
    _signals: Callable[[], list[SignalFacts]] = list

    @property
    def path(self) -> Path:
        """The file or bag folder."""
        return self.folder / self.facts.path

    @property
    def name(self) -> str:
        """Its file name without ending."""
        return self.path.stem

    @property
    def begun(self) -> datetime:
        """When it began, by the wall clock, in local time."""
        return (EPOCH + timedelta(microseconds=self.facts.begun_ns // 1000)).astimezone()

    @property
    def tags(self) -> tuple[str, ...]:
        """Its tags, in the order in which they were given."""
        return self._said.tags

    @property
    def notes(self) -> tuple[str, ...]:
        """What was noted, oldest first."""
        return self._said.notes

    @property
    def signals(self) -> list[SignalFacts]:
        """Each scalar in a few numbers, from the index."""
        return self._signals()

    def open(self) -> "Log":
        """Open the log. Raises as `silo.open_log`."""
        return open_log(self.path)

    def tag(self, *tags: str) -> None:
        """Give it tags. Raises ElementError for one that is no word, SaveError."""
        labels.tag(self.path.parent, self.name, tags)
        self._reread()

    def untag(self, *tags: str) -> None:
        """Take tags from it. Raises as `tag`."""
        labels.tag(self.path.parent, self.name, (), tags)
        self._reread()

    def note(self, text: str) -> None:
        """Say something of it. Raises ElementError, SaveError."""
        labels.note(self.path.parent, self.name, text)
        self._reread()

    def undo(self) -> str:
        """Take the last tag or note back, and return what it was. Raises ElementError where there is none."""
        gone = labels.undo(self.path.parent, self.name)
        self._reread()
        return gone

    def __repr__(self) -> str:
        said = f" [{', '.join(self.tags)}]" if self.tags else ""
        when = f"{self.begun:%Y-%m-%d %H:%M:%S}, {self.facts.span_s:.6g} s"
        return f"<Run {self.facts.path}: {self.facts.robot}, {when}{said}>"

    @property
    def _said(self) -> labels.Labels:
        return self._labels.get(self.name, labels.Labels())

    def _reread(self) -> None:
        self._labels.clear()
        self._labels.update(labels.read_labels(self.path.parent))


class RunList(Sequence[ListedRun]):
    """Runs, oldest first. What narrows it returns another one; nothing is read but the index."""

    def __init__(self, runs: Sequence[ListedRun], indexes: Sequence[RunIndex]) -> None:
        """Keep runs, and the indexes that they are from; `silo.runs` makes them."""
        self._runs, self._indexes = list(runs), indexes

    def __len__(self) -> int:
        return len(self._runs)

    @overload
    def __getitem__(self, key: int) -> ListedRun: ...
    @overload
    def __getitem__(self, key: slice) -> "RunList": ...
    def __getitem__(self, key: int | slice) -> "ListedRun | RunList":
        if isinstance(key, slice):
            return self._kept(range(len(self))[key])
        return self._runs[key]

    def __iter__(self) -> Iterator[ListedRun]:
        return iter(self._runs)

    def __repr__(self) -> str:
        total = sum(run.facts.size_bytes for run in self._runs)
        return f"<{many(len(self), 'run')}, {size_text(total)}>"

    def where(self, condition: str) -> "RunList":
        """Return those for which a condition holds: `max(joints/tau_3) > 30 and lost == 0`.

        Args:
            condition: over `min max mean std rms last count` of signals, facts (`span lost limits triggers marks ...`),
                tags and parameters. A run that lacks what is asked for is left out.

        Returns:
            The runs.

        Raises:
            ExpressionError: it can't be understood; the message has the place.
        """
        found = self._judged(condition, lambda one: one.holds)
        return self._kept([place for place, value in enumerate(found) if value])

    def values(self, expression: str) -> list[float]:
        """Return a number for each run: `runs.values("max(joints/tau_3)")`; NaN where a run lacks it.

        Args:
            expression: as `where` takes it.

        Returns:
            As many numbers as there are runs.

        Raises:
            ExpressionError: it can't be understood.
        """
        return [float(value) for value in self._judged(expression, lambda one: one.number)]

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

    def to_pandas(self) -> Any:
        """Return a table with a row per run. Needs pandas."""
        from silo.files.extras import need

        rows = [told_of(run) for run in self]
        return need("pandas", "analysis", "tables of runs").DataFrame(rows)

    def _judged(self, text: str, how: Callable[[Query], Callable[..., float]]) -> list[float]:
        known: dict[str, list[str]] = {}
        for index in self._indexes:
            for element, scalars in index.elements().items():
                known[element] = list(dict.fromkeys([*known.get(element, ()), *scalars]))
        words = {word for run in self for word in (*run.tags, *run.facts.parameters)}
        condition = Query(text, known, words)
        signals = {index.root: index.signals(condition.signals) for index in self._indexes}
        judge = how(condition)
        return [judge(run.facts, run.tags, signals[run.folder].get(run.facts.path, ())) for run in self]

    def _kept(self, places: Sequence[int]) -> "RunList":
        return RunList([self._runs[place] for place in places], self._indexes)


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
    said: dict[Path, dict[str, labels.Labels]] = {}
    for index in indexes:
        index.refresh(told, anew=rebuild)
        for facts in index.runs():
            folder = (index.root / facts.path).parent
            if folder not in said:
                said[folder] = labels.read_labels(folder)
            every.append(ListedRun(facts, index.root, said[folder], partial(index.of_run, facts.path)))
    every.sort(key=lambda run: (run.facts.begun_ns, run.facts.path))
    found = RunList(every, indexes).between(since, until)
    return found.where(where) if where else found


def told_of(run: ListedRun) -> dict[str, Any]:
    """Return a run as a row of plain values, as `silo runs --json` prints it."""
    import msgspec

    facts: dict[str, Any] = msgspec.to_builtins(run.facts)
    whole = {one: getattr(run.facts, one) for one in ("kind", "robot", "task", "span_s", "ticks", "elements", "lost")}
    return {"path": str(run.path), **{key: value for key, value in facts.items() if key != "path"}, **whole,
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

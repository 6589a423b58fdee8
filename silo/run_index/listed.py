"""One run of a list: its facts, what people say of it, the way to its log."""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from silo.analysis.opening import open_log
from silo.core.episodes.words import Episode
from silo.core.quantities.writing import and_more, many
from silo.core.recording import Recording
from silo.core.structs import alike
from silo.errors import LogWarning
from silo.files.added import added_formats
from silo.files.formats import read_recording
from silo.run_index import labels
from silo.run_index.facts import EventFacts, Piece, RunFacts, SignalFacts, by_run, merged, signals_of

if TYPE_CHECKING:
    from silo.analysis.log import Log

EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)

OfRun = Callable[[str, int | None], list[SignalFacts]]


@dataclass(frozen=True, eq=False, repr=False)
class ListedRun:
    """One run of a list: its facts, what people say of it, and the way to its log."""

    facts: RunFacts
    folder: Path
    _labels: dict[str, labels.Labels] = field(default_factory=dict)
    _of: OfRun = lambda path, episode: []
    files: tuple[RunFacts, ...] = ()  # all that it is of, where that is several, in their order
    pieces: tuple[tuple[Piece, ...], ...] = ()  # where each of its episodes stands then
    others: Mapping[str, dict[str, labels.Labels]] = field(default_factory=dict)  # more files of it, with their labels

    @property
    def paths(self) -> list[str]:
        """The paths of its files, relative to the folder of the index."""
        return [one.path for one in self.files] or [self.facts.path]

    @property
    def stands(self) -> Sequence[Piece]:
        """Where all of it stands: pieces of its files."""
        return [(path, None) for path in self.paths]

    def signals_in(
        self, runs: Mapping[str, Sequence[SignalFacts]], episodes: Mapping[tuple[str, int], Sequence[SignalFacts]]
    ) -> list[SignalFacts]:
        """The facts of its scalars among those of all files, and of all episodes in them."""
        return signals_of(
            [runs.get(path, ()) if number is None else episodes.get((path, number), ()) for path, number in self.stands]
        )

    def has(self, path: Path) -> bool:
        """Whether a file is of it, though another one may be listed."""
        return path.absolute() in [(self.folder / one).absolute() for one in (*self.paths, *self.others)]

    def by_file(self) -> "list[ListedRun]":
        """Return each of its files as a run by itself."""
        return [replace(self, facts=one, files=(), pieces=(), others={}) for one in self.files] or [self]

    @property
    def path(self) -> Path:
        """The file or bag folder."""
        return self.folder / self.facts.path

    @property
    def key(self) -> tuple[Path, int]:
        """What tells it from all others: its path, and the number of the episode, -1 for a whole run."""
        return self.path, -1

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
        return signals_of([self._of(*piece) for piece in self.stands])

    @property
    def said(self) -> str:
        """What lists say of it in a line: why it can't be read, what it is, its tags, its newest note, its files."""
        facts = self.facts
        if facts.problem:
            return f"can't be read: {facts.problem}"
        folders = {path.rpartition("/")[0] for path in self.others} - {facts.path.rpartition("/")[0]}
        beside = [path.rpartition("/")[2] for path in self.others]
        where = f" in {and_more(sorted(filter(None, folders)), 2)}" if any(folders) else f": {and_more(beside, 2)}"
        others = f"{many(len(self.others), 'more file')}{where}" if self.others else ""
        parts = many(len(self.files), "part") if self.files else ""
        more = ", ".join(filter(None, ["cut off" if facts.cut_off else "", parts, others]))
        tags = [f"#{tag}" for tag in self.tags]
        return " ".join(filter(None, ["capture" if facts.kind == "capture" else "", *tags, *self.notes[-1:], more]))

    def open(self) -> "Log":
        """Open the log. Raises as `silo.open_log`."""
        if self.files:
            return open_log([self.folder / path for path in self.paths])
        return open_log(self.path, alone=True)

    def read(self) -> Recording:
        """Read its files as one recording. Raises SiloError."""
        if not self.files:
            return read_recording(self.path, added_formats)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", LogWarning)  # they stand in it
            return self.open().recording

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
        own = dict.fromkeys(self.paths, self._labels)
        said = [known.get(Path(path).stem, labels.Labels()) for path, known in {**own, **self.others}.items()]
        if len(said) == 1:
            return said[0]
        tags = dict.fromkeys(tag for one in said for tag in one.tags)
        return labels.Labels(tuple(tags), tuple(note for one in said for note in one.notes))

    def _reread(self) -> None:
        self._labels.clear()
        self._labels.update(labels.read_labels(self.path.parent))


@dataclass(frozen=True, eq=False, repr=False)
class ListedEpisode(ListedRun):
    """One episode of a run, as a run of its own; what it lost, its parameters and labels are those of its run."""

    episode: Episode = field(default_factory=lambda: Episode("", 0, 0))

    @property
    def key(self) -> tuple[Path, int]:
        """Its run's path, and its number there."""
        return self.path, self.episode.number

    @property
    def said(self) -> str:
        """How it went, before what is said of its run, and of how many signals nothing is left of it."""
        one, lacks = self.episode, self.facts.in_episodes[0].overwritten if self.facts.in_episodes else 0
        less = f"({many(lacks, 'signal')} overwritten)" if lacks else ""
        how = one.verdict or ("" if one.whole else "unfinished")
        return " ".join(filter(None, [how, one.why, super().said, less]))

    @property
    def stands(self) -> Sequence[Piece]:
        """Where it stands: pieces of its run's files."""
        number = self.episode.number
        return self.pieces[number] if self.pieces else [(self.facts.path, number)]

    def open(self) -> "Log":
        """Open its part of the log. Raises as `silo.open_log`, and ElementError where the log lacks it by now."""
        log = super().open()
        one = next((one for one in log.episodes if self.files and one.number == self.episode.number), self.episode)
        return log.clip(one)

    def __repr__(self) -> str:
        one = self.episode
        return (
            f"<Episode {one.number} of {self.facts.path}: {one.name}, {self.facts.span_s:.6g} s, success {one.success}>"
        )


def episodes_of(run: ListedRun) -> list[ListedEpisode]:
    """Return the episodes of a run. Conditions know what was said of them: `success`, `good`, `bad`, `redo`, facts."""
    return [
        alike(
            ListedEpisode,
            run,
            facts=msgspec.structs.replace(
                run.facts,
                kind="episode",
                task=one.name,
                begun_ns=run.facts.begun_ns + round(one.start_s * 1e9),
                span_s=one.stop_s - one.start_s,
                ticks=one.last - one.first + 1,
                about={**run.facts.about, **{key: str(value) for key, value in one.about.items()}},
                parameters={**run.facts.parameters, **one.facts},
                episodes=(one,),
                in_episodes=(happened,),
                marks=happened.marks,
                limits=happened.limits,
                triggers=happened.triggers,
            ),
            episode=one,
        )
        for one, happened in zip(run.facts.episodes, run.facts.in_episodes, strict=True)
    ]


def listed(
    root: Path,
    files: Sequence[RunFacts],
    said: Callable[[Path], dict[str, labels.Labels]],
    of_run: OfRun = ListedRun._of,
) -> Iterator[ListedRun]:
    """The runs that files below a folder are of; `said` gives what people say of the logs in a folder."""
    for some, more in by_run(files, lambda path: frozenset(one.element for one in of_run(path, None))):
        facts, pieces = merged(some) if len(some) > 1 else (some[0], ())
        its, *others = (said((root / path).parent) for path in (facts.path, *more))
        yield ListedRun(facts, root, its, of_run, some[1:] and some, pieces, dict(zip(more, others, strict=True)))


class ArchivedFacts(msgspec.Struct, frozen=True):
    """What is known of a file: the path in `run` is its name in the archive; `episodes` are the scalars of each."""

    run: RunFacts
    signals: tuple[SignalFacts, ...]
    episodes: tuple[tuple[SignalFacts, ...], ...]
    events: tuple[EventFacts, ...]
    labels: labels.Labels


class KnownFiles:
    """Facts of files, as an index has them."""

    root = Path()

    def __init__(self, files: Sequence[ArchivedFacts]) -> None:
        self._files = files

    def signals(self) -> dict[str, list[SignalFacts]]:
        """Return the facts of scalars by file."""
        return {one.run.path: list(one.signals) for one in self._files}

    def signals_of_episodes(self) -> dict[tuple[str, int], list[SignalFacts]]:
        """Return the facts of scalars by file, and the number of the episode in it."""
        return {(one.run.path, at): list(some) for one in self._files for at, some in enumerate(one.episodes)}

    def events(self) -> dict[str, list[EventFacts]]:
        """Return what happened by file."""
        return {one.run.path: list(one.events) for one in self._files}

    def runs(self) -> list[ListedRun]:
        """Return the runs that they are of."""
        said = {Path(one.run.path).stem: one.labels for one in self._files}
        signals = self.signals()
        return list(listed(self.root, [one.run for one in self._files], lambda _: said, lambda path, _: signals[path]))

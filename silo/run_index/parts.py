"""Runs of several files in an archive, as those of a run that was cut, or of a recording.

Each file is archived by itself: more are added to a run that goes on, and old ones are deleted where it was logged.
What is known of each is kept beside it, so that all of them are one run in the tables, whichever are still there.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec

from silo.run_index.facts import EventFacts, RunFacts, SignalFacts, by_run, merged
from silo.run_index.labels import Labels
from silo.run_index.listed import ListedRun
from silo.run_index.tables import Known


class FileFacts(msgspec.Struct, frozen=True):
    """What is known of a file: the path in `run` is its name in the archive; `episodes` are the scalars of each."""

    run: RunFacts
    signals: tuple[SignalFacts, ...]
    episodes: tuple[tuple[SignalFacts, ...], ...]
    events: tuple[EventFacts, ...]
    labels: Labels


class Parts(msgspec.Struct, frozen=True):
    """Names in the archive: the files of a run, in their order, and other ones of which these have more."""

    files: tuple[str, ...]
    others: tuple[str, ...] = ()


class KnownFiles:
    """Facts of files, as an index has them."""

    root = Path()

    def __init__(self, files: Sequence[FileFacts]) -> None:
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
        found = []
        for files, more in by_run([one.run for one in self._files]):
            facts, pieces = merged(files) if len(files) > 1 else (files[0], ())
            others = dict.fromkeys(more, said)
            found.append(ListedRun(facts, self.root, said, files=files[1:] and files, pieces=pieces, others=others))
        return found


def chain_of(facts: RunFacts) -> str:
    """What files of one run have in common; empty for one that is a run by itself."""
    return f"{facts.robot}/{facts.run}/{facts.recorder}" if facts.run and (facts.part or facts.recorder) else ""


def known_files(runs: Mapping[str, ListedRun], indexes: Sequence[Known]) -> dict[str, FileFacts]:
    """Return what indexes know of files, by their names in an archive."""
    if not runs:
        return {}
    signals = {index.root: index.signals() for index in indexes}
    episodes = {index.root: index.signals_of_episodes() for index in indexes}
    events = {index.root: index.events() for index in indexes}
    return {
        name: FileFacts(
            msgspec.structs.replace(run.facts, path=name),
            tuple(signals[run.folder].get(run.facts.path, ())),
            tuple(tuple(episodes[run.folder].get((run.facts.path, at), ())) for at in range(len(run.facts.episodes))),
            tuple(events[run.folder].get(run.facts.path, ())),
            Labels(run.tags, run.notes),
        )
        for name, run in runs.items()
    }

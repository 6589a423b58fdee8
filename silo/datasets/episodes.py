"""What an episode of a data set is: a run, a capture, or each stretch that a program marked in one."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from silo.analysis.log import Log
from silo.core.elements import BufferType, Entry, join_name
from silo.core.episodes.words import REDO, Episode
from silo.core.recording import RecordedElement, RecordedEntry
from silo.errors import ElementError
from silo.files.naming import is_capture

Pieces = Literal["runs", "episodes", "captures"]


class EpisodeLog(NamedTuple):
    """An episode: its name, of which run it is, its part of the log, the same with what was `known` when it began, and
    its marks.
    """

    name: str
    source: str
    log: Log
    known: Log
    marked: Episode | None

    @property
    def span_ns(self) -> tuple[int, int] | None:
        """Where one that the program marked begins and ends."""
        stamps = self.log.time_ns
        return None if self.marked is None else (int(stamps.min()), int(stamps.max()))


def pieces_of(log: Log, source: str, pieces: Pieces) -> list[EpisodeLog]:
    """Return the episodes of a log. Raises ElementError where it has none."""
    if pieces not in get_args(Pieces):
        raise ElementError(f"episodes must be one of {', '.join(get_args(Pieces))}, got {pieces!r}")
    if pieces == "captures" and not is_capture(Path(os.path.basename(source))):  # noqa: PTH119
        raise ElementError("it is no capture")
    if pieces != "episodes":
        return [EpisodeLog(source, source, log, log, None)]
    found = [one for one in log.episodes if one.verdict != REDO]
    if not found:
        raise ElementError("no episode is marked in it that isn't to be done again")
    return [
        EpisodeLog(f"{source}#{one.number}", source, log.clip(one), log._of_episode(one, known=True), one)
        for one in found
    ]


class SeenMoments:
    """Which ticks of which runs are in a data set: a run and what triggers captured of it have the same."""

    def __init__(self) -> None:
        self._seen: dict[tuple[str, int], list[tuple[int, int, str]]] = {}

    def again(self, episode: str, log: Log) -> str:
        """Note an episode; return what it shares with one before, in words; empty where nothing."""
        recording = log.recording
        run = recording.likely_run
        if not run or not len(recording.time_ns):
            return ""
        first, last = recording.offset - len(recording.time_ns) + recording.early, recording.offset - 1
        seen = self._seen.setdefault((run, recording.stretch.part if recording.stretch is not None else 0), [])
        shared = next(
            (
                (max(first, begin), min(last, end), other)
                for begin, end, other in seen
                if first <= end and begin <= last
            ),
            None,
        )
        seen.append((first, last, episode))
        if shared is None:
            return ""
        return f"ticks {shared[0]} to {shared[1]} of its run are in {shared[2]}, too: the same moments count twice"


def with_facts(log: Log, episode: Episode) -> Log:
    """Return the log with what was said of the episode as signals, in place of its own of the same names."""
    recording = log.recording
    facts = {
        join_name(recording.prefix, "", key): one for key, one in episode.facts.items() if not isinstance(one, str)
    }
    own = [one for one in recording.elements if one.name not in facts]
    made = [_constant(name, value, len(recording.time_ns)) for name, value in facts.items()]
    return Log(replace(recording, elements=(*own, *made)), log.path, log.start_ns)


def task_of(log: Log, marked: Episode | None) -> str:
    """Return what was done in an episode as its program said: of it, by its name, or of the run; empty if nowhere."""
    said = {} if marked is None else {"task": marked.name, **marked.about}
    return str(said.get("task") or log.recording.about.get("task", ""))


def facts_of(episode: Episode) -> dict[str, Any]:
    """Return what a data set tells of an episode; the same columns for each."""
    return {"silo/episode": episode.number, "silo/verdict": episode.verdict, "silo/whole": episode.whole}


def _constant(name: str, value: float, ticks: int) -> RecordedElement:
    values = np.broadcast_to(np.asarray(value), ticks)
    entry = RecordedEntry(name, Entry("", values.dtype.str), values)
    return RecordedElement(name, "", "scalar", (), 1, BufferType.LOOPING, 0, (entry,))

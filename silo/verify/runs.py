"""All that is known of a run of a log folder, and of the parts of its recordings."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from silo.core.arrays.spans import Span, merged
from silo.core.elements import DAMAGED, LoggedEvent
from silo.core.recording import Recording
from silo.files.manifest import number_of
from silo.files.parts.scan import PartScan
from silo.rpc.published import EventKind

# what tells of a loss, once "0 lost" and paths are taken out
_LOSS = re.compile(
    r"lost|missing|not recorded|left out|could not|couldn't|gone|overwritten|deleted|blind|not saved|"
    r"not written|nothing of this run|stays in memory|in no file"
)
_NO_LOSS = re.compile(r"\b0 (samples )?lost\b|(?<!\S)/\S+")
_TELL_LOSS = frozenset(
    kind.value
    for kind in (EventKind.LOST, EventKind.RECORDING, EventKind.RECORDING_FAILED, EventKind.BLIND, EventKind.CRASHED,
                 EventKind.RECOVERED, EventKind.SAVE_FAILED, EventKind.DELETED, EventKind.FILES_DELETED)
)  # fmt: skip


@dataclass
class ScannedPart:
    """A part of an endless recording; `rows` of each ring are stretches of (first, one after the last)."""

    path: Path
    scan: PartScan

    @property
    def recorder(self) -> str:
        """The name of its recording; empty where it doesn't tell."""
        return self.scan.facts.recorder if self.scan.facts is not None else ""

    @property
    def number(self) -> int:
        """Which part of the recording it is, by its name."""
        return number_of(self.path)

    def ticks(self) -> list[Span]:
        """The ticks of which any ring has a row."""
        dividers = {ring.ring: ring.divider for ring in self.scan.facts.value_rings} if self.scan.facts else {}
        return merged(
            (first * dividers[ring], (end - 1) * dividers[ring])
            for ring, stretches in self.scan.rows.items()
            for first, end in stretches
            if ring in dividers
        )

    def covered(self) -> list[Span]:
        """The same, each row up to the next one: what comes seldom stands for all ticks between."""
        most = max((ring.divider for ring in self.scan.facts.value_rings), default=1) if self.scan.facts else 1
        return merged((first, last + most - 1) for first, last in self.ticks())


@dataclass
class KnownRun:
    """All that is known of a run."""

    logger: str
    run: str
    started_ns: int = 0
    ticks: int = 0
    events: list[LoggedEvent] = field(default_factory=list)
    parts: list[ScannedPart] = field(default_factory=list)
    saved: list[tuple[Path, Span, str]] = field(default_factory=list)  # and why
    captured: list[tuple[Path, Recording]] = field(default_factory=list)
    memory: list[Span] = field(default_factory=list)  # of which any ring has a row
    held: list[Span] = field(default_factory=list)  # of which any value has its row
    # by looping element, what saves and memory have of it, from its first sample there on
    newest: dict[str, list[Span]] = field(default_factory=dict)
    dividers: dict[str, int] = field(default_factory=dict)  # of these elements, the largest that there was
    slack: int = 1  # ticks by which buffers differ that are rounded up to whole samples
    trimmed: dict[str, tuple[list[Span], bool]] = field(default_factory=dict)  # by recorder, what its list says it had
    ended: bool = False  # nobody logs in it any more
    lacks: dict[str, int] = field(default_factory=dict)  # by recording, samples that are in no part
    # by stretch and element, as saved logs and memory count them
    lost: dict[tuple[int, str], int] = field(default_factory=dict)
    paused: list[Span] = field(default_factory=list)  # what came while somebody had stopped a recording
    away: list[str] = field(default_factory=list)  # saves to other folders, where they can't be read, with their events

    @property
    def started(self) -> int:
        """The number of the event that tells of its start, 0 where none does."""
        return next((event.number for event in self.events if event.kind == EventKind.STARTED.value), 0)

    def hold(self, name: str, first: int, last: int, divider: int) -> None:
        """Note what a looping buffer has."""
        self.newest.setdefault(name, []).append((first, last))
        self.dividers[name] = max(self.dividers.get(name, 1), divider)
        self.slack = max(self.slack, divider)

    def lose(self, part: int, name: str, samples: int) -> None:
        """Note what an element lost in a stretch; who is saved later, or is saved twice, counts the same again."""
        if samples:
            self.lost[part, name] = max(samples, self.lost.get((part, name), 0))

    def told(self, words: Sequence[str] = ()) -> str:
        """Who told of a loss in this run: the first event that does, with one of these words where there are any."""
        for event in self.events:
            text = _NO_LOSS.sub("", event.text)
            if event.kind == DAMAGED or (
                event.kind in _TELL_LOSS and _LOSS.search(text) and (not words or any(word in text for word in words))
            ):
                return f"event {event.number}: {event.text}"
        return ""

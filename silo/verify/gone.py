"""What was written to a log folder, as its event log and its list of captures tell, and is gone."""

import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

from silo.core.elements import LoggedEvent
from silo.core.quantities.writing import and_more
from silo.files.manifest import CaptureEntry
from silo.rpc.published import EventKind
from silo.verify.verdicts import MOST_SHOWN, Verdict

_WRITTEN = re.compile(r"(?:^saved |: |, )(/.+?) \(\d[\d.]* [kMGT]?B\)")
_BEFORE = "the last run was saved before it is cleared: "


def saves_that_lack(
    folder: Path, there: frozenset[str], logger: str, events: Sequence[LoggedEvent]
) -> Iterator[Verdict]:
    """The saves of which no format is there, by the event log; with who told to have deleted them."""
    deleted = [event for event in events if event.kind == EventKind.DELETED.value]
    for event, written, _ in saves(folder, events):
        gone = [path.name for path in written]
        if gone and there.isdisjoint(gone):
            names = and_more(gone, MOST_SHOWN)
            by = (f"event {one.number}: {one.text}" for one in deleted if {*gone} & {*re.split("[ ,]+", one.text)})
            text = f"{names} was saved (event {event.number}), and is gone"
            yield Verdict("missing", text, logger, told=next(by, ""))


def saves(folder: Path, events: Sequence[LoggedEvent]) -> list[tuple[LoggedEvent, list[Path], list[Path]]]:
    """The saves that an event log tells of, each with its files in this folder, and with those in others."""
    saved = [
        (event, list(map(Path, _files(event.text))))
        for event in events
        if event.kind in (EventKind.SAVED.value, EventKind.RECOVERED.value)
    ]
    # what this folder was called, where it was moved or copied; saved may be to others, too
    here = {path.parent for _, files in saved for path in files if (folder / path.name).exists()}
    own = [[path for path in files if path.parent in here or path.parent.resolve() == folder.resolve()]
           for _, files in saved]  # fmt: skip
    return [
        (event, mine, [path for path in files if path not in mine])
        for (event, files), mine in zip(saved, own, strict=True)
    ]


def _files(text: str) -> list[str]:
    return text.removeprefix(_BEFORE).split(", ") if text.startswith(_BEFORE) else _WRITTEN.findall(text)


def captures_that_lack(
    there: frozenset[str], logger: str, captures: Sequence[CaptureEntry], keeps: Mapping[tuple[str, str], int]
) -> Iterator[Verdict]:
    """The captures that were written and are gone, but for those that made room for newer ones of their trigger.

    `keeps` tells by logger and trigger how many stay, 0 for all; that may have been another number before.
    """
    newer: Counter[str] = Counter()
    for entry in reversed(captures):
        if not entry.files:
            continue
        keep = keeps.get((logger, entry.trigger), 1)
        is_kept = not entry.let_go and (not keep or newer[entry.trigger] < keep)
        if is_kept and not there & {one.name for one in entry.files}:
            names = and_more([one.name for one in entry.files], MOST_SHOWN)
            text = f"{names} is gone: it was capture {entry.number} of '{entry.trigger}' in run {entry.run}"
            yield Verdict("missing", text, logger, entry.run)
        newer[entry.trigger] += 1


def parts_that_lack(stretches: Mapping[tuple[str, str], Collection[int]]) -> Iterator[Verdict]:
    """The stretches between others of a run that was cut, by logger and run, of which no event log tells."""
    for (logger, run), parts in stretches.items():
        if lacks := sorted({*range(1, max(parts))}.difference(parts)):
            text = f"run {run} was cut, and lacks part {and_more([str(one) for one in lacks], MOST_SHOWN)}"
            yield Verdict("missing", text, logger, run)

"""What a program that died left, read whole and saved to files."""

import os
from collections.abc import Callable, Sequence

from silo.collecting.damage import damage
from silo.collecting.holdings import Holdings, recording_holdings
from silo.collecting.journal_reader import JournalReader
from silo.collecting.segment_reader import SegmentReader
from silo.model import Extras, FileType, LoggedEvent, SavedFile

DIED = "program died"  # why its log was saved
RECOVERED = "program died, recovered later"


def save_reader(
    reader: SegmentReader | JournalReader,
    folder: str | os.PathLike[str],
    types: Sequence[FileType] = (FileType.SILO,),
    progress: Callable[[float], None] | None = None,
    why: str = DIED,
    events: Sequence[LoggedEvent] | None = None,
    extras: Extras | None = None,
) -> tuple[list[SavedFile], Holdings]:
    """Save all that is held, and tell how much that is; no file if it is nothing. Raises SaveError.

    `events` are what happened in its run; None: what the event log in the logger's folder says. `extras` are its
    derived signals, limits and triggers as they were last; None: as they were when the run began.
    """
    from silo.files import LogOfRun, write_run

    recording = reader.snapshot()
    held = recording_holdings(recording)
    if not held.samples:
        return [], held
    schema = reader.schema
    happened = LogOfRun(schema.folder, schema.run) if events is None else events
    files = write_run(
        recording, folder, schema.logger, types, progress=progress, why=why, events=happened, extras=extras,
        damage=missing(reader),
    )  # fmt: skip
    return files, held


def missing(reader: SegmentReader | JournalReader) -> tuple[str, ...]:
    """What is damaged, or lost, in what a dead process left; fit to show."""
    return damage(reader) if isinstance(reader, SegmentReader) else (reader.proven_text,)

"""What a program that died left, read whole and saved to files."""

import dataclasses
import logging
import os
from collections.abc import Callable, Sequence

from silo.collecting.damage import damage
from silo.collecting.holdings import Holdings, recording_holdings
from silo.collecting.journal_reader import JournalReader
from silo.collecting.segment_reader import SegmentReader
from silo.files.event_log import read_events
from silo.model import Extras, FileType, LoggedEvent, SavedFile
from silo.recording import with_events

DIED = "program died"  # why its log was saved
RECOVERED = "program died, recovered later"

log = logging.getLogger("silo")


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
    from silo.files import write

    recording = reader.snapshot()
    held = recording_holdings(recording)
    if not held.samples:
        return [], held
    recording = dataclasses.replace(recording, warnings=(*missing(reader), *recording.warnings))
    recording = with_events(recording, _logged(reader) if events is None else events)
    if extras is not None:
        recording = dataclasses.replace(recording, extras=extras)
    return write(recording, folder, reader.schema.logger, types, progress=progress, why=why), held


def _logged(reader: SegmentReader | JournalReader) -> list[LoggedEvent]:
    schema = reader.schema
    try:
        return read_events(schema.folder, schema.logger, schema.run) if schema.run else []
    except OSError as error:
        log.warning("%s: the event log can't be read (%s): the file has the marks alone", schema.folder, error.strerror)
        return []


def missing(reader: SegmentReader | JournalReader) -> tuple[str, ...]:
    """What is damaged, or lost, in what a dead process left; fit to show."""
    return damage(reader) if isinstance(reader, SegmentReader) else (reader.proven_text,)

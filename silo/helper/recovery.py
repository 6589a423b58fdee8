"""Saving what a robot process left behind: by its helper when it dies, by `silo recover` when both died."""

import dataclasses
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from silo.collecting.damage import damage
from silo.collecting.holdings import Holdings, recording_holdings
from silo.collecting.left_behind import claimed, find_stale, has_unsaved, mark_saved
from silo.collecting.segment_reader import SegmentReader
from silo.errors import StateError
from silo.model import FileType, SavedFile

__all__ = ["Recovered", "find_stale", "recover", "save_reader"]


@dataclass(frozen=True)
class Recovered:
    """What became of a segment: the files, what they hold, and `text`, fit to show."""

    files: list[SavedFile]
    holdings: Holdings
    text: str


def recover(
    path: str | os.PathLike[str],
    folder: str | os.PathLike[str] | None = None,
    types: Sequence[FileType] = (FileType.SILO,),
) -> Recovered:
    """Save a segment whose writer is gone, in `folder` or its logger's own, then delete it.

    Waits while another process saves it. Raises SegmentError for what isn't a segment, or is damaged,
    SavedMeanwhileError if another process saved it, StateError while its own process lives, SaveError if it can't be
    saved (the segment stays).
    """
    path = Path(path)
    reader = SegmentReader(path)
    try:
        if reader.alive():
            raise StateError(f"{path}: process {reader.schema.pid} is still logging into it; nothing was changed")
        with claimed(reader, wait=True):
            if reader.ticks and not has_unsaved(reader):
                held = Holdings(reader.ticks, 0, 0, 0.0)
                text = f"all its {reader.ticks} ticks were saved before its process ended; its memory was freed"
                path.unlink(missing_ok=True)
                return Recovered([], held, text)
            files, held = save_reader(reader, folder or reader.schema.folder, types)
            mark_saved(reader)
            path.unlink(missing_ok=True)
            nothing = f"held {held.text}" if held.ticks else "held no tick"
            text = "; ".join([f"saved {held.text}", *damage(reader)]) if files else f"{nothing}; its memory was freed"
            return Recovered(files, held, text)
    finally:
        reader.close()


def save_reader(
    reader: SegmentReader,
    folder: str | os.PathLike[str],
    types: Sequence[FileType] = (FileType.SILO,),
    progress: Callable[[float], None] | None = None,
) -> tuple[list[SavedFile], Holdings]:
    """Save all that a segment holds, and tell how much that is; no file if it is nothing. Raises SaveError."""
    from silo.files import write

    recording = reader.snapshot()
    held = recording_holdings(recording)
    if not held.samples:
        return [], held
    recording = dataclasses.replace(recording, warnings=(*damage(reader), *recording.warnings))
    return write(recording, folder, reader.schema.logger, types, progress=progress), held

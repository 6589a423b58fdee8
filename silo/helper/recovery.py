"""Saving what a robot process left behind: by its helper when it dies, by `silo recover` when both died.

Of a run whose segment is still in memory that is saved, else (after a power cut) what its journal proves.
"""

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from silo.collecting.damage import damage
from silo.collecting.holdings import Holdings
from silo.collecting.journal import JOURNAL_SUFFIX
from silo.collecting.journal_reader import JournalReader
from silo.collecting.left_behind import StaleSegment, claimed, discard, find_stale, has_unsaved, mark_saved
from silo.collecting.left_journals import claimed_journal, find_stale_journals, is_journal, remove_proven
from silo.collecting.segment_reader import SegmentReader
from silo.errors import StateError
from silo.helper.left_log import RECOVERED, save_reader
from silo.model import FileType, SavedFile

if TYPE_CHECKING:
    # 1.4 MB that a helper without triggers doesn't need
    from silo.helper.capture_recovery import RecoveredCaptures

__all__ = ["Recovered", "find_all", "find_stale", "recover"]


def find_all(folders: Iterable[Path]) -> list[StaleSegment]:
    """What processes left that ended without saving: segments, and journals in `folders` whose segments are gone.

    Segments are looked for in the runtime folder too.
    """
    places = list(dict.fromkeys(folder.resolve() for folder in folders))
    segments = [one for folder in places for one in find_stale(folder)]
    journals = [one for folder in places for one in find_stale_journals(folder)]
    return list({one.path: one for one in [*segments, *journals]}.values())


@dataclass(frozen=True)
class Recovered:
    """What became of a segment or journal: the files, what they hold, and `text`, fit to show."""

    files: list[SavedFile]
    holdings: Holdings
    text: str


def recover(
    path: str | os.PathLike[str],
    folder: str | os.PathLike[str] | None = None,
    types: Sequence[FileType] = (FileType.SILO,),
) -> Recovered:
    """Save a segment or a journal whose writer is gone, in `folder` or its logger's own, then delete it.

    Waits while another process saves it. Raises SegmentError for what isn't one, or is damaged,
    SavedMeanwhileError if another process saved it, StateError while its own process lives, SaveError if it can't be
    saved (it stays).
    """
    from silo.helper.capture_recovery import recover_captures

    path = Path(path)
    if is_journal(path) or path.suffix == JOURNAL_SUFFIX:
        return _recover_journal(path, folder, types)
    reader = SegmentReader(path)
    try:
        if reader.alive():
            raise StateError(f"{path}: process {reader.schema.pid} is still logging into it; nothing was changed")
        with claimed(reader, wait=True):
            captures = recover_captures(reader, str(folder or reader.schema.folder))
            if reader.ticks and not has_unsaved(reader):
                discard(reader)
                return _saved_before(reader, "memory was freed", captures)
            files, held = save_reader(
                reader, folder or reader.schema.folder, types, why=RECOVERED, extras=captures.extras
            )
            mark_saved(reader)
            discard(reader)
            nothing = f"held {held.text}" if held.ticks else "held no tick"
            saved = [f"saved {held.text}", *damage(reader)] if files else [f"{nothing}; its memory was freed"]
            return Recovered([*files, *captures.files], held, "; ".join([*saved, *captures.texts]))
    finally:
        reader.close()


def _recover_journal(path: Path, folder: str | os.PathLike[str] | None, types: Sequence[FileType]) -> Recovered:
    with claimed_journal(path, wait=True) as reader:
        if reader.ticks and reader.saved_ticks >= reader.ticks:
            remove_proven(reader)
            return _saved_before(reader, "journal was removed")
        files, held = save_reader(reader, folder or path.parent, types, why=RECOVERED)
        remove_proven(reader)
        nothing = f"held {held.text}" if held.ticks else "proves no tick"
        return Recovered(files, held, f"saved {held.text}; {reader.proven_text}" if files else f"{nothing}; removed")


def _saved_before(
    reader: SegmentReader | JournalReader, freed: str, captures: "RecoveredCaptures | None" = None
) -> Recovered:
    texts = [f"all its {reader.ticks} ticks were saved before its process ended; its {freed}"]
    files = captures.files if captures else []
    texts += captures.texts if captures else []
    return Recovered(files, Holdings(reader.ticks, 0, 0, 0.0), "; ".join(texts))

"""Saving what a robot process left behind: by its helper when it dies, by `silo recover` when both died."""

import fcntl
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from silo.collecting.schema import SegmentSchema
from silo.collecting.segment_reader import SegmentReader
from silo.errors import SegmentError, StateError
from silo.model import FileType, SavedFile
from silo.runtime import list_segments


@dataclass(frozen=True)
class StaleSegment:
    """A segment without its writer. `schema` is None for a file that can't be read; `reason` says what it is."""

    path: Path
    schema: SegmentSchema | None
    ticks: int
    reason: str


def find_stale(folder: Path | None = None) -> list[StaleSegment]:
    """Return segments of processes that ended without saving: in the runtime folder, and in `folder`
    (`storage="file"`).
    """
    return [stale for path in list_segments(folder) if (stale := _look(path)) is not None]


def _look(path: Path) -> StaleSegment | None:
    try:
        reader = SegmentReader(path)
    except SegmentError as error:
        return StaleSegment(path, None, 0, str(error)) if path.exists() else None
    try:
        if reader.alive():
            return None
        unsaved = reader.ticks - reader.saved_ticks
        schema = reader.schema
        reason = f"process {schema.pid} of user {schema.user} ended without close(); {unsaved} ticks are in no file"
        return StaleSegment(path, schema, reader.ticks, reason)
    finally:
        reader.close()


def recover(
    path: str | os.PathLike[str],
    folder: str | os.PathLike[str] | None = None,
    types: Sequence[FileType] = (FileType.SILO,),
) -> list[SavedFile]:
    """Save a segment whose writer is gone, in `folder` or its logger's own, then delete it; [] if it holds nothing.

    Raises SegmentError for what isn't a segment, StateError while its process lives or somebody saves it, SaveError if
    it can't be saved (the segment stays).
    """
    path = Path(path)
    reader = SegmentReader(path)
    try:
        if reader.alive():
            raise StateError(f"{path}: process {reader.schema.pid} is still logging into it; nothing was changed")
        with claimed(path):
            files = save_reader(reader, folder or reader.schema.folder, types)
            path.unlink()
            return files
    finally:
        reader.close()


@contextmanager
def claimed(path: Path) -> Iterator[None]:
    """Hold a segment for one who saves it. Raises StateError while another does."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise StateError(f"{path}: another process is saving it right now") from None
        yield
    finally:
        os.close(descriptor)


def save_reader(
    reader: SegmentReader,
    folder: str | os.PathLike[str],
    types: Sequence[FileType] = (FileType.SILO,),
    progress: Callable[[float], None] | None = None,
) -> list[SavedFile]:
    """Save all that a segment holds; [] if that is nothing. Raises SaveError."""
    from silo.files import write

    recording = reader.snapshot()
    if not recording.elements:
        return []
    return write(recording, folder, reader.schema.logger, types, progress=progress)

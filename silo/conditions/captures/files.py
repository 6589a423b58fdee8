"""Writing one capture to its files: by the helper process that cut it, or by who recovers what it left."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import msgspec

from silo.conditions.captures.buffer import CaptureBuffer
from silo.core.elements import FileType, LoggedEvent, SavedFile
from silo.errors import SaveError
from silo.files.atomic import check_room, claimed
from silo.files.formats import kind_of
from silo.files.manifest import CaptureEntry, CaptureList
from silo.files.saving import size_of

PATIENCE_S = 60.0  # how long is waited for another process that writes the same capture


@dataclass(frozen=True)
class WrittenCapture:
    """A capture that was written: its files, and in words what it is; `removed` are older ones that went for it."""

    files: list[SavedFile]
    text: str
    removed: list[str]


def write_capture(
    buffer: CaptureBuffer,
    folder: str,
    listed: CaptureList,
    happened: Sequence[LoggedEvent],
    *,
    leaves_room: bool = False,
) -> WrittenCapture:
    """Write a capture, under the name that one who was killed had begun it with; note it in the list.

    One process at a time writes it: the writing process of a helper that was killed goes on, and a helper that gives
    way writes what its successor knows of too. Who comes second finds it written. `happened` are events of its run.
    `leaves_room`: to others of the disk, as there may be captures without end. Raises OSError, SaveError.
    """
    from silo.files.naming import next_run_number

    capture, logger = buffer.capture, buffer.schema.logger
    Path(folder).mkdir(parents=True, exist_ok=True)

    def name() -> str:
        begun = f"{logger}_{datetime.now():%Y%m%d_%H-%M-%S}_{next_run_number(folder, logger):05d}"
        return f"{begun}_{buffer.trigger}_{capture.number}"

    what = f"capture {capture.number} of '{buffer.trigger}' in run {buffer.run}"
    with claimed(folder, what, PATIENCE_S) as claim:
        entry = listed.begun(buffer.run, buffer.trigger, capture.number, name)
        if entry.files:  # its trigger may not keep it any more
            files, removed = _there(folder, entry), []
        else:
            if leaves_room:
                check_room(Path(folder), buffer.size_bytes)
            files = _written(buffer, folder, entry.name, happened, claim)
            removed = listed.written(entry, [file.path for file in files], buffer.options.keep)
    ended = buffer.why and f" ({buffer.why})"
    paths = ", ".join(file.path for file in files)
    text = f"capture {capture.number} of '{buffer.trigger}', ticks {capture.first} to {capture.last}{ended}: {paths}"
    return WrittenCapture(files, text, removed)


def _there(folder: str, entry: CaptureEntry) -> list[SavedFile]:
    """What is still there of a capture that was written."""
    paths = [path for path in (Path(folder, file.name) for file in entry.files) if path.exists()]
    return [SavedFile(str(path), kind, size_of(path)) for path in paths if (kind := kind_of(path)) is not None]


def _written(
    buffer: CaptureBuffer, folder: str, name: str, happened: Sequence[LoggedEvent], claim: int
) -> list[SavedFile]:
    """The files of a capture; those that a predecessor wrote already are left as they are."""
    from silo.files import write_run
    from silo.files.formats import SAVED
    from silo.files.naming import custom_path
    from silo.recordings.writing import WriteOrder, write_apart

    wanted: list[FileType] = list(dict.fromkeys((FileType.SILO, *buffer.options.save)))
    paths = {kind: custom_path(folder, name, SAVED[kind].ending) for kind in wanted}
    files = [SavedFile(str(path), kind, size_of(path)) for kind, path in paths.items() if path.exists()]
    there = {file.type for file in files}
    if there.issuperset(buffer.options.save):
        return [file for file in files if file.type in buffer.options.save]
    options, logger = buffer.options, buffer.schema.logger
    if FileType.SILO not in there:
        recording = buffer.recording(happened)
        # derived signals and limits by which it fired, whatever they are by now
        conditions = msgspec.structs.replace(buffer.conditions, capture=recording.conditions.capture)
        why = f"trigger {options.name}"
        files += write_run(recording, folder, logger, name=name, why=why, events=(), conditions=conditions)
    others: list[FileType] = [kind for kind in wanted if kind is not FileType.SILO and kind not in there]
    if others:
        # what CSV and bags need would leave this process with twice its memory
        order = WriteOrder(folder, logger, others, name, log=str(paths[FileType.SILO]))
        report = write_apart(None, order, lambda _: None, [claim])
        files += report.files
        if report.error:
            raise SaveError(f"{report.error}; saved: {', '.join(file.path for file in files)}")
    if FileType.SILO not in options.save:
        paths[FileType.SILO].unlink(missing_ok=True)
    return sorted((file for file in files if file.type in options.save), key=lambda file: wanted.index(file.type))

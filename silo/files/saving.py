"""One save: a recording in every format that was asked for, under one run number.

The logger and the helper process call `write`; it knows neither of them. Formats are imported when they are written,
so that saving `.silo` costs no import of what bags need.
"""

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from silo.core.conditions import Conditions
from silo.core.elements import FileType, LoggedEvent, SavedFile
from silo.core.recording import Progress, Recording, told_unknown, with_events
from silo.errors import SaveError, reason
from silo.files.event_log import with_happened
from silo.files.formats import SAVED, file_types, savable
from silo.files.naming import custom_path, log_path, next_run_number, with_part


class PartlySavedError(SaveError):
    """Some formats could not be written; `saved` lists those that were."""

    def __init__(self, message: str, saved: Sequence[SavedFile]) -> None:
        super().__init__(message)
        self.saved = tuple(saved)


class LogOfRun(NamedTuple):
    """Where stands what happened in a run: the folder of its logger's event log, and the run's id."""

    folder: str | os.PathLike[str]
    run: str


def write(
    recording: Recording,
    folder: str | os.PathLike[str],
    logger: str,
    types: Iterable[FileType | str],
    name: str | None = None,
    progress: Progress | None = None,
    why: str = "",
) -> list[SavedFile]:
    """Save a recording in each of the `types` (`"silo"`, `"csv"`, `"bag"`), in a folder that is made if missing.

    Files are called `<logger>_<date>_<time>_<run number>`, or `name`, which must not be taken yet. If a format fails,
    the others are written all the same, and a `PartlySavedError` (a `SaveError`) says what failed and what was saved.
    `progress` is called with the fraction of the whole, from 0 to 1. `why` it is saved, in a few words, is kept in the
    files for those who look through them.
    """
    chosen = file_types(types)
    if not chosen:
        raise SaveError(f"no file type to save: choose from {savable()}")
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SaveError(
            f"can't make the folder '{folder}': {reason(error)}; choose another one; the log is still in memory"
        ) from error
    paths = _paths(Path(folder), logger, chosen, name, recording.stretch.part if recording.stretch else 0)
    recording = replace(recording, why=why) if why else recording
    if recording.conditions.derived:
        from silo.expressions.derived_samples import with_derived_samples

        recording = with_derived_samples(recording)  # once for all formats
    saved: list[SavedFile] = []
    failed: list[str] = []
    for index, (kind, path) in enumerate(paths.items()):
        part = _part_of(progress, index, len(paths)) if progress else None
        try:
            SAVED[kind].load_writer()(recording, path, part)
            saved.append(SavedFile(str(path), kind, size_of(path)))
        except SaveError as error:
            failed.append(str(error))
    if failed:
        rest = f"; saved: {', '.join(file.path for file in saved)}" if saved else ""
        raise PartlySavedError(f"{'; '.join(failed)}; the log is still in memory{rest}", saved)
    return saved


def write_run(
    recording: Recording,
    folder: str | os.PathLike[str],
    logger: str,
    types: Iterable[FileType | str] = (FileType.SILO,),
    name: str | None = None,
    progress: Progress | None = None,
    why: str = "",
    *,
    events: Iterable[LoggedEvent] | LogOfRun,
    conditions: Conditions | None = None,
    damage: Sequence[str] = (),
) -> list[SavedFile]:
    """Save what a run holds as `write` does, with what there is to say of it beside its samples. Raises SaveError.

    `events` are what happened in it, or where that stands; `conditions` its derived signals, limits and triggers as
    they are now, None: as they were when it began; `damage` tells what of it is damaged, or lost.
    """
    recording = replace(
        recording, conditions=conditions or recording.conditions, warnings=(*damage, *recording.warnings)
    )
    if isinstance(events, LogOfRun):
        recording = with_happened(recording, events.folder, events.run)
    else:
        recording = with_events(recording, events)
    return write(told_unknown(recording), folder, logger, types, name, progress, why)


def size_of(path: Path) -> int:
    """Bytes of a file, or of all files in a folder; 0 of what somebody deleted as soon as it was there."""
    try:
        if path.is_dir():
            return sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
        return path.stat().st_size
    except FileNotFoundError:
        return 0


def _paths(folder: Path, logger: str, types: list[FileType], name: str | None, part: int) -> dict[FileType, Path]:
    if name is None:
        now = datetime.now()
        run = next_run_number(folder, logger)
        return {kind: with_part(log_path(folder, logger, run, now, SAVED[kind].ending), part) for kind in types}
    paths = {kind: with_part(custom_path(folder, name, SAVED[kind].ending), part) for kind in types}
    taken = [str(path) for path in paths.values() if path.exists()]
    if taken:
        raise SaveError(f"'{', '.join(taken)}' exists already; remove it or choose another name; nothing was saved")
    return paths


def _part_of(progress: Progress, index: int, count: int) -> Progress:
    def part(fraction: float) -> None:
        progress((index + fraction) / count)

    return part

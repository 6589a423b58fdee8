"""One save: a recording in every format that was asked for, under one run number.

The logger and the helper process call `write`; it knows neither of them. Formats are imported when they are written,
so that saving `.silo` costs no import of what bags need.
"""

import os
from collections.abc import Iterable, Sequence
from datetime import datetime
from pathlib import Path

from silo.errors import SaveError
from silo.files.atomic import reason
from silo.files.naming import ENDINGS, custom_path, log_path, next_run_number
from silo.model import FileType, SavedFile
from silo.recording import Progress, Recording


class PartlySavedError(SaveError):
    """Some formats could not be written; `saved` lists those that were."""

    def __init__(self, message: str, saved: Sequence[SavedFile]) -> None:
        super().__init__(message)
        self.saved = tuple(saved)


def write(
    recording: Recording,
    folder: str | os.PathLike[str],
    logger: str,
    types: Iterable[FileType | str],
    name: str | None = None,
    progress: Progress | None = None,
) -> list[SavedFile]:
    """Save a recording in each of the `types` (`"silo"`, `"csv"`, `"bag"`), in a folder that is made if missing.

    Files are called `<logger>_<date>_<time>_<run number>`, or `name`, which must not be taken yet. If a format fails,
    the others are written all the same, and a `PartlySavedError` (a `SaveError`) says what failed and what was saved.
    `progress` is called with the fraction of the whole, from 0 to 1.
    """
    chosen = _file_types(types)
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SaveError(
            f"can't make the folder '{folder}': {reason(error)}; choose another one; the log is still in memory"
        ) from error
    paths = _paths(Path(folder), logger, chosen, name)
    saved: list[SavedFile] = []
    failed: list[str] = []
    for index, (file_type, path) in enumerate(paths.items()):
        part = _part_of(progress, index, len(paths)) if progress else None
        try:
            _write_one(recording, path, file_type, part)
            saved.append(SavedFile(str(path), file_type, size_of(path)))
        except SaveError as error:
            failed.append(str(error))
    if failed:
        rest = f"; saved: {', '.join(file.path for file in saved)}" if saved else ""
        raise PartlySavedError(f"{'; '.join(failed)}; the log is still in memory{rest}", saved)
    return saved


def size_of(path: Path) -> int:
    """Bytes of a file, or of all files in a folder."""
    if path.is_dir():
        return sum(file.stat().st_size for file in path.rglob("*") if file.is_file())
    return path.stat().st_size


def _file_types(types: Iterable[FileType | str]) -> list[FileType]:
    chosen: list[FileType] = []
    for given in [types] if isinstance(types, str | FileType) else types:
        file_type = _file_type(given)
        if file_type not in chosen:
            chosen.append(file_type)
    if not chosen:
        raise SaveError(f"no file type to save: choose from {_known()}")
    return chosen


def _file_type(given: FileType | str) -> FileType:
    if isinstance(given, FileType):
        return given
    word = given.upper().removeprefix(".")
    if word not in FileType.__members__:
        raise SaveError(f"unknown file type '{given}': choose from {_known()}")
    return FileType[word]


def _known() -> str:
    return ", ".join(file_type.name.lower() for file_type in FileType)


def _paths(folder: Path, logger: str, types: list[FileType], name: str | None) -> dict[FileType, Path]:
    if name is None:
        now = datetime.now()
        run = next_run_number(folder, logger)
        return {file_type: log_path(folder, logger, run, now, ENDINGS[file_type]) for file_type in types}
    paths = {file_type: custom_path(folder, name, ENDINGS[file_type]) for file_type in types}
    taken = [str(path) for path in paths.values() if path.exists()]
    if taken:
        raise SaveError(f"'{', '.join(taken)}' exists already; remove it or choose another name; nothing was saved")
    return paths


def _write_one(recording: Recording, path: Path, file_type: FileType, progress: Progress | None) -> None:
    if file_type is FileType.SILO:
        from silo.files.silo_writer import write_silo

        write_silo(recording, path, progress)
    elif file_type is FileType.CSV:
        from silo.files.csv_file import write_csv

        write_csv(recording, path, progress=progress)
    else:
        from silo.files.bag import write_bag

        write_bag(recording, path, progress)


def _part_of(progress: Progress, index: int, count: int) -> Progress:
    def part(fraction: float) -> None:
        progress((index + fraction) / count)

    return part
